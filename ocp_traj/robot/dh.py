"""A robot from Denavit-Hartenberg rows as plain data: what is wrong is said by the row's number."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from ocp_traj.errors import InputError, RobotDefinitionError, nearest, quoted
from ocp_traj.robot.chain import DHRow, LinkInertia
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

CONSTANTS = ("theta", "d", "a", "alpha")
KEYS = (*CONSTANTS, "kind", "name", "mass", "com", "inertia", "armature")
KINDS = ("revolute", "prismatic", "fixed")


def robot_of_rows(
    rows: Sequence[Mapping[str, Any]],
    *,
    convention: str = "standard",
    base: pin.SE3 | None = None,
    tool: pin.SE3 | None = None,
    gravity: npt.ArrayLike = (0.0, 0.0, -9.81),
    limits: JointLimits | None = None,
    name: str = "robot",
) -> Robot:
    """A robot of Denavit-Hartenberg rows; conventions, base and tool are those of `Robot.from_dh`.

    Args:
        rows: each a mapping; all keys are optional.
            theta, alpha [rad], d, a [m]: constants of the row, 0 where not given.
            kind: "revolute", "prismatic" or "fixed"; "revolute" where not given.
            name: of the joint; joint1, joint2, ... where not given.
            mass [kg], com ``(3,)`` [m], inertia about the com [kg m^2] as `inertia_matrix` takes it: of the row's link,
            in its frame.
            armature: a rotor's inertia as felt at the joint, times the gear ratio squared [kg m^2 or kg].
        convention: "standard" or "modified".
        base: of the first joint in the world.
        tool: tool frame in the last row's frame.
        gravity: in the world [m/s^2].
        limits: of the joints that move.
        name: of the robot.
    """
    if not rows:
        raise RobotDefinitionError("there are no rows; give one per joint")
    parts = []
    for number, row in enumerate(rows, start=1):
        try:
            parts.append(_row(row))
        except InputError as error:
            raise RobotDefinitionError(f"row {number}: {error}") from error
    moving = [row for row, _ in parts if row.kind != "fixed"]
    given = [row for row in rows if row.get("kind", "revolute") != "fixed"]
    labels = [str(row.get("name", f"joint{i}")) for i, row in enumerate(given, start=1)]
    if not moving:
        raise RobotDefinitionError("all rows are fixed; give one that is revolute or prismatic")
    robot = Robot.from_dh(
        [row for row, _ in parts], [body for _, body in parts], convention=convention, base=base, tool=tool,
        gravity=gravity, joints=labels, limits=limits, name=name,
    )  # fmt: skip
    robot.model.armature = np.array([float(row.get("armature", 0.0)) for row in given])
    for index, label in enumerate(labels, start=1):
        robot.model.names[index] = label
    return robot


def _row(row: Mapping[str, Any]) -> tuple[DHRow, LinkInertia | None]:
    """The constants and the link of a row, checked."""
    for key in row:
        if key not in KEYS:
            raise RobotDefinitionError(
                f"{quoted(key)} is not allowed{nearest(str(key), KEYS)}; allowed are {', '.join(KEYS)}"
            )
    kind = row.get("kind", "revolute")
    if kind not in KINDS:
        raise RobotDefinitionError(f"kind is {quoted(kind)}; allowed are {', '.join(KINDS)}")
    constants = {key: _number(row.get(key, 0.0), key) for key in CONSTANTS}
    if kind == "fixed":
        for key in ("name", "armature"):
            if key in row:
                raise RobotDefinitionError(f"{key} is of a joint, and the row is fixed; leave it out")
    elif _number(row.get("armature", 0.0), "armature") < 0.0:
        raise RobotDefinitionError(f"armature is {row['armature']}, expected zero or more")
    if "name" in row and not (isinstance(row["name"], str) and row["name"]):
        raise RobotDefinitionError(f"name is {quoted(row['name'])}, expected a text")
    for key in ("com", "inertia"):
        if key in row and "mass" not in row:
            raise RobotDefinitionError(f"{key} is given without a mass; give mass [kg] too")
    body = None
    if "mass" in row:
        given = {name: row[key] for key, name in (("com", "centre"), ("inertia", "inertia")) if key in row}
        body = LinkInertia(_number(row["mass"], "mass"), **given)
    return DHRow(**constants, kind=kind), body


def _number(value: Any, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise RobotDefinitionError(f"{key} is {quoted(value)}, expected a finite number")
    return float(value)
