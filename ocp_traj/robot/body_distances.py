"""Nearest points and separating directions of many pairs of convex cores at once.

Everything here is a float computation that proves nothing: ``ocp_traj.proof.separation`` takes the direction and the
points, and computes anew, with a bound of the rounding, what follows from them. Segments (points included) with
segments and boxes, and anything with half-spaces, are in closed form, boxes with boxes by their edges; a segment and a
cylinder by bisection of the distance's slope along the segment; cylinders with boxes and cylinders by ``coal``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.robot.bodies import CYLINDER, HALF_SPACE, Body

SEGMENTS, BOXES, CYLINDERS, HALF_SPACES = range(4)
BISECTIONS = 52  # of a segment: down to rounding
POLISHING = 20  # projections back and forth, of what coal finds to its tolerance
TOLERANCE = 1e-10  # of coal's iteration

_EDGES = np.array([
    (*corner[:k], 0.0, *corner[k:]) for k in range(3) for corner in product((-1.0, 1.0), repeat=2)
])  # fmt: skip
_RUNS = np.repeat(np.eye(3), 4, axis=0)


@dataclass(frozen=True, eq=False)
class Cores:
    """N cores in the world, or any one frame.

    Attributes:
        group: ``SEGMENTS``, ``BOXES``, .. of each ``(N,)``.
        centre: ``(N, 3)`` [m].
        axes: columns are the core's axes ``(N, 3, 3)``.
        half: half lengths along them ``(N, 3)`` [m].
    """

    group: Index
    centre: Array
    axes: Array
    half: Array

    def take(self, which: Any) -> Cores:
        """Those at some indices."""
        return Cores(self.group[which], self.centre[which], self.axes[which], self.half[which])

    def local(self, points: Array) -> Array:
        """Points ``(N, 3)`` in the cores' own axes."""
        return np.asarray(np.einsum("nij,ni->nj", self.axes, points - self.centre))

    def world(self, local: Array) -> Array:
        """The reverse of ``local``."""
        return np.asarray(self.centre + np.einsum("nij,nj->ni", self.axes, local))

    def project(self, points: Array) -> Array:
        """The nearest points of the cores ``(N, 3)``."""
        return self.world(projected(self.local(points), self.half, self.group == CYLINDERS))

    def shrunk(self, by: Array) -> Cores:
        """Boxes and cylinders whose half lengths are less by ``(N,)`` [m]."""
        return Cores(self.group, self.centre, self.axes, self.half - by[:, None])


def group_of(body: Body) -> int:
    """How distances to a body are found."""
    if body.kind == HALF_SPACE:
        return HALF_SPACES
    if body.kind == CYLINDER:
        return CYLINDERS
    return BOXES if (body.half[:2] > 0.0).any() else SEGMENTS


def placed(bodies: Sequence[Body], rotation: Array, position: Array) -> Cores:
    """Cores of bodies whose joints have rotations ``(N, 3, 3)`` and positions ``(N, 3)``."""
    centre, axes, half = (np.array([getattr(body, name) for body in bodies]) for name in ("centre", "axes", "half"))
    world = np.einsum("nij,nj->ni", rotation, centre) + position
    half = np.where(np.isfinite(half), half, 0.0)
    return Cores(np.array([group_of(body) for body in bodies]), world, rotation @ axes, half)


def projected(local: Array, half: Array, cylinder: NDArray[np.bool_]) -> Array:
    """Nearest points of cores of half lengths ``(N, 3)`` to points in their own axes ``(N, 3)``."""
    found = np.clip(local, -half, half)
    if cylinder.any():
        flat = local[cylinder, :2]
        size = np.hypot(flat[:, 0], flat[:, 1])
        radius = half[cylinder, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(size > radius, radius / size, 1.0)
        found[cylinder, :2] = flat * share[:, None]
    return found


def nearest(a: Cores, b: Cores) -> tuple[Array, Array, Array]:
    """Nearest points of both cores of N pairs, and unit directions from b to a, ``(N, 3)`` each.

    Where cores meet the points may be equal, and the direction is that between the centres.
    """
    x, y = np.zeros((2, *a.centre.shape))
    low, high = np.minimum(a.group, b.group), np.maximum(a.group, b.group)
    for first, second in (divmod(kind, 4) for kind in np.unique(4 * low + high).tolist()):
        for swapped in (False, True):
            one, two = (b, a) if swapped else (a, b)
            which = np.flatnonzero((one.group == first) & (two.group == second))
            if not len(which) or (swapped and first == second):
                continue
            points = _NEAREST[first, second](one.take(which), two.take(which))
            (y if swapped else x)[which], (x if swapped else y)[which] = points
    apart = x - y
    size = np.linalg.norm(apart, axis=1)
    centres = a.centre - b.centre
    apart = np.where(size[:, None] > 0.0, apart, centres)
    size = np.linalg.norm(apart, axis=1)
    normal = np.where(size[:, None] > 0.0, apart / np.where(size > 0.0, size, 1.0)[:, None], np.eye(3)[2])
    normal = np.where((b.group == HALF_SPACES)[:, None], b.axes[:, :, 2], normal)
    normal = np.where((a.group == HALF_SPACES)[:, None], -a.axes[:, :, 2], normal)
    return x, y, normal


def _runs(cores: Cores) -> Array:
    """From the middle of segments to their ends ``(N, 3)``."""
    return np.asarray(cores.axes[:, :, 2] * cores.half[:, 2:])


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", x, y))


def _share(numerator: Array, denominator: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.clip(np.where(denominator > 0.0, numerator / denominator, 0.0), -1.0, 1.0)


def _segment_segment(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The best of five: both inside, and each end of each, with the point of the other nearest to it.

    Where segments are nearly parallel the first is ill-conditioned, and one of the others as good.
    """
    d1, d2, r = _runs(a), _runs(b), a.centre - b.centre
    aa, bb, ab, ar, br = _dot(d1, d1), _dot(d2, d2), _dot(d1, d2), _dot(d1, r), _dot(d2, r)
    inner = _share(ab * br - ar * bb, aa * bb - ab * ab)
    inner = _share(ab * _share(ab * inner + br, bb) - ar, aa)
    one, zero = np.ones_like(aa), np.zeros_like(aa)
    s = np.stack([inner, one, -one, *(_share(t * ab - ar, aa) for t in (one, -one, zero))])
    t = _share(s * ab + br, bb)
    x, y = a.centre + s[..., None] * d1, b.centre + t[..., None] * d2
    best = np.argmin(((x - y) ** 2).sum(axis=2), axis=0), np.arange(len(aa))
    return x[best], y[best]


def _segment_box(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The slope of the squared distance along a segment is monotone and linear between where it passes faces."""
    start, run, half = b.local(a.centre), np.einsum("nij,ni->nj", b.axes, _runs(a)), b.half
    s = _box_share(start, run, half)
    x = start + s[:, None] * run
    return a.centre + s[:, None] * _runs(a), b.world(np.clip(x, -half, half))


def _box_share(start: Array, run: Array, half: Array) -> Array:
    """Where in [-1, 1] segments ``start + s run`` are nearest to boxes, all in the boxes' axes."""
    one = np.ones((len(start), 1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        passes = np.concatenate([(half - start) / run, (-half - start) / run], axis=1)
    passes = np.sort(np.concatenate([-one, np.clip(np.nan_to_num(passes, nan=1.0), -1.0, 1.0), one], axis=1), axis=1)
    points = start[:, None] + passes[..., None] * run[:, None]
    slope = ((points - np.clip(points, -half[:, None], half[:, None])) * run[:, None]).sum(axis=2)
    last = np.clip((slope <= 0.0).sum(axis=1) - 1, 0, 6)
    each = np.arange(len(start))
    low, high = slope[each, last], slope[each, last + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.where(high > low, -low / (high - low), 0.0), 0.0, 1.0)
    return np.asarray(passes[each, last] + share * (passes[each, last + 1] - passes[each, last]))


def _segment_cylinder(a: Cores, b: Cores) -> tuple[Array, Array]:
    s = np.zeros(len(a.centre))
    long = a.half[:, 2] > 0.0
    if long.any():
        s[long] = _cylinder_share(a.take(long), b.take(long))
    x = a.centre + s[:, None] * _runs(a)
    return x, b.project(x)


def _cylinder_share(a: Cores, b: Cores) -> Array:
    """Where in [-1, 1] segments are nearest to cylinders: where the slope of the distance changes its sign."""
    start, run = b.local(a.centre), np.einsum("nij,ni->nj", b.axes, _runs(a))
    round_ = np.ones(len(start), dtype=bool)
    low, high = -np.ones(len(start)), np.ones(len(start))
    for _ in range(BISECTIONS):
        s = 0.5 * (low + high)
        x = start + s[:, None] * run
        rising = _dot(x - projected(x, b.half, round_), run) > 0.0
        low, high = np.where(rising, low, s), np.where(rising, s, high)
    return np.asarray(0.5 * (low + high))


def _box_box(a: Cores, b: Cores) -> tuple[Array, Array]:
    """Of disjoint boxes one of the nearest points is on an edge, or may be moved to one along a face."""
    (x, y), (v, u) = _edges_box(a, b), _edges_box(b, a)
    first = ((x - y) ** 2).sum(axis=1) <= ((u - v) ** 2).sum(axis=1)
    return np.where(first[:, None], x, u), np.where(first[:, None], y, v)


def _edges_box(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The point of the 12 edges of a that is nearest to b, and that of b."""
    turn = np.einsum("nki,nkj->nij", b.axes, a.axes)
    middle = b.local(a.centre)[:, None] + np.einsum("nij,enj->nei", turn, _EDGES[:, None] * a.half)
    run = np.einsum("nij,enj->nei", turn, _RUNS[:, None] * a.half)
    half = np.repeat(b.half[:, None], 12, axis=1)
    s = _box_share(middle.reshape(-1, 3), run.reshape(-1, 3), half.reshape(-1, 3)).reshape(-1, 12)
    x = middle + s[..., None] * run
    off = x - np.clip(x, -half, half)
    best, each = np.argmin((off**2).sum(axis=2), axis=1), np.arange(len(s))
    local = (_EDGES[best] + s[each, best][:, None] * _RUNS[best]) * a.half
    return a.world(local), b.world(np.clip(x[each, best], -b.half, b.half))


def _by_coal(a: Cores, b: Cores) -> tuple[Array, Array]:
    x, y = np.empty((2, len(a.centre), 3))
    request = coal.DistanceRequest()
    request.gjk_tolerance = request.epa_tolerance = TOLERANCE
    shapes = [[_shape(g, h) for g, h in zip(c.group.tolist(), c.half, strict=True)] for c in (a, b)]
    for k in range(len(x)):
        places = (coal.Transform3s(pin.SE3(c.axes[k], c.centre[k])) for c in (a, b))
        result, (at_a, at_b) = coal.DistanceResult(), places
        coal.distance(shapes[0][k], at_a, shapes[1][k], at_b, request, result)
        x[k], y[k] = result.getNearestPoint1(), result.getNearestPoint2()
    x, y = np.where(np.isfinite(x), x, a.centre), np.where(np.isfinite(y), y, b.centre)
    x = a.project(x)
    for _ in range(POLISHING):
        y = b.project(x)
        x = a.project(y)
    return x, y


def _shape(group: int, half: Array) -> Any:
    return coal.Cylinder(half[0], 2.0 * half[2]) if group == CYLINDERS else coal.Box(*(2.0 * half))


def _half_space(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The deepest point of a, and its foot on the face of b."""
    normal = b.axes[:, :, 2]
    along = np.einsum("nij,ni->nj", a.axes, normal)
    local = -np.sign(along) * a.half
    round_ = a.group == CYLINDERS
    size = np.hypot(along[:, 0], along[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        rim = np.where(size[:, None] > 0.0, -along[:, :2] / size[:, None] * a.half[:, :1], 0.0)
    local[round_, :2] = rim[round_]
    x = a.world(local)
    return x, x - _dot(x - b.centre, normal)[:, None] * normal


_NEAREST = {
    (SEGMENTS, SEGMENTS): _segment_segment, (SEGMENTS, BOXES): _segment_box, (SEGMENTS, CYLINDERS): _segment_cylinder,
    (BOXES, BOXES): _box_box, (BOXES, CYLINDERS): _by_coal, (CYLINDERS, CYLINDERS): _by_coal,
    **{(group, HALF_SPACES): _half_space for group in range(4)},
}  # fmt: skip
