"""Requirements of a curve, put to one whose segments are parts of that curve's segments.

What counts segments, or the local time on them, is told which part of which segment it is on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.requirements import (
    DurationConstraint,
    Expression,
    PathConstraint,
    PointConstraint,
    Requirements,
    State,
)

NANOSECOND = 1e-9  # [s], to which controllers are told times


def cut_requirements(requirements: Requirements, source: Index, a: Array, b: Array) -> Requirements:
    """The same limits for a curve of P pieces.

    No derivative may jump below those that are limited, whatever was promised of the curve: across a jump the next
    one is infinite. Durations that are given are kept to a nanosecond.

    Args:
        requirements: of the curve that was cut.
        source: the segment that each piece is of ``(P,)``, ascending.
        a: where on it the piece begins ``(P,)``, in local time.
        b: where it ends, likewise.
    """
    count = int(source.max()) + 1
    smooth = max((requirements.order(limit) - 1 for limit in requirements.path_constraints), default=-1)
    return Requirements(
        requirements.joints, requirements.joint_units,
        tuple(_path(requirements, limit, source, a, b) for limit in requirements.path_constraints),
        tuple(_points(point, source, a, b, count) for point in requirements.point_constraints),
        requirements.parameters, max(requirements.continuity, smooth),
        tuple(_durations(limit, source, a, b, count) for limit in requirements.duration_constraints),
        requirements.parameter_bounds, requirements.clearance_constraints,
    )  # fmt: skip


def anywhere_and_somewhere(requirements: Requirements) -> tuple[Requirements, Requirements]:
    """Path limits that are the same on every segment with the continuity, and all other requirements."""
    same = [limit for limit in requirements.path_constraints if not _counts(requirements, limit)]
    other = tuple(limit for limit in requirements.path_constraints if limit not in same)
    return (
        replace(
            requirements, path_constraints=tuple(same), point_constraints=(), duration_constraints=(),
            parameter_bounds=(),
        ),
        replace(requirements, path_constraints=other, continuity=-1, clearance_constraints=()),
    )  # fmt: skip


def _counts(requirements: Requirements, limit: PathConstraint) -> bool:
    """Whether a limit depends on the segment, or on the place on it."""
    timed = 0 in requirements.function(limit).jac_sparsity(0, 1).get_triplet()[1]
    return limit.segments is not None or limit.constants is not None or timed


def _path(requirements: Requirements, limit: PathConstraint, source: Index, a: Array, b: Array) -> PathConstraint:
    segments = None if limit.segments is None else tuple(np.flatnonzero(np.isin(source, limit.segments)).tolist())
    if not _counts(requirements, limit):
        return limit
    given = np.zeros((len(source), 0)) if limit.constants is None else limit.constants[source]
    width = given.shape[1]
    table = np.column_stack([given, a, b - a])
    return replace(limit, segments=segments, constants=table, expression=_on_part(limit.expression, width))


def _on_part(expression: Expression, width: int) -> Callable[[State], object]:
    """The expression at the local time of the whole segment, which follows from two more constants."""
    return lambda s: expression(s._replace(c=s.c[:width], u=s.c[width] + s.c[width + 1] * s.u))


def _points(point: PointConstraint, source: Index, a: Array, b: Array, count: int) -> PointConstraint:
    places = []
    for segment, u in point.at:
        pieces = np.flatnonzero(source == segment % count)
        k = pieces[min(int(np.searchsorted(b[pieces], u - 1e-12)), len(pieces) - 1)]
        places.append((int(k), float(np.clip((u - a[k]) / (b[k] - a[k]), 0.0, 1.0))))
    snapped = tuple((k, round(u) + 0.0 if abs(u - round(u)) < 1e-9 else u) for k, u in places)
    return replace(point, at=snapped)


def _durations(limit: DurationConstraint, source: Index, a: Array, b: Array, count: int) -> DurationConstraint:
    pieces, lower, upper = [], [], []
    for segment, low, high in zip(limit.segments, limit.lower, limit.upper, strict=True):
        for k in np.flatnonzero(source == segment % count).tolist():
            pieces.append(k)
            lower.append(low * (b[k] - a[k]))
            upper.append(high * (b[k] - a[k]))
    finite = [bound for bound in (*lower, *upper) if 0.0 < bound < np.inf]
    tolerance = limit.tolerance + NANOSECOND / min(finite, default=1.0)
    return replace(limit, segments=tuple(pieces), lower=np.array(lower), upper=np.array(upper), tolerance=tolerance)
