"""A limit on arcs: bounds of its values at their ends and of its second derivatives over them, by the interval tape.

Only where every operation of the limit is proved to be defined; elsewhere the bounds are infinite.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.requirements import ORDERS, PathConstraint, Requirements
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.enclosure import Arcs, Pair

Array = NDArray[np.float64]


def curvature_function(requirements: Requirements, limit: PathConstraint) -> Any:
    """Second time derivative of a limit along any curve, symbolically.

    Returns:
        casadi SX Function (derivatives 0..6 of the joints ``(7 dof,)``, u, p, c, 1/T) -> ``(rows,)`` [unit/s^2].
    """
    dof, function = requirements.dof, requirements.function(limit)
    orders = len(ORDERS) + 2
    x = casadi.SX.sym("x", orders * dof)
    u, rate = casadi.SX.sym("u", function.numel_in(1)), casadi.SX.sym("rate")  # the sweep, if any, stays
    p, c = casadi.SX.sym("p", function.numel_in(2)), casadi.SX.sym("c", function.numel_in(3))
    base = casadi.vertcat(x[: (orders - 1) * dof], u)
    motion = casadi.vertcat(x[dof:], rate, casadi.SX.zeros(u.numel() - 1))
    first = casadi.jtimes(function(x[: len(ORDERS) * dof], u, p, c), base, motion)
    second = casadi.cse(casadi.jtimes(first, base, motion))
    return casadi.Function("curvature", [x, u, p, c, rate], [casadi.densify(second)])


def domain_function(function: Any) -> Any:
    """What has to be positive for every operation of a compiled limit to be defined and smooth.

    Intervals forgive an operation that is undefined on a part of a box, and any at all that is multiplied by zero.

    Returns:
        casadi SX Function of the same arguments -> ``(conditions,)``, often none.
    """
    arguments = [casadi.SX.sym("z", function.sparsity_in(i)) for i in range(function.n_in())]
    nonzeros = [argument.nonzeros() for argument in arguments]
    register: dict[int, Any] = {}
    conditions: list[Any] = []
    for k in range(function.n_instructions()):
        operation, written = function.instruction_id(k), function.instruction_output(k)
        read = function.instruction_input(k)
        if operation == casadi.OP_INPUT:
            register[written[0]] = nonzeros[read[0]][read[1]]
        elif operation == casadi.OP_CONST:
            register[written[0]] = casadi.SX(function.instruction_constant(k))
            if not np.isfinite(function.instruction_constant(k)):
                conditions.append(casadi.SX(-1.0))
        elif operation != casadi.OP_OUTPUT:
            operands = [register[i] for i in read]
            conditions.extend(_conditions(operation, *operands))
            apply = casadi.SX.unary if len(operands) == 1 else casadi.SX.binary
            register[written[0]] = apply(operation, *operands)
    return casadi.Function("domain", arguments, [casadi.densify(casadi.vertcat(casadi.SX(0, 1), *conditions))])


def _conditions(operation: int, x: Any, y: Any = None) -> tuple[Any, ...]:
    """Expressions that are positive where an operation is defined and smooth."""
    if operation in (casadi.OP_SQRT, casadi.OP_LOG):
        return (x,)
    if operation in (casadi.OP_ASIN, casadi.OP_ACOS, casadi.OP_ATANH):
        return (1 - x, 1 + x)
    if operation == casadi.OP_ACOSH:
        return (x - 1,)
    if operation == casadi.OP_LOG1P:
        return (x + 1,)
    if operation == casadi.OP_TAN:
        return (casadi.cos(x) ** 2,)
    if operation in (casadi.OP_DIV, casadi.OP_INV):
        divisor = x if y is None else y
        return () if divisor.is_constant() and float(divisor) != 0.0 else (divisor**2,)
    if operation in (casadi.OP_POW, casadi.OP_CONSTPOW):
        if not y.is_constant() or float(y) % 1.0 != 0.0:
            return (x,)
        return (x**2,) if float(y) < 0.0 else ()
    return ()


class LimitTapes:
    """The interval tapes of one limit, with the parameters of the motions it is enclosed on.

    Values and bounds are of both sides, ``(2, rows, N)``: side 0 is g, side 1 is -g.

    Attributes:
        order: highest derivative the limit depends on, at least 0.
    """

    def __init__(self, motions: Sequence[Motion], requirements: Requirements, limit: PathConstraint) -> None:
        counts = {motion.curve.segments for motion in motions}
        if limit.constants is not None and counts - {len(limit.constants)}:
            raise ProblemDefinitionError(
                f"limit {limit.id!r} has constants for {len(limit.constants)} segments; the trajectories have "
                f"{sorted(counts)}"
            )
        self.requirements, self.limit = requirements, limit
        self.parameters = requirements.parameters_of(motions)
        self.order = max(requirements.order(limit), 0)
        self.value, self.curvature = requirements.compiled(limit, "proof", lambda: _compile(requirements, limit))

    def values(self, arcs: Arcs, which: int, sweep: Array | None = None) -> Pair:
        """Bounds of the values at the start (0) or end (-1) of each arc, and at ``sweep (N,)``."""
        x = self._states(arcs.ends(which), self.order + 1, len(ORDERS))
        arguments = self._arguments(arcs, x, arcs.end_time(which), (sweep, sweep))
        bounds, domain = self.value.enclose(*arguments)
        return both_sides(*_where_defined(bounds, domain, arguments))

    def curvatures(self, arcs: Arcs, sweep: Pair | tuple[None, None] = (None, None)) -> list[Array]:
        """Upper bounds of -g'' over each arc and part ``(N,)`` of a sweep: along time, and along the sweep."""
        x = self._states(arcs.hulls(), self.order + 3, len(ORDERS) + 2)
        with np.errstate(over="ignore"):
            inverse = 1.0 / arcs.duration[None]
        rate = np.nextafter(inverse, -np.inf), np.nextafter(inverse, np.inf)
        arguments = self._arguments(arcs, x, arcs.local_time(), sweep)
        *bends, domain = self.curvature.enclose(*arguments, rate)
        # -g'' of side 0 is at most -(lower end of g''), of side 1 (which is -g) at most its upper end.
        return [np.stack([-low, high]) for low, high in (_where_defined(bend, domain, arguments) for bend in bends)]

    def _states(self, bounds: Pair, known: int, orders: int) -> Pair:
        """Bounds of the first derivatives, with zeros for those of higher order, which the limit does not read."""
        dof = self.requirements.dof
        low, high = (np.zeros((orders * dof, bounds[0].shape[1])) for _ in bounds)
        low[: known * dof], high[: known * dof] = (end[: known * dof] for end in bounds)
        return low, high

    def _arguments(self, arcs: Arcs, x: Pair, u: Pair, sweep: tuple[Array | None, Array | None]) -> list[Pair]:
        p, arguments = self.parameters[:, arcs.owner], self.requirements.arguments
        ends = (arguments(self.limit, x[i], arcs.segment, u[i][0], p, sweep[i]) for i in (0, 1))
        return list(zip(*ends, strict=True))


def _compile(requirements: Requirements, limit: PathConstraint) -> tuple[Tape, Tape]:
    """Tapes of the value, and of its second derivatives along time and any sweep, each with the limit's domain."""
    function, curvature = requirements.function(limit), curvature_function(requirements, limit)
    domain = domain_function(function)
    x, place, p, c, rate = (casadi.SX.sym(name, curvature.sparsity_in(i)) for i, name in enumerate("xupcr"))
    state = (x[: function.numel_in(0)], place, p, c)
    value = Tape(casadi.Function("value", state, [function(*state), domain(*state)]))
    value.require_smooth(f"limit {limit.id!r}")
    bends = [curvature(x, place, p, c, rate)]
    if limit.sweep:
        along = casadi.DM([0.0, 1.0])
        slope = casadi.jtimes(function(*state), place, along)
        bends.append(casadi.densify(casadi.jtimes(slope, place, along)))
    outputs = casadi.cse([*bends, domain(*state)])
    return value, Tape(casadi.Function("curvature", [x, place, p, c, rate], outputs))


def both_sides(lower: Array, upper: Array) -> Pair:
    """Bounds of g and -g, ``(2, rows, N)``, from those of g."""
    return np.stack([lower, -upper]), np.stack([upper, -lower])


def _where_defined(bounds: Pair, conditions: Pair, arguments: Sequence[Pair]) -> Pair:
    """The bounds, infinite where not all conditions are proved to be positive and p and c finite."""
    defined = (conditions[0] > 0.0).all(axis=0)
    for numbers, _ in arguments[2:]:
        defined &= np.isfinite(numbers).all(axis=0)
    return np.where(defined, bounds[0], -np.inf), np.where(defined, bounds[1], np.inf)
