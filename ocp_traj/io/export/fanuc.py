"""FANUC: TP programs as text (``.ls``) with a joint motion to each point.

A FANUC controller shows joint 3 from the ground: turning joint 2 alone leaves the forearm's attitude, and J3 as shown,
unchanged. With parallel axes of joints 2 and 3, along n2 and n3, J3 as shown is q3 + (n2 . n3) q2.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap

import numpy as np
import pinocchio as pin

from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.files import write_text
from ocp_traj.formulation.case import number
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.io.export.exported import Exported, comments, retimed, unproved
from ocp_traj.io.export.via_points import ViaPoints, decimal, program_name
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.robot.robot import Robot

MOST_JOINTS = 9  # of a motion group
COMMENT = 32  # characters of a line of comment
PARALLEL = 1e-6  # sine of the angle between axes 2 and 3: our choice


@dataclass(frozen=True, kw_only=True)
class Fanuc(ViaPoints):
    """Joint positions in degrees and mm, joint 3 from the ground.

    Attributes:
        coupling: of joint 2 into joint 3 as shown: 1 or -1, 0 for none; from the robot's axes if not given.
        frame, tool: numbers of the user frame and the tool that the points name.
    """

    most_points: int = number(200, what="a whole number", least=2)
    coupling: int | None = number(None, what="-1, 0 or 1:", least=-1, most=1, whole=True)
    frame: int = number(0, least=0, most=9)
    tool: int = number(1, least=1, most=10)

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes the programs; the one that was asked for calls the others where there are several."""
        name = program_name(target, (".ls",)).upper()
        if len(trajectory.joints) > MOST_JOINTS:
            raise InputError(
                f"a FANUC group has up to {MOST_JOINTS} joints; the trajectory has {len(trajectory.joints)}"
            )
        factor = self._coupling(trajectory)
        found, rows, speeds = self.postures(trajectory, requirements)
        if factor and requirements is not None:
            if requirements.joint_units[1:3] != ("rad", "rad"):
                raise InputError("joints 2 and 3 are no revolute pair, which alone is coupled; give the coupling 0")
            rows = rows.copy()
            rows[:, 2] += factor * rows[:, 1]
        units = ["deg" if unit == "rad" else "mm" for unit in requirements.joint_units] if requirements else []
        facts = retimed(found) | {"joint 3 shown": {0: "q3", 1: "q3 + q2", -1: "q3 - q2"}[factor]}
        header = [f"! {line} ;" for words in comments(facts, "") for line in wrap(words.strip(), COMMENT)]
        parts = list(self.parts(len(rows)))
        if len(parts) == 1:
            path = self._file(target, name, header, rows, speeds, units)
            return unproved(path, "fanuc", (path,), facts)
        paths, calls = [], []
        for part, points in parts:
            own, chosen = f"{name}_{part:02d}", slice(points.start, points.stop)
            goes_on = part < len(parts)
            place = target.with_name(f"{own.lower()}{target.suffix}")
            paths.append(self._file(place, own, header, rows[chosen], speeds[chosen], units, goes_on))
            calls.append(f"CALL {own} ;")
        path = write_text(target, _program(name, [*header, *calls], []))
        return unproved(path, "fanuc", (path, *paths), facts)

    def _coupling(self, trajectory: Trajectory) -> int:
        if self.coupling is not None:
            return self.coupling
        robot = None
        if trajectory.origin is not None:
            robot = trajectory.origin.robot
        elif problems.known(trajectory.problem):
            robot = problems.load(trajectory.problem, **trajectory.case).robot
        if robot is None or robot.actuator_map is not None:
            raise InputError("joint 3 as shown needs the robot's axes; give the coupling: 1, -1, or 0 for none")
        return coupling_of(robot)

    def _file(
        self, target: Path, name: str, header: list[str], rows: Array, speeds: list[int], units: list[str],
        goes_on: bool = False,
    ) -> Path:  # fmt: skip
        """One program; all points but the last are rounded, and that one where there are more."""
        moves = []
        for i, speed in enumerate(speeds, 1):
            moves.append(f"J P[{i}] {speed}% {'CNT100' if i < len(speeds) or goes_on else 'FINE'} ;")
        positions = []
        for i, row in enumerate(rows.tolist(), 1):
            joints = [
                f"J{j}= {decimal(value)} {unit}" for j, (value, unit) in enumerate(zip(row, units, strict=True), 1)
            ]
            lines = [", ".join(joints[k : k + 3]) for k in range(0, len(joints), 3)]
            positions += [
                f"P[{i}]{{", "   GP1:", f"    UF : {self.frame}, UT : {self.tool},",
                *(f"    {line}{',' if k < len(lines) else ''}" for k, line in enumerate(lines, 1)), "};",
            ]  # fmt: skip
        return write_text(target, _program(name, [*header, *moves], positions))


def _program(name: str, lines: list[str], positions: list[str]) -> str:
    numbered = [f"{i:4d}:{'' if line.startswith('J ') else '  '}{line}" for i, line in enumerate(lines, 1)]
    head = [f"/PROG {name}", "/ATTR", "OWNER = MNEDITOR;", f"LINE_COUNT = {len(lines)};", "PROTECT = READ_WRITE;"]
    group = "1,*,*,*,*" if positions else "*,*,*,*,*"
    return "\n".join([*head, f"DEFAULT_GROUP = {group};", "/MN", *numbered, "/POS", *positions, "/END"]) + "\n"


def coupling_of(robot: Robot) -> int:
    """n2 . n3 of the axes of joints 2 and 3, which have to be parallel; 0 where there are not three joints."""
    model = robot.model
    if model.njoints < 4:
        return 0
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    axes = []
    for joint in (2, 3):
        move = data.oMi[joint].act(pin.Motion(data.joints[joint].S.ravel()))
        axes.append(np.asarray(move.angular))
    if np.linalg.norm(np.cross(axes[0], axes[1])) > PARALLEL or min(map(np.linalg.norm, axes)) == 0.0:
        raise InputError("the axes of joints 2 and 3 are not parallel; give the coupling: 1, -1, or 0 for none")
    return int(np.sign(axes[0] @ axes[1]))
