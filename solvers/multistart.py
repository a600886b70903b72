"""Many random starts of a local solver, and the best proved solution among them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.parallel.workers import Pending, Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.optima import distinct, with_sampled
from ocp_traj.results.records import Found, ignore
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.elastic_exchange import amounts_to_give
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.feasible_descent import descends
from ocp_traj.solvers.starts import Line, StartLine, WholeLine, forget_openings
from ocp_traj.stopping import STOPS, stopping
from ocp_traj.transcription.nlp import Status

SOLVES = 2  # of each start when all optima are wanted
ROUNDS = 40  # at least: along a flat valley steps are short; our choice


@dataclass(frozen=True)
class Multistart:
    """Runs ``solver`` from ``starts`` random points; start i depends on the seed and i alone, and like points are one.

    Where the problem has a ``warm_start_objective``, a point is first moved to an optimum of that. ``solve`` takes the
    starts in waves, and follows first what begins best. It gives a start up whose first NLP, which has only some of the
    limits, already ends no better than the best that is proved, for limits at more instants only raise that optimum,
    or has no solution where another start is proved. A solver that would leave it for a better one is not waited for;
    ``all_optima`` and ``solve_all`` follow every start to its end.

    Attributes:
        solver: of one start.
        starts: how many.
        seed: of the starting points.
        all_optima: whether the solution lists every distinct local optimum. Each start is then solved twice: as usual,
            which leads across to deep optima, and with a solver that ends in one nearby. The
            first NLP is built once, and where it leads to one point what follows is shared: hundreds of starts are
            affordable.
        progress: told after each start.
        workers: who solves; what is found does not depend on it.
        found: given a record of each start that was followed to its end.
    """

    solver: Exchange = field(default_factory=Exchange)
    starts: int = 1
    seed: int = 0
    all_optima: bool = False
    progress: Progress = silent
    workers: Workers = field(default_factory=Workers)
    found: Found = ignore

    def points(self, problem: Problem) -> list[Array]:
        """The starting points, each once."""
        points = [problem.guess(np.random.default_rng([self.seed, i])) for i in range(self.starts)]
        return list({x.tobytes(): x for x in points}.values())

    def solve_all(self, problem: Problem, scalarisation: Scalarisation) -> list[Solution]:
        """One solution a start, or two with ``all_optima``; Ctrl-C ends it early with those it has, if any."""
        return self._solved(problem, scalarisation, gives_up=False).solutions

    def _lines(
        self, problem: Problem, scalarisation: Scalarisation, points: Sequence[Array], gives_up: bool,
        worth: float = np.inf,
    ) -> list[StartLine]:  # fmt: skip
        """What each start is solved by: one solver, or ``SOLVES`` with ``all_optima``."""
        solver, found = replace(self.solver, progress=silent) if self.workers.count else self.solver, self.found
        if problem.tuning.warm_start_objective not in ("", *scalarisation.names) and not self.all_optima:
            return [WholeLine("warmed", problem, scalarisation, solver, self.workers, found)]
        if descends(problem, scalarisation) and not self.all_optima:  # which begins with no NLP
            return [WholeLine("started", problem, scalarisation, solver, self.workers, found)]
        solvers = [solver]
        if self.all_optima:
            rounds = max(ROUNDS, solver.exchanges(problem))
            solvers.append(replace(solver, solver=solver.solver.near_start(), max_exchanges=rounds))
        gives_up = gives_up and (len(points) > 1 or worth < np.inf)
        return [Line(problem, scalarisation, each, self.workers, gives_up, found, worth) for each in solvers]

    def _solved(
        self, problem: Problem, scalarisation: Scalarisation, gives_up: bool,
        begun: dict[int, list[Pending]] | None = None, beside: Solution | None = None, worth: float = np.inf,
    ) -> _Solved:  # fmt: skip
        solutions: list[Solution] = []
        points = self.points(problem)
        lines = self._lines(problem, scalarisation, points, gives_up, worth)
        done, size = 0, max(line.wave for line in lines)
        begun, known = {} if begun is None else begun, [] if beside is None else [beside]
        with stopping() as stop:
            try:
                for first in range(0, len(points), size):
                    wave = range(first, min(first + size, len(points)))
                    for i in wave:
                        self._begin(points, lines, begun, i)
                    starts = [(points[i], begun.pop(i)) for i in wave]
                    ends = [line.ends([(x0, each[k]) for x0, each in starts]) for k, line in enumerate(lines)]
                    for found in zip(*ends, strict=True):
                        solutions += [solution for one in found for solution in one]
                        done += 1
                        best = best_of([*solutions, *known])
                        self.progress(done, len(points), f"best {best.f:.9g}" if best.ok else best.status.value)
            except STOPS as reason:
                if not solutions and not known:
                    raise
                stop.take(reason)
            finally:
                forget_openings(problem)
            return _Solved(solutions, lines, done, f"after {done} of {len(points)} starts" if stop.tell() else "")

    def _begin(
        self, points: Sequence[Array], lines: Sequence[StartLine], begun: dict[int, list[Pending]], first: int
    ) -> None:
        """Submits a start, and as many after it as workers look ahead, but those that are begun."""
        for j in range(first, min(first + 1 + self.workers.ahead, len(points))):
            if j not in begun:
                begun[j] = [line.begin(points[j]) for line in lines]

    def begin(self, problem: Problem, scalarisation: Scalarisation) -> dict[int, list[Pending]]:
        """Submits the first starts of a ``solve`` that comes later, for workers that have nothing else to do."""
        begun: dict[int, list[Pending]] = {}
        if self.workers.ahead:
            points = self.points(problem)
            self._begin(points, self._lines(problem, scalarisation, points, not self.all_optima), begun, 0)
        return begun

    @one_blas_thread
    def solve(
        self, problem: Problem, scalarisation: Scalarisation, begun: dict[int, list[Pending]] | None = None,
        beside: Solution | None = None, gain: float = 0.0,
    ) -> Solution:  # fmt: skip
        """The best of all starts: proved before unproved, then the smaller value.

        Ctrl-C ends it early with the best so far, whose ``interrupted`` says so; before the first start has ended it
        raises ``KeyboardInterrupt``.

        Args:
            problem: what to solve.
            scalarisation: its objectives as one.
            begun: what ``begin`` has submitted of it.
            beside: a proved solution that is known, the best where no start is.
            gain: by how much a start has to be better than that.
        """
        since = time.perf_counter()
        worth = np.inf if beside is None else beside.f - gain
        solved = self._solved(problem, scalarisation, not self.all_optima, begun, beside, worth)
        solutions, done, interrupted = solved.solutions, solved.done, solved.interrupted
        pairs = [pair for line in solved.lines if isinstance(line, Line) for pair in line.pairs]
        optima = with_sampled(problem, distinct(problem, solutions, SOLVES), pairs) if self.all_optima else ()
        each = SOLVES if self.all_optima else 1
        best = best_of(solutions if beside is None else [*solutions, beside])
        if best.status is Status.LOCALLY_INFEASIBLE and best.conflicts and not interrupted:
            best = replace(best, conflicts=amounts_to_give(problem, scalarisation, best))
        return replace(
            best, seconds=time.perf_counter() - since, optima=optima, starts=done,
            given_up=done - len(solutions) // each, interrupted=interrupted, key="",
        )  # fmt: skip


@dataclass(frozen=True)
class _Solved:
    """What starts have come to.

    Attributes:
        solutions: their own, and those shared by several.
        lines: that have solved them.
        done: how many starts were.
        interrupted: after how many of them Ctrl-C came, if it did.
    """

    solutions: list[Solution]
    lines: Sequence[StartLine]
    done: int
    interrupted: str


def best_of(solutions: Sequence[Solution]) -> Solution:
    """Proved before unproved, usable before failed, then least f.

    Of failures one that has a trajectory comes first, then the nearest of those that say which limits they miss; what
    is infeasible for certain comes last, for it says nothing of the others.
    """
    order = (Status.UNPROVED, Status.LOCALLY_INFEASIBLE)

    def rank(solution: Solution) -> tuple[bool, bool, int, bool, float]:
        proved = solution.audit is not None and solution.audit.proved
        local = solution.status is Status.LOCALLY_INFEASIBLE
        kind = order.index(solution.status) if solution.status in order else len(order)
        value = solution.violation if local else solution.f
        return not proved, not solution.ok, kind, solution.status is Status.INFEASIBLE, value

    return min(solutions, key=rank)
