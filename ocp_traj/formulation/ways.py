"""Starts that lead past obstacles: a way for each leg, from a file or planned, driven through without a stop.

They are where an optimiser begins, not via points: it may leave them, and what it ends with is proved on its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.rounded import Rounded, rounded
from ocp_traj.errors import InputError
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.paths.connecting_trees import STEP, Space, connect, shortened
from ocp_traj.robot.clearance_scan import ClearanceScan
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

PLAN, OMPL = "plan", "ompl"
MOST = 60_000  # points that a planner looks at for one leg: our choice, a few seconds
# [m] beyond what is asked, which a planner keeps from obstacles, in the order in which it is tried; but not CLOSE to
# the ends, of the norm of q / speed, which may have less: our choice.
ROOMS, CLOSE = (0.01, 0.003, 0.0), 0.1
TRIES = 2  # plans, of which the one whose rounded corners come least near, and then the quickest, is taken
SLOWER = (1.0, 1.5, 2.0, 3.0)  # than the limits allow; the first at which rounded corners come near no obstacle
TOUCHING = 1e-3  # [m] by which rounded corners may be too near and count as clear: what is left the optimiser mends
NEAR = 1e-3  # [rad or m] within which a path of a file has to pass a via point: our choice
SAMPLES = 5  # steps of the rounded motion from one look at clearances to the next


class Ways:
    """Ways from via point to via point.

    Args:
        points: via points ``(L + 1, n)``.
        robot: with its limits.
        clearances: what it keeps.
        planner: ``PLAN`` for trees of our own, ``OMPL`` for OMPL's.
        given: a path through all via points in place of one that is planned ``(W, n)``.
        name: of the task, for complaints.
    """

    def __init__(
        self, points: Array, robot: Robot, clearances: Sequence[ClearanceConstraint], planner: str = PLAN,
        given: Array | None = None, name: str = "the task",
    ) -> None:  # fmt: skip
        """Checks that a given path passes the via points."""
        self.points, self.robot, self.clearances, self.planner = points, robot, clearances, planner
        self._given = None if given is None else _legs_of(given, points, robot, name)
        self._scans: dict[float, ClearanceScan] = {}
        self.looked = 0  # how many points the last search looked at

    def __call__(self, begin: int, end: int, rng: np.random.Generator) -> Rounded | None:
        """A motion from via point ``begin`` to ``end``, past those between; None where no way was found.

        Args:
            begin: where it begins at rest.
            end: where it ends.
            rng: of what is random.
        """
        if self._given is not None:
            return self._driven(self._given[begin:end])
        found: list[tuple[float, float, int, Rounded]] = []
        for _ in range(TRIES):
            legs = [self.planned(i, rng) for i in range(begin, end)]
            ways = [leg for leg in legs if leg is not None]
            if len(ways) == len(legs):
                motion = self._driven(ways)
                short = max(0.0, -self._least(motion) - TOUCHING)
                found.append((short, motion.duration, len(found), motion))
        return min(found)[3] if found else None

    def planned(
        self, leg: int, rng: np.random.Generator, short: bool = True, vain: set[float] | None = None
    ) -> Array | None:
        """A way ``(W, n)`` from one via point to the next; None where none was found.

        Args:
            leg: from which via point.
            rng: of what is random.
            short: whether it is shortened.
            vain: rooms not to look for again, to which those are added in which there was no way.
        """
        vain = set() if vain is None else vain
        start, goal = self.points[leg], self.points[leg + 1]
        for room in (room for room in ROOMS if room not in vain):
            space = self.space(start, goal, room)
            if self.planner == OMPL:
                from ocp_traj.paths.ompl_planner import ompl_path  # an extra that few have

                path = ompl_path(space, start, goal, int(rng.integers(2**31 - 1)), MOST)
            else:
                path = connect(space, start, goal, rng, MOST if room == 0.0 else MOST // 4)
            self.looked = space.looked
            if path is not None:
                return shortened(space, path, rng) if short else path
            if room:
                vain.add(room)
        return None

    def given(self, leg: int) -> Array | None:
        """The way of a leg that was given, if one was."""
        return None if self._given is None else self._given[leg]

    def space(self, start: Array, goal: Array, room: float = 0.0, step: float = STEP) -> Space:
        """Joint space between two points, and what is clear in it; some room to obstacles but close to these."""
        plain, ends = self.scan(0.0).clear, np.array([start, goal])
        roomy, scale = self.scan(room).clear, self._speeds

        def clear(q: Array) -> Array:
            found = np.array(roomy(q), dtype=bool)
            close = np.linalg.norm((q[:, None] - ends) / scale, axis=2).min(axis=1) <= CLOSE
            if (again := np.flatnonzero(close & np.logical_not(found))).size:
                found[again] = plain(q[again])
            return found

        return Space(*self._box(start, goal), scale, clear if room else plain, step)

    def scan(self, room: float) -> ClearanceScan:
        """Clearances less what is asked for, and less some room to what does not move."""
        if room not in self._scans:
            self._scans[room] = self._scan(room)
        return self._scans[room]

    def _scan(self, room: float) -> ClearanceScan:
        pairs, asked = [], []
        for limit in self.clearances:
            for i, j in limit.pairs:
                pair = limit.bodies[i], limit.bodies[j]
                pairs.append(pair)
                asked.append(limit.clearance + (room if 0 in (pair[0].joint, pair[1].joint) else 0.0))
        return ClearanceScan(self.robot, pairs, asked)

    def _least(self, motion: Rounded) -> float:
        return float(self.scan(0.0).least(motion.states[::SAMPLES, 0]).min())

    def _driven(self, ways: Sequence[Array]) -> Rounded:
        """The motion along ways, one after the other, no slower than it has to be for its corners to be clear."""
        points = np.concatenate([ways[0][:1], *(way[1:] for way in ways)])
        speed, acceleration, jerk = (
            np.full(self.robot.size, np.inf) if reach is None else reach
            for reach in (_reach(self.robot.limits, order) for order in (1, 2, 3))
        )
        passed = np.cumsum([0, *(len(way) - 1 for way in ways)])
        tries: list[tuple[float, int, Rounded]] = []
        for slower in SLOWER:
            motion = rounded(points, speed, acceleration, jerk, slower)
            motion = Rounded(motion.times, motion.states, motion.passed[passed])
            if not self.clearances:
                return motion
            least = min(self._least(motion) + TOUCHING, 0.0)
            tries.append((-least, len(tries), motion))
            if least == 0.0:
                break
        return min(tries)[2]

    @property
    def _speeds(self) -> Array:
        """By which a planner measures distances ``(n,)``."""
        reach = _reach(self.robot.limits, 1)
        return np.ones(self.robot.size) if reach is None or not np.isfinite(reach).all() else reach

    def _box(self, start: Array, goal: Array) -> tuple[Array, Array]:
        """Where a planner looks: within the limits on position, and half a turn of the ends."""
        low, high = np.minimum(start, goal) - np.pi, np.maximum(start, goal) + np.pi
        pair = self.robot.limits.bounds(0)
        if pair is None:
            return low, high
        return np.maximum(pair[0], low), np.minimum(pair[1], high)


def reach_of(limits: JointLimits) -> Array:
    """The least bound, of both ways, on derivatives 1 to 4 of each joint ``(4, n)``; infinite where there is none."""
    known = [_reach(limits, order) for order in range(1, 5)]
    size = next((len(reach) for reach in known if reach is not None), limits.size or 1)
    return np.array([np.full(size, np.inf) if reach is None else reach for reach in known])


def _reach(limits: JointLimits, order: int) -> Array | None:
    pair = limits.bounds(order)
    return None if pair is None else np.minimum(-pair[0], pair[1])


def _legs_of(path: Array, points: Array, robot: Robot, name: str) -> list[Array]:
    """A path cut where it passes the via points, which replace those of it that are near them."""
    knots, legs, first = path.copy(), [], 0
    for i, point in enumerate(points):
        rest = np.abs(knots[first:] - point).max(axis=1)
        where = int(np.argmin(rest)) if i < len(points) - 1 else len(rest) - 1
        if i == 0:
            where = 0
        if not rest[where] <= NEAR:
            off = int(np.argmax(np.abs(knots[first + where] - point)))
            words = "begins" if i == 0 else "ends" if i == len(points) - 1 else "comes as near as"
            raise InputError(
                f"{name}: [solve] start {words} {rest[where]:.4g} {robot.units[off]} of {robot.joints[off]} from point "
                f"{i + 1} of [[move]]; give a path that passes all points of the moves, in their order"
            )
        if i:
            leg = np.concatenate([points[i - 1 : i], knots[first + 1 : first + where], points[i : i + 1]])
            legs.append(leg[np.concatenate([[True], (np.diff(leg, axis=0) != 0.0).any(axis=1)])])
        first += where
    return legs
