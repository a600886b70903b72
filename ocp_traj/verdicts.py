"""What an audit says: a row for each row of each limit, and the verdict on the whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

ALLOWANCE = 1e-12  # of a limit's scale: a value resting exactly on its limit could never be decided

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


@dataclass(frozen=True)
class Audit:
    """The rows of an audit and the verdict on the whole."""

    rows: tuple[AuditRow, ...]
    allowance: float = ALLOWANCE

    @property
    def verdict(self) -> str:
        """The worst of the rows: ``proved`` only where every limit is proved and every point constraint met."""
        worst = max((SEVERITY[row.verdict] for row in self.rows), default=0)
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
            return f"proved: every limit holds at every instant (allowance {self.allowance:g} of each limit's scale)"
        worst = "; ".join(
            f"{row.limit} {row.label} {row.verdict}: {row.attained:.6g} at t = {row.instant:.6g} s, "
            f"bound {row.bound:.6g} {row.unit}"
            + (f", enclosed by {row.proved_bound:.6g}" if row.verdict == UNDECIDED else "")
            for row in self.failures[:4]
        )
        return f"{self.verdict}: {worst}"
