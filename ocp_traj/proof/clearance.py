"""Proves that whole bodies keep their distance at every instant: branch and bound over pairs and arcs of time.

Let n_a and n_b be unit vectors at the ends of an arc, each as good as can be had there (``separation``), and n(t) the
straight line between them, seen from the joint on which the links of both bodies branch off. It is never longer than 1,
so that ``n(t) . (x - y)``, where it is positive for all points x of one core and y of the other, is less than the
cores' distance. Its second derivative is at most ``c = M_2 + 2 M_1 |n_b - n_a| / w`` in size, M_1 and M_2 bounding the
relative speed and acceleration of x and y over the arc of duration w: so the parabola of curvature c through the least
values at both ends lies below it. As n turns with the bodies the bound is of second order in w, whatever their shapes;
arcs are halved until it tells. (A direction that stands still over an arc loses w times the body's size where a side
turns towards what it is near: it needs many more arcs.)

A distance at an instant is bounded from above by two points of the bodies: only that makes ``violated``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.body_motion import ArcMotion, Joints, motion_bounds
from ocp_traj.proof.decision import allowance_of, decide
from ocp_traj.proof.enclosure import Arcs, parabola_bound
from ocp_traj.proof.separation import BodyTable, Frames, separation
from ocp_traj.proof.verdicts import AuditRow
from ocp_traj.robot.cores import HALF_SPACES
from ocp_traj.robot.placements import placements_function

WIDTH = 1e-4  # [m] how closely the least clearance of all is enclosed
FIRST = 16  # arcs of a motion to begin with, at least: a pass over few takes as long
BATCH = 16384  # pairs and arcs that are looked at in one pass: a bound on memory
MAX_SPLITS = 48  # of a segment


@dataclass(frozen=True, eq=False)
class _Ends:
    """At one end of arcs, of M pairs: lower bounds of their cores' separation, and directions seen from their base."""

    apart: Array
    normal: Array
    off: Array

    def take(self, which: Any) -> _Ends:
        return _Ends(self.apart[which], self.normal[which], self.off[which])


@dataclass
class _Batch:
    """Arcs with frames at their ends, and pairs that are open on some of them."""

    arcs: Arcs
    start: Frames
    end: Frames
    arc: Index
    pair: Index
    first: _Ends
    last: _Ends

    def take(self, which: NDArray[np.bool_] | Index) -> _Batch:
        """Some of the pairs, and the arcs they are on."""
        arcs, arc = np.unique(self.arc[which], return_inverse=True)
        ends = self.first.take(which), self.last.take(which)
        return _Batch(
            self.arcs.take(arcs), self.start.take(arcs), self.end.take(arcs), arc, self.pair[which], *ends
        )  # fmt: skip


class ClearanceProver:
    """Bounds one clearance constraint over all segments of all trajectories."""

    def __init__(
        self, trajectories: Sequence[Motion], requirements: Requirements, limit: ClearanceConstraint,
        allowance: float, max_arcs: int,
    ) -> None:  # fmt: skip
        self.trajectories, self.limit, self.max_arcs = trajectories, limit, max_arcs
        self.share = allowance
        self.joints = Joints.of(limit.robot, [body.joint for body in limit.bodies])
        self.table = BodyTable.of(limit.bodies, self.joints.indices)
        self.one, self.two = np.array(limit.pairs, dtype=np.intp).T
        owners = self.table.joint[self.one], self.table.joint[self.two]
        self.base = np.array([self.joints.common(i, j) for i, j in zip(*map(np.ndarray.tolist, owners), strict=True)])
        self.flat = (self.table.group[self.one] == HALF_SPACES) | (self.table.group[self.two] == HALF_SPACES)
        self.radii = self.table.radius[self.one] + self.table.radius[self.two]
        robot, joints = limit.robot, self.joints.indices
        self.placements = requirements.compiled(limit, "placements", lambda: Tape(placements_function(robot, joints)))
        self.rates = None
        if robot.actuator_map is not None:
            self.rates = requirements.compiled(limit, "rates", partial(_rates, robot))

    def run(self) -> list[list[AuditRow]]:
        """One row a row of the limit, for each trajectory."""
        return [self._prove(motion) for motion in self.trajectories]

    def _prove(self, motion: Motion) -> list[AuditRow]:
        self.asked = self.limit.least(motion)
        self.allowance = float(allowance_of(np.array(self.asked), self.share))
        rows = len(self.limit.labels)
        self.attained, self.instant = np.full(rows, np.inf), np.zeros(rows)
        self.proved, self.boxes = np.full(rows, np.inf), np.zeros(rows, dtype=int)
        self.motion = motion
        pending = [self._begin()]
        while pending:
            batch = pending.pop()
            if len(batch.arc) > BATCH:
                half = len(batch.arc) // 2
                pending += [batch.take(np.arange(half, len(batch.arc))), batch.take(np.arange(half))]
                continue
            bound = self._bound(batch)
            row = self.limit.row_of[batch.pair]
            self.boxes += np.bincount(row, minlength=rows)
            keep = self._open(batch, bound) & (self.boxes[row] < self.max_arcs) & (batch.arcs.splits < MAX_SPLITS)
            np.minimum.at(self.proved, row[~keep], bound[~keep])
            if keep.any():
                pending.append(self._split(batch.take(keep)))
        return self._rows()

    def _begin(self) -> _Batch:
        curve = self.motion.curve
        parts = []
        for degree in sorted(set(curve.degrees)):
            chosen = np.array([k for k, n in enumerate(curve.degrees) if n == degree])
            points = np.array([curve.control_points[k] for k in chosen])
            parts.append(
                Arcs.of_segments(np.zeros(len(chosen), dtype=np.intp), chosen, points, curve.durations[chosen], 2)
            )
        arcs = Arcs.join(parts)
        arcs = arcs.take(np.argsort(arcs.segment))
        while len(arcs) < FIRST:
            left, right = arcs.split(np.full(len(arcs), 0.5))
            arcs = left.interleave(right)
        arc, pair = (part.ravel() for part in np.indices((len(arcs), len(self.one))))
        start, end = self._frames(arcs, 0), self._frames(arcs, -1)
        first, last = self._ends(arcs, start, arc, pair, 0), self._ends(arcs, end, arc, pair, -1)
        return _Batch(arcs, start, end, arc, pair, first, last)

    def _split(self, batch: _Batch) -> _Batch:
        """Every arc halved, with what is known at its middle."""
        left, right = batch.arcs.split(np.full(len(batch.arcs), 0.5))
        middle = self._frames(left, -1)
        found = self._ends(left, middle, batch.arc, batch.pair, -1)
        both = [_join(a, b) for a, b in ((batch.first, found), (found, batch.last))]
        return _Batch(
            left.interleave(right), batch.start.interleave(middle), middle.interleave(batch.end),
            np.concatenate([2 * batch.arc, 2 * batch.arc + 1]), np.concatenate([batch.pair, batch.pair]), *both,
        )  # fmt: skip

    def _frames(self, arcs: Arcs, which: int) -> Frames:
        return Frames.of_bounds(*self.placements.enclose(arcs.end(0, which))[0])

    def _ends(self, arcs: Arcs, frames: Frames, arc: Index, pair: Index, which: int) -> _Ends:
        """What is known at one end of the arcs, noting the least clearances."""
        found = separation(self.table, frames, arc, self.one[pair], self.two[pair])
        base = self.base[pair]
        normal = np.einsum("nij,ni->nj", frames.rotation[arc, base], found.normal)
        self._attain(arcs, arc, pair, found.clearance, which)
        return _Ends(found.apart, normal, 4.0 * frames.turn[arc, base] + 1e-14)

    def _attain(self, arcs: Arcs, arc: Index, pair: Index, clearance: Array, which: int) -> None:
        row = self.limit.row_of[pair]
        order = np.lexsort((clearance, row))
        rows, first = np.unique(row[order], return_index=True)
        best = order[first]
        better = clearance[best] < self.attained[rows]
        rows, best = rows[better], best[better]
        curve = self.motion.curve
        u = (arcs.a if which == 0 else arcs.b)[arc[best]]
        segment = arcs.segment[arc[best]]
        self.attained[rows] = clearance[best]
        self.instant[rows] = curve.knots[segment] + u * curve.durations[segment]

    def _bound(self, batch: _Batch) -> Array:
        """Lower bounds of the clearance of each pair on its arc."""
        speeds = self._speeds(batch)
        width = batch.arcs.width()
        pairs = len(self.table.joint)
        base, sides = self.base[batch.pair], []
        for body in (self.one[batch.pair], self.two[batch.pair]):
            key = (batch.arc * pairs + body) * len(self.joints.indices) + base
            _, at, back = np.unique(key, return_index=True, return_inverse=True)
            found = motion_bounds(self.joints, self.table, speeds, batch.arc[at], body[at], base[at])
            sides.append([values[back] for values in found])
        speed, acceleration = sides[0][0] + sides[1][0], sides[0][1] + sides[1][1]
        change = batch.last.normal - batch.first.normal
        turn = np.sqrt(np.einsum("ni,ni->n", change, change)) + batch.first.off + batch.last.off
        arcs = batch.arcs
        least = np.maximum((arcs.b - arcs.a - 2.0 * arcs.slack) * arcs.duration * (1.0 - 1e-15), 0.0)
        curvature = (acceleration + 2.0 * speed * turn / least[batch.arc]) * (1.0 + 1e-14)
        apart = -parabola_bound(-batch.first.apart, -batch.last.apart, curvature, width[batch.arc])
        # A half-space has a depth, by its one direction; other cores that meet are not told apart.
        apart = np.where(apart >= 0.0, apart, np.where(self.flat[batch.pair], apart * (1.0 + 1e-14), -np.inf))
        bound = np.nextafter(apart - self.radii[batch.pair] * (1.0 + 1e-15), -np.inf)
        return np.where(np.isnan(bound), -np.inf, bound)

    def _speeds(self, batch: _Batch) -> ArcMotion:
        arcs = batch.arcs
        if self.rates is None:
            rates = [arcs.hull(order) for order in (1, 2)]
        else:
            rates = list(self.rates.enclose(*(arcs.hull(order) for order in (0, 1, 2))))
        speed, acceleration = (np.maximum(-low, high) for low, high in rates)
        return ArcMotion(batch.start, batch.end, arcs.width(), speed, acceleration)

    def _open(self, batch: _Batch, bound: Array) -> NDArray[np.bool_]:
        """Which pairs and arcs to halve: not decided, and not hopeless; or what may hold the least clearance of all."""
        row = self.limit.row_of[batch.pair]
        allowed = self.asked - self.allowance
        ends = np.minimum(batch.first.apart, batch.last.apart)
        ends = np.where((ends >= 0.0) | self.flat[batch.pair], ends - self.radii[batch.pair], -np.inf)
        undecided = ~(bound >= allowed) & ~(self.attained[row] < allowed) & (ends >= allowed)
        least = float(self.attained.min()) - WIDTH
        return np.asarray(undecided | (~(bound >= least) & (ends >= least)))

    def _rows(self) -> list[AuditRow]:
        limit, asked, scale = self.limit, self.asked, self.asked or 1.0
        return [
            AuditRow(
                limit.id, label, "m", asked, float(attained), float(instant), float(proved),
                (float(proved) - asked) / scale,
                decide(-float(attained), -float(proved), self.allowance - asked), int(boxes),
                None, self.allowance,
            )
            for label, attained, instant, proved, boxes in zip(
                limit.labels, self.attained, self.instant, self.proved, self.boxes, strict=True
            )
        ]  # fmt: skip


def _join(a: _Ends, b: _Ends) -> _Ends:
    return _Ends(*(np.concatenate([getattr(a, name), getattr(b, name)]) for name in ("apart", "normal", "off")))


def _rates(robot: Any) -> Tape:
    """Velocities and accelerations of the model's joints from those of the actuators."""
    q, v, a = (casadi.SX.sym(name, robot.size) for name in "qva")
    _, rate, rate2, _ = robot._serial(q, v, a)
    return Tape(casadi.Function("rates", [q, v, a], [casadi.densify(rate), casadi.densify(rate2)]))
