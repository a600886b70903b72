"""How a problem's path and objectives change where all variables grow by one factor, derived from their tapes."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import casadi

from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.interval.degrees import ZERO, degrees
from ocp_traj.transcription.symbolic import (
    SymbolicCurve,
    curve_function,
    objective_values,
    smooth_objectives,
    variables_function,
)


def path_is_of_ratios(problem: Problem) -> bool:
    """Whether s x moves along the path of x, s times as slowly, for every s > 0: shown by the curve's operations."""

    def build() -> bool:
        durations, *others = degrees(curve_function(problem), [[1] * problem.size])
        return set(durations) == {Fraction(1)} and all(degree in (0, ZERO) for rows in others for degree in rows)

    return bool(problem.cached("path is of ratios", build))


def is_total_time(problem: Problem, name: str) -> bool:
    """Whether an objective is the sum of all variables."""
    objective = problem.objective(name)
    if objective.of_variables is None or time_degree(problem, name) != 1:
        return False
    x = casadi.SX.sym("x", problem.size)
    slope = casadi.gradient(variables_function(problem, objective)(x), x)
    return not casadi.symvar(slope) and bool((casadi.evalf(slope).full() == 1.0).all())


def time_degree(problem: Problem, name: str) -> Fraction | None:
    """The d of f(s x) = s^d f(x), for every s > 0; None where the objective's operations do not show one."""

    def build() -> Fraction | None:
        if name not in smooth_objectives(problem):
            return None
        degree = degrees(scalar_function(problem, name), [[1] * problem.size])[0][0]
        return degree if isinstance(degree, Fraction) else None

    found: Fraction | None = problem.cached(("time degree", name), build)
    return found


def scalar_function(problem: Problem, name: str) -> Any:
    """Casadi SX Function x -> value of a smooth objective, all of it on one tape."""

    def build() -> Any:
        if name not in smooth_objectives(problem):
            raise InputError(f"{problem.id}: {name} is a total variation, or a sum of some, and no smooth function")
        x = casadi.MX.sym("x", problem.size)
        value = objective_values(SymbolicCurve.at(problem, x), [name])[name]
        return casadi.Function("objective", [x], [casadi.densify(value)]).expand()

    return problem.cached(("scalar function", name), build)
