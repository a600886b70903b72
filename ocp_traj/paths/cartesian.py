"""Tool paths: where the tool frame has to be and how it is turned, along lines and arcs one after the other.

A section is a line or an arc along which the tool turns evenly about a fixed axis. It is cut into legs, each with a
frame of its own at its middle: x along the path, y towards the centre of the arc, z across. With curvature k (0 of a
line) a point (x, y, z) of that frame is

    ((k (x^2 + y^2) - 2 y) / (k r + 1), z),  k r = sqrt((k x)^2 + (1 - k y)^2)

off the path, outwards and across, and atan(k x / (1 - k y)) / k, of a line x, along it: one smooth expression of lines
and arcs alike, whose constants differ from leg to leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil, pi
from typing import Any, NamedTuple

import casadi
import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError

SHORTEST = 1e-6  # [m] of a section: our choice, as all that follow
WIDEST = pi / 3.0  # [rad] of a leg of an arc, and of the turn of the tool along a leg
SMOOTH = 1e-6  # [rad] corner below which a path goes on smoothly
CONSTANTS = 25  # of a leg; see ``Leg.constants``


class Ball(NamedTuple):
    """Where the tool may be as it rounds a corner.

    Attributes:
        frame: of the tool at the corner.
        radius: distance from it [m].
    """

    frame: pin.SE3
    radius: float


@dataclass(frozen=True, eq=False)
class Section:
    """A line or an arc along which the tool turns evenly.

    Attributes:
        start: tool frame at its beginning.
        tangent: unit vector ``(3,)`` there.
        normal: unit vector ``(3,)`` towards the centre, of a line any across it.
        curvature: 0 of a line [1/m].
        length: of arc [m].
        turn: rotation vector ``(3,)`` of the tool over the section, in the world [rad].
        ball: of a section that rounds a corner, within which the tool has to stay; it need not be near the section.
    """

    start: pin.SE3
    tangent: Array
    normal: Array
    curvature: float
    length: float
    turn: Array
    ball: Ball | None = None

    @classmethod
    def line(cls, start: pin.SE3, by: Array, turn: Array) -> Section:
        """A straight one, by ``by (3,)`` [m]."""
        length = float(np.linalg.norm(by))
        if length < SHORTEST:
            raise InputError(f"it goes {length:.3g} m; a tool path goes {SHORTEST:g} m or more")
        tangent = np.asarray(by, dtype=float) / length
        return cls(start, tangent, _across(tangent), 0.0, length, np.asarray(turn, dtype=float))

    @classmethod
    def arc(cls, start: pin.SE3, centre: Array, axis: Array, angle: float, turn: Array) -> Section:
        """An arc about ``axis (3,)`` through ``centre (3,)`` [m], by ``angle`` [rad], right-handed."""
        direction = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
        spoke = start.translation - np.asarray(centre, dtype=float)
        spoke = spoke - direction * (direction @ spoke)
        radius = float(np.linalg.norm(spoke))
        if not radius >= SHORTEST or not abs(angle) * radius >= SHORTEST:
            raise InputError(
                f"its radius is {radius:.3g} m and its length {abs(angle) * radius:.3g} m; give an arc whose axis does "
                "not pass through where it begins"
            )
        normal = -spoke / radius
        tangent = np.sign(angle) * np.cross(direction, -normal)
        return cls(start, tangent, normal, 1.0 / radius, abs(angle) * radius, np.asarray(turn, dtype=float))

    @classmethod
    def through(cls, start: pin.SE3, via: Array, end: Array, turn: Array) -> Section:
        """The arc from the start through a point ``via (3,)`` to ``end (3,)`` [m]."""
        a, b = np.asarray(via) - start.translation, np.asarray(end) - start.translation
        axis = np.cross(a, b)
        size = float(axis @ axis)
        if size <= 1e-12 * float((a @ a) * (b @ b)):
            raise InputError(
                "its three points lie on one line; give a via off the line from start to end, or a line in its place"
            )
        centre = start.translation + np.cross((a @ a) * b - (b @ b) * a, axis) / (2.0 * size)
        axis = axis / np.sqrt(size)
        from_, to = start.translation - centre, np.asarray(end) - centre
        angle = float(np.arctan2(axis @ np.cross(from_, to), from_ @ to)) % (2.0 * pi)
        return cls.arc(start, centre, axis, angle, turn)

    def at(self, s: float) -> pin.SE3:
        """The tool frame at a length of arc [m]."""
        k = self.curvature
        if k:
            step = (np.sin(k * s) * self.tangent + (1.0 - np.cos(k * s)) * self.normal) / k
        else:
            step = s * self.tangent
        turned = pin.exp3(self.turn * (s / self.length)) @ self.start.rotation
        return pin.SE3(turned, self.start.translation + step)

    def direction(self, s: float) -> tuple[Array, Array]:
        """Unit vectors ``(3,)`` along the path and towards the centre at a length of arc [m]."""
        c, d = np.cos(self.curvature * s), np.sin(self.curvature * s)
        return c * self.tangent + d * self.normal, c * self.normal - d * self.tangent


class Leg(NamedTuple):
    """A part of a section, between two via points of the motion.

    Attributes:
        section: of which it is a part.
        before: length of the whole path before the section [m].
        low, high: lengths of arc of the section at its ends [m].
        window: lengths of arc of the section between which the motion has to stay on this leg [m].
    """

    section: Section
    before: float
    low: float
    high: float
    window: tuple[float, float]

    @property
    def constants(self) -> Array:
        """What ``places`` and ``wanted_rotation`` need ``(CONSTANTS,)``.

        The middle of the leg (3), the frame there (rows x, y, z; 9), curvature, 1 of a line and 0 of an arc, radius of
        an arc and 0 of a line, the tool's rotation at the middle as a quaternion x, y, z, w (4), the axis about which
        it turns (3) and by how much a metre, and the window's ends from the leg's middle (2). A leg that rounds a
        corner has it for its middle, one rotation all over, and its ball's radius as the window.
        """
        section, middle = self.section, (self.low + self.high) / 2.0
        if section.ball is not None:
            return _constants_of_ball(section.ball)
        tool = section.at(middle)
        tangent, normal = section.direction(middle)
        frame = np.stack([tangent, normal, np.cross(tangent, normal)])
        curvature = section.curvature
        kind = (curvature, 1.0, 0.0) if curvature == 0.0 else (curvature, 0.0, 1.0 / curvature)
        angle = float(np.linalg.norm(section.turn))
        axis = section.turn / angle if angle > 0.0 else np.eye(3)[2]
        quaternion = pin.Quaternion(tool.rotation).coeffs()
        ends = [side - middle for side in self.window]
        return np.concatenate([tool.translation, frame.ravel(), kind, quaternion, axis, [angle / section.length], ends])


@dataclass(frozen=True, eq=False)
class ToolPath:
    """Sections, each from where the one before ends."""

    sections: tuple[Section, ...]

    @cached_property
    def ends(self) -> Array:
        """Lengths of path at which sections begin, and the whole ``(K + 1,)`` [m]."""
        return np.append(0.0, np.cumsum([section.length for section in self.sections]))

    @property
    def length(self) -> float:
        """Of the whole [m]."""
        return float(self.ends[-1])

    def _place(self, s: float) -> tuple[Section, float]:
        k = int(np.clip(np.searchsorted(self.ends, s, side="right") - 1, 0, len(self.sections) - 1))
        return self.sections[k], s - float(self.ends[k])

    def at(self, s: float) -> pin.SE3:
        """The tool frame at a length of path [m]."""
        section, own = self._place(s)
        return section.at(own)

    @cached_property
    def corners(self) -> tuple[int, ...]:
        """Sections, counted from 0, that begin with a corner of the path or of the tool's turning; the first does."""
        found = [0]
        for k in range(1, len(self.sections)):
            before, after = self.sections[k - 1], self.sections[k]
            if before.ball is not None or after.ball is not None:
                continue
            bend = np.linalg.norm(before.direction(before.length)[0] - after.tangent)
            twist = np.linalg.norm(before.turn / before.length - after.turn / after.length)
            if bend > SMOOTH or twist > SMOOTH / SHORTEST:
                found.append(k)
        return tuple(found)

    def legs(self, cuts: Sequence[float] = ()) -> list[Leg]:
        """The path in legs: sections, cut where they bend or turn far, and at lengths of the path that are given.

        A leg's window is its section, and its line up to a corner that is rounded, of an arc no more than
        ``WIDEST / 2`` beyond the leg; it ends at given cuts.
        """
        found = []
        for k, (section, before) in enumerate(zip(self.sections, self.ends, strict=False)):
            angle = max(section.curvature * section.length, float(np.linalg.norm(section.turn)))
            if section.ball is not None:
                angle = 0.0
            beyond = WIDEST / 2.0 / section.curvature if section.curvature else np.inf
            own = [c - before for c in cuts if SHORTEST < c - before < section.length - SHORTEST]
            for first, last in pairwise([0.0, *sorted(own), section.length]):
                parts = max(1, ceil(angle * (last - first) / section.length / WIDEST - 1e-9))
                for low, high in pairwise(np.linspace(first, last, parts + 1).tolist()):
                    window = max(first, low - beyond), min(last, high + beyond)
                    if first == 0.0:
                        window = window[0] - self._to_corner(k - 1, section.start), window[1]
                    if last == section.length:
                        window = window[0], window[1] + self._to_corner(k + 1, section.at(last))
                    found.append(Leg(section, float(before), low, high, window))
        return found

    def _to_corner(self, k: int, end: pin.SE3) -> float:
        """How far the corner that section ``k`` rounds is from an end of its neighbour [m]; zero where it does not."""
        ball = self.sections[k].ball if 0 <= k < len(self.sections) else None
        return 0.0 if ball is None else float(np.linalg.norm(ball.frame.translation - end.translation))


def _constants_of_ball(ball: Ball) -> Array:
    quaternion = pin.Quaternion(ball.frame.rotation).coeffs()
    still = [0.0, 0.0, 1.0, 0.0]
    ends = [-ball.radius, ball.radius]
    return np.concatenate([ball.frame.translation, np.eye(3).ravel(), [0.0, 1.0, 0.0], quaternion, still, ends])


def places(constants: Any, place: Any) -> tuple[Any, Any, Any]:
    """Where a tool point is by a leg: off the path outwards and across, and along it from the leg's middle [m].

    Args:
        constants: of ``Leg``, symbolic.
        place: of the tool point ``(3,)`` in the world [m].
    """
    local = casadi.mtimes(casadi.reshape(constants[3:12], 3, 3).T, place - constants[:3])
    x, y, z = local[0], local[1], local[2]
    k, straight, radius = constants[12], constants[13], constants[14]
    outwards = (k * (x**2 + y**2) - 2.0 * y) / (casadi.sqrt((k * x) ** 2 + (1.0 - k * y) ** 2) + 1.0)
    return outwards, z, straight * x + radius * casadi.atan(k * x / (1.0 - k * y))


def wanted_rotation(constants: Any, along: Any) -> Any:
    """The rotation ``(3, 3)`` that the tool should have at a length from the leg's middle [m], symbolic."""
    qx, qy, qz, qw = (constants[15 + i] for i in range(4))
    middle = casadi.vertcat(
        casadi.horzcat(1.0 - 2.0 * (qy**2 + qz**2), 2.0 * (qx * qy - qz * qw), 2.0 * (qx * qz + qy * qw)),
        casadi.horzcat(2.0 * (qx * qy + qz * qw), 1.0 - 2.0 * (qx**2 + qz**2), 2.0 * (qy * qz - qx * qw)),
        casadi.horzcat(2.0 * (qx * qz - qy * qw), 2.0 * (qy * qz + qx * qw), 1.0 - 2.0 * (qx**2 + qy**2)),
    )
    ax, ay, az, angle = constants[19], constants[20], constants[21], constants[22] * along
    cross = casadi.vertcat(casadi.horzcat(0.0, -az, ay), casadi.horzcat(az, 0.0, -ax), casadi.horzcat(-ay, ax, 0.0))
    turned = middle + casadi.sin(angle) * casadi.mtimes(cross, middle)
    return turned + (1.0 - casadi.cos(angle)) * casadi.mtimes(cross, casadi.mtimes(cross, middle))


def progress(constants: Any, along: Any, past: float) -> Any:
    """A place along a leg as a share of half its window, symbolic: from -1 to 1 within it and ``past`` [m] beyond."""
    low, high = constants[23], constants[24]
    return (along - (low + high) / 2.0) / ((high - low) / 2.0 + past)


def off_corner(constants: Any, place: Any) -> Any:
    """The square of a tool point's distance from the corner of a leg that rounds one, as a share of its ball's."""
    return casadi.sumsqr(place - constants[:3]) / constants[24] ** 2


def _across(direction: Array) -> Array:
    """A unit vector across another."""
    side = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    return np.asarray(side / np.linalg.norm(side))
