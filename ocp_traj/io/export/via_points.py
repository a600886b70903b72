"""Points for controllers that time a motion anew: postures in degrees and millimetres, speeds in per cent, in files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import degrees
from pathlib import Path

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, quoted
from ocp_traj.formulation.case import number
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.io.export.exported import Timed
from ocp_traj.results.playback import Playback
from ocp_traj.results.trajectory import Trajectory

LONGEST_NAME = 20  # characters of a program's name without its number: our choice, within what both controllers take


@dataclass(frozen=True, kw_only=True)
class ViaPoints(Timed):
    """Points at knots or at a rate, in one file or several.

    Attributes:
        most_points: in a file; more go into further files, which the first one calls.
    """

    most_points: int = number(500, what="a whole number", least=2)

    def postures(self, trajectory: Trajectory, requirements: Requirements | None) -> tuple[Playback, Array, list[int]]:
        """The points, as degrees and millimetres ``(N, dof)``, and for each the speed towards it in per cent.

        A speed is the mean one of the joint that needs most of its limit, which is what a controller that moves all
        joints together takes it for; the first, towards the start, is 10 %.
        """
        if requirements is None:
            raise InputError("speeds in per cent need the joints' units and velocity limits; give limits, or a problem")
        limit = next((one for one in requirements.path_constraints if one.order == 1), None)
        if limit is None or not (np.isfinite(limit.lower) & np.isfinite(limit.upper)).all():
            raise InputError(
                "speeds in per cent need a velocity limit for each joint, of both signs; give them in limits"
            )
        found = self.played(trajectory, requirements)
        q = found.states[0]
        moved = np.diff(q, axis=0) / (np.diff(found.ticks) * 1e-9)[:, None]
        share = np.maximum(moved / limit.upper, moved / limit.lower).max(axis=1)
        speeds = [10, *np.clip(np.ceil(100.0 * share - 1e-9), 1, 100).astype(int).tolist()]
        factors = [degrees(1.0) if unit == "rad" else 1000.0 for unit in requirements.joint_units]
        return found, q * factors, speeds

    def parts(self, count: int) -> Iterator[tuple[int, range]]:
        """Number and points of each file."""
        for part, first in enumerate(range(0, count, self.most_points), 1):
            yield part, range(first, min(first + self.most_points, count))


def decimal(value: float) -> str:
    """A number of degrees or millimetres to a millionth; zero has no sign."""
    return f"{round(value, 6) + 0.0:.6f}"


def program_name(target: Path, suffixes: tuple[str, ...]) -> str:
    """A program's name, from that of its file: letters, digits and underscores, a letter first."""
    if target.suffix.lower() not in suffixes:
        raise InputError(f"such a program is written as {', '.join(suffixes)}; {target.name!r} ends otherwise")
    name = re.sub(r"[^A-Za-z0-9_]", "_", target.name.split(".")[0])
    if not name or not name[0].isalpha() or len(name) > LONGEST_NAME:
        raise InputError(
            f"a program is called by its file's name, {quoted(name)}; give one of 1 to {LONGEST_NAME} characters that "
            "begins with a letter, with -o"
        )
    return name
