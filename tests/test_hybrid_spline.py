"""Guo et al. (2016): its tables, and an independent computation with pinocchio and scipy."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from ocp_traj import problems
from ocp_traj.formulation.problem import Problem
from ocp_traj.problems import hybrid_robot
from ocp_traj.problems import hybrid_spline as paper
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.closed_form import clamped_spline
from tests.independent.check import broken, excesses
from tests.independent.hybrid import FORCE, TABLE_6
from tests.independent.robots import L01, L1, L2, L3, L4, L5, LINKS, G, HybridRobot, efforts

LAST_DIGIT = np.array([0.01, 0.01, 0.01, 0.001, 0.001])
TABLE_7 = np.array([0.330, 0.837, 0.803, 0.569, 0.477, 0.382, 0.348, 0.348, 0.392, 0.552, 0.732, 0.420])  # h [s]


@pytest.fixture(scope="module")
def literal() -> Problem:
    return problems.load("hybrid-spline", convention="paper-literal")


# --- kinematics ---


def test_via_points_are_table_6_to_its_printed_digits() -> None:
    """Half a unit of the last digit, but for row 2's X_S3: 325.1298 is cut off to 325.12, not rounded (one unit)."""
    ours = paper.via_points(paper.Guo2016()) * np.array([1e3, 1e3, 1e3, 1.0, 1.0])
    units = np.abs(ours - TABLE_6) / LAST_DIGIT
    assert units[1, 2] <= 1.0
    units[1, 2] = 0.0
    assert units.max() <= 0.5


def test_table_6_of_the_module_is_table_6() -> None:
    assert_allclose(np.array(paper.TABLE_6), TABLE_6, rtol=0, atol=0)
    printed = problems.load("hybrid-spline", via_points="table6").requirements.point_constraints[1].lower
    assert_allclose(printed * np.array([1e3, 1e3, 1e3, 1.0, 1.0]), TABLE_6, rtol=1e-15)


def test_row_6_as_printed_would_be_off_by_3_mm() -> None:
    ours = paper.via_points(paper.Guo2016())[4, 2] * 1e3
    assert ours - 223.38 == pytest.approx(3.0, abs=0.005)


@pytest.mark.slow
def test_inverse_kinematics_undoes_forward_kinematics() -> None:
    """FK(IK(p, a)) = (p, a) to rounding over 2 000 reachable poses, by the robot's own FK and by pinocchio's."""
    rng = np.random.default_rng(0)
    axis = rng.normal(size=(2000, 3))
    axis[:, 2] = np.abs(axis[:, 2])
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    position = rng.uniform([0.4, -0.25, 0.9], [1.2, 0.25, 1.3], size=(2000, 3))
    joints = hybrid_robot.joints_of(position, axis)
    q = ca.SX.sym("q", 5)
    pose = ca.Function("pose", [q], list(hybrid_robot.robot().tool_pose(q)))
    machine = HybridRobot()
    for p, a, found in zip(position, axis, joints, strict=True):
        for rotation, origin in ((np.array(part) for part in pose(found)), machine.tool_pose(found)):
            assert_allclose(np.ravel(origin), p, rtol=0, atol=1e-12)
            assert_allclose(rotation[:, 2], a, rtol=0, atol=1e-12)
        assert rotation[2, 0] <= 1e-12  # n_z <= 0: of the two turns about a, the paper's


def test_tool_axes_are_unit_vectors_normal_to_the_polygon_and_point_down() -> None:
    """Z0 points down, so a_z > 0; inside, the axis is normal to the secant between both neighbours."""
    position, axis = paper.task_points()
    assert_allclose(np.linalg.norm(axis, axis=1), 1.0, rtol=1e-14)
    assert (axis[:, 2] > 0.0).all()
    assert_allclose((axis[1:-1] * (position[2:] - position[:-2])).sum(axis=1), 0.0, atol=1e-14)
    assert_allclose(axis[:, 0] * 0.6, axis[:, 1] * 0.8, atol=1e-15)  # in the vertical plane of the path


def test_the_path_is_equation_156() -> None:
    position, _ = paper.task_points()
    x, y, z = position.T * 1e3
    assert_allclose([x[0], y[0], x[-1], y[-1]], [600.0, -150.0, 1000.0, 150.0])
    assert_allclose(z, (y - 100.0) ** 2 / 400.0 - x**2 / 6400.0 + 1100.0, rtol=1e-14)


def test_a_position_beyond_the_yaw_range_has_no_joint_coordinates() -> None:
    found = hybrid_robot.joints_of([[0.8, 0.35, 1.1], [0.8, 0.30, 1.1]], [[0.0, 0.0, 1.0]] * 2)
    assert np.isnan(found[0]).any() and np.isfinite(found[1]).all()  # 0.35 / L3 > sin 45 deg


# --- dynamics ---


@pytest.mark.parametrize("convention", paper.CONVENTIONS)
@pytest.mark.parametrize("payload", [0.0, 10.0])
def test_forces_equal_pinocchios_through_the_actuator_map(convention: str, payload: float) -> None:
    problem = problems.load("hybrid-spline", convention=convention, payload=payload)
    machine = HybridRobot(payload, literal=convention == "paper-literal")
    force = next(limit for limit in problem.requirements.path_constraints if limit.id == "effort-limit")
    function = problem.requirements.function(force)
    rng = np.random.default_rng(1)
    for _ in range(200):
        q, v, a = rng.uniform(-1.0, 1.0, 5), rng.normal(size=5), 3.0 * rng.normal(size=5)
        expected = machine.effort(q, v, a)
        found = np.array(function(np.concatenate([q, v, a, np.zeros(10)]), 0.0, [payload], [])).ravel()
        assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_two_conventions_differ_by_where_the_payload_pulls() -> None:
    """Where the tool's axis points straight down a weight and a force along it are one."""
    q = hybrid_robot.joints_of([0.8, 0.05, 1.1], [0.0, 0.0, 1.0])[0]
    heavy, literal = HybridRobot(10.0), HybridRobot(10.0, literal=True)
    zero = np.zeros(5)
    assert_allclose(heavy.effort(q, zero, zero), literal.effort(q, zero, zero), atol=1e-9)
    tilted = hybrid_robot.joints_of([0.8, 0.05, 1.1], [0.6, 0.0, 0.8])[0]
    assert np.abs(heavy.effort(tilted, zero, zero) - literal.effort(tilted, zero, zero)).max() > 10.0


# --- objectives ---


def test_cost_at_table_7_in_the_physical_convention(hybrid: Problem) -> None:
    found = evaluate_objectives(hybrid, TABLE_7)
    assert found["cost"] == pytest.approx(2.70598, abs=5e-6)
    assert found["time"] == pytest.approx(6.190, abs=1e-12)  # the sum of Table 7; the paper prints 6.189


def test_objectives_at_table_7_in_the_papers_convention(literal: Problem) -> None:
    """guo2016.md: z = 6.190, 3914.6, 1.0656, 0.1936, Fc 3.0914; half a unit of the last digit each."""
    found = evaluate_objectives(literal, TABLE_7)
    for name, value, half in (
        ("time", 6.190, 5e-4),
        ("energy", 3914.6, 5e-2),
        ("jerk", 1.0656, 5e-5),
        ("acceleration", 0.1936, 5e-5),
        ("cost", 3.0914, 5e-5),
    ):
        assert found[name] == pytest.approx(value, abs=half), name


def test_objectives_at_table_7_are_close_to_the_papers(literal: Problem) -> None:
    """Table 9: 6.189, 3921.602, 1.068, 0.194 and 3.093; h is printed to 0.5 ms, 0.15 % of the shortest interval.

    Jerk falls as the fifth power of time, so 0.75 % is what rounding h can do at most.
    """
    found = evaluate_objectives(literal, TABLE_7)
    for name, value in paper.TABLE_9["NSGA-II, best"].items():
        assert found[name] == pytest.approx(value, rel=7.5e-3), name


def recomputed(curve: CubicSpline, literal: bool) -> dict[str, float]:
    """z1 .. z4 of (113)-(116) with the trapezoid rule over the spline's knots."""
    t = curve.x
    q, v, a, jerk = (curve(t, order) for order in range(4))
    power = np.abs(efforts(HybridRobot(10.0, literal=literal), q, v, a) * v)
    energy = power.sum(axis=1) ** 2 if literal else (power**2).sum(axis=1)
    return {
        "time": float(t[-1] - t[0]),
        "energy": float(np.trapezoid(energy, t)),
        "jerk": float((np.diff(t)[:, None] * jerk[:-1] ** 2).sum()),
        "acceleration": float(np.trapezoid((a**2).sum(axis=1), t)),
    }


@pytest.mark.parametrize("convention", paper.CONVENTIONS)
@pytest.mark.parametrize("seed", range(5))
def test_objectives_equal_an_independent_computation(convention: str, seed: int) -> None:
    """scipy's CubicSpline, pinocchio's rnea and the trapezoid rule, at random intervals."""
    problem = problems.load("hybrid-spline", convention=convention)
    is_literal = convention == "paper-literal"
    h = problem.guess(np.random.default_rng(seed))
    via = problem.requirements.point_constraints[1].lower
    expected = recomputed(clamped_spline(via, h), is_literal)
    found = evaluate_objectives(problem, h)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-9), name
    weights = {"time": 0.3, "energy": 0.3 / 1000.0, "jerk": 0.2 / 10.0, "acceleration": 0.2}  # below (154)
    assert found["cost"] == pytest.approx(sum(w * expected[name] for name, w in weights.items()), rel=1e-9)


def test_weights_of_the_case_are_those_of_the_cost() -> None:
    problem = problems.load("hybrid-spline", weights=(1.0, 2.0, 3.0, 4.0))
    found = evaluate_objectives(problem, TABLE_7)
    expected = found["time"] + 2 * found["energy"] / 1e3 + 3 * found["jerk"] / 10 + 4 * found["acceleration"]
    assert found["cost"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("factor", [0.5, 1.3, 4.0])
def test_jerk_and_acceleration_scale_by_their_powers_of_time(hybrid: Problem, factor: float) -> None:
    """h -> s h: z1 ~ s, z3 ~ s^-5 and z4 ~ s^-3 exactly, z2 ~ s^-1 only where gravity rules: within 10 % here."""
    before, after = (evaluate_objectives(hybrid, s * TABLE_7) for s in (1.0, factor))
    assert after["time"] == pytest.approx(factor * before["time"], rel=1e-13)
    assert after["jerk"] == pytest.approx(before["jerk"] / factor**5, rel=1e-11)
    assert after["acceleration"] == pytest.approx(before["acceleration"] / factor**3, rel=1e-11)
    assert after["energy"] == pytest.approx(before["energy"] / factor, rel=0.1)


# --- curve, bounds, limits ---


def test_the_curve_is_scipys_clamped_spline_through_free_knots(hybrid: Problem) -> None:
    curve = trajectory_of(hybrid, TABLE_7).curve
    reference = clamped_spline(hybrid.requirements.point_constraints[1].lower, TABLE_7)
    t = np.linspace(0.0, curve.duration, 300)
    for order in range(3):
        expected = reference(t, order)
        assert_allclose(curve(t, order), expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_table_8s_extra_knots_follow_from_table_7(hybrid: Problem) -> None:
    """Table 8, corrected: row 2 X_S1 = 263.47 mm; row 12 X_S2 = 657.51 mm (cut off, not rounded), phi5 = 0.1997 rad."""
    points = trajectory_of(hybrid, TABLE_7).curve.control_points
    assert points[1][0, 0] * 1e3 == pytest.approx(263.47, abs=0.005)
    assert points[11][0, 1] * 1e3 == pytest.approx(657.51, abs=0.01)
    assert points[11][0, 4] == pytest.approx(0.1997, abs=5e-5)


def test_bounds_of_the_intervals_are_equation_152(hybrid: Problem) -> None:
    """An interval lasts at least its displacement at full speed; h1, h2, h11, h12 have none of their own."""
    step = np.abs(np.diff(paper.via_points(paper.Guo2016()), axis=0)) / np.array([0.25, 0.25, 0.25, 1.96, 1.96])
    assert_allclose(hybrid.lower[2:10], step.max(axis=1)[1:9], rtol=1e-14)
    assert_allclose(hybrid.lower[[0, 1, 10, 11]], 0.02)
    assert_allclose(hybrid.upper, 4.0)


def test_limits_are_table_2(hybrid: Problem) -> None:
    limits = {limit.id: limit for limit in hybrid.requirements.path_constraints}
    for name, bound in (
        ("velocity-limit", [0.25, 0.25, 0.25, 1.96, 1.96]),
        ("acceleration-limit", [5.0, 5.0, 5.0, 60.0, 60.0]),
        ("jerk-limit", [100.0, 100.0, 100.0, 1200.0, 1200.0]),
        ("effort-limit", FORCE),
    ):
        assert_allclose(limits[name].upper, bound, rtol=1e-15)
        assert_allclose(limits[name].lower, -np.array(bound), rtol=1e-15)
    assert_allclose(limits["position-limit"].upper, [1.0, 1.0, 0.5, np.pi, np.pi])
    assert_allclose(limits["position-limit"].lower, [0.0, 0.0, 0.0, -np.pi, -np.pi])
    assert (limits["yaw"].lower[0], limits["yaw"].upper[0]) == (-0.420, 0.420)  # |atan(x / L1)| <= 45 deg


def test_constants_of_the_module_are_table_1_and_table_4() -> None:
    assert (
        hybrid_robot.L1,
        hybrid_robot.L2,
        hybrid_robot.L3,
        hybrid_robot.L4,
        hybrid_robot.L5,
        hybrid_robot.L01,
        hybrid_robot.GRAVITY,
    ) == (L1, L2, L3, L4, L5, L01, G)
    assert hybrid_robot.LP == pytest.approx(-0.068137, abs=5e-7)
    for (mass, inertia, centre), (m, (xx, yy, zz, xy, xz, yz), c) in zip(hybrid_robot.TABLE_4, LINKS, strict=True):
        assert (mass, tuple(float(x) for x in centre)) == (m, c)
        assert inertia == ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


@pytest.mark.slow
def test_table_7_respects_every_limit_and_carries_11_88_kg() -> None:
    """Along Table 7 the largest payload is 11.88 kg: half a unit of the last digit either way."""
    for payload, carried in ((10.0, True), (11.875, True), (11.885, False)):
        problem = problems.load("hybrid-spline", payload=payload)
        assert bool(broken(excesses(trajectory_of(problem, TABLE_7).to_dict()))) != carried


# --- the freed payload ---


def test_a_freed_payload_is_the_last_variable_and_a_parameter_of_the_curve() -> None:
    problem = problems.load("hybrid-spline", free_payload=True, max_payload=30.0)
    assert problem.labels == (*(f"h{i}" for i in range(1, 13)), "payload")
    assert (problem.lower[-1], problem.upper[-1]) == (0.0, 30.0)
    x = np.append(TABLE_7, 7.0)
    found = evaluate_objectives(problem, x)
    fixed = evaluate_objectives(problems.load("hybrid-spline", payload=7.0), TABLE_7)
    assert found.pop("payload_mass") == 7.0
    assert found == pytest.approx(fixed, rel=1e-13)
    assert trajectory_of(problem, x).parameters == {"payload": 7.0}
    assert_allclose(problem.dilate(x, 2.0), [*(2.0 * TABLE_7), 7.0])  # type: ignore[misc]
