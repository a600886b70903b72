"""A curve's control points, durations and parameters at x, with their derivatives, a segment a row.

A segment depends on few of a long path's variables: its derivatives are dense in those, and whatever is made of them
grows with the number of segments, not with its square.
"""

from __future__ import annotations

from functools import cached_property

import casadi
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.problem import Problem
from ocp_traj.mapped import Mapped
from ocp_traj.transcription.symbolic import curve_function, degrees


class Shape:
    """What the shape of a problem's curve depends on, and how.

    Attributes:
        size: number of variables n.
        degrees: of each segment ``(K,)``; control points are padded with zeros to the highest.
        dof: joints.
        columns: which variables a segment depends on ``(K, m)``, padded with n.
        depends: whether the points of a joint, ``[:, :dof]``, T and each parameter depend on a column: bool
            ``(K, dof + 1 + n_p, m)``.
    """

    def __init__(self, problem: Problem) -> None:
        """Compiles the shape's derivatives."""
        self.size, self.dof = problem.size, problem.requirements.dof
        self.degrees = np.array(degrees(problem))
        self._count = len(problem.requirements.parameters)
        segments, most = len(self.degrees), int(self.degrees.max())
        self._rows = (most + 1) * self.dof + 1 + self._count  # of a segment: points, T, p
        x = casadi.SX.sym("x", problem.size)
        durations, parameters, *points = curve_function(problem).call([x])
        whole, places = [], []  # one entry of the shape, and where it stands, segment by segment
        for k in range(segments):
            whole += [casadi.vec(points[k].T), durations[k], parameters]
            number = (self.degrees[k] + 1) * self.dof
            places += [
                k * self._rows + np.arange(number),
                k * self._rows + self._rows - 1 - self._count + np.arange(1 + self._count),
            ]
        stacked, self._places = casadi.densify(casadi.vertcat(*whole)), np.concatenate(places)
        slope = casadi.jacobian(stacked, x)
        row, column = (np.array(index, dtype=np.intp) for index in slope.sparsity().get_triplet())
        segment, within = np.divmod(self._places[row], self._rows)
        used, which = np.unique(segment * self.size + column, return_inverse=True)
        owner, some = np.divmod(used, max(self.size, 1))
        place = np.arange(len(used)) - np.searchsorted(owner, owner)
        width = int(place.max(initial=-1)) + 1
        self.columns: Index = np.full((segments, width), self.size, dtype=np.intp)
        self.columns[owner, place] = some
        where = place[which]
        self._slope_places = (segment * self._rows + within) * width + where
        self.depends = np.zeros((segments, self.dof + 1 + self._count, width), dtype=bool)
        number = (most + 1) * self.dof
        self.depends[segment, np.where(within < number, within % self.dof, within - number + self.dof), where] = True
        self._value = Mapped(casadi.Function("shape", [x], [stacked]))
        self._slope = Mapped(casadi.Function("shape_slope", [x], [slope.nz[:]]))
        nu = casadi.SX.sym("nu", stacked.numel())
        bend = casadi.triu(casadi.hessian(casadi.dot(nu, stacked), x)[0])
        self.bend_sparsity = bend.sparsity()
        self._bend = Mapped(casadi.Function("shape_bend", [x, nu], [bend.nz[:]]))

    def at(self, x: Array) -> ShapeAt:
        """The shape at ``x (n,)``."""
        return ShapeAt(self, np.array(x, dtype=float))


class ShapeAt:
    """The shape at one x; derivatives are computed on first use.

    Attributes:
        x: ``(n,)``.
        points: ``(K, most + 1, dof)``, zero beyond a segment's own degree.
        durations: ``(K,)``.
        parameters: ``(K, n_p)``, the same in every row.
    """

    def __init__(self, shape: Shape, x: Array) -> None:
        """Evaluates the shape."""
        self.shape, self.x = shape, x
        segments, rows = len(shape.degrees), shape._rows
        flat = np.zeros(segments * rows)
        flat[shape._places] = shape._value(x[None])[0][0]
        self.points, self.durations, self.parameters = self._split(flat.reshape(segments, rows))
        self.local = np.append(x, 0.0)[shape.columns]  # (K, m): the variables of each segment

    def _split(self, values: Array) -> tuple[Array, Array, Array]:
        """Values ``(K, rows, ..)`` as those of points ``(K, most + 1, dof, ..)``, durations and parameters."""
        shape = self.shape
        number = shape._rows - 1 - shape._count
        points = values[:, :number].reshape(len(values), -1, shape.dof, *values.shape[2:])
        return points, values[:, number], values[:, number + 1 :]

    @cached_property
    def slopes(self) -> tuple[Array, Array, Array]:
        """Derivatives in the segment's variables: ``(K, most + 1, dof, m)``, ``(K, m)``, ``(K, n_p, m)``."""
        shape = self.shape
        segments, width = shape.columns.shape
        flat = np.zeros(segments * shape._rows * width)
        flat[shape._slope_places] = shape._slope(self.x[None])[0][0]
        return self._split(flat.reshape(segments, shape._rows, width))

    def bend(self, points: Array, durations: Array, parameters: Array) -> Array:
        """Nonzeros of the Hessian in x, ``bend_sparsity``, of the shape's entries times weights of its own form."""
        weights = np.concatenate([points.reshape(len(points), -1), durations[:, None], parameters], axis=1)
        return np.array(self.shape._bend(self.x[None], weights.ravel()[self.shape._places][None])[0][0])


def shape_of(problem: Problem) -> Shape:
    """The shape of a problem's curve, compiled once."""
    shape: Shape = problem.cached("shape by segment", lambda: Shape(problem))
    return shape
