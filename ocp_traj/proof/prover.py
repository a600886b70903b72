"""Encloses limits over whole trajectories: arcs are bounded, and cut where their bound peaks, until all is decided.

Limits on a derivative of the joints are bounded by hulls of control points, which are exact enclosures, all together;
every other limit by the parabola test of ``enclosure`` over boxes of states, with the second derivative enclosed by the
interval tape, and only where every operation of the limit is proved to be defined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.proof.decision import Decision
from ocp_traj.proof.enclosure import Arcs, Pair, parabola_bound, peak_fraction
from ocp_traj.proof.limit_tapes import LimitTapes, both_sides
from ocp_traj.proof.verdicts import AuditRow

Array = NDArray[np.float64]

RESOLUTION = 1e-12  # of a bound's size or the value: bounds this close to the largest value's own are not refined
MAX_SPLITS = 48  # of a segment, one after the other: our choice; an arc halved so often is shorter than rounding tells
FIRST = 64  # arcs of the first pass, at least: a pass of the tape takes hardly longer for as many as for one
FEW = 1024  # arcs whose halves are halved at once, for the same reason
BATCH = 4096  # arcs enclosed in one pass: wide enough to amortise a step of the tape, and a bound on memory


class Prover:
    """Encloses one limit, or any number of limits on derivatives, over all segments of all trajectories.

    Values and bounds are kept for both sides, ``(2, rows, N)``; see ``ocp_traj.proof.decision``. An arc is shared by
    the limits, each of which takes part until it is decided there.
    """

    def __init__(
        self, trajectories: Sequence[Motion], requirements: Requirements, limits: Sequence[PathConstraint],
        allowance: float, tightness: float, max_arcs: int,
    ) -> None:  # fmt: skip
        limits = sorted(limits, key=lambda limit: limit.order or 0)
        self.limits, self.trajectories, self.max_arcs = limits, trajectories, max_arcs
        self.known = Decision(trajectories, limits, allowance, tightness)
        bound = self.known.bound
        self.size = np.where(np.isfinite(bound) & (bound != 0.0), np.abs(bound), self.known.scale)[..., None]
        # No bound can be below: the largest value's own upper bound.
        self.floor = np.full_like(self.known.attained, -np.inf)
        self.orders = [limit.order for limit in limits if limit.order is not None]
        if not self.orders:
            self.tapes = LimitTapes(trajectories, requirements, limits[0])
        for limit in limits:
            if limit.order is not None:
                check = partial(_require_derivative, requirements, limit, limit.order)
                requirements.compiled(limit, "is derivative", check)

    def run(self) -> list[list[AuditRow]]:
        """One row a row of the limits, for each trajectory."""
        arcs = self._arcs()
        self._prove(arcs, np.array([[limit.holds_on(k) for k in arcs.segment] for limit in self.limits]))
        return [self.known.rows(index) for index in range(len(self.trajectories))]

    def _arcs(self) -> Arcs:
        """All segments of all trajectories."""
        orders = max(self.orders) if self.orders else self.tapes.order + 2
        for limit in self.limits:
            if not any(limit.holds_on(k) for t in self.trajectories for k in range(t.curve.segments)):
                raise ProblemDefinitionError(
                    f"limit {limit.id!r} is for the segments {limit.segments}; the trajectories have none of them"
                )
        parts = []
        for degree in sorted({n for t in self.trajectories for n in t.curve.degrees}):
            members = [
                (i, k, t.curve.control_points[k], t.curve.durations[k])
                for i, t in enumerate(self.trajectories)
                for k, n in enumerate(t.curve.degrees)
                if n == degree and any(limit.holds_on(k) for limit in self.limits)
            ]
            if not members:
                continue
            owner, segment, points, duration = map(np.array, zip(*members, strict=True))
            parts.append(Arcs.of_segments(owner, segment, points, duration, orders))
        arcs = Arcs.join(parts)
        arcs = arcs.take(np.lexsort((arcs.segment, arcs.owner)))  # every array of arcs is in the order of its owners
        if self.orders:
            return arcs.only(self.orders)
        while len(arcs) < FIRST:
            left, right = arcs.split(np.full(len(arcs), 0.5))
            arcs = left.interleave(right)
        return arcs

    def _prove(self, arcs: Arcs, concerns: NDArray[np.bool_]) -> None:
        known, values = self.known, [self._values(arcs, which, concerns) for which in (0, -1)]
        pending = [_Batch(arcs, values[0], values[1], np.full_like(values[0][1], np.inf), concerns)]
        while pending:
            batch = pending.pop()
            if len(batch.arcs) > BATCH:
                pending += [batch.take(slice(BATCH, None)), batch.take(slice(None, BATCH))]
                continue
            owner = batch.arcs.owner
            bound, cut = self._enclose(batch)
            still_open = self._open(batch, bound) & batch.concerns[known.limit_of]
            for boxes, concerned in zip(known.boxes, batch.concerns, strict=True):
                boxes += np.bincount(owner[concerned], minlength=len(boxes))
            concerns = np.stack([still_open[:, known.limit_of == k].any(axis=(0, 1)) for k in range(len(self.limits))])
            concerns &= (known.boxes[:, owner] < self.max_arcs) & (batch.arcs.splits < MAX_SPLITS)
            known.close(owner, np.where((batch.concerns & ~concerns)[known.limit_of], bound, -np.inf))
            keep = concerns.any(axis=0)
            if not keep.any():
                continue
            rest = batch.take(keep)
            rest.bound, rest.concerns = bound[..., keep], concerns[:, keep]
            rest = self._split(rest, self._where(bound, cut, still_open)[keep])
            pending.append(self._split(rest, 0.5) if len(rest.arcs) <= FEW else rest)

    def _split(self, batch: _Batch, at: Array | float) -> _Batch:
        left, right = batch.arcs.split(np.broadcast_to(at, len(batch.arcs)))
        middle = self._values(left, -1, batch.concerns)
        start, end = _alternate(batch.start, middle), _alternate(middle, batch.end)
        bound, concerns = np.repeat(batch.bound, 2, axis=-1), np.repeat(batch.concerns, 2, axis=-1)
        return _Batch(left.interleave(right), start, end, bound, concerns)

    def _open(self, batch: _Batch, bound: Array) -> NDArray[np.bool_]:
        """Which sides, rows and arcs to cut; not those whose bound cannot be told from a value found so far."""
        owner, floor = batch.arcs.owner, self.floor[..., batch.arcs.owner]
        ends = np.maximum(batch.start[1], batch.end[1])
        with np.errstate(over="ignore"):
            near = floor + RESOLUTION * np.maximum(self.size, np.abs(floor))
            # Hopeless: a value found so far cannot be told from one beyond the limit; nor can this arc's own ends.
            beyond = np.where(floor > self.known.allowed, near, -np.inf)
            hopeless = np.maximum(ends + 1e-15 * np.abs(ends) + 1e-300, beyond)
        return self.known.open(owner, bound, near, hopeless)

    @staticmethod
    def _where(bound: Array, cut: Array, still_open: NDArray[np.bool_]) -> Array:
        """Where to cut each arc: at the parabola's peak of the open row that reaches highest above the rest."""
        reach = np.where(still_open, bound, -np.inf).reshape(-1, bound.shape[-1])
        choice = np.argmax(reach, axis=0)
        return np.asarray(cut.reshape(reach.shape)[choice, np.arange(reach.shape[1])])

    def _enclose(self, batch: _Batch) -> tuple[Array, Array]:
        """Bounds of both sides over each arc, and where to cut it."""
        if self.orders:
            bound = both_sides(*batch.arcs.hulls())[1]
            return np.minimum(np.where(np.isnan(bound), np.inf, bound), batch.bound), np.full(bound.shape, 0.5)
        ends = batch.start[1], batch.end[1], self.tapes.curvatures(batch.arcs)[0], batch.arcs.width()
        return np.minimum(parabola_bound(*ends), batch.bound), peak_fraction(*ends)

    def _values(self, arcs: Arcs, which: int, concerns: NDArray[np.bool_]) -> Pair:
        """Bounds of both sides' values at one end of each arc, of which note is taken where they concern a limit."""
        low, high = both_sides(*arcs.ends(which)) if self.orders else self.tapes.values(arcs, which)
        lower, upper = (np.where(concerns[self.known.limit_of], end, -np.inf) for end in (low, high))
        self.known.attain(arcs.owner, lower, arcs.segment, arcs.a if which == 0 else arcs.b)
        owners, first = np.unique(arcs.owner, return_index=True)
        self.floor[..., owners] = np.maximum(self.floor[..., owners], np.maximum.reduceat(upper, first, axis=-1))
        return low, high


@dataclass
class _Batch:
    """Arcs with what is known of them: values at both ends, ``(2, rows, N)`` each, a bound, and whom they concern."""

    arcs: Arcs
    start: Pair
    end: Pair
    bound: Array
    concerns: NDArray[np.bool_]

    def take(self, which: Any) -> _Batch:
        start, end = _take(self.start, which), _take(self.end, which)
        return _Batch(self.arcs.take(which), start, end, self.bound[..., which], self.concerns[:, which])


def _take(pair: Pair, which: Any) -> Pair:
    return pair[0][..., which], pair[1][..., which]


def _alternate(left: Pair, right: Pair) -> Pair:
    """Entries of two pairs ``(.., N)`` in turn."""
    low, high = (np.stack([x, y], axis=-1).reshape(*x.shape[:-1], -1) for x, y in zip(left, right, strict=True))
    return low, high


def _require_derivative(requirements: Requirements, limit: PathConstraint, order: int) -> bool:
    """Refuses a limit that claims to be on a derivative itself and is not: its expression would not be read."""
    function = requirements.function(limit)
    state = [casadi.SX.sym("z", function.sparsity_in(i)) for i in range(4)]
    value, dof = function(*state), requirements.dof
    derivative = casadi.vertsplit(state[0], dof)[order]
    if value.numel() != dof or not all(casadi.is_equal(value[i], derivative[i]) for i in range(dof)):
        raise ProblemDefinitionError(
            f"limit {limit.id!r}: it says order={order}, but its expression is not that derivative of the joints; "
            "leave order out"
        )
    return True
