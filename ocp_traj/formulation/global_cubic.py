"""The cubic spline through via points whose durations are the decision variables."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import cubic_spline_free_ends
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.knots import LONGEST, SHORTEST, least_times
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Variable
from ocp_traj.robot.joint_limits import JointLimits

SLOWER = (1.0, 1.8)  # random starts are so many times slower than a shortest motion with stops: our choice


def global_cubic(points: ArrayLike, limits: JointLimits) -> Parametrisation:
    """The C2 cubic spline through via points ``(L + 1, n)``, L >= 2, at rest in velocity and acceleration at its ends.

    One more knot in the first leg and one in the last; see ``cubic_spline_free_ends``. Every segment depends on all
    durations, the only variables.

    Raises:
        ProblemDefinitionError: where there are fewer than three via points.
    """
    where = np.asarray(points, dtype=float)
    if where.ndim != 2 or len(where) < 3 or not np.isfinite(where).all():
        raise ProblemDefinitionError(
            f"a cubic spline goes through 3 or more via points, a finite row of joints each; got shape {where.shape}: "
            "for fewer take quintic segments, whose pieces are free between them"
        )
    count = len(where) - 1
    least = least_times(where, limits)
    usual = np.concatenate([np.full(2, least[0] / 2.0), least[1:-1], np.full(2, least[-1] / 2.0)])
    legs = (range(2), *(range(i + 1, i + 2) for i in range(1, count - 1)), range(count, count + 2))

    def durations(curve: PiecewiseBezier) -> Array:
        if curve.segments != count + 2:
            raise ProblemDefinitionError(f"a curve of {curve.segments} segments was given; it has to have {count + 2}")
        return np.array(curve.durations, dtype=float)

    def total(x: Any) -> Any:
        own = x[: count + 2]  # variables may go on after the curve's
        return own.sum() if isinstance(x, np.ndarray) else casadi.sum1(own)

    labels = tuple(f"T{k + 1}" for k in range(count + 2))
    return Parametrisation(
        variables=(Variable("T", SHORTEST * usual, LONGEST * usual, "s", labels),),
        curve=lambda x: cubic_spline_free_ends(where, x),
        guess=lambda rng: usual * rng.uniform(*SLOWER, size=count + 2),
        variables_of=durations,
        dilate=lambda x, s: np.asarray(x, dtype=float) * s,
        knots=((0, 0.0), *((i + 1, 0.0) for i in range(1, count)), (-1, 1.0)),
        legs=legs,
        continuity=2,
        hull_rows=(),
        scales_in_time=True,
        duration=total,
    )
