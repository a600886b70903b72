"""A stand-in for the KUKA KR90 R3100 extra HA with a welding torch: no dynamic data of that robot are published.

Dimensions are the KR90's. Masses, centres of mass and inertias are those of the KR150 R3100-2 as published in
kroshu/kuka_robot_descriptions (kuka_quantec_support/urdf/kr150_r3100_2_macro.xacro, Apache-2.0), hung on the KR90's
dimensions, with link 3's centre of mass put on the wrist's axis; so are the efforts. Friction and torch are our
assumptions. Limits up to snap are Table 3 of Ogbemhe et al. (2019), positions its (20).
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin
from numpy.typing import ArrayLike
from pinocchio.rpy import rpyToMatrix

from ocp_traj.arrays import Array
from ocp_traj.robot.chain import AxisJoint, LinkInertia
from ocp_traj.robot.dynamics import Friction
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.six_axis import JointAngles, SixAxisArm

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")
H = pi / 2.0
# Placement of each joint in the one before at q = 0: roll, pitch, yaw [rad] and position [m]; every axis is z.
PLACEMENTS = (
    ((pi, 0.0, 0.0), (0.0, 0.0, 0.3056)),
    ((H, 0.0, 0.0), (0.350, 0.072, -0.3694)),
    ((0.0, 0.0, 0.0), (1.350, 0.0, -0.103)),
    ((H, 0.0, -H), (1.008, 0.041, 0.175)),
    ((0.0, H, H), (0.0, 0.096, -0.392)),
    ((H, 0.0, -H), (0.1665, 0.0, -0.096)),
)
# Mass [kg], centre of mass [m] in the joint's frame, principal moments [kg m2] and roll, pitch, yaw of their axes.
LINKS = (
    (363.07, (0.0288, 0.0119, -0.2340), (13.209, 31.495, 33.884), (1.8662, 0.1026, -0.2163)),
    (250.56, (0.5779, -0.0014, -0.1256), (6.112, 82.751, 83.259), (0.5376, 0.0907, 0.0072)),
    (199.93, (0.2623, 0.041, 0.1377), (3.488, 31.684, 32.631), (2.1421, -0.0660, -0.0638)),
    (42.41, (0.0, 0.0192, -0.1979), (0.1613, 1.3645, 1.3916), (1.5711, -1.4368, -1.5712)),
    (16.99, (0.0622, 0.0003, -0.0658), (0.2001, 0.1206, 0.2210), (1.5705, -0.8763, -0.0023)),
    (6.60, (0.0, 0.0, -0.0065), (0.01146, 0.01146, 0.01454), (0.0, 0.0, 0.0)),
)
FLANGE = ((pi, 0.0, 0.0), (0.0, 0.0, -0.0485))  # on A6
TORCH = (12.0, (0.03, 0.0, 0.18), (0.25, 0.25, 0.03))  # [kg], [m], [kg m2], in the flange's frame: our assumption
TIP = ((0.06, 0.0, 0.38), 40.0)  # [m] of the flange, and its tilt about the flange's y [deg]: our assumption

VELOCITY = (105.0, 101.0, 107.0, 292.0, 258.0, 284.0)  # [deg/s], Table 3
ACCELERATION = (52.0, 50.0, 80.0, 136.0, 178.0, 206.0)  # [deg/s2], Table 3
JERK = (75.0, 75.0, 82.0, 100.0, 190.0, 200.0)  # [deg/s3], Table 3
SNAP = (100.0, 100.0, 95.0, 90.0, 105.0, 150.0)  # [deg/s4], Table 3
TABLE_3 = pd.DataFrame(
    {"velocity [deg/s]": VELOCITY, "acceleration [deg/s2]": ACCELERATION, "jerk [deg/s3]": JERK, "snap [deg/s4]": SNAP},
    index=JOINTS,
)
POSITION = ((-185.0, -140.0, -120.0, -350.0, -125.0, -350.0), (185.0, -5.0, 155.0, 350.0, 125.0, 350.0))  # [deg], (20)
RANGES = dict(zip(JOINTS, zip(*POSITION, strict=True), strict=True))
EFFORT = (7290.0, 8910.0, 7539.0, 2431.0, 1461.0, 893.0)  # [N m], KR150 R3100-2
COULOMB = 0.03  # of the effort: our assumption, as the next two
VISCOUS = 0.05  # of the effort, at the largest velocity
CREEP = 0.02  # of the largest velocity: where the Coulomb friction has risen to 76 %
ARM = SixAxisArm(d1=0.675, a1=0.350, a2=1.350, a3=-0.041, d4=1.400, d6=0.215)  # [m], to the flange
REACH = ARM.a2 + ARM.forearm  # [m] from A2 to the wrist's centre, arm straight
THETA = JointAngles(  # of ``ARM``
    np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0]), np.array([0.0, 0.0, -H, 0.0, 0.0, 0.0]), np.radians(POSITION)
)


def robot(payload: float = 0.0, *, riser: float = 0.0, gravity: float = 9.81) -> Robot:
    """The stand-in, its torch mounted.

    Args:
        payload: a point mass at the flange's origin beside the torch [kg].
        riser: height on which the robot stands [m].
        gravity: [m/s2].
    """
    joints = []
    for (angles, place), (mass, centre, moments, axes) in zip(PLACEMENTS, LINKS, strict=True):
        turn = rpyToMatrix(*axes)
        inertia = LinkInertia(mass, centre, turn @ np.diag(moments) @ turn.T)
        joints.append(AxisJoint("revolute", (0, 0, 1), _place(angles, place), inertia))
    flange = _place(*FLANGE)
    mass, centre, moments = TORCH
    model = Robot.from_dh(
        rows=(),
        inertias=(),
        prefix=joints,
        base=pin.SE3(np.eye(3), np.array([0.0, 0.0, riser])),
        gravity=(0.0, 0.0, -gravity),
        tool=flange * _tip(),
        joints=JOINTS,
        units=("rad",) * 6,
        limits=JointLimits(
            position=np.radians(POSITION),
            velocity=np.radians(VELOCITY),
            acceleration=np.radians(ACCELERATION),
            jerk=np.radians(JERK),
            snap=np.radians(SNAP),
            effort=EFFORT,
        ),
        name="KR90 R3100 extra HA (stand-in)",
    )
    model.model.appendBodyToJoint(6, pin.Inertia(mass, np.array(centre), np.diag(moments)), flange)
    if payload > 0.0:
        model.model.appendBodyToJoint(6, pin.Inertia(payload, np.zeros(3), np.zeros((3, 3))), flange)
    return model


def _place(angles: tuple[float, ...], position: tuple[float, ...]) -> pin.SE3:
    return pin.SE3(rpyToMatrix(*angles), np.array(position))


def _tip() -> pin.SE3:
    """The torch's tip in the flange's frame."""
    return _place((0.0, np.radians(TIP[1]), 0.0), TIP[0])


def wrist_from_tip() -> Array:
    """The wrist's centre in the frame of the torch's tip ``(3,)`` [m]."""
    return np.asarray(_tip().actInv(np.array([0.0, 0.0, -ARM.d6])))


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike, riser: float = 0.0) -> Array:
    """Joints ``(N, 8, 6)`` [rad] that put the torch's tip at poses, NaN where a branch does not exist.

    Whether the joints' ranges allow a branch is not looked at; ``ARM.inverse`` of the flange says what is singular.
    """
    tip, turned = _tip(), np.reshape(rotation, (-1, 3, 3)) @ _tip().rotation.T
    flange = np.reshape(position, (-1, 3)) - turned @ tip.translation - np.array([0.0, 0.0, riser])
    return THETA.joints(ARM.inverse(turned, flange).angles)


def friction() -> Friction:
    """Coulomb and viscous friction of the joints; our assumption, for no figures are published."""
    effort, speed = np.array(EFFORT), np.radians(VELOCITY)
    return Friction(COULOMB * effort, VISCOUS * effort / speed, CREEP * speed)


def torque(machine: Robot, q: Any, v: Any, a: Any) -> Any:
    """Efforts ``(6,)`` [N m], friction included."""
    return machine.effort(q, v, a, friction=friction())
