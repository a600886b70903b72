"""Capsules that enclose a mesh, cut by planes into parts with a capsule each while that makes them smaller.

A part is cut with its triangles, so that the capsules enclose the surface and, as each holds the convex hull of its
part, the solid inside it as well. How far a capsule stands off is the one-sided Hausdorff distance from it to the
convex hull H of its part, the largest ``h_capsule(n) - h_H(n)`` of the support functions over all directions n. A flat
end stands off by much: one of radius R in a capsule of radius r by ``r - sqrt(r^2 - R^2)`` at least, whatever its axis;
so cuts end where they no longer pay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError

STANDOFF = 0.005  # [m] capsules that stand off no more are not cut further
MOST = 6  # capsules a mesh, at most: our choice
GAIN = 0.95  # of the volume at most is left by each capsule more: our choice
ROUNDING = 1e-9  # [m] by which radii are larger than needed: far above what cutting and fitting round
CUTS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of a part's extent, where cuts are tried
WIDER = (1.0, 1.03, 1.08, 1.15, 1.3)  # radii tried, over the least: a wider capsule is shorter
TURNS = 40  # steps towards the centre of the least circle


@dataclass(frozen=True, eq=False)
class FittedCapsule:
    """A capsule from ``start (3,)`` to ``end (3,)`` around a part of a mesh [m].

    Attributes:
        standoff: how far it reaches beyond the hull of its part, at most; see the module.
        volume: [m^3].
    """

    start: Array
    end: Array
    radius: float
    standoff: float
    volume: float


def fit_capsules(
    triangles: Array, standoff: float = STANDOFF, most: int = MOST
) -> tuple[list[FittedCapsule], list[Array]]:
    """Capsules, each with the triangles ``(N, 3, 3)`` of the part that it encloses; the largest part is first.

    Args:
        triangles: of the mesh ``(N, 3, 3)`` [m].
        standoff: a part whose capsule stands off no more is not cut [m].
        most: capsules.
    """
    corners = np.asarray(triangles, dtype=float)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners) or not np.isfinite(corners).all():
        raise InputError(f"a mesh has triangles of shape {corners.shape}; give (N, 3, 3) finite numbers, N >= 1")
    parts = [(_smallest(_points(corners)), corners)]
    stages = [list(parts)]
    while len(parts) < most:
        coarse = [part for part in parts if part[0].standoff > standoff]
        halves = _best_cut(max(coarse, key=lambda part: part[0].volume)[1]) if coarse else []
        if not halves:
            break
        largest = max(coarse, key=lambda part: part[0].volume)
        parts = [part for part in parts if part is not largest] + halves
        stages.append(parts)
    chosen = min(stages, key=lambda stage: sum(capsule.volume for capsule, _ in stage) / GAIN ** len(stage))
    chosen = sorted(chosen, key=lambda part: -part[0].volume)
    return [capsule for capsule, _ in chosen], [part for _, part in chosen]


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


def standoff_of(start: Array, end: Array, radius: float, points: Array) -> float:
    """Upper bound of the largest h_capsule(n) - h_points(n) over all unit n, from a net of directions.

    On the net's mesh width d the difference changes by at most d times the reach of both bodies from a point inside.
    """
    middle = 0.5 * (start + end)
    excess = np.maximum(_NET @ (start - middle), _NET @ (end - middle)) + radius
    excess -= (_NET @ (points - middle).T).max(axis=1)
    return float(excess.max())


def _net() -> Array:
    """Directions ``(N, 3)`` spread over the sphere by the golden angle."""
    i = np.arange(400) + 0.5
    z, turn = 1.0 - 2.0 * i / len(i), np.pi * (1.0 + np.sqrt(5.0)) * i
    return np.stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z], axis=1)


_NET = _net()


def _points(triangles: Array) -> Array:
    return np.unique(triangles.reshape(-1, 3), axis=0)


def _principal(points: Array) -> Array:
    """Rows are the principal axes ``(3, 3)`` of a cloud of points."""
    centred = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(centred.T @ centred)[1].T)


def _smallest(points: Array) -> FittedCapsule:
    """The capsule of least volume around points ``(n, 3)``, of some axes and radii."""
    axes = np.concatenate([np.eye(3), _principal(points)])
    first = np.eye(3)[np.argmin(np.abs(axes), axis=1)]
    first = first - (first * axes).sum(axis=1)[:, None] * axes
    first /= np.linalg.norm(first, axis=1)[:, None]
    across = np.stack([first, np.cross(axes, first)], axis=1)  # (axes, 2, 3)
    flat, height = across @ points.T, axes @ points.T
    centre, each = flat.mean(axis=2), np.arange(len(axes))
    for k in range(TURNS):  # Badoiu and Clarkson (2003): a step towards the farthest point, ever shorter
        farthest = np.argmax(((flat - centre[..., None]) ** 2).sum(axis=1), axis=1)
        centre = centre + (flat[each, :, farthest] - centre) / (k + 2)
    off2 = ((flat - centre[..., None]) ** 2).sum(axis=1)
    radius = np.sqrt(off2.max(axis=1))[:, None] * np.array(WIDER)
    reach = np.sqrt(np.maximum(radius[..., None] ** 2 - off2[:, None], 0.0))
    high, low = (height[:, None] - reach).max(axis=2), (height[:, None] + reach).min(axis=2)
    high, low = np.maximum(high, 0.5 * (high + low)), np.minimum(low, 0.5 * (high + low))
    volume = np.pi * radius**2 * (high - low) + 4.0 / 3.0 * np.pi * radius**3
    k, w = np.unravel_index(int(np.argmin(volume)), volume.shape)
    ends = [centre[k] @ across[k] + end * axes[k] for end in (low[k, w], high[k, w])]
    span = ends[1] - ends[0]
    length2 = float(span @ span)
    along = np.clip((points - ends[0]) @ span / length2, 0.0, 1.0) if length2 > 0.0 else np.zeros(len(points))
    least = float(np.linalg.norm(points - ends[0] - along[:, None] * span, axis=1).max()) + ROUNDING
    return FittedCapsule(ends[0], ends[1], least, standoff_of(ends[0], ends[1], least, points), float(volume[k, w]))


def _best_cut(triangles: Array) -> list[tuple[FittedCapsule, Array]]:
    """Two parts whose capsules together are smallest; none where no plane tried has something on both sides."""
    points, best, least = _points(triangles), [], np.inf
    for axis in _principal(points):
        height = points @ axis
        low, high = float(height.min()), float(height.max())
        for share in CUTS:
            offset = low + share * (high - low)
            parts = clipped(triangles, axis, offset), clipped(triangles, -axis, -offset)
            if any(len(part) == 0 for part in parts):
                continue
            fitted = [_smallest(_points(part)) for part in parts]
            volume = sum(capsule.volume for capsule in fitted)
            if volume < least:
                least, best = volume, list(zip(fitted, parts, strict=True))
    return best
