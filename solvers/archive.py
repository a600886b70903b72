"""Proved points of a front that is being searched, the gaps between them, and the solutions a neighbour begins from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.results.solution import Solution

SAME = 1e-7  # of the front's extent: points closer than this in every objective are one; our choice


@dataclass(frozen=True, eq=False)
class Known:
    """A proved point.

    Attributes:
        x: ``(n,)``.
        f: traded objectives ``(objectives,)``, less is better.
        solution: whose instants and multipliers a neighbour's solve begins with, where there is one.
    """

    x: Array
    f: Array
    solution: Solution | None = None

    @property
    def name(self) -> bytes:
        """Of its variables, to the last bit."""
        return self.x.tobytes()


class Archive:
    """Points none of which is dominated.

    Args:
        objectives: how many are traded.
        scales: of the objectives ``(objectives,)``, for a front without extent.
    """

    def __init__(self, objectives: int, scales: Array) -> None:
        """Begins empty."""
        self.points: list[Known] = []
        self._scales, self._closed = scales, set[frozenset[bytes]]()
        self.f = np.empty((0, objectives))

    @property
    def extent(self) -> Array:
        """Of the points, in each objective ``(objectives,)``; its scale where that is nothing."""
        if not len(self.f):
            return self._scales
        size = np.ptp(self.f, axis=0)
        return np.asarray(np.where(size > 0.0, size, self._scales))

    def gains(self, f: Array) -> bool:
        """Whether a point ``f (objectives,)`` is dominated by none, nor one that is known already."""
        return bool(np.all(np.any(f < self.f - SAME * self.extent, axis=1)))

    def add(self, point: Known) -> bool:
        """Takes a point in, and drops those that it dominates; whether it gains anything."""
        if not self.gains(point.f):
            return False
        stays = np.any(self.f < point.f, axis=1)
        self.points = [p for p, keep in zip(self.points, stays.tolist(), strict=True) if keep] + [point]
        self.f = np.vstack([self.f[stays], point.f])
        return True

    def nearest(self, f: Array) -> Known | None:
        """The point with a solution that is nearest to ``f (objectives,)`` in units of the front's extent."""
        solved = [i for i, point in enumerate(self.points) if point.solution is not None]
        if not solved:
            return None
        return self.points[solved[int(np.argmin(np.linalg.norm((self.f[solved] - f) / self.extent, axis=1)))]]

    def drop(self, solution: Solution) -> bool:
        """Takes a point out again, which is not as it was found after all; whether it was there."""
        stays = [point.solution is not solution for point in self.points]
        self.points = [point for point, keep in zip(self.points, stays, strict=True) if keep]
        self.f = self.f[stays]
        return not all(stays)

    def distances(self, f: Array, more: Array) -> Array:
        """Of points ``f (N, objectives)`` to the nearest of these and ``more``, in units of the front's extent.

        Infinite where there are none.
        """
        others = np.vstack([self.f, more])
        apart = np.linalg.norm((f[:, None] - others) / self.extent, axis=2)
        return np.asarray(apart.min(axis=1, initial=np.inf))

    def gap(self) -> tuple[Known, Known] | None:
        """The neighbours farthest apart between which nothing was looked for yet; None where there are none.

        Of two objectives neighbours follow each other, and the gap is the area that may lie between; of more the
        nearest point is the neighbour, and the gap its distance.
        """
        if len(self.points) < 2:
            return None
        scaled = self.f / self.extent
        if self.f.shape[1] == 2:
            order = np.argsort(scaled[:, 0], kind="stable")
            pairs = list(zip(order[:-1].tolist(), order[1:].tolist(), strict=True))
            sizes = np.abs(scaled[order[1:]] - scaled[order[:-1]]).prod(axis=1)
        else:
            apart = np.linalg.norm(scaled[:, None] - scaled, axis=2)
            every = range(len(apart))
            apart[[[i == j or self._pair(i, j) in self._closed for j in every] for i in every]] = np.inf
            pairs = list(enumerate(apart.argmin(axis=1).tolist()))
            sizes = apart.min(axis=1)
            sizes[~np.isfinite(sizes)] = 0.0
        for k in np.argsort(-sizes, kind="stable").tolist():
            if sizes[k] > 0.0 and self._pair(*pairs[k]) not in self._closed:
                return self.points[pairs[k][0]], self.points[pairs[k][1]]
        return None

    def close(self, one: Known, other: Known) -> None:
        """Notes that something was looked for between two points."""
        self._closed.add(frozenset((one.name, other.name)))

    def _pair(self, i: int, j: int) -> frozenset[bytes]:
        return frozenset((self.points[i].name, self.points[j].name))
