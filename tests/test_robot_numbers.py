"""A robot as JSON and back, to the last digit; files that are no robot."""

import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from casadi import SX

from ocp_traj.errors import RobotDefinitionError
from ocp_traj.robot.dynamics import Friction
from ocp_traj.robot.joint_limits import QUANTITIES, JointLimits
from ocp_traj.robot.numbers import from_numbers, to_numbers
from ocp_traj.robot.payload import ToolPayload
from ocp_traj.robot.robot import ActuatorMap, Robot
from tests.mutations import structure
from tests.random_robots import random_model, random_robot


def again(robot: Robot) -> Robot:
    """Through the text of a file."""
    return from_numbers(json.loads(json.dumps(to_numbers(robot), allow_nan=False)))


def motion(robot: Robot) -> ca.Function:
    q, v, a = (SX.sym(name, robot.size) for name in "qva")
    payload = ToolPayload(2.0, (0.01, 0.02, 0.03), (0.1, 0.2, 0.3))
    return ca.Function("motion", [q, v, a], [robot.effort(q, v, a, payload=payload), *robot.tool_pose(q)])


def require_same(first: Robot, second: Robot) -> None:
    one, other = motion(first), motion(second)
    assert one.n_instructions() == other.n_instructions()
    rng = np.random.default_rng(3)
    for q, v, a in rng.uniform(-3.0, 3.0, size=(10, 3, first.size)):
        for x, y in zip(one(q, v, a), other(q, v, a), strict=True):
            assert np.array_equal(np.asarray(x), np.asarray(y))
    assert (first.joints, first.units) == (second.joints, second.units)
    for name in QUANTITIES:
        assert np.array_equal(getattr(first.limits, name), getattr(second.limits, name))
    assert list(first.model.names) == list(second.model.names)
    assert to_numbers(first) == to_numbers(second)


@pytest.mark.parametrize(
    "name", ["ur5", "ur10", "kinova", "xarm", "z1", "so101", "talos_arm", "anymal", "g1_29dof_rev_1_0"]
)
def test_a_description_is_the_same_robot_to_the_last_digit(name: str) -> None:
    robot = Robot.from_description(name)
    require_same(robot, again(robot))


@pytest.mark.parametrize("seed", range(5))
def test_any_tree_is_the_same_robot_to_the_last_digit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, 6)
    tree = random_model(rng, 6, branching=True)
    friction = Friction(rng.uniform(size=6), rng.uniform(size=6), 0.02)
    for made in (robot, Robot(tree, robot.joints, robot.units, tool=robot.tool, tool_joint=3, friction=friction)):
        require_same(made, again(made))


def test_locked_joints_and_infinite_limits_are_kept() -> None:
    fingers = {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}
    limits = JointLimits(velocity=[np.inf, *[2.0] * 6], jerk=[100.0] * 7)
    robot = Robot.from_description("panda", locked=fingers, tool_frame="panda_hand_tcp", limits=limits)
    numbers = to_numbers(robot)
    assert numbers["limits"]["velocity"] == [[None, *[-2.0] * 6], [None, *[2.0] * 6]]
    require_same(robot, again(robot))


def test_an_actuator_map_is_no_number() -> None:
    robot = replace(random_robot(np.random.default_rng(1), 2), actuator_map=ActuatorMap("screws", lambda q: q))
    with pytest.raises(RobotDefinitionError, match="actuator map 'screws' is a function"):
        to_numbers(robot)


def put(*path: Any) -> Callable[[Any], None]:
    """Sets, or with one key less removes, an entry."""

    def change(numbers: Any) -> None:
        *way, key, value = path
        for step in way:
            numbers = numbers[step]
        if value is ...:
            del numbers[key]
        else:
            numbers[key] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("joints", ...), "the robot: joints is missing"),
        (put("gravities", 1.0), r"the robot: 'gravities' is not allowed \(nearest is 'gravity'\)"),
        (put("joints", []), r"the robot's joints are \[\], expected a list of 1 to 200"),
        (put("joints", 0, 3), "joint 1 of the robot is 3, expected an object"),
        (put("joints", 1, "parent", 2), "joint 2 of the robot: parent is 2, expected a whole number from 0 to 1"),
        (put("joints", 1, "parent", True), "joint 2 of the robot: parent is True"),
        (put("joints", 1, "kind", "screw"), "joint 2 of the robot: kind is 'screw'; allowed are revolute, prismatic"),
        (put("joints", 1, "kind", []), r"joint 2 of the robot: kind is \[\]"),
        (put("joints", 1, "axis", [0.0, 0.0, 2.0]), "joint 2 of the robot: axis is .*expected a unit vector"),
        (put("joints", 1, "axis", [0.0, 1.0]), "joint 2 of the robot: axis is .*expected a list of 3"),
        (put("joints", 1, "mass", -1.0), "joint 2 of the robot: mass is -1.0, expected zero or more"),
        (put("joints", 1, "mass", float("nan")), "joint 2 of the robot: mass is nan, expected a number"),
        (
            put("joints", 1, "mass", 1e300),
            r"joint 2 of the robot: mass is 1e\+300, expected a number of at most 1e\+09",
        ),
        (put("joints", 1, "com", 0, "x"), "joint 2 of the robot: com is 'x', expected a number"),
        (put("joints", 1, "rotation", [1.0] * 9), "joint 2 of the robot: rotation is .*expected a rotation matrix"),
        (put("joints", 1, "inertia", 0, None), "joint 2 of the robot: inertia is None"),
        (put("joints", 1, "armature", -1.0), "joint 2 of the robot: armature is -1.0"),
        (put("joints", 1, "name", "joint1"), "joint 2 of the robot: name is 'joint1', which an earlier one has"),
        (put("tool", "joint", 9), "the robot's tool: joint is 9, expected a whole number from 1 to 3"),
        (put("tool", "joint", ...), "the robot's tool: joint is missing"),
        (put("units", ["rad"]), r"the robot's units is \['rad'\], expected a list of 3"),
        (put("units", ["deg"] * 3), "the robot's numbers: units are .*'deg'"),
        (put("actuators", ["a"] * 3), "the robot's numbers: actuator labels are .*all different"),
        (put("limits", []), r"the robot's limits are \[\], expected an object"),
        (put("limits", "velocity", [[None] * 3]), "the robot's limits: velocity is .*expected a list of 2"),
        (put("limits", "velocity", [[1.0] * 3, [0.0] * 3]), "the robot's limits: velocity limit of joint 1"),
        (put("limits", "speed", [[1.0] * 3] * 2), "the robot's limits: speed is not allowed"),
        (put("friction", {"coulomb": [0.0] * 3}), "the robot's friction: viscous is missing"),
        (
            put("friction", {"coulomb": [0.0] * 3, "viscous": [0.0] * 3, "velocity_scale": [0.0] * 3}),
            "the robot's numbers: friction's velocity_scale is .*expected a finite number > 0",
        ),
    ],
)
def test_numbers_that_are_no_robot_are_named(change: Callable[[Any], None], message: str) -> None:
    numbers = deepcopy(to_numbers(random_robot(np.random.default_rng(4), 3)))
    change(numbers)
    with pytest.raises(RobotDefinitionError, match=message) as caught:
        from_numbers(numbers)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_changed_numbers_are_a_robot_or_refused_in_one_line() -> None:
    rng = np.random.default_rng(12)
    whole = to_numbers(replace(random_robot(rng, 3), friction=Friction(1.0, 0.5, 0.02)))
    refused = 0
    for _ in range(500):
        numbers = deepcopy(whole)
        structure(rng, numbers)
        try:
            motion(from_numbers(numbers))
        except RobotDefinitionError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 250
