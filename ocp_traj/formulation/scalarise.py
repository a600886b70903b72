"""From many objectives to one: weighted sum, epsilon-constraint, goal attainment.

Each scalarisation turns named objective values (already signed so that less is better) into one function to minimise,
rows to respect and, for goal attainment, one extra variable. Miettinen, *Nonlinear Multiobjective Optimization* (1999).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, Protocol

import casadi
import numpy as np

from ocp_traj.errors import InputError, UnknownName, quoted
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem


@dataclass(frozen=True)
class Scalarised:
    """One function to minimise.

    Attributes:
        f: expression.
        rows: (objective id, expression, upper bound), scaled to order one.
        extra: symbol of an extra variable, or None.
    """

    f: Any
    rows: tuple[tuple[str, Any, float], ...] = ()
    extra: Any = None


class Scalarisation(Protocol):
    """Turns the objectives it names into one: f and rows that are linear in their values."""

    @property
    def names(self) -> tuple[str, ...]:
        """Objectives it needs the values of."""

    def apply(self, problem: Problem, values: Mapping[str, Any]) -> Scalarised:
        """Builds the scalar problem from the objectives' expressions."""


def _signed(objective: Objective, value: Any) -> Any:
    return (value if objective.sense == "min" else -value) / objective.scale


def _check(names: Mapping[str, float], what: str, *, positive: bool) -> None:
    for name, number in names.items():
        if not isfinite(number) or (positive and number < 0.0):
            raise InputError(
                f"{what} of {name!r} is {number}; give a finite{' number, zero or more' if positive else ' number'}"
            )


@dataclass(frozen=True)
class WeightedSum:
    """Minimise sum_k w_k f_k / scale_k."""

    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks the weights."""
        _check(self.weights, "the weight", positive=True)
        if not any(w > 0.0 for w in self.weights.values()):
            raise InputError(f"a weighted sum needs at least one positive weight; got {dict(self.weights)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Objectives with a weight above zero."""
        return tuple(name for name, w in self.weights.items() if w > 0.0)

    def apply(self, problem: Problem, values: Mapping[str, Any]) -> Scalarised:
        """sum_k w_k f_k / scale_k."""
        return Scalarised(sum(self.weights[k] * _signed(problem.objective(k), values[k]) for k in self.names))


@dataclass(frozen=True)
class EpsilonConstraint:
    """Minimise one objective with the others bounded: f_k <= eps_k (>= for one that is maximised).

    A trace of the bounded ones, ``augmentation`` times their scaled sum, keeps weakly efficient points out.
    """

    minimise: str
    bounds: Mapping[str, float]
    augmentation: float = 0.0

    def __post_init__(self) -> None:
        """Checks the bounds."""
        _check(self.bounds, "the bound", positive=False)
        if self.minimise in self.bounds:
            raise InputError(f"{self.minimise!r} is minimised; bound the other objectives instead")

    @property
    def names(self) -> tuple[str, ...]:
        """All objectives that take part."""
        return (self.minimise, *self.bounds)

    def apply(self, problem: Problem, values: Mapping[str, Any]) -> Scalarised:
        """The objective, and one row a bound."""
        rows, extra = [], 0.0
        for name, bound in self.bounds.items():
            value = _signed(problem.objective(name), values[name])
            rows.append((name, value, float(_signed(problem.objective(name), bound))))
            extra = extra + self.augmentation * value
        return Scalarised(_signed(problem.objective(self.minimise), values[self.minimise]) + extra, tuple(rows))


@dataclass(frozen=True)
class GoalAttainment:
    """Minimise gamma subject to f_k - w_k gamma <= goal_k and f_k <= bound_k; Gembicki and Haimes (1975)."""

    goals: Mapping[str, float]
    weights: Mapping[str, float]
    bounds: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks goals and weights."""
        _check(self.goals, "the goal", positive=False)
        _check(self.weights, "the weight", positive=True)
        _check(self.bounds, "the bound", positive=False)
        if set(self.goals) != set(self.weights):
            raise InputError(
                f"goal attainment needs a goal and a weight for each objective; got {sorted(self.goals)} "
                f"and {sorted(self.weights)}"
            )
        if not any(w > 0.0 for w in self.weights.values()):
            raise InputError(f"goal attainment needs at least one positive weight; got {dict(self.weights)}")

    @property
    def names(self) -> tuple[str, ...]:
        """All objectives that take part."""
        return tuple(dict.fromkeys((*self.goals, *self.bounds)))

    def apply(self, problem: Problem, values: Mapping[str, Any]) -> Scalarised:
        """The attainment factor gamma, one row a goal and one a bound."""
        gamma = casadi.MX.sym("gamma")
        rows = []
        for name in self.goals:
            objective = problem.objective(name)
            value = _signed(objective, values[name]) - self.weights[name] / objective.scale * gamma
            rows.append((name, value, float(_signed(objective, self.goals[name]))))
        for name, bound in self.bounds.items():
            objective = problem.objective(name)
            rows.append((name, _signed(objective, values[name]), float(_signed(objective, bound))))
        return Scalarised(gamma, tuple(rows), gamma)


def value_of(problem: Problem, scalarisation: Scalarisation, objectives: Mapping[str, float]) -> tuple[float, float]:
    """What is minimised, at values of the objectives, and by how much a row is exceeded that nothing else can meet."""
    scalar = scalarisation.apply(problem, objectives)
    if scalar.extra is None:
        return float(scalar.f), max((float(value) - bound for _, value, bound in scalar.rows), default=0.0)
    rows = casadi.Function("rows", [scalar.extra], [casadi.vertcat(*(v - bound for _, v, bound in scalar.rows))])
    at_zero, at_one = (np.array(rows(number)).ravel() for number in (0.0, 1.0))
    falls = at_zero - at_one > 0.0  # with gamma, in which rows are linear
    least = float((at_zero[falls] / (at_zero - at_one)[falls]).max())
    return least, float(at_zero[~falls].max(initial=0.0))


def check_names(problem: Problem, scalarisation: Scalarisation) -> None:
    """Raises ``UnknownName`` if the scalarisation names an objective the problem does not have."""
    known = [objective.id for objective in problem.objectives]
    for name in (*scalarisation.names, *getattr(scalarisation, "weights", ())):
        if name not in known:
            raise UnknownName(f"{problem.id} has no objective {quoted(name)}; objectives are {', '.join(known)}")
