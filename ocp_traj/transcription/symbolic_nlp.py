"""The NLP of a problem at instants as CasADi expressions: for other solvers, and to check the numeric one against."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import difference_matrix
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.transcription.instants import Instant, step_nodes
from ocp_traj.transcription.symbolic import SymbolicCurve, degrees, objective_values, states_at, variations


def symbolic_nlp(problem: Problem, scalarisation: Scalarisation, instants: Sequence[Instant]) -> tuple[Any, Any, Any]:
    """Variables ``(n,)``, f and rows g ``(m,)`` of ``transcribe``'s NLP, in its order, as MX expressions.

    Raises:
        ProblemDefinitionError: where a limit is chosen at the state, which no expression tells.
    """
    if any(instant.limit == limit.id for limit in problem.chosen_limits for instant in instants):
        raise ProblemDefinitionError(
            f"{problem.id}: limits on distances between bodies are no expressions; solve it by a method that takes "
            "numbers, such as ipopt"
        )
    x = casadi.MX.sym("x", problem.size)
    curve = SymbolicCurve.at(problem, x)
    g: list[Any] = []
    sizes, given = [], {}
    for objective in variations(problem, scalarisation.names):
        limit = problem.variation(objective)
        differences = []
        for row in range(len(limit.labels)):
            nodes = step_nodes(problem, objective, row, instants)
            values = limit_values(curve, limit, nodes)[row, :].T
            inner = [j for j in range(1, len(nodes)) if nodes[j].segment == nodes[j - 1].segment]
            differences.append((values[inner] - values[[j - 1 for j in inner]]) / objective.scale)
        together = casadi.vertcat(*differences)
        sizes.append(casadi.MX.sym(f"steps of {objective.id}", together.numel()))
        g += [sizes[-1] - together, sizes[-1] + together]
        given[objective.id] = objective.scale * casadi.sum1(sizes[-1])
    values = objective_values(curve, dict.fromkeys((*scalarisation.names, *problem.tuning.regularisation)), given)
    scalar = scalarisation.apply(problem, values)
    traces = [w * values[name] / problem.objective(name).scale for name, w in problem.tuning.regularisation.items()]
    for limit in problem.requirements.path_constraints:
        members = [instant for instant in instants if instant.limit == limit.id]
        if members:
            rows = [range(len(limit.labels)) if m.rows is None else m.rows for m in members]
            entries = [(i, j) for j, some in enumerate(rows) for i in some]
            found = casadi.vec(limit_values(curve, limit, members))[[i + j * len(limit.labels) for i, j in entries]]
            g.append(found / casadi.DM([limit.scale[i] for i, _ in entries]))
    for point in problem.requirements.point_constraints:
        if not point.structural:
            local = casadi.DM([u for _, u in point.at])
            n, states = len(point.at), states_at(curve, [k % len(degrees(problem)) for k, _ in point.at], local)
            function = problem.requirements.function(point).map(n)
            g.append(casadi.vec(function(states, local.T, casadi.repmat(curve.parameters, 1, n), casadi.MX(0, n))))
    g += [value for _, value, _ in scalar.rows]
    extra = [] if scalar.extra is None else [scalar.extra]
    f = casadi.MX(scalar.f + sum(traces))
    return casadi.vertcat(x, *extra, *sizes), f, casadi.vertcat(*g) if g else casadi.MX(0, 1)


def limit_values(curve: SymbolicCurve, limit: PathConstraint, members: Sequence[Instant]) -> Any:
    """MX expression of a path limit at instants: ``(rows, instants)``."""
    problem = curve.problem
    local = casadi.vertcat(*(_local_time(m, curve.x) for m in members))
    segments, n = [m.segment for m in members], len(members)
    if limit.order is not None:
        dof = problem.requirements.dof
        values = casadi.horzsplit(states_at(curve, segments, local)[limit.order * dof : (limit.order + 1) * dof, :])
        for j, member in enumerate(members):
            if member.control is not None:
                points = curve.points[member.segment]
                row = difference_matrix(points.shape[0] - 1, limit.order)[member.control]
                values[j] = points.T @ casadi.DM(row) / curve.durations[member.segment] ** limit.order
        return casadi.horzcat(*values)
    constants = np.zeros((n, 0)) if limit.constants is None else limit.constants[segments]
    function = problem.requirements.function(limit)
    place = local.T
    if limit.sweep:
        along = casadi.vertcat(*(_along(m, curve.x) for m in members))
        place = casadi.vertcat(place, along.T)
    parameters, given = casadi.repmat(curve.parameters, 1, n), casadi.MX(casadi.DM(constants.T))
    return function.map(n)(states_at(curve, segments, local), place, parameters, given)


def _local_time(instant: Instant, x: Any) -> Any:
    return _moved(instant, instant.u, instant.slope, x)


def _along(instant: Instant, x: Any) -> Any:
    return _moved(instant, instant.sweep, instant.sweep_slope, x)


def _moved(instant: Instant, start: float, slope: Array | None, x: Any) -> Any:
    if slope is None or instant.anchor is None:
        return casadi.MX(start)
    few = np.nonzero(slope)[0]  # an instant moves with the variables of its own segment
    if not len(few):
        return casadi.MX(start)
    columns = few if instant.columns is None else instant.columns[few]
    moved = start + casadi.dot(casadi.DM(slope[few]), x[columns.tolist()] - casadi.DM(instant.anchor[few]))
    return casadi.fmin(casadi.fmax(moved, 0.0), 1.0)
