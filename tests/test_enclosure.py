"""Sub-arcs contain the exact curve, in rational arithmetic; the parabola lies above what it bounds."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from ocp_traj.arrays import Array
from ocp_traj.proof.enclosure import Arcs, parabola_bound, peak_fraction
from ocp_traj.proof.prover import MAX_SPLITS

ORDERS = 6
SIZES = (1.0, 1e-8, 1e150, 1e-300, 5e-324)  # [rad] of the control points; the last are subnormal numbers


def exact_hodograph(points: Array, duration: float, order: int) -> list[list[Fraction]]:
    """Control points of a derivative, ``[control point][joint]``."""
    rows = [[Fraction(x) for x in row] for row in points]
    for _ in range(order):
        n, time = len(rows) - 1, Fraction(duration)
        if n == 0:
            return [[Fraction(0)] * points.shape[1]]
        rows = [[n * (y - x) / time for x, y in zip(a, b, strict=True)] for a, b in zip(rows, rows[1:], strict=False)]
    return rows


def exact_value(rows: list[list[Fraction]], u: Fraction) -> list[Fraction]:
    n = len(rows) - 1
    weights = [comb(n, i) * u**i * (1 - u) ** (n - i) for i in range(n + 1)]
    return [sum(w * row[j] for w, row in zip(weights, rows, strict=True)) for j in range(len(rows[0]))]


def contains(pair: tuple[Array, Array], exact: list[list[Fraction]]) -> bool:
    """Whether bounds ``(rows, columns)`` hold the exact numbers."""
    return all(
        low <= x <= high
        for lows, highs, row in zip(*(end.tolist() for end in pair), exact, strict=True)
        for low, high, x in zip(lows, highs, row, strict=True)
    )


def one_arc(points: Array, duration: float) -> Arcs:
    return Arcs.of_segments(np.array([0]), np.array([0]), points[None], np.array([duration]), ORDERS)


def random_case(rng: np.random.Generator, size: float) -> tuple[Array, float]:
    degree, dof = int(rng.integers(1, 10)), 2
    points = size * rng.normal(size=(degree + 1, dof)) + (rng.integers(2) * 3.0 * size)
    return points, float(10.0 ** rng.uniform(-2.0, 2.0))


def random_cut(rng: np.random.Generator) -> Array:
    """In the middle, at a multiple of 2^-20, or as near an end as cuts go."""
    return np.array([rng.choice([0.5, rng.uniform(), 0.125, 1e-9, 1.0 - 1e-9])])


@pytest.mark.parametrize("size", SIZES)
def test_hodographs_contain_the_exact_ones(size: float) -> None:
    rng = np.random.default_rng(1)
    for _ in range(60):
        points, duration = random_case(rng, size)
        arcs = one_arc(points, duration)
        for order in range(ORDERS + 1):
            low, high = arcs.hodographs[order]
            assert contains((low[0], high[0]), exact_hodograph(points, duration, order))


@pytest.mark.parametrize("size", SIZES)
def test_arcs_contain_the_exact_curve_however_they_are_cut(size: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(15):
        points, duration = random_case(rng, size)
        exact = [exact_hodograph(points, duration, order) for order in range(ORDERS + 1)]
        arcs, a, b = one_arc(points, duration), Fraction(0), Fraction(1)
        for _ in range(int(rng.integers(1, 12))):
            at = random_cut(rng)
            ratio = Fraction(float(np.clip(np.round(at * 2.0**20), 1.0, 2.0**20 - 1.0)[0])) / 2**20
            left, right = arcs.split(at)
            middle = a + ratio * (b - a)
            goes_left = bool(rng.integers(2))
            arcs, a, b = (left, a, middle) if goes_left else (right, middle, b)
        for order in range(ORDERS + 1):
            ends = [exact_value(exact[order], u) for u in (a, b)]
            for which, value in zip((0, -1), ends, strict=True):
                low, high = arcs.end(order, which)
                assert contains((low.T, high.T), [value])
            low, high = arcs.hull(order)
            for u in (a, (2 * a + b) / 3, (a + b) / 2, b):
                assert contains((low.T, high.T), [exact_value(exact[order], u)])
        for (low, high), u in ((arcs.end_time(0), a), (arcs.end_time(-1), b)):
            assert low[0, 0] <= u <= high[0, 0]
        low, high = arcs.local_time()
        assert low[0, 0] <= a and b <= high[0, 0]
        assert Fraction(float(arcs.width()[0])) >= (b - a) * Fraction(duration)


@pytest.mark.parametrize("size", SIZES)
def test_joined_arcs_of_several_degrees_contain_the_exact_curves(size: float) -> None:
    rng = np.random.default_rng(8)
    cases = [random_case(rng, size) for _ in range(6)]
    parts = [
        Arcs.of_segments(np.array([i % 2]), np.array([i]), points[None], np.array([duration]), ORDERS)
        for i, (points, duration) in enumerate(cases)
    ]
    joined = Arcs.join(parts)
    assert joined.owner.tolist() == [0, 1, 0, 1, 0, 1]
    joined = joined.take(np.lexsort((joined.segment, joined.owner)))
    assert joined.owner.tolist() == [0, 0, 0, 1, 1, 1] and joined.segment.tolist() == [0, 2, 4, 1, 3, 5]
    assert joined.hodographs[0][0].shape[1] == max(len(points) for points, _ in cases)
    for row, (points, duration) in enumerate(cases[i] for i in joined.segment):
        for order in range(ORDERS + 1):
            exact = exact_hodograph(points, duration, order)
            low, high = (end[row] for end in joined.hodographs[order])
            while len(exact) < len(low):
                n = len(exact)
                inner = [
                    [Fraction(i, n) * x + (1 - Fraction(i, n)) * y for x, y in zip(exact[i - 1], exact[i], strict=True)]
                    for i in range(1, n)
                ]
                exact = [exact[0], *inner, exact[-1]]
            assert contains((low, high), exact)


def test_recorded_ends_of_arcs_stay_within_the_slack_after_every_cut() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        arcs, a, b = one_arc(np.zeros((2, 1)), 1.0), Fraction(0), Fraction(1)
        for _ in range(MAX_SPLITS):
            at = np.array([rng.choice([rng.uniform(0.125, 0.875), 0.5])])
            ratio = Fraction(float(np.round(at * 2.0**20)[0])) / 2**20
            halves, middle = arcs.split(at), a + ratio * (b - a)
            side = int(rng.integers(2))
            arcs, a, b = halves[side], (a, middle)[side], (middle, b)[side]
            assert (
                abs(Fraction(float(arcs.a[0])) - a) <= arcs.slack and abs(Fraction(float(arcs.b[0])) - b) <= arcs.slack
            )


def test_arcs_of_a_constant_stay_exact() -> None:
    arcs = one_arc(np.full((10, 1), 0.1), 0.3)
    for _ in range(MAX_SPLITS):
        arcs = arcs.split(np.array([0.37]))[1]
    low, high = arcs.hull(0)
    assert low[0, 0] == high[0, 0] == 0.1


def test_parts_lie_within_the_whole() -> None:
    rng = np.random.default_rng(4)
    arcs = one_arc(rng.normal(size=(10, 3)), 0.7)
    for _ in range(MAX_SPLITS):
        halves = arcs.split(random_cut(rng))
        for half in halves:
            for order in range(ORDERS + 1):
                (low, high), (below, above) = half.hull(order), arcs.hull(order)
                assert (below <= low).all() and (high <= above).all()
        arcs = halves[int(rng.integers(2))]


def test_arcs_keep_the_order_of_their_owners() -> None:
    owner = np.array([0, 0, 1, 3])
    arcs = Arcs.of_segments(
        owner, np.array([0, 1, 0, 0]), np.random.default_rng(5).normal(size=(4, 4, 2)), np.ones(4), 2
    )
    left, right = arcs.split(np.full(4, 0.25))
    both = left.interleave(right)
    assert both.owner.tolist() == [0, 0, 0, 0, 1, 1, 3, 3]
    assert both.segment.tolist() == [0, 0, 1, 1, 0, 0, 0, 0]
    assert both.a.tolist() == [0.0, 0.25] * 4 and both.b.tolist() == [0.25, 1.0] * 4
    rest = both.take(both.a > 0.0)
    for order in range(3):
        for ours, theirs in zip(rest.hodographs[order], right.hodographs[order], strict=True):
            assert (ours == theirs).all()


@pytest.mark.parametrize("duration", [1e-320, 1e-200, 1e200])
def test_hodographs_of_extreme_durations_are_bounds_without_a_warning(duration: float) -> None:
    points = np.array([[0.1], [-0.3], [0.2], [1e308], [-1e308]])
    arcs = one_arc(points, duration)
    left, right = arcs.split(np.array([0.3]))
    for order in range(ORDERS + 1):
        exact = exact_hodograph(points, duration, order)
        assert contains(tuple(end[0] for end in arcs.hodographs[order]), exact)  # type: ignore[arg-type]
        for half, u in ((left, Fraction(0)), (right, Fraction(1))):
            low, high = half.end(order, 0 if u == 0 else -1)
            assert contains((low.T, high.T), [exact_value(exact, u)])
            assert not (np.isnan(low).any() or np.isnan(high).any())


# --- The parabola -----------------------------------------------------------------------------------------------------


def exact_bound(start: float, end: float, curvature: float, width: float) -> Fraction:
    """Maximum of the parabola of second derivative -curvature through both ends."""
    k = max(Fraction(0), Fraction(curvature)) * Fraction(width) ** 2 / 2
    d = abs(Fraction(end) - Fraction(start))
    top = max(Fraction(start), Fraction(end))
    return top + (k - d) ** 2 / (4 * k) if k > d else top


def bound(start: float, end: float, curvature: float, width: float) -> float:
    arrays = [np.array([[x]]) for x in (start, end, curvature)]
    return float(parabola_bound(*arrays, np.array([width]))[0, 0])


@pytest.mark.parametrize("size", [1.0, 1e-155, 1e-307, 1e155, 1e307])
@pytest.mark.parametrize("width", [1.0, 1e-160, 1e-100, 1e100])
def test_parabola_bound_is_never_below_the_exact_one(size: float, width: float) -> None:
    rng = np.random.default_rng(6)
    for _ in range(100):
        start, end = size * rng.normal(size=2)
        if rng.integers(2):
            end = start * (1.0 + rng.choice([0.0, 1e-16, 1e-8]))
        k = abs(end - start) * rng.choice([1.0, 1.0 + 1e-15, 1.0 + 1e-8, 0.5, 3.0]) + rng.integers(2) * size
        with np.errstate(over="ignore", under="ignore"):
            curvature = float(np.float64(2.0 * k) / width / width)
        found = bound(float(start), float(end), curvature, width)
        if np.isfinite(curvature):
            exact = exact_bound(float(start), float(end), curvature, width)
            assert found >= exact
            if 1e-200 < size < 1e200 and 1e-290 < curvature < 1e290:
                assert Fraction(found) - exact <= Fraction(1e-14) * (abs(exact) + Fraction(float(k)) + Fraction(size))
        else:
            assert found == np.inf


def test_parabola_bound_does_not_lean_on_a_rounded_comparison_of_curvature_and_slope() -> None:
    """The end at 0 is the top: what the parabola rises above it is all there is, down to 1e-33 of the slope."""
    rng, close = np.random.default_rng(9), 0
    for _ in range(300):
        curvature, width = rng.uniform(1.0, 2.0, 2)
        drop = 0.5 * width**2 * curvature * rng.choice([1.0, 1.0 + 2.0**-52, 1.0 - 2.0**-52])
        exact = exact_bound(-drop, 0.0, curvature, width)
        close += 0 < exact < 1e-30
        assert Fraction(bound(-drop, 0.0, curvature, width)) >= exact
    assert close > 50


def test_parabola_bound_is_attained_by_the_parabola() -> None:
    rng = np.random.default_rng(7)
    s = np.linspace(0.0, 1.0, 100_001)
    for _ in range(20):
        start, end, curvature, width = *rng.normal(size=2), rng.uniform(-1.0, 30.0), rng.uniform(0.1, 2.0)
        values = start + (end - start) * s + 0.5 * curvature * width**2 * s * (1.0 - s)
        assert bound(start, end, curvature, width) == pytest.approx(
            values.max() if curvature > 0 else max(start, end), abs=1e-8
        )
        at = peak_fraction(*(np.array([[x]]) for x in (start, end, curvature)), np.array([width]))[0, 0]
        if 0.125 < s[np.argmax(values)] < 0.875:
            assert at == pytest.approx(s[np.argmax(values)], abs=2e-5)
        assert 0.125 <= at <= 0.875


@pytest.mark.parametrize(
    ("start", "end", "curvature"),
    [
        (0.0, 0.0, np.inf), (0.0, 0.0, np.nan), (np.inf, 0.0, 0.0), (np.inf, np.inf, -1.0), (np.nan, 0.0, 1.0),
        (0.0, np.nan, -1.0), (0.0, 0.0, 1e308),
    ],
)  # fmt: skip
def test_parabola_bound_of_what_is_unknown_is_infinite(start: float, end: float, curvature: float) -> None:
    assert bound(start, end, curvature, 1e3) == np.inf
    at = peak_fraction(*(np.array([[x]]) for x in (start, end, curvature)), np.array([1e3]))[0, 0]
    assert 0.125 <= at <= 0.875
