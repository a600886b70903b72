"""Limits from a TOML file: what a trajectory from anywhere has to meet, without a problem of this package.

The format, ``ocp-traj/limits/1``, is described with an example in ``docs/formats.md``. All numbers are SI.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj import problems
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.files import read_text
from ocp_traj.problem import ORDERS, PathConstraint, PointConstraint, Requirements
from ocp_traj.robot import EFFORT_UNITS, QUANTITIES, Limits, Robot
from ocp_traj.trajectory import Trajectory

Array = NDArray[np.float64]

FORMAT = "ocp-traj/limits/1"
TABLES = (*QUANTITIES, "robot", "payload", "rest", "tool")
SI = "SI only: rad, m, s, kg, N, N m"
PER_TIME = ("", "/s", "/s2", "/s3", "/s4")  # of ORDERS
REST_TOLERANCE = 1e-9  # [of the derivative's unit], as PointConstraint: rounding is about 1e-13
PAYLOAD = "payload"  # the trajectory's parameter [kg]


@dataclass(frozen=True)
class _Table:
    """A table of the file, the file itself if it has no name; what it complains of is said with file and key."""

    path: Path
    name: str
    values: dict[str, Any]

    def error(self, key: str, fault: str) -> FileFormatError:
        place = f"[{self.name}] {key}" if self.name else key
        return FileFormatError(f"{self.path}: {place} {fault}")

    def only(self, *keys: str) -> None:
        for key in self.values:
            if key not in keys:
                raise self.error(key, f"is unknown; allowed are {', '.join(keys)} ({SI})")

    def table(self, name: str) -> _Table | None:
        values = self.values.get(name)
        if values is not None and not isinstance(values, dict):
            raise self.error(name, f"is {values!r}; it must be a table, [{name}]")
        return None if values is None else _Table(self.path, name, values)

    def get(self, key: str, kind: type, wanted: str, default: Any = None) -> Any:
        value = self.values.get(key, default)
        if value is None:
            raise self.error(key, f"is missing; give {wanted}")
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self.error(key, f"is {value!r}; give {wanted}")
        return value

    def whole(self, key: str, least: int) -> int:
        value: int = self.get(key, int, wanted := f"a whole number from {least} to {len(ORDERS) - 1}")
        if not least <= value < len(ORDERS):
            raise self.error(key, f"is {value}; give {wanted}")
        return value

    def number(self, key: str, wanted: str, default: float | None = None) -> float:
        value = self.get(key, int | float, wanted, default)  # type: ignore[arg-type]
        return _as_float(value)

    def numbers(self, key: str, size: int, what: str) -> Array:
        values = self.get(key, list, f"{size} numbers, {what}")
        plain = [_as_float(value) for value in values]
        if len(plain) != size or any(math.isnan(value) for value in plain):
            raise self.error(key, f"is {values!r}; give {size} numbers, {what} ({SI}; inf where there is no limit)")
        return np.array(plain)

    def names(self, key: str, wanted: str) -> tuple[str, ...]:
        values = self.get(key, list, wanted)
        if not values or not all(isinstance(value, str) and value for value in values):
            raise self.error(key, f"is {values!r}; give {wanted}")
        return tuple(values)

    def bounds(self, labels: tuple[str, ...], what: str) -> Array:
        """``lower`` and ``upper``, ``(2, n)``; one that is missing is infinite."""
        ends = {key: self.numbers(key, len(labels), what) for key in ("lower", "upper") if key in self.values}
        infinite = np.full(len(labels), np.inf)
        lower, upper = ends.get("lower", -infinite), ends.get("upper", infinite)
        for label, low, high in zip(labels, lower, upper, strict=True):
            if not low < high:
                raise self.error("lower", f"of {label} is {low:.9g}, upper is {high:.9g}; give lower < upper")
        return np.stack([lower, upper])


def _as_float(value: Any) -> float:
    """A TOML number; NaN for what is none."""
    try:
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:
        return math.nan


def read_requirements(path: str | Path) -> Requirements:
    """Reads a limits file; every fault raises ``FileFormatError`` in one line: file, key, what is allowed."""
    file = _read(Path(path))
    joints = file.names("joints", 'the joints\' names, such as ["A1", "A2"]')
    if len(set(joints)) < len(joints):
        raise file.error("joints", f"is {list(joints)}; give different names")
    units = file.names("units", wanted := f'one of "rad", "m" for each of {list(joints)} ({SI})')
    if len(units) != len(joints) or not set(units) <= set(EFFORT_UNITS):
        raise file.error("units", f"is {list(units)}; give {wanted}")
    given = Limits(**{name: _joint_bounds(file, name, joints) for name in QUANTITIES})
    robot, limits = _robot(file, joints, units, given)
    payload = _payload(file)

    path_constraints = [
        PathConstraint.on_derivative(f"{name}-limit", order, *pair, [u + PER_TIME[order] for u in units], joints)
        for order, name in enumerate(QUANTITIES[: len(ORDERS)])
        if (pair := limits.bounds(name)) is not None
    ]
    efforts = limits.bounds("effort")
    if efforts is not None:
        body = _needed(file, robot, "effort")
        path_constraints.append(
            PathConstraint(
                "force",
                lambda s: body.effort(s.q, s.v, s.a, payload=s.p[0] if payload is None else payload),
                *efforts,
                body.effort_units,
                tuple(("tau_" if unit == "rad" else "F_") + joint for joint, unit in zip(joints, units, strict=True)),
            )
        )
    elif payload != 0.0:
        raise file.error("[payload]", "changes nothing without limits on the effort; give [effort] or leave it out")
    box = file.table("tool")
    if box is not None:
        axes, holder = ("x", "y", "z"), _needed(file, robot, "tool")
        box.only("lower", "upper")
        low, high = box.bounds(axes, "x, y, z [m] in the world")
        path_constraints.append(PathConstraint("tool-box", lambda s: holder.tool_pose(s.q)[1], low, high, ("m",) * 3, axes))
    path_constraints = [c for c in path_constraints if np.isfinite([*c.lower, *c.upper]).any()]
    rest = _rest(file, joints, units)
    continuity = file.whole("continuity", 0) if "continuity" in file.values else -1
    if not path_constraints and not rest and continuity < 0:
        raise FileFormatError(f"{path} limits nothing; give one or more of {', '.join(f'[{name}]' for name in TABLES)}")
    parameters = (PAYLOAD,) if payload is None else ()
    return Requirements(joints, units, tuple(path_constraints), rest, parameters, continuity)


def check_joints(trajectory: Trajectory, requirements: Requirements) -> None:
    """Raises ``InputError`` unless a trajectory has the joints of its limits, in their order."""
    if trajectory.joints != requirements.joints:
        raise InputError(
            f"the trajectory's joints are {list(trajectory.joints)}, those of the limits {list(requirements.joints)}; "
            "give the same names in the same order"
        )


def _read(path: Path) -> _Table:
    try:
        file = _Table(path, "", tomllib.loads(read_text(path, "limits")))
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(f"{path} is not a limits file: not TOML ({error})") from error
    if file.values.get("format") != FORMAT:
        raise FileFormatError(
            f"{path} is not a limits file: its format is {file.values.get('format')!r}; allowed is {FORMAT!r}"
        )
    file.only("format", "joints", "units", "continuity", *TABLES)
    return file


def _joint_bounds(file: _Table, name: str, joints: tuple[str, ...]) -> Array | None:
    table = file.table(name)
    if table is None:
        return None
    table.only("lower", "upper", "limit")
    what = f"one a joint of {list(joints)}"
    if set(table.values) == {"limit"}:
        limit = table.numbers("limit", len(joints), what)
        if not (limit > 0.0).all():
            raise table.error("limit", f"is {limit.tolist()}; give numbers above zero: the motion stays within +-limit")
        return np.stack([-limit, limit])
    if set(table.values) != {"lower", "upper"}:
        keys = ", ".join(table.values) or "nothing"
        raise FileFormatError(f"{file.path}: [{name}] has {keys}; give lower and upper (inf for none), or limit alone")
    return table.bounds(joints, what)


def _needed(file: _Table, robot: Robot | None, table: str) -> Robot:
    if robot is None:
        raise FileFormatError(f"{file.path}: [{table}] needs the robot; give [robot] with urdf or problem")
    return robot


def _robot(
    file: _Table, joints: tuple[str, ...], units: tuple[str, ...], given: Limits
) -> tuple[Robot | None, Limits]:
    """The robot, and the limits with its own where they are asked for."""
    table = file.table("robot")
    if table is None:
        return None, given
    if ("urdf" in table.values) == ("problem" in table.values):
        raise FileFormatError(f"{file.path}: [robot] needs urdf or problem, and only one of them")
    own = table.get("limits", bool, "true or false", False)
    options: dict[str, Any] = {}
    if "problem" in table.values:
        table.only("problem", "limits")
    else:
        table.only("urdf", "gravity", "tool_frame", "limits")
        if "gravity" in table.values:
            options["gravity"] = table.numbers("gravity", 3, "[m/s2] in the world")
        if "tool_frame" in table.values:
            options["tool_frame"] = table.get("tool_frame", str, "the name of a link or frame")

    def load(limits: Limits) -> Robot:
        try:
            if "problem" in table.values:
                found: Robot = problems.load(table.get("problem", str, "the id of a problem")).robot
                return found
            urdf = file.path.parent / table.get("urdf", str, "the path of a URDF file, from this file's folder")
            return Robot.from_urdf(urdf, limits=limits, **options)
        except FileFormatError:
            raise
        except InputError as error:
            raise FileFormatError(f"{file.path}: [robot]: {error}") from error
    ...
