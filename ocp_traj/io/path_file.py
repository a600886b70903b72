"""Paths through joint space from files: points, a trajectory of this package, or a point of a run's front."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import MOST_NAMES, FileFormatError, InputError, nearest, quoted
from ocp_traj.files import read_json
from ocp_traj.io.run_reader import load_run
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_points import read_points
from ocp_traj.results.trajectory import Trajectory


def load_path(path: str | Path, joints: Sequence[str], *, degree: int = 3, point: int | None = None) -> JointPath:
    """The path that a file or run folder holds, its joints in the order of ``joints``.

    Points (``paths.path_points``) are joined by a spline of ``degree``; a trajectory keeps its own geometry.

    Args:
        path: a ``.csv``, ``.yaml`` or ``.json`` file, or a run folder.
        joints: of the robot.
        degree: 3 or 5.
        point: of the run's front, counted from 0; not needed where it has only one.

    Raises:
        InputError: one line that names the file and what is wrong with it.
    """
    if Path(path).is_dir():
        points = load_run(path).points
        if point is None and len(points) > 1:
            raise InputError(f"{path} has {len(points)} trajectories; say which, point = 0 to {len(points) - 1}")
        if not points or not -len(points) <= (point or 0) < len(points):
            raise InputError(f"{path} has {len(points)} trajectories; there is no point {point or 0}")
        return _of_motion(points[point or 0].trajectory, str(path), joints)
    if point is not None:
        raise InputError(f"point = {point} is of a run's front; {path} is no run folder")
    if Path(path).suffix.lower() == ".json":
        data = read_json(path, "path")
        if isinstance(data, dict) and "format" in data:
            return _of_motion(Trajectory.from_dict(data, str(path)), str(path), joints)
    found, places = read_points(path, joints)
    return JointPath.through(found, joints, degree=degree, places=places)


def _of_motion(motion: Motion, source: str, joints: Sequence[str]) -> JointPath:
    for name in motion.joints:
        if name not in joints:
            raise FileFormatError(
                f"{source}: its joint {quoted(name)} is none of the robot's{nearest(name, joints)}; those are "
                f"{quoted(list(joints), MOST_NAMES)}"
            )
    for name in joints:
        if name not in motion.joints:
            raise FileFormatError(
                f"{source}: the joint {quoted(name)} is missing; it has {quoted(list(motion.joints))}"
            )
    order = [motion.joints.index(name) for name in joints]
    curve = PiecewiseBezier(motion.curve.durations, tuple(points[:, order] for points in motion.curve.control_points))
    return JointPath.of_curve(curve, joints)
