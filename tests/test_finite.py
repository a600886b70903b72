"""A step that cannot be computed is named with its cause: a root at rest, a curve or a start that is no number."""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation import standard
from ocp_traj.formulation.objective import TRAPEZOID, Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, PointConstraint, Requirements
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.fatrop import Fatrop
from ocp_traj.transcription.finite import not_finite
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.nlp import Status
from tests.closed_form import quintic_problem


def having(*limits: Any, points: tuple[PointConstraint, ...] = (), **changes: Any) -> Problem:
    """A rest-to-rest motion of one joint, with more limits."""
    problem = quintic_problem()
    paths = (*(replace(limit) for limit in problem.requirements.path_constraints), *limits)
    return replace(problem, requirements=Requirements(("j",), ("rad",), paths, points), **changes)


def speed(s: Any) -> Any:
    return ca.norm_2(ca.vertcat(s.v, s.v))


TOOL_SPEED = PathConstraint("tool-speed", speed, np.array([-1.0]), np.array([3.0]), ("m/s",), ("tool",))
SQUARED = PathConstraint(
    "tool-speed", lambda s: 2.0 * ca.sumsqr(s.v), np.array([-1.0]), np.array([9.0]), ("m2/s2",), ("tool",)
)
AT_END = PointConstraint("stop", speed, ((-1, 1.0),), np.zeros(1), np.zeros(1), ("m/s",), ("tool",))
WAY = Objective("way", "m", integrand=speed, quadrature=TRAPEZOID)
ROOTS: dict[str, tuple[Problem, str]] = {
    "limit": (having(TOOL_SPEED), "limit 'tool-speed' has no finite derivative at segment 0, u = 0: a root"),
    "point": (having(points=(AT_END,)), "point constraint 'stop' has no finite derivative at segment 0, u = 1: a root"),
    "objective": (
        replace(quintic_problem(), objectives=(*quintic_problem().objectives, WAY), default_objective="way"),
        "objective 'way' has no finite derivative at segment 0, u = 0: a root",
    ),
    "value": (
        having(replace(TOOL_SPEED, id="root", expression=lambda s: ca.sqrt(s.q - 0.5))),
        "limit 'root' has no finite value at segment 0, u = 0",
    ),
    "start": (having(guess=lambda rng: np.array([np.nan])), "its start is not finite: T"),
}


@pytest.mark.parametrize("solver", [Exchange(), Exchange(solver=Fatrop())], ids=["ipopt", "fatrop"])
@pytest.mark.parametrize("name", ROOTS)
def test_a_number_that_cannot_be_computed_is_named(name: str, solver: Exchange) -> None:
    problem, words = ROOTS[name]
    found = ot.solve(problem, solver=solver, certify=False)
    assert found.status is Status.FAILED
    assert words in found.explain() and words in found.detail
    assert ("square it" in found.explain()) == ("derivative" in words)


def test_what_is_squared_is_solved() -> None:
    found = ot.solve(having(SQUARED), certify=False)
    assert found.audit is not None and found.audit.proved
    assert not_finite(having(SQUARED), ["time", "both"], few_instants(having(SQUARED)), np.ones(1)) == ""


def test_via_points_that_are_no_numbers_are_named() -> None:
    points = [[0.0, 1.0], [0.5, np.nan]]
    with pytest.raises(ProblemDefinitionError, match="'via': the bound of b at segment 0, u = 0.5 is no number"):
        standard.via_points(points, ((0, 0.0), (0, 0.5)), ("a", "b"), ("rad", "rad"))
    curve = quintic_problem().curve
    bent = replace(quintic_problem(), curve=lambda x: replace(curve(x), control_points=(ca.SX(6, 1) + ca.SX(np.nan),)))
    assert "its curve is not finite on segment 0" in ot.solve(bent, certify=False).explain()


@pytest.mark.slow
def test_a_bound_on_a_variable_that_is_in_the_way_is_not_crowded_out_by_what_is_missed() -> None:
    jerk = (2100.0, 2100.0, 2200.0, 4300.0, 4500.0, 7200.0)
    found = ot.solve(ot.problems.load("rotor-353", max_duration=0.2, jerk=jerk))
    assert found.status is Status.LOCALLY_INFEASIBLE
    assert sum(conflict.excess > 0.0 for conflict in found.conflicts) >= 6
    for name in ("t1", "t2"):
        assert f"variable {name}: held at its bound 0.2 s" in found.explain()
