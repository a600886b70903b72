"""What an audit says: a row for each row of each limit, and the verdict on the whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

ALLOWANCE = 1e-12  # of a bound's own size: a value resting exactly on its limit could never be decided

PROVED, CHECKED, UNDECIDED, VIOLATED = "proved", "checked", "undecided", "violated"
SEVERITY = {PROVED: 0, CHECKED: 0, UNDECIDED: 1, VIOLATED: 2}


@dataclass(frozen=True)
class AuditRow:
    """What is known of one row of one limit, on the side where its margin is smallest.

    Attributes:
        limit, label, unit: which.
        bound: what is allowed [unit].
        attained: the most extreme value found, rounded inward [unit]; infinite where none could be found.
        instant: when [s].
        proved_bound: the value is proved to stay within this [unit]; for point constraints the attained value.
        margin: distance of ``proved_bound`` to ``bound`` as a fraction of the limit's scale; > 0 when satisfied.
        verdict: ``proved``, ``violated``, ``undecided``; ``checked`` for point constraints and continuity.
        boxes: how many boxes of states the proof took.
        sweep: of a swept limit, where along it in [0, 1].
        allowance: what the bound may be exceeded by and still count as met [unit].
    """

    limit: str
    label: str
    unit: str
    bound: float
    attained: float
    instant: float
    proved_bound: float
    margin: float
    verdict: str
    boxes: int
    sweep: float | None = None
    allowance: float = 0.0


@dataclass(frozen=True)
class Audit:
    """The rows of an audit and the verdict on the whole.

    Attributes:
        rows: one a row of each limit.
        allowance: what a path limit may be exceeded by, as a share of its bound.
        parameters: with which the limits were evaluated, such as the payload.
    """

    rows: tuple[AuditRow, ...]
    allowance: float = ALLOWANCE
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def verdict(self) -> str:
        """The worst of the rows: ``proved`` only where every limit is proved and every point constraint met.

        Where nothing was looked at nothing is decided.
        """
        worst = max((SEVERITY[row.verdict] for row in self.rows), default=SEVERITY[UNDECIDED])
        return (PROVED, UNDECIDED, VIOLATED)[worst]

    @property
    def proved(self) -> bool:
        """Whether every limit holds at every instant."""
        return self.verdict == PROVED

    @property
    def margin(self) -> float:
        """Smallest relative margin over the path limits."""
        return min((row.margin for row in self.rows if row.verdict != CHECKED), default=np.inf)

    @property
    def failures(self) -> tuple[AuditRow, ...]:
        """The rows that are violated or undecided, worst first."""
        bad = [row for row in self.rows if SEVERITY[row.verdict]]
        return tuple(sorted(bad, key=lambda row: (-SEVERITY[row.verdict], row.margin)))

    @property
    def table(self) -> pd.DataFrame:
        """One line a row."""
        return pd.DataFrame([vars(row) for row in self.rows])

    def explain(self) -> str:
        """One line: the verdict and, where it is not proved, the limits at fault and the instants."""
        if self.proved:
            given = "".join(f", {name} {value:g}" for name, value in self.parameters.items())
            return f"proved: every limit holds at every instant (allowance {self.allowance:g} of each bound{given})"
        if not self.rows:
            return "undecided: the limits ask nothing of this trajectory"
        worst = "; ".join(
            f"{row.limit} {row.label} {row.verdict}: {row.attained:.6g} at t = {row.instant:.6g} s, "
            f"bound {row.bound:.6g} {row.unit}"
            + (f", enclosed by {row.proved_bound:.6g}" if row.verdict == UNDECIDED else "")
            for row in self.failures[:4]
        )
        return f"{self.verdict}: {worst}"
