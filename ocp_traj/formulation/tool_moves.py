"""Moves along tool paths: what a task says of one as sections and postures, and these as legs of a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import (
    ArcTable,
    LineTable,
    MoveTable,
    PoseTable,
    SectionTable,
    SpeedTable,
    ToleranceTable,
    ToolPathTable,
    Turned,
)
from ocp_traj.paths.cartesian import Leg, Section, ToolPath
from ocp_traj.paths.following import Followed, best_branch, follow
from ocp_traj.robot.inverse_kinematics import InverseKinematics
from ocp_traj.robot.robot import Robot

ROWS = 8  # postures a leg from one via point to the next: our choice, as all that follow
RUN_UP = 0.1  # share of the path in which the speed is free at either end, where nothing is said
OPPOSITE = 1e-3  # [rad] a turn of the tool this near to a half turn has no shorter way
STILL = 1e-9  # [rad] a turn of the tool below which it does not turn
HERE = 1e-6  # [m, rad] a first pose this near to where the tool is begins the path


@dataclass(frozen=True, eq=False)
class ToolMove:
    """A resolved move along a tool path.

    Attributes:
        path: of the tool frame.
        postures: joints along it, ``ROWS`` a leg and one more ``(N, n)``.
        position, tilt: tolerances [m], [rad].
        free_turn: whether the tool may turn about its axis z.
        speed: that is constant, with its band and run-up [m]; None where it is free.
        branch: words on how the first posture was chosen.
    """

    path: ToolPath
    postures: Array
    position: float
    tilt: float
    free_turn: bool
    speed: tuple[float, float, float] | None
    branch: str

    @classmethod
    def of(cls, move: MoveTable) -> ToolMove | None:
        """Of a resolved move; None where it is none along a tool path."""
        if move.tool_path is None:
            return None
        assert isinstance(move.tolerance, ToleranceTable)
        path, tolerance = _path_of(move.tool_path), move.tolerance
        speed = None
        if isinstance(move.speed, SpeedTable):
            run_up = RUN_UP * path.length if move.speed.run_up is None else move.speed.run_up
            speed = move.speed.value, move.speed.band, run_up
        postures = np.array(move.via)
        made = cls(path, postures, tolerance.position, tolerance.tilt, move.free_turn, speed, move.tool_path.branch)
        if len(postures) != ROWS * len(made.legs) + 1:
            raise InputError(f"a tool path of {len(made.legs)} legs has {len(postures)} postures; resolve it anew")
        return made

    @cached_property
    def cuts(self) -> tuple[float, ...]:
        """Lengths of path [m] between which the speed is constant, the tolerance in which legs end taken off."""
        if self.speed is None:
            return ()
        return self.speed[2] - self.position, self.path.length - self.speed[2] + self.position

    @cached_property
    def legs(self) -> list[Leg]:
        """The path in legs; those at constant speed begin and end at ``cuts``."""
        return self.path.legs(self.cuts)

    @cached_property
    def even(self) -> tuple[int, ...]:
        """Legs, counted from 0, on which the speed is constant."""
        if self.speed is None:
            return ()
        low, high = self.cuts
        middles = [leg.before + (leg.low + leg.high) / 2.0 for leg in self.legs]
        return tuple(i for i, s in enumerate(middles) if low < s < high)

    @property
    def places(self) -> Array:
        """Lengths of path at the postures ``(N,)`` [m]."""
        edges = [(leg.before + leg.low, leg.before + leg.high) for leg in self.legs]
        inner = [np.linspace(a, b, ROWS + 1)[:-1] for a, b in edges]
        return np.append(np.concatenate(inner), self.path.length)


def resolved_tool_move(move: MoveTable, robot: Robot, before: Array | None, angle: float, length: float) -> MoveTable:
    """A move along a tool path as sections and postures, in SI.

    Args:
        move: with line, arc or poses; not along joints.
        robot: that moves.
        before: posture ``(n,)`` at which the move before ends; None for the first.
        angle: unit of the task [rad].
        length: likewise [m].
    """
    if move.tool_path is not None:
        raise InputError("tool_path is what a resolved task alone has; give line, arc or poses")
    if move.begin is not None or move.end is not None:
        raise InputError("begin or end is of a move along joints; a tool path begins and ends at rest: leave it out")
    start = _start(move, robot, before, angle, length)
    ik = InverseKinematics(robot, move.free_turn)
    frames = _Frames(angle, length)
    here = None if start is None else ik.pose(start)
    path = frames.path(move, here)
    made = _unplaced(move, path, angle, length)
    followed = _followed(ik, path, start)
    postures = followed.at(made.places, ik, path)
    postures[0] = followed.q[0] if start is None else start
    tables = [_section_table(section) for section in path.sections]
    first = path.at(0.0)
    x, y, z, w = pin.Quaternion(first.rotation).coeffs()
    table = ToolPathTable(pose=[*first.translation, w, x, y, z], sections=tables, branch=followed.branch)
    speed = None
    if made.speed is not None:
        speed = SpeedTable(value=made.speed[0], band=made.speed[1], run_up=made.speed[2])
    changed: dict[str, Any] = {
        "via": postures.tolist(), "start": None, "line": None, "arc": None, "poses": None, "tool_path": table,
        "tolerance": ToleranceTable(position=made.position, tilt=made.tilt), "speed": speed,
    }  # fmt: skip
    return move.model_copy(update=changed)


def _start(move: MoveTable, robot: Robot, before: Array | None, angle: float, length: float) -> Array | None:
    """The posture where the move begins ``(n,)``; None where the first of poses decides."""
    if before is not None:
        if move.start is not None:
            raise InputError(
                "start is of the first move alone; this one begins where the one before ends: leave it out"
            )
        return np.asarray(before, dtype=float)
    if move.start is None:
        if move.poses is None:
            raise InputError("start is missing; give the joints at which it begins, or poses, which begin at the first")
        return None
    if len(move.start) != robot.size:
        raise InputError(
            f"start has {len(move.start)} coordinates; the robot has {robot.size} joints: {', '.join(robot.joints)}"
        )
    return np.array(move.start) * [angle if unit == "rad" else length for unit in robot.units]


def _unplaced(move: MoveTable, path: ToolPath, angle: float, length: float) -> ToolMove:
    """The move but for its postures."""
    assert isinstance(move.tolerance, ToleranceTable)
    position, tilt = move.tolerance.position * length, move.tolerance.tilt * angle
    if not position < 0.5 * path.length:
        raise InputError(
            f"its tolerance of position is {position:g} m, on a path of {path.length:g} m; give less than half of that"
        )
    if not tilt < np.pi:
        raise InputError(f"its tolerance of tilt is {tilt:g} rad; give less than a half turn")
    speed = None
    if move.speed is not None:
        given = move.speed if isinstance(move.speed, SpeedTable) else SpeedTable(value=move.speed)
        run_up = RUN_UP * path.length if given.run_up is None else given.run_up * length
        if not position < run_up < 0.5 * path.length:
            raise InputError(
                f"its run_up is {run_up:g} m; give more than the tolerance of position, {position:g} m, and less than "
                f"half of the path, {0.5 * path.length:g} m"
            )
        if len(path.corners) > 1:
            s = path.ends[path.corners[1]]
            raise InputError(
                f"at {s:.4g} m of {path.length:.4g} m along it is a corner, of the path or of how the tool turns, "
                "which no constant speed takes; leave speed out, or give a move of its own to each part"
            )
        speed = given.value * length, given.band, run_up
    return ToolMove(path, np.zeros((0, 0)), position, tilt, move.free_turn, speed, "")


def _followed(ik: InverseKinematics, path: ToolPath, start: Array | None) -> Followed:
    if start is None:
        pair = ik.robot.limits.bounds(1)
        speeds = np.full(ik.robot.size, np.inf) if pair is None else np.minimum(-pair[0], pair[1])
        return best_branch(ik, path, np.random.default_rng(0), speeds)
    low, high = ik.ranges
    if (beyond := (start < low) | (start > high)).any():
        joint = ik.robot.joints[int(np.argmax(beyond))]
        raise InputError(f"its start has {joint} beyond its range; give another")
    return follow(ik, path, start)


@dataclass(frozen=True)
class _Frames:
    """Frames of a task in its units [rad, m]."""

    angle: float
    length: float

    def path(self, move: MoveTable, here: pin.SE3 | None) -> ToolPath:
        """The path of a move that begins with the tool ``here``."""
        if move.line is not None:
            assert here is not None
            return ToolPath((self._line(move.line, here),))
        if move.arc is not None:
            assert here is not None
            return ToolPath((self._arc(move.arc, here),))
        frames = [self._pose(pose) for pose in move.poses or ()]
        if here is None:
            here = frames.pop(0)
        elif np.linalg.norm(pin.log6(here.actInv(frames[0])).vector) < HERE:
            frames.pop(0)
        if not frames:
            raise InputError("its poses are one in all, where the tool is already; give two or more")
        sections = []
        for i, frame in enumerate(frames):
            try:
                sections.append(Section.line(here, frame.translation - here.translation, _turn(here, frame.rotation)))
            except InputError as error:
                raise InputError(f"to its pose {i + 1 + (len(frames) < len(move.poses or ()))}: {error}") from error
            here = frame
        return ToolPath(tuple(sections))

    def _line(self, line: LineTable, here: pin.SE3) -> Section:
        if line.by is not None:
            by = self.length * np.array(line.by)
        else:
            by = self.length * np.array(line.to) - here.translation
        return Section.line(here, by, _turn(here, self._rotation(line, here.rotation)))

    def _arc(self, arc: ArcTable, here: pin.SE3) -> Section:
        turn = _turn(here, self._rotation(arc, here.rotation))
        if arc.via is not None:
            through = Section.through(here, self.length * np.array(arc.via), self.length * np.array(arc.to), turn)
            if not arc.with_arc:
                return through
            axis = np.cross(through.tangent, through.normal)
            return replace(through, turn=axis * through.curvature * through.length)
        assert arc.axis is not None and arc.angle is not None
        angle = self.angle * arc.angle
        if not 0.0 < abs(angle) <= 2.0 * np.pi * (1.0 + 1e-12):
            raise InputError(f"its angle is {angle:g} rad; give one that is not zero and at most one turn either way")
        axis = np.array(arc.axis) / np.linalg.norm(arc.axis)
        turn = angle * axis if arc.with_arc else turn
        return Section.arc(here, self.length * np.array(arc.centre), axis, angle, turn)

    def _pose(self, pose: PoseTable | list[float]) -> pin.SE3:
        if isinstance(pose, PoseTable):
            if pose.rpy is None and pose.quat_wxyz is None:
                raise InputError("one of its poses has no rotation; give rpy or quat_wxyz")
            return pin.SE3(self._rotation(pose, np.eye(3)), self.length * np.array(pose.xyz))
        if len(pose) != 7 or not any(pose[3:]):
            raise InputError(
                f"one of its poses is {pose}; give seven numbers x, y, z, w, x, y, z, the last four a quaternion"
            )
        table = PoseTable(xyz=pose[:3], quat_wxyz=pose[3:])
        return self._pose(table)

    def _rotation(self, turned: Turned, otherwise: Array) -> Array:
        if turned.rpy is not None:
            return np.asarray(pin.rpy.rpyToMatrix(*(self.angle * np.array(turned.rpy))))
        if turned.quat_wxyz is not None:
            w, x, y, z = np.array(turned.quat_wxyz) / np.linalg.norm(turned.quat_wxyz)
            return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())
        return otherwise


def _turn(here: pin.SE3, rotation: Array) -> Array:
    """The shortest rotation vector ``(3,)`` in the world from a frame to a rotation [rad]."""
    turn = np.asarray(pin.log3(rotation @ here.rotation.T))
    if np.linalg.norm(turn) < STILL:
        return np.zeros(3)
    if np.linalg.norm(turn) > np.pi - OPPOSITE:
        raise InputError("the tool would turn by a half turn, either way; give a pose between")
    return turn


def _section_table(section: Section) -> SectionTable:
    turn = section.turn.tolist()
    if not section.curvature:
        return SectionTable(by=(section.length * section.tangent).tolist(), turn=turn)
    centre = section.start.translation + section.normal / section.curvature
    axis = np.cross(section.tangent, section.normal)
    return SectionTable(centre=centre.tolist(), axis=axis.tolist(), angle=section.curvature * section.length, turn=turn)


def _path_of(table: ToolPathTable) -> ToolPath:
    """The path of a resolved move."""
    if len(table.pose) != 7 or not any(table.pose[3:]):
        raise InputError(f"the pose of a tool path is {table.pose}; give seven numbers x, y, z, w, x, y, z")
    quaternion = np.array(table.pose[3:]) / np.linalg.norm(table.pose[3:])
    here = pin.SE3(pin.Quaternion(*quaternion).toRotationMatrix(), np.array(table.pose[:3]))
    sections = []
    for one in table.sections:
        turn = np.array(one.turn)
        if one.by is not None:
            section = Section.line(here, np.array(one.by), turn)
        else:
            assert one.angle is not None
            section = Section.arc(here, np.array(one.centre), np.array(one.axis), one.angle, turn)
        sections.append(section)
        here = section.at(section.length)
    return ToolPath(tuple(sections))
