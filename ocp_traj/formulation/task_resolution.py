"""A task resolved: its robot in numbers, all of it in SI, its points in it: nothing else decides it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation.collision_resolution import resolved_collision
from ocp_traj.formulation.task import Derivatives, Held, MoveTable, Placement, RobotTable, Source, Task, Units
from ocp_traj.formulation.task_values import share_of
from ocp_traj.paths.path_points import read_points
from ocp_traj.robot.descriptions import description_urdf
from ocp_traj.robot.dh import robot_of_rows
from ocp_traj.robot.dynamics import Friction
from ocp_traj.robot.joint_limits import QUANTITIES, JointLimits
from ocp_traj.robot.numbers import from_numbers, to_numbers
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf import urdf_root, urdf_text

ANGLES, LENGTHS = {"rad": 1.0, "deg": np.pi / 180.0}, {"m": 1.0, "mm": 1e-3}
HELD = ("position", "velocity", "effort")  # what a description may hold
STARTS = ("auto", "straight", "plan", "ompl")  # words of [solve] start
ASKED = ("acceleration", "jerk")  # what none holds, and a motion needs: given, or waived


def resolve(task: Task, folder: Path) -> Task:
    """The task with its robot in numbers, all in SI and its points in it, so that nothing else decides what it means.

    Args:
        task: as it was written.
        folder: from which its paths count.
    """
    if task.resolved:
        return task
    angle, length = ANGLES[task.units.angle], LENGTHS[task.units.length]
    bare = _robot(task.robot, folder, angle, length, JointLimits(), False)
    factor = np.array([angle if unit == "rad" else length for unit in bare.units])
    given, shares = _given_limits(task, bare, factor)
    own = task.limits.description and task.robot.dh is None and task.robot.numbers is None
    robot = _robot(task.robot, folder, angle, length, given, own)
    limits = {name: robot.limits.bounds(name) for name in QUANTITIES}
    for name, share in shares.items():
        if (pair := limits[name]) is None or not own:
            raise InputError(f"{task.name}: [limits] {name} is a share of the description's, which has none; give it")
        limits[name] = (pair[0] * share, pair[1] * share)
    for name in (*HELD, *ASKED):
        if getattr(task.limits, name) is None and limits[name] is None:
            raise InputError(
                f'{task.name}: [limits] {name} is missing: no description holds it; give it, or "none" for no limit'
            )
    if (friction := task.robot.friction) is not None:
        robot = replace(robot, friction=Friction(*(getattr(friction, name) for name in Friction._fields)))
    robot = replace(robot, limits=JointLimits(**{name: pair for name, pair in limits.items() if pair is not None}))
    for i, move in enumerate(task.move):
        if move.goal is not None and (move.start is None) != (i > 0):
            words = "has goal without start; give both" if i == 0 else "has start, but begins where the one before ends"
            raise InputError(f"{task.name}: [[move]] {i + 1} {words}, or give via")
    moves = [_resolved_move(move, task, folder, robot, factor, length) for move in task.move]
    if (collision := task.collision) is not None:
        urdf = _urdf(task.robot, folder)
        collision = resolved_collision(collision, task.name, robot, urdf, folder, angle, length)
    payload = _resolved_held(task.robot.payload, length)
    start = task.solve.start
    if isinstance(start, str) and Path(start).suffix:
        start = _path_points(folder / start, robot, factor).tolist()
    elif isinstance(start, str) and start not in STARTS:
        raise InputError(
            f"{task.name}: [solve] start is {quoted(start)}{nearest(start, STARTS)}; give {', '.join(STARTS)}, or the path "
            "of a .csv or .yaml file"
        )
    changed = {
        "units": Units(), "robot": RobotTable(numbers=to_numbers(robot), payload=payload),
        "limits": task.limits.model_copy(update={name: None for name in QUANTITIES}), "move": moves,
        "collision": collision, "solve": task.solve.model_copy(update={"start": start}),
        "source": task.source or Source(file="code", sha256=""),
    }  # fmt: skip
    return task.model_copy(update=changed)


def _robot(table: RobotTable, folder: Path, angle: float, length: float, limits: JointLimits, own: bool) -> Robot:
    if table.numbers is not None:
        robot = from_numbers(table.numbers)
        return replace(robot, limits=robot.limits.overridden_by(limits))
    if table.dh is not None:
        scales = {"theta": angle, "alpha": angle, "d": length, "a": length}
        rows = [{k: _scaled(v, scales.get(k, 1.0)) for k, v in row.items()} for row in table.dh]
        base, tool = (None if p is None else _placed(p, angle, length) for p in (table.base, table.tool))
        return robot_of_rows(
            rows, convention=table.convention, base=base, tool=tool, limits=limits, gravity=table.gravity
        )
    urdf = _urdf(table, folder)
    assert urdf is not None
    robot = Robot.from_urdf(
        urdf, tool_frame=table.tool_frame, locked=_locked(table, urdf, angle, length), file_limits=own, limits=limits,
        gravity=table.gravity,
    )  # fmt: skip
    if table.tool is not None:
        robot = replace(robot, tool=robot.tool * _placed(table.tool, angle, length))
    return robot


def _urdf(table: RobotTable, folder: Path) -> Path | None:
    """The robot's description; None for a robot by rows or numbers."""
    if table.description is not None:
        return description_urdf(table.description)
    return None if table.urdf is None else folder / table.urdf


def _locked(table: RobotTable, urdf: Path, angle: float, length: float) -> dict[str, float]:
    """Coordinates of the locked joints [rad or m]: which it is the file says."""
    if angle == length == 1.0 or not table.locked:
        return dict(table.locked)
    slides = {j.get("name") for j in urdf_root(*urdf_text(urdf)).iter("joint") if j.get("type") == "prismatic"}
    return {name: value * (length if name in slides else angle) for name, value in table.locked.items()}


def _scaled(value: Any, factor: float) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return value * factor if number and factor != 1.0 else value


def _placed(placement: Placement, angle: float, length: float) -> pin.SE3:
    rotation = np.eye(3)
    if placement.rpy is not None:
        rotation = pin.rpy.rpyToMatrix(*(angle * np.array(placement.rpy)))
    elif placement.quat_wxyz is not None:
        w, x, y, z = np.array(placement.quat_wxyz) / np.linalg.norm(placement.quat_wxyz)
        rotation = pin.Quaternion(w, x, y, z).toRotationMatrix()
    return pin.SE3(rotation, length * np.array(placement.xyz))


def _given_limits(task: Task, robot: Robot, factor: Array) -> tuple[JointLimits, dict[str, float]]:
    """The limits that are given in numbers, "none" as infinite ones, and those that are shares."""
    pairs: dict[str, Array] = {}
    shares: dict[str, float] = {}
    n, infinite = robot.size, np.inf
    for name in QUANTITIES:
        value = getattr(task.limits, name)
        if value is None:
            continue
        if (share := share_of(value)) is not None:
            if name in (*ASKED, "snap"):
                raise InputError(f"{task.name}: [limits] {name} is a share of the description's; no URDF holds it")
            shares[name] = share
            continue
        two = isinstance(value, list) and value and isinstance(value[0], list)
        if value == "none":
            low, high = np.full(n, -infinite), np.full(n, infinite)
        elif two:
            low, high = (
                np.array([fill if v is None else v for v in side], dtype=float)
                for side, fill in zip(value, (-infinite, infinite), strict=True)
            )
        elif name == "position":
            raise InputError(f"{task.name}: [limits] position needs two lists, lower and upper, one number a joint")
        else:
            each = value if isinstance(value, list) else [value] * n
            high = np.array([infinite if v is None else v for v in each], dtype=float)
            low = -high
        if low.shape != (n,) or high.shape != (n,):
            raise InputError(
                f"{task.name}: [limits] {name} has {max(low.size, high.size)} numbers; the robot has {n} joints: "
                f"{', '.join(robot.joints)}"
            )
        scale = 1.0 if name == "effort" else factor
        pairs[name] = np.array([low * scale, high * scale])
    try:
        return JointLimits(**pairs), shares
    except InputError as error:
        raise InputError(f"{task.name}: [limits] {error}") from error


def _resolved_held(held: Held | None, length: float) -> Held | None:
    return held and held.model_copy(update={"com": [length * x for x in held.com]})


def _resolved_move(move: MoveTable, task: Task, folder: Path, robot: Robot, factor: Array, length: float) -> MoveTable:
    if move.path is not None:
        points = _path_points(folder / move.path, robot, factor)
    else:
        rows = move.via if move.via is not None else [row for row in (move.start, move.goal) if row is not None]
        if wrong := [row for row in rows if len(row) != robot.size]:
            raise InputError(
                f"{task.name}: a point of [[move]] has {len(wrong[0])} coordinates; the robot has {robot.size} joints: "
                f"{', '.join(robot.joints)}"
            )
        points = np.array(rows) * factor
        for i in np.flatnonzero((np.diff(points, axis=0) == 0.0).all(axis=1)).tolist():
            raise InputError(
                f"{task.name}: points {i + 1} and {i + 2} of [[move]] are the same; leave one of them out (to stand "
                "still is a dwell)"
            )
    changed: dict[str, Any] = {"via": points.tolist(), "start": None, "goal": None, "path": None}
    changed["payload"] = _resolved_held(move.payload, length)
    tolerance = np.broadcast_to(np.asarray(move.tolerance, dtype=float), np.shape(move.tolerance) or ())
    if tolerance.shape not in ((), (robot.size,)) or (tolerance < 0.0).any():
        raise InputError(f"{task.name}: the tolerance of [[move]] is {move.tolerance}; give numbers from 0 up")
    changed["tolerance"] = (np.broadcast_to(tolerance, (robot.size,)) * factor).tolist() if tolerance.any() else 0.0
    for side in ("begin", "end"):
        table = getattr(move, side)
        if table is not None:
            given = {k: v for k, v in dict(table).items() if v is not None}
            if any(len(v) != robot.size for v in given.values()):
                raise InputError(f"{task.name}: {side} of [[move]] needs {robot.size} numbers, one a joint")
            changed[side] = Derivatives(**{k: (np.array(v) * factor).tolist() for k, v in given.items()})
    return move.model_copy(update=changed)


def _path_points(path: Path, robot: Robot, factor: Array) -> Array:
    """Points of a file ``(N, dof)``: a table's are in the task's units, a ROS message's in SI; none twice in a row."""
    points, places = read_points(path, robot.joints)
    for i in np.flatnonzero((np.diff(points, axis=0) == 0.0).all(axis=1)).tolist():
        raise InputError(f"{places[i]} and {places[i + 1]} are the same; leave one of them out")
    return points * factor if path.suffix.lower() == ".csv" else points
