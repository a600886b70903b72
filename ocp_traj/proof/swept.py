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

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.requirements import ORDERS, PathConstraint, Requirements
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.enclosure import Arcs, Pair, parabola_bound, peak_fraction
from ocp_traj.proof.prover import RESOLUTION, allowance_of, curvature_function, domain_function
from ocp_traj.proof.verdicts import SEVERITY, AuditRow, decide

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
        self, trajectories: Sequence[Motion], requirements: Requirements, limit: PathConstraint,
        allowance: float, tightness: float, max_arcs: int,
    ) -> None:  # fmt: skip
        self.trajectories, self.limit = trajectories, limit
        self.tightness, self.max_arcs = tightness, max_arcs
        if limit.constants is not None and any(len(limit.constants) != t.curve.segments for t in trajectories):
            raise ProblemDefinitionError(
                f"limit {limit.id!r} has constants for {len(limit.constants)} segments; the trajectories have "
                f"{sorted({t.curve.segments for t in trajectories})}"
            )
        self.order = max(requirements.order(limit), 0)
        self.value, self.curvature = requirements.compiled(limit, "proof", lambda: _compile(requirements, limit))
        self.bound, self.scale = np.stack([limit.upper, -limit.lower]), limit.scale
        self.allowance = allowance_of(self.bound, allowance)
        self.names = requirements.parameters

    def run(self) -> list[list[AuditRow]]:
        """One row a row of the limit, for each trajectory."""
        return [self._trajectory(trajectory) for trajectory in self.trajectories]

    def _trajectory(self, trajectory: Motion) -> list[AuditRow]:
        rows = len(self.limit.labels)
        self.parameters = np.array([[trajectory.parameters[name]] for name in self.names]).reshape(-1, 1)
        self.attained = np.full((2, rows), -np.inf)
        self.place = np.zeros((3, 2, rows))  # segment, local time and sweep of that value
        self.proved = np.full((2, rows), -np.inf)
        self.boxes = 0
        pending = [self._start(trajectory)]
        while pending:
            part = pending.pop()
            bound, cut_time, at, at_sweep = self._enclose(part)
            self.boxes += len(part.low)
            still_open = self._open(bound)
            keep = still_open.any(axis=(0, 1)) & (self.boxes < self.max_arcs) & (part.arcs.splits < MAX_SPLITS)
            keep &= (part.cuts < MAX_CUTS) | cut_time
            self.proved = np.maximum(self.proved, bound[..., ~keep].max(axis=-1, initial=-np.inf))
            if keep.any():
                pending.append(self._cut(part.take(keep), cut_time[keep], at[keep], at_sweep[keep]))
        return self._rows(trajectory)

    def _start(self, trajectory: Motion) -> _Rectangles:
        parts = []
        for k, points in enumerate(trajectory.curve.control_points):
            if not self.limit.holds_on(k):
                continue
            owner, segment = np.zeros(1, dtype=np.intp), np.full(1, k, dtype=np.intp)
            duration = np.array([trajectory.curve.durations[k]])
            parts.append(Arcs.of_segments(owner, segment, points[None], duration, self.order + 2))
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
        splits = max(piece.arcs.splits for piece in pieces)
        arcs = Arcs.join([_as_often(piece.arcs, splits) for piece in pieces])
        low, high, cuts = (np.concatenate([getattr(p, name) for p in pieces]) for name in ("low", "high", "cuts"))
        return _Rectangles(arcs, low, high, cuts)

    def _enclose(self, part: _Rectangles) -> tuple[Array, NDArray[np.bool_], Array, Array]:
        """Bounds of both sides, whether time is the coordinate to cut, and where on the arc and on the sweep."""
        arcs, corners = part.arcs, {}
        for which in (0, -1):
            for name, s in (("low", part.low), ("high", part.high)):
                corners[which, name] = self._corner(arcs, which, s)
                self._attain(arcs, which, s, corners[which, name][0])
        c_time, c_sweep = self._curvatures(part)
        width, along = arcs.width(), np.nextafter(part.high - part.low, np.inf)
        edges = {
            name: parabola_bound(corners[0, name][1], corners[-1, name][1], c_time, width) for name in ("low", "high")
        }
        bound = parabola_bound(edges["low"], edges["high"], c_sweep, along)
        highest = np.maximum.reduce([c[1] for c in corners.values()])
        by_time = np.maximum(edges["low"], edges["high"]) - highest
        by_sweep = bound - np.maximum(edges["low"], edges["high"])
        reach = np.where(self._open(bound), bound, -np.inf).reshape(-1, len(part.low))
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
        return bound, time, at, at_sweep

    def _corner(self, arcs: Arcs, which: int, s: Array) -> Pair:
        """Bounds of both sides' values at one corner of each rectangle."""
        x = _stack([arcs.end(order, which) for order in range(self.order + 1)], len(ORDERS))
        u = arcs.end_time(which)
        place = np.concatenate([u[0], s[None]]), np.concatenate([u[1], s[None]])
        return self._sides(self.value.enclose(x, place, *self._shared(arcs)), arcs)

    def _curvatures(self, part: _Rectangles) -> tuple[Array, Array]:
        """Upper bounds of -g_tt and -g_ss of both sides over each rectangle."""
        arcs = part.arcs
        x = _stack([arcs.hull(order) for order in range(self.order + 3)], len(ORDERS) + 2)
        with np.errstate(over="ignore"):
            inverse = 1.0 / arcs.duration[None]
            rate = np.nextafter(inverse, -np.inf), np.nextafter(inverse, np.inf)
        u = arcs.local_time()
        place = np.concatenate([u[0], part.low[None]]), np.concatenate([u[1], part.high[None]])
        time, sweep, domain = self.curvature.enclose(x, place, *self._shared(arcs), rate)
        # -g_tt of side 0 is at most -(lower end of g_tt), of side 1 (which is -g) at most its upper end.
        (a, b), (c, d) = (self._where_defined(pair, domain, arcs) for pair in (time, sweep))
        return np.stack([-a, b]), np.stack([-c, d])

    def _sides(self, found: Sequence[Pair], arcs: Arcs) -> Pair:
        low, high = self._where_defined(found[0], found[1], arcs)
        return np.stack([low, -high]), np.stack([high, -low])

    def _where_defined(self, bounds: Pair, domain: Pair, arcs: Arcs) -> Pair:
        defined = (domain[0] > 0.0).all(axis=0)
        for numbers, _ in self._shared(arcs):
            defined &= np.isfinite(numbers).all(axis=0)
        return np.where(defined, bounds[0], -np.inf), np.where(defined, bounds[1], np.inf)

    def _shared(self, arcs: Arcs) -> tuple[Pair, Pair]:
        p = np.repeat(self.parameters, len(arcs), axis=1)
        constants = self.limit.constants
        c = np.zeros((0, len(arcs))) if constants is None else constants[arcs.segment].T
        return (p, p), (c, c)

    def _attain(self, arcs: Arcs, which: int, s: Array, values: Array) -> None:
        """Takes note of the largest value at one corner of the rectangles, and where."""
        best = np.argmax(values, axis=-1)
        largest = np.take_along_axis(values, best[..., None], axis=-1)[..., 0]
        better = largest > self.attained
        self.attained[better] = largest[better]
        u = arcs.a if which == 0 else arcs.b
        for k, source in enumerate((arcs.segment, u, s)):
            self.place[k][better] = source[best[better]]

    def _open(self, bound: Array) -> NDArray[np.bool_]:
        """Which sides, rows and rectangles need refining: not decided, or not tight."""
        scale = self.scale[:, None]
        allowed = (self.bound + self.allowance)[:, :, None]
        attained = self.attained[..., None]
        with np.errstate(invalid="ignore"):
            tight = attained + np.maximum(self.tightness, RESOLUTION) * scale
        undecided = ~(bound <= allowed) & ~(attained > allowed)
        loose = ~(bound <= tight)
        return np.asarray((undecided | loose) & np.isfinite(self.bound)[:, :, None])

    def _rows(self, trajectory: Motion) -> list[AuditRow]:
        rows = []
        for row in range(len(self.limit.labels)):
            sides = [self._row(trajectory, side, row) for side in (0, 1) if np.isfinite(self.bound[side, row])]
            rows.append(max(sides, key=lambda r: (SEVERITY[r.verdict], -r.margin)))
        return rows

    def _row(self, trajectory: Motion, side: int, row: int) -> AuditRow:
        limit, sign = self.limit, (1.0, -1.0)[side]
        bound, scale = float(self.bound[side, row]), float(self.scale[row])
        attained, proved = float(self.attained[side, row]), float(self.proved[side, row])
        allowance = float(self.allowance[side, row])
        curve, segment = trajectory.curve, int(self.place[0, side, row])
        instant = float(curve.knots[segment] + self.place[1, side, row] * curve.durations[segment])
        return AuditRow(
            limit.id, limit.labels[row], limit.units[row], sign * bound, sign * attained, instant,
            sign * proved, (bound - proved) / scale, decide(attained, proved, bound + allowance), self.boxes,
            float(self.place[2, side, row]), allowance,
        )  # fmt: skip


def _as_often(arcs: Arcs, splits: int) -> Arcs:
    """The same arcs, recorded as cut ``splits`` times: the bound on their ends' rounding only grows."""
    return Arcs(arcs.owner, arcs.segment, arcs.a, arcs.b, arcs.duration, arcs.hodographs, splits)


def _compile(requirements: Requirements, limit: PathConstraint) -> tuple[Tape, Tape]:
    """Tapes of the value, and of its second derivatives along time and sweep, each with the limit's domain."""
    function, curvature = requirements.function(limit), curvature_function(requirements, limit)
    domain = domain_function(function)
    x, place, p, c, rate = (casadi.SX.sym(name, curvature.sparsity_in(i)) for i, name in enumerate("xupcr"))
    state = (x[: function.numel_in(0)], place, p, c)
    g = function(*state)
    value = Tape(casadi.Function("value", state, [g, domain(*state)]))
    value.require_smooth(f"limit {limit.id!r}")
    slope = casadi.jtimes(g, place, casadi.DM([0.0, 1.0]))
    bend = casadi.densify(casadi.jtimes(slope, place, casadi.DM([0.0, 1.0])))
    both = casadi.cse([curvature(x, place, p, c, rate), bend, domain(*state)])
    return value, Tape(casadi.Function("curvatures", [x, place, p, c, rate], both))


def _stack(derivatives: list[Pair], orders: int) -> Pair:
    """The derivatives below each other, with zeros for those of higher order, which the limit does not read."""
    rest = np.zeros(((orders - len(derivatives)) * len(derivatives[0][0]), derivatives[0][0].shape[1]))
    low, high = (np.concatenate([*(d[i] for d in derivatives), rest]) for i in (0, 1))
    return low, high
