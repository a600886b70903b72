"""Motions from files: control points, samples, spline coefficients, scipy's BPoly, ROS messages and tables.

Every reader takes plain values and returns a curve; what is wrong with them is a ``ValueError`` or ``KeyError``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.interpolate import CubicSpline

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier, elevation_matrix
from ocp_traj.curves.interpolation import interpolate
from ocp_traj.errors import FileFormatError, cut, quoted
from ocp_traj.files import read_json, read_text

FORMAT = "ocp-traj/trajectory/1"
SAMPLES_FORMAT = "ocp-traj/samples/1"
SPLINE_FORMAT = "ocp-traj/spline/1"
BPOLY_FORMAT = "ocp-traj/bpoly/1"
ROS_FORMAT = "trajectory_msgs/JointTrajectory"  # has no field that says so
HIGHEST_DEGREE = 60  # of a file's segments: our choice; of higher ones rounding leaves nothing
ROS_FIELDS = ("positions", "velocities", "accelerations")
COLUMN = re.compile(r"(?P<joint>.+) (?P<quantity>q|v|a|jerk|snap)(?: \[(?P<unit>[^\]]*)\])?")
UNITS = ("rad", "m")
PER_TIME = {"q": "", "v": "/s", "a": "/s2"}
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast, where PyYAML was built with it


def read_values(path: str | Path) -> Any:
    """Plain values of a trajectory's file: JSON, YAML (a ROS message) or CSV (a table of samples), by its name."""
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        return _table(read_text(path, "trajectory"), str(path))
    if suffix not in (".yaml", ".yml"):
        return read_json(path, "trajectory")
    text = read_text(path, "trajectory")
    try:
        return next(iter(yaml.load_all(text, Loader=LOADER)), None)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        words = " ".join(str(error).split())
        raise FileFormatError(f"{path} is not a trajectory file: not YAML ({cut(words, 200)})") from error


def kind_of(data: Any) -> Any:
    """The format that values say they are of; a ROS message is known by its fields."""
    if not isinstance(data, dict):
        return None
    if "format" not in data and {"joint_names", "points"} <= set(data):
        return ROS_FORMAT
    return data.get("format")


def joints_of(data: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the joints."""
    joints = data["joint_names"] if "joint_names" in data and "joints" not in data else data["joints"]
    if not isinstance(joints, list | tuple) or len({str(name) for name in joints}) < len(joints):
        raise ValueError(f"joints are {quoted(joints)}; give a list of different names")
    return tuple(str(name) for name in joints)


def finite(values: Any, what: str, rank: int) -> Array:
    """Finite numbers in an array of so many dimensions."""
    numbers = np.asarray(values, dtype=float)
    if numbers.ndim != rank:  # one of another shape would be broadcast into a curve nobody meant
        raise ValueError(f"{what} must be nested {rank} deep, not {numbers.ndim}")
    if not np.isfinite(numbers).all():
        raise ValueError(f"{what} must be finite numbers")
    return numbers


def _control_points(data: dict[str, Any]) -> PiecewiseBezier:
    durations = finite(data["durations"], "durations", 1)
    segments = tuple(finite(points, "control points", 2) for points in data["control_points"])
    for points in segments:
        _check_degree(len(points) - 1)
    return PiecewiseBezier(durations, segments)


def _check_degree(degree: int) -> None:
    if degree > HIGHEST_DEGREE:
        raise ValueError(f"a segment is of degree {degree}; allowed are degrees up to {HIGHEST_DEGREE}")


def _samples(data: dict[str, Any]) -> PiecewiseBezier:
    """A C2 spline through positions; where each has a velocity cubics, with an acceleration too quintics."""
    times, positions = finite(data["times"], "times", 1), finite(data["positions"], "positions", 2)
    states = [finite(data[name], name, 2) for name in ROS_FIELDS if name in data]
    if any(rows.shape != (len(times), positions.shape[1]) for rows in states):
        raise ValueError(f"{', '.join(ROS_FIELDS)} need a row for each of the {len(times)} times, of one length")
    durations = np.diff(times)
    if not len(durations) or not (durations > 0.0).all():
        raise ValueError("times must be two or more, strictly increasing")
    if "velocities" in data:
        return interpolate(durations, states)
    if len(states) > 1:
        raise ValueError("there are accelerations without velocities; give both")
    rest = data.get("rest", False)
    if not isinstance(rest, bool):
        raise ValueError(f"rest is {quoted(rest)}; give true or false")
    return PiecewiseBezier.from_ppoly(CubicSpline(times, positions, bc_type="clamped" if rest else "not-a-knot"))


def _spline(data: dict[str, Any]) -> PiecewiseBezier:
    durations = np.diff(finite(data["knots"], "knots", 1))
    segments = []
    for duration, powers in zip(durations, data["coefficients"], strict=True):
        coefficients = finite(powers, "coefficients", 2)
        degree = len(coefficients) - 1
        _check_degree(degree)
        # B_i = sum_j C(i, j) / C(n, j) c_j T^j; Farin (2002), sect. 5.8.
        scaled = coefficients * (duration ** np.arange(degree + 1))[:, None]
        change = np.array([[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)])
        segments.append(change @ scaled)
    return PiecewiseBezier(durations, tuple(segments))


def _bpoly(data: dict[str, Any]) -> PiecewiseBezier:
    """Each segment at its own degree again, if ``degrees`` say which; durations as given, else those between ``x``."""
    knots, raised = finite(data["x"], "x", 1), finite(data["c"], "c", 3)
    durations = finite(data["durations"], "durations", 1) if "durations" in data else np.diff(knots)
    high, count = raised.shape[0] - 1, raised.shape[1]
    _check_degree(high)
    if len(knots) != count + 1 or np.abs(np.diff(knots) - durations).max() > 1e-12 * np.abs(knots).max():
        raise ValueError(f"c has {count} segments; x and durations have to be theirs")
    degrees = data.get("degrees", [high] * count)
    if len(degrees) != count or not all(isinstance(n, int) and 0 <= n <= high for n in degrees):
        raise ValueError(f"degrees are {quoted(degrees)}; give a whole number up to {high} for each segment")
    segments = []
    for k, degree in enumerate(degrees):
        raising = elevation_matrix(degree, high)
        points = raised[:, k, :] if degree == high else np.linalg.lstsq(raising, raised[:, k, :], rcond=None)[0]
        if np.abs(raising @ points - raised[:, k, :]).max() > 1e-12 * (1.0 + np.abs(raised).max()):
            raise ValueError(f"segment {k} is not of degree {degree}")
        segments.append(points)
    return PiecewiseBezier(durations, tuple(segments))


def _ros(data: dict[str, Any]) -> PiecewiseBezier:
    points = data["points"]
    if not points:
        raise ValueError("there are no points")
    stamps = [point["time_from_start"] for point in points]
    ticks = [int(stamp.get("sec", 0)) * 10**9 + int(stamp.get("nanosec", 0)) for stamp in stamps]
    given = [name for name in ROS_FIELDS if any(point.get(name) for point in points)]
    # Differences of whole nanoseconds are exact; those of seconds are not.
    times = (np.array(ticks, dtype=np.int64) - ticks[0]) if ticks else np.zeros(0, dtype=np.int64)
    found = {name: [point[name] for point in points] for name in given}
    if given and given[0] != "positions":
        raise ValueError("there are no positions")
    states = [finite(found[name], name, 2) for name in given]
    if len(states) < 2 or "velocities" not in given:
        return _samples({"times": times * 1e-9, **found})
    if len(times) < 2 or not (np.diff(times) > 0).all():
        raise ValueError("times must be two or more, strictly increasing")
    if len({rows.shape for rows in states}) > 1:
        raise ValueError(f"{', '.join(given)} differ in their numbers of joints")
    return interpolate(np.diff(times) * 1e-9, states)


def _table(text: str, source: str) -> dict[str, Any]:
    """Samples of a table with a header ``time [s]``, ``JOINT q [unit]``, ..; lines that begin with # are left out."""
    rows = list(csv.reader(line for line in text.splitlines() if line.strip() and not line.startswith("#")))
    if not rows or "time [s]" not in rows[0]:
        raise FileFormatError(f"{source} is not a trajectory table: its header has no column 'time [s]'")
    header, units = rows[0], dict[str, str]()
    places: dict[tuple[str, str], int] = {}
    for i, name in enumerate(header):
        match = COLUMN.fullmatch(name)
        if match is None:
            if name != "time [s]":
                raise FileFormatError(
                    f"{source}: the column {quoted(name)} is not 'time [s]', 'JOINT q [unit]', 'JOINT v [unit/s]', .."
                )
            continue
        joint, quantity, unit = match["joint"], match["quantity"], match["unit"]
        places[joint, quantity] = i
        if quantity in PER_TIME and unit is not None:
            allowed = [base + PER_TIME[quantity] for base in UNITS]
            if unit not in allowed or units.setdefault(joint, unit.partition("/")[0]) != unit.partition("/")[0]:
                raise FileFormatError(
                    f"{source}: the column {quoted(name)} is in {unit}; give {' or '.join(allowed)}, one unit a joint"
                )
    joints = list(dict.fromkeys(joint for joint, quantity in places if quantity == "q"))
    if not joints:
        raise FileFormatError(f"{source} is not a trajectory table: it has no column 'JOINT q [unit]'")
    try:
        numbers = np.array([[float(entry) for entry in row] for row in rows[1:]]).reshape(-1, len(header))
    except ValueError as error:
        raise FileFormatError(
            f"{source}: {cut(str(error), 200)}; give numbers, as many in each row as columns"
        ) from error
    found: dict[str, Any] = {"format": SAMPLES_FORMAT, "joints": joints, "times": numbers[:, header.index("time [s]")]}
    for quantity, name in zip(PER_TIME, ROS_FIELDS, strict=True):
        if not all((joint, quantity) in places for joint in joints):
            break
        found[name] = numbers[:, [places[joint, quantity] for joint in joints]]
    return found


READERS: dict[str, Callable[[dict[str, Any]], PiecewiseBezier]] = {
    FORMAT: _control_points,
    SAMPLES_FORMAT: _samples,
    SPLINE_FORMAT: _spline,
    BPOLY_FORMAT: _bpoly,
    ROS_FORMAT: _ros,
}


@contextmanager
def sound(data: Any, source: str) -> Iterator[None]:
    """What readers raise as one line that names the file."""
    kind = kind_of(data)
    try:
        yield
    except FileFormatError:
        raise
    except KeyError as error:
        raise FileFormatError(f"{source}: the field {error} of format {kind} is missing") from error
    except (TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        raise FileFormatError(f"{source} is not a sound {kind} file: {cut(str(error), 200)}") from error


def curve_of(data: Any, source: str) -> PiecewiseBezier:
    """The curve of a file's plain values, in one of the formats of ``READERS``."""
    kind = kind_of(data)
    if not isinstance(kind, str) or kind not in READERS:
        raise FileFormatError(
            f"{source} is not a trajectory: its format is {quoted(kind)}; allowed {', '.join(READERS)}"
        )
    with sound(data, source):
        return READERS[kind](data)
