"""Robots by name, continuous joints, and where a URDF's packages lie: facts against pinocchio."""

from importlib.metadata import PackageNotFoundError
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from casadi import SX

from ocp_traj.errors import FileFormatError, RobotDefinitionError, UnknownName, UnsupportedJoint
from ocp_traj.io.requirements_file import read_requirements
from ocp_traj.robot import descriptions
from ocp_traj.robot.descriptions import description_urdf, package_folders
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("ur5", "ur_description/urdf/ur5_robot.urdf"),
        ("ur3", "ur_description/urdf/ur3_robot.urdf"),
        ("ur10_limited", "ur_description/urdf/ur10_joint_limited_robot.urdf"),
        ("ur5_gripper", "ur_description/urdf/ur5_gripper.urdf"),
        ("panda", "panda_description/urdf/panda.urdf"),
        ("kinova", "kinova_description/robots/kinova.urdf"),
        ("xarm", "xarm_description/urdf/xarm7.urdf"),
        ("xarm7", "xarm_description/urdf/xarm7.urdf"),
        ("talos_arm", "talos_data/robots/talos_left_arm.urdf"),
        ("anymal_c", "anymal_c_simple_description/urdf/anymal.urdf"),
    ],
)
def test_a_name_is_a_file_of_the_package(name: str, file: str) -> None:
    assert description_urdf(name).as_posix().endswith(f"example-robot-data/robots/{file}")


def test_every_name_of_the_loaders_is_a_file() -> None:
    known = descriptions.descriptions()
    assert set(descriptions.LOADERS) <= set(known)
    assert all(path.is_file() for path in known.values())


def test_an_unknown_name_and_a_missing_package_are_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        UnknownName, match=r"'ur6' is no robot of example-robot-data \(nearest is 'ur\d+'\); known are "
    ):
        Robot.from_description("ur6")

    def nothing(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(descriptions, "distribution", nothing)
    with pytest.raises(RobotDefinitionError, match=r"not installed; pip install 'ocp-traj\[robots\]', or give a URDF"):
        description_urdf("ur5")


@pytest.mark.parametrize("name", ["kinova", "ur5", "talos_arm", "romeo"])
def test_meshes_are_found_in_the_package_folders(name: str) -> None:
    urdf = description_urdf(name)
    folders = package_folders(urdf)
    meshes = [line.split("package://")[1].split('"')[0] for line in urdf.read_text().splitlines() if "package:" in line]
    assert meshes
    assert all(any((folder / mesh.lstrip("/")).is_file() for folder in folders) for mesh in meshes)


def test_pinocchio_loads_collision_meshes_from_the_package_folders() -> None:
    urdf = description_urdf("ur5")
    model = pin.buildModelFromUrdf(str(urdf))
    geometry = pin.buildGeomFromUrdf(
        model, str(urdf), pin.GeometryType.COLLISION, package_dirs=[str(folder) for folder in package_folders(urdf)]
    )
    assert geometry.ngeoms == 8


def test_a_package_that_is_not_there_is_named(tmp_path: Path) -> None:
    mesh = '<link name="a"><visual><geometry><mesh filename="package://{}/a.stl"/></geometry></visual></link>'
    inside = tmp_path / "mine" / "urdf" / "arm.urdf"
    inside.parent.mkdir(parents=True)
    inside.write_text(f'<robot name="r">{mesh.format("mine")}</robot>')
    assert package_folders(inside) == [tmp_path]
    inside.write_text(f'<robot name="r">{mesh.format("theirs")}</robot>')
    with pytest.raises(RobotDefinitionError, match="package 'theirs' of .*arm.urdf' is in no folder above"):
        package_folders(inside)


def test_continuous_joints_are_revolute_ones_without_limits() -> None:
    robot = Robot.from_description("kinova", tool_frame="j2s6s200_end_effector")
    assert robot.units == ("rad",) * 6
    free = np.isinf(robot.limits.position).all(axis=0)
    assert free.tolist() == [True, False, False, True, False, True]
    assert robot.limits.velocity[1] == pytest.approx([0.628318530718] * 3 + [0.837758040957] * 3)
    model = pin.buildModelFromUrdf(str(description_urdf("kinova")))  # cosine and sine of the continuous ones
    assert model.nq == 9
    data, rng = model.createData(), np.random.default_rng(0)
    q, v, a = (SX.sym(name, 6) for name in "qva")
    tau = ca.Function("tau", [q, v, a], [robot.effort(q, v, a)])
    pose = ca.Function("pose", [q], robot.tool_pose(q))
    for x, dx, ddx in rng.uniform(-3.0, 3.0, size=(20, 3, 6)):
        full = pin.integrate(model, pin.neutral(model), x)
        expected = pin.rnea(model, data, full, dx, ddx)
        assert np.abs(np.asarray(tau(x, dx, ddx))[:, 0] - expected).max() <= 1e-9 * np.abs(expected).max()
        pin.framesForwardKinematics(model, data, full)
        frame = data.oMf[model.getFrameId("j2s6s200_end_effector")]
        assert np.abs(np.asarray(pose(x)[1])[:, 0] - frame.translation).max() <= 1e-12


def test_mimic_and_missing_limits_of_descriptions_are_named() -> None:
    with pytest.raises(UnsupportedJoint, match="'panda_finger_joint2' of .* is a mimic joint.*Lock it"):
        Robot.from_description("panda")
    with pytest.raises(
        RobotDefinitionError, match="the position limit of 'joint1', 'joint2' is 0, which means not given"
    ):
        Robot.from_description("double_pendulum")
    free = Robot.from_description("double_pendulum", file_limits=False)
    assert free.limits.size is None
    wide = JointLimits(position=[[-3.0] * 2, [3.0] * 2], velocity=[5.0] * 2, effort=[np.inf] * 2)
    assert Robot.from_description("double_pendulum", limits=wide).limits.velocity.tolist() == [[-5.0] * 2, [5.0] * 2]


def test_limits_files_take_a_description_and_locked_joints(tmp_path: Path) -> None:
    joints = [f"panda_joint{i}" for i in range(1, 8)]
    path = tmp_path / "limits.toml"

    def write(robot: str) -> Path:
        path.write_text(
            f'format = "ocp-traj/limits/1"\njoints = {joints}\nunits = {["rad"] * 7}\n[robot]\nlimits = true\n{robot}\n'
        )
        return path

    locked = "locked = { panda_finger_joint1 = 0.02, panda_finger_joint2 = 0.02 }"
    read = read_requirements(write(f'description = "panda"\n{locked}'))
    assert [limit.id for limit in read.path_constraints] == ["position-limit", "velocity-limit", "effort-limit"]
    assert read_requirements(write(f'urdf = "{description_urdf("panda")}"\n{locked}')).joints == tuple(joints)
    for robot, message in (
        ('description = "pandas"\n', r"\[robot\] description: 'pandas' is no robot .*\(nearest is 'panda'\)"),
        ('description = "panda"\nurdf = "a.urdf"', r"\[robot\] urdf is not allowed here; allowed are description"),
        (
            'description = "panda"\nlocked = { panda_finger_joint1 = "in" }',
            r"\[robot\] locked is .*give a table of joints",
        ),
        (
            f'description = "panda"\n{locked.replace("joint2", "joint3")}',
            "description: joint 'panda_finger_joint2' .*mimic",
        ),
    ):
        with pytest.raises(FileFormatError, match=message):
            read_requirements(write(robot))
