"""The tape (instruction list) of a CasADi SX function, run on NumPy arrays: in floats and in intervals.

An SX function is a list of scalar operations on registers.  Run once with ``N`` values in each register, it evaluates
``N`` points in one pass: in floats, for populations and dense scans; in intervals, for proofs.  There a register holds
``N`` boxes, ``(2, N)`` for lower and upper ends, and operations round outward (see ``intervals``), so that the
result contains the exact range of the tape (its constants as rounded) over each box.
"""

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import casadi
import numpy as np
from scipy import special

from ocp_traj.errors import InputError, KinkedExpression, UnsupportedOperation
from ocp_traj.interval.intervals import (
    INTERVAL,
    Array,
    Operation,
    add,
    constant_power,
    multiply,
    on_boxes,
    operation_table,
    scale,
    upper_bounds,
)  # fmt: skip
from ocp_traj.interval.program import Program, Read, Step


class Tape:
    """The instructions of an SX function, decoded once, to run on columns of arguments."""

    def __init__(self, function: casadi.Function) -> None:
        """Decode an SX function without free variables."""
        if not (isinstance(function, casadi.Function) and function.is_a("SXFunction")):
            raise UnsupportedOperation(f"{function} is not an SX function, the only kind with a tape; try its expand()")
        self.name: str = function.name()
        if function.has_free():
            raise InputError(f"{self.name}: the variables {function.get_free()} are free; make them inputs")
        self.n_in: int = function.n_in()
        self.n_out: int = function.n_out()
        self._numel_in = [function.numel_in(k) for k in range(self.n_in)]
        self._numel_out = [function.numel_out(k) for k in range(self.n_out)]
        rows_in = [function.sparsity_in(k).find() for k in range(self.n_in)]  # dense rows of the non-zeros
        # Slots, in this order: non-zeros of the outputs, registers, leaves (a constant or a row of an input).
        self._results = [(k, row) for k in range(self.n_out) for row in function.sparsity_out(k).find()]
        first_result = np.cumsum([0] + [function.nnz_out(k) for k in range(self.n_out)]).tolist()
        self._n_slots: int = len(self._results) + function.sz_w()
        self._leaves: list[float | tuple[int, int]] = []
        self._steps: list[tuple[int, int, int, int]] = []  # operation, slot written, slots read (-1: none)
        leaf_of_row: dict[tuple[int, int], int] = {}
        slot: dict[int, int] = {}  # where the value of a register is
        for index in range(function.n_instructions()):
            operation = function.instruction_id(index)
            read, written = function.instruction_input(index), function.instruction_output(index)
            if operation == casadi.OP_OUTPUT:
                self._steps.append((casadi.OP_ASSIGN, first_result[written[0]] + written[1], slot[read[0]], -1))
            elif operation == casadi.OP_CONST:
                slot[written[0]] = self._n_slots + len(self._leaves)
                self._leaves.append(function.instruction_constant(index))
            elif operation == casadi.OP_INPUT:
                row = (read[0], rows_in[read[0]][read[1]])
                if row not in leaf_of_row:
                    leaf_of_row[row] = len(self._leaves)
                    self._leaves.append(row)
                slot[written[0]] = self._n_slots + leaf_of_row[row]
            elif operation in FLOAT:
                operands = [slot[register] for register in read] + [-1]
                slot[written[0]] = len(self._results) + written[0]
                self._steps.append((operation, slot[written[0]], operands[0], operands[1]))
            else:
                raise self._unsupported(operation, "in floats", FLOAT)
        self._float_program: list[Any] = [(FLOAT[operation], *slots) for operation, *slots in self._steps]

    def evaluate(self, *inputs: Array) -> tuple[Array, ...]:
        """Values at ``N`` points.

        Args:
            inputs: Argument k, dense column-major: ``(numel_in(k), N)``, or ``(numel_in(k),)`` for the same N times.

        Returns:
            Result k, dense column-major, ``(numel_out(k), N)``.
        """
        rows, n_columns = self._columns(inputs)
        leaves = [leaf if isinstance(leaf, float) else rows[leaf[0]][leaf[1]] for leaf in self._leaves]
        results = [np.zeros((numel, n_columns)) for numel in self._numel_out]
        with np.errstate(all="ignore"):
            values: list[Any] = [None] * self._n_slots + leaves
            for operation, written, first, second in self._float_program:
                values[written] = operation(values[first]) if second < 0 else operation(values[first], values[second])
        for (k, row), value in zip(self._results, values, strict=False):
            results[k][row] = value
        return tuple(results)

    def enclose(self, *inputs: tuple[Array, Array]) -> tuple[tuple[Array, Array], ...]:
        """Bounds on the exact range over ``N`` boxes.

        Args:
            inputs: Lower and upper ends of argument k, each as in ``evaluate``.  An end that is NaN is infinite.

        Returns:
            Lower and upper ends of result k, each ``(numel_out(k), N)``; infinite where unbounded, never NaN.
        """
        program = self._interval_program
        columns, n_columns = self._columns([end for pair in inputs for end in pair], ends=2)
        pairs = list(zip(columns[::2], columns[1::2], strict=True))
        for k, (lower, upper) in enumerate(pairs):
            if (lower > upper).any():
                raise InputError(f"{self.name}: input {k} has a lower end above its upper end; swap them")
        results = [np.zeros((2, numel, n_columns)) for numel in self._numel_out]
        with np.errstate(all="ignore", invalid="raise"):  # 0 * inf and inf - inf are rare: each operation catches them
            program.run([upper_bounds(*pair) for pair in pairs], results)
        return tuple((-negated, upper) for negated, upper in results)

    def require_smooth(self, what: str) -> None:
        """Refuse a tape with kinks or jumps: second derivatives miss them, so that a proof by them is unsound."""
        for operation, *_ in self._steps:
            if operation in _KINKED:
                raise KinkedExpression(f"{what} is not smooth: it contains {NAMES[operation]}; {_KINKED[operation]}")

    def _columns(self, inputs: Sequence[Array], ends: int = 1) -> tuple[list[Array], int]:
        """The inputs as ``(numel_in(k), 1 or N)``, ``ends`` of them to an argument, and N."""
        if len(inputs) != ends * self.n_in:
            raise InputError(f"{self.name}: {len(inputs) // ends} inputs given, expected {self.n_in}")
        columns = [np.asarray(value, dtype=np.float64) for value in inputs]
        columns = [value.reshape(-1, 1) if value.ndim < 2 else value for value in columns]
        widths = {value.shape[-1] for value in columns} - {1}
        expected = [numel for numel in self._numel_in for _ in range(ends)]
        if len(widths) > 1 or [value.shape[:-1] for value in columns] != [(numel,) for numel in expected]:
            shapes = [value.shape for value in columns]
            raise InputError(f"{self.name}: inputs have shapes {shapes}, expected (n, N) with n = {expected}, one N")
        return columns, widths.pop() if widths else 1

    @cached_property
    def _interval_program(self) -> Program:
        """Passes in intervals; better ones where an operand is constant or repeated, none for a negative."""
        steps: list[Step] = []
        value = {self._n_slots + j: Read(~j) for j in range(len(self._leaves))}  # in each slot
        for operation, written, *slots in self._steps:
            reads = [value[slot] for slot in slots if slot >= 0]
            if operation in (casadi.OP_ASSIGN, casadi.OP_NEG):
                value[written] = reads[0].negative(operation == casadi.OP_NEG)
            else:
                value[written] = Read(len(steps))
                steps.append(self._interval_step(operation, reads))
        results = [(k, row, value[slot]) for slot, (k, row) in enumerate(self._results)]
        return Program(self._leaves, steps, results)

    def _interval_step(self, operation: int, reads: list[Read]) -> Step:
        first, last = reads[0], reads[-1]
        if operation == casadi.OP_SUB:
            return Step("add", add, (first, last.negative()))
        if operation in (casadi.OP_ADD, casadi.OP_TWICE):
            return Step("add", add, (first, last))
        if operation == casadi.OP_MUL and first == last:
            operation, reads = casadi.OP_SQ, [first]
        elif operation == casadi.OP_MUL:
            for factor, other in ((first, last), (last, first)):
                number = self._constant(factor)
                if number and math.isfinite(number):
                    return Step("scale", scale, (other.negative(number < 0.0), factor.negative(number < 0.0)))
            return Step("multiply", multiply, (first, last))
        elif operation in (casadi.OP_POW, casadi.OP_CONSTPOW):
            exponent = self._constant(last)
            if exponent is not None:
                return Step((operation, exponent), on_boxes(constant_power(exponent)), (first,))
        if operation not in INTERVAL:
            raise self._unsupported(operation, "in intervals", [*INTERVAL, *_ARITHMETIC])
        return Step(operation, on_boxes(INTERVAL[operation]), tuple(reads))

    def _constant(self, read: Read) -> float | None:
        """The number that is read, if it is a constant."""
        leaf = self._leaves[~read.value] if read.value < 0 else None
        return (-leaf if read.negated else leaf) if isinstance(leaf, float) else None

    def _unsupported(self, operation: int, where: str, known: Iterable[int]) -> UnsupportedOperation:
        name = NAMES.get(operation, f"operation {operation}")
        allowed = ", ".join(sorted(NAMES[key] for key in known))
        return UnsupportedOperation(f"{self.name}: {name} is not supported {where}; supported are {allowed}")


NAMES = {getattr(casadi, name): name for name in dir(casadi) if name.startswith("OP_")}
_ARITHMETIC = casadi.OP_ADD, casadi.OP_SUB, casadi.OP_TWICE, casadi.OP_MUL, casadi.OP_NEG
_SPLIT = "split it into several limits, one for each branch or argument (a maximum is several limits)"
_KINKED: dict[int, str] = operation_table(
    FABS="write |x| <= c as the two-sided limit -c <= x <= c, and limit a distance by its square (sqrt(x^2) is |x|)",
    ATAN2="it jumps by 2 pi across the half-line y = 0, x < 0: limit sines and cosines of the angle, or products",
    **dict.fromkeys(("FMIN", "FMAX", "SIGN", "COPYSIGN", "IF_ELSE_ZERO", "FLOOR", "CEIL", "FMOD", "REMAINDER"), _SPLIT),
    **dict.fromkeys(("LT", "LE", "EQ", "NE", "AND", "OR", "NOT"), _SPLIT),
)

# --- Floats -----------------------------------------------------------------------------------------------------------


def _remainder(x: Array, y: Array) -> Array:
    """C's ``remainder``: x - n y, n the integer nearest to x / y, the even one of two."""
    modulus, rest = np.abs(y), np.fmod(np.abs(x), 2.0 * np.abs(y))
    below = np.where(2.0 * rest >= 3.0 * modulus, rest - 2.0 * modulus, rest - modulus)
    return np.where(2.0 * rest > modulus, below, rest) * np.copysign(1.0, x)


def _logical(function: Operation) -> Operation:
    return lambda *operands: function(*operands) * 1.0


FLOAT: dict[int, Operation] = operation_table(
    ASSIGN=lambda x: x, ADD=np.add, SUB=np.subtract, MUL=np.multiply, DIV=np.divide, NEG=np.negative, INV=np.reciprocal,
    SQ=np.square, TWICE=lambda x: x + x, SQRT=np.sqrt, POW=np.power, CONSTPOW=np.power, HYPOT=np.hypot,
    EXP=np.exp, EXPM1=np.expm1, LOG=np.log, LOG1P=np.log1p, ERF=special.erf,
    SIN=np.sin, COS=np.cos, TAN=np.tan, ASIN=np.arcsin, ACOS=np.arccos, ATAN=np.arctan, ATAN2=np.arctan2,
    SINH=np.sinh, COSH=np.cosh, TANH=np.tanh, ASINH=np.arcsinh, ACOSH=np.arccosh, ATANH=np.arctanh,
    FABS=np.fabs, SIGN=np.sign, COPYSIGN=np.copysign, FLOOR=np.floor, CEIL=np.ceil, FMOD=np.fmod, REMAINDER=_remainder,
    FMIN=np.fmin, FMAX=np.fmax, IF_ELSE_ZERO=lambda x, y: np.where(np.not_equal(x, 0.0), y, 0.0),
    LT=_logical(np.less), LE=_logical(np.less_equal), EQ=_logical(np.equal), NE=_logical(np.not_equal),
    NOT=_logical(np.logical_not), AND=_logical(np.logical_and), OR=_logical(np.logical_or),
)  # fmt: skip
