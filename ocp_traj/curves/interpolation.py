"""What a controller makes of points in time: lines, cubics or quintics between them, by what each point gives.

Two states of q and its first c derivatives have one polynomial of degree 2 c + 1 between them: a line, a cubic, a
quintic. Its control points are q, q + v T/n, .. from either end; Farin (2002), sect. 5.3 and 7.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import PiecewiseBezier, elevation_matrix
from ocp_traj.errors import InputError, quoted

INTERPOLATIONS = {"linear": 0, "cubic": 1, "quintic": 2}  # and how many derivatives are continuous


def continuity_of(interpolation: str) -> int:
    """How many derivatives do not jump at the points; an unknown interpolation is refused."""
    if interpolation not in INTERPOLATIONS:
        raise InputError(f"the interpolation is {quoted(interpolation)}; give {', '.join(INTERPOLATIONS)}")
    return INTERPOLATIONS[interpolation]


def segments_between(durations: Array, states: Sequence[Array]) -> Array:
    """Control points between the states ``(K + 1, dof)`` of q, v, .. and the next: ``(K, 2 c + 2, dof)``."""
    q, *rates = states
    n, t = 2 * len(states) - 1, durations[:, None]
    if not rates:
        return np.stack([q[:-1], q[1:]], axis=1)
    begin, end = q[:-1], q[1:]
    first, last = rates[0][:-1] * t / n, rates[0][1:] * t / n
    if len(rates) == 1:
        return np.stack([begin, begin + first, end - last, end], axis=1)
    bend, bent = (a * t**2 / (n * (n - 1)) for a in (rates[1][:-1], rates[1][1:]))
    inner = begin + 2.0 * first + bend, end - 2.0 * last + bent
    return np.stack([begin, begin + first, *inner, end - last, end], axis=1)


def interpolate(durations: Array, states: Sequence[Array]) -> PiecewiseBezier:
    """The curve through K + 1 states.

    Args:
        durations: of the K segments [s].
        states: q, and where given v and a, ``(K + 1, dof)`` each.
    """
    return PiecewiseBezier(durations, tuple(segments_between(durations, states)))


def sub_arcs(points: Array, a: Array, b: Array) -> Array:
    """Control points of N arcs [a, b] of one segment ``(n + 1, dof)``: ``(N, n + 1, dof)``.

    Entry i is the blossom of i arguments b and n - i arguments a; Farin (2002), sect. 4.6.
    """
    rows = []
    for i in range(len(points)):
        left = np.broadcast_to(points, (len(a), *points.shape))
        for place in [b] * i + [a] * (len(points) - 1 - i):
            u = place[:, None, None]
            left = (1.0 - u) * left[:, :-1] + u * left[:, 1:]
        rows.append(left[:, 0])
    return np.stack(rows, axis=1)


def largest_distance(segments: Array, others: Array) -> Array:
    """A bound of the largest difference of any joint between arcs of equal local time ``(N,)``, to rounding.

    Args:
        segments: control points ``(N, n + 1, dof)``.
        others: likewise, of any degree.
    """
    n = max(segments.shape[1], others.shape[1]) - 1
    raised = [elevation_matrix(points.shape[1] - 1, n) @ points for points in (segments, others)]
    return np.asarray(np.abs(raised[0] - raised[1]).max(axis=(1, 2)))


def cut_at(curve: PiecewiseBezier, times: Array) -> tuple[PiecewiseBezier, Index, Array, Array]:
    """The same curve, cut at more times inside it.

    Args:
        curve: numeric.
        times: where [s], ascending; those within 1e-12 of the duration of a knot cut nothing.

    Returns:
        The curve in pieces; of each piece the segment it was cut from, and where on it, from ``a`` to ``b``.
    """
    near, pieces, sources, starts, ends = 1e-12 * curve.duration, [], [], [], []
    for k, (begin, end) in enumerate(pairwise(curve.knots.tolist())):
        inside = times[(times > begin + near) & (times < end - near)]
        marks = np.concatenate([[0.0], (inside - begin) / (end - begin), [1.0]])
        arcs = sub_arcs(curve.control_points[k], marks[:-1], marks[1:]) if len(inside) else [curve.control_points[k]]
        pieces += list(arcs)
        sources += [k] * len(arcs)
        starts += marks[:-1].tolist()
        ends += marks[1:].tolist()
    a, b = np.array(starts), np.array(ends)
    source = np.array(sources)
    return PiecewiseBezier((b - a) * curve.durations[source], tuple(pieces)), source, a, b
