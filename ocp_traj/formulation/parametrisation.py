"""How decision variables make a curve: what a problem with its own limits and objectives is put together from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.problem import Variable
from ocp_traj.formulation.requirements import PathConstraint, Points


@dataclass(frozen=True, eq=False)
class Parametrisation:
    """How decision variables make a curve.

    Attributes:
        variables: blocks; x is their concatenation ``(n,)``.
        curve: x -> PiecewiseBezier, of numbers or of casadi SX.
        guess: random starting point ``(n,)`` from a generator, within the bounds.
        variables_of: numeric curve of this shape -> x, the inverse of ``curve``.
        dilate: (x, s) -> x of the same path s times slower; None where given derivatives do not allow it.
        knots: where each via point is passed: segment, counted from the end where negative, and local time.
        legs: of each leg between two via points, the range of its segments.
        continuity: promised at inner knots.
        hull_rows: orders of derivatives, 0 to 4, whose limits are best held at control points (``Tuning.hull_rows``).
        scales_in_time: whether the variables are the durations of the segments and nothing else; see ``Problem``.
        duration: x -> total time [s], a number or an expression.
        limits: that the curve needs to be what it says, beside those of the problem.
        refine: (x with pieces that are some whole number of these long, that number) -> x of the same motion; None
            where the curve's pieces cut evenly give it.
        guess_along: (generator, ways) -> starting point that follows ways which are known; see ``Knots.guess``.
    """

    variables: tuple[Variable, ...]
    curve: Callable[[Any], PiecewiseBezier]
    guess: Callable[[np.random.Generator], Array]
    variables_of: Callable[[PiecewiseBezier], Array]
    dilate: Callable[[Array, float], Array] | None
    knots: Points
    legs: tuple[range, ...]
    continuity: int
    hull_rows: tuple[int, ...]
    scales_in_time: bool
    duration: Callable[[Any], Any]
    limits: tuple[PathConstraint, ...] = ()
    refine: Callable[[Array, int], Array] | None = None
    guess_along: Callable[..., Array] | None = None
