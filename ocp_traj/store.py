"""A run folder: the front, its picture, its trajectories and what made them, written whole or not at all.

``run.json`` (format ``ocp-traj/run/1``), ``front.csv`` (units in the column names), ``front.png``,
``trajectories/NNN.json`` (one a row of ``front.csv``).
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import ocp_traj
from ocp_traj import problems
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.files import read_json, read_text
from ocp_traj.front import Front, FrontPoint, Hypervolume
from ocp_traj.plot import plot_front
from ocp_traj.symbolic import evaluate_objectives
from ocp_traj.trajectory import Trajectory
from ocp_traj.transcription import case_fields, trajectory
from ocp_traj.verdicts import PROVED, UNDECIDED, VIOLATED

FORMAT = "ocp-traj/run/1"
PACKAGES = ("casadi", "pin", "pymoo", "numpy")
AGREE = 1e-6  # relative, by which a row and its trajectory may differ: far above what other versions round differently


def check_target(folder: str | Path, force: bool = False) -> Path:
    """Raises ``InputError`` unless a run can be written to ``folder``; to be called before long work.

    An existing run folder needs ``force``; a folder that holds files but no ``run.json`` is never replaced.
    """
    try:
        target = Path(folder).resolve()
        if target.exists():
            _check_replaceable(Path(folder), target, force)
        above = next(parent for parent in target.parents if parent.exists())
        os.rmdir(tempfile.mkdtemp(prefix=f".{target.name}.", dir=above))  # the only sure way to know that one can
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot create {folder}: {reason}; choose a place that is writable") from error
    return target


def _check_replaceable(given: Path, target: Path, force: bool) -> None:
    if not target.is_dir():
        raise InputError(f"{given} exists and is not a folder; choose another folder")
    if not force:
        raise InputError(f"{given} exists; choose another folder or pass --force")
    if target in (Path.cwd(), *Path.cwd().parents):
        raise InputError(f"{given} is the current folder or one above it; choose another folder")
    if any(target.iterdir()) and not (target / "run.json").is_file():
        raise InputError(
            f"{given} is not a run folder: it holds files but no run.json, so --force does not delete it; "
            "choose another folder"
        )


def save_run(front: Front, folder: str | Path, *, force: bool = False, hypervolume: Hypervolume | None = None) -> Path:
    """Writes a run under a temporary name beside ``folder`` and renames it; ``force`` replaces an earlier run.

    ``hypervolume`` is what to record, where it was measured with other corners than the front's own.
    """
    target = check_target(folder, force)
    work: Path | None = None
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
        new = work / "new"
        (new / "trajectories").mkdir(parents=True)
        (new / "run.json").write_text(json.dumps(describe(front, hypervolume), indent=1) + "\n", encoding="utf-8")
        front.table.to_csv(new / "front.csv")
        plot_front(front, new / "front.png")
        for index, point in enumerate(front.points):
            point.trajectory.save(_trajectory_file(new, index))
        check_target(folder, force)  # somebody may have come first
        _swap(new, target, work / "old")
    except OSError as error:
        raise FileFormatError(
            f"cannot write the run {folder}: {error.strerror or error}; choose a place that is writable"
        ) from error
    finally:
        if work is not None:
            shutil.rmtree(work, ignore_errors=True)
    return Path(folder)


def _swap(new: Path, target: Path, old: Path) -> None:
    """Puts ``new`` in the place of ``target``; brings ``target`` back if that fails."""
    replaced = target.exists()
    if replaced:
        target.rename(old)
    try:
        new.rename(target)
    except OSError:
        if replaced:
            old.rename(target)
        raise


def describe(front: Front, hypervolume: Hypervolume | None = None) -> dict[str, Any]:
    """What ``run.json`` holds, as plain JSON values."""
    try:
        measured = (hypervolume or front.hypervolume()).to_dict()
    except InputError:  # the problem has no reference point for these objectives
        measured = dict.fromkeys(("value", "volume", "reference", "ideal", "ideal_from", "own_ideal"))
    described = plain(
        {
            "format": FORMAT,
            "problem": front.problem.id,
            "case": case_fields(front.problem),
            "objectives": front.objectives,
            "method": front.method,
            "seed": front.seed,
            "seconds": front.seconds,
            "points": len(front),
            "hypervolume": measured,
            "versions": {"ocp-traj": ocp_traj.__version__, **{name: _version(name) for name in PACKAGES}},
            "info": front.info,
        }
    )
    return dict(described)


def load_run(folder: str | Path) -> Front:
    """Reads a run folder; the problem is built again from its id and case.

    Verdicts and margins are those of ``front.csv``: ``front.audit(i)`` proves them anew. What is checked is that the
    files belong together: each row's variables give its objectives and its trajectory.
    """
    root = Path(folder)
    run = read_manifest(root)
    try:
        problem = problems.load(run["problem"], **run["case"])
        front = Front(
            problem, tuple(run["objectives"]), (), run["method"], run["seed"], float(run["seconds"]), dict(run["info"])
        )
    except KeyError as error:
        raise FileFormatError(f"{root / 'run.json'}: the field {error} of format {FORMAT} is missing") from error
    except (InputError, TypeError, ValueError) as error:
        raise FileFormatError(f"{root / 'run.json'} does not describe a run: {error}") from error
    table = read_front_csv(root / "front.csv")
    if list(table.columns) != list(front.table.columns):
        raise FileFormatError(
            f"{root / 'front.csv'}: its columns are {', '.join(table.columns)}; "
            f"those of {problem.id} are {', '.join(front.table.columns)}"
        )
    if len(table) != run.get("points", len(table)):
        raise FileFormatError(f"{root / 'front.csv'} has {len(table)} rows; run.json says {run['points']}")
    points = tuple(_point(front, row, root, index) for index, row in enumerate(table.itertuples(index=False)))
    return Front(problem, front.objectives, points, front.method, front.seed, front.seconds, front.info)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The contents of a run folder's ``run.json``."""
    run = read_json(folder / "run.json", "run")
    kind = run.get("format") if isinstance(run, dict) else None
    if kind != FORMAT:
        raise FileFormatError(f"{folder / 'run.json'} is not a run: its format is {kind!r}; allowed is {FORMAT!r}")
    return dict(run)


def read_front_csv(path: Path) -> pd.DataFrame:
    """A ``front.csv``, every number as it was written, indexed by ``point``."""
    text = read_text(path, "front")
    try:
        table = pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)
    except ValueError as error:  # of pandas' parser
        raise FileFormatError(f"{path} is not a front: {error}") from error
    if list(table.columns[:1]) != ["point"] or not {"margin", "verdict"} <= set(table.columns):
        raise FileFormatError(f"{path} is not a front: it has no columns point, margin and verdict")
    if table["point"].tolist() != [str(index) for index in range(len(table))]:
        raise FileFormatError(f"{path} is not a front: its points are not numbered 0, 1, 2, ..; a row is missing")
    unknown = set(table["verdict"]) - {PROVED, UNDECIDED, VIOLATED}
    if unknown:
        raise FileFormatError(f"{path} is not a front: it has the verdicts {sorted(unknown)}")
    numbers = {str(name): table[name] for name in table.columns.drop(["point", "verdict"])}
    read = pd.DataFrame({name: _numbers(path, name, column) for name, column in numbers.items()})
    read.insert(list(table.columns).index("verdict") - 1, "verdict", table["verdict"].astype(object))
    return read.rename_axis("point")


def _numbers(path: Path, name: str, texts: Iterable[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A column's numbers to the last bit, which not every version of pandas reads."""
    try:
        numbers = np.array([float(text) for text in texts], dtype=float)
    except ValueError as error:
        raise FileFormatError(f"{path} is not a front: {name} holds what is no number: {error}") from error
    if np.isnan(numbers).any() or (name != "margin" and np.isinf(numbers).any()):  # no path limit: margin inf
        raise FileFormatError(f"{path} is not a front: {name} holds what is no finite number")
    return numbers


def _point(front: Front, row: tuple[Any, ...], root: Path, index: int) -> FrontPoint:
    """One row of ``front.csv`` with its trajectory; raises ``FileFormatError`` where they do not belong together."""
    *numbers, margin, verdict = row
    names = [name for name, _ in front.columns[: len(numbers) - front.problem.size]]
    x = np.array(numbers[len(names) :], dtype=float)
    objectives = dict(zip(names, map(float, numbers), strict=False))
    path = _trajectory_file(root, index)
    found, computed = Trajectory.load(path), evaluate_objectives(front.problem, x)
    if not _same(found, trajectory(front.problem, x)) or not all(
        np.isclose(objectives[name], computed[name], rtol=AGREE, atol=AGREE) for name in names
    ):
        raise FileFormatError(
            f"{path} and point {index} of front.csv do not belong together: one of them was changed, or run.json was"
        )
    return FrontPoint(x, objectives, found, float(margin), str(verdict))


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


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, numbers that are not finite as null, anything else as its text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _trajectory_file(root: Path, index: int) -> Path:
    return root / "trajectories" / f"{index:03d}.json"
