"""Sub-arcs of Bezier curves with outward-rounded control points, and the bound a smooth function has on them.

On a sub-arc every derivative of the curve lies in the hull of its control points: a box of states. On a sub-arc of
duration w, with g'' >= -c there, g stays below max(g(a), g(b)) + (K - |D|)^2 / (4 K) where K = w^2 max(0, c) / 2,
D = g(b) - g(a) and |D| < K, and below max(g(a), g(b)) otherwise: the parabola of curvature -c through both ends
lies above g.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[Array, Array]  # lower, upper

# A cut at a + r (b - a) rounds three times, by at most 2^-54 each since all stays below 1, and passes on older errors.
ROUNDING = 2.3e-16
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
        hodographs: per derivative order, lower and upper control points ``(N, max(n - order, 0) + 1, dof)``.
        splits: how often they were cut.
    """

    owner: NDArray[np.intp]
    segment: NDArray[np.intp]
    a: Array
    b: Array
    duration: Array
    hodographs: tuple[Pair, ...]
    splits: int = 0

    @classmethod
    def of_segments(
        cls, owner: NDArray[np.intp], segment: NDArray[np.intp], points: Array, duration: Array, orders: int
    ) -> Arcs:
        """Whole segments from control points ``(N, n + 1, dof)``, with derivatives up to ``orders``."""
        lower, upper = points, points
        hodographs = [(lower, upper)]
        time = duration[:, None, None]
        with np.errstate(over="ignore"):  # an end that overflows outward is infinite, which is a bound
            for _ in range(orders):
                degree = lower.shape[1] - 1
                if degree == 0:
                    lower = upper = np.zeros_like(lower)
                else:
                    lower, upper = outward(lower[:, 1:] - upper[:, :-1], upper[:, 1:] - lower[:, :-1])
                    lower, upper = outward(lower * degree, upper * degree)
                    lower, upper = outward(lower / time, upper / time)
                hodographs.append((lower, upper))
        n = len(owner)
        return cls(owner, segment, np.zeros(n), np.ones(n), duration, tuple(hodographs))

    @classmethod
    def join(cls, parts: Sequence[Arcs]) -> Arcs:
        """Some arcs after each other, written at the highest degree among them."""
        counts = [
            max(low.shape[1] for low, _ in same) for same in zip(*(part.hodographs for part in parts), strict=True)
        ]
        hodographs = []
        for order, count in enumerate(counts):
            pairs = [part.hodographs[order] for part in parts]
            low = np.concatenate([_elevated(pair[0], count, -1.0) for pair in pairs])
            hodographs.append((low, np.concatenate([_elevated(pair[1], count, 1.0) for pair in pairs])))
        owner, segment, a, b, duration = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("owner", "segment", "a", "b", "duration")
        )
        return cls(owner, segment, a, b, duration, tuple(hodographs), max(part.splits for part in parts))

    def __len__(self) -> int:
        """Number of arcs."""
        return len(self.owner)

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Arcs:
        """The arcs at these indices."""
        return Arcs(
            self.owner[which], self.segment[which], self.a[which], self.b[which], self.duration[which],
            tuple((low[which], high[which]) for low, high in self.hodographs), self.splits,
        )  # fmt: skip

    def split(self, at: Array) -> tuple[Arcs, Arcs]:
        """Left and right parts of every arc, cut at the fraction ``at (N,)`` (rounded to 2^-20, so exact)."""
        ratio = np.clip(np.round(at * 2.0**20), 1.0, 2.0**20 - 1.0) * 2.0**-20
        r = ratio[:, None, None]
        s = 1.0 - r  # exact: both are multiples of 2^-20
        with np.errstate(over="ignore"):
            parts = [_de_casteljau(low, high, r, s) for low, high in self.hodographs]
        middle = self.a + ratio * (self.b - self.a)
        left, right = (tuple(part[i] for part in parts) for i in (0, 1))
        return (
            Arcs(self.owner, self.segment, self.a, middle, self.duration, left, self.splits + 1),
            Arcs(self.owner, self.segment, middle, self.b, self.duration, right, self.splits + 1),
        )

    def interleave(self, other: Arcs) -> Arcs:
        """These arcs and as many others in turn."""
        return Arcs.join([self, other]).take(np.arange(2 * len(self)).reshape(2, -1).T.ravel())

    def hull(self, order: int) -> Pair:
        """Bounds of one derivative on each arc, ``(dof, N)`` each."""
        low, high = self.hodographs[order]
        return low.min(axis=1).T, high.max(axis=1).T

    def end(self, order: int, which: int) -> Pair:
        """Bounds of one derivative at the start (0) or end (-1) of each arc, ``(dof, N)``."""
        low, high = self.hodographs[order]
        return low[:, which].T, high[:, which].T

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


def _de_casteljau(lower: Array, upper: Array, r: Array, s: Array) -> tuple[Pair, Pair]:
    """Outward-rounded control points of both parts; r + s = 1, ``(N, 1, 1)``."""
    left, right = [(lower[:, :1], upper[:, :1])], [(lower[:, -1:], upper[:, -1:])]
    while lower.shape[1] > 1:
        lower, upper = _mean(lower, r, s, -1.0), _mean(upper, r, s, 1.0)
        left.append((lower[:, :1], upper[:, :1]))
        right.append((lower[:, -1:], upper[:, -1:]))
    ends = [tuple(np.concatenate([pair[i] for pair in part], axis=1) for i in (0, 1)) for part in (left, right[::-1])]
    return (ends[0][0], ends[0][1]), (ends[1][0], ends[1][1])


def _elevated(points: Array, count: int, outward: float) -> Array:
    """Bounds on one side of ``count`` control points of the same curves; Farin (2002), sect. 6.1."""
    while points.shape[1] < count:
        n = points.shape[1]
        s = np.arange(1, n)[:, None] / n
        points = np.concatenate([points[:, :1], _mean(points, 1.0 - s, s, outward), points[:, -1:]], axis=1)
    return points


def _mean(points: Array, r: Array, s: Array, outward: float) -> Array:
    """Bound of s P_i + r P_{i+1} on one side, and not beyond the farther of the two, where no mean lies."""
    first, second = points[:, :-1], points[:, 1:]
    # The products and the sum round by less than 2^-52 of the larger point together, or by one subnormal number; r and
    # s, where they are not exact, by 2^-53 together.
    slack = 4e-16 * np.maximum(np.abs(first), np.abs(second))
    mean = np.nextafter(s * first + r * second + outward * slack, outward * np.inf)
    return np.minimum(mean, np.maximum(first, second)) if outward > 0.0 else np.maximum(mean, np.minimum(first, second))


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
