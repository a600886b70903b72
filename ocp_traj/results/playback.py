"""A trajectory as a controller plays it: points at whole nanoseconds, what is between them, and the audit of that.

The points of ``at_knots`` are the ends of the curve's segments. Where these are of degree 5 or less and C2, the
quintics between the points are the curve itself; others are halved until the quintics are as close as is asked. Times
are rounded up, and all is slowed until it is proved. ``at_rate`` gives samples, and what is between them as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.interpolation import continuity_of, cut_at, interpolate, largest_distance
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import InputError
from ocp_traj.formulation.cut_requirements import anywhere_and_somewhere, cut_requirements
from ocp_traj.formulation.requirements import ORDERS, Requirements
from ocp_traj.proof.audit import audit
from ocp_traj.proof.verdicts import CHECKED, PROVED, UNDECIDED, Audit, AuditRow
from ocp_traj.results.time_scaling import LARGEST, MULTIPLES, excess_over
from ocp_traj.results.trajectory import Trajectory

MOST_POINTS = 1_000_000  # a file of some hundred megabytes: our choice
TOLERANCE = 1e-6  # [rad or m] by which a refitted motion may leave the trajectory: our choice, below what encoders see
SLOWED_LITTLE = 1.001  # more than this is mended by more pieces, where these help: our choice
REFINED = 4  # times that all pieces are halved for the sake of the proof: our choice
GIVEN = {"linear": "q alone", "cubic": "q and v", "quintic": "q, v and a"}
NO_LIMITS = "nothing is proved: the trajectory names no problem, and no limits were given"


@dataclass(frozen=True, eq=False)
class Playback:
    """Points, what is played between them, and what is proved of that.

    Attributes:
        trajectory: what is played.
        interpolation: ``linear``, ``cubic`` or ``quintic``.
        ticks: times of the N points [ns], whole numbers, the first 0.
        states: q, v, a at the points, as many as the interpolation takes, ``(N, dof)`` each.
        played: the polynomials between the points.
        source: the segment of the trajectory that each of them begins on, and where on it, in local time ``(N - 1,)``.
        factor: by which the trajectory was slowed.
        deviation: bound of the largest difference of a joint's position from the trajectory so slowed [rad or m].
        requirements: the limits, put to ``motion``; None where there are none.
        audit: of ``motion``; None where there are no limits.
    """

    trajectory: Trajectory
    interpolation: str
    ticks: Index
    states: tuple[Array, ...]
    played: PiecewiseBezier
    source: tuple[Index, Array]
    factor: float
    deviation: float
    requirements: Requirements | None
    audit: Audit | None

    @property
    def duration(self) -> float:
        """Total time [s]."""
        return float(self.ticks[-1]) * 1e-9

    @property
    def proved(self) -> bool:
        """Whether every limit is proved of what is played."""
        return self.audit is not None and self.audit.proved

    @property
    def verdict(self) -> str:
        """``proved``, ``undecided`` or ``violated``; ``undecided`` where there are no limits."""
        return UNDECIDED if self.audit is None else self.audit.verdict

    @property
    def jump(self) -> AuditRow | None:
        """The jump of the lowest derivative that should not jump and does."""
        rows = () if self.audit is None else self.audit.rows
        jumps = [row for row in rows if row.limit.startswith("continuity") and row.verdict != CHECKED]
        order = min((_order(row) for row in jumps), default=None)
        return max((row for row in jumps if _order(row) == order), key=lambda row: row.attained, default=None)

    @property
    def not_carried(self) -> tuple[str, ...]:
        """Limits that cannot hold: on what jumps in the middle, and on what the points do not set at the ends."""
        if self.requirements is None or self.audit is None:
            return ()
        found = []
        if self.jump is not None:
            order, limits = _order(self.jump), self.requirements.path_constraints
            found = [limit.id for limit in limits if self.requirements.order(limit) > order]
        return (*found, *sorted({row.limit for row in self.audit.failures if self._unset(row)}))

    def _unset(self, row: AuditRow) -> bool:
        """Whether a row of a point constraint is of a derivative that the points do not give."""
        points = {point.id: point for point in self.requirements.point_constraints} if self.requirements else {}
        if row.limit not in points or self.requirements is None:
            return False
        point = points[row.limit]
        sparsity = np.array(casadi.DM(self.requirements.function(point).jac_sparsity(0, 0), 1.0))
        used = np.flatnonzero(sparsity[point.labels.index(row.label)])
        return bool(len(used)) and used.max() // self.requirements.dof > continuity_of(self.interpolation)

    @cached_property
    def carried(self) -> Audit | None:
        """The audit of the limits that can hold."""
        if self.audit is None:
            return None
        limits = () if self.requirements is None else self.requirements.path_constraints
        left_out = {limit.id for limit in limits} & set(self.not_carried)
        return replace(
            self.audit,
            rows=tuple(
                row
                for row in self.audit.rows
                if row.limit not in left_out
                and (row.verdict == CHECKED or not (row.limit.startswith("continuity") or self._unset(row)))
            ),
        )

    @property
    def excess(self) -> float:
        """Largest relative amount by which a limit that can hold is exceeded."""
        if self.requirements is None or self.carried is None:
            return float("nan")
        return excess_over(self.requirements, self.carried)

    def explain(self) -> str:
        """One line: what is proved of what is played, and what not."""
        if self.audit is None or self.carried is None:
            return NO_LIMITS
        if self.proved:
            return self.audit.explain()
        parts = []
        if self.jump is not None:
            what = f"{ORDERS[_order(self.jump)]} jumps by {self.jump.attained:.6g} {self.jump.unit}"
            parts.append(f"{what} at t = {self.jump.instant:.6g} s")
        if self.not_carried:
            names = ", ".join(self.not_carried)
            parts.append(f"{names} cannot hold between points of {GIVEN[self.interpolation]}")
        worst: dict[str, AuditRow] = {}
        for row in self.carried.failures:
            if row.limit not in worst or abs(row.attained - row.bound) > abs(
                worst[row.limit].attained - worst[row.limit].bound
            ):
                worst[row.limit] = row
        for row in sorted(worst.values(), key=lambda row: not row.boxes):
            missed = f"{row.limit} {row.label} {row.verdict}: {row.attained:.9g} at t = {row.instant:.6g} s, bound "
            parts.append(f"{missed}{row.bound:.9g} {row.unit}")
        if self.carried.proved:
            parts.append("every other limit is proved")
        return f"not proved: {'; '.join(parts)}"


def _order(row: AuditRow) -> int:
    return ORDERS.index(row.limit.rpartition(" ")[2])


def at_knots(
    trajectory: Trajectory, requirements: Requirements | None, interpolation: str = "quintic",
    tolerance: float = TOLERANCE,
) -> Playback:  # fmt: skip
    """Points at the ends of the segments, or of parts of them; see the module.

    Args:
        trajectory: what is played.
        requirements: its limits; None where there are none.
        interpolation: ``linear``, ``cubic`` or ``quintic``; only quintics are fitted, others are taken as they come.
        tolerance: largest difference of a joint's position [rad or m].
    """
    if not 0.0 < tolerance < np.inf:
        raise InputError(f"the tolerance is {tolerance}; give a number above zero [rad or m]")
    quintic = continuity_of(interpolation) == 2
    curve = trajectory.curve
    times = _places(curve, requirements)
    if quintic:
        times = _halved_until(curve, times, tolerance)
    best = _slowed(trajectory, requirements, interpolation, times)
    for _ in range(REFINED if quintic and requirements is not None else 0):
        settled = best.carried is not None and best.carried.proved and best.factor <= SLOWED_LITTLE
        high = np.array(cut_at(curve, times)[0].degrees) > 5
        if settled or not high.any():
            break
        times = _halve(curve, times, high)
        finer = _slowed(trajectory, requirements, interpolation, times)
        best = min((best, finer), key=lambda found: (not (found.carried and found.carried.proved), found.duration))
    return best


def at_rate(
    trajectory: Trajectory, requirements: Requirements | None, rate: float, interpolation: str = "quintic"
) -> Playback:
    """Samples every 1 / ``rate`` [s] and at the end, and what the interpolation makes of them.

    The last interval is of half a period to one and a half: of a shorter one rounding would leave nothing.
    """
    curve, c = trajectory.curve, continuity_of(interpolation)
    if not 0.0 < rate < np.inf:
        raise InputError(f"the rate is {rate} Hz; give a number above zero")
    if curve.duration * rate > MOST_POINTS:
        raise InputError(
            f"{rate:g} Hz over {curve.duration:.6g} s are more than {MOST_POINTS} points; give a lower rate"
        )
    if rate > 1e9:
        raise InputError(f"the rate is {rate:g} Hz; give at most 1e9, one point a nanosecond")
    last = _ticks(np.array([curve.duration]))[0]
    ticks = _ticks(np.arange(int(curve.duration * rate) + 2) / rate)
    ticks = np.append(ticks[(ticks == 0) | (ticks <= last - 0.5e9 / rate)], last)
    times = np.minimum(ticks * 1e-9, curve.duration)
    states = tuple(curve(times, order) for order in range(c + 1))
    played = interpolate(np.diff(ticks) * 1e-9, states)
    own, near = np.concatenate([curve.knots[1:-1], _places(curve, requirements)]), 1e-12 * curve.duration
    at = np.clip(np.searchsorted(times, own), 1, len(times) - 1)
    marks = np.unique(own[np.minimum(np.abs(own - times[at]), np.abs(own - times[at - 1])) > near])
    marks = marks[np.concatenate([[True], np.diff(marks) > near])] if len(marks) else marks
    cut = cut_at(played, marks)[0]
    original, source, a, b = cut_at(curve, np.sort(np.concatenate([marks, times[1:-1]])))
    deviation = _deviation(original, cut)
    wanted = None if requirements is None else cut_requirements(requirements, source, a, b)
    found = None
    if wanted is not None:
        # Parts that end close to a point are short, and rounding spoils their derivatives: as few as can be see them.
        anywhere, somewhere = anywhere_and_somewhere(wanted)
        found, more = audit(_motion(trajectory, played), anywhere), audit(_motion(trajectory, cut), somewhere)
        found = replace(found, rows=(*found.rows, *more.rows), parameters={**found.parameters, **more.parameters})
    begins = curve.locate(times[:-1])
    return Playback(trajectory, interpolation, ticks, states, played, begins, 1.0, deviation, wanted, found)


def _motion(trajectory: Trajectory, curve: PiecewiseBezier) -> Motion:
    return Motion(curve, trajectory.joints, trajectory.parameters)


def _ticks(times: Array) -> Index:
    """Times in whole nanoseconds, rounded up but for what rounding of floats has added."""
    return np.ceil(times * 1e9 - 1e-5).astype(np.intp)


def _places(curve: PiecewiseBezier, requirements: Requirements | None) -> Array:
    """The times of all point constraints [s], ascending."""
    points = () if requirements is None else requirements.point_constraints
    at = {(segment % curve.segments, u) for point in points for segment, u in point.at}
    return np.array(sorted(curve.knots[k] + u * curve.durations[k] for k, u in at))


def _end_states(pieces: PiecewiseBezier, continuity: int) -> tuple[Array, ...]:
    """q, v, .. at the ends of the pieces ``(P + 1, dof)`` each; where two sides differ, their mean."""
    found = []
    for order in range(continuity + 1):
        hodographs = [pieces.hodograph(k, order) for k in range(pieces.segments)]
        left, right = np.array([h[0] for h in hodographs]), np.array([h[-1] for h in hodographs])
        found.append(np.concatenate([left[:1], 0.5 * (left[1:] + right[:-1]), right[-1:]]))
    return tuple(found)


def _deviation(pieces: PiecewiseBezier, played: PiecewiseBezier) -> float:
    return float(_distances(pieces, played).max())


def _distances(pieces: PiecewiseBezier, played: PiecewiseBezier) -> Array:
    high = max(pieces.degrees)
    return largest_distance(np.stack(pieces.elevate(high).control_points), np.stack(played.control_points))


def _halve(curve: PiecewiseBezier, times: Array, chosen: NDArray[np.bool]) -> Array:
    """More times to cut at: the middles of chosen pieces."""
    knots = cut_at(curve, times)[0].knots
    return np.unique(np.concatenate([times, (0.5 * (knots[:-1] + knots[1:]))[chosen]]))


def _halved_until(curve: PiecewiseBezier, times: Array, tolerance: float) -> Array:
    """Times to cut at so that quintics between the pieces' ends are as close as the tolerance says."""
    while True:
        pieces = cut_at(curve, times)[0]
        far = _distances(pieces, interpolate(pieces.durations, _end_states(pieces, 2))) > tolerance
        if not far.any():
            return times
        if pieces.segments > MOST_POINTS // 10:
            raise InputError(
                f"no {pieces.segments} quintics come within {tolerance:g} of the trajectory; give a larger tolerance"
            )
        times = _halve(curve, times, far)


def _slowed(trajectory: Trajectory, requirements: Requirements | None, interpolation: str, times: Array) -> Playback:
    """The pieces between ``times``, rounded up to nanoseconds and slowed until proved, at most by ``LARGEST``."""
    pieces, source, a, b = cut_at(trajectory.curve, times)
    rates = _end_states(pieces, continuity_of(interpolation))
    wanted = None if requirements is None else cut_requirements(requirements, source, a, b)

    def attempt(factor: float) -> Playback:
        ticks = np.maximum(_ticks(pieces.durations * factor), 1)
        states = tuple(rate / factor**order for order, rate in enumerate(rates))
        played = interpolate(ticks * 1e-9, states)
        found = None if wanted is None else audit(_motion(trajectory, played), wanted)
        whole = np.concatenate([[0], np.cumsum(ticks)])
        return Playback(
            trajectory, interpolation, whole, states, played, (source, a), factor, _deviation(pieces, played), wanted,
            found,
        )  # fmt: skip

    first = attempt(1.0)
    if first.carried is None or not any(
        row.verdict not in (PROVED, CHECKED) and row.boxes for row in first.carried.rows
    ):
        return first
    excess = max(first.excess, 1e-9)
    for multiple in MULTIPLES:
        if multiple * excess > LARGEST - 1.0:
            break
        found = attempt(1.0 + multiple * excess)
        if found.carried is not None and found.carried.proved:
            return found
    return first
