"""The moves of a task as one path through joint space: its points, where it rests, and how long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import Derivatives, Task
from ocp_traj.formulation.tool_moves import ROWS, ToolMove


@dataclass(frozen=True, eq=False)
class Route:
    """A path.

    Attributes:
        points: via points, ends included ``(L + 1, n)``.
        stops: those at which it rests, counted from 0; inner ones.
        dwells: seconds that it stands still, by via point.
        tolerance: by which each point may be missed ``(L + 1, n)``; infinite inside tool paths.
        moves: of each leg between two points, the move it is of ``(L,)``, counted from 0.
        begin, end: derivatives 1, 2, .. ``(k, n)`` at the ends; None for rest.
        tool_moves: (number of its first leg, move) of each move along a tool path.
    """

    points: Array
    stops: tuple[int, ...]
    dwells: dict[int, float]
    tolerance: Array
    moves: tuple[int, ...]
    begin: Array | None
    end: Array | None
    tool_moves: tuple[tuple[int, ToolMove], ...] = ()


def route_of(task: Task, joints: int) -> Route:
    """The route of a resolved task."""
    points: list[list[float]] = []
    stops: list[int] = []
    dwells: dict[int, float] = {}
    tool_moves: list[tuple[int, ToolMove]] = []
    free: list[int] = []
    moves: list[int] = []
    for i, move in enumerate(task.move):
        rows = list(move.via or ())
        if not rows or any(len(row) != joints for row in rows):
            raise InputError(f"{task.name}: [[move]] {i + 1} has points that are not of {joints} joints; give such")
        tool_move = ToolMove.of(move)
        if tool_move is not None:
            rows = rows[::ROWS]
        if points and np.array_equal(rows[0], points[-1]):
            rows = rows[1:]
        points += rows
        if tool_move is not None:
            first = len(points) - len(tool_move.legs) - 1
            tool_moves.append((first, tool_move))
            free += range(first + 1, len(points) - 1)
        moves += [i] * len(rows)
        last = i == len(task.move) - 1
        if last and move.dwell:
            raise InputError(f"{task.name}: [[move]] {i + 1}: dwell is after the last move; leave it out")
        if not last and move.stop and len(points) > 1:
            stops.append(len(points) - 1)
        if move.dwell:
            dwells[len(points) - 1] = move.dwell
        for side, own in (("begin", i == 0), ("end", last)):
            if getattr(move, side) is not None and not own:
                raise InputError(f"{task.name}: [[move]] {i + 1}: {side} is what only an end of the whole has")
    if len(points) < 2:
        raise InputError(f"{task.name}: [[move]] 1 has the only point; give two or more, or start and goal")
    given = [move.tolerance for move in task.move if move.tool_path is None]
    tolerances = [np.broadcast_to(np.asarray(one, dtype=float), (joints,)) for one in given]
    if any(not np.array_equal(one, tolerances[0]) for one in tolerances):
        raise InputError(f"{task.name}: moves have different tolerances; give all the same")
    tolerance = np.tile(tolerances[0] if tolerances else np.zeros(joints), (len(points), 1))
    tolerance[[0, -1]] = 0.0
    for first, tool_move in tool_moves:
        tolerance[[first, first + len(tool_move.legs)]] = 0.0
    tolerance[free] = np.inf
    ends = (_derivatives(task.move[0].begin), _derivatives(task.move[-1].end))
    return Route(np.array(points), tuple(stops), dwells, tolerance, tuple(moves[1:]), *ends, tuple(tool_moves))


def exact_points(route: Route) -> list[tuple[str, Array]]:
    """The points that every motion along a route passes exactly ``(n,)``, in words."""
    last = len(route.points) - 1
    names = {0: "the start", last: "the goal"}
    exact = [i for i in range(last + 1) if i in names or not route.tolerance[i].any()]
    return [(names.get(i, f"point {i + 1}"), route.points[i]) for i in exact]


def _derivatives(table: Derivatives | None) -> Array | None:
    return None if table is None else np.array([table.velocity, *([table.acceleration] if table.acceleration else [])])
