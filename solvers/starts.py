"""One random start of a local solver as a job, and what becomes of it beside the starts before it.

A start's first NLP has only some of the limits. Where it leads to the point of an earlier one, what follows is that
one's; where it already ends no better than the best that is proved, it is given up, for limits at more instants only
raise that optimum. Both depend on the starts before alone. A job that is begun before those have ended knows less and
does more; whoever takes its answer decides with all that it has to know, so that the order of events changes nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation, WeightedSum
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.workers import Pending, Workers
from ocp_traj.progress import silent
from ocp_traj.results.incumbent import no_worse_than
from ocp_traj.results.records import KEY, Found, of_opening, of_start
from ocp_traj.results.solution import Solution
from ocp_traj.results.solution_records import exact, solution_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.transcription.nlp import NLP, NLPResult, Status

LITTLE = 1e-9  # of the best value: what may be gained by less is not waited for; our choice
ONE_POINT = 1e-6  # of the variables' size: our choice, far above the solver's tolerance
OPENINGS = 2  # first NLPs that a problem keeps: of the two solvers of a start


def opened(
    problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array, known: Sequence[Array] = (),
    best: float | None = None,
) -> Answer:  # fmt: skip
    """The job of one start from ``x0 (n,)``; without a solution where it is shared or given up.

    Args:
        problem: what to solve.
        solver: of the start.
        scalarisation: its objectives as one.
        x0: starting point.
        known: where the first NLPs of earlier starts have led ``(n',)`` each.
        best: the least value that is proved, to give up by; None for not at all.
    """
    nlp = _opening(problem, solver, scalarisation, x0)
    first = solver.solver.solve(nlp, nlp.start(x0))
    told = exact({"x": first.x, "f": first.f, "status": first.status.name})
    if _like(first, known) is not None or _hopeless(first, best):
        return of_opening(told)
    return of_start(scalarisation, solver.solve(problem, scalarisation, x0, opened=(nlp, first)), told)


def warmed(problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array) -> Answer:
    """The job of one start from the optimum of the problem's objective that is easily found."""
    easiest = problem.tuning.warm_start_objective
    key = "warm start", repr(solver), x0.tobytes()
    first = problem.cached(key, lambda: solver.solve(problem, WeightedSum({easiest: 1.0}), x0))
    if not first.ok:
        return of_start(scalarisation, solver.solve(problem, scalarisation, x0))
    solution = replace(solver, first=first.instants).solve(problem, scalarisation, first.x)
    solution = no_worse_than(problem, scalarisation, solution, x0)
    return of_start(scalarisation, replace(solution, iterations=first.iterations + solution.iterations))


def started(problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array) -> Answer:
    """The job of one solve from ``x0 (n,)`` that leads to another one."""
    return of_start(scalarisation, solver.solve(problem, scalarisation, x0))


def solved_from(
    problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array, workers: Workers, found: Found
) -> Solution:
    """The solution of ``started``."""
    if workers.count:
        solver = replace(solver, progress=silent)
    arguments = {"solver": solver, "scalarisation": scalarisation, "x0": x0}
    answer = workers.submit(Job("ocp_traj.solvers.starts:started", problem, arguments)).result()
    found(answer)
    return replace(solution_of(answer["solution"], problem), key=answer[KEY])


def _opening(problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array) -> NLP:
    """The first NLP: built once, but where what it holds depends on where it starts."""
    if problem.chosen_limits:
        return solver.opening(problem, scalarisation, x0)
    kept, key = _openings(problem), (repr(solver), repr(scalarisation))
    if key not in kept:
        while len(kept) >= OPENINGS:
            del kept[next(iter(kept))]
        kept[key] = solver.opening(problem, scalarisation, problem.lower)
    return kept[key]


def _openings(problem: Problem) -> dict[tuple[str, str], NLP]:
    kept: dict[tuple[str, str], NLP] = problem.cached("openings", dict)
    return kept


def forget_openings(problem: Problem) -> None:
    """Lets go of the first NLPs."""
    _openings(problem).clear()


@dataclass(frozen=True)
class _First:
    """What is remembered of a first NLP's solution."""

    x: Array
    f: float
    status: Status

    @property
    def ok(self) -> bool:
        return self.status.ok


def _like(first: NLPResult | _First, known: Sequence[Array]) -> int | None:
    """Which of some points a first NLP has led to."""
    if not first.ok:
        return None
    for i, x in enumerate(known):
        if np.abs(first.x - x).max() <= ONE_POINT * (1.0 + np.abs(x).max()):
            return i
    return None


def _hopeless(first: NLPResult | _First, best: float | None) -> bool:
    return best is not None and first.status is Status.SOLVED and first.f > best - LITTLE * abs(best)


@dataclass(eq=False)
class Line:
    """The starts of one solver, in their order.

    Attributes:
        problem, scalarisation, solver: what is solved, and how.
        workers: who solves.
        gives_up: whether starts are given up that cannot end better than the best.
        found: given a record of each start.
        pairs: what first NLPs have ended with, each with what it led to; one that is given up leads to nothing.
    """

    problem: Problem
    scalarisation: Scalarisation
    solver: Exchange
    workers: Workers
    gives_up: bool
    found: Found
    pairs: list[tuple[_First, Solution]] = field(default_factory=list)

    def begin(self, x0: Array) -> Pending:
        """Submits a start, with what is known by now."""
        return self._submit(x0, {"known": [first.x for first, _ in self.pairs], "best": self._best})

    def end(self, x0: Array, pending: Pending) -> list[Solution]:
        """The solution of a start, its own or a shared one; none where it is given up."""
        answer = pending.result()
        told = answer["first"]
        first = _First(np.array([float(value) for value in told["x"]]), float(told["f"]), Status[told["status"]])
        same = _like(first, [one.x for one, _ in self.pairs])
        if same is not None:
            solution = self.pairs[same][1]
            return [no_worse_than(self.problem, self.scalarisation, solution, x0) if solution.ok else solution]
        if _hopeless(first, self._best):
            return []
        if "solution" not in answer:  # found where more starts were given up than here
            answer = self._submit(x0, {}).result()
        self.found(answer)
        solution = replace(solution_of(answer["solution"], self.problem), key=answer[KEY])
        if first.ok:
            self.pairs.append((first, solution))
        return [solution]

    @property
    def _best(self) -> float | None:
        proved = [solution.f for _, solution in self.pairs if solution.audit is not None and solution.audit.proved]
        return min(proved) if self.gives_up and proved else None

    def _submit(self, x0: Array, hints: dict[str, object]) -> Pending:
        arguments = {"solver": self.solver, "scalarisation": self.scalarisation, "x0": x0}
        return self.workers.submit(Job("ocp_traj.solvers.starts:opened", self.problem, arguments, hints))


@dataclass(frozen=True, eq=False)
class WholeLine:
    """Starts that have nothing to do with each other: jobs of ``function``, ``warmed`` or ``started``."""

    function: str
    problem: Problem
    scalarisation: Scalarisation
    solver: Exchange
    workers: Workers
    found: Found

    def begin(self, x0: Array) -> Pending:
        """Submits a start."""
        arguments = {"solver": self.solver, "scalarisation": self.scalarisation, "x0": x0}
        return self.workers.submit(Job(f"ocp_traj.solvers.starts:{self.function}", self.problem, arguments))

    def end(self, x0: Array, pending: Pending) -> list[Solution]:
        """Its solution."""
        answer = pending.result()
        self.found(answer)
        return [replace(solution_of(answer["solution"], self.problem), key=answer[KEY])]
