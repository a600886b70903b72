"""Objectives of a problem in numbers: value, gradient and Hessian in the variables."""

from __future__ import annotations

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.hessian_sum import HessianSum, gathered
from ocp_traj.transcription.instant_values import InstantValues, InstantValuesAt
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.mapped import Mapped
from ocp_traj.transcription.shape import ShapeAt
from ocp_traj.transcription.symbolic import quadrature

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Integral:
    """An objective that is a sum of an integrand at nodes, each times its share of the durations."""

    def __init__(self, problem: Problem, objective: Objective) -> None:
        nodes, self.weights = quadrature(problem, objective)
        self.values = InstantValues.of(problem, objective.id, [Instant(objective.id, k, u) for k, u in nodes])
        shape = self.values.shape
        durations = shape.depends[:, shape.dof]  # (K, m)
        touched = self.weights != 0.0
        some = [np.unique(shape.columns[here][durations[here]]) for here in touched]
        width = max((len(s) for s in some), default=0)
        self.columns = np.full((len(nodes), width), shape.size, dtype=np.intp)  # of the durations of each node
        for j, s in enumerate(some):
            self.columns[j, : len(s)] = s

    def pairs(self) -> Index:
        """Places in the Hessian of gradient times slope of durations: (i, j) ``(P, 2)``."""
        left = np.broadcast_to(self._rows()[:, :, None], self._outer())
        right = np.broadcast_to(self.columns[:, None, :], self._outer())
        return np.stack([left.ravel(), right.ravel()], axis=1)

    def _rows(self) -> Index:
        return self.values.shape.columns[self.values.segments]

    def _outer(self) -> tuple[int, int, int]:
        return (*self._rows().shape, self.columns.shape[1])

    def value(self, at: ShapeAt, values: InstantValuesAt) -> float:
        """The integral."""
        return float((self.weights @ at.durations) @ values.values[:, 0])

    def gradient(self, at: ShapeAt, values: InstantValuesAt) -> Array:
        """In the variables ``(n,)``."""
        found = np.zeros(at.shape.size + 1)
        shares = self.weights @ at.durations
        np.add.at(found, self._rows(), shares[:, None] * values.slopes[:, 0])
        of_durations = self.weights.T @ values.values[:, 0]
        np.add.at(found, at.shape.columns, of_durations[:, None] * at.slopes[1])
        return found[:-1]

    def add(self, total: HessianSum, at: ShapeAt, values: InstantValuesAt, weight: float, places: Index) -> None:
        """Adds its Hessian times a weight; ``places`` are those of ``pairs`` among the nonzeros."""
        values.add_curvature(total, weight * (self.weights @ at.durations)[:, None])
        total.durations += weight * (self.weights.T @ values.values[:, 0])
        slopes = np.zeros((len(self.weights), at.shape.size + 1))
        full = np.zeros((len(at.durations), at.shape.size + 1))
        np.put_along_axis(full, at.shape.columns, at.slopes[1], axis=1)
        slopes = np.take_along_axis(self.weights @ full, self.columns, axis=1)
        slopes[self.columns == at.shape.size] = 0.0
        outer = weight * values.slopes[:, 0][:, :, None] * slopes[:, None, :]
        # A pair and its mirror: off the diagonal each stands once above it, on it both do.
        doubled = self._rows()[:, :, None] == self.columns[:, None, :]
        outer = np.where(doubled, 2.0 * outer, outer).ravel()
        total.nonzeros += gathered(places, outer, len(total.nonzeros))


class OfVariables:
    """An objective that is a function of x."""

    def __init__(self, problem: Problem, objective: Objective) -> None:
        assert objective.of_variables is not None
        x = casadi.SX.sym("x", problem.size)
        value = casadi.densify(casadi.SX(objective.of_variables(x, problem.parameters(x))))
        bend, gradient = casadi.hessian(value, x)
        bend = casadi.triu(bend)
        self.triplet = np.array(bend.sparsity().get_triplet(), dtype=np.intp).T.reshape(-1, 2)
        self._first = Mapped(casadi.Function("first", [x], [value, casadi.densify(gradient)]))
        self._second = Mapped(casadi.Function("second", [x], [bend.nz[:]]))

    def value(self, x: Array) -> float:
        """Its value."""
        return float(self._first(x[None])[0][0, 0])

    def gradient(self, x: Array) -> Array:
        """In the variables ``(n,)``."""
        return np.array(self._first(x[None])[1][0])

    def nonzeros(self, x: Array) -> Array:
        """Of its Hessian's upper triangle, at ``triplet``."""
        return np.array(self._second(x[None])[0][0])
