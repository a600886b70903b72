"""Closed-form kinematics of six-axis arms, against the product of the rows' matrices, on random and singular poses."""

from math import pi

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

from ocp_traj.errors import InputError
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.six_axis import ELBOW_SINGULAR, SIGNS, SixAxisArm, wrapped

# Arms with all offsets, with none, with negative ones and with a forearm longer than the upper arm. [m]
ARMS = [
    SixAxisArm(0.45, 0.075, 0.84, 0.195, 1.1, 0.075),
    SixAxisArm(0.4, 0.0, 0.5, 0.0, 0.5, 0.1),
    SixAxisArm(0.3, -0.1, 0.7, -0.05, 0.6, 0.0),
    SixAxisArm(0.45, 0.075, 0.84, 1.1, 1.1, 0.075),
]
RANDOM = 12_000


def matrix_of_rows(arm: SixAxisArm, theta: np.ndarray) -> np.ndarray:
    """The product of the matrices (1) of Zhu and Wang, one configuration."""
    a = (0.0, arm.a1, arm.a2, arm.a3, 0.0, 0.0)
    alpha = np.radians([0.0, -90.0, 0.0, -90.0, 90.0, -90.0])
    d = (arm.d1, 0.0, 0.0, arm.d4, 0.0, arm.d6)
    pose = np.eye(4)
    for i in range(6):
        c, s, ca_, sa = np.cos(theta[i]), np.sin(theta[i]), np.cos(alpha[i]), np.sin(alpha[i])
        rows = [[c, -s, 0.0, a[i]], [s * ca_, c * ca_, -sa, -d[i] * sa], [s * sa, c * sa, ca_, d[i] * ca_]]
        pose = pose @ np.array([*rows, [0.0, 0.0, 0.0, 1.0]])
    return pose


def random_angles(seed: int, count: int = RANDOM) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-pi, pi, (count, 6))


@pytest.mark.parametrize("arm", ARMS)
def test_forward_kinematics_is_the_product_of_the_rows(arm: SixAxisArm) -> None:
    angles = random_angles(0, 50)
    rotation, position = arm.forward(angles)
    for i, theta in enumerate(angles):
        pose = matrix_of_rows(arm, theta)
        assert_allclose(rotation[i], pose[:3, :3], atol=1e-14)
        assert_allclose(position[i], pose[:3, 3], atol=1e-14)


@pytest.mark.parametrize("arm", ARMS)
def test_rows_give_a_robot_with_the_same_kinematics(arm: SixAxisArm) -> None:
    robot = Robot.from_dh(arm.rows, (None,) * 6, convention="modified")
    q = ca.SX.sym("q", 6)
    pose = ca.Function("pose", [q], list(robot.tool_pose(q)))
    for theta in random_angles(1, 50):
        for found, expected in zip(pose(theta), arm.forward(theta), strict=True):
            assert_allclose(np.squeeze(np.array(found)), expected[0], atol=1e-14)


@pytest.mark.parametrize("arm", ARMS)
def test_a_random_configuration_is_among_the_branches_of_its_pose(arm: SixAxisArm) -> None:
    """12 000 configurations an arm come back to 1e-9 rad; rounding is amplified by the inverse of the measures."""
    angles = random_angles(2)
    branches = arm.inverse(*arm.forward(angles))
    nearest, gap = branches.nearest(angles)
    away = np.nanmin(branches.measures, axis=(1, 2)) > 1e-5
    assert away.mean() > 0.999
    assert gap[away].max() <= 1e-9
    assert np.abs(nearest - angles)[away].max() <= 1e-9


@pytest.mark.parametrize("arm", ARMS)
def test_every_branch_reproduces_the_pose(arm: SixAxisArm) -> None:
    """To 1e-6 mm, at any distance from singularities: setting a free angle does not move the flange."""
    rotation, position = arm.forward(random_angles(3))
    branches = arm.inverse(rotation, position)
    owner = np.nonzero(branches.exists)[0]
    found, place = arm.forward(branches.angles[branches.exists])
    assert_allclose(place, position[owner], rtol=0, atol=1e-9)  # [m]
    assert_allclose(found, rotation[owner], rtol=0, atol=1e-9)
    assert set(branches.exists.sum(axis=1).tolist()) <= {2, 4, 6, 8}


def test_branches_differ_and_carry_their_signs() -> None:
    arm = ARMS[0]
    angles = random_angles(4, 500)
    rotation, position = arm.forward(angles)
    branches = arm.inverse(rotation, position)
    whole = branches.exists.all(axis=1) & (branches.measures.min(axis=(1, 2)) > 1e-3)
    assert whole.sum() > 100
    found = branches.angles[whole]
    gaps = np.abs(wrapped(found[:, :, None] - found[:, None])).max(axis=-1) + 10.0 * np.eye(8)
    assert gaps.min() > 1e-3
    assert (np.sign(np.sin(found[..., 4])) == SIGNS[:, 2]).all()  # wrist
    wrist = position - arm.d6 * rotation[:, :, 2]
    before = np.cos(found[..., 0]) * wrist[whole, None, 0] + np.sin(found[..., 0]) * wrist[whole, None, 1]
    assert (np.sign(before) == SIGNS[:, 0]).all()  # the arm's plane faces the wrist, or turns its back on it
    bend = np.cos(np.arctan2(arm.a3, arm.d4) - found[..., 2])
    assert (np.sign(bend) == SIGNS[:, 1]).all()  # elbow


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("fifth", [0.0, pi])
def test_at_a_wrist_singularity_the_fourth_angle_is_set_and_the_pose_kept(arm: SixAxisArm, fifth: float) -> None:
    angles = random_angles(5, 200)
    angles[:, 4] = fifth
    rotation, position = arm.forward(angles)
    branches = arm.inverse(rotation, position)
    reasons = branches.reasons[branches.exists]
    singular = [i for i, reason in enumerate(reasons) if "wrist singular: only theta_4 and theta_6" in reason]
    found, place = arm.forward(branches.angles[branches.exists])
    owner = np.nonzero(branches.exists)[0]
    assert len(set(owner[singular])) == 200
    assert (branches.angles[branches.exists][singular, 3] == 0.0).all()
    assert_allclose(found, rotation[owner], rtol=0, atol=1e-8)
    assert_allclose(place, position[owner], rtol=0, atol=1e-9)


@pytest.mark.parametrize(("arm", "folded"), [(arm, False) for arm in ARMS[:3]] + [(ARMS[0], True), (ARMS[2], True)])
def test_a_stretched_or_folded_arm_has_one_elbow_branch_and_says_so(arm: SixAxisArm, folded: bool) -> None:
    angles = random_angles(6, 200)
    angles[:, 2] = np.arctan2(arm.a3, arm.d4) + (pi / 2 if folded else -pi / 2)
    rotation, position = arm.forward(angles)
    branches = arm.inverse(rotation, position)
    singular = np.char.find(branches.reasons.astype(str), "elbow singular") >= 0
    assert singular.any(axis=1).all()
    owner, branch = np.nonzero(singular)
    assert_allclose(branches.angles[owner, branch, 2], branches.angles[owner, branch ^ 2, 2], atol=4 * ELBOW_SINGULAR)
    found, place = arm.forward(branches.angles[owner, branch])
    assert_allclose(place, position[owner], rtol=0, atol=1e-9)
    assert_allclose(found, rotation[owner], rtol=0, atol=1e-8)


def test_with_the_wrist_on_the_base_axis_the_first_angle_is_set_and_the_pose_kept() -> None:
    arm, rotation = ARMS[0], np.diag([1.0, -1.0, -1.0])
    branches = arm.inverse(rotation, [0.0, 0.0, 1.5])
    assert branches.exists.all()
    assert (branches.angles[0, :, 0] == 0.0).all()
    assert all("shoulder singular: the wrist is on the base axis" in reason for reason in branches.reasons[0])
    found, place = arm.forward(branches.angles[0])
    assert_allclose(found, np.tile(rotation, (8, 1, 1)), atol=1e-14)
    assert_allclose(place, np.tile([0.0, 0.0, 1.5], (8, 1)), atol=1e-14)


@pytest.mark.parametrize(
    ("position", "what"), [((5.0, 0.0, 0.0), "the wrist is 4.9529 m"), ((0.1, 0.0, 0.5), "the wrist is 0.0353553 m")]
)
def test_a_pose_out_of_reach_has_no_branch_and_says_how_far_it_is(position: tuple[float, ...], what: str) -> None:
    arm = ARMS[0]
    branches = arm.inverse(np.eye(3), position)
    assert not branches.exists.any() and np.isnan(branches.angles).all()
    assert what in branches.reasons[0, 0] and "it can be 0.27715 to 1.95715 m away" in branches.reasons[0, 0]
    with pytest.raises(InputError, match="pose 0 is out of reach: the wrist"):
        branches.require()
    _, gap = branches.nearest(np.zeros(6))
    assert np.isnan(gap).all()


def test_of_many_poses_each_is_judged_alone() -> None:
    arm = ARMS[0]
    rotation, position = arm.forward(random_angles(7, 3))
    position[1] = [9.0, 0.0, 0.0]
    assert arm.inverse(rotation, position).exists.any(axis=1).tolist() == [True, False, True]


def test_angles_are_wrapped_to_one_turn() -> None:
    assert_allclose(wrapped([pi, -pi, 3 * pi, 0.5 - 4 * pi, 0.0]), [pi, pi, pi, 0.5, 0.0], atol=1e-15)
    inside = np.random.default_rng(0).uniform(-pi, pi, 1000)
    assert (wrapped(inside) == inside).all()


@pytest.mark.parametrize(
    ("rotation", "position", "message"),
    [
        (2.0 * np.eye(3), np.zeros(3), "rotation 0 is no rotation matrix"),
        (np.diag([1.0, 1.0, -1.0]), np.zeros(3), "rotation 0 is no rotation matrix"),
        (np.eye(3), [0.0, np.nan, 0.0], "is no number"),
        (np.eye(3), np.zeros((2, 3)), "1 rotations for 2 positions"),
    ],
)
def test_a_pose_that_is_none_is_refused(rotation: np.ndarray, position: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ARMS[0].inverse(rotation, position)


@pytest.mark.parametrize("lengths", [(0, 0, 0, 0, 1, 0), (0, 0, 1, 0, -1, 0), (0, np.inf, 1, 0, 1, 0)])
def test_an_arm_without_an_arm_is_refused(lengths: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="a2 and d4 above zero"):
        SixAxisArm(*lengths)
