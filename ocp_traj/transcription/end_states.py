"""States that no variable moves: a limit broken there is broken by every trajectory of the problem.

At the ends of a rest-to-rest motion position, velocity and acceleration are given, so torque there is static: it bounds
the payload for every time law, and says at once when a payload is too heavy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np

from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, SWEEP, PathConstraint
from ocp_traj.formulation.rows import Conflict, Row


@dataclass(frozen=True, eq=False)
class FixedValue:
    """A row of a limit at an end where its state is given.

    Attributes:
        limit, row: which.
        segment, instant: the end.
        value: casadi Function p -> value.
    """

    limit: PathConstraint
    row: int
    segment: int
    instant: float
    value: Any


def fixed_values(problem: Problem) -> list[FixedValue]:
    """Rows of path limits at both ends that depend on parameters alone."""
    x, curve = problem.at_symbols
    p = casadi.SX.sym("p", len(problem.requirements.parameters))
    found = []
    for segment, u in ((0, 0.0), (curve.segments - 1, 1.0)):
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


def fixed_conflicts(problem: Problem) -> tuple[Conflict, ...]:
    """Limits that are broken at the ends whatever the variables; empty where a parameter is itself a variable.

    Slacks of objectives count with their lower bounds, which tighten no limit.
    """
    x = casadi.SX.sym("x", problem.size)
    inactive = problem.inactive([])
    bounds = enumerate(zip(problem.lower, inactive, strict=True))
    least = casadi.vertcat(*(casadi.SX(low) if unused else x[j] for j, (low, unused) in bounds))
    parameters = casadi.SX(problem.parameters(least))
    if casadi.depends_on(parameters, x):
        return ()
    p = np.array(casadi.evalf(parameters)).ravel()
    conflicts: dict[tuple[str, str], Conflict] = {}
    for fixed in fixed_values(problem):
        limit, i = fixed.limit, fixed.row
        value = float(fixed.value(p))
        bound = float(limit.upper[i]) if value > limit.upper[i] else float(limit.lower[i])
        excess = max(value - limit.upper[i], limit.lower[i] - value)
        if excess > 1e-9 * limit.scale[i]:
            row = Row(limit.id, limit.labels[i], fixed.segment, fixed.instant, limit.units[i], float(limit.scale[i]))
            conflict = Conflict(row, value, bound, float(excess))
            if problem.about.describe_conflict is not None:
                conflict = replace(conflict, words=problem.about.describe_conflict(conflict))
            if (limit.id, limit.labels[i]) not in conflicts:
                conflicts[limit.id, limit.labels[i]] = conflict
    return tuple(sorted(conflicts.values(), key=lambda c: -c.excess / c.row.scale))
