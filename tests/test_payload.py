"""Payloads in the tool frame, friction of a robot, inertias that are missing, rows with masses: against pinocchio."""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from casadi import SX

from ocp_traj.errors import RobotDefinitionError
from ocp_traj.robot.chain import DHRow, LinkInertia
from ocp_traj.robot.dh import robot_of_rows
from ocp_traj.robot.dynamics import Friction, joint_friction
from ocp_traj.robot.inertias import inertia_matrix, missing_inertias, require_inertias
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.payload import ToolPayload
from ocp_traj.robot.robot import Robot
from tests.random_robots import random_inertia, random_model, random_placement, random_robot, random_states


def effort(robot: Robot, **options: Any) -> ca.Function:
    q, v, a = (SX.sym(name, robot.size) for name in "qva")
    return ca.Function("effort", [q, v, a], [robot.effort(q, v, a, **options)])


# Payload


@pytest.mark.parametrize("seed", range(4))
def test_a_payload_with_inertia_equals_a_body_appended_in_pinocchio(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = random_inertia(rng)
    chain = random_robot(rng, 5)
    tree = Robot(random_model(rng, 5, branching=True), chain.joints, ("rad",) * 5, tool=chain.tool, tool_joint=3)
    mass = SX.sym("m")
    for robot in (chain, tree):
        loaded = robot.model.copy()
        loaded.appendBodyToJoint(robot.tool_joint or 5, body, robot.tool)
        q, v, a = (SX.sym(name, 5) for name in "qva")
        free = robot.effort(q, v, a, payload=ToolPayload(mass, body.lever, body.inertia))
        symbolic = ca.Function("effort", [q, v, a, mass], [free])
        given = effort(robot, payload=ToolPayload(body.mass, body.lever, body.inertia[np.triu_indices(3)]))
        data = loaded.createData()
        for state in zip(*(x.T for x in random_states(rng, 5, 20)), strict=True):
            expected = pin.rnea(loaded, data, *state)
            for ours in (given(*state), symbolic(*state, body.mass)):
                assert np.abs(np.asarray(ours)[:, 0] - expected).max() <= 1e-9 * np.abs(expected).max()


def test_a_payload_without_centre_is_the_point_mass_at_the_tool() -> None:
    robot = random_robot(np.random.default_rng(5), 4)
    body, point = effort(robot, payload=ToolPayload(3.0)), effort(robot, payload=3.0)
    for state in zip(*(x.T for x in random_states(np.random.default_rng(6), 4, 5)), strict=True):
        assert np.asarray(body(*state)) == pytest.approx(np.asarray(point(*state)), rel=1e-13)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ((-1.0,), "a payload's mass is -1.0, expected a finite number >= 0"),
        ((np.inf,), "a payload's mass is inf"),
        (("heavy",), "a payload's mass is 'heavy'"),
        ((1.0, [0.0, 1.0]), r"a payload's com is \[0.0, 1.0\], expected three finite numbers \[m\]"),
        ((1.0, ["a", 0.0, 0.0]), "a payload's com is"),
        ((1.0, (0.0, 0.0, 0.0), [1.0, 2.0]), r"an inertia is \[1.0, 2.0\], expected .*ixx, ixy, ixz, iyy, iyz, izz"),
        ((1.0, (0.0, 0.0, 0.0), [1.0, 2.0, -3.0]), "not symmetric and positive semidefinite"),
        ((1.0, (0.0, 0.0, 0.0), "round"), "an inertia is 'round'"),
    ],
)
def test_a_payload_that_is_none_is_explained(fields: tuple[Any, ...], message: str) -> None:
    with pytest.raises(RobotDefinitionError, match=message):
        ToolPayload(*fields)


def test_moments_are_read_in_a_urdfs_order() -> None:
    assert inertia_matrix([1.0, 0.1, 0.2, 2.0, 0.3, 3.0]).tolist() == [
        [1.0, 0.1, 0.2],
        [0.1, 2.0, 0.3],
        [0.2, 0.3, 3.0],
    ]
    assert inertia_matrix([1.0, 2.0, 3.0]).tolist() == np.diag([1.0, 2.0, 3.0]).tolist()


# Friction


def test_a_robots_own_friction_is_added_and_can_be_replaced() -> None:
    bare = random_robot(np.random.default_rng(7), 3)
    own, other = Friction([1.0, 2.0, 3.0], 0.5, 0.02), Friction(0.0, 1.0, 0.1)
    robot = replace(bare, friction=own)
    for state in zip(*(x.T for x in random_states(np.random.default_rng(8), 3, 5)), strict=True):
        without = np.asarray(effort(bare)(*state))
        for found, expected in ((effort(robot), own), (effort(robot, friction=other), other)):
            rubbing = np.asarray(ca.DM(joint_friction(SX(state[1]), *expected)))
            assert np.asarray(found(*state)) - without == pytest.approx(rubbing, abs=1e-9)


@pytest.mark.parametrize(
    ("friction", "message"),
    [
        (Friction([1.0, 2.0], 0.0, 1.0), r"friction's coulomb is \[1.0, 2.0\], expected a finite number >= 0, or 3"),
        (Friction(0.0, -1.0, 1.0), "friction's viscous is -1.0"),
        (Friction(0.0, 1.0, 0.0), "friction's velocity_scale is 0.0, expected a finite number > 0"),
        (Friction(0.0, np.nan, 1.0), "friction's viscous is nan"),
        (Friction("much", 0.0, 1.0), "friction's coulomb is 'much'"),
    ],
)
def test_a_friction_that_is_none_is_explained(friction: Friction, message: str) -> None:
    with pytest.raises(RobotDefinitionError, match=message):
        replace(random_robot(np.random.default_rng(7), 3), friction=friction)


# Missing inertias


def chain(*masses: float, kind: str = "revolute") -> pin.Model:
    """Joints about z in a row, 1 m apart along x, each with a point mass 0.5 m further out."""
    model = pin.Model()
    types = {"revolute": pin.JointModelRZ, "prismatic": pin.JointModelPZ}
    for i, mass in enumerate(masses):
        place = pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0]))
        index = model.addJoint(i, types[kind](), place, f"j{i + 1}")
        if mass > 0.0:
            body = pin.Inertia(mass, np.array([0.5, 0.0, 0.0]), np.zeros((3, 3)))
            model.appendBodyToJoint(index, body, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_joints_that_move_no_inertia_are_named(kind: str) -> None:
    assert missing_inertias(chain(1.0, 2.0, kind=kind)) == ()
    assert missing_inertias(chain(0.0, 0.0, 2.0, kind=kind)) == ()  # massless links between others
    assert missing_inertias(chain(1.0, 0.0, 0.0, kind=kind)) == ("j2", "j3")
    assert missing_inertias(chain(0.0, 0.0, kind=kind)) == ("j1", "j2")
    model = chain(1.0, 0.0, kind=kind)
    model.armature = np.array([0.0, 0.1])
    assert missing_inertias(model) == ()


def test_a_point_mass_on_the_axis_is_no_inertia() -> None:
    model = chain(1.0, 0.0)
    model.appendBodyToJoint(2, pin.Inertia(1.0, np.array([0.0, 0.0, 0.3]), np.zeros((3, 3))), pin.SE3.Identity())
    assert missing_inertias(model) == ("j2",)
    with pytest.raises(RobotDefinitionError, match="an effort limit needs inertias, and nothing .* moves with 'j2'"):
        require_inertias(model, "an effort limit")


# Denavit-Hartenberg rows as plain data

ROWS: list[dict[str, Any]] = [
    {"d": 0.4, "a": 0.1, "alpha": -1.5, "mass": 8.0, "com": [0.0, 0.1, 0.0], "inertia": [0.3, 0.2, 0.1]},
    {"kind": "prismatic", "theta": 0.3, "mass": 5.0, "armature": 40.0, "name": "lift"},
    {"a": 0.2, "kind": "fixed"},
    {"alpha": 0.7, "mass": 2.0, "inertia": [0.03, 0.001, 0.002, 0.04, 0.003, 0.05], "armature": 0.2},
]


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_rows_of_plain_data_are_the_robot_of_their_objects(convention: str) -> None:
    limits, tool = JointLimits(velocity=[1.0, 2.0, 3.0]), random_placement(np.random.default_rng(9))
    robot = robot_of_rows(ROWS, convention=convention, tool=tool, limits=limits)
    assert (robot.joints, robot.units) == (("joint1", "lift", "joint3"), ("rad", "m", "rad"))
    assert list(robot.model.names)[1:] == ["joint1", "lift", "joint3"]
    rows = [DHRow(0.0, 0.4, 0.1, -1.5), DHRow(0.3, kind="prismatic"), DHRow(a=0.2, kind="fixed"), DHRow(alpha=0.7)]
    turned = [[0.03, 0.001, 0.002], [0.001, 0.04, 0.003], [0.002, 0.003, 0.05]]
    links = [LinkInertia(8.0, [0.0, 0.1, 0.0], np.diag([0.3, 0.2, 0.1])), LinkInertia(5.0), None]
    same = Robot.from_dh(rows, [*links, LinkInertia(2.0, inertia=turned)], convention=convention, tool=tool)
    data = same.model.createData()
    same.model.armature = np.array([0.0, 40.0, 0.2])
    for q, v, a in np.random.default_rng(10).normal(size=(10, 3, 3)):
        expected = pin.rnea(same.model, data, q, v, a)
        assert np.abs(np.asarray(effort(robot)(q, v, a))[:, 0] - expected).max() <= 1e-9 * np.abs(expected).max()
        assert np.allclose(robot.poses(q)[1], same.poses(q)[1], atol=1e-14)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"masse": 1.0}, r"row 2: 'masse' is not allowed \(nearest is 'mass'\); allowed are theta, d, a, alpha"),
        ({"kind": "helical"}, "row 2: kind is 'helical'; allowed are revolute, prismatic, fixed"),
        ({"alpha": "90 deg"}, "row 2: alpha is '90 deg', expected a finite number"),
        ({"d": np.inf}, "row 2: d is inf"),
        ({"d": True}, "row 2: d is True"),
        ({"mass": -1.0}, "row 2: a link's mass is -1.0 kg, expected finite and >= 0"),
        ({"com": [0.0, 0.0, 0.0]}, r"row 2: com is given without a mass; give mass \[kg\] too"),
        ({"mass": 1.0, "com": [0.0, "x", 0.0]}, "row 2: a link has centre"),
        ({"mass": 1.0, "inertia": [1.0, 1.0]}, r"row 2: an inertia is \[1.0, 1.0\]"),
        ({"armature": -0.1}, "row 2: armature is -0.1, expected zero or more"),
        ({"kind": "fixed", "armature": 0.1}, "row 2: armature is of a joint, and the row is fixed"),
        ({"name": ""}, "row 2: name is '', expected a text"),
    ],
)
def test_a_row_that_is_wrong_is_named_by_its_number(row: dict[str, Any], message: str) -> None:
    with pytest.raises(RobotDefinitionError, match=message):
        robot_of_rows([ROWS[0], row])


def test_rows_that_make_no_robot_are_explained() -> None:
    with pytest.raises(RobotDefinitionError, match="there are no rows; give one per joint"):
        robot_of_rows([])
    with pytest.raises(RobotDefinitionError, match="all rows are fixed; give one that is revolute or prismatic"):
        robot_of_rows([{"kind": "fixed"}])
    with pytest.raises(RobotDefinitionError, match="actuator labels are .*all different"):
        robot_of_rows([{"name": "a"}, {"name": "a"}])
