"""Nearest points and separating directions of many pairs of convex cores at once.

The one place where they are found: ``nearest_features`` adds to them what the optimiser needs, and everything is a
float computation that proves nothing: ``ocp_traj.proof.separation`` takes the direction and the points, and computes
anew, with a bound of the rounding, what follows from them. Segments (points included) with segments and boxes, and
anything with half-spaces, are in closed form, boxes with boxes by their edges; a segment and a cylinder by bisection of
the distance's slope along the segment; cylinders with boxes and cylinders by ``coal``. Where a stretch of a segment is
as near as any of its points, along a parallel segment, face or edge, it is the middle of the stretch.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.robot.cores import BOXES, CYLINDERS, HALF_SPACES, SEGMENTS, Cores, dot, projected

BISECTIONS = 52  # of a segment: down to rounding
POLISHING = 8  # rounds of projections back and forth, of what coal finds to its tolerance
STEADY = 1.0 - 1e-6  # the greatest ratio of two steps from which the steps to come are summed: our choice
FINE, COARSE = 1e-10, 1e-6  # tolerances of coal's iteration; the second is its own
DOUBTFUL = 1e-9  # [m] gap between points and direction from which another tolerance is tried: our choice
LEVEL = 1e-15  # of lengths: distances that differ by less count as equal, by what floats round
PERPENDICULAR = 1e-14  # of the product of sizes: a slope below is none, by what floats round

_EDGES = np.array([
    (*corner[:k], 0.0, *corner[k:]) for k in range(3) for corner in product((-1.0, 1.0), repeat=2)
])  # fmt: skip
_RUNS = np.repeat(np.eye(3), 4, axis=0)


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
    normal = np.where((b.group == HALF_SPACES)[:, None], b.axis, normal)
    normal = np.where((a.group == HALF_SPACES)[:, None], -a.axis, normal)
    return x, y, normal


def _share(numerator: Array, denominator: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.clip(np.where(denominator > 0.0, numerator / denominator, 0.0), -1.0, 1.0)


def _segment_segment(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The best of five: both inside, and each end of each, with the point of the other nearest to it.

    Where segments are nearly parallel the first is ill-conditioned, and one of the others as good; where they are
    parallel to the last digits, the middle of where they face one another.
    """
    d1, d2, r = a.runs, b.runs, a.centre - b.centre
    aa, bb, ab, ar, br = dot(d1, d1), dot(d2, d2), dot(d1, d2), dot(d1, r), dot(d2, r)
    inner = _share(ab * br - ar * bb, aa * bb - ab * ab)
    inner = _share(ab * _share(ab * inner + br, bb) - ar, aa)
    one = np.ones_like(aa)
    ends = _share(ab - ar, aa), _share(-ab - ar, aa)
    s = np.stack([0.5 * (ends[0] + ends[1]), inner, one, -one, *ends])
    t = _share(s * ab + br, bb)
    apart = np.linalg.norm(r + s[..., None] * d1 - t[..., None] * d2, axis=2)
    best, each = np.argmin(apart, axis=0), np.arange(len(aa))
    rounding = LEVEL * (np.linalg.norm(r, axis=1) + a.half[:, 2] + b.half[:, 2])
    best = np.where(apart[0] <= apart[best, each] + rounding, 0, best)
    return a.centre + s[best, each][:, None] * d1, b.centre + t[best, each][:, None] * d2


def _segment_box(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The slope of the squared distance along a segment is monotone and linear between where it passes faces."""
    start, run, half = b.local(a.centre), b.turned_in(a.runs), b.half
    s = _box_share(start, run, half, middle=True)
    x = start + s[:, None] * run
    return a.centre + s[:, None] * a.runs, b.world(np.clip(x, -half, half))


def _box_share(start: Array, run: Array, half: Array, *, middle: bool = False) -> Array:
    """Where in [-1, 1] segments ``start + s run`` are nearest to boxes, all in the boxes' axes.

    Args:
        start: their middles ``(N, 3)`` [m].
        run: from there to their ends ``(N, 3)`` [m].
        half: half lengths of the boxes ``(N, 3)`` [m].
        middle: of a stretch that is as near, where there is one; else any of its points.
    """
    one = np.ones((len(start), 1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        passes = np.concatenate([(half - start) / run, (-half - start) / run], axis=1)
    passes = np.sort(np.concatenate([-one, np.clip(np.nan_to_num(passes, nan=1.0), -1.0, 1.0), one], axis=1), axis=1)
    points = start[:, None] + passes[..., None] * run[:, None]
    beyond = points - np.clip(points, -half[:, None], half[:, None])
    slope = dot(beyond, run[:, None])
    last = np.clip((slope <= 0.0).sum(axis=1) - 1, 0, 6)
    each = np.arange(len(start))
    low, high = slope[each, last], slope[each, last + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(np.where(high > low, -low / (high - low), 0.0), 0.0, 1.0)
    root = passes[each, last] + share * (passes[each, last + 1] - passes[each, last])
    if not middle:
        return np.asarray(root)
    # Where the slope vanishes on a stretch: it only rises, so that the stretch has no gaps.
    level = np.abs(slope) <= PERPENDICULAR * np.abs(run).sum(axis=1)[:, None] * np.abs(beyond).max(axis=2)
    several = np.flatnonzero(level.sum(axis=1) > 1)
    if len(several):
        least = np.where(level[several], passes[several], np.inf).min(axis=1)
        root[several] = 0.5 * (least + np.where(level[several], passes[several], -np.inf).max(axis=1))
    return np.asarray(root)


def _segment_cylinder(a: Cores, b: Cores) -> tuple[Array, Array]:
    s = np.zeros(len(a.centre))
    long = np.flatnonzero(a.half[:, 2] > 0.0)
    if len(long):
        segments, solid = a.take(long), b.take(long)
        s[long] = _cylinder_share(solid.local(segments.centre), solid.turned_in(segments.runs), solid.half)
    x = a.centre + s[:, None] * a.runs
    return x, b.project(x)


def _cylinder_share(start: Array, run: Array, half: Array) -> Array:
    """As ``_box_share``, of cylinders: where the slope of the distance changes its sign."""
    (x, y, z), (along_x, along_y, along_z), (radius, _, height) = start.T, run.T, half.T
    low, high = -np.ones(len(start)), np.ones(len(start))
    for _ in range(BISECTIONS):
        s = 0.5 * (low + high)
        at_x, at_y, at_z = x + s * along_x, y + s * along_y, z + s * along_z
        off = np.maximum(np.sqrt(at_x * at_x + at_y * at_y), radius)
        slope = (at_x * along_x + at_y * along_y) * (1.0 - radius / off)
        rising = slope + (at_z - np.clip(at_z, -height, height)) * along_z > 0.0
        low, high = np.where(rising, low, s), np.where(rising, s, high)
    return np.asarray(0.5 * (low + high))


def _box_box(a: Cores, b: Cores) -> tuple[Array, Array]:
    """Of disjoint boxes one of the nearest points is on an edge, or may be moved to one along a face."""
    (x, y), (v, u) = _edges_solid(a, b), _edges_solid(b, a)
    first = ((x - y) ** 2).sum(axis=1) <= ((u - v) ** 2).sum(axis=1)
    return np.where(first[:, None], x, u), np.where(first[:, None], y, v)


def _cylinder_box(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The best of the box's edges, and of the cylinder's chords between its furthest points along the box's axes.

    Where the nearest point of the box is inside a face, that of the cylinder is the furthest against its normal, or may
    be moved there or to an edge. Where they meet and no edge meets the cylinder, the furthest point is in the box, or a
    whole section of the cylinder is in a face, and a point of the chord with it.
    """
    y, x = _edges_solid(b, a)
    start = b.local(a.centre)
    for k in range(3):
        run = b.turned_in(a.turned_out(_furthest(a, b.axes[:, :, k])))
        chord = start + _box_share(start, run, b.half)[:, None] * run
        on_box = np.clip(chord, -b.half, b.half)
        better = (((chord - on_box) ** 2).sum(axis=1) < ((x - y) ** 2).sum(axis=1))[:, None]
        x, y = np.where(better, b.world(chord), x), np.where(better, b.world(on_box), y)
    return x, y


def _edges_solid(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The point of the 12 edges of boxes a that is nearest to boxes or cylinders b, and that of b."""
    round_ = b.group[0] == CYLINDERS
    turn = np.einsum("nki,nkj->nij", b.axes, a.axes)
    middle = b.local(a.centre)[:, None] + np.einsum("nij,enj->nei", turn, _EDGES[:, None] * a.half)
    run = np.einsum("nij,enj->nei", turn, _RUNS[:, None] * a.half)
    half = np.repeat(b.half[:, None], 12, axis=1).reshape(-1, 3)
    s = (_cylinder_share if round_ else _box_share)(middle.reshape(-1, 3), run.reshape(-1, 3), half).reshape(-1, 12)
    x = middle + s[..., None] * run
    on_b = projected(x.reshape(-1, 3), half, np.full(len(half), round_)).reshape(x.shape)
    best, each = np.argmin(((x - on_b) ** 2).sum(axis=2), axis=1), np.arange(len(s))
    local = (_EDGES[best] + s[each, best][:, None] * _RUNS[best]) * a.half
    return a.world(local), b.world(on_b[each, best])


def _cylinder_cylinder(a: Cores, b: Cores) -> tuple[Array, Array]:
    """Of ``coal``'s points at two tolerances the better: at the finer it misses some pairs that overlap."""
    x, y = _polished(a, b, _by_coal(a, b, FINE))
    apart = np.linalg.norm(x - y, axis=1)
    doubtful = np.flatnonzero((apart > 0.0) & (_gap(a, b, x, y) > DOUBTFUL))
    if len(doubtful):
        one, two = a.take(doubtful), b.take(doubtful)
        v, u = _polished(one, two, _by_coal(one, two, COARSE))
        better = (np.linalg.norm(v - u, axis=1) < apart[doubtful])[:, None]
        x[doubtful], y[doubtful] = np.where(better, v, x[doubtful]), np.where(better, u, y[doubtful])
    return x, y


def _gap(a: Cores, b: Cores, x: Array, y: Array) -> Array:
    """By how much the distance of points exceeds that of the cores at most ``(N,)`` [m]."""
    apart = x - y
    between = dot(b.turned_out(_furthest(b, apart)) - a.turned_out(_furthest(a, -apart)) + b.centre - a.centre, apart)
    size = np.linalg.norm(apart, axis=1)
    return np.asarray(size + between / np.where(size > 0.0, size, 1.0))


def _polished(a: Cores, b: Cores, x: Array) -> tuple[Array, Array]:
    """Nearest points from one near by, projected back and forth; what that leaves shrinks by a steady ratio."""
    x = a.project(x)
    for _ in range(POLISHING):
        first = a.project(b.project(x))
        second = a.project(b.project(first))
        before, after = first - x, second - first
        size = dot(before, before)
        ratio = np.clip(dot(after, before) / np.where(size > 0.0, size, 1.0), 0.0, STEADY)
        further = a.project(second + (ratio / (1.0 - ratio))[:, None] * after)
        lengths = [np.linalg.norm(points - b.project(points), axis=1) for points in (further, second)]
        x = np.where((lengths[0] < lengths[1])[:, None], further, second)
    return x, b.project(x)


def _by_coal(a: Cores, b: Cores, tolerance: float) -> Array:
    """Points of a that ``coal`` finds nearest to b ``(N, 3)``."""
    request = coal.DistanceRequest()
    request.gjk_tolerance = request.epa_tolerance = tolerance
    points = [coal_distance(a, b, k, request)[1].getNearestPoint1() for k in range(len(a.centre))]
    x = np.array(points).reshape(-1, 3)
    return np.where(np.isfinite(x), x, a.centre)


def coal_distance(a: Cores, b: Cores, k: int, request: Any) -> tuple[float, Any]:
    """Signed distance of the k-th pair of cylinders and boxes [m], and ``coal``'s whole result."""
    placed = []
    for cores in (a, b):
        half = cores.half[k]
        shape = coal.Cylinder(half[0], 2.0 * half[2]) if cores.group[k] == CYLINDERS else coal.Box(*(2.0 * half))
        placed += [shape, coal.Transform3s(pin.SE3(cores.axes[k], cores.centre[k]))]
    result = coal.DistanceResult()
    return float(coal.distance(*placed, request, result)), result


def _half_space(a: Cores, b: Cores) -> tuple[Array, Array]:
    """The deepest point of a, and its foot on the face of b."""
    normal = b.axis
    x = a.world(_furthest(a, -normal))
    return x, x - dot(x - b.centre, normal)[:, None] * normal


def _furthest(cores: Cores, direction: Array) -> Array:
    """The furthest points along directions ``(N, 3)``, in the cores' own axes; the middle of those as far."""
    along = cores.turned_in(direction)
    local = np.sign(along) * cores.half
    round_ = cores.group == CYLINDERS
    size = np.hypot(along[:, 0], along[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        rim = np.where(size[:, None] > 0.0, along[:, :2] / size[:, None] * cores.half[:, :1], 0.0)
    local[round_, :2] = rim[round_]
    return local


_NEAREST = {
    (SEGMENTS, SEGMENTS): _segment_segment, (SEGMENTS, CYLINDERS): _segment_cylinder, (SEGMENTS, BOXES): _segment_box,
    (CYLINDERS, CYLINDERS): _cylinder_cylinder, (CYLINDERS, BOXES): _cylinder_box, (BOXES, BOXES): _box_box,
    **{(group, HALF_SPACES): _half_space for group in range(4)},
}  # fmt: skip
