"""The NLP says what the problem says: rows and objectives against direct evaluation of the expressions on numbers."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, GoalAttainment, WeightedSum
from ocp_traj.results.trajectory import case_fields, trajectory_of
from ocp_traj.transcription.instants import Instant, few_instants, uniform_instants
from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.symbolic import SymbolicCurve, evaluate_objectives, quadrature, states_at
from ocp_traj.transcription.transcription import BACK_OFF, transcribe
from tests.closed_form import (
    Direct,
    Mixed,
    Quintic,
    mixed_problem,
    quintic_problem,
    septic_problem,
    stairs_problem,
    via_constraint,
)

TIME = WeightedSum({"time": 1.0})


def values(nlp: NLP, x: np.ndarray) -> tuple[float, np.ndarray]:
    f, g = ca.Function("values", [nlp.x], [nlp.f, nlp.g])(x)
    return float(f), np.array(g).ravel()


def guess(problem: Problem, seed: int = 0) -> np.ndarray:
    return problem.guess(np.random.default_rng(seed))


# --- states ---


def test_states_of_segments_of_different_degrees_come_in_the_order_asked_for() -> None:
    problem = mixed_problem()
    segments, u = [2, 0, 1, 0, 2], [0.3, 0.0, 1.0, 0.7, 1.0]
    x = ca.MX.sym("x", problem.size)
    states = states_at(SymbolicCurve.at(problem, x), segments, ca.DM(u))
    at = guess(problem)
    found = np.array(ca.Function("states", [x], [states])(at))
    curves = Direct(problem, at).segments
    for i, (k, local) in enumerate(zip(segments, u, strict=True)):
        t = local * curves[k].x[-1]
        expected = np.concatenate([curves[k].derivative(order)(t) if order else curves[k](t) for order in range(5)])
        assert_allclose(found[:, i], expected, rtol=1e-11, atol=1e-10 * np.abs(expected).max())


# --- rows of path limits ---


@pytest.mark.parametrize("make", [mixed_problem, quintic_problem, stairs_problem])
@pytest.mark.parametrize("seed", range(3))
def test_rows_are_the_limits_on_numbers_over_their_scale(make: type, seed: int) -> None:
    problem: Problem = make()
    nlp = transcribe(problem, TIME, uniform_instants(problem, 4))
    x = guess(problem, seed)
    f, g = values(nlp, x)
    direct = Direct(problem, x)
    assert f == pytest.approx(direct.objective("time") / problem.objective("time").scale, rel=1e-14)
    limits = {limit.id: limit for limit in problem.requirements.path_constraints}
    assert len(nlp.rows) == len(g) >= 7
    for row, value, low, high in zip(nlp.rows, g, nlp.lower_g, nlp.upper_g, strict=True):
        limit = limits[row.limit]
        i = limit.labels.index(row.label)
        expected = direct.limit(limit, row.segment, row.instant)[i]
        assert value * row.scale == pytest.approx(expected, rel=1e-10, abs=1e-10 * row.scale)
        assert (row.scale, row.unit) == (limit.scale[i], limit.units[i])
        assert low == limit.lower[i] / row.scale + BACK_OFF
        assert high == limit.upper[i] / row.scale - BACK_OFF


def test_a_limit_without_instants_has_no_rows() -> None:
    problem = mixed_problem()
    nlp = transcribe(problem, TIME, [Instant("smooth", 1, 0.5)])
    assert [(r.limit, r.segment, r.instant) for r in nlp.rows] == [("smooth", 1, 0.5)]


def test_an_instant_may_be_for_some_rows_of_its_limit_only() -> None:
    problem = mixed_problem()
    x = guess(problem)
    whole = transcribe(problem, TIME, [Instant("odd", 0, 0.4), Instant("odd", 2, 0.9)])
    some = transcribe(problem, TIME, [Instant("odd", 0, 0.4, (2,)), Instant("odd", 2, 0.9, (0, 1))])
    assert [row.label for row in some.rows] == ["three", "one", "two"]
    assert_array_equal(values(some, x)[1], values(whole, x)[1][[2, 3, 4]])
    assert_array_equal(some.upper_g, whole.upper_g[[2, 3, 4]])


@pytest.mark.parametrize(("moved", "expected"), [(0.1, 0.6), (-0.2, 0.3), (0.8, 1.0), (-0.9, 0.0)])
def test_a_moving_instant_follows_the_variables_and_stays_on_its_segment(moved: float, expected: float) -> None:
    """u(x) = clip(0.5 + s (x - x_0), 0, 1)."""
    problem = mixed_problem()
    anchor = guess(problem)
    slope = np.zeros(problem.size)
    slope[0] = 2.0
    nlp = transcribe(problem, TIME, [Instant("odd", 0, 0.5, None, slope, anchor)])
    x = anchor.copy()
    x[0] += moved / 2.0
    odd = problem.requirements.path_constraints[1]
    assert_allclose(values(nlp, x)[1] * odd.scale, Direct(problem, x).limit(odd, 0, expected), rtol=1e-9)


def test_the_back_off_tightens_both_sides() -> None:
    problem = quintic_problem()
    loose, tight = (transcribe(problem, TIME, uniform_instants(problem, 3), back_off=b) for b in (0.0, 0.1))
    assert_allclose(tight.lower_g, loose.lower_g + 0.1)
    assert_allclose(tight.upper_g, loose.upper_g - 0.1)


# --- grids ---


def test_few_instants_are_enough_for_the_degree_and_shared_at_smooth_knots(hybrid: Problem) -> None:
    """Cubic segments: jerk is constant (1 instant), acceleration linear (its 2 ends, one side of an inner knot)."""
    count = {
        limit.id: sum(i.limit == limit.id for i in few_instants(hybrid))
        for limit in hybrid.requirements.path_constraints
    }
    assert count["jerk-limit"] == 12
    assert count["acceleration-limit"] == 12 + 1
    assert count["velocity-limit"] == 12 * 2 + 1
    assert count["position-limit"] == 12 * 2 + 1
    assert count["effort-limit"] == 12 * 2 + 1


def test_uniform_instants_share_a_knot_only_where_the_limit_is_continuous() -> None:
    problem = mixed_problem()  # promises continuity of position only; "smooth" sees no more than that
    instants = uniform_instants(problem, 5)
    count = {limit: sum(i.limit == limit for i in instants) for limit in ("jerk-limit", "odd", "smooth")}
    assert count == {"jerk-limit": 15, "odd": 15, "smooth": 13}
    assert [(i.segment, i.u) for i in instants if i.limit == "smooth" and i.u in (0.0, 1.0)] == [
        (0, 0.0),
        (1, 0.0),
        (2, 0.0),
        (2, 1.0),
    ]


# --- other rows ---


def test_rows_at_rest_leave_the_hessian_and_no_others(hybrid: Problem) -> None:
    nlp = transcribe(hybrid, WeightedSum({"energy": 1.0}), few_instants(hybrid))
    x, rng = nlp.start(guess(hybrid)), np.random.default_rng(1)
    active = np.where(np.arange(len(nlp.rows)) % 5 == 0, rng.uniform(0.5, 1.0, len(nlp.rows)), 0.0)
    others = np.where(active == 0.0, rng.uniform(0.5, 1.0, len(nlp.rows)), 0.0)

    def hessian(factor: float, multipliers: np.ndarray) -> np.ndarray:
        return np.asarray(nlp.program.hessian(x, factor, multipliers))

    without, rest = hessian(1.0, active), hessian(0.0, others)
    size = np.abs(without).max()
    assert np.abs(rest).max() > 1e-3 * size
    assert_array_equal(hessian(1.0, active + 1e-9 * others), without)
    assert_allclose(hessian(1.0, active + 1e-6 * others), without + 1e-6 * rest, rtol=0, atol=1e-12 * size)


def test_a_point_constraint_has_rows_unless_it_is_structural() -> None:
    plain = septic_problem()
    for structural, rows in ((False, 1), (True, 0)):
        via = replace(via_constraint(0.3, 0.2), structural=structural)
        problem = replace(plain, requirements=replace(plain.requirements, point_constraints=(via,)))
        nlp = transcribe(problem, WeightedSum({"jerk": 1.0}), ())
        assert len(nlp.rows) == rows
        if rows:
            x = guess(problem)
            assert values(nlp, x)[1][0] == pytest.approx(Direct(problem, x).segments[0](0.3 * 1.3)[0], rel=1e-12)
            assert (nlp.lower_g[0], nlp.upper_g[0], nlp.rows[0].segment, nlp.rows[0].instant) == (0.2, 0.2, 0, 0.3)


def test_a_bounded_objective_is_a_row_of_its_own_unit_and_scale() -> None:
    problem = quintic_problem()
    nlp = transcribe(problem, EpsilonConstraint("time", {"effort": 5.0}), ())
    (row,) = nlp.rows
    assert (row.limit, row.unit, row.scale, row.segment) == ("effort", "rad2/s3", 10.0, -1)
    assert (nlp.lower_g[0], nlp.upper_g[0]) == (-np.inf, 0.5)
    assert values(nlp, np.array([2.0]))[1][0] == pytest.approx(Quintic().effort_constant / 8.0 / 10.0, rel=1e-13)


def test_goal_attainment_adds_a_free_variable_of_its_own() -> None:
    problem = quintic_problem()
    nlp = transcribe(problem, GoalAttainment({"time": 1.0}, {"time": 1.0}), few_instants(problem))
    assert nlp.labels == ("T", "gamma")
    assert nlp.units == ("s", "-")
    assert_array_equal(nlp.lower_x, [0.1, -np.inf])
    assert_array_equal(nlp.upper_x, [10.0, np.inf])


# --- objectives ---


@pytest.mark.parametrize("duration", [0.5, 1.0, 3.7])
def test_objectives_of_the_quintic_have_their_closed_form(duration: float) -> None:
    found = evaluate_objectives(quintic_problem(), [duration])
    effort = Quintic().effort_constant / duration**3
    assert found == pytest.approx(
        {"time": duration, "effort": effort, "speed": 1.0 / duration, "both": 0.5 * duration + 0.1 * effort}, rel=1e-13
    )


@pytest.mark.parametrize("seed", range(3))
def test_objectives_are_their_definitions_on_numbers(seed: int) -> None:
    """Both sides of a knot count where the integrand jumps, as that of "trapezoid" does."""
    problem = mixed_problem()
    x = guess(problem, seed)
    raised = replace(problem, curve=lambda x: problem.curve(x).elevate(5))
    direct = Direct(problem, x)
    for name in ("time", "rough", "trapezoid", "sum"):
        assert evaluate_objectives(problem, x)[name] == pytest.approx(direct.objective(name), rel=1e-11)
        assert evaluate_objectives(raised, x)[name] == pytest.approx(direct.objective(name), rel=1e-9)


def test_quadrature_nodes_are_shared_at_knots_where_the_integrand_is_continuous() -> None:
    problem = mixed_problem()
    nodes, weights = quadrature(problem, problem.objective("area"))
    assert nodes == [(0, 0.0), (1, 0.0), (2, 0.0), (2, 1.0)]
    assert_array_equal(weights.toarray(), 0.5 * np.array([[1, 0, 0], [1, 1, 0], [0, 1, 1], [0, 0, 1]]))
    nodes, weights = quadrature(problem, problem.objective("trapezoid"))
    assert len(nodes) == 6
    assert_array_equal(weights.sum(axis=0), [1.0, 1.0, 1.0])


# --- trajectories ---


def test_a_trajectory_is_the_curve_at_x_with_all_that_belongs_to_it() -> None:
    problem = mixed_problem(Mixed(rate=7.0, steps=(3.0,)))
    x = guess(problem)
    found = trajectory_of(problem, x)
    assert found.curve.degrees == (5, 3, 4)
    assert_array_equal(found.curve.durations, x[:3])
    for ours, reference in zip(found.curve.control_points, Direct(problem, x).segments, strict=True):
        assert_array_equal(ours, reference.c[:, 0, :])
    assert (found.problem, found.joints) == ("mixed", ("a", "b"))
    assert found.parameters == {"p": 7.0 * x[3]}
    assert_array_equal(np.concatenate(list(found.variables.values())), x)
    assert found.case == {"rate": 7.0, "steps": [3.0]}


def test_a_case_is_stored_as_what_differs_from_its_defaults() -> None:
    assert case_fields(mixed_problem()) == {}
    assert case_fields(mixed_problem(Mixed(steps=(5.0, 6.0)))) == {"steps": [5.0, 6.0]}
