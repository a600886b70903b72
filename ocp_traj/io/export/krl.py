"""KUKA KRL: ``.src`` and ``.dat`` with a PTP motion to each point."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.files import write_text
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.io.export.exported import Exported, comments, retimed, unproved
from ocp_traj.io.export.via_points import ViaPoints, decimal, program_name
from ocp_traj.results.trajectory import Trajectory

AXES = ("A1", "A2", "A3", "A4", "A5", "A6", "E1", "E2", "E3", "E4", "E5", "E6")
HEAD = ["&ACCESS RVP", "&REL 1"]


@dataclass(frozen=True, kw_only=True)
class Krl(ViaPoints):
    """Points as E6AXIS, in degrees and mm; joints are A1 .. A6, E1 .. in their order unless renamed to those."""

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes the programs; the one that was asked for calls the others where there are several."""
        name = program_name(target, (".src",))
        axes = self._axes(trajectory)
        found, rows, speeds = self.postures(trajectory, requirements)
        facts = retimed(found)
        header = comments(facts, ";")
        parts = list(self.parts(len(rows)))
        if len(parts) == 1:
            return unproved(target, "krl", self._pair(target, name, header, axes, rows, speeds), facts)
        paths, calls = list[Path](), []
        for part, points in parts:
            own = f"{name}_{part:02d}"
            chosen = slice(points.start, points.stop)
            last = part == len(parts)
            place = target.with_name(f"{own}.src")
            paths += self._pair(place, own, header, axes, rows[chosen], speeds[chosen], goes_on=not last)
            calls.append(f"{own}()")
        path = write_text(target, "\n".join([*HEAD, f"DEF {name}()", *header, *calls, "END"]) + "\n")
        return unproved(path, "krl", (path, *paths), facts)

    def _axes(self, trajectory: Trajectory) -> list[str]:
        if len(trajectory.joints) > len(AXES):
            raise InputError(f"KRL moves up to {len(AXES)} joints; the trajectory has {len(trajectory.joints)}")
        if not self.joints:
            return list(AXES[: len(trajectory.joints)])
        names = self.names(trajectory)
        if unknown := [name for name in names if name not in AXES]:
            raise InputError(f"KRL has no axis {unknown[0]!r}; rename every joint to one of {', '.join(AXES)}")
        return names

    def _pair(
        self, target: Path, name: str, header: list[str], axes: list[str], rows: Array, speeds: list[int],
        goes_on: bool = False,
    ) -> tuple[Path, Path]:  # fmt: skip
        """Program and data of one file's points; all but the last are rounded, and that one where there are more."""
        declared = []
        for i, row in enumerate(rows.tolist(), 1):
            values = (f"{axis} {decimal(value)}" for axis, value in sorted(zip(axes, row, strict=True)))
            declared.append(f"DECL E6AXIS P{i}={{{','.join(values)}}}")
        moves = ["BAS(#INITMOV,0)", "BAS(#ACC_PTP,100)"]
        for i, speed in enumerate(speeds, 1):
            rounded = " C_PTP" if i < len(speeds) or goes_on else ""
            moves += [f"BAS(#VEL_PTP,{speed})", f"PTP P{i}{rounded}"]
        source = [*HEAD, f"DEF {name}()", *header, "EXT BAS(BAS_COMMAND :IN,REAL :IN)", *moves, "END"]
        data = [*HEAD, f"DEFDAT {name}", *declared, "ENDDAT"]
        return (
            write_text(target, "\n".join(source) + "\n"),
            write_text(target.with_suffix(".dat"), "\n".join(data) + "\n"),
        )
