"""Rules of integrals: what the default leaves open, and what a paper's own rule does."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.objective import GAUSS, MIDPOINT, TRAPEZOID, Objective, gauss, rule_name
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.symbolic import evaluate_objectives


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
