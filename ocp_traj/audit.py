"""The audit: every limit of a trajectory, at every instant, proved or not, from the trajectory and its limits alone.

Limits on a derivative of the joints are bounded by hulls of control points, which are exact enclosures; every other
limit by the parabola test of ``ocp_traj.enclosure`` over boxes of states, with the second derivative enclosed by the
interval tape. Arcs are cut where their bound peaks until each is decided and the peak is known to a stated tightness.
Continuity, rest and via points are checked to a tolerance. What is proved is the tape, with its constants as rounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ocp_traj.bernstein import PiecewiseBezier
from ocp_traj.enclosure import MAX_SPLITS, Arcs, Pair, parabola_bound, peak_fraction
from ocp_traj.errors import InputError, ProblemDefinitionError
from ocp_traj.evaluate import limit_on
from ocp_traj.problem import ORDERS, PathConstraint, PointConstraint, Requirements
from ocp_traj.tape import Tape
from ocp_traj.trajectory import Trajectory

Array = NDArray[np.float64]

ALLOWANCE = 1e-12  # of a limit's scale: a value resting exactly on its limit could never be decided
TIGHTNESS = 1e-3  # of a limit's scale: how closely a peak is enclosed once its verdict is known
MAX_ARCS = 200_000  # a limit, over all trajectories audited together

PROVED, CHECKED, UNDECIDED, VIOLATED = "proved", "checked", "undecided", "violated"
_SEVERITY = {PROVED: 0, CHECKED: 0, UNDECIDED: 1, VIOLATED: 2}


@dataclass(frozen=True)
class AuditRow:
    """What is known of one row of one limit, on the side where its margin is smallest.

    Attributes:
        limit, label, unit: which.
        bound: what is allowed [unit].
        attained: the most extreme value found [unit].
        instant: when [s].
        proved_bound: the value is proved to stay within this [unit]; for point constraints the attained value.
        margin: distance of ``proved_bound`` to ``bound`` as a fraction of the limit's scale; > 0 when satisfied.
        verdict: ``proved``, ``violated``, ``undecided``; ``checked`` for point constraints and continuity.
        boxes: how many boxes of states the proof took.
    """

    limit: str
    label: str
    unit: str
    bound: float
    attained: float
    instant: float
    proved_bound: float
    margin: float
    verdict: str
    boxes: int


@dataclass(frozen=True)
class Audit:
    """The rows of an audit and the verdict on the whole."""

    rows: tuple[AuditRow, ...]
    allowance: float = ALLOWANCE

    @property
    def verdict(self) -> str:
        """The worst of the rows: ``proved`` only where every limit is proved and every point constraint met."""
        worst = max((_SEVERITY[row.verdict] for row in self.rows), default=0)
        return (PROVED, UNDECIDED, VIOLATED)[worst]

    @property
    def proved(self) -> bool:
        """Whether every limit holds at every instant."""
        return self.verdict == PROVED

    @property
    def margin(self) -> float:
        """Smallest relative margin over the path limits."""
        return min((row.margin for row in self.rows if row.verdict != CHECKED), default=np.inf)

    @property
    def failures(self) -> tuple[AuditRow, ...]:
        """The rows that are violated or undecided, worst first."""
        bad = [row for row in self.rows if _SEVERITY[row.verdict]]
        return tuple(sorted(bad, key=lambda row: (-_SEVERITY[row.verdict], row.margin)))

    @property
    def table(self) -> pd.DataFrame:
        """One line a row."""
        return pd.DataFrame([vars(row) for row in self.rows])

    def explain(self) -> str:
        """One line: the verdict and, where it is not proved, the limits at fault and the instants."""
        if self.proved:
            return f"proved: every limit holds at every instant (allowance {self.allowance:g} of each limit's scale)"
        worst = "; ".join(
            f"{row.limit} {row.label} {row.verdict}: {row.attained:.6g} at t = {row.instant:.6g} s, "
            f"bound {row.bound:.6g} {row.unit}"
            + (f", enclosed by {row.proved_bound:.6g}" if row.verdict == UNDECIDED else "")
            for row in self.failures[:4]
        )
        return f"{self.verdict}: {worst}"


def audit(trajectory: Trajectory, requirements: Requirements, **options: Any) -> Audit:
    """Audits one trajectory; see ``audit_all``."""
    return audit_all([trajectory], requirements, **options)[0]


def audit_all(
    trajectories: Sequence[Trajectory],
    requirements: Requirements,
    *,
    allowance: float = ALLOWANCE,
    tightness: float = TIGHTNESS,
    max_arcs: int = MAX_ARCS,
) -> list[Audit]:
    """Audits trajectories that share their limits, in few wide passes of the tape.

    Args:
        trajectories: any number, of the joints of ``requirements``.
        requirements: limits, point constraints and promised continuity.
        allowance: what a limit may be exceeded by, in units of its scale, and still count as met.
        tightness: how closely peaks are enclosed, in units of the limit's scale.
        max_arcs: stop refining one limit after so many arcs; what is not decided by then is ``undecided``.

    Returns:
        One audit a trajectory.
    """
    for trajectory in trajectories:
        if trajectory.curve.dof != requirements.dof:
            raise InputError(f"the trajectory has {trajectory.curve.dof} joints, the limits are for {requirements.dof}")
        missing = [name for name in requirements.parameters if name not in trajectory.parameters]
        if missing:
            raise InputError(
                f"the limits need the parameters {missing}; the trajectory has {sorted(trajectory.parameters)}"
            )
    rows: list[list[AuditRow]] = [[] for _ in trajectories]
    for limit in requirements.path_constraints:
        prover = _Prover(trajectories, requirements, limit, allowance, tightness, max_arcs)
        for index, found in enumerate(prover.run()):
            rows[index].extend(found)
    for index, trajectory in enumerate(trajectories):
        for point in requirements.point_constraints:
            rows[index].extend(_check_points(trajectory, requirements, point))
        rows[index].extend(_check_continuity(trajectory, requirements))
    return [Audit(tuple(found), allowance) for found in rows]


def curvature_function(requirements: Requirements, limit: PathConstraint) -> Any:
    """Second time derivative of a limit along any curve, symbolically.

    Returns:
        casadi SX Function (derivatives 0..6 of the joints ``(7 dof,)``, u, p, c, 1/T) -> ``(rows,)`` [unit/s^2].
    """
    dof, function = requirements.dof, requirements.function(limit)
    orders = len(ORDERS) + 2
    x = casadi.SX.sym("x", orders * dof)
    u, rate = casadi.SX.sym("u"), casadi.SX.sym("rate")
    p, c = casadi.SX.sym("p", function.numel_in(2)), casadi.SX.sym("c", function.numel_in(3))
    base = casadi.vertcat(x[: (orders - 1) * dof], u)
    motion = casadi.vertcat(x[dof:], rate)
    first = casadi.jtimes(function(x[: len(ORDERS) * dof], u, p, c), base, motion)
    second = casadi.cse(casadi.jtimes(first, base, motion))
    return casadi.Function("curvature", [x, u, p, c, rate], [casadi.densify(second)])


class _Prover:
    """Encloses one limit over all segments of all trajectories."""

    def __init__(
        self, trajectories: Sequence[Trajectory], requirements: Requirements, limit: PathConstraint,
        allowance: float, tightness: float, max_arcs: int,
    ) -> None:  # fmt: skip
        self.limit, self.requirements = limit, requirements
        self.trajectories, self.max_arcs = trajectories, max_arcs
        self.allowance, self.tightness = allowance, tightness
        count, rows = len(trajectories), len(limit.labels)
        # Both sides as "value <= bound": side 0 is g <= upper, side 1 is -g <= -lower.
        self.bound = np.stack([limit.upper, -limit.lower])
        self.attained = np.full((2, rows, count), -np.inf)  # lower bound of the largest value
        self.found = np.full((2, rows, count), -np.inf)  # the same as computed in floats, for show
        self.instant = np.zeros((2, rows, count))
        self.proved = np.full((2, rows, count), -np.inf)  # upper bound over all arcs that are closed
        self.boxes = np.zeros(count, dtype=int)
        self.parameters = np.array([[t.parameters[name] for name in requirements.parameters] for t in trajectories]).T
        self.parameters = self.parameters.reshape(len(requirements.parameters), count)
        if limit.constants is not None and any(len(limit.constants) != t.curve.segments for t in trajectories):
            raise ProblemDefinitionError(
                f"limit {limit.id!r} has constants for {len(limit.constants)} segments; the trajectories have "
                f"{sorted({t.curve.segments for t in trajectories})}"
            )
        if limit.order is None:
            compiled = requirements.compiled(limit, "proof", lambda: self._compile(requirements, limit))
            self.value, self.curvature = compiled

    @staticmethod
    def _compile(requirements: Requirements, limit: PathConstraint) -> tuple[Tape, Tape]:
        value = Tape(requirements.function(limit))
        value.require_smooth(f"limit {limit.id!r}")
        return value, Tape(curvature_function(requirements, limit))

    def run(self) -> list[list[AuditRow]]:
        for degree in sorted({n for t in self.trajectories for n in t.curve.degrees}):
            self._prove(self._arcs(degree))
        return [self._rows(index) for index in range(len(self.trajectories))]

    def _arcs(self, degree: int) -> Arcs:
        members = [
            (i, k, t.curve.control_points[k], t.curve.durations[k])
            for i, t in enumerate(self.trajectories)
            for k, n in enumerate(t.curve.degrees)
            if n == degree
        ]
        owner, segment, points, duration = zip(*members, strict=True)
        orders = self.limit.order if self.limit.order is not None else len(ORDERS) + 1
        return Arcs.of_segments(np.array(owner), np.array(segment), np.array(points), np.array(duration), orders)

    def _prove(self, arcs: Arcs) -> None:
        total = len(arcs)
        for _ in range(MAX_SPLITS):
            start, end, bound, cut = self._enclose(arcs)
            self._attain(arcs, start, 0)
            self._attain(arcs, end, -1)
            self.boxes += np.bincount(arcs.owner, minlength=len(self.boxes))
            still_open = self._open(arcs, bound)
            keep = still_open.any(axis=(0, 1))
            total += int(keep.sum())
            if total > self.max_arcs:
                keep[:] = False
            self._close(arcs.owner[~keep], bound[:, :, ~keep])
            if not keep.any():
                return
            arcs = arcs.take(keep).split(self._cut(bound, cut, still_open, keep))
        self._close(arcs.owner, self._enclose(arcs)[2])

    def _open(self, arcs: Arcs, bound: Array) -> NDArray[np.bool_]:
        """Which sides, rows and arcs need refining: not decided, or not tight."""
        scale = self.limit.scale[None, :, None]
        allowed = self.bound[:, :, None] + self.allowance * scale
        attained = self.attained[:, :, arcs.owner]
        undecided = ~(bound <= allowed) & ~(attained > allowed)
        loose = ~(bound <= attained + self.tightness * scale)
        finite = np.isfinite(self.bound)[:, :, None]
        return np.asarray((undecided | loose) & finite)

    @staticmethod
    def _cut(bound: Array, cut: Array, still_open: NDArray[np.bool_], keep: NDArray[np.bool_]) -> Array:
        """Where to cut each kept arc: at the parabola's peak of the open row that reaches highest above the rest."""
        excess = np.where(still_open, bound, -np.inf)[:, :, keep]
        flat = excess.reshape(-1, excess.shape[-1])
        choice = np.argmax(np.where(np.isnan(flat), np.inf, flat), axis=0)
        return np.asarray(cut[:, :, keep].reshape(flat.shape)[choice, np.arange(flat.shape[1])])

    def _close(self, owner: NDArray[np.intp], bound: Array) -> None:
        for side in range(2):
            for row in range(bound.shape[1]):
                np.maximum.at(self.proved[side, row], owner, bound[side, row])

    def _attain(self, arcs: Arcs, value: Pair, which: int) -> None:
        """Records the largest values at one end of the arcs, with their instants."""
        u = arcs.a if which == 0 else arcs.b
        for side, (lower, middle) in enumerate(
            ((value[0], 0.5 * (value[0] + value[1])), (-value[1], -0.5 * (value[0] + value[1])))
        ):
            for row in range(lower.shape[0]):
                np.maximum.at(self.attained[side, row], arcs.owner, np.where(np.isnan(lower[row]), -np.inf, lower[row]))
                ascending = np.argsort(middle[row], kind="stable")
                at = np.zeros(len(self.boxes), dtype=np.intp)
                at[arcs.owner[ascending]] = ascending  # the last one written is the owner's largest
                best = np.full(len(self.boxes), -np.inf)
                best[arcs.owner] = middle[row][at[arcs.owner]]
                better = best > self.found[side, row]
                chosen = at[better]
                self.found[side, row, better] = best[better]
                self.instant[side, row, better] = self._time(arcs.owner[chosen], arcs.segment[chosen], u[chosen])

    def _time(self, owner: NDArray[np.intp], segment: NDArray[np.intp], u: Array) -> Array:
        curves = [self.trajectories[i].curve for i in owner]
        return np.array([c.knots[k] + s * c.durations[k] for c, k, s in zip(curves, segment, u, strict=True)])

    def _enclose(self, arcs: Arcs) -> tuple[Pair, Pair, Array, Array]:
        """Values at both ends, bounds of both sides over each arc, and where to cut."""
        if self.limit.order is not None:
            order = self.limit.order
            start, end = arcs.end(order, 0), arcs.end(order, -1)
            lower, upper = arcs.hull(order)
            bound = np.stack([upper, -lower])
            return start, end, bound, np.full(bound.shape, 0.5)
        start, end = self._values(arcs, 0), self._values(arcs, -1)
        low, high = self._curvature(arcs)
        width = arcs.width()
        bounds = [parabola_bound(start[1], end[1], -low, width), parabola_bound(-start[0], -end[0], high, width)]
        cuts = [peak_fraction(start[1], end[1], -low, width), peak_fraction(-start[0], -end[0], high, width)]
        return start, end, np.stack(bounds), np.stack(cuts)

    def _shared(self, arcs: Arcs) -> tuple[Pair, Pair]:
        p = self.parameters[:, arcs.owner]
        constants = self.limit.constants
        c = np.zeros((0, len(arcs))) if constants is None else constants[arcs.segment].T
        return (p, p), (c, c)

    def _values(self, arcs: Arcs, which: int) -> Pair:
        ends = [arcs.end(order, which) for order in range(len(ORDERS))]
        x = (np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends]))
        return self.value.enclose(x, arcs.end_time(which), *self._shared(arcs))[0]

    def _curvature(self, arcs: Arcs) -> Pair:
        hulls = [arcs.hull(order) for order in range(len(ORDERS) + 2)]
        x = (np.concatenate([low for low, _ in hulls]), np.concatenate([high for _, high in hulls]))
        rate = (np.nextafter(1.0 / arcs.duration, -np.inf)[None], np.nextafter(1.0 / arcs.duration, np.inf)[None])
        return self.curvature.enclose(x, arcs.local_time(), *self._shared(arcs), rate)[0]

    def _rows(self, index: int) -> list[AuditRow]:
        limit, rows = self.limit, []
        for row, label in enumerate(limit.labels):
            scale = float(limit.scale[row])
            sides = []
            for side, sign in ((0, 1.0), (1, -1.0)):
                bound = self.bound[side, row]
                if not np.isfinite(bound):
                    continue
                attained, proved = self.attained[side, row, index], self.proved[side, row, index]
                if attained > bound + self.allowance * scale:
                    verdict = VIOLATED
                elif proved <= bound + self.allowance * scale:
                    verdict = PROVED
                else:
                    verdict = UNDECIDED
                found = self.found[side, row, index]
                sides.append(
                    AuditRow(
                        limit.id,
                        label,
                        limit.units[row],
                        sign * bound,
                        sign * found,
                        float(self.instant[side, row, index]),
                        sign * max(proved, found),
                        float((bound - max(proved, found)) / scale),
                        verdict,
                        int(self.boxes[index]),
                    )  # fmt: skip
                )
            if sides:
                rows.append(max(sides, key=lambda r: (_SEVERITY[r.verdict], -r.margin)))
        return rows


def _check_points(trajectory: Trajectory, requirements: Requirements, point: PointConstraint) -> list[AuditRow]:
    curve = trajectory.curve
    nodes = [(k % curve.segments, u) for k, u in point.at]
    values = np.concatenate([limit_on(trajectory, requirements, point, k, u) for k, u in nodes], axis=1)
    rows = []
    for i, label in enumerate(point.labels):
        excess = np.maximum(values[i] - point.upper[:, i], point.lower[:, i] - values[i])
        worst = int(np.argmax(np.where(np.isnan(excess), np.inf, excess)))
        k, local = nodes[worst]
        above = values[i, worst] >= 0.5 * (point.lower[worst, i] + point.upper[worst, i])
        verdict = CHECKED if excess[worst] <= point.tolerance else VIOLATED
        rows.append(
            AuditRow(
                point.id,
                label,
                point.units[i],
                float((point.upper if above else point.lower)[worst, i]),
                float(values[i, worst]),
                float(curve.knots[k] + local * curve.durations[k]),
                float(values[i, worst]),
                float(1.0 - max(excess[worst], 0.0) / point.tolerance),
                verdict,
                0,
            )  # fmt: skip
        )
    return rows


def _check_continuity(trajectory: Trajectory, requirements: Requirements) -> list[AuditRow]:
    """Jumps across inner knots, relative to the largest value of the derivative: at most 1e-9."""
    curve: PiecewiseBezier = trajectory.curve
    rows = []
    for order in range(requirements.continuity + 1):
        jumps = np.abs(curve.jump(order))
        if not jumps.size:
            break
        low, high = curve.hull(order)
        size = np.maximum(np.maximum(-low, high).max(axis=0), np.finfo(float).tiny)
        for j, joint in enumerate(requirements.joints):
            k = int(np.argmax(jumps[:, j]))
            bound = 1e-9 * float(size[j])
            rows.append(
                AuditRow(
                    f"continuity of {ORDERS[order]}",
                    joint,
                    requirements.joint_units[j] + ("", "/s", "/s2", "/s3", "/s4")[order],
                    bound,
                    float(jumps[k, j]),
                    float(curve.knots[k + 1]),
                    float(jumps[k, j]),
                    float((bound - jumps[k, j]) / bound),
                    CHECKED if jumps[k, j] <= bound else VIOLATED,
                    0,
                )  # fmt: skip
            )
    return rows
