"""Fronts and trajectories for other programs and for controllers: one file a format."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd

from ocp_traj import problems
from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation.case import convert
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.io.export.exported import Exported, Format
from ocp_traj.io.export.tables import WRITERS, Table
from ocp_traj.io.export.tables import trajectory_table as trajectory_table
from ocp_traj.io.run_folder import MANIFEST, TABLE
from ocp_traj.io.run_reader import load_run, read_manifest
from ocp_traj.results.front_table import read_front_csv
from ocp_traj.results.trajectory import Trajectory

FORMATS = {
    "csv": "ocp_traj.io.export.tables:Csv",
    "parquet": "ocp_traj.io.export.tables:Parquet",
    "json": "ocp_traj.io.export.tables:Json",
    "ros": "ocp_traj.io.export.ros:Ros",
    "urscript": "ocp_traj.io.export.urscript:Urscript",
    "bpoly": "ocp_traj.io.export.bpoly:Bpoly",
    "krl": "ocp_traj.io.export.krl:Krl",
    "fanuc": "ocp_traj.io.export.fanuc:Fanuc",
}
FLAGS = ("samples", "at", "rate", "interpolation", "tolerance", "joints")  # options the command line has flags for
SUFFIXES = {"ros": ".ros.yaml", "urscript": ".script", "bpoly": ".bpoly.json", "krl": ".src", "fanuc": ".ls"}


def format_class(format: str) -> type[Any]:
    """The class of a format, imported."""
    if format not in FORMATS:
        known = nearest(format, FORMATS)
        raise InputError(f"there is no export format {quoted(format)}{known}; formats are {', '.join(FORMATS)}")
    module, _, name = FORMATS[format].partition(":")
    found: type[Any] = getattr(import_module(module), name)
    return found


def configured(format: str, **options: Any) -> Format:
    """A format with its options; unknown ones are refused."""
    chosen = format_class(format)
    allowed = [field.name for field in fields(chosen)]
    for option in options:
        if option not in allowed:
            what = f"options are {', '.join(allowed)}" if allowed else "it has none"
            raise InputError(f"{format} has no option {quoted(option)}{nearest(option, allowed)}; {what}")
    found: Format = chosen(**options)
    return found


def options_from_text(format: str, texts: Mapping[str, str]) -> dict[str, Any]:
    """Options as text, as values of their types: of those that have no flag of their own."""
    chosen = format_class(format)
    known = [field.name for field in fields(chosen) if field.name not in FLAGS]
    return convert(format, chosen, dict(texts), "option", known)


def check_table(table: Mapping[str, Any]) -> None:
    """Refuses what ``[export]`` of a task has and no export takes."""
    options = dict(table)
    if not isinstance(kind := options.pop("format", None), str):
        what = "is missing" if kind is None else f"is {quoted(kind)}"
        raise InputError(f"[export] format {what}; give one of {', '.join(FORMATS)}")
    try:
        chosen = format_class(kind)
    except InputError as error:
        raise InputError(f"[export] format: {error}") from error
    words = {field.name for field in fields(chosen) if field.default is None and not field.metadata}
    for name, value in options.items():
        try:
            configured(kind, **{name: value} if name in words else convert(kind, chosen, {name: value}, "option"))
        except InputError as error:
            raise InputError(f"[export] {name}: {error}") from error


def asked_by_task(source: str | Path) -> dict[str, Any]:
    """``format`` and its options, as ``[export]`` of the task has them that a trajectory's file carries."""
    origin = Path(source)
    case = {} if origin.is_dir() or origin.suffix.lower() == ".csv" else Trajectory.load(origin).case
    asked = case.get("export")
    if not isinstance(asked, dict) or not isinstance(asked.get("format"), str):
        raise InputError(f"{source} does not say what to export it to; give --format, one of {', '.join(FORMATS)}")
    return dict(asked)


def export(
    source: str | Path | Trajectory, format: str, destination: str | Path, *, limits: Requirements | None = None,
    **options: Any,
) -> Exported:  # fmt: skip
    """Writes a front or a trajectory in another format, and says what is proved of what a controller makes of it.

    Args:
        source: a trajectory or its file, a run folder, at any moment of the run, or a ``front.csv``. The points of a
            run are proved anew; a ``front.csv`` that lies in no run of a known problem is taken as it is.
        format: ``csv``, ``parquet``, ``json``; of trajectories ``ros``, ``urscript``, ``bpoly``, ``krl``, ``fanuc``.
        destination: the file to write.
        limits: of the trajectory; those of its problem if not given.
        options: fields of the format's class, such as ``rate`` of ``ros``.

    Returns:
        The path, which it can be used as, and the verdict.
    """
    target = Path(destination)
    chosen = configured(format, **options)
    if isinstance(source, Trajectory):
        return _write(source, chosen, target, limits)
    origin = Path(source)
    if os.path.realpath(source) == os.path.realpath(destination):
        raise InputError(f"the export would overwrite its source {source}; give another file")
    if origin.is_dir() or (origin.suffix.lower() == ".csv" and _is_front(origin)):
        if format not in WRITERS:
            raise InputError(
                f"{source} is a front; {format} is for one trajectory, such as trajectories/000.json of a run"
            )
        if options or limits is not None:
            raise InputError(
                f"{source} is a front, which has no options: {', '.join(options) or 'limits'}; leave them out"
            )
        table, metadata = _front(origin)
        path = WRITERS[format](table, {"kind": "front", "metadata": metadata}, target)
        return Exported(path, format, (path,), {})
    return _write(Trajectory.load(origin), chosen, target, limits)


def _write(trajectory: Trajectory, chosen: Format, target: Path, limits: Requirements | None) -> Exported:
    plain = isinstance(chosen, Table) and not chosen.plays
    if limits is None and not plain and (trajectory.origin is not None or problems.known(trajectory.problem)):
        trajectory.audit()  # refuses one that is not what its problem makes of its variables, payload and case
        origin = trajectory.origin or problems.load(trajectory.problem, **trajectory.case)
        limits = origin.requirements
    return chosen.write(trajectory, limits, target)


def _is_front(source: Path) -> bool:
    """Whether a CSV is not a table of a trajectory's samples."""
    try:
        with source.open(encoding="utf-8", errors="replace") as file:
            header = next((line for line in file if not line.startswith("#")), "")
    except OSError:
        return True  # whose reader says what is wrong
    return not header.startswith("time [s],")


def _front(source: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The front's table, and what its run folder says of it."""
    folder = source if source.is_dir() else source.parent
    if not source.is_dir() and not (source.name == TABLE and (folder / MANIFEST).is_file()):
        return read_front_csv(source).reset_index(), {}
    run = read_manifest(folder)
    if not source.is_dir() and not problems.known(str(run.get("problem"))):
        # A problem of the user's own, which nothing here can prove a point of.
        return read_front_csv(source).reset_index(), run
    return load_run(folder).table.reset_index(), run
