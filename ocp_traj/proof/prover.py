"""Encloses one limit over whole trajectories: arcs are bounded, and cut where their bound peaks, until all is decided.

Limits on a derivative of the joints are bounded by hulls of control points, which are exact enclosures; every other
limit by the parabola test of ``enclosure`` over boxes of states, with the second derivative enclosed by the
interval tape, and only where every operation of the limit is proved to be defined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.requirements import ORDERS, PathConstraint, Requirements
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.enclosure import Arcs, Pair, parabola_bound, peak_fraction
from ocp_traj.proof.verdicts import SEVERITY, AuditRow, decide

Array = NDArray[np.float64]

RESOLUTION = 1e-12  # of a bound's size or the value: bounds this close to the largest value's own are not refined
UNDERFLOW = 1e-300  # of any unit: far above what is left of rounding a zero outward, far below any quantity
MAX_SPLITS = 48  # of a segment, one after the other: our choice; an arc halved so often is shorter than rounding tells
FIRST = 64  # arcs of the first pass, at least: a pass of the tape takes hardly longer for as many as for one
FEW = 1024  # arcs whose halves are halved at once, for the same reason
BATCH = 4096  # arcs enclosed in one pass: wide enough to amortise a step of the tape, and a bound on memory


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


class Prover:
    """Encloses one limit over all segments of all trajectories.

    Values and bounds are kept for both sides, as "value <= bound": side 0 is g <= upper, side 1 is -g <= -lower.
    """

    def __init__(
        self, trajectories: Sequence[Motion], requirements: Requirements, limit: PathConstraint,
        allowance: float, tightness: float, max_arcs: int,
    ) -> None:  # fmt: skip
        self.limit, self.trajectories, self.max_arcs = limit, trajectories, max_arcs
        self.tightness = tightness
        count, rows = len(trajectories), len(limit.labels)
        self.bound, self.scale = np.stack([limit.upper, -limit.lower]), limit.scale
        self.allowance = allowance_of(self.bound, allowance)
        self.size = np.where(np.isfinite(self.bound) & (self.bound != 0.0), np.abs(self.bound), self.scale)
        self.attained = np.full((2, rows, count), -np.inf)  # lower bound of the largest value
        self.place = np.zeros((2, 2, rows, count))  # segment and local time of that value
        self.floor = np.full((2, rows, count), -np.inf)  # no bound can be below: the largest value's own upper bound
        self.proved = np.full((2, rows, count), -np.inf)  # upper bound over all arcs that are closed
        self.boxes = np.zeros(count, dtype=int)
        self.parameters = np.array([[t.parameters[name] for name in requirements.parameters] for t in trajectories]).T
        self.parameters = self.parameters.reshape(len(requirements.parameters), count)
        if limit.constants is not None and any(len(limit.constants) != t.curve.segments for t in trajectories):
            raise ProblemDefinitionError(
                f"limit {limit.id!r} has constants for {len(limit.constants)} segments; the trajectories have "
                f"{sorted({t.curve.segments for t in trajectories})}"
            )
        order = limit.order
        if order is None:
            compiled = requirements.compiled(limit, "proof", lambda: self._compile(requirements, limit))
            self.order, self.value, self.curvature = compiled
        else:
            requirements.compiled(limit, "order", lambda: _require_derivative(requirements, limit, order))

    @staticmethod
    def _compile(requirements: Requirements, limit: PathConstraint) -> tuple[int, Tape, Tape]:
        """The highest derivative the limit depends on; tapes of its value and its curvature, each with its domain."""
        function, curvature = requirements.function(limit), curvature_function(requirements, limit)
        domain = domain_function(function)
        x, u, p, c, rate = (casadi.SX.sym(name, curvature.sparsity_in(i)) for i, name in enumerate("xupcr"))
        state = (x[: function.numel_in(0)], u, p, c)
        value = Tape(casadi.Function("value", state, [function(*state), domain(*state)]))
        value.require_smooth(f"limit {limit.id!r}")
        both = casadi.cse([curvature(x, u, p, c, rate), domain(*state)])
        return max(requirements.order(limit), 0), value, Tape(casadi.Function("curvature", [x, u, p, c, rate], both))

    def run(self) -> list[list[AuditRow]]:
        """One row a row of the limit, for each trajectory."""
        self._prove(self._arcs())
        return [self._rows(index) for index in range(len(self.trajectories))]

    def _arcs(self) -> Arcs:
        """All segments of all trajectories."""
        orders = self.limit.order if self.limit.order is not None else self.order + 2
        parts = []
        for degree in sorted({n for t in self.trajectories for n in t.curve.degrees}):
            members = [
                (i, k, t.curve.control_points[k], t.curve.durations[k])
                for i, t in enumerate(self.trajectories)
                for k, n in enumerate(t.curve.degrees)
                if n == degree and self.limit.holds_on(k)
            ]
            if not members:
                continue
            owner, segment, points, duration = map(np.array, zip(*members, strict=True))
            parts.append(Arcs.of_segments(owner, segment, points, duration, orders))
        arcs = Arcs.join(parts)
        arcs = arcs.take(np.lexsort((arcs.segment, arcs.owner)))  # every array of arcs is in the order of its owners
        while self.limit.order is None and len(arcs) < FIRST:
            left, right = arcs.split(np.full(len(arcs), 0.5))
            arcs = left.interleave(right)
        return arcs

    def _prove(self, arcs: Arcs) -> None:
        start, end = self._values(arcs, 0), self._values(arcs, -1)
        self._attain(arcs, 0, start)
        self._attain(arcs, -1, end)
        pending = [_Batch(arcs, start, end, np.full_like(start[1], np.inf))]
        while pending:
            batch = pending.pop()
            if len(batch.arcs) > BATCH:
                pending += [batch.take(slice(BATCH, None)), batch.take(slice(None, BATCH))]
                continue
            owner = batch.arcs.owner
            bound, cut = self._enclose(batch)
            still_open = self._open(batch, bound)
            self.boxes += np.bincount(owner, minlength=len(self.boxes))
            keep = still_open.any(axis=(0, 1)) & (self.boxes[owner] < self.max_arcs) & (batch.arcs.splits < MAX_SPLITS)
            self._close(owner[~keep], bound[..., ~keep])
            if not keep.any():
                continue
            rest = batch.take(keep)
            rest.bound = bound[..., keep]
            rest = self._split(rest, self._where(bound, cut, still_open)[keep])
            pending.append(self._split(rest, 0.5) if len(rest.arcs) <= FEW else rest)

    def _split(self, batch: _Batch, at: Array | float) -> _Batch:
        left, right = batch.arcs.split(np.broadcast_to(at, len(batch.arcs)))
        middle = self._values(left, -1)
        self._attain(left, -1, middle)
        start, end = _alternate(batch.start, middle), _alternate(middle, batch.end)
        return _Batch(left.interleave(right), start, end, np.repeat(batch.bound, 2, axis=-1))

    def _open(self, batch: _Batch, bound: Array) -> NDArray[np.bool_]:
        """Which sides, rows and arcs need refining, and can gain by it: not decided, or not tight."""
        scale, owner = self.scale[:, None], batch.arcs.owner
        allowed = (self.bound + self.allowance)[:, :, None]
        attained, floor = self.attained[..., owner], self.floor[..., owner]
        ends = np.maximum(batch.start[1], batch.end[1])
        with np.errstate(over="ignore"):
            above = floor + RESOLUTION * np.maximum(self.size[:, :, None], np.abs(floor))
            tight = np.maximum(attained + self.tightness * scale, above)
            # Hopeless: a value found so far cannot be told from one beyond the limit; nor can this arc's own ends.
            least = np.maximum(ends + 1e-15 * np.abs(ends) + 1e-300, np.where(floor > allowed, above, -np.inf))
        undecided = ~(bound <= np.maximum(allowed, least)) & ~(attained > allowed)
        loose = ~(bound <= tight)
        return np.asarray((undecided | loose) & np.isfinite(self.bound)[:, :, None])

    @staticmethod
    def _where(bound: Array, cut: Array, still_open: NDArray[np.bool_]) -> Array:
        """Where to cut each arc: at the parabola's peak of the open row that reaches highest above the rest."""
        reach = np.where(still_open, bound, -np.inf).reshape(-1, bound.shape[-1])
        choice = np.argmax(reach, axis=0)
        return np.asarray(cut.reshape(reach.shape)[choice, np.arange(reach.shape[1])])

    def _close(self, owner: NDArray[np.intp], bound: Array) -> None:
        if len(owner):
            owners, first = np.unique(owner, return_index=True)
            self.proved[..., owners] = np.maximum(self.proved[..., owners], np.maximum.reduceat(bound, first, axis=-1))

    def _attain(self, arcs: Arcs, which: int, values: Pair) -> None:
        """Takes note of the values at one end of the arcs: the largest of each trajectory, and where."""
        low, high = values
        owners, first, inverse = np.unique(arcs.owner, return_index=True, return_inverse=True)
        self.floor[..., owners] = np.maximum(self.floor[..., owners], np.maximum.reduceat(high, first, axis=-1))
        largest = np.maximum.reduceat(low, first, axis=-1)
        index = np.where(low == largest[..., inverse], np.arange(len(arcs)), -1)
        index = np.maximum.reduceat(index, first, axis=-1)
        better = largest > self.attained[..., owners]
        side, row, owner = np.nonzero(better)
        chosen, at = index[better], (side, row, owners[owner])
        self.attained[at] = largest[better]
        self.place[0][at], self.place[1][at] = arcs.segment[chosen], (arcs.a if which == 0 else arcs.b)[chosen]

    def _enclose(self, batch: _Batch) -> tuple[Array, Array]:
        """Bounds of both sides over each arc, and where to cut it."""
        if self.limit.order is not None:
            bound = _sides(*batch.arcs.hull(self.limit.order))[1]
            return np.minimum(np.where(np.isnan(bound), np.inf, bound), batch.bound), np.full(bound.shape, 0.5)
        ends = batch.start[1], batch.end[1], self._curvature(batch.arcs), batch.arcs.width()
        return np.minimum(parabola_bound(*ends), batch.bound), peak_fraction(*ends)

    def _values(self, arcs: Arcs, which: int) -> Pair:
        """Bounds of both sides' values at one end of each arc."""
        if self.limit.order is not None:
            return _sides(*arcs.end(self.limit.order, which))
        x = self._stack([arcs.end(order, which) for order in range(self.order + 1)], len(ORDERS))
        p, c = self._shared(arcs)
        return _sides(*_where_defined(*self.value.enclose(x, arcs.end_time(which), p, c), p, c))

    def _curvature(self, arcs: Arcs) -> Array:
        """Upper bounds of minus the second derivative of both sides' values over each arc."""
        x = self._stack([arcs.hull(order) for order in range(self.order + 3)], len(ORDERS) + 2)
        with np.errstate(over="ignore"):
            inverse = 1.0 / arcs.duration[None]
            rate = np.nextafter(inverse, -np.inf), np.nextafter(inverse, np.inf)
        p, c = self._shared(arcs)
        low, high = _where_defined(*self.curvature.enclose(x, arcs.local_time(), p, c, rate), p, c)
        return np.stack([-low, high])

    @staticmethod
    def _stack(derivatives: list[Pair], orders: int) -> Pair:
        """The derivatives below each other, with zeros for those of higher order, which the limit does not read."""
        rest = np.zeros(((orders - len(derivatives)) * len(derivatives[0][0]), derivatives[0][0].shape[1]))
        return np.concatenate([low for low, _ in derivatives] + [rest]), np.concatenate(
            [high for _, high in derivatives] + [rest]
        )

    def _shared(self, arcs: Arcs) -> tuple[Pair, Pair]:
        p = self.parameters[:, arcs.owner]
        constants = self.limit.constants
        c = np.zeros((0, len(arcs))) if constants is None else constants[arcs.segment].T
        return (p, p), (c, c)

    def _rows(self, index: int) -> list[AuditRow]:
        rows = []
        for row in range(len(self.limit.labels)):
            sides = [self._row(side, row, index) for side in (0, 1) if np.isfinite(self.bound[side, row])]
            if sides:
                rows.append(max(sides, key=lambda r: (SEVERITY[r.verdict], -r.margin)))
        return rows

    def _row(self, side: int, row: int, index: int) -> AuditRow:
        limit, at, sign = self.limit, (side, row, index), (1.0, -1.0)[side]
        bound, scale, allowance = float(self.bound[side, row]), float(self.scale[row]), float(self.allowance[side, row])
        attained, proved = float(self.attained[at]), float(self.proved[at])
        curve, segment = self.trajectories[index].curve, int(self.place[0][at])
        instant = float(curve.knots[segment] + self.place[1][at] * curve.durations[segment])
        return AuditRow(
            limit.id, limit.labels[row], limit.units[row], sign * bound, sign * attained, instant,
            sign * proved, (bound - proved) / scale, decide(attained, proved, bound + allowance),
            int(self.boxes[index]), allowance=allowance,
        )  # fmt: skip


def allowance_of(bound: Array, share: float) -> Array:
    """What each bound may be exceeded by: a share of its own size; of zero, what outward rounding makes of a zero."""
    return np.where(np.isfinite(bound), np.maximum(share * np.abs(bound), UNDERFLOW), 0.0)


@dataclass
class _Batch:
    """Arcs with what is known of them: values at both ends, ``(2, rows, N)`` to an end, and a bound."""

    arcs: Arcs
    start: Pair
    end: Pair
    bound: Array

    def take(self, which: Any) -> _Batch:
        return _Batch(self.arcs.take(which), _take(self.start, which), _take(self.end, which), self.bound[..., which])


def _sides(lower: Array, upper: Array) -> Pair:
    """Bounds of g and -g, ``(2, rows, N)``."""
    return np.stack([lower, -upper]), np.stack([upper, -lower])


def _take(pair: Pair, which: Any) -> Pair:
    return pair[0][..., which], pair[1][..., which]


def _alternate(left: Pair, right: Pair) -> Pair:
    """Entries of two pairs ``(.., N)`` in turn."""
    low, high = (np.stack([x, y], axis=-1).reshape(*x.shape[:-1], -1) for x, y in zip(left, right, strict=True))
    return low, high


def _where_defined(bounds: Pair, conditions: Pair, *numbers: Pair) -> Pair:
    """The bounds, infinite where not all conditions are proved to be positive and all numbers finite."""
    defined = (conditions[0] > 0.0).all(axis=0)
    for number, _ in numbers:
        defined &= np.isfinite(number).all(axis=0)
    return np.where(defined, bounds[0], -np.inf), np.where(defined, bounds[1], np.inf)


def _require_derivative(requirements: Requirements, limit: PathConstraint, order: int) -> bool:
    """Refuses a limit that claims to be on a derivative itself and is not: its expression would not be read."""
    function = requirements.function(limit)
    state = [casadi.SX.sym("z", function.sparsity_in(i)) for i in range(4)]
    value, dof = function(*state), requirements.dof
    derivative = casadi.vertsplit(state[0], dof)[order]
    if value.numel() != dof or not all(casadi.is_equal(value[i], derivative[i]) for i in range(dof)):
        raise ProblemDefinitionError(
            f"limit {limit.id!r}: it says order={order}, but its expression is not that derivative of the joints; "
            "leave order out"
        )
    return True
