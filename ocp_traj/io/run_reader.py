"""Reading a run folder: the points come from its journal, and every one is proved anew.

What the folder says of its points is compared with what their variables give, and refused where it differs. A folder
of format ``ocp-traj/run/1`` has no journal: there the variables are those of ``front.csv``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.files import plain, read_json
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.journal import records
from ocp_traj.io.run_folder import JOURNAL, MANIFEST, TABLE, TRAJECTORIES
from ocp_traj.io.store import FORMAT, trajectory_file
from ocp_traj.results.alternatives import merged_front
from ocp_traj.results.front import Front
from ocp_traj.results.front_table import read_front_csv
from ocp_traj.results.pareto_set import ParetoSet, proved_front
from ocp_traj.results.provenance import AGREE
from ocp_traj.results.records import FRONT, POINTS, POPULATION, SOLVE, Record, usable
from ocp_traj.results.trajectory import Trajectory, case_fields
from ocp_traj.transcription.symbolic import evaluate_objectives

WITHOUT_JOURNAL = "ocp-traj/run/1"


@one_blas_thread
def load_run(folder: str | Path, problem: Problem | None = None) -> Front:
    """Reads a run folder, at any moment of the run, and proves every point anew.

    Where the run has ended this is its front. Where it was cut short, or is still going on, it is the front of all that
    was finished so far, and ``front.info["interrupted"]`` is true.

    Args:
        folder: of the run.
        problem: whose run it is; by default it is built again from the id and case that ``run.json`` names, where the
            id is registered or an importable ``module:function``.
    """
    root = Path(folder)
    run = read_manifest(root)
    # Before the journal: of a run that goes on, the journal is then at least as new.
    table = read_front_csv(root / TABLE) if (root / TABLE).exists() or run["format"] == WITHOUT_JOURNAL else None
    try:
        chosen = problem_of(root, run, problem)
        if chosen.levels is not None:
            chosen = _level(chosen, root / JOURNAL)
        keep_unproved = run["format"] == WITHOUT_JOURNAL or bool(run["keep_unproved"])
        empty = Front(
            chosen,
            tuple(run["objectives"]),
            (),
            run["method"],
            run["seed"],
            float(run.get("seconds", 0.0)),
            dict(run.get("info", {"interrupted": True})),
        )
    except KeyError as error:
        raise FileFormatError(f"{root / MANIFEST}: the field {error} of format {run['format']} is missing") from error
    except FileFormatError:
        raise
    except (InputError, TypeError, ValueError) as error:
        raise FileFormatError(f"{root / MANIFEST} does not describe a run: {error}") from error
    if table is not None and list(table.columns) not in (list(empty.table.columns), list(empty.full_table.columns)):
        raise FileFormatError(
            f"{root / TABLE}: its columns are {', '.join(table.columns)}; "
            f"those of {chosen.id} are {', '.join(empty.table.columns)}"
        )
    if run["format"] == WITHOUT_JOURNAL:
        assert table is not None
        front = _proved(
            empty, list(table[[*table.columns[-2 - chosen.size : -2]]].to_numpy(dtype=float)), keep_unproved
        )
    else:
        front = _of_journal(empty, keep_unproved, run, root / JOURNAL)
    if table is not None:
        _compare(front, table, root)
    if len(front) != run.get("points", len(front)):
        raise FileFormatError(f"{root / MANIFEST} says that the front has {run['points']} points; it has {len(front)}")
    return front


def read_manifest(folder: Path) -> dict[str, Any]:
    """The contents of a run folder's ``run.json``."""
    run = read_json(folder / MANIFEST, "run")
    kind = run.get("format") if isinstance(run, dict) else None
    if kind not in (FORMAT, WITHOUT_JOURNAL):
        raise FileFormatError(
            f"{folder / MANIFEST} is not a run: its format is {kind!r}; allowed are {FORMAT!r} and {WITHOUT_JOURNAL!r}"
        )
    return dict(run)


def problem_of(root: Path, run: Mapping[str, Any], given: Problem | None) -> Problem:
    """The problem of a run, built again, or the one that is given, if it is that."""
    if given is None:
        if not problems.known(run["problem"]):
            raise FileFormatError(
                f"{root / MANIFEST} does not describe a run: there is no problem {run['problem']!r}; where it is one "
                "of your own, give it, load_run(folder, problem), or make its id an importable 'module:function'"
            )
        return problems.load(run["problem"], **run["case"])
    if (given.id, plain(case_fields(given))) != (run["problem"], run["case"]):
        raise FileFormatError(
            f"{root} is a run of {run['problem']} with the case {run['case']}, and not of the problem that was given, "
            f"{given.id} with the case {case_fields(given)}"
        )
    return given


def _level(problem: Problem, journal: Path) -> Problem:
    """The level of a problem whose front a run traced, all of it: a finer one has more variables."""
    sizes = {len(point["x"]) for record in records(journal) for point in record.get("points", ())}
    level = problem
    while level.size not in sizes and level.levels is not None and level.levels.finer is not None:
        level = level.levels.finer()
    return level if level.size in sizes else problem


def _proved(empty: Front, xs: Sequence[Array], keep_unproved: bool) -> Front:
    """The front of some vectors, as it was recorded."""
    front = Front.of(
        empty.problem, empty.objectives, xs,
        method=empty.method, seed=empty.seed, seconds=empty.seconds, keep_unproved=keep_unproved,
    )  # fmt: skip
    return replace(front, info=empty.info)


def _of_journal(empty: Front, keep_unproved: bool, run: Mapping[str, Any], path: Path) -> Front:
    """The front that ended the run, or that of all it has found so far."""
    found = records(path)
    last: Record = found[-1] if found else {"kind": None}
    try:
        if "seconds" not in run:
            empty = replace(empty, seconds=float(last.get("elapsed", 0.0)))
        if last["kind"] == FRONT:
            problem = empty.problem
            if problem.alternatives and "alternative" not in last:
                return _of_alternatives(empty, keep_unproved, last, path)
            if problem.alternatives:
                problem = problem.alternatives[last["alternative"]]
            return _proved(replace(empty, problem=problem), _points(problem, last, path), keep_unproved)
        if "points" in run:
            raise FileFormatError(f"{path} ends before the front that {MANIFEST} tells of: a part of it is missing")
        return _so_far(empty, keep_unproved, path, found)
    except FileFormatError:
        raise
    except (KeyError, AttributeError, TypeError, ValueError) as error:
        raise FileFormatError(f"{path} does not hold the records of a run: {error!r}") from error


def _so_far(empty: Front, keep_unproved: bool, path: Path, found: Sequence[Record]) -> Front:
    """The front of all solves and points, and of the last population, of each alternative."""
    parts = empty.problem.alternatives or {"": empty.problem}
    fronts: dict[str, Front] = {}
    for name, part in parts.items():
        mine = [record for record in found if record.get("alternative", "") == name]
        solves = [record for record in mine if record["kind"] in (SOLVE, POINTS) and usable(record)]
        population = [record for record in mine if record["kind"] == POPULATION][-1:]
        xs = [x for record in (*solves, *population) for x in _points(part, record, path)]
        if xs:
            so_far = ParetoSet(xs, empty.method, empty.seed, empty.seconds, interrupted=True)
            fronts[name] = proved_front(part, empty.objectives, so_far, keep_unproved)
    if not fronts:
        return empty
    if not empty.problem.alternatives:
        return fronts[""]
    return replace(merged_front(empty.problem, fronts, empty.problem.alternatives), seconds=empty.seconds)


def _of_alternatives(empty: Front, keep_unproved: bool, last: Record, path: Path) -> Front:
    """The front that ended a run, of points of several alternatives."""
    fronts = {}
    for name, part in empty.problem.alternatives.items():
        mine = [point for point in last["points"] if point["alternative"] == name]
        xs = _points(part, {"points": mine}, path)
        fronts[name] = _proved(replace(empty, problem=part), xs, keep_unproved)
    found = merged_front(empty.problem, fronts, empty.problem.alternatives)
    if len(found) != len(last["points"]):
        raise FileFormatError(f"{path}: points of the front are of no alternative, or no longer proved: it was changed")
    return replace(found, problem=empty.problem, seconds=empty.seconds, info=empty.info)


def _points(problem: Problem, record: Record, path: Path) -> list[Array]:
    """The vectors of a record; raises ``FileFormatError`` where its objectives are not theirs."""
    xs = []
    for point in record["points"]:
        x = np.array(point["x"], dtype=float)
        if x.shape != (problem.size,):
            raise FileFormatError(f"{path}: a point has {x.size} variables; {problem.id} has {problem.size}")
        if "objectives" in point and not _agree(point["objectives"], evaluate_objectives(problem, x)):
            raise FileFormatError(
                f"{path} and {MANIFEST} do not belong together: the variables of a point do not give its objectives"
            )
        xs.append(x)
    return xs


def _agree(told: Mapping[str, float | None], computed: Mapping[str, float]) -> bool:
    """Whether objectives are those computed, to rounding."""
    known = {name: np.nan if value is None else value for name, value in told.items()}  # JSON has no infinity
    return all(
        np.isclose(value, computed[name], rtol=AGREE, atol=AGREE) or not np.isfinite([value, computed[name]]).any()
        for name, value in known.items()
    )


def _compare(front: Front, table: pd.DataFrame, root: Path) -> None:
    """Raises ``FileFormatError`` unless table and trajectories show this front."""
    path = root / TABLE
    if len(front) != len(table):
        raise FileFormatError(f"{path} has {len(table)} rows; the front has {len(front)} points: it was changed")
    names = [name for name, _ in front.columns[: len(front.columns) - front.problem.size]]
    for index, (row, point) in enumerate(zip(table.itertuples(index=False), front.points, strict=True)):
        *numbers, _, verdict = row
        file = trajectory_file(root / TRAJECTORIES, index)
        if (
            not (len(numbers) == len(names) or np.array_equal(numbers[len(names) :], point.x))
            or not _agree(dict(zip(names, numbers, strict=False)), point.objectives)
            or not _same(Trajectory.load(file), point.trajectory)
        ):
            raise FileFormatError(
                f"{file} and point {index} of {TABLE} do not belong together: one of them was changed, or "
                f"{MANIFEST} or {JOURNAL} was"
            )
        if verdict != point.verdict:
            raise FileFormatError(
                f"{path} says that point {index} is {verdict}; the proof says {point.verdict}: it was changed, or "
                "another version wrote it"
            )


def _same(one: Trajectory, other: Trajectory) -> bool:
    """Whether two trajectories are the same to rounding."""
    if any(getattr(one, name) != getattr(other, name) for name in ("problem", "case", "joints")):
        return False
    if one.curve.degrees != other.curve.degrees or set(one.parameters) != set(other.parameters):
        return False
    pairs = [(one.curve.durations, other.curve.durations)]
    pairs += zip(one.curve.control_points, other.curve.control_points, strict=True)
    pairs += [(np.array(one.parameters[name]), np.array(other.parameters[name])) for name in other.parameters]
    return all(np.abs(a - b).max() <= AGREE * (1.0 + np.abs(b).max()) for a, b in pairs)
