"""Curves whose knot states and durations are variables: what they meet, their inverse, and what is refused."""

from typing import Any

import casadi
import numpy as np
import pytest
from numpy.testing import assert_allclose

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.curves.families import hermite
from ocp_traj.curves.least_time import least_time, phases, time_law
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.knot_states import knot_states
from ocp_traj.formulation.parametrisation import Parametrisation

LIMITS = ot.JointLimits(
    position=np.array([[-3.0, -3.0, -np.inf], [3.0, 3.0, np.inf]]), velocity=(2.0, 3.0, 4.0),
    acceleration=(8.0, 8.0, 9.0), jerk=(60.0, 60.0, np.inf),
)  # fmt: skip
POINTS = np.array([[0.0, 0.5, -0.2], [0.7, 0.1, 0.4], [0.9, -0.6, 0.4], [0.2, -0.8, 1.5]])
CASES: dict[str, dict[str, Any]] = {
    "one piece": {},
    "pieces": {"pieces": 3},
    "a duration each": {"pieces": 3, "even": False},
    "septic, a stop": {"degree": 7, "pieces": 2, "stops": (1,)},
    "nonic, dwells, tolerance": {
        "degree": 9, "pieces": 2, "dwells": {1: 0.5, 2: 0.25}, "via_tolerance": (0.1, 0.0, 0.2),
    },
    "given derivatives": {"degree": 7, "start": np.ones((1, 3)), "end": np.full((2, 3), 0.1)},
    "point to point": {"pieces": 7, "points": POINTS[:2]},
    "metres and radians": {"pieces": 2, "units": ("m", "rad", "m")},
}  # fmt: skip


@pytest.fixture(params=CASES)
def case(request: pytest.FixtureRequest) -> dict[str, Any]:
    return {"points": POINTS, **CASES[request.param]}


def _made(case: dict[str, Any]) -> tuple[Parametrisation, Array]:
    given = dict(case)
    made = knot_states(given.pop("points"), LIMITS, **given)
    x = made.guess(np.random.default_rng(0))
    noise = np.random.default_rng(1).normal(size=len(x))
    lower, upper = (np.concatenate([getattr(v, side) for v in made.variables]) for side in ("lower", "upper"))
    return made, np.clip(x * (1.0 + 0.1 * noise) + 0.01 * noise**2, lower, upper)


def test_the_curve_passes_the_via_points_as_smooth_as_promised(case: dict[str, Any]) -> None:
    made, x = _made(case)
    curve, degree = made.curve(x), case.get("degree", 5)
    assert set(curve.degrees) == {degree} and made.continuity == degree // 2
    for order in range(made.continuity + 1):
        assert np.abs(curve.jump(order)).max(initial=0.0) < 1e-9 * np.abs(curve.hull(order)).max()
    tolerance = np.broadcast_to(case.get("via_tolerance", 0.0), 3)
    for i, (k, u) in enumerate(made.knots):
        ends = i in (0, len(made.knots) - 1)
        assert (np.abs(curve.at(k, u)[0] - case["points"][i]) <= (0.0 if ends else 1.0) * tolerance + 1e-15).all()
    assert made.duration(x) == pytest.approx(curve.duration)


def test_the_ends_rest_or_have_what_is_given(case: dict[str, Any]) -> None:
    made, x = _made(case)
    curve = made.curve(x)
    for word, k, u in (("start", 0, 0.0), ("end", curve.segments - 1, 1.0)):
        for order, wanted in enumerate(case.get(word, np.zeros((2, 3))), 1):
            assert_allclose(curve.at(k, u, order)[0], wanted, atol=1e-12)


def test_stops_rest_and_dwells_stand_still_for_their_time() -> None:
    made, x = _made({"points": POINTS, **CASES["septic, a stop"]})
    assert_allclose([made.curve(x).at(*made.knots[1], order)[0] for order in (1, 2)], 0.0, atol=1e-12)
    assert np.abs(made.curve(x).at(*made.knots[1], 3)).max() > 0.1  # above ``rest`` derivatives are free
    made, x = _made({"points": POINTS, **CASES["nonic, dwells, tolerance"]})
    curve = made.curve(x)
    for i, seconds in ((1, 0.5), (2, 0.25)):
        k, _ = made.knots[i]
        assert curve.durations[k] == seconds and np.ptp(curve.control_points[k], axis=0).max() == 0.0
        assert all(k not in leg for leg in made.legs)


def test_variables_are_those_of_the_curve(case: dict[str, Any]) -> None:
    made, x = _made(case)
    assert_allclose(made.variables_of(made.curve(x)), x, rtol=1e-9, atol=1e-11)


def test_numbers_and_symbols_make_one_curve(case: dict[str, Any]) -> None:
    made, x = _made(case)
    symbols = casadi.SX.sym("x", len(x))
    curve = made.curve(symbols)
    durations, *points = casadi.Function("curve", [symbols], [curve.durations, *curve.control_points])(x)
    assert_allclose(np.array(durations).ravel(), made.curve(x).durations, rtol=1e-14)
    for one, other in zip(points, made.curve(x).control_points, strict=True):
        assert_allclose(np.array(one), other, rtol=1e-13, atol=1e-14)


def test_a_segment_depends_on_its_own_states_and_time_alone() -> None:
    made, x = _made({"points": np.tile(POINTS, (5, 1)), "pieces": 2})
    symbols = casadi.SX.sym("x", len(x))
    for points in made.curve(symbols).control_points:
        _, columns = casadi.jacobian(casadi.vec(points), symbols).sparsity().get_triplet()
        assert len(set(columns)) <= 1 + 2 * 3 * 3


def test_dilated_variables_are_the_same_path_slower(case: dict[str, Any]) -> None:
    made, x = _made(case)
    if made.dilate is None:
        assert "start" in case
        return
    curve, slower = made.curve(x), made.curve(made.dilate(x, 1.3))
    waits = case.get("dwells", {}).values()
    assert slower.duration == pytest.approx(1.3 * (curve.duration - sum(waits)) + sum(waits))
    for one, other in zip(curve.control_points, slower.control_points, strict=True):
        assert_allclose(one, other, rtol=1e-12, atol=1e-13)


def test_guesses_are_within_bounds_that_are_the_limits(case: dict[str, Any]) -> None:
    given = dict(case)
    made = knot_states(given.pop("points"), LIMITS, **given)
    lower, upper = (np.concatenate([getattr(v, side) for v in made.variables]) for side in ("lower", "upper"))
    for seed in range(5):
        x = made.guess(np.random.default_rng(seed))
        assert (x >= lower).all() and (x <= upper).all()
    third = [
        high for v in made.variables for label, high in zip(v.labels, v.upper, strict=True)
        if label.endswith("joint 3") and v.id.startswith(("q", "jerk", "snap")) and "via_tolerance" not in case
    ]  # fmt: skip
    assert all(np.isinf(high) for high in third)  # it has no such limits


def test_the_guess_of_seven_pieces_of_a_lone_move_is_the_shortest_law() -> None:
    limits = ot.JointLimits(velocity=(1.0,) * 3, acceleration=(3.0,) * 3, jerk=(30.0,) * 3)
    made = knot_states(POINTS[:2], limits, pieces=7, even=False)
    curve = made.curve(made.guess(np.random.default_rng(0)))
    longest = np.abs(np.diff(POINTS[:2], axis=0)).max()
    least = phases(1.0 / longest, 3.0 / longest, 30.0 / longest).sum()
    assert least <= curve.duration <= 1.05 * least
    for order, bound in ((1, 1.0), (2, 3.0), (3, 30.0)):
        assert max(max(-e.lower, e.upper) for e in curve.extrema(order)) <= bound * (1.0 + 1e-9)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"points": POINTS[:1]}, "via points are of shape"),
        ({"degree": 4}, "degree: 4; give 5, 7 or 9"),
        ({"pieces": 0}, "pieces: 0; give 1 or more"),
        ({"rest": 3}, "rest: 3; give 0 to 2, for degree 5"),
        ({"stops": (3,)}, "stop at via point: 3; give inner ones, 1 to 2"),
        ({"dwells": {1: 0.0}}, "dwell at via point 1: 0.0; give seconds above zero"),
        ({"via_tolerance": -1.0}, "via_tolerance: -1.0"),
        ({"start": np.ones((3, 3))}, "derivatives at an end"),
        ({"joints": ("a",)}, "names of joints: 1; give 3, one a joint"),
    ],
)
def test_what_does_not_fit_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=words):
        knot_states(**{"points": POINTS, "limits": LIMITS, **given})


# --- segments and laws ---


@pytest.mark.parametrize("rows", [2, 3, 4, 5])
def test_hermite_segments_have_the_knots_states(rows: int) -> None:
    rng = np.random.default_rng(rows)
    states, times = rng.normal(size=(4, rows, 2)), rng.uniform(0.3, 1.0, 3)
    curve = hermite(list(states), times)
    assert set(curve.degrees) == {2 * rows - 1}
    for k in range(3):
        for order in range(rows):
            size = np.abs(curve.hull(order)).max()
            for u in (0, 1):
                assert_allclose(curve.at(k, float(u), order)[0], states[k + u, order], atol=1e-12 * size)


@pytest.mark.parametrize("bounds", [(3.0, 8.0, 60.0), (1.0, 8.0, 60.0), (100.0, 3.0, 60.0), (100.0, 100.0, 5.0)])
def test_the_shortest_law_covers_the_distance_within_its_bounds(bounds: tuple[float, float, float]) -> None:
    shortest, (times, states) = phases(*bounds).sum(), time_law(*bounds)
    curve = hermite([state[:, None] for state in states], times)
    assert_allclose(states[[0, -1]], [[0, 0, 0], [1, 0, 0]], atol=1e-12)
    assert shortest <= times.sum() <= 1.02 * shortest
    for order, bound in enumerate(bounds, 1):
        (peak,) = curve.extrema(order)
        assert max(-peak.lower, peak.upper) <= bound * (1.0 + 1e-9)


def test_least_times_of_single_bounds() -> None:
    """Of bounded speed, acceleration and jerk they are the law's, where nothing else binds."""
    huge = 1e9
    assert least_time(1.0, [2.0, np.inf, np.inf]) == pytest.approx(0.5)
    assert least_time(1.0, [np.inf, 3.0]) == pytest.approx(phases(huge, 3.0, huge).sum(), rel=1e-3)
    assert least_time(1.0, [np.inf, np.inf, 5.0]) == pytest.approx(phases(huge, huge, 5.0).sum())
    assert least_time(0.0, [1.0]) == 0.0
