"""Ways out of one another for convex cores that overlap, many pairs at once: how deep they are and along which normal.

A float computation that proves nothing. Segments are taken out of boxes over faces and edges, which is exact, and out
of cylinders over an end or straight aside; cylinders and boxes out of one another by ``coal``.
"""

from __future__ import annotations

import coal
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.robot.cores import CYLINDERS, SEGMENTS, Cores, dot, unit
from ocp_traj.robot.nearest_points import coal_distance

SHORT = 1e-9  # [m] a length below it has no direction; our choice
PARALLEL = 1e-6  # of the sine between two edges: below it they have no common normal; our choice

Way = tuple[Array, Array, Array, Array]  # signed distances (N,) [m], points of a and of b, unit normals from b to a


def way_out(a: Cores, b: Cores, meeting: Way) -> Way:
    """Of N pairs that overlap, the group of a not after that of b, without half-spaces.

    Args:
        a: the first of each.
        b: the second.
        meeting: what ``nearest`` finds of them.
    """
    found = tuple(values.copy() for values in meeting)
    for first, second in dict.fromkeys(zip(a.group.tolist(), b.group.tolist(), strict=True)):
        here = np.flatnonzero((a.group == first) & (b.group == second))
        one, two, points = a.take(here), b.take(here), (meeting[1][here], meeting[2][here])
        if second == SEGMENTS:
            parts: tuple[Array, ...] = _crossing(one, two, *points)
        elif first == SEGMENTS:
            parts = _through_solid(one, two)
        else:
            parts = _by_coal(one, two, (meeting[0][here], *points, meeting[3][here]))
        for values, part in zip(found, parts, strict=True):
            values[here] = part
    return found[0], found[1], found[2], found[3]


def _crossing(a: Cores, b: Cores, x: Array, y: Array) -> Way:
    """Of segments the normal is perpendicular to both."""
    one, two = a.runs, b.runs
    across = np.cross(one, two)
    skew = dot(across, across) > PARALLEL * dot(one, one) * dot(two, two)
    normal = unit(np.where(skew[:, None], across, _perpendicular(one + two)))
    return dot(normal, x - y), x, y, normal


def _perpendicular(vectors: Array) -> Array:
    """Some unit vector perpendicular to each of ``(N, 3)``."""
    axis = np.eye(3)[np.argmin(np.abs(vectors), axis=-1)]
    return unit(np.cross(vectors, axis)) + np.where(np.any(vectors != 0.0, axis=-1, keepdims=True), 0.0, axis)


def _through_solid(a: Cores, b: Cores) -> Way:
    """Of segments that run through cylinders or boxes, of one group."""
    run = b.turned_in(a.runs)
    begin, method = b.local(a.centre) - run, _through_cylinder if b.group[0] == CYLINDERS else _through_box
    distance, point, normal = method(begin, 2.0 * run, b.half)
    x, normal = b.world(point), b.turned_out(normal)
    return distance, x, x - distance[:, None] * normal, normal


def _by_coal(a: Cores, b: Cores, meeting: Way) -> Way:
    """Of cylinders and boxes: how deep they are ``nearest`` does not tell."""
    distance, x, y, normal = (values.copy() for values in meeting)
    for k in range(len(x)):
        depth, result = coal_distance(a, b, k, coal.DistanceRequest())
        if depth < 0.0:
            distance[k], normal[k] = depth, -np.asarray(result.normal).ravel()
            x[k], y[k] = result.getNearestPoint1(), result.getNearestPoint2()
    return distance, x, y, normal


def _through_cylinder(begin: Array, step: Array, half: Array) -> tuple[Array, Array, Array]:
    """Of segments that run through a cylinder about the origin: the least way out, over its ends or straight aside."""
    radius, height = half[:, 0], half[:, 2]
    ends, rows = np.stack([begin, begin + step], axis=1), np.arange(len(begin))
    caps = np.stack([ends[:, :, 2].min(axis=1) - height, -ends[:, :, 2].max(axis=1) - height], axis=1)
    flat = step[:, :2]
    size = (flat**2).sum(axis=1)
    t = np.clip(-(begin[:, :2] * flat).sum(axis=1) / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
    near = begin + t[:, None] * step
    off = np.hypot(near[:, 0], near[:, 1])
    sideways = np.where((off > SHORT)[:, None], near[:, :2], np.column_stack([-flat[:, 1], flat[:, 0]]))
    sideways = np.where((np.abs(sideways).max(axis=1) > 0.0)[:, None], sideways, np.array([1.0, 0.0]))
    radial = np.column_stack([unit(sideways), np.zeros(len(begin))])
    aside, cap = off - radius, np.argmax(caps, axis=1)
    by_cap = caps[rows, cap] >= aside
    normal = np.where(by_cap[:, None], np.where(cap == 0, 1.0, -1.0)[:, None] * np.array([0.0, 0.0, 1.0]), radial)
    which = np.argmin(np.where((cap == 0)[:, None], ends[:, :, 2], -ends[:, :, 2]), axis=1)
    point = np.where(by_cap[:, None], ends[rows, which], near)
    return np.where(by_cap, caps[rows, cap], aside), point, normal


def _through_box(begin: Array, step: Array, half: Array) -> tuple[Array, Array, Array]:
    """Of segments that run through a box about the origin: the least way out, over its faces and its edges' normals."""
    count = len(begin)
    ends = np.stack([begin, begin + step], axis=1)
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    heights = np.einsum("fi,nki->nfk", faces, ends)
    gaps = heights.min(axis=2) - np.tile(half, 2)  # (N, 6)
    across = np.cross(step[:, None], np.eye(3)[None])  # (N, 3, 3)
    size = np.linalg.norm(across, axis=2, keepdims=True)
    usable = size[:, :, 0] > PARALLEL * (np.linalg.norm(step, axis=1)[:, None] + SHORT)
    across = np.where(usable[:, :, None], across / np.where(size > 0.0, size, 1.0), 0.0)
    across = np.concatenate([across, -across], axis=1)  # (N, 6, 3)
    reach = np.einsum("nfi,ni->nf", np.abs(across), half)
    edge_gaps = np.einsum("nfi,ni->nf", across, begin) - reach
    edge_gaps = np.where(np.tile(usable, 2), edge_gaps, -np.inf)
    rows = np.arange(count)
    face, edge = np.argmax(gaps, axis=1), np.argmax(edge_gaps, axis=1)
    by_face = gaps[rows, face] >= edge_gaps[rows, edge]
    normal = np.where(by_face[:, None], faces[face], across[rows, edge])
    distance = np.where(by_face, gaps[rows, face], edge_gaps[rows, edge])
    which = np.where(by_face, np.argmin(heights[rows, face], axis=1), 0)
    return distance, ends[rows, which], normal
