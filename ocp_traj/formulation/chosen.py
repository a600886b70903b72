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
        at_least: (postures ``(N, dof)``, parameters ``(N, n_p)``) -> numbers ``(N, rows)`` that the values are not
            below, quickly.
        number: n_c.
        size: what a row is divided by in the NLP.
        proved_as: label of the row of the requirements that each row belongs to.
        kernels: what was compiled of the expressions, for all problems that have the limit.
    """

    expressions: tuple[Expression, ...] = ()
    choose: Callable[[Array, Index], Array] | None = None
    at_least: Callable[[Array, Array], Array] | None = None
    number: int = 0
    size: float = 1.0
    proved_as: tuple[str, ...] = ()
    kernels: dict[Hashable, Any] = field(default_factory=dict, repr=False, init=False)

    def __post_init__(self) -> None:
        """Checks that each row has an expression, and a lower bound alone."""
        super().__post_init__()
        if len(self.expressions) != len(self.labels) or self.choose is None or self.at_least is None:
            raise ProblemDefinitionError(
                f"limit {self.id!r}: {len(self.expressions)} expressions for {len(self.labels)} labels; give one a row, "
                "and how their constants are chosen"
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

    def least_at(self, q: Array, p: Array) -> Array:
        """What the rows' values ``(N, rows)`` are at least at postures ``(N, dof)`` and parameters ``(N, n_p)``."""
        assert self.at_least is not None
        return self.at_least(q, p)
