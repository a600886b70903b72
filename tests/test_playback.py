from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

import ocp_traj as ot
from examples.own_robot import build
from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.interpolation import cut_at, interpolate, largest_distance, sub_arcs
from ocp_traj.errors import InputError
from ocp_traj.formulation.cut_requirements import cut_requirements
from ocp_traj.formulation.requirements import DurationConstraint, PathConstraint, Requirements
from ocp_traj.results.playback import Playback, at_knots, at_rate
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from tests.quintics import GOAL, START, quintics, ur5

# Durations of the fastest motion of examples.own_robot [s], to the last bit: its jerks rest on their limit.
FASTEST = np.array([
    0.11231548656231252, 0.3192111461236642, 0.37613838073104117, 0.4196997060043672, 0.7968033093750339,
    0.7248224918011817, 0.11933118246936393,
])  # fmt: skip


@pytest.fixture(scope="module")
def fast() -> Trajectory:
    """Cubics on a jerk limit of 60 rad/s3, proved."""
    found = trajectory_of(build(), FASTEST * (1.0 + 1e-9))
    assert found.audit().proved
    return found


@pytest.fixture(scope="module")
def welded() -> Trajectory:
    """Segments of degree 9 with limits up to snap, along a seam held to 0.5 mm."""
    problem = problems.load("weld-bezier")
    solution = ot.solve(problem, seed=0)
    assert solution.trajectory is not None and solution.trajectory.audit().proved
    return solution.trajectory


def played(trajectory: Trajectory, rate: float | None = None, interpolation: str = "quintic") -> Playback:
    assert trajectory.origin is not None
    limits = trajectory.origin.requirements
    if rate is None:
        return at_knots(trajectory, limits, interpolation)
    return at_rate(trajectory, limits, rate, interpolation)


def worst_jerk(found: Playback) -> float:
    return max(max(abs(e.lower), abs(e.upper)) for e in found.played.extrema(3))


# --- curves ---


def test_a_quintic_between_its_ends_states_is_itself() -> None:
    points = default_rng(0).normal(size=(6, 3))
    curve = PiecewiseBezier(np.array([0.7]), (points,))
    for degree, states in ((1, 1), (3, 2), (5, 3)):
        given = [np.vstack([curve.at(0, u, m)[0] for u in (0.0, 1.0)]) for m in range(states)]
        found = interpolate(np.array([0.7]), given)
        assert found.degrees == (degree,)
        for m in range(states):
            for u in (0.0, 1.0):
                np.testing.assert_allclose(found.at(0, u, m), curve.at(0, u, m), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.control_points[0], points, atol=1e-13)


def test_arcs_and_pieces_are_the_curve() -> None:
    rng = default_rng(1)
    curve = PiecewiseBezier(np.array([0.5, 2.0]), tuple(rng.normal(size=(n + 1, 2)) for n in (9, 4)))
    a, b = np.array([0.0, 0.25]), np.array([0.25, 0.9])
    for k, arc in enumerate(sub_arcs(curve.control_points[0], a, b)):
        np.testing.assert_allclose(arc, curve.restrict(0, a[k], b[k]), atol=1e-13)
    cut, source, start, end = cut_at(curve, np.array([0.1, 0.5, 1.3, 2.5]))
    assert source.tolist() == [0, 0, 1, 1] and start.tolist() == pytest.approx([0.0, 0.2, 0.0, 0.4])
    assert end.tolist() == pytest.approx([0.2, 1.0, 0.4, 1.0])
    times = np.linspace(0.0, 2.5, 77)
    for order in range(4):
        np.testing.assert_allclose(cut(times, order), curve(times, order), rtol=1e-9, atol=1e-9)


def test_a_distance_is_bounded_by_control_points() -> None:
    rng = default_rng(2)
    one, other = rng.normal(size=(5, 10, 3)), rng.normal(size=(5, 6, 3))
    bound = largest_distance(one, other)
    u = np.linspace(0.0, 1.0, 101)
    for k in range(5):
        pair = [PiecewiseBezier(np.array([1.0]), (points[k],)).at(0, u) for points in (one, other)]
        assert np.abs(pair[0] - pair[1]).max() <= bound[k]


# --- at knots ---


@pytest.mark.slow
def test_at_knots_a_motion_up_to_degree_five_is_proved_where_samples_exceed_its_jerk_limit(fast: Trajectory) -> None:
    sampled = played(fast, 199.0 / fast.duration)
    assert not sampled.proved and worst_jerk(sampled) > 80.0  # of 60
    assert sampled.excess == pytest.approx(worst_jerk(sampled) / 60.0 - 1.0, rel=1e-3)
    assert "jerk-limit shoulder_pan_joint violated: 86." in sampled.explain()
    found = played(fast)
    assert found.proved and worst_jerk(found) <= 60.0 * (1.0 + 1e-12) and found.excess == 0.0
    assert len(found.ticks) == 8 and found.deviation < 1e-8
    # Times are rounded up: never sooner than the trajectory, and 1 ns a segment and the slowing later at most.
    late = found.duration - fast.duration * found.factor
    assert 0.0 <= late <= 7e-9 and 0.0 <= found.factor - 1.0 < 1e-6
    assert (np.diff(found.ticks) * 1e-9 >= fast.curve.durations - 1e-14).all()


@pytest.mark.slow
def test_quintics_of_many_pieces_with_torques_and_jerk_are_proved() -> None:
    problem = quintics(ur5(), np.array([START, GOAL]), 2)
    solution = ot.solve(problem, seed=0)
    assert solution.trajectory is not None
    found = played(solution.trajectory)
    assert found.proved and found.duration == pytest.approx(solution.trajectory.duration, rel=1e-5)
    assert found.duration >= solution.trajectory.duration


@pytest.mark.slow
def test_lines_and_cubics_are_told_what_they_break(fast: Trajectory) -> None:
    lines = played(fast, interpolation="linear")
    assert lines.verdict == "violated" and lines.jump is not None and lines.jump.limit == "continuity of v"
    assert lines.not_carried == ("acceleration-limit", "jerk-limit", "effort-limit", "rest")
    assert "v jumps by 2.6" in lines.explain() and lines.played.degrees == (1,) * 7
    cubics = played(fast, interpolation="cubic")
    assert cubics.played.degrees == (3,) * 7 and "jerk-limit" in cubics.not_carried
    with pytest.raises(InputError, match="the interpolation is 'spline'; give linear, cubic, quintic"):
        played(fast, interpolation="spline")


@pytest.mark.slow
def test_higher_degrees_are_refitted_within_the_tolerance_and_snap_is_named(welded: Trajectory) -> None:
    assert welded.origin is not None
    points = []
    for tolerance in (1e-4, 1e-6, 1e-8):
        found = at_knots(welded, welded.origin.requirements, tolerance=tolerance)
        assert found.deviation <= tolerance + 1e-9 * found.factor  # a nanosecond at 1 rad/s
        times = np.linspace(0.0, 1.0, 4001)
        apart = found.played(times * found.played.duration) - welded.curve(times * welded.curve.duration)
        assert np.abs(apart).max() <= found.deviation + 1e-6  # the same share of the time is not the same local time
        points.append(len(found.ticks))
        assert not found.proved and found.carried is not None and found.carried.proved
        assert found.not_carried == ("snap-limit", "end", "start")
        assert "jerk jumps by" in found.explain() and "every other limit is proved" in found.explain()
    assert points == sorted(set(points)) and len(welded.curve.durations) + 1 < points[0]


def test_a_motion_without_limits_is_never_proved(fast: Trajectory) -> None:
    for found in (at_knots(replace(fast, origin=None), None), at_rate(fast, None, 50.0)):
        assert not found.proved and found.verdict == "undecided" and found.not_carried == ()
        assert found.explain().startswith("nothing is proved: the trajectory names no problem")


@pytest.mark.slow
def test_a_tolerance_no_quintics_can_meet_is_refused(welded: Trajectory) -> None:
    with pytest.raises(InputError, match="the tolerance is 0.0; give a number above zero"):
        at_knots(welded, None, tolerance=0.0)


# --- at a rate ---


@pytest.mark.parametrize("rate", [10.0, 125.0, 1000.0 / 3.0])
def test_samples_are_the_trajectory_at_whole_nanoseconds(fast: Trajectory, rate: float) -> None:
    found = played(fast, rate)
    assert found.ticks[0] == 0 and found.ticks[-1] == np.ceil(fast.duration * 1e9)
    steps = np.diff(found.ticks)
    assert np.abs(steps[:-1] - 1e9 / rate).max() <= 1.0 and 0.5 <= steps[-1] * rate / 1e9 <= 1.5
    for order, rows in enumerate(found.states):
        expected = fast.curve(np.minimum(found.ticks * 1e-9, fast.duration), order)
        np.testing.assert_allclose(rows, expected, atol=1e-12)


@pytest.mark.slow
def test_finer_samples_deviate_less_and_state_their_own_excess(fast: Trajectory) -> None:
    found = [played(fast, rate) for rate in (25.0, 100.0, 400.0)]
    assert [f.deviation for f in found] == sorted((f.deviation for f in found), reverse=True)
    for one in found:
        apart = one.played(one.ticks[:-1] * 1e-9 + 0.001) - fast.curve(one.ticks[:-1] * 1e-9 + 0.001)
        assert 0.0 < np.abs(apart).max() <= one.deviation
        assert one.excess == pytest.approx(worst_jerk(one) / 60.0 - 1.0, rel=1e-3)


@pytest.mark.slow
def test_a_seam_is_followed_between_samples_that_straddle_its_pieces(welded: Trajectory) -> None:
    """Limits with constants of each segment are put to the samples that lie on parts of two of them."""
    found = played(welded, 50.0)
    rows = {row.limit: row.verdict for row in found.audit.rows} if found.audit else {}
    assert rows["tcp"] == rows["tcp-distance"] == rows["tilt"] == "proved"
    coarse = played(welded, 0.5)
    assert coarse.excess > 1.0 and "tcp-distance squared violated" in coarse.explain()


# --- requirements of parts ---


def _requirements() -> Requirements:
    limit = PathConstraint(
        "ramp", lambda s: s.q[0] - s.c[0] * s.u, np.array([-np.inf]), np.array([0.1]), ("rad",), ("j",),
        constants=np.array([[1.0], [2.0]]), segments=(1,),
    )  # fmt: skip
    goals = np.array([[1.0], [2.0]])
    at = ot.PointConstraint("mid", lambda s: s.q, ((1, 0.5), (-1, 1.0)), goals, goals, ("rad",), ("j",))
    times = DurationConstraint("T", (1,), np.array([2.0]), np.array([2.0]))
    return Requirements(("j",), ("rad",), (limit,), (at,), duration_constraints=(times,))


def line(slope: float) -> PiecewiseBezier:
    return PiecewiseBezier(np.array([1.0, 2.0]), (np.zeros((2, 1)), np.array([[0.0], [slope]])))


@pytest.mark.parametrize(("height", "verdict"), [(2.0, "proved"), (2.3, "violated")])
def test_parts_of_segments_meet_what_the_segments_meet(height: float, verdict: str) -> None:
    whole = line(height)
    parts, source, a, b = cut_at(whole, np.array([0.5, 1.3, 2.0]))
    for curve, limits in ((whole, _requirements()), (parts, cut_requirements(_requirements(), source, a, b))):
        found = ot.audit(ot.Trajectory(curve, ("j",)), limits)
        rows = {row.limit: row.verdict for row in found.rows}
        assert rows["ramp"] == verdict and rows["T"] == "checked"
        assert rows["mid"] == ("checked" if verdict == "proved" else "violated")
