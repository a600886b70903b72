"""What is nearest of pairs of convex cores, many at once: points, edges and faces, signed distances and normals.

Two convex cores a and b are nearest in features: a point, an edge or a face of each. While the features stay, the
distance is a smooth function of where the bodies are,

    w = p_a - p_b,  d = n . w                           where a face or a fixed normal decides it,
                    d = |w less its part along e_a, e_b|  where points and edges do,

and equal to the distance itself, with its first and second derivatives. Which features they are follows from the
points that ``nearest_points`` finds. Where cores overlap, d < 0 is how far b has to be moved along n until they touch
(``ways_out``).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.robot.cores import BOXES, CYLINDERS, HALF_SPACES, SEGMENTS, Cores, dot
from ocp_traj.robot.nearest_points import nearest
from ocp_traj.robot.ways_out import way_out

PARALLEL = (
    1e-6  # of the sine squared between two edges: below it they count as parallel, and one is a point; our choice
)
TOUCHING = 1e-9  # [m] between cores: below it their direction is no normal; our choice
AT_END = 1e-12  # [m] from an end of a segment: what floats round, with room; our choice


@dataclass(frozen=True, eq=False)
class Nearest:
    """What is nearest of two cores, in the world.

    Attributes:
        distance: ``(N,)`` [m], of the cores, negative where they overlap.
        point_a, point_b: ``(N, 3)`` [m], on either core.
        edge_a, edge_b: ``(N, 3)``, unit vectors along which the point is free to slide; zero for none.
        normal: ``(N, 3)``, unit, from b to a.
        flat: ``(N,)``, 1 where the normal stays as it is fixed to b, 0 where it follows from points and edges.
        grown: ``(N,)`` [m], by which point_b lies inside b's core: the radius of a cylinder whose side is nearest.
    """

    distance: Array
    point_a: Array
    point_b: Array
    edge_a: Array
    edge_b: Array
    normal: Array
    flat: Array
    grown: Array

    def take(self, which: Index) -> Nearest:
        """Those at some indices."""
        return Nearest(*(getattr(self, field.name)[which] for field in fields(self)))

    def put(self, places: Index, found: Nearest) -> None:
        """Writes what was found at some places."""
        for field in fields(self):
            getattr(self, field.name)[places] = getattr(found, field.name)


def nearest_features(a: Cores, b: Cores) -> Nearest:
    """What is nearest of N pairs, the group of a not after that of b; cylinders and boxes by a normal that stays.

    Of segments that run through a cylinder, and of cylinders and boxes that overlap, d is no more than how deep.
    """
    x, y, normal = nearest(a, b)
    none, count = np.zeros_like(x), len(x)
    found = Nearest(dot(x - y, normal), x, y, none, none.copy(), normal, np.ones(count), np.zeros(count))
    apart = found.distance > TOUCHING
    for group, features in ((SEGMENTS, _of_segments), (CYLINDERS, _of_cylinder), (BOXES, _of_box)):
        here = np.flatnonzero(apart & (a.group == SEGMENTS) & (b.group == group))
        if len(here):
            found.put(here, features(a.take(here), b.take(here), found.take(here)))
    meeting = np.flatnonzero(~apart & (b.group != HALF_SPACES))
    if len(meeting):
        known = (found.distance[meeting], x[meeting], y[meeting], normal[meeting])
        ways = way_out(a.take(meeting), b.take(meeting), known)
        told = (found.distance, found.point_a, found.point_b, found.normal)
        for values, way in zip(told, ways, strict=True):
            values[meeting] = way
    return found


def _inner(segments: Cores, points: Array) -> NDArray[np.bool_]:
    """Which points are inside segments, and not at an end ``(N,)``."""
    return np.asarray(np.abs(segments.local(points)[:, 2]) < segments.half[:, 2] - AT_END)


def _skew(one: Array, two: Array) -> NDArray[np.bool_]:
    """Which unit vectors ``(N, 3)``, zero for none, are not parallel."""
    return np.asarray(1.0 - dot(one, two) ** 2 > PARALLEL)


def _of_segments(a: Cores, b: Cores, found: Nearest) -> Nearest:
    inner_a, inner_b = _inner(a, found.point_a), _inner(b, found.point_b)
    inner_a &= ~inner_b | _skew(a.axis, b.axis)
    edges = a.axis * inner_a[:, None], b.axis * inner_b[:, None]
    return Nearest(
        found.distance, found.point_a, found.point_b, *edges, found.normal, np.zeros(len(inner_a)), found.grown
    )  # fmt: skip


def _of_cylinder(a: Cores, b: Cores, found: Nearest) -> Nearest:
    """Points of the side are told by the axis; ends and their rims by a normal that stays."""
    point, height = b.local(found.point_a), b.half[:, 2]
    side = (np.abs(point[:, 2]) < height)[:, None]
    inner = (_inner(a, found.point_a) & _skew(a.axis, b.axis))[:, None]
    on_axis = b.centre + b.axis * point[:, 2:]
    return Nearest(
        found.distance, found.point_a, np.where(side, on_axis, found.point_b), a.axis * (inner & side), b.axis * side,
        found.normal, (~side[:, 0]).astype(float), np.where(side[:, 0], b.half[:, 0], 0.0),
    )  # fmt: skip


def _of_box(a: Cores, b: Cores, found: Nearest) -> Nearest:
    """A point free along two of the box's axes is over a face, along one over an edge."""
    free = np.abs(b.local(found.point_a)) < b.half
    count = free.sum(axis=1)
    edge_b = b.turned_out(free * (count == 1)[:, None])
    edge_a = a.axis * (_inner(a, found.point_a) & _skew(a.axis, edge_b) & (count != 2))[:, None]
    flat = (count == 2).astype(float)
    return Nearest(found.distance, found.point_a, found.point_b, edge_a, edge_b, found.normal, flat, found.grown)
