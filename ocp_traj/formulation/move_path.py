"""The path of a move: points of a file, or the geometry of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError
from ocp_traj.formulation.route import Route
from ocp_traj.formulation.task import Geometry, Task
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_file import read_path
from ocp_traj.robot.joint_limits import JointLimits

# Pieces a leg of a path that is retimed with limits on snap, by septics, and without; fewer where more than so many
# come together; and by how many times they grow from level to level: our choice. Each doubling takes a UR5 through its
# points twice as long to solve; 8 septics gain 0.34 % over 4, 32 quintics 0.06 % over 16.
RETIMED_SNAP, RETIMED, ARCS, RETIMED_FACTOR = 4, 16, 80, 4


def resolved_path(
    path: str, folder: Path, point: int | None, joints: Sequence[str], factor: Array
) -> tuple[Array, Geometry | None]:
    """Points of a move ``(N, dof)`` in SI, none twice in a row, and their own geometry where a motion has given them.

    Args:
        path: a file or run folder, from ``folder``.
        folder: of the task file.
        point: of the run.
        joints: of the robot.
        factor: what a coordinate in the task's units is in SI ``(dof,)``: a table of points is in those.
    """
    given = read_path(folder / path, joints, point)
    for i in np.flatnonzero((np.diff(given.points, axis=0) == 0.0).all(axis=1)).tolist():
        raise InputError(f"{given.places[i]} and {given.places[i + 1]} are the same; leave one of them out")
    if given.curve is None:
        return given.points * factor if given.in_file_units else given.points, None
    segments = [points.tolist() for points in given.curve.control_points]
    return given.points, Geometry(durations=given.curve.durations.tolist(), control_points=segments)


def retimed_path(task: Task, route: Route, joints: Sequence[str], limits: JointLimits) -> JointPath:
    """The path that a task keeps: its own geometry, or a spline through its points, as smooth as the limits ask for."""
    geometry = task.move[0].geometry
    if geometry is None:
        return JointPath.through(route.points, joints, degree=5 if _limits_snap(limits) else 3)
    curve = PiecewiseBezier(np.array(geometry.durations), tuple(np.array(rows) for rows in geometry.control_points))
    path = JointPath.of_curve(curve, joints)
    if path.points.shape != route.points.shape or np.abs(path.points - route.points).max() > 1e-9:
        raise InputError(f"{task.name}: [[move]] geometry does not pass the points of via at the ends of its segments")
    return path


def retimed_pieces(task: Task, path: JointPath, limits: JointLimits) -> int:
    """Pieces from one point of the path to the next: those asked for, or enough to gain what there is to be had."""
    most = RETIMED_SNAP if _limits_snap(limits) else RETIMED
    return task.curve.pieces or int(np.clip(ARCS // path.curve.segments, 1, most))


def _limits_snap(limits: JointLimits) -> bool:
    pair = limits.bounds("snap")
    return pair is not None and bool(np.isfinite(pair).any())
