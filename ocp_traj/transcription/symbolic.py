"""A problem's curve, states and objectives as CasADi expressions, each compiled once for the problem.

The curve's control points are one function of x, states another of the control points, integrands a third of the
states, mapped over instants: an NLP with other instants reuses all of them, and their derivatives.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier, total_variation
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, Expression, derivative_order, state_function


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
        instants = casadi.horzcat(*(u[i] for i in members))
        columns.append(_segment_states(curve.problem, degree).map(len(members))(flat, times, instants))
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

    return problem.cached(("segment states", degree), build)


def curve_function(problem: Problem) -> Any:
    """Casadi SX Function x -> (durations ``(K,)``, p, control points of each segment ``(n_k + 1, dof)``)."""

    def build() -> Any:
        x, curve = problem.at_symbols
        outputs = [casadi.densify(o) for o in (curve.durations, problem.parameters(x), *curve.control_points)]
        return casadi.Function("curve", [x], outputs)

    return problem.cached("curve", build)


def motion_of(problem: Problem, x: ArrayLike) -> Motion:
    """The motion that a decision vector ``x (n,)`` stands for."""
    durations, parameters, *points = (np.array(value) for value in curve_function(problem)(np.asarray(x, dtype=float)))
    named = dict(zip(problem.requirements.parameters, parameters.ravel().tolist(), strict=True))
    return Motion(PiecewiseBezier(durations.ravel(), tuple(points)), problem.requirements.joints, named)


def degrees(problem: Problem) -> tuple[int, ...]:
    """Degree of each segment."""
    curve = curve_function(problem)
    return tuple(curve.size1_out(k) - 1 for k in range(2, curve.n_out()))


def integrand_function(problem: Problem, objective: Objective, rows: Expression | None = None) -> Any:
    """The objective's integrand, or the rows whose squares it sums; see ``requirements.state_function``."""
    assert objective.integrand is not None
    expression, requirements = rows or objective.integrand, problem.requirements
    table = objective.constants
    width = 0 if table is None else table.shape[1]
    if table is not None and len(table) != len(degrees(problem)):
        raise ProblemDefinitionError(
            f"objective {objective.id!r} has constants for {len(table)} segments; the curve has {len(degrees(problem))}"
        )
    return problem.cached(
        ("integrand", objective.id, rows is None),
        lambda: state_function(objective.id, expression, requirements.dof, len(requirements.parameters), width),
    )


def constants_at(objective: Objective, segments: ArrayLike) -> Array:
    """The constants of an integrand on segments ``(N,)``: ``(N, n_c)``."""
    where = np.asarray(segments, dtype=np.intp)
    return np.zeros((len(where), 0)) if objective.constants is None else objective.constants[where]


def _share_function(problem: Problem, objective: Objective) -> Any:
    """Casadi SX Function (derivatives, u, p, c, weight) -> weight x integrand."""

    def build() -> Any:
        function = integrand_function(problem, objective)
        state = [casadi.SX.sym("z", function.numel_in(i)) for i in range(4)]
        weight = casadi.SX.sym("w")
        value = weight * function(*state)
        return casadi.Function("share", [*state, weight], [value])

    return problem.cached(("share", objective.id), build)


def quadrature(problem: Problem, objective: Objective) -> tuple[list[tuple[int, float]], csr_array]:
    """Nodes (segment, u) of an objective's quadrature, and weights.

    The two sides of an inner knot are one node where the integrand is continuous there.

    Returns:
        nodes, and sparse weights ``(nodes, K)`` which, times the durations, give each node's weight.
    """
    segments = len(degrees(problem))
    order = derivative_order(integrand_function(problem, objective), problem.requirements.dof)
    shared = order <= problem.requirements.continuity and objective.constants is None
    nodes: dict[tuple[int, float], int] = {}
    entries: list[tuple[int, int, float]] = []
    for k in range(segments):
        for u, weight in objective.quadrature:
            node = (k + 1, 0.0) if shared and u == 1.0 and k < segments - 1 else (k, u)
            entries.append((nodes.setdefault(node, len(nodes)), k, weight))
    row, column, weights = zip(*entries, strict=True)
    return list(nodes), csr_array((weights, (row, column)), shape=(len(nodes), segments))


def plain_objectives(problem: Problem, names: Iterable[str]) -> dict[str, Objective]:
    """The objectives called ``names`` and those they are sums of, sums last."""
    wanted = [problem.objective(name) for name in names]
    parts = [problem.objective(term) for objective in wanted for term in objective.terms or ()]
    return {o.id: o for o in sorted([*parts, *wanted], key=lambda o: o.terms is not None)}


def variations(problem: Problem, names: Iterable[str]) -> tuple[Objective, ...]:
    """Those of the named objectives, and of the terms they sum, that are total variations."""
    return tuple(o for o in plain_objectives(problem, names).values() if o.variation is not None)


def objective_values(
    curve: SymbolicCurve, names: Iterable[str], given: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """MX expressions of the named objectives (and of the terms they sum); of total variations those ``given``."""
    problem = curve.problem
    values: dict[str, Any] = dict(given or {})
    for name, objective in plain_objectives(problem, names).items():
        if name in values:
            continue
        if objective.terms is not None:
            values[name] = sum(factor * values[term] for term, factor in objective.terms.items())
        elif objective.of_variables is not None:
            values[name] = variables_function(problem, objective)(curve.x)
        else:
            nodes, weights = quadrature(problem, objective)
            u = casadi.DM([u for _, u in nodes])
            shares = _share_function(problem, objective).map(len(nodes))(
                states_at(curve, [k for k, _ in nodes], u),
                casadi.MX(u.T),
                casadi.repmat(curve.parameters, 1, len(nodes)),
                casadi.MX(casadi.DM(constants_at(objective, [k for k, _ in nodes]).T)),
                casadi.mtimes(casadi.DM(weights.tocsc()), curve.durations).T,
            )
            values[name] = casadi.sum2(shares)
    return values


def variables_function(problem: Problem, objective: Objective) -> Any:
    """Casadi SX Function x -> value of an objective that is a function of the variables."""

    def build() -> Any:
        x = casadi.SX.sym("x", problem.size)
        assert objective.of_variables is not None
        return casadi.Function("of_variables", [x], [objective.of_variables(x, problem.parameters(x))])

    return problem.cached(("variables", objective.id), build)


def smooth_objectives(problem: Problem) -> tuple[str, ...]:
    """Objectives that are smooth functions of x: all but total variations and sums of them."""
    return tuple(o.id for o in problem.objectives if not variations(problem, [o.id]))


def objective_function(problem: Problem) -> Any:
    """Casadi Function x -> values of ``smooth_objectives``, in their order ``(objectives,)``."""

    def build() -> Any:
        x = casadi.MX.sym("x", problem.size)
        names = smooth_objectives(problem)
        values = objective_values(SymbolicCurve.at(problem, x), names)
        return casadi.Function("objectives", [x], [casadi.vertcat(*(values[name] for name in names))])

    return problem.cached("objectives", build)


def evaluate_objectives(problem: Problem, x: ArrayLike) -> dict[str, float]:
    """Value of every objective at a decision vector; total variations are exact, by the derivative's roots."""
    point = np.asarray(x, dtype=float)
    smooth = np.array(objective_function(problem)(point)).ravel().tolist()
    values = dict(zip(smooth_objectives(problem), smooth, strict=True))
    turning = [objective for objective in problem.objectives if objective.variation is not None]
    if turning:
        points = [np.array(value)[:, :, None] for value in curve_function(problem)(point)[2:]]
        values |= {o.id: float(row_variations(problem, o, points).sum()) for o in turning}
    for objective in problem.objectives:
        if objective.id not in values:
            values[objective.id] = sum(factor * values[term] for term, factor in (objective.terms or {}).items())
    return {objective.id: values[objective.id] for objective in problem.objectives}


def variation_matrix(problem: Problem, objective: Objective) -> Array:
    """A of the rows A q + b whose total variation an objective sums: ``(rows, dof)``."""

    def build() -> Array:
        function = problem.requirements.function(problem.variation(objective))
        arguments = [casadi.SX.sym("z", function.numel_in(i)) for i in range(4)]
        slopes = casadi.jacobian(function(*arguments), arguments[0])[:, : problem.requirements.dof]
        return np.array(casadi.DM(casadi.evalf(casadi.densify(slopes))))

    matrix: Array = problem.cached(("variation matrix", objective.id), build)
    return matrix


def row_variations(problem: Problem, objective: Objective, points: Sequence[Array]) -> Array:
    """Exact total variation of each row ``(rows, N)`` of N curves, by their control points ``(n_k + 1, dof, N)``."""
    matrix = variation_matrix(problem, objective)
    total = np.zeros((len(matrix), points[0].shape[2]))
    for segment in points:
        rows = np.einsum("rj,ijn->irn", matrix, segment)
        total += total_variation(rows.reshape(len(segment), -1)).reshape(total.shape)
    return total
