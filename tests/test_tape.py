"""The tape in floats equals CasADi's call; in intervals it contains the values of its function."""

from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
import pytest
from numpy.typing import NDArray

from ocp_traj.errors import InputError, KinkedExpression, UnsupportedOperation
from ocp_traj.interval import program
from ocp_traj.interval.tape import FLOAT, NAMES, Tape
from tests.operations import BINARY, CASES, FLOAT_ONLY, case_function, function_of, mixture

Array = NDArray[Any]
SX = casadi.SX


# --- Floats -----------------------------------------------------------------------------------------------------------


def _every_operation(x: Any, y: Any) -> Any:
    """Every operation of a tape once or more, its arguments inside the domain for 0.1 < x, y < 0.9."""
    inside = {"acosh": lambda z: 1 + z, "pow": lambda z: 2 * z}
    rows = [
        CASES[name].expression(*[inside.get(name, lambda z: z)(z) for z in ((x, y) if name in BINARY else (x * y,))])
        for name in CASES
        if name not in ("times -3e300", "power 101")
    ]
    rows += [expression(4 * x - 2, 5 * y - 2) for expression in FLOAT_ONLY.values()]
    return casadi.vertcat(*rows, 2**x)


def test_floats_equal_casadi_on_every_operation() -> None:
    rng = np.random.default_rng(0)
    x, y = SX.sym("x"), SX.sym("y")
    function = casadi.Function("zoo", [x, y], [_every_operation(x, y), x + y])
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert {NAMES[operation] for operation in set(FLOAT) - used} == {"OP_ASSIGN"}, "an operation goes untested"
    points = rng.uniform(0.1, 0.9, (2, 300))
    rows, total = Tape(function).evaluate(points[:1], points[1:])
    expected = function.map(300)(points[:1], points[1:])
    np.testing.assert_allclose(rows, expected[0].full(), rtol=1e-13, atol=0.0)
    np.testing.assert_allclose(total, expected[1].full(), rtol=1e-15)


def test_floats_equal_casadi_on_special_values() -> None:
    values = np.array([0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.5, -7.5, 3.0, 5.0, np.inf, -np.inf])
    points = np.array([(x, y) for x in values for y in values]).T
    for name, expression in {**FLOAT_ONLY, **{name: CASES[name].expression for name in BINARY}}.items():
        function = function_of(expression, 2)
        (result,) = Tape(function).evaluate(points[:1], points[1:])
        expected = function.map(points.shape[1])(points[:1], points[1:]).full()
        np.testing.assert_allclose(result, expected, rtol=1e-15, atol=0.0, err_msg=name)


def _random_expression(rng: np.random.Generator, leaves: list[Any], operations: int) -> Any:
    """A random smooth expression of bounded values and slopes, with shared subexpressions."""
    pool = list(leaves)
    unary = [casadi.sin, casadi.cos, casadi.tanh, casadi.atan, lambda z: 1 / (2 + z * z), lambda z: casadi.exp(-z * z)]
    binary = [lambda a, b: a * b / 2, lambda a, b: 0.7 * a - b, lambda a, b: a + 0.3 * b, casadi.hypot]
    for _ in range(operations):
        a, b = (pool[rng.integers(max(0, len(pool) - 12), len(pool))] for _ in range(2))
        inner = binary[rng.integers(len(binary))](a, b)
        pool.append(unary[rng.integers(len(unary))](inner) if rng.uniform() < 0.7 else inner)
    return pool


@pytest.mark.slow
def test_floats_equal_casadi_on_random_functions_sparse_and_dense() -> None:
    rng = np.random.default_rng(1)
    for trial in range(40):
        x = SX.sym("x", casadi.Sparsity.lower(3)) if trial % 2 else SX.sym("x", 3, 2)
        y = SX.sym("y", casadi.Sparsity.banded(4, 1)) if trial % 3 else SX.sym("y", 2)
        pool = _random_expression(rng, [*casadi.vertsplit(x.nz[:]), *casadi.vertsplit(y.nz[:])], 60)
        matrix = SX(casadi.Sparsity.upper(4))
        matrix.nz[:] = casadi.vertcat(*pool[-10:])
        outputs = [matrix, casadi.vertcat(*pool[-5:]), SX(2, 2), casadi.vertcat(SX(1.5), pool[-1], x.nz[0])]
        function = casadi.Function("f", [x, y], outputs)
        inputs = [rng.normal(size=(function.numel_in(k), 7)) for k in range(2)]
        results = Tape(function).evaluate(*inputs)
        boxes = Tape(function).enclose(*[(values, values) for values in inputs])
        for column in range(7):
            arguments = [inputs[k][:, column].reshape(function.size_in(k), order="F") for k in range(2)]
            for result, (lower, upper), expected in zip(results, boxes, function.call(arguments), strict=True):
                dense = casadi.DM(expected).full().ravel(order="F")
                np.testing.assert_allclose(result[:, column], dense, rtol=1e-13, atol=1e-14)
                assert (lower[:, column] <= result[:, column]).all() and (result[:, column] <= upper[:, column]).all()
                np.testing.assert_allclose(upper[:, column] - lower[:, column], 0.0, atol=1e-9)


def test_input_without_columns_is_the_same_for_all() -> None:
    x, y, p = SX.sym("x", 2), SX.sym("y"), SX.sym("p", 0)
    tape = Tape(casadi.Function("f", [x, y, p], [x * y + casadi.exp(y), 3 * y, casadi.SX(0, 1)]))
    many = np.linspace(-1, 1, 5)
    result = tape.evaluate(np.array([1.0, 2.0]), many[None], np.zeros(0))
    np.testing.assert_allclose(result[0], np.outer([1, 2], many) + np.exp(many), rtol=1e-15)
    assert [value.shape for value in result] == [(2, 5), (1, 5), (0, 5)]
    result = tape.evaluate(np.array([1.0, 2.0]), np.array([[3.0]]), np.zeros(0))
    assert [value.shape for value in result] == [(2, 1), (1, 1), (0, 1)]
    boxes = tape.enclose((np.array([1.0, 2.0]), np.full((2, 5), 2.0)), (many[None], many[None]), (np.zeros(0),) * 2)
    assert [end.shape for pair in boxes for end in pair] == [(2, 5)] * 2 + [(1, 5)] * 2 + [(0, 5)] * 2
    np.testing.assert_allclose(boxes[0][0][1], 2 * many + np.exp(many), rtol=1e-14)
    none = tape.evaluate(np.zeros((2, 0)), np.zeros((1, 0)), np.zeros((0, 0)))
    assert [value.shape for value in none] == [(2, 0), (1, 0), (0, 0)]


def test_results_and_inputs_are_not_shared() -> None:
    x = SX.sym("x")
    tape = Tape(casadi.Function("f", [x], [x, x]))
    values = np.ones((1, 3))
    first, second = tape.evaluate(values)
    first += 1.0
    assert (values == 1.0).all() and (second == 1.0).all()


def test_enclosure_of_random_functions_contains_their_values() -> None:
    rng = np.random.default_rng(5)
    for _ in range(30):
        x = SX.sym("x", 4)
        function = casadi.Function("f", [x], [casadi.vertcat(*_random_expression(rng, casadi.vertsplit(x), 40)[-8:])])
        tape = Tape(function)
        centre, width = rng.normal(size=(4, 500)), 10 ** rng.uniform(-12, 0.5, (4, 500))
        ((lower, upper),) = tape.enclose((centre - width, centre + width))
        assert (lower <= upper).all() and np.isfinite(upper - lower).all()
        for _ in range(10):
            corner = mixture(rng, [-1.0, 1.0, rng.uniform(-1, 1, 2000)]).reshape(4, 500)
            point = np.clip(centre + corner * width, centre - width, centre + width)
            (values,) = tape.evaluate(point)
            assert (lower <= values).all() and (values <= upper).all()


def test_columns_do_not_meddle() -> None:
    """A column with infinite ends, which sends its operations the exceptional way, leaves the other columns alone."""
    x, y = SX.sym("x"), SX.sym("y")
    tape = Tape(casadi.Function("f", [x, y], [casadi.exp(x * y) / y + casadi.sin(x) * y]))
    low, high = np.array([[0.5, -np.inf, 0.0, 1e200]]), np.array([[0.6, np.inf, 0.0, np.inf]])
    other = (np.array([[2.0, 0.0, -np.inf, 1e200]]), np.array([[2.5, 0.0, np.inf, 1e300]]))
    ((lower, upper),) = tape.enclose((low, high), other)
    ((lower_alone, upper_alone),) = tape.enclose((low[:, :1], high[:, :1]), (other[0][:, :1], other[1][:, :1]))
    assert lower[0, 0] == lower_alone[0, 0] and upper[0, 0] == upper_alone[0, 0]
    assert not np.isnan(lower).any() and not np.isnan(upper).any()


def test_enclosure_does_not_depend_on_how_many_columns_go_together(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, x = np.random.default_rng(6), SX.sym("x", 4)
    function = casadi.Function("f", [x], [casadi.vertcat(*_random_expression(rng, casadi.vertsplit(x), 80)[-8:])])
    tape, centre = Tape(function), rng.normal(size=(4, 50))
    ((lower, upper),) = tape.enclose((centre - 0.1, centre + 0.1))
    monkeypatch.setattr(program, "_ENTRIES", 2000)  # of a few columns
    ((low, high),) = tape.enclose((centre - 0.1, centre + 0.1))
    assert (low == lower).all() and (high == upper).all()


def test_negatives_of_intervals_are_read_the_other_way_round() -> None:
    x, y = SX.sym("x"), SX.sym("y")
    outputs = [-x, -(x - y), (-x) * (-x), (-x) * y, -2.0 * (-x), casadi.sin(-x), -y - x]
    boxes = (np.array([1.0]), np.array([2.0])), (np.array([3.0]), np.array([5.0]))
    ((lower, upper),) = Tape(casadi.Function("f", [x, y], [casadi.vertcat(*outputs)])).enclose(*boxes)
    exact = np.array([(-2, -1), (1, 4), (1, 4), (-10, -3), (2, 4), (-1, -np.sin(1.0)), (-7, -4)])
    np.testing.assert_allclose(np.hstack([lower, upper]), exact, rtol=1e-14)
    assert (lower[:, 0] <= exact[:, 0]).all() and (exact[:, 1] <= upper[:, 0]).all()


def test_steps_alike_that_do_not_wait_for_each_other_are_one_pass() -> None:
    kinds, reads = "amamam", [(-1, -2), (-1, -1), (-1, -1), (0, 2), (1, 3), (2, -1)]
    steps = [
        program.Step(kind, lambda *_: None, tuple(map(program.Read, values)))
        for kind, values in zip(kinds, reads, strict=True)
    ]
    groups = program.groups_of(steps)
    place = {i: k for k, group in enumerate(groups) for i in group}
    assert sorted(place) == list(range(6)) and len(groups) == 3
    assert all(len({kinds[i] for i in group}) == 1 for group in groups)
    assert all(place[value] < place[i] for i, values in enumerate(reads) for value in values if value >= 0)


# --- Refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FLOAT_ONLY)
def test_operation_without_an_extension_is_refused_by_name(name: str) -> None:
    tape = Tape(function_of(FLOAT_ONLY[name], 2, "limit_7"))
    box = (np.zeros(1), np.ones(1))
    allowed = {"OP_IF_ELSE_ZERO": "OP_LT", "OP_EQ": "OP_FLOOR", "OP_NE": "OP_FLOOR", "OP_NOT": "OP_FLOOR"}
    allowed |= {"OP_AND": "OP_FLOOR", "OP_OR": "OP_FLOOR"}
    with pytest.raises(UnsupportedOperation, match=f"limit_7: {allowed.get(name, name)} is not supported in intervals"):
        tape.enclose(box, box)


def test_operation_unknown_to_floats_is_refused_by_name() -> None:
    with pytest.raises(UnsupportedOperation, match="f: OP_PRINTME is not supported in floats"):
        Tape(function_of(lambda x, y: x.printme(y), 2))


@pytest.mark.parametrize("name", FLOAT_ONLY)
def test_branch_is_refused_as_a_limit(name: str) -> None:
    with pytest.raises(KinkedExpression, match="joint speed is not smooth: it contains OP_.*several limits"):
        Tape(function_of(FLOAT_ONLY[name], 2)).require_smooth("joint speed")


@pytest.mark.parametrize(
    ("expression", "message"),
    [
        (lambda x, y: casadi.fabs(x), "OP_FABS.*two-sided"),
        (lambda x, y: casadi.sqrt(x**2), "OP_FABS.*square"),
        (lambda x, y: casadi.norm_1(casadi.vertcat(x, y)), "OP_FABS"),
        (lambda x, y: casadi.fmin(x, y), "OP_FMIN.*several limits"),
        (lambda x, y: casadi.mmax(casadi.vertcat(x, y)), "OP_FMAX.*several limits"),
        (lambda x, y: casadi.atan2(x, y), "OP_ATAN2.*jumps"),
        (lambda x, y: casadi.logsumexp(casadi.vertcat(x, y)), "OP_FMAX"),
        (lambda x, y: casadi.sin(x) + casadi.heaviside(y), "OP_SIGN"),
    ],
)
def test_kink_is_refused_as_a_limit(expression: Callable[..., Any], message: str) -> None:
    with pytest.raises(KinkedExpression, match="clearance 3 .*" + message):
        Tape(function_of(expression, 2)).require_smooth("clearance 3")


def test_smooth_expression_passes() -> None:
    smooth = [name for name in CASES if name not in ("fabs", "fmin", "fmax", "atan2")]
    for name in smooth:
        Tape(case_function(name)).require_smooth(name)


def test_mx_function_is_refused() -> None:
    x = casadi.MX.sym("x")
    with pytest.raises(UnsupportedOperation, match="not an SX function.*expand"):
        Tape(casadi.Function("f", [x], [casadi.sin(x)]))
    with pytest.raises(UnsupportedOperation, match="not an SX function"):
        Tape(SX.sym("x"))  # type: ignore[arg-type]


def test_free_variables_are_refused() -> None:
    x, y = SX.sym("x"), SX.sym("y")
    with pytest.raises(InputError, match=r"g: the variables \['y'\] are free"):
        Tape(casadi.Function("g", [x], [x + y], {"allow_free": True}))


def test_wrong_inputs_are_refused() -> None:
    x, y = SX.sym("x", 2), SX.sym("y")
    tape = Tape(casadi.Function("f", [x, y], [x * y]))
    with pytest.raises(InputError, match="1 inputs given, expected 2"):
        tape.evaluate(np.zeros(2))
    with pytest.raises(InputError, match=r"shapes \[\(3, 1\), \(1, 1\)\], expected"):
        tape.evaluate(np.zeros(3), np.zeros(1))
    with pytest.raises(InputError, match="one N"):
        tape.evaluate(np.zeros((2, 4)), np.zeros((1, 3)))
    with pytest.raises(InputError, match="one N"):
        tape.enclose((np.zeros((2, 4)), np.zeros((2, 3))), (np.zeros(1), np.zeros(1)))
    with pytest.raises(InputError, match="input 1 has a lower end above"):
        tape.enclose((np.zeros(2), np.zeros(2)), (np.ones(1), np.zeros(1)))
