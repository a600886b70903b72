"""Rows of a nonlinear program, which know the limit they came from, and limits that did not hold together."""

from __future__ import annotations

from dataclasses import dataclass

VARIABLE = "variable"  # limit of a row that is a bound on a variable, its label the variable's


@dataclass(frozen=True)
class Row:
    """Where a constraint row comes from, and how to turn it back into its unit.

    Attributes:
        limit: id of the limit, or of the objective a bound is put on.
        label: joint, or whatever the limit calls its rows.
        segment: of the curve; -1 where the row belongs to no instant.
        instant: local time in [0, 1] at the point of transcription.
        unit: of the row's value before scaling.
        scale: the row is the limit's value divided by this.
        sweep: where along the sweep of a swept limit.
        control: the control point of the limit's derivative on the segment that the row holds, in place of an instant.
        defines: the row only says what an extra variable is; it can always be met and is in nobody's way.
    """

    limit: str
    label: str
    segment: int = -1
    instant: float = 0.0
    unit: str = ""
    scale: float = 1.0
    defines: bool = False
    sweep: float = 0.0
    control: int | None = None


@dataclass(frozen=True)
class Conflict:
    """One limit of those that did not hold together.

    Attributes:
        row: the limit's row.
        value: what the least-violating point gives [row.unit].
        bound: what the limit allows [row.unit].
        excess: by how much it is exceeded, >= 0, and would have to give where all others in conflict give what they are
            said to; 0 for a limit that is met but stands in the way of the others.
        words: what that means, where the problem can say it better than the numbers.
    """

    row: Row
    value: float
    bound: float
    excess: float
    words: str = ""

    @property
    def share(self) -> float | None:
        """The excess as a share of the bound; None of a bound of zero."""
        return self.excess / abs(self.bound) if self.bound else None

    def __str__(self) -> str:
        """The limit, where, and by how much."""
        if self.words:
            return self.words
        name = f"{self.row.limit} {self.row.label}".strip()
        place = f"u = {self.row.instant:.3f}" if self.row.control is None else f"control point {self.row.control}"
        where = f" at segment {self.row.segment}, {place}" if self.row.segment >= 0 else ""
        if self.excess > 0.0:
            off = f"{self.excess:.3g} {self.row.unit}".rstrip(" -")
            off += f", {100.0 * self.share:.3g} %" if self.share is not None else ""
            return f"{name}{where}: {self.value:.6g}, allowed {self.bound:.6g} {self.row.unit} (off by {off})"
        return f"{name}{where}: held at its bound {self.bound:.6g} {self.row.unit}"
