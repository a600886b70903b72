"""Objectives and limits of many decision vectors in one pass of the tapes: what evolutionary loops evaluate.

The curve's tape turns a population into control points, small matrices turn those into states at all instants, and one
run of each limit's and integrand's tape evaluates every instant of every individual together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.bernstein import basis, difference_matrix
from ocp_traj.errors import InputError
from ocp_traj.problem import ORDERS, Objective, PathConstraint, Problem
from ocp_traj.tape import Tape
from ocp_traj.transcription import (
    curve_function,
    integrand_function,
    plain_objectives,
    quadrature,
    variables_function,
)

Array = NDArray[np.float64]
Nodes = Sequence[tuple[int, float]]  # (segment, local time)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A population's values.

    Attributes:
        objectives: ``(N, objectives asked for)``, in their own sense and unit.
        violations: of each row of each path limit ``(N, rows)``: largest excess over the instants in units of the limit's
            scale, <= 0 where met. NaN becomes inf: an individual that cannot be evaluated is infeasible.
    """

    objectives: Array
    violations: Array


class Population:
    """Evaluates populations of one problem.

    Args:
        problem: whose objectives and limits.
        objectives: ids, in the order wanted.
        per_segment: instants a segment at which limits are looked at.
    """

    def __init__(self, problem: Problem, objectives: Sequence[str], per_segment: int = 5) -> None:
        """Compiles the tapes; see the class."""
        self.problem, self.names = problem, tuple(objectives)
        self._plain = plain_objectives(problem, self.names)
        curve = curve_function(problem)
        self._curve = Tape(curve)
        self._shapes = [curve.size_out(k) for k in range(2, curve.n_out())]
        self._limits = [
            (limit, self._nodes(limit, per_segment), Tape(problem.requirements.function(limit)))
            for limit in problem.requirements.path_constraints
        ]
        self._integrands = {o.id: Tape(integrand_function(problem, o)) for o in self._plain.values() if o.integrand}
        self._direct = {o.id: Tape(variables_function(problem, o)) for o in self._plain.values() if o.of_variables}

    def _nodes(self, limit: PathConstraint, per_segment: int) -> list[tuple[int, float]]:
        shared, last = self.problem.requirements.continuous(limit), len(self._shapes) - 1
        grid = [(k, float(u)) for k in range(last + 1) for u in np.linspace(0.0, 1.0, per_segment)]
        return [(k, u) for k, u in grid if not (shared and u == 1.0 and k < last)]

    def evaluate(self, x: ArrayLike) -> Evaluation:
        """Objectives and violations of a population ``x (N, n)``."""
        population = np.atleast_2d(np.asarray(x, dtype=float))
        if population.shape[1] != self.problem.size:
            raise InputError(f"{self.problem.id} has {self.problem.size} variables; the population has {population.shape[1]}")
        durations, parameters, *flat = self._curve.evaluate(population.T)
        # CasADi stores matrices by column: (dof, n + 1, N) after reshaping, then (n + 1, dof, N).
        points = [
            np.swapaxes(p.reshape(cols, rows, -1), 0, 1) for p, (rows, cols) in zip(flat, self._shapes, strict=True)
        ]
        hodographs = [
            [np.tensordot(difference_matrix(len(p) - 1, order), p, axes=1) / durations[k] ** order for order in range(5)]
            for k, p in enumerate(points)
        ]
        violations = [self._violation(limit, nodes, tape, hodographs, parameters) for limit, nodes, tape in self._limits]
        values: dict[str, Array] = {}
        for name, objective in self._plain.items():
            values[name] = self._objective(objective, values, population, hodographs, durations, parameters)
        worst = np.concatenate(violations).T if violations else np.zeros((len(population), 0))
        return Evaluation(
            np.stack([values[name] for name in self.names], axis=1), np.where(np.isnan(worst), np.inf, worst)
        )

    def _violation(
        self, limit: PathConstraint, nodes: Nodes, tape: Tape, hodographs: list[list[Array]], parameters: Array
    ) -> Array:
        orders = range(len(ORDERS)) if limit.order is None else [limit.order]
        states = _states(hodographs, nodes, orders)
        if limit.order is not None:
            values = states
        else:
            values = _over_nodes(tape, states, nodes, parameters, limit.constants)
        scale = limit.scale[:, None, None]
        excess = np.maximum(values - limit.upper[:, None, None], limit.lower[:, None, None] - values) / scale
        return np.asarray(excess.max(axis=1))

    def _objective(
        self, objective: Objective, values: dict[str, Array], x: Array, hodographs: list[list[Array]],
        durations: Array, parameters: Array,
    ) -> Array:  # fmt: skip
        if objective.terms is not None:
            return np.asarray(sum(factor * values[term] for term, factor in objective.terms.items()))
        if objective.of_variables is not None:
            return self._direct[objective.id].evaluate(x.T)[0][0]
        nodes, weights = quadrature(self.problem, objective)
        states = _states(hodographs, nodes, range(len(ORDERS)))
        integrand = _over_nodes(self._integrands[objective.id], states, nodes, parameters, None)[0]
        return np.asarray(np.einsum("mn,mn->n", integrand, weights @ durations))


def _states(hodographs: list[list[Array]], nodes: Nodes, orders: Sequence[int]) -> Array:
    """States at nodes ``(len(orders) dof, M, N)``."""
    blocks: list[Array] = [np.empty(0)] * len(nodes)
    for segment in {k for k, _ in nodes}:
        members = [i for i, (k, _) in enumerate(nodes) if k == segment]
        u = np.array([nodes[i][1] for i in members])
        values = [np.tensordot(basis(len(hodographs[segment][o]) - 1, u), hodographs[segment][o], axes=1) for o in orders]
        for row, i in enumerate(members):
            blocks[i] = np.concatenate([value[row] for value in values])
    return np.stack(blocks, axis=1)


def _over_nodes(tape: Tape, states: Array, nodes: Nodes, parameters: Array, constants: Array | None) -> Array:
    """Runs a state function's tape over nodes and individuals together: ``(rows, M, N)``."""
    width, m, n = states.shape
    u = np.repeat(np.array([u for _, u in nodes]), n)[None]
    p = np.tile(parameters, (1, m))
    c = np.zeros((0, m * n)) if constants is None else np.repeat(constants[[k for k, _ in nodes]].T, n, axis=1)
    return tape.evaluate(states.reshape(width, m * n), u, p, c)[0].reshape(-1, m, n)
