"""Fronts and trajectories for other programs: CSV, Parquet, JSON and ROS 2 messages."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pandas as pd

from ocp_traj import problems
from ocp_traj.curves.motion import COLUMNS
from ocp_traj.errors import InputError, quoted
from ocp_traj.files import plain, write_text, write_with
from ocp_traj.io.run_folder import MANIFEST, TABLE
from ocp_traj.io.run_reader import load_run, read_manifest
from ocp_traj.results.front_table import read_front_csv
from ocp_traj.results.trajectory import Trajectory

FORMAT = "ocp-traj/table/1"
FORMATS = ("csv", "parquet", "json", "ros")
ROS_SUFFIXES = (".yaml", ".yml", ".json")
PER_TIME = ("", "/s", "/s2", "/s3", "/s4")  # of q, v, a, jerk, snap


MOST_SAMPLES = 1_000_000  # a table of some hundred megabytes: our choice


def export(source: str | Path, format: str, destination: str | Path, *, samples: int = 200) -> Path:
    """Writes a front or a trajectory in another format.

    Args:
        source: a run folder, at any moment of the run, a ``front.csv``, or a trajectory's JSON file. The points of a
            run are proved anew; a ``front.csv`` that lies in no run of a known problem is taken as it is.
        format: ``csv``, ``parquet``, ``json`` (``{"format", "kind", "metadata", "rows"}``, a record a row), or, for a
            trajectory, ``ros``: a ``trajectory_msgs/msg/JointTrajectory`` of ROS 2 as ``.yaml`` or ``.json``.
        destination: the file to write.
        samples: number of even times a trajectory is sampled at, its ends included.
    """
    origin, target = Path(source), Path(destination)
    if format not in FORMATS:
        raise InputError(f"there is no export format {quoted(format)}; formats are {', '.join(FORMATS)}")
    if os.path.realpath(source) == os.path.realpath(destination):
        raise InputError(f"the export would overwrite its source {source}; give another file")
    if not 2 <= samples <= MOST_SAMPLES:
        raise InputError(f"a trajectory is sampled at {samples} times; give 2 to {MOST_SAMPLES}")
    if origin.is_dir() or origin.suffix.lower() == ".csv":
        if format == "ros":
            raise InputError(f"{source} is a front; ros is for one trajectory, such as trajectories/000.json of a run")
        table, metadata = _front(origin)
        return _WRITERS[format](table, {"kind": "front", "metadata": metadata}, target)
    trajectory = Trajectory.load(origin)
    if format == "ros":
        return _write_ros(trajectory, target, samples)
    metadata = {"problem": trajectory.problem, "case": trajectory.case, "parameters": trajectory.parameters}
    return _WRITERS[format](trajectory_table(trajectory, samples), {"kind": "trajectory", "metadata": metadata}, target)


def _front(source: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The front's table, and what its run folder says of it."""
    folder = source if source.is_dir() else source.parent
    if not source.is_dir() and not (source.name == TABLE and (folder / MANIFEST).is_file()):
        return read_front_csv(source).reset_index(), {}
    run = read_manifest(folder)
    if not source.is_dir() and not problems.known(str(run.get("problem"))):
        # A problem of the user's own, which nothing here can prove a point of.
        return read_front_csv(source).reset_index(), run
    return load_run(folder).table.reset_index(), run


def trajectory_table(trajectory: Trajectory, samples: int = 200) -> pd.DataFrame:
    """Samples of a trajectory: ``time [s]``, then ``JOINT q [unit]`` .. ``JOINT snap [unit/s4]`` of every joint.

    The joints' units are the problem's; a trajectory of no known problem has columns without units.
    """
    sampled = trajectory.sample(samples)
    units: tuple[str, ...] | None = None
    if trajectory.origin is not None:
        units = trajectory.origin.requirements.joint_units
    elif problems.known(trajectory.problem):
        units = problems.load(trajectory.problem, **trajectory.case).requirements.joint_units
    names = []
    for quantity, per_time in zip(COLUMNS, PER_TIME, strict=True):
        for index, joint in enumerate(trajectory.joints):
            names.append(f"{joint} {quantity}" + (f" [{units[index]}{per_time}]" if units else ""))
    sampled.columns = pd.Index(names)
    return sampled.reset_index()


def _write_csv(table: pd.DataFrame, about: dict[str, Any], target: Path) -> Path:
    return write_with(target, lambda temporary: table.to_csv(temporary, index=False))


def _write_json(table: pd.DataFrame, about: dict[str, Any], target: Path) -> Path:
    content = plain({"format": FORMAT, **about, "rows": table.to_dict("records")})
    return write_text(target, json.dumps(content, indent=1) + "\n")


def _write_parquet(table: pd.DataFrame, about: dict[str, Any], target: Path) -> Path:
    if find_spec("pyarrow") is None:
        raise InputError("parquet needs pyarrow, which is not installed; pip install 'ocp-traj[parquet]'")
    return write_with(target, lambda temporary: table.to_parquet(temporary, engine="pyarrow", index=False))


_WRITERS: dict[str, Callable[[pd.DataFrame, dict[str, Any], Path], Path]] = {
    "csv": _write_csv,
    "parquet": _write_parquet,
    "json": _write_json,
}


def _write_ros(trajectory: Trajectory, target: Path, samples: int) -> Path:
    """A JointTrajectory message; positions in rad and m, as ROS has them (REP 103)."""
    suffix = target.suffix.lower()
    if suffix not in ROS_SUFFIXES:
        raise InputError(f"a ros trajectory is written as {', '.join(ROS_SUFFIXES)}; {target.name!r} ends otherwise")
    sampled = trajectory.sample(samples)
    lists = [sampled[name].to_numpy().tolist() for name in ("q", "v", "a")]
    points = []
    for time, *rows in zip(sampled.index, *lists, strict=True):
        seconds, nanoseconds = divmod(round(float(time) * 1e9), 10**9)
        fields = dict(zip(("positions", "velocities", "accelerations"), rows, strict=True))
        points.append({**fields, "time_from_start": {"sec": seconds, "nanosec": nanoseconds}})
    if suffix == ".json":
        return write_text(target, json.dumps({"joint_names": trajectory.joints, "points": points}, indent=1) + "\n")
    lines = [f"joint_names: {json.dumps(trajectory.joints)}", "points:"]
    for point in points:
        entries = [f"{name}: {_flow(value)}" for name, value in point.items()]
        lines += [f"{'- ' if i == 0 else '  '}{entry}" for i, entry in enumerate(entries)]
    return write_text(target, "\n".join(lines) + "\n")


def _flow(value: Any) -> str:
    """A value in YAML's flow style, its numbers as YAML 1.1 (which ROS reads) knows them: 1e-05 would be a text."""
    if isinstance(value, list):
        return f"[{', '.join(_flow(item) for item in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_flow(item)}' for key, item in value.items())}}}"
    text = repr(value)
    return text.replace("e", ".0e", 1) if "e" in text and "." not in text else text
