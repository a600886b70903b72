"""The audit: every limit of a trajectory, at every instant, proved or not, from the trajectory and its limits alone.

Path limits are proved by ``prover`` and ``swept``, clearances by ``clearance``. Continuity, rest, via points, durations
and parameters are checked to a tolerance. What is proved is the tape, with its constants as rounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import isfinite, perm
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import MOST_NAMES, InputError, quoted
from ocp_traj.formulation.requirements import ORDERS, PointConstraint, Requirements
from ocp_traj.proof.clearance import ClearanceProver
from ocp_traj.proof.prover import Prover
from ocp_traj.proof.swept import SweptProver
from ocp_traj.proof.values import values_at
from ocp_traj.proof.verdicts import ALLOWANCE, CHECKED, VIOLATED, Audit, AuditRow

TIGHTNESS = 1e-3  # of a limit's scale: how closely a peak is enclosed once its verdict is known
MAX_ARCS = 50_000  # a limit and trajectory


def audit(trajectory: Motion, requirements: Requirements, **options: Any) -> Audit:
    """Audits one trajectory; see ``audit_all``."""
    return audit_all([trajectory], requirements, **options)[0]


@one_blas_thread
def audit_all(
    trajectories: Sequence[Motion],
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
        allowance: what a path limit may be exceeded by, as a share of its bound, and still count as met.
        tightness: how closely peaks are enclosed, in units of the limit's scale.
        max_arcs: stop refining a limit of a trajectory after so many arcs; what is not decided then is ``undecided``.

    Returns:
        One audit a trajectory.
    """
    if not 0.0 <= allowance < 1.0:
        raise InputError(f"the allowance is {allowance} of each bound; give a number from 0 to below 1")
    for trajectory in trajectories:
        require_joints(trajectory, requirements)
    if not trajectories:
        return []
    rows: list[list[AuditRow]] = [[] for _ in trajectories]
    # Numbers may overflow on the way; what is not a number is never taken for a proof.
    with np.errstate(all="ignore"):
        derivatives = [limit for limit in requirements.path_constraints if limit.order is not None]
        others = [[limit] for limit in requirements.path_constraints if limit.order is None]
        for limits in [derivatives, *others] if derivatives else others:
            chosen = SweptProver if limits[0].sweep else Prover
            prover = chosen(trajectories, requirements, limits, allowance, tightness, max_arcs)
            for index, found in enumerate(prover.run()):
                rows[index].extend(found)
        for clearance in requirements.clearance_constraints:
            kept = ClearanceProver(trajectories, requirements, clearance, allowance, max_arcs)
            for index, found in enumerate(kept.run()):
                rows[index].extend(found)
        for found in rows:
            found.sort(key=lambda row: requirements.ids.index(row.limit))
        for point in requirements.point_constraints:
            for index, found in enumerate(_check_points(trajectories, requirements, point)):
                rows[index].extend(found)
        for index, trajectory in enumerate(trajectories):
            rows[index].extend(_check_durations(trajectory, requirements))
            rows[index].extend(_check_parameters(trajectory, requirements))
            rows[index].extend(_check_continuity(trajectory, requirements))
    names = requirements.parameters
    return [
        Audit(tuple(found), allowance, {name: trajectory.parameters[name] for name in names})
        for trajectory, found in zip(trajectories, rows, strict=True)
    ]


def require_joints(trajectory: Motion, requirements: Requirements) -> None:
    """Raises ``InputError`` unless a trajectory has the joints of its limits, in their order, and the parameters."""
    if trajectory.joints != requirements.joints:
        raise InputError(
            f"the trajectory's joints are {quoted(list(trajectory.joints), MOST_NAMES)}, those of the limits "
            f"{quoted(list(requirements.joints), MOST_NAMES)}; give the same, in the same order"
        )
    missing = [name for name in requirements.parameters if name not in trajectory.parameters]
    if missing:
        raise InputError(
            f"the limits need the parameters {missing}; the trajectory has {sorted(trajectory.parameters)}"
        )


def checked_row(
    limit: str, label: str, unit: str, value: float, lower: float, upper: float, tolerance: float, instant: float = 0.0
) -> AuditRow:
    """A row of a number that is checked against two bounds, each to a share ``tolerance`` of its own size."""
    bound = lower if lower - value > value - upper else upper
    excess, allowed = max(lower - value, value - upper), tolerance * abs(bound) if isfinite(bound) else 0.0
    size = upper - lower if 0.0 < upper - lower < np.inf else abs(bound) or 1.0
    return AuditRow(
        limit, label, unit, bound, value, instant, value, -excess / size,
        CHECKED if excess <= allowed else VIOLATED, 0, allowance=allowed,
    )  # fmt: skip


def _check_durations(trajectory: Motion, requirements: Requirements) -> list[AuditRow]:
    curve, rows = trajectory.curve, []
    for limit in requirements.duration_constraints:
        for segment, lower, upper in zip(limit.segments, limit.lower, limit.upper, strict=True):
            k = _segment(curve, segment, limit.id)
            bounds = float(lower), float(upper), limit.tolerance
            at = float(curve.knots[k])
            rows.append(checked_row(limit.id, f"segment {k}", "s", float(curve.durations[k]), *bounds, at))
    return rows


def _check_parameters(trajectory: Motion, requirements: Requirements) -> list[AuditRow]:
    return [
        checked_row("parameter", b.parameter, b.unit, trajectory.parameters[b.parameter], b.lower, b.upper, 0.0)
        for b in requirements.parameter_bounds
    ]


def _segment(curve: PiecewiseBezier, segment: int, limit: str) -> int:
    """A segment counted from 0, whether it was counted from there or from the end."""
    if not -curve.segments <= segment < curve.segments:
        raise InputError(f"{limit!r} is on segment {segment}; the trajectory has segments 0 to {curve.segments - 1}")
    return segment % curve.segments


def _check_points(
    trajectories: Sequence[Motion], requirements: Requirements, point: PointConstraint
) -> list[list[AuditRow]]:
    """The rows of a point constraint, per trajectory."""
    state = np.zeros((len(ORDERS), requirements.dof, len(trajectories), len(point.at)))
    for i, trajectory in enumerate(trajectories):
        for j, (segment, u) in enumerate(point.at):
            k = _segment(trajectory.curve, segment, point.id)
            for order in range(requirements.order(point) + 1):
                state[order, :, i, j] = trajectory.curve.at(k, u, order)[0]
    columns = state.reshape(len(ORDERS) * requirements.dof, -1)
    segments, local = (np.tile(part, len(trajectories)) for part in zip(*point.at, strict=True))
    p = np.repeat(requirements.parameters_of(trajectories), len(point.at), axis=1)
    values = values_at(requirements, point, columns, segments, local, p).reshape(-1, len(trajectories), len(point.at))
    return [_point_rows(trajectory, point, values[:, i]) for i, trajectory in enumerate(trajectories)]


def _point_rows(trajectory: Motion, point: PointConstraint, values: Array) -> list[AuditRow]:
    curve, rows = trajectory.curve, []
    for i, label in enumerate(point.labels):
        lower, upper = point.lower[:, i], point.upper[:, i]
        over, under = values[i] - upper, lower - values[i]
        excess = np.maximum(over, under)
        excess = np.where(np.isnan(excess), np.inf, excess)
        worst = int(np.argmax(excess))
        segment, local = point.at[worst]
        value, segment = float(values[i, worst]), segment % curve.segments
        rows.append(
            AuditRow(
                point.id,
                label,
                point.units[i],
                float((lower if under[worst] > over[worst] else upper)[worst]),
                value,
                float(curve.knots[segment] + local * curve.durations[segment]),
                value,
                1.0 - max(float(excess[worst]), 0.0) / point.tolerance,
                CHECKED if excess[worst] <= point.tolerance else VIOLATED,
                0,
                allowance=point.tolerance,
            )  # fmt: skip
        )
    return rows


def _check_continuity(trajectory: Motion, requirements: Requirements) -> list[AuditRow]:
    """Jumps across inner knots: at most 1e-9 of the largest value of the derivative, beside what rounding makes."""
    curve: PiecewiseBezier = trajectory.curve
    rows: list[AuditRow] = []
    if curve.segments == 1:
        return rows
    largest = np.array([np.abs(points).max(axis=0) for points in curve.control_points])
    degrees = np.array(curve.degrees)
    for order in range(requirements.continuity + 1):
        hodographs = [curve.hodograph(k, order) for k in range(curve.segments)]
        jumps = np.array([np.abs(b[0] - a[-1]) for a, b in pairwise(hodographs)])
        size = np.max([np.abs(points).max(axis=0) for points in hodographs], axis=0)
        # Of a sum of n + 1 control points with weights whose sizes sum to 2^m n! / (n - m)!, over T^m.
        weight = np.array([2.0**order * perm(n, order) for n in curve.degrees]) / curve.durations**order
        rounding = ((degrees + 2) * np.finfo(float).eps * weight)[:, None] * largest
        bounds = 1e-9 * size + rounding[:-1] + rounding[1:] + np.finfo(float).tiny
        for j, joint in enumerate(requirements.joints):
            k = int(np.argmax(jumps[:, j] / bounds[:, j]))
            jump, bound = float(jumps[k, j]), float(bounds[k, j])
            rows.append(
                AuditRow(
                    f"continuity of {ORDERS[order]}",
                    joint,
                    requirements.joint_units[j] + ("", "/s", "/s2", "/s3", "/s4")[order],
                    bound,
                    jump,
                    float(curve.knots[k + 1]),
                    jump,
                    (bound - jump) / bound,
                    CHECKED if jump <= bound else VIOLATED,
                    0,
                )  # fmt: skip
            )
    return rows
