"""Rules of integrals: what the default leaves open, and what a paper's own rule does."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from ocp_traj import problems
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.objective import GAUSS, MIDPOINT, TRAPEZOID, Objective, gauss, rule_name
from ocp_traj.formulation.problem import Problem
from ocp_traj.results.quadrature import quadrature_errors
from ocp_traj.transcription.symbolic import evaluate_objectives, motion_of

EXAMPLES = Path(__file__).parent.parent / "examples" / "tasks"


def test_gauss_is_exact_to_twice_its_points() -> None:
    for points in range(1, 9):
        for power in range(2 * points):
            assert sum(w * u**power for u, w in gauss(points)) == pytest.approx(1.0 / (power + 1), rel=1e-14)
        assert sum(w * u ** (2 * points) for u, w in gauss(points)) != pytest.approx(1.0 / (2 * points + 1), rel=1e-12)


def test_an_integral_that_names_no_rule_takes_gauss() -> None:
    assert Objective("a", "-", integrand=lambda s: s.q[0]).quadrature == GAUSS
    assert Objective("a", "-", integrand=lambda s: s.q[0], quadrature=TRAPEZOID).quadrature == TRAPEZOID
    with pytest.raises(ProblemDefinitionError, match="a quadrature rule is for an integrand; leave it out"):
        Objective("a", "-", terms={"b": 1.0}, quadrature=GAUSS)


def test_rules_are_shown_by_name() -> None:
    assert [rule_name(rule) for rule in ((), TRAPEZOID, MIDPOINT, GAUSS, ((0.3, 1.0),))] == [
        "", "trapezoid: as the paper has it, not exact", "Gauss, exact to degree 1", "Gauss, exact to degree 19",
        "1 nodes",
    ]  # fmt: skip


def with_rule(problem: Problem, points: int) -> Problem:
    rule = gauss(points)
    objectives = tuple(replace(o, quadrature=rule) if o.integrand is not None else o for o in problem.objectives)
    return replace(problem, objectives=objectives)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "case", "errors"),
    [
        ("hybrid-spline", {}, {"energy": 1e-12, "jerk": 1e-13, "acceleration": 1e-13}),
        ("rotor-353", {}, {"effort": 1e-3, "jerk": 1e-12}),
        ("weld-bezier", {"case": "air-move"}, {"movement": 1e-13, "effort": 1e-3, "snap": 1e-13}),
    ],
)
def test_the_default_rule_has_the_error_it_states(name: str, case: dict[str, Any], errors: dict[str, float]) -> None:
    problem = problems.load(name, **case)
    usual, fine = with_rule(problem, len(GAUSS)), with_rule(problem, 40)
    for seed in range(3):
        x = problem.guess(np.random.default_rng(seed))
        a, b = evaluate_objectives(usual, x), evaluate_objectives(fine, x)
        for objective, error in errors.items():
            assert a[objective] == pytest.approx(b[objective], rel=error), objective


def test_the_papers_trapezoid_is_percents_off() -> None:
    problem = problems.load("hybrid-spline")
    assert next(o for o in problem.objectives if o.id == "energy").quadrature == TRAPEZOID
    x = np.array(problems.module("hybrid-spline").TABLE_7)
    share = evaluate_objectives(problem, x)["energy"] / evaluate_objectives(with_rule(problem, 40), x)["energy"]
    assert share == pytest.approx(2629.785 / 2695.441, rel=1e-6)  # along Table 7


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cubic", "quintic"])
def test_the_error_told_of_a_rule_is_what_it_is_off_by(kind: str) -> None:
    problem = problems.load("task", file=str(EXAMPLES / "ur5-via.toml"), **{"curve.kind": kind})
    for points in (2, 10):
        own = with_rule(problem, points)
        x = own.guess(np.random.default_rng(points))
        motion = motion_of(own, x)
        errors, values = quadrature_errors(own, motion), evaluate_objectives(own, x)
        tool = {"tool_path_length", "tool_speed_uniformity"}
        assert set(errors) == {"work", "energy", "effort", "acceleration", "jerk"} | tool
        exact = evaluate_objectives(with_rule(problem, 80), x)
        for name, error in errors.items():
            off, rounding = abs(values[name] - exact[name]), 1e-12 * exact[name]
            # Powers that change their sign within 0.1 W of a joint's are what the finest sum itself misses.
            assert off <= 3.0 * error + rounding, name
            assert error <= 10.0 * off + (1e-2 if name == "work" else 1e-6) * exact[name], name
    assert errors["jerk"] <= 1e-12 * values["jerk"]  # of degree that the rule is exact for


def test_a_papers_rule_is_told_to_be_off_and_so_is_a_sum_of_it() -> None:
    problem = problems.load("hybrid-spline")
    x = np.array(problems.module("hybrid-spline").TABLE_7)
    errors, values = quadrature_errors(problem, motion_of(problem, x)), evaluate_objectives(problem, x)
    assert errors["energy"] / values["energy"] == pytest.approx(2695.441 / 2629.785 - 1.0, rel=1e-3)
    terms = problem.objective("cost").terms or {}
    assert errors["cost"] == pytest.approx(sum(abs(f) * errors.get(name, 0.0) for name, f in terms.items()))
    assert "time" not in errors


def test_work_is_the_integral_of_the_sizes_of_powers_and_at_most_its_smoothing_more() -> None:
    problem = problems.load("task", file=str(EXAMPLES / "ur5-via.toml"))
    curve = motion_of(problem, problem.guess(np.random.default_rng(3))).curve
    robot, u = problem.robot, (np.arange(2000) + 0.5) / 2000
    body = pin.Inertia(3.0, np.array([0.0, 0.0, 0.05]), np.zeros((3, 3)))
    model = robot.model.copy()
    model.appendBodyToJoint(robot.tool_joint or model.njoints - 1, body, robot.tool)
    data, exact = model.createData(), 0.0
    for k, duration in enumerate(curve.durations):
        q, v, a = (curve.at(k, u, order) for order in range(3))
        power = np.array([pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)]) * v
        exact += float(duration * np.abs(power).sum(axis=1).mean())
    found = evaluate_objectives(problem, problem.guess(np.random.default_rng(3)))["work"]
    assert 0.0 < found - exact + 2e-3 * exact and found - exact < 6 * 0.1 * float(curve.duration) + 2e-3 * exact


def test_constants_are_of_integrands_and_one_a_segment() -> None:
    with pytest.raises(ProblemDefinitionError, match="constants are for an integrand"):
        Objective("a", "-", terms={"b": 1.0}, constants=np.zeros((3, 1)))
    problem = problems.load("hybrid-spline")
    wrong = Objective("a", "-", integrand=lambda s: s.c[0], constants=np.ones((2, 1)))
    with pytest.raises(ProblemDefinitionError, match="'a' has constants for 2 segments; the curve has 12"):
        evaluate_objectives(replace(problem, objectives=(*problem.objectives, wrong)), np.ones(problem.size))
    right = Objective("a", "-", integrand=lambda s: s.c[0], constants=np.arange(12.0)[:, None])
    values = evaluate_objectives(replace(problem, objectives=(*problem.objectives, right)), np.ones(problem.size))
    assert values["a"] == pytest.approx(66.0, rel=1e-12)  # sum of 0 .. 11, a second each
