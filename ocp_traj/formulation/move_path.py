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

RETIMED, ARCS = (
    16,
    80,
)  # pieces a leg of a path that is retimed, fewer where more than so many come together: our choice


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
        snap = limits.bounds("snap")
        smooth = snap is not None and np.isfinite(snap).any()
        return JointPath.through(route.points, joints, degree=5 if smooth else 3)
    curve = PiecewiseBezier(np.array(geometry.durations), tuple(np.array(rows) for rows in geometry.control_points))
    path = JointPath.of_curve(curve, joints)
    if path.points.shape != route.points.shape or np.abs(path.points - route.points).max() > 1e-9:
        raise InputError(f"{task.name}: [[move]] geometry does not pass the points of via at the ends of its segments")
    return path


def retimed_pieces(task: Task, legs: int) -> int:
    """Pieces from one point of the path to the next: those asked for, or enough to gain what there is to be had."""
    return task.curve.pieces or int(np.clip(ARCS // legs, 1, RETIMED))
