"""One random start of a local solver as a job, and what becomes of it beside the others.

A start's first NLP has only some of the limits. Where it leads to the point of an earlier one, what follows is that
one's. Where only the best start counts, some first NLPs are solved before any is followed, and the best of them is
followed first: another that already ends no better than the best that is proved is given up, for limits at more
instants only raise that optimum. What depends on other starts is decided by whoever takes the answers, in an order of
their own, so that the order of events changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

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
from ocp_traj.solvers.exchange import Exchange, NotWorth
from ocp_traj.transcription.nlp import NLP, NLPResult, Status

LITTLE = 1e-9  # of the best value: what may be gained by less is not waited for; our choice
ONE_POINT = 1e-6  # of the variables' size: our choice, far above the solver's tolerance
OPENINGS = 2  # first NLPs that a problem keeps: of the two solvers of a start
LONGEST = 150  # iterations of a first NLP, after which another start is more likely to lead somewhere; our choice
WAVE = 4  # starts whose first NLPs are solved before the best is followed: our choice


def opened(
    problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array, known: Sequence[Array] = (),
    follow: bool = True, worth: float = np.inf, told: Mapping[str, Any] | None = None,
) -> Answer:  # fmt: skip
    """The job of one start from ``x0 (n,)``; without a solution where it is shared, given up or not yet followed.

    Args:
        problem: what to solve.
        solver: of the start.
        scalarisation: its objectives as one.
        x0: starting point.
        known: where the first NLPs of earlier starts have led ``(n',)`` each.
        follow: whether to go on after the first NLP, however long that takes; without, this process keeps its solution
            for when it is.
        worth: the largest value that is of use.
        told: what was told of the first NLP before, when it was not followed.
    """
    ends, key = _ends(problem), (repr(solver), repr(scalarisation), x0.tobytes())
    if (end := ends.pop(key, None)) is None:
        nlp = _opening(problem, solver, scalarisation, x0)
        chosen = solver.solver if follow else solver.solver.limited(LONGEST)
        end = nlp, chosen.solve(nlp, nlp.start(x0))
    first = end[1]
    told = told or exact({"x": first.x, "f": first.f, "status": first.status.name})
    if not follow and first.ok:
        while len(ends) >= 2 * WAVE:
            del ends[next(iter(ends))]
        ends[key] = end
    if not follow or _like(first, known) is not None:
        return of_opening(told)
    try:
        found = replace(solver, worth=worth).solve(problem, scalarisation, x0, opened=end)
    except NotWorth:
        return of_opening(told)
    return of_start(scalarisation, found, told)


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


def _ends(problem: Problem) -> dict[tuple[str, str, bytes], tuple[NLP, NLPResult]]:
    """First NLPs that were solved and are not yet followed, the last few of them."""
    kept: dict[tuple[str, str, bytes], tuple[NLP, NLPResult]] = problem.cached("ends of openings", dict)
    return kept


def forget_openings(problem: Problem) -> None:
    """Lets go of the first NLPs."""
    _openings(problem).clear()
    _ends(problem).clear()


@dataclass(frozen=True)
class _First:
    """What is remembered of a first NLP's solution."""

    x: Array
    f: float
    status: Status

    @classmethod
    def of(cls, answer: Answer) -> _First:
        """What an answer tells of it."""
        told = answer["first"]
        return cls(np.array([float(value) for value in told["x"]]), float(told["f"]), Status[told["status"]])

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


class StartLine(Protocol):
    """The starts of one solver."""

    @property
    def wave(self) -> int:
        """How many starts are begun before any of them is followed."""

    def begin(self, x0: Array) -> Pending:
        """Submits a start."""

    def ends(self, starts: Sequence[tuple[Array, Pending]]) -> Iterator[list[Solution]]:
        """What each of some starts comes to; nothing of one that is given up."""


@dataclass(eq=False)
class Line:
    """The starts of one solver whose first NLPs are compared.

    Attributes:
        problem, scalarisation, solver: what is solved, and how.
        workers: who solves.
        gives_up: whether only the best counts, so that starts are given up that cannot end better.
        found: given a record of each start.
        best: the least value that is proved; infinite where there is none.
        pairs: what first NLPs have ended with, each with what it led to; one that is given up leads to nothing.
    """

    problem: Problem
    scalarisation: Scalarisation
    solver: Exchange
    workers: Workers
    gives_up: bool
    found: Found
    best: float = np.inf
    pairs: list[tuple[_First, Solution]] = field(default_factory=list)

    @property
    def wave(self) -> int:
        """Several, where they are compared."""
        return WAVE if self.gives_up else 1

    def begin(self, x0: Array) -> Pending:
        """Submits a start, with what is known by now."""
        known = [first.x for first, _ in self.pairs]
        return self._submit(x0, {"follow": False} if self.gives_up else {"known": known})

    def ends(self, starts: Sequence[tuple[Array, Pending]]) -> Iterator[list[Solution]]:
        """The solutions of starts, each its own or a shared one; none where it is given up.

        Where only the best counts, that which begins best is followed first.
        """
        if not self.gives_up:
            for x0, pending in starts:
                yield self._end(x0, pending.result())
            return
        answers = [(x0, pending.result()) for x0, pending in starts]
        firsts = [_First.of(answer) for _, answer in answers]
        for i in sorted(range(len(answers)), key=lambda i: (not firsts[i].ok, firsts[i].f, i)):
            yield self._end(*answers[i])

    def _end(self, x0: Array, answer: Answer) -> list[Solution]:
        first = _First.of(answer)
        same = _like(first, [one.x for one, _ in self.pairs])
        if same is not None:
            solution = self.pairs[same][1]
            return [no_worse_than(self.problem, self.scalarisation, solution, x0) if solution.ok else solution]
        if self.gives_up and self.best < np.inf and (not first.ok or first.f > self._worth):
            return []
        if "solution" not in answer:
            answer = self._submit(x0, {"worth": self._worth, "told": answer["first"]}).result()
        if "solution" not in answer:
            return []
        self.found(answer)
        solution = replace(solution_of(answer["solution"], self.problem), key=answer[KEY])
        if solution.audit is not None and solution.audit.proved:
            self.best = min(self.best, solution.f)
        if first.ok:
            self.pairs.append((first, solution))
        return [solution]

    @property
    def _worth(self) -> float:
        return self.best - LITTLE * abs(self.best) if self.gives_up and self.best < np.inf else np.inf

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
    wave: int = 1

    def begin(self, x0: Array) -> Pending:
        """Submits a start."""
        arguments = {"solver": self.solver, "scalarisation": self.scalarisation, "x0": x0}
        return self.workers.submit(Job(f"ocp_traj.solvers.starts:{self.function}", self.problem, arguments))

    def ends(self, starts: Sequence[tuple[Array, Pending]]) -> Iterator[list[Solution]]:
        """The solution of each."""
        for _, pending in starts:
            answer = pending.result()
            self.found(answer)
            yield [replace(solution_of(answer["solution"], self.problem), key=answer[KEY])]
