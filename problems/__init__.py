"""The published problems, by id: ``load("hybrid-spline", payload=8.0)``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import Any

from ocp_traj.errors import InputError, UnknownName
from ocp_traj.problem import Problem

# id: (module, case class). A new paper is one file here, one line in this table and a reference row in the tests.
REGISTRY = {
    "hybrid-spline": ("hybrid_spline", "Guo2016"),
    "rotor-353": ("rotor_353", "ZhuWang"),
}


def names() -> tuple[str, ...]:
    """Ids of all problems."""
    return tuple(REGISTRY)


def case_class(name: str) -> Any:
    """The frozen dataclass that holds a problem's numbers."""
    if name not in REGISTRY:
        raise UnknownName(f"there is no problem {name!r}; problems are {', '.join(REGISTRY)}")
    module, class_name = REGISTRY[name]
    return getattr(import_module(f"ocp_traj.problems.{module}"), class_name)


def module(name: str) -> Any:
    """The module a problem is written in."""
    return import_module(case_class(name).__module__)


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
            raise UnknownName(f"{name} has no case field {key!r}; fields are {', '.join(known)}")
        values[key] = _converted(name, key, value, known[key].default, known[key].metadata)
    problem: Problem = module(name).build(cls(**values))
    return problem


def _converted(problem: str, key: str, value: Any, default: Any, metadata: Mapping[str, Any]) -> Any:
    """The value as the default's type, or an error that says what is wanted.

    A field of numbers may say in its metadata how many (``size``, else as many as its default) and that it may be
    ``empty``, which is written "none".
    """
    wanted = f"{problem}: {key} is {value!r}; give"
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        if str(value).lower() in ("true", "false"):
            return str(value).lower() == "true"
        raise InputError(f"{wanted} true or false")
    if isinstance(default, tuple):
        size, empty = metadata.get("size", len(default)), metadata.get("empty", False)
        items = value.split(",") if isinstance(value, str) else value
        such = f", such as {','.join(map(str, default))}" if default else ""
        wanted = f"{wanted} {size} numbers{such}{', or none' if empty else ''}"
        if empty and (value == "none" or value is None):
            return ()
        try:
            numbers = tuple(float(item) for item in items)
        except (TypeError, ValueError) as error:
            raise InputError(wanted) from error
        if len(numbers) != size and not (empty and not numbers):
            raise InputError(wanted)
        return numbers
    if isinstance(default, float | int):
        try:
            return type(default)(value)
        except (TypeError, ValueError) as error:
            raise InputError(f"{wanted} a number, such as {default}") from error
    return str(value)
