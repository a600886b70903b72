"""The moves of a task as one path through joint space: its points, where it rests, and how long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import Derivatives, Task


@dataclass(frozen=True, eq=False)
class Route:
    """A path.

    Attributes:
        points: via points, ends included ``(L + 1, n)``.
        stops: those at which it rests, counted from 0; inner ones.
        dwells: seconds that it stands still, by via point.
        tolerance: by which inner points may be missed ``(n,)``.
        begin, end: derivatives 1, 2, .. ``(k, n)`` at the ends; None for rest.
    """

    points: Array
    stops: tuple[int, ...]
    dwells: dict[int, float]
    tolerance: Array
    begin: Array | None
    end: Array | None


def route_of(task: Task, joints: int) -> Route:
    """The route of a resolved task."""
    points: list[list[float]] = []
    stops: list[int] = []
    dwells: dict[int, float] = {}
    for i, move in enumerate(task.move):
        rows = list(move.via or ())
        if not rows or any(len(row) != joints for row in rows):
            raise InputError(f"{task.name}: [[move]] {i + 1} has points that are not of {joints} joints; give such")
        if points and np.array_equal(rows[0], points[-1]):
            rows = rows[1:]
        points += rows
        last = i == len(task.move) - 1
        if last and move.dwell:
            raise InputError(f"{task.name}: the last [[move]] has a dwell; there is nothing after it: leave it out")
        if not last and move.stop and len(points) > 1:
            stops.append(len(points) - 1)
        if move.dwell:
            dwells[len(points) - 1] = move.dwell
        for side, own in (("begin", i == 0), ("end", last)):
            if getattr(move, side) is not None and not own:
                raise InputError(f"{task.name}: [[move]] {i + 1} has {side}, which only an end of the whole has")
    if len(points) < 2:
        raise InputError(f"{task.name}: there is one point in all; give two or more, or start and goal")
    tolerances = [np.broadcast_to(np.asarray(move.tolerance, dtype=float), (joints,)) for move in task.move]
    if any(not np.array_equal(one, tolerances[0]) for one in tolerances):
        raise InputError(f"{task.name}: moves have different tolerances; give all the same")
    ends = (_derivatives(task.move[0].begin), _derivatives(task.move[-1].end))
    return Route(np.array(points), tuple(stops), dwells, tolerances[0], *ends)


def exact_points(route: Route) -> list[tuple[str, Array]]:
    """The points that every motion along a route passes exactly ``(n,)``, in words."""
    last = len(route.points) - 1
    names = {0: "the start", last: "the goal"}
    inner = [] if route.tolerance.any() else range(1, last)
    return [(names.get(i, f"point {i + 1}"), route.points[i]) for i in (0, *inner, last)]


def _derivatives(table: Derivatives | None) -> Array | None:
    return None if table is None else np.array([table.velocity, *([table.acceleration] if table.acceleration else [])])
