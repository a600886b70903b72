"""Polylines past obstacles that are clear as they stand: each edge can be driven, with a stop at every corner."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.ways import Ways
from ocp_traj.paths.connecting_trees import Space, connect, shortened

STEP = 0.004  # between points that are looked at, of the norm of q / speed: a proof seldom finds less than these
PASSES = 20  # of shortening a mended polyline: our choice
ATTEMPTS = 6  # plans: our choice
# Of so many that are clear the shortest is taken, and no other is looked for once so many points were looked at: ours
PLANS, PATIENCE = 5, 45_000
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
    vain: set[float] = set()
    found: list[Array] = []
    begun = ways.looked
    for _ in range(ATTEMPTS):
        path = ways.planned(leg, rng, False, vain) if given is None else given
        path = None if path is None else _mended(space, path, rng)
        if path is not None and given is None:  # what is cut off is looked at less closely, and may have to be mended
            short = _mended(space, shortened(ways.space(*ends), path, rng), rng)
            path = _pruned(space, path if short is None else short)
        elif path is not None and len(path) - 1 > most:
            path = _pruned(space, path)
        if path is not None and len(path) - 1 > most:
            path = _mended(space, shortened(space, path, rng, PASSES), rng)
            path = None if path is None else _pruned(space, path)
        if path is not None and len(path) - 1 <= most:
            found.append(path)
        if found and (given is not None or len(found) == PLANS or ways.looked - begun > PATIENCE):
            break
    return min(found, key=lambda path: float(space.distance(path[1:], path[:-1]).sum()), default=None)


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
