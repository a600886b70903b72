"""Zhu and Wang: its curve, limits, robot and kinematics, against computations that share nothing with the package."""

import json
from collections.abc import Iterator
from math import pi

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import ocp_traj as ot
from ocp_traj import problems
from ocp_traj.cli.commands import run
from ocp_traj.curves.families import polynomial_353
from ocp_traj.errors import InputError, ProblemDefinitionError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.problems import m10id
from ocp_traj.problems import rotor_353 as paper
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.robot.robot import Robot
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.independent.check import broken, excesses
from tests.independent.robots import RotorRobot, efforts
from tests.independent.rotor import SPEED, TABLE_2, via_points

JERK = (2100.0, 2100.0, 2200.0, 4300.0, 4500.0, 7200.0)  # [deg/s3], 10 v_max per second^2: for these tests
PURE = {"position_limits": False, "effort_limits": False}  # (14) and (15) alone, as in the paper


# --- the curve, by the paper's linear system ---


def system(t: np.ndarray) -> np.ndarray:
    """The matrices ``(N, 14, 14)`` of the conditions on a10..a13, a20..a25, a30..a33, at durations ``(N, 3)``."""
    matrices = np.zeros((len(t), 14, 14))

    def row(i: int, k: int, order: int, time: np.ndarray | float, sign: float = 1.0) -> None:
        first, count = ((0, 4), (4, 6), (10, 4))[k]
        for power in range(order, count):
            factor = float(np.prod(np.arange(power - order + 1, power + 1)))
            matrices[:, i, first + power] += sign * factor * np.asarray(time, dtype=float) ** (power - order)

    for order in range(3):
        row(order, 0, order, 0.0)
        row(3 + order, 2, order, t[:, 2])
    row(6, 0, 0, t[:, 0])
    row(7, 1, 0, 0.0)
    row(8, 1, 0, t[:, 1])
    row(9, 2, 0, 0.0)
    for order in (1, 2):
        row(9 + order, 0, order, t[:, 0])
        row(9 + order, 1, order, 0.0, -1.0)
        row(11 + order, 1, order, t[:, 1])
        row(11 + order, 2, order, 0.0, -1.0)
    return matrices


def coefficients(points: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Of the three polynomials in local time ``(N, 14, dof)``."""
    x = points
    right = np.zeros((14, points.shape[1]))
    right[[0, 3, 6, 7, 8, 9]] = x[[0, 3, 1, 1, 2, 2]]
    return np.linalg.solve(system(t), np.broadcast_to(right, (len(t), *right.shape)))


def random_durations(seed: int, count: int) -> np.ndarray:
    return np.exp(np.random.default_rng(seed).uniform(np.log(0.1), np.log(3.0), (count, 3)))


def segments_of(found: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """(segment, coefficients by rising power ``(n + 1, dof)``)."""
    yield from enumerate((found[:4], found[4:10], found[10:]))


def test_closed_form_is_the_solution_of_the_linear_system() -> None:
    rng = np.random.default_rng(0)
    for t in random_durations(1, 100):
        points = rng.normal(size=(4, 5))
        curve = polynomial_353(points, t)
        u = np.linspace(0.0, 1.0, 11)
        for k, a in segments_of(coefficients(points, t[None])[0]):
            for order in range(4):
                expected = np.polynomial.polynomial.polyval(u * t[k], np.polynomial.polynomial.polyder(a, order)).T
                size = np.abs(expected).max(axis=0)
                assert (np.abs(curve.at(k, u, order) - expected) <= 1e-9 * size).all()


def test_determinant_shows_that_there_is_no_other_curve() -> None:
    t = random_durations(2, 100)
    assert_allclose(np.abs(np.linalg.det(system(t))), 16.0 * t[:, 0] ** 3 * t[:, 1] ** 9 * t[:, 2] ** 3, rtol=1e-9)


def test_symbolic_curve_equals_the_numeric_one() -> None:
    points, x = np.random.default_rng(3).normal(size=(4, 3)), ca.SX.sym("t", 3)
    symbolic = polynomial_353(points, x)
    function = ca.Function("f", [x], [symbolic.durations, *symbolic.control_points])
    for t in random_durations(4, 10):
        numeric = polynomial_353(points, t)
        durations, *found = (np.array(part) for part in function(t))
        assert (durations.ravel() == t).all()
        for ours, theirs in zip(found, numeric.control_points, strict=True):
            assert_allclose(ours, theirs, rtol=1e-14, atol=1e-14)


def test_curve_rests_at_its_ends_and_is_smooth_between() -> None:
    points, t = np.random.default_rng(5).normal(size=(4, 3)), np.array([0.3, 1.1, 0.4])
    curve = polynomial_353(points, t)
    assert curve.degrees == (3, 5, 3)
    knots = [curve.control_points[0][0], *(part[-1] for part in curve.control_points)]
    assert (np.array(knots) == points).all()
    for end in (curve.control_points[0][:3], curve.control_points[2][1:]):  # three equal points: v = a = 0 exactly
        assert (end == end[0]).all()
    for order in (1, 2):
        assert np.abs(curve.jump(order)).max() < 1e-12
    assert np.abs(curve.jump(3)).min() > 1.0 and np.abs(curve.at(0, 0.0, 3)).min() > 1.0  # jerk steps at every knot


@pytest.mark.parametrize(("points", "durations"), [((3, 2), 3), ((4, 2), 2), ((5, 2), 4)])
def test_a_wrong_number_of_points_or_durations_is_refused(points: tuple[int, int], durations: int) -> None:
    for t in (np.ones(durations), ca.SX.sym("t", durations)):
        with pytest.raises(ProblemDefinitionError, match="4 points in 3 durations"):
            polynomial_353(np.zeros(points), t)


def test_exact_peaks_equal_those_of_a_dense_scan() -> None:
    """A scan with N samples misses a peak by at most g'' / (8 N^2): here 1e-6 of the largest value and less."""
    points, u = paper.via_points(paper.ZhuWang()), np.linspace(0.0, 1.0, 4001)
    for t in random_durations(6, 20):
        curve = polynomial_353(points, t)
        for order in (1, 2):
            samples = np.concatenate([curve.at(k, u, order) for k in range(3)])
            found = np.array([(e.lower, e.upper) for e in curve.extrema(order)])
            scale = np.abs(samples).max()
            assert_allclose(found, np.stack([samples.min(axis=0), samples.max(axis=0)], axis=1), atol=1e-5 * scale)
            assert (found[:, 0] <= samples.min(axis=0) + 1e-12 * scale).all()
            assert (found[:, 1] >= samples.max(axis=0) - 1e-12 * scale).all()


# --- the optimum, by brute force over the two ratios of the durations ---


def peaks(points: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """Largest |v|, |a| and |jerk| ``(N, dof)``, and largest joint 2 + joint 3 ``(N,)``, all from 200 samples.

    Samples between which a polynomial peaks miss it by 2e-5 of its size; the comparison below allows for that.
    """
    found = coefficients(points, t)
    u = np.linspace(0.0, 1.0, 200)
    speed, bend, jerk, turn = (np.zeros((len(t), points.shape[1])) for _ in range(4))
    for k, (first, count) in enumerate(((0, 4), (4, 6), (10, 4))):
        time = u * t[:, k : k + 1]
        power = np.arange(count)
        basis = time[..., None] ** power
        v_basis = power * time[..., None] ** np.maximum(power - 1, 0)
        a_basis = power * (power - 1) * time[..., None] ** np.maximum(power - 2, 0)
        j_basis = power * (power - 1) * (power - 2) * time[..., None] ** np.maximum(power - 3, 0)
        part = found[:, first : first + count]
        jerk = np.maximum(jerk, np.abs(j_basis @ part).max(axis=1))
        speed = np.maximum(speed, np.abs(v_basis @ part).max(axis=1))
        bend = np.maximum(bend, np.abs(a_basis @ part).max(axis=1))
        if points.shape[1] == 6:
            turn[:, 0] = np.maximum(turn[:, 0], (basis @ (part[..., 1] + part[..., 2])[..., None])[..., 0].max(axis=1))
    return speed, bend, jerk, turn[:, 0]


def ratio_scan(points: np.ndarray, limits: tuple[object, ...], turn: float = np.inf) -> float:
    """Least time [s]: a grid over t1 / t2 and t3 / t2, zoomed in; the scale follows from ``limits`` on v, a, jerk."""
    centre, width, best = np.zeros(2), np.log(20.0), np.inf
    for _ in range(12):
        axis = np.linspace(-width, width, 17)
        grid = centre + np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
        t = np.stack([np.exp(grid[:, 0]), np.ones(len(grid)), np.exp(grid[:, 1])], axis=1)
        *found, angle = peaks(points, t)
        scale = np.zeros(len(t))
        for order, (values, limit) in enumerate(zip(found, limits, strict=True), 1):
            if limit:
                scale = np.maximum(scale, (values / np.array(limit)).max(axis=1) ** (1.0 / order))
        time = np.where(angle <= turn, scale * t.sum(axis=1), np.inf)
        best, centre, width = min(best, time.min()), grid[np.argmin(time)], width / 2.5
    return float(best)


# What ``solve`` finds, proved [s]: recorded from runs, here compared with the scan. The first number is the paper's
# problem with our a_max; the maker's range of J2 + J3 binds with the printed sign, and its effort of joint 1 without
# acceleration limits.
FOUR = tuple((4.0 * SPEED).tolist())
SOLVES = [
    ({}, 1.7313622, np.inf),
    ({"acceleration": FOUR}, 1.2242580, np.inf),
    ({"acceleration": (), **PURE}, 0.9351778, np.inf),
    ({"acceleration": ()}, 0.9420678, None),
    ({"as_printed": True, **PURE}, 4.5964565, np.inf),
    ({"as_printed": True}, 4.7676709, 222.0),
    ({"jerk": JERK}, 2.2669891, np.inf),
]


@pytest.mark.slow
@pytest.mark.parametrize(("changes", "expected", "turn"), SOLVES, ids=str)
def test_time_optimum_is_proved(changes: dict[str, object], expected: float, turn: float | None) -> None:
    problem = problems.load("rotor-353", **changes)
    solution = ot.solve(problem, certify=False)
    assert solution.ok and solution.audit is not None and solution.audit.proved
    assert solution.objectives["time"] == pytest.approx(expected, abs=2e-7)
    assert solution.x.sum() == pytest.approx(expected, abs=2e-7)
    assert solution.trajectory is not None and not broken(excesses(solution.trajectory.to_dict()))


@pytest.mark.parametrize(
    ("changes", "expected"),
    [SOLVES[0][:2], *(pytest.param(*entry[:2], marks=pytest.mark.slow) for entry in SOLVES[1:])],
    ids=str,
)
def test_time_optimum_is_certified(changes: dict[str, object], expected: float) -> None:
    """Branch and bound: nothing is faster by more than a millionth, efforts and positions that bind included."""
    found = ot.solve(problems.load("rotor-353", **changes))
    assert found.certificate is not None and found.certificate.certified and found.certificate.gap <= 1e-6
    assert found.certificate.lower <= found.objectives["time"] <= found.certificate.upper
    assert found.objectives["time"] == pytest.approx(expected, abs=2e-7)


@pytest.mark.parametrize(
    ("changes", "expected", "turn"),
    [SOLVES[0], *(pytest.param(*entry, marks=pytest.mark.slow) for entry in SOLVES[1:] if entry[2] is not None)],
    ids=str,
)
def test_time_optimum_is_the_best_there_is(changes: dict[str, object], expected: float, turn: float) -> None:
    """The scan has no effort limit: where that binds there is nothing to compare."""
    problem = problems.load("rotor-353", **changes)
    case = problem.case
    scanned = ratio_scan(via_points(case.as_printed), (case.velocity, case.acceleration, case.jerk), turn)
    assert scanned == pytest.approx(expected, rel=3e-4)


def test_with_the_printed_sign_the_paper_takes_2_65_times_as_long() -> None:
    """63.179 sends joint 3 through 118 and 132 degrees where -63.179 asks for 8 and 5."""
    steps = np.abs(np.diff(np.degrees(paper.via_points(paper.ZhuWang(as_printed=True)))[:, 2]))
    assert_allclose(steps, [7.741, 118.387, 131.699], atol=1e-9)
    assert 4.5964565 / 1.7313622 == pytest.approx(2.655, abs=5e-4)


# --- the robot ---


@pytest.mark.parametrize("payload", [0.0, 8.0])
def test_efforts_equal_pinocchios_through_the_pendants_coupling(payload: float) -> None:
    """Gravity -9.81 m/s^2 along z; serial joint 3 is J2 + J3, so actuator 2 feels both torques: virtual work."""
    problem = problems.load("rotor-353", payload=payload)
    limit = next(c for c in problem.requirements.path_constraints if c.id == "effort-limit")
    function, machine = problem.requirements.function(limit), RotorRobot(payload)
    rng = np.random.default_rng(0)
    for _ in range(200):
        q, v, a = rng.uniform(-pi, pi, 6), rng.normal(size=6), 3.0 * rng.normal(size=6)
        expected = machine.effort(q, v, a)
        found = np.array(function(np.concatenate([q, v, a, np.zeros(12)]), 0.0, [payload], [])).ravel()
        assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_one_robot_the_makers_joints_and_table_1_agree() -> None:
    """Table 1 by modified rows, the makers' joints through the coupling, and the arm in closed form: one flange."""
    rows = Robot.from_dh(m10id.arm().rows, (None,) * 6, convention="modified")
    q = ca.SX.sym("q", 6)
    maker = ca.Function("maker", [q], list(paper.robot().tool_pose(q)))
    table = ca.Function("table", [q], list(rows.tool_pose(q)))
    for angles in np.random.default_rng(1).uniform(-pi, pi, (200, 6)):
        theta = m10id.pendant_to_table_1(angles)
        assert_allclose(
            np.degrees(theta),
            [1, 1, -1, -1, -1, -1] * np.degrees([angles[0], angles[1] - pi / 2, angles[1] + angles[2], *angles[3:]]),
            atol=1e-10,
        )
        for one, two, three in zip(maker(angles), table(theta), paper.forward_kinematics(angles), strict=True):
            assert_allclose(np.array(one), np.array(two), atol=1e-14)
            assert_allclose(np.squeeze(np.array(one)), three[0], atol=1e-14)


def test_position_limits_are_the_makers_on_its_own_joints() -> None:
    limits = {c.id: c for c in problems.load("rotor-353").requirements.path_constraints}
    assert list(limits) == ["position-limit", "velocity-limit", "acceleration-limit", "effort-limit"]
    position = limits["position-limit"]
    assert position.labels == ("J1", "J2", "J2 + J3", "J4", "J5", "J6")
    assert_allclose(np.degrees(position.lower), [-185, -90, -90, -190, -179.999, -450])
    assert_allclose(np.degrees(position.upper), [185, 145, 222, 190, 179.999, 450])
    assert_allclose(np.degrees(limits["velocity-limit"].upper), SPEED)
    assert_allclose(np.degrees(limits["acceleration-limit"].upper), 2.0 * SPEED)
    assert_allclose(limits["effort-limit"].upper, [2000, 3000, 1000, 100, 100, 50])


# --- kinematics ---


def test_table_2_is_degrees_of_the_pendant_and_comes_back() -> None:
    q = paper.via_points(paper.ZhuWang())
    assert_allclose(np.degrees(q), TABLE_2.T, atol=1e-12)
    assert_allclose(m10id.table_1_to_pendant(m10id.pendant_to_table_1(q)), q, atol=1e-14)
    poses = paper.forward_kinematics(q)
    found, branches = paper.inverse_kinematics(*poses), m10id.arm().inverse(*poses)
    assert branches.exists.all() and (branches.reasons == "").all()
    assert np.abs(found - q[:, None]).max(axis=-1).min(axis=1).max() < 1e-12


def test_random_pendant_angles_come_back() -> None:
    """10 000 configurations within the maker's ranges, those further than 1e-5 from a singularity: to 1e-9 rad."""
    low, high = np.radians([[-180, -90, -90, -180, -179.999, -180], [180, 145, 222, 180, 179.999, 180]])
    serial = np.random.default_rng(2).uniform(low, high, (10_000, 6))
    q = serial.copy()
    q[:, 2] -= q[:, 1]
    poses = paper.forward_kinematics(q)
    found, branches = paper.inverse_kinematics(*poses), m10id.arm().inverse(*poses)
    away = np.nanmin(branches.measures, axis=(1, 2)) > 1e-5
    assert away.mean() > 0.999
    gap = np.abs(found - q[:, None]).max(axis=-1)
    assert np.nanmin(gap, axis=1)[away].max() <= 1e-9


def turn_between(one: np.ndarray, two: np.ndarray) -> tuple[float, np.ndarray]:
    """Angle [deg] and axis of the turn from one rotation to another."""
    vector = pin.log3(two @ one.T)
    return float(np.degrees(np.linalg.norm(vector))), vector / np.linalg.norm(vector)


def test_corrected_tables_make_a_turn_about_the_vertical_and_a_pure_translation() -> None:
    rotation, position = paper.forward_kinematics(paper.via_points(paper.ZhuWang()))
    angle, axis = turn_between(rotation[0], rotation[1])
    assert angle == pytest.approx(5.530, abs=5e-4)
    assert abs(axis[2]) == pytest.approx(1.0, abs=1e-8)
    assert abs(position[1, 2] - position[0, 2]) < 7e-6  # [m]
    assert turn_between(rotation[2], rotation[3])[0] == pytest.approx(0.00089, abs=5e-6)
    assert np.linalg.norm(position[3] - position[2]) == pytest.approx(0.13730, abs=5e-6)


def test_as_printed_neither_holds() -> None:
    case = paper.ZhuWang(as_printed=True)
    assert m10id.arm(as_printed=True).a3 == 1.1 and m10id.arm().a3 == 0.195
    rotation, position = paper.forward_kinematics(paper.via_points(case), case)
    assert abs(position[1, 2] - position[0, 2]) > 0.1  # [m]
    assert turn_between(rotation[2], rotation[3])[0] > 90.0


# --- objectives ---


def exact(problem: Problem, x: np.ndarray, pieces: int = 40) -> dict[str, float]:
    """Effort, work (without smoothing) and jerk of a motion with pinocchio, on a composite rule of 20 nodes a piece."""
    machine = RotorRobot(problem.case.payload)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    totals = {"effort": 0.0, "work": 0.0, "jerk": 0.0}
    for k, a in segments_of(coefficients(np.radians(TABLE_2.T), x[None])[0]):
        for piece in range(pieces):
            t = (piece + (nodes + 1.0) / 2.0) / pieces * x[k]
            w = weights / 2.0 * x[k] / pieces
            state = [
                np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(a, order)).T for order in range(4)
            ]
            tau = efforts(machine, *state[:3])
            totals["effort"] += float(w @ ((tau / [2000, 3000, 1000, 100, 100, 50]) ** 2).sum(axis=1))
            totals["work"] += float(w @ np.abs(tau * state[1]).sum(axis=1))
            totals["jerk"] += float(w @ (state[3] ** 2).sum(axis=1))
    return totals


def test_objectives_equal_an_independent_computation() -> None:
    """Measured over 22 motions: effort to 1.4e-7; work to 0.3 %, of which smoothing is 6 x 0.1 W x T at most."""
    problem = problems.load("rotor-353", payload=3.0)
    for x in (np.array([0.3249, 1.0839, 0.3226]), np.array([0.5, 0.4, 0.9])):
        found, expected = evaluate_objectives(problem, x), exact(problem, x)
        assert found["time"] == pytest.approx(x.sum(), rel=1e-15)
        assert found["effort"] == pytest.approx(expected["effort"], rel=2e-7)
        assert found["jerk"] == pytest.approx(expected["jerk"], rel=1e-11)
        assert found["work"] == pytest.approx(expected["work"], abs=6 * 0.1 * x.sum() + 0.002 * expected["work"])


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_jerk_falls_with_the_fifth_power_of_time(factor: float) -> None:
    problem, x = problems.load("rotor-353"), np.array([0.4, 1.0, 0.5])
    assert problem.dilate is not None
    before, after = (evaluate_objectives(problem, x_) for x_ in (x, problem.dilate(x, factor)))
    assert after["jerk"] == pytest.approx(before["jerk"] / factor**5, rel=1e-11)
    assert after["time"] == pytest.approx(before["time"] * factor, rel=1e-14)


@pytest.mark.slow
def test_a_small_front_is_proved() -> None:
    front = ot.pareto(problems.load("rotor-353"), ["time", "jerk"], points=4)
    assert len(front) == 4 and {point.verdict for point in front.points} == {"proved"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("other", "changes"), [("effort", {}), ("jerk", {}), ("jerk", {"jerk": JERK}), ("jerk", {"as_printed": True})]
)
def test_fronts_of_thirty_points_are_all_proved(other: str, changes: dict[str, object]) -> None:
    front = ot.pareto(problems.load("rotor-353", **changes), ["time", other], points=30, seed=0)
    assert len(front) == 30
    assert {point.verdict for point in front.points} == {"proved"}
    assert 0.5 < front.hypervolume().value < 1.0


# --- the paper's recipe: every joint alone ---


@pytest.fixture(scope="module")
def recipe() -> Solution:
    return ot.solve(problems.load("rotor-353", timing="per_joint"))


def test_per_joint_recipe_is_feasible_here_and_not_optimal(recipe: Solution) -> None:
    assert recipe.status is Status.FEASIBLE and recipe.audit is not None and recipe.audit.proved
    assert_allclose(recipe.x, [0.48882108, 1.1287613, 0.34505321], atol=2e-7)
    assert recipe.f == pytest.approx(1.9626356, abs=2e-7)
    assert recipe.f > 1.13 * 1.7313622
    assert "not an optimum of the whole" in recipe.detail


@pytest.mark.slow
def test_per_joint_recipe_takes_the_longest_of_each_phase_of_the_joints_alone(recipe: Solution) -> None:
    """Each joint alone by the scan over ratios, its own limits only."""
    for j, part in enumerate(problems.load("rotor-353", timing="per_joint").decomposition.parts):  # type: ignore[union-attr]
        assert part.requirements.joints == (f"J{j + 1}",)
        alone = Exchange().solve(part, WeightedSum({"time": 1.0}), part.guess(np.random.default_rng(0)))
        scanned = ratio_scan(TABLE_2[j : j + 1].T, ([SPEED[j]], [2.0 * SPEED[j]], []))
        assert alone.f == pytest.approx(scanned, rel=3e-4)
        assert (alone.x <= recipe.x + 1e-9).all()


@pytest.mark.slow
def test_per_joint_recipe_breaks_a_limit_with_the_printed_sign() -> None:
    for changes, excess in ((PURE, 0.0668), ({}, 0.1393)):
        problem = problems.load("rotor-353", timing="per_joint", as_printed=True, **changes)
        solution = ot.solve(problem)
        assert solution.status is Status.UNPROVED and not solution.ok
        assert solution.audit is not None
        broken = {(row.limit, row.label) for row in solution.audit.failures}
        assert ("acceleration-limit", "J3") in broken
        assert (("position-limit", "J2 + J3") in broken) == (not changes)
        assert solution.violation == pytest.approx(excess, abs=5e-5)
        assert "acceleration-limit J3 violated" in solution.explain()
        assert solution.x.sum() == pytest.approx(4.7447835, abs=2e-6)


def test_per_joint_has_no_front_no_effort_and_no_free_payload() -> None:
    problem = problems.load("rotor-353", timing="per_joint")
    with pytest.raises(InputError, match="solved by parts in this case, which gives one trajectory and no front"):
        ot.pareto(problem, ["time", "jerk"])
    with pytest.raises(InputError, match="J1 alone' has no objective 'effort'; it has time, jerk"):
        ot.solve(problem, objective="effort")
    with pytest.raises(InputError, match="timing per_joint has no payload to choose"):
        problems.load("rotor-353", timing="per_joint", free_payload=True)


@pytest.mark.slow
@pytest.mark.parametrize(("printed", "code", "verdict"), [("false", 0, "proved"), ("true", 1, "violated")])
def test_command_line_tells_a_recipe_that_breaks_limits(
    printed: str, code: int, verdict: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["solve", "rotor-353", "--set", "timing=per_joint", "--set", f"as_printed={printed}", "--json"]
    assert run(words) == code
    out = json.loads(capsys.readouterr().out)
    assert out["audit"]["verdict"] == verdict
    assert out["detail"] == "6 parts solved alone and put together: not an optimum of the whole"
    assert any("our choice, 2 v_max per second" in note for note in out["notes"])
    assert (out["status"] == "not proved") == bool(code)


def test_the_case_and_what_the_paper_leaves_out_are_on_the_sheet(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", "rotor-353"]) == 0
    out = capsys.readouterr().out
    assert "Not in the paper" in out and "our choice, 2 v_max per second" in out and "provisional" in out


def test_a_recipe_whose_part_has_no_solution_says_which() -> None:
    solution = ot.solve(problems.load("rotor-353", timing="per_joint", max_duration=0.2))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    assert "J1 alone" in solution.explain()


# --- the case ---


def test_what_the_paper_leaves_out_is_said() -> None:
    plain = " ".join(problems.load("rotor-353").about.notes)
    assert "420, 420, 440, 860, 900, 1440 deg/s2: our choice, 2 v_max per second" in plain
    assert "efforts 2000, 3000, 1000, 100, 100, 50 N m" in plain and "provisional" in plain
    other = " ".join(problems.load("rotor-353", acceleration=FOUR, jerk=JERK, timing="per_joint").about.notes)
    assert "our choice" not in other and "deg/s3: given" in other and "per_joint" in other


def test_a_jerk_limit_holds_at_the_ends_and_at_both_sides_of_the_vias() -> None:
    problem = problems.load("rotor-353", jerk=JERK)
    solution = ot.solve(problem, certify=False)
    assert solution.trajectory is not None
    curve = solution.trajectory.curve
    jerk = np.concatenate([np.abs(curve.at(k, np.array([0.0, 1.0]), 3)) for k in range(3)])
    assert (jerk / np.radians(JERK)).max() == pytest.approx(1.0, abs=1e-8)
    assert np.abs(curve.at(0, 0.0, 3)).min() > 0.0  # a cubic starts with all of its jerk


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"velocity": (1.0, 2.0)}, "velocity is"),
        ({"velocity": ()}, "velocity is"),
        ({"velocity": "none"}, "velocity is 'none'; give 6 numbers"),
        ({"acceleration": (0.0,) * 6}, "acceleration is .* deg/s2; give 6 finite numbers above zero, or none"),
        ({"acceleration": "1,2,x,4,5,6"}, "acceleration is .*give 6 numbers, such as 420.0"),
        ({"jerk": (1.0,) * 5}, "jerk is .*give 6 numbers, or none"),
        ({"jerk": (float("nan"),) * 6}, "jerk is"),
        ({"payload": -1.0}, "payload is -1.0 kg"),
        ({"max_payload": 0.0}, "max_payload is 0.0 kg"),
        ({"timing": "together"}, "timing is 'together'; allowed are synchronised, per_joint"),
        ({"min_duration": 0.0}, "min_duration is 0.0 s; give a finite number above zero"),
        ({"min_duration": 2.0, "max_duration": 1.0}, "leave nothing between; give min_duration < max_duration"),
        ({"effort_limits": "maybe"}, "give true or false"),
    ],
)
def test_a_wrong_field_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        problems.load("rotor-353", **changes)


def test_limits_may_be_written_as_text() -> None:
    case = problems.load("rotor-353", acceleration="none", jerk=",".join(map(str, JERK))).case
    assert case.acceleration == () and case.jerk == JERK


# --- payload ---


def test_static_payload_is_where_joint_3_holds_the_arm_at_the_start() -> None:
    """113.485 kg: the torque of joint 3 at X0 is linear in the mass, with pinocchio."""
    found = ot.payload(problems.load("rotor-353"))
    assert (found.binding, found.kind) == ("effort-limit J3", "every time law")
    tau = RotorRobot(found.payload).effort(np.radians(TABLE_2[:, 0]), np.zeros(6), np.zeros(6))
    assert tau[2] == pytest.approx(1000.0, abs=1e-6)
    assert found.payload == pytest.approx(113.485486, abs=1e-6)


@pytest.mark.slow
def test_payload_within_a_time_lies_below_the_static_bound() -> None:
    found = ot.payload(problems.load("rotor-353"), max_time=2.0)
    assert found.audit is not None and found.audit.proved
    assert found.payload == pytest.approx(78.8007, abs=1e-3)


def test_without_effort_limits_there_is_no_payload_to_find() -> None:
    with pytest.raises(InputError, match="there is no static bound"):
        ot.payload(problems.load("rotor-353", effort_limits=False))


def test_a_freed_payload_is_the_last_variable() -> None:
    problem, x = problems.load("rotor-353", free_payload=True), np.array([0.4, 1.2, 0.4, 5.0])
    assert problem.labels == ("t1", "t2", "t3", "payload")
    moved: Trajectory = trajectory_of(problem, x)
    assert moved.parameters == {"payload": 5.0}
    assert_allclose(problem.dilate(x, 2.0), [0.8, 2.4, 0.8, 5.0])  # type: ignore[misc]
    fixed = evaluate_objectives(problems.load("rotor-353", payload=5.0), x[:3])
    found = evaluate_objectives(problem, x)
    assert found.pop("payload_mass") == 5.0
    assert found == pytest.approx(fixed, rel=1e-13)
