"""Scalarisations on a front with a closed form: effort = c / T^3 along one variable T."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq

from ocp_traj.errors import InputError, ProblemDefinitionError, UnknownName
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import (
    EpsilonConstraint,
    GoalAttainment,
    Scalarisation,
    Scalarised,
    WeightedSum,
    check_names,
)
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import uniform_instants
from ocp_traj.transcription.transcription import transcribe
from tests.closed_form import Quintic, quintic_problem

CASE = Quintic()
PROBLEM = quintic_problem(CASE)
C = CASE.effort_constant
TIME_SCALE, EFFORT_SCALE, SPEED_SCALE = (PROBLEM.objective(name).scale for name in ("time", "effort", "speed"))


def solved(scalarisation: Scalarisation) -> Solution:
    nlp = transcribe(PROBLEM, scalarisation, uniform_instants(PROBLEM, 9))
    solution = Ipopt().solve(nlp, np.full(nlp.x.numel(), 3.0)).require()
    # Feasibility first: the limits hold if and only if T >= T_least; 9 instants miss the acceleration's peak by < 5 %.
    assert solution.x[0] >= 0.97 * CASE.least_time
    return solution


# --- weighted sum ---


@pytest.mark.parametrize("weights", [(1.0, 1.5), (0.2, 1.0), (2.0, 1.2)])
def test_weighted_sum_reaches_the_point_where_the_front_has_its_slope(weights: tuple[float, float]) -> None:
    """d/dT [w1 T/s1 + w2 c/(s2 T^3)] = 0 at T^4 = 3 w2 c s1 / (w1 s2)."""
    first, second = weights
    expected = (3 * second * C * TIME_SCALE / (first * EFFORT_SCALE)) ** 0.25
    assert expected > CASE.least_time
    solution = solved(WeightedSum({"time": first, "effort": second}))
    assert solution.x[0] == pytest.approx(expected, rel=1e-6)
    value = first * expected / TIME_SCALE + second * C / expected**3 / EFFORT_SCALE
    assert solution.f == pytest.approx(value, rel=1e-8)


def test_weights_of_zero_leave_their_objectives_out() -> None:
    scalar = WeightedSum({"time": 0.0, "effort": 1.0})
    assert scalar.names == ("effort",)
    # Off its bound by IPOPT's tolerance over the slope, which falls with T^-4.
    assert solved(scalar).x[0] == pytest.approx(PROBLEM.upper[0], rel=1e-5)


def test_an_objective_to_be_maximised_is_maximised() -> None:
    """Mean speed D/T is largest at the least time."""
    fastest = solved(WeightedSum({"time": 1.0}))
    solution = solved(WeightedSum({"speed": 1.0}))
    assert solution.x[0] == pytest.approx(fastest.x[0], rel=1e-6)
    assert solution.f == pytest.approx(-CASE.distance / fastest.x[0] / SPEED_SCALE, rel=1e-6)


def test_a_sum_of_terms_is_what_its_factors_say() -> None:
    """0.5 T + 0.1 c / T^3 is the weighted sum with weights 1, 1 and scales 2, 10."""
    one, other = solved(WeightedSum({"both": 1.0})), solved(WeightedSum({"time": 1.0, "effort": 1.0}))
    assert one.f == pytest.approx(other.f, rel=1e-9)


# --- epsilon-constraint ---


@pytest.mark.parametrize(
    ("minimise", "bounds", "expected"),
    [
        ("effort", {"time": 2.0}, 2.0),
        ("time", {"effort": 5.0}, (C / 5.0) ** (1 / 3)),
        ("effort", {"speed": 0.4}, CASE.distance / 0.4),  # at least 0.4 rad/s
        ("speed", {"effort": 5.0}, (C / 5.0) ** (1 / 3)),  # as fast as that effort allows
        ("effort", {"time": 4.0, "speed": 0.4}, 2.5),
        ("effort", {"time": 2.0, "speed": 0.4}, 2.0),
    ],
)
def test_epsilon_constraint_ends_on_its_tightest_bound(
    minimise: str, bounds: dict[str, float], expected: float
) -> None:
    solution = solved(EpsilonConstraint(minimise, bounds))
    assert solution.x[0] == pytest.approx(expected, rel=1e-7)
    for row, slack in solution.slacks.items():
        if row.limit in bounds:
            assert slack >= -1e-9  # scaled


def test_augmentation_adds_a_trace_of_the_bounded_objectives() -> None:
    plain, augmented = (solved(EpsilonConstraint("time", {"effort": 5.0}, augmentation=a)) for a in (0.0, 1e-3))
    assert augmented.f - plain.f == pytest.approx(1e-3 * 5.0 / EFFORT_SCALE, rel=1e-3)


# --- goal attainment ---


@pytest.mark.parametrize(
    ("goals", "weights"),
    [((1.5, 2.0), (1.0, 1.0)), ((1.0, 0.5), (0.5, 3.0)), ((3.0, 9.0), (1.0, 2.0))],
)
def test_goal_attainment_exceeds_every_goal_by_gamma_times_its_weight(
    goals: tuple[float, float], weights: tuple[float, float]
) -> None:
    """(T - g1)/w1 = (c/T^3 - g2)/w2 = gamma; below zero where the goals are surpassed."""
    expected = brentq(lambda t: (t - goals[0]) / weights[0] - (C / t**3 - goals[1]) / weights[1], 0.5, 9.0)
    assert expected > CASE.least_time
    names = ("time", "effort")
    solution = solved(GoalAttainment(dict(zip(names, goals, strict=True)), dict(zip(names, weights, strict=True))))
    assert solution.x[0] == pytest.approx(expected, rel=1e-7)
    assert solution.x[1] == solution.f == pytest.approx((expected - goals[0]) / weights[0], rel=1e-6)


def test_goal_of_an_objective_to_be_maximised_is_a_lower_bound() -> None:
    """D/T + w gamma >= goal and c/T^3 - gamma <= 2."""
    goal, weight = 0.8, 0.1
    expected = brentq(lambda t: (goal - CASE.distance / t) / weight - (C / t**3 - 2.0), 0.5, 9.0)
    solution = solved(GoalAttainment({"speed": goal, "effort": 2.0}, {"speed": weight, "effort": 1.0}))
    assert solution.x[0] == pytest.approx(expected, rel=1e-7)


def test_a_goal_of_weight_zero_is_a_hard_bound() -> None:
    solution = solved(GoalAttainment({"time": 2.0, "effort": 0.0}, {"time": 0.0, "effort": 1.0}))
    assert solution.x[0] == pytest.approx(2.0, rel=1e-7)
    assert solution.f == pytest.approx(C / 8.0, rel=1e-7)


def test_goal_attainment_keeps_its_bounds_beside_its_goals() -> None:
    """Both goals are met best at T = 3 s; at most 2 s are allowed, so the effort's goal is missed by c/8 - goal."""
    goals = {"time": 3.0, "effort": C / 27.0}
    solution = solved(GoalAttainment(goals, {"time": 1.0, "effort": 1.0}, {"time": 2.0}))
    assert solution.x[0] == pytest.approx(2.0, rel=1e-7)
    assert solution.f == pytest.approx(C / 8.0 - C / 27.0, rel=1e-7)


# --- what is built ---


def test_rows_are_scaled_and_signed_so_that_less_is_better() -> None:
    values = {"time": ca.MX(3.0), "speed": ca.MX(0.25)}
    scalar = EpsilonConstraint("time", {"speed": 0.4}).apply(PROBLEM, values)
    ((name, value, bound),) = scalar.rows
    assert (name, float(ca.evalf(value)), bound) == ("speed", -0.25 / SPEED_SCALE, -0.4 / SPEED_SCALE)
    assert float(ca.evalf(scalar.f)) == 3.0 / TIME_SCALE
    assert scalar.extra is None


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: WeightedSum({}), "at least one positive weight"),
        (lambda: WeightedSum({"time": 0.0}), "at least one positive weight; got {'time': 0.0}"),
        (lambda: WeightedSum({"time": -1.0}), "the weight of 'time' is -1.0; give a finite number, zero or more"),
        (lambda: WeightedSum({"time": np.nan}), "the weight of 'time' is nan"),
        (lambda: WeightedSum({"time": np.inf}), "the weight of 'time' is inf"),
        (lambda: EpsilonConstraint("time", {"time": 1.0}), "'time' is minimised; bound the other objectives"),
        (lambda: EpsilonConstraint("time", {"effort": np.nan}), "the bound of 'effort' is nan; give a finite number"),
        (lambda: EpsilonConstraint("time", {"effort": np.inf}), "the bound of 'effort' is inf"),
        (
            lambda: GoalAttainment({"time": 1.0}, {"effort": 1.0}),
            r"a goal and a weight for each objective; got \['time'\] and \['effort'\]",
        ),
        (lambda: GoalAttainment({"time": np.nan}, {"time": 1.0}), "the goal of 'time' is nan"),
        (lambda: GoalAttainment({"time": 1.0}, {"time": -1.0}), "the weight of 'time' is -1.0"),
        (lambda: GoalAttainment({"time": 1.0}, {"time": 0.0}), "at least one positive weight"),
        (lambda: GoalAttainment({}, {}), "at least one positive weight"),
    ],
)
def test_a_bad_scalarisation_is_refused(build: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        build()


@pytest.mark.parametrize(
    "scalarisation",
    [
        WeightedSum({"time": 1.0, "cost": 1.0}),
        WeightedSum({"time": 1.0, "cost": 0.0}),
        EpsilonConstraint("cost", {"time": 1.0}),
        EpsilonConstraint("time", {"cost": 1.0}),
        GoalAttainment({"cost": 1.0}, {"cost": 1.0}),
    ],
    ids=repr,
)
def test_an_unknown_objective_is_refused_whatever_its_weight(scalarisation: Scalarisation) -> None:
    message = "quintic has no objective 'cost'; objectives are time, effort, speed, both"
    with pytest.raises(UnknownName, match=message):
        check_names(PROBLEM, scalarisation)
    with pytest.raises(UnknownName, match=message):
        transcribe(PROBLEM, scalarisation, ())


class Squared:
    """The square of the time, which no scalarisation may be."""

    names = ("time",)

    def apply(self, problem: Problem, values: Mapping[str, Any]) -> Scalarised:
        return Scalarised(values["time"] ** 2)


def test_a_scalarisation_that_is_not_linear_is_refused() -> None:
    with pytest.raises(ProblemDefinitionError, match="Squared is not linear in the objectives' values; state it by"):
        transcribe(PROBLEM, Squared(), ())
