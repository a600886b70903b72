"""Capsules that enclose a mesh, cut by parallel planes into slabs with a capsule each while that makes them smaller.

A slab is cut with its triangles, so that the capsules enclose the surface and, as each holds the convex hull of its
slab, the solid inside it as well. How far a capsule stands off is the one-sided Hausdorff distance from it to the
convex hull H of its slab, the largest ``h_capsule(n) - h_H(n)`` of the support functions over all directions n.

Flat ends keep capsules off: one that holds a disc of radius R, whatever its own radius r > R, stands off it by
``r - sqrt(r^2 - R^2)``, and one that holds a right-angled edge by 0.29 r. Housings of a robot's joints are such discs,
of 60 mm: within 5 mm of them there would have to be more than 60 capsules each, as cuts by planes go. So the number of
slabs is that which leaves the least volume, with a price on each. Where cylinders are allowed a slab is in the smaller
of a capsule and a cylinder, which fits such housings closely.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError

STANDOFF = 0.005  # [m] capsules that stand off no more are not cut further
MOST = 8  # capsules a mesh, at most: our choice
GAIN = 0.95  # share of the volume that each capsule more has to leave, at most: our choice
ROUNDING = 1e-9  # [m] by which radii are larger than needed: far above what cutting and fitting round
WIDER = (1.0, 1.03, 1.08, 1.15, 1.3)  # radii tried, over the least: a wider capsule is shorter
TURNS = 40  # steps towards the centre of the least circle


@dataclass(frozen=True, eq=False)
class FittedCapsule:
    """A capsule, or a cylinder, from ``start (3,)`` to ``end (3,)`` around a slab of a mesh [m].

    Attributes:
        volume: [m^3].
        flat: whether it is a cylinder.
        points: what it is around ``(n, 3)`` [m].
    """

    start: Array
    end: Array
    radius: float
    volume: float
    flat: bool
    points: Array

    @cached_property
    def standoff(self) -> float:
        """How far it reaches beyond the hull of its slab, over a net of 400 directions some 0.1 rad apart [m]."""
        middle = 0.5 * (self.start + self.end)
        ahead, behind = _NET @ (self.start - middle), _NET @ (self.end - middle)
        reach, size = np.maximum(ahead, behind), float(np.linalg.norm(self.end - self.start))
        if self.flat:
            along = _NET @ (self.end - self.start) / size
            reach = reach + self.radius * np.sqrt(np.maximum(1.0 - along**2, 0.0))
        else:
            reach = reach + self.radius
        return float((reach - (_NET @ (self.points - middle).T).max(axis=1)).max())


@one_blas_thread
def fit_capsules(
    triangles: Array, standoff: float = STANDOFF, most: int = MOST, cylinders: bool = False
) -> tuple[list[FittedCapsule], list[Array]]:
    """Capsules, each with the triangles ``(M, 3, 3)`` of the slab that it encloses; see the module.

    Args:
        triangles: of the mesh ``(N, 3, 3)`` [m].
        standoff: fewest capsules that stand off no more are taken, where there are some [m].
        most: capsules.
        cylinders: whether they may be cylinders.
    """
    corners = np.asarray(triangles, dtype=float)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners) or not np.isfinite(corners).all():
        raise InputError(f"a mesh has triangles of shape {corners.shape}; give (N, 3, 3) finite numbers, N >= 1")
    if most < 1 or not standoff >= 0.0:
        raise InputError(f"capsules are to stand off {standoff} m, {most} at most; give zero or more, and one or more")
    tried = [[corners]]
    if _fit(tried[0], cylinders)[0].standoff > standoff:
        tried += [_slabs(corners, axis, count) for axis in _principal(_points(corners)) for count in range(2, most + 1)]
    fits = [_fit(slabs, cylinders) for slabs in tried]
    near = [k for k, fit in enumerate(fits) if all(capsule.standoff <= standoff for capsule in fit)]
    if near:
        best = min(near, key=lambda k: len(fits[k]))
    else:
        best = min(range(len(fits)), key=lambda k: sum(c.volume for c in fits[k]) / GAIN ** len(fits[k]))
    return fits[best], tried[best]


def clipped(triangles: Array, normal: Array, offset: float) -> Array:
    """The triangles ``(M, 3, 3)`` that cover the parts of some others with ``normal . x <= offset``."""
    height = triangles @ normal - offset
    inside = height <= 0.0
    count = inside.sum(axis=1)
    pieces = [triangles[count == 3]]
    for alone, wanted in ((True, 1), (False, 2)):
        chosen = count == wanted
        corner = np.argmax(inside[chosen] == alone, axis=1)  # the one that is on its side alone comes first
        order = (corner[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(triangles[chosen], order[..., None], axis=1).swapaxes(0, 1)
        h = np.take_along_axis(height[chosen], order, axis=1)
        ab, ac = (a + (end - a) * (h[:, 0] / (h[:, 0] - h[:, k]))[:, None] for k, end in ((1, b), (2, c)))
        pieces += [np.stack([a, ab, ac], 1)] if alone else [np.stack([ab, b, c], 1), np.stack([ab, c, ac], 1)]
    return np.concatenate(pieces)


def _net() -> Array:
    """Directions ``(N, 3)`` spread over the sphere by the golden angle."""
    i = np.arange(400) + 0.5
    z, turn = 1.0 - 2.0 * i / len(i), np.pi * (1.0 + np.sqrt(5.0)) * i
    return np.stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z], axis=1)


_NET, _LINE = _net(), (0.5412841283, 0.7297261471, 0.4180339887)


def _points(triangles: Array) -> Array:
    """Corners of triangles, most of them once: of those with one place along a line of no meaning, one."""
    corners = triangles.reshape(-1, 3)
    places = corners[:, 0] * _LINE[0] + corners[:, 1] * _LINE[1] + corners[:, 2] * _LINE[2]
    return np.asarray(corners[np.unique(places, return_index=True)[1]])


def _principal(points: Array) -> Array:
    """Rows are the principal axes ``(3, 3)`` of a cloud of points."""
    centred = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(centred.T @ centred)[1].T)


def _smallest(corners: Array, points: Array, cylinders: bool) -> FittedCapsule:
    """The capsule, or cylinder, of least volume around corners ``(m, 3)``, of some axes and radii.

    It is looked for around some of them, ``points (n, 3)``, and then made to hold all.
    """
    axes = np.concatenate([np.eye(3), _principal(points)])
    first = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
    first = first - (first * axes).sum(axis=1)[:, None] * axes
    first /= np.linalg.norm(first, axis=1)[:, None]
    across = np.stack([first, np.cross(axes, first)], axis=1)  # (axes, 2, 3)
    flat, height = across @ points.T, axes @ points.T
    centre, each = flat.mean(axis=2), np.arange(len(axes))
    for step in range(TURNS):  # Badoiu and Clarkson (2003): a step towards the farthest point, ever shorter
        farthest = np.argmax(((flat - centre[..., None]) ** 2).sum(axis=1), axis=1)
        centre = centre + (flat[each, :, farthest] - centre) / (step + 2)
    off2 = ((flat - centre[..., None]) ** 2).sum(axis=1)
    radius = np.sqrt(off2.max(axis=1))[:, None] * np.array(WIDER)
    reach = np.sqrt(np.maximum(radius[..., None] ** 2 - off2[:, None], 0.0))
    high, low = (height[:, None] - reach).max(axis=2), (height[:, None] + reach).min(axis=2)
    high, low = np.maximum(high, 0.5 * (high + low)), np.minimum(low, 0.5 * (high + low))
    volume = np.pi * radius**2 * (high - low) + 4.0 / 3.0 * np.pi * radius**3
    k, w = divmod(int(np.argmin(volume)), len(WIDER))
    if cylinders:
        span = height.max(axis=1) - height.min(axis=1)
        flat_volume = np.pi * off2.max(axis=1) * span
        best = int(np.argmin(flat_volume))
        if flat_volume[best] < volume[k, w]:
            return _cylinder(corners, points, axes[best], centre[best] @ across[best])
    ends = [centre[k] @ across[k] + end * axes[k] for end in (low[k, w], high[k, w])]
    span = ends[1] - ends[0]
    length2 = float(span @ span)
    along = np.clip((corners - ends[0]) @ span / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(len(corners))
    least = float(np.linalg.norm(corners - ends[0] - along[:, None] * span, axis=1).max()) + ROUNDING
    return FittedCapsule(ends[0], ends[1], least, float(volume[k, w]), False, points)


def _cylinder(corners: Array, points: Array, axis: Array, foot: Array) -> FittedCapsule:
    """The cylinder around corners ``(m, 3)`` whose axis runs through a point; see ``ROUNDING``."""
    height, across = corners @ axis, corners - foot - ((corners - foot) @ axis)[:, None] * axis
    radius = float(np.linalg.norm(across, axis=1).max()) + ROUNDING
    low, high = float(height.min()) - ROUNDING, float(height.max()) + ROUNDING
    base = foot - (foot @ axis) * axis
    volume = float(np.pi * radius**2 * (high - low))
    return FittedCapsule(base + low * axis, base + high * axis, radius, volume, True, points)


def _fit(slabs: list[Array], cylinders: bool) -> list[FittedCapsule]:
    return [_smallest(slab.reshape(-1, 3), _points(slab), cylinders) for slab in slabs]


def _slabs(triangles: Array, axis: Array, count: int) -> list[Array]:
    """The triangles between planes across an axis, as far apart; slabs without any are left out."""
    height = triangles @ axis
    rest, slabs = triangles, []
    for offset in np.linspace(float(height.min()), float(height.max()), count + 1)[1:-1].tolist():
        slabs.append(clipped(rest, axis, offset))
        rest = clipped(rest, -axis, -offset)
    return [slab for slab in (*slabs, rest) if len(slab)]
