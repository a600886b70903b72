"""The state of a robot in a ROS message: where its joints are, and what it holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.io.ros_values import Node

STATE = ("joint_state", "multi_dof_joint_state", "attached_collision_objects", "is_diff")
STILL = 1e-9  # how large a velocity counts as none [rad/s or m/s], and a displacement of a floating joint: our choice


@dataclass(frozen=True, eq=False)
class RobotState:
    """Coordinates by joint [rad or m], in the file's order, and the list of attached objects, if there is one."""

    joints: dict[str, float]
    attached: Node | None


def robot_state(node: Node) -> RobotState:
    """The state of a ``moveit_msgs/RobotState``, at rest; a joint of several degrees of freedom has to be at zero."""
    node.known(STATE)
    state = node.at("joint_state")
    state.known(("header", "name", "position", "velocity", "effort"))
    names, positions = state.at("name"), state.at("position")
    found: dict[str, float] = {}
    if len(positions.items()) != len(names.items()):
        raise positions.refused(f"has {len(positions.items())} numbers for {len(names.items())} names; give one each")
    for name, position in zip(names.items(), positions.items(), strict=True):
        if name.text() in found:
            raise name.refused(f"names the joint {name.text()!r} a second time; name it once")
        found[name.text()] = position.number()
    for item in state.at("velocity").items():
        if abs(item.number()) > STILL:
            raise item.wrong("0: a motion from rest is what can be had")
    floating = node.at("multi_dof_joint_state")
    floating.known(("header", "joint_names", "transforms", "twist", "wrench"))
    for item in floating.at("transforms").items():
        if np.abs(item.transform().homogeneous - np.eye(4)).max() > STILL:
            raise item.refused(
                "moves the robot's base; not supported: give bodies in the robot's first frame, and no transform"
            )
    attached = node.at("attached_collision_objects")
    return RobotState(found, attached if attached.items() else None)
