"""Encloses a swept limit g(t, s) over all times and all s in [0, 1]: rectangles of an arc of time and a part of s.

On a rectangle with -g_tt <= c_t and -g_ss <= c_s, g stays along the edges s_0 and s_1 below the bounds P_0 and P_1 that
``parabola_bound`` makes of its corners. At any one instant it stays, along s, below the parabola of
curvature c_s through values of at most P_0 and P_1. As that bound grows with both, it holds for the whole rectangle,
and no mixed derivative is needed. A squared distance is a parabola in s, for which the second step is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.proof.decision import Decision
from ocp_traj.proof.enclosure import Arcs, parabola_bound, peak_fraction
from ocp_traj.proof.limit_tapes import LimitTapes
from ocp_traj.proof.prover import RESOLUTION
from ocp_traj.proof.verdicts import AuditRow

Array = NDArray[np.float64]

FIRST = (8, 4)  # arcs a segment, and parts of the sweep, of the first pass: our choice
MAX_CUTS = 40  # of the sweep, one after the other: exact in binary as long as cuts are halves
MAX_SPLITS = 48  # of a segment


@dataclass
class _Rectangles:
    """Arcs of time, each with a part [low, high] of the sweep, cut ``cuts`` times."""

    arcs: Arcs
    low: Array
    high: Array
    cuts: NDArray[np.intp]

    def take(self, which: Any) -> _Rectangles:
        return _Rectangles(self.arcs.take(which), self.low[which], self.high[which], self.cuts[which])


class SweptProver:
    """Encloses one swept limit over all segments of all trajectories; see ``ocp_traj.proof.prover.Prover``."""

    def __init__(
        self, trajectories: Sequence[Motion], requirements: Requirements, limits: Sequence[PathConstraint],
        allowance: float, tightness: float, max_arcs: int,
    ) -> None:  # fmt: skip
        (limit,) = limits
        self.trajectories, self.limit, self.max_arcs = trajectories, limit, max_arcs
        self.tapes = LimitTapes(trajectories, requirements, limit)
        self.known = Decision(trajectories, [limit], allowance, max(tightness, RESOLUTION))

    def run(self) -> list[list[AuditRow]]:
        """One row a row of the limit, for each trajectory."""
        for index in range(len(self.trajectories)):
            self._prove(index)
        return [self.known.rows(index) for index in range(len(self.trajectories))]

    def _prove(self, index: int) -> None:
        known, pending = self.known, [self._start(index)]
        while pending:
            part = pending.pop()
            bound, still_open, cut_time, at, at_sweep = self._enclose(part)
            known.boxes[0, index] += len(part.low)
            keep = (
                still_open.any(axis=(0, 1)) & (known.boxes[0, index] < self.max_arcs) & (part.arcs.splits < MAX_SPLITS)
            )
            keep &= (part.cuts < MAX_CUTS) | cut_time
            known.close(part.arcs.owner[~keep], bound[..., ~keep])
            if keep.any():
                pending.append(self._cut(part.take(keep), cut_time[keep], at[keep], at_sweep[keep]))

    def _start(self, index: int) -> _Rectangles:
        curve, owner, parts = self.trajectories[index].curve, np.full(1, index, dtype=np.intp), []
        for k, points in enumerate(curve.control_points):
            if not self.limit.holds_on(k):
                continue
            segment, duration = np.full(1, k, dtype=np.intp), np.array([curve.durations[k]])
            parts.append(Arcs.of_segments(owner, segment, points[None], duration, self.tapes.order + 2))
        arcs = Arcs.join(parts)
        for _ in range(int(np.log2(FIRST[0]))):
            left, right = arcs.split(np.full(len(arcs), 0.5))
            arcs = Arcs.join([left, right])
        edges = np.linspace(0.0, 1.0, FIRST[1] + 1)
        count = len(arcs)
        whole = arcs.take(np.repeat(np.arange(count), FIRST[1]))
        low, high = np.tile(edges[:-1], count), np.tile(edges[1:], count)
        return _Rectangles(whole, low, high, np.full(len(low), 2))

    def _cut(self, part: _Rectangles, time: NDArray[np.bool_], at: Array, at_sweep: Array) -> _Rectangles:
        """Every rectangle in two: at an instant where ``time`` says so, else along the sweep.

        The arc of a rectangle cut along the sweep is cut as well, and put together again by being taken twice: arcs of
        one batch share the number of their cuts.
        """
        pieces = []
        if time.any():
            chosen = part.take(time)
            left, right = chosen.arcs.split(at[time])
            pieces += [_Rectangles(arcs, chosen.low, chosen.high, chosen.cuts) for arcs in (left, right)]
        if not time.all():
            chosen = part.take(~time)
            middle = chosen.low + at_sweep[~time] * (chosen.high - chosen.low)
            pieces.append(_Rectangles(chosen.arcs, chosen.low, middle, chosen.cuts + 1))
            pieces.append(_Rectangles(chosen.arcs, middle, chosen.high, chosen.cuts + 1))
        arcs = Arcs.join([piece.arcs for piece in pieces])
        low, high, cuts = (np.concatenate([getattr(p, name) for p in pieces]) for name in ("low", "high", "cuts"))
        return _Rectangles(arcs, low, high, cuts)

    def _enclose(self, part: _Rectangles) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_], Array, Array]:
        """Bounds of both sides, which are open, whether time is the coordinate to cut, and where on arc and sweep."""
        arcs, corners = part.arcs, {}
        for which, u in ((0, arcs.a), (-1, arcs.b)):
            for name, s in (("low", part.low), ("high", part.high)):
                corners[which, name] = self.tapes.values(arcs, which, s)
                self.known.attain(arcs.owner, corners[which, name][0], arcs.segment, u, s)
        c_time, c_sweep = self.tapes.curvatures(arcs, (part.low, part.high))
        width, along = arcs.width(), np.nextafter(part.high - part.low, np.inf)
        edges = {
            name: parabola_bound(corners[0, name][1], corners[-1, name][1], c_time, width) for name in ("low", "high")
        }
        bound = parabola_bound(edges["low"], edges["high"], c_sweep, along)
        highest = np.maximum.reduce([c[1] for c in corners.values()])
        by_time = np.maximum(edges["low"], edges["high"]) - highest
        by_sweep = bound - np.maximum(edges["low"], edges["high"])
        still_open = self.known.open(arcs.owner, bound)
        reach = np.where(still_open, bound, -np.inf).reshape(-1, len(part.low))
        chosen = (np.argmax(reach, axis=0), np.arange(len(part.low)))

        def of(values: Array) -> Array:
            return np.asarray(values.reshape(reach.shape)[chosen])

        with np.errstate(invalid="ignore"):
            time = ~(of(by_sweep) > of(by_time))
        name_low = of((edges["low"] >= edges["high"]).astype(float)) > 0.5
        start = np.where(name_low, of(corners[0, "low"][1]), of(corners[0, "high"][1]))
        end = np.where(name_low, of(corners[-1, "low"][1]), of(corners[-1, "high"][1]))
        at = peak_fraction(start, end, of(c_time), width)
        at_sweep = peak_fraction(of(edges["low"]), of(edges["high"]), of(c_sweep), along)
        return bound, still_open, time, at, at_sweep
