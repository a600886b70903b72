"""Limits on derivatives held at control points, on the quintics of a UR5; and what many pieces cost."""

import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.rows import Conflict
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.transcription import BACK_OFF, transcribe
from ocp_traj.transcription.worst_instants import worst_instants
from tests.closed_form import quintic_problem
from tests.quintics import (
    ACCELERATION,
    GOAL,
    HULL,
    JERK,
    START,
    curves,
    halved,
    held_at_control_points,
    quintics,
    ur5,
    wander,
)  # fmt: skip

TIME = WeightedSum({"time": 1.0})
NEARBY = {"mu_init": 1e-3, "bound_push": 1e-4, "bound_frac": 1e-4}  # of IPOPT, from a like curve's solution
SLOWER = 1.0005  # so that such a start is inside its limits


@pytest.fixture(scope="module")
def robot() -> ot.Robot:
    return ur5()


@pytest.fixture(scope="module")
def two(robot: ot.Robot) -> Solution:
    """Through six points, two pieces from one to the next, from the solution with one, halved."""
    points = wander(6)
    one = held_at_control_points(quintics(robot, points, 1))
    whole = _curve(Exchange().solve(one, TIME, one.guess(np.random.default_rng(0))))
    return _from(robot, points, halved(whole), 2, NEARBY)


def _curve(solution: Solution) -> PiecewiseBezier:
    assert solution.trajectory is not None
    return solution.trajectory.curve


def _from(robot: ot.Robot, points: Array, curve: PiecewiseBezier, pieces: int, options: dict[str, object]) -> Solution:
    """From a curve, with a duration for each piece."""
    made = curves(robot, points, pieces, even=False)
    problem, x = quintics(robot, points, pieces, made=made), made.variables_of(curve.dilate(SLOWER))
    return Exchange(Ipopt(options=options)).solve(problem, TIME, x)


def _is_proved_at_once(solution: Solution) -> bool:
    return solution.audit is not None and solution.audit.proved and solution.rounds == 1


def test_time_optimal_quintics_are_proved_after_one_round(two: Solution) -> None:
    assert _is_proved_at_once(two)
    assert two.f == pytest.approx(2.4539, abs=5e-5)  # [s], as first found, without this package's transcription


@pytest.mark.slow
def test_seven_pieces_from_point_to_point_are_the_seven_phases_of_least_time(robot: ot.Robot) -> None:
    """Bounded jerk, acceleration and speed of the joint that takes longest: D / v + v / a + a / j from rest to rest."""
    points = np.stack([START, GOAL])
    shared = quintics(robot, points, 7)
    even = Exchange().solve(shared, TIME, shared.guess(np.random.default_rng(0)))
    assert _is_proved_at_once(even)
    free = _from(robot, points, _curve(even), 7, NEARBY)
    bounds = robot.limits.bounds("velocity")
    assert bounds is not None
    speed = float(bounds[1][0])
    least = (GOAL - START)[0] / speed + speed / ACCELERATION + ACCELERATION / JERK
    assert _is_proved_at_once(free)
    assert free.f == pytest.approx(least, rel=1e-6) and even.f == pytest.approx(least, rel=0.02)


# --- rows ---


def test_hull_rows_are_the_derivatives_control_points_and_each_once(robot: ot.Robot) -> None:
    problem = quintics(robot, wander(3), 2)
    nlp = transcribe(problem, TIME, few_instants(problem))
    x = problem.guess(np.random.default_rng(1)) + 0.1 * np.random.default_rng(2).normal(size=problem.size) ** 2
    _, g = nlp.program.values(x)
    curve = trajectory_of(problem, x).curve
    orders = {limit.id: limit.order for limit in problem.requirements.path_constraints}
    assert len(set(nlp.rows)) == len(nlp.rows)
    for order, name in enumerate(HULL):
        rows = [i for i, row in enumerate(nlp.rows) if row.limit == name]
        # What the C2 curve has at a knot from both sides is held once.
        assert orders[name] == order and len(rows) == 6 * (4 * (6 - order) - 3 * (order <= 2))
        for i in rows:
            row = nlp.rows[i]
            assert row.control is not None
            value = curve.hodograph(row.segment, order)[row.control, robot.joints.index(row.label)]
            assert g[i] * row.scale == pytest.approx(value, rel=1e-10, abs=1e-10)
    assert all(row.control is None for row in nlp.rows if row.limit not in HULL)


def test_where_hull_rows_hold_a_limit_no_peak_is_added_and_a_broken_limit_is_seen(two: Solution) -> None:
    problem = quintics(ur5(), wander(6), 2, even=False)
    x = two.x[: problem.size]
    assert worst_instants(problem, x, BACK_OFF) == ([], 0.0)
    times = len(problem.variables[0].labels)
    peaks, excess = worst_instants(problem, np.concatenate([0.9 * x[:times], x[times:]]), BACK_OFF)
    assert excess > 0.1 and {peak.limit for peak in peaks} & set(HULL)


def test_a_row_on_a_control_point_is_told_as_such(robot: ot.Robot) -> None:
    problem = held_at_control_points(quintics(robot, wander(3), 1))
    (row, *_) = [r for r in transcribe(problem, TIME, few_instants(problem)).rows if r.limit == "jerk-limit"]
    words = str(Conflict(row, 70.0, 60.0, 10.0))
    place = "jerk-limit shoulder_pan_joint at segment 0, control point 0"
    assert words == f"{place}: 70, allowed 60 rad/s3 (off by 10 rad/s3, 16.7 %)"


def test_hull_rows_of_what_is_no_derivative_are_refused() -> None:
    with pytest.raises(ProblemDefinitionError, match="hull rows of 'jerk-limit', no limit on a derivative"):
        replace(quintic_problem(), tuning=Tuning(hull_rows=("jerk-limit",)))


# --- many pieces ---


def _transcribed(robot: ot.Robot, pieces: int) -> tuple[NLP, float]:
    """The NLP of a path of so many pieces, peaks included, and the CPU time that it took [s]."""
    begun = time.process_time()
    problem = quintics(robot, wander(pieces // 2 + 1), 2)
    few = few_instants(problem)
    peaks, _ = worst_instants(problem, problem.guess(np.random.default_rng(0)), BACK_OFF)
    assert all(peak.slope is None or len(peak.slope) < 50 for peak in peaks)
    return transcribe(problem, TIME, [*few, *peaks[:pieces]]), time.process_time() - begun


def test_nonzeros_grow_as_the_pieces_do(robot: ot.Robot) -> None:
    sizes = []
    for pieces in (4, 8, 12):
        program = transcribe(
            problem := quintics(robot, wander(pieces // 2 + 1), 2), TIME, few_instants(problem)
        ).program
        sizes.append([program.jacobian_sparsity.nnz(), program.hessian_sparsity.nnz()])
    assert_allclose(np.diff(sizes, 2, axis=0), 0.0, atol=0)


@pytest.mark.slow
def test_a_path_twice_as_long_takes_about_twice_the_time_to_build(robot: ot.Robot) -> None:
    _transcribed(robot, 20)
    short, long = (min(_transcribed(robot, pieces)[1] for _ in range(3)) for pieces in (100, 200))
    assert long < 3.0 * short  # four times, were it quadratic; a busy machine has made it 2.51
