"""A robot as plain JSON values and back, exactly: the same efforts and poses to the last digit."""

from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, RobotDefinitionError, nearest, quoted
from ocp_traj.robot.dynamics import Friction, joint_index, joint_is_revolute
from ocp_traj.robot.joint_limits import QUANTITIES, UNLIMITED, JointLimits
from ocp_traj.robot.robot import Robot

MOST_JOINTS = 200  # our choice
LARGEST = 1e9  # [SI] of a length, mass, inertia or acceleration of gravity: our choice
RIGID, UNIT = 1e-6, 1e-9  # how far a rotation may be from one, and an axis from unit length: our choice
SYMMETRIC = np.triu_indices(3)
WHOLE = ("name", "gravity", "joints", "actuators", "units", "limits", "tool", "friction")
JOINT = ("name", "parent", "kind", "axis", "rotation", "translation", "mass", "com", "inertia", "armature")
TYPES = {
    ("revolute", (1.0, 0.0, 0.0)): pin.JointModelRX, ("prismatic", (1.0, 0.0, 0.0)): pin.JointModelPX,
    ("revolute", (0.0, 1.0, 0.0)): pin.JointModelRY, ("prismatic", (0.0, 1.0, 0.0)): pin.JointModelPY,
    ("revolute", (0.0, 0.0, 1.0)): pin.JointModelRZ, ("prismatic", (0.0, 0.0, 1.0)): pin.JointModelPZ,
}  # fmt: skip


def to_numbers(robot: Robot) -> dict[str, Any]:
    """Plain JSON values that `from_numbers` makes the same robot of; an infinite limit is ``None``.

    Raises ``RobotDefinitionError`` for an actuator map, which is a function and no number.
    """
    if robot.actuator_map is not None:
        raise RobotDefinitionError(
            f"actuator map {robot.actuator_map.name!r} is a function and cannot be written as numbers; "
            "name the problem that brings the robot instead"
        )
    model = robot.model
    data = model.createData()
    joints = []
    for i in range(1, model.njoints):
        revolute, body = joint_is_revolute(model, i), model.inertias[i]
        subspace = np.asarray(data.joints[i].S, dtype=float).reshape(6)  # linear part first
        joints.append({
            "name": str(model.names[i]),
            "parent": int(model.parents[i]),
            "kind": "revolute" if revolute else "prismatic",
            "axis": (subspace[3:] if revolute else subspace[:3]).tolist(),
            **_placement(model.jointPlacements[i]),
            "mass": float(body.mass),
            "com": body.lever.tolist(),
            "inertia": body.inertia[SYMMETRIC].tolist(),
            "armature": float(model.armature[i - 1]),
        })  # fmt: skip
    numbers: dict[str, Any] = {
        "name": str(model.name),
        "gravity": model.gravity.linear.tolist(),
        "joints": joints,
        "actuators": list(robot.joints),
        "units": list(robot.units),
        "limits": {
            name: [[x if np.isfinite(x) else None for x in side] for side in getattr(robot.limits, name).tolist()]
            for name in QUANTITIES if getattr(robot.limits, name) is not None
        },
        "tool": {"joint": joint_index(model, robot.tool_joint), **_placement(robot.tool)},
    }  # fmt: skip
    if robot.friction is not None:
        numbers["friction"] = {name: value.tolist() for name, value in robot.friction._asdict().items()}
    return numbers


def _placement(placement: pin.SE3) -> dict[str, list[float]]:
    """Rotation, row by row, and translation [m]."""
    return {"rotation": placement.rotation.ravel().tolist(), "translation": placement.translation.tolist()}


def from_numbers(numbers: Any) -> Robot:
    """The robot of `to_numbers`; what is wrong raises ``RobotDefinitionError``: one line with its place."""
    _only(numbers, WHOLE, "the robot", optional=("friction",))
    joints = numbers["joints"]
    if not isinstance(joints, list) or not 1 <= len(joints) <= MOST_JOINTS:
        raise RobotDefinitionError(f"the robot's joints are {quoted(joints)}, expected a list of 1 to {MOST_JOINTS}")
    model, armature = pin.Model(), []
    model.name = _text(numbers["name"], "the robot's name")
    model.gravity.linear = _array(numbers["gravity"], 3, "the robot's gravity")
    for i, joint in enumerate(joints, start=1):
        where = f"joint {i} of the robot"
        _only(joint, JOINT, where)
        name = _text(joint["name"], f"{where}: name")
        if model.existJointName(name):
            raise RobotDefinitionError(f"{where}: name is {quoted(name)}, which an earlier one has; give another")
        model.addJoint(_whole(joint["parent"], i - 1, f"{where}: parent"), _joint_model(joint, where),
                       _se3(joint, where), name)  # fmt: skip
        model.inertias[i] = _body(joint, where)
        armature.append(_least(joint["armature"], f"{where}: armature"))
    model.armature = np.array(armature)
    _only(numbers["tool"], ("joint", "rotation", "translation"), "the robot's tool")
    carrier = _whole(numbers["tool"]["joint"], len(joints), "the robot's tool: joint", least=1)
    tool = _se3(numbers["tool"], "the robot's tool")
    labels, units = (
        tuple(_text(x, f"the robot's {key}") for x in _list(numbers[key], len(joints), f"the robot's {key}"))
        for key in ("actuators", "units")
    )
    friction = None
    if "friction" in numbers:
        _only(numbers["friction"], Friction._fields, "the robot's friction")
        friction = Friction(
            *(_array(numbers["friction"][key], len(joints), f"the robot's {key}") for key in Friction._fields)
        )
    limits = _limits(numbers["limits"], len(joints))
    try:
        return Robot(model, labels, units, limits, tool, None, carrier, friction)
    except InputError as error:
        raise RobotDefinitionError(f"the robot's numbers: {error}") from error


def _joint_model(joint: Mapping[str, Any], where: str) -> Any:
    axis = _array(joint["axis"], 3, f"{where}: axis")
    if abs(np.linalg.norm(axis) - 1.0) > UNIT:
        raise RobotDefinitionError(f"{where}: axis is {axis.tolist()}, expected a unit vector")
    unaligned = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
    kind = joint["kind"]
    if not isinstance(kind, str) or kind not in unaligned:
        raise RobotDefinitionError(f"{where}: kind is {quoted(kind)}; allowed are {', '.join(unaligned)}")
    aligned = TYPES.get((kind, tuple(axis.tolist())))
    return unaligned[kind](axis) if aligned is None else aligned()


def _body(joint: Mapping[str, Any], where: str) -> pin.Inertia:
    body, inertia = pin.Inertia.Zero(), np.empty((3, 3))
    inertia[SYMMETRIC] = inertia.T[SYMMETRIC] = _array(joint["inertia"], 6, f"{where}: inertia")
    body.mass = _least(joint["mass"], f"{where}: mass")
    body.lever = _array(joint["com"], 3, f"{where}: com")
    body.inertia = inertia
    return body


def _se3(values: Mapping[str, Any], where: str) -> pin.SE3:
    rotation = _array(values["rotation"], 9, f"{where}: rotation").reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > RIGID or np.linalg.det(rotation) < 0.0:
        raise RobotDefinitionError(f"{where}: rotation is {quoted(rotation.tolist())}, expected a rotation matrix")
    return pin.SE3(rotation, _array(values["translation"], 3, f"{where}: translation"))


def _limits(values: Any, size: int) -> JointLimits:
    if not isinstance(values, dict):
        raise RobotDefinitionError(f"the robot's limits are {quoted(values)}, expected an object")
    given = {}
    for name, pair in values.items():
        where = f"the robot's limits: {name}"
        if name not in QUANTITIES:
            raise RobotDefinitionError(f"{where} is not allowed{nearest(name, QUANTITIES)}")
        sides = [_list(side, size, where) for side in _list(pair, 2, where)]
        given[name] = [[fill if x is None else _number(x, where, UNLIMITED) for x in side]
                       for side, fill in zip(sides, (-inf, inf), strict=True)]  # fmt: skip
    try:
        return JointLimits(**given)
    except InputError as error:
        raise RobotDefinitionError(f"the robot's limits: {error}") from error


def _only(values: Any, keys: tuple[str, ...], where: str, optional: tuple[str, ...] = ()) -> None:
    """Checks that an object has these keys and no others."""
    if not isinstance(values, dict):
        raise RobotDefinitionError(f"{where} is {quoted(values)}, expected an object with {', '.join(keys)}")
    for key in values:
        if key not in keys:
            raise RobotDefinitionError(f"{where}: {quoted(key)} is not allowed{nearest(str(key), keys)}")
    for key in keys:
        if key not in values and key not in optional:
            raise RobotDefinitionError(f"{where}: {key} is missing; give {', '.join(keys)}")


def _number(value: Any, where: str, most: float = LARGEST) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= most:
        raise RobotDefinitionError(f"{where} is {quoted(value)}, expected a number of at most {most:g}")
    return float(value)


def _least(value: Any, where: str) -> float:
    number = _number(value, where)
    if number < 0.0:
        raise RobotDefinitionError(f"{where} is {number}, expected zero or more")
    return number


def _whole(value: Any, most: int, where: str, least: int = 0) -> int:
    if type(value) is not int or not least <= value <= most:
        raise RobotDefinitionError(f"{where} is {quoted(value)}, expected a whole number from {least} to {most}")
    return value


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise RobotDefinitionError(f"{where} is {quoted(value)}, expected a text")
    return value


def _list(value: Any, size: int, where: str) -> list[Any]:
    if not isinstance(value, list) or len(value) != size:
        raise RobotDefinitionError(f"{where} is {quoted(value)}, expected a list of {size}")
    return value


def _array(value: Any, size: int, where: str) -> Array:
    return np.array([_number(x, where) for x in _list(value, size, where)])
