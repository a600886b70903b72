"""Limits whose constants are chosen at the state: smooth pieces of a function that has no one expression.

The distance of two convex bodies is such a function: which points, edges or faces are nearest depends on the posture,
and with these held it is a smooth expression that is equal to it there, to second order where they do not change.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.requirements import Expression, PathConstraint


@dataclass(frozen=True, eq=False)
class ChosenLimit(PathConstraint):
    """lower <= g_i(q; c_i(q)) at every instant, each row i an expression of its own with constants of its own.

    The NLP imposes it where the requirements hold the same in another form, which is what is proved: its id and labels
    are those of that form. It has many rows, few of which are near their bounds: only those are looked at closely.

    Attributes:
        expressions: one a row, of the state with ``c`` its constants; rows that share one share what is compiled.
        choose: (postures ``(N, dof)``, rows ``(N,)``) -> constants ``(N, n_c)`` of one row at each posture.
        value: (postures ``(N, dof)``, rows ``(N,)``, parameters ``(N, n_p)``) -> values ``(N,)``.
        at_least: (postures ``(N, dof)``, parameters ``(N, n_p)``) -> numbers ``(N, rows)`` that the values are not
            below, quickly.
        number: n_c.
        size: what a row is divided by in the NLP.
        within: of its size, how far above its bound a row is at a start that the first grid has.
        proved_as: label of the row of the requirements that each row belongs to.
        kernels: what was compiled of the expressions, for all problems that have the limit.
    """

    expressions: tuple[Expression, ...] = ()
    choose: Callable[[Array, Index], Array] | None = None
    value: Callable[[Array, Index, Array], Array] | None = None
    at_least: Callable[[Array, Array], Array] | None = None
    number: int = 0
    size: float = 1.0
    within: float = 1.0
    proved_as: tuple[str, ...] = ()
    kernels: dict[Hashable, Any] = field(default_factory=dict, repr=False, init=False)

    def __post_init__(self) -> None:
        """Checks that each row has an expression, and a lower bound alone."""
        super().__post_init__()
        if len(self.expressions) != len(self.labels) or None in (self.choose, self.value, self.at_least):
            raise ProblemDefinitionError(
                f"limit {self.id!r}: {len(self.expressions)} expressions for {len(self.labels)} labels; give one a "
                "row, and how their constants are chosen"
            )
        if np.isfinite(self.upper).any() or not np.isfinite(self.lower).all():
            raise ProblemDefinitionError(f"limit {self.id!r}: chosen limits are bounded below; leave upper infinite")

    @cached_property
    def scale(self) -> Array:
        """Size of each row ``(rows,)``."""
        return np.full(len(self.labels), self.size)

    def constants_at(self, q: Array, rows: Index) -> Array:
        """The constants ``(N, n_c)`` of rows ``(N,)`` at postures ``(N, dof)``."""
        assert self.choose is not None
        return self.choose(q, rows)

    def above(self, q: Array, p: Array, within: float) -> Array:
        """How far the rows' values are above their bounds ``(N, rows)``; infinite where that is certainly farther.

        Args:
            q: postures ``(N, dof)``.
            p: parameters ``(N, n_p)``.
            within: how far values are looked at, in the rows' unit.
        """
        assert self.at_least is not None and self.value is not None
        at, rows = np.nonzero(self.at_least(q, p) - self.lower < within)
        found = np.full((len(q), len(self.labels)), np.inf)
        if len(at):
            found[at, rows] = self.value(q[at], rows, p[at]) - self.lower[rows]
        return found


def rows_proved_as(limit: PathConstraint, label: str) -> tuple[int, ...]:
    """The rows of a limit that a row of an audit is about."""
    labels = limit.proved_as if isinstance(limit, ChosenLimit) else limit.labels
    return tuple(i for i, own in enumerate(labels) if own == label)
