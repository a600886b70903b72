"""Tables: CSV, Parquet and JSON of fronts, and of trajectories sampled, at their knots or at a rate."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj import problems
from ocp_traj.curves.motion import COLUMNS
from ocp_traj.errors import InputError
from ocp_traj.files import plain, write_text, write_with
from ocp_traj.formulation.case import number
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.formulation.standard import PER_TIME
from ocp_traj.io.export.exported import Exported, Timed, about, comments
from ocp_traj.results.playback import MOST_POINTS
from ocp_traj.results.trajectory import Trajectory

FORMAT = "ocp-traj/table/1"
SAMPLES = 200  # where nothing else is asked for: our choice


@dataclass(frozen=True, kw_only=True)
class Table(Timed):
    """Rows of times with q, v, a of every joint; without ``at`` and ``rate``, even samples with jerk and snap too.

    Attributes:
        samples: number of even times, the ends included; for tables that no controller is to play.
    """

    samples: int | None = number(None, what="a whole number", least=2, most=MOST_POINTS, whole=True)

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes the table; one for a controller with what is proved of it."""
        metadata = {"problem": trajectory.problem, "case": trajectory.case, "parameters": trajectory.parameters}
        kind: dict[str, Any] = {"kind": "trajectory", "metadata": metadata}
        if not self.plays:
            if self.joints:
                raise InputError("joints are renamed in tables at knots or at a rate; give one of the two")
            table = trajectory_table(trajectory, SAMPLES if self.samples is None else self.samples)
            return Exported(self._put(table, kind, target), self._format, (target,), {})
        if self.samples is not None:
            raise InputError("a table has samples, or points at knots or at a rate; give one of them")
        names, found = self.names(trajectory), self.played(trajectory, requirements)
        columns = {"time [s]": found.ticks / 1e9}
        for rows, header in zip(found.states, _headers(trajectory, names), strict=False):
            columns |= dict(zip(header, rows.T, strict=True))
        facts = about(found)
        path = self._put(pd.DataFrame(columns), {**kind, "about": facts}, target)
        return Exported(path, self._format, (path,), facts, found.verdict)

    @property
    def plays(self) -> bool:
        """Whether a controller is to play the rows."""
        return self.at is not None or self.rate is not None

    @property
    def _format(self) -> str:
        return type(self).__name__.lower()

    def _put(self, table: pd.DataFrame, said: Mapping[str, Any], target: Path) -> Path:
        return WRITERS[self._format](table, said, target)


class Csv(Table):
    """Comma-separated; what is said of points for a controller stands in lines that begin with #."""


class Parquet(Table):
    """Parquet, by pyarrow; what is said stands in its metadata, pandas' ``attrs``."""


class Json(Table):
    """``{"format", "kind", "metadata", "about", "rows"}``, a record a row."""


def trajectory_table(trajectory: Trajectory, samples: int = SAMPLES) -> pd.DataFrame:
    """Samples of a trajectory: ``time [s]``, then ``JOINT q [unit]`` .. ``JOINT snap [unit/s4]`` of every joint.

    The joints' units are the problem's; a trajectory of no known problem has columns without units.
    """
    if not 2 <= samples <= MOST_POINTS:
        raise InputError(f"a trajectory is sampled at {samples} times; give 2 to {MOST_POINTS}")
    sampled = trajectory.sample(samples)
    sampled.columns = pd.Index(np.concatenate(_headers(trajectory, trajectory.joints)).tolist())
    return sampled.reset_index()


def joint_units(trajectory: Trajectory) -> tuple[str, ...] | None:
    """Units of the joints, where the trajectory's problem is known."""
    if trajectory.origin is not None:
        return trajectory.origin.requirements.joint_units
    if problems.known(trajectory.problem):
        return problems.load(trajectory.problem, **trajectory.case).requirements.joint_units
    return None


def _headers(trajectory: Trajectory, names: Any) -> list[list[str]]:
    """Names of the columns, a list a quantity."""
    units = joint_units(trajectory)
    return [
        [f"{name} {quantity}" + (f" [{units[i]}{per_time}]" if units else "") for i, name in enumerate(names)]
        for quantity, per_time in zip(COLUMNS, PER_TIME, strict=True)
    ]


def _write_csv(table: pd.DataFrame, said: Mapping[str, Any], target: Path) -> Path:
    lines = comments(said["about"]) if "about" in said else []

    def write(temporary: Path) -> None:
        with temporary.open("w", encoding="utf-8", newline="") as file:
            file.writelines(f"{line}\n" for line in lines)
            table.to_csv(file, index=False, lineterminator="\n")

    return write_with(target, write)


def _write_json(table: pd.DataFrame, said: Mapping[str, Any], target: Path) -> Path:
    content = plain({"format": FORMAT, **said, "rows": table.to_dict("records")})
    return write_text(target, json.dumps(content, indent=1) + "\n")


def _write_parquet(table: pd.DataFrame, said: Mapping[str, Any], target: Path) -> Path:
    if find_spec("pyarrow") is None:
        raise InputError("parquet needs pyarrow, which is not installed; pip install 'ocp-traj[parquet]'")
    if "about" in said:
        table.attrs = plain(said["about"])
    return write_with(target, lambda temporary: table.to_parquet(temporary, engine="pyarrow", index=False))


WRITERS: dict[str, Callable[[pd.DataFrame, Mapping[str, Any], Path], Path]] = {
    "csv": _write_csv,
    "parquet": _write_parquet,
    "json": _write_json,
}
