"""Solving by levels: the quintics of a UR5 from few pieces to many."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import ocp_traj as ot
from ocp_traj.curves.least_time import phases
from ocp_traj.formulation.problem import Levels
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.results.starts import levels_to
from ocp_traj.transcription.symbolic import motion_of
from tests.quintics import curves, move, quintics, refined, ur5, wander


@pytest.fixture(scope="module")
def robot() -> ot.Robot:
    return ur5()


def _pieces(problem: ot.Problem, legs: int) -> int:
    return len(motion_of(problem, problem.guess(np.random.default_rng(0))).curve.durations) // legs


@pytest.mark.slow
def test_more_pieces_are_solved_from_fewer_until_little_is_gained(robot: ot.Robot) -> None:
    found = ot.solve(refined(robot, wander(6), 1, 16))
    assert found.ok and found.audit is not None and found.audit.proved
    assert found.f <= 2.40  # [s]; 2.8169 with one piece a leg
    assert found.trajectory is not None and found.trajectory.origin is not None
    assert _pieces(found.trajectory.origin, 5) == 8  # of which the last gains less than one per cent
    assert "by levels: 2.8169 of 53 variables" in found.detail
    assert found.trajectory.audit().proved and found.x.shape == (found.trajectory.origin.size,)


@pytest.mark.slow
def test_a_number_of_pieces_is_kept(robot: ot.Robot) -> None:
    problem = refined(robot, wander(6), 6)
    assert [_pieces(p, 5) for p in levels_to(problem)] == [1, 3, 6]
    found = ot.solve(problem)
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    assert found.trajectory.origin is problem and found.f == pytest.approx(2.4, abs=2e-4)


@pytest.mark.slow
def test_one_piece_is_solved_with_limits_at_control_points_first(robot: ot.Robot) -> None:
    before, problem = levels_to(refined(robot, wander(6), 1))
    assert before.tuning.hull_rows and not problem.tuning.hull_rows and before.size == problem.size
    found = ot.solve(problem)
    assert found.audit is not None and found.audit.proved
    assert found.f == pytest.approx(2.60234, abs=2e-5)  # [s]; 2.8169 before, which asks for more than the limits do


def test_prolonged_variables_are_the_same_motion_a_little_slower(robot: ot.Robot) -> None:
    coarse, fine = levels_to(refined(robot, wander(4), 3))
    assert fine.levels is not None
    x = coarse.guess(np.random.default_rng(0))
    curve, other = motion_of(coarse, x).curve, motion_of(fine, fine.levels.prolong(x)).curve
    shares = np.linspace(0.0, 1.0, 40)
    assert other.duration == pytest.approx(1.0005 * curve.duration)
    assert_allclose(other(shares * other.duration), curve(shares * curve.duration), atol=1e-12)


@pytest.mark.slow
def test_a_level_that_is_not_solved_leaves_the_one_before(robot: ot.Robot) -> None:
    coarse = quintics(robot, move(0), 8, torque=False)
    slow = quintics(ur5(velocity=(0.01,) * 6), move(0), 8, torque=False)
    hopeless = replace(coarse, guess=lambda rng: coarse.lower, requirements=slow.requirements)
    finer = replace(hopeless, levels=Levels(lambda: coarse, lambda x: x, None, 0.01))
    begun = replace(coarse, levels=Levels(None, np.array, lambda: finer, 0.01))
    found, alone = ot.solve(begun), ot.solve(coarse)
    assert found.ok and found.f == alone.f and found.trajectory is not None and found.trajectory.origin is begun


def test_a_level_is_begun_anew_where_the_coarser_does_not_lead_on(robot: ot.Robot) -> None:
    fine = quintics(robot, move(0), 8, torque=False)
    useless = replace(fine, tuning=Tuning(max_exchanges=1, instants={}, hull_rows=()))  # which sees no limit
    found = ot.solve(replace(fine, levels=Levels(lambda: useless, lambda x: x, None, 0.01)))
    assert found.audit is not None and found.audit.proved and found.f == pytest.approx(ot.solve(fine).f, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_random_move_takes_hardly_longer_than_bounded_jerk_asks_for(robot: ot.Robot, seed: int) -> None:
    """The longest of the joints' own shortest times, which the others can follow, is the optimum."""
    bounds = np.array([robot.limits.bounds(order)[1] for order in (1, 2, 3)])  # type: ignore[index]
    least = max(phases(*own).sum() for own in (bounds / np.abs(np.diff(move(seed), axis=0))).T)
    found = ot.solve(refined(robot, move(seed), 8, 16, torque=False))
    assert found.audit is not None and found.audit.proved and least <= found.f * (1.0 + 1e-9) <= 1.01 * least


@pytest.mark.slow
def test_all_points_of_a_front_share_one_discretisation(robot: ot.Robot) -> None:
    front = ot.pareto(refined(robot, move(3), 8, 16), ["time", "energy"], points=4)
    assert len(front) == 4
    assert {point.trajectory.curve.segments for point in front.points} == {16}


def test_curves_without_levels_are_as_they_were(robot: ot.Robot) -> None:
    assert quintics(robot, wander(3), 2).levels is None
    assert curves(robot, wander(3), 1).hull_rows == () and curves(robot, wander(3), 2).hull_rows
