"""What is known of limits along motions, and what follows: proved, violated, undecided, or worth another cut.

Both sides of each row are read as "value <= bound": side 0 is g <= upper, side 1 is -g <= -lower. A value that is
attained beyond what is allowed violates it, a bound over all arcs within what is allowed proves it; nothing that is
not a number passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.proof.verdicts import PROVED, SEVERITY, UNDECIDED, VIOLATED, AuditRow

Array = NDArray[np.float64]

UNDERFLOW = 1e-300  # of any unit: far above what is left of rounding a zero outward, far below any quantity


def decide(attained: float, enclosed: float, allowed: float) -> str:
    """The verdict on "value <= allowed", from a value that is attained and one that is never exceeded."""
    if attained > allowed:
        return VIOLATED
    return PROVED if enclosed <= allowed else UNDECIDED


def allowance_of(bound: Array, share: float) -> Array:
    """What each bound may be exceeded by: a share of its own size; of zero, what outward rounding makes of a zero."""
    return np.where(np.isfinite(bound), np.maximum(share * np.abs(bound), UNDERFLOW), 0.0)


class Decision:
    """The values attained and the bounds found of limits, per side, row and motion.

    Args:
        motions: along which the limits are looked at.
        limits: whose rows follow each other.
        allowance: as a share of each bound.
        tightness: how closely the largest value is enclosed, in units of the limit's scale.

    Attributes:
        bound, allowance: ``(2, rows)``, infinite and 0 where there is no bound.
        attained: lower bound of the largest value ``(2, rows, motions)``.
        place: segment, local time and sweep of that value ``(3, 2, rows, motions)``.
        proved: upper bound over all arcs that are closed ``(2, rows, motions)``.
        boxes: how many were looked at ``(limits, motions)``.
        limit_of: index of each row's limit ``(rows,)``.
    """

    def __init__(
        self, motions: Sequence[Motion], limits: Sequence[PathConstraint], allowance: float, tightness: float
    ) -> None:
        self.motions, self.limits, self.tightness = motions, limits, tightness
        self.bound = np.concatenate([np.stack([limit.upper, -limit.lower]) for limit in limits], axis=1)
        self.scale = np.concatenate([limit.scale for limit in limits])
        self.limit_of = np.repeat(np.arange(len(limits)), [len(limit.labels) for limit in limits])
        self.allowance = allowance_of(self.bound, allowance)
        shape = 2, len(self.scale), len(motions)
        self.attained, self.proved, self.place = np.full(shape, -np.inf), np.full(shape, -np.inf), np.zeros((3, *shape))
        self.boxes = np.zeros((len(limits), len(motions)), dtype=int)

    @property
    def allowed(self) -> Array:
        """What no value may exceed ``(2, rows, 1)``."""
        return np.asarray((self.bound + self.allowance)[..., None])

    def attain(self, owner: NDArray[np.intp], values: Array, *place: NDArray[Any]) -> None:
        """Takes note of the largest of values ``(2, rows, N)`` of motions ``owner (N,)``, ascending, and where."""
        owners, first, inverse = np.unique(owner, return_index=True, return_inverse=True)
        largest = np.maximum.reduceat(values, first, axis=-1)
        index = np.where(values == largest[..., inverse], np.arange(len(owner)), -1)
        index = np.maximum.reduceat(index, first, axis=-1)
        better = largest > self.attained[..., owners]
        side, row, found = np.nonzero(better)
        at = side, row, owners[found]
        self.attained[at] = largest[better]
        for known, source in zip(self.place, place, strict=False):
            known[at] = source[index[better]]

    def open(
        self, owner: NDArray[np.intp], bound: Array, near: Array | float = -np.inf, hopeless: Array | float = -np.inf
    ) -> NDArray[np.bool_]:
        """Which sides, rows and arcs need refining, and can gain by it: not decided, or not tight.

        Args:
            owner: motion of each arc ``(N,)``.
            bound: of both sides over each arc ``(2, rows, N)``.
            near: what is tight whatever the tightness says ``(2, rows, N)``.
            hopeless: below what no cut can bring the bound ``(2, rows, N)``.
        """
        attained, allowed = self.attained[..., owner], self.allowed
        with np.errstate(invalid="ignore"):
            tight = np.maximum(attained + self.tightness * self.scale[:, None], near)
        undecided = ~(bound <= np.maximum(allowed, hopeless)) & ~(attained > allowed)
        return np.asarray((undecided | ~(bound <= tight)) & np.isfinite(self.bound)[:, :, None])

    def close(self, owner: NDArray[np.intp], bound: Array) -> None:
        """Takes note of bounds ``(2, rows, N)`` over arcs of motions ``owner (N,)``, ascending, that are closed."""
        if len(owner):
            owners, first = np.unique(owner, return_index=True)
            self.proved[..., owners] = np.maximum(self.proved[..., owners], np.maximum.reduceat(bound, first, axis=-1))

    def rows(self, motion: int) -> list[AuditRow]:
        """Of each row of the limits the side that is worse off."""
        rows: list[AuditRow] = []
        names = [
            (k, *name) for k, limit in enumerate(self.limits) for name in zip(limit.labels, limit.units, strict=True)
        ]
        numbers = (
            self.bound,
            self.allowance,
            self.attained[..., motion],
            self.proved[..., motion],
            *self.place[..., motion],
        )
        table = np.stack(numbers).transpose(2, 1, 0).tolist()  # by row and side
        curve, knots = self.motions[motion].curve, self.motions[motion].curve.knots
        for row, (k, label, unit) in enumerate(names):
            sides = []
            for sign, values in zip((1.0, -1.0), table[row], strict=True):
                bound, allowance, attained, proved, segment, u, sweep = values
                if np.isfinite(bound):
                    sides.append(AuditRow(
                        self.limits[k].id, label, unit, sign * bound, sign * attained,
                        float(knots[int(segment)] + u * curve.durations[int(segment)]), sign * proved,
                        (bound - proved) / float(self.scale[row]), decide(attained, proved, bound + allowance),
                        int(self.boxes[k, motion]), sweep if self.limits[k].sweep else None, allowance,
                    ))  # fmt: skip
            if sides:
                rows.append(max(sides, key=lambda r: (SEVERITY[r.verdict], -r.margin)))
        return rows
