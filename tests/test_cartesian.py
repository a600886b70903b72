"""Tool paths: geometry, inverse kinematics, postures along them, and what is refused with its place and reason."""

from __future__ import annotations

from itertools import product

import casadi
import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import make_interp_spline

from ocp_traj.errors import InputError
from ocp_traj.interval.tape import Tape
from ocp_traj.paths.cartesian import CONSTANTS, Section, ToolPath, places, progress, wanted_rotation
from ocp_traj.paths.following import SINGULAR, STEP, Unreachable, best_branch, follow
from ocp_traj.robot.inverse_kinematics import InverseKinematics
from ocp_traj.robot.robot import Robot

START = np.array([0.0, -1.3, 1.4, -1.6, -1.5, 0.0])


@pytest.fixture(scope="module")
def ur5() -> Robot:
    """A six-joint arm, with eight postures a pose."""
    return Robot.from_description("ur5", tool_frame="tool0")


@pytest.fixture(scope="module")
def panda() -> Robot:
    """A seven-joint arm."""
    locked = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    return Robot.from_description("panda", tool_frame="panda_hand", locked=locked)


def _pose(rng: np.random.Generator) -> pin.SE3:
    return pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))


def _sections() -> list[Section]:
    rng = np.random.default_rng(0)
    found = []
    for _ in range(6):
        found.append(Section.line(_pose(rng), rng.normal(size=3), rng.normal(size=3)))
        angle = rng.uniform(-6.2, 6.2)
        found.append(Section.arc(_pose(rng), rng.normal(size=3), rng.normal(size=3), angle, rng.normal(size=3)))
        found.append(Section.through(_pose(rng), rng.normal(size=3), rng.normal(size=3), np.zeros(3)))
    return found


def test_distance_progress_and_rotation_of_points_put_off_a_path_are_those() -> None:
    rng = np.random.default_rng(1)
    c, p = casadi.SX.sym("c", CONSTANTS), casadi.SX.sym("p", 3)
    outwards, across, along = places(c, p)
    outputs = [casadi.vertcat(outwards, across, along, progress(c, along, 1e-3)), wanted_rotation(c, along)]
    function = casadi.Function("place", [c, p], outputs)
    Tape(function).require_smooth("a tool path")
    for section in _sections():
        for leg in ToolPath((section,)).legs():
            middle = (leg.low + leg.high) / 2.0
            for s in np.linspace(leg.low, leg.high, 3):
                frame, (tangent, normal) = section.at(s), section.direction(s)
                off = rng.uniform(-1e-2, 1e-2, 2)
                point = frame.translation - off[0] * normal + off[1] * np.cross(tangent, normal)
                found, rotation = (np.array(o) for o in function(leg.constants, point))
                low, high = leg.window
                expected = [*off, s - middle, (2.0 * s - low - high) / (high - low + 2e-3)]
                np.testing.assert_allclose(found.ravel(), expected, atol=1e-11)
                np.testing.assert_allclose(rotation, frame.rotation, atol=1e-11)


def test_an_arc_passes_its_points_and_keeps_its_distance_from_the_centre() -> None:
    rng = np.random.default_rng(2)
    for _ in range(10):
        start, via, end = _pose(rng), rng.normal(size=3), rng.normal(size=3)
        arc = Section.through(start, via, end, np.zeros(3))
        centre = arc.start.translation + arc.normal / arc.curvature
        radii = [np.linalg.norm(point - centre) for point in (start.translation, via, end)]
        np.testing.assert_allclose(radii, 1.0 / arc.curvature, rtol=1e-9)
        np.testing.assert_allclose(arc.at(arc.length).translation, end, atol=1e-9)
        # The via is on the arc, not on what is left of the circle.
        spoke = (via - centre) * arc.curvature
        angle = np.arctan2(spoke @ arc.tangent, -spoke @ arc.normal) % (2.0 * np.pi)
        assert angle < arc.curvature * arc.length
        np.testing.assert_allclose(arc.at(angle / arc.curvature).translation, via, atol=1e-9)


def test_legs_join_and_end_at_cuts_and_corners_are_where_the_path_bends() -> None:
    here = pin.SE3.Identity()
    first = Section.line(here, np.array([1.0, 0.0, 0.0]), np.zeros(3))
    smooth = Section.arc(first.at(1.0), np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.pi / 2.0, np.zeros(3))
    bent = Section.line(smooth.at(smooth.length), np.array([1.0, 0.0, 0.0]), np.zeros(3))
    path = ToolPath((first, smooth, bent))
    assert path.corners == (0, 2)
    legs = path.legs((0.25,))
    edges = [leg.before + leg.low for leg in legs] + [path.length]
    np.testing.assert_allclose(edges, [0.0, 0.25, 1.0, 1.0 + np.pi / 4.0, 1.0 + np.pi / 2.0, 2.0 + np.pi / 2.0])
    assert legs[0].window == (0.0, 0.25) and legs[1].window == (0.25, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "free_turn"), list(product(("ur5", "panda"), (False, True))))
def test_postures_that_a_search_ends_in_have_the_pose(
    name: str, free_turn: bool, request: pytest.FixtureRequest
) -> None:
    robot = request.getfixturevalue(name)
    ik, rng = InverseKinematics(robot, free_turn), np.random.default_rng(3)
    low, high = ik.ranges
    for _ in range(3):
        target = ik.pose(rng.uniform(np.maximum(low, -2.5), np.minimum(high, 2.5)))
        found = ik.branches(target, rng)
        assert found
        rotation, place = robot.poses(np.array(found))  # by the symbolic kinematics, not by pinocchio's
        np.testing.assert_allclose(place, np.tile(target.translation, (len(found), 1)), atol=1e-9)
        first = 2 if free_turn else 0  # column of the rotation that counts
        wanted = np.broadcast_to(target.rotation, rotation.shape)
        np.testing.assert_allclose(rotation[:, :, first:], wanted[:, :, first:], atol=1e-9, rtol=0.0)
        assert all(((low <= q) & (q <= high)).all() for q in found)


def test_a_six_joint_arm_has_its_eight_branches(ur5: Robot) -> None:
    ik = InverseKinematics(ur5)
    assert len(ik.branches(ik.pose(START), np.random.default_rng(0))) == 8


def test_the_jacobian_is_the_derivative_of_the_pose(panda: Robot) -> None:
    ik, q = InverseKinematics(panda), np.array([0.1, -0.5, 0.2, -2.0, 0.3, 1.6, 0.8])
    h = 1e-6
    columns = [pin.log6(ik.pose(q - h * e).actInv(ik.pose(q + h * e))).vector / (2.0 * h) for e in np.eye(7)]
    np.testing.assert_allclose(ik.jacobian(q), np.array(columns).T, atol=1e-8)


@pytest.mark.parametrize("by", [(0.0, 0.3, 0.05), (0.2, 0.0, 0.0), (0.0, -0.4, -0.1)])
def test_postures_along_a_line_are_on_it_and_go_on_smoothly(by: tuple[float, ...], ur5: Robot) -> None:
    ik = InverseKinematics(ur5)
    path = ToolPath((Section.line(ik.pose(START), np.array(by), np.zeros(3)),))
    found = follow(ik, path, START)
    assert np.abs(np.diff(found.q, axis=0)).max() <= STEP and found.least >= SINGULAR
    _, place = ur5.poses(found.q)
    np.testing.assert_allclose(place, [path.at(s).translation for s in found.s], atol=1e-9)


def test_where_the_start_is_open_the_quickest_branch_that_holds_is_taken(ur5: Robot) -> None:
    ik = InverseKinematics(ur5)
    path = ToolPath((Section.line(ik.pose(START), np.array([0.0, 0.3, 0.05]), np.zeros(3)),))
    speeds = np.full(6, 3.15)
    chosen = best_branch(ik, path, np.random.default_rng(0), speeds)
    own = follow(ik, path, START)

    def time(q: np.ndarray) -> float:
        return float((np.abs(np.diff(q, axis=0)) / speeds).max(axis=1).sum())

    assert time(chosen.q) <= time(own.q) and chosen.branch.startswith("the quickest of")


REFUSED = [
    ((1.5, 0.0, 0.0), START, r"at 0\.22\d+ m of 1\.5 m along it, at \(0\.81\d+, 0\.115, 0\.3709\) m: out of the arm's"),
    ((-0.6, 0.0, 0.0), START, r"at 0\.5\d+ m of 0\.6 m along it, at \(0\.00\d+, 0\.115, 0\.3709\) m: a singular pos"),
    ((0.1, 0.0, 0.0), [0.0, -1.3, 1.4, -1.6, 0.0, 0.0], r"at 0 m of 0\.1 m .*: a singular posture: the least singular"),
]


@pytest.mark.parametrize(("by", "start", "words"), REFUSED)
def test_what_an_arm_cannot_follow_is_refused_with_the_place_and_the_reason(
    by: tuple[float, ...], start: list[float], words: str, ur5: Robot
) -> None:
    ik, q = InverseKinematics(ur5), np.array(start)
    path = ToolPath((Section.line(ik.pose(q), np.array(by), np.zeros(3)),))
    with pytest.raises(Unreachable, match=words):
        follow(ik, path, q)


def test_a_singularity_between_two_samples_is_found(ur5: Robot) -> None:
    """The wrist is straight at some place of a path that bends it from one side to the other."""
    ik, q = InverseKinematics(ur5), np.array([0.0, -1.3, 1.4, -1.6, 0.25, 0.0])
    before = ik.pose(q)
    there = ik.pose(np.array([0.0, -1.3, 1.4, -1.6, -0.25, 0.0]))
    turn = pin.log3(there.rotation @ before.rotation.T)
    path = ToolPath((Section.line(before, there.translation - before.translation, turn),))
    with pytest.raises(Unreachable, match="a singular posture") as caught:
        follow(ik, path, q)
    assert 0.0 < caught.value.share < 1.0


def test_a_joint_at_the_end_of_its_range_is_named(panda: Robot) -> None:
    ik, q = InverseKinematics(panda), np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 2.5])
    here = ik.pose(q)
    turn = here.rotation[:, 2] * 2.5  # about the tool's axis, beyond what joint 7 has left
    path = ToolPath((Section.line(here, np.array([0.0, 0.0, 0.02]), turn),))
    with pytest.raises(InputError, match=r"panda_joint7 would have to go to .* beyond its range, which ends at 2\.897"):
        follow(ik, path, q)
    assert follow(InverseKinematics(panda, free_turn=True), path, q).least > SINGULAR  # where it may turn, it need not


def test_postures_of_an_arm_with_a_joint_to_spare_join_smoothly(panda: Robot) -> None:
    """A spline through a few of them is on the path between: what is to spare does not jump from one to the next."""
    ik = InverseKinematics(panda)
    start = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    path = ToolPath((Section.line(ik.pose(start), np.array([0.0, 0.3, 0.05]), np.zeros(3)),))
    places = np.linspace(0.0, path.length, 17)
    spline = make_interp_spline(places, follow(ik, path, start).at(places, ik, path), k=5)
    for s in np.linspace(0.0, path.length, 200):
        assert np.linalg.norm(ik.pose(spline(s)).translation - path.at(s).translation) < 1e-5
