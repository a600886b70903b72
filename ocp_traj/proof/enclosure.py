"""Sub-arcs of Bezier curves with outward-rounded control points, and the bound a smooth function has on them.

On a sub-arc every derivative of the curve lies in the hull of its control points: a box of states. On a sub-arc of
duration w, with g'' >= -c there, g stays below max(g(a), g(b)) + (K - |D|)^2 / (4 K) where K = w^2 max(0, c) / 2,
D = g(b) - g(a) and |D| < K, and below max(g(a), g(b)) otherwise: the parabola of curvature -c through both ends
lies above g.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[Array, Array]  # lower, upper

# A cut at a + r (b - a) rounds three times, by at most 2^-54 each since all stays below 1, and passes on older errors.
ROUNDING = 2.3e-16
_PER_ARC = ("owner", "segment", "a", "b", "duration", "points")
_TINY = np.finfo(float).tiny  # 2^-1022


def outward(lower: Array, upper: Array) -> Pair:
    """Widens by one unit in the last place: what one correctly rounded operation can be off."""
    return np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)


@dataclass(frozen=True, eq=False)
class Arcs:
    """N sub-arcs of segments, written at one degree n.

    Attributes:
        owner: index of the trajectory ``(N,)``.
        segment: ``(N,)``.
        a, b: local times of the ends ``(N,)``, rounded; the arcs tile their segment exactly.
        duration: of the whole segment [s] ``(N,)``.
        points: of the hodographs, upper bounds of the negative and of the control point, so that both round upward:
            ``(largest count, orders, 2, dof, N)``, -inf beyond an order's count.
        counts: of control points per derivative order, the largest first.
        splits: how often they were cut.
    """

    owner: NDArray[np.intp]
    segment: NDArray[np.intp]
    a: Array
    b: Array
    duration: Array
    points: Array
    counts: tuple[int, ...]
    splits: int = 0

    @classmethod
    def of_segments(
        cls, owner: NDArray[np.intp], segment: NDArray[np.intp], points: Array, duration: Array, orders: int
    ) -> Arcs:
        """Whole segments from control points ``(N, n + 1, dof)``, with derivatives up to ``orders``."""
        bounds = np.stack([-points, points]).transpose(2, 0, 3, 1)  # (n + 1, 2, dof, N)
        hodographs = [bounds]
        with np.errstate(over="ignore"):  # an end that overflows upward is infinite, which is a bound
            for _ in range(orders):
                degree = len(bounds) - 1
                if degree == 0:
                    bounds = np.zeros_like(bounds)
                else:
                    bounds = _upward(bounds[1:] + bounds[:-1, ::-1])
                    bounds = _upward(_upward(bounds * degree) / duration)
                hodographs.append(bounds)
        counts = tuple(map(len, hodographs))
        n = len(owner)
        return cls(owner, segment, np.zeros(n), np.ones(n), duration, _padded(hodographs, counts), counts)

    @classmethod
    def join(cls, parts: Sequence[Arcs]) -> Arcs:
        """Some arcs after each other, written at the highest degree among them."""
        counts = tuple(map(max, zip(*(part.counts for part in parts), strict=True)))
        points = [part._elevated(counts) for part in parts]
        owner, segment, a, b, duration = (
            np.concatenate([getattr(part, name) for part in parts]) for name in _PER_ARC[:-1]
        )
        splits = max(part.splits for part in parts)
        return cls(owner, segment, a, b, duration, np.concatenate(points, axis=-1), counts, splits)

    def _elevated(self, counts: tuple[int, ...]) -> Array:
        if counts == self.counts:
            return self.points
        elevated = []
        for order, count in enumerate(counts):
            points = self.points[: self.counts[order], order]
            while len(points) < count:  # Farin (2002), sect. 6.1
                s = (np.arange(1, len(points)) / len(points))[:, None, None, None]
                inner = _mean(points, 1.0 - s, s, _slack(points, axis=1))
                points = np.concatenate([points[:1], inner, points[-1:]])
            elevated.append(points)
        return _padded(elevated, counts)

    def __len__(self) -> int:
        """Number of arcs."""
        return len(self.owner)

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Arcs:
        """The arcs at these indices."""
        return Arcs(
            self.owner[which], self.segment[which], self.a[which], self.b[which], self.duration[which],
            self.points[..., which], self.counts, self.splits,
        )  # fmt: skip

    def only(self, orders: Sequence[int]) -> Arcs:
        """The same arcs with some derivatives alone."""
        counts = tuple(self.counts[order] for order in orders)
        return replace(self, points=self.points[: max(counts), orders], counts=counts)

    def split(self, at: Array) -> tuple[Arcs, Arcs]:
        """Left and right parts of every arc, cut at the fraction ``at (N,)`` (rounded to 2^-20, so exact)."""
        r = np.clip(np.round(at * 2.0**20), 1.0, 2.0**20 - 1.0) * 2.0**-20
        s = 1.0 - r  # exact: both are multiples of 2^-20
        left, right = np.full((2, *self.points.shape), -np.inf)
        counts, level, slack = np.array(self.counts), self.points, _slack(self.points, axis=2)
        for j in range(len(level)):  # de Casteljau
            orders = np.count_nonzero(counts > j)
            level = _mean(level[:, :orders], r, s, slack[:orders]) if j else level
            last = counts[:orders] - 1 - j, np.arange(orders)
            left[j, :orders], right[last] = level[0], level[last]
        middle, splits = self.a + r * (self.b - self.a), self.splits + 1
        return replace(self, b=middle, points=left, splits=splits), replace(self, a=middle, points=right, splits=splits)

    def interleave(self, other: Arcs) -> Arcs:
        """These arcs and as many others in turn."""
        arrays = ((getattr(arcs, name) for arcs in (self, other)) for name in _PER_ARC)
        owner, segment, a, b, duration, points = (np.stack(list(pair), axis=-1) for pair in arrays)
        points = points.reshape(*points.shape[:-2], -1)
        return Arcs(
            owner.ravel(), segment.ravel(), a.ravel(), b.ravel(), duration.ravel(), points, self.counts, self.splits
        )

    @property
    def hodographs(self) -> tuple[Pair, ...]:
        """Per order, lower and upper control points ``(N, count, dof)``."""
        bounds = [self.points[:count, order].transpose(1, 3, 0, 2) for order, count in enumerate(self.counts)]
        return tuple((-negated, upper) for negated, upper in bounds)

    def hulls(self) -> Pair:
        """Bounds of all derivatives on each arc, below each other, ``(orders dof, N)``."""
        return _ends(self.points.max(axis=0))

    def ends(self, which: int) -> Pair:
        """Bounds of all derivatives at the start (0) or end (-1) of each arc, below each other, ``(orders dof, N)``."""
        return _ends(self.points[0 if which == 0 else np.array(self.counts) - 1, np.arange(len(self.counts))])

    def hull(self, order: int) -> Pair:
        """Bounds of one derivative on each arc, ``(dof, N)`` each."""
        return self.only([order]).hulls()

    def end(self, order: int, which: int) -> Pair:
        """Bounds of one derivative at the start (0) or end (-1) of each arc, ``(dof, N)``."""
        return self.only([order]).ends(which)

    @property
    def slack(self) -> float:
        """How far the recorded ends are off at most."""
        return self.splits * ROUNDING

    def local_time(self) -> Pair:
        """Enclosure of u over each arc, ``(1, N)``."""
        return _widened(self.a, self.b, self.slack)

    def end_time(self, which: int) -> Pair:
        """Enclosure of u at the start (0) or end (-1) of each arc, ``(1, N)``."""
        u = self.a if which == 0 else self.b
        return _widened(u, u, self.slack)

    def width(self) -> Array:
        """Upper bound of each arc's duration [s], ``(N,)``."""
        return (self.b - self.a + 2.0 * self.slack) * self.duration * (1.0 + 1e-15)


def _widened(a: Array, b: Array, slack: float) -> Pair:
    if slack == 0.0:
        return a[None], b[None]
    lower, upper = outward(a - slack, b + slack)
    return np.maximum(lower, 0.0)[None], np.minimum(upper, 1.0)[None]


def _upward(values: Array) -> Array:
    """The next floats."""
    return np.nextafter(values, np.inf)


def _padded(hodographs: Sequence[Array], counts: tuple[int, ...]) -> Array:
    points = np.full((max(counts), len(counts), *hodographs[0].shape[1:]), -np.inf)
    for order, bounds in enumerate(hodographs):
        points[: counts[order], order] = bounds
    return points


def _ends(bounds: Array) -> Pair:
    """Lower and upper ends ``(orders dof, N)`` from upper bounds ``(orders, 2, dof, N)`` of the negative and itself."""
    negated, upper = bounds.swapaxes(0, 1).reshape(2, -1, bounds.shape[-1])
    return -negated, upper


def _slack(points: Array, axis: int) -> Array:
    """What a mean of control points, or of their means, is rounded by at most.

    The products and the sum round by 2^-52 of the largest |P| together, or by two halves of a subnormal number; r and
    s, where they are not exact, by 2^-53; adding the slack rounds by 2^-53 and the slack itself by less.
    """
    largest = np.minimum(points.max(axis=(0, axis), keepdims=True)[0], np.finfo(float).max)
    return np.asarray(6e-16 * largest + 2.0**-1070)


def _mean(points: Array, r: Array, s: Array, slack: Array) -> Array:
    """Upper bound of s P_i + r P_{i+1}, and not beyond the larger of the two, where no mean lies."""
    first, second = points[:-1], points[1:]
    with np.errstate(over="ignore", invalid="ignore"):
        mean = s * first
        mean += r * second
        mean += slack
        return np.minimum(mean, np.maximum(first, second), out=mean)


def parabola_bound(start: Array, end: Array, curvature: Array, width: Array) -> Array:
    """Upper bound of g on arcs from bounds at the ends and of -g''.

    Args:
        start: upper bound of g at the start ``(.., N)``.
        end: the same at the end.
        curvature: upper bound of -g'' ``(.., N)`` [per s^2].
        width: upper bounds of the durations ``(N,)`` [s].

    Returns:
        ``(.., N)``; inf where anything is unknown.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        # K is inflated by more than it and D are rounded, so that K <= |D| is sure where it is found. Products are
        # ordered so that they do not underflow by more than the 2^-1022 added.
        k = width * np.maximum(curvature, 0.0) * width * 0.5 * (1.0 + 4e-15) + _TINY
        d = np.abs(end - start)
        rise = np.where(k > d, 0.25 * (k - d) * ((k - d) / k) + 4e-16 * (k + d), 0.0)
        bound = np.nextafter(np.maximum(start, end) + rise * (1.0 + 4e-15), np.inf)
    # NaN (an unbounded curvature, say) must never pass for a bound.
    return np.where(np.isfinite(k) & ~np.isnan(bound), bound, np.inf)


def peak_fraction(start: Array, end: Array, curvature: Array, width: Array) -> Array:
    """Where on the arc, in (0, 1), the bounding parabola peaks: the best place to cut, ``(.., N)``."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        k = width * np.maximum(curvature, 0.0) * width * 0.5
        fraction = 0.5 * (1.0 + (end - start) / k)
    return np.where(np.isfinite(fraction), np.clip(fraction, 0.125, 0.875), 0.5)
