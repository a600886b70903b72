"""Signed distances of pairs of bodies fixed to a robot's joints or to the world, at many postures at once.

Which points, edges or faces are nearest at a posture (see ``separation``) is told in the frames of the joints that
carry the bodies: with these numbers held, ``expression`` is the distance as a smooth function of the posture, exact
there, with its slopes; to second order as well where no face of a core is curved or turns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import casadi
import coal
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.mapped import Mapped
from ocp_traj.robot.bodies import BOX, CAPSULE, CYLINDER, HALF_SPACE, SPHERE, Body
from ocp_traj.robot.body_distances import BOXES, CYLINDERS, HALF_SPACES, SEGMENTS, Cores, nearest
from ocp_traj.robot.cylinder_separation import cylinder_plane, segment_cylinder
from ocp_traj.robot.pair_bounds import PairBounds
from ocp_traj.robot.placements import placements_function
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.separation import (
    TOUCHING,
    Nearest,
    box_plane,
    segment_box,
    segment_plane,
    segment_segment,
)

CONSTANTS = 17  # point, edge; point, edge, normal; flat, radius: what is nearest at a posture is told by
ORDER = {SPHERE: 0, CAPSULE: 0, CYLINDER: 1, BOX: 2, HALF_SPACE: 3}  # which body of a pair comes first
GROUPS = (SEGMENTS, CYLINDERS, BOXES, HALF_SPACES)  # of ``body_distances``, in that order


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
        self.pairs = [pair if ORDER[pair[0].kind] <= ORDER[pair[1].kind] else pair[::-1] for pair in pairs]
        kinds = [(ORDER[a.kind], ORDER[b.kind]) for a, b in self.pairs]
        self._kinds = {kind: i for i, kind in enumerate(dict.fromkeys(kinds))}
        self._kind = np.array([self._kinds[kind] for kind in kinds], dtype=np.intp)
        self.joints = np.array([[a.joint, b.joint] for a, b in self.pairs], dtype=np.intp).reshape(-1, 2)
        self.radius = np.array([a.radius + b.radius for a, b in self.pairs])
        self._carriers: Index = np.unique(self.joints)
        self._frames = Mapped(placements_function(robot, self._carriers.tolist()))
        bodies = [[pair[side] for pair in self.pairs] for side in (0, 1)]
        self._centre = [np.array([b.centre for b in own]).reshape(-1, 3) for own in bodies]
        self._axes = [np.array([b.axes for b in own]).reshape(-1, 3, 3) for own in bodies]
        self._half = [np.array([b.half for b in own]).reshape(-1, 3) for own in bodies]
        self._bounds = PairBounds(self.pairs, self._carriers)

    def placements(self, q: Array) -> tuple[Array, Array]:
        """Rotations ``(N, joints, 3, 3)`` and places ``(N, joints, 3)`` of joints with bodies, at postures."""
        found = self._frames(q)[0].reshape(len(q), -1, 12).copy()
        return found[:, :, :9].reshape(len(q), -1, 3, 3), found[:, :, 9:]

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
        found = Nearest.empty(len(q))
        for kinds, number in self._kinds.items():
            here = np.flatnonzero(self._kind[rows] == number)
            if len(here):
                a, b = (self._world(side, here, rows[here], rotations, places) for side in (0, 1))
                method = _METHODS.get(kinds)
                found.put(here, _in_general(kinds, a, b) if method is None else method(a, b))
        return found

    def _world(self, side: int, here: Index, rows: Index, rotations: Array, places: Array) -> _Cores:
        carrier = np.searchsorted(self._carriers, self.joints[rows, side])
        turn = rotations[here, carrier]
        centre = np.einsum("nij,nj->ni", turn, self._centre[side][rows]) + places[here, carrier]
        return _Cores(centre, turn @ self._axes[side][rows], self._half[side][rows])

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


class _Cores:
    """Cores in the world.

    Attributes:
        centre: ``(N, 3)``.
        axes: ``(N, 3, 3)``, columns.
        half: ``(N, 3)``.
    """

    def __init__(self, centre: Array, axes: Array, half: Array) -> None:
        self.centre, self.axes, self.half = centre, axes, half

    @property
    def ends(self) -> Array:
        """Of segments along the third axis ``(N, 2, 3)``."""
        reach = self.half[:, 2:] * self.axes[:, :, 2]
        return np.stack([self.centre - reach, self.centre + reach], axis=1)

    @property
    def box(self) -> tuple[Array, Array, Array]:
        """Centre, axes and half lengths."""
        return self.centre, self.axes, self.half

    @property
    def plane(self) -> tuple[Array, Array]:
        """Normal ``(N, 3)`` and offset ``(N,)`` of half-spaces normal . x <= offset."""
        normal = self.axes[:, :, 2]
        return normal, (normal * self.centre).sum(axis=1)


def _in_general(kinds: tuple[int, int], a: _Cores, b: _Cores) -> Nearest:
    """Of kinds that have no method of their own here, such as two cylinders: by points and a normal that stays."""
    count = len(a.centre)
    cores = [Cores(np.full(count, GROUPS[kind]), *own.box) for kind, own in zip(kinds, (a, b), strict=True)]
    x, y, normal = nearest(*cores)
    none = np.zeros_like(x)
    distance = ((x - y) * normal).sum(axis=1)
    for i in np.flatnonzero(distance <= TOUCHING).tolist():  # that they meet is known, not how deep
        shapes = [_shape(kind, own.half[i]) for kind, own in zip(kinds, (a, b), strict=True)]
        poses = [coal.Transform3s(own.axes[i], own.centre[i]) for own in (a, b)]
        result = coal.DistanceResult()
        depth = coal.distance(shapes[0], poses[0], shapes[1], poses[1], coal.DistanceRequest(), result)
        if depth < 0.0:
            distance[i], normal[i] = depth, -np.asarray(result.normal).ravel()
            x[i], y[i] = result.getNearestPoint1(), result.getNearestPoint2()
    return Nearest(distance, x, y, none, none, normal, np.ones(count), np.zeros(count))


def _shape(kind: int, half: Array) -> Any:
    """A cylinder or box about the origin, as ``coal`` has it."""
    return coal.Cylinder(float(half[0]), 2.0 * float(half[2])) if kind == ORDER[CYLINDER] else coal.Box(*(2.0 * half))


_METHODS: dict[tuple[int, int], Callable[[_Cores, _Cores], Nearest]] = {
    (0, 0): lambda a, b: segment_segment(a.ends, b.ends),
    (0, 1): lambda a, b: segment_cylinder(a.ends, *b.box),
    (0, 2): lambda a, b: segment_box(a.ends, *b.box),
    (0, 3): lambda a, b: segment_plane(a.ends, *b.plane),
    (1, 3): lambda a, b: cylinder_plane(*a.box, *b.plane),
    (2, 3): lambda a, b: box_plane(*a.box, *b.plane),
}
