"""States that no variable moves: a limit broken there is broken by every trajectory of the problem.

At the ends of a rest-to-rest motion position, velocity and acceleration are given, so torque there is static: it bounds
the payload for every time law, and says at once when a payload is too heavy.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, SWEEP, PathConstraint
from ocp_traj.formulation.rows import Conflict, Row


@dataclass(frozen=True, eq=False)
class FixedValue:
    """A row of a limit where its state is given.

    Attributes:
        limit, row: which.
        segment, instant: the end, or the stop.
        value: casadi Function p -> value.
    """

    limit: PathConstraint
    row: int
    segment: int
    instant: float
    value: Any


def fixed_values(problem: Problem) -> list[FixedValue]:
    """Rows of path limits at both ends, and where the motion stops between them, that depend on parameters alone."""
    x, curve = problem.at_symbols
    p = casadi.SX.sym("p", len(problem.requirements.parameters))
    found = []
    for segment, u in ((0, 0.0), *((k, 0.0) for k in _stops(curve)), (curve.segments - 1, 1.0)):
        state = [casadi.densify(curve.at(segment, u, order).T) for order in range(len(ORDERS))]
        for limit in problem.requirements.path_constraints:
            if not limit.holds_on(segment):
                continue
            constants = [] if limit.constants is None else limit.constants[segment]
            for place in [casadi.vertcat(u, s) for s in SWEEP] if limit.sweep else [u]:
                values = problem.requirements.function(limit)(casadi.vertcat(*state), place, p, casadi.DM(constants))
                for row in range(len(limit.labels)):
                    value = values[row]
                    if not casadi.depends_on(value, x):
                        function = casadi.Function("fixed", [p], [value])
                        found.append(FixedValue(limit, row, segment, u, function))
    return found


def _stops(curve: PiecewiseBezier) -> list[int]:
    """Segments, but the first, at whose start position, velocity and acceleration are given whatever the variables."""
    return [
        k
        for k in range(1, curve.segments)
        if curve.control_points[k].shape[0] > 2 and casadi.SX(curve.control_points[k][:3, :]).is_constant()
    ]


def _positions(problem: Problem) -> Iterator[tuple[PathConstraint, int, int, float]]:
    """Limits on positions, their row, a segment and the position given at its start, inner knots alone."""
    curve = problem.at_symbols[1]
    limits = [limit for limit in problem.requirements.path_constraints if limit.order == 0]
    for k in range(1, curve.segments) if limits else ():
        start = casadi.SX(curve.control_points[k][0, :])
        for j in (j for j in range(curve.dof) if start[j].is_constant()):
            value = float(start[j])
            yield from ((limit, j, k, value) for limit in limits if limit.holds_on(k))


def fixed_conflicts(problem: Problem) -> tuple[Conflict, ...]:
    """Limits that are broken whatever the variables: at ends and stops, and of positions at via points.

    What a parameter decides that is itself a variable is left out.

    Slacks of objectives count with their lower bounds, which tighten no limit.
    """
    x = casadi.SX.sym("x", problem.size)
    inactive = problem.inactive([])
    bounds = enumerate(zip(problem.lower, inactive, strict=True))
    least = casadi.vertcat(*(casadi.SX(low) if unused else x[j] for j, (low, unused) in bounds))
    parameters = casadi.SX(problem.parameters(least))
    values = [(limit, i, k, 0.0, value) for limit, i, k, value in _positions(problem)]
    if not casadi.depends_on(parameters, x):
        p = np.array(casadi.evalf(parameters)).ravel()
        values = [(f.limit, f.row, f.segment, f.instant, float(f.value(p))) for f in fixed_values(problem)] + values
    conflicts: dict[tuple[str, str], Conflict] = {}
    for limit, i, segment, instant, value in values:
        bound = float(limit.upper[i]) if value > limit.upper[i] else float(limit.lower[i])
        excess = max(value - limit.upper[i], limit.lower[i] - value)
        if excess > 1e-9 * limit.scale[i]:
            row = Row(limit.id, limit.labels[i], segment, instant, limit.units[i], float(limit.scale[i]))
            conflict = Conflict(row, value, bound, float(excess))
            if problem.about.describe_conflict is not None:
                conflict = replace(conflict, words=problem.about.describe_conflict(conflict))
            known = conflicts.get((limit.id, limit.labels[i]))
            if known is None or conflict.excess > known.excess:
                conflicts[limit.id, limit.labels[i]] = conflict
    return tuple(sorted(conflicts.values(), key=lambda c: -c.excess / c.row.scale))
