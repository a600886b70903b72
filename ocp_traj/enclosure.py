"""Sub-arcs of Bezier curves with outward-rounded control points, and the bound a smooth function has on them.

On a sub-arc every derivative of the curve lies in the hull of its control points: a box of states. On a sub-arc of
duration w, with g'' >= -c there, g stays below max(g(a), g(b)) + (K - |D|)^2 / (4 K) where K = w^2 max(0, c) / 2,
D = g(b) - g(a) and |D| < K, and below max(g(a), g(b)) otherwise: the parabola of curvature -c through both ends
lies above g.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[Array, Array]  # lower, upper

MAX_SPLITS = 48  # of one arc: our choice; an arc halved 48 times is shorter than rounding can tell
# A cut rounds the recorded end of an arc three times, by at most 2^-53 each in [0, 1]: of b - a, product and sum.
SLACK = MAX_SPLITS * 3.4e-16
_TINY = np.finfo(float).tiny


def outward(lower: Array, upper: Array) -> Pair:
    """Widens by one unit in the last place: what one correctly rounded operation can be off."""
    return np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)


@dataclass(frozen=True, eq=False)
class Arcs:
    """N sub-arcs of segments of one degree.

    Attributes:
        owner: index of the trajectory ``(N,)``, ascending.
        segment: ``(N,)``.
        a, b: local times of the ends ``(N,)``, rounded; the arcs tile their segment exactly.
        duration: of the whole segment [s] ``(N,)``.
        hodographs: per derivative order, lower and upper control points ``(N, max(n - order, 0) + 1, dof)``.
    """

    owner: NDArray[np.intp]
    segment: NDArray[np.intp]
    a: Array
    b: Array
    duration: Array
    hodographs: tuple[Pair, ...]

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

    def __len__(self) -> int:
        """Number of arcs."""
        return len(self.owner)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.hodographs[0][0].shape[2])

    def take(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Arcs:
        """The arcs at these ascending indices."""
        return Arcs(
            self.owner[which], self.segment[which], self.a[which], self.b[which], self.duration[which],
            tuple((low[which], high[which]) for low, high in self.hodographs),
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
            Arcs(self.owner, self.segment, self.a, middle, self.duration, left),
            Arcs(self.owner, self.segment, middle, self.b, self.duration, right),
        )

    def interleave(self, other: Arcs) -> Arcs:
        """These arcs and as many others, alternating."""
        names = ("owner", "segment", "a", "b", "duration")
        plain = [interleave(getattr(self, name), getattr(other, name)) for name in names]
        pairs = zip(self.hodographs, other.hodographs, strict=True)
        return Arcs(*plain, tuple((interleave(x[0], y[0]), interleave(x[1], y[1])) for x, y in pairs))

    def hull(self, order: int) -> Pair:
        """Bounds of one derivative on each arc, ``(dof, N)`` each."""
        low, high = self.hodographs[order]
        return low.min(axis=1).T, high.max(axis=1).T

    def end(self, order: int, which: int) -> Pair:
        """Bounds of one derivative at the start (0) or end (-1) of each arc, ``(dof, N)``."""
        low, high = self.hodographs[order]
        return low[:, which].T, high[:, which].T

    def local_time(self) -> Pair:
        """Enclosure of u over each arc, ``(1, N)``."""
        return np.maximum(self.a - SLACK, 0.0)[None], np.minimum(self.b + SLACK, 1.0)[None]

    def end_time(self, which: int) -> Pair:
        """Enclosure of u at the start (0) or end (-1) of each arc, ``(1, N)``."""
        u = self.a if which == 0 else self.b
        exact = (u == 0.0) | (u == 1.0)  # the ends of the segment itself: a cut never gets closer than SLACK matters
        slack = np.where(exact, 0.0, SLACK)
        return np.maximum(u - slack, 0.0)[None], np.minimum(u + slack, 1.0)[None]

    def width(self) -> Array:
        """Upper bound of each arc's duration [s], ``(N,)``."""
        return (self.b - self.a + 2.0 * SLACK) * self.duration * (1.0 + 1e-15)
