"""Kills a front of twelve points at random moments and looks at what is left.

Run with ``python benchmarks/kill.py [KILLS [SEED]]``. Every run is written to one folder, with ``--force``, over what
the one before has left. What a run had reported, a line of its journal, has to be there afterwards and on the front
that ``load_run`` proves, or worse than a point of it. Until a run has a proved point, the one it replaces has to be
there too. Journals are read by code of this file.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import ocp_traj as ot
from ocp_traj.results.front import Front

OBJECTIVES = ("time", "energy")
POINTS = 12
EARLIER = "ocp-traj.earlier"
SAME = 1e-9  # relative: what a front counts as one point


@dataclass(frozen=True)
class Left:
    """What a folder holds: records of the run, and of the one that it replaces."""

    records: list[dict[str, Any]]
    earlier: list[dict[str, Any]]

    @classmethod
    def read(cls, root: Path) -> Left:
        """Reads the whole lines of both journals."""
        earlier = [_lines(root / name / "journal.jsonl") for name in (EARLIER, f".{EARLIER}.moving")]
        return cls(_lines(root / "journal.jsonl"), earlier[0] or earlier[1])

    @property
    def has_point(self) -> bool:
        """Whether the run has one that is proved."""
        return any(_points(record) for record in self.records)

    @property
    def kept(self) -> list[dict[str, Any]]:
        """The records that may not be lost."""
        return self.records if self.has_point else self.earlier


def _lines(path: Path) -> list[dict[str, Any]]:
    try:
        whole = path.read_bytes().split(b"\n")[:-1]
    except FileNotFoundError:
        return []
    return [json.loads(line)["record"] for line in whole]


def _points(record: dict[str, Any]) -> list[dict[str, Any]]:
    return [point for point in record["points"] if point.get("verdict") == "proved"]


def start(root: Path, points: int = POINTS) -> subprocess.Popen[bytes]:
    """A run of the command line in a process of its own."""
    line = [sys.executable, "-m", "ocp_traj", "pareto", "hybrid-spline", "--objectives", ",".join(OBJECTIVES)]
    line += ["--points", str(points), "-o", str(root), "--force"]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent), "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment)


class Moment:
    """A number of records of the new run, and a time [s] after them."""

    def __init__(self, records: int, delay: float) -> None:
        self.records, self.delay, self._reached = records, delay, np.inf

    def __call__(self, seconds: float, left: Left) -> bool:
        """Whether it has come."""
        if len(left.records) >= self.records:
            self._reached = min(self._reached, seconds)
        return seconds >= self._reached + self.delay


def kill(root: Path, due: Callable[[float, Left], bool]) -> tuple[Left, Left]:
    """Starts a run, kills it when it is due (of seconds and of what is there), and reads what was there and what is."""
    begun, known = time.perf_counter(), Left.read(root)
    before, new = known, Left([], [])
    with start(root) as process:
        while process.poll() is None and not due(time.perf_counter() - begun, new):
            time.sleep(0.002)
            before = Left.read(root)
            new = before if before.records != known.records else Left([], [])
        process.kill()  # nothing to a run that came to its end first
        if process.wait() not in (0, -signal.SIGKILL):
            raise RuntimeError(f"the run failed on its own: exit code {process.returncode}")
    return before, Left.read(root)


def lost(known: Sequence[dict[str, Any]], before: Left, after: Left) -> str:
    """What is missing that ``known``, the run that was there, or the new one had reported; empty if nothing is."""
    if not after.has_point and known not in (after.earlier, after.records):
        return "the earlier run"
    there = after.records[: len(before.records)] == before.records
    moved = before.records == known == after.earlier  # in the very last moment
    return "" if there or moved else f"some of {len(before.records)} records"


def missing(front: Front, records: Sequence[dict[str, Any]]) -> int:
    """How many points of records are neither on a front nor worse than a point of it."""
    values = np.array([[point["objectives"][n] for n in OBJECTIVES] for r in records for point in _points(r)])
    on_or_worse = (front.values[None] <= values[:, None] * (1.0 + SAME)).all(axis=2).any(axis=1)
    return int((~on_or_worse).sum())


def main(kills: int = 20, seed: int = 0) -> int:
    """Prints a line a kill; the number of failures."""
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "run"
        begun = time.perf_counter()
        with start(root) as process:
            process.wait()
        length = time.perf_counter() - begun
        known = Left.read(root).records
        print(f"unharmed: {length:.1f} s, {len(known)} records, {len(ot.load_run(root))} points")
        rng = np.random.default_rng(seed)
        for number in range(1, kills + 1):
            count = int(rng.integers(0, POINTS + 1))
            moment = Moment(count, float(rng.uniform(0.0, length / (POINTS if count else 2))))  # starting takes long
            before, after = kill(root, moment)
            gone = lost(known, before, after)
            known = after.kept or known
            place = root if after.has_point or not after.earlier else root / EARLIER
            if not after.has_point and not (place / "run.json").exists():
                place = root / f".{EARLIER}.moving"  # while its files are moved: they are put back at the next start
            front = ot.load_run(place)
            proved = sum(front.audit(i).proved for i in range(len(front)))
            bad = bool(gone) or proved < len(front) or bool(missing(front, known))
            failures += bad
            print(
                f"kill {number:2d}, {moment.delay:.2f} s after {moment.records:2d} records: {len(before.records):2d} "
                f"before, {len(after.records):2d} after, {len(after.earlier):2d} of the earlier run; {place.name}: "
                f"{len(front)} points, {proved} proved"
                f"{'; LOST: ' + (gone or 'points') if bad else ''}",
                flush=True,
            )
        with start(root) as process:
            assert process.stderr is not None
            words = process.stderr.read().decode().splitlines()
        front = ot.load_run(root)
        print(f"once more, to its end: exit {process.returncode}, {len(front)} points; {words[0] if words else ''}")
        failures += process.returncode != 0 or len(front) != POINTS
    print("nothing was lost" if not failures else f"{failures} failures")
    return failures


if __name__ == "__main__":
    sys.exit(min(main(*map(int, sys.argv[1:])), 1))
