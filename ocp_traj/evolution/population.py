"""Objectives and limits of many decision vectors in one pass of the tapes: what evolutionary loops evaluate.

The curve's tape turns a population into control points, small matrices turn those into states at all instants, and one
run of each limit's and integrand's tape evaluates every instant of every individual together.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import basis, difference_matrix
from ocp_traj.errors import InputError
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, SWEEP, PathConstraint
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.values import values_at
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.symbolic import (
    constants_at,
    curve_function,
    integrand_function,
    plain_objectives,
    quadrature,
    row_variations,
    variables_function,
)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A population's values.

    Attributes:
        objectives: ``(N, objectives asked for)``, in their own sense and unit.
        violations: of each row of each path limit ``(N, rows)``: largest excess over the instants in units of the
            limit's scale, <= 0 where met. NaN becomes inf: an individual that cannot be evaluated is infeasible.
    """

    objectives: Array
    violations: Array


class _Nodes:
    """Instants on a curve, with the matrices that turn control points into states there."""

    def __init__(self, nodes: Sequence[tuple[int, float]], degrees: Sequence[int]) -> None:
        self.nodes = tuple(nodes)
        self.u = np.array([u for _, u in nodes])
        self.segment = np.array([k for k, _ in nodes], dtype=np.intp)
        alike = defaultdict(list)  # by degree and number of nodes: segment, its places among the nodes
        for k in sorted(set(self.segment.tolist())):
            places = np.nonzero(self.segment == k)[0]
            alike[degrees[k], len(places)].append((k, places))
        self._groups = []  # segments (K,), places (K, M), matrices (K, orders, M, n + 1)
        for (n, _), members in alike.items():
            segments, places = map(np.array, zip(*members, strict=True))
            per_order = [
                basis(max(n - o, 0), self.u[places].ravel()) @ difference_matrix(n, o) for o in range(len(ORDERS))
            ]
            self._groups.append(
                (segments, places, np.stack(per_order).reshape(len(ORDERS), *places.shape, n + 1).swapaxes(0, 1))
            )

    def states(self, points: list[Array], durations: Array) -> Array:
        """Derivatives 0..4 at the nodes ``(5, dof, M, N)`` from control points ``(n_k + 1, dof, N)``."""
        dof, individuals = points[0].shape[1:]
        out = np.empty((len(ORDERS), dof, len(self.nodes), individuals))
        powers = np.stack([durations**order for order in range(len(ORDERS))], axis=1)
        for segments, places, matrices in self._groups:
            together = np.stack([points[k] for k in segments])
            values = matrices @ together.reshape(len(segments), 1, together.shape[1], -1)
            values = values.reshape(*values.shape[:3], dof, individuals)
            values /= powers[segments][:, :, None, None]
            out[:, :, places] = values.transpose(1, 3, 0, 2, 4)
        return out

    def together(self, states: Array, parameters: Array) -> tuple[Array, Index, Array, Array]:
        """Nodes and individuals as M N instants: stacked states, segments, local times and parameters."""
        m, n = states.shape[2:]
        flat = states.reshape(-1, m * n)
        return flat, np.repeat(self.segment, n), np.repeat(self.u, n), np.tile(parameters, (1, m))


class Population:
    """Evaluates populations of one problem.

    Args:
        problem: whose objectives and limits.
        objectives: ids, in the order wanted.
        per_segment: instants a segment at which limits are looked at.
        refine: whether peaks between instants are estimated by parabolas through three of them: closer, and no proof
            either.
    """

    def __init__(self, problem: Problem, objectives: Sequence[str], per_segment: int = 5, refine: bool = False) -> None:
        """Compiles the tapes; see the class."""
        self.problem, self.names, self.refine = problem, tuple(objectives), refine
        self.per_segment = per_segment
        self._plain = plain_objectives(problem, self.names)
        curve = curve_function(problem)
        self._curve = Tape(curve)
        self._shapes = [curve.size_out(k) for k in range(2, curve.n_out())]
        degrees = [rows - 1 for rows, _ in self._shapes]
        last = len(degrees) - 1
        grid = [(k, float(u)) for k in range(last + 1) for u in np.linspace(0.0, 1.0, per_segment)]
        # Where a limit is continuous at an inner knot, one side of it is enough.
        grids = {True: _Nodes([(k, u) for k, u in grid if u < 1.0 or k == last], degrees), False: _Nodes(grid, degrees)}
        requirements = problem.requirements
        partial = {
            limit.segments: _Nodes([(k, u) for k, u in grid if limit.holds_on(k)], degrees)
            for limit in requirements.path_constraints
            if limit.segments is not None
        }
        self._limits = [
            (limit, grids[requirements.continuous(limit)] if limit.segments is None else partial[limit.segments])
            for limit in requirements.path_constraints
        ]
        # A chosen limit is told its postures, which the first derivatives of any grid's states are.
        self._chosen = [(limit, grids[True]) for limit in problem.chosen_limits]
        self._integrals: dict[str, tuple[_Nodes, Array, Tape]] = {}
        self._direct: dict[str, Tape] = {}
        for objective in self._plain.values():
            if objective.integrand is not None:
                nodes, weights = quadrature(problem, objective)
                tape = Tape(integrand_function(problem, objective))
                self._integrals[objective.id] = (_Nodes(nodes, degrees), weights.toarray(), tape)
            elif objective.of_variables is not None:
                self._direct[objective.id] = Tape(variables_function(problem, objective))

    def evaluate(self, x: ArrayLike, limits: bool = True) -> Evaluation:
        """Objectives and violations of a population ``x (N, n)``; without its ``limits`` no violations."""
        population, durations, parameters, points = self._curves(x)
        wanted = self._limits if limits else []
        chosen = self._chosen if limits else []
        grids = {nodes for _, nodes in (*wanted, *chosen)}
        states = {nodes: nodes.states(points, durations) for nodes in grids}
        violations = [self._violation(limit, nodes, states[nodes], parameters) for limit, nodes in wanted]
        violations += [_chosen_violation(limit, nodes, states[nodes], parameters) for limit, nodes in chosen]
        values: dict[str, Array] = {}
        for name, objective in self._plain.items():
            if objective.terms is not None:
                values[name] = np.asarray(sum(factor * values[term] for term, factor in objective.terms.items()))
            elif objective.variation is not None:
                values[name] = row_variations(self.problem, objective, points).sum(axis=0)
            elif name in self._direct:
                values[name] = self._direct[name].evaluate(population.T)[0][0]
            else:
                nodes, weights, tape = self._integrals[name]
                state, segment, u, p = nodes.together(nodes.states(points, durations), parameters)
                c = np.zeros((0, 1)) if objective.constants is None else constants_at(objective, segment).T
                integrand = tape.evaluate(state, u[None], p, c)[0].reshape(len(nodes.nodes), -1)
                values[name] = (integrand * (weights @ durations)).sum(axis=0)
        worst = np.concatenate(violations).T if violations else np.zeros((len(population), 0))
        return Evaluation(
            np.stack([values[name] for name in self.names], axis=1), np.where(np.isnan(worst), np.inf, worst)
        )

    def _curves(self, x: ArrayLike) -> tuple[Array, Array, Array, list[Array]]:
        """A population ``(N, n)`` and its durations, parameters and control points ``(n_k + 1, dof, N)``."""
        population = np.atleast_2d(np.asarray(x, dtype=float))
        if population.shape[1] != self.problem.size:
            raise InputError(
                f"{self.problem.id} has {self.problem.size} variables; the population has {population.shape[1]}"
            )
        durations, parameters, *flat = self._curve.evaluate(population.T)
        # CasADi stores matrices by column: (dof, n + 1, N) after reshaping, then (n + 1, dof, N).
        points = [
            np.ascontiguousarray(np.swapaxes(p.reshape(cols, rows, -1), 0, 1))
            for p, (rows, cols) in zip(flat, self._shapes, strict=True)
        ]
        return population, durations, parameters, points

    @property
    def instants(self) -> list[Instant]:
        """Where the path limits are looked at: limit after limit, of a swept one place after place of its sweep."""
        return [
            Instant(limit.id, k, u, sweep=float(s))
            for limit, nodes in self._limits
            for s in (SWEEP if limit.sweep else (0.0,))
            for k, u in nodes.nodes
        ]

    def rows(self, x: ArrayLike) -> Array:
        """Values of the path limits ``(N, m)`` of a population ``x (N, n)``, each over its scale.

        Instant after instant, as ``instants`` has them, each with the rows of its limit.
        """
        population, durations, parameters, points = self._curves(x)
        states = {nodes: nodes.states(points, durations) for nodes in {nodes for _, nodes in self._limits}}
        found = [np.zeros((len(population), 0))]
        for limit, nodes in self._limits:
            values = self._values(limit, nodes, states[nodes], parameters) / limit.scale[:, None, None]
            found.append(values.transpose(2, 1, 0).reshape(len(population), -1))
        return np.concatenate(found, axis=1)

    def _values(self, limit: PathConstraint, nodes: _Nodes, states: Array, parameters: Array) -> Array:
        """Values at the nodes, of a swept limit once for each place of its sweep: ``(rows, sweeps M, N)``."""
        if limit.order is not None:
            return np.asarray(states[limit.order])
        where, u = nodes.together(states, parameters), np.repeat(nodes.u, states.shape[3])
        sweeps = [np.full_like(u, s) for s in SWEEP] if limit.sweep else [None]
        found = [values_at(self.problem.requirements, limit, *where, s) for s in sweeps]
        return np.stack(found, axis=1).reshape(len(limit.labels), -1, states.shape[3])

    def _violation(self, limit: PathConstraint, nodes: _Nodes, states: Array, parameters: Array) -> Array:
        """Largest excess of each row over the nodes, in units of the limit's scale: ``(rows, N)``."""
        values = self._values(limit, nodes, states, parameters)
        scale = limit.scale[:, None]
        high, low = values.max(axis=1), values.min(axis=1)
        if self.refine:
            high, low = np.maximum(high, _between(values, nodes)), np.minimum(low, -_between(-values, nodes))
        return np.asarray(np.maximum(high - limit.upper[:, None], limit.lower[:, None] - low) / scale)


def _chosen_violation(limit: ChosenLimit, nodes: _Nodes, states: Array, parameters: Array) -> Array:
    """Largest excess of each row over the nodes ``(rows, N)``, by its size; -1 where it is farther than that."""
    flat, _, _, p = nodes.together(states, parameters)
    above = limit.above(flat[: states.shape[1]].T, p.T, limit.size)
    found = above.reshape(len(nodes.nodes), states.shape[3], -1).min(axis=0).T
    return np.asarray(np.maximum(-found / limit.size, -1.0))


def _between(values: Array, nodes: _Nodes) -> Array:
    """Largest vertex of the parabolas through three neighbouring nodes of a segment ``(rows, N)``; -inf for none.

    The last node of a segment may be the first of the next one, where the limit is continuous there.
    """
    inside = (nodes.segment[:-2] == nodes.segment[1:-1]) & (nodes.u[1:-1] > 0.0) & (nodes.u[1:-1] < 1.0)
    a, b, c = values[:, :-2][:, inside], values[:, 1:-1][:, inside], values[:, 2:][:, inside]
    if not inside.any():
        return np.full(values[:, 0].shape, -np.inf)
    bend = a - 2.0 * b + c
    with np.errstate(divide="ignore", invalid="ignore"):
        peak = b - (a - c) ** 2 / (8.0 * bend)
    return np.asarray(np.where((b >= a) & (b >= c) & (bend < 0.0), peak, -np.inf).max(axis=1))
