"""Time derivatives of single joints at instants: what limits on derivatives are made of, all of them together.

A limit on the m-th derivative of joint j is D^m / T^m at its instant, with D^m the derivative in local time; or, for a
control point of that derivative in place of its value, the same with another row of weights. ``instant_values`` has the
formulas; with Z = (D^m, T) they need no compiled function.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import derivative_basis, difference_matrix
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.hessian_sum import HessianSum
from ocp_traj.transcription.instant_values import BySegment, lines, moved_places
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.shape import ShapeAt, shape_of

AT_ONCE = 1024  # instants whose control points' slopes are gathered together: of all, they would not fit into a cache


class DerivativeValues(BySegment):
    """Time derivatives of joints at instants, one value an instant.

    Args:
        problem: whose curve.
        entries: (order, joint, instant) of each value.
    """

    def __init__(self, problem: Problem, entries: Sequence[tuple[int, int, Instant]]) -> None:
        """Collects the places."""
        self.shape = shape_of(problem)
        self.order, self.joint = (np.array([e[i] for e in entries], dtype=np.intp) for i in (0, 1))
        instants = [instant for _, _, instant in entries]
        self.segments = np.array([i.segment for i in instants], dtype=np.intp)
        self.u, self.slopes = lines(self.shape, instants, [(i.u, i.slope) for i in instants])
        self._control = np.array([-1 if i.control is None else i.control for i in instants], dtype=np.intp)

    def depends(self) -> NDArray[np.bool_]:
        """Which of its segment's variables a value depends on: ``(N, 1, m)``."""
        pattern = self.shape.depends[self.segments]
        found = pattern[np.arange(len(self.joint)), self.joint] | (
            pattern[:, self.shape.dof] & (self.order > 0)[:, None]
        )
        return np.asarray((found if self.slopes is None else found | (self.slopes != 0.0))[:, None])

    def at(self, shape: ShapeAt, slopes: bool = False) -> DerivativeValuesAt:
        """The values at one x; their ``slopes`` are as cheap later."""
        return DerivativeValuesAt(self, shape)

    @cached_property
    def fixed_weights(self) -> Array | None:
        """The weights of instants that do not move, computed once."""
        return None if self.slopes is not None else self.weights(np.clip(self.u, 0.0, 1.0), 0)

    def weights(self, u: Array, more: int) -> Array:
        """What takes a joint's control points to D^m .. D^(m + more) ``(N, more + 1, most + 1)``."""
        degrees = self.shape.degrees[self.segments]
        found = np.zeros((len(u), more + 1, int(self.shape.degrees.max()) + 1))
        for degree in np.unique(degrees).tolist():
            here = np.nonzero(degrees == degree)[0]
            basis = derivative_basis(degree, u[here], int(self.order[here].max()) + more)
            for extra in range(more + 1):
                found[here, extra, : degree + 1] = basis[np.arange(len(here)), self.order[here] + extra]
        hull = self._control >= 0
        found[hull] = 0.0
        for degree, order in set(zip(degrees[hull].tolist(), self.order[hull].tolist(), strict=True)):
            here = np.nonzero(hull & (degrees == degree) & (self.order == order))[0]
            found[here, 0, : degree + 1] = difference_matrix(degree, order)[self._control[here]]
        return found


class DerivativeValuesAt:
    """Time derivatives of joints at instants and at one x.

    Attributes:
        values: ``(N, 1)``.
    """

    def __init__(self, of: DerivativeValues, shape: ShapeAt) -> None:
        """Evaluates them."""
        self.of, self._shape = of, shape
        segments = of.segments
        self._u, self._slopes = moved_places(of.u, of.slopes, shape.local[segments])
        fixed = of.fixed_weights
        self._weights = of.weights(self._u, 2) if fixed is None else fixed
        self._points = shape.points[segments, :, of.joint]  # (N, most + 1)
        self._derivatives = (self._weights @ self._points[:, :, None])[:, :, 0]  # (N, 1 or 3)
        self._duration = shape.durations[segments]
        self._factor: Array = self._duration ** -of.order.astype(float)
        self.values: Array = (self._derivatives[:, 0] * self._factor)[:, None]

    @cached_property
    def _parts(self) -> tuple[Array, Array]:
        """D^m in the segment's variables, instants moving as they do, and the duration ``(N, m)`` each."""
        points, durations, _ = self._shape.slopes
        segments = self.of.segments
        moved = np.empty((len(segments), points.shape[-1]))
        for begin in range(0, len(segments), AT_ONCE):
            here = slice(begin, begin + AT_ONCE)
            own = points[segments[here], :, self.of.joint[here]]
            np.einsum("nk,nkm->nm", self._weights[here, 0], own, out=moved[here])
        if self._slopes is not None:
            moved = moved + self._derivatives[:, 1:2] * self._slopes
        return moved, durations[segments]

    @property
    def _of_duration(self) -> Array:
        """dV/dT at fixed D^m ``(N,)``."""
        return np.asarray(-self.of.order * self.values[:, 0] / self._duration)

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of the values in the segment's variables ``(N, 1, m)``."""
        derivative, duration = self._parts
        return np.asarray(self._factor[:, None] * derivative + self._of_duration[:, None] * duration)[:, None]

    def add_curvature(self, total: HessianSum, weights: Array) -> None:
        """Adds the second derivatives of the sum of the values times weights ``(N, 1)``."""
        of, shape, weight = self.of, self._shape, weights[:, 0]
        derivative, duration = self._parts
        order, factor = of.order, self._factor * weight
        cross = -order * factor / self._duration
        twice = order * (order + 1) * self._derivatives[:, 0] * factor / self._duration**2
        # Of a symmetric sum a half, to which its mirror is added; a segment's instants share its duration.
        left = np.zeros(shape.slopes[1].shape)
        of.add_by_segment(left, cross[:, None] * derivative + 0.5 * twice[:, None] * duration)
        half = left[:, :, None] * shape.slopes[1][:, None, :]
        if self._slopes is not None:
            points = shape.slopes[0][of.segments, :, of.joint]
            a = (self._weights[:, None, 1] @ points)[:, 0] + 0.5 * self._derivatives[:, 2:] * self._slopes
            of.add_products(half, (factor[:, None] * a)[:, None], self._slopes[:, None])
        total.local += half + np.swapaxes(half, 1, 2)
        spread = np.zeros((len(weight), total.points.shape[1], of.shape.dof))
        spread[np.arange(len(weight)), :, of.joint] = factor[:, None] * self._weights[:, 0]
        of.add_by_segment(total.points, spread)
        of.add_by_segment(total.durations, weight * self._of_duration)
