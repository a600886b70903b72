"""FANUC M-10iD/8L: the maker's dynamics, and the kinematics of Table 1 of Zhu and Wang, which are the same arm's.

Placements, inertias, ranges, speeds and efforts are those of the maker's robot description (FANUC Corporation,
fanuc_description, m10_8-20d, Apache-2.0); its efforts look like round placeholders. Coordinates are the teach pendant's
angles, whose joint 3 is measured from the horizontal.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import casadi
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.robot.chain import AxisJoint, LinkInertia
from ocp_traj.robot.robot import ActuatorMap, Robot
from ocp_traj.robot.six_axis import JointAngles, SixAxisArm

JOINTS = ("J1", "J2", "J3", "J4", "J5", "J6")
VELOCITY = (210.0, 210.0, 220.0, 430.0, 450.0, 720.0)  # [deg/s]
EFFORT = (2000.0, 3000.0, 1000.0, 100.0, 100.0, 50.0)  # [N m]
# [deg] of the joints between the links: J1, J2, J2 + J3, J4, J5, J6.
POSITION = ((-185.0, -90.0, -90.0, -190.0, -179.999, -450.0), (185.0, 145.0, 222.0, 190.0, 179.999, 450.0))

# Placement [m] and axis of each joint; mass [kg], centre of mass [m], inertia about it (xx, xy, xz, yy, yz, zz)
# [kg m^2] of its link, in the joint's frame.
LINKS = (
    ((0.0, 0.0, 0.45), (0, 0, 1), 25.1, (0.0385, -0.0176, -0.0359),
     (0.285, -0.0106, -0.0157, 0.242, -0.00898, 0.336)),
    ((0.075, 0.0, 0.0), (0, 1, 0), 33.5, (-0.0227, -0.151, 0.402),
     (2.3, -0.0223, 0.0191, 2.33, -0.0412, 0.152)),
    ((0.0, 0.0, 0.84), (0, -1, 0), 54.5, (0.242, 0.0064, 0.116),
     (0.693, -0.0249, -0.368, 2.13, -0.035, 2.1)),
    ((0.0, 0.0, 0.195), (-1, 0, 0), 17.5, (0.678, -0.0311, -0.000832),
     (0.0509, 0.0696, 0.000437, 0.9, -0.000433, 0.915)),
    ((1.1, 0.0, 0.0), (0, -1, 0), 1.16, (0.0214, -0.015, 0.0),
     (0.00173, -0.000392, 0.0, 0.00191, 0.0, 0.00189)),
    ((0.0, 0.0, 0.0), (-1, 0, 0), 0.224, (0.0537, 0.0, 0.0),
     (0.000131, 0.0, 0.0, 0.000102, 0.0, 0.000102)),
)  # fmt: skip
FLANGE_AXES = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])  # of Table 1's frame 6 at zero
FLANGE = 0.075  # [m] from the wrist along J6

TABLE_1 = SixAxisArm(d1=0.45, a1=0.075, a2=0.84, a3=0.195, d4=1.1, d6=0.075)  # [m]
PRINTED_A3 = 1.1  # [m], Table 1, row 4
# theta of Table 1 from the angles between the links.
THETA = JointAngles(
    np.array([1.0, 1.0, -1.0, -1.0, -1.0, -1.0]), np.array([0.0, -pi / 2, 0.0, 0.0, 0.0, 0.0]), np.radians(POSITION)
)


def serial_angles(q: Any) -> Any:
    """Angles between the links from the pendant's, whose joint 3 is measured from the horizontal. [rad]."""
    return casadi.vertcat(q[0], q[1], q[1] + q[2], q[3], q[4], q[5])


def robot() -> Robot:
    """FANUC M-10iD/8L with the inertias of the maker's description; its coordinates are the pendant's angles."""
    joints = []
    for place, axis, mass, centre, (xx, xy, xz, yy, yz, zz) in LINKS:
        inertia = LinkInertia(mass, centre, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        joints.append(AxisJoint("revolute", axis, pin.SE3(np.eye(3), np.array(place)), inertia))
    return Robot.from_dh(
        rows=(),
        inertias=(),
        prefix=joints,
        tool=pin.SE3(FLANGE_AXES, np.array([FLANGE, 0.0, 0.0])),
        gravity=(0.0, 0.0, -9.81),
        joints=JOINTS,
        units=("rad",) * 6,
        actuator_map=ActuatorMap("pendant angles", serial_angles),
        name="FANUC M-10iD/8L",
    )


def arm(as_printed: bool = False) -> SixAxisArm:
    """The arm of Table 1, with a3 as printed or corrected."""
    return replace(TABLE_1, a3=PRINTED_A3) if as_printed else TABLE_1


def pendant_to_table_1(q: ArrayLike) -> Array:
    """Angles theta of Table 1 from the pendant's, ``(.., 6)`` [rad]."""
    serial = np.array(q, dtype=float)
    serial[..., 2] += serial[..., 1]
    return THETA.theta(serial)


def table_1_to_pendant(theta: ArrayLike) -> Array:
    """The pendant's angles from Table 1's, ``(.., 6)`` [rad], on the turns that their ranges hold."""
    serial = THETA.joints(theta)
    serial[..., 2] -= serial[..., 1]
    return serial


def forward_kinematics(q: ArrayLike, as_printed: bool = False) -> tuple[Array, Array]:
    """Flange poses, rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m], of pendant angles ``(N, 6)`` [rad]."""
    return arm(as_printed).forward(pendant_to_table_1(q))


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike, as_printed: bool = False) -> Array:
    """Pendant angles ``(N, 8, 6)`` [rad] that reach flange poses, NaN where a branch does not exist.

    (3) as printed takes the flange for the wrist and has signs of another arm. Whether the joints' ranges allow a
    branch is not looked at; what is singular, and why a branch does not exist, says ``arm().inverse``.
    """
    return table_1_to_pendant(arm(as_printed).inverse(rotation, position).angles)
