"""What is certain of a front as a whole: two staircases, and the hypervolume between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj.arrays import Array
from ocp_traj.rounding import rounded_down, rounded_up

ATTAINED, BOUND = "attained", "bound"  # names of the staircases in a table


@dataclass(frozen=True, eq=False)
class FrontCertificate:
    """How much hypervolume a front of two objectives leaves out at most.

    A staircase is its corners in ascending order of the first objective: from one corner to the next the second
    objective is that of the first of the two.

    *What is claimed*: no trajectory of the problem, with its curve, the bounds of its variables and its limits, that is
    better than the reference point in both objectives lies below or to the left of ``bound``. Objectives are those that
    the problem computes, its constants as rounded, in exact arithmetic. ``attained`` are proved points of the front and
    nothing else, neither what lies between them nor their dilations: the gap holds what a number of points leaves out
    for being no curve.

    Attributes:
        objectives: the one that grows with time, then the one that does not.
        units: of the objectives.
        bound: corners of the lower staircase ``(K, 2)``, where it is below the reference.
        attained: corners of the upper staircase ``(N, 2)``.
        reference: worst values worth having, of both objectives.
        volume: dominated by ``attained`` within the reference, rounded down, in the product of the units.
        most: that no front has more of, rounded up.
        tolerance: gap that counts as certified.
        boxes: of ratios of durations that were bounded.
        seconds: spent.
        left_out: limits that the bound takes no account of, which can only make it lower.
    """

    objectives: tuple[str, str]
    units: tuple[str, str]
    bound: Array
    attained: Array
    reference: Mapping[str, float]
    volume: float
    most: float
    tolerance: float
    boxes: int
    seconds: float
    left_out: tuple[str, ...] = ()

    @property
    def gap(self) -> float:
        """Hypervolume between the staircases, as a share of what lies above the lower one; 1 where nothing is known."""
        return 1.0 - self.volume / self.most if 0.0 < self.most < np.inf else 1.0

    @property
    def certified(self) -> bool:
        """Whether the gap is within the tolerance."""
        return self.gap <= self.tolerance

    @property
    def table(self) -> pd.DataFrame:
        """Both staircases, a corner a row: ``staircase``, and the objectives with units in the column names."""
        names = [f"{name} [{unit}]" for name, unit in zip(self.objectives, self.units, strict=True)]
        parts = [(BOUND, self.bound), (ATTAINED, self.attained)]
        table = pd.DataFrame(np.concatenate([corners for _, corners in parts]), columns=names)
        table.insert(0, "staircase", [kind for kind, corners in parts for _ in corners])
        return table

    def explain(self) -> str:
        """One line."""
        gap, tolerance = rounded_up(100.0 * self.gap, 3), 100.0 * self.tolerance
        within = ", ".join(
            f"{name} {self.reference[name]:.6g} {unit}" for name, unit in zip(self.objectives, self.units, strict=True)
        )
        word = "certified" if self.certified else f"not certified to {tolerance:g} %"
        least = f"{self.objectives[0]} below {rounded_down(self.bound[0, 0], 7):.7g}" if len(self.bound) else "a point"
        without = f"; without {', '.join(self.left_out)}, which can only narrow it" if self.left_out else ""
        return (
            f"front {word}: no trajectory has {least} or lies below the lower staircase; what its points leave out of "
            f"the hypervolume is at most {gap:.3g} % (within {within}; interval branch and bound over ratios of "
            f"durations, {self.boxes} boxes, {self.seconds:.2f} s{without})"
        )

    def to_dict(self) -> dict[str, Any]:
        """As plain values, without the staircases."""
        return {
            "objectives": list(self.objectives),
            "gap": self.gap,
            "certified": self.certified,
            "tolerance": self.tolerance,
            "volume": self.volume,
            "most": self.most,
            "reference": dict(self.reference),
            "boxes": self.boxes,
            "seconds": self.seconds,
            "left_out": list(self.left_out),
        }
