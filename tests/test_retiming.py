import casadi
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import cubic_spline_free_ends, nonic
from ocp_traj.errors import InputError
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.retiming import FORWARD, retiming
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_arcs import nearest
from ocp_traj.proof.audit import audit
from ocp_traj.results.trajectory import trajectory_of
from tests.quintics import PAYLOAD, wander
from tests.retimed import arm, refined, retimed

TOPPRA = 2.3112  # [s] of wander(6), by toppra 0.6.10: ConstAccel, Interpolation, 1000 steps; acceleration 8
LIMITS = {1: {}, 2: {"acceleration": 8.0}, 3: {"acceleration": 8.0, "jerk": 60.0}}


@pytest.fixture(scope="module")
def path() -> JointPath:
    return JointPath.through(wander(6), arm().joints)


def law(path: JointPath, order: int, pieces: int = 2, rest: int = 1) -> Parametrisation:
    return retiming(path, arm(**LIMITS[order]).limits, pieces=pieces, rest=rest)


def some(made: Parametrisation, seed: int = 0) -> Array:
    """A start, its derivatives changed a little."""
    rng = np.random.default_rng(seed)
    x = made.guess(rng)
    return x * rng.uniform(0.97, 1.03, len(x))


def off_path(path: JointPath, curve: PiecewiseBezier, legs: tuple[range, ...]) -> float:
    """Largest distance of a motion from its path, leg by leg."""
    u = np.linspace(0.0, 1.0, 11)
    worst = 0.0
    for leg, segments in enumerate(legs):
        q = np.concatenate([curve.at(k, u) for k in segments])
        worst = max(worst, float(np.abs(path.curve.at(leg, nearest(path.curve, leg, q)) - q).max()))
    return worst


@pytest.mark.parametrize("order", [2, 3])
def test_the_motion_keeps_to_the_path(path: JointPath, order: int) -> None:
    made = law(path, order, rest=order - 1)
    curve = made.curve(some(made))
    assert off_path(path, curve, made.legs) < 1e-12
    assert set(curve.degrees) == {3 * (2 * order - 1)}
    first, last = curve.control_points[0], curve.control_points[-1]
    assert (first[:order] == first[0]).all() and (last[-order:] == last[-1]).all()  # at rest, without rounding
    for m in range(1, order):
        size = max(np.abs(curve.hodograph(k, m)).max() for k in range(curve.segments))
        assert np.abs(curve.jump(m)).max() < 1e-11 * size
    assert made.continuity == order - 1
    for (k, u), point in zip(made.knots, path.points, strict=True):
        assert np.abs(curve.at(k % curve.segments, u)[0] - point).max() < 1e-14


@pytest.mark.parametrize("order", [2, 3])
def test_variables_are_found_back_from_the_curve(path: JointPath, order: int) -> None:
    made = law(path, order)
    x = some(made)
    assert np.abs(made.variables_of(made.curve(x)) - x).max() < 1e-9


@pytest.mark.parametrize("order", [2, 3])
def test_symbols_make_the_curve_that_numbers_make(path: JointPath, order: int) -> None:
    made = law(path, order)
    x = some(made)
    symbol = casadi.SX.sym("x", len(x))
    curve, numbers = made.curve(symbol), made.curve(x)
    for points, expected in zip(curve.control_points, numbers.control_points, strict=True):
        assert np.allclose(np.array(casadi.Function("f", [symbol], [points])(x)), expected, rtol=0.0, atol=1e-15 * 50)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 3])
def test_more_pieces_and_slower_motions_are_the_same_motion(path: JointPath, order: int) -> None:
    coarse, fine = law(path, order, 2), law(path, order, 6)
    x = some(coarse)
    curve, t = coarse.curve(x), np.linspace(0.0, 1.0, 301)
    assert fine.refine is not None and coarse.dilate is not None
    finer, slower = fine.curve(fine.refine(x, 3)), coarse.curve(coarse.dilate(x, 1.7))
    assert finer.duration == pytest.approx(curve.duration, rel=1e-13)
    for m in range(order):
        expected = curve(t * curve.duration, m)
        size = np.abs(expected).max()
        assert np.abs(finer(t * finer.duration, m) - expected).max() < 1e-10 * size
        assert np.abs(slower(t * slower.duration, m) * 1.7**m - expected).max() < 1e-10 * size


@pytest.mark.slow
def test_a_straight_line_is_driven_in_the_least_time() -> None:
    line = JointPath.through([[0.0] * 6, [1.0, 0.2, 0.0, 0.0, 0.0, -0.4]], arm().joints)
    found = ot.solve(retimed(arm(acceleration=4.0, velocity=1.5), line, 8), certify=False)
    assert found.audit is not None and found.audit.proved
    # One radian at 4 rad/s2 up to 1.5 rad/s, which is passed between knots: 1 / 1.5 + 1.5 / 4 with knots there.
    assert 1.0 / 1.5 + 1.5 / 4.0 <= found.f <= 1.005 * (1.0 / 1.5 + 1.5 / 4.0)
    free = ot.solve(retimed(arm(acceleration=4.0, velocity=9.0), line, 8), certify=False)
    assert free.f == pytest.approx(1.0, rel=1e-6)  # 2 sqrt(d / a): the switch is at a knot


@pytest.mark.slow
def test_a_path_is_driven_as_fast_as_toppra_does_and_proved(path: JointPath) -> None:
    found = ot.solve(retimed(arm(acceleration=8.0), path, 8), certify=False)
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    assert found.f <= 1.01 * TOPPRA
    assert found.f >= 0.999 * TOPPRA  # whose grid is as fine as to be near the optimum
    assert off_path(path, found.trajectory.curve, law(path, 2, 8).legs) < 1e-12


@pytest.mark.slow
def test_jerk_and_torque_limits_are_proved_as_well(path: JointPath) -> None:
    problem = retimed(arm(acceleration=8.0, jerk=60.0), path, 4, rest=2, payload=PAYLOAD)
    found = ot.solve(problem, certify=False)
    assert found.audit is not None and found.audit.proved
    assert TOPPRA < found.f < 1.15 * TOPPRA
    assert {row.limit for row in found.audit.rows} >= {"jerk-limit", "effort-limit", FORWARD, "rest", "via"}


@pytest.mark.slow
def test_levels_lead_to_more_pieces(path: JointPath) -> None:
    found = ot.solve(refined(arm(acceleration=8.0), path, 2, 8), certify=False)
    assert found.audit is not None and found.audit.proved
    assert found.f <= 1.01 * TOPPRA and "by levels" in found.detail


@pytest.mark.slow
def test_a_law_that_runs_back_breaks_the_forward_limit(path: JointPath) -> None:
    problem = retimed(arm(acceleration=8.0), path, 2)
    made = law(path, 2)
    x = made.guess(np.random.default_rng(0))
    kept = audit(trajectory_of(problem, x), problem.requirements)
    assert not [row for row in kept.failures if row.limit == FORWARD]
    x[4] *= 8.0  # far too long for the speeds at its ends: between them it has to run back
    broken = audit(trajectory_of(problem, x), problem.requirements)
    assert [row.verdict for row in broken.rows if row.limit == FORWARD] == ["violated"]


@pytest.mark.slow
def test_a_motion_is_retimed_along_its_own_geometry() -> None:
    robot = arm(acceleration=8.0, jerk=60.0)
    slow = cubic_spline_free_ends(wander(5), np.full(6, 1.0))
    own = JointPath.of_curve(slow, robot.joints)
    made = retiming(own, robot.limits, pieces=2, rest=2)
    labels = [label for v in made.variables for label in v.labels]
    assert "s'0" in labels and "s''12" in labels  # it rests at its ends whatever the law
    x = some(made)
    assert off_path(own, made.curve(x), made.legs) < 1e-12
    assert np.abs(made.variables_of(made.curve(x)) - x).max() < 1e-7
    found = ot.solve(retimed(robot, own, 2, rest=2), certify=False)
    assert found.audit is not None and found.audit.proved and found.f < 0.6 * slow.duration


@pytest.mark.slow
def test_snap_limits_are_proved_on_a_smoother_path() -> None:
    robot = arm(acceleration=8.0, jerk=60.0, snap=1500.0)
    smooth = JointPath.through(wander(6), robot.joints, degree=5)
    found = ot.solve(retimed(robot, smooth, 2, rest=2), certify=False)
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    assert set(found.trajectory.curve.degrees) == {35}


def nonics() -> PiecewiseBezier:
    states = [np.vstack([q, np.zeros((4, 6))]) for q in wander(3)]
    return nonic(states, np.ones(2))


@pytest.mark.parametrize(
    ("points", "limits", "more", "words"),
    [
        (wander(6), {"snap": 1500.0}, {}, "snap is limited, and the path's .* up to the 2. alone"),
        (wander(6), {}, {"rest": 4}, "rest: 4; give 0 to 3"),
        (wander(6), {}, {"pieces": 0}, "pieces: 0; give 1 or more"),
        (wander(4) + [0, 0, 5, 0, 0, 0], {}, {}, "the path takes 'elbow_joint' to .* beyond its limit"),
        ([[0] * 6, [1] * 6, [0.5] * 6, [0.7] * 6], {}, {}, "turns back between its points"),
        (nonics(), {"snap": 1500.0}, {}, "degree 9 with a time law of degree 7 makes segments of degree 63"),
    ],
)  # fmt: skip
def test_paths_that_cannot_be_timed_are_refused(points: object, limits: dict, more: dict, words: str) -> None:
    robot = arm(**limits)
    made = JointPath.of_curve if isinstance(points, PiecewiseBezier) else JointPath.through
    with pytest.raises(InputError, match=words):
        retiming(made(points, robot.joints), robot.limits, **{"pieces": 2, **more})


@pytest.mark.slow
def test_a_limit_that_is_infinite_is_none() -> None:
    path = JointPath.through(wander(6), arm().joints)
    free, given = (retiming(path, arm(**more).limits) for more in ({}, {"snap": np.inf}))
    assert [v.id for v in free.variables] == [v.id for v in given.variables] == ["T", "s'"]


@pytest.mark.slow
def test_a_corner_needs_a_stop() -> None:
    corner = PiecewiseBezier([1.0, 1.0], (wander(3)[:2], wander(3)[1:]))
    with pytest.raises(InputError, match="acceleration is limited"):
        retiming(JointPath.of_curve(corner, arm().joints), arm(acceleration=8.0).limits)
