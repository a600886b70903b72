"""Interval arithmetic on NumPy arrays: extensions of CasADi operations, rounded outward.

A box is ``(2, N)``, the lower and upper ends of ``N`` intervals, or ``(2, 1)`` where all columns are the same.  The
extension of an operation contains its exact range over each of them:

* ``+ - * /``, square and square root are correctly rounded (IEEE 754): the next float outward is a bound;
* NumPy's transcendental functions err by up to 4 units in the last place (ulp): the margin is 4 of them or more;
* a box is never empty nor NaN: lower ends are below ``+inf``, upper ends above ``-inf``, both infinite where nothing is
  known.  Of a box partly outside the domain of a function, the part inside counts.
"""

import math
from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]
Operation = Callable[..., Any]

_MAX = np.finfo(np.float64).max
_ENTIRE, _INWARD = np.array([[-np.inf], [np.inf]]), np.array([[_MAX], [-_MAX]])
_PI, _HALF_PI = np.nextafter(np.pi, np.inf), np.nextafter(np.pi / 2, np.inf)  # bounds from above
_HUGE_ANGLE = 1e5  # [rad] our choice: the range of sin, cos and tan is not resolved beyond
_FULL_TURN = np.array([[-4.0], [4.0]])  # [rad] a box with every extremum of sin and cos inside

Margin = tuple[Array, Array]  # relative and absolute

# x + (a |x| + b), in floats, is the next float after x or the one after that: Rump, Zimmermann, Boldo and Melquiond
# (2009), BIT 49(2), Algorithm 1.
_NEXT: Margin = (np.array(2.0**-53 * (1.0 + 2.0**-52)), np.array(2.0**-1074))
_ULPS: Margin = (np.array(4.5 * 2.0**-52), np.array(2.0**-1022))  # 4 ulp once rounded; below 2^-1022 a flush to zero


def operation_table(**by_name: Any) -> dict[int, Any]:
    """Values by CasADi's operation codes, given by its names without ``OP_``."""
    return {getattr(casadi, f"OP_{name}"): value for name, value in by_name.items()}


def _outward(box: Array, margin: Margin) -> Array:
    """The box wider by the margin at each end."""
    more = np.abs(box)
    more *= margin[0]
    more += margin[1]
    np.negative(more[0], out=more[0])
    try:
        result: Array = box + more
    except FloatingPointError:  # inf - inf: an end that overflowed inward
        with np.errstate(invalid="ignore"):
            result = box + more
        result = np.where(np.isnan(result), _INWARD, result)
    return result


def _hull(values: Array) -> Array:
    """Least and greatest of each column."""
    result = np.empty((2, values.shape[1]))
    np.minimum.reduce(values, axis=0, out=result[0])
    np.maximum.reduce(values, axis=0, out=result[1])
    return result


def upper_bounds(lower: Array, upper: Array) -> Array:
    """Upper bounds ``(2, ..)`` of -x and x of ends ``(..)`` each, of which those that are NaN are infinite."""
    bounds = np.stack(np.broadcast_arrays(-lower, upper))
    return np.where(np.isnan(bounds), np.inf, np.maximum(bounds, -_MAX))


def on_boxes(extension: Operation) -> Operation:
    """An extension for registers of upper bounds; see ``ocp_traj.interval.program``."""

    def run(result: Array, *operands: Array) -> None:
        boxes = [operand.reshape(2, -1) for operand in operands]
        for box in boxes:
            np.negative(box[0], out=box[0])
        lower, upper = np.broadcast_to(extension(*boxes), boxes[0].shape)
        np.negative(lower.reshape(result[0].shape), out=result[0])
        result[1] = upper.reshape(result[1].shape)

    return run


def _upward(values: Array, result: Array) -> None:
    """Writes the float after each value, or the one after that."""
    more = np.abs(values)
    more *= _NEXT[0]
    more += _NEXT[1]
    try:
        np.add(values, more, out=result)
    except FloatingPointError:  # inf - inf: a bound that overflowed downward
        with np.errstate(invalid="ignore"):
            np.add(values, more, out=result)
        result[np.isnan(result)] = -_MAX


def add(result: Array, x: Array, y: Array) -> None:
    """Sum of upper bounds; none is -inf, so that the sum is a number."""
    x += y
    _upward(x, result)


def scale(result: Array, x: Array, y: Array) -> None:
    """Product of upper bounds with a number y > 0."""
    x *= y[1]
    _upward(x, result)


def multiply(result: Array, x: Array, y: Array) -> None:
    """Product of upper bounds (-a, b) and (-c, d): the largest of -ac, -ad, -bc, -bd and of ac, ad, bc, bd."""
    try:
        same, crossed = x * y, x * y[::-1]  # (ac, bd) and (-ad, -bc)
    except FloatingPointError:  # 0 * inf: 0 for finite operands, and their other limits are corners
        with np.errstate(invalid="ignore"):
            same, crossed = x * y, x * y[::-1]
        for product in (same, crossed):
            product[np.isnan(product)] = 0.0
    for end, positive, negative in ((0, crossed, same), (1, same, crossed)):
        np.maximum(positive[0], positive[1], out=x[end])
        np.minimum(negative[0], negative[1], out=y[end])
    np.negative(y, out=y)
    np.maximum(x, y, out=x)
    _upward(x, result)


def _corners(function: Operation, margin: Margin) -> Operation:
    """Extension of a function of two variables with its extrema over a box at the corners."""

    def extension(x: Array, y: Array) -> Array:
        try:
            values = function(x[:, None], y[None])
        except FloatingPointError:  # 0 * inf and inf / inf: 0 for finite operands, and their other limits are corners
            with np.errstate(invalid="ignore"):
                values = function(x[:, None], y[None])
            values[np.isnan(values)] = 0.0
        return _outward(_hull(values.reshape(4, -1)), margin)

    return extension


def apply(function: Operation, *operands: Array) -> Array:
    """What a NumPy function gives, whose flag of an invalid operation may be raised without a cause."""
    try:
        result: Array = function(*operands)
    except FloatingPointError:  # on lanes that vectorised code does not use
        with np.errstate(invalid="ignore"):
            result = function(*operands)
    return result


def _increasing(
    function: Operation,
    domain: tuple[float, float] | None = None,
    image: tuple[float, float] | None = None,
    margin: Margin = _ULPS,
) -> Operation:
    """Extension of an increasing function of one variable."""

    def extension(x: Array) -> Array:
        inside = np.minimum(np.maximum(x, domain[0]), domain[1]) if domain else x
        result = _outward(apply(function, inside), margin)
        if image:
            result = np.minimum(np.maximum(result, image[0]), image[1])
        return np.where((x[1] < domain[0]) | (x[0] > domain[1]), _ENTIRE, result) if domain else result

    return extension


def _magnitude(x: Array) -> Array:
    """Range of |x|, exact."""
    result: Array = np.maximum(np.maximum(x, -x[::-1]), 0.0)
    return result


def _even(increasing: Operation) -> Operation:
    return lambda x: increasing(_magnitude(x))


def _quotient(x: Array, y: Array) -> Array:
    pole = (y[0] <= 0.0) & (y[1] >= 0.0)
    return np.where(pole, _ENTIRE, _divide(x, np.where(pole, 1.0, y)))


def _inverse(x: Array) -> Array:
    return np.where((x[0] <= 0.0) & (x[1] >= 0.0), _ENTIRE, _outward(1.0 / x[::-1], _NEXT))


def constant_power(exponent: float) -> Operation:
    """Extension of x^exponent, for an exponent that is not an integer on x >= 0."""
    if not math.isfinite(exponent):
        return lambda x: _ENTIRE
    if exponent < 0.0:
        positive = constant_power(-exponent)
        return lambda x: _inverse(positive(x))
    if exponent % 2.0 == 1.0:
        return _increasing(lambda x: np.power(x, exponent))
    increasing = _increasing(lambda x: np.power(x, exponent), domain=(0.0, np.inf), image=(0.0, np.inf))
    return _even(increasing) if exponent % 2.0 == 0.0 else increasing


def _power(x: Array, y: Array) -> Array:
    """Extension of x^y = exp(y log x)."""
    return np.where(x[0] < 0.0, _ENTIRE, _exp(_multiply(y, _log(x))))


def _turns(x: Array, period: float, first: float) -> Array:
    """The box in periods after ``first``, [rad]; the margin is more than the rounding, that of pi included."""
    return _outward((x - first) / period, (_ULPS[0], _ULPS[0]))


def _holds_integer(turns: Array) -> Any:
    return np.floor(turns[1]) >= np.ceil(turns[0])


def _is_huge(x: Array) -> Any:
    return np.maximum(-x[0], x[1]) > _HUGE_ANGLE


def _wave(function: Operation, peak: float) -> Operation:
    """Extension of sin or cos, whose maximum 1 is at ``peak``, [rad]."""

    def extension(x: Array) -> Array:
        x = np.where(_is_huge(x), _FULL_TURN, x)
        result = np.minimum(np.maximum(_outward(_hull(apply(function, x)), _ULPS), -1.0), 1.0)
        turns = _turns(x, 2.0 * np.pi, peak)
        result[0][_holds_integer(turns - 0.5)] = -1.0
        result[1][_holds_integer(turns)] = 1.0
        return result

    return extension


def _tan(x: Array) -> Array:
    pole = _is_huge(x) | _holds_integer(_turns(x, np.pi, np.pi / 2))
    return np.where(pole, _ENTIRE, _outward(apply(np.tan, np.where(pole, 0.0, x)), _ULPS))


def _angle(y: Array, x: Array) -> Array:
    """Extension of atan2(y, x), [rad]: all of it for a box that touches the half-line y = 0, x <= 0."""
    cut = (y[0] <= 0.0) & (y[1] >= 0.0) & (x[0] <= 0.0)
    result: Array = np.minimum(np.maximum(np.where(cut, _ENTIRE, _atan2(y, x)), -_PI), _PI)
    return result


def _length(x: Array, y: Array) -> Array:
    result: Array = np.maximum(_outward(apply(np.hypot, _magnitude(x), _magnitude(y)), _ULPS), 0.0)
    return result


_multiply, _divide, _atan2 = _corners(np.multiply, _NEXT), _corners(np.divide, _NEXT), _corners(np.arctan2, _ULPS)
_exp, _log = _increasing(np.exp, image=(0.0, np.inf)), _increasing(np.log, domain=(0.0, np.inf))
_acos_of_minus = _increasing(lambda x: np.arccos(-x), domain=(-1.0, 1.0), image=(0.0, _PI))

# Extensions by operation code, beside sums, products and negatives.
INTERVAL: dict[int, Operation] = operation_table(
    ASSIGN=lambda x: x, FABS=_magnitude, FMIN=np.minimum, FMAX=np.maximum,
    DIV=_quotient, INV=_inverse, POW=_power, CONSTPOW=_power, HYPOT=_length,
    SQ=_even(_increasing(np.square, image=(0.0, np.inf), margin=_NEXT)),
    SQRT=_increasing(np.sqrt, domain=(0.0, np.inf), image=(0.0, np.inf), margin=_NEXT),
    EXP=_exp, EXPM1=_increasing(np.expm1, image=(-1.0, np.inf)),
    LOG=_log, LOG1P=_increasing(np.log1p, domain=(-1.0, np.inf)),
    ERF=_increasing(special.erf, image=(-1.0, 1.0), margin=(4.0 * _ULPS[0], _ULPS[1])),  # SciPy's errs by 3 ulp or so
    SIN=_wave(np.sin, np.pi / 2), COS=_wave(np.cos, 0.0), TAN=_tan, ATAN2=_angle,
    ASIN=_increasing(np.arcsin, domain=(-1.0, 1.0), image=(-_HALF_PI, _HALF_PI)),
    ACOS=lambda x: _acos_of_minus(-x[::-1]), ATAN=_increasing(np.arctan, image=(-_HALF_PI, _HALF_PI)),
    SINH=_increasing(np.sinh), COSH=_even(_increasing(np.cosh, image=(1.0, np.inf))),
    TANH=_increasing(np.tanh, image=(-1.0, 1.0)), ASINH=_increasing(np.arcsinh),
    ACOSH=_increasing(np.arccosh, domain=(1.0, np.inf), image=(0.0, np.inf)),
    ATANH=_increasing(np.arctanh, domain=(-1.0, 1.0)),
)  # fmt: skip
