"""Arguments and options that several commands have, and what is read from them."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING, Annotated

import typer

from ocp_traj.errors import InputError, cut, quoted

if TYPE_CHECKING:
    from ocp_traj.formulation.problem import Problem
    from ocp_traj.formulation.task import Task

ProblemName = Annotated[
    str, typer.Argument(metavar="PROBLEM", help="Id of a problem, see `ocp-traj problems`, or a task file (TOML).")
]
Fields = Annotated[
    list[str] | None, typer.Option("--set", metavar="FIELD=VALUE", help="Change a field of the case; may be repeated.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Set an option of the method; may be repeated."),
]
WorkerCount = Annotated[
    int, typer.Option(metavar="N", help="Processes that solve; the result does not depend on how many.", min=0)
]
ClusterAddress = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler whose workers solve, such as tcp://host:8786.")
]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]


def load_problem(name: str, assignments: Sequence[str] | None) -> Problem:
    """A problem by its id, or of a task file, with changes to its case."""
    from ocp_traj import problems

    changes = pairs(assignments, "--set")
    if name.lower().endswith(".toml"):
        if "file" in changes:
            raise InputError("--set file is no place in a task; give one such as robot.payload.mass")
        problem = problems.load("task", file=name, **changes)
        _check_export(problem.case, name)
        return problem
    return problems.load(name, **changes)


def _check_export(task: Task, file: str) -> None:
    """Refuses a wrong ``[export]`` before there is anything to export."""
    if task.export is None:
        return
    from ocp_traj.formulation.task_file import told
    from ocp_traj.io.export import check_table

    try:
        check_table(task.export)
    except InputError as error:
        raise told(error, task.name, file) from error


def task_of(problem: Problem) -> Task | None:
    """The task a problem is made from, if it is."""
    from ocp_traj.formulation.task import Task

    return problem.case if isinstance(problem.case, Task) else None


def pairs(assignments: Sequence[str] | None, option: str) -> dict[str, str]:
    """What an option that may be repeated gives: names and values."""
    pairs: dict[str, str] = {}
    for text in assignments or ():
        name, equals, value = text.partition("=")
        if not (equals and name.strip() and value.strip()):
            hint = f"; an empty list is written {cut(name.strip())}=none" if equals and name.strip() else ""
            raise InputError(f"{option} {quoted(text)} is not NAME=VALUE{hint}")
        if name.strip() in pairs:
            raise InputError(f"{option} gives {quoted(name.strip())} twice; give it once")
        pairs[name.strip()] = value.strip()
    return pairs


def number(text: str, what: str) -> float:
    """A number that is given as text."""
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{what} is {quoted(text)}; give a number") from error


def point(text: str | None, names: Sequence[str], option: str) -> dict[str, float] | None:
    """A point of objectives, a number for each of their names; None where there is none."""
    if text is None:
        return None
    numbers = [number(part, option) for part in text.split(",")]
    if not all(isfinite(number) for number in numbers):
        raise InputError(f"{option} is {quoted(text)}; give finite numbers")
    if len(numbers) != len(names):
        raise InputError(f"{option} has {len(numbers)} numbers; give one for each of {', '.join(names)}")
    return dict(zip(names, numbers, strict=True))
