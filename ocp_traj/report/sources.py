"""What a page is made of: run folders and trajectory files, each proved anew when it is read."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, cut
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.registry import load
from ocp_traj.formulation.task import Task
from ocp_traj.io.run_reader import load_run, read_manifest
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.alternatives import problem_of
from ocp_traj.results.front import Front
from ocp_traj.results.provenance import audit_motions
from ocp_traj.results.trajectory import Trajectory, audit_points
from ocp_traj.transcription.symbolic import evaluate_objectives

TASK_FILE = "TASK.toml"  # in place of a task's file, whose name a run does not hold


@dataclass(frozen=True, eq=False)
class Point:
    """One trajectory with its audit.

    Attributes:
        name: on the page.
        trajectory, audit: of it.
        x: decision vector ``(n,)``; None where the trajectory brings none along.
        objectives: by id; empty where there is no x.
    """

    name: str
    trajectory: Trajectory
    audit: Audit
    x: Array | None
    objectives: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Source:
    """A run or a trajectory.

    Attributes:
        name: on the page.
        problem: of all its points.
        points: of it.
        front: of a run; None of a trajectory.
        request: what was asked, by name, in words.
        versions: by package, of what made it.
        command: that makes it again, or proves it again.
    """

    name: str
    problem: Problem
    points: tuple[Point, ...]
    front: Front | None
    request: Mapping[str, str]
    versions: Mapping[str, str]
    command: str


def read_sources(places: Sequence[str | Path]) -> list[Source]:
    """The runs and trajectories at some places, in their order.

    Raises:
        InputError: where there is none, one is given twice, a run has no points, or a trajectory names no problem.
    """
    if not places:
        raise InputError("there is nothing to report; give one or more run folders or trajectory files")
    paths = [Path(place) for place in places]
    for index, path in enumerate(paths):
        if path.resolve() in [other.resolve() for other in paths[:index]]:
            raise InputError(f"{cut(str(path))} is given twice; give each once")
    return [_run(path) if path.is_dir() else _trajectory(path) for path in paths]


def _run(folder: Path) -> Source:
    front, manifest = load_run(folder), read_manifest(folder)
    return source_of_front(front, folder.resolve().name, manifest, str(folder))


def source_of_front(
    front: Front, name: str, manifest: Mapping[str, Any] | None = None, folder: str = "RUN"
) -> Source:  # fmt: skip
    """A front as a source; ``manifest`` is what its ``run.json`` holds, where there is one."""
    if not front.points:
        raise InputError(f"{name} has no points to show; give it more time, or another seed")
    audits: dict[int, Audit] = {}
    for of in dict.fromkeys(point.alternative for point in front.points):
        mine = [index for index, point in enumerate(front.points) if point.alternative == of]
        own = problem_of(front, front.points[mine[0]])
        audited = audit_points(own, [front.points[index].x for index in mine])
        audits |= {index: audit for index, (_, audit) in zip(mine, audited, strict=True)}
    points = tuple(
        Point(f"{index}", point.trajectory, audits[index], point.x, point.objectives)
        for index, point in enumerate(front.points)
    )
    asked = manifest or {}
    request = {
        "objectives": ", ".join(front.objectives), "method": front.method,
        "seed": "" if front.seed is None else str(front.seed),
        "options": ", ".join(f"{key} {value}" for key, value in asked.get("options", {}).items()),
        "budget": f"{asked['budget']} s" if asked.get("budget") else "", "took": f"{front.seconds:.3g} s",
        "case": _case_words(front.problem, asked.get("case", {})),
        "ended": "cut short: this is what had been found" if front.info.get("interrupted") else "",
    }  # fmt: skip
    versions = {key: str(value) for key, value in asked.get("versions", {}).items() if value}
    kept = {key: value for key, value in request.items() if value}
    return Source(name, front.problem, points, front, kept, versions, _pareto_command(front, asked, folder))


def _trajectory(file: Path) -> Source:
    moved = Trajectory.load(file)
    if not moved.problem:
        raise InputError(
            f"{cut(str(file))} names no problem, so that its limits are not known; a report is of runs and of "
            "trajectories that ocp-traj wrote (for others: ocp-traj audit FILE --limits LIMITS)"
        )
    problem = load(moved.problem, **moved.case)
    audit = audit_motions(problem, [moved], [moved.variables])[0]
    x = np.concatenate([np.ravel(moved.variables[v.id]) for v in problem.variables]) if moved.variables else None
    objectives = {} if x is None else evaluate_objectives(problem, x)
    name = file.name
    case = _case_words(problem, moved.case)
    return Source(
        name, problem, (Point(name, moved, audit, x, objectives),), None, {"case": case} if case else {}, {},
        f"ocp-traj audit {shlex.quote(str(file))}",
    )  # fmt: skip


def _case_words(problem: Problem, case: Mapping[str, Any]) -> str:
    """What differs from the defaults; a task is told by its title and its limits."""
    if isinstance(problem.case, Task):
        return ""
    return ", ".join(f"{name} {value}" for name, value in case.items())


def _pareto_command(front: Front, asked: Mapping[str, Any], folder: str) -> str:
    """The command that asks for the same again; ``TASK.toml`` stands for a task's file."""
    problem = front.problem
    words = ["ocp-traj", "pareto", TASK_FILE if isinstance(problem.case, Task) else problem.id]
    if not isinstance(problem.case, Task):
        for name, value in asked.get("case", {}).items():
            words += ["--set", f"{name}={_set_text(value)}"]
    words += ["--objectives", ",".join(front.objectives), "--method", front.method]
    if front.seed is not None:
        words += ["--seed", str(front.seed)]
    for name, value in asked.get("options", {}).items():
        words += ["--points", str(value)] if name == "points" else ["--option", f"{name}={_set_text(value)}"]
    if asked.get("budget"):
        words += ["--budget", str(asked["budget"])]
    return shlex.join([*words, "-o", folder])


def _set_text(value: Any) -> str:
    """A field's value as ``--set`` takes it: lists by commas, lists of lists by colons and semicolons."""
    if not isinstance(value, list):
        return str(value).lower() if isinstance(value, bool) else str(value)
    if value and isinstance(value[0], list):
        return ";".join(":".join(map(str, item)) for item in value)
    return ",".join(map(str, value)) or "none"
