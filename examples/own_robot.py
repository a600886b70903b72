"""A robot and a path of one's own: a UR5 through six points with a payload, limits from velocity to jerk and torque."""

from dataclasses import dataclass
from importlib.metadata import files

import casadi
import numpy as np

import ocp_traj as ot

URDF = next(str(file.locate()) for file in files("example-robot-data") or () if file.name == "ur5_robot.urdf")
VIA = np.array([
    [0.782, -1.064, 1.456, -1.894, -1.864, -0.394], [0.558, -0.822, 1.608, -1.771, -1.852, -0.166],
    [0.252, -0.890, 1.407, -1.522, -1.836, -0.288], [-0.073, -0.997, 1.411, -1.637, -1.298, 0.131],
    [-1.200, -1.782, 1.338, -1.812, -1.209, 0.221], [-0.320, -2.245, 1.181, -0.963, -0.940, 0.497],
])  # [rad]  # fmt: skip
AT = (0, 0.0), (2, 0.0), (3, 0.0), (4, 0.0), (5, 0.0), (-1, 1.0)  # segment and local time of each point


@dataclass(frozen=True)
class Case:
    """The numbers that ``--set`` changes."""

    payload: float = 3.0  # [kg]


def build(case: Case = Case()) -> ot.Problem:
    """The problem: seven durations of a cubic spline; acceleration [rad/s2] and jerk [rad/s3] are our choice."""
    robot = ot.Robot.from_urdf(URDF, limits=ot.JointLimits(acceleration=[8.0] * 6, jerk=[60.0] * 6), tool_frame="tool0")
    axes, most = (robot.joints, robot.units), robot.limits.bounds("effort")

    def torque(s: ot.State) -> casadi.SX:
        return robot.effort(s.q, s.v, s.a, payload=case.payload)

    effort = ot.standard.effort_limit(torque, most, robot.effort_units, robot.joints)
    limits = (*ot.standard.joint_limits(robot.limits, *axes), effort)
    points = (ot.standard.rest(*axes), ot.standard.via_points(VIA, AT, *axes))
    h = ot.Variable("h", np.full(7, 0.02), np.full(7, 5.0), "s", tuple(f"h{i}" for i in range(1, 8)))
    return ot.Problem(
        "examples.own_robot:build", (h,), lambda h: ot.curves.cubic_spline_free_ends(VIA, h),
        (ot.Objective("time", "s", of_variables=lambda h, p: casadi.sum1(h)),
         ot.Objective("effort", "s", integrand=lambda s: casadi.sumsqr(torque(s) / most[1]))),
        ot.Requirements(*axes, limits, points), lambda rng: rng.uniform(0.3, 1.0, 7), case, robot,
        dilate=lambda h, s: s * h, scales_in_time=True, reference_point={"time": 6.0, "effort": 2.0},
    )  # fmt: skip
