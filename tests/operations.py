"""Every operation of a tape, in CasADi, in NumPy and in ball arithmetic, with boxes and points to try it on."""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi
import flint
import numpy as np
from numpy.typing import NDArray
from scipy import special

from ocp_traj.interval.tape import Tape

Array = NDArray[Any]
SX = casadi.SX
arb = flint.arb

N_BOXES = 100_000  # per operation, against long doubles
N_EXACT = 4_000  # of them, against ball arithmetic
PRECISION = 200  # [bit] of the balls
LARGEST = np.finfo(float).max


class Case(NamedTuple):
    """An operation in CasADi, in NumPy (run with long doubles) and in ball arithmetic."""

    expression: Callable[..., Any]
    wide: Callable[..., Any]
    ball: Callable[..., Any]


def _hypot_ball(x: Any, y: Any) -> Any:
    return (x * x + y * y).sqrt()


CASES = {
    "add": Case(lambda x, y: x + y, np.add, lambda x, y: x + y),
    "sub": Case(lambda x, y: x - y, np.subtract, lambda x, y: x - y),
    "mul": Case(lambda x, y: x * y, np.multiply, lambda x, y: x * y),
    "div": Case(lambda x, y: x / y, np.divide, lambda x, y: x / y),
    "fmin": Case(casadi.fmin, np.minimum, lambda x, y: x.min(y)),
    "fmax": Case(casadi.fmax, np.maximum, lambda x, y: x.max(y)),
    "hypot": Case(casadi.hypot, np.hypot, _hypot_ball),
    "atan2": Case(casadi.atan2, np.arctan2, lambda x, y: arb.atan2(x, y)),
    "pow": Case(lambda x, y: x**y, np.power, lambda x, y: x**y),
    "neg": Case(lambda x: -x, np.negative, lambda x: -x),
    "inv": Case(lambda x: 1 / x, lambda x: 1 / x, lambda x: 1 / x),
    "sq": Case(lambda x: x**2, np.square, lambda x: x * x),
    "twice": Case(lambda x: 2 * x, lambda x: 2 * x, lambda x: 2 * x),
    "times 0.1": Case(lambda x: 0.1 * x, lambda x: 0.1 * x, lambda x: arb(0.1) * x),
    "times -3e300": Case(lambda x: x * -3e300, lambda x: x * -3e300, lambda x: arb(-3e300) * x),
    "plus 0.1": Case(lambda x: 0.1 + x, lambda x: 0.1 + x, lambda x: arb(0.1) + x),
    "over -0.3": Case(lambda x: x / -0.3, lambda x: x / -0.3, lambda x: x / arb(-0.3)),
    "sqrt": Case(casadi.sqrt, np.sqrt, lambda x: x.sqrt()),
    "x x": Case(lambda x: x * x, lambda x: x * x, lambda x: x * x),
    "power 3": Case(lambda x: x**3, lambda x: x**3, lambda x: x**3),
    "power 4": Case(lambda x: x**4, lambda x: x**4, lambda x: x**4),
    "power -3": Case(lambda x: x**-3, lambda x: x**-3, lambda x: 1 / x**3),
    "power -2": Case(lambda x: x**-2, lambda x: x**-2, lambda x: 1 / x**2),
    "power 101": Case(lambda x: x**101, lambda x: x ** np.longdouble(101), lambda x: x**101),
    "power 2.3": Case(lambda x: x**2.3, lambda x: x ** np.longdouble(2.3), lambda x: x ** arb(2.3)),
    "power -0.7": Case(lambda x: x**-0.7, lambda x: x ** np.longdouble(-0.7), lambda x: x ** arb(-0.7)),
    "exp": Case(casadi.exp, np.exp, lambda x: x.exp()),
    "expm1": Case(casadi.expm1, np.expm1, lambda x: x.expm1()),
    "log": Case(casadi.log, np.log, lambda x: x.log()),
    "log1p": Case(casadi.log1p, np.log1p, lambda x: x.log1p()),
    "sin": Case(casadi.sin, np.sin, lambda x: x.sin()),
    "cos": Case(casadi.cos, np.cos, lambda x: x.cos()),
    "tan": Case(casadi.tan, np.tan, lambda x: x.tan()),
    "asin": Case(casadi.asin, np.arcsin, lambda x: x.asin()),
    "acos": Case(casadi.acos, np.arccos, lambda x: x.acos()),
    "atan": Case(casadi.atan, np.arctan, lambda x: x.atan()),
    "sinh": Case(casadi.sinh, np.sinh, lambda x: x.sinh()),
    "cosh": Case(casadi.cosh, np.cosh, lambda x: x.cosh()),
    "tanh": Case(casadi.tanh, np.tanh, lambda x: x.tanh()),
    "asinh": Case(casadi.asinh, np.arcsinh, lambda x: x.asinh()),
    "acosh": Case(casadi.acosh, np.arccosh, lambda x: x.acosh()),
    "atanh": Case(casadi.atanh, np.arctanh, lambda x: x.atanh()),
    "erf": Case(casadi.erf, lambda x: special.erf(x.astype(float)), lambda x: x.erf()),
    "fabs": Case(casadi.fabs, np.abs, abs),
}
VERBATIM = ("x x", "power 3", "power 4", "power -3", "power -2")  # CasADi makes squares and products of them
BINARY = ("add", "sub", "mul", "div", "fmin", "fmax", "hypot", "atan2", "pow")

# Operations that only floats know, as expressions of x and y.
FLOAT_ONLY: dict[str, Callable[[Any, Any], Any]] = {
    "OP_SIGN": lambda x, y: casadi.sign(x),
    "OP_COPYSIGN": casadi.copysign,
    "OP_FLOOR": lambda x, y: casadi.floor(3 * x),
    "OP_CEIL": lambda x, y: casadi.ceil(3 * x),
    "OP_FMOD": casadi.fmod,
    "OP_REMAINDER": casadi.remainder,
    "OP_IF_ELSE_ZERO": lambda x, y: casadi.if_else(x < y, x, y),
    "OP_LT": lambda x, y: x < y,
    "OP_LE": lambda x, y: x <= y,
    "OP_EQ": lambda x, y: casadi.floor(x) == casadi.floor(y),
    "OP_NE": lambda x, y: casadi.floor(x) != casadi.floor(y),
    "OP_NOT": lambda x, y: casadi.logic_not(casadi.floor(x)),
    "OP_AND": lambda x, y: casadi.logic_and(casadi.floor(x), casadi.floor(y)),
    "OP_OR": lambda x, y: casadi.logic_or(casadi.floor(x), casadi.floor(y)),
}


def function_of(expression: Callable[..., Any], n: int, name: str = "f", verbatim: bool = False) -> casadi.Function:
    symbols = [SX.sym("xyz"[k]) for k in range(n)]
    try:
        casadi.GlobalOptions.setSimplificationOnTheFly(not verbatim)
        return casadi.Function(name, symbols, [expression(*symbols)])
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(True)


def case_function(name: str) -> casadi.Function:
    return function_of(CASES[name].expression, 2 if name in BINARY else 1, verbatim=name in VERBATIM)


def mixture(rng: np.random.Generator, rows: list[Any], shares: list[float] | None = None) -> Array:
    """Each column from a row drawn for it."""
    table = np.array(np.broadcast_arrays(*rows))
    mixed: Array = table[rng.choice(len(rows), table.shape[1], p=shares), np.arange(table.shape[1])]
    return mixed


def _random_ends(rng: np.random.Generator, n: int) -> tuple[Array, Array]:
    """Boxes of all sorts: thin and wide, huge and tiny, around zero, at multiples of pi / 2, at +-1, infinite."""
    sign = rng.choice([-1.0, 1.0], n)
    centre = mixture(
        rng,
        [
            rng.normal(size=n),
            rng.normal(size=n),
            sign * 10 ** rng.uniform(-300, 300, n),
            sign * rng.uniform(0, 1e-310, n),
            sign * 10 ** rng.uniform(300, 308.2, n),
            rng.integers(-70_000, 70_000, n) * (np.pi / 2),
            rng.integers(-4, 5, n) * (np.pi / 2),
            sign * (1 + rng.normal(size=n) * 10 ** rng.uniform(-16, -1, n)),
            rng.uniform(-800, 800, n),
            np.zeros(n),
            sign,
        ],
    )
    width = mixture(
        rng,
        [
            np.zeros(n),
            np.spacing(np.abs(centre)) * rng.integers(0, 4, n),
            np.abs(centre) * 10 ** rng.uniform(-15, 0, n),
            np.abs(centre) * 10 ** rng.uniform(-15, 0, n),
            rng.uniform(0, 7, n),
            10 ** rng.uniform(-300, 300, n),
            np.full(n, np.inf),
        ],
        [0.15, 0.15, 0.2, 0.2, 0.2, 0.08, 0.02],
    )
    left = mixture(rng, [0.0, 1.0, rng.uniform(size=n)])
    with np.errstate(all="ignore"):
        lower = centre - np.where(left == 0, 0, width * left)
        upper = centre + np.where(left == 1, 0, width * (1 - left))
    return np.minimum(lower, LARGEST), np.maximum(upper, -LARGEST)


def _points(rng: np.random.Generator, lower: Array, upper: Array) -> Array:
    """Finite points of each box: both ends, and one inside, often near an end or near zero; ``(3, n)``."""
    low, high = np.maximum(lower, -LARGEST), np.minimum(upper, LARGEST)
    share = mixture(rng, [0.5, rng.uniform(size=low.size), 10 ** rng.uniform(-20, 0, low.size)])
    anywhere = low * (1 - share) + high * share
    return np.array([low, high, np.clip(mixture(rng, [rng.normal(size=low.size), anywhere]), low, high)])


def arguments(rng: np.random.Generator, name: str, n: int) -> tuple[list[tuple[Array, Array]], list[Array]]:
    """Boxes for each argument of a case, and points in them paired in every way that matters."""
    boxes = [_random_ends(rng, n) for _ in range(2 if name in BINARY else 1)]
    if name == "pow":
        ends = np.where(rng.uniform(size=n) < 0.8, np.abs(boxes[0]), boxes[0])
        boxes[0] = (ends.min(axis=0), ends.max(axis=0))
    points = [_points(rng, *box) for box in boxes]
    if len(points) == 2:
        points = [points[0][[0, 0, 1, 1, 2]], points[1][[0, 1, 0, 1, 2]]]
    return boxes, points


def enclose(function: casadi.Function, *boxes: tuple[Array, Array]) -> tuple[Array, Array]:
    """Enclosure of a function of scalars with one scalar result."""
    ((lower, upper),) = Tape(function).enclose(*[(np.atleast_2d(low), np.atleast_2d(high)) for low, high in boxes])
    assert not np.isnan(lower).any() and not np.isnan(upper).any()
    assert (lower <= upper).all()
    return lower[0], upper[0]
