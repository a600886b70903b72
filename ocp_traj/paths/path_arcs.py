"""A path cut into short arcs, each of which goes on along a direction of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError
from ocp_traj.paths.joint_path import JointPath

SHORTEST = 1.0 / 64.0  # of the path from one point to the next: an arc that is cut no more; our choice
ROUNDING = 1e-12  # of the steps of control points: by so much some may go against the direction


@dataclass(frozen=True, eq=False)
class PathArcs:
    """Arcs of a path.

    Attributes:
        curve: an arc a segment, its ``durations`` the steps of the path's parameter.
        directions: unit vectors ``(K, dof)``, with which the tangent makes no more than a right angle all over an arc.
        legs: the arcs from each point of the path to the next.
    """

    curve: PiecewiseBezier
    directions: Array
    legs: tuple[range, ...]

    @classmethod
    def of(cls, path: JointPath, pieces: int) -> PathArcs:
        """Equal steps of the parameter, so many from one point to the next: more where the path turns sharply.

        Raises:
            InputError: where the path turns back on itself.
        """
        whole = path.curve
        cuts: list[tuple[int, float, float]] = []
        ways: list[Array] = []
        legs: list[range] = []
        for leg in range(whole.segments):
            first, todo = len(cuts), [(0.0, 1.0)]
            while todo:
                a, b = todo.pop()
                points = whole.restrict(leg, a, b)
                way = points[-1] - points[0]
                steps = np.diff(points, axis=0) @ way  # all of one sign: so is the tangent's component
                if way.any() and (steps >= -ROUNDING * np.abs(steps).max()).all():
                    at = np.linspace(a, b, pieces + 1)
                    cuts += [(leg, float(low), float(high)) for low, high in zip(at[:-1], at[1:], strict=True)]
                    ways += [way / np.linalg.norm(way)] * pieces
                elif b - a > SHORTEST:
                    todo += [((a + b) / 2.0, b), (a, (a + b) / 2.0)]
                else:
                    raise InputError(
                        f"the path turns back between its points {leg + 1} and {leg + 2}, where every motion along it "
                        "stops; make that a point, and two paths"
                    )
            legs.append(range(first, len(cuts)))
        steps = np.array([whole.durations[leg] * (b - a) for leg, a, b in cuts])
        return cls(PiecewiseBezier(steps, tuple(whole.restrict(*cut) for cut in cuts)), np.array(ways), tuple(legs))


def nearest(curve: PiecewiseBezier, segment: int, points: Array) -> Array:
    """Where a segment is nearest to points ``(N, dof)``: local times ``(N,)``."""
    grid = np.linspace(0.0, 1.0, 101)
    distance = ((curve.at(segment, grid)[None] - points[:, None]) ** 2).sum(axis=2)
    found = grid[np.argmin(distance, axis=1)]
    step = curve.durations[segment]
    for _ in range(8):  # of Newton's method, from within half a percent
        away = curve.at(segment, found) - points
        first, second = (curve.at(segment, found, order) * step**order for order in (1, 2))
        bend = (first**2).sum(axis=1) + (away * second).sum(axis=1)
        move = (away * first).sum(axis=1) / np.where(bend > 0.0, bend, np.inf)
        found = np.clip(found - move, 0.0, 1.0)
    return np.asarray(found)
