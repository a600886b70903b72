"""A problem that is in no registry can do what a registered one can."""

from dataclasses import dataclass, field, replace
from typing import Any

import casadi
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.errors import InputError
from ocp_traj.export import trajectory_table
from ocp_traj.problem import Problem
from ocp_traj.requirements import PathConstraint, Requirements
from ocp_traj.screen import problem_sheet
from ocp_traj.trajectory import case_fields
from tests.closed_form import Quintic, quintic_problem


@dataclass(frozen=True)
class WithNumbers:
    """A case with a field that has to be given, and one that holds an array."""

    distance: float
    bounds: np.ndarray = field(default_factory=lambda: np.ones(2))


CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "none": (None, {}),
    "a dictionary": ({"distance": 1.0}, {}),
    "defaults": (Quintic(), {}),
    "a field changed": (Quintic(velocity=3.0), {"velocity": 3.0}),
    "a field that has to be given": (WithNumbers(1.0), {"distance": 1.0}),
    "an array": (WithNumbers(1.0, np.array([1.0, 2.0])), {"distance": 1.0, "bounds": [1.0, 2.0]}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_case_of_any_kind_is_solved_audited_and_shown(name: str) -> None:
    case, expected = CASES[name]
    problem = replace(quintic_problem(), case=case)
    assert case_fields(problem) == expected
    solution = ot.solve(problem)
    assert solution.trajectory is not None and dict(solution.trajectory.case) == expected
    assert solution.trajectory.audit().proved
    assert problem_sheet(problem).tables


def test_solution_front_and_table_know_their_problem() -> None:
    problem = quintic_problem()
    front = ot.pareto(problem, ["time", "effort"], points=3)
    assert len(front) == 3 and all(front.audit(i).proved for i in range(3))
    assert list(trajectory_table(front.trajectory(0), 2).columns[:3]) == ["time [s]", "j q [rad]", "j v [rad/s]"]
    with pytest.raises(InputError, match="quintic has no payload"):
        ot.payload(problem)
    with pytest.raises(InputError, match="quintic has no objective 'payload_mass': give it the payload as a variable"):
        ot.payload(problem, max_time=1.0)


@pytest.mark.parametrize("name", ["v tape", "v proof", "v order", "expression"])
def test_names_of_limits_do_not_collide_with_what_is_kept_of_others(name: str) -> None:
    base = quintic_problem(velocity_limit="v")
    bound = PathConstraint(name, lambda s: casadi.sin(s.q[0]), np.array([-1.0]), np.array([1.0]), ("-",), ("j",))
    problem = _with(base, bound)
    solution = ot.solve(problem)
    assert solution.audit is not None and solution.audit.proved
    assert {row.limit for row in solution.audit.rows} >= {"v", name}


def _with(problem: Problem, *limits: PathConstraint) -> Problem:
    old = problem.requirements
    more = (*limits, *(replace(limit) for limit in old.path_constraints))
    return replace(problem, requirements=Requirements(old.joints, old.joint_units, more, old.point_constraints))
