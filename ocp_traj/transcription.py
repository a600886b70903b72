"""Transcription: a problem and the instants at which its limits are imposed become an NLP.

The curve is expanded in SX once per NLP and gives the states at all instants; limits and objectives are then mapped
over the columns of states, so that the NLP's size, not its build time, grows with the number of instants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.bernstein import PiecewiseBezier
from ocp_traj.nlp import NLP, Row
from ocp_traj.problem import Objective, Problem
from ocp_traj.requirements import ORDERS, PathConstraint, PointConstraint, derivative_order, state_function
from ocp_traj.scalarise import Scalarisation, check_names
from ocp_traj.trajectory import Trajectory

Array = NDArray[np.float64]

BACK_OFF = 1e-9  # tightening of every path limit, in its own scale: our choice; it costs about 2e-9 of an objective


@dataclass(frozen=True, eq=False)
class Instant:
    """An instant at which a limit is imposed.

    It may move with the variables, u(x) = clip(u_0 + s (x - x_0), 0, 1), so as to stay on the peak it was put on.

    Attributes:
        limit: id of the path constraint.
        segment: of the curve.
        u: local time u_0.
        rows: indices of the limit's rows, None for all.
        slope: s ``(n,)``, or None for an instant that stays.
        anchor: x_0 ``(n,)``.
    """

    limit: str
    segment: int
    u: float
    rows: tuple[int, ...] | None = None
    slope: Array | None = None
    anchor: Array | None = None


@dataclass(frozen=True, eq=False)
class SymbolicCurve:
    """A problem's curve at an MX vector x, called once and shared by everything built on it."""

    problem: Problem
    x: Any
    durations: Any
    parameters: Any
    points: tuple[Any, ...]

    @classmethod
    def at(cls, problem: Problem, x: Any) -> SymbolicCurve:
        """The curve's durations, parameters and control points as expressions of x ``(n,)``."""
        durations, parameters, *points = curve_function(problem)(x)
        return cls(problem, x, durations, parameters, tuple(points))


def states_at(curve: SymbolicCurve, segments: Sequence[int], u: Any) -> Any:
    """States of the curve at instants, as MX expressions.

    The curve's control points are one function of x and the states another of the control points, each compiled once
    for the problem: an NLP with other instants reuses both, and their derivatives.

    Args:
        curve: whose states.
        segments: of each instant ``(N,)``.
        u: local times, MX or DM ``(N,)``.

    Returns:
        stacked derivatives ``(5 dof, N)``.
    """
    points = curve.points
    columns: list[Any] = []
    order: list[int] = []
    for degree in sorted({points[k].shape[0] - 1 for k in segments}):
        members = [i for i, k in enumerate(segments) if points[k].shape[0] - 1 == degree]
        flat = casadi.horzcat(*(casadi.vec(points[segments[i]]) for i in members))
        times = casadi.horzcat(*(curve.durations[segments[i]] for i in members))
        local = casadi.horzcat(*(u[i] for i in members))
        columns.append(_segment_states(curve.problem, degree).map(len(members))(flat, times, local))
        order += members
    together = casadi.horzcat(*columns)
    return together if order == sorted(order) else together[:, np.argsort(order).tolist()]


def _segment_states(problem: Problem, degree: int) -> Any:
    """Casadi SX Function (control points, stacked ``(n + 1) dof``, T, u) -> derivatives 0..4, stacked ``(5 dof,)``."""

    def build() -> Any:
        dof = problem.requirements.dof
        points, duration, u = casadi.SX.sym("P", degree + 1, dof), casadi.SX.sym("T"), casadi.SX.sym("u")
        curve = PiecewiseBezier(duration, (points,))
        states = casadi.vertcat(*(curve.at(0, u, order).T for order in range(len(ORDERS))))
        return casadi.Function("segment_states", [casadi.vec(points), duration, u], [casadi.densify(states)])

    return problem.cached(f"segment states {degree}", build)


def curve_function(problem: Problem) -> Any:
    """Casadi SX Function x -> (durations ``(K,)``, p, control points of each segment ``(n_k + 1, dof)``)."""

    def build() -> Any:
        x = casadi.SX.sym("x", problem.size)
        curve = problem.curve(x)
        outputs = [casadi.densify(o) for o in (curve.durations, problem.parameters(x), *curve.control_points)]
        return casadi.Function("curve", [x], outputs)

    return problem.cached("curve", build)


def trajectory(problem: Problem, x: ArrayLike) -> Trajectory:
    """The trajectory that a decision vector stands for."""
    durations, parameters, *points = (np.array(value) for value in curve_function(problem)(np.asarray(x, dtype=float)))
    return Trajectory(
        curve=PiecewiseBezier(durations.ravel(), tuple(points)),
        joints=problem.requirements.joints,
        problem=problem.id,
        case=case_fields(problem),
        variables=problem.unpack(x),
        parameters=dict(zip(problem.requirements.parameters, parameters.ravel().tolist(), strict=True)),
    )


def case_fields(problem: Problem) -> dict[str, Any]:
    """The case's fields that differ from their defaults, as plain values: enough to build the problem again."""
    case, plain = problem.case, type(problem.case)()
    different = {
        name: getattr(case, name) for name in case.__dataclass_fields__ if getattr(case, name) != getattr(plain, name)
    }
    return {name: list(value) if isinstance(value, tuple) else value for name, value in different.items()}


def few_instants(problem: Problem) -> tuple[Instant, ...]:
    """The first grid of constraint exchange: degree/2 + 1 instants a segment, at least 3.

    A limit on a derivative that is constant, or linear, on its segments gets the 1 or 2 instants that are exact.
    """
    degrees = _degrees(problem)
    return tuple(_grid(problem, lambda k, limit: _count(degrees[k], limit)))


def uniform_instants(problem: Problem, per_segment: int) -> tuple[Instant, ...]:
    """``per_segment`` instants on every segment for every limit, ends included."""
    return tuple(_grid(problem, lambda k, limit: per_segment))


def _degrees(problem: Problem) -> tuple[int, ...]:
    """Degree of each segment."""
    curve = curve_function(problem)
    return tuple(curve.size1_out(k) - 1 for k in range(2, curve.n_out()))


def _count(degree: int, limit: PathConstraint) -> int:
    few = max(3, degree // 2 + 1)
    if limit.order is None:
        return few
    return min(few, max(degree - limit.order, 0) + 1)


def _grid(problem: Problem, count: Callable[[int, PathConstraint], int]) -> Iterable[Instant]:
    segments = len(_degrees(problem))
    for limit in problem.requirements.path_constraints:
        shared = problem.requirements.continuous(limit)
        for k in range(segments):
            number = count(k, limit)
            for u in np.linspace(0.0, 1.0, number) if number > 1 else [0.5]:
                if not (shared and u == 1.0 and k < segments - 1):
                    yield Instant(limit.id, k, float(u))


def integrand_function(problem: Problem, objective: Objective) -> Any:
    """The objective's integrand, compiled; see ``problem.state_function``."""
    assert objective.integrand is not None
    integrand, requirements = objective.integrand, problem.requirements
    return problem.cached(
        f"integrand {objective.id}",
        lambda: state_function(objective.id, integrand, requirements.dof, len(requirements.parameters)),
    )


def quadrature(problem: Problem, objective: Objective) -> tuple[list[tuple[int, float]], Array]:
    """Nodes (segment, u) of an objective's quadrature, and weights.

    The two sides of an inner knot are one node where the integrand is continuous there.

    Returns:
        nodes, and weights ``(nodes, K)`` which, times the durations, give each node's weight.
    """
    segments = len(_degrees(problem))
    order = derivative_order(integrand_function(problem, objective), problem.requirements.dof)
    shared = order <= problem.requirements.continuity
    nodes: dict[tuple[int, float], Array] = {}
    for k in range(segments):
        for u, weight in objective.quadrature:
            node = (k + 1, 0.0) if shared and u == 1.0 and k < segments - 1 else (k, u)
            nodes.setdefault(node, np.zeros(segments))[k] += weight
    return list(nodes), np.array(list(nodes.values()))


def plain_objectives(problem: Problem, names: Iterable[str]) -> dict[str, Objective]:
    """The objectives called ``names`` and those they are sums of, sums last."""
    wanted = [problem.objective(name) for name in names]
    parts = [problem.objective(term) for objective in wanted for term in objective.terms or ()]
    return {o.id: o for o in sorted([*parts, *wanted], key=lambda o: o.terms is not None)}


def objective_values(curve: SymbolicCurve, names: Iterable[str]) -> dict[str, Any]:
    """MX expressions of the named objectives (and of the terms they sum)."""
    problem = curve.problem
    values: dict[str, Any] = {}
    for name, objective in plain_objectives(problem, names).items():
        if objective.terms is not None:
            values[name] = sum(factor * values[term] for term, factor in objective.terms.items())
        elif objective.of_variables is not None:
            values[name] = variables_function(problem, objective)(curve.x)
        else:
            nodes, weights = quadrature(problem, objective)
            states = states_at(curve, [k for k, _ in nodes], casadi.DM([u for _, u in nodes]))
            integrand = integrand_function(problem, objective)
            columns = integrand.map(len(nodes))(
                states,
                casadi.DM([u for _, u in nodes]).T,
                casadi.repmat(curve.parameters, 1, len(nodes)),
                casadi.MX(0, len(nodes)),
            )
            values[name] = casadi.mtimes(columns, casadi.mtimes(casadi.DM(weights), curve.durations))
    return values


def variables_function(problem: Problem, objective: Objective) -> Any:
    """Casadi SX Function x -> value of an objective that is a function of the variables."""

    def build() -> Any:
        x = casadi.SX.sym("x", problem.size)
        assert objective.of_variables is not None
        return casadi.Function("of_variables", [x], [objective.of_variables(x, problem.parameters(x))])

    return problem.cached(f"variables {objective.id}", build)


def objective_function(problem: Problem) -> Any:
    """Casadi Function x -> values of all objectives of the problem, in their order ``(objectives,)``."""

    def build() -> Any:
        x = casadi.MX.sym("x", problem.size)
        names = [objective.id for objective in problem.objectives]
        values = objective_values(SymbolicCurve.at(problem, x), names)
        return casadi.Function("objectives", [x], [casadi.vertcat(*(values[name] for name in names))])

    return problem.cached("objectives", build)


def evaluate_objectives(problem: Problem, x: ArrayLike) -> dict[str, float]:
    """Value of every objective at a decision vector."""
    values = np.array(objective_function(problem)(np.asarray(x, dtype=float))).ravel()
    return {objective.id: float(value) for objective, value in zip(problem.objectives, values, strict=True)}


def transcribe(
    problem: Problem, scalarisation: Scalarisation, instants: Sequence[Instant], back_off: float = BACK_OFF
) -> NLP:
    """Builds the NLP of a problem, with one objective and its limits imposed at ``instants``.

    Args:
        problem: what to optimise.
        scalarisation: many objectives to one.
        instants: where each path limit is imposed.
        back_off: tightening of the path limits, in units of their scale.

    Returns:
        An NLP over x, and over the scalarisation's extra variable if it has one.
    """
    check_names(problem, scalarisation)
    x = casadi.MX.sym("x", problem.size)
    curve = SymbolicCurve.at(problem, x)
    scalar = scalarisation.apply(problem, objective_values(curve, scalarisation.names))
    g: list[Any] = []
    lower: list[float] = []
    upper: list[float] = []
    rows: list[Row] = []
    for limit in problem.requirements.path_constraints:
        members = [instant for instant in instants if instant.limit == limit.id]
        if members:
            _path_rows(curve, limit, members, back_off, g, lower, upper, rows)
    for point in problem.requirements.point_constraints:
        if not point.structural:
            _point_rows(curve, point, g, lower, upper, rows)
    for name, value, bound in scalar.rows:
        objective = problem.objective(name)
        g.append(value)
        lower.append(-np.inf)
        upper.append(bound)
        rows.append(Row(name, "", unit=objective.unit, scale=objective.scale))
    extra = [] if scalar.extra is None else [scalar.extra]
    unbounded = np.full(len(extra), np.inf)
    return NLP(
        name=problem.id,
        x=casadi.vertcat(x, *extra),
        f=scalar.f,
        g=casadi.vertcat(*g) if g else casadi.MX(0, 1),
        lower_x=np.concatenate([problem.lower, -unbounded]),
        upper_x=np.concatenate([problem.upper, unbounded]),
        lower_g=np.array(lower, dtype=float),
        upper_g=np.array(upper, dtype=float),
        rows=tuple(rows),
        labels=(*problem.labels, *("gamma" for _ in extra)),
        units=(*problem.units, *("-" for _ in extra)),
        memory=problem.cached("solver memory", dict),
    )


def _path_rows(
    curve: SymbolicCurve, limit: PathConstraint, members: list[Instant], back_off: float,
    g: list[Any], lower: list[float], upper: list[float], rows: list[Row],
) -> None:  # fmt: skip
    """Appends the rows of one path limit at its instants, scaled to order one."""
    values = limit_values(curve, limit, members)
    scaled = values / casadi.DM(limit.scale)
    low, high = limit.lower / limit.scale + back_off, limit.upper / limit.scale - back_off
    entries = [(i, j) for j, m in enumerate(members) for i in (range(len(limit.labels)) if m.rows is None else m.rows)]
    g.append(casadi.vec(scaled)[[i + j * len(limit.labels) for i, j in entries]])
    for i, j in entries:
        lower.append(low[i])
        upper.append(high[i])
        rows.append(
            Row(limit.id, limit.labels[i], members[j].segment, members[j].u, limit.units[i], float(limit.scale[i]))
        )


def limit_values(curve: SymbolicCurve, limit: PathConstraint, members: Sequence[Instant], u: Any = None) -> Any:
    """MX expression of a path limit at instants: ``(rows, instants)``; ``u`` replaces the instants' own local times."""
    problem = curve.problem
    local = casadi.vertcat(*(_local_time(m, curve.x) for m in members)) if u is None else u
    states = states_at(curve, [m.segment for m in members], local)
    n = len(members)
    if limit.order is not None:
        dof = problem.requirements.dof
        return states[limit.order * dof : (limit.order + 1) * dof, :]
    constants = np.zeros((n, 0)) if limit.constants is None else limit.constants[[m.segment for m in members]]
    function = problem.requirements.function(limit)
    return function.map(n)(states, local.T, casadi.repmat(curve.parameters, 1, n), casadi.MX(casadi.DM(constants.T)))


def _local_time(instant: Instant, x: Any) -> Any:
    if instant.slope is None:
        return casadi.MX(instant.u)
    assert instant.anchor is not None
    moved = instant.u + casadi.dot(casadi.DM(instant.slope), x - casadi.DM(instant.anchor))
    return casadi.fmin(casadi.fmax(moved, 0.0), 1.0)


def _point_rows(
    curve: SymbolicCurve, point: PointConstraint, g: list[Any], lower: list[float], upper: list[float], rows: list[Row]
) -> None:
    """Appends the rows of one point constraint; they are not scaled."""
    problem = curve.problem
    segments = len(_degrees(problem))
    nodes = [(k % segments, u) for k, u in point.at]
    local = casadi.DM([u for _, u in nodes])
    states = states_at(curve, [k for k, _ in nodes], local)
    n = len(nodes)
    values = problem.requirements.function(point).map(n)(
        states, local.T, casadi.repmat(curve.parameters, 1, n), casadi.MX(0, n)
    )
    g.append(casadi.vec(values))
    for j, (k, u) in enumerate(nodes):
        for i, label in enumerate(point.labels):
            lower.append(point.lower[j, i])
            upper.append(point.upper[j, i])
            rows.append(Row(point.id, label, k, u, point.units[i]))
