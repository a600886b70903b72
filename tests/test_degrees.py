"""Degrees of homogeneity from a tape: right where one is named, silent where none is."""

from fractions import Fraction

import casadi
import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.interval.degrees import ZERO, degrees
from ocp_traj.transcription.symbolic import evaluate_objectives
from ocp_traj.transcription.time_degrees import is_total_time, path_is_of_ratios, time_degree
from tests.test_branch_and_bound import small_problem

SX = casadi.SX


@pytest.mark.parametrize(
    ("expression", "degree"),
    [
        (lambda t, a: t + 2.0 * t, 1),
        (lambda t, a: t**2 / a, 5),  # a falls as t^-3
        (lambda t, a: casadi.sqrt(a) * t, Fraction(-1, 2)),
        (lambda t, a: casadi.fmax(t, 3.0 * t) * casadi.sin(a * t**3), 1),
        (lambda t, a: casadi.atan2(t, 2.0 * t), 0),
        (lambda t, a: t + 0.0 * a + SX(0), 1),
        (lambda t, a: SX(0), ZERO),
        (lambda t, a: SX(7), 0),
        (lambda t, a: a**-1.5, Fraction(9, 2)),
        (lambda t, a: casadi.if_else(t > 2.0 * t, t, 3.0 * t), 1),
        (lambda t, a: t + a, None),
        (lambda t, a: t + 1.0, None),
        (lambda t, a: casadi.sin(t), None),
        (lambda t, a: casadi.exp(a), None),
        (lambda t, a: casadi.if_else(t > 1.0, t, 3.0 * t), None),
        (lambda t, a: t**a, None),
    ],
)
def test_degrees_of_expressions(expression: object, degree: object) -> None:
    t, a = SX.sym("t"), SX.sym("a")
    function = casadi.Function("f", [t, a], [casadi.densify(expression(t, a))])  # type: ignore[operator]
    assert degrees(function, [[1], [-3]]) == ((degree,),)


def test_a_degree_that_is_named_holds_at_random_points() -> None:
    """Of random products, sums, roots and quotients of two inputs: f(s x, s^-2 y) = s^d f(x, y)."""
    rng = np.random.default_rng(0)
    named = 0
    for _ in range(60):
        x, y = SX.sym("x"), SX.sym("y")
        pool = [x, y, SX(float(rng.uniform(0.5, 2.0)))]
        for _ in range(8):
            a, b = (pool[i] for i in rng.integers(len(pool), size=2))
            pool.append([a * b, a / b, a + b, casadi.sqrt(a), casadi.hypot(a, b), a**3][rng.integers(6)])
        function = casadi.Function("f", [x, y], [pool[-1]])
        ((degree,),) = degrees(function, [[1], [-2]])
        if not isinstance(degree, Fraction):
            continue
        named += 1
        for s, u, v in rng.uniform(0.5, 2.0, (3, 3)):
            scaled, plain = float(function(s * u, v / s**2)), float(function(u, v))
            assert scaled == pytest.approx(s ** float(degree) * plain, rel=1e-10)
    assert named > 10


@pytest.mark.slow
def test_objectives_of_the_problems_scale_as_it_says() -> None:
    problem = problems.load("rotor-353")
    assert path_is_of_ratios(problem) and is_total_time(problem, "time")
    assert [time_degree(problem, name) for name in ("time", "effort", "work", "jerk")] == [1, None, None, -5]
    x = np.array([0.5, 1.3, 0.6])
    once, twice = evaluate_objectives(problem, x), evaluate_objectives(problem, 2.0 * x)
    assert twice["jerk"] == pytest.approx(once["jerk"] / 32.0, rel=1e-12)
    small = small_problem(0)
    assert time_degree(small, "first") == 1 and not is_total_time(small, "first")
    # A payload among the variables grows with them, and is no duration.
    assert not path_is_of_ratios(problems.load("rotor-353", free_payload=True))
