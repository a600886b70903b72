"""The decision variables of a curve that is there: an earlier result as a start, also one of fewer pieces."""

from __future__ import annotations

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.levels import cut
from ocp_traj.formulation.parametrisation import Parametrisation


def variables_of(made: Parametrisation, curve: PiecewiseBezier) -> Array:
    """The decision vector ``(n,)`` of a numeric curve; where it has fewer pieces a leg, they are cut evenly.

    What the parametrisation holds fixed, such as its via points, stays: of the curve only what is variable is read.

    Raises:
        ProblemDefinitionError: where neither the curve nor its pieces cut have the right number of segments.
    """
    sizes = {len(leg) for leg in made.legs}
    waits = _segments(made) - sum(len(leg) for leg in made.legs)
    pieces, left = divmod(curve.segments - waits, len(made.legs))
    even = len(sizes) == 1 and made.refine is None and left == 0 and 0 < pieces < max(sizes)
    if not even or max(sizes) % pieces:
        return made.variables_of(curve)
    legs, begin = [], 0
    for i, leg in enumerate(made.legs):
        begin += leg.start - (made.legs[i - 1].stop if i else 0)  # dwells before it
        legs.append(range(begin, begin + pieces))
        begin += pieces
    return made.variables_of(cut(curve, max(sizes) // pieces, tuple(legs)))


def _segments(made: Parametrisation) -> int:
    """How many segments its curves have: the last leg ends them."""
    return made.legs[-1].stop
