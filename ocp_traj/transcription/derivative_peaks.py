"""Where derivatives of the joints turn near their limits: instants that hold a motion where it may go next."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import difference_matrix, turning_values
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.shape import shape_of


def derivative_peaks(problem: Problem, x: Array, share: float) -> list[Instant]:
    """Turning points, inside segments, at which a derivative is above a share of its limit.

    Args:
        problem: whose.
        x: where ``(n,)``.
        share: of a limit, from which on a point counts.
    """
    shape, found = shape_of(problem).at(x), []
    for limit in problem.requirements.path_constraints:
        for k, degree in enumerate(shape.shape.degrees.tolist()):
            if not limit.order or degree <= limit.order or not limit.holds_on(k):
                continue
            slopes = difference_matrix(degree, limit.order) @ shape.points[k, : degree + 1]
            times, values = turning_values(slopes / shape.durations[k] ** limit.order)
            with np.errstate(divide="ignore", invalid="ignore"):  # of a side without a bound, or at zero
                near = np.maximum(values / limit.upper, values / limit.lower) > share
            inside = (times > 0.0) & (times < 1.0)
            found += [Instant(limit.id, k, float(times[i, j]), (j,)) for i, j in np.argwhere(near & inside).tolist()]
    return found
