"""Polylines past obstacles that are clear as they stand: each edge can be driven, with a stop at every corner."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.ways import Ways
from ocp_traj.paths.connecting_trees import Space, connect, shortened

STEP = 0.004  # between points that are looked at, of the norm of q / speed: a proof seldom finds less than these
PASSES = 20  # of shortening a mended polyline: our choice
# Of so many plans the shortest that can be mended is taken, or of fewer, where one took so many points to find; and
# so often, where none can be: our choice.
PLANS, PATIENCE, ROUNDS = 4, 5_000, 3
MOST = 8000  # points that are looked at to mend one edge: our choice


def clear_polyline(ways: Ways, leg: int, most: int, rng: np.random.Generator) -> Array | None:
    """A polyline ``(W, n)`` from one via point to the next that is clear all along.

    One that is given is mended where it is not clear, and cut short only where it has too many edges.

    Args:
        ways: that are known, or how one is planned.
        leg: from which via point.
        most: edges.
        rng: of what is random.

    Returns:
        None where none was found of so few edges.
    """
    ends = ways.points[leg], ways.points[leg + 1]
    space, given = ways.space(*ends, step=STEP), ways.given(leg)
    if given is not None:
        path = _mended(space, given, rng)
        return path if path is None or len(path) - 1 <= most else _cut(space, path, most, rng)
    vain: set[float] = set()
    for _ in range(ROUNDS):
        for plan, short in _plans(ways, leg, rng, vain):
            # What is cut off is looked at less closely, and may be beyond mending.
            for path in (short, plan):
                mended = _mended(space, path, rng)
                path = None if mended is None else _cut(space, mended, most, rng)
                if path is not None:
                    return path
    return None


def _plans(ways: Ways, leg: int, rng: np.random.Generator, vain: set[float]) -> list[tuple[Array, Array]]:
    """Some plans, each as it is and shortened, the shortest first."""
    space = ways.space(ways.points[leg], ways.points[leg + 1])
    found: list[tuple[float, int, Array, Array]] = []
    for _ in range(PLANS):
        plan = ways.planned(leg, rng, False, vain)
        if plan is not None:
            short = shortened(space, plan, rng)
            found.append((float(space.distance(short[1:], short[:-1]).sum()), len(found), plan, short))
        if ways.looked > PATIENCE:
            break
    return [(plan, short) for _, _, plan, short in sorted(found, key=lambda one: one[:2])]


def _cut(space: Space, path: Array, most: int, rng: np.random.Generator) -> Array | None:
    """A path of so few edges; None where that fails."""
    path = _pruned(space, path)
    if len(path) - 1 > most:
        mended = _mended(space, shortened(space, path, rng, PASSES), rng)
        if mended is None:
            return None
        path = _pruned(space, mended)
    return path if len(path) - 1 <= most else None


def _mended(space: Space, path: Array, rng: np.random.Generator) -> Array | None:
    """A path with what is not clear of it replaced; None where that fails."""
    corners = np.asarray(space.clear(path), dtype=bool)
    if not corners[[0, -1]].all():
        return None
    path = path[corners]
    reached = space.reached(path[:-1], path[1:])
    parts = [path[:1]]
    for a, b, share in zip(path[:-1], path[1:], reached, strict=True):
        way = np.array([a, b]) if share >= 1.0 else connect(space, a, b, rng, MOST)
        if way is None:
            return None
        parts.append(way[1:])
    return np.concatenate(parts)


def _pruned(space: Space, path: Array) -> Array:
    """A path without the corners that it can do without."""
    i = 1
    while i < len(path) - 1:
        if space.reached(path[i - 1 : i], path[i + 1 : i + 2])[0] >= 1.0:
            path = np.delete(path, i, axis=0)
        else:
            i += 1
    return path
