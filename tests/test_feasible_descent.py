"""Starts that stop at corners, proved as they stand, and what a descent by feasible steps makes of them."""

from pathlib import Path

import numpy as np
import pytest

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import hermite
from ocp_traj.curves.stops import with_stops
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.problems import load
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers import feasible_descent
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.feasible_descent import FeasibleDescent, descends
from ocp_traj.transcription.derivative_peaks import derivative_peaks
from ocp_traj.transcription.transcription import transcribe
from ocp_traj.transcription.worst_instants import lowest_instants

TIME = WeightedSum({"time": 1.0})
TASK = """
format = "ocp-traj/task/1"
robot = { description = "ur5", tool_frame = "tool0" }
limits = { acceleration = 8.0, jerk = 60.0 }
curve = { kind = "quintic", pieces = 6 }
[[move]]
via = [[-0.9, -1.2, 1.5, -1.8, -1.5, 0.0], [0.9, -1.0, 1.3, -1.8, -1.5, 0.0]]
[collision]
links = "given"
link = [{ frame = "wrist_3_link", from = [0, 0, 0], to = [0, 0, 0.1], radius = 0.05 }]
self = false
clearance = 0.01
[[collision.obstacle]]
name = "wall"
box = { centre = [0.55, 0.0, 0.2], size = [0.6, 0.05, 0.7] }
[solve]
start = "plan"
"""


@pytest.fixture(scope="module")
def problem(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    file: Path = tmp_path_factory.mktemp("task") / "task.toml"
    file.write_text(TASK)
    return load("task", file=str(file))


@pytest.mark.parametrize("rows", [3, 4, 5])
def test_a_polyline_with_stops_is_straight_at_rest_at_corners_and_as_quick_as_its_limits_allow(rows: int) -> None:
    rng = np.random.default_rng(rows)
    points, reach = rng.uniform(-2.0, 2.0, size=(4, 3)), rng.uniform(1.0, 9.0, size=(3, 3))
    reach[1, 2] = np.inf
    driven = with_stops(points, reach, rows, 7)
    assert driven is not None
    durations, states = driven
    curve = hermite(list(states), durations)
    # Every corner is a knot, at rest; times between are those of the edges.
    corners = [int(np.argmin(np.abs(states[:, 0] - p).sum(axis=1))) for p in points]
    assert corners == sorted(corners) and corners[0] == 0 and corners[-1] == 7
    assert np.abs(states[corners, 0] - points).max() < 1e-12 and np.abs(states[corners, 1:]).max() < 1e-9
    for a, b, p, q in zip(corners, corners[1:], points, points[1:], strict=False):
        part = PiecewiseBezier(durations[a:b], tuple(curve.control_points[a:b]))
        along = (np.concatenate(part.control_points) - p) / (q - p)
        assert np.abs(along - along[:, :1]).max() < 1e-9 and along.min() > -1e-9 and along.max() < 1.0 + 1e-9
        dense = np.linspace(0.0, part.duration, 4001)
        share = [np.abs(part(dense, k + 1)).max(axis=0) / reach[k] for k in range(3)]
        assert 0.99 < np.max(share) <= 1.0 + 1e-9
    assert with_stops(points, reach, rows, 2) is None


@pytest.mark.slow
def test_a_planned_start_is_proved_and_a_descent_leads_to_a_better_one_that_is(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(feasible_descent, "STEPS", 2)
    x = problem.guess(np.random.default_rng([0, 0]))
    ((first, audit),) = audit_points(problem, [x])
    assert audit.proved, audit.explain()
    assert descends(problem, TIME) and not descends(problem, WeightedSum({"time": 1.0, "movement": 1.0}))
    found = Exchange().solve(problem, TIME, x)
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    assert found.f == pytest.approx(float(found.trajectory.curve.duration), rel=1e-12)
    assert found.f < 0.9 * float(first.curve.duration)


def test_distances_to_first_order_are_those_at_a_point_and_their_slopes_there(problem: Problem) -> None:
    x = problem.guess(np.random.default_rng([0, 0]))
    instants = [i for i in lowest_instants(problem, x, 3.0) if i.limit == problem.chosen_limits[0].id]
    assert len(instants) > 20
    exact, linear = (transcribe(problem, TIME, instants, about=about).program for about in (None, x))
    assert np.abs(exact.values(x)[1] - linear.values(x)[1]).max() < 1e-12
    step = np.random.default_rng(1).normal(size=problem.size) * np.where(problem.upper > problem.lower, 1.0, 0.0)
    ends = [np.subtract(*(p.values(x + sign * 1e-6 * step)[1] for sign in (1.0, -1.0))) / 2e-6 for p in (exact, linear)]
    assert np.abs(ends[0]).max() > 0.1 and np.abs(ends[0] - ends[1]).max() < 1e-5 * np.abs(ends[0]).max()


def test_peaks_of_derivatives_are_what_no_sample_inside_a_segment_exceeds(problem: Problem) -> None:
    x = problem.guess(np.random.default_rng([0, 0]))
    curve = problem.curve(x)
    limits = {limit.id: limit for limit in problem.requirements.path_constraints if limit.order}
    found = derivative_peaks(problem, x, 0.3)
    assert {i.limit for i in found} <= set(limits) and len(found) > 3
    for instant in found:
        limit, (row,) = limits[instant.limit], instant.rows or (0,)
        # At a turning point the next derivative is zero, against its size on the segment.
        along = curve.at(instant.segment, np.array([instant.u, *np.linspace(0.0, 1.0, 51)]), int(limit.order or 0) + 1)
        assert abs(along[0, row]) < 1e-6 * np.abs(along[1:, row]).max()


def test_a_descent_that_is_stopped_has_what_it_has_proved(problem: Problem) -> None:
    x = problem.guess(np.random.default_rng([0, 0]))

    def stop(done: int, total: int, words: str) -> None:
        if done == 1:
            raise KeyboardInterrupt

    found = FeasibleDescent(problem, TIME, stop).solve(x)
    assert found is not None and found.interrupted == "after 1 steps of descent"
    assert found.audit is not None and found.audit.proved
    assert found.f < float(problem.curve(x).duration)


def test_a_start_that_is_not_proved_is_none_to_descend_from(problem: Problem) -> None:
    x = problem.guess(np.random.default_rng([0, 0]))
    assert problem.dilate is not None
    assert FeasibleDescent(problem, TIME).solve(problem.dilate(x, 0.5)) is None
