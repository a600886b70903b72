"""Many random starts of a local solver, and the best proved solution among them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation, WeightedSum
from ocp_traj.progress import Progress, silent
from ocp_traj.results.incumbent import no_worse_than
from ocp_traj.results.optima import distinct, with_sampled
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.elastic_exchange import amounts_to_give
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.feasible_descent import descends
from ocp_traj.stopping import STOPS, stopping
from ocp_traj.transcription.nlp import NLP, NLPResult, Status

_Pair = tuple[NLPResult, Solution]  # of a first NLP, and what it led to

SOLVES = 2  # of each start when all optima are wanted
ROUNDS = 40  # at least: along a flat valley steps are short; our choice
LITTLE = 1e-9  # of the best value: what may be gained by less is not waited for; our choice
ONE_POINT = 1e-6  # of the variables' size: our choice, far above the solver's tolerance


@dataclass(frozen=True)
class Multistart:
    """Runs ``solver`` from ``starts`` random points; start i depends on the seed and i alone, and like points are one.

    Where the problem has a ``warm_start_objective``, a point is first moved to an optimum of that. ``solve`` gives a
    start up whose first NLP, which has only some of the limits, already ends no better than the best that is proved:
    limits at more instants only raise that optimum. A solver that would leave it for a better one is not waited for;
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
    """

    solver: Exchange = field(default_factory=Exchange)
    starts: int = 1
    seed: int = 0
    all_optima: bool = False
    progress: Progress = silent

    def points(self, problem: Problem) -> list[Array]:
        """The starting points, each once."""
        points = [problem.guess(np.random.default_rng([self.seed, i])) for i in range(self.starts)]
        return list({x.tobytes(): x for x in points}.values())

    def solve_all(self, problem: Problem, scalarisation: Scalarisation) -> list[Solution]:
        """One solution a start, or two with ``all_optima``; Ctrl-C ends it early with those it has, if any."""
        return self._solved(problem, scalarisation, [], gives_up=False)[0]

    def _solved(
        self, problem: Problem, scalarisation: Scalarisation, pairs: list[_Pair], gives_up: bool
    ) -> tuple[list[Solution], int, str]:
        """The solutions, of how many starts, and after how many of them Ctrl-C came, if it did."""
        solutions: list[Solution] = []
        points = self.points(problem)
        done = 0
        with stopping() as stop:
            try:
                warm = problem.tuning.warm_start_objective not in ("", *scalarisation.names) and not self.all_optima
                if warm:
                    one_start = self._warm
                elif descends(problem, scalarisation) and not self.all_optima:
                    one_start = self._from_itself
                else:
                    one_start = self._shared(problem, scalarisation, pairs, gives_up)
                for x0 in points:
                    solutions += one_start(problem, scalarisation, x0)
                    done += 1
                    best = best_of(solutions)
                    self.progress(done, len(points), f"best {best.f:.9g}" if best.ok else best.status.value)
            except STOPS as reason:
                if not solutions:
                    raise
                stop.take(reason)
            return solutions, done, f"after {done} of {len(points)} starts" if stop.tell() else ""

    @one_blas_thread
    def solve(self, problem: Problem, scalarisation: Scalarisation) -> Solution:
        """The best of all starts: proved before unproved, then the smaller value.

        Ctrl-C ends it early with the best so far, whose ``interrupted`` says so; before the first start has ended it
        raises ``KeyboardInterrupt``.
        """
        begun = time.perf_counter()
        pairs: list[_Pair] = []
        solutions, done, interrupted = self._solved(problem, scalarisation, pairs, gives_up=not self.all_optima)
        optima = with_sampled(problem, distinct(problem, solutions, SOLVES), pairs) if self.all_optima else ()
        each = SOLVES if self.all_optima else 1
        best = best_of(solutions)
        if best.status is Status.LOCALLY_INFEASIBLE and best.conflicts and not interrupted:
            best = replace(best, conflicts=amounts_to_give(problem, scalarisation, best))
        return replace(
            best, seconds=time.perf_counter() - begun, optima=optima, starts=done,
            given_up=done - len(solutions) // each, interrupted=interrupted,
        )  # fmt: skip

    def _warm(self, problem: Problem, scalarisation: Scalarisation, x0: Array) -> list[Solution]:
        """From the optimum of the objective that is easily found."""
        easiest = problem.tuning.warm_start_objective
        key = "warm start", repr(self.solver), x0.tobytes()
        first = problem.cached(key, lambda: self.solver.solve(problem, WeightedSum({easiest: 1.0}), x0))
        if not first.ok:
            return [self.solver.solve(problem, scalarisation, x0)]
        solution = replace(self.solver, first=first.instants).solve(problem, scalarisation, first.x)
        solution = no_worse_than(problem, scalarisation, solution, x0)
        return [replace(solution, iterations=first.iterations + solution.iterations)]

    def _from_itself(self, problem: Problem, scalarisation: Scalarisation, x0: Array) -> list[Solution]:
        """One solution, of a start whose first NLP is not looked at on its own."""
        return [self.solver.solve(problem, scalarisation, x0)]

    def _shared(
        self, problem: Problem, scalarisation: Scalarisation, pairs: list[_Pair], gives_up: bool
    ) -> Callable[..., list[Solution]]:
        """One solution a start, ``SOLVES`` with ``all_optima``; first NLPs that lead to one point share the rest.

        ``pairs`` collects what each first NLP has led to; one that is given up leads to nothing.
        """
        solvers = [self.solver]
        if self.all_optima:
            rounds = max(ROUNDS, self.solver.exchanges(problem))
            solvers.append(replace(self.solver, solver=self.solver.solver.near_start(), max_exchanges=rounds))
        alike = not problem.chosen_limits  # else what the first NLP holds depends on where it starts
        nlps: list[tuple[Exchange, NLP | None, list[_Pair]]] = [
            (solver, solver.opening(problem, scalarisation, problem.lower) if alike else None, []) for solver in solvers
        ]

        def one(solver: Exchange, shared: NLP | None, known: list[_Pair], x0: Array) -> list[Solution]:
            nlp = solver.opening(problem, scalarisation, x0) if shared is None else shared
            opened = solver.solver.solve(nlp, nlp.start(x0))
            for other, solution in known:
                if opened.ok and np.abs(opened.x - other.x).max() <= ONE_POINT * (1.0 + np.abs(other.x).max()):
                    return [no_worse_than(problem, scalarisation, solution, x0) if solution.ok else solution]
            proved = [solution.f for _, solution in known if solution.audit is not None and solution.audit.proved]
            best = min(proved, default=np.inf)
            if gives_up and opened.status is Status.SOLVED and opened.f > best - LITTLE * abs(best):
                return []
            solution = solver.solve(problem, scalarisation, x0, opened=(nlp, opened))
            if opened.ok:
                known.append((opened, solution))
                pairs.append((opened, solution))
            return [solution]

        return lambda problem, scalarisation, x0: [solution for entry in nlps for solution in one(*entry, x0)]


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
