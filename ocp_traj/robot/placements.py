"""Where all joints of a robot are, from the root outward: one symbolic function, for bulk evaluation and enclosures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np
from casadi import SX

from ocp_traj.robot.dynamics import aligned_joints
from ocp_traj.robot.robot import Robot


def placements_function(robot: Robot, joints: Sequence[int]) -> Any:
    """SX Function from actuator coordinates q ``(n,)`` to the frames of some joints in the world ``(12 joints,)``.

    A joint's rotation comes first, row by row, then its position [m]. Joint 0 is the world.
    """
    q = SX.sym("q", robot.size)
    s = q if robot.actuator_map is None else robot.actuator_map.position(q)
    frames: list[tuple[Any, Any]] = [(SX(np.eye(3)), SX(np.zeros(3)))]
    aligned = aligned_joints(robot.model)
    for joint in aligned[1:]:
        rotation, position = frames[joint.parent]
        turned = rotation @ SX(np.array(joint.rotation, dtype=float))
        position = position + rotation @ SX(np.array(joint.position, dtype=float))
        if joint.revolute:
            c, t = casadi.cos(s[joint.column]), casadi.sin(s[joint.column])
            x, y, z = casadi.horzsplit(turned)
            turned = casadi.horzcat(x * c + y * t, y * c - x * t, z)
        else:
            position = position + turned[:, 2] * s[joint.column]
        frames.append((turned, position))
    parts = []
    for index in joints:
        rotation, position = frames[index]
        axes = np.eye(3) if index == 0 else aligned[index].axes
        parts += [casadi.vec((rotation @ SX(axes.T)).T), position]
    return casadi.Function("placements", [q], [casadi.densify(casadi.vertcat(*parts))])
