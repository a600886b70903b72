"""Frames and sections of tool paths, as a task gives them in its units."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import ArcTable, LineTable, MoveTable, PoseTable, Turned
from ocp_traj.paths.cartesian import Section

OPPOSITE = 1e-3  # [rad] a turn of the tool this near to a half turn has no shorter way: our choice, as all that follow
STILL = 1e-9  # [rad] a turn of the tool below which it does not turn
HERE = 1e-6  # [m, rad] a first pose this near to where the tool is begins the path


@dataclass(frozen=True)
class Frames:
    """Frames of a task in its units [rad, m]."""

    angle: float
    length: float

    def sections(self, move: MoveTable, here: pin.SE3 | None) -> list[Section]:
        """The sections of a move that begins with the tool ``here``; of poses the first may say where that is."""
        if move.line is not None:
            assert here is not None
            return [self._line(move.line, here)]
        if move.arc is not None:
            assert here is not None
            return [self._arc(move.arc, here)]
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
        return sections

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
