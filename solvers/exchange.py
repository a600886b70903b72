"""Constraint exchange: few instants, solve, add the instants where a limit is broken between them, solve again.

Blankenship and Falk (1976), JOTA 19(2), with instants that move with the variables: a new instant sits on a peak of
g(x, u), where g_u = 0, and follows it to first order, u(x) = u_i + s (x - x_k) with s = -g_ux / g_uu. That makes the
exchange converge quadratically where instants that stay gain a constant factor a round. It ends when the audit has
proved every limit, so that the solution needs no further check.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.evaluate import limit_on
from ocp_traj.nlp import NLP, Row, Solution, Status
from ocp_traj.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.provenance import audit_points
from ocp_traj.requirements import PathConstraint
from ocp_traj.scalarise import Scalarisation
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.peaks import along, frozen, moving, peak_function, where
from ocp_traj.solvers.repair import largest_excess, slow_down
from ocp_traj.solvers.swept_peaks import sharpened_sweep, swept_peaks
from ocp_traj.solvers.turning import turned
from ocp_traj.symbolic import evaluate_objectives, variations
from ocp_traj.trajectory import Trajectory
from ocp_traj.transcription import BACK_OFF, Instant, few_instants, trajectory, transcribe
from ocp_traj.verdicts import Audit

Array = NDArray[np.float64]

SCAN = 48  # samples a segment when looking for peaks: our choice, far denser than the degrees in use have peaks
FINE = 33  # samples about a sample that stands out, from one neighbour to the other: our choice
KEEP = 0.1  # of a limit's scale: rows with more slack than this after the first solve are dropped; our choice
STALLED, NEGLIGIBLE = (
    4.0,
    1e-6,
)  # a round that gains less than this factor on an excess this small: back off; our choice
WARM_ITERATIONS = 80  # a warm start that needs more is none
GAINS = 2.0  # a round that reduces the excess by less than this gains too little; our choice
NEAR = 0.15  # of a segment: a new peak this close to a moving instant replaces it


@dataclass(frozen=True)
class Exchange:
    """Solves a problem until its trajectory is proved.

    Attributes:
        solver: of the NLPs.
        max_rounds: solves; as many as the problem asks for if not given.
        back_off: tightening of the limits in the NLP, so that a solution at a limit can be proved to be within it.
        repair: whether to slow an unproved last solution down until it is proved, where the problem allows that.
        first: the first grid; None for ``few_instants``.
        progress: told of each round.
    """

    solver: Ipopt = field(default_factory=Ipopt)
    max_rounds: int | None = None
    back_off: float = BACK_OFF
    repair: bool = True
    first: Sequence[Instant] | None = None
    progress: Progress = silent

    def opening(self, problem: Problem, scalarisation: Scalarisation) -> NLP:
        """The NLP of the first round."""
        return transcribe(problem, scalarisation, self._first(problem), self.back_off)

    def rounds(self, problem: Problem) -> int:
        """How many rounds a problem gets."""
        return problem.rounds if self.max_rounds is None else self.max_rounds

    def _first(self, problem: Problem) -> list[Instant]:
        # Slopes of another solution mislead.
        given = [replace(instant, slope=None, sweep_slope=None) for instant in self.first or ()]
        return given or list(few_instants(problem))

    def solve(
        self,
        problem: Problem,
        scalarisation: Scalarisation,
        x0: Array,
        warm: Solution | None = None,
        opened: Solution | None = None,
    ) -> Solution:
        """Solves from ``x0 (n,)``.

        Args:
            problem: what to solve.
            scalarisation: its objectives as one.
            x0: starting point.
            warm: an earlier solution of this problem, whose multipliers are reused.
            opened: solution of ``opening``, where it is known.

        Returns:
            A solution with its trajectory, objectives and audit; ``audit.proved`` says whether the exchange succeeded.
        """
        begun = time.perf_counter()
        instants = self._first(problem)
        x, extra, iterations = np.asarray(x0, dtype=float), np.zeros(0), 0
        back_off, excess = self.back_off, np.inf
        last: Solution | None = None  # feasible at its instants
        proved: Solution | None = None  # the last that is proved, its total variations not yet exact
        most = self.rounds(problem)
        for number in range(1, most + 1):
            nlp = transcribe(problem, scalarisation, instants, back_off)
            start = nlp.start(x)
            follows = any(instant.moves for instant in instants)
            limit = min(self.solver.max_iter, WARM_ITERATIONS) if follows else self.solver.max_iter
            if number == 1 and opened is not None:
                solution = opened
            else:
                solution = replace(self.solver, max_iter=limit).solve(nlp, start, warm)
            iterations += solution.iterations
            if solution.status is not Status.SOLVED and (follows or warm is not None):
                # Multipliers, or an instant that races along a flat peak, can mislead: once more without either.
                instants = [frozen(instant, x) for instant in instants]
                nlp = transcribe(problem, scalarisation, instants, back_off)
                solution = self.solver.solve(nlp, start)
                iterations += solution.iterations
            solution = replace(solution, iterations=iterations, rounds=number, instants=tuple(instants))
            if not solution.ok:
                solution = replace(solution, seconds=time.perf_counter() - begun)
                break
            x, extra = solution.x[: problem.size], solution.x[problem.size :]
            last = solution = _finished(problem, scalarisation, solution, x, begun)
            assert solution.audit is not None and solution.trajectory is not None
            self.progress(number, most, f"{len(nlp.rows)} rows, {solution.audit.verdict}")
            updated = turned(problem, scalarisation, instants, solution.trajectory)
            if solution.audit.proved:
                proved = solution
                if updated is None:
                    return _settled(problem, scalarisation, solution)
            before, excess = excess, largest_excess(problem, solution.audit)
            if before / STALLED < excess < NEGLIGIBLE:
                back_off += 2.0 * excess  # flat peaks wander for ever: stay clear of the limit by what they wander
            peaks = worst_instants(problem, solution.trajectory, solution.audit, self.back_off)
            instants = updated or instants
            if number == 1 and self.first is None and problem.instants is None:
                instants = _near(instants, problem, solution)
            instants, renamed = _merge(instants, peaks, x, problem, keep=excess > before / GAINS)
            inherited = {new: solution.multipliers.get(old, 0.0) for new, old in renamed.items()}
            warm = replace(solution, multipliers={**solution.multipliers, **inherited})
        if proved is not None:
            return _settled(problem, scalarisation, replace(proved, seconds=time.perf_counter() - begun))
        if self.repair and last is not None:
            last = _mended(problem, scalarisation, last, extra, self.solver.feasibility)
        if last is not None and last.audit is not None and last.audit.proved:
            return _settled(problem, scalarisation, replace(last, seconds=time.perf_counter() - begun))
        # Infeasible on the way is an answer, with the limits in conflict; else there is a point, but no proof of it.
        if solution.status is Status.INFEASIBLE or last is None:
            return solution
        return replace(last, status=Status.UNPROVED, seconds=time.perf_counter() - begun)


def _mended(
    problem: Problem, scalarisation: Scalarisation, solution: Solution, extra: Array, feasibility: float
) -> Solution:
    """The solution slowed down until it is proved, if that can be done within the bounds on its objectives."""
    assert solution.audit is not None
    (mended,), (found,) = slow_down(problem, [solution.x], [solution.audit])
    known = {limit.id for limit in problem.requirements.path_constraints}
    nlp = transcribe(problem, scalarisation, [i for i in solution.instants if i.limit not in known])
    point = nlp.start(mended)
    point[problem.size : problem.size + nlp.labels.count("gamma")] = extra[: nlp.labels.count("gamma")]
    f, g = (np.array(v).ravel() for v in casadi.Function("value", [nlp.x], [nlp.f, nlp.g])(point))
    violation = nlp.violation(point, g)
    if not found.proved or not violation <= feasibility:
        return solution
    slowed = replace(
        solution,
        f=float(f[0]),
        status=Status.FEASIBLE,
        violation=violation,
        multipliers={},
        slacks={},
        detail="slowed down until every limit was proved",
    )
    return _finished(problem, scalarisation, slowed, mended, time.perf_counter(), found)


def _settled(problem: Problem, scalarisation: Scalarisation, solution: Solution) -> Solution:
    """The solution with its auxiliary variables at what its curve really has, where that is proved as well."""
    if problem.settle is None:
        return solution
    found = _finished(problem, scalarisation, solution, problem.settle(solution.x), time.perf_counter())
    proved = found.audit is not None and found.audit.proved
    return replace(found, seconds=solution.seconds) if proved else solution


def _finished(
    problem: Problem,
    scalarisation: Scalarisation,
    solution: Solution,
    x: Array,
    begun: float,
    checked: Audit | None = None,
) -> Solution:
    """A solution with its trajectory, objectives and audit."""
    candidate, found = (trajectory(problem, x), checked) if checked else audit_points(problem, [x])[0]
    objectives = evaluate_objectives(problem, x)
    # The NLP's sum of steps may fall short of a total variation, and traces are not what is asked for.
    if variations(problem, scalarisation.names) or problem.regularisation:
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


def worst_instants(
    problem: Problem, candidate: Trajectory, checked: Audit, back_off: float = BACK_OFF
) -> list[Instant]:
    """The peaks at which a trajectory breaks its limits, each as an instant that moves with the variables."""
    failing = {row.limit for row in checked.failures}
    x = np.concatenate(list(candidate.variables.values()))
    found: list[Instant] = []
    for limit in problem.requirements.path_constraints:
        if limit.id in failing:
            found += _sharpened(problem, limit, _peaks(problem, limit, candidate, back_off), x, back_off)
    return found


def _scaled_bounds(limit: PathConstraint, back_off: float) -> tuple[Array, Array]:
    return limit.lower / limit.scale + back_off, limit.upper / limit.scale - back_off


def _peaks(problem: Problem, limit: PathConstraint, candidate: Trajectory, back_off: float) -> list[Instant]:
    """Local maxima of the violation of one limit, from a scan: above zero, or close enough to hide one that is."""
    low, high = _scaled_bounds(limit, back_off)
    u = np.linspace(0.0, 1.0, SCAN)
    members: list[Instant] = []
    for k in filter(limit.holds_on, range(candidate.curve.segments)):
        if limit.sweep:
            members += swept_peaks(problem, limit, k, candidate, back_off)
            continue
        values = limit_on(candidate, problem.requirements, limit, k, u) / limit.scale[:, None]
        for side, bound in ((1.0, high), (-1.0, -low)):
            rows, places = np.nonzero(_stands_out(side * values - bound[:, None]))
            if not len(rows):
                continue
            # Narrow peaks lie between samples, where Newton's method would go astray: look closer first.
            close = np.clip(u[places][:, None] + np.linspace(-1.0, 1.0, FINE) / (SCAN - 1), 0.0, 1.0)
            closer = limit_on(candidate, problem.requirements, limit, k, close.ravel()) / limit.scale[:, None]
            own = closer.reshape(-1, *close.shape)[rows, np.arange(len(rows))]  # (peaks, FINE)
            highest = close[np.arange(len(rows)), np.argmax(side * own, axis=1)]
            members += [Instant(limit.id, k, float(v), (int(row),)) for row, v in zip(rows, highest, strict=True)]
    return members


def _stands_out(excess: Array) -> NDArray[np.bool_]:
    """Which samples ``(rows, SCAN)`` are local maxima of an excess that is above zero, or may be between samples."""
    left = np.pad(excess[:, :-1], ((0, 0), (1, 0)), constant_values=-np.inf)
    right = np.pad(excess[:, 1:], ((0, 0), (0, 1)), constant_values=-np.inf)
    with np.errstate(invalid="ignore"):  # of a side without a bound
        falls = np.stack([excess - left, excess - right])
    fall = np.where(np.isfinite(falls), falls, 0.0).max(axis=0)
    return np.asarray((excess >= left) & (excess > right) & (excess > -fall))


def _sharpened(
    problem: Problem, limit: PathConstraint, members: list[Instant], x: Array, back_off: float
) -> list[Instant]:
    """Moves instants onto their peaks by Newton's method on g_u = 0; keeps those where the limit is broken."""
    if not members:
        return []
    if limit.sweep:
        return sharpened_sweep(problem, limit, members, x, back_off)
    derivatives = peak_function(problem, limit, members)
    rows = np.array([m.rows[0] for m in members if m.rows])
    low, high = (bound[rows] for bound in _scaled_bounds(limit, back_off))
    first = np.array([m.u for m in members])
    u, cell = first, 2.0 / (SCAN - 1) / (FINE - 1)
    begun = np.array(derivatives(x, u)[0]).ravel()
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(4):
            value, gu, guu, gux = (np.array(part) for part in derivatives(x, u))
            step = np.nan_to_num(-gu.ravel() / guu.ravel(), nan=0.0, posinf=0.0, neginf=0.0)
            u = np.clip(u + step, np.maximum(first - cell, 0.0), np.minimum(first + cell, 1.0))
        value, gu, guu, gux = (np.array(part) for part in derivatives(x, u))
    value = value.ravel()
    excess, at_first = np.maximum(value - high, low - value), np.maximum(begun - high, low - begun)
    kept = []
    for i in np.nonzero(np.maximum(excess, at_first) > 0.0)[0]:
        if excess[i] < at_first[i]:
            # Newton's method led downhill: the peak is a corner at the end of a segment, where it stays.
            kept.append(members[i])
        elif not problem.instants_move:
            kept.append(replace(members[i], u=float(u[i])))
        else:  # g_u = 0 ties u to x
            kept.append(moving(replace(members[i], u=float(u[i])), guu[i, 0], gux[i], x))
    return kept


def _near(instants: list[Instant], problem: Problem, solution: Solution) -> list[Instant]:
    """The instants and rows close to their bounds; others only cost time, and return as peaks should they matter."""
    kept = []
    known = {limit.id for limit in problem.requirements.path_constraints}
    for instant in instants:
        if instant.limit not in known:  # of a total variation
            kept.append(instant)
            continue
        limit = _limit(problem, instant)
        rows = range(len(limit.labels)) if instant.rows is None else instant.rows
        near = tuple(i for i in rows if solution.slacks[_row(limit, instant, i)] < KEEP)
        if near:
            kept.append(replace(instant, rows=near))
    return kept


def _merge(
    instants: list[Instant], peaks: list[Instant], x: Array, problem: Problem, *, keep: bool
) -> tuple[list[Instant], dict[Row, Row]]:
    """Adds peaks to the grid; one close to an instant that moves replaces it, and inherits its multiplier.

    Where replacing them gains too little the rounds may go in a circle: ``keep`` leaves the old ones where they
    were put.
    """
    merged, renamed = list(instants), {}
    for peak in peaks:
        for i, old in enumerate(merged):
            same = (old.limit, old.segment, old.rows) == (
                peak.limit,
                peak.segment,
                peak.rows,
            ) and old.anchor is not None
            if same and abs(where(old, x) - peak.u) < NEAR and abs(along(old, x) - peak.sweep) < NEAR:
                limit, row = _limit(problem, peak), (peak.rows or (0,))[0]
                renamed[_row(limit, peak, row)] = _row(limit, old, row)
                merged[i] = peak
                if keep:
                    merged.append(replace(old, slope=None, anchor=None))
                break
        else:
            merged.append(peak)
    return merged, renamed


def _limit(problem: Problem, instant: Instant) -> PathConstraint:
    return next(c for c in problem.requirements.path_constraints if c.id == instant.limit)


def _row(limit: PathConstraint, instant: Instant, i: int) -> Row:
    scale = float(limit.scale[i])
    return Row(limit.id, limit.labels[i], instant.segment, instant.u, limit.units[i], scale, sweep=instant.sweep)
