"""Values of limits that a page cannot compute, along many trajectories at once: efforts, tool errors, clearances."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import PiecewiseBezier, derivative_basis
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.requirements import ORDERS, SWEEP, PathConstraint, Requirements
from ocp_traj.proof.values import farthest, values_at
from ocp_traj.robot.pair_distances import PairDistances

INSTANTS, CLEARANCES = 400, 100  # of a trajectory, at least: our choice


def local_times(segments: int, instants: int) -> Array:
    """Even local times ``(N,)`` in [0, 1] for each of a curve's segments, both ends among them."""
    return np.linspace(0.0, 1.0, max(-(-instants // segments), 3))


def limit_samples(motions: Sequence[Motion], requirements: Requirements, limit: PathConstraint) -> list[Array]:
    """Values of a limit ``(segments, N, rows)`` on each motion at ``local_times``; NaN on segments it does not hold on.

    Of a swept limit, the values farthest beyond its bounds, or nearest to them.
    """
    places, segments, states, parameters = [], [], [], []
    for index, motion in enumerate(motions):
        u = local_times(motion.curve.segments, INSTANTS)
        for k in range(motion.curve.segments):
            places.append(u)
            segments.append(np.full(len(u), k))
            states.append(_states(motion.curve, k, u))
            parameters.append(np.full(len(u), index))
    at, segment, state = np.concatenate(places), np.concatenate(segments), np.concatenate(states, axis=1)
    p = requirements.parameters_of(motions)[:, np.concatenate(parameters)]
    if limit.sweep:
        swept = [
            values_at(requirements, limit, state, segment, at, p, np.full(len(at), s))[:, None] for s in SWEEP
        ]  # fmt: skip
        values = farthest(limit, np.concatenate(swept, axis=1))
    else:
        values = values_at(requirements, limit, state, segment, at, p)
    found, begin = [], 0
    for motion in motions:
        count, width = motion.curve.segments, len(local_times(motion.curve.segments, INSTANTS))
        block = values[:, begin : begin + count * width].reshape(-1, count, width).transpose(1, 2, 0).copy()
        for k in range(count):
            if not limit.holds_on(k):
                block[k] = np.nan
        found.append(block)
        begin += count * width
    return found


def _states(curve: PiecewiseBezier, segment: int, u: Array) -> Array:
    """Stacked derivatives ``(5 dof, N)`` on a segment."""
    points, duration = curve.control_points[segment], curve.durations[segment]
    basis = _basis(len(points) - 1, len(u))
    return np.concatenate([(basis[:, m] @ points).T / duration**m for m in range(len(ORDERS))])


@lru_cache(maxsize=64)
def _basis(degree: int, count: int) -> Array:
    """What takes control points to all derivatives at even local times."""
    return derivative_basis(degree, np.linspace(0.0, 1.0, count), len(ORDERS) - 1)


def clearance_samples(motions: Sequence[Motion], limit: ClearanceConstraint) -> list[tuple[Array, Index]]:
    """The least distance of all pairs [m] and its row, both ``(segments, N)``, on each motion at ``local_times``."""
    pairs = PairDistances(limit.robot, [(limit.bodies[i], limit.bodies[j]) for i, j in limit.pairs])
    found = []
    for motion in motions:
        u = local_times(motion.curve.segments, CLEARANCES)
        q = np.concatenate([motion.curve.at(k, u) for k in range(motion.curve.segments)])
        distance, row = _nearest(pairs, limit, q)
        shape = motion.curve.segments, len(u)
        found.append((distance.reshape(shape), row.reshape(shape)))
    return found


def _nearest(pairs: PairDistances, limit: ClearanceConstraint, q: Array) -> tuple[Array, Index]:
    """Least distance over all pairs at postures ``(N, dof)``, and the row of the pair."""
    bound = pairs.at_least(q)
    every = np.arange(len(q))
    best = bound.argmin(axis=1)
    least = pairs.distances(q, best)
    bound[every, best] = np.inf
    at, others = np.nonzero(bound < least[:, None])  # of the others, those that may be nearer still
    for i, pair, distance in zip(at, others, pairs.distances(q[at], others) if len(at) else (), strict=True):
        if distance < least[i]:
            least[i], best[i] = distance, pair
    return least, limit.row_of[best]
