"""Points of a path from files: a table with a column for each joint, or a ``trajectory_msgs`` message's positions."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ocp_traj.arrays import Array
from ocp_traj.errors import MOST_NAMES, FileFormatError, cut, nearest, quoted
from ocp_traj.files import read_text

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast, where PyYAML was built with it


def read_points(path: str | Path, joints: Sequence[str]) -> tuple[Array, tuple[str, ...]]:
    """Points ``(N, dof)`` of a file, its columns in the order of ``joints``, and what messages call each of them.

    ``.csv``: a line of joint names, in any order, then a line a point. ``.yaml``, ``.yml``, ``.json``: a
    ``trajectory_msgs/JointTrajectory`` message; its times, velocities and accelerations are not looked at.

    Raises:
        FileFormatError: one line that names file, line or point, and joint.
    """
    text, suffix = read_text(path, "path").removeprefix("\ufeff"), Path(path).suffix.lower()
    if suffix == ".csv":
        return _table(text, str(path), joints)
    if suffix in (".yaml", ".yml", ".json"):
        return _message(_values(text, suffix, str(path)), str(path), joints)
    raise FileFormatError(f"{path}: points of a path are read from .csv, .yaml, .yml and .json; give one of these")


def _table(text: str, source: str, joints: Sequence[str]) -> tuple[Array, tuple[str, ...]]:
    rows = csv.reader(text.splitlines(), skipinitialspace=True)
    found: list[list[float]] = []
    places: list[str] = []
    order: list[int] = []
    width = 0
    try:
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            place = f"line {rows.line_num}"
            if not order:
                order, width = _order([cell.strip() for cell in row], f"{source}, {place}", joints), len(row)
                continue
            if len(row) != width:
                raise FileFormatError(f"{source}, {place}: {len(row)} numbers; the first line names {width} columns")
            found.append([_number(row[i], f"{source}, {place}, {name}") for i, name in zip(order, joints, strict=True)])
            places.append(place)
    except csv.Error as error:
        raise FileFormatError(f"{source}, line {rows.line_num}: {error}") from error
    return _checked(found, places, source, joints)


def _values(text: str, suffix: str, source: str) -> Any:
    try:
        return json.loads(text) if suffix == ".json" else next(iter(yaml.load_all(text, Loader=LOADER)), None)
    except json.JSONDecodeError as error:
        raise FileFormatError(f"{source} is not a path: not JSON (line {error.lineno}: {error.msg})") from error
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        words = " ".join(str(error).split())
        raise FileFormatError(f"{source} is not a path: not YAML ({cut(words, 200)})") from error


def _message(data: Any, source: str, joints: Sequence[str]) -> tuple[Array, tuple[str, ...]]:
    names, points = (data.get(key) if isinstance(data, dict) else None for key in ("joint_names", "points"))
    if not isinstance(names, list) or not isinstance(points, list):
        raise FileFormatError(
            f"{source} is not a path: it has no lists joint_names and points; give a trajectory_msgs/JointTrajectory"
        )
    order = _order([str(name) for name in names], f"{source}, joint_names", joints)
    found, places = [], []
    for number, point in enumerate(points, 1):
        place, positions = f"point {number}", point.get("positions") if isinstance(point, dict) else None
        if not isinstance(positions, list) or len(positions) != len(names):
            raise FileFormatError(
                f"{source}, {place}: positions are {quoted(positions)}; give {len(names)} numbers, one a joint name"
            )
        found.append(
            [_number(positions[i], f"{source}, {place}, {name}") for i, name in zip(order, joints, strict=True)]
        )
        places.append(place)
    return _checked(found, places, source, joints)


def _order(names: Sequence[str], place: str, joints: Sequence[str]) -> list[int]:
    """The column of each joint."""
    allowed = f"the robot's joints are {quoted(list(joints), MOST_NAMES)}"
    for name in names:
        if name not in joints:
            raise FileFormatError(f"{place}: there is no joint {quoted(name)}{nearest(name, joints)}; {allowed}")
        if names.count(name) > 1:
            raise FileFormatError(f"{place}: the joint {quoted(name)} is named twice; name it once")
    for joint in joints:
        if joint not in names:
            raise FileFormatError(f"{place}: the joint {quoted(joint)} is missing; {allowed}; give all of them")
    return [names.index(joint) for joint in joints]


def _number(value: Any, place: str) -> float:
    try:
        number = float("nan") if isinstance(value, bool) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = float("nan")
    if not np.isfinite(number):
        raise FileFormatError(f"{place}: {quoted(value)} is no finite number")
    return number


def _checked(
    found: list[list[float]], places: list[str], source: str, joints: Sequence[str]
) -> tuple[Array, tuple[str, ...]]:
    if len(found) < 2:
        raise FileFormatError(f"{source} has {len(found)} points; a path needs two or more")
    return np.array(found).reshape(-1, len(joints)), tuple(f"{place} of {source}" for place in places)
