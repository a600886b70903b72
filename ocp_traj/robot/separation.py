"""Signed distances of segments, boxes, cylinders and half-spaces, many pairs at once, with what is nearest to what.

Two convex cores a and b are nearest in features: a point, an edge or a face of each. While the features stay, the
distance is a smooth function of where the bodies are,

    w = p_a - p_b,  d = n . w                           where a face or a fixed normal decides it,
                    d = |w less its part along e_a, e_b|  where points and edges do,

and equal to the distance itself, with its first and second derivatives. Where cores overlap, d < 0 is how far b has to
be moved along n until they touch.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ocp_traj.arrays import Array, Index

PARALLEL = (
    1e-6  # of the sine squared between two edges: below it they count as parallel, and one is a point; our choice
)
TOUCHING = 1e-9  # [m] between cores: below it their direction is no normal; our choice


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

    @classmethod
    def empty(cls, count: int) -> Nearest:
        """Of so many pairs, to be filled."""
        sizes = {name: (count,) if name in ("distance", "flat", "grown") else (count, 3) for name in cls.names()}
        return cls(**{name: np.zeros(size) for name, size in sizes.items()})

    @classmethod
    def names(cls) -> list[str]:
        """Its fields."""
        return [field.name for field in fields(cls)]

    def turned(self, rotation: Array, place: Array) -> Nearest:
        """The same, told in frames turned ``(N, 3, 3)`` and moved ``(N, 3)`` against those it was found in."""

        def turn(vectors: Array) -> Array:
            return np.asarray(np.einsum("nij,nj->ni", rotation, vectors))

        return Nearest(
            self.distance, place + turn(self.point_a), place + turn(self.point_b), turn(self.edge_a), turn(self.edge_b),
            turn(self.normal), self.flat, self.grown,
        )  # fmt: skip

    def put(self, places: Index, found: Nearest) -> None:
        """Writes what was found at some places."""
        for name in self.names():
            getattr(self, name)[places] = getattr(found, name)


def dot(a: Array, b: Array) -> Array:
    """Scalar products of vectors."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def unit(vectors: Array) -> Array:
    """Unit vectors of ``(N, 3)``; zero of those that are zero."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0.0))


def _perpendicular(vectors: Array) -> Array:
    """Some unit vector perpendicular to each of ``(N, 3)``."""
    axis = np.eye(3)[np.argmin(np.abs(vectors), axis=-1)]
    return unit(np.cross(vectors, axis)) + np.where(np.any(vectors != 0.0, axis=-1, keepdims=True), 0.0, axis)


def segment_segment(a: Array, b: Array) -> Nearest:
    """Of segments ``(N, 2, 3)``, a point being one without length; Ericson (2005), sect. 5.1.9.

    Where the cores cross, the normal is perpendicular to both.
    """
    d_a, d_b, r = a[:, 1] - a[:, 0], b[:, 1] - b[:, 0], a[:, 0] - b[:, 0]
    aa, bb, ab = dot(d_a, d_a), dot(d_b, d_b), dot(d_a, d_b)
    c, f = dot(d_a, r), dot(d_b, r)
    long_a, long_b = aa > TOUCHING**2, bb > TOUCHING**2
    safe_a, safe_b = np.where(long_a, aa, 1.0), np.where(long_b, bb, 1.0)
    det = aa * bb - ab * ab
    skew = long_a & long_b & (det > PARALLEL * aa * bb)
    s = np.where(skew, np.clip((ab * f - c * bb) / np.where(skew, det, 1.0), 0.0, 1.0), 0.0)
    # Of parallel segments the middle of where they face one another.
    facing = np.clip(np.stack([-c, ab - c]) / safe_a, 0.0, 1.0).mean(axis=0)
    s = np.where(long_a & ~skew, np.where(long_b, facing, np.clip(-c / safe_a, 0.0, 1.0)), s)
    t = np.where(long_b, (ab * s + f) / safe_b, 0.0)
    outside = (t < 0.0) | (t > 1.0)
    t = np.clip(t, 0.0, 1.0)
    again = np.clip((t * ab - c) / safe_a, 0.0, 1.0)
    s = np.where(long_a & outside, again, s)
    inner_a, inner_b = long_a & (s > 0.0) & (s < 1.0), long_b & (t > 0.0) & (t < 1.0)
    inner_a &= skew | ~inner_b
    point_a, point_b = a[:, 0] + s[:, None] * d_a, b[:, 0] + t[:, None] * d_b
    edge_a, edge_b = unit(d_a) * inner_a[:, None], unit(d_b) * inner_b[:, None]
    apart = point_a - point_b
    distance = np.linalg.norm(apart, axis=1)
    crossing = distance <= TOUCHING
    across = np.cross(d_a, d_b)
    across = np.where((skew & crossing)[:, None], across, _perpendicular(d_a + d_b))
    normal = np.where(crossing[:, None], unit(across), unit(apart))
    clear = np.where(crossing[:, None], 0.0, 1.0)
    distance = np.where(crossing, dot(normal, apart), distance)
    none = np.zeros(len(a))
    return Nearest(distance, point_a, point_b, edge_a * clear, edge_b * clear, normal, crossing.astype(float), none)


def segment_plane(a: Array, normal: Array, offset: Array) -> Nearest:
    """Of segments ``(N, 2, 3)`` from half-spaces normal . x <= offset, which are in the way."""
    heights = np.einsum("nki,ni->nk", a, normal) - offset[:, None]
    return _over_plane(a, heights, normal)


def box_plane(centre: Array, rotation: Array, half: Array, normal: Array, offset: Array) -> Nearest:
    """Of boxes from half-spaces normal . x <= offset; see ``segment_box`` for boxes."""
    corners = np.array([[i, j, k] for i in (-1.0, 1.0) for j in (-1.0, 1.0) for k in (-1.0, 1.0)])
    points = centre[:, None] + np.einsum("nij,nkj->nki", rotation, corners[None] * half[:, None])
    heights = np.einsum("nki,ni->nk", points, normal) - offset[:, None]
    return _over_plane(points, heights, normal)


def _over_plane(points: Array, heights: Array, normal: Array) -> Nearest:
    lowest = np.argmin(heights, axis=1)
    rows = np.arange(len(points))
    distance, point = heights[rows, lowest], points[rows, lowest]
    return by_normal(distance, point, normal)


def by_normal(distance: Array, point_a: Array, normal: Array) -> Nearest:
    """Of points of a at distances along normals that stay."""
    none, count = np.zeros_like(point_a), len(distance)
    point_b = point_a - distance[:, None] * normal
    return Nearest(distance, point_a, point_b, none, none, normal, np.ones(count), np.zeros(count))


def segment_box(a: Array, centre: Array, rotation: Array, half: Array) -> Nearest:
    """Of segments from boxes.

    Args:
        a: ends ``(N, 2, 3)`` [m].
        centre: ``(N, 3)`` [m].
        rotation: ``(N, 3, 3)``, its columns the box's axes.
        half: half its sizes ``(N, 3)`` [m].
    """
    local = np.einsum("nji,nkj->nki", rotation, a - centre[:, None])
    begin, step = local[:, 0], local[:, 1] - local[:, 0]
    t = _nearest_to_box(begin, step, half)
    point = begin + t[:, None] * step
    on_box = np.clip(point, -half, half)
    apart = point - on_box
    distance = np.linalg.norm(apart, axis=1)
    free = np.abs(point) < half
    count = free.sum(axis=1)
    length = np.linalg.norm(step, axis=1)
    inner = (t > 0.0) & (t < 1.0) & (length > TOUCHING)
    edge_a = unit(step) * inner[:, None]
    edge_b = free * (count == 1)[:, None] * 1.0
    parallel = 1.0 - dot(edge_a, edge_b) ** 2 <= PARALLEL
    edge_a = edge_a * ~parallel[:, None]
    flat = (count == 2).astype(float)
    round_ = edge_a * (flat == 0.0)[:, None]
    found = Nearest(distance, point, on_box, round_, edge_b, unit(apart), flat, np.zeros(len(a)))
    inside = np.flatnonzero(distance <= TOUCHING)
    if len(inside):
        found.put(inside, _through_box(begin[inside], step[inside], half[inside]))
    return found.turned(rotation, centre)


def _nearest_to_box(begin: Array, step: Array, half: Array) -> Array:
    """Where in [0, 1] points begin + t step are nearest to a box about the origin ``(N,)``.

    The squared distance is convex, and its slope is linear between the places where a coordinate enters or leaves the
    box's range: its root is found exactly.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.concatenate([(half - begin) / step, (-half - begin) / step], axis=1)
    crossings = np.clip(np.nan_to_num(crossings, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    ends = np.broadcast_to([0.0, 1.0], (len(begin), 2))
    t = np.sort(np.concatenate([crossings, ends], axis=1), axis=1)  # (N, 8)
    points = begin[:, None] + t[:, :, None] * step[:, None]
    beyond = points - np.clip(points, -half[:, None], half[:, None])
    slope = np.einsum("nki,ni->nk", beyond, step)
    # The first place where the slope is no longer negative, and the last where it is not positive.
    first = np.argmax(np.concatenate([slope[:, :-1] >= 0.0, np.ones((len(t), 1), dtype=bool)], axis=1), axis=1)
    rows = np.arange(len(t))
    before = np.maximum(first - 1, 0)
    low, high = slope[rows, before], slope[rows, first]
    share = np.where(high > low, -low / np.where(high > low, high - low, 1.0), 0.0)
    root = t[rows, before] + np.clip(share, 0.0, 1.0) * (t[rows, first] - t[rows, before])
    # Where the slope vanishes on a stretch, along a face or an edge, its middle: both ends are as near.
    size = np.abs(step).sum(axis=1) * (1.0 + np.abs(beyond).max(axis=(1, 2)))
    level = np.abs(slope) <= 1e-14 * size[:, None]
    least, most = np.where(level, t, np.inf).min(axis=1), np.where(level, t, -np.inf).max(axis=1)
    stretch = most > least
    middle = 0.5 * (np.where(stretch, least, 0.0) + np.where(stretch, most, 0.0))
    return np.asarray(np.where(stretch, middle, root))


def _through_box(begin: Array, step: Array, half: Array) -> Nearest:
    """Of segments that run through a box about the origin: the least way out, over its faces and its edges' normals."""
    count = len(begin)
    ends = np.stack([begin, begin + step], axis=1)
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    heights = np.einsum("fi,nki->nfk", faces, ends)
    gaps = heights.min(axis=2) - np.tile(half, 2)  # (N, 6)
    across = np.cross(step[:, None], np.eye(3)[None])  # (N, 3, 3)
    size = np.linalg.norm(across, axis=2, keepdims=True)
    usable = size[:, :, 0] > 1e-6 * (np.linalg.norm(step, axis=1)[:, None] + TOUCHING)
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
    return by_normal(distance, ends[rows, which], normal)
