"""Solves of one problem as jobs of workers: begun ahead or in waves, counted, told of, and proved together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.workers import Pending, Workers
from ocp_traj.progress import silent
from ocp_traj.results.records import KEY, Found, Record, ignore, of_opening, of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.results.solution_records import of_solution, solution_of
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.exchange import Exchange, NotWorth
from ocp_traj.solvers.multistart import best_of
from ocp_traj.solvers.starts import LONGEST
from ocp_traj.transcription.instants import few_with
from ocp_traj.transcription.nlp import Status

SOLVE, SECOND = "ocp_traj.solvers.waves:solved", "ocp_traj.solvers.waves:second"
# Solves that are chosen before any of them is done, whoever solves: as many workers have work, and the next four know
# of these. Our choice.
WAVE = 4
# Solutions that wait to be proved, and their iterations times rows, some 2 s of work, after which they are: our choice.
# With the clock the front would depend on the machine.
TOGETHER, PATIENCE = 8, 2e5
GAIN = 1e-6  # of the value that is known: by less a second solve is not followed; our choice


def solved(
    problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array, warm: Record | None = None
) -> Answer:
    """The job of one solve from ``x0 (n,)``: a record of it, its limits at the instants of an earlier one if given."""
    known = None
    if warm is not None:
        known = solution_of(warm["solution"], problem, trajectory=False)
        solver = replace(solver, first=known.instants)
    return of_solve(scalarisation, solver.solve(problem, scalarisation, x0, known))


def second(problem: Problem, solver: Exchange, scalarisation: Scalarisation, x0: Array, beside: Record) -> Answer:
    """The job of a solve from ``x0 (n,)`` beside one that is proved: followed where its first NLP ends better.

    That has the limits at the instants of the other one too, so that it seldom ends below the same optimum.
    """
    known = solution_of(beside["solution"], problem, trajectory=False)
    solver = replace(solver, first=few_with(problem, known.instants, known.x))
    nlp = solver.opening(problem, scalarisation, x0)
    result = solver.solver.limited(LONGEST).solve(nlp, nlp.start(x0))
    worth = known.f - GAIN * abs(known.f)
    if result.status is Status.SOLVED and result.f < worth:
        with suppress(NotWorth):
            solver = replace(solver, worth=worth)
            return of_solve(scalarisation, solver.solve(problem, scalarisation, x0, opened=(nlp, result)))
    return of_opening({"f": float(result.f), "status": result.status.name, "iterations": result.iterations})


@dataclass(frozen=True, eq=False)
class Request:
    """A solve that is asked for.

    Attributes:
        scalarisation: what is minimised.
        x0: where it begins ``(n,)``.
        warm: a neighbour's solution, whose instants and multipliers it begins with.
        prove: whether it is proved by whoever solves it, and not together with others.
        fallbacks: where to begin once more, with all instants, until one ends well: starting points ``(n,)``.
        others: where to begin once more, followed where that may be better, or the first has found nothing.
    """

    scalarisation: Scalarisation
    x0: Array
    warm: Solution | None = None
    prove: bool = False
    fallbacks: Sequence[Array] = ()
    others: Sequence[Array] = field(default=())


class Solves:
    """What is asked of one problem by one method: everything is counted and told of, whoever solves it.

    Attributes:
        problem, solver: what is solved, and how.
        workers: who solves.
        found: given a record of each solve, once it is proved.
        solves, iterations, failed: counts so far.
    """

    def __init__(self, problem: Problem, solver: Exchange, workers: Workers, found: Found = ignore) -> None:
        self.problem, self.workers, self.found = problem, workers, found
        self.solver = replace(solver, progress=silent)
        self.solves = self.iterations = self.failed = 0
        self._told = WeakKeyDictionary[Solution, Record]()  # what a worker has said of one need not be written again
        self._waiting: list[tuple[Scalarisation, Solution, Callable[[Solution, Solution], None]]] = []

    def begin(self, request: Request) -> Begun:
        """Submits a request, whose solution is taken later, or never."""
        solver = replace(self.solver, prove=request.prove)
        first = self._submit(request.scalarisation, request.x0, solver, request.warm)
        return Begun(request, first)

    def take(self, begun: Begun, replaced: Callable[[Solution, Solution], None] | None = None) -> Solution:
        """The solution of a request that was begun: the best of its solves.

        Where it is not yet proved, it waits for ``prove``, which calls ``replaced(it, the one that is proved)``.
        """
        request = begun.request
        solution = self._solution(begun.first)
        if solution.audit is None and solution.ok and replaced is not None:
            self._waiting.append((request.scalarisation, solution, replaced))
        else:
            self.count(request.scalarisation, solution)
        own = solution.own.ok
        solution = best_of([solution, *self._seconds(request.scalarisation, request.others, solution)])
        for x in [] if own else request.fallbacks:
            again = self._solution(self._submit(request.scalarisation, x, self.solver))
            self.count(request.scalarisation, again)
            solution = best_of([solution, again])
            if solution.own.ok:
                break
        return solution

    def _seconds(self, scalarisation: Scalarisation, starts: Sequence[Array], known: Solution) -> list[Solution]:
        """What other starts ``(n,)`` lead to, beside a solution; where that is proved, if it may be better."""
        arguments = {"solver": self.solver, "scalarisation": scalarisation}
        if known.audit is None or not known.audit.proved:
            pending = [self._submit(scalarisation, x, self.solver) for x in starts]
        else:
            arguments["beside"] = self._record(known)
            pending = [self.workers.submit(Job(SECOND, self.problem, {**arguments, "x0": x})) for x in starts]
        found = []
        for one in pending:
            answer = one.result()
            if "solution" in answer:
                found.append(self._taken(answer))
                self.count(scalarisation, found[-1])
            else:
                self.found(answer)
                self.iterations += answer["first"]["iterations"]
        return found

    def prove_many(self) -> None:
        """Proves what waits for it where that is much, so that little is lost with a run that is killed."""
        waiting = [solution for _, solution, _ in self._waiting]
        if len(waiting) >= TOGETHER or sum(one.iterations * one.row_count for one in waiting) > PATIENCE:
            self.prove()

    def prove(self, again: bool = True) -> None:
        """Proves what waits for it, together; what fails goes back to exchange, or is not ok where time is over."""
        waiting, self._waiting = self._waiting, []
        for (scalar, found, replaced), proved in zip(
            waiting, self._proved([(scalar, found) for scalar, found, _ in waiting], again), strict=True
        ):
            self.count(scalar, proved, found if proved.key == found.key else None)
            replaced(found, proved)

    def solve_wave(self, requests: Sequence[Request]) -> list[Solution]:
        """The solutions of requests that do not depend on each other, in their order, each proved where it is ok."""
        begun = [self.begin(request) for request in requests]
        final: dict[int, Solution] = {}

        def replaced(one: Solution, other: Solution) -> None:
            final[id(one)] = other

        solutions = [self.take(one, replaced) for one in begun]
        self.prove()
        return [final.get(id(solution), solution) for solution in solutions]

    def again(self, request: Request, longest: int | None = None) -> Solution:
        """The solution of one request that is proved by whoever solves it, its NLPs in so many iterations each."""
        solver = self.solver if longest is None else replace(self.solver, solver=self.solver.solver.limited(longest))
        solution = self._solution(self._submit(request.scalarisation, request.x0, solver, request.warm))
        self.count(request.scalarisation, solution)
        return solution

    @property
    def words(self) -> str:
        """How many solves are done, how many of them have failed, and how many workers are busy."""
        found = f"{self.solves} solves, {self.failed} failed"
        if self.workers.count:
            found += f", {self.workers.busy} of {self.workers.count} workers busy"
        return found

    def count(self, scalarisation: Scalarisation, solution: Solution, as_found: Solution | None = None) -> None:
        """Counts a solve, and tells of it, as its job has found it where it was proved later."""
        if self.found is not ignore:
            self.found(of_solve(scalarisation, solution, as_found))
        self.solves += 1
        self.iterations += solution.iterations
        self.failed += not solution.ok

    def _proved(self, pairs: Sequence[tuple[Scalarisation, Solution]], again: bool) -> list[Solution]:
        audited = audit_points(self.problem, [solution.x for _, solution in pairs])
        proved = []
        for (scalar, found), (path, audit) in zip(pairs, audited, strict=True):
            if audit.proved:
                proved.append(replace(found, trajectory=path, audit=audit))
                if found in self._told:
                    self._told[proved[-1]] = self._told[found]
            elif again:
                proved.append(self._solution(self._submit(scalar, found.x, self.solver, found)))
            else:
                proved.append(replace(found, status=Status.UNPROVED, trajectory=path, audit=audit))
        return proved

    def _submit(
        self, scalarisation: Scalarisation, x0: Array, solver: Exchange, warm: Solution | None = None
    ) -> Pending:
        arguments = {"solver": solver, "scalarisation": scalarisation, "x0": x0}
        if warm is not None:
            arguments["warm"] = self._record(warm)
        return self.workers.submit(Job(SOLVE, self.problem, arguments))

    def _record(self, known: Solution) -> Record:
        """A solution as a job takes it."""
        told = self._told.get(known)
        return {
            "solution": of_solution(known) if told is None else told, **({KEY: known.key} if known.key else {})
        }  # fmt: skip

    def _solution(self, pending: Pending) -> Solution:
        return self._taken(pending.result())

    def _taken(self, answer: Answer) -> Solution:
        solution = replace(solution_of(answer["solution"], self.problem), key=answer[KEY])
        self._told[solution] = answer["solution"]
        return solution


@dataclass(frozen=True, eq=False)
class Begun:
    """A request whose first solve was submitted."""

    request: Request
    first: Pending
