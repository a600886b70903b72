"""A motion from its file, evaluated without the package: derivatives of Bernstein polynomials by de Casteljau."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import perm
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BPoly, CubicSpline, PPoly

Array = npt.NDArray[np.float64]
State = tuple[Array, Array, Array, Array, Array]  # q, v, a, jerk, snap

GRID = 400  # cells a segment that is scanned
FINER = 80  # cells between the two neighbours of the worst instant of a scan
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Motion:
    """Durations ``(K,)`` [s] and Bezier control points ``(n + 1, dof)`` of K segments."""

    durations: Array
    points: tuple[Array, ...]

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> "Motion":
        """From the JSON value of a trajectory file, of any of the three formats."""
        if data["format"] == "ocp-traj/trajectory/1":
            return cls(np.array(data["durations"], float), tuple(np.array(p, float) for p in data["control_points"]))
        if data["format"] == "ocp-traj/samples/1":
            end = "clamped" if data.get("rest", False) else "not-a-knot"
            spline = CubicSpline(np.array(data["times"], float), np.array(data["positions"], float), bc_type=end)
            return cls(np.diff(spline.x), tuple(np.moveaxis(BPoly.from_power_basis(spline).c, 1, 0)))
        durations = np.diff(np.array(data["knots"], float))
        powers = [
            PPoly(np.array(rows, float)[::-1, None], [0.0, T])
            for rows, T in zip(data["coefficients"], durations, strict=True)
        ]
        return cls(durations, tuple(BPoly.from_power_basis(power).c[:, 0] for power in powers))

    @property
    def segments(self) -> int:
        return len(self.durations)

    @property
    def dof(self) -> int:
        return int(self.points[0].shape[1])

    @property
    def everywhere(self) -> range:
        """All segments."""
        return range(self.segments)

    def hodograph(self, k: int, order: int) -> Array:
        """Control points of a time derivative on segment k."""
        degree = len(self.points[k]) - 1
        if order > degree:
            return np.zeros((1, self.dof))
        scale = perm(degree, order) / self.durations[k] ** order
        return np.asarray(np.diff(self.points[k], n=order, axis=0) * scale)

    def at(self, k: int, u: npt.ArrayLike, order: int = 0) -> Array:
        """A time derivative on segment k at local times ``(N,)``: ``(N, dof)``."""
        time = np.atleast_1d(np.asarray(u, dtype=float))[:, None]
        values = np.repeat(self.hodograph(k, order)[:, None], len(time), axis=1)
        while len(values) > 1:
            values = (1.0 - time) * values[:-1] + time * values[1:]
        return np.asarray(values[0])

    def state(self, k: int, u: npt.ArrayLike) -> State:
        """q, v, a, jerk, snap at local times ``(N,)`` of segment k, ``(N, dof)`` each."""
        q, v, a, jerk, snap = (self.at(k, u, order) for order in range(5))
        return q, v, a, jerk, snap

    def knot(self, i: int) -> Array:
        """q, v, a, jerk, snap ``(5, dof)`` at a knot, as the segment after it has them, at the end the one before."""
        last = i == self.segments
        return np.array(self.state(i - last, float(last)))[:, 0]

    def rounding(self, order: int) -> float:
        """What rounding may make of a derivative: (n + 1) eps of a sum whose weights add up to 2^m n!/(n - m)!/T^m."""
        return max(
            float(len(p) * EPS * 2.0**order * perm(len(p) - 1, order) * np.abs(p).max() / T**order)
            for p, T in zip(self.points, self.durations, strict=True)
        )

    def jump(self, order: int) -> float:
        """Largest jump of a derivative at an inner knot, less rounding, over the largest control point of its joint."""
        if self.segments == 1:
            return -np.inf
        rows = [self.hodograph(k, order) for k in self.everywhere]
        size = np.max([np.abs(row).max(axis=0) for row in rows], axis=0)
        gap = np.max([np.abs(b[0] - a[-1]) for a, b in zip(rows, rows[1:], strict=False)], axis=0)
        gap = gap - 4.0 * self.rounding(order)
        return float(np.where(gap > 0.0, gap / np.where(size > 0.0, size, 1.0), 0.0).max())


Values = Callable[[int, Array], Array]  # segment, local times (N,) -> (N, rows)


def beyond(values: Array, lower: npt.ArrayLike, upper: npt.ArrayLike) -> Array:
    """Excess of values ``(N, rows)`` over bounds, each side over its own bound's size (the other's, if it is 0)."""
    low, high = (np.broadcast_to(np.asarray(b, dtype=float), values.shape[1:]) for b in (lower, upper))
    sides = []
    for gap, bound, other in ((values - high, high, low), (low - values, low, high)):
        size = np.where(bound == 0.0, other, bound)
        size = np.where((size == 0.0) | ~np.isfinite(size), 1.0, np.abs(size))
        sides.append(np.where(np.isfinite(bound), gap / size, -np.inf))
    return np.where(np.isnan(values), np.inf, np.maximum(*sides))


def worst(
    motion: Motion, values: Values, lower: npt.ArrayLike, upper: npt.ArrayLike, segments: Sequence[int] | None = None
) -> float:
    """Largest relative excess at all instants: a scan of the segments, and a finer one about each row's worst."""
    chosen = list(motion.everywhere if segments is None else segments)
    u = np.linspace(0.0, 1.0, GRID + 1)
    scans = np.array([beyond(values(k, u), lower, upper) for k in chosen])  # (K, N, rows)
    found = float(scans.max())
    for row in range(scans.shape[2]):
        k, i = np.unravel_index(int(np.argmax(scans[:, :, row])), scans.shape[:2])
        near = np.clip(u[i] + np.linspace(-1.0, 1.0, FINER + 1) / GRID, 0.0, 1.0)
        found = max(found, float(beyond(values(chosen[k], near), lower, upper).max()))
    return found


def within(values: npt.ArrayLike, lower: npt.ArrayLike, upper: npt.ArrayLike) -> float:
    """Largest relative excess of numbers over their bounds."""
    return float(beyond(np.atleast_1d(np.asarray(values, dtype=float))[None], lower, upper).max(initial=-np.inf))


def apart(values: npt.ArrayLike, wanted: npt.ArrayLike, tolerance: float) -> float:
    """Largest difference of numbers that have to be equal, less a tolerance."""
    gap = np.abs(np.asarray(values, dtype=float) - np.asarray(wanted, dtype=float)) - tolerance
    return float(np.where(np.isnan(gap), np.inf, gap).max(initial=-np.inf))
