"""A polyline driven edge by edge, at rest at every corner: legal wherever its straight edges are clear."""

from __future__ import annotations

from functools import cache

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier, difference_matrix, turning_values
from ocp_traj.curves.families import hermite

ROOM = 1e-6  # relative, by which a duration is above the least: our choice, so that a proof passes


def with_stops(points: Array, reach: Array, rows: int, pieces: int) -> tuple[Array, Array] | None:
    """Hermite pieces along a polyline, at rest at its corners, each edge one polynomial as quick as the limits allow.

    An edge takes as many pieces of even duration as it takes time among the others, one or more.

    Args:
        points: corners, ends included ``(W, n)``, none twice in a row.
        reach: least bound, of both ways, on derivatives 1, 2, .. of each joint ``(M, n)``, infinite for none.
        rows: of a state, q and its derivatives: the pieces are of degree ``2 rows - 1``.
        pieces: of the whole.

    Returns:
        Durations ``(pieces,)`` and states ``(pieces + 1, rows, n)``; None where there are more edges than pieces.
    """
    steps = np.diff(points, axis=0)
    if len(steps) > pieces:
        return None
    peaks = _peaks(rows)
    orders = np.arange(1, min(len(reach), len(peaks)) + 1)
    share = np.abs(steps)[:, None] * peaks[orders - 1][:, None] / reach[orders - 1]  # (edges, M, n)
    times = (share.max(axis=2) ** (1.0 / orders)).max(axis=1) * (1.0 + ROOM)
    times = np.where(times > 0.0, times, np.abs(steps).max(axis=1))
    counts = np.ones(len(steps), dtype=int)
    while counts.sum() < pieces:
        counts[np.argmax(times / counts)] += 1
    law = _law(rows)
    states = np.zeros((pieces + 1, rows, points.shape[1]))
    states[-1, 0], first = points[-1], 0
    for edge, step, time, count in zip(points, steps, times, counts, strict=False):
        for i in range(count):
            for order in range(rows):
                states[first + i, order] = law.at(0, np.array([i / count]), order)[0] * step / time**order
        states[first : first + count, 0] += edge
        first += count
    return np.repeat(times / counts, counts), states


@cache
def _law(rows: int) -> PiecewiseBezier:
    ends = np.zeros((2, rows, 1))
    ends[1, 0] = 1.0
    return hermite(list(ends), np.ones(1))


@cache
def _peaks(rows: int) -> Array:
    """The largest sizes of derivatives 1, 2, .. of a law from 0 to 1 in one second, at rest at both ends."""
    points = np.asarray(_law(rows).control_points[0])
    degree = len(points) - 1
    return np.array([
        np.abs(turning_values(difference_matrix(degree, order) @ points)[1]).max() for order in range(1, degree + 1)
    ])  # fmt: skip
