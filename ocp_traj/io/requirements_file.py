"""Limits from a TOML file: what a trajectory from anywhere has to meet, without a problem of this package.

The format, ``ocp-traj/limits/1``, is described with an example in ``docs/formats.md``. All numbers are SI.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from math import isinf
from pathlib import Path
from sys import float_info
from typing import Any

import numpy as np

from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.errors import FileFormatError, InputError, cut, quoted
from ocp_traj.files import read_text
from ocp_traj.formulation import standard
from ocp_traj.formulation.requirements import (
    ORDERS,
    ParameterBound,
    PointConstraint,
    Requirements,
    State,
)
from ocp_traj.robot.descriptions import description_urdf
from ocp_traj.robot.inertias import missing_inertias, require_exact
from ocp_traj.robot.joint_limits import QUANTITIES, UNLIMITED, JointLimits
from ocp_traj.robot.robot import EFFORT_UNITS, Robot

Names = tuple[str, ...]

FORMAT = "ocp-traj/limits/1"
SI = "SI only, no degrees"
UNITS = set(EFFORT_UNITS)
GRAVITY = [0.0, 0.0, -9.81]  # [m/s^2], where the file gives none
REST_TOLERANCE = 1e-9  # [of the derivative's unit], where the file gives none; rounding is about 1e-13


@dataclass(frozen=True)
class _Table:
    """A table of the file, or the whole file if it has no name; complaints name the file and the key."""

    path: Path
    name: str
    values: dict[str, Any]

    def error(self, key: str, fault: str) -> FileFormatError:
        return FileFormatError(f"{self.path}: {f'[{self.name}] ' if self.name else ''}{key} {fault}")

    def only(self, *keys: str) -> None:
        for key in self.values:
            if key not in keys:
                raise self.error(cut(key), f"is not allowed here; allowed are {', '.join(keys)} ({SI})")

    def table(self, name: str, *keys: str) -> _Table:
        """The table called ``name``, empty if there is none; it may hold ``keys`` only."""
        found = _Table(self.path, name, self.get(name, dict, f"a table, [{name}]", default={}))
        found.only(*keys)
        if name in self.values and not found.values:
            raise self.error(f"[{name}]", f"is empty; give {', '.join(keys)}, or leave it out")
        return found

    def get(self, key: str, kind: Any, wanted: str, sound: Any = lambda _: True, default: Any = None) -> Any:
        """A sound value of the right kind; ``default``, if there is one, where the file gives none."""
        if key not in self.values and default is None:
            raise self.error(key, f"is missing; give {wanted}")
        value = self.values.get(key, default)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool) or not sound(value):
            raise self.error(key, f"is {quoted(value)}; give {wanted}")
        return value

    def numbers(self, key: str, size: int, what: str, default: list[float] | None = None) -> Array:
        wanted = f"{size} numbers below {UNLIMITED:g}, inf for no limit, {what} ({SI})"
        return np.array(self.get(key, list, wanted, lambda v: _are_numbers(v) and len(v) == size, default), dtype=float)


def _are_numbers(values: list[Any]) -> bool:
    """Whether a TOML list holds numbers only: infinite ones mean no limit, NaN and such as are too large do not."""
    return all(type(x) in (int, float) and (abs(x) < UNLIMITED or abs(x) == float("inf")) for x in values)


def _float(text: str) -> float:
    """A TOML float; one that no float can hold is not taken for infinity, which means that there is no limit."""
    value = float(text)
    return float("nan") if isinf(value) and "inf" not in text else value


def _are_names(values: list[Any]) -> bool:
    return bool(values) and all(isinstance(x, str) and x and values.count(x) == 1 for x in values)


def read_requirements(path: str | Path) -> Requirements:
    """Reads a limits file; a fault raises ``FileFormatError``: one line with file, key and what is allowed."""
    try:
        file = _Table(Path(path), "", tomllib.loads(read_text(path, "limits"), parse_float=_float))
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(f"{path} is not a limits file: not TOML ({cut(str(error), 200)})") from error
    except RecursionError as error:
        raise FileFormatError(f"{path} is not a limits file: nested too deep") from error
    if (kind := file.values.get("format")) != FORMAT:
        raise FileFormatError(f"{path} is not a limits file: its format is {quoted(kind)}; allowed is {FORMAT!r}")
    file.only("format", "joints", "units", "continuity", *QUANTITIES, "robot", "payload", "rest", "tool")
    wanted = 'a list of different names, such as ["A1", "A2"]'
    joints = tuple(file.get("joints", list, wanted, _are_names))
    wanted = f'"rad" or "m" for each of {list(joints)} ({SI})'
    units = tuple(file.get("units", list, wanted, lambda v: len(v) == len(joints) and set(map(str, v)) <= UNITS))
    each = f"one for each of {list(joints)}"
    given = JointLimits(
        **{name: _bounds(file.table(name, "lower", "upper", "limit"), joints, each) for name in QUANTITIES}
    )
    robot, limits = _robot(file, joints, units, given)
    constraints = list(standard.joint_limits(limits, joints, units))
    payload = _payload(file.table("payload", "mass", "parameter"))
    if (efforts := limits.bounds("effort")) is not None:
        if lacking := missing_inertias(robot.model):
            raise file.error(
                "[effort]",
                f"means nothing for a robot without inertia beyond {', '.join(lacking)}; give it its inertias",
            )
        try:
            require_exact(robot.model, robot.tool.translation, payload or 0.0, efforts, f"{file.path}: [effort]")
        except InputError as error:
            raise FileFormatError(str(error)) from error
        labels = tuple(("tau_" if unit == "rad" else "F_") + joint for unit, joint in zip(units, joints, strict=True))

        def effort(s: State) -> Any:
            return robot.effort(s.q, s.v, s.a, payload=s.p[0] if payload is None else payload)

        constraints.append(standard.effort_limit(effort, efforts, robot.effort_units, labels))
    elif payload != 0.0:
        raise file.error("[payload]", "changes nothing where the effort has no limits; give [effort] too")
    where = file.table("tool", "lower", "upper")
    if (box := _bounds(where, standard.AXES, "x, y, z [m] in the world", True)) is not None:
        constraints.append(standard.tool_box(robot, *box))
    constraints = [limit for limit in constraints if np.isfinite([limit.lower, limit.upper]).any()]
    points = _rest(file.table("rest", "order", "tolerance"), joints, units)
    if not constraints and not points and "continuity" not in file.values:
        raise FileFormatError(f"{path} limits nothing; give at least one finite limit, [rest] or continuity")
    # A bounded m-th derivative means that the one below it does not jump; an effort bounds the acceleration.
    least = max([0, *(2 if limit.id == standard.EFFORT else limit.order or 0 for limit in constraints)]) - 1
    wanted = "a whole number from 0 to 4"
    continuity = file.get("continuity", int, wanted, lambda n: 0 <= n < len(ORDERS), max(least, 0))
    brought = (ParameterBound("payload", 0.0, float("inf"), "kg"),) if payload is None else ()
    return Requirements(
        joints, units, tuple(constraints), points, tuple(bound.parameter for bound in brought), continuity,
        parameter_bounds=brought,
    )  # fmt: skip


def _bounds(table: _Table, labels: Names, what: str, optional: bool = False) -> tuple[Array, Array] | None:
    """Lower and upper bounds ``(n,)``; with ``optional``, a side that is not given is infinite."""
    if not table.values:
        return None
    if "limit" in table.values:
        table.only("limit")
        upper = table.numbers("limit", len(labels), what)
        lower = -upper
    else:
        free = {"lower": [-np.inf] * len(labels), "upper": [np.inf] * len(labels)} if optional else {}
        lower, upper = (table.numbers(key, len(labels), what, free.get(key)) for key in ("lower", "upper"))
    for label, low, high in zip(labels, lower, upper, strict=True):
        if not low < high:
            raise table.error(label, f"has lower {low:.9g} and upper {high:.9g}; give lower < upper, or a limit > 0")
    return lower, upper


def _robot(file: _Table, joints: Names, units: Names, given: JointLimits) -> tuple[Any, JointLimits]:
    """The robot, if there is one, and the limits: the given ones, and its own beside them where those are wanted."""
    table = file.table("robot", "urdf", "description", "problem", "gravity", "tool_frame", "locked", "limits")
    if not table.values:
        for name in (n for n in ("effort", "tool") if n in file.values):
            raise file.error(f"[{name}]", "needs the robot; give [robot] with urdf, description or problem")
        return None, given
    own = table.get("limits", bool, "true or false", default=False)
    if "problem" in table.values:
        table.only("problem", "limits")
        known = problems.names()
        robot = problems.load(table.get("problem", str, f"one of {', '.join(known)}", lambda x: x in known)).robot
    else:
        kind = "description" if "description" in table.values else "urdf"
        if kind == "description":
            table.only("description", "gravity", "tool_frame", "locked", "limits")
        source = table.get(kind, str, "the path of a URDF file, from this file's folder; or description, or problem")
        frame = table.get("tool_frame", str, "the name of a link or frame", default="") or None
        gravity = table.numbers("gravity", 3, "x, y, z [m/s2] in the world", GRAVITY)
        wanted = f"a table of joints and where to hold them, such as {{ finger = 0.02 }} [m or rad] ({SI})"
        locked = table.get("locked", dict, wanted, lambda v: _are_numbers(list(v.values())), {})
        try:
            urdf = description_urdf(source) if kind == "description" else file.path.parent / source
            robot = Robot.from_urdf(
                urdf, limits=given if own else None, file_limits=own, tool_frame=frame, locked=locked, gravity=gravity
            )
        except InputError as error:
            fault = " ".join(str(error).split()).replace("override it with limits=", "give that table in this file")
            raise table.error(f"{kind}:", fault) from error
    theirs, ours = (dict(zip(*pair, strict=True)) for pair in ((robot.joints, robot.units), (joints, units)))
    if list(theirs.items()) != list(ours.items()):
        raise table.error("has the joints", f"{theirs}, this file {ours}; give the same, in the same order")
    return robot, robot.limits.overridden_by(given) if own else given


def _payload(table: _Table) -> float | None:
    """The mass [kg]; ``None`` where it is the trajectory's parameter."""
    if "parameter" in table.values:
        table.only("parameter")
        table.get("parameter", bool, "true, or mass instead", bool)
        return None
    return float(table.get("mass", int | float, "a mass [kg], 0 or more", lambda m: 0 <= m <= float_info.max, 0.0))


def _rest(table: _Table, joints: Names, units: Names) -> tuple[PointConstraint, ...]:
    if not table.values:
        return ()
    last = table.get("order", int, "1 to 4, the highest derivative that vanishes", lambda n: 1 <= n < len(ORDERS))
    tolerance = table.get("tolerance", int | float, "a number > 0", lambda x: 0.0 < x <= float_info.max, REST_TOLERANCE)
    return (standard.rest(joints, units, last, structural=False, tolerance=float(tolerance)),)
