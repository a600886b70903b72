"""The air move of ``weld-bezier`` with as many pieces as are worth it, in place of the paper's one from point to point.

The limits are the paper problem's, at rest up to jerk at both ends, so that snap is bounded there as well.
"""

from __future__ import annotations

from dataclasses import replace

from ocp_traj.formulation.levels import levels_of
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Problem
from ocp_traj.problems.weld_bezier import via_points
from tests.quintics import curves, quintics

COARSEST, FINEST = 2, 8  # pieces from one point to the next: our choice


def refined_air_move(paper: Problem) -> Problem:
    """Septic pieces, by levels.

    Args:
        paper: ``weld-bezier`` with ``case="air-move"``.
    """
    robot, points = paper.robot, via_points(paper.case)
    (torque,) = (limit for limit in paper.requirements.path_constraints if limit.order is None)

    def posed(count: int, made: Parametrisation) -> Problem:
        plain = quintics(robot, points, count, made=made, torque=False)
        limits = (*plain.requirements.path_constraints, torque)
        return replace(plain, requirements=replace(plain.requirements, path_constraints=limits))

    return levels_of(lambda count: curves(robot, points, count, degree=7, rest=3), posed, COARSEST, finest=FINEST)
