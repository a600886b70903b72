"""Coordinates about a trajectory that keeps its limits, in which a step of one goes about as far as limits allow.

Where limits leave a narrow tube (a torch within 0.04 mm of its seam) hardly a random step of the variables stays in it.
To first order the ellipsoid |z| <= 1 of x = x_0 + B z keeps every limit (Dikin 1967, Soviet Math. Dokl. 8: B B' is the
inverse of J' D^-2 J, with J the slopes of all rows and D what they have left at x_0), and its axes are the columns of
B: long ones along the tube, short ones across it. The tube bends, so each is cut to where a step along it alone still
keeps the limits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse import csc_matrix

from ocp_traj.arrays import Array
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.transcription.transcription import transcribe

LEAST = 1e-3  # of a row's scale, or a variable's range: what is left of it is taken for no less; our choice
STEPS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # along an axis, as it is without the bend: our choice
FARTHEST = 10.0  # of a variable's range, an axis at most: else rounding makes it long where nothing limits it


class LocalFrame:
    """Coordinates z about a trajectory, of which those within +-1 are searched.

    Args:
        problem: whose limits.
        population: at whose instants they are looked at.
        reference: x_0 ``(n,)``.
        box: lower and upper bounds of x ``(n,)``, all finite.
        fixed: variables ``(n,)`` that stay as they are.
        tolerance: excess that is overlooked, in units of a limit's scale.

    Attributes:
        reference: x_0.
        size: of z.
        directions: B ``(n, size)``.
        reach: of each axis ``(size,)``, by which it is longer than that of Dikin's ellipsoid, or shorter.
    """

    def __init__(
        self, problem: Problem, population: Population, reference: Array, box: tuple[Array, Array],
        fixed: NDArray[np.bool_], tolerance: float = 0.0,
    ) -> None:  # fmt: skip
        """Takes the slopes of all rows at the reference apart; see the class."""
        self.reference, (self.lower, self.upper) = np.asarray(reference, dtype=float), box
        free = ~fixed & (self.upper > self.lower)
        slopes, low, high = _rows(problem, population, self.reference)
        values, extent = population.rows(self.reference)[0], (self.upper - self.lower)[free]
        left = np.maximum(np.minimum(high - values, values - low), LEAST)
        own = np.minimum(self.upper - self.reference, self.reference - self.lower)[free]
        # Variables in units of their ranges: what no row limits is limited by these.
        scaled = slopes[:, free] * (extent / left[:, None])
        bounds = np.diag(extent / np.maximum(own, LEAST * extent))
        (triangle,) = qr(np.concatenate([scaled, bounds]), mode="r", overwrite_a=True, check_finite=False)
        _, sizes, axes = np.linalg.svd(triangle[: len(bounds)])  # as of the whole: rows are many, variables few
        sizes = np.maximum(sizes, 1.0 / FARTHEST)
        self.size = len(sizes)
        self.directions, self._back = np.zeros((problem.size, self.size)), np.zeros((self.size, problem.size))
        self.directions[free], self._back[:, free] = extent[:, None] * (axes.T / sizes), sizes[:, None] * axes / extent
        self.reach = self._reach(population, tolerance)
        self.directions *= self.reach
        self._back /= self.reach[:, None]

    def x(self, z: Array) -> Array:
        """Decision vectors ``(N, n)`` of coordinates ``(N, size)``, within their bounds."""
        return np.clip(self.reference + z @ self.directions.T, self.lower, self.upper)

    def z(self, x: Array) -> Array:
        """Coordinates ``(N, size)`` of decision vectors ``(N, n)``."""
        return np.asarray((x - self.reference) @ self._back.T)

    def _reach(self, population: Population, tolerance: float) -> Array:
        """Of each axis ``(size,)`` the longest of ``STEPS`` to one side that keeps the limits, as those before do."""
        kept = np.ones((2, self.size), dtype=bool)
        reach = np.full(self.size, STEPS[0])
        for step in STEPS:
            for side, sign in zip(kept, (1.0, -1.0), strict=True):
                some = np.flatnonzero(side)
                if len(some):
                    there = self.x(sign * step * np.eye(self.size)[some])
                    side[some] = (population.evaluate(there).violations <= tolerance).all(axis=1)
            reach[kept.any(axis=0)] = step
        return reach


def _rows(problem: Problem, population: Population, x: Array) -> tuple[Array, Array, Array]:
    """Slopes ``(m, n)`` and bounds ``(m,)`` of the rows at a population's instants, in the limits' scales."""
    nlp = transcribe(problem, WeightedSum({population.names[0]: 1.0}), population.instants, 0.0)
    limits = {limit.id for limit in problem.requirements.path_constraints}
    own = np.array([row.limit in limits and not row.defines for row in nlp.rows], dtype=bool)
    sparsity = nlp.program.jacobian_sparsity
    places = np.array(sparsity.row()), np.array(sparsity.colind())
    full = csc_matrix((nlp.program.jacobian(nlp.start(x)), *places), (nlp.program.rows, nlp.program.size))
    return full[:, : problem.size].toarray()[own], nlp.lower_g[own], nlp.upper_g[own]
