"""rotor-353: the curve, the arm's kinematics, the time-optimal motion and the paper's recipe."""

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import ocp_traj as ot
from ocp_traj import problems
from ocp_traj.curves import polynomial_353
from ocp_traj.errors import InputError, ProblemDefinitionError
from ocp_traj.nlp import Status
from ocp_traj.problem import Problem
from ocp_traj.problems import rotor_353 as rotor
from ocp_traj.symbolic import evaluate_objectives
from ocp_traj.tape import Tape
from ocp_traj.transcription import trajectory

VELOCITY = np.radians(rotor.VELOCITY)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return problems.load("rotor-353")


# --- the curve ---


def system(t: np.ndarray) -> np.ndarray:
    """The 14 x 14 matrix of (4)-(5): coefficients of three polynomials in their own time, ascending powers."""

    def row(power: int, order: int, u: float) -> list[float]:
        factors = [float(np.prod(range(k - order + 1, k + 1))) if k >= order else 0.0 for k in range(power + 1)]
        return [c * u ** max(k - order, 0) for k, c in enumerate(factors)]

    blocks = []
    widths, places = (3, 5, 3), (0, 4, 10)

    def line(*entries: tuple[int, int, float, float]) -> np.ndarray:
        values = np.zeros(14)
        for segment, order, u, sign in entries:
            at = places[segment]
            values[at : at + widths[segment] + 1] += sign * np.array(row(widths[segment], order, u))
        return values

    for k in (0, 1):  # continuity of q, v, a at the inner knots
        blocks += [line((k, order, t[k], 1.0), (k + 1, order, 0.0, -1.0)) for order in (0, 1, 2)]
    blocks += [line((2, order, t[2], 1.0)) for order in (0, 1, 2)]
    blocks += [line((0, order, 0.0, 1.0)) for order in (0, 1, 2)]
    blocks += [line((2, 0, 0.0, 1.0)), line((1, 0, 0.0, 1.0))]
    return np.array(blocks)


def test_the_closed_form_solves_the_linear_system_of_the_paper() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        t, points = np.exp(rng.uniform(-2.0, 1.2, 3)), rng.normal(size=(4, 2))
        right = np.zeros((14, 2))
        right[6], right[9], right[12], right[13] = points[3], points[0], points[2], points[1]
        solved = np.linalg.solve(system(t), right)
        curve = polynomial_353(points, t)
        for k, (start, count) in enumerate(((0, 4), (4, 6), (10, 4))):
            u = np.linspace(0.0, 1.0, 7)
            powers = (u * t[k])[:, None] ** np.arange(count)
            expected = powers @ solved[start : start + count]
            assert_allclose(curve.at(k, u), expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_the_system_has_the_determinant_that_makes_the_curve_unique() -> None:
    rng = np.random.default_rng(1)
    for t in np.exp(rng.uniform(-1.0, 1.0, (50, 3))):
        assert abs(np.linalg.det(system(t))) == pytest.approx(16.0 * t[0] ** 3 * t[1] ** 9 * t[2] ** 3, rel=1e-9)


def test_the_curve_is_c2_at_rest_at_its_ends_and_symbolic_as_well() -> None:
    rng = np.random.default_rng(2)
    points, t = rng.normal(size=(4, 3)), np.array([0.3, 1.1, 0.7])
    curve = polynomial_353(points, t)
    for order in (0, 1, 2):
        assert np.abs(curve.jump(order)).max() < 1e-12 * np.abs(np.concatenate(curve.hull(order))).max()
    for order in (1, 2):
        assert np.abs([curve.hodograph(0, order)[0], curve.hodograph(2, order)[-1]]).max() < 1e-14
    x = ca.SX.sym("t", 3)
    symbolic = ca.Function("c", [x], list(polynomial_353(points, x).control_points))
    for ours, theirs in zip(curve.control_points, symbolic.call([ca.DM(t)]), strict=True):
        assert_allclose(ours, np.array(theirs), rtol=1e-14, atol=1e-14)


def test_exact_peaks_are_those_of_a_scan() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        curve = polynomial_353(rng.normal(size=(4, 2)), np.exp(rng.uniform(-1.0, 1.0, 3)))
        for order in (1, 2):
            scan = np.concatenate([curve.at(k, np.linspace(0, 1, 4001), order) for k in range(3)])
            for j, extremum in enumerate(curve.extrema(order)):
                size = np.abs(scan[:, j]).max()
                assert 0.0 <= extremum.upper - scan[:, j].max() < 1e-6 * size
                assert 0.0 <= scan[:, j].min() - extremum.lower < 1e-6 * size


def test_other_numbers_of_points_or_durations_are_refused() -> None:
    with pytest.raises(ProblemDefinitionError, match="4 points in 3 durations"):
        polynomial_353(np.zeros((3, 2)), [1.0, 1.0, 1.0])


# --- kinematics ---


def random_configurations(count: int) -> np.ndarray:
    low, high = np.radians(rotor.POSITION)
    q = np.random.default_rng(4).uniform(np.maximum(low, -np.pi), np.minimum(high, np.pi), (count, 6))
    return q


def distance(q: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.abs(np.arctan2(np.sin(q - other), np.cos(q - other))).max(axis=-1)


def test_ten_thousand_configurations_are_found_again_and_every_branch_reaches_its_pose() -> None:
    """Away from singularities: sin(theta5), the elbow and the shoulder at least 1e-3 from where they vanish."""
    q = random_configurations(12_000)
    poses, counted, worst_angle, worst_pose = rotor.forward_kinematics(q), 0, 0.0, 0.0
    theta = rotor.dh_angles(q)
    wrist = poses[:, :3, 3] - rotor.FLANGE * poses[:, :3, 2]
    elbow = np.abs(np.cos(theta[:, 2] - np.arctan2(rotor.A3, rotor.D4)))
    clear = (np.abs(np.sin(theta[:, 4])) > 1e-3) & (np.hypot(wrist[:, 0], wrist[:, 1]) > 1e-3) & (elbow > 1e-3)
    for target, own in zip(poses[clear], q[clear], strict=True):
        found, names = rotor.inverse_kinematics(target)
        assert len(found) == len(set(names)) and len(found) in (4, 8)
        worst_angle = max(worst_angle, distance(found, own).min())
        worst_pose = max(worst_pose, np.abs(rotor.forward_kinematics(found) - target).max())
        counted += 1
    assert counted >= 10_000
    assert worst_angle <= 1e-9
    assert worst_pose <= 1e-9  # [m]: 1e-6 mm


def test_the_arm_of_the_maker_is_that_of_table_1() -> None:
    """Tool position and rotation of the pinocchio model, up to the turn between the two flange conventions."""
    q = ca.SX.sym("q", 6)
    pose = ca.Function("pose", [q], list(rotor.robot().tool_pose(q)))
    turn = None
    for configuration in random_configurations(20):
        rotation, position = (np.array(part) for part in pose(configuration))
        table = rotor.forward_kinematics(configuration)[0]
        assert_allclose(position.ravel(), table[:3, 3], atol=1e-12)
        turn = rotation.T @ table[:3, :3] if turn is None else turn
        assert_allclose(rotation @ turn, table[:3, :3], atol=1e-12)


def test_pendant_angles_and_table_2_map_back_and_forth() -> None:
    q = random_configurations(100)
    assert_allclose(rotor.pendant_angles(rotor.dh_angles(q)), q, atol=1e-14)
    for point in rotor.via_points(rotor.ZhuWang()):
        found, names = rotor.inverse_kinematics(rotor.forward_kinematics(point)[0])
        assert distance(found, point).min() < 1e-9 and len(names) == 8


@pytest.mark.parametrize(
    ("place", "words"),
    [((3.0, 0.0, 1.0), "out of reach"), ((0.0, 0.0, 1.2), "shoulder singularity")],
)
def test_poses_without_an_answer_say_why(place: tuple[float, float, float], words: str) -> None:
    pose = np.eye(4)
    pose[:3, 3] = np.array(place) + np.array([0.0, 0.0, rotor.FLANGE])
    with pytest.raises(InputError, match=words):
        rotor.inverse_kinematics(pose)


def test_a_wrist_in_line_and_a_pose_that_is_none_are_refused() -> None:
    with pytest.raises(InputError, match="wrist singularity"):
        rotor.inverse_kinematics(rotor.forward_kinematics([0.1, 0.2, 0.3, 0.4, 0.0, 0.5])[0])
    with pytest.raises(InputError, match="no rigid motion"):
        rotor.inverse_kinematics(np.diag([1.0, 1.0, -1.0, 1.0]))
    with pytest.raises(InputError, match="no rigid motion"):
        rotor.inverse_kinematics(np.eye(3))


def test_table_2_with_its_sign_mended_is_a_turn_and_a_translation() -> None:
    """X0 to X1 turns about the vertical at constant height; X2 to X3 does not turn; with the printed sign it does."""
    first, second, third, last = rotor.forward_kinematics(rotor.via_points(rotor.ZhuWang()))
    turn = second[:3, :3] @ first[:3, :3].T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    assert np.abs(axis[:2] / axis[2]).max() < 1e-4
    assert abs(second[2, 3] - first[2, 3]) < 8e-6  # [m]

    def angle(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.degrees(np.linalg.norm(pin.log3(a[:3, :3].T @ b[:3, :3]))))

    assert angle(third, last) < 1e-3
    printed = rotor.forward_kinematics(rotor.via_points(rotor.ZhuWang(as_printed=True)))
    assert angle(printed[2], printed[3]) > 90.0


# --- dynamics ---


def test_efforts_are_those_of_pinocchio(problem: Problem) -> None:
    model = problem.robot.model
    data = model.createData()
    limit = next(c for c in problem.requirements.path_constraints if c.id == "effort-limit")
    function = problem.requirements.function(limit)
    to_serial = np.eye(6)
    to_serial[2, 1] = 1.0
    for seed in range(20):
        q, v, a = np.random.default_rng(seed).normal(size=(3, 6))
        state = np.concatenate([q, v, a, np.zeros(12)])
        ours = np.array(function(state, 0.0, 0.0, [])).ravel()
        expected = to_serial.T @ pin.rnea(model, data, to_serial @ q, to_serial @ v, to_serial @ a)
        assert_allclose(ours, expected, rtol=1e-9, atol=1e-9)


# --- the time-optimal motion ---

# Certified by branch and bound within 1e-6; `ocp-traj solve rotor-353 --set ..`.
REFERENCES = [
    ({}, 1.731362),
    ({"acceleration": tuple(4.0 * v for v in rotor.VELOCITY)}, 1.224258),
    ({"acceleration": (), "effort_limits": False}, 0.935178),
    ({"as_printed": True}, 4.767671),
]


def shortest_on_a_grid(problem: Problem) -> float:
    """Least time over a grid of ratios, each slowed down until the limits on derivatives hold: shares no solver."""
    points, case = rotor.via_points(problem.case), problem.case
    best = np.inf
    for x in np.geomspace(0.3, 10.0, 60):
        for y in np.geomspace(0.3, 10.0, 60):
            curve = polynomial_353(points, np.array([1.0, x, x / y]))
            slow = 0.0
            for order, bound in ((1, case.velocity), (2, case.acceleration)):
                if bound:
                    peaks = np.abs([(e.lower, e.upper) for e in curve.extrema(order)]).max(axis=1)
                    slow = max(slow, ((peaks / np.radians(bound)) ** (1.0 / order)).max())
            best = min(best, slow * curve.duration)
    return best


@pytest.mark.parametrize(("changes", "expected"), REFERENCES)
def test_the_shortest_time_is_proved_and_certified(changes: dict, expected: float) -> None:
    found = ot.solve(problems.load("rotor-353", **changes))
    assert found.status.value == "solved" and found.audit is not None and found.audit.proved
    assert found.objectives["time"] == pytest.approx(expected, abs=1e-6)
    assert found.certificate is not None and found.certificate.certified and found.certificate.gap <= 1e-6
    assert found.certificate.lower <= found.objectives["time"] <= found.certificate.upper


@pytest.mark.slow
@pytest.mark.parametrize(("changes", "expected"), REFERENCES[:3])
def test_no_grid_of_ratios_has_a_shorter_time(changes: dict, expected: float) -> None:
    on_grid = shortest_on_a_grid(problems.load("rotor-353", **changes))
    assert expected * (1.0 - 1e-6) < on_grid < 1.05 * expected


@pytest.mark.slow
def test_efforts_that_bind_are_part_of_the_certificate() -> None:
    found = ot.solve(problems.load("rotor-353", acceleration=()))
    assert found.certificate is not None and found.certificate.certified
    assert found.objectives["time"] == pytest.approx(0.942068, abs=1e-6)
    tight = [row.limit for row in found.audit.rows if row.margin < 1e-6] if found.audit else []
    assert "effort-limit" in tight


def test_a_limit_on_jerk_holds_at_ends_and_vias_as_well() -> None:
    jerk = tuple(20.0 * v for v in rotor.VELOCITY)
    found = ot.solve(problems.load("rotor-353", jerk=jerk))
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    curve = found.trajectory.curve
    for k in range(3):
        peaks = np.abs(curve.at(k, np.linspace(0.0, 1.0, 101), 3)).max(axis=0)
        assert (peaks <= np.radians(jerk) * (1.0 + 1e-9)).all()
    assert found.objectives["time"] > REFERENCES[0][1]


def test_each_joint_alone_and_the_longest_phases_are_slower_and_with_the_printed_sign_not_feasible() -> None:
    alone = ot.solve(problems.load("rotor-353", timing="per_joint"))
    assert alone.audit is not None and alone.audit.proved and alone.status is Status.FEASIBLE
    assert alone.objectives["time"] > 1.01 * REFERENCES[0][1]
    printed = ot.solve(problems.load("rotor-353", timing="per_joint", as_printed=True))
    assert printed.audit is not None and not printed.audit.proved and printed.status is Status.UNPROVED
    assert "acceleration-limit" in {row.limit for row in printed.audit.failures}


@pytest.mark.parametrize("pair", [("time", "effort"), ("time", "jerk")])
def test_small_fronts_are_proved(pair: tuple[str, str], problem: Problem) -> None:
    front = ot.pareto(problem, pair, points=4)
    assert len(front) == 4 and (front.table["verdict"] == "proved").all()


@pytest.mark.slow
@pytest.mark.parametrize("pair", [("time", "effort"), ("time", "jerk"), ("time", "work")])
def test_thirty_points_are_proved(pair: tuple[str, str], problem: Problem) -> None:
    front = ot.pareto(problem, pair, points=30)
    assert len(front) == 30 and (front.table["verdict"] == "proved").all()


def test_smoothed_work_is_close_to_the_integral_of_power(problem: Problem) -> None:
    limit = next(c for c in problem.requirements.path_constraints if c.id == "effort-limit")
    tape, rng, u = Tape(problem.requirements.function(limit)), np.random.default_rng(0), np.linspace(0.0, 1.0, 2001)
    for x in [problem.guess(rng) for _ in range(30)]:
        curve, work = trajectory(problem, x).curve, 0.0
        for k in range(3):
            states = np.concatenate([curve.at(k, u, order).T for order in range(5)])
            torque = tape.evaluate(states, u[None], np.zeros((1, 1)), np.zeros((0, 1)))[0]
            work += curve.durations[k] * np.trapezoid(np.abs(torque * curve.at(k, u, 1).T).sum(axis=0), u)
        assert evaluate_objectives(problem, x)["work"] == pytest.approx(work, rel=4e-3)


# --- bad input ---


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"velocity": "1,2"}, "6 numbers, such as 210.0"),
        ({"velocity": "none"}, "6 numbers"),
        ({"acceleration": "1,2,3,4,5,-6"}, "six numbers above zero"),
        ({"timing": "alone"}, "allowed are synchronised, per_joint"),
        ({"payload": -1.0}, "zero or more"),
        ({"min_duration": 5.0}, "leave no duration"),
    ],
)
def test_bad_fields_are_refused(changes: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        problems.load("rotor-353", **changes)


def test_a_payload_can_be_freed() -> None:
    found = ot.payload(problems.load("rotor-353"), max_time=2.5, starts=1)
    assert found.audit is not None and found.audit.proved and found.payload > 8.0
