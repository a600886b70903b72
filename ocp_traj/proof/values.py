"""Values of a limit along a trajectory, in floats: what scans, point checks and pictures need."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.requirements import ORDERS, SWEEP, PathConstraint, PointConstraint, Requirements
from ocp_traj.interval.tape import Tape


def values_at(
    requirements: Requirements, limit: PathConstraint | PointConstraint, states: Array, segment: Index,
    u: Array, p: Array, s: Array | None = None,
) -> Array:  # fmt: skip
    """Values of a limit at N instants ``(rows, N)``, in the limit's units; see ``Requirements.arguments``."""
    tape = requirements.compiled(limit, "tape", lambda: Tape(requirements.function(limit)))
    return np.asarray(tape.evaluate(*requirements.arguments(limit, states, segment, u, p, s))[0])


def limit_on(
    trajectory: Motion,
    requirements: Requirements,
    limit: PathConstraint | PointConstraint,
    segment: int,
    u: ArrayLike,
) -> Array:
    """Values of a limit on one segment at local times ``u (N,)``: ``(rows, N)``, in the limit's units.

    Of a swept limit, the value nearest to its bounds, or farthest beyond, over ``SWEEP``.
    """
    if isinstance(limit, PathConstraint) and limit.sweep:
        return farthest(limit, swept_on(trajectory, requirements, limit, segment, u, SWEEP).swapaxes(1, 2))
    return swept_on(trajectory, requirements, limit, segment, u, None)[:, :, 0]


def swept_on(
    trajectory: Motion, requirements: Requirements, limit: PathConstraint | PointConstraint, segment: int,
    u: ArrayLike, s: ArrayLike | None,
) -> Array:  # fmt: skip
    """Values of a swept limit on one segment at all pairs of ``u (N,)`` and ``s (M,)``: ``(rows, N, M)``.

    Of a limit that is not swept, with None for s, ``(rows, N, 1)``.
    """
    local = np.atleast_1d(np.asarray(u, dtype=float))
    sweep = None if s is None else np.atleast_1d(np.asarray(s, dtype=float))
    count = 1 if sweep is None else len(sweep)
    states = np.concatenate([trajectory.curve.at(segment, local, order).T for order in range(len(ORDERS))])
    place = np.full(len(local) * count, segment), np.repeat(local, count), requirements.parameters_of([trajectory])
    along = None if sweep is None else np.tile(sweep, len(local))
    values = values_at(requirements, limit, np.repeat(states, count, axis=1), *place, along)
    return values.reshape(-1, len(local), count)


def farthest(limit: PathConstraint, values: Array) -> Array:
    """Of values ``(rows, M, N)``, those farthest beyond the limit's bounds, or nearest to them: ``(rows, N)``."""
    excess = np.maximum(values - limit.upper[:, None, None], limit.lower[:, None, None] - values)
    return np.take_along_axis(values, np.argmax(excess, axis=1)[:, None], axis=1)[:, 0]


def limit_along(
    trajectory: Motion, requirements: Requirements, limit: PathConstraint, per_segment: int = 50
) -> tuple[Array, Array]:
    """Times ``(N,)`` [s] and values ``(rows, N)`` of a limit over a trajectory; inner knots appear once a side.

    Where the limit need not hold its values are not numbers.
    """
    u = np.linspace(0.0, 1.0, per_segment)
    curve = trajectory.curve
    times = np.concatenate([curve.knots[k] + u * curve.durations[k] for k in range(curve.segments)])
    values = [
        limit_on(trajectory, requirements, limit, k, u)
        if limit.holds_on(k)
        else np.full((len(limit.labels), per_segment), np.nan)
        for k in range(curve.segments)
    ]
    return times, np.concatenate(values, axis=1)
