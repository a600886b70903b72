"""Moves along tool paths: what a task says of one as sections and postures, and these as legs of a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import MoveTable, SectionTable, SpeedTable, ToleranceTable, ToolPathTable
from ocp_traj.formulation.tool_chains import Chain
from ocp_traj.formulation.tool_frames import Frames
from ocp_traj.paths.cartesian import Ball, Leg, Section, ToolPath
from ocp_traj.paths.following import Followed, best_branch, follow
from ocp_traj.robot.inverse_kinematics import InverseKinematics
from ocp_traj.robot.robot import Robot

ROWS = 8  # postures a leg from one via point to the next: our choice, as all that follow
PAST = 1e-3  # of the tolerance of position, by which the tool may run past an end, or a cut
RUN_UP = 0.1  # share of the path in which the speed is free at either end, where nothing is said


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
        """Lengths of path [m] between which the speed is constant, what legs may run past taken off."""
        if self.speed is None:
            return ()
        inside = self.speed[2] - PAST * self.position
        return inside, self.path.length - inside

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
    def round(self) -> tuple[int, ...]:
        """Legs, counted from 0, that round corners."""
        return tuple(i for i, leg in enumerate(self.legs) if leg.section.ball is not None)

    @property
    def places(self) -> Array:
        """Lengths of path at the postures ``(N,)`` [m]."""
        edges = [(leg.before + leg.low, leg.before + leg.high) for leg in self.legs]
        inner = [np.linspace(a, b, ROWS + 1)[:-1] for a, b in edges]
        return np.append(np.concatenate(inner), self.path.length)


def resolved_tool_move(chain: Chain, robot: Robot, before: Array | None, angle: float, length: float) -> MoveTable:
    """Moves along one tool path as sections and postures, in SI.

    Args:
        chain: moves with line, arc or poses; not along joints.
        robot: that moves.
        before: posture ``(n,)`` at which the move before ends; None for the first.
        angle: unit of the task [rad].
        length: likewise [m].
    """
    move = chain.whole
    if move.tool_path is not None:
        raise InputError("tool_path is what a resolved task alone has; give line, arc or poses")
    for one in chain.moves:
        if one.begin is not None or one.end is not None:
            raise InputError(
                "begin or end is of a move along joints; a tool path begins and ends at rest: leave it out"
            )
    if any(one.start is not None for one in chain.moves[1:]):
        raise InputError("start is of the first move alone; those behind a blend begin where it ends: leave it out")
    start = _start(move, robot, before, angle, length)
    ik = InverseKinematics(robot, move.free_turn)
    path = chain.path(Frames(angle, length), None if start is None else ik.pose(start))
    made = _unplaced(move, path, angle, length)
    followed = _followed(ik, path, start)
    postures = followed.at(made.places, ik, path)
    postures[0] = followed.q[0] if start is None else start
    tables = [_section_table(section) for section in path.sections]
    table = ToolPathTable(pose=_numbers_of(path.at(0.0)), sections=tables, branch=followed.branch)
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
                "which no constant speed takes; round it with blend, leave speed out, or give a move of its own to "
                "each part"
            )
        for section, begin in zip(path.sections, path.ends, strict=False):
            if section.ball is not None and any(
                begin < s < begin + section.length for s in (run_up, path.length - run_up)
            ):
                raise InputError(f"its run_up of {run_up:g} m ends within a blend; give another")
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


def _section_table(section: Section) -> SectionTable:
    table: dict[str, Any] = {"turn": section.turn.tolist()}
    if section.curvature:
        centre = section.start.translation + section.normal / section.curvature
        axis = np.cross(section.tangent, section.normal)
        table |= {"centre": centre.tolist(), "axis": axis.tolist(), "angle": section.curvature * section.length}
    else:
        table["by"] = (section.length * section.tangent).tolist()
    if section.ball is not None:
        table |= {"corner": _numbers_of(section.ball.frame), "blend": section.ball.radius}
    return SectionTable(**table)


def _numbers_of(frame: pin.SE3) -> list[float]:
    """Place and quaternion x, y, z, w, x, y, z of a frame."""
    x, y, z, w = pin.Quaternion(frame.rotation).coeffs()
    return [*frame.translation.tolist(), float(w), float(x), float(y), float(z)]


def _frame_of(numbers: list[float], words: str) -> pin.SE3:
    if len(numbers) != 7 or not any(numbers[3:]):
        raise InputError(f"{words} of a tool path is {numbers}; give seven numbers x, y, z, w, x, y, z")
    quaternion = np.array(numbers[3:]) / np.linalg.norm(numbers[3:])
    return pin.SE3(pin.Quaternion(*quaternion).toRotationMatrix(), np.array(numbers[:3]))


def _path_of(table: ToolPathTable) -> ToolPath:
    """The path of a resolved move."""
    here = _frame_of(table.pose, "the pose")
    sections = []
    for one in table.sections:
        turn = np.array(one.turn)
        if one.by is not None:
            section = Section.line(here, np.array(one.by), turn)
        else:
            assert one.angle is not None
            section = Section.arc(here, np.array(one.centre), np.array(one.axis), one.angle, turn)
        if one.corner is not None:
            assert one.blend is not None
            section = replace(section, ball=Ball(_frame_of(one.corner, "a corner"), one.blend))
        sections.append(section)
        here = section.at(section.length)
    return ToolPath(tuple(sections))
