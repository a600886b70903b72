"""Rows of a limit whose constants are chosen at the state: chosen anew at each x, for all rows together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.instant_values import InstantValues, lines, moved_places
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.kernel import Kernel, chosen_kernel, linear_kernel
from ocp_traj.transcription.shape import Shape, ShapeAt, shape_of


class ChosenValues(InstantValues):
    """One row an instant of a limit whose constants are chosen at the state.

    Args:
        shape, kernel, segments, u, slopes: as of ``InstantValues``; the kernel is of all these rows.
        limit: whose rows.
        rows: of each instant ``(N,)``.
    """

    def __init__(
        self, shape: Shape, kernel: Kernel, segments: Index, u: Array, limit: ChosenLimit, rows: Index,
        slopes: Array | None = None,
    ) -> None:  # fmt: skip
        super().__init__(shape, kernel, segments, u, slopes=slopes)
        self.limit, self.rows = limit, rows
        self.together: _Together | None = None

    def constants_at(self, shape: ShapeAt, q: Array) -> Array:
        """The constants ``(N, n_c)`` at one x, where the postures are ``(N, dof)``."""
        if self.together is not None:
            return self.together.constants_at(shape)[id(self)]
        return self.limit.constants_at(q, self.rows)

    def linear(self, problem: Problem, shape: ShapeAt) -> InstantValues:
        """The rows to first order in the joints and the parameters, about those at one x."""
        at = self.at(shape)
        slopes = at.slopes_in_posture
        place = np.concatenate([self.postures(shape), shape.parameters[self.segments]], axis=1)
        rest = at.values[:, :1] - (slopes * place).sum(axis=1, keepdims=True)
        constants = np.concatenate([rest, slopes], axis=1)
        return InstantValues(
            self.shape, linear_kernel(problem), self.segments, self.u, slopes=self.slopes, constants=constants
        )

    def postures(self, shape: ShapeAt) -> Array:
        """The postures ``(N, dof)`` at one x."""
        u, _ = moved_places(self.u, self.slopes, shape.local[self.segments])
        basis = self.basis(u, 0) if self.fixed_basis is None else self.fixed_basis[:, :1]
        return np.asarray((basis @ shape.points[self.segments])[:, 0])


class _Together:
    """Rows of a limit with different kernels, whose constants are chosen in one go: that is where the time goes."""

    def __init__(self, members: Sequence[ChosenValues]) -> None:
        self._members = members
        self._rows = np.concatenate([member.rows for member in members])
        self._at: tuple[ShapeAt, dict[int, Array]] | None = None

    def constants_at(self, shape: ShapeAt) -> dict[int, Array]:
        if self._at is None or self._at[0] is not shape:
            q = np.concatenate([member.postures(shape) for member in self._members])
            found = self._members[0].limit.constants_at(q, self._rows)
            ends = np.cumsum([len(member.rows) for member in self._members])[:-1]
            parts = np.split(found, ends)
            self._at = shape, {id(member): part for member, part in zip(self._members, parts, strict=True)}
        return self._at[1]


def chosen_values(
    problem: Problem, limit: ChosenLimit, rows: Sequence[int], instants: Sequence[Instant]
) -> list[tuple[Index, ChosenValues]]:
    """Rows of a chosen limit, one an instant: places among these, and the values there, a kernel each."""
    shape = shape_of(problem)
    alike: dict[object, list[int]] = {}
    for i, row in enumerate(rows):
        alike.setdefault(limit.expressions[row], []).append(i)
    found = []
    for places in alike.values():
        some = [instants[i] for i in places]
        segments = np.array([instant.segment for instant in some], dtype=np.intp)
        u, slopes = lines(shape, some, [(i.u, i.slope) for i in some])
        kernel, own = chosen_kernel(problem, limit, rows[places[0]]), np.array([rows[i] for i in places], dtype=np.intp)
        found.append((np.array(places, dtype=np.intp), ChosenValues(shape, kernel, segments, u, limit, own, slopes)))
    together = _Together([values for _, values in found])
    for _, values in found:
        values.together = together
    return found
