"""What a problem is made of refuses what does not hang together, and says so; the registry likewise."""

from dataclasses import fields, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj import problems
from ocp_traj.errors import InputError, OcpTrajError, ProblemDefinitionError, UnknownName
from ocp_traj.formulation.objective import TRAPEZOID, Objective
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import (
    PathConstraint,
    PointConstraint,
    Requirements,
    State,
    derivative_order,
    state_function,
)
from ocp_traj.formulation.rows import Row
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.results.solution import Solution
from ocp_traj.transcription.nlp import NLP, Status
from tests.closed_form import quintic_problem, stairs_problem

JOINTS = ("a", "b")


def path(id: str = "limit", expression: Any = lambda s: s.v, **changes: Any) -> PathConstraint:
    given = {"lower": -1.0, "upper": 1.0, "units": ("m/s",) * 2, "labels": JOINTS} | changes
    return PathConstraint(id, expression, **given)


def point(id: str = "point", **changes: Any) -> PointConstraint:
    given = {"at": ((0, 0.0),), "lower": 0.0, "upper": 0.0, "units": ("m",) * 2, "labels": JOINTS} | changes
    return PointConstraint(id, lambda s: s.q, **given)


def requirements(*limits: PathConstraint, points: tuple[PointConstraint, ...] = (), **changes: Any) -> Requirements:
    return Requirements(JOINTS, ("m", "m"), limits, points, **changes)


# --- variables ---


def test_variable_bounds_become_arrays_and_may_be_equal() -> None:
    variable = Variable("T", 1.0, 1.0, "s", ("T",))  # type: ignore[arg-type]
    assert_array_equal(variable.lower, [1.0])


@pytest.mark.parametrize(
    ("lower", "upper", "message"),
    [
        ([0.0, 3.0], [1.0, 2.0], r"variable 'h': the bounds of h2 are empty, lower 3 > upper 2 s; widen them"),
        ([0.0, np.nan], [1.0, 2.0], "the bounds of h2 are empty"),
        ([0.0], [1.0, 2.0], r"bounds \(1,\) and \(2,\) for 2 labels"),
        ([0.0] * 3, [1.0] * 3, r"bounds \(3,\) and \(3,\) for 2 labels"),
    ],
)
def test_a_bad_variable_is_refused(lower: list[float], upper: list[float], message: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=message):
        Variable("h", np.array(lower), np.array(upper), "s", ("h1", "h2"))


# --- path constraints ---


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lower": [1.0, -1.0]}, "limit 'limit': the bounds of a are empty or equal, lower 1, upper 1"),
        ({"upper": [1.0, -2.0]}, "the bounds of b are empty or equal, lower -1, upper -2"),
        ({"upper": np.nan}, "the bounds of a are empty or equal"),
        ({"lower": [0.0] * 3}, "limit 'limit': lower does not fit its 2 labels"),
        ({"upper": [0.0] * 3}, "limit 'limit': upper does not fit its 2 labels"),
        ({"units": ("m",)}, "1 units for 2 labels; give one a row"),
        ({"order": 5}, r"order 5; allowed 0 \(position\) to 4 \(snap\)"),
        ({"order": -1}, "order -1"),
    ],
)
def test_a_bad_path_constraint_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=message):
        path(**changes)


@pytest.mark.parametrize(
    ("lower", "upper", "scale"),
    [
        ([-2.0, 0.0], [4.0, 1.0], [3.0, 0.5]),
        (-np.inf, [5.0, -3.0], [5.0, 3.0]),
        ([-7.0, 2.0], np.inf, [7.0, 2.0]),
        (-np.inf, [0.0, 3.0], [1.0, 3.0]),
        (-np.inf, np.inf, [1.0, 1.0]),
        ([-np.inf, -2.0], [5.0, 4.0], [5.0, 3.0]),
    ],
)
def test_scale_is_half_the_range_else_the_bounds_size_else_one(lower: Any, upper: Any, scale: list[float]) -> None:
    assert_array_equal(path(lower=np.array(lower), upper=np.array(upper)).scale, scale)


@pytest.mark.parametrize("order", range(5))
def test_a_limit_on_a_derivative_is_that_derivative(order: int) -> None:
    limit = PathConstraint.on_derivative("x", order, -1.0, 1.0, ("m",) * 2, JOINTS)
    assert limit.order == order
    function = requirements(limit).function(limit)
    state = np.arange(10.0)
    assert_array_equal(np.array(function(state, 0.3, [], [])).ravel(), state[2 * order : 2 * order + 2])
    assert requirements(limit).order(limit) == order


# --- point constraints ---


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"lower": [0.0] * 3}, r"point constraint 'point': lower does not fit \(instants, rows\) = \(1, 2\)"),
        ({"upper": np.zeros((2, 2))}, r"upper does not fit \(instants, rows\) = \(1, 2\)"),
        ({"lower": 1.0}, "a lower bound lies above its upper bound"),
        ({"lower": np.nan}, "the bound of a at segment 0, u = 0 is no number; give one"),
        ({"units": ("m",)}, "1 units for 2 labels"),
    ],
)
def test_a_bad_point_constraint_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=message):
        point(**changes)


def test_point_bounds_broadcast_over_instants() -> None:
    constraint = point(at=((0, 0.0), (-1, 1.0)), upper=[1.0, 2.0])
    assert_array_equal(constraint.upper, [[1.0, 2.0], [1.0, 2.0]])
    assert_array_equal(constraint.lower, np.zeros((2, 2)))


# --- objectives ---


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, "give exactly one of integrand, of_variables, terms"),
        (
            {"integrand": lambda s: s.v, "of_variables": lambda x, p: x[0], "quadrature": TRAPEZOID},
            "give exactly one of integrand, of_variables, terms",
        ),
        ({"terms": {"x": 1.0}, "quadrature": TRAPEZOID}, "a quadrature rule is for an integrand; leave it out"),
        ({"terms": {"x": 1.0}, "sense": "least"}, "sense 'least'; allowed 'min', 'max'"),
        ({"terms": {"x": 1.0}, "scale": 0.0}, "scale 0.0; it must be positive"),
        ({"terms": {"x": 1.0}, "scale": -1.0}, "scale -1.0; it must be positive"),
        ({"terms": {"x": 1.0}, "scale": np.inf}, "scale inf; it must be positive"),
        ({"terms": {"x": 1.0}, "scale": np.nan}, "scale nan; it must be positive"),
    ],
)
def test_a_bad_objective_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=f"objective 'f': {message}"):
        Objective("f", "s", **changes)


# --- requirements ---


def test_limit_ids_are_unique_over_path_and_point_constraints() -> None:
    with pytest.raises(ProblemDefinitionError, match="limit id 'x' is used 2 times"):
        requirements(path("x"), path("x"))
    with pytest.raises(ProblemDefinitionError, match="limit id 'x' is used 2 times"):
        requirements(path("x"), points=(point("x"),))


def test_an_expression_needs_as_many_rows_as_labels() -> None:
    with pytest.raises(ProblemDefinitionError, match="limit 'x': its expression has 1 rows for 2 labels"):
        requirements(path("x", lambda s: s.v[0]))


@pytest.mark.parametrize("id", ["x", "u", "tool speed", "2nd limit", "a__b", "\N{GREEK SMALL LETTER TAU}"])
def test_any_text_may_be_the_id_of_a_limit(id: str) -> None:
    limit = path(id)
    assert_array_equal(np.array(requirements(limit).function(limit)(np.arange(10.0), 0.0, [], [])).ravel(), [2.0, 3.0])


def test_a_failing_expression_names_its_limit() -> None:
    with pytest.raises(ProblemDefinitionError, match="x: its expression failed on a symbolic state: .*nonsense"):
        requirements(path("x", lambda s: s.nonsense))


@pytest.mark.parametrize(
    ("expression", "order"),
    [
        (lambda s: s.q + s.u, 0),
        (lambda s: s.q * s.jerk, 3),
        (lambda s: s.snap, 4),
        (lambda s: ca.vertcat(s.u, s.p), -1),
    ],
)
def test_order_is_the_highest_derivative_in_the_expression(expression: Any, order: int) -> None:
    assert derivative_order(state_function("x", expression, 2, 1), 2) == order


@pytest.mark.parametrize(
    ("limit", "continuous"),
    [
        (path(), True),
        (path(expression=lambda s: s.a), True),
        (path(expression=lambda s: s.jerk), False),
        (path(expression=lambda s: s.v + s.u), False),
        (path(expression=lambda s: s.v + s.c, constants=np.zeros((3, 1))), False),
    ],
)
def test_a_limit_is_continuous_at_knots_if_it_sees_only_what_is(limit: PathConstraint, continuous: bool) -> None:
    assert requirements(limit, continuity=2).continuous(limit) is continuous
    assert not requirements(limit).continuous(limit)  # nothing promised


def test_state_function_passes_every_part_of_the_state() -> None:
    function = state_function("all", lambda s: ca.vertcat(*s[:-1]), 2, 1, 3)
    numbers = [np.arange(10.0), 0.5, [20.0], [31.0, 32.0, 33.0]]
    assert_array_equal(np.array(function(*numbers)).ravel(), [*range(10), 0.5, 20.0, 31.0, 32.0, 33.0])
    assert State._fields == ("q", "v", "a", "jerk", "snap", "u", "p", "c", "s")
    swept = state_function("all", lambda s: ca.vertcat(*s), 2, 1, 3, sweep=True)
    numbers[1] = [0.5, 0.25]
    assert_array_equal(np.array(swept(*numbers)).ravel(), [*range(10), 0.5, 20.0, 31.0, 32.0, 33.0, 0.25])


# --- problem ---


def test_an_objective_may_not_share_the_id_of_a_limit() -> None:
    """In a prototype such an objective silently replaced the limit."""
    with pytest.raises(ProblemDefinitionError, match="the id 'time' is used more than once"):
        quintic_problem(velocity_limit="time")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"default_objective": "cost"}, "default objective 'cost' is not one of"),
        (
            {"objectives": (Objective("f", "s", terms={"g": 1.0}),), "default_objective": "f"},
            "objective 'f' sums 'g', which is no plain objective",
        ),
        (
            {"objectives": (Objective("f", "s", terms={"f": 1.0}),), "default_objective": "f"},
            "objective 'f' sums 'f', which is no plain objective",
        ),
        ({"objectives": (), "default_objective": ""}, "there is no objective"),
        ({"tuning": Tuning(warm_start_objective="cost")}, "warm start objective 'cost' is not one of"),
        ({"tuning": Tuning(regularisation={"cost": 1.0})}, "objective of the regularisation 'cost' is not one of"),
        ({"requirements": Requirements(JOINTS, ("m", "m"), ())}, "the curve has 1 joints, the limits 2"),
    ],
)
def test_a_bad_problem_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=message):
        replace(quintic_problem(), **changes)


@pytest.mark.parametrize("name", ["starts", "max_exchanges"])
def test_tuning_without_a_solve_is_refused(name: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=f"tuning: {name} is 0; give 1 or more"):
        Tuning(**{name: 0})


def test_six_fields_state_a_problem_and_twenty_two_are_all() -> None:
    assert len(fields(Problem)) <= 22
    given = {f.name: getattr(quintic_problem(), f.name) for f in fields(Problem)[:6]}
    assert Problem(**given).default_objective == "time"  # the first


def test_an_unknown_objective_is_named_with_those_there_are() -> None:
    with pytest.raises(UnknownName, match="quintic has no objective 'cost'; objectives are time, effort, speed, both"):
        quintic_problem().objective("cost")


def test_blocks_of_variables_line_up_with_their_bounds_labels_and_units() -> None:
    problem = replace(
        stairs_problem(),
        variables=(
            Variable("first", np.array([0.5]), np.array([6.0]), "s", ("T1",)),
            Variable("second", np.array([0.6]), np.array([7.0]), "ks", ("T2",)),
        ),
    )
    assert problem.size == 2
    assert_array_equal(problem.lower, [0.5, 0.6])
    assert_array_equal(problem.upper, [6.0, 7.0])
    assert (problem.labels, problem.units) == (("T1", "T2"), ("s", "ks"))
    blocks = problem.unpack([1.0, 2.0])
    assert {name: block.tolist() for name, block in blocks.items()} == {"first": [1.0], "second": [2.0]}


# --- NLP and Solution ---


def test_an_nlp_checks_its_shapes() -> None:
    x = ca.MX.sym("x", 2)
    given: dict[str, Any] = {
        "name": "n", "x": x, "f": x[0], "g": x[:1], "lower_x": np.zeros(2), "upper_x": np.ones(2),
        "lower_g": np.zeros(1), "upper_g": np.ones(1), "rows": (Row("r", ""),), "labels": ("a", "b"),
        "units": ("m", "m"),
    }  # fmt: skip
    assert NLP.symbolic(**given).rows[0].limit == "r"
    for field, value, message in (
        ("lower_x", np.zeros(3), r"n: a bound on x has shape \(3,\), expected \(2,\)"),
        ("upper_x", np.zeros(1), r"a bound on x has shape \(1,\), expected \(2,\)"),
        ("lower_g", np.zeros(2), r"a bound on g has shape \(2,\), expected \(1,\)"),
        ("upper_g", np.zeros(0), r"a bound on g has shape \(0,\), expected \(1,\)"),
        ("rows", (), "0 row names for 1 rows"),
        ("labels", ("a",), "1 labels for 2 variables"),
    ):
        with pytest.raises(ProblemDefinitionError, match=message):
            NLP.symbolic(**given | {field: value})


def test_violation_is_the_largest_excess_and_never_hides_nan() -> None:
    x = ca.MX.sym("x", 2)
    nlp = NLP.symbolic(
        "n", x, x[0], x[:1], lower_x=np.array([0.0, -np.inf]), upper_x=np.array([1.0, np.inf]), lower_g=np.zeros(1),
        upper_g=np.array([np.inf]), rows=(Row("r", ""),), labels=("a", "b"), units=("", ""),
    )  # fmt: skip
    assert nlp.violation(np.array([0.5, 9.0]), np.array([3.0])) == 0.0
    assert nlp.violation(np.array([1.25, 0.0]), np.array([0.0])) == 0.25
    assert nlp.violation(np.array([-2.0, 0.0]), np.array([-3.0])) == 3.0
    assert nlp.violation(np.array([0.5, 0.0]), np.array([np.nan])) == np.inf
    assert nlp.violation(np.array([np.nan, 0.0]), np.array([0.5])) == np.inf


@pytest.mark.parametrize("status", Status)
def test_require_lets_only_usable_solutions_through(status: Status) -> None:
    solution = Solution("p", np.zeros(1), 1.0, status, 0.0, 3, 0.1, detail="said the solver")
    usable = {Status.SOLVED, Status.ACCEPTABLE, Status.FEASIBLE}
    assert solution.ok is (status in usable)
    if solution.ok:
        assert solution.require() is solution
    else:
        local = "the one start found no trajectory; the nearest misses its limits by 0 of their scale"
        other = f"{status.value} after 3 iterations.*said the solver"
        with pytest.raises(OcpTrajError, match=f"p: {local if status is Status.LOCALLY_INFEASIBLE else other}"):
            solution.require()


# --- registry ---


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"speed": 1.0}, UnknownName, "hybrid-spline has no case field 'speed'; fields are payload, convention"),
        ({"payload": "heavy"}, InputError, "payload is 'heavy'; give a number, such as 10.0"),
        ({"payload": None}, InputError, "payload is None; give a number"),
        ({"payload": -1.0}, InputError, "payload is -1.0 kg; give a finite mass, zero or more"),
        ({"payload": "nan"}, InputError, "payload is nan kg; give a finite mass"),
        ({"payload": float("inf")}, InputError, "payload is inf kg; give a finite mass"),
        ({"convention": "metric"}, InputError, "convention is 'metric'; allowed are physical, paper-literal"),
        ({"via_points": "table7"}, InputError, "via_points is 'table7'; allowed are rederived, table6"),
        ({"weights": (1.0, 2.0)}, InputError, r"weights is \(1.0, 2.0\); give 4 numbers, such as 0.3,0.3,0.2,0.2"),
        ({"weights": "a,b,c,d"}, InputError, "weights is 'a,b,c,d'; give 4 numbers"),
        ({"weights": 3.0}, InputError, "weights is 3.0; give 4 numbers"),
        ({"weights": (0, 0, 0, 0)}, InputError, "4 finite numbers, zero or more and not all zero"),
        ({"weights": (1, 1, 1, -1)}, InputError, "4 finite numbers, zero or more and not all zero"),
        ({"min_interval": 5.0}, InputError, "min_interval 5.0 s and max_interval 4.0 s leave nothing between"),
        ({"min_interval": 0.0}, InputError, "min_interval is 0.0 s; give a finite number above zero"),
        ({"max_interval": float("inf")}, InputError, "max_interval is inf s; give a finite number"),
        ({"max_interval": 0.1}, ProblemDefinitionError, "variable 'h': the bounds of h3 are empty"),
        ({"free_payload": "perhaps"}, InputError, "free_payload is 'perhaps'; give true or false"),
        ({"max_payload": 0.0}, InputError, "max_payload is 0.0 kg; give a finite mass above zero"),
    ],
)  # fmt: skip
def test_a_bad_case_of_hybrid_spline_is_refused(changes: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        problems.load("hybrid-spline", **changes)


def test_case_fields_are_converted_from_what_a_command_line_or_a_file_holds() -> None:
    problem = problems.load("hybrid-spline", payload="8", weights="1,2,3,4", free_payload="False", max_interval=3)
    assert problem.case.payload == 8.0
    assert problem.case.weights == (1.0, 2.0, 3.0, 4.0)
    assert problem.case.free_payload is False
    assert isinstance(problem.case.max_interval, float)
    assert problems.load("hybrid-spline", weights=[1, 0, 0, 0]).case.weights == (1.0, 0.0, 0.0, 0.0)
    assert problems.load("hybrid-spline", free_payload="true").case.free_payload is True


@pytest.mark.parametrize("ask", [problems.load, problems.module, problems.case_class])
def test_an_unknown_problem_is_named_with_those_there_are(ask: Any) -> None:
    with pytest.raises(UnknownName, match="there is no problem 'rotor'; problems are .*hybrid-spline"):
        ask("rotor")
