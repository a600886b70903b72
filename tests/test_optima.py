"""Which solutions are one local optimum."""

from dataclasses import replace

import numpy as np

from ocp_traj.formulation.about import About
from ocp_traj.results.optima import distinct
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.transcription.nlp import Status
from tests.closed_form import quintic_problem

PROBLEM = quintic_problem()


def solution(f: float, scale: float = 1.0) -> Solution:
    """A solution of some value, whose curve is bent inside by ``scale``."""
    moved = trajectory_of(PROBLEM, np.array([3.0]))
    (points,) = moved.curve.control_points
    bent = points.copy()
    bent[3] *= scale
    curve = replace(moved.curve, control_points=(bent,))
    return Solution("p", np.array([3.0]), f, Status.SOLVED, 0.0, 1, 0.0, trajectory=replace(moved, curve=curve))


def counted(*solutions: Solution, ways: bool = False) -> list[tuple[float, int]]:
    def way(trajectory: Trajectory) -> str:
        return "left" if trajectory.curve.control_points[0][3, 0] > 1.0 else "right"

    problem = replace(PROBLEM, about=About(homotopy_class=way if ways else None))
    return [(optimum.solution.f, optimum.starts) for optimum in distinct(problem, solutions)]


def test_optima_differ_in_value_or_in_their_curve() -> None:
    assert counted(solution(2.0), solution(2.0 * (1.0 + 1e-7)), solution(2.0)) == [(2.0, 3)]
    assert counted(solution(2.001), solution(2.0)) == [(2.0, 1), (2.001, 1)]
    assert counted(solution(2.0), solution(2.0, 1.001)) == [(2.0, 2)]
    assert counted(solution(2.0), solution(2.0, 1.5)) == [(2.0, 1), (2.0, 1)]


def test_where_there_is_a_word_for_the_way_it_decides_among_equal_values() -> None:
    low, high = solution(2.0, 0.5), solution(2.0, 1.5)
    assert counted(low, high, ways=True) == [(2.0, 1), (2.0, 1)]
    assert counted(high, solution(2.0, 1.9), ways=True) == [(2.0, 2)]
