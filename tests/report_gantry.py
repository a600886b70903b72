"""A robot that no problem of the package has: a gantry that slides along two skew axes, spins, and bends."""

import casadi
import numpy as np

import ocp_traj as ot
from ocp_traj.formulation.surroundings import Surroundings
from ocp_traj.robot.bodies import box, capsule, cylinder, half_space, sphere

URDF = """<robot name="gantry"><link name="world_link"/>
<joint name="rail" type="prismatic"><parent link="world_link"/><child link="carriage"/><origin xyz="0.1 -0.2 0.9" rpy="0.2 0.1 -0.3"/>
<axis xyz="1 0.5 0"/><limit lower="-1" upper="1" velocity="1.5" effort="300"/></joint>
<link name="carriage"><inertial><mass value="4"/><origin xyz="0 0 0.05"/><inertia ixx="0.1" iyy="0.2" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="prismatic"><parent link="carriage"/><child link="column"/><origin xyz="0 0.1 0" rpy="0 0.3 0"/>
<axis xyz="0 0 -1"/><limit lower="-0.5" upper="0.5" velocity="1" effort="300"/></joint>
<link name="column"><inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="spin" type="continuous"><parent link="column"/><child link="head"/><origin xyz="0.05 0 -0.3" rpy="0 0 0.4"/>
<axis xyz="0 0.6 0.8"/><limit velocity="3" effort="50"/></joint>
<link name="head"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="mount" type="fixed"><parent link="head"/><child link="bracket"/><origin xyz="0.02 0.03 0.1" rpy="0.5 0 0"/></joint>
<link name="bracket"/>
<joint name="bend" type="revolute"><parent link="bracket"/><child link="hand"/><origin xyz="0 0 0.1" rpy="0 0.7 0"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="50"/></joint>
<link name="hand"><inertial><mass value="1"/><inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="tip" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0.01 0.02 0.25" rpy="0.1 0 0"/></joint>
<link name="tool"/></robot>"""  # fmt: skip  # noqa: E501
VIA = np.array([[-0.6, -0.2, 0.0, 0.3], [0.1, 0.3, 2.5, -0.9], [0.7, -0.1, 7.0, 1.1]])
AT = ((0, 0.0), (2, 0.0), (-1, 1.0))


def build() -> ot.Problem:
    """Through one point, with durations free; all kinds of bodies stand around it."""
    robot = ot.Robot.from_urdf(URDF, limits=ot.JointLimits(acceleration=[4.0] * 4, jerk=[60.0] * 4), tool_frame="tool")
    axes = robot.joints, robot.units
    most = robot.limits.bounds("effort")

    def force(s: ot.State) -> casadi.SX:
        return robot.effort(s.q, s.v, s.a)

    limits = (
        *ot.standard.joint_limits(robot.limits, *axes),
        ot.standard.effort_limit(force, most, robot.effort_units, robot.joints),
    )
    points = (ot.standard.rest(*axes), ot.standard.via_points(VIA, AT, *axes))
    h = ot.Variable("h", np.full(4, 0.05), np.full(4, 8.0), "s", tuple(f"h{i}" for i in range(1, 5)))
    around = Surroundings(
        (
            sphere("ball", 0, [0.5, 0.6, 0.4], 0.15), box("crate", 0, [-0.6, 0.5, 0.2], [0.3, 0.2, 0.4]),
            cylinder("post", 0, [0.2, -0.8, 0.0], [0.2, -0.8, 0.9], 0.06), half_space("floor", [0, 0, 1], -0.1),
            capsule("beam", 2, [0, 0, 0], [0.05, 0, -0.3], 0.04), capsule("hand", 4, [0, 0, 0], [0, 0, 0.25], 0.03),
        ),
        {"mark": np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1], [0.3, 0.3, 0.1]])},
    )  # fmt: skip
    return ot.Problem(
        "tests.report_gantry:build", (h,), lambda x: ot.curves.cubic_spline_free_ends(VIA, x),
        (ot.Objective("time", "s", of_variables=lambda x, p: casadi.sum1(x)),
         ot.Objective("jerk", "-", integrand=lambda s: casadi.sumsqr(s.jerk))),
        ot.Requirements(*axes, limits, points), lambda rng: rng.uniform(0.5, 1.5, 4), None, robot,
        dilate=lambda x, s: s * x, scales_in_time=True, reference_point={"time": 30.0, "jerk": 1e6},
        about=ot.About(title="a <gantry> & its marks", surroundings=lambda: around),
    )  # fmt: skip
