"""A way past obstacles in joint space: two trees that grow towards each other, then shortened.

RRT-Connect (Kuffner and LaValle, 2000, ICRA), a few samples at a time, so that what is clear is asked of many points at
once. It finds a start for an optimiser, no more: what lies between the points that are looked at is not proved here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ocp_traj.arrays import Array

Clear = Callable[[Array], Array]  # points (N, n) -> whether each is clear (N,)

STEP = 0.04  # between points that are looked at, of the norm of q / scale: our choice
REACH = 2.0  # of one growth towards a sample
BATCH = 8  # samples at once
PASSES = 60  # of shortening: our choice, after which paths seldom get shorter


class Space:
    """A box in joint space, the scale of its metric, and what is clear in it.

    Attributes:
        low, high: bounds ``(n,)``, finite.
        scale: by which distances are measured ``(n,)``, such as the joints' speeds.
        clear: points ``(N, n)`` -> whether each is clear.
        step: between points that are looked at along a line, of the norm of q / scale.
        looked: how many points were looked at.
    """

    def __init__(self, low: Array, high: Array, scale: Array, clear: Clear, step: float = STEP) -> None:
        """Keeps them."""
        self.low, self.high, self.scale, self.clear, self.step, self.looked = low, high, scale, clear, step, 0

    def distance(self, a: Array, b: Array) -> Array:
        """Between points, rows of ``(.., n)``."""
        return np.asarray(np.linalg.norm((a - b) / self.scale, axis=-1))

    def reached(self, begins: Array, ends: Array) -> Array:
        """How far along straight lines ``(B, n)`` all that is looked at is clear: shares of them ``(B,)``."""
        counts = np.maximum(1, np.ceil(self.distance(begins, ends) / self.step)).astype(int)
        which = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts) + 1
        share = (number / counts[which])[:, None]
        free = np.asarray(self.clear(begins[which] + share * (ends - begins)[which]), dtype=bool)
        self.looked += len(which)
        blocked = np.flatnonzero(~free)
        first = np.full(len(counts), np.iinfo(int).max)
        np.minimum.at(first, which[blocked], number[blocked])
        return np.asarray(np.minimum(first - 1, counts) / counts)


class _Tree:
    """Points, and from which each was reached."""

    def __init__(self, root: Array) -> None:
        self.points, self.parents, self.size = np.empty((256, len(root))), np.zeros(256, dtype=int), 0
        self.add(root, -1)

    def add(self, point: Array, parent: int) -> int:
        if self.size == len(self.points):
            self.points = np.concatenate([self.points, np.empty_like(self.points)])
            self.parents = np.concatenate([self.parents, np.zeros_like(self.parents)])
        self.points[self.size], self.parents[self.size] = point, parent
        self.size += 1
        return self.size - 1

    def nearest(self, space: Space, targets: Array) -> Array:
        """Indices ``(B,)``."""
        mine, theirs = self.points[: self.size] / space.scale, targets / space.scale
        squares = (mine**2).sum(1)[None] - 2.0 * theirs @ mine.T
        return np.asarray(squares.argmin(axis=1))

    def branch(self, leaf: int) -> list[Array]:
        """From the leaf to the root."""
        found = []
        while leaf >= 0:
            found.append(self.points[leaf])
            leaf = int(self.parents[leaf])
        return found


def connect(space: Space, start: Array, goal: Array, rng: np.random.Generator, most: int) -> Array | None:
    """A path from start to goal ``(W, n)``, or None where none was found.

    Args:
        space: in which.
        start: clear, ``(n,)``.
        goal: likewise.
        rng: of the samples.
        most: points to look at.
    """
    if space.reached(start[None], goal[None])[0] >= 1.0:
        return np.array([start, goal])
    trees = [_Tree(start), _Tree(goal)]
    begun, turn = space.looked, 0
    while space.looked - begun < most:
        grown, other = trees[turn], trees[1 - turn]
        samples = rng.uniform(space.low, space.high, size=(BATCH, len(start)))
        tips = _grow(space, grown, samples, REACH)
        if len(tips):
            met = _grow(space, other, grown.points[tips], np.inf)
            for tip, end in zip(tips, met, strict=True):
                if np.array_equal(grown.points[tip], other.points[end]):
                    ways = grown.branch(int(tip)), other.branch(int(end))
                    forth, back = ways if turn == 0 else ways[::-1]
                    return np.array(forth[::-1] + back[1:])
        turn = 1 - turn
    return None


def _grow(space: Space, tree: _Tree, targets: Array, reach: float) -> Array:
    """Grows a tree towards targets, as far as it is clear; the indices of its new points, or of those it stays at.

    With an infinite reach there is one index a target; else targets towards which nothing is clear have none.
    """
    near = tree.nearest(space, targets)
    begins = tree.points[near]
    length = space.distance(begins, targets)
    share = np.minimum(1.0, reach / np.maximum(length, 1e-12))[:, None]
    ends = np.where(share < 1.0, begins + share * (targets - begins), targets)
    got = space.reached(begins, ends)
    found = []
    for i, parent in enumerate(near):
        if got[i] > 0.0:
            end = ends[i] if got[i] >= 1.0 else begins[i] + got[i] * (ends[i] - begins[i])
            found.append(tree.add(end, int(parent)))
        elif np.isinf(reach):
            found.append(int(parent))
    return np.array(found, dtype=int)


def shortened(space: Space, path: Array, rng: np.random.Generator, passes: int = PASSES) -> Array:
    """A path ``(W, n)`` with detours cut off where the straight line is clear; its ends stay.

    Pairs of points anywhere on it are tried, ``BATCH`` at once, and of those that are clear the one that gains most is
    taken.
    """
    path = np.asarray(path, dtype=float)
    for _ in range(passes):
        if len(path) == 2:
            break
        steps = space.distance(path[1:], path[:-1])
        knots = np.concatenate([[0.0], np.cumsum(steps)])
        places = np.sort(rng.uniform(0.0, knots[-1], size=(BATCH, 2)), axis=1)
        # Every other pair begins and ends at corners: it takes whole ones away.
        corners = np.sort(rng.integers(0, len(path), size=(BATCH // 2, 2)), axis=1)
        places[::2] = knots[corners]
        ends = np.stack([np.interp(places, knots, path[:, j]) for j in range(path.shape[1])], axis=-1)
        gains = places[:, 1] - places[:, 0] - space.distance(ends[:, 0], ends[:, 1])
        worth = np.flatnonzero(gains > 1e-3 * knots[-1])
        if not len(worth):
            continue
        clear = worth[space.reached(ends[worth, 0], ends[worth, 1]) >= 1.0]
        if len(clear):
            best = clear[np.argmax(gains[clear])]
            (a, b), (first, last) = places[best], ends[best]
            path = np.concatenate([path[knots < a - 1e-9], [first, last], path[knots > b + 1e-9]])
    return path
