"""Constraint exchange: few instants, solve, add the instants where a limit is broken between them, solve again.

Blankenship and Falk (1976), JOTA 19(2), with instants that move with the variables: a new instant sits on a peak of
g(x, u), where g_u = 0, and follows it to first order, u(x) = u_i + s (x - x_k) with s = -g_ux / g_uu. That makes the
exchange converge quadratically where instants that stay gain a constant factor a round. It ends when the audit has
proved every limit, so that the solution needs no further check.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.formulation import case
from ocp_traj.formulation.chosen import ChosenLimit, rows_proved_as
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.formulation.rows import Row
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.incumbent import no_worse_than
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import largest_excess, slow_down
from ocp_traj.results.trajectory import audit_points, trajectory_of
from ocp_traj.solvers.feasible_descent import FeasibleDescent, descends
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.protocols import NLPSolver
from ocp_traj.solvers.way_back import WayBack
from ocp_traj.transcription.finite import not_finite
from ocp_traj.transcription.instants import Instant, along, few_instants, few_with, frozen, where
from ocp_traj.transcription.nlp import NLP, NLPResult, Status
from ocp_traj.transcription.symbolic import evaluate_objectives, motion_of, variations
from ocp_traj.transcription.transcription import BACK_OFF, row_of, transcribe
from ocp_traj.transcription.turning_points import turned
from ocp_traj.transcription.worst_instants import near_instants, worst_instants

KEEP = 0.1  # of a limit's scale: rows with more slack than this after the first solve are dropped; our choice
# Distances between bodies change much from one solve to the next: without their rows it would go through what is in the
# way once more.
KEEP_CHOSEN = 1.0
STALLED, NEGLIGIBLE = (
    4.0,
    1e-6,
)  # a round that gains less than this factor on an excess this small: back off; our choice
WARM_ITERATIONS = 40  # a warm start that needs more is none: from a cold one some 25 are enough
STUCK = 0.9  # times the excess of the round before: where hardly less is left, the next may begin elsewhere; our choice
GAINS = 2.0  # a round that reduces the excess by less than this gains too little; our choice
ABOUT = 1e-2  # of a limit's scale: a start's peak this close to its bound is where a neighbour's instant moves: ours
FAR = 0.1  # of a limit's scale: a start that breaks one by more is left for the neighbour that is known; our choice
NEAR = 0.15  # of a segment: a new peak this close to a moving instant replaces it


class NotWorth(Exception):
    """A solve cannot end as well as it would have to."""


@dataclass(frozen=True)
class Exchange:
    """Solves a problem until its trajectory is proved.

    Attributes:
        solver: of the NLPs.
        max_exchanges: solves; as many as the problem asks for if not given.
        back_off: tightening of the limits in the NLP, so that a solution at a limit can be proved to be within it.
        repair: whether to slow an unproved last solution down until it is proved, where the problem allows that.
        first: the first grid; None for ``few_instants``.
        worth: the largest value that is of use. A round that ends above it raises ``NotWorth``, for limits at more
            instants only raise an optimum.
        prove: whether a solution is audited; without, its ``audit`` is None where a scan finds no limit broken, for one
            who proves many together (``audit_points``).
        progress: told of each round.
    """

    solver: NLPSolver = field(default_factory=Ipopt)
    max_exchanges: int | None = case.count(None)
    back_off: float = case.number(BACK_OFF)
    repair: bool = True
    first: Sequence[Instant] | None = None
    worth: float = np.inf
    prove: bool = True
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the numbers."""
        case.check(self)

    def opening(self, problem: Problem, scalarisation: Scalarisation, x0: Array) -> NLP:
        """The NLP of the first round, from ``x0 (n,)``: one for all starts where no limit is chosen at the state."""
        return transcribe(problem, scalarisation, self._first(problem, None, x0), self.back_off)

    def exchanges(self, problem: Problem) -> int:
        """How many rounds a problem gets."""
        return problem.tuning.max_exchanges if self.max_exchanges is None else self.max_exchanges

    def _first(self, problem: Problem, warm: Solution | None, x0: Array) -> list[Instant]:
        given = list(few_instants(problem) if self.first is None else self.first)
        if warm is None:  # slopes of another solution mislead where its multipliers do not come with them
            given = [replace(instant, slope=None, sweep_slope=None) for instant in given]
        return given if self.first is not None else [*given, *near_instants(problem, x0)]

    @one_blas_thread
    def solve(
        self,
        problem: Problem,
        scalarisation: Scalarisation,
        x0: Array,
        warm: Solution | None = None,
        opened: tuple[NLP, NLPResult] | None = None,
    ) -> Solution:
        """Solves from ``x0 (n,)``; never worse than a point that was known before and is proved.

        Args:
            problem: what to solve.
            scalarisation: its objectives as one.
            x0: starting point.
            warm: an earlier solution of this problem, whose multipliers are reused; where it begins, if ``x0`` is far
                from keeping the limits.
            opened: ``opening`` and its solution from ``x0``, where they are known.

        Returns:
            A solution with its trajectory, objectives and audit; ``audit.proved`` says whether the exchange succeeded,
            ``detail`` why it did not. Where the start, a solution of an earlier round or ``warm`` is proved and
            better, that, with what the exchange ended with in ``instead_of``.
        """
        begun = time.perf_counter()
        if warm is None and opened is None and self.first is None and descends(problem, scalarisation):
            descended = FeasibleDescent(problem, scalarisation, self.progress).solve(x0)
            if descended is not None:
                return _tightened(problem, scalarisation, descended)
        proved: list[Solution] = []
        found = self._rounds(problem, scalarisation, x0, warm, opened, proved, begun)
        known = {
            "the solution of an earlier round": proved,
            "the solution it began from": [] if warm is None else [warm],
        }
        found = no_worse_than(problem, scalarisation, found, x0)
        for words, solutions in known.items():
            for one in solutions:
                found = no_worse_than(problem, scalarisation, found, one.x, words)
        return found

    def _rounds(
        self,
        problem: Problem,
        scalarisation: Scalarisation,
        x0: Array,
        warm: Solution | None,
        opened: tuple[NLP, NLPResult] | None,
        proved: list[Solution],
        begun: float,
    ) -> Solution:
        """The rounds; ``proved`` collects those that are, but for total variations that are not yet exact."""
        instants = self._first(problem, warm, x0)
        x, extra, iterations = np.asarray(x0, dtype=float), np.zeros(0), 0
        back_off, before = self.back_off, np.inf
        last: Solution | None = None  # feasible at its instants
        if warm is not None:
            peaks, excess = worst_instants(problem, x, self.back_off, ABOUT)
            if excess > FAR:  # most of a solve would be the way back
                x = np.array(warm.x[: problem.size])
                peaks, _ = worst_instants(problem, x, self.back_off, ABOUT)
            if any(instant.moves for instant in instants):  # a neighbour's, to where its peaks now are
                instants, renamed = _merge(instants, peaks, x, problem, keep=False, add=False)
                warm = _inheriting(warm, renamed)
        excess, most, way_back = np.inf, self.exchanges(problem), WayBack(problem, x)
        for number in range(1, most + 1):
            known, whole = opened if number == 1 else None, number == 1 and (self.first is None or opened is not None)
            nlp = transcribe(problem, scalarisation, instants, back_off) if known is None else known[0]
            start = nlp.start(x)
            follows = any(instant.moves for instant in instants)
            if known is not None:
                result = known[1]
            else:
                solver = self.solver.limited(WARM_ITERATIONS) if follows else self.solver
                result = solver.solve(nlp, start, warm)
            iterations += result.iterations
            if result.status is not Status.SOLVED and (follows or warm is not None):
                # Multipliers, or an instant that races along a flat peak, can mislead: once more without either.
                # With all rows of the first grid, for few of them hold nothing that is far away.
                instants, whole = few_with(problem, instants, x), True
                nlp = transcribe(problem, scalarisation, instants, back_off)
                result = self.solver.solve(nlp, start)
                iterations += result.iterations
            elif result.status is Status.ITERATION_LIMIT and number == 1:
                # The barrier has led away, and there was no way back: a narrow one stays near the start.
                result = self.solver.near_start().solve(nlp, start)
                iterations += result.iterations
            solution = Solution.of(result, iterations=iterations, rounds=number, instants=tuple(instants))
            if not solution.ok:
                solution = replace(solution, seconds=time.perf_counter() - begun)
                break
            if solution.status is Status.SOLVED and solution.f > self.worth:
                raise NotWorth
            x, extra = solution.x[: problem.size], solution.x[problem.size :]
            last = solution
            before, (peaks, excess) = excess, worst_instants(problem, x, self.back_off)
            updated = turned(problem, scalarisation, instants, x, motion_of(problem, x))
            if excess <= 0.0:
                last = solution = _finished(problem, scalarisation, solution, x, begun, prove=self.prove)
                if solution.audit is None or solution.audit.proved:
                    proved.append(solution)
                else:
                    excess, peaks = largest_excess(problem, solution.audit), _unproved(problem, solution)
            self.progress(
                number, most, f"{len(nlp.rows)} rows, {'proved' if excess <= 0.0 else f'excess {excess:.2g}'}"
            )
            if proved and proved[-1] is solution and updated is None:
                if problem.tuning.instants is None:  # a neighbour's solve begins with these
                    solution = replace(solution, instants=tuple(_near(instants, problem, solution)))
                return _tightened(problem, scalarisation, solution) if self.prove else solution
            if before / STALLED < excess < NEGLIGIBLE:
                back_off += 2.0 * excess  # flat peaks wander for ever: stay clear of the limit by what they wander
            instants, back = updated or instants, way_back.after(x, stalled=excess > STUCK * before)
            if whole and back is None and problem.tuning.instants is None:
                instants = _near(instants, problem, solution)
            keep = back is not None or excess > before / GAINS
            instants, renamed = _merge(instants, peaks, x, problem, keep=keep)
            warm = _inheriting(solution, renamed)
            if back is not None:
                instants, x, warm = [frozen(instant, x) for instant in instants], back, None
        if last is not None and last.audit is None:
            last = _finished(problem, scalarisation, last, x, begun)
        if proved:
            return _tightened(problem, scalarisation, replace(proved[-1], seconds=time.perf_counter() - begun))
        if self.repair and last is not None:
            last = _mended(problem, scalarisation, last, extra, self.solver.feasibility)
        if last is not None and last.audit is not None and last.audit.proved:
            return _tightened(problem, scalarisation, replace(last, seconds=time.perf_counter() - begun))
        # Infeasible on the way is an answer, with the limits in conflict; else there is a point, but no proof of it.
        if solution.ok:
            gain = "the exchange has stalled" if excess > before / GAINS else "the last one still gained"
            why = f"all {most} rounds are used up, {gain}" if most > 1 else "the one round is used up"
        else:
            why = f"round {number} of {most} found no point: {solution.status.value}, {solution.detail}"
            if solution.status is Status.FAILED:
                names = (*scalarisation.names, *problem.tuning.regularisation)
                why = "; ".join(filter(None, (why, not_finite(problem, names, instants, x))))
        if solution.status is Status.LOCALLY_INFEASIBLE or last is None:
            return replace(solution, detail=why)
        assert last.audit is not None
        row = last.audit.failures[0]
        off = f"{row.limit} {row.label} is {row.verdict}, {abs(row.attained - row.bound):.3g} {row.unit} from its bound"
        return replace(
            last,
            status=Status.UNPROVED,
            seconds=time.perf_counter() - begun,
            detail=f"{why}; {off} at t = {row.instant:.6g} s; its last solve ended with {last.detail}",
        )


def _unproved(problem: Problem, solution: Solution) -> list[Instant]:
    """Instants where a proof failed though a scan has found no limit broken: they stay where they are."""
    assert solution.audit is not None and solution.trajectory is not None
    limits = {limit.id: limit for limit in problem.path_limits}
    knots, found = solution.trajectory.curve.knots, []
    for row in (row for row in solution.audit.failures if row.limit in limits):
        k = int(np.clip(np.searchsorted(knots, row.instant, side="right") - 1, 0, len(knots) - 2))
        u = float(np.clip((row.instant - knots[k]) / (knots[k + 1] - knots[k]), 0.0, 1.0))
        rows = rows_proved_as(limits[row.limit], row.label)
        found.append(Instant(row.limit, k, u, rows, sweep=row.sweep or 0.0))
    return found


def _mended(
    problem: Problem, scalarisation: Scalarisation, solution: Solution, extra: Array, feasibility: float
) -> Solution:
    """The solution slowed down until it is proved, if that can be done within the bounds on its objectives."""
    assert solution.audit is not None
    (mended,), (found,) = slow_down(problem, [solution.x], [solution.audit])
    known = {limit.id for limit in problem.path_limits}
    nlp = transcribe(problem, scalarisation, [i for i in solution.instants if i.limit not in known])
    point = nlp.start(mended)
    point[problem.size : problem.size + nlp.labels.count("gamma")] = extra[: nlp.labels.count("gamma")]
    f, g = nlp.program.values(point)
    violation = nlp.violation(point, g)
    if not found.proved or not violation <= feasibility:
        return solution
    slowed = replace(
        solution,
        f=f,
        status=Status.FEASIBLE,
        violation=violation,
        multipliers={},
        slacks={},
        detail="slowed down until every limit was proved",
    )
    return _finished(problem, scalarisation, slowed, mended, time.perf_counter(), found)


def _tightened(problem: Problem, scalarisation: Scalarisation, solution: Solution) -> Solution:
    """The solution with the slacks of its objectives at what its curve really has, where that is proved as well."""
    if problem.tighten_slacks is None:
        return solution
    found = _finished(problem, scalarisation, solution, problem.tighten_slacks(solution.x), time.perf_counter())
    proved = found.audit is not None and found.audit.proved
    return replace(found, seconds=solution.seconds) if proved else solution


def _finished(
    problem: Problem,
    scalarisation: Scalarisation,
    solution: Solution,
    x: Array,
    begun: float,
    checked: Audit | None = None,
    prove: bool = True,
) -> Solution:
    """A solution with its trajectory, objectives and audit, which is made if it is not given and wanted."""
    proves = checked is None and prove
    candidate, found = audit_points(problem, [x])[0] if proves else (trajectory_of(problem, x), checked)
    objectives = evaluate_objectives(problem, x)
    # The NLP's sum of steps may fall short of a total variation, and traces are not what is asked for.
    if variations(problem, scalarisation.names) or problem.tuning.regularisation:
        exact = scalarisation.apply(problem, objectives)
        solution = replace(solution, f=float(exact.f)) if exact.extra is None else solution
    return replace(
        solution,
        x=x,
        trajectory=candidate,
        audit=found,
        objectives=objectives,
        seconds=time.perf_counter() - begun,
    )


def _near(instants: list[Instant], problem: Problem, solution: Solution) -> list[Instant]:
    """The instants and rows close to their bounds; others only cost time, and return as peaks should they matter."""
    kept = []
    known = {limit.id for limit in problem.path_limits}
    for instant in instants:
        if instant.limit not in known or instant.control is not None:  # of a total variation, or one of all that hold
            kept.append(instant)
            continue
        limit = _limit(problem, instant)
        rows = range(len(limit.labels)) if instant.rows is None else instant.rows
        keep = KEEP_CHOSEN if isinstance(limit, ChosenLimit) else KEEP
        near = tuple(i for i in rows if solution.slacks[row_of(limit, instant, i)] < keep)
        if near:
            kept.append(replace(instant, rows=near))
    return kept


def _merge(
    instants: list[Instant], peaks: list[Instant], x: Array, problem: Problem, *, keep: bool, add: bool = True
) -> tuple[list[Instant], dict[Row, Row]]:
    """Adds peaks to the grid, if wanted; one close to an instant that moves replaces it, and inherits its multiplier.

    Where replacing them gains too little the rounds may go in a circle: ``keep`` leaves the old ones where they
    were put.
    """
    merged, renamed = list(instants), {}
    alike: dict[tuple[Any, ...], list[int]] = {}
    for i, old in enumerate(merged):
        alike.setdefault((old.limit, old.segment, old.rows), []).append(i)
    for peak in peaks:
        places = alike.setdefault((peak.limit, peak.segment, peak.rows), [])
        for i in places:
            old = merged[i]
            if old.anchor is None:
                continue
            if abs(where(old, x) - peak.u) < NEAR and abs(along(old, x) - peak.sweep) < NEAR:
                limit, row = _limit(problem, peak), (peak.rows or (0,))[0]
                renamed[row_of(limit, peak, row)] = row_of(limit, old, row)
                merged[i] = peak
                if keep:
                    merged.append(replace(old, slope=None, anchor=None))
                break
        else:
            if add:
                places.append(len(merged))
                merged.append(peak)
    return merged, renamed


def _inheriting(solution: Solution, renamed: Mapping[Row, Row]) -> Solution:
    """A solution with the multipliers of rows for those that replace them."""
    inherited = {new: solution.multipliers.get(old, 0.0) for new, old in renamed.items()}
    return replace(solution, multipliers={**solution.multipliers, **inherited})


def _limit(problem: Problem, instant: Instant) -> PathConstraint:
    return next(c for c in problem.path_limits if c.id == instant.limit)
