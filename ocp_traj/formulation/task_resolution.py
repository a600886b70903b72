"""A task resolved: its robot in numbers, all of it in SI, its points in it: nothing else decides it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.display import count
from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation.collision_resolution import resolved_collision
from ocp_traj.formulation.move_path import resolved_path
from ocp_traj.formulation.task import (
    TOOL_WAYS,
    Derivatives,
    Held,
    MoveTable,
    Placement,
    RobotTable,
    Source,
    Task,
    Units,
)
from ocp_traj.formulation.task_values import share_of
from ocp_traj.formulation.tool_chains import Chain
from ocp_traj.formulation.tool_moves import resolved_tool_move
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
    with _at(task, "[robot]", _keys_of(task.robot)):
        bare = _robot(task.robot, folder, angle, length, JointLimits(), False)
    factor = np.array([angle if unit == "rad" else length for unit in bare.units])
    given, shares = _given_limits(task, bare, factor)
    own = task.limits.description and task.robot.dh is None and task.robot.numbers is None
    with _at(task, "[robot]", _keys_of(task.robot)):
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
        with _at(task, "[robot]", {"": "friction"}):
            robot = replace(robot, friction=Friction(*(getattr(friction, name) for name in Friction._fields)))
    robot = replace(robot, limits=JointLimits(**{name: pair for name, pair in limits.items() if pair is not None}))
    for i, move in enumerate(task.move):
        if move.goal is not None and (move.start is None) != (i > 0):
            words = (
                "has goal without start; give both" if i == 0
                else "has start, but begins where the one before ends; leave start out"
            )  # fmt: skip
            raise InputError(f"{task.name}: [[move]] {i + 1} {words}, or give via")
    moves: list[MoveTable] = []
    done = 0  # moves
    for i, move in enumerate(task.move):
        if i < done:
            continue
        done = i + 1
        with _of_move(task, i):
            if any(getattr(move, way) is not None for way in TOOL_WAYS) or move.tool_path is not None:
                before = np.array(moves[-1].via[-1]) if moves and moves[-1].via else None
                chain = Chain.at(task.move, i)
                done = i + len(chain.moves)
                along = resolved_tool_move(chain, robot, before, angle, length)
                moves.append(along.model_copy(update={"payload": _resolved_held(move.payload, length)}))
                continue
            moves.append(_resolved_move(move, task, folder, robot, factor, length))
    if (collision := task.collision) is not None:
        urdf = _urdf(task.robot, folder)
        collision = resolved_collision(collision, task.name, robot, urdf, folder, angle, length)
    payload = _resolved_held(task.robot.payload, length)
    start = task.solve.start
    if isinstance(start, str) and Path(start).suffix:
        start = resolved_path(start, folder, None, robot.joints, factor)[0].tolist()
    elif isinstance(start, str) and start not in STARTS:
        raise InputError(
            f"{task.name}: [solve] start is {quoted(start)}{nearest(start, STARTS)}; give {', '.join(STARTS)}, or the "
            "path of a .csv or .yaml file"
        )
    waived = dict.fromkeys(QUANTITIES)
    if task.limits.tool_speed is not None:
        waived["tool_speed"] = task.limits.tool_speed * length
    changed = {
        "units": Units(), "robot": RobotTable(numbers=to_numbers(robot), payload=payload),
        "limits": task.limits.model_copy(update=waived), "move": moves,
        "collision": collision,
        "solve": task.solve.model_copy(update={"start": start}),
        "source": task.source or Source(file="code", sha256=""),
    }  # fmt: skip
    return task.model_copy(update=changed)


@contextmanager
def _at(task: Task, table: str, keys: Mapping[str, str]) -> Iterator[None]:
    """Complaints within name the task, the table and, by the words they begin with, the key they are of."""
    try:
        yield
    except InputError as error:
        words = str(error)
        key = next(key for begin, key in keys.items() if words.startswith(begin))
        raise type(error)(f"{task.name}: {table} {key}: {words}") from error


@contextmanager
def _of_move(task: Task, number: int) -> Iterator[None]:
    """Complaints within name the task, and the move by its number."""
    try:
        yield
    except InputError as error:
        words, own = str(error).removeprefix(f"{task.name}: "), f"[[move]] {number + 1}"
        key = "path: " if task.move[number].path is not None else ""
        words = words.replace("[[move]]", own, 1) if "[[move]]" in words else f"{own}: {key}{words}"
        raise type(error)(f"{task.name}: {words}") from error


def _keys_of(robot: RobotTable) -> dict[str, str]:
    """The key that a complaint about a robot is of, by the words it begins with."""
    locked = {begin + repr(name): "locked" for name in robot.locked for begin in ("", "joint ")}
    by = next(name for name in ("description", "urdf", "dh", "numbers") if getattr(robot, name) is not None)
    return {repr(robot.tool_frame): "tool_frame", **locked, "": by}


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
        else:
            each = value if isinstance(value, list) else [value] * n
            high = np.array([infinite if v is None else v for v in each], dtype=float)
            low = -high
        if low.shape != (n,) or high.shape != (n,):
            raise InputError(
                f"{task.name}: [limits] {name} has {low.size if low.size != n else high.size} numbers; the robot has "
                f"{n} joints: "
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
        points, geometry = resolved_path(move.path, folder, move.point, robot.joints, factor)
    else:
        geometry = move.geometry
        rows = move.via if move.via is not None else [row for row in (move.start, move.goal) if row is not None]
        if wrong := [row for row in rows if len(row) != robot.size]:
            raise InputError(
                f"{task.name}: [[move]] has a point of {count(len(wrong[0]), 'coordinate')}; the robot has "
                f"{robot.size} joints: "
                f"{', '.join(robot.joints)}"
            )
        points = np.array(rows) * factor
        for i in np.flatnonzero((np.diff(points, axis=0) == 0.0).all(axis=1)).tolist():
            raise InputError(
                f"{task.name}: [[move]]: points {i + 1} and {i + 2} are the same; leave one of them out (to stand "
                "still is a dwell)"
            )
    changed: dict[str, Any] = {"via": points.tolist(), **dict.fromkeys(("start", "goal", "path", "point"))}
    changed["geometry"] = geometry
    changed["payload"] = _resolved_held(move.payload, length)
    tolerance = np.asarray(move.tolerance, dtype=float)
    if tolerance.shape not in ((), (robot.size,)):
        raise InputError(
            f"{task.name}: [[move]]: tolerance has {tolerance.size} numbers; the robot has {robot.size} joints"
        )
    changed["tolerance"] = (np.broadcast_to(tolerance, (robot.size,)) * factor).tolist() if tolerance.any() else 0.0
    for side in ("begin", "end"):
        table = getattr(move, side)
        if table is not None:
            given = {k: v for k, v in dict(table).items() if v is not None}
            for name, row in given.items():
                if len(row) != robot.size:
                    numbers = count(len(row), "number")
                    raise InputError(
                        f"{task.name}: [[move]]: {side}.{name} has {numbers}; the robot has {robot.size} joints"
                    )
            changed[side] = Derivatives(**{k: (np.array(v) * factor).tolist() for k, v in given.items()})
    return move.model_copy(update=changed)
