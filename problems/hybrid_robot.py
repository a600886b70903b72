"""The 5-DOF hybrid robot of Guo et al. (2016): its numbers, dynamics and inverse kinematics."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.robot.chain import AxisJoint, DHRow, LinkInertia
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import ActuatorMap, Robot

JOINTS = ("X_S1", "X_S2", "X_S3", "phi_4", "phi_5")
UNITS = ("m", "m", "m", "rad", "rad")
GRAVITY = 9.80665  # [m/s^2], below (42)

# Table 1 [m]. L_p: (8), with L_t = 225 mm.
L1, L2, L3, L4, L5, L01, E = 0.420, 0.050, 0.450, 0.180, 0.180, 0.400, 0.0
LP = 0.225 - (0.180 + sqrt(2.0) * 0.080 + E)

# Table 4: mass [kg], inertia about the centre of mass [kg mm^2], centre of mass [mm].
TABLE_4 = (
    (
        83.025,
        ((5095170.782, -61.008, 1019.065), (-61.008, 3291706.841, -15.858), (1019.065, -15.858, 2367692.766)),
        (0.0, 0.0, -44.182),
    ),
    (
        21.333,
        (
            (1475990.573, -3970.014, -748196.633),
            (-3970.014, 2366543.574, -8327.223),
            (-748196.633, -8327.223, 911968.216),
        ),
        (-304.563, -1.306, -278.925),
    ),
    (
        8.022,
        ((142265.977, -0.114, 0.002), (-0.114, 45016.139, 46002.096), (0.002, 46002.096, 109393.601)),
        (0.0, -63.686, -468.138),
    ),
    (
        9.120,
        ((119573.680, 27.342, -0.849), (27.342, 36160.108, -18452.465), (-0.849, -18452.465, 94076.578)),
        (0.0, -52.909, -261.241),
    ),
)

# Table 2, SI.
LIMITS = JointLimits(
    position=((0.0, 0.0, 0.0, -pi, -pi), (1.0, 1.0, 0.5, pi, pi)),
    velocity=(0.25, 0.25, 0.25, 1.96, 1.96),
    acceleration=(5.0, 5.0, 5.0, 60.0, 60.0),
    jerk=(100.0, 100.0, 100.0, 1200.0, 1200.0),
    effort=(500.0, 500.0, 500.0, 17.0, 17.0),
)


def robot(case: Any = None) -> Robot:
    """The 5-DOF hybrid robot: two parallel ball screws that move and yaw link 1, a lift, and two revolute joints.

    It is the same for every case.
    """

    def serial(q: Any) -> Any:  # (90), (92): d1, alpha, X_S3, phi_4, phi_5
        return casadi.vertcat((q[0] + q[1]) / 2.0, casadi.atan((q[1] - q[0]) / L1), q[2], q[3], q[4])

    links = [LinkInertia(mass, np.array(centre) * 1e-3, np.array(inertia) * 1e-6) for mass, inertia, centre in TABLE_4]
    return Robot.from_dh(
        rows=(  # Table 3
            DHRow(d=L01, a=L3, kind="prismatic"),
            DHRow(theta=-pi / 2.0, d=L2 + L4 + sqrt(2.0) * L5, alpha=pi / 4.0),
            DHRow(theta=pi, d=sqrt(2.0) * E, alpha=pi / 4.0),
            DHRow(d=LP, kind="fixed"),
        ),
        inertias=(*links[1:], None),
        prefix=(AxisJoint("prismatic", axis=(1, 0, 0)), AxisJoint("revolute", axis=(0, 0, 1), inertia=links[0])),
        gravity=(0.0, 0.0, GRAVITY),  # Z0 points down
        joints=JOINTS,
        units=UNITS,
        limits=LIMITS,
        actuator_map=ActuatorMap("parallel screws", serial),
        name="hybrid 5-DOF",
    )


def joints_of(position: ArrayLike, axis: ArrayLike, side: float = -1.0) -> Array:
    """Joint coordinates of tool positions and tool axes, (29)-(32) with A1/L3 in place of A1.

    Args:
        position: p ``(N, 3)`` [m].
        axis: a ``(N, 3)``, unit, a_z > 0.
        side: sign of n_z, which tells the two turns about the axis apart; the paper's is the negative one.

    Returns:
        ``(N, 5)``: X_S1, X_S2, X_S3 [m], phi_4, phi_5 [rad]; NaN where the yaw would lie beyond +-45 deg (below (4)).
    """
    p, a = np.atleast_2d(np.asarray(position, dtype=float)), np.atleast_2d(np.asarray(axis, dtype=float))
    az = a[:, 2]
    nz = side * np.sqrt(np.maximum(1.0 - (2.0 * az - 1.0) ** 2, 0.0)) / sqrt(2.0)
    y, x = a[:, 1] * (az - 1.0) + a[:, 0] * nz, a[:, 0] * (az - 1.0) - a[:, 1] * nz
    sine = (p[:, 1] - LP * a[:, 1] + (E * y / ((az - 1.0) ** 2 + nz**2) if E else 0.0)) / L3
    alpha = np.arcsin(np.where(np.abs(sine) > sqrt(0.5), np.nan, sine))
    phi5 = np.arctan2(-sqrt(2.0) * nz, 2.0 * az - 1.0)
    phi4 = np.arctan2(y, x) - alpha
    phi4 = np.arctan2(np.sin(phi4), np.cos(phi4))
    middle = p[:, 0] + E * np.cos(alpha + phi4) - L3 * np.cos(alpha) - LP * a[:, 0]
    half = 0.5 * L1 * np.tan(alpha)
    lift = p[:, 2] - (L2 + L4 + sqrt(2.0) * L5 + L01 + E + az * LP)
    return np.asarray(np.stack([middle - half, middle + half, lift, phi4, phi5], axis=1))


def forward_kinematics(q: ArrayLike, case: Any = None) -> tuple[Array, Array]:
    """Tool poses, rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m], of joint coordinates ``(N, 5)`` [m, rad]."""
    return robot(case).poses(q)


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike, case: Any = None) -> Array:
    """Joint coordinates ``(N, 2, 5)`` of tool poses, for both signs of n_z; NaN where the tool does not get there."""
    axis = np.reshape(rotation, (-1, 3, 3))[:, :, 2]
    found = np.stack([joints_of(position, axis, side) for side in (-1.0, 1.0)], axis=1)
    return robot(case).reaching(found, rotation, position)
