"""A polyline driven through without a stop: its corners rounded by two moving averages, as motion controllers do it.

A point that runs along the polyline at constant speed on each edge jumps in velocity at corners. Averaged over a time
T_a its acceleration is bounded by what the velocity jumps by over T_a, and averaged over T_j again so is its jerk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array

GRID = 1500  # steps of the whole: our choice, some hundred to the shortest average
LEAST = 0.02  # of the whole, the shortest average


@dataclass(frozen=True, eq=False)
class Rounded:
    """A motion from rest to rest along a polyline with rounded corners, on an even grid.

    Attributes:
        times: ``(N,)`` [s], from 0.
        states: q, v, a at these ``(N, 3, n)``.
        passed: when it passes the polyline's points, or comes nearest ``(W,)`` [s]; ends included.
    """

    times: Array
    states: Array
    passed: Array

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1])

    def at(self, t: Array) -> Array:
        """States ``(K, 3, n)`` at times ``(K,)``, linear between the grid's."""
        place = np.clip(t / self.times[1], 0.0, len(self.times) - 1.0)
        i = np.minimum(place.astype(int), len(self.times) - 2)
        share = (place - i)[:, None, None]
        return np.asarray((1.0 - share) * self.states[i] + share * self.states[i + 1])


def rounded(points: Array, speed: Array, acceleration: Array, jerk: Array, slower: float = 1.0) -> Rounded:
    """The motion along points ``(W, n)`` that keeps limits ``(n,)``, infinite for none, about.

    Args:
        points: two or more, none twice in a row.
        speed: of each joint.
        acceleration: likewise.
        jerk: likewise.
        slower: than the limits on speed allow; the corners are then cut by less, its square.
    """
    steps = np.diff(points, axis=0)
    edges = (np.abs(steps) / speed).max(axis=1)
    if not np.isfinite(speed).all():
        edges = np.where(edges > 0.0, edges, np.linalg.norm(steps, axis=1))
    edges = slower * np.maximum(edges, 1e-9)
    v = steps / edges[:, None]
    jumps = np.abs(np.diff(np.concatenate([np.zeros_like(v[:1]), v, np.zeros_like(v[:1])]), axis=0))
    whole = float(edges.sum())
    wide = max(float((jumps / acceleration).max()), LEAST * whole)
    sharp = np.where(np.isfinite(jerk), np.minimum(acceleration, jumps.max(axis=0) / wide) / jerk, 0.0)
    narrow = max(float(sharp.max()), LEAST * whole)
    duration = whole + wide + narrow
    step = duration / GRID
    arrivals = np.concatenate([[0.0], np.cumsum(edges)])
    # Averages of the grid's steps, wide and narrow of them, of the velocity along the polyline.
    a, j = (max(1, round(width / step)) for width in (wide, narrow))
    count = GRID - a - j
    path = np.stack([np.interp(np.linspace(0.0, whole, count + 1), arrivals, x) for x in points.T], axis=1)
    q = np.concatenate([np.repeat(path[:1], a + j, axis=0), path, np.repeat(path[-1:], a + j, axis=0)])
    for width in (a, j):
        sums = np.cumsum(np.concatenate([np.zeros_like(q[:1]), q]), axis=0)
        q = (sums[width:] - sums[:-width]) / width
    q = q[len(q) // 2 - GRID // 2 : len(q) // 2 - GRID // 2 + GRID + 1]
    q[0], q[-1] = points[0], points[-1]
    v = np.gradient(q, step, axis=0)
    acc = np.gradient(v, step, axis=0)
    times, states = np.linspace(0.0, duration, GRID + 1), np.stack([q, v, acc], axis=1, dtype=float)
    return Rounded(times, states, _passed(arrivals, wide + narrow, duration))


def _passed(arrivals: Array, delay: float, duration: float) -> Array:
    found = arrivals + 0.5 * delay
    found[0], found[-1] = 0.0, duration
    return np.asarray(found)
