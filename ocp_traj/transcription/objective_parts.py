"""Objectives of a problem in numbers: value, gradient and Hessian in the variables."""

from __future__ import annotations

import casadi
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.mapped import Mapped
from ocp_traj.transcription.hessian_sum import HessianSum, gathered
from ocp_traj.transcription.instant_values import InstantValues, InstantValuesAt
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.shape import ShapeAt
from ocp_traj.transcription.symbolic import quadrature


class Integral:
    """An objective that is a sum of an integrand at nodes, each times its share of the durations."""

    def __init__(self, problem: Problem, objective: Objective) -> None:
        nodes, self.weights = quadrature(problem, objective)
        self.values = InstantValues.of(problem, objective.id, [Instant(objective.id, k, u) for k, u in nodes])
        self._by_duration = self.weights.T.tocsr()
        shape = self.values.shape
        # The variables of each duration come first in its row; those left over are padding.
        moves = shape.depends[:, shape.dof]  # (K, m)
        self._first = np.argsort(~moves, axis=1, kind="stable")[:, : int(moves.sum(axis=1).max(initial=0))]
        self._columns = np.where(
            np.take_along_axis(moves, self._first, axis=1), np.take_along_axis(shape.columns, self._first, axis=1),
            shape.size,
        )  # fmt: skip
        # A node's gradient meets the durations of the segments that share it: pairs (segment of the node, segment).
        self._node, duration = self.weights.nonzero()
        pairs, self._pair = np.unique(
            np.stack([self.values.segments[self._node], duration], axis=1), axis=0, return_inverse=True
        )
        self._left, self._right = pairs.T

    def pairs(self) -> Index:
        """Places in the Hessian of gradient times slope of durations: (i, j) ``(P, 2)``."""
        left, right = np.broadcast_arrays(*self._outer())
        return np.stack([left.ravel(), right.ravel()], axis=1)

    def _outer(self) -> tuple[Index, Index]:
        """Variables of the node's segment and of the duration, a pair of segments each, to be broadcast."""
        return self.values.shape.columns[self._left][:, :, None], self._columns[self._right][:, None, :]

    def value(self, at: ShapeAt, values: InstantValuesAt) -> float:
        """The integral."""
        return float((self.weights @ at.durations) @ values.values[:, 0])

    def gradient(self, at: ShapeAt, values: InstantValuesAt) -> Array:
        """In the variables ``(n,)``."""
        found = np.zeros(at.shape.size + 1)
        shares = self.weights @ at.durations
        np.add.at(found, at.shape.columns[self.values.segments], shares[:, None] * values.slopes[:, 0])
        of_durations = self._by_duration @ values.values[:, 0]
        np.add.at(found, at.shape.columns, of_durations[:, None] * at.slopes[1])
        return found[:-1]

    def add(self, total: HessianSum, at: ShapeAt, values: InstantValuesAt, weight: float, places: Index) -> None:
        """Adds its Hessian times a weight; ``places`` are those of ``pairs`` among the nonzeros."""
        values.add_curvature(total, weight * (self.weights @ at.durations)[:, None])
        total.durations += weight * (self._by_duration @ values.values[:, 0])
        slopes = np.zeros((len(self._left), at.shape.columns.shape[1]))
        np.add.at(slopes, self._pair, self.weights.data[:, None] * values.slopes[self._node, 0])
        of_duration = np.take_along_axis(at.slopes[1], self._first, axis=1)[self._right]
        outer = weight * slopes[:, :, None] * of_duration[:, None, :]
        # A pair and its mirror: off the diagonal each stands once above it, on it both do.
        left, right = self._outer()
        outer = np.where(left == right, 2.0 * outer, outer).ravel()
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
