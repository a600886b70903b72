"""Where a front has most to gain: what of a box is dominated, what lies below optima, and what is still open.

Geometry alone, on values of objectives that are to be made small: no problem, no solver. The box between ideal and
reference is filled with the points of a low-discrepancy sequence (Sobol, 1967). A sample that a point of the front
dominates is had; one that lies strictly below a corner is not to be had, as far as the solve can tell which found that
all objectives cannot be better than there at once; the others are open. The number of samples that a point dominates
alone is its share of the hypervolume, in any number of objectives and for thousands of points in one pass.
"""

from __future__ import annotations

import numpy as np
from scipy.stats.qmc import Sobol

from ocp_traj.arrays import Array, Flags, Index

OPEN = 8192  # samples that are kept open: our choice; more are drawn as the open part of the box shrinks
DRAWN, MOST = 8192, 2**18  # samples drawn at a time, and in all: our choice
LOOKED_AT = 1024  # open samples among which the next directions are chosen: our choice
ROOM = 1e-6  # of the box: a corner is not contradicted by a point that is better by less; our choice


class OpenBox:
    """The box between an ideal and a reference point, and what a front has not decided of it yet.

    Args:
        ideal, reference: its corners ``(m,)``, the first less than the second in every objective.

    Attributes:
        values: the front's points, in units of the box ``(N, m)``: 0 at the ideal, 1 at the reference.
        corners: below which nothing is to be had, likewise ``(C, m)``.
        open: samples that are neither dominated nor below a corner ``(K, m)``.
    """

    def __init__(self, ideal: Array, reference: Array) -> None:
        """Draws the first samples; see the class."""
        self.ideal, self.span = np.asarray(ideal, dtype=float), np.asarray(reference - ideal, dtype=float)
        self.values = self.corners = np.empty((0, len(self.span)))
        self._draw_anew()

    def _draw_anew(self) -> None:
        self._sequence = Sobol(len(self.span), rng=0)
        self._drawn = self._below = 0  # samples in all, and those below corners
        self.open = np.empty((0, len(self.span)))
        self.refill()

    def refill(self) -> None:
        """Draws samples until enough are open, or enough were drawn: the finer, the less of the box is open."""
        while len(self.open) < OPEN and self._drawn < MOST:
            samples = self._sequence.random(DRAWN)
            self._drawn += len(samples)
            for point in self.values:
                samples = samples[~_above(point, samples)]
            left = samples
            for corner in self.corners:
                left = left[~_below(corner, left)]
            self._below += len(samples) - len(left)
            self.open = np.vstack([self.open, left])

    @property
    def hypervolume(self) -> float:
        """Share of the box that is dominated, as the samples tell."""
        return 1.0 - (len(self.open) + self._below) / self._drawn

    @property
    def undecided(self) -> float:
        """Share of the box that is open."""
        return len(self.open) / self._drawn

    def in_units(self, values: Array) -> Array:
        """Values of objectives ``(N, m)`` in units of the box."""
        return np.asarray((values - self.ideal) / self.span)

    def gains(self, values: Array) -> Array:
        """Share of the box that each of some values ``(N, m)`` would dominate and the front does not ``(N,)``."""
        return np.asarray(dominance(self.in_units(values), self.open).sum(axis=1) / self._drawn)

    def add(self, values: Array) -> None:
        """Takes values ``(N, m)`` as points of the front; a corner below which one of them lies was none."""
        points = self.in_units(np.atleast_2d(values))
        self.values = np.vstack([self.values, points])
        wrong = (points[:, None] < self.corners[None] - ROOM).all(axis=2).any(axis=0)
        if wrong.any():
            self.corners = self.corners[~wrong]
            self._draw_anew()
        for point in points:
            self.open = self.open[~_above(point, self.open)]

    def close(self, corner: Array) -> None:
        """Nothing is better than ``corner (m,)`` in all objectives at once, as far as a solve can tell."""
        unit = self.in_units(corner)
        self.corners = np.vstack([self.corners, unit])
        below = _below(unit, self.open)
        self._below += int(below.sum())
        self.open = self.open[~below]

    def best_of(self, values: Array, least: float) -> list[int]:
        """Which of some values ``(N, m)`` to take, the one that adds most first, while it adds ``least`` or more.

        The greedy choice, which is within 1 - 1/e of the best one (Nemhauser, Wolsey and Fisher, 1978).
        """
        found = greedy(dominance(self.in_units(values), self.open), least * self._drawn)
        return [index for index, _ in found]

    def next_targets(self, count: int) -> Array:
        """Points ``(count or less, m)`` to aim at, where the front has most to gain, in the objectives' units.

        A solve that ends at an open sample decides all samples above it, which its point dominates, and all below it.
        Those where both are many come first; what one decides counts for none of the others.
        """
        samples = self.open[:LOOKED_AT]
        above = dominance(samples, samples).astype(np.float32)
        left = np.ones(len(samples), dtype=np.float32)
        chosen: list[int] = []
        while len(chosen) < count:
            worth = np.where(left > 0.0, (above @ left) * (above.T @ left), 0.0)
            i = int(np.argmax(worth)) if len(worth) else 0
            if not len(worth) or worth[i] <= 0.0:
                break
            chosen.append(i)
            left[(above[i] > 0.0) | (above[:, i] > 0.0)] = 0.0
        return np.asarray(self.ideal + samples[chosen] * self.span)


def dominance(points: Array, others: Array) -> Flags:
    """Whether points ``(N, m)`` are no worse in any objective than others ``(K, m)``, each than each: ``(N, K)``."""
    found = points[:, None, 0] <= others[None, :, 0]
    for k in range(1, points.shape[1]):
        found &= points[:, None, k] <= others[None, :, k]
    return np.asarray(found)


def _above(point: Array, samples: Array) -> Flags:
    """Which of some samples ``(N, m)`` a point ``(m,)`` is no worse than: objective by objective, which is quicker."""
    found = point[0] <= samples[:, 0]
    for k in range(1, len(point)):
        found &= point[k] <= samples[:, k]
    return np.asarray(found)


def _below(corner: Array, samples: Array) -> Flags:
    """Which of some samples ``(N, m)`` are better than a corner ``(m,)`` in every objective."""
    found = samples[:, 0] < corner[0]
    for k in range(1, len(corner)):
        found &= samples[:, k] < corner[k]
    return np.asarray(found)


def greedy(
    covers: Flags, least: float = 0.0, most: int | None = None, first: Index | None = None
) -> list[tuple[int, int]]:
    """Rows of ``covers (N, K)`` that cover most columns together: (row, columns it adds), one after the other.

    Args:
        covers: what each row covers.
        least: columns that the last one adds; none is taken that adds nothing.
        most: rows.
        first: rows that are taken in any case, before all others.
    """
    left = np.ones(covers.shape[1], dtype=bool)
    taken: list[tuple[int, int]] = []

    def take(row: int) -> None:
        taken.append((row, int((covers[row] & left).sum())))
        np.logical_and(left, ~covers[row], out=left)

    for row in [] if first is None else first.tolist():
        take(row)
    bound = covers.sum(axis=1)  # what a row adds only falls: where it was last counted bounds it
    bound[[row for row, _ in taken]] = -1
    while (most is None or len(taken) < most) and len(bound):
        row = int(np.argmax(bound))
        if bound[row] < max(least, 1):
            break
        adds = int((covers[row] & left).sum())
        if adds == bound[row]:
            take(row)
            bound[row] = -1
        else:
            bound[row] = adds
    return taken


def well_spread(values: Array, ideal: Array, reference: Array, count: int, first: Index) -> Index:
    """Which ``count`` of a front's values ``(N, m)`` dominate most of the box, ``first`` among them; in their order."""
    if len(values) <= count:
        return np.arange(len(values))
    samples = Sobol(values.shape[1], rng=0).random(DRAWN)
    chosen = [row for row, _ in greedy(dominance((values - ideal) / (reference - ideal), samples), 0.0, count, first)]
    rest = [i for i in range(len(values)) if i not in set(chosen)]
    return np.sort(np.array([*chosen, *rest][:count], dtype=np.intp))
