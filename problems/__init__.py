"""The published problems, by id: ``load("hybrid-spline", payload=8.0)``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any

from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, UnknownName, quoted
from ocp_traj.problem import Problem

# id: (module, case class). A new paper is one file here, one line in this table and a reference row in the tests.
REGISTRY = {
    "hybrid-spline": ("hybrid_spline", "Guo2016"),
    "rotor-353": ("rotor_353", "ZhuWang"),
    "wrist-obstacle": ("wrist_obstacle", "ElHaiek2019"),
    "weld-bezier": ("weld_bezier", "Ogbemhe2019"),
}


def names() -> tuple[str, ...]:
    """Ids of all problems."""
    return tuple(REGISTRY)


def case_class(name: str) -> Any:
    """The frozen dataclass that holds a problem's numbers."""
    if name not in REGISTRY:
        raise UnknownName(f"there is no problem {quoted(name)}; problems are {', '.join(REGISTRY)}")
    module, class_name = REGISTRY[name]
    return getattr(import_module(f"ocp_traj.problems.{module}"), class_name)


def module(name: str) -> Any:
    """The module a problem is written in."""
    return import_module(case_class(name).__module__)


@one_blas_thread
def load(name: str, **changes: Any) -> Problem:
    """Builds a problem, with fields of its case changed.

    Args:
        name: id of the problem.
        changes: case fields; lists become tuples, whole numbers floats where the default is one.
    """
    cls = case_class(name)
    known = {f.name: f for f in fields(cls)}
    values = {}
    for key, value in changes.items():
        if key not in known:
            raise UnknownName(f"{name} has no case field {quoted(key)}; fields are {', '.join(known)}")
        values[key] = _converted(name, key, value, known[key].default, known[key].metadata)
    problem: Problem = module(name).build(cls(**values))
    return problem


def _converted(problem: str, key: str, value: Any, default: Any, metadata: Mapping[str, Any]) -> Any:
    """The value as the default's type, or an error that says what is wanted.

    A field of numbers may say in its metadata how many (``size``, else as many as its default) and that it may be
    ``empty``, which is written "none".
    """
    wanted = f"{problem}: {key} is {quoted(value)}; give"
    if default is None:
        return None if value is None else _numbers(value, f"{wanted} numbers, such as 1,0,0.5")
    if isinstance(default, tuple) and default and isinstance(default[0], tuple):
        return _rows(value, len(default[0]), wanted, default)
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        if str(value).lower() in ("true", "false"):
            return str(value).lower() == "true"
        raise InputError(f"{wanted} true or false")
    if isinstance(default, tuple):
        size, empty = metadata.get("size", len(default)), metadata.get("empty", False)
        such = f", such as {','.join(map(str, default))}" if default else ""
        wanted = f"{wanted} {size} numbers{such}{', or none' if empty else ''}"
        if empty and (value is None or value == "none"):
            return ()
        numbers = _numbers(value, wanted)
        if len(numbers) != size and not (empty and not numbers):
            raise InputError(wanted)
        return numbers
    if isinstance(default, float | int):
        try:
            return type(default)(value)
        except (TypeError, ValueError) as error:
            raise InputError(f"{wanted} a number, such as {default}") from error
    return str(value)


def _numbers(value: Any, wanted: str, between: str = ",") -> tuple[float, ...]:
    try:
        return tuple(float(item) for item in (value.split(between) if isinstance(value, str) else value))
    except (TypeError, ValueError) as error:
        raise InputError(wanted) from error


def _rows(value: Any, width: int, wanted: str, default: Any) -> tuple[tuple[float, ...], ...]:
    """Any number of rows of ``width`` numbers: ``a:b:c; d:e:f`` or a list of lists; ``none`` for none."""
    example = ";".join(":".join(f"{number:g}" for number in row) for row in default)
    wanted += f" rows of {width} numbers, such as {example}, more of them after a semicolon, or none"
    if isinstance(value, str):
        value = [] if value.strip().lower() == "none" else value.split(";")
    try:
        rows = tuple(_numbers(row, wanted, ":") for row in value)
    except TypeError as error:
        raise InputError(wanted) from error
    if any(len(row) != width for row in rows):
        raise InputError(wanted)
    return rows
