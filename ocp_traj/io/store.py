"""A run folder: what was asked, a journal of what was found, and the front that comes of it.

``run.json`` (format ``ocp-traj/run/2``) says what was asked, and at the end how the run went. ``journal.jsonl`` is the
truth: a record of every finished solve, on the disk before the next begins, and last the front. ``front.csv`` (units in
the column names), ``front.png`` and ``trajectories/NNN.json`` (one a row of ``front.csv``) show that front to others:
they are made when the run ends and are never believed.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any

from ocp_traj.errors import InputError
from ocp_traj.files import plain, write_text, write_with
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.journal import Journal
from ocp_traj.io.run_folder import BOUNDS, JOURNAL, MANIFEST, PICTURE, TABLE, TRAJECTORIES, RunFolder
from ocp_traj.proof.verdicts import PROVED
from ocp_traj.results.front import Front, Hypervolume
from ocp_traj.results.records import KEY, Record, is_proved, of_front, usable
from ocp_traj.results.trajectory import case_fields
from ocp_traj.version import __version__

FORMAT = "ocp-traj/run/2"
PACKAGES = ("casadi", "pin", "pymoo", "numpy")


def request(
    problem: Problem, objectives: Sequence[str], method: str, *, seed: int | None = None, budget: float | None = None,
    keep_unproved: bool = False, certify: bool = False, options: Mapping[str, Any] | None = None,
    corners: Sequence[Mapping[str, float] | None] = (None, None), task: Mapping[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """What ``run.json`` holds from the start, as plain JSON values: enough to ask for the same again.

    ``corners`` are the reference and the ideal point of the hypervolume that were given, ``task`` is the file a task
    was read from and the values that were changed in it.
    """
    return dict(
        plain(
            {
                "format": FORMAT,
                "problem": problem.id,
                "case": case_fields(problem),
                "objectives": objectives,
                "method": method,
                "seed": seed,
                "options": options or {},
                "budget": budget,
                "keep_unproved": keep_unproved,
                "corners": corners,
                "task": task,
                "versions": versions(),
                **({"certify": True} if certify else {}),
            }
        )
    )


def versions() -> dict[str, str | None]:
    """Of this package and of those that the numbers come from."""
    return {"ocp-traj": __version__, **{name: _version(name) for name in PACKAGES}}


class Run:
    """A run folder that is being written: ``found`` takes what a method has finished, ``finish`` the front.

    Use it in a ``with`` block. One that ends without a point leaves nothing, and the run that it was to replace as it
    was; one that ends early leaves what was found, for ``load_run``.

    Attributes:
        folder: as it was given.
        holds_points: whether anything that ``load_run`` can make a front of is in it.
    """

    def __init__(
        self, folder: str | Path, asked: Mapping[str, Any], *, force: bool = False, place: RunFolder | None = None,
        earlier: Sequence[Record] = (),
    ) -> None:  # fmt: skip
        """Takes the folder and writes ``asked``, a ``request``; raises ``InputError`` as ``check_target`` does.

        A run that was stopped is gone on with in its ``place``, after the ``earlier`` records of its journal.
        """
        self.folder = Path(folder)
        elapsed = float(earlier[-1]["elapsed"]) if earlier else 0.0
        self._resumed = place is not None
        self._asked, self._begun = asked, time.perf_counter() - elapsed
        self._keys = {record[KEY] for record in earlier if record.get(KEY)}
        self.holds_points, self._proved = any(map(usable, earlier)), any(map(is_proved, earlier))
        self._place = RunFolder(folder, force) if place is None else place
        try:
            self._journal = Journal(self._place.root / JOURNAL)
            self._place.forget_shown()
            self._write_manifest({})
        except BaseException:
            self._place.discard()
            raise

    def __enter__(self) -> Run:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self.holds_points or self._resumed:
            self.close()
        else:
            self.discard()

    def found(self, record: Record) -> None:
        """Writes a record of finished work; it is on the disk when this returns. What is there stands once."""
        key = record.get(KEY)
        if key and key in self._keys:
            return
        self._append(record)
        self._keys |= {key} if key else set()
        self.holds_points = self.holds_points or usable(record)
        if is_proved(record):
            self._keep()

    def finish(self, front: Front, hypervolume: Hypervolume | None = None) -> Path:
        """Writes the front: into the journal first, then for others to read.

        ``hypervolume`` is what to record, where it was measured with other corners than the front's own.
        """
        from ocp_traj.io.plot import plot_front  # Matplotlib is slow to import, and drawn with at the end alone

        self._append(of_front(front))
        root = self._place.root
        _write_trajectories(front, root / TRAJECTORIES)
        write_with(root / TABLE, lambda temporary: front.table.to_csv(temporary))
        if front.certificate is not None:
            corners = front.certificate.table
            write_with(root / BOUNDS, lambda temporary: corners.to_csv(temporary, index=False))
        self._write_manifest(describe(front, hypervolume))
        plot_front(front, root / PICTURE)
        self._keep()
        return self.folder

    def discard(self) -> None:
        """Leaves nothing of this run, and brings back the one that it was to replace; not once a point is proved."""
        if self._proved:
            self.close()
        else:
            self._place.discard()

    def close(self) -> None:
        """Leaves the folder as it is."""
        self._place.close()

    def _append(self, record: Record) -> None:
        self._journal.append({**record, "elapsed": time.perf_counter() - self._begun})

    def _keep(self) -> None:
        self.holds_points = self._proved = True
        self._place.forget_earlier()

    def _write_manifest(self, results: Mapping[str, Any]) -> None:
        text = json.dumps({**self._asked, **results}, indent=1)
        write_text(self._place.root / MANIFEST, text + "\n")


def save_run(front: Front, folder: str | Path, *, force: bool = False, hypervolume: Hypervolume | None = None) -> Path:
    """Writes a run of a front that is there, whole or not at all; ``force`` replaces an earlier run.

    ``hypervolume`` is what to record, where it was measured with other corners than the front's own.
    """
    unproved = any(point.verdict != PROVED for point in front.points)
    asked = request(front.problem, front.objectives, front.method, seed=front.seed, keep_unproved=unproved)
    with Run(folder, asked, force=force) as run:
        return run.finish(front, hypervolume)


def describe(front: Front, hypervolume: Hypervolume | None = None) -> dict[str, Any]:
    """What ``run.json`` holds beside the request when a run has ended, as plain JSON values."""
    try:
        measured = (hypervolume or front.hypervolume()).to_dict()
    except InputError:  # the problem has no reference point for these objectives
        measured = dict.fromkeys(("value", "volume", "reference", "ideal", "ideal_from", "own_ideal"))
    described = {"seconds": front.seconds, "points": len(front), "hypervolume": measured, "info": front.info}
    if front.certificate is not None:
        described["certificate"] = front.certificate.to_dict()
    return dict(plain(described))


def trajectory_file(folder: Path, index: int) -> Path:
    """Where the trajectory of a row of ``front.csv`` is kept."""
    return folder / f"{index:03d}.json"


def _write_trajectories(front: Front, folder: Path) -> None:
    staged = folder.with_name(f".{folder.name}.new")
    staged.mkdir()
    for index, point in enumerate(front.points):
        point.trajectory.save(trajectory_file(staged, index))
    if folder.exists():
        shutil.rmtree(folder)
    staged.rename(folder)


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
