"""Values that may stand in a task's tables: how each is checked, and what its complaint ends with."""

from __future__ import annotations

from math import isfinite
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict

from ocp_traj.display import count
from ocp_traj.errors import InputError, quoted
from ocp_traj.formulation.task_complaints import PartOf
from ocp_traj.robot.inertias import inertia_matrix

LARGEST = 1e12  # of a number in a task: our choice, beyond any robot
SMALLEST = 1e-9  # of a limit that is not zero: our choice, below any robot's
MOST_POINTS = 100_000  # of a path: our choice


def _plain(value: Any) -> Any:
    """Arrays and tuples as lists, so that a task built in code is like one from a file."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(v) for v in value] if isinstance(value, list | tuple) else value


def _number(value: Any) -> Any:
    value = _plain(value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise ValueError("no such number")
    return float(value)


def _positive(value: Any) -> Any:
    if not (number := _number(value)) > 0.0:
        raise ValueError("not above zero")
    return number


def _mass(value: Any) -> Any:
    if not (number := _number(value)) >= 0.0:
        raise ValueError("below zero")
    return number


def _row(value: Any) -> Any:
    value = _plain(value)
    if not isinstance(value, list) or not value:
        raise ValueError("no list of numbers")
    for i, entry in enumerate(value):
        try:
            _number(entry)
        except ValueError as error:
            raise PartOf(f"number {i + 1} is {quoted(entry)}") from error
    return [_number(v) for v in value]


def _rows(value: Any) -> Any:
    value = _plain(value)
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_POINTS:
        raise ValueError("no list of rows")
    rows = []
    for i, row in enumerate(value):
        try:
            rows.append(_row(row))
        except PartOf as error:
            raise PartOf(f"point {i + 1}, {error}") from error
        if len(rows[-1]) != len(rows[0]):
            raise PartOf(f"point {i + 1} has {count(len(rows[-1]), 'number')}, the first has {len(rows[0])}")
    return rows


def _three(value: Any) -> Any:
    if len(row := _row(value)) != 3:
        raise ValueError("not three")
    return row


def _each(value: Any) -> Any:
    """A number for all joints, or a list, one a joint."""
    value = _plain(value)
    return _row(value) if isinstance(value, list) else _number(value)


def _each_from_0(value: Any) -> Any:
    if np.min(value := _each(value)) < 0.0:
        raise ValueError("below zero")
    return value


def _true_or_false(value: Any) -> Any:
    if not isinstance(value, bool | np.bool_):
        raise ValueError("neither true nor false")
    return bool(value)


def _inertia(value: Any) -> Any:
    try:
        inertia_matrix(row := _row(value))
    except InputError as error:
        raise ValueError("no inertia") from error
    return row


def _share(text: str) -> float | None:
    """What "50 %" means, or None where it is no share."""
    number, sign, rest = text.partition("%")
    try:
        share = float(number) / 100.0
    except ValueError:
        return None
    return share if sign and not rest.strip() and isfinite(share) and share > 0.0 else None


def _bound(value: Any) -> Any:
    """A bound: a number or a list a joint, on both sides; two of these, lower and upper; "50 %"; "none"."""
    value = _plain(value)
    if isinstance(value, str):
        if value.strip() != "none" and _share(value) is None:
            raise ValueError("no such word")
        return value.strip()
    if isinstance(value, list) and len(value) == 2 and all(isinstance(v, list) for v in value):
        return [[_side(v) for v in side] for side in value]
    if isinstance(value, list) and value:
        sides = [_side(v) for v in value]
        for i, side in enumerate(sides):
            if side is not None and not side > 0.0:
                raise PartOf(f"number {i + 1} is {side:g}, not above zero")
        return sides
    return _side(_positive(value))


def _range(value: Any) -> Any:
    """A bound that is not symmetric: two lists; "50 %"; "none"."""
    value = _bound(value)
    if not isinstance(value, str) and not (isinstance(value, list) and isinstance(value[0], list)):
        raise ValueError("not two lists")
    return value


def _side(value: Any) -> float | None:
    """One joint's bound; none where it is infinite, which JSON has no number for."""
    if value is None or (isinstance(value, float) and value in (np.inf, -np.inf)):
        return None
    number: float = _number(value)
    if 0.0 < abs(number) < SMALLEST:
        raise ValueError("too small")
    return number


def _whole(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError("no whole number")
    return value


def share_of(bound: Any) -> float | None:
    """The share of the description's limit that a bound is, such as 0.5 of "50 %"; None for any other."""
    return _share(bound) if isinstance(bound, str) else None


def _start(value: Any) -> Any:
    """A word or the path of a file, or points, as a resolved task has them."""
    value = _plain(value)
    if isinstance(value, str) and value.strip():
        return value.strip()
    return _rows(value)


def _different(value: list[str]) -> list[str]:
    if len(set(value)) < len(value):
        raise ValueError("one of them twice")
    return value


def _some(value: Any) -> Any:
    if value == {}:
        raise ValueError("empty")
    return value


Number = Annotated[float, BeforeValidator(_number)]
Positive = Annotated[float, BeforeValidator(_positive)]
Mass = Annotated[float, BeforeValidator(_mass)]
Row = Annotated[list[float], BeforeValidator(_row)]
Rows = Annotated[list[list[float]], BeforeValidator(_rows)]
Three = Annotated[list[float], BeforeValidator(_three)]
Start = Annotated[Any, BeforeValidator(_start)]
Inertia = Annotated[list[float], BeforeValidator(_inertia)]
Truth = Annotated[bool, BeforeValidator(_true_or_false)]
Each = Annotated[Any, BeforeValidator(_each)]
EachFrom0 = Annotated[Any, BeforeValidator(_each_from_0)]
Bound = Annotated[Any, BeforeValidator(_bound)]
Range = Annotated[Any, BeforeValidator(_range)]
Whole = Annotated[int, BeforeValidator(_whole)]
Different = Annotated[list[str], AfterValidator(_different)]
Weights = Annotated[str | dict[str, Positive], AfterValidator(_some)]

THREE = "three numbers [m, or units.length]"
PER_JOINT = "a number above zero for all joints, a list with one a joint, two such lists (lower, upper), "
LIMIT = PER_JOINT + 'a share of the description\'s such as "50 %", or "none"'
FREE = PER_JOINT + 'or "none"; no URDF holds it'


class Table(BaseModel):
    """A table of a task: what it does not know is an error, and it does not change."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=True, strict=False)
