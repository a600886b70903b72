"""The spherical wrist of El Haiek et al. (2019), Rz(th1) Ry(th2) Rz(th3): its kinematics, and dynamics of our choice.

Masses are 1.2, 0.8 and 0.25 kg, with 0.30 kg at the tip, all our choice. Links 1 and 2 are solid cylinders of radius
0.05 and 0.04 m and height 0.1 and 0.08 m about the centre of the wrist, link 3 is a rod of radius 0.02 m from there to
the tip. Gravity acts along -z of the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, hypot, pi
from typing import Any

import casadi
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.robot.chain import AxisJoint, LinkInertia
from ocp_traj.robot.collision import Obstacle
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

Array = NDArray[np.float64]

JOINTS = ("theta1", "theta2", "theta3")
UNITS = ("rad", "rad", "rad")


def robot(length: float, limits: JointLimits) -> Robot:
    """The wrist, its tool frame at the tip.

    Args:
        length: of the last link [m].
        limits: of its joints and efforts.
    """

    def cylinder(mass: float, radius: float, height: float, centre: float = 0.0) -> LinkInertia:
        across = mass * (3.0 * radius**2 + height**2) / 12.0
        return LinkInertia(mass, (0.0, 0.0, centre), np.diag([across, across, mass * radius**2 / 2.0]))

    rod, tip = cylinder(0.25, 0.02, length, length / 2.0), 0.30
    mass = rod.mass + tip
    centre = (rod.mass * length / 2.0 + tip * length) / mass
    spread = rod.mass * (centre - length / 2.0) ** 2 + tip * (length - centre) ** 2
    third = LinkInertia(mass, (0.0, 0.0, centre), rod.inertia + np.diag([spread, spread, 0.0]))
    links = (cylinder(1.2, 0.05, 0.1), cylinder(0.8, 0.04, 0.08), third)
    axes = ((0, 0, 1), (0, 1, 0), (0, 0, 1))
    return Robot.from_dh(
        rows=(),
        inertias=(),
        prefix=tuple(AxisJoint("revolute", axis=axis, inertia=link) for axis, link in zip(axes, links, strict=True)),
        tool=pin.SE3(np.eye(3), np.array([0.0, 0.0, length])),
        joints=JOINTS,
        units=UNITS,
        limits=limits,
        name="spherical wrist",
    )


def direction(q: Any) -> Any:
    """Direction of the last link, (1)-(3) over d3: a symbolic column from joints ``(3,)``."""
    return casadi.vertcat(*_direction(q, casadi))


def directions(q: Array) -> Array:
    """Directions of the last link ``(N, 3)`` from joints ``(N, 3)``."""
    return np.stack(_direction(q.T, np), axis=1)


def _direction(q: Any, of: Any) -> tuple[Any, Any, Any]:
    """With the sine and cosine of a library."""
    sine = of.sin(q[1])
    return of.cos(q[0]) * sine, of.sin(q[0]) * sine, of.cos(q[1])


def pointing(point: Sequence[float] | Array, branch: int = 0) -> tuple[float, float]:
    """theta1, theta2 [rad] in (-pi, pi] that point the last link at a point; branch 1 is (th1 -+ pi, -th2)."""
    x, y, z = point
    th1, th2 = atan2(y, x), atan2(hypot(x, y), z)
    if branch == 0:
        return th1, th2
    return (th1 - pi if th1 > 0.0 else th1 + pi), -th2


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike) -> Array:
    """Joints ``(N, 2, 3)`` [rad] of both branches that point at positions ``(N, 3)`` and turn as ``(N, 3, 3)`` does."""
    found = []
    for turned, point in zip(np.reshape(rotation, (-1, 3, 3)), np.reshape(position, (-1, 3)), strict=True):
        for branch in (0, 1):
            th1, th2 = pointing(point, branch)
            x = np.array([np.cos(th1) * np.cos(th2), np.sin(th1) * np.cos(th2), -np.sin(th2)])  # axes before th3
            y = np.array([-np.sin(th1), np.cos(th1), 0.0])
            found.append((th1, th2, atan2(y @ turned[:, 0], x @ turned[:, 0])))
    return np.reshape(found, (-1, 2, 3))


def homotopy_class(curve: PiecewiseBezier, obstacles: Sequence[Obstacle], branch: int) -> str:
    """The homotopy class: the goal's branch, then per obstacle on which sides of its joint images it passes.

    The link points at an obstacle's centre at two places of the plane (theta1, theta2). About each the curve turns by
    some angle; its sign, + for anticlockwise, says on which side the curve passes, a number before it the full turns.
    """
    q = np.concatenate([curve.at(k, np.linspace(0.0, 1.0, 401)) for k in range(curve.segments)])
    words = [f"branch {branch}"]
    for sphere in obstacles:
        signs = ""
        for image in (0, 1):
            away = q[:, :2] - np.array(pointing(sphere.centre, image))
            angle = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
            turn = angle[-1] - angle[0]
            turns = int(abs(turn) // (2.0 * pi))
            signs += (str(turns) if turns else "") + ("+" if turn >= 0.0 else "-")
        words.append(f"obstacle {sphere.number} {signs}")
    return ", ".join(words)
