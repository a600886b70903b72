"""Signed distances of pairs of bodies fixed to a robot's joints or to the world, at many postures at once.

Which points, edges or faces are nearest at a posture (``nearest_features``) is told in the frames of the joints that
carry the bodies: with these numbers held, ``expression`` is the distance as a smooth function of the posture, exact
there, with its slopes; to second order as well where no face of a core is curved or turns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.mapped import Mapped
from ocp_traj.robot.bodies import Body
from ocp_traj.robot.cores import Cores, group_of
from ocp_traj.robot.nearest_features import Nearest, nearest_features
from ocp_traj.robot.pair_bounds import PairBounds
from ocp_traj.robot.placements import placements_function
from ocp_traj.robot.robot import Robot

CONSTANTS = 17  # point, edge; point, edge, normal; flat, radius: what is nearest at a posture is told by


class PairDistances:
    """Distances of pairs of bodies.

    Args:
        robot: whose joints carry them.
        pairs: of bodies, one at least on a joint that moves.

    Attributes:
        pairs: the same, each with the simpler body first.
        joints: that carry them ``(pairs, 2)``.
        radius: sum of the radii by which the cores are grown ``(pairs,)`` [m].
    """

    def __init__(self, robot: Robot, pairs: Sequence[tuple[Body, Body]]) -> None:
        """Puts the numbers of all pairs in arrays."""
        self.robot = robot
        self.pairs = [pair if group_of(pair[0]) <= group_of(pair[1]) else pair[::-1] for pair in pairs]
        self.joints = np.array([[a.joint, b.joint] for a, b in self.pairs], dtype=np.intp).reshape(-1, 2)
        self.radius = np.array([a.radius + b.radius for a, b in self.pairs])
        self._carriers: Index = np.unique(self.joints)
        self._frames = Mapped(placements_function(robot, self._carriers.tolist()))
        bodies = [[pair[side] for pair in self.pairs] for side in (0, 1)]
        self._centre = [np.array([b.centre for b in own]).reshape(-1, 3) for own in bodies]
        self._axes = [np.array([b.axes for b in own]).reshape(-1, 3, 3) for own in bodies]
        half = [np.array([b.half for b in own]).reshape(-1, 3) for own in bodies]
        self._half = [np.where(np.isfinite(own), own, 0.0) for own in half]
        self._group = [np.array([group_of(b) for b in own], dtype=np.intp) for own in bodies]
        self._bounds = PairBounds(self.pairs, self._carriers)

    def placements(self, q: Array) -> tuple[Array, Array]:
        """Rotations ``(N, joints, 3, 3)`` and places ``(N, joints, 3)`` of joints with bodies, at postures."""
        found = self._frames(q)[0].reshape(len(q), len(self._carriers), 12).copy()
        return found[:, :, :9].reshape(*found.shape[:2], 3, 3), found[:, :, 9:]

    def at_least(self, q: Array) -> Array:
        """What the distances ``(N, pairs)`` are at least, quickly; see ``pair_bounds``."""
        return self._bounds(*self.placements(q))

    def least(self, q: Array) -> Array:
        """The least distance of all pairs at postures ``(N, dof)``: ``(N,)`` [m]."""
        placed = self.placements(q)
        bound, every = self._bounds(*placed), np.arange(len(q))
        first = bound.argmin(axis=1)
        found = np.asarray(self.nearest(q, first, placed).distance - self.radius[first])
        bound[every, first] = np.inf
        at, rows = np.nonzero(bound < found[:, None])  # of the others, those that may be nearer still
        if len(at):
            others = self.nearest(q[at], rows, (placed[0][at], placed[1][at])).distance - self.radius[rows]
            np.minimum.at(found, at, others)
        return found

    def nearest(self, q: Array, rows: Index, placed: tuple[Array, Array] | None = None) -> Nearest:
        """What is nearest of the cores of pair ``rows[i]`` at posture ``q[i]``.

        Args:
            q: postures ``(N, dof)``.
            rows: pairs ``(N,)``.
            placed: ``placements(q)``, where they are known.
        """
        rotations, places = self.placements(q) if placed is None else placed
        a, b = (self._cores(side, rows, rotations, places) for side in (0, 1))
        return nearest_features(a, b)

    def _cores(self, side: int, rows: Index, rotations: Array, places: Array) -> Cores:
        carrier, each = np.searchsorted(self._carriers, self.joints[rows, side]), np.arange(len(rows))
        turn = rotations[each, carrier]
        centre = np.einsum("nij,nj->ni", turn, self._centre[side][rows]) + places[each, carrier]
        return Cores(self._group[side][rows], centre, turn @ self._axes[side][rows], self._half[side][rows])

    def distances(self, q: Array, rows: Index) -> Array:
        """Signed distances ``(N,)`` [m] of pair ``rows[i]`` at posture ``q[i]``."""
        return np.asarray(self.nearest(q, rows).distance - self.radius[rows])

    def constants(self, q: Array, rows: Index) -> Array:
        """What is nearest, in the frames of the bodies' joints ``(N, CONSTANTS)``; see ``expression``."""
        placed = self.placements(q)
        found = self.nearest(q, rows, placed)
        parts = []
        for side, point, vectors in (
            (0, found.point_a, (found.edge_a,)), (1, found.point_b, (found.edge_b, found.normal)),
        ):  # fmt: skip
            carrier = np.searchsorted(self._carriers, self.joints[rows, side])
            index = np.arange(len(q))
            turn, place = placed[0][index, carrier], placed[1][index, carrier]
            parts += [np.einsum("nji,nj->ni", turn, v) for v in (point - place, *vectors)]
        return np.column_stack([*parts, found.flat, found.grown + self.radius[rows]])

    @cached_property
    def expressions(self) -> list[Callable[[Any, Any], Any]]:
        """(q ``(dof,)``, c ``(CONSTANTS,)``) -> distance of each pair; the same object for the same joints."""
        made = {joints: self._expression(*joints) for joints in dict.fromkeys(map(tuple, self.joints.tolist()))}
        return [made[a, b] for a, b in self.joints.tolist()]

    def _expression(self, joint_a: int, joint_b: int) -> Callable[[Any, Any], Any]:
        def distance(q: Any, c: Any) -> Any:
            (turn_a, place_a), (turn_b, place_b) = (self.robot.joint_pose(q, joint) for joint in (joint_a, joint_b))
            point_a, edge_a, point_b, edge_b, normal = (c[3 * i : 3 * i + 3] for i in range(5))
            flat, radius = c[15], c[16]
            apart = casadi.mtimes(turn_a, point_a) + place_a - casadi.mtimes(turn_b, point_b) - place_b
            e_a, e_b = casadi.mtimes(turn_a, edge_a), casadi.mtimes(turn_b, edge_b)
            along_a, along_b, between = casadi.dot(e_a, apart), casadi.dot(e_b, apart), casadi.dot(e_a, e_b)
            within = (along_a**2 + along_b**2 - 2.0 * along_a * along_b * between) / (1.0 - between**2)
            direct = casadi.sqrt(casadi.sumsqr(apart) - within + flat)  # flat: so that the unused root has slopes
            along_normal = casadi.dot(casadi.mtimes(turn_b, normal), apart)
            return flat * along_normal + (1.0 - flat) * direct - radius

        return distance
