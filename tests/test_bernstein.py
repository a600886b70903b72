"""Piecewise Bezier curves: identities over random curves, scipy's BPoly as the reference."""

from collections.abc import Callable
from math import comb

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BPoly, CubicSpline, PPoly

from ocp_traj.curves.bernstein import PiecewiseBezier, basis, difference_matrix, elevation_matrix, subdivision_matrix
from ocp_traj.errors import InputError, ProblemDefinitionError

EPS = np.finfo(float).eps
SEEDS = range(5)


def random_curve(seed: int, degrees: tuple[int, ...] | None = None, dof: int = 3) -> PiecewiseBezier:
    rng = np.random.default_rng(seed)
    degrees = degrees or (5,) * int(rng.integers(1, 6))
    durations = rng.uniform(0.3, 2.0, len(degrees))
    return PiecewiseBezier(durations, tuple(rng.normal(size=(n + 1, dof)) for n in degrees))


def symbolic_function(
    curve: PiecewiseBezier, build: Callable[[PiecewiseBezier], ca.SX]
) -> tuple[ca.Function, list[np.ndarray]]:
    """Whatever ``build`` makes of the curve in symbols, as a function, with the curve's numbers as arguments."""
    durations = ca.SX.sym("T", curve.segments)
    points = [ca.SX.sym(f"P{k}", *p.shape) for k, p in enumerate(curve.control_points)]
    symbolic = PiecewiseBezier(durations, tuple(points))
    function = ca.Function("f", [durations, *points], [ca.densify(ca.SX(build(symbolic)))])
    return function, [curve.durations, *curve.control_points]


# --- basis ---


@pytest.mark.parametrize("degree", range(10))
def test_basis_is_a_partition_of_unity(degree: int) -> None:
    values = basis(degree, np.linspace(0.0, 1.0, 101))
    assert values.shape == (101, degree + 1)
    assert (values >= 0.0).all()
    assert_allclose(values.sum(axis=1), 1.0, rtol=4 * (degree + 1) * EPS)


@pytest.mark.parametrize("degree", range(10))
def test_basis_reproduces_linear_functions(degree: int) -> None:
    """sum_i (i/n) B_i(u) = u; Farin (2002), eq. 5.14."""
    u = np.linspace(0.0, 1.0, 101)
    if degree:
        assert_allclose(basis(degree, u) @ (np.arange(degree + 1) / degree), u, atol=10 * EPS)


@pytest.mark.parametrize("degree", range(10))
@pytest.mark.parametrize("kind", [ca.SX, ca.MX])
def test_symbolic_basis_and_its_derivative_equal_the_numeric_ones_at_the_ends_too(degree: int, kind: type) -> None:
    u = kind.sym("u", 4)
    at = np.array([0.0, 0.3, 0.9, 1.0])
    row = basis(degree, u)
    slope = ca.jacobian(ca.vec(row.T), u)
    function = ca.Function("f", [u], [row, slope])
    values, slopes = (np.array(part) for part in function(at))
    assert_allclose(values, basis(degree, at), atol=10 * EPS)
    # B' by its own recurrence, n (B_{i-1}^{n-1} - B_i^{n-1}); Farin (2002), sect. 5.3.
    if degree:
        lower = basis(degree - 1, at)
        expected = degree * (np.pad(lower, ((0, 0), (1, 0))) - np.pad(lower, ((0, 0), (0, 1))))
    else:
        expected = np.zeros((4, 1))
    for i in range(4):
        assert_allclose(slopes[i * (degree + 1) : (i + 1) * (degree + 1), i], expected[i], atol=100 * EPS)


def test_difference_matrix_beyond_the_degree_is_zero() -> None:
    assert_array_equal(difference_matrix(2, 3), np.zeros((1, 3)))
    assert_array_equal(difference_matrix(3, 0), np.eye(4))
    assert_array_equal(difference_matrix(3, 3), [[-6.0, 18.0, -18.0, 6.0]])


@pytest.mark.parametrize("degree", range(1, 9))
def test_elevation_matrix_rows_are_convex_combinations(degree: int) -> None:
    matrix = elevation_matrix(degree, degree + 3)
    assert matrix.shape == (degree + 4, degree + 1)
    assert (matrix >= 0.0).all()
    assert_allclose(matrix.sum(axis=1), 1.0, rtol=10 * EPS)


@pytest.mark.parametrize("seed", SEEDS)
def test_subdivision_matrices_compose(seed: int) -> None:
    """The arc [c, d] of the arc [a, b] is the arc [a + c (b - a), a + d (b - a)]."""
    a, b = np.sort(np.random.default_rng(seed).uniform(size=2))
    c, d = np.sort(np.random.default_rng(seed + 100).uniform(size=2))
    twice = subdivision_matrix(6, c, d) @ subdivision_matrix(6, a, b)
    assert_allclose(twice, subdivision_matrix(6, a + c * (b - a), a + d * (b - a)), atol=50 * EPS)


# --- evaluation and derivatives ---


@pytest.mark.parametrize("seed", SEEDS)
def test_a_segment_interpolates_its_first_and_last_control_points_exactly(seed: int) -> None:
    curve = random_curve(seed, (1, 4, 7))
    for k, points in enumerate(curve.control_points):
        assert_array_equal(curve.at(k, [0.0, 1.0]), points[[0, -1]])


@pytest.mark.parametrize("order", range(7))
@pytest.mark.parametrize("seed", SEEDS)
def test_values_and_derivatives_equal_scipy_bpoly(seed: int, order: int) -> None:
    curve = random_curve(seed)
    reference = BPoly(np.stack(curve.control_points, axis=1), curve.knots)
    t = np.random.default_rng(seed).uniform(0.0, curve.duration, 50)
    expected = reference.derivative(order)(t) if order else reference(t)
    size = max(1.0, np.abs(np.concatenate(curve.hull(order))).max())
    assert_allclose(curve(t, order), expected, atol=1e3 * EPS * size)


@pytest.mark.parametrize("order", range(1, 5))
@pytest.mark.parametrize("degrees", [(5,), (3, 7, 2), (6, 6)], ids=str)
def test_derivative_equals_central_difference(degrees: tuple[int, ...], order: int) -> None:
    curve = random_curve(3, degrees)
    step = EPS ** (1 / 3)
    for k, duration in enumerate(curve.durations):
        u = np.linspace(0.1, 0.9, 9)
        reach = step / duration
        slope = (curve.at(k, u + reach, order - 1) - curve.at(k, u - reach, order - 1)) / (2 * step)
        # Truncation step^2 |f'''|/6 and rounding eps |f|/step, each of hulls.
        truncation = step**2 * np.abs(curve.hodograph(k, order + 2)).max()
        rounding = 100 * EPS * np.abs(curve.hodograph(k, order - 1)).max() / step
        assert_allclose(curve.at(k, u, order), slope, atol=truncation + rounding)


@pytest.mark.parametrize("seed", SEEDS)
def test_derivative_curve_has_the_derivative_as_its_value(seed: int) -> None:
    curve = random_curve(seed, (5, 3, 4))
    t = np.linspace(0.0, curve.duration, 40)
    for order in range(4):
        assert_allclose(curve.derivative(order)(t), curve(t, order), atol=1e-12)
        assert_allclose(curve.derivative(order)(t, 1), curve(t, order + 1), atol=1e-10)


def test_derivatives_beyond_the_degree_vanish() -> None:
    curve = random_curve(0, (2, 1))
    assert_array_equal(curve(np.linspace(0.0, curve.duration, 7), 3), np.zeros((7, 3)))
    assert curve.derivative(3).degrees == (0, 0)


def test_a_known_parabola() -> None:
    """q = t^2 on [0, 2]: control points 0, 0, 4; v = 2t, a = 2."""
    curve = PiecewiseBezier([2.0], (np.array([[0.0], [0.0], [4.0]]),))
    t = np.array([0.0, 0.5, 1.5, 2.0])
    assert_allclose(curve(t)[:, 0], t**2)
    assert_allclose(curve(t, 1)[:, 0], 2 * t)
    assert_allclose(curve(t, 2)[:, 0], 2.0)


@pytest.mark.parametrize("order", range(5))
def test_symbolic_values_equal_numeric_ones(order: int) -> None:
    curve = random_curve(1, (5, 2, 4))
    u = np.array([0.0, 0.2, 0.7, 1.0])
    for k in range(curve.segments):
        function, numbers = symbolic_function(curve, lambda c, k=k: c.at(k, u, order))
        assert_allclose(np.array(function(*numbers)), curve.at(k, u, order), rtol=1e-13, atol=1e-11)


@pytest.mark.parametrize("operation", ["split", "elevate", "dilate", "derivative"])
def test_symbolic_operations_equal_numeric_ones(operation: str) -> None:
    curve = random_curve(2, (3, 4))
    do: dict[str, Callable[[PiecewiseBezier], PiecewiseBezier]] = {
        "split": lambda c: c.split(1, 0.3),
        "elevate": lambda c: c.elevate(6),
        "dilate": lambda c: c.dilate(1.7),
        "derivative": lambda c: c.derivative(2),
    }
    expected = do[operation](curve)
    function, numbers = symbolic_function(
        curve, lambda c: ca.vertcat(do[operation](c).durations, *(ca.vec(p) for p in do[operation](c).control_points))
    )
    flat = np.concatenate([expected.durations, *(p.ravel(order="F") for p in expected.control_points)])
    assert_allclose(np.array(function(*numbers)).ravel(), flat, rtol=1e-13, atol=1e-12)


# --- elevation, splitting, dilation ---


@pytest.mark.parametrize("seed", SEEDS)
def test_elevation_leaves_the_curve_and_its_derivatives_unchanged(seed: int) -> None:
    curve = random_curve(seed, (2, 5, 3))
    raised = curve.elevate(8)
    assert raised.degrees == (8, 8, 8)
    t = np.linspace(0.0, curve.duration, 60)
    for order in range(3):
        assert_allclose(raised(t, order), curve(t, order), atol=1e-11)


@pytest.mark.parametrize("u", [1e-3, 0.25, 0.5, 0.999])
def test_a_split_curve_is_the_same_curve(u: float) -> None:
    curve = random_curve(4, (4, 6, 3))
    cut = curve.split(1, u)
    assert cut.segments == 4
    assert cut.degrees == (4, 6, 6, 3)
    assert cut.duration == pytest.approx(curve.duration, rel=4 * EPS)
    t = np.linspace(0.0, curve.duration, 200)
    # A derivative of the shorter piece divides rounding by its duration once more.
    for order in range(3):
        assert_allclose(cut(t, order), curve(t, order), atol=1e-12 / min(u, 1 - u) ** order)


@pytest.mark.parametrize("seed", SEEDS)
def test_restriction_is_the_arc(seed: int) -> None:
    curve = random_curve(seed, (6,))
    a, b = np.sort(np.random.default_rng(seed).uniform(size=2))
    w = np.linspace(0.0, 1.0, 11)
    assert_allclose(basis(6, w) @ curve.restrict(0, a, b), curve.at(0, a + w * (b - a)), atol=1e-13)


@pytest.mark.parametrize("factor", [0.2, 1.7, 30.0])
@pytest.mark.parametrize("order", range(5))
def test_dilation_scales_the_mth_derivative_by_factor_to_the_minus_m(order: int, factor: float) -> None:
    curve = random_curve(5, (5, 4))
    slow = curve.dilate(factor)
    t = np.linspace(0.0, curve.duration, 50)
    assert_allclose(slow(factor * t, order) * factor**order, curve(t, order), rtol=1e-10, atol=1e-9)
    assert slow.duration == pytest.approx(factor * curve.duration, rel=4 * EPS)


# --- bounds ---


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("seed", SEEDS)
def test_hull_holds_every_sample(seed: int, order: int) -> None:
    curve = random_curve(seed, (5, 3, 6))
    low, high = curve.hull(order)
    for k in range(curve.segments):
        values = curve.at(k, np.linspace(0.0, 1.0, 201), order)
        slack = 100 * EPS * np.abs(values).max()
        assert (values >= low[k] - slack).all()
        assert (values <= high[k] + slack).all()


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("seed", range(12))
def test_extrema_are_exact_and_never_inside_a_dense_scan(seed: int, order: int) -> None:
    curve = random_curve(seed, ((5, 2, 7), (9,), (3, 3, 4))[seed % 3])
    count = 4001
    samples = np.concatenate([curve.at(k, np.linspace(0, 1, count), order) for k in range(curve.segments)])
    # Between samples a value can be du^2 |q''| / 8 beyond them.
    bend = max(np.abs(curve.hodograph(k, order + 2)).max() * curve.durations[k] ** 2 for k in range(curve.segments))
    hidden, slack = bend / (count - 1) ** 2 / 8, 1e3 * EPS * np.abs(samples).max()
    for j, found in enumerate(curve.extrema(order)):
        assert samples[:, j].min() - hidden - slack <= found.lower <= samples[:, j].min() + slack
        assert samples[:, j].max() + hidden + slack >= found.upper >= samples[:, j].max() - slack


@pytest.mark.parametrize("seed", SEEDS)
def test_the_value_at_the_instant_of_an_extremum_is_the_extremum(seed: int) -> None:
    curve = random_curve(seed)
    curve = PiecewiseBezier(curve.durations, _joined(curve.control_points))  # no jumps: an instant has one value
    for j, found in enumerate(curve.extrema()):
        low, high = curve([found.lower_time, found.upper_time])[:, j]
        assert low == pytest.approx(found.lower, abs=1e-12)
        assert high == pytest.approx(found.upper, abs=1e-12)


def _joined(points: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    joined = [points[0]]
    for p in points[1:]:
        joined.append(np.concatenate([joined[-1][-1:], p[1:]]))
    return tuple(joined)


def test_extrema_of_a_quartic_with_a_fourfold_root_and_of_constant_and_linear_joints() -> None:
    """(u - 1/2)^4: its derivative has a triple root, which rounding makes complex; the minimum is still 0."""
    quartic = [0.5**4 * (-1) ** i for i in range(5)]  # blossom of (u - 1/2)^4 at i ones and 4 - i zeros
    points = np.stack([quartic, np.full(5, 3.0), np.linspace(0.0, 2.0, 5)], axis=1)
    fourfold, constant, linear = PiecewiseBezier([1.0], (points,)).extrema()
    assert fourfold.lower == pytest.approx(0.0, abs=1e-15)
    assert fourfold.lower_time == pytest.approx(0.5, abs=1e-3)
    assert fourfold.upper == pytest.approx(0.5**4, rel=1e-14)
    assert (constant.lower, constant.upper) == (3.0, 3.0)
    assert (linear.lower, linear.lower_time, linear.upper, linear.upper_time) == (0.0, 0.0, 2.0, 1.0)


def test_extrema_of_a_quintic_move_have_their_closed_form() -> None:
    """Peak velocity 15/8 D/T at T/2; peak acceleration 10/sqrt(3) D/T^2 at (3 - sqrt(3))/6 T; peak jerk 60 D/T^3."""
    distance, duration = 0.8, 1.6
    curve = PiecewiseBezier([duration], (np.array([0.0] * 3 + [distance] * 3)[:, None],))
    velocity, acceleration, jerk = (curve.extrema(order)[0] for order in (1, 2, 3))
    assert velocity.upper == pytest.approx(15 / 8 * distance / duration, rel=1e-14)
    assert velocity.upper_time == pytest.approx(duration / 2, rel=1e-7)
    assert acceleration.upper == pytest.approx(10 / np.sqrt(3) * distance / duration**2, rel=1e-14)
    assert acceleration.upper_time == pytest.approx((3 - np.sqrt(3)) / 6 * duration, rel=1e-7)
    assert acceleration.lower == pytest.approx(-acceleration.upper, rel=1e-13)
    assert jerk.upper == pytest.approx(60 * distance / duration**3, rel=1e-13)


@pytest.mark.parametrize("order", range(3))
def test_jump_is_the_difference_of_one_sided_limits(order: int) -> None:
    curve = random_curve(6, (4, 5, 3, 3))
    expected = [curve.at(k + 1, 0.0, order)[0] - curve.at(k, 1.0, order)[0] for k in range(3)]
    assert_allclose(curve.jump(order), expected, atol=1e-12)
    assert random_curve(0, (4,)).jump(order).shape == (0, 3)


def test_jumps_of_a_cubic_spline_vanish_up_to_acceleration_and_not_beyond() -> None:
    rng = np.random.default_rng(0)
    curve = PiecewiseBezier.from_ppoly(CubicSpline(np.cumsum(rng.uniform(0.2, 1, 8)), rng.normal(size=(8, 2))))
    for order in range(3):
        assert np.abs(curve.jump(order)).max() < 1e-11
    assert np.abs(curve.jump(3)).max() > 1.0


# --- times ---


def test_a_knot_belongs_to_the_segment_it_starts_and_the_end_to_the_last() -> None:
    curve = random_curve(0, (3, 3, 3))
    segment, u = curve.locate(curve.knots)
    assert segment.tolist() == [0, 1, 2, 2]
    assert_allclose(u, [0.0, 0.0, 0.0, 1.0], atol=4 * EPS)


@pytest.mark.parametrize("time", [-0.1, 1e3, np.nan])
def test_a_time_outside_the_curve_is_refused(time: float) -> None:
    with pytest.raises(InputError, match=r"times must lie in \[0, .* s; got"):
        random_curve(0)([0.0, time])


def test_a_time_off_the_end_by_rounding_is_accepted() -> None:
    curve = random_curve(0)
    assert_array_equal(curve([curve.knots[-1] * (1 + 4 * EPS)]), curve([curve.knots[-1]]))


# --- scipy ---


@pytest.mark.parametrize("seed", SEEDS)
def test_bpoly_round_trip_is_exact(seed: int) -> None:
    curve = random_curve(seed)
    back = PiecewiseBezier.from_bpoly(curve.to_bpoly())
    assert_allclose(back.durations, curve.durations, rtol=1e-14)
    for ours, theirs in zip(curve.control_points, back.control_points, strict=True):
        assert_array_equal(ours, theirs)


def test_bpoly_of_mixed_degrees_is_the_same_curve() -> None:
    curve = random_curve(1, (2, 5, 3))
    t = np.linspace(0.0, curve.duration, 50)
    assert_allclose(curve.to_bpoly()(t), curve(t), atol=1e-13)


def test_bpoly_of_one_joint_without_a_joint_axis_is_read() -> None:
    bpoly = BPoly([[0.0, 1.0], [0.5, 2.0], [1.0, 3.0]], [2.0, 3.0, 5.0])
    curve = PiecewiseBezier.from_bpoly(bpoly)
    assert (curve.dof, curve.degrees) == (1, (2, 2))
    t = np.linspace(0.0, 3.0, 20)
    assert_allclose(curve(t)[:, 0], bpoly(t + 2.0), atol=1e-14)


@pytest.mark.parametrize("order", range(4))
def test_ppoly_and_cubic_spline_are_read_unchanged(order: int) -> None:
    rng = np.random.default_rng(2)
    knots = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, 6))])
    t = rng.uniform(0.0, knots[-1], 60)
    spline = CubicSpline(knots, rng.normal(size=(7, 4)), bc_type="clamped")
    ppoly = PPoly(rng.normal(size=(6, 6, 4)), knots)
    for reference in (spline, ppoly):
        curve = PiecewiseBezier.from_ppoly(reference)
        size = np.abs(np.concatenate(curve.hull(order))).max()
        assert_allclose(curve(t, order), reference(t, order), atol=1e3 * EPS * size)


# --- properties and bad input ---


def test_properties_of_mixed_degrees() -> None:
    curve = random_curve(0, (2, 5), dof=4)
    assert (curve.segments, curve.dof, curve.degrees) == (2, 4, (2, 5))
    assert_array_equal(curve.knots, [0.0, curve.durations[0], curve.durations.sum()])
    assert curve.hodograph(0, 1).shape == (2, 4)
    assert curve.hodograph(0, 4).shape == (1, 4)
    assert comb(5, 2) * 0.25**2 * 0.75**3 == pytest.approx(basis(5, 0.25)[0, 2])


@pytest.mark.parametrize(
    ("durations", "points", "message"),
    [
        ([1.0, 2.0], (np.zeros((3, 2)),), "one duration per segment: 2 durations, 1 segments"),
        ([], (), "one duration per segment: 0 durations, 0 segments"),
        ([1.0, 1.0], (np.zeros((3, 2)), np.zeros((3, 1))), r"same number of joints; got \[1, 2\]"),
        ([1.0, 0.0], (np.zeros((3, 2)),) * 2, "durations must be positive and finite"),
        ([1.0, -1.0], (np.zeros((3, 2)),) * 2, "durations must be positive and finite"),
        ([np.nan], (np.zeros((3, 2)),), "durations must be positive and finite"),
        ([np.inf], (np.zeros((3, 2)),), "durations must be positive and finite"),
        ([1.0, 1.0], (np.zeros((3, 2)), np.full((3, 2), np.nan)), "control points of segment 1 are not all finite"),
    ],
)
def test_a_bad_curve_is_refused(durations: list[float], points: tuple[np.ndarray, ...], message: str) -> None:
    with pytest.raises(ProblemDefinitionError, match=message):
        PiecewiseBezier(durations, points)


@pytest.mark.parametrize("u", [0.0, 1.0, -0.5, 2.0])
def test_a_segment_is_split_inside_it_only(u: float) -> None:
    with pytest.raises(InputError, match="0 < u < 1; got"):
        random_curve(0).split(0, u)


def test_elevation_does_not_go_down() -> None:
    with pytest.raises(InputError, match="degree elevation goes up: 3 is below 4"):
        random_curve(0, (2, 4)).elevate(3)
