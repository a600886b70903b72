"""What every registered problem must do; a new paper gets these tests with its line in the registry."""

import ast
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ocp_traj import problems
from ocp_traj.errors import InputError
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import GoalAttainment, WeightedSum
from ocp_traj.formulation.summary import Summary
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.verdicts import VIOLATED
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.transcription.instants import Instant, few_instants
from ocp_traj.transcription.shape import shape_of
from ocp_traj.transcription.symbolic import evaluate_objectives, objective_function, smooth_objectives, variations
from ocp_traj.transcription.transcription import transcribe
from tests.closed_form import Direct

# Cases other than the default one that must pass as well.
VARIANTS: dict[str, list[dict[str, Any]]] = {
    "hybrid-spline": [
        {"convention": "paper-literal"},
        {"via_points": "table6", "payload": 7.5, "weights": (1.0, 0.0, 0.5, 2.0)},
        {"free_payload": True, "min_interval": 0.3, "max_interval": 0.9},  # guesses must be cut off at both bounds
    ],
    "rotor-353": [
        {"as_printed": True, "jerk": (2100.0, 2100.0, 2200.0, 4300.0, 4500.0, 7200.0), "payload": 4.0},
        {"acceleration": (), "position_limits": False, "effort_limits": False},
        {"free_payload": True, "min_duration": 0.3, "max_duration": 1.1, "max_payload": 3.0},
        {"timing": "per_joint"},
    ],
    "wrist-obstacle": [
        {"case": "open", "branch": "1", "weights": (2.0, 0.5)},
        {"branch": "1", "obstacles": ((0.5, 0.5, 0.0, 0.4), (-0.3, 0.9, 0.6, 0.2)), "min_clearance": 0.01},
        {"effort_limits": True},
        {"obstacles": ()},
        {"obstacles": ((0.0, 2.2, 0.0, 0.3),)},  # out of the tip's reach but for its near side: a swept limit
    ],
    "weld-bezier": [{"case": "air-move"}, {"case": "air-move", "rest_at_tags": True, "as_printed": True}],
}
CASES = [(name, changes) for name in problems.names() for changes in ({}, *VARIANTS.get(name, ()))]
EPS = np.finfo(float).eps
MANY = 40  # variables


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[0]} {case[1] or ''}".strip())
def problem(request: pytest.FixtureRequest) -> Problem:
    name, changes = request.param
    return problems.load(name, **changes)


def guess(problem: Problem, seed: int = 0) -> np.ndarray:
    return problem.guess(np.random.default_rng(seed))


# --- variables ---


def test_guesses_lie_within_the_bounds_and_differ(problem: Problem) -> None:
    points = np.array([guess(problem, seed) for seed in range(100)])
    assert points.shape == (100, problem.size)
    assert (points >= problem.lower).all()
    assert (points <= problem.upper).all()
    assert len(np.unique(points, axis=0)) in (1, 100)  # one guess, or as many as there are seeds


def test_a_guess_depends_on_the_seed_alone(problem: Problem) -> None:
    again = problems.load(problem.id, **trajectory_of(problem, guess(problem)).case)
    for seed in range(5):
        assert_array_equal(guess(problem, seed), guess(problem, seed))
        assert_array_equal(guess(problem, seed), guess(again, seed))


def test_every_variable_has_a_label_a_unit_and_bounds_with_room(problem: Problem) -> None:
    assert len(set(problem.labels)) == len(problem.labels) == len(problem.units) == problem.size
    assert (problem.lower < problem.upper).all()
    assert np.isfinite([problem.lower, problem.upper]).all()


# --- what lists and reports need ---


@pytest.mark.parametrize("name", problems.names())
def test_a_summary_is_that_of_the_problem_as_it_is_built(name: str) -> None:
    assert problems.summary(name) == Summary.of(problems.load(name))


def test_the_problem_says_what_it_is(problem: Problem) -> None:
    assert problem.id in problems.names()
    assert problem.about.title and problem.about.reference and problem.about.curve_kind
    assert type(problem.case) is problems.case_class(problem.id)
    assert "Deviations" in (problems.module(problem.id).__doc__ or "")
    assert problem.default_objective in {o.id for o in problem.objectives}
    assert set(problem.reference_point) <= {o.id for o in problem.objectives}
    assert problem.robot is None or problem.robot.joints == problem.requirements.joints


def test_best_values_are_known_of_the_default_case_and_within_the_reference(problem: Problem) -> None:
    """Of a case that changes nothing but the choice of a branch as well, and of either case of the weld."""
    fields = {k: v for k, v in vars(problem.case).items() if k not in ("branch", "case")}
    default = all(v == getattr(problems.case_class(problem.id)(), k) for k, v in fields.items())
    known = default and getattr(problem.case, "case", "") != "open"
    assert set(problem.best_values) == (set(problem.reference_point) if known else set())
    for name, values in problem.best_values.items():
        assert set(values) == set(problem.reference_point) - {name}
        less = problem.objective(name).sense == "min"
        for value in values.values():
            assert value < problem.reference_point[name] if less else value > problem.reference_point[name]


def test_every_objective_has_a_unit_and_an_equation(problem: Problem) -> None:
    for objective in problem.objectives:
        assert objective.unit and objective.eq, objective.id


def test_every_limit_has_units_labels_an_equation_and_a_bound(problem: Problem) -> None:
    requirements = problem.requirements
    assert len(requirements.joint_units) == requirements.dof
    for limit in (*requirements.path_constraints, *requirements.point_constraints):
        rows = requirements.function(limit).numel_out(0)
        assert rows == len(limit.labels) == len(limit.units) == len(set(limit.labels)), limit.id
        assert all(limit.labels) and all(limit.units) and limit.eq, limit.id
    for limit in requirements.path_constraints:
        assert (np.isfinite(limit.lower) | np.isfinite(limit.upper)).all(), limit.id


def test_limits_are_smooth_so_that_the_audit_can_prove_them(problem: Problem) -> None:
    for limit in problem.requirements.path_constraints:
        Tape(problem.requirements.function(limit)).require_smooth(limit.id)  # raises where there is a kink


def test_a_problem_module_imports_no_solver_and_no_solver_a_problem_module() -> None:
    root = Path(__file__).parents[1]
    for folder, banned in (("problems", "ocp_traj.solvers"), ("solvers", "ocp_traj.problems")):
        for file in (root / folder).glob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
                if isinstance(node, ast.ImportFrom):
                    names = [f"{node.module}.{a.name}" for a in node.names]
                assert not any(name.startswith(banned) for name in names), file


# --- modules ---


def test_a_module_has_what_every_module_has(problem: Problem) -> None:
    module = problems.module(problem.id)
    assert module.Case is problems.case_class(problem.id)
    assert module.build().case == module.Case()
    assert module.robot(problem.case).joints == module.robot().joints == problem.requirements.joints
    assert_array_equal(module.via_points(), module.via_points(module.Case()))
    for name in ("Case", "build", "robot", "forward_kinematics", "inverse_kinematics", "via_points", "TABLE_n"):
        assert f"``{name}" in (problems.__doc__ or "")


def test_the_curve_passes_through_the_via_points_in_their_order(problem: Problem) -> None:
    points = problems.module(problem.id).via_points(problem.case)
    assert points.shape[1] == problem.requirements.dof
    curve = trajectory_of(problem, np.random.default_rng(7).uniform(problem.lower, problem.upper)).curve
    knots = iter([curve.at(0, 0.0)[0], *(curve.at(k, 1.0)[0] for k in range(curve.segments))])
    for point in points:
        held = ~np.isnan(point)
        assert held.any()
        assert any(np.abs(knot - point)[held].max() <= 1e-9 for knot in knots)  # goes on from the last one found
    first, last = curve.at(0, 0.0)[0], curve.at(curve.segments - 1, 1.0)[0]
    for point, end in ((points[0], first), (points[-1], last)):
        assert np.nanmax(np.abs(end - point)) <= 1e-9


def test_inverse_kinematics_undoes_forward_kinematics(problem: Problem) -> None:
    """One branch of a via point's pose is the via point, and all that exist have its pose."""
    module, q = problems.module(problem.id), problems.module(problem.id).via_points(problem.case)
    q = np.where(np.isnan(q), 0.3, q)
    rotation, position = module.forward_kinematics(q, problem.case)
    assert rotation.shape == (len(q), 3, 3) and position.shape == (len(q), 3)
    found = module.inverse_kinematics(rotation, position, problem.case)
    assert found.shape == (len(q), found.shape[1], q.shape[1])
    exists = ~np.isnan(found).any(axis=2)
    assert (exists == ~np.isnan(found).all(axis=2)).all()
    turns = np.array([2.0 * np.pi if unit == "rad" else np.inf for unit in problem.requirements.joint_units])
    away = np.abs(found - q[:, None])
    away = np.minimum(away, np.abs(away - turns))
    assert (np.where(exists, away.max(axis=2), np.inf).min(axis=1) <= 1e-9).all()
    for i, branch in np.argwhere(exists):
        again = module.forward_kinematics(found[i, branch][None], problem.case)
        assert_allclose(again[0][0], rotation[i], rtol=0, atol=1e-9)
        assert_allclose(again[1][0], position[i], rtol=0, atol=1e-9)


def test_a_pose_that_the_tool_does_not_reach_has_no_joint_coordinates(problem: Problem) -> None:
    module = problems.module(problem.id)
    found = module.inverse_kinematics(np.eye(3), [50.0, 0.0, 0.0], problem.case)  # [m]
    assert np.isnan(found).all()


def test_forward_kinematics_is_that_of_the_robot(problem: Problem) -> None:
    if problem.id == "rotor-353" and problem.case.as_printed:
        pytest.skip("Table 1 as printed is no arm's")
    module = problems.module(problem.id)
    q = np.random.default_rng(8).uniform(-0.5, 0.5, (5, problem.requirements.dof))
    robot = module.robot(problem.case)
    for ours, theirs in zip(module.forward_kinematics(q, problem.case), robot.poses(q), strict=True):
        assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", problems.names())
def test_tables_have_units(name: str) -> None:
    module = problems.module(name)
    tables = [value for key, value in vars(module).items() if re.fullmatch(r"TABLE_\d+", key)]
    assert tables or name == "wrist-obstacle"  # which has none
    for table in tables:
        if isinstance(table, dict):
            assert all(set(line) <= {o.id for o in module.build().objectives} for line in table.values())
        else:
            labels = [table.name or table.index[0]] if isinstance(table, pd.Series) else table.columns
            assert all(re.search(r"\[.+\]$", label) for label in labels) and np.isfinite(table.to_numpy()).all()


@pytest.mark.parametrize("name", problems.names())
def test_fields_of_a_case_say_what_they_may_be(name: str) -> None:
    """A choice among words, or numbers that are finite; a bound is met or the case refused."""
    Case = problems.case_class(name)
    for f in fields(Case):
        value = f.default
        if isinstance(value, bool) or value is None or f.name == "seam_file":
            continue
        if isinstance(value, tuple) and not value:
            bad: Any = (np.nan,) * f.metadata["size"]
        elif isinstance(value, tuple):
            bad = ((np.nan, *value[0][1:]),) if isinstance(value[0], tuple) else (np.nan, *value[1:])
        else:
            bad = "neither" if isinstance(value, str) else np.nan
        with pytest.raises(InputError, match=f.name.removesuffix("s")) as caught:
            Case(**{f.name: bad})
        assert "\n" not in str(caught.value)


def test_what_actuators_do_is_limited_under_one_name(problem: Problem) -> None:
    found = [c for c in problem.requirements.path_constraints if set(c.units) & {"N", "N m"}]
    assert [c.id for c in found] in ([], ["effort-limit"])


# --- objectives and limits ---


def test_objectives_agree_however_they_are_computed(problem: Problem) -> None:
    """The NLP's function, the population's tape, and the definition on numbers."""
    names = [o.id for o in problem.objectives]
    xs = np.array([guess(problem, seed) for seed in range(3)])
    tape = Population(problem, names).evaluate(xs).objectives
    for x, row in zip(xs, tape, strict=True):
        values = evaluate_objectives(problem, x)
        assert list(values) == names
        compiled = np.array(objective_function(problem)(x)).ravel()
        assert [values[name] for name in smooth_objectives(problem)] == compiled.tolist()
        assert_allclose(row, list(values.values()), rtol=1e-10)
    direct = Direct(problem, xs[0])
    assert_allclose(tape[0], [direct.objective(name) for name in names], rtol=1e-10)


def test_an_nlp_has_the_total_variation_from_node_to_node(problem: Problem) -> None:
    """Too small where the curve turns back between nodes; exact with its turning points among them."""
    found = variations(problem, [o.id for o in problem.objectives])
    if not found:
        pytest.skip("no objective is a total variation")
    for objective in found:
        short = 0
        for seed in range(3):
            x = guess(problem, seed)
            direct = Direct(problem, x)
            exact = direct.objective(objective.id)
            turning = [
                Instant(objective.id, k, u, (row,))
                for k in range(len(direct.segments))
                for row, instants in enumerate(direct.turning_points(objective, k))
                for u in instants
            ]
            for instants, complete in (((), False), (turning, True)):
                nlp = transcribe(problem, WeightedSum({objective.id: 1.0}), instants)
                value, rows = (np.array(v).ravel() for v in ca.Function("f", [nlp.x], [nlp.f, nlp.g])(nlp.start(x)))
                steps = [i for i, row in enumerate(nlp.rows) if row.limit == objective.id]
                assert steps and (rows[steps] >= nlp.lower_g[steps] - 1e-12).all()
                total = float(value[0]) * objective.scale
                assert total == pytest.approx(exact, rel=1e-10) if complete else total <= exact * (1 + 1e-12)
                short += total < exact * (1 - 1e-6)
        assert short  # else nothing is said of turning points


def test_violations_of_a_population_are_those_on_numbers(problem: Problem) -> None:
    x = guess(problem, 1)
    found = Population(problem, [problem.default_objective], 3).evaluate(x).violations[0]
    direct = Direct(problem, x)
    # Of a limit that is continuous at a knot both sides are one: looking at both does no harm.
    expected = [direct.excess(limit, (0.0, 0.5, 1.0)) for limit in problem.requirements.path_constraints]
    assert_allclose(found, np.concatenate(expected), rtol=1e-9, atol=1e-9)


def test_structural_point_constraints_hold_for_any_variables(problem: Problem) -> None:
    rng = np.random.default_rng(0)
    for point in problem.requirements.point_constraints:
        if point.structural:
            for x in (guess(problem), rng.uniform(problem.lower, problem.upper)):
                direct = Direct(problem, x)
                for i, (k, u) in enumerate(point.at):
                    value = direct.limit(point, k % len(direct.segments), u)
                    assert (value <= point.upper[i] + point.tolerance).all(), point.id
                    assert (value >= point.lower[i] - point.tolerance).all(), point.id


def test_promised_continuity_holds_for_any_variables(problem: Problem) -> None:
    rng = np.random.default_rng(1)
    for x in (guess(problem), rng.uniform(problem.lower, problem.upper)):
        curve = trajectory_of(problem, x).curve
        for order in range(problem.requirements.continuity + 1):
            size = np.abs(np.concatenate(curve.hull(order))).max()
            assert np.abs(curve.jump(order)).max(initial=0.0) <= 1e-9 * size


def _matches_central_differences(function: ca.Function, x: np.ndarray, scale: np.ndarray | float = 1.0) -> None:
    """Every column of the Jacobian, with Richardson's extrapolation of two steps: error O(step^4) and eps / step.

    Of many columns random sums stand for all. A row is a number of order one, less another, over ``scale``: rounding
    adds eps / scale to it.
    """
    symbol = ca.MX.sym("x", len(x))
    jacobian = np.array(ca.densify(ca.Function("J", [symbol], [ca.jacobian(function(symbol), symbol)])(x)))
    value = np.array(function(x)).ravel()
    step, n = 1e-4, len(x)
    for d in np.eye(n) if n <= MANY else np.random.default_rng(3).choice([-1.0, 1.0], (MANY // 2, n)):
        length = max(np.abs(d * x).max(), 0.1)
        slopes = []
        for width in (step * length, step * length / 2):
            slopes.append(np.array(function(x + width * d) - function(x - width * d)).ravel() / (2 * width))
        slope = (4 * slopes[1] - slopes[0]) / 3
        size = np.maximum(np.abs(jacobian).max(axis=1) + np.abs(value), 1e-3)  # rows are of order one; some vanish
        rounding = 64.0 * EPS / np.asarray(scale) / (step / 2 * length)
        assert (np.abs(jacobian @ d - slope) <= 1e-7 * size + rounding).all()


def test_gradients_of_the_objectives_match_central_differences(problem: Problem) -> None:
    _matches_central_differences(objective_function(problem), guess(problem, 2))


def test_jacobian_of_the_limits_matches_central_differences(problem: Problem) -> None:
    nlp = transcribe(problem, WeightedSum({problem.default_objective: 1.0}), few_instants(problem))
    scale = np.array([min(row.scale, 1.0) for row in nlp.rows])
    _matches_central_differences(ca.Function("g", [nlp.x], [nlp.g]), nlp.start(guess(problem, 2)), scale)


def _moving(problem: Problem) -> list[Instant]:
    """Instants that move with the variables, one for each limit on a derivative of the joints and for one other."""
    rng = np.random.default_rng(4)
    anchor = guess(problem, 3)
    found, others = [], 0
    for limit in problem.requirements.path_constraints:
        others += limit.order is None
        if limit.sweep or (limit.order is None and others > 1):
            continue
        segment = min(limit.segments or (0,))
        slope = 1e-3 * rng.normal(size=problem.size) / (1.0 + np.abs(anchor))
        slope[np.setdiff1d(np.arange(problem.size), shape_of(problem).columns[segment])] = 0.0
        found.append(Instant(limit.id, segment, 0.4, (len(limit.labels) - 1,), slope=slope, anchor=anchor))
    return found


def test_the_nlp_in_numbers_is_the_one_in_symbols(problem: Problem) -> None:
    """f, g and their derivatives put together from those of each instant, against CasADi's of the whole."""
    if problem.size > 100:
        pytest.skip("the derivatives of the whole in hundreds of variables: among the slow tests")
    _is_the_one_in_symbols(problem)


@pytest.mark.slow
def test_the_nlp_of_hundreds_of_variables_in_numbers_is_the_one_in_symbols() -> None:
    _is_the_one_in_symbols(problems.load("weld-bezier"))


def _is_the_one_in_symbols(problem: Problem) -> None:
    names = {objective.id: 1.0 for objective in problem.objectives}
    few = few_instants(problem)
    derivatives = tuple(limit.id for limit in problem.requirements.path_constraints if limit.order is not None)
    hull = few_instants(replace(problem, tuning=replace(problem.tuning, hull_rows=derivatives)))
    hull = [instant for instant in hull if instant.control is not None]
    instants = [*few[:: max(1, len(few) // 40)], *_moving(problem), *hull[:: max(1, len(hull) // 10)]]
    nlp = transcribe(problem, GoalAttainment(names, names), instants)
    rng = np.random.default_rng(3)
    x = nlp.start(guess(problem, 3))
    multipliers = rng.normal(size=len(nlp.rows))
    lam = ca.MX.sym("lam", len(nlp.rows))
    slopes = [ca.gradient(nlp.f, nlp.x), ca.jacobian(nlp.g, nlp.x)]
    bend = ca.triu(ca.hessian(0.7 * nlp.f + ca.dot(lam, nlp.g), nlp.x)[0])
    expected = ca.Function("whole", [nlp.x, lam], [nlp.f, nlp.g, *slopes, bend])(x, multipliers)
    program = nlp.program
    f, g = program.values(x)
    jacobian = ca.DM(program.jacobian_sparsity, program.jacobian(x))
    hessian = ca.DM(program.hessian_sparsity, program.hessian(x, 0.7, multipliers))
    for found, wanted in zip((f, g, program.gradient(x), jacobian, hessian), expected, strict=True):
        ours, theirs = np.array(ca.densify(ca.DM(found))), np.array(ca.densify(wanted))
        assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(float(np.abs(theirs).max()), 1.0))


# --- trajectories ---


def test_a_problem_is_rebuilt_from_what_its_trajectory_stores(problem: Problem) -> None:
    x = guess(problem, 3)
    stored = trajectory_of(problem, x)
    again = problems.load(stored.problem, **stored.case)
    assert again.case == problem.case
    assert_array_equal(np.concatenate([stored.variables[v.id] for v in again.variables]), x)
    rebuilt = trajectory_of(again, x)
    assert_array_equal(rebuilt.curve.durations, stored.curve.durations)
    for ours, theirs in zip(rebuilt.curve.control_points, stored.curve.control_points, strict=True):
        assert_array_equal(ours, theirs)
    assert rebuilt.parameters == stored.parameters
    assert evaluate_objectives(again, x) == evaluate_objectives(problem, x)


def test_a_trajectory_survives_its_file_bit_by_bit(problem: Problem, tmp_path: Path) -> None:
    one = trajectory_of(problem, guess(problem, 4))
    two = Trajectory.load(one.save(tmp_path / "trajectory.json"))
    assert two.to_dict() == one.to_dict()
    assert_array_equal(two.curve.durations, one.curve.durations)
    for ours, theirs in zip(two.curve.control_points, one.curve.control_points, strict=True):
        assert_array_equal(ours, theirs)
    again = problems.load(two.problem, **two.case)
    assert again.case == problem.case


def test_dilation_keeps_the_path_and_its_parameters(problem: Problem) -> None:
    if problem.dilate is None:
        pytest.skip("this problem does not dilate")
    x = guess(problem, 5)
    one, two = trajectory_of(problem, x), trajectory_of(problem, problem.dilate(x, 1.37))
    assert_allclose(two.curve.durations, 1.37 * one.curve.durations, rtol=4 * EPS)
    for ours, theirs in zip(two.curve.control_points, one.curve.control_points, strict=True):
        assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
    assert two.parameters == one.parameters
    assert_array_equal(problem.dilate(x, 1.0), x)


@pytest.mark.parametrize("share", [1.0, 0.05])
def test_the_audit_of_a_guess_encloses_what_direct_evaluation_finds(problem: Problem, share: float) -> None:
    """Of the guess itself, and of one in a twentieth of its time, which breaks limits."""
    x = guess(problem, 6)
    if share < 1.0:
        if problem.dilate is None:
            pytest.skip("this problem does not dilate")
        x = problem.dilate(x, share)
    rows = {(row.limit, row.label): row for row in trajectory_of(problem, x).audit().rows}
    direct, broken = Direct(problem, x), 0
    for limit in problem.requirements.path_constraints:
        excess = direct.excess(limit, (0.0, 0.4, 0.8))
        for label, worst in zip(limit.labels, excess, strict=True):
            assert -rows[limit.id, label].margin >= worst - 1e-9
            if worst > 1e-9:
                broken += 1
                assert rows[limit.id, label].verdict == VIOLATED
    assert broken > 0 or share == 1.0
