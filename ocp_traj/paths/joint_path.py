"""A path through joint space: a curve over a parameter of its own, of which a time law makes a motion.

Points are joined by a spline over chord length, ends not-a-knot, as ``scipy.interpolate`` has it: C2 cubics, or C4
quintics for motions with limits on snap, whose paths have to be C3. A curve keeps its own parameter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PPoly, make_interp_spline

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError, quoted

SAME = 1e-9  # of the path's length: points this close together are one, given twice
SMOOTH = 1e-9  # of a derivative's largest value: a jump below it is rounding
DEGREES = (3, 5)  # of splines


@dataclass(frozen=True, eq=False)
class JointPath:
    """A path.

    Attributes:
        curve: over the path's parameter, its ``durations`` the parameter's steps from point to point.
        joints: one name a joint.
        continuity: derivatives in the parameter, 0 to 4, that do not jump at the points.
    """

    curve: PiecewiseBezier
    joints: tuple[str, ...]
    continuity: int

    @property
    def points(self) -> Array:
        """Where the segments of the curve meet, ends included ``(L + 1, dof)``."""
        segments = self.curve.control_points
        return np.array([segments[0][0], *(points[-1] for points in segments)])

    @classmethod
    def through(
        cls, points: ArrayLike, joints: Sequence[str], *, degree: int = 3, places: Sequence[str] = ()
    ) -> JointPath:
        """The spline through points ``(L + 1, dof)`` over chord length.

        Args:
            points: two or more; not-a-knot ends take ``degree + 1``: through fewer goes the one polynomial of least
                degree, such as a line through two.
            joints: one name a joint.
            degree: 3 or 5: continuous up to the 2nd or 4th derivative.
            places: what messages call the points; their numbers, counted from 1, by default.

        Raises:
            InputError: names the points that do not fit.
        """
        where = np.asarray(points, dtype=float)
        if where.ndim != 2 or where.shape[1:] != (len(joints),) or not np.isfinite(where).all():
            raise InputError(
                f"the points of a path are of shape {where.shape}; give a finite row for each, of {len(joints)} joints"
            )
        if degree not in DEGREES:
            raise InputError(f"a path of degree {degree}; give {' or '.join(map(str, DEGREES))}")
        if len(where) < 2:
            raise InputError(f"a path needs 2 points or more; got {len(where)}; give more")
        chords = np.linalg.norm(np.diff(where, axis=0), axis=1)
        for i in np.flatnonzero(~(chords > SAME * chords.sum())).tolist():
            one, two = (places[k] if places else f"point {k + 1}" for k in (i, i + 1))
            raise InputError(f"{one} and {two} of the path are the same; leave one of them out")
        at = np.append(0.0, np.cumsum(chords))
        if degree == 3:
            return cls(PiecewiseBezier.from_ppoly(CubicSpline(at, where, bc_type="not-a-knot")), tuple(joints), 2)
        low = min(degree, len(where) - 1)
        spline = make_interp_spline(at, where, k=low)
        powers = [spline(at[:-1], nu) / factorial(nu) for nu in range(low, -1, -1)]
        return cls(PiecewiseBezier.from_ppoly(PPoly(np.array(powers), at)), tuple(joints), degree - 1)

    @classmethod
    def of_curve(cls, curve: PiecewiseBezier, joints: Sequence[str]) -> JointPath:
        """The geometry of a curve of numbers, which keeps its parameter: of a motion, its time."""
        if curve.dof != len(joints):
            raise InputError(f"the curve has {curve.dof} joints; the path's are {quoted(list(joints))}")
        order = 0
        while order < 5 and _is_continuous(curve, order):
            order += 1
        if order == 0:
            raise InputError("the curve jumps at a knot; a path has to be continuous")
        return cls(curve, tuple(joints), order - 1)


def _is_continuous(curve: PiecewiseBezier, order: int) -> bool:
    if curve.segments == 1:
        return True
    size = np.max([np.abs(curve.hodograph(k, order)).max(axis=0) for k in range(curve.segments)], axis=0)
    # What rounding of control points leaves of a derivative, whose weights are up to 2^m n^m over T^m.
    largest = max(float(np.abs(points).max()) for points in curve.control_points)
    noise = 1e-15 * (2.0 * max(curve.degrees) / float(curve.durations.min())) ** order * largest
    return bool((np.abs(curve.jump(order)) <= SMOOTH * size + noise).all())
