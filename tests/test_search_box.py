"""Populations on problems whose variables have no bounds: they are given a box, and what they find is proved."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.evolution.search_box import ROOM, search_box
from ocp_traj.formulation.problem import Problem

EXAMPLE = Path(__file__).parent.parent / "examples" / "tasks" / "ur5-via.toml"
OPEN = {"curve.kind": "septic", "limits.jerk": "none"}  # jerk at knots is a variable, and has no bound


@pytest.fixture(scope="module")
def unlimited() -> Problem:
    return ot.problems.load("task", file=str(EXAMPLE), **OPEN)


def test_the_box_is_finite_holds_every_guess_and_keeps_the_bounds_there_are(unlimited: Problem) -> None:
    lower, upper = search_box(unlimited)
    bounded = np.isfinite(unlimited.lower) & np.isfinite(unlimited.upper)
    assert 0 < bounded.sum() < unlimited.size and np.isfinite([lower, upper]).all() and (lower < upper).all()
    assert np.array_equal(lower[bounded], unlimited.lower[bounded])
    assert np.array_equal(upper[bounded], unlimited.upper[bounded])
    for seed in range(50):
        x = unlimited.guess(np.random.default_rng(seed))
        assert (lower <= x).all() and (x <= upper).all()
    far = np.where(bounded, unlimited.guess(np.random.default_rng(0)), 1e3)
    assert search_box(unlimited, [far])[1][~bounded] == pytest.approx(ROOM * 1e3)
    plain = ot.problems.load("hybrid-spline")
    assert np.array_equal(search_box(plain), [plain.lower, plain.upper])


@pytest.mark.parametrize("method", ["pso", "ga"])
def test_populations_solve_what_is_not_limited(unlimited: Problem, method: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        solution = ot.solve(unlimited, objective="time", method=method, population=20, generations=5)
    assert solution.audit is not None and solution.audit.proved and np.isfinite(solution.x).all()
    assert solution.gains == ()


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("nsga2", {"generations": 5}),
        ("mopso", {"generations": 5}),
        pytest.param("hmoga", {"generations": 5, "points": 3}, marks=pytest.mark.slow),
    ],
)
def test_fronts_of_populations_of_what_is_not_limited_are_proved(
    unlimited: Problem, method: str, options: dict[str, int]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        front = ot.pareto(unlimited, ["time", "effort"], method=method, population=20, **options)
    assert len(front) and (front.table["verdict"] == "proved").all()
