"""Distances of bodies at an instant and least ones along a motion, one pair and one instant at a time.

Nothing of the package is used but the plain numbers of a body and of a curve: placements are pinocchio's, a point's
distance from a core is a formula, a segment's a search along it, any other pair's is coal's.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.optimize import minimize_scalar

BY_COAL = ("box", "cylinder")  # two of these


def curve_at(durations: np.ndarray, points: list[np.ndarray], t: float) -> np.ndarray:
    """A piecewise Bezier curve at a time, by de Casteljau."""
    k = 0
    while k < len(durations) - 1 and t > durations[k]:
        t -= durations[k]
        k += 1
    u, level = min(max(t / durations[k], 0.0), 1.0), np.array(points[k])
    while len(level) > 1:
        level = (1.0 - u) * level[:-1] + u * level[1:]
    return level[0]


class Pair:
    """Two bodies of a robot: their distance at given joint coordinates."""

    def __init__(self, model: pin.Model, first: Any, second: Any) -> None:
        self.model, self.data, self.bodies = model, model.createData(), (first, second)
        self.exact = not all(body.kind in BY_COAL for body in self.bodies)

    def distance(self, q: np.ndarray) -> float:
        """Below zero where they overlap, if only by what the radii are together."""
        pin.forwardKinematics(self.model, self.data, q)
        placed = [self.data.oMi[body.joint] * pin.SE3(body.axes, body.centre) for body in self.bodies]
        (one, at), (two, to) = sorted(zip(self.bodies, placed, strict=True), key=lambda item: RANK[item[0].kind])
        return core_distance(one, at, two, to) - one.radius - two.radius


RANK = {"sphere": 0, "capsule": 1, "cylinder": 2, "box": 3, "half-space": 4}


def core_distance(one: Any, at: pin.SE3, two: Any, to: pin.SE3) -> float:
    """The distance of two cores, the first no higher in ``RANK``."""
    if two.kind == "half-space":
        normal = to.rotation[:, 2]
        return float(normal @ (at.translation - to.translation)) - extent(one, at.rotation.T @ normal)
    if one.kind == "sphere":
        return float(point_distances(two, to.actInv(at.translation)[None])[0])
    if one.kind == "capsule":
        ends = [at.act(np.array([0.0, 0.0, sign * one.half[2]])) for sign in (-1.0, 1.0)]
        if two.kind == "capsule":
            others = [to.act(np.array([0.0, 0.0, sign * two.half[2]])) for sign in (-1.0, 1.0)]
            return segments_distance(*ends, *others)
        start, end = (to.actInv(point) for point in ends)
        return least_along(two, start, end - start)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = 1e-12
    shapes = [
        coal.Box(*(2.0 * b.half)) if b.kind == "box" else coal.Cylinder(b.half[0], 2.0 * b.half[2]) for b in (one, two)
    ]
    return float(coal.distance(shapes[0], coal.Transform3s(at), shapes[1], coal.Transform3s(to), request, result))


def extent(body: Any, direction: np.ndarray) -> float:
    """How far a core reaches from its middle in a direction of its own axes."""
    x, y, z = np.abs(direction) * body.half
    return float(np.hypot(x, y) + z if body.kind == "cylinder" else x + y + z)


def point_distances(body: Any, points: np.ndarray) -> np.ndarray:
    """Of points ``(N, 3)`` in the axes of a core."""
    if body.kind == "cylinder":
        aside = np.maximum(np.hypot(points[:, 0], points[:, 1]) - body.half[0], 0.0)
        return np.hypot(aside, np.maximum(np.abs(points[:, 2]) - body.half[2], 0.0))
    off = np.maximum(np.abs(points) - body.half, 0.0)
    return np.sqrt((off * off).sum(axis=1))


def segments_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """From a to b and from c to d: of an end and the other segment, or of the lines where their feet are inside."""
    found = [point_segment(p, *ends) for p, ends in ((a, (c, d)), (b, (c, d)), (c, (a, b)), (d, (a, b)))]
    across = np.cross(b - a, d - c)
    size = across @ across
    if size > 1e-20 * ((b - a) @ (b - a)) * ((d - c) @ (d - c)):
        s, t = np.cross(c - a, d - c) @ across / size, np.cross(c - a, b - a) @ across / size
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            found.append(float(np.linalg.norm(a + s * (b - a) - c - t * (d - c))))
    return min(found)


def point_segment(p: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    length = (b - a) @ (b - a)
    s = min(max((p - a) @ (b - a) / length, 0.0), 1.0) if length > 0.0 else 0.0
    return float(np.linalg.norm(p - a - s * (b - a)))


def least_along(body: Any, start: np.ndarray, run: np.ndarray) -> float:
    """The least distance of a core from a segment: a grid, ever finer about its least value, as that is convex."""
    low, high = 0.0, 1.0
    while True:
        s = np.linspace(low, high, 33)
        values = point_distances(body, start + s[:, None] * run)
        k = int(np.argmin(values))
        if high - low < 1e-11:
            return float(values[k])
        low, high = s[max(k - 1, 0)], s[min(k + 1, 32)]


def least_distance(
    pair: Pair, durations: np.ndarray, points: list[np.ndarray], count: int = 240
) -> tuple[float, float]:
    """The least distance along a motion and its instant: a scan, and a search in its cells that may hold it."""
    total = float(np.sum(durations))

    def at(t: float) -> float:
        return pair.distance(curve_at(durations, points, t))

    times = np.union1d(np.linspace(0.0, total, count), np.minimum(np.cumsum(durations), total))
    values = np.array([at(t) for t in times])
    best = int(np.argmin(values))
    least, when = float(values[best]), float(times[best])
    padded = np.concatenate([[np.inf], values, [np.inf]])
    valleys = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]))
    for i in sorted(valleys, key=lambda i: values[i])[:4]:
        low, high = times[max(i - 1, 0)], times[min(i + 1, len(times) - 1)]
        found = minimize_scalar(at, bounds=(low, high), method="bounded", options={"xatol": 1e-13 * max(total, 1.0)})
        if found.fun < least:
            least, when = float(found.fun), float(found.x)
    return least, when
