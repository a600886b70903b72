"""Problems by id: the published ones, those a user registers, those of other packages, and any ``module:function``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, is_dataclass, make_dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from inspect import signature
from typing import Any, get_args, get_type_hints

from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, UnknownName, quoted
from ocp_traj.formulation.case import convert
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.summary import Summary
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.task_file import changed, task_of, told

AND = " + "  # between a problem's id and what is added to it in Python
GROUP = "ocp_traj.problems"  # entry points NAME = "module", of modules that have ``build`` and ``Case``

# A new paper is one file in problems/ and one name here.
MODULES = {
    "hybrid-spline": "ocp_traj.problems.hybrid_spline",
    "rotor-353": "ocp_traj.problems.rotor_353",
    "wrist-obstacle": "ocp_traj.problems.wrist_obstacle",
    "weld-bezier": "ocp_traj.problems.weld_bezier",
}


@dataclass(frozen=True)
class Entry:
    """A registered problem.

    Attributes:
        build: case -> problem.
        case: the frozen dataclass of its numbers.
        module: in which it is written, or none.
        make: (id, changes) -> case, where that is more than its fields changed.
    """

    build: Callable[[Any], Problem]
    case: type[Any]
    module: Any = None
    make: Callable[[str, dict[str, Any]], Any] | None = None


TASK = "task"  # id of the problem of a task file, which no list has: without its file it is nothing


_registered: dict[str, Entry] = {}


def register(id: str, build: Callable[[Any], Problem], case: type[Any]) -> None:
    """Makes a problem known by an id for the rest of this process, so that files and commands can name it.

    Args:
        id: of the problems that ``build`` makes.
        build: case -> problem.
        case: frozen dataclass of the problem's numbers, with a default for each.
    """
    if id in names():
        raise InputError(f"there is a problem {id!r} already; problems are {', '.join(names())}")
    _registered[id] = Entry(build, case, import_module(build.__module__))


def names() -> tuple[str, ...]:
    """Ids of all problems."""
    return tuple(dict.fromkeys((*MODULES, *_of_other_packages(), *_registered)))


@cache
def _of_other_packages() -> dict[str, str]:
    """Modules of problems that installed packages offer, by id."""
    return {point.name: point.value for point in entry_points(group=GROUP)}


def known(id: str) -> bool:
    """Whether a problem of that id can be loaded."""
    try:
        return entry(id).build is not None
    except UnknownName:
        return False


def entry(id: str) -> Entry:
    """A registered problem, or one that an importable ``module:function`` makes; else raises ``UnknownName``."""
    if id in _registered:
        return _registered[id]
    found = _of_other_packages() | MODULES | {TASK: "ocp_traj.problems.task"}
    if id in found:
        module = import_module(found[id])
        return Entry(module.build, module.Case, module, getattr(module, "make", None))
    own, with_, additions = id.partition(AND)
    if with_ and own in found:
        raise UnknownName(
            f"{quoted(id)} has what no file holds, {additions}, added to {own} in Python: nothing is known of it here; "
            "audit the trajectory with that problem, ocp_traj.audit(trajectory, problem.requirements), or give the "
            "problem the id module:function of what makes it (ocp_traj.with_id)"
        )
    name, _, function = id.partition(":")
    if all(part.isidentifier() for part in (*name.split("."), function)):
        return _importable(name, function)
    raise UnknownName(
        f"there is no problem {quoted(id)}; problems are {', '.join(names())}, and any module:function that makes one"
    )


def _importable(name: str, function: str) -> Entry:
    """The problem of a function ``(case: Case) -> Problem``, ``(task: Task = TASK) -> Problem`` or ``() -> Problem``.

    The id may come from a file: no function is called that is not annotated to make a problem.
    """
    try:
        module = import_module(name)
        build = getattr(module, function)
        hints, taken = get_type_hints(build), list(signature(build).parameters)
    except (ImportError, AttributeError, NameError, TypeError, ValueError) as error:
        raise UnknownName(f"there is no problem {quoted(f'{name}:{function}')}: {error}") from error
    given = hints.get(taken[0]) if taken else make_dataclass("Case", ())
    if given is Task and hints.get("return") is Problem and len(taken) == 1:
        default = signature(build).parameters[taken[0]].default
        return Entry(build, Task, module, lambda id, changes: _task(id, changes, default))
    cases = [kind for kind in get_args(given) or (given,) if isinstance(kind, type) and is_dataclass(kind)]
    if hints.get("return") is not Problem or len(taken) > 1 or not cases:
        raise UnknownName(
            f"{quoted(f'{name}:{function}')} makes no problem; give a function that is annotated (case: Case) -> "
            "Problem, of a dataclass Case, (task: Task = TASK) -> Problem, or () -> Problem"
        )
    return Entry(build if taken else lambda case: build(), cases[0], module)


def _task(id: str, changes: dict[str, Any], default: Any) -> Task:
    """The task of a file, which has all its fields, or the default one with values by dotted place."""
    if {"robot", "move"} <= changes.keys():
        return task_of(changes)
    if not isinstance(default, Task):
        raise InputError(f"{id} takes a task and has none by default; give it one")
    return changed(default, changes)


def case_class(id: str) -> Any:
    """The frozen dataclass that holds a problem's numbers."""
    return entry(id).case


def module(id: str) -> Any:
    """The module a problem is written in."""
    return entry(id).module


@one_blas_thread
def load(id: str, **changes: Any) -> Problem:
    """Builds a problem, with fields of its case changed.

    Args:
        id: of the problem; ``task`` is that of a task file, ``load("task", file="arm.toml")``, or of one built in code,
            ``load("task", task=ot.Task(..))``, whose further changes are values by dotted place, such as
            ``{"robot.payload.mass": 2.0}``.
        changes: case fields; lists become tuples, whole numbers floats where the default is one.
    """
    found = entry(id)
    if found.make is not None:
        case = found.make(id, changes)
        try:
            return found.build(case)
        except InputError as error:
            if "file" not in changes:
                raise
            raise told(error, case.name, changes["file"]) from error
    return found.build(found.case(**convert(id, found.case, changes)))


def summary(id: str) -> Summary:
    """What a list says of a problem: its module's own ``SUMMARY``, where building it takes long, or by building it."""
    found: Summary | None = getattr(module(id), "SUMMARY", None)
    return found if found is not None and found.id == id else Summary.of(load(id))
