"""What is certain of the distance of two bodies at an instant: a lower bound by a direction, an upper by two points.

For a vector n with |n| <= 1 the least ``n . (x - y)`` over the cores, x of the first and y of the second, is a bound of
their distance from below where it is not negative; the distance of any two of their points is one from above. Where n
comes from does not matter. Placements are enclosed by the interval tape, and what floats round is bounded:

* a core's points are within ``2 (e_p + e_R s) + 128 u S`` of where floats place them, where e_p and e_R are the half
  widths of the enclosed position and rotation, s the sum of sizes of centre and half lengths in the joint's frame, S
  that with the joint's position added, and u = 2^-53: a point is a sum of eight products, each rounded thrice;
* the same bound covers the sums of ``n . (x - y)``, which are as short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.robot.bodies import Body
from ocp_traj.robot.cores import BOXES, CYLINDERS, HALF_SPACES, Cores, group_of
from ocp_traj.robot.nearest_points import nearest

UNIT = 2.0**-53  # what one operation rounds by, of its result
SHORTER = 1.0 - 2.0**-49  # of a unit vector, so that none is longer than 1
SHRUNK = 0.02  # of the least half length, by which a solid core is shrunk into a rounded one: our choice
MEETING = 1e-9  # [m] cores as near as this are looked at shrunk


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of joints at N instants, enclosed.

    Attributes:
        rotation, position: middles ``(N, joints, 3, 3)``, ``(N, joints, 3)``.
        turn, shift: half widths of the widest entry of each ``(N, joints)``.
    """

    rotation: Array
    position: Array
    turn: Array
    shift: Array

    @classmethod
    def of_bounds(cls, lower: Array, upper: Array) -> Frames:
        """From ends ``(12 joints, N)`` of what ``placements_function`` gives."""
        low, high = (end.reshape(-1, 12, end.shape[-1]).transpose(2, 0, 1) for end in (lower, upper))
        middle = 0.5 * (low + high)
        half = np.nextafter(np.maximum(high - middle, middle - low), np.inf)
        half = np.where(np.isnan(half), np.inf, half)
        rotation = middle[..., :9].reshape(*middle.shape[:2], 3, 3)
        return cls(rotation, middle[..., 9:], half[..., :9].max(axis=2), half[..., 9:].max(axis=2))

    def take(self, which: Any) -> Frames:
        """Those at some instants."""
        return Frames(self.rotation[which], self.position[which], self.turn[which], self.shift[which])

    def interleave(self, other: Frames) -> Frames:
        """These and as many others in turn."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in ("rotation", "position", "turn", "shift"))
        return Frames(*(np.stack(pair, axis=1).reshape(-1, *pair[0].shape[1:]) for pair in pairs))


@dataclass(frozen=True, eq=False)
class BodyTable:
    """Bodies as arrays, one row a body.

    Attributes:
        joint: column of a body's joint among those of the frames.
        group: see ``ocp_traj.robot.cores``.
        centre, axes, half, radius: as a body has them; half lengths of a half-space are zero.
        size: sum of sizes of centre and half lengths [m].
        reach: of a core from the part of its third axis inside it [m], rounded up.
    """

    joint: Index
    group: Index
    centre: Array
    axes: Array
    half: Array
    radius: Array
    size: Array
    reach: Array

    @classmethod
    def of(cls, bodies: Sequence[Body], joints: Sequence[int]) -> BodyTable:
        """Of bodies on some joints."""
        half = np.array([np.where(np.isfinite(body.half), body.half, 0.0) for body in bodies])
        centre = np.array([body.centre for body in bodies])
        return cls(
            np.array([joints.index(body.joint) for body in bodies], dtype=np.intp),
            np.array([group_of(body) for body in bodies], dtype=np.intp),
            centre, np.array([body.axes for body in bodies]), half, np.array([body.radius for body in bodies]),
            np.abs(centre).sum(axis=1) + half.sum(axis=1), np.hypot(half[:, 0], half[:, 1]) * (1.0 + 1e-15),
        )  # fmt: skip

    def cores(self, frames: Frames, instant: Index, body: Index) -> tuple[Cores, Array]:
        """Cores of bodies at instants ``(N,)`` each, and how far their points are off at most ``(N,)`` [m]."""
        joint = self.joint[body]
        rotation, position = frames.rotation[instant, joint], frames.position[instant, joint]
        centre = np.einsum("nij,nj->ni", rotation, self.centre[body]) + position
        cores = Cores(self.group[body], centre, rotation @ self.axes[body], self.half[body])
        size = self.size[body]
        off = 2.0 * (frames.shift[instant, joint] + 2.0 * frames.turn[instant, joint] * size)
        return cores, off + 128.0 * UNIT * (size + np.abs(position).sum(axis=1))


@dataclass(frozen=True, eq=False)
class Separation:
    """What is known of N pairs of bodies at an instant each.

    Attributes:
        normal: from the second body to the first, in the world, not longer than 1 ``(N, 3)``.
        apart: lower bound of the least ``normal . (x - y)`` over the cores ``(N,)`` [m].
        clearance: upper bound of the distance of the bodies, below zero where they overlap ``(N,)`` [m].
    """

    normal: Array
    apart: Array
    clearance: Array


def separation(table: BodyTable, frames: Frames, instant: Index, first: Index, second: Index) -> Separation:
    """Bounds for pairs of bodies ``first (N,)`` and ``second (N,)`` at instants ``(N,)``."""
    (a, off_a), (b, off_b) = (table.cores(frames, instant, body) for body in (first, second))
    off = off_a + off_b
    x, y, normal = nearest(a, b)
    normal = normal * SHORTER
    flat = (a.group == HALF_SPACES) | (b.group == HALF_SPACES)
    apart = np.einsum("ni,ni->n", normal, a.centre - b.centre) - _extent(a, normal) - _extent(b, normal) - off
    gap = x - y
    length = np.sqrt(np.einsum("ni,ni->n", gap, gap)) * (1.0 + 1e-15)
    along = np.einsum("ni,ni->n", normal, gap)
    # Of a half-space the depth below its face counts; its normal is a unit vector to some 1e-16.
    length = np.where(flat, along + 1e-14 * np.abs(along), length)
    radii = table.radius[first] + table.radius[second]
    clearance = length + off - radii * (1.0 - 1e-15)
    meeting = (length <= MEETING) & ~flat
    if meeting.any():
        inside = _overlap(a.take(meeting), b.take(meeting)) + (off - radii * (1.0 - 1e-15))[meeting]
        clearance[meeting] = np.minimum(clearance[meeting], inside)
    apart = np.where(np.isfinite(apart), apart, -np.inf)
    return Separation(normal, apart, np.where(np.isnan(clearance), np.inf, clearance))


def _extent(cores: Cores, normal: Array) -> Array:
    """How far cores reach from their centres along a direction ``(N,)``: their support function."""
    along = np.abs(np.einsum("nij,ni->nj", cores.axes, normal))
    round_ = np.hypot(along[:, 0], along[:, 1]) * cores.half[:, 0] + along[:, 2] * cores.half[:, 2]
    return np.asarray(np.where(cores.group == CYLINDERS, round_, (along * cores.half).sum(axis=1)))


def _overlap(a: Cores, b: Cores) -> Array:
    """Upper bounds of the distance of cores that meet, from cores inside them, grown by a ball that stays inside."""
    by = [
        np.where((c.group == BOXES) | (c.group == CYLINDERS), SHRUNK * c.half.min(axis=1), 0.0)
        for c in (a, b)
    ]  # fmt: skip
    x, y, _ = nearest(a.shrunk(by[0]), b.shrunk(by[1]))
    return np.asarray(np.linalg.norm(x - y, axis=1) * (1.0 + 1e-15) - (by[0] + by[1]) * (1.0 - 1e-15))
