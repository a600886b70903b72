"""Degrees of homogeneity, derived from a tape: how its results grow where its inputs grow by powers of one factor.

A function is homogeneous of degree d where f(s^d_1 x_1, .., s^d_n x_n) = s^d f(x) for every s > 0. The degree follows
from the operations alone, as units do: factors add theirs, summands must agree, a sine takes none. Where they do not
agree nothing is said of the result, though it may be homogeneous all the same (terms that cancel).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import casadi

from ocp_traj.errors import UnsupportedOperation

ZERO = "zero"
"""The degree of a result that is zero whatever the inputs are: any."""
Degree = Fraction | str | None
"""Of one result: a number, ``ZERO``, or None where it is not known to be homogeneous."""

_ALIKE = {casadi.OP_ASSIGN, casadi.OP_NEG, casadi.OP_TWICE, casadi.OP_FABS}
_SUMS = {casadi.OP_ADD, casadi.OP_SUB, casadi.OP_FMIN, casadi.OP_FMAX, casadi.OP_HYPOT}
_RATIOS = {casadi.OP_ATAN2, casadi.OP_LT, casadi.OP_LE, casadi.OP_EQ, casadi.OP_NE}  # of two alike: a number


def degrees(function: casadi.Function, inputs: Sequence[Sequence[int]]) -> tuple[tuple[Degree, ...], ...]:
    """Degrees of an SX function's results.

    Args:
        function: without free variables.
        inputs: degree of each entry of each argument, dense column-major.

    Returns:
        The degree of each entry of each result, dense column-major.
    """
    if not (isinstance(function, casadi.Function) and function.is_a("SXFunction")):
        raise UnsupportedOperation(f"{function} is not an SX function, the only kind with a tape; try its expand()")
    rows_in = [function.sparsity_in(k).find() for k in range(function.n_in())]
    rows_out = [function.sparsity_out(k).find() for k in range(function.n_out())]
    results: list[list[Degree]] = [[ZERO] * function.numel_out(k) for k in range(function.n_out())]
    known: dict[int, Degree] = {}
    number: dict[int, float] = {}  # value of a register that holds a constant
    for index in range(function.n_instructions()):
        operation = function.instruction_id(index)
        read, written = function.instruction_input(index), function.instruction_output(index)
        if operation == casadi.OP_OUTPUT:
            results[written[0]][rows_out[written[0]][written[1]]] = known[read[0]]
            continue
        number_of_second = number.get(read[1]) if len(read) == 2 and operation != casadi.OP_INPUT else None
        number.pop(written[0], None)
        if operation == casadi.OP_INPUT:
            known[written[0]] = Fraction(inputs[read[0]][rows_in[read[0]][read[1]]])
        elif operation == casadi.OP_CONST:
            value = function.instruction_constant(index)
            known[written[0]] = ZERO if value == 0.0 else Fraction(0) if math.isfinite(value) else None
            number[written[0]] = value
        else:
            known[written[0]] = _of(operation, [known[register] for register in read], number_of_second)
    return tuple(tuple(result) for result in results)


def _of(operation: int, operands: list[Degree], exponent: float | None) -> Degree:
    """The degree of an operation's result; ``exponent`` is the second operand's value, where that is a constant."""
    first, last = operands[0], operands[-1]
    if first is None or last is None:  # there are two at most
        return None
    if operation in _ALIKE:
        return first
    if operation in _SUMS:
        return _common(operands)
    if operation in _RATIOS:
        return None if _common(operands) is None else Fraction(0)
    if operation in (casadi.OP_MUL, casadi.OP_DIV, casadi.OP_INV):
        return _product(operation, first, last)
    if operation == casadi.OP_SQ:
        return first if isinstance(first, str) else 2 * first
    if operation == casadi.OP_SQRT:
        return first if isinstance(first, str) else first / 2
    if operation == casadi.OP_IF_ELSE_ZERO:
        return last if first in (ZERO, 0) else None
    if operation in (casadi.OP_POW, casadi.OP_CONSTPOW) and exponent is not None and math.isfinite(exponent):
        return None if isinstance(first, str) else first * Fraction(exponent)
    return Fraction(0) if all(operand in (ZERO, 0) for operand in operands) else None


def _common(operands: list[Degree]) -> Degree:
    """The degree that all have, those of zeros aside."""
    left = {operand for operand in operands if operand != ZERO}
    return ZERO if not left else left.pop() if len(left) == 1 else None


def _product(operation: int, first: Degree, last: Degree) -> Degree:
    """Of a product, a quotient or an inverse."""
    if operation == casadi.OP_INV:
        return -first if isinstance(first, Fraction) else None
    if operation == casadi.OP_DIV and last == ZERO:
        return None
    if ZERO in (first, last):
        return ZERO
    assert isinstance(first, Fraction) and isinstance(last, Fraction)
    return first - last if operation == casadi.OP_DIV else first + last
