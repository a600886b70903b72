"""Certificates of the shortest time: never wrong, tight where they say so, refused where they do not apply."""

import re
from dataclasses import dataclass, replace
from fractions import Fraction

import casadi
import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.curves.families import polynomial_353
from ocp_traj.errors import InputError
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.formulation.scalarise import EpsilonConstraint, WeightedSum
from ocp_traj.proof.audit import audit
from ocp_traj.results.solution import Certificate, Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.branch_and_bound import BranchAndBound
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ratio_search import Search
from ocp_traj.transcription.nlp import Status

TIME = WeightedSum({"time": 1.0})


@dataclass(frozen=True)
class Plain:
    """A case without fields."""


def small_problem(seed: int, longest: float = 60.0, position: float = np.inf) -> Problem:
    """A 3-5-3 motion of two joints through random points with random limits; positions limited if asked for."""
    rng = np.random.default_rng(seed)
    points, joints = rng.normal(size=(4, 2)), ("A", "B")
    velocity, acceleration = rng.uniform(0.5, 2.0, 2), rng.uniform(0.5, 4.0, 2)
    limits = [
        PathConstraint.on_derivative("velocity-limit", 1, -velocity, velocity, ("rad/s",) * 2, joints),
        PathConstraint.on_derivative("acceleration-limit", 2, -2 * acceleration, acceleration, ("rad/s2",) * 2, joints),
    ]
    if np.isfinite(position):
        reach = np.abs(points).max(axis=0) + position
        limits.append(PathConstraint.on_derivative("position-limit", 0, -reach, reach, ("rad",) * 2, joints))
    low, high = np.full(3, 0.05), np.full(3, longest)
    return Problem(
        id="small", case=Plain(),
        variables=(Variable("t", low, high, "s", ("t1", "t2", "t3")),),
        curve=lambda x: polynomial_353(points, x),
        objectives=(
            Objective("time", "s", of_variables=lambda x, p: casadi.sum1(x)),
            Objective("first", "s", of_variables=lambda x, p: x[0]),
        ),
        requirements=Requirements(joints, ("rad",) * 2, tuple(limits), continuity=2),
        guess=lambda r: r.uniform(0.5, 5.0, 3),
        default_objective="time", dilate=lambda x, s: np.asarray(x) * s, scales_in_time=True,
    )  # fmt: skip


def as_solution(problem: Problem, x: np.ndarray) -> Solution:
    """A decision vector as a proved solution."""
    moved = trajectory_of(problem, x)
    found = audit(moved, problem.requirements)
    assert found.proved
    return Solution(problem.id, x, float(x.sum()), Status.FEASIBLE, 0.0, 0, 0.0, trajectory=moved, audit=found)


def exact_time(problem: Problem, ratios: np.ndarray) -> float:
    """The shortest time at given ratios, by the exact extrema of the derivatives."""
    curve = trajectory_of(problem, ratios / ratios.sum()).curve
    slow = 0.0
    for limit in problem.requirements.path_constraints:
        order = limit.order or 0
        for extremum, low, high in zip(curve.extrema(order), limit.lower, limit.upper, strict=True):
            if order:
                slow = max(slow, (max(extremum.upper / high, extremum.lower / low)) ** (1.0 / order))
            elif extremum.upper > high or extremum.lower < low:
                return np.inf
    return slow


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 6))])
def test_the_optimum_of_random_problems_is_certified_and_no_random_ratio_is_better(seed: int) -> None:
    problem = small_problem(seed)
    found = BranchAndBound().solve(problem, TIME, np.ones(3))
    certificate = found.certificate
    assert certificate is not None and certificate.certified and certificate.gap <= 1e-6
    rng = np.random.default_rng(seed)
    near = found.x / found.x.sum() * np.exp(1e-3 * rng.normal(size=(300, 3)))
    for ratios in np.concatenate([np.exp(rng.normal(size=(300, 3))), near]):
        assert exact_time(problem, ratios) >= certificate.lower


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 4))])
def test_bounds_of_boxes_are_below_every_time_in_them(seed: int) -> None:
    problem = small_problem(seed, position=0.5)
    best = BranchAndBound().solve(problem, TIME, np.ones(3))
    search = Search(problem, best, 1e3, 1e3)
    rng = np.random.default_rng(seed)
    middle, width = np.exp(rng.normal(size=(24, 2))), np.exp(rng.uniform(-7.0, 0.5, (24, 1)))
    low, high = middle / (1.0 + width), middle * (1.0 + width)
    bounds = search.bound(low, high, np.zeros(24))
    assert (bounds > 0.0).all()
    for a, b, bound in zip(low, high, bounds, strict=True):
        for z in rng.uniform(a, b, (20, 2)):
            time = exact_time(problem, np.append(1.0, z))
            x = np.append(1.0, z) / (1.0 + z.sum()) * time
            if (x <= problem.upper).all():
                assert max(time, (0.05 * (1.0 + z.sum()) / np.append(1.0, z)).max()) >= bound * (1.0 - 1e-12)


@pytest.mark.slow
def test_the_lagrangian_claims_nothing_beyond_the_times_it_was_bounded_over() -> None:
    """Bounded over times up to 70 % of the shortest there are, it is larger than they are all over some boxes."""
    problem = small_problem(0, position=0.5)
    best = BranchAndBound().solve(problem, TIME, np.ones(3))
    end = 0.7 * best.f
    search = Search(problem, best, end, end)
    ratios = best.x[1:] / best.x[0]
    low, high = np.outer([0.9, 0.99, 0.999], ratios).T, np.outer([1.1, 1.01, 1.001], ratios).T
    centre = 0.5 * (low + high)
    bounds = search.with_others((low, high), centre, search.rows.peaks(centre), np.zeros(3))
    assert (bounds > 0.0).all() and (bounds <= end).all()


@pytest.mark.parametrize(
    ("lower", "upper"), [(1.7313607177882824, 1.7313622466969796), (12.0, 12.5), (0.1, 0.2), (123456.7890123, 1e6 / 3)]
)
def test_a_printed_bound_is_one(lower: float, upper: float) -> None:
    words = Certificate(lower, upper, True, 1, 0.0, "").explain()
    numbers = [Fraction(n) for n in re.findall(r"(?:below|is|of) ([\d.e+-]+\d)", words)]
    assert numbers[0] <= Fraction(lower) and numbers[1] >= Fraction(upper)
    assert numbers[2] >= (Fraction(upper) - Fraction(lower)) / Fraction(upper)
    assert float(numbers[0]) == pytest.approx(lower, rel=1e-9) and float(numbers[1]) == pytest.approx(upper, rel=1e-9)


@pytest.mark.slow
def test_a_slow_solution_is_not_certified_and_a_better_point_is_named() -> None:
    problem = problems.load("rotor-353")
    best = Exchange().solve(problem, TIME, np.array([0.5, 1.0, 0.5]))
    slow = as_solution(problem, best.x * 1.001)
    certificate, better = BranchAndBound(max_boxes=3000).certify(problem, TIME, slow)
    assert not certificate.certified and certificate.gap > 9e-4
    assert certificate.lower <= best.objectives["time"]
    assert better is not None and better.sum() < slow.x.sum()


@pytest.mark.slow
def test_a_solution_that_is_only_local_is_replaced_by_the_global_one() -> None:
    """From a poor point the search finds what exchange does from a good one."""
    problem = small_problem(3, position=0.5)
    direct = BranchAndBound().solve(problem, TIME, np.ones(3))
    slow = as_solution(problem, np.asarray(direct.x) * 1.3)
    improved = BranchAndBound().improve(problem, TIME, slow)
    assert improved.certificate is not None and improved.certificate.certified
    assert improved.f == pytest.approx(direct.f, rel=2e-6)


@pytest.mark.slow
def test_bounds_on_durations_are_part_of_the_bound() -> None:
    problem = small_problem(1)
    free = BranchAndBound().solve(problem, TIME, np.ones(3))
    forced = float(free.x[0] * 1.5)
    variable = Variable("t", np.array([forced, 0.05, 0.05]), np.full(3, 60.0), "s", ("t1", "t2", "t3"))
    bounded = BranchAndBound().solve(replace(problem, variables=(variable,)), TIME, np.full(3, forced * 1.1))
    assert bounded.certificate is not None and bounded.certificate.certified
    assert bounded.x[0] == pytest.approx(forced, rel=1e-7)
    assert bounded.certificate.lower > free.f


@pytest.mark.slow
def test_limits_on_boxes_and_time_end_it_honestly() -> None:
    problem = problems.load("rotor-353")
    best = Exchange().solve(problem, TIME, np.array([0.5, 1.0, 0.5]))
    certificate, _ = BranchAndBound(max_boxes=50).certify(problem, TIME, best)
    assert not certificate.certified and 0.0 <= certificate.lower < best.f
    assert "not certified" in certificate.explain()


@pytest.mark.parametrize(
    ("name", "scalar", "words"),
    [
        ("hybrid-spline", TIME, "not durations of segments alone"),
        ("rotor-353", WeightedSum({"effort": 1.0}), "only the total time alone"),
        ("rotor-353", WeightedSum({"time": 1.0, "jerk": 1.0}), "not time, jerk"),
        ("rotor-353", EpsilonConstraint("time", {"jerk": 1e4}), "only the total time alone"),
    ],
)
def test_what_cannot_be_certified_is_refused(name: str, scalar: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        BranchAndBound().solve(problems.load(name), scalar, np.ones(3))  # type: ignore[arg-type]


def test_the_first_duration_is_not_the_total() -> None:
    with pytest.raises(InputError, match="only the total time can be, not first"):
        BranchAndBound().solve(small_problem(0), WeightedSum({"first": 1.0}), np.ones(3))


def test_an_unproved_solution_and_a_foolish_tolerance_are_refused() -> None:
    problem = small_problem(0)
    unproved = Solution(problem.id, np.ones(3), 3.0, Status.SOLVED, 0.0, 1, 0.0)
    with pytest.raises(InputError, match="only a proved solution"):
        BranchAndBound().certify(problem, TIME, unproved)
    with pytest.raises(InputError, match="between 0 and 1"):
        BranchAndBound(tolerance=0.0)
