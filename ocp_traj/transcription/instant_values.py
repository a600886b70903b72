"""A function at instants of a problem's curve: its values, and how they change with the variables of each segment.

With Z what the function depends on (see ``kernel``), V its value, D^m the m-th derivative of the joints in local time
and u(x), s(x) the instant's local time and sweep,

    dZ = Z_x dx + Z_u du + Z_s ds,
    V'' = Z'^T V_ZZ Z' + (a u'^T + u' a^T) + c u' u'^T + sum_Z V_Z Z_xx,
    a = sum V_D dD^(m+1)/dx,  c = sum V_D D^(m+2),

where Z_xx is the bend of the curve's own shape in x and is summed for all instants of a segment together.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import derivative_basis
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.transcription.hessian_sum import HessianSum
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.kernel import First, Kernel, limit_kernel
from ocp_traj.transcription.shape import Shape, ShapeAt, shape_of


class Peak(NamedTuple):
    """Derivatives of a weighted sum of rows in local time u, sweep s and the segment's variables x.

    Attributes:
        u, s, uu, us, ss: ``(N,)``.
        ux, sx: ``(N, m)``.
    """

    u: Array
    s: Array
    uu: Array
    us: Array
    ss: Array
    ux: Array
    sx: Array


class BySegment:
    """Numbers of instants, to be summed by the segment they are on.

    Attributes:
        segments: of each instant ``(N,)``.
    """

    segments: Index

    @cached_property
    def _runs(self) -> tuple[Index, Index, Index]:
        """The order of instants by segment, where each segment begins in it, and the segments."""
        order = np.argsort(self.segments, kind="stable")
        segments, starts = np.unique(self.segments[order], return_index=True)
        return order, starts, segments

    def add_by_segment(self, total: Array, values: Array) -> None:
        """Adds values of the instants ``(N, ..)`` to those of their segments ``(K, ..)``."""
        order, starts, segments = self._runs
        if len(order):
            total[segments] += np.add.reduceat(values[order], starts)

    def add_products(self, total: Array, left: Array, right: Array) -> None:
        """Adds left^T right of the instants ``(N, a, m)`` each, to the sums of their segments ``(K, m, m)``."""
        order, starts, segments = self._runs
        if not len(order):
            return
        counts = np.diff(np.append(starts, len(order)))
        most = int(counts.max())
        if (counts == most).all():
            some = order.reshape(len(segments), most)
            a, b = left[some], right[some]
        else:  # segments with fewer instants get some of no weight
            inside = np.arange(most) < counts[:, None]
            some = order[np.minimum(starts[:, None] + np.arange(most), len(order) - 1)]
            a, b = np.where(inside[:, :, None, None], left[some], 0.0), right[some]
        shape = (len(segments), most * left.shape[1], left.shape[2])
        total[segments] += np.swapaxes(a.reshape(shape), 1, 2) @ b.reshape(shape)


class InstantValues(BySegment):
    """A function at instants.

    Args:
        shape: of the curve.
        kernel: of the function.
        segments: of each instant ``(N,)``.
        u: local times ``(N,)`` at x = 0: u(x) = clip(u + slopes x, 0, 1).
        sweep: places along the sweep, likewise; None where the function has none.
        slopes, sweep_slopes: in the variables of each segment ``(N, m)``; None where no instant moves.
        constants: of each instant ``(N, n_c)``.
        control: which control points of the derivative take the place of its value at u ``(N,)``; None for values.
    """

    def __init__(
        self, shape: Shape, kernel: Kernel, segments: Index, u: Array, sweep: Array | None = None,
        slopes: Array | None = None, sweep_slopes: Array | None = None, constants: Array | None = None,
    ) -> None:  # fmt: skip
        self.shape, self.kernel = shape, kernel
        self.segments = segments
        self.u, self.sweep, self.slopes, self.sweep_slopes = u, sweep, slopes, sweep_slopes
        self.constants = np.zeros((len(self.segments), 0)) if constants is None else constants

    @classmethod
    def of(cls, problem: Problem, name: str, instants: Sequence[Instant]) -> InstantValues:
        """A limit, integrand or total variation of a problem at its instants."""
        shape = shape_of(problem)
        kernel = limit_kernel(problem, name)
        segments = np.array([instant.segment for instant in instants], dtype=np.intp)
        limit = next((c for c in problem.requirements.path_constraints if c.id == name), None)
        of = limit or next((o for o in problem.objectives if o.id == name), None)
        table = None if of is None else of.constants
        u, slopes = lines(shape, instants, [(i.u, i.slope) for i in instants])
        along, sweep_slopes = lines(shape, instants, [(i.sweep, i.sweep_slope) for i in instants])
        return cls(
            shape, kernel, segments, u, along if limit is not None and limit.sweep else None, slopes, sweep_slopes,
            None if table is None else table[segments],
        )  # fmt: skip

    def constants_at(self, shape: ShapeAt, q: Array) -> Array:
        """The constants ``(N, n_c)`` at one x, where the postures are ``(N, dof)``."""
        return self.constants

    def depends(self) -> NDArray[np.bool_]:
        """Which rows of the function depend on which of its segment's variables: ``(N, rows, m)``."""
        pattern = self.shape.depends[self.segments]  # (N, dof + 1 + n_p, m)
        fixed = np.asarray(np.einsum("rj,njm->nrm", self.kernel.depends * 1.0, pattern * 1.0) > 0.0)
        for slopes in (self.slopes, self.sweep_slopes):
            if slopes is not None:
                fixed |= (slopes != 0.0)[:, None, :]
        return fixed

    def at(self, shape: ShapeAt, slopes: bool = False) -> InstantValuesAt:
        """The values at one x, together with their derivatives where those will be wanted."""
        return InstantValuesAt(self, shape, slopes=slopes)

    @cached_property
    def fixed_basis(self) -> Array | None:
        """The basis of instants that do not move, computed once."""
        if self.slopes is not None:
            return None
        return self.basis(np.clip(self.u, 0.0, 1.0), max(self.kernel.orders, default=0))

    @cached_property
    def _by_degree(self) -> list[tuple[int, slice | Index]]:
        """Instants by the degree of their segments."""
        degrees = self.shape.degrees[self.segments]
        distinct = np.unique(degrees).tolist()
        if len(distinct) == 1:
            return [(distinct[0], slice(None))]
        return [(degree, np.nonzero(degrees == degree)[0]) for degree in distinct]

    def basis(self, u: Array, top: int) -> Array:
        """What takes control points to derivatives in local time of order 0 .. ``top``: ``(N, top + 1, most + 1)``."""
        found = np.zeros((len(u), top + 1, int(self.shape.degrees.max()) + 1))
        for degree, here in self._by_degree:
            found[here, :, : degree + 1] = derivative_basis(degree, u[here], top)
        return found


class InstantValuesAt:
    """A function at instants and at one x; derivatives are computed on first use.

    Attributes:
        values: ``(N, rows)``.
    """

    def __init__(
        self, of: InstantValues, shape: ShapeAt, u: Array | None = None, sweep: Array | None = None,
        slopes: bool = False,
    ) -> None:  # fmt: skip
        """Evaluates the function, at other places than the instants' own where they are given."""
        self.of, self.shape = of, shape
        segments, kernel = of.segments, of.kernel
        local = shape.local[segments]
        self.u, self._u_slopes = moved_places(of.u, of.slopes, local) if u is None else (u, None)
        self.sweep, self._sweep_slopes = (None, None)
        if of.sweep is not None:
            moved = moved_places(of.sweep, of.sweep_slopes, local)
            self.sweep, self._sweep_slopes = moved if sweep is None else (sweep, None)
        top = max(kernel.orders, default=0)
        fixed = of.fixed_basis if u is None else None
        self._basis = of.basis(self.u, top) if fixed is None else fixed
        self._points = shape.points[segments]
        derivatives = self._basis @ self._points  # (N, top + 1, dof)
        states = np.zeros((len(segments), len(ORDERS), of.shape.dof))
        states[:, : top + 1] = derivatives
        place = self.u[:, None] if self.sweep is None else np.stack([self.u, self.sweep], axis=1)
        self._arguments = (
            states.reshape(len(segments), -1), shape.durations[segments][:, None], place, shape.parameters[segments],
            of.constants_at(shape, derivatives[:, 0]),
        )  # fmt: skip
        self.values = self._first.values if slopes else kernel.values(self._arguments)

    @cached_property
    def _first(self) -> First:
        return self.of.kernel.first(self._arguments)

    @cached_property
    def slopes_in_posture(self) -> Array:
        """Derivatives of the first row in q and the parameters ``(N, dof + n_p)``, of a function of these alone."""
        kernel, dof = self.of.kernel, self.of.shape.dof
        found, known = np.zeros((len(self.u), dof + self.shape.parameters.shape[1])), self._first.slopes
        if 0 in kernel.orders:
            found[:, :dof] = known[:, 0, :dof]
        found[:, dof:][:, : kernel.parameters.stop - kernel.parameters.start] = known[:, 0, kernel.parameters]
        return found

    @cached_property
    def _further(self) -> tuple[Array, Array]:
        """The basis two orders higher, and derivatives in local time with it."""
        raised = self.of.basis(self.u, max(self.of.kernel.orders, default=0) + 2)
        return raised, raised @ self._points

    @cached_property
    def _fixed(self) -> Array:
        """Z_x ``(N, a, m)``, instants held where they are."""
        kernel, segments = self.of.kernel, self.of.segments
        points, durations, parameters = self.shape.slopes
        count, width = len(segments), durations.shape[1]
        moved = np.zeros((count, kernel.size, width))
        if kernel.orders:
            weights = self._basis[:, kernel.orders, :]  # (N, orders, most + 1)
            flat = points.reshape(len(points), points.shape[1], -1)[segments]  # (N, most + 1, dof m)
            moved[:, : len(kernel.orders) * self.of.shape.dof] = (weights @ flat).reshape(count, -1, width)
        moved[:, kernel.duration] = durations[segments][:, None, :] if kernel.duration != slice(0) else 0.0
        moved[:, kernel.parameters] = parameters[segments][:, : kernel.parameters.stop - kernel.parameters.start]
        return moved

    @cached_property
    def _along(self) -> Array:
        """Z_u ``(N, a)``."""
        kernel = self.of.kernel
        moved = np.zeros((len(self.u), kernel.size))
        if kernel.orders:
            raised = self._further[1][:, np.array(kernel.orders) + 1]
            moved[:, : raised[0].size] = raised.reshape(len(moved), -1)
        moved[:, kernel.time] = 1.0
        return moved

    @cached_property
    def _across(self) -> Array:
        """Z_s ``(N, a)``."""
        moved = np.zeros((len(self.u), self.of.kernel.size))
        moved[:, self.of.kernel.sweep] = 1.0
        return moved

    @cached_property
    def _whole(self) -> Array:
        """dZ/dx ``(N, a, m)``, instants moving as they do."""
        whole = self._fixed
        if self._u_slopes is not None:
            whole = whole + self._along[:, :, None] * self._u_slopes[:, None, :]
        if self._sweep_slopes is not None:
            whole = whole + self._across[:, :, None] * self._sweep_slopes[:, None, :]
        return whole

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of the values in the segment's variables ``(N, rows, m)``."""
        return self._first.slopes @ self._whole

    def add_curvature(self, total: HessianSum, weights: Array) -> None:
        """Adds the second derivatives of the sum of the values times weights ``(N, rows)``."""
        of, kernel = self.of, self.of.kernel
        gradient, bend = kernel.second(self._arguments, weights, self._first)
        of.add_products(total.local, self._whole, bend @ self._whole)
        if self._u_slopes is not None:
            a, c = self._raised(gradient)
            sides = np.zeros_like(total.local)
            of.add_products(sides, (a + 0.5 * c[:, None] * self._u_slopes)[:, None], self._u_slopes[:, None])
            total.local += sides + np.swapaxes(sides, 1, 2)
        if kernel.orders:
            spread = np.swapaxes(self._basis[:, kernel.orders], 1, 2) @ self._of_states(gradient)
            of.add_by_segment(total.points, spread)
        if kernel.duration.stop > kernel.duration.start:
            of.add_by_segment(total.durations, gradient[:, kernel.duration.start])
        if kernel.parameters.stop > kernel.parameters.start:
            of.add_by_segment(total.parameters, gradient[:, kernel.parameters])

    def _of_states(self, gradient: Array) -> Array:
        """The part of a gradient in Z that belongs to derivatives of the joints ``(N, orders, dof)``."""
        number = len(self.of.kernel.orders) * self.of.shape.dof
        return gradient[:, :number].reshape(len(gradient), -1, self.of.shape.dof)

    def _raised(self, gradient: Array) -> tuple[Array, Array]:
        """Sum V_D dD^(m+1)/dx ``(N, m)`` and sum V_D D^(m+2) ``(N,)``, for a gradient in Z ``(N, a)``."""
        kernel, segments = self.of.kernel, self.of.segments
        points = self.shape.slopes[0]
        width = points.shape[-1]
        if not kernel.orders:
            return np.zeros((len(segments), width)), np.zeros(len(segments))
        raised, derivatives = self._further
        orders, of_states = np.array(kernel.orders), self._of_states(gradient)
        weights = np.swapaxes(raised[:, orders + 1], 1, 2) @ of_states  # (N, most + 1, dof)
        flat = points.reshape(len(points), -1, width)[segments]
        a = (weights.reshape(len(segments), 1, -1) @ flat)[:, 0]
        return a, (of_states * derivatives[:, orders + 2]).sum(axis=(1, 2))

    def peak(self, weights: Array) -> Peak:
        """Derivatives in local time, sweep and variables of the sum of the values times weights ``(N, rows)``."""
        gradient, bend = self.of.kernel.second(self._arguments, weights)
        a, c = self._raised(gradient)
        bent = [(bend @ z[:, :, None])[:, :, 0] for z in (self._along, self._across)]

        def against(values: Array, other: Array) -> Array:
            return np.asarray((values * other).sum(axis=1))

        return Peak(
            against(gradient, self._along), against(gradient, self._across),
            against(bent[0], self._along) + c, against(bent[0], self._across), against(bent[1], self._across),
            (bent[0][:, None, :] @ self._fixed)[:, 0] + a, (bent[1][:, None, :] @ self._fixed)[:, 0],
        )  # fmt: skip


def moved_places(start: Array, slopes: Array | None, local: Array) -> tuple[Array, Array | None]:
    """Places clipped to [0, 1] at variables ``(N, m)``, and how they move there."""
    if slopes is None:
        return np.clip(start, 0.0, 1.0), None
    places = start + (slopes * local).sum(axis=1)
    inside = (places > 0.0) & (places < 1.0)
    return np.clip(places, 0.0, 1.0), slopes * inside[:, None]


def lines(
    shape: Shape, instants: Sequence[Instant], places: Sequence[tuple[float, Array | None]]
) -> tuple[Array, Array | None]:
    """Places of instants at x = 0 ``(N,)`` and their slopes in the segments' variables, None where none has any."""
    start = np.array([place for place, _ in places], dtype=float)
    if all(slope is None or i.anchor is None for i, (_, slope) in zip(instants, places, strict=True)):
        return start, None
    slopes, anchors = np.zeros((2, len(places), shape.columns.shape[1]))
    for j, (instant, (_, slope)) in enumerate(zip(instants, places, strict=True)):
        if slope is not None and instant.anchor is not None:
            used = np.flatnonzero(slope)
            own, columns = shape.columns[instant.segment], used if instant.columns is None else instant.columns[used]
            at = np.searchsorted(own[own < shape.size], columns)
            if not np.isin(columns, own).all():
                raise ProblemDefinitionError(
                    f"an instant on segment {instant.segment} moves with variables that the segment does not depend on"
                )
            slopes[j, at], anchors[j, at] = slope[used], instant.anchor[used]
            start[j] -= float(slopes[j] @ anchors[j])
    return start, slopes
