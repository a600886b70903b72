"""MoveIt motion plan requests: from where to where, in joint coordinates.

A ``moveit_msgs/MotionPlanRequest`` message in YAML. A start state and joint constraints on the goal are read; what else
a request may ask for is refused by name, since a motion that does not keep it would be none of what was asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ocp_traj.io.robot_state import RobotState, robot_state
from ocp_traj.io.ros_values import Node, read_message

WHAT = "motion request"
REQUEST = (
    "workspace_parameters", "start_state", "goal_constraints", "path_constraints", "trajectory_constraints",
    "reference_trajectories", "pipeline_id", "planner_id", "group_name", "num_planning_attempts",
    "allowed_planning_time", "max_velocity_scaling_factor", "max_acceleration_scaling_factor",
    "cartesian_speed_end_effector_link", "cartesian_speed_limited_link", "max_cartesian_speed",
)  # fmt: skip
OTHERS = ("position_constraints", "orientation_constraints", "visibility_constraints")
PARTS = ("name", "joint_constraints", *OTHERS)


@dataclass(frozen=True, eq=False)
class Request:
    """What a request asks for.

    Attributes:
        start: the state it begins in.
        goal: coordinates by joint [rad or m].
        scaling: shares of the limits on velocity and acceleration that it asks for; 1 where it does not.
        tolerant: whether it would take a goal near the one it names as well.
    """

    start: RobotState
    goal: dict[str, float]
    scaling: dict[str, float]
    tolerant: bool


def read_request(path: str | Path) -> Request:
    """The request of a file.

    Raises:
        FileFormatError: one line with file and place.
    """
    root = read_message(path, WHAT)
    root.known(REQUEST)
    path_constraints = root.at("path_constraints")
    path_constraints.known(PARTS)
    for name in PARTS[1:]:
        if path_constraints.at(name).items():
            raise path_constraints.at(name).refused("hold along the way, which is not supported: leave them out")
    for name in ("trajectory_constraints", "reference_trajectories"):
        node = root.at(name)
        if node.value not in (None, [], {}) and node.value != {"constraints": []}:
            raise node.refused("are not supported: leave them out")
    speed = root.at("max_cartesian_speed")
    if speed.value is not None and speed.number() > 0.0:
        raise speed.refused(f"is {speed.number():g}; a limit on the speed of a link is not supported: leave it out")
    goals = root.at("goal_constraints")
    if len(goals.items()) != 1:
        raise goals.refused(f"has {len(goals.items())} goals; give one")
    goal, tolerant = _goal(goals.items()[0])
    start = root.at("start_state")
    state = robot_state(start)
    if not state.joints:
        raise start.at("joint_state").wrong("the state that the motion begins in: lists name and position")
    scaling = {word: _share(root.at(f"max_{word}_scaling_factor")) for word in ("velocity", "acceleration")}
    return Request(state, goal, scaling, tolerant)


def _goal(node: Node) -> tuple[dict[str, float], bool]:
    """Coordinates by joint, and whether there are tolerances."""
    node.known(PARTS)
    for name in OTHERS:
        if node.at(name).items():
            raise node.at(name).refused("are not supported; give joint_constraints, of inverse kinematics of your own")
    found: dict[str, float] = {}
    tolerant = False
    constraints = node.at("joint_constraints")
    if not constraints.items():
        raise constraints.wrong("one for each joint, with joint_name and position")
    for item in constraints.items():
        item.known(("joint_name", "position", "tolerance_above", "tolerance_below", "weight"))
        name = item.at("joint_name").text()
        if name in found:
            raise item.at("joint_name").refused(f"names the joint {name!r} a second time; name it once")
        found[name] = item.at("position").number()
        for side in ("tolerance_above", "tolerance_below"):
            tolerance = item.at(side)
            if tolerance.value is not None and not tolerance.number() >= 0.0:
                raise tolerance.wrong("a number, 0 or more")
            tolerant |= bool(tolerance.value)
    return found, tolerant


def _share(node: Node) -> float:
    """A scaling factor; none, or 0, is 1 as MoveIt has it."""
    if node.value is None:
        return 1.0
    share = node.number("a number from 0 to 1")
    if not 0.0 <= share <= 1.0:
        raise node.wrong("a number from 0 to 1")
    return share or 1.0
