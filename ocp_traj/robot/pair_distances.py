"""Signed distances of pairs of convex bodies fixed to a robot's joints or to the world, at many postures at once.

A body is a core (a segment, a box or a half-space) grown by a radius. What the distance at a posture depends on, the
features that are nearest there (see ``separation``), is told in the frames of the joints that carry the bodies: with
these numbers held, ``expression`` is the distance as a smooth function of the posture, exact there to second order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi
import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array, Index
from ocp_traj.robot.dynamics import forward_kinematics
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.separation import Nearest, box_plane, segment_box, segment_plane, segment_segment

CONSTANTS = 17  # point, edge; point, edge, normal; flat, radius: what the features at a posture are told by


@dataclass(frozen=True, eq=False)
class Core:
    """What a body is grown from, in the frame of the joint that carries it.

    Attributes:
        kind: ``segment`` (a point is one without length), ``box`` or ``plane``.
        joint: index of the joint in the robot's model, 0 for the world.
        points: a segment's ends ``(2, 3)``; of a box its centre ``(1, 3)``; of a half-space its normal ``(1, 3)``.
        radius: by which it is grown [m].
        rotation: of a box ``(3, 3)``, its columns the axes.
        half: of a box half its sizes ``(3,)``; of a half-space normal . x <= offset that offset ``(1,)``.
    """

    kind: str
    joint: int
    points: Array
    radius: float = 0.0
    rotation: Array | None = None
    half: Array | None = None

    @cached_property
    def ball(self) -> tuple[Array, float]:
        """Centre ``(3,)`` and radius of a ball that holds the body; the radius is infinite for a half-space."""
        if self.kind == "segment":
            return self.points.mean(axis=0), 0.5 * float(np.linalg.norm(self.points[1] - self.points[0])) + self.radius
        if self.kind == "box":
            assert self.half is not None
            return self.points[0], float(np.linalg.norm(self.half)) + self.radius
        return np.zeros(3), np.inf


_ORDER = {"segment": 0, "box": 1, "plane": 2}


class PairDistances:
    """Distances of pairs of bodies.

    Args:
        robot: whose joints carry them.
        pairs: of bodies, one at least on a joint that moves.
    """

    def __init__(self, robot: Robot, pairs: Sequence[tuple[Core, Core]]) -> None:
        self.robot = robot
        self.pairs = [pair if _ORDER[pair[0].kind] <= _ORDER[pair[1].kind] else pair[::-1] for pair in pairs]
        kinds = [(a.kind, b.kind) for a, b in self.pairs]
        self._kinds = {kind: i for i, kind in enumerate(dict.fromkeys(kinds))}
        self._kind = np.array([self._kinds[kind] for kind in kinds], dtype=np.intp)
        self.joints = np.array([[a.joint, b.joint] for a, b in self.pairs], dtype=np.intp).reshape(-1, 2)
        self.radius = np.array([a.radius + b.radius for a, b in self.pairs])
        self._data = [self._stacked(side) for side in (0, 1)]

    def _stacked(self, side: int) -> dict[str, Array]:
        """The numbers of all cores on one side, in arrays over the pairs."""
        cores = [pair[side] for pair in self.pairs]
        return {
            "points": np.stack([np.broadcast_to(c.points, (2, 3)) for c in cores]),
            "rotation": np.stack([np.eye(3) if c.rotation is None else c.rotation for c in cores]),
            "half": np.stack([np.zeros(3) if c.half is None else np.broadcast_to(c.half, (3,)) for c in cores]),
        }

    @cached_property
    def _frames(self) -> Any:
        """Casadi Function q -> rotations and places of all joints that carry a body, stacked ``(12 joints,)``."""
        q = casadi.SX.sym("q", self.robot.size)
        parts = [casadi.vertcat(casadi.vec(r), p) for r, p in (self.frame(q, int(j)) for j in self._carriers)]
        return casadi.Function("frames", [q], [casadi.densify(casadi.vertcat(*parts))])

    @cached_property
    def _carriers(self) -> Index:
        return np.unique(self.joints)

    def frame(self, q: Any, joint: int) -> tuple[Any, Any]:
        """Rotation ``(3, 3)`` and place ``(3,)`` of a joint's frame in the world, symbolic; of the world for 0."""
        if joint == 0:
            return casadi.SX.eye(3), casadi.SX.zeros(3)
        zero = casadi.SX.zeros(self.robot.size)
        return forward_kinematics(self.robot.model, self.robot._serial(q, zero, zero)[0], joint, pin.SE3.Identity())

    def placements(self, q: Array) -> tuple[Array, Array]:
        """Rotations ``(N, joints, 3, 3)`` and places ``(N, joints, 3)`` of the carriers at postures ``(N, dof)``."""
        found = np.array(self._frames.map(len(q))(q.T)).T.reshape(len(q), -1, 12)
        return found[:, :, :9].reshape(len(q), -1, 3, 3).swapaxes(2, 3), found[:, :, 9:]

    def at_least(self, q: Array) -> Array:
        """What the distances ``(N, pairs)`` are at least, by balls about the bodies; -inf beside a half-space."""
        rotations, places = self.placements(q)
        centres, radii = [], []
        for side in (0, 1):
            balls = [pair[side].ball for pair in self.pairs]
            local = np.array([centre for centre, _ in balls])
            carrier = np.searchsorted(self._carriers, self.joints[:, side])
            centres.append(np.einsum("npij,pj->npi", rotations[:, carrier], local) + places[:, carrier])
            radii.append(np.array([radius for _, radius in balls]))
        return np.asarray(np.linalg.norm(centres[0] - centres[1], axis=2) - radii[0] - radii[1])

    def nearest(self, q: Array, rows: Index, placed: tuple[Array, Array] | None = None) -> Nearest:
        """What is nearest of pair ``rows[i]`` at posture ``q[i]``: the cores', without their radii.

        Args:
            q: postures ``(N, dof)``.
            rows: pairs ``(N,)``.
            placed: ``placements(q)``, where they are known.
        """
        rotations, places = self.placements(q) if placed is None else placed
        found = Nearest.empty(len(q))
        for (kind_a, kind_b), number in self._kinds.items():
            here = np.flatnonzero(self._kind[rows] == number)
            if len(here):
                sides = [self._world(side, here, rows[here], rotations, places) for side in (0, 1)]
                found.put(here, _METHODS[kind_a, kind_b](*sides))
        return found

    def _world(self, side: int, here: Index, rows: Index, rotations: Array, places: Array) -> dict[str, Array]:
        carrier = np.searchsorted(self._carriers, self.joints[rows, side])
        turn, place = rotations[here, carrier], places[here, carrier]
        data = {name: values[rows] for name, values in self._data[side].items()}
        turned = np.einsum("nij,nkj->nki", turn, data["points"])
        return {
            "points": turned + place[:, None], "rotation": turn @ data["rotation"], "half": data["half"],
            "normal": turned[:, 0], "offset": data["half"][:, 0] + (turned[:, 0] * place).sum(axis=1),
        }  # fmt: skip

    def distances(self, q: Array, rows: Index) -> Array:
        """Signed distances ``(N,)`` [m] of pair ``rows[i]`` at posture ``q[i]``."""
        return np.asarray(self.nearest(q, rows).distance - self.radius[rows])

    def constants(self, q: Array, rows: Index) -> Array:
        """The features that are nearest, in the frames of the bodies' joints ``(N, CONSTANTS)``: see ``expression``."""
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
        return np.concatenate([*parts, found.flat[:, None], self.radius[rows][:, None]], axis=1)

    def expression(self, joint_a: int, joint_b: int) -> Callable[[Any, Any], Any]:
        """(q, c) -> the distance of bodies on two joints, symbolic, by the features c ``(CONSTANTS,)``."""

        def distance(q: Any, c: Any) -> Any:
            (turn_a, place_a), (turn_b, place_b) = self.frame(q, joint_a), self.frame(q, joint_b)
            point_a, edge_a, point_b, edge_b, normal = (c[3 * i : 3 * i + 3] for i in range(5))
            flat, radius = c[15], c[16]
            apart = casadi.mtimes(turn_a, point_a) + place_a - casadi.mtimes(turn_b, point_b) - place_b
            e_a, e_b = casadi.mtimes(turn_a, edge_a), casadi.mtimes(turn_b, edge_b)
            along_a, along_b, between = casadi.dot(e_a, apart), casadi.dot(e_b, apart), casadi.dot(e_a, e_b)
            within = (along_a**2 + along_b**2 - 2.0 * along_a * along_b * between) / (1.0 - between**2)
            round_ = casadi.sqrt(casadi.sumsqr(apart) - within + flat)  # flat: a root with a slope, which is not used
            straight = casadi.dot(casadi.mtimes(turn_b, normal), apart)
            return flat * straight + (1.0 - flat) * round_ - radius

        return distance


_METHODS: dict[tuple[str, str], Callable[[dict[str, Array], dict[str, Array]], Nearest]] = {
    ("segment", "segment"): lambda a, b: segment_segment(a["points"], b["points"]),
    ("segment", "box"): lambda a, b: segment_box(a["points"], b["points"][:, 0], b["rotation"], b["half"]),
    ("segment", "plane"): lambda a, b: segment_plane(a["points"], b["normal"], b["offset"]),
    ("box", "plane"): lambda a, b: box_plane(
        a["points"][:, 0], a["rotation"], a["half"], b["normal"], b["offset"]
    ),
}  # fmt: skip
