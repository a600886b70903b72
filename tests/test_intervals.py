"""Operations on intervals contain the exact range, whatever the boxes, and not much more."""

import warnings
from collections.abc import Callable
from typing import Any

import casadi
import flint
import numpy as np
import pytest
from numpy.typing import NDArray

from ocp_traj.interval.intervals import INTERVAL, apply
from ocp_traj.interval.tape import NAMES, Tape
from tests.operations import (
    BINARY,
    CASES,
    LARGEST,
    N_BOXES,
    N_EXACT,
    PRECISION,
    arb,
    arguments,
    case_function,
    enclose,
    function_of,
)

Array = NDArray[Any]
SX = casadi.SX


def test_every_interval_operation_is_tested() -> None:
    functions = [case_function(name) for name in CASES]
    used = {function.instruction_id(k) for function in functions for k in range(function.n_instructions())}
    assert {NAMES[operation] for operation in set(INTERVAL) - used} == {"OP_ASSIGN"}


@pytest.mark.parametrize("name", CASES)
def test_enclosure_contains_long_double_values(name: str) -> None:
    rng = np.random.default_rng(list(name.encode()))
    boxes, points = arguments(rng, name, N_BOXES)
    lower, upper = enclose(case_function(name), *boxes)
    with np.errstate(all="ignore"):
        values = CASES[name].wide(*[p.astype(np.longdouble) for p in points])
    known = np.isfinite(values)
    assert known.sum() > 0.05 * known.size
    values, column = values[known], np.nonzero(known)[1]
    # The reference errs, too: by a few of its own ulp (those of a double for erf).
    slack = np.abs(values) * (4 * np.finfo(values.dtype).eps) + np.finfo(values.dtype).smallest_subnormal
    outside = (values + slack < lower[column]) | (values - slack > upper[column])
    assert not outside.any(), [p[known][outside][0] for p in points]


@pytest.mark.parametrize("name", CASES)
def test_enclosure_contains_exact_values(name: str) -> None:
    rng = np.random.default_rng(list(name.encode()) + [1])
    boxes, points = arguments(rng, name, N_EXACT)
    lower, upper = enclose(case_function(name), *boxes)
    conclusive = 0
    flint.ctx.prec = PRECISION
    for box in range(N_EXACT):
        low, high = arb(lower[box]), arb(upper[box])
        for point in zip(*[p[:, box].tolist() for p in points], strict=True):
            try:
                value = CASES[name].ball(*map(arb, point))
            except ZeroDivisionError:
                continue
            assert not value < low and not value > high, (point, lower[box], upper[box])
            conclusive += low <= value and value <= high
    assert conclusive > 0.5 * N_EXACT


@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_enclosure_holds_at_every_multiple_of_half_pi(name: str) -> None:
    """The worst cases of argument reduction and of quadrant counting: the floats around all multiples up to 1e5."""
    nearest = np.arange(-63_700, 63_701) * (np.pi / 2)
    for steps in (-1, 0, 1, 10_000):
        low = nearest + steps * np.spacing(nearest)
        high = low + np.spacing(np.abs(low))
        lower, upper = enclose(case_function(name), (low, high))
        assert name == "tan" or ((lower >= -1.0).all() and (upper <= 1.0).all())
        for point in (low, high):
            with np.errstate(all="ignore"):
                value = CASES[name].wide(point.astype(np.longdouble))
            slack = 4 * np.finfo(np.longdouble).eps * np.abs(value)
            assert (lower <= value + slack).all() and (value - slack <= upper).all()


@pytest.mark.parametrize(("name", "peak"), [("sin", 0.25), ("cos", 0.0)])
def test_extrema_inside_are_found(name: str, peak: float) -> None:
    rng = np.random.default_rng(2)
    for extremum, turns in ((1.0, peak), (-1.0, peak + 0.5)):
        centre = (rng.integers(-15_000, 15_000, N_BOXES) + turns) * (2 * np.pi)
        left, right = 10 ** rng.uniform(-10, 0.4, (2, N_BOXES))
        lower, upper = enclose(case_function(name), (centre - left, centre + right))
        assert ((lower if extremum < 0 else upper) == extremum).all()
        other = -upper if extremum < 0 else lower  # the value at the farther end, the opposite extremum being outside
        np.testing.assert_allclose(other, np.cos(np.maximum(left, right)), atol=1e-10)


def test_huge_angles_have_the_whole_range() -> None:
    low = np.array([2e5, -3e5, 1e300, -np.inf, 0.0, -np.inf])
    high = np.array([2e5, -3e5, 2e300, np.inf, np.inf, 0.0])
    for name, (least, most) in {"sin": (-1, 1), "cos": (-1, 1), "tan": (-np.inf, np.inf)}.items():
        lower, upper = enclose(case_function(name), (low, high))
        assert (lower == least).all() and (upper == most).all()


@pytest.mark.parametrize("name", CASES)
def test_enclosure_of_a_point_is_tight(name: str) -> None:
    rng = np.random.default_rng(3)
    points = [rng.uniform(0.1, 0.9, 1000) + (name == "acosh") for _ in range(2 if name in BINARY else 1)]
    lower, upper = enclose(case_function(name), *[(p, p) for p in points])
    # [ulp] 2 for the operations of IEEE, 2 x 10 for others; x^y goes through exp, log and a product.
    allowed = 150 if name in ("pow", "erf") else 40 if name.startswith("power") else 21
    allowed = 4 if name in ("add", "sub", "mul", "div", "inv", "sq", "x x", "twice", "sqrt", "plus 0.1") else allowed
    assert (upper - lower <= allowed * np.spacing(np.minimum(np.abs(lower), np.abs(upper)))).all()


@pytest.mark.parametrize(
    "name", ["exp", "expm1", "log", "log1p", "sqrt", "sinh", "asinh", "atan", "tanh", "erf", "tan"]
)
def test_enclosure_of_a_monotone_function_is_tight(name: str) -> None:
    rng = np.random.default_rng(4)
    low = rng.uniform(0.1, 0.7, 1000)
    high = low + rng.uniform(0.0, 0.8, 1000)
    lower, upper = enclose(case_function(name), (low, high))
    np.testing.assert_allclose(lower, np.float64(CASES[name].wide(low)), rtol=1e-14)
    np.testing.assert_allclose(upper, np.float64(CASES[name].wide(high)), rtol=1e-14)


def test_known_ranges_are_tight() -> None:
    def ends(expression: Callable[..., Any], *boxes: tuple[float, float]) -> tuple[float, float]:
        lower, upper = enclose(function_of(expression, len(boxes)), *[(np.array([a]), np.array([b])) for a, b in boxes])
        return float(lower[0]), float(upper[0])

    low, high = ends(casadi.sin, (0.0, np.pi / 6))
    assert -1e-300 < low <= 0.0 and 0.5 - 2**-54 <= high <= 0.5 + 10 * np.spacing(0.5)
    low, high = ends(lambda x: x**2, (-1.0, 2.0))
    assert low == 0.0 and high == np.nextafter(4.0, 5.0)
    assert ends(casadi.cos, (-0.1, 0.1))[1] == 1.0
    assert ends(casadi.fabs, (-3.0, 2.0)) == (0.0, 3.0)
    assert ends(casadi.fmax, (-3.0, 2.0), (-1.0, 1.0)) == (-1.0, 2.0)
    assert ends(lambda x, y: x * y, (-1.0, 2.0), (-3.0, 0.5)) == pytest.approx((-6.0, 3.0), rel=1e-15)
    assert ends(lambda x, y: x / y, (-1.0, 2.0), (0.5, 4.0)) == pytest.approx((-2.0, 4.0), rel=1e-15)
    assert ends(lambda x, y: x / y, (1.0, 2.0), (-4.0, -0.5)) == pytest.approx((-4.0, -0.25), rel=1e-15)
    assert ends(casadi.cosh, (-1.0, 2.0)) == pytest.approx((1.0, np.cosh(2.0)))
    assert ends(casadi.hypot, (-3.0, 1.0), (4.0, 4.0)) == pytest.approx((4.0, 5.0))
    assert ends(lambda x: x**101, (-2.0, 1.0)) == pytest.approx((-(2.0**101), 1.0))
    assert ends(lambda x: x**102, (-2.0, 1.0)) == pytest.approx((0.0, 2.0**102))
    assert ends(lambda x: x**-101, (-1.0, -0.5)) == pytest.approx((-(2.0**101), -1.0))
    assert ends(lambda x: x**2.5, (1.0, 4.0)) == pytest.approx((1.0, 32.0))
    assert ends(lambda x, y: x**y, (0.5, 2.0), (-1.0, 3.0)) == pytest.approx((0.125, 8.0))
    assert ends(casadi.atan2, (-1.0, 1.0), (1.0, 2.0)) == pytest.approx((-np.pi / 4, np.pi / 4))
    assert ends(casadi.atan2, (1.0, 2.0), (-1.0, 1.0)) == pytest.approx((np.pi / 4, 3 * np.pi / 4))
    for y in ((-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)):
        low, high = ends(casadi.atan2, y, (-2.0, -1.0))
        assert low == np.nextafter(-np.pi, -4.0) and high == np.nextafter(np.pi, 4.0)


def test_product_with_itself_is_a_square() -> None:
    function = case_function("x x")
    assert function.instruction_id(1) == casadi.OP_MUL
    lower, upper = enclose(function, (np.array([-1.0]), np.array([2.0])))
    assert lower[0] == 0.0 and upper[0] == np.nextafter(4.0, 5.0)


NEVER_NAN = {
    "1/x": lambda x: 1 / x,
    "x/x": lambda x: x / (x + 0),
    "1/x - 1/x": lambda x: 1 / x - 1 / (x + 1e-9),
    "0 inf": lambda x: (x - x.T * 1.0) * (1 / x) + (0.1 * x - x / 10) * casadi.exp(1 / x),
    "inf - inf": lambda x: casadi.exp(1e4 * x) - casadi.exp(2e4 * x),
    "sqrt of negative": lambda x: casadi.sqrt(-1 - x**2) + casadi.log(-1 - x**2) + casadi.asin(2 + x**2),
    "acosh, atanh, log1p": lambda x: casadi.acosh(-x) + casadi.atanh(1 + x) + casadi.log1p(x - 1),
    "nested": lambda x: casadi.sin(casadi.log(casadi.sqrt(x))) / casadi.tan(1 / x) * casadi.atan2(1 / x, x),
    "powers": lambda x: x**-2.5 * x**x * casadi.constpow(x, -3),
    "infinite constant": lambda x: x * SX(np.inf) + casadi.cos(x * SX(-np.inf)) + x ** SX(np.inf),
    "NaN constant": lambda x: x * SX(np.nan) + x ** SX(np.nan),
    "hypot, cosh": lambda x: casadi.hypot(1 / x, x) - casadi.cosh(1 / x) * casadi.sinh(1 / x),
}


@pytest.mark.parametrize("name", NEVER_NAN)
def test_never_nan(name: str) -> None:
    ends = np.array([-np.inf, -LARGEST, -2.0, -1.0, -1e-320, -0.0, 0.0, 1e-320, 1.0, 3.0, LARGEST, np.inf])
    low, high = (values.ravel() for values in np.meshgrid(ends, ends))
    low, high = low[low <= high], high[low <= high]
    function = function_of(NEVER_NAN[name], 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lower, upper = enclose(function, (low, high))  # asserts that there is no NaN
        values = Tape(function).evaluate(np.clip(low, -LARGEST, LARGEST)[None])[0][0]
    defined = np.isfinite(values)
    slack = 1e-12 * np.abs(values[defined])
    assert (lower[defined] - slack <= values[defined]).all() and (values[defined] <= upper[defined] + slack).all()


def test_outside_of_the_domain_nothing_is_known() -> None:
    boxes = {"sqrt": -1.0, "log": -1.0, "asin": 2.0, "acos": -2.0, "acosh": 0.5, "atanh": 2.0, "log1p": -2.0}
    for name, value in {**boxes, "power 2.3": -1.0, "inv": 0.0}.items():
        lower, upper = enclose(case_function(name), (np.array([value]), np.array([value])))
        assert lower[0] == -np.inf and upper[0] == np.inf, name


def test_flag_raised_without_cause_does_no_harm() -> None:
    def double(x: Array) -> Array:
        np.sqrt(-np.ones(1))  # as vectorised code does on unused lanes
        return 2.0 * x

    with np.errstate(invalid="raise"):
        assert apply(double, np.ones(3)).tolist() == [2.0, 2.0, 2.0]


def test_an_end_that_is_nan_is_infinite() -> None:
    lower, upper = enclose(function_of(lambda x: x + 1, 1), (np.array([np.nan, 0.0]), np.array([0.0, np.nan])))
    assert lower[0] == -np.inf and upper[0] == pytest.approx(1.0)
    assert lower[1] == pytest.approx(1.0) and upper[1] == np.inf
