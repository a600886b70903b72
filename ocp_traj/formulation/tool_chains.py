"""Moves along tool paths that are one, since the tool does not stop at the corners between them: those with blends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pinocchio as pin

from ocp_traj.errors import InputError
from ocp_traj.formulation.task import TOOL_WAYS, MoveTable, ToleranceTable
from ocp_traj.formulation.tool_frames import Frames
from ocp_traj.paths.blending import blended
from ocp_traj.paths.cartesian import Section, ToolPath

ALIKE = ("tolerance", "free_turn", "speed", "payload")  # of moves that are one


@dataclass(frozen=True)
class Chain:
    """Moves that are one.

    Attributes:
        moves: one or more.
        first: number of the first, counted from 1.
    """

    moves: Sequence[MoveTable]
    first: int

    @classmethod
    def at(cls, moves: Sequence[MoveTable], i: int) -> Chain:
        """The move ``i``, counted from 0, and those that follow its blends."""
        last = i
        while last + 1 < len(moves) and moves[last].blend is not None and not moves[last].dwell:
            after = moves[last + 1]
            if not any(getattr(after, way) is not None for way in TOOL_WAYS):
                break
            for name in ALIKE:
                if getattr(after, name) != getattr(moves[last], name):
                    raise InputError(
                        f"its blend leads to move {last + 2}, which has another {name}; give both the same, or "
                        "leave blend out"
                    )
            last += 1
        return cls(moves[i : last + 1], i + 1)

    @property
    def whole(self) -> MoveTable:
        """The move that all of them are, but for where it goes."""
        last = self.moves[-1]
        return self.moves[0].model_copy(update={"stop": last.stop, "dwell": last.dwell, "blend": None})

    def path(self, frames: Frames, here: pin.SE3 | None) -> ToolPath:
        """The path that begins with the tool ``here``, or where poses begin."""
        sections: list[Section] = []
        radii: list[float] = []
        for k, move in enumerate(self.moves):
            own = frames.sections(move, here)
            radius = 0.0 if move.blend is None else frames.length * move.blend
            into = 0.0 if k == 0 else frames.length * (self.moves[k - 1].blend or 0.0)
            radii += [into, *[radius] * (len(own) - 1)]
            sections += own
            here = own[-1].at(own[-1].length)
        if self.moves[-1].blend is not None and len(own) < 2:
            number = self.first + len(self.moves) - 1
            raise InputError(
                f"the blend of move {number} has no corner to round: no move along a tool path follows; leave it out"
            )
        tolerance = self.moves[0].tolerance
        assert isinstance(tolerance, ToleranceTable)
        least = min((radius for radius in radii if radius > 0.0), default=None)
        position = tolerance.position * frames.length
        if least is not None and not least > position:
            raise InputError(f"its blend is {least:g} m; give more than the tolerance of position, {position:g} m")
        return blended(sections, radii, tolerance.tilt * frames.angle)
