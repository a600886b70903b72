"""Paths through joint space from files: points, a motion, or a point of a run's front.

Points are joined by a spline; whatever says how the joints move from one to the next keeps its own geometry: a
trajectory of this package, samples, splines and BPoly, and a ``trajectory_msgs`` message or a table with velocities, as
a controller interpolates it. The times of a motion are the path's parameter and nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import MOST_NAMES, FileFormatError, InputError, nearest, quoted
from ocp_traj.files import read_text
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_points import read_points
from ocp_traj.paths.trajectory_file import ROS_FORMAT, curve_of, joints_of, kind_of, read_values, sound

TRAJECTORIES = "trajectories"  # folder of a run's, numbered from 0
STILL = 1e-12  # of the path's extent: a segment that moves less is a dwell, and no part of the geometry


@dataclass(frozen=True, eq=False)
class GivenPath:
    """What a file holds.

    Attributes:
        points: ``(N, dof)``, of a motion its knots, joints in the robot's order.
        places: what messages call them.
        curve: of a motion [rad or m, over s]; None where there are points alone.
        in_file_units: whether the points are in units that the file does not tell.
    """

    points: Array
    places: tuple[str, ...]
    curve: PiecewiseBezier | None = None
    in_file_units: bool = False


def read_path(path: str | Path, joints: Sequence[str], point: int | None = None) -> GivenPath:
    """What a file or run folder holds, its joints in the order of ``joints``.

    Args:
        path: a ``.csv``, ``.yaml`` or ``.json`` file, or a run folder.
        joints: of the robot.
        point: of the run's front, counted from 0; not needed where it has only one.

    Raises:
        InputError: one line that names the file and what is wrong with it.
    """
    if Path(path).is_dir():
        path = _of_run(Path(path), point)
    elif point is not None:
        raise InputError(f"point = {point} is of a run's front; {path} is no run folder")
    if (data := _motion(path)) is None:
        points, places = read_points(path, joints)
        return GivenPath(points, places, None, Path(path).suffix.lower() == ".csv")
    curve = _in_order(curve_of(data, str(path)), _names(data, str(path)), str(path), joints)
    moving = _without_dwells(curve, str(path))
    knots = JointPath.of_curve(moving, joints).points
    return GivenPath(knots, tuple(f"knot {i} of {path}" for i in range(len(knots))), moving)


def load_path(path: str | Path, joints: Sequence[str], *, degree: int = 3, point: int | None = None) -> JointPath:
    """The path that a file or run folder holds: see ``read_path``.

    Points are joined by a spline of ``degree`` 3 or 5; a motion keeps its own geometry.
    """
    given = read_path(path, joints, point)
    if given.curve is not None:
        return JointPath.of_curve(given.curve, joints)
    return JointPath.through(given.points, joints, degree=degree, places=given.places)


def _of_run(folder: Path, point: int | None) -> Path:
    """The file of a point of a run's front."""
    files = sorted((folder / TRAJECTORIES).glob("[0-9]*.json"))
    if not files:
        raise InputError(f"{folder} has no {TRAJECTORIES}/000.json: it is no run folder, or its run has not ended")
    if point is None and len(files) > 1:
        raise InputError(f"{folder} has {len(files)} trajectories; say which, point = 0 to {len(files) - 1}")
    if not 0 <= (point or 0) < len(files):
        raise InputError(f"{folder} has {len(files)} trajectories, 0 to {len(files) - 1}; there is no point {point}")
    return files[point or 0]


def _motion(path: str | Path) -> dict[str, Any] | None:
    """Values of a file that says how the joints move; None of one that has points alone."""
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        text = read_text(path, "path").removeprefix("\ufeff")
        head = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
        return read_values(path) if "time [s]" in head else None
    if suffix not in (".yaml", ".yml", ".json"):
        return None
    data = read_values(path)
    kind = kind_of(data)
    if kind is None:
        return None
    if kind == ROS_FORMAT:
        points = data["points"]
        whole = isinstance(points, list) and len(points) > 1 and all(isinstance(p, dict) for p in points)
        moves = whole and all(p.get("velocities") and p.get("time_from_start") is not None for p in points)
        return data if moves else None
    return dict(data)


def _names(data: dict[str, Any], source: str) -> tuple[str, ...]:
    with sound(data, source):
        return joints_of(data)


def _in_order(curve: PiecewiseBezier, names: tuple[str, ...], source: str, joints: Sequence[str]) -> PiecewiseBezier:
    for name in names:
        if name not in joints:
            raise FileFormatError(
                f"{source}: its joint {quoted(name)} is none of the robot's{nearest(name, joints)}; those are "
                f"{quoted(list(joints), MOST_NAMES)}"
            )
    for name in joints:
        if name not in names:
            raise FileFormatError(f"{source}: the joint {quoted(name)} is missing; it has {quoted(list(names))}")
    if curve.dof != len(names):
        raise FileFormatError(f"{source} names {len(names)} joints; its curve has {curve.dof}")
    order = [names.index(name) for name in joints]
    return PiecewiseBezier(curve.durations, tuple(points[:, order] for points in curve.control_points))


def _without_dwells(curve: PiecewiseBezier, source: str) -> PiecewiseBezier:
    extent = max(float(np.ptp(points, axis=0).max()) for points in curve.control_points)
    kept = [k for k, points in enumerate(curve.control_points) if np.ptp(points, axis=0).max() > STILL * extent]
    if not kept:
        raise FileFormatError(f"{source} does not move; a path has to go somewhere")
    return PiecewiseBezier(curve.durations[kept], tuple(curve.control_points[k] for k in kept))
