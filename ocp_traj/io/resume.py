"""Going on with a run that was stopped: what it asked is asked again, and what it has finished is answered.

No state of a method is kept: each begins again, its seed the same, and each of its jobs that a record of the journal
names by its key is answered by that. So the front is that of a run that was never stopped, where no budget was given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ocp_traj import problems
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import FileFormatError, InputError, cut
from ocp_traj.files import plain
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.journal import records
from ocp_traj.io.run_folder import JOURNAL, MANIFEST, RunFolder
from ocp_traj.io.run_reader import WITHOUT_JOURNAL, problem_of, read_manifest
from ocp_traj.io.store import Run, versions
from ocp_traj.results.pareto_set import ENDED_AFTER
from ocp_traj.results.records import KEY, Record
from ocp_traj.results.trajectory import case_fields

RESULTS = ("seconds", "points", "hypervolume", "info", "certificate")  # of ``run.json``: how the run went
MOST = 5  # differences in a message: our choice


@dataclass(frozen=True)
class Resumed:
    """A run that was stopped and is gone on with.

    Attributes:
        run: to which what is found is told.
        problem: whose front is wanted.
        asked: what ``run.json`` holds of the request.
        known: finished work, by the key of its job.
        budget: what is left of it [s]; None for none.
        other_versions: of packages, with which the run was begun: its finished work is then done again.
    """

    run: Run
    problem: Problem
    asked: Mapping[str, Any]
    known: Mapping[str, Record]
    budget: float | None
    other_versions: Mapping[str, str | None]


def is_finished(folder: str | Path) -> bool:
    """Whether a run has ended by itself, so that nothing is left to do."""
    run = read_manifest(Path(folder))
    info = run.get("info")
    return isinstance(info, Mapping) and not info.get("interrupted") and ENDED_AFTER not in info


@one_blas_thread
def resume_run(folder: str | Path) -> Resumed:
    """Takes a run that was stopped, to go on with it; raises ``InputError`` where that is not the run it was."""
    place = RunFolder(folder, resume=True)
    try:
        return _resumed(folder, place)
    except BaseException:
        place.close()
        raise


def _resumed(folder: str | Path, place: RunFolder) -> Resumed:
    manifest = read_manifest(place.root)
    if manifest["format"] == WITHOUT_JOURNAL:
        raise InputError(f"{folder} is of an earlier version, which kept no journal; run it again")
    asked = {name: value for name, value in manifest.items() if name not in RESULTS}
    try:
        problem = problem_of(place.root, asked, None)
        _check_task(folder, asked)
        budget = None if asked["budget"] is None else float(asked["budget"])
    except KeyError as error:
        raise FileFormatError(f"{place.root / MANIFEST}: the field {error} is missing") from error
    earlier = records(place.root / JOURNAL) if (place.root / JOURNAL).exists() else []
    if budget is not None:
        budget -= float(earlier[-1]["elapsed"]) if earlier else 0.0
        if budget <= 0.0:
            raise InputError(
                f"the budget of {folder}, {asked['budget']:g} s, is used up; run it again with a larger one"
            )
    now = versions()
    other = {name: old for name, old in dict(asked.get("versions", {})).items() if now.get(name) != old}
    known = {record[KEY]: record for record in earlier if record.get(KEY)}
    run = Run(folder, {**asked, "versions": now}, place=place, earlier=earlier)
    return Resumed(run, problem, asked, known, budget, other)


def _check_task(folder: str | Path, asked: Mapping[str, Any]) -> None:
    """Refuses a task whose file, where it is still there, is not what the run was begun with."""
    source = asked.get("task")
    if source is None or not Path(source["file"]).exists():
        return
    try:
        now = plain(case_fields(problems.load("task", file=source["file"], **source["changes"])))
    except InputError as error:
        raise InputError(f"{folder} was begun with {source['file']}, which has changed since: {error}") from error
    found = differences(asked["case"], now)
    if found:
        more = f", and {len(found) - MOST} more" if len(found) > MOST else ""
        raise InputError(
            f"{folder} was begun with {source['file']}, which has changed since: {'; '.join(found[:MOST])}{more}; "
            "undo that, or begin another run"
        )


def differences(old: Any, new: Any, place: str = "") -> list[str]:
    """Where two plain values differ, each with what it was and what it is."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        names = [*old, *(name for name in new if name not in old)]
        inner = [(f"{place}.{name}".lstrip("."), old.get(name), new.get(name)) for name in names]
        return [words for name, one, other in inner for words in differences(one, other, name)]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new) and isinstance((*old, 0)[0], Mapping):
        inner = [(f"{place}[{i}]", *pair) for i, pair in enumerate(zip(old, new, strict=True))]
        return [words for name, one, other in inner for words in differences(one, other, name)]
    return [] if old == new else [f"{place} was {cut(str(old), 60)} and is {cut(str(new), 60)}"]
