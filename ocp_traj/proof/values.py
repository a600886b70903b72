"""Values of a limit along a trajectory, in floats: what scans, point checks and pictures need."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.requirements import ORDERS, SWEEP, PathConstraint, PointConstraint, Requirements
from ocp_traj.interval.tape import Tape

Array = NDArray[np.float64]


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
    local = np.atleast_1d(np.asarray(u, dtype=float))
    states = np.concatenate([trajectory.curve.at(segment, local, order).T for order in range(len(ORDERS))])
    tape = requirements.compiled(limit, "tape", lambda: Tape(requirements.function(limit)))
    parameters = np.array([[trajectory.parameters[name]] for name in requirements.parameters]).reshape(-1, 1)
    table = getattr(limit, "constants", None)
    constants = np.zeros((0, 1)) if table is None else table[segment][:, None]
    shared = [np.repeat(values, len(local), axis=1) for values in (parameters, constants)]
    if isinstance(limit, PathConstraint) and limit.sweep:
        swept = [tape.evaluate(states, np.stack([local, np.full_like(local, s)]), *shared)[0] for s in SWEEP]
        return farthest(limit, np.stack(swept, axis=1))
    return np.asarray(tape.evaluate(states, local[None], *shared)[0])


def swept_on(
    trajectory: Motion, requirements: Requirements, limit: PathConstraint, segment: int, u: ArrayLike, s: ArrayLike
) -> Array:
    """Values of a swept limit on one segment at all pairs of ``u (N,)`` and ``s (M,)``: ``(rows, N, M)``."""
    local, sweep = np.atleast_1d(np.asarray(u, dtype=float)), np.atleast_1d(np.asarray(s, dtype=float))
    states = np.concatenate([trajectory.curve.at(segment, local, order).T for order in range(len(ORDERS))])
    tape = requirements.compiled(limit, "tape", lambda: Tape(requirements.function(limit)))
    count = len(local) * len(sweep)
    parameters = np.array([[trajectory.parameters[name]] for name in requirements.parameters]).reshape(-1, 1)
    constants = np.zeros((0, 1)) if limit.constants is None else limit.constants[segment][:, None]
    shared = [np.repeat(values, count, axis=1) for values in (parameters, constants)]
    place = np.stack([np.repeat(local, len(sweep)), np.tile(sweep, len(local))])
    values = tape.evaluate(np.repeat(states, len(sweep), axis=1), place, *shared)[0]
    return np.asarray(values.reshape(-1, len(local), len(sweep)))


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
