"""Robots from URDF and Denavit-Hartenberg data, their limits, tools and actuators."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from casadi import SX

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, RobotDefinitionError, UnsupportedJoint
from ocp_traj.robot.chain import AxisJoint, DHRow, LinkInertia
from ocp_traj.robot.dynamics import Friction, inverse_dynamics, joint_friction
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import ActuatorMap, Robot
from tests.random_robots import random_inertia, random_placement, random_robot, random_states

G = 9.80665  # [m/s^2], Guo et al. (2016), below Eq. (42)
L1, L2, L3, L4, L5, L01 = 0.420, 0.050, 0.450, 0.180, 0.180, 0.400  # [m], Table 1
LP = 0.225 - (0.180 + np.sqrt(2.0) * 0.080)  # [m], Eq. (8)
TABLE_4 = (  # mass [kg], inertia [kg mm^2], centre [mm]
    (
        83.025,
        [[5095170.782, -61.008, 1019.065], [-61.008, 3291706.841, -15.858], [1019.065, -15.858, 2367692.766]],
        [0.0, 0.0, -44.182],
    ),
    (
        21.333,
        [
            [1475990.573, -3970.014, -748196.633],
            [-3970.014, 2366543.574, -8327.223],
            [-748196.633, -8327.223, 911968.216],
        ],
        [-304.563, -1.306, -278.925],
    ),
    (
        8.022,
        [[142265.977, -0.114, 0.002], [-0.114, 45016.139, 46002.096], [0.002, 46002.096, 109393.601]],
        [0.0, -63.686, -468.138],
    ),
    (
        9.120,
        [[119573.680, 27.342, -0.849], [27.342, 36160.108, -18452.465], [-0.849, -18452.465, 94076.578]],
        [0.0, -52.909, -261.241],
    ),
)


def serial_from_actuators(q: Any) -> Any:
    """Serial coordinates of the hybrid robot, Guo et al. (2016), Eq. (1)."""
    return ca.vertcat((q[0] + q[1]) / 2.0, ca.atan((q[1] - q[0]) / L1), q[2], q[3], q[4])


def hybrid_robot() -> Robot:
    """The robot of Guo et al. (2016); Z0 points down."""
    links = [LinkInertia(m, 1e-3 * np.array(c), 1e-6 * np.array(i)) for m, i, c in TABLE_4]
    return Robot.from_dh(
        [
            DHRow(d=L01, a=L3, kind="prismatic"),  # Table 3
            DHRow(theta=-np.pi / 2.0, alpha=np.pi / 4.0, d=L2 + L4 + np.sqrt(2.0) * L5),
            DHRow(theta=np.pi, alpha=np.pi / 4.0),
            DHRow(d=LP, kind="fixed"),
        ],
        [*links[1:], None],
        prefix=[AxisJoint("prismatic", (1.0, 0.0, 0.0)), AxisJoint("revolute", inertia=links[0])],
        gravity=(0.0, 0.0, G),
        joints=("X_S1", "X_S2", "X_S3", "phi4", "phi5"),
        units=("m", "m", "m", "rad", "rad"),
        actuator_map=ActuatorMap("two screws move and yaw link 1", serial_from_actuators),
    )


def hybrid_states(count: int) -> Any:
    """Rows of (q, v, a) of the actuators."""
    rng = np.random.default_rng(11)
    q = np.stack([*rng.uniform(0.0, 1.0, size=(2, count)), *rng.uniform(-3.0, 3.0, size=(3, count))])
    return zip(q.T, rng.normal(size=(count, 5)), 3.0 * rng.normal(size=(count, 5)), strict=True)


def hybrid_serial(q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
    """(s, rates, second rates, Jacobian) in closed form, Guo et al. (2016), Eqs. (1), (43) and (109)."""
    gap, speed, acceleration = q[1] - q[0], v[1] - v[0], a[1] - a[0]
    square = L1**2 + gap**2
    rate2 = L1 * acceleration / square - 2.0 * L1 * gap * speed**2 / square**2
    jacobian = np.eye(5)
    jacobian[:2, :2] = [[0.5, 0.5], [-L1 / square, L1 / square]]
    return (
        np.array([(q[0] + q[1]) / 2.0, np.arctan(gap / L1), *q[2:]]),
        np.array([(v[0] + v[1]) / 2.0, L1 * speed / square, *v[2:]]),
        np.array([(a[0] + a[1]) / 2.0, rate2, *a[2:]]),
        jacobian,
    )


def effort_function(robot: Robot, **options: Any) -> ca.Function:
    q, v, a = (SX.sym(name, robot.size) for name in "qva")
    return ca.Function("effort", [q, v, a], [robot.effort(q, v, a, **options)])


def with_point_mass(robot: Robot, mass: float) -> pin.Model:
    loaded = robot.model.copy()
    loaded.appendBodyToJoint(loaded.njoints - 1, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), robot.tool)
    return loaded


# The hybrid robot of Guo et al. (2016)


@pytest.mark.parametrize("mass", [0.0, 10.0])
def test_hybrid_effort_equals_rnea_through_the_actuator_map(mass: float) -> None:
    robot = hybrid_robot()
    effort, model = effort_function(robot, payload=mass), with_point_mass(robot, mass)
    data = model.createData()
    for q, v, a in hybrid_states(200):
        s, rate, rate2, jacobian = hybrid_serial(q, v, a)
        tau = pin.rnea(model, data, s, rate, rate2)
        ours = np.asarray(effort(q, v, a))[:, 0]
        assert np.abs(ours - jacobian.T @ tau).max() <= 1e-9 * np.abs(tau).max()
        shift = tau[1] * L1 / ((q[1] - q[0]) ** 2 + L1**2)  # Eq. (110)
        cosine2 = np.cos(np.arctan((q[1] - q[0]) / L1)) ** 2  # Eqs. (86) and (87)
        for force in (tau[0] / 2.0 - shift, tau[0] / 2.0 - tau[1] * cosine2 / L1):
            assert ours[0] == pytest.approx(force, rel=0.0, abs=1e-9 * np.abs(tau).max())
        for force in (tau[0] / 2.0 + shift, tau[0] / 2.0 + tau[1] * cosine2 / L1):
            assert ours[1] == pytest.approx(force, rel=0.0, abs=1e-9 * np.abs(tau).max())


def test_hybrid_tool_pose_equals_the_papers_closed_form() -> None:
    robot, q = hybrid_robot(), SX.sym("q", 5)
    pose = ca.Function("pose", [q], robot.tool_pose(q))
    for x, _, _ in hybrid_states(200):
        alpha = np.arctan((x[1] - x[0]) / L1)
        (sp, cp), (s5, c5) = ((np.sin(t), np.cos(t)) for t in (alpha + x[3], x[4]))
        r = s5 / np.sqrt(2)
        a = [cp * (c5 - 1) / 2 - sp * r, sp * (c5 - 1) / 2 + cp * r, (1 + c5) / 2]  # (16)-(18)
        o = [sp * r - cp * (1 + c5) / 2, -cp * r - sp * (1 + c5) / 2, (1 - c5) / 2]  # (20)-(22)
        n = [-sp * c5 - cp * r, cp * c5 - sp * r, -r]  # (24)-(26)
        p = [  # (12)-(14) with e = 0
            (x[0] + x[1]) / 2 + L3 * np.cos(alpha) + LP * a[0],
            L3 * np.sin(alpha) + LP * a[1],
            L2 + L4 + np.sqrt(2) * L5 + x[2] + L01 + LP * a[2],
        ]
        rotation, position = (np.asarray(y) for y in pose(x))
        assert np.abs(rotation - np.column_stack((n, o, a))).max() <= 1e-12
        assert np.abs(position[:, 0] - p).max() <= 1e-12


def test_hybrid_lift_force_at_rest_is_the_moving_weight() -> None:
    robot, mass = hybrid_robot(), SX.sym("m")
    q, zero = SX.sym("q", 5), SX.zeros(5)
    force = ca.Function("F3", [q, mass], [robot.effort(q, zero, zero, payload=mass)[2]])
    for x, _, _ in hybrid_states(50):
        for m in (0.0, 8.0, 12.5108):
            assert float(force(x, m)) == pytest.approx(-(38.475 + m) * G, rel=1e-12)  # 38.475 kg: Table 4, links 2 to 4
    assert robot.effort_units == ("N", "N", "N", "N m", "N m")


# Effort and tool of any robot


@pytest.mark.parametrize("joints", [1, 4, 7])
def test_payload_and_tool_force_equal_pinocchio(joints: int) -> None:
    rng = np.random.default_rng(joints)
    robot = random_robot(rng, joints)
    mass, force = 3.0, 20.0 * rng.normal(size=3)
    model = with_point_mass(robot, mass)
    data, external = model.createData(), pin.StdVec_Force()
    for _ in range(joints):
        external.append(pin.Force.Zero())
    external.append(robot.tool.act(pin.Force(-force, np.zeros(3))))
    effort = effort_function(robot, payload=mass, tool_force=force)
    for q, v, a in zip(*(x.T for x in random_states(rng, joints, 100)), strict=True):
        expected = pin.rnea(model, data, q, v, a, external)
        assert np.abs(np.asarray(effort(q, v, a))[:, 0] - expected).max() <= 1e-9 * np.abs(expected).max()


def test_no_payload_costs_no_instruction() -> None:
    robot = random_robot(np.random.default_rng(0), 6)
    q, v, a = (SX.sym(name, 6) for name in "qva")
    plain = ca.Function("tau", [q, v, a], [inverse_dynamics(robot.model, q, v, a)])
    assert effort_function(robot).n_instructions() == plain.n_instructions()


def test_friction_acts_on_the_actuators() -> None:
    robot, friction = hybrid_robot(), Friction([30.0, 30.0, 40.0, 1.0, 1.0], 5.0, 0.02)
    with_friction, without = effort_function(robot, friction=friction), effort_function(robot)
    for q, v, a in hybrid_states(5):
        expected = np.asarray(ca.DM(joint_friction(SX(v), *friction)))
        assert np.asarray(with_friction(q, v, a) - without(q, v, a)) == pytest.approx(expected, abs=1e-9)


def test_actuator_power_equals_joint_power() -> None:
    robot = random_robot(np.random.default_rng(8), 3)
    mixed = replace(
        robot, actuator_map=ActuatorMap("coupled", lambda q: ca.vertcat(q[0] + q[1] ** 2, ca.sin(q[1]), q[2]))
    )
    q, v, a = (SX.sym(name, 3) for name in "qva")
    s = mixed.actuator_map.position(q) if mixed.actuator_map else q
    rate = ca.jtimes(s, q, v)
    rate2 = ca.jtimes(s, q, a) + ca.jtimes(rate, q, v)
    powers = [ca.dot(mixed.effort(q, v, a), v), ca.dot(inverse_dynamics(robot.model, s, rate, rate2), rate)]
    function = ca.Function("power", [q, v, a], powers)
    for state in zip(*(x.T for x in random_states(np.random.default_rng(9), 3, 20)), strict=True):
        ours, theirs = (float(x) for x in function(*state))
        assert ours == pytest.approx(theirs, rel=1e-10, abs=1e-9)


def test_robot_refuses_parts_that_do_not_fit() -> None:
    robot = random_robot(np.random.default_rng(1), 3)
    labels = robot.joints
    with pytest.raises(RobotDefinitionError, match=r"actuator labels are \['a', 'a', 'b'\].*all different"):
        replace(robot, joints=("a", "a", "b"))
    with pytest.raises(RobotDefinitionError, match=r"units are \['m', 'rad'\], expected 3 of \['m', 'rad'\]"):
        replace(robot, units=("m", "rad"))
    with pytest.raises(RobotDefinitionError, match="units are .*'deg'"):
        replace(robot, units=("m", "deg", "m"))
    with pytest.raises(RobotDefinitionError, match="limits are of 2 joints, the robot has 3"):
        replace(robot, limits=JointLimits(velocity=[1.0, 2.0]))
    with pytest.raises(RobotDefinitionError, match=r"joints gives shape \(2, 1\), the model expects \(3, 1\)"):
        replace(robot, joints=labels[:2], units=("m", "m"), limits=JointLimits())
    with pytest.raises(RobotDefinitionError, match=r"actuator map 'wrong' gives shape \(2, 1\)"):
        replace(robot, actuator_map=ActuatorMap("wrong", lambda q: q[:2]))
    with pytest.raises(RobotDefinitionError, match="'hand' is not a joint of 'random'"):
        replace(robot, tool_joint="hand")
    with pytest.raises(InputError, match=r"q has shape \(2, 1\), expected \(3, 1\)"):
        robot.tool_pose(SX.sym("q", 2))


# JointLimits


def test_limits_become_lower_and_upper_per_order() -> None:
    limits = JointLimits(position=([0.0, -1.0], [1.0, np.inf]), velocity=[2.0, 3.0], jerk=[[-1.0, -2.0], [5.0, 6.0]])
    assert limits.size == 2
    for quantity, lower, upper in (
        (0, [0.0, -1.0], [1.0, np.inf]),
        ("velocity", [-2.0, -3.0], [2.0, 3.0]),
        (3, [-1.0, -2.0], [5.0, 6.0]),
    ):
        pair = limits.bounds(quantity)
        assert pair is not None
        assert pair[0].tolist() == lower
        assert pair[1].tolist() == upper
    assert limits.bounds(2) is None
    assert limits.bounds("effort") is None
    assert JointLimits().size is None
    with pytest.raises(ValueError, match="read-only"):
        limits.velocity[0, 0] = 1.0
    merged = limits.overridden_by(JointLimits(velocity=[7.0, 8.0], snap=[1.0, 1.0]))
    assert merged.velocity[1].tolist() == [7.0, 8.0]
    assert merged.jerk.tolist() == limits.jerk.tolist()
    assert merged.bounds(4) is not None


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"position": [1.0, 2.0]}, r"position limit has shape \(2,\), expected \(2, n\)$"),
        ({"velocity": 1.0}, r"velocity limit has shape \(\), expected \(2, n\) or \(n,\)"),
        ({"velocity": np.ones((3, 2))}, r"velocity limit has shape \(3, 2\)"),
        ({"jerk": []}, r"jerk limit has shape \(0,\)"),
        ({"snap": "fast"}, "snap limit is 'fast', expected numbers"),
        ({"snap": ([1.0], [2.0, 3.0])}, "snap limit is .*, expected numbers"),
        ({"acceleration": [1.0, 0.0]}, r"acceleration limit of joint 2 is \[-0.0, 0.0\], expected lower < upper"),
        ({"acceleration": [-1.0, 1.0]}, "acceleration limit of joint 1"),
        ({"effort": [1.0, np.nan]}, "effort limit of joint 2 is .*no NaN"),
        ({"position": ([0.0, 2.0], [1.0, 1.0])}, r"position limit of joint 2 is \[2.0, 1.0\]"),
        (
            {"velocity": [1.0], "effort": [1.0, 2.0]},
            "limits are of different numbers of joints: {'velocity': 1, 'effort': 2}",
        ),
    ],
)
def test_bad_limits_are_explained(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(RobotDefinitionError, match=message):
        JointLimits(**fields)


def test_unknown_quantity_has_no_bounds() -> None:
    for quantity in (5, -1, "torque"):
        with pytest.raises(RobotDefinitionError, match=f"{quantity!r} has no limits; allowed are 0..4 and position"):
            JointLimits().bounds(quantity)


# Denavit-Hartenberg


def rotation_x(t: float) -> Array:
    return np.array([[1, 0, 0, 0], [0, np.cos(t), -np.sin(t), 0], [0, np.sin(t), np.cos(t), 0], [0, 0, 0, 1]])


def rotation_z(t: float) -> Array:
    return np.array([[np.cos(t), -np.sin(t), 0, 0], [np.sin(t), np.cos(t), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def translation(x: float, z: float) -> Array:
    return np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, z], [0, 0, 0, 1]])


def row_transform(row: DHRow, q: float, convention: str) -> Array:
    theta = row.theta + (q if row.kind == "revolute" else 0.0)
    d = row.d + (q if row.kind == "prismatic" else 0.0)
    if convention == "standard":
        return rotation_z(theta) @ translation(0.0, d) @ translation(row.a, 0.0) @ rotation_x(row.alpha)
    return rotation_x(row.alpha) @ translation(row.a, 0.0) @ rotation_z(theta) @ translation(0.0, d)


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_dh_rows_equal_explicit_products_and_their_energy(convention: str) -> None:
    rng = np.random.default_rng(21)
    kinds = ("fixed", "revolute", "prismatic", "revolute", "fixed", "revolute", "prismatic", "fixed", "fixed")
    rows = [
        DHRow(theta, d, a, alpha, kind)
        for kind, (theta, d, a, alpha) in zip(kinds, rng.normal(size=(9, 4)), strict=True)
    ]
    bodies = [random_inertia(rng) for _ in rows]
    inertias = [LinkInertia(b.mass, b.lever, b.inertia) for b in bodies]
    base, tool, gravity = random_placement(rng), random_placement(rng), rng.normal(size=3)
    robot = Robot.from_dh(rows, inertias, convention=convention, base=base, tool=tool, gravity=gravity)
    assert robot.units == ("rad", "m", "rad", "rad", "m")
    assert robot.joints == ("joint1", "joint2", "joint3", "joint4", "joint5")
    moving = [i for i, kind in enumerate(kinds) if kind != "fixed"]

    def frames(q: Array) -> list[Array]:
        values = dict(zip(moving, q, strict=True))
        transforms = [base.homogeneous]
        for i, row in enumerate(rows):
            transforms.append(transforms[-1] @ row_transform(row, values.get(i, 0.0), convention))
        return transforms[1:]

    def potential(q: Array) -> float:
        """Of the moving bodies, from their DH frames [J]."""
        pairs = list(zip(bodies, frames(q), strict=True))[1:]  # row 0 is fixed to the world
        return float(-sum(b.mass * gravity @ (t @ np.append(b.lever, 1.0))[:3] for b, t in pairs))

    symbol, zero, step = SX.sym("q", 5), SX.zeros(5), 1e-5  # step [rad or m]
    pose = ca.Function("pose", [symbol], robot.tool_pose(symbol))
    weight = ca.Function("weight", [symbol], [robot.effort(symbol, zero, zero)])
    for q in rng.normal(size=(20, 5)):
        expected = frames(q)[-1] @ tool.homogeneous
        rotation, position = (np.asarray(x) for x in pose(q))
        assert np.abs(np.column_stack((rotation, position)) - expected[:3]).max() <= 1e-12
        slope = [(potential(q + e) - potential(q - e)) / (2.0 * step) for e in step * np.eye(5)]
        assert np.abs(np.asarray(weight(q))[:, 0] - slope).max() <= 1e-7  # [N m], central differences


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_dh_inertia_is_carried_into_the_joint_frame(convention: str) -> None:
    rng, row = np.random.default_rng(22), DHRow(0.3, 0.4, 0.5, 0.6)
    body = random_inertia(rng)
    robot = Robot.from_dh([row], [LinkInertia(body.mass, body.lever, body.inertia)], convention=convention)
    # About the joint's axis, from its direction and position in the link's own frame.
    to_link = np.linalg.inv(row_transform(row, 0.0, convention)) if convention == "standard" else np.eye(4)
    axis, point = to_link[:3, 2], to_link[:3, 3]
    arm = np.cross(axis, body.lever - point)
    expected = axis @ body.inertia @ axis + body.mass * arm @ arm
    q, zero = SX.sym("q", 1), SX.zeros(1)
    inertia = ca.Function("I", [q], [robot.effort(q, zero, SX.ones(1)) - robot.effort(q, zero, zero)])
    assert float(inertia(0.7)) == pytest.approx(expected, rel=1e-12)


def test_bad_chains_are_explained() -> None:
    row, link = DHRow(), LinkInertia(1.0)
    with pytest.raises(
        RobotDefinitionError, match="'craig' is not a convention; allowed are 'standard' and 'modified'"
    ):
        Robot.from_dh([row], [link], convention="craig")
    with pytest.raises(RobotDefinitionError, match="1 inertias for 2 rows; give one per row, None if massless"):
        Robot.from_dh([row, row], [link])
    with pytest.raises(UnsupportedJoint, match="joint 1 is 'helical'; allowed are 'revolute', 'prismatic'"):
        Robot.from_dh([DHRow(kind="helical")], [link])
    with pytest.raises(RobotDefinitionError, match="expected one or more"):
        Robot.from_dh([DHRow(kind="fixed")], [link])
    with pytest.raises(RobotDefinitionError, match="a DH row has an angle nan rad"):
        Robot.from_dh([DHRow(theta=np.nan)], [link])
    with pytest.raises(RobotDefinitionError, match=r"axis of joint 1 is \(0.0, 0.0, 0.0\)"):
        Robot.from_dh([], [], prefix=[AxisJoint("revolute", (0.0, 0.0, 0.0))])
    with pytest.raises(RobotDefinitionError, match="gravity is 9.81, expected three finite numbers"):
        Robot.from_dh([row], [link], gravity=9.81)
    with pytest.raises(RobotDefinitionError, match="units of the actuators are needed"):
        Robot.from_dh([row], [link], actuator_map=ActuatorMap("same", lambda q: q))
    with pytest.raises(RobotDefinitionError, match="mass is -1.0 kg"):
        LinkInertia(-1.0)
    with pytest.raises(RobotDefinitionError, match="a link has centre"):
        LinkInertia(1.0, [0.0, np.inf, 0.0])
    with pytest.raises(RobotDefinitionError, match="not symmetric and positive semidefinite"):
        LinkInertia(1.0, inertia=-np.eye(3))
    with pytest.raises(RobotDefinitionError, match="not symmetric"):
        LinkInertia(1.0, inertia=[[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


# URDF


def link(name: str) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0.02 0.2" rpy="0.1 0.2 0.3"/><mass value="2"/>'
        '<inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial></link>'
    )


def joint(name: str, kind: str, parent: str, child: str, extra: str) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/>{extra}</joint>'
    )


SHOULDER = '<axis xyz="0 0 1"/><limit lower="-1" upper="2" velocity="3" effort="40"/>'
SLIDE = '<axis xyz="0 1 1"/><limit lower="0" upper="0.5" velocity="0.2" effort="500"/>'
FINGER = '<axis xyz="1 0 0"/><limit lower="0" upper="0.04" velocity="0.1" effort="10"/>'
URDF = (
    '<robot name="arm">'
    + "".join(link(name) for name in ("base", "upper", "fore", "hand", "finger"))
    + joint("shoulder", "revolute", "base", "upper", SHOULDER)
    + joint("slide", "prismatic", "upper", "fore", SLIDE)
    + joint("wrist", "fixed", "fore", "hand", "")
    + joint("grip", "prismatic", "hand", "finger", FINGER)
    + "</robot>"
)


def test_urdf_gives_joints_limits_tool_and_dynamics(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text('<?xml version="1.0"?>\n' + URDF, encoding="utf-8")
    for source in (URDF, path, str(path)):
        robot = Robot.from_urdf(
            source, tool_frame="hand", limits=JointLimits(jerk=[1.0, 2.0, 3.0], velocity=[1.0, 1.0, 1.0])
        )
        assert robot.joints == ("shoulder", "slide", "grip")
        assert robot.units == ("rad", "m", "m")
        assert robot.limits.position.tolist() == [[-1.0, 0.0, 0.0], [2.0, 0.5, 0.04]]
        assert robot.limits.velocity.tolist() == [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]
        assert robot.limits.effort.tolist() == [[-40.0, -500.0, -10.0], [40.0, 500.0, 10.0]]
        assert robot.limits.jerk[1].tolist() == [1.0, 2.0, 3.0]
        assert robot.limits.acceleration is None
        model = pin.buildModelFromXML(URDF)
        data, rng = model.createData(), np.random.default_rng(0)
        symbol = SX.sym("q", 3)
        pose, effort = ca.Function("pose", [symbol], robot.tool_pose(symbol)), effort_function(robot, payload=2.0)
        loaded, on_slide = model.copy(), 2  # the hand is fixed to the slide
        loaded.appendBodyToJoint(on_slide, pin.Inertia(2.0, np.zeros(3), np.zeros((3, 3))), robot.tool)
        for q, v, a in zip(*(x.T for x in random_states(rng, 3, 20)), strict=True):
            pin.framesForwardKinematics(model, data, q)
            expected = data.oMf[model.getFrameId("hand")]
            rotation, position = (np.asarray(x) for x in pose(q))
            assert np.abs(rotation - expected.rotation).max() <= 1e-12
            assert np.abs(position[:, 0] - expected.translation).max() <= 1e-12
            tau = pin.rnea(loaded, loaded.createData(), q, v, a)
            assert np.abs(np.asarray(effort(q, v, a))[:, 0] - tau).max() <= 1e-9 * np.abs(tau).max()


def test_urdf_joint_can_be_locked() -> None:
    robot = Robot.from_urdf(URDF, locked={"grip": 0.02}, gravity=(0.0, 0.0, -1.62))
    assert robot.joints == ("shoulder", "slide")
    full = pin.buildModelFromXML(URDF)
    full.gravity.linear = np.array([0.0, 0.0, -1.62])
    effort = effort_function(robot)
    for q, v, a in zip(*(x.T for x in random_states(np.random.default_rng(0), 2, 20)), strict=True):
        tau = pin.rnea(full, full.createData(), np.append(q, 0.02), np.append(v, 0.0), np.append(a, 0.0))[:2]
        assert np.abs(np.asarray(effort(q, v, a))[:, 0] - tau).max() <= 1e-9 * np.abs(tau).max()
    mimic = URDF.replace(FINGER, FINGER + '<mimic joint="slide" multiplier="2"/>')
    assert Robot.from_urdf(mimic, locked={"grip": 0.0}).joints == ("shoulder", "slide")
    with pytest.raises(
        UnsupportedJoint, match=r"joint 'grip' of the URDF string is a mimic joint.*locked={'grip': 0.0}"
    ):
        Robot.from_urdf(mimic)
    with pytest.raises(RobotDefinitionError, match="'claw' is not a joint of 'arm'"):
        Robot.from_urdf(URDF, locked={"claw": 0.0})
    with pytest.raises(RobotDefinitionError, match=r"'grap' is not a joint of 'arm' \(nearest is 'grip'\)"):
        Robot.from_urdf(URDF, locked={"grap": 0.0})
    with pytest.raises(RobotDefinitionError, match="joint 'grip' is locked at nan; give a finite coordinate"):
        Robot.from_urdf(URDF, locked={"grip": np.nan})


@pytest.mark.parametrize(
    ("xml", "message"),
    [
        ("<robot name=", "the URDF string is not a URDF: it is not XML"),
        ("<sdf/>", "the URDF string is not a URDF: its root is <sdf>, expected <robot>"),
        ("<robot name='r'/>", "the URDF string is not a URDF pinocchio can read .*see standard error"),
        (
            '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>',
            "the URDF string is a xacro file, not a URDF; run xacro",
        ),
        (
            URDF.replace('velocity="0.2"', 'velocity="0"'),
            r"the velocity limit of 'slide' is 0, which means not given; write it there, or override it with limits=",
        ),
        (
            URDF.replace('lower="-1" upper="2" ', ""),
            r"the position limit of 'shoulder' is 0, which means not given; write it there, or override it",
        ),
        (
            URDF.replace(SHOULDER, '<axis xyz="0 0 1"/>'),
            "the position limit of 'shoulder' is 0, which means not given",
        ),
        (URDF.replace('lower="-1" upper="2"', 'lower="2" upper="-1"'), "position limit of joint 1 is .*'shoulder'"),
        (URDF.replace('"revolute"', '"planar"'), "joint 'shoulder' of 'arm' is a "),
    ],
)
def test_bad_urdf_is_explained(xml: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Robot.from_urdf(xml)


def test_bad_urdf_source_is_explained(tmp_path: Path) -> None:
    with pytest.raises(
        RobotDefinitionError,
        match="cannot read the URDF file .*nowhere.urdf: No such file.*; give a path, or the XML itself",
    ):
        Robot.from_urdf(tmp_path / "nowhere.urdf")
    binary = tmp_path / "mesh.stl"
    binary.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(RobotDefinitionError, match="cannot read the URDF file .*: it is not text"):
        Robot.from_urdf(binary)
    with pytest.raises(
        RobotDefinitionError,
        match=r"'gripper' is no frame that moves in the URDF string \(nearest is 'grip'\); those are finger, fore",
    ):
        Robot.from_urdf(URDF, tool_frame="gripper")
    with pytest.raises(RobotDefinitionError, match="'base' is no frame that moves"):
        Robot.from_urdf(URDF, tool_frame="base")
