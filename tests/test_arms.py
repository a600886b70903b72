"""Arms of ``example-robot-data`` and of one's own: loaded, a random move solved and proved."""

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import ocp_traj as ot
from benchmarks.arms import ARMS, NO_ARMS, Arm, move, random_postures
from ocp_traj.errors import RobotDefinitionError
from ocp_traj.robot.descriptions import description_urdf, descriptions
from ocp_traj.robot.dh import robot_of_rows

GRIPPER = re.compile("gripper|finger_joint", re.IGNORECASE)
AXES = "<axis xyz='{}'/><limit lower='-1' upper='1' velocity='1' effort='{}'/>"
BODY = "<inertial><mass value='4'/><inertia ixx='0.1' iyy='0.1' izz='0.1' ixy='0' ixz='0' iyz='0'/></inertial>"
STAGES = (("x", "base", "1 0 0", 200), ("y", "lx", "0 1 0", 150), ("z", "ly", "0 0 1", 90))
GANTRY = "<robot name='gantry'><link name='base'/>" + "".join(
    f"<link name='l{axis}'>{BODY}</link><joint name='{axis}' type='prismatic'><parent link='{parent}'/>"
    f"<child link='l{axis}'/>{AXES.format(along, effort)}</joint>"
    for axis, parent, along, effort in STAGES
) + "</robot>"  # fmt: skip


def proved(robot: ot.Robot, table: dict[str, Any], **limits: Any) -> bool:
    found = ot.solve(move(table, random_postures(robot, 0), finest=2, **limits))
    assert found.trajectory is not None and found.trajectory.joints == robot.joints
    return found.audit is not None and found.audit.proved


def test_every_description_of_two_to_seven_joints_is_listed() -> None:
    listed = {description_urdf(name) for name in (*(arm.name for arm in ARMS), *NO_ARMS)}
    for path in set(descriptions().values()):
        joints = [joint for joint in ElementTree.parse(path).getroot().iter("joint") if joint.get("type") != "fixed"]
        moving = [joint for joint in joints if joint.get("type") and not GRIPPER.search(joint.get("name", ""))]
        assert (2 <= len(moving) <= 7) == (path in listed), path


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_an_arm_loads_or_is_refused_for_limits_that_are_not_given(arm: Arm) -> None:
    if arm.name.startswith("double_pendulum"):
        with pytest.raises(RobotDefinitionError, match="limit of 'joint1', 'joint2' is 0, which means not given"):
            arm.robot()
    else:
        assert 2 <= arm.robot().size <= 7


@pytest.mark.slow
@pytest.mark.parametrize("name", ["kinova", "xarm", "so100"])
def test_a_random_move_of_an_arm_is_proved(name: str) -> None:
    (arm,) = (arm for arm in ARMS if arm.name == name)
    assert proved(arm.robot(), arm.table)


def test_a_gantry_of_prismatic_joints_is_proved(tmp_path: Path) -> None:
    robot, file = ot.Robot.from_urdf(GANTRY, tool_frame="lz"), tmp_path / "gantry.urdf"
    file.write_text(GANTRY)
    assert robot.units == ("m", "m", "m")
    assert proved(robot, {"urdf": str(file), "tool_frame": "lz"}, acceleration=2.0, jerk=20.0)


@pytest.mark.slow
def test_an_arm_of_rows_is_proved() -> None:
    body = {"mass": 2.0, "com": [-0.1, 0.0, 0.0], "inertia": [0.01, 0.02, 0.02]}
    rows = [{"d": 0.3, "alpha": np.pi / 2, **body}, {"a": 0.4, **body}, {"a": 0.3, **body}]
    limits = ot.JointLimits(
        position=[[-2.0] * 3, [2.0] * 3], velocity=[2.0] * 3, acceleration=[8.0] * 3, jerk=[60.0] * 3,
        effort=[60.0, 60.0, 30.0],
    )  # fmt: skip
    given = {name: limits.bounds(name) for name in ("position", "velocity", "effort")}
    assert proved(robot_of_rows(rows, limits=limits), {"dh": rows}, **given)


def test_a_tool_frame_and_a_joint_of_one_name_are_told_apart() -> None:
    (arm,) = (arm for arm in ARMS if arm.name == "so100")
    robot = arm.robot()
    model = pin.buildModelFromUrdf(str(description_urdf("so100")))  # its link "gripper" hangs on wrist_roll
    data, q = model.createData(), np.array([0.1, 1.0, -1.0, 0.2, 0.3, 0.0])
    pin.framesForwardKinematics(model, data, q)
    place = data.oMf[model.getFrameId("gripper", pin.FrameType.BODY)]
    order = [list(model.names)[1:].index(name) for name in robot.joints]
    rotation, position = robot.poses(q[order])
    assert np.abs(rotation[0] - place.rotation).max() <= 1e-12
    assert np.abs(position[0] - place.translation).max() <= 1e-12
