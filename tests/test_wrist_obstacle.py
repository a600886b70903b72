"""The wrist of El Haiek et al. (2019): its curve, its obstacles, its known optima, all checked without the package."""

import json
from collections.abc import Sequence
from dataclasses import replace
from math import asin, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.testing import assert_allclose
from pytest import approx

from ocp_traj import pareto, problems, solve
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.problems import wrist_obstacle as paper
from ocp_traj.problems.wrist import directions, pointing
from ocp_traj.proof.audit import audit
from ocp_traj.proof.values import limit_on
from ocp_traj.results.time_scaling import TimeScaling
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.robot.collision import least_clearance
from ocp_traj.solvers.ga import GA
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import uniform_instants
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from ocp_traj.transcription.transcription import transcribe
from tests.independent.check import broken, excesses
from tests.independent.motion import Motion
from tests.independent.robots import WristRobot, efforts
from tests.independent.wrist import segment_distance, tip, tips, wrist_angles

FITNESS = WeightedSum({"fitness": 1.0})
BLOCKED, OPEN = 4.46973957, 2.76640438  # fitness; found by other code as 4.4698 and 2.7664
SPHERE = (0.5, 0.5, 0.0, 0.4)  # the paper's place, our size
SECOND = (-0.3, 0.9, 0.6, 0.2)
FAR = (0.0, 2.2, 0.0, 0.3)  # sqrt(2.2^2 - 0.35^2) = 2.17 > d3 = 2: the tip, not the direction, says what is clear
LINK = 0.05
V_MAX, A_MAX = np.array([2.0, 2.0, 3.0]), np.array([10.0, 10.0, 15.0])


# --- the wrist again, sharing nothing with the package ---


class Polynomials:
    """Quartic, then quintic, joint by joint, each the solution of its own boundary conditions."""

    def __init__(self, start: np.ndarray, x: np.ndarray, goal: np.ndarray) -> None:
        via, speed, (t1, t2) = x[:3], x[3:6], x[7:9]
        last = np.array([goal[0], goal[1], x[6]])
        self.durations = np.array([t1, t2])
        first = [self._through([(0, 0, a), (0, 1, 0), (0, 2, 0), (t1, 0, b), (t1, 1, v)])
                 for a, b, v in zip(start, via, speed, strict=True)]  # fmt: skip
        bent = [p.deriv(2)(t1) for p in first]
        second = [self._through([(0, 0, b), (0, 1, v), (0, 2, c), (t2, 0, e), (t2, 1, 0), (t2, 2, 0)])
                  for b, v, c, e in zip(via, speed, bent, last, strict=True)]  # fmt: skip
        self.segments = (first, second)

    @staticmethod
    def _through(conditions: list[tuple[float, int, float]]) -> Polynomial:
        """The polynomial with given derivatives: (time, order, value)."""
        n = len(conditions)
        units = [Polynomial.basis(k) for k in range(n)]
        matrix = [[(unit.deriv(order) if order else unit)(t) for unit in units] for t, order, _ in conditions]
        return Polynomial(np.linalg.solve(np.array(matrix), [value for *_, value in conditions]))

    def at(self, order: int, samples: int) -> np.ndarray:
        """A derivative on both segments ``(2 samples, 3)``."""
        return np.concatenate(
            [
                np.stack([(p.deriv(order) if order else p)(np.linspace(0.0, T, samples)) for p in segment], axis=1)
                for segment, T in zip(self.segments, self.durations, strict=True)
            ]
        )

    def variation(self) -> float:
        """Total variation of the joints, by the roots of their velocities."""
        total = 0.0
        for segment, T in zip(self.segments, self.durations, strict=True):
            for p in segment:
                inner = sorted(r.real for r in p.deriv().roots() if abs(r.imag) < 1e-9 and 0.0 < r.real < T)
                total += np.abs(np.diff([p(t) for t in (0.0, *inner, T)])).sum()
        return float(total)


def polynomials(problem: Problem, x: np.ndarray) -> Polynomials:
    branch = 0 if problem.case.branch == "best" else int(problem.case.branch)
    ends = [wrist_angles(point, b) for point, b in zip(problem.case.ends, (0, branch), strict=True)]
    return Polynomials(np.array([*ends[0], 0.0]), np.asarray(x), np.array(ends[1]))


def least_distance(curve: Polynomials, sphere: Sequence[float], samples: int = 4001) -> float:
    """Between the link's axis and a sphere's centre, over a fine scan, less the radii; < 0 where they overlap."""
    return float(segment_distance(tips(curve.at(0, samples)), np.array(sphere[:3])).min() - sphere[3] - LINK)


def check(problem: Problem, x: np.ndarray) -> None:
    """Every limit, recomputed; and the curve is that of the variables."""
    data = trajectory_of(problem, x).to_dict()
    assert not broken(excesses(data))
    curve = polynomials(problem, x)
    found = np.concatenate([Motion.read(data).at(k, np.linspace(0.0, 1.0, 101)) for k in (0, 1)])
    assert_allclose(found, curve.at(0, 101), atol=1e-9)


@pytest.fixture(scope="module")
def wrist() -> Problem:
    return problems.load("wrist-obstacle", branch="0")


def random_x(problem: Problem, seed: int) -> np.ndarray:
    return problem.guess(np.random.default_rng(seed))


# --- curve and objectives ---


@pytest.mark.parametrize("changes", [{"branch": "0"}, {"branch": "1"}, {"case": "open", "branch": "1"}], ids=str)
def test_the_curve_is_the_polynomials_of_its_boundary_conditions(changes: dict[str, Any]) -> None:
    problem = problems.load("wrist-obstacle", **changes)
    for seed in range(5):
        x = random_x(problem, seed)
        ours, theirs = trajectory_of(problem, x).curve, polynomials(problem, x)
        u = np.linspace(0.0, 1.0, 101)
        for order in range(3):
            found = np.concatenate([ours.at(k, u, order) for k in (0, 1)])
            assert_allclose(found, theirs.at(order, 101), atol=1e-9 * np.abs(theirs.at(order, 101)).max())


def test_the_coefficients_of_the_paper_as_they_must_read() -> None:
    """(8) needs - 3 v0 T - a0 T^2, b4 is missing; the acceleration at the via point follows from the quartic."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        q0, q1, v0, v1, a0, a1, T = (*rng.normal(size=6), rng.uniform(0.3, 2.0))
        quartic = Polynomials._through([(0, 0, q0), (0, 1, v0), (0, 2, a0), (T, 0, q1), (T, 1, v1)])
        assert quartic.coef[3] == approx((4 * q1 - v1 * T - 4 * q0 - 3 * v0 * T - a0 * T**2) / T**3)
        assert quartic.coef[4] == approx((v1 * T - 3 * q1 + 3 * q0 + 2 * v0 * T + a0 * T**2 / 2) / T**4)
        assert quartic.deriv(2)(T) == approx(a0 + 6 * (v0 + v1) / T - 12 * (q1 - q0) / T**2)
        printed = (4 * q1 - v1 * T - 4 * q0 - 3 * a0 * T**2) / T**3
        assert printed != approx(quartic.coef[3])
        quintic = Polynomials._through(
            [(0, 0, q0), (0, 1, v0), (0, 2, a0), (T, 0, q1), (T, 1, v1), (T, 2, a1)]
        )  # fmt: skip
        b4 = (-30 * (q1 - q0) + (14 * v1 + 16 * v0) * T + (3 * a0 - 2 * a1) * T**2) / (2 * T**4)
        assert quintic.coef[4] == approx(b4)


def test_distance_is_the_total_variation_by_roots_and_by_a_scan(wrist: Problem) -> None:
    for seed in range(10):
        x = random_x(wrist, seed)
        found = evaluate_objectives(wrist, x)
        curve = polynomials(wrist, x)
        scan = np.abs(np.diff(curve.at(0, 20_001), axis=0)).sum()
        assert found["distance"] == approx(curve.variation(), rel=1e-10)
        assert found["distance"] == approx(scan, rel=1e-6) and scan <= found["distance"] * (1 + 1e-12)
        assert found["time"] == approx(x[7] + x[8], rel=1e-15)
        assert found["fitness"] == approx(found["time"] + found["distance"], rel=1e-15)


def test_slower_by_s_has_the_same_path_and_peaks_that_fall_as_s(wrist: Problem) -> None:
    assert wrist.dilate is not None
    for seed in range(5):
        x, s = random_x(wrist, seed), 1.37
        one, two = polynomials(wrist, x), polynomials(wrist, wrist.dilate(x, s))
        for order in range(3):
            slower = one.at(order, 301) / s**order
            assert_allclose(two.at(order, 301), slower, atol=1e-9 * np.abs(slower).max())
        assert two.variation() == approx(one.variation(), rel=1e-10)


# --- kinematics, obstacles, dynamics ---


def test_both_branches_point_the_link_at_the_point() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        point = rng.normal(size=3)
        point *= 2.0 / np.linalg.norm(point)
        for branch in (0, 1):
            th1, th2 = pointing(point, branch)
            assert abs(th1) <= pi and abs(th2) <= pi
            assert (th1, th2) == approx(wrist_angles(point, branch), abs=1e-12)
            assert_allclose(tip((th1, th2, rng.uniform(-pi, pi))), point, atol=1e-12)


@pytest.mark.slow
def test_the_limit_is_met_exactly_where_the_whole_link_is_clear() -> None:
    """Spheres within reach, by a cosine, and those whose far side the tip does not reach, by a sweep of the link."""
    rng = np.random.default_rng(2)
    seen = {(name, clear): 0 for name in ("obstacles", "far-obstacles") for clear in (True, False)}
    plain = problems.load("wrist-obstacle", branch="0")
    for trial in range(60):
        x = random_x(plain, trial)
        x[9] = 0.0
        # Near the way of the tip, so that there is something to hit.
        centre = tip(trajectory_of(plain, x).curve.at(trial % 2, rng.uniform(0.2, 0.8))[0]) * rng.uniform(0.4, 1.3)
        centre += 0.2 * rng.normal(size=3)
        radius = float(rng.uniform(0.1, 0.6))
        if np.linalg.norm(centre) < radius + 2.0 * LINK:
            continue
        problem = problems.load("wrist-obstacle", branch="0", obstacles=((*centre.tolist(), radius),))
        (limit,) = [c for c in problem.requirements.path_constraints if c.id.endswith("obstacles")]
        within = 2.0 >= sqrt(centre @ centre - (radius + LINK) ** 2)
        assert limit.id == ("obstacles" if within else "far-obstacles") and limit.sweep == (not within)
        moving = trajectory_of(problem, x)
        u = np.linspace(0.0, 1.0, 40)
        for k in (0, 1):
            values = limit_on(moving, problem.requirements, limit, k, u)[0]
            for q, value in zip(moving.curve.at(k, u), values, strict=True):
                gap = segment_distance(tip(q), centre) - radius - LINK
                if abs(gap) > 0.02:  # a swept limit is looked at in 17 places here; the proof has no such gap
                    assert (value <= 0.0) == (gap > 0.0)
                    seen[limit.id, gap > 0.0] += 1
    assert min(seen.values()) > 20, seen


def test_clearance_is_the_angle_by_which_an_obstacle_may_grow(wrist: Problem) -> None:
    """An obstacle seen from the base under a half angle larger by the clearance touches the link, and no smaller."""
    size = sqrt(0.5)
    for seed in range(10):
        x = random_x(wrist, seed)
        found = least_clearance(trajectory_of(wrist, x).curve, directions, paper.obstacles(wrist.case))
        radius = size * np.sin(asin((0.4 + LINK) / size) + found)
        assert 0.0 < radius < size
        assert least_distance(polynomials(wrist, x), (0.5, 0.5, 0.0, radius - LINK)) == approx(0.0, abs=1e-5)


def test_efforts_are_pinocchios() -> None:
    """Cylinders of 1.2 and 0.8 kg, a rod of 0.25 kg and 0.2 m, and 0.30 kg at its tip."""
    machine = WristRobot()
    problem = problems.load("wrist-obstacle", branch="0", effort_limits=True)
    (limit,) = [c for c in problem.requirements.path_constraints if c.id == "effort-limit"]
    assert_allclose(limit.upper, [1.0, 2.0, 0.2])
    for seed in range(5):
        moving = trajectory_of(problem, random_x(problem, seed))
        u = np.linspace(0.0, 1.0, 11)
        for k in (0, 1):
            states = [moving.curve.at(k, u, order) for order in range(3)]
            theirs = efforts(machine, *states)
            ours = limit_on(moving, problem.requirements, limit, k, u).T
            assert_allclose(ours, theirs, atol=1e-10 * np.abs(theirs).max())


# --- known optima ---


def test_the_blocked_case_has_its_known_optimum(wrist: Problem) -> None:
    solution = solve(wrist, starts=1)
    assert solution.status is Status.SOLVED and solution.audit is not None and solution.audit.proved
    assert solution.f == approx(BLOCKED, abs=1e-7)
    assert solution.objectives["time"] == approx(1.3281, abs=5e-5)
    assert solution.objectives["distance"] == approx(pi, abs=1e-7)
    check(wrist, solution.x)
    curve = polynomials(wrist, solution.x)
    assert solution.f == approx(sum(curve.durations) + curve.variation(), abs=1e-9)
    assert least_distance(curve, SPHERE) < 1e-6  # the obstacle is touched
    assert np.abs(curve.at(0, 101)[:, 2]).max() < 1e-9  # theta3 does not matter, and does not move


def test_the_open_case_has_its_known_optimum_and_does_not_touch_the_obstacle() -> None:
    problem = problems.load("wrist-obstacle", case="open", branch="0")
    solution = solve(problem, starts=1)
    assert solution.audit is not None and solution.audit.proved
    assert solution.f == approx(OPEN, abs=1e-7)
    check(problem, solution.x)
    assert least_distance(polynomials(problem, solution.x), SPHERE) > 0.03
    free = problems.load("wrist-obstacle", case="open", branch="0", obstacles="none")
    assert solve(free, starts=1).f == approx(OPEN, abs=1e-7)


@pytest.mark.slow
def test_both_branches_are_solved_and_the_better_one_chosen() -> None:
    solution = solve(problems.load("wrist-obstacle"))
    assert solution.f == approx(BLOCKED, abs=1e-7)
    assert {name: s.f for name, s in solution.alternatives.items()}["branch 0"] == solution.f
    other = solution.alternatives["branch 1"]
    assert other.audit is not None and other.audit.proved and other.f > 11.0
    check(problems.load("wrist-obstacle", branch="1"), other.x)


@pytest.mark.slow
def test_without_obstacles_no_clearance_is_spoken_of() -> None:
    problem = problems.load("wrist-obstacle", branch="0", obstacles=())
    assert [o.id for o in problem.objectives] == ["time", "distance", "fitness"]
    solution = solve(problem)
    assert solution.f == approx(4.3372007, abs=1e-6)
    check(problem, solution.x)


@pytest.mark.slow
def test_most_starts_of_a_branch_end_in_its_best_optimum(wrist: Problem) -> None:
    solution = solve(wrist, starts=20, all_optima=True)
    best, *others = solution.optima
    assert best.solution.f == approx(BLOCKED, abs=1e-7) and best.starts > 10
    assert others and min(o.solution.f for o in others) == approx(7.62946, abs=1e-5)
    assert len({o.homotopy_class for o in solution.optima}) > 1
    for optimum in solution.optima:
        check(wrist, optimum.solution.x)


# --- obstacles of one's own ---


@pytest.mark.slow
def test_two_spheres_are_both_cleared() -> None:
    """The second sphere stands in the way of the optimum past the first."""
    centre = 1.2 * tip((1.9, 1.9, 0.0)) / 2.0
    spheres = (SPHERE, (*centre.tolist(), 0.15))
    problem = problems.load("wrist-obstacle", branch="0", obstacles=spheres)
    solution = solve(problem, starts=3)
    assert solution.audit is not None and solution.audit.proved
    check(problem, solution.x)
    one = problems.load("wrist-obstacle", branch="0")
    assert solution.f > BLOCKED + 1e-4
    assert least_distance(polynomials(one, solve(one, starts=1).x), spheres[1]) < 0.0


@pytest.mark.slow
def test_an_obstacle_beyond_the_tips_reach_is_passed_by_the_tip_itself() -> None:
    problem = problems.load("wrist-obstacle", branch="0", obstacles=(FAR,))
    assert [c.id for c in problem.requirements.path_constraints][-1] == "far-obstacles"
    solution = solve(problem, starts=1)
    assert solution.status is Status.SOLVED and solution.audit is not None and solution.audit.proved
    check(problem, solution.x)
    assert least_distance(polynomials(problem, solution.x), FAR) < 1e-6  # it is touched
    assert solution.f > 4.3372007  # without an obstacle, see below


def far_from_the_solver(problem: Problem) -> str:
    solution = solve(problem)
    assert solution.status is Status.INFEASIBLE and solution.trajectory is None
    return solution.explain()


def test_an_obstacle_that_touches_an_end_is_named_with_its_depth() -> None:
    start, goal = np.array([-1.0, 1.0, -sqrt(2.0)]), np.array([1.0, 1.0, sqrt(2.0)])
    for end, point in (("start", start), ("goal", goal)):
        centre = 0.6 * point + np.array([0.05, 0.05, 0.0])
        words = far_from_the_solver(problems.load("wrist-obstacle", obstacles=((*centre.tolist(), 0.3),)))
        overlap = 0.3 + LINK - segment_distance(point, centre)
        assert f"touches the link at the {end}: they overlap by {overlap:.4g}" in words
    around = far_from_the_solver(problems.load("wrist-obstacle", obstacles=((1.0, 1.0, 1.4, 0.5),)))
    assert "obstacle 1 (centre 1, 1, 1.4, radius 0.5, link radius 0.05) touches the link at the goal" in around
    assert "\n" not in around
    tight = far_from_the_solver(problems.load("wrist-obstacle", min_clearance=0.2))
    assert "leaves 0.09558 rad of clearance at the goal, 0.2 is asked for" in tight


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("obstacles", "0.1:0.1:0:0.3", "reaches the link's base at the origin"),
        ("obstacles", "0.5:0.5:0", "give rows of 4 numbers, such as 0.5:0.5:0:0.4, more of them after a semicolon, or"),
        ("obstacles", "0.5:0.5:0:-1", "the radius above zero"),
        ("start", (1.0, 0.0, 0.0), "the tip moves at d3 = 2 from it"),
        ("case", "shut", "allowed are blocked, open"),
        ("branch", "2", "allowed are best, 0, 1"),
        ("min_clearance", -0.1, "give an angle from 0"),
        ("min_clearance", 2.5, "from obstacle 1 no motion has more than 2.45"),
        ("weights", (0.0, 0.0), "zero or more and not all zero"),
        ("min_time", 5.0, "min_time 5.0 s and max_time 4.0 s leave nothing between"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(field: str, value: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        problems.load("wrist-obstacle", **{field: value})
    assert "\n" not in str(caught.value)


def test_a_clearance_that_no_angle_can_be_is_not_proved_but_refused() -> None:
    """Beyond a right angle, or two, sines and cosines of the grown half angle fall back to what is met."""
    for sphere, most in ((FAR, pi / 2.0 - asin(0.35 / 2.2)), ((0.0, -0.7, 0.0, 0.6), pi - asin(0.65 / 0.7))):
        with pytest.raises(InputError, match=f"obstacle 1 no motion has more than {most:.6g} rad"):
            problems.load("wrist-obstacle", obstacles=(sphere,), min_clearance=3.1)
        assert problems.load("wrist-obstacle", obstacles=(sphere,), min_clearance=most - 0.01)


def test_the_command_line_says_how_no_obstacle_is_written(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "wrist-obstacle", "--set", "obstacles="]) == 2
    assert "none" in capfd.readouterr().err
    assert run(["show", "wrist-obstacle", "--set", "obstacles=none", "--json"]) == 0
    shown = json.loads(capfd.readouterr().out)
    assert "obstacles" not in json.dumps(shown["limits"])
    assert run(["solve", "wrist-obstacle", "--set", "obstacles=1:1:1.4142:0.5"]) == 1
    assert "touches the link at the goal" in capfd.readouterr().err
    assert run(["solve", "wrist-obstacle", "--set", "obstacles=0.1:0.1:0:0.3"]) == 2


# --- proof ---


def test_a_sampled_solution_without_margin_is_caught_between_its_samples(wrist: Problem) -> None:
    nlp = transcribe(wrist, FITNESS, uniform_instants(wrist, 20), back_off=0.0)
    sampled = Ipopt().solve(nlp, nlp.start(random_x(wrist, 0)))
    assert sampled.status is Status.SOLVED
    x = sampled.x[: wrist.size]
    found = audit(trajectory_of(wrist, x), wrist.requirements)
    (row,) = [row for row in found.rows if row.limit == "obstacles"]
    curve = polynomials(wrist, x)
    at_samples = least_distance(curve, SPHERE, 20)
    assert at_samples > -1e-9 and least_distance(curve, SPHERE) < -1e-6
    assert row.verdict == "violated" and f"obstacles obstacle 1 violated: {row.attained:.6g} at t = " in found.explain()
    k = int(row.instant > curve.durations[0])
    q = [p(row.instant - k * curve.durations[0]) for p in curve.segments[k]]
    assert segment_distance(tip(q), np.array(SPHERE[:3])) < SPHERE[3] + LINK  # there and then


def test_a_margin_of_ten_microradians_is_proved_in_few_pieces(wrist: Problem) -> None:
    problem = problems.load("wrist-obstacle", branch="0", min_clearance=1e-5)
    solution = solve(problem, starts=1)
    assert solution.audit is not None and solution.audit.proved
    assert BLOCKED < solution.f < BLOCKED + 1e-4
    (row,) = [row for row in solution.audit.rows if row.limit == "obstacles"]
    assert row.boxes <= 200
    assert least_distance(polynomials(problem, solution.x), SPHERE) == approx(1e-5 * sqrt(0.5 - 0.45**2), rel=1e-2)
    without = trajectory_of(wrist, np.append(solution.x[:9], 0.0)).audit()
    (row,) = [row for row in without.rows if row.limit == "obstacles"]
    assert row.verdict == "proved" and row.margin > 1e-6 and row.boxes <= 200


@pytest.mark.slow
def test_limits_on_efforts_bind_and_are_proved() -> None:
    plain = {"branch": "0", "effort_limits": True}
    problem = problems.load("wrist-obstacle", **plain, max_effort=(0.1, 2.0, 0.2))
    solution = solve(problem, starts=2)
    assert solution.audit is not None and solution.audit.proved
    check(problem, solution.x)
    (row,) = [row for row in solution.audit.rows if (row.limit, row.label) == ("effort-limit", "theta1")]
    assert row.margin < 1e-6 and solution.f > BLOCKED + 1e-3
    assert solve(problems.load("wrist-obstacle", **plain), starts=1).f == approx(BLOCKED, abs=1e-7)


# --- fronts ---


@pytest.mark.slow
def test_time_against_clearance_is_a_front_from_touching_to_the_ends_own_clearance(wrist: Problem) -> None:
    front = pareto(wrist, ["time", "clearance"], points=6, seed=0)
    table = front.table.sort_values("time [s]")
    assert len(table) == 6 and (table["verdict"] == "proved").all()
    times, rooms = table["time [s]"].to_numpy(), table["clearance [rad]"].to_numpy()
    assert (np.diff(times) > 0.0).all() and (np.diff(rooms) > 0.0).all()
    ends = pi / 4 - asin(0.45 / sqrt(0.5))  # of the goal, 45 degrees off the centre
    assert times[[0, -1]] == approx([1.32815, 1.59338], abs=2e-5) and rooms[[0, -1]] == approx([0.0, ends], abs=2e-6)
    for i in range(len(front)):
        moving = front.trajectory(i)
        x = np.concatenate([np.ravel(v) for v in moving.variables.values()])
        check(wrist, x)
        radius = sqrt(0.5) * np.sin(asin(0.45 / sqrt(0.5)) + x[9]) - LINK
        assert least_distance(polynomials(wrist, x), (*SPHERE[:3], radius)) >= -1e-6


@pytest.mark.slow
def test_time_and_distance_do_not_conflict(wrist: Problem) -> None:
    front = pareto(wrist, ["time", "distance"], points=5, seed=0)
    assert len(front) == 1 and front.info["conflict"] is False
    assert front.ideal == approx({"time": 1.328147, "distance": pi}, abs=1e-5)


# --- the paper's genetic algorithm ---


def test_the_genetic_algorithm_has_the_papers_numbers() -> None:
    ga = GA(seed=0)
    assert (ga.population, ga.generations, ga.tournament, ga.crossover, ga.mutation) == (200, 80, 5, 0.8, 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("handling", ["feasibility", "death"])
def test_a_short_run_of_the_genetic_algorithm_is_proved_and_not_optimal(wrist: Problem, handling: str) -> None:
    solution = solve(wrist, method="ga", starts=1, generations=30, handling=handling)
    assert solution.audit is not None and solution.audit.proved
    check(wrist, solution.x)
    assert BLOCKED < solution.f < 2.0 * BLOCKED


def test_time_scaling_makes_each_individual_just_keep_its_limits(wrist: Problem) -> None:
    """s = max(|v| / v_max, sqrt(|a| / a_max)), the peaks by the roots of numpy's polynomials."""
    scaling = TimeScaling(wrist)
    xs = np.array([random_x(wrist, seed) for seed in range(20)])
    scaled = scaling.apply(xs)
    for x, s, faster in zip(xs, scaling.factors(xs), scaled, strict=True):
        curve = polynomials(wrist, x)
        share = 0.0
        for segment, T in zip(curve.segments, curve.durations, strict=True):
            for p, v_max, a_max in zip(segment, V_MAX, A_MAX, strict=True):
                for derivative, bound, power in ((p.deriv(), v_max, 1.0), (p.deriv(2), a_max, 0.5)):
                    inner = [r.real for r in derivative.deriv().roots() if 0.0 < r.real < T]
                    peak = max(abs(derivative(t)) for t in (0.0, *inner, T))
                    share = max(share, (peak / bound) ** power)
        assert s == approx(share, rel=1e-9)
        meant = wrist.dilate(x, s * (1.0 + 1e-9))
        if (meant >= wrist.lower).all() and (meant <= wrist.upper).all():
            again = polynomials(wrist, faster)
            ratio = max(
                np.abs(again.at(1, 2001) / V_MAX).max(), np.sqrt(np.abs(again.at(2, 2001) / A_MAX).max())
            )  # fmt: skip
            assert ratio == approx(1.0, abs=1e-5)
    assert (scaled >= wrist.lower).all() and (scaled <= wrist.upper).all()


def test_time_scaling_needs_a_problem_that_scales(wrist: Problem) -> None:
    with pytest.raises(InputError, match="leave the scaling out"):
        TimeScaling(replace(wrist, dilate=None))


def test_slacks_of_objectives_take_no_part_in_a_population(wrist: Problem) -> None:
    """The least clearance asked for is no gene of the fitness: it stays at the least."""
    solution = GA(seed=1, population=40, generations=8, scaling=True).solve(wrist, FITNESS)
    assert solution.x[9] == 0.0 and solution.audit is not None and solution.audit.proved


def test_a_saved_trajectory_is_audited_again(wrist: Problem, tmp_path: Path) -> None:
    solution = solve(wrist, starts=1)
    assert solution.trajectory is not None
    again = Trajectory.load(solution.trajectory.save(tmp_path / "wrist.json"))
    assert again.audit().proved
    assert problems.load(again.problem, **again.case).case == wrist.case
