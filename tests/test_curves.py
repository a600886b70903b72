"""The papers' curves: scipy's CubicSpline is the reference for the spline with free end knots."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicSpline

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import cubic_spline_free_ends, nonic
from ocp_traj.errors import ProblemDefinitionError
from tests.closed_form import clamped_spline

EPS = np.finfo(float).eps
COUNTS = [3, 4, 5, 8, 11, 16]  # of via points


def random_spline(seed: int, count: int, dof: int = 3) -> tuple[np.ndarray, np.ndarray, PiecewiseBezier]:
    rng = np.random.default_rng([seed, count])
    points, h = rng.normal(size=(count, dof)), rng.uniform(0.2, 1.5, count + 1)
    return points, h, cubic_spline_free_ends(points, h)


def knots_of(curve: PiecewiseBezier) -> np.ndarray:
    return np.array([*(p[0] for p in curve.control_points), curve.control_points[-1][-1]])


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("seed", range(3))
def test_spline_equals_scipys_clamped_spline_through_its_own_knots(seed: int, count: int) -> None:
    _, _, curve = random_spline(seed, count)
    reference = CubicSpline(curve.knots, knots_of(curve), bc_type="clamped")
    t = np.linspace(0.0, curve.duration, 500)
    for order in range(4):
        expected = reference(t, order)
        if order == 3:  # piecewise constant: compare inside the segments only
            t = (curve.knots[:-1] + curve.knots[1:]) / 2
            expected = reference(t, order)
        assert_allclose(curve(t, order), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("count", COUNTS)
def test_free_knots_are_those_that_null_the_end_accelerations_of_a_clamped_spline(count: int) -> None:
    points, h, curve = random_spline(7, count)
    reference = clamped_spline(points, h)
    assert_allclose(knots_of(curve), reference(reference.x), atol=1e-11)


@pytest.mark.parametrize("count", COUNTS)
def test_spline_passes_its_via_points_and_rests_exactly_at_both_ends(count: int) -> None:
    points, _, curve = random_spline(1, count)
    knots = knots_of(curve)
    assert_array_equal(knots[[0, *range(2, count), count + 1]], points)
    for end in (curve.control_points[0][:3], curve.control_points[-1][1:]):  # three equal points: v = a = 0 exactly
        assert_array_equal(end[1:], end[:-1])
    for order in (1, 2):
        for k, u in ((0, 0.0), (count, 1.0)):
            rounding = 10 * EPS * np.abs(points).max() / curve.durations[k] ** order * 6
            assert_allclose(curve.at(k, u, order), 0.0, atol=rounding)


@pytest.mark.parametrize("count", COUNTS)
def test_free_knots_are_where_the_paper_puts_them(count: int) -> None:
    """q_2 = q_1 + h_1^2 a_2 / 6 and q_{m-1} = q_m + h_{m-1}^2 a_{m-1} / 6; Guo et al. (2016), sect. 3.2."""
    points, h, curve = random_spline(2, count)
    knots = knots_of(curve)
    second, last = curve.at(1, 0.0, 2)[0], curve.at(count - 1, 1.0, 2)[0]
    assert_allclose(knots[1], points[0] + h[0] ** 2 * second / 6.0, atol=1e-12)
    assert_allclose(knots[-2], points[-1] + h[-1] ** 2 * last / 6.0, atol=1e-12)


@pytest.mark.parametrize("count", COUNTS)
def test_symbolic_spline_equals_the_numeric_one(count: int) -> None:
    points, h, curve = random_spline(3, count)
    x = ca.SX.sym("h", count + 1)
    symbolic = cubic_spline_free_ends(points, x)
    function = ca.Function("f", [x], [symbolic.durations, *symbolic.control_points])
    durations, *found = (np.array(part) for part in function(h))
    assert_array_equal(durations.ravel(), h)
    for ours, theirs in zip(found, curve.control_points, strict=True):
        assert_allclose(ours, theirs, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("seed", range(5))
def test_spline_stays_sound_with_extreme_ratios_of_intervals(seed: int, ratio: float) -> None:
    """Elimination without row exchange needs positive pivots; the knot accelerations solve the spline equations."""
    rng = np.random.default_rng(seed)
    points, h = rng.normal(size=(9, 2)), ratio ** rng.uniform(0.0, 1.0, 10)
    curve = cubic_spline_free_ends(points, h)
    for order in (1, 2):
        # Rounding of P is divided by T^m on either side of a knot.
        shortest = np.minimum(curve.durations[:-1], curve.durations[1:])[:, None]
        size = max(np.abs(p).max() for p in curve.control_points)
        assert (np.abs(curve.jump(order)) <= 100 * EPS * size / shortest**order).all()
    assert np.abs(curve.jump(0)).max() == 0.0


def test_reversed_via_points_and_intervals_give_the_reversed_spline() -> None:
    points, h, curve = random_spline(4, 8)
    backwards = cubic_spline_free_ends(points[::-1], h[::-1])
    t = np.linspace(0.0, curve.duration, 100)
    assert_allclose(backwards(curve.duration - t), curve(t), atol=1e-12)
    assert_allclose(backwards(curve.duration - t, 1), -curve(t, 1), atol=1e-11)


def test_dilated_intervals_keep_the_control_points() -> None:
    points, h, curve = random_spline(5, 6)
    slow = cubic_spline_free_ends(points, 3.0 * h)
    for ours, theirs in zip(slow.control_points, curve.control_points, strict=True):
        assert_allclose(ours, theirs, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("count", "intervals", "message"),
    [(2, 3, "got 2 and 3"), (5, 5, "got 5 and 5"), (5, 7, "got 5 and 7")],
)
def test_a_wrong_number_of_intervals_is_refused(count: int, intervals: int, message: str) -> None:
    for h in (np.ones(intervals), ca.SX.sym("h", intervals)):
        with pytest.raises(ProblemDefinitionError, match=f"at least 3 via points and one interval more; {message}"):
            cubic_spline_free_ends(np.zeros((count, 2)), h)


# --- nonic segments through tags ---


def random_tags(seed: int, count: int, dof: int = 3) -> tuple[list[np.ndarray], np.ndarray, PiecewiseBezier]:
    rng = np.random.default_rng([seed, count])
    tags, times = [rng.normal(size=(5, dof)) for _ in range(count)], rng.uniform(0.3, 4.0, count - 1)
    return tags, times, nonic(tags, times)


@pytest.mark.parametrize("count", [2, 3, 6])
@pytest.mark.parametrize("seed", range(4))
def test_nonic_segments_have_the_tags_derivatives_at_both_ends(seed: int, count: int) -> None:
    """Ogbemhe et al. (2019), (5)-(18) mended: the boundary map, by derivatives of the control points."""
    tags, _, curve = random_tags(seed, count)
    for k in range(count - 1):
        for order in range(5):
            size = np.abs(curve.hodograph(k, order)).max()
            assert_allclose(curve.at(k, 0.0, order)[0], tags[k][order], rtol=0, atol=1e-12 * size)
            assert_allclose(curve.at(k, 1.0, order)[0], tags[k + 1][order], rtol=0, atol=1e-12 * size)


def test_nonic_segments_are_c4_at_tags() -> None:
    for seed in range(5):
        _, _, curve = random_tags(seed, 6)
        for order in range(5):
            assert np.abs(curve.jump(order)).max() <= 1e-9 * np.abs(np.concatenate(curve.hull(order))).max()


def test_a_nonic_from_rest_to_rest_is_the_polynomial_and_has_the_peaks_of_theory() -> None:
    """q0 + d (126 u^5 - 420 u^6 + 540 u^7 - 315 u^8 + 70 u^9); its derivatives peak where numpy finds them to."""
    start, end = np.zeros((5, 1)), np.zeros((5, 1))
    end[0] = 0.7
    duration = 1.9
    curve = nonic([start, end], np.array([duration]))
    exact = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70]) * 0.7
    u = np.linspace(0.0, 1.0, 101)
    assert_allclose(curve.at(0, u)[:, 0], exact(u), rtol=0, atol=1e-13)
    for order, factor in ((1, 2.4609), (2, 9.3720), (3, 78.750), (4, 622.533)):
        derivative = exact.deriv(order)
        roots = derivative.deriv().roots()
        places = np.concatenate(
            [[0.0, 1.0], roots.real[(abs(roots.imag) < 1e-6) & (roots.real > 0) & (roots.real < 1)]]
        )
        peak = np.abs(derivative(places)).max() / duration**order
        (extreme,) = curve.extrema(order)
        assert max(extreme.upper, -extreme.lower) == pytest.approx(peak, rel=1e-9)
        assert peak * duration**order / 0.7 == pytest.approx(factor, rel=3e-5)  # of five digits


def test_nonic_segments_of_symbols_are_those_of_numbers() -> None:
    tags, times, curve = random_tags(0, 4)
    symbols, t = [ca.SX.sym("s", 5, 3) for _ in tags], ca.SX.sym("t", 3)
    function = ca.Function("f", [*symbols, t], list(nonic(symbols, t).control_points))
    for found, expected in zip(function(*tags, times), curve.control_points, strict=True):
        assert_allclose(np.array(found), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_nonic_segments_need_one_duration_less_than_tags() -> None:
    with pytest.raises(ProblemDefinitionError, match="3 knots need 2 durations"):
        nonic([np.zeros((5, 1))] * 3, np.ones(3))
