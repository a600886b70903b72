"""What a trajectory has to meet: limits as functions of its state at one instant, and point constraints.

A limit is not a row of a grid: the NLP composes it with the curve, the audit feeds it arrays and boxes of states, and
plots and tables read the same expression.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.clearance import ClearanceConstraint

Points = tuple[tuple[int, float], ...]  # (segment, local time u) pairs; a negative segment counts from the end

SWEEP = np.linspace(0.0, 1.0, 17)  # where swept limits are looked at by what looks at samples: our choice
ORDERS = ("q", "v", "a", "jerk", "snap")  # time derivatives a limit may depend on


class State(NamedTuple):
    """State of a trajectory at one instant, symbolic.

    Attributes:
        q, v, a, jerk, snap: joint coordinates and their time derivatives, ``(dof,)`` each, SI.
        u: local time in [0, 1] on the segment.
        p: the problem's global parameters ``(n_p,)``, such as a payload.
        c: constants of the limit on this segment ``(n_c,)``, such as a seam's polynomial.
        s: sweep in [0, 1] of a swept limit, such as the place along a link; None for other limits.
    """

    q: Any
    v: Any
    a: Any
    jerk: Any
    snap: Any
    u: Any
    p: Any
    c: Any
    s: Any = None


Expression = Callable[[State], Any]


def _symbols(dof: int, parameters: int, constants: int, sweep: bool) -> tuple[State, list[Any]]:
    stacked = casadi.SX.sym("x", dof * len(ORDERS))
    place, p, c = casadi.SX.sym("u", 1 + sweep), casadi.SX.sym("p", parameters), casadi.SX.sym("c", constants)
    q, v, a, jerk, snap = casadi.vertsplit(stacked, dof)
    return State(q, v, a, jerk, snap, place[0], p, c, place[1] if sweep else None), [stacked, place, p, c]


def state_function(
    name: str, expression: Expression, dof: int, parameters: int, constants: int = 0, sweep: bool = False
) -> Any:
    """Compiles an expression of the state.

    Returns:
        casadi SX Function (stacked derivatives ``(5 dof,)``, u, p, c) -> ``(rows,)``; (u, s) in place of u for a swept
        one.
    """
    state, inputs = _symbols(dof, parameters, constants, sweep)
    try:
        value = casadi.densify(casadi.SX(expression(state)))
    except Exception as error:  # an expression is the user's code: name the limit it belongs to
        raise ProblemDefinitionError(f"{name}: its expression failed on a symbolic state: {error}") from error
    return casadi.Function("state_function", inputs, [casadi.vec(value)])


def derivative_order(function: Any, dof: int) -> int:
    """Highest time derivative that a compiled expression depends on: 0 for q .. 4 for snap; -1 for none."""
    sparsity = np.array(casadi.DM(function.jac_sparsity(0, 0), 1.0))
    used = [k for k in range(len(ORDERS)) if sparsity[:, k * dof : (k + 1) * dof].any()]
    return max(used, default=-1)


@dataclass(frozen=True, eq=False)
class PathConstraint:
    """lower <= g(state) <= upper at every instant.

    Attributes:
        id: unique name, such as ``velocity``.
        expression: g, from a symbolic state to ``(rows,)``.
        lower, upper: bounds ``(rows,)`` in ``units``; infinite where there is none, never equal.
        units: one a row.
        labels: one a row, such as joint names.
        eq: equation or table of the source.
        order: set where g is the ``order``-th derivative itself, so that hulls and extrema are exact.
        constants: per segment ``(K, n_c)``, reaching the expression as ``state.c``.
        sweep: whether it depends on ``state.s`` and has to hold for all s in [0, 1] as well.
        segments: of the curve, on which it has to hold; None for all.
    """

    id: str
    expression: Expression
    lower: Array
    upper: Array
    units: tuple[str, ...]
    labels: tuple[str, ...]
    eq: str = ""
    order: int | None = None
    constants: Array | None = None
    sweep: bool = False
    segments: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        """Checks shapes and bounds."""
        if self.segments is not None and (not self.segments or min(self.segments) < 0):
            raise ProblemDefinitionError(
                f"limit {self.id!r} is for the segments {self.segments}; give one or more, counted from 0"
            )
        if self.sweep and self.order is not None:
            raise ProblemDefinitionError(f"limit {self.id!r}: a derivative of the joints has no sweep; leave order out")
        rows = len(self.labels)
        for name in ("lower", "upper"):
            try:
                bound = np.broadcast_to(np.asarray(getattr(self, name), dtype=float), (rows,)).copy()
            except ValueError as error:
                raise ProblemDefinitionError(f"limit {self.id!r}: {name} does not fit its {rows} labels") from error
            object.__setattr__(self, name, bound)
        if len(self.units) != rows:
            raise ProblemDefinitionError(
                f"limit {self.id!r}: {len(self.units)} units for {rows} labels; give one a row"
            )
        for label, low, high in zip(self.labels, self.lower, self.upper, strict=True):
            if not low < high:
                raise ProblemDefinitionError(
                    f"limit {self.id!r}: the bounds of {label} are empty or equal, lower {low:.9g}, upper {high:.9g}; "
                    "a path limit needs lower < upper (hold an equality within a band, or make it a point constraint)"
                )
        if self.order is not None and not 0 <= self.order < len(ORDERS):
            raise ProblemDefinitionError(f"limit {self.id!r}: order {self.order}; allowed 0 (position) to 4 (snap)")

    @classmethod
    def on_derivative(
        cls,
        id: str,
        order: int,
        lower: ArrayLike,
        upper: ArrayLike,
        units: Sequence[str],
        labels: Sequence[str],
        eq: str = "",
    ) -> PathConstraint:
        """A limit on one time derivative of the joints: 0 position, 1 velocity, .. 4 snap."""
        return cls(
            id,
            lambda state: state[order],
            np.asarray(lower),
            np.asarray(upper),
            tuple(units),
            tuple(labels),
            eq,
            order=order,
        )

    def holds_on(self, segment: int) -> bool:
        """Whether it has to hold on a segment of the curve."""
        return self.segments is None or segment in self.segments

    @cached_property
    def scale(self) -> Array:
        """Size of each row ``(rows,)``: half the range where two-sided, else the bound's size, else 1."""
        two_sided = np.isfinite(self.lower) & np.isfinite(self.upper)
        single = np.maximum(
            np.where(np.isfinite(self.lower), np.abs(self.lower), 0.0),
            np.where(np.isfinite(self.upper), np.abs(self.upper), 0.0),
        )
        size = np.where(two_sided, 0.5 * (self.upper - self.lower), single) if two_sided.any() else single
        return np.where((size > 0.0) & np.isfinite(size), size, 1.0)


@dataclass(frozen=True, eq=False)
class PointConstraint:
    """lower <= g(state) <= upper at stated instants: rest at an end, a via point.

    Attributes:
        id: unique name.
        expression: g, from a symbolic state to ``(rows,)``.
        at: the instants.
        lower, upper: ``(instants, rows)`` or what broadcasts to it; equal for an equality.
        units, labels: one a row.
        eq: equation or table of the source.
        structural: the curve meets it for every value of the variables: the NLP needs no row, the audit checks it.
        tolerance: what the audit allows [of the row's own unit]; rounding makes structural ones about 1e-13 off.
    """

    id: str
    expression: Expression
    at: Points
    lower: Array
    upper: Array
    units: tuple[str, ...]
    labels: tuple[str, ...]
    eq: str = ""
    structural: bool = False
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        """Checks shapes and bounds."""
        shape = (len(self.at), len(self.labels))
        for name in ("lower", "upper"):
            try:
                bound = np.broadcast_to(np.asarray(getattr(self, name), dtype=float), shape).copy()
            except ValueError as error:
                raise ProblemDefinitionError(
                    f"point constraint {self.id!r}: {name} does not fit (instants, rows) = {shape}"
                ) from error
            object.__setattr__(self, name, bound)
        if len(self.units) != len(self.labels):
            raise ProblemDefinitionError(
                f"point constraint {self.id!r}: {len(self.units)} units for {len(self.labels)} labels"
            )
        for bound in (self.lower, self.upper):
            if np.isnan(bound).any():
                (k, u), row = self.at[np.argwhere(np.isnan(bound))[0, 0]], np.argwhere(np.isnan(bound))[0, 1]
                raise ProblemDefinitionError(
                    f"point constraint {self.id!r}: the bound of {self.labels[row]} at segment {k}, u = {u:g} is no "
                    "number; give one"
                )
        if not (self.lower <= self.upper).all():
            raise ProblemDefinitionError(f"point constraint {self.id!r}: a lower bound lies above its upper bound")
        if not 0.0 < self.tolerance < np.inf:
            raise ProblemDefinitionError(
                f"point constraint {self.id!r}: its tolerance is {self.tolerance}; give a number above zero"
            )


@dataclass(frozen=True, eq=False)
class DurationConstraint:
    """lower <= T_k <= upper for some segments of the curve: the pieces of a path whose speed is given.

    Attributes:
        id: unique name.
        segments: of the curve, counted from 0; a negative one counts from the end.
        lower, upper: ``(segments,)`` or what broadcasts to it [s]; equal for an equality.
        eq: equation or table of the source.
        tolerance: what the audit allows, as a share of the bound.
    """

    id: str
    segments: tuple[int, ...]
    lower: Array
    upper: Array
    eq: str = ""
    tolerance: float = 1e-9

    def __post_init__(self) -> None:
        """Checks shapes and bounds."""
        for name in ("lower", "upper"):
            bound = np.broadcast_to(np.asarray(getattr(self, name), dtype=float), (len(self.segments),)).copy()
            object.__setattr__(self, name, bound)
        if not self.segments or not ((self.lower >= 0.0) & (self.lower <= self.upper)).all():
            raise ProblemDefinitionError(
                f"duration constraint {self.id!r}: give one or more segments, each with 0 <= lower <= upper [s]"
            )


@dataclass(frozen=True)
class ParameterBound:
    """lower <= p <= upper for a global parameter that a trajectory brings along, such as its payload."""

    parameter: str
    lower: float
    upper: float
    unit: str


@dataclass(frozen=True, eq=False)
class Requirements:
    """What a trajectory has to meet, whoever made it: all that the audit needs beside the trajectory.

    Attributes:
        joints: one name a joint.
        path_constraints, point_constraints: the limits.
        parameters: labels of the global parameters p.
        continuity: the curve is promised to be C^continuity at its inner knots; -1 for no promise.
        joint_units: one a joint.
        duration_constraints: on segments whose time is given.
        parameter_bounds: of parameters that nothing else decides.
        clearance_constraints: on distances between bodies.
    """

    joints: tuple[str, ...]
    joint_units: tuple[str, ...]
    path_constraints: tuple[PathConstraint, ...]
    point_constraints: tuple[PointConstraint, ...] = ()
    parameters: tuple[str, ...] = ()
    continuity: int = -1
    duration_constraints: tuple[DurationConstraint, ...] = ()
    parameter_bounds: tuple[ParameterBound, ...] = ()
    clearance_constraints: tuple[ClearanceConstraint, ...] = ()
    _functions: dict[Hashable, Any] = field(default_factory=dict, repr=False, init=False)

    def __post_init__(self) -> None:
        """Checks that ids are unique and that every expression has the shape of its labels."""
        limits: list[PathConstraint | PointConstraint] = [*self.path_constraints, *self.point_constraints]
        for bound in self.parameter_bounds:
            if bound.parameter not in self.parameters:
                raise ProblemDefinitionError(
                    f"there is a bound on the parameter {bound.parameter!r}; parameters are {list(self.parameters)}"
                )
        for name in self.ids:
            if self.ids.count(name) > 1:
                raise ProblemDefinitionError(f"limit id {name!r} is used {self.ids.count(name)} times; ids are unique")
        for clearance in self.clearance_constraints:
            if clearance.parameter and clearance.parameter not in self.parameters:
                raise ProblemDefinitionError(
                    f"limit {clearance.id!r} is of the parameter {clearance.parameter!r}; parameters are "
                    f"{list(self.parameters)}"
                )
            if clearance.robot.size != self.dof:
                raise ProblemDefinitionError(
                    f"limit {clearance.id!r} is of a robot with {clearance.robot.size} joints; there are {self.dof}"
                )
        for limit in limits:
            rows = self.function(limit).numel_out(0)
            if rows != len(limit.labels):
                raise ProblemDefinitionError(
                    f"limit {limit.id!r}: its expression has {rows} rows for {len(limit.labels)} labels"
                )

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joints)

    @property
    def ids(self) -> list[str]:
        """Ids of all limits."""
        groups = (
            self.path_constraints, self.point_constraints, self.duration_constraints, self.clearance_constraints
        )  # fmt: skip
        return [limit.id for group in groups for limit in group]

    def function(self, limit: PathConstraint | PointConstraint) -> Any:
        """The limit's compiled expression, built once; see ``state_function``."""

        def build() -> Any:
            constants = getattr(limit, "constants", None)
            width = 0 if constants is None else constants.shape[1]
            return state_function(
                limit.id, limit.expression, self.dof, len(self.parameters), width, getattr(limit, "sweep", False)
            )

        return self.compiled(limit, "expression", build)

    def compiled(
        self, limit: PathConstraint | PointConstraint | ClearanceConstraint, what: str, build: Callable[[], Any]
    ) -> Any:
        """Something built from the limit's expression, kept for the next use."""
        key = limit.id, what
        if key not in self._functions:
            self._functions[key] = build()
        return self._functions[key]

    def arguments(
        self, limit: PathConstraint | PointConstraint, states: Array, segment: Index, u: Array, p: Array,
        s: Array | None = None,
    ) -> tuple[Array, Array, Array, Array]:  # fmt: skip
        """What ``function(limit)`` takes at N instants, a column an instant.

        Args:
            limit: whose constants.
            states: stacked derivatives ``(5 dof, N)``.
            segment: of each instant ``(N,)``.
            u: local times ``(N,)``.
            p: parameters ``(n_p, N)``, or ``(n_p, 1)`` for all; see ``parameters_of``.
            s: place along the sweep ``(N,)``, of a swept limit.
        """
        table = getattr(limit, "constants", None)
        c = np.zeros((0, 1)) if table is None else np.take(table.T, segment, axis=1)
        return states, u[None] if s is None else np.stack([u, s]), p, c

    def parameters_of(self, motions: Sequence[Motion]) -> Array:
        """The global parameters of motions ``(n_p, motions)``."""
        columns = [[motion.parameters[name] for motion in motions] for name in self.parameters]
        return np.array(columns, dtype=float).reshape(len(self.parameters), len(motions))

    def order(self, limit: PathConstraint | PointConstraint) -> int:
        """Highest time derivative the limit depends on; see ``derivative_order``."""
        order: int = self.compiled(limit, "order", lambda: derivative_order(self.function(limit), self.dof))
        return order

    def continuous(self, limit: PathConstraint) -> bool:
        """Whether the limit has the same value on both sides of an inner knot."""
        uses_local_time = 0 in self.function(limit).jac_sparsity(0, 1).get_triplet()[1]
        everywhere = limit.constants is None and limit.segments is None
        return self.order(limit) <= self.continuity and everywhere and not uses_local_time
