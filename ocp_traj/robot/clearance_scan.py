"""How near bodies come to each other, of many postures at once and in little time: for planners, and to choose starts.

A body on a joint that moves counts as balls along its longest axis: a sphere and a capsule are held by theirs up to
``SAG`` of the radius, a box and a cylinder are rounded. What is found is close, and no proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.mapped import Mapped
from ocp_traj.robot.bodies import CYLINDER, Body
from ocp_traj.robot.placements import placements_function
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.signed_distance import outside

SAG = 0.05  # of the radius, by which balls along a capsule fall short of it between two: our choice
CHUNK = 256  # postures at once: the arrays stay in the processor's cache
SIZES = (1, 16, 64, CHUNK)  # numbers of postures that there are functions for, the missing ones filled up


@dataclass(frozen=True, eq=False)
class _Group:
    """What is fixed to one joint: balls, and one ball around them, in the joint's frame."""

    joint: int
    centres: Array
    radii: Array
    middle: Array
    reach: float


class ClearanceScan:
    """Clearances of pairs of bodies, less what is asked for.

    Args:
        robot: that carries them.
        pairs: of bodies, one of which moves.
        asked: of each pair [m].
    """

    def __init__(self, robot: Robot, pairs: Sequence[tuple[Body, Body]], asked: Sequence[float]) -> None:
        """Sorts the pairs by what they are fixed to."""
        moving = {id(b): b for pair in pairs for b in pair if b.joint}
        fixed = {id(b): b for pair in pairs for b in pair if not b.joint}
        self._joints = sorted({b.joint for b in moving.values()})
        self._frames = Mapped(placements_function(robot, self._joints))
        balls = {key: _balls(body) for key, body in moving.items()}
        self._size = robot.size
        wanted: dict[tuple[int, int], list[tuple[int, float]]] = {}  # (joint, fixed body) -> bodies there
        own: dict[tuple[int, int], list[tuple[int, int, float]]] = {}  # two joints -> pairs of bodies there
        for (a, b), margin in zip(pairs, asked, strict=True):
            if a.joint and b.joint:
                first, second = (a, b) if a.joint <= b.joint else (b, a)
                own.setdefault((first.joint, second.joint), []).append((id(first), id(second), margin))
            else:
                mover, other = (a, b) if a.joint else (b, a)
                wanted.setdefault((mover.joint, id(other)), []).append((id(mover), margin))
        self._obstacles = [
            (_group(joint, [(balls[key], margin) for key, margin in bodies]), fixed[other])
            for (joint, other), bodies in wanted.items()
        ]
        self._own: list[tuple[_Group, _Group, Array]] = []
        for joints, entries in own.items():
            sides: tuple[list[tuple[Array, Array]], ...] = ([], [])
            margins = []
            for one, two, margin in entries:
                (pa, ra), (pb, rb) = balls[one], balls[two]
                i, j = (x.ravel() for x in np.indices((len(pa), len(pb))))
                sides[0].append((pa[i], ra[i]))
                sides[1].append((pb[j], rb[j]))
                margins.append(np.full(len(i), margin))
            first_group, second_group = (
                _around(joint, *(np.concatenate(parts) for parts in zip(*side, strict=True)))
                for joint, side in zip(joints, sides, strict=True)
            )
            self._own.append((first_group, second_group, np.concatenate(margins)))

    def clear(self, q: Array) -> Array:
        """Whether all pairs keep what is asked for at postures ``(N, n)``, ``(N,)``."""
        return np.concatenate([self._clear(q[i : i + CHUNK]) for i in range(0, len(q), CHUNK)])

    def least(self, q: Array) -> Array:
        """The least clearance of all pairs, less what is asked for, at postures ``(N, n)``, ``(N,)`` [m]."""
        return np.concatenate([self._least(q[i : i + CHUNK]) for i in range(0, len(q), CHUNK)])

    def _placed(self, q: Array) -> dict[int, tuple[Array, Array]]:
        """Rotations ``(N, 3, 3)`` and places ``(N, 3)`` of the joints."""
        size = next(size for size in SIZES if len(q) <= size)
        padded = np.zeros((size, self._size))
        padded[: len(q)] = q
        found = self._frames(padded)[0][: len(q)].reshape(len(q), -1, 12).copy()  # overwritten by the next call
        turned = found[:, :, :9].reshape(len(q), -1, 3, 3)
        return {joint: (turned[:, k], found[:, k, 9:]) for k, joint in enumerate(self._joints)}

    def _clear(self, q: Array) -> Array:
        placed, clear = self._placed(q), np.ones(len(q), dtype=bool)
        for group, body in self._obstacles:
            turn, place = placed[group.joint]
            near = outside(body, turn @ group.middle + place) <= group.reach
            here = np.flatnonzero(near & clear)
            if len(here):
                points = group.centres @ turn[here].swapaxes(1, 2) + place[here, None]
                clear[here] = (outside(body, points) - group.radii).min(axis=1) >= 0.0
        for one, other, margin in self._own:
            (turn_a, place_a), (turn_b, place_b) = placed[one.joint], placed[other.joint]
            apart = turn_a @ one.middle + place_a - turn_b @ other.middle - place_b
            here = np.flatnonzero(((apart**2).sum(1) <= (one.reach + other.reach + margin.max()) ** 2) & clear)
            if len(here):
                clear[here] = _between(one, other, placed, here, margin).min(axis=1) >= 0.0
        return clear

    def _least(self, q: Array) -> Array:
        placed, least = self._placed(q), np.full(len(q), np.inf)
        everywhere = np.arange(len(q))
        for group, body in self._obstacles:
            turn, place = placed[group.joint]
            points = group.centres @ turn.swapaxes(1, 2) + place[:, None]
            least = np.minimum(least, (outside(body, points) - group.radii).min(axis=1))
        for one, other, margin in self._own:
            least = np.minimum(least, _between(one, other, placed, everywhere, margin).min(axis=1))
        return least


def _between(one: _Group, other: _Group, placed: dict[int, tuple[Array, Array]], here: Index, margin: Array) -> Array:
    """Clearances of the pairs of balls of two joints ``(len(here), pairs)``, less the margin."""
    points = []
    for group in (one, other):
        turn, place = placed[group.joint]
        points.append(group.centres @ turn[here].swapaxes(1, 2) + place[here, None])
    return np.asarray(np.linalg.norm(points[0] - points[1], axis=2) - one.radii - other.radii - margin)


def _balls(body: Body) -> tuple[Array, Array]:
    """Centres ``(K, 3)`` and radii ``(K,)`` of balls along the longest axis of a body."""
    half = np.where(np.arange(3) == 2, body.half, 0.0) if body.kind == CYLINDER else np.asarray(body.half)
    longest = int(np.argmax(half))
    others = np.delete(body.half, longest)
    radius = body.radius + float(np.hypot(*others)) if body.radius == 0.0 else body.radius + float(others.max())
    if body.kind == CYLINDER:
        radius = body.radius + float(body.half[0])
    step = 2.0 * radius * np.sqrt(SAG * (2.0 - SAG))
    count = max(1, int(np.ceil(2.0 * half[longest] / step)) + 1) if half[longest] > 0.0 else 1
    along = np.linspace(-half[longest], half[longest], count)[:, None]
    return body.centre + along * body.axes[:, longest], np.full(count, radius)


def _group(joint: int, bodies: Sequence[tuple[tuple[Array, Array], float]]) -> _Group:
    """Balls of bodies grown by what is asked of each."""
    return _around(
        joint,
        np.concatenate([centres for (centres, _), _ in bodies]),
        np.concatenate([radii + margin for (_, radii), margin in bodies]),
    )


def _around(joint: int, centres: Array, radii: Array) -> _Group:
    middle = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
    return _Group(joint, centres, radii, middle, float((np.linalg.norm(centres - middle, axis=1) + radii).max()))
