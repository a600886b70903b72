"""Kills a front at random moments with SIGKILL, goes on with it, and compares its bytes with those of a whole run.

Run with ``python -m benchmarks.resume_kill [KILLS [SEED]]``. Runs take turns without workers and with two; half of them
are killed a second time while they are gone on with. The ``front.csv`` of each has to be that of a run that nobody has
stopped, and no worker may outlive its run. Prints a line a run; exits 1 if one differs.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

LINE = ["hybrid-spline", "--objectives", "time,energy", "--points", "12"]
PATIENCE = 10.0  # [s] for workers to notice that their run is gone


def begin(arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    """A command in a session of its own."""
    line = [sys.executable, "-m", "ocp_traj", *arguments]
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True)


def left_of(session: int) -> list[int]:
    """Processes of a session."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if fields[0] != "Z" and int(fields[3]) == session:
            found.append(int(entry.name))
    return found


def kill_after(process: subprocess.Popen[bytes], seconds: float) -> bool:
    """Kills a command, and waits for its workers to end; whether it was still running."""
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
    process.communicate()
    end = time.monotonic() + PATIENCE
    while left_of(process.pid):
        if time.monotonic() > end:
            raise SystemExit(f"workers {left_of(process.pid)} outlive their run")
        time.sleep(0.1)
    return process.returncode == -9


def done(arguments: Sequence[str]) -> float:
    """The time that a command takes to its end [s], which has to be a good one."""
    begun = time.monotonic()
    process = begin(arguments)
    _, err = process.communicate()
    if process.returncode:
        raise SystemExit(f"{' '.join(arguments)} ended with {process.returncode}: {err.decode()[-300:]}")
    return time.monotonic() - begun


def digest(run: Path) -> str:
    """Of the bytes of a front."""
    return hashlib.sha256((run / "front.csv").read_bytes()).hexdigest()[:16]


def main(kills: int = 10, seed: int = 0) -> int:
    """Prints a line a killed run."""
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    rng, differs = np.random.default_rng(seed), 0
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        seconds = {"0": done(["pareto", *LINE, "-o", str(whole)])}
        seconds["2"] = done(["pareto", *LINE, "-o", str(Path(folder) / "two"), "--workers", "2"])
        differs += digest(Path(folder) / "two") != digest(whole)
        print(f"whole: {seconds['0']:.1f} s, {seconds['2']:.1f} s with 2 workers, {digest(whole)}", flush=True)
        for number in range(kills):
            run, workers = Path(folder) / f"run{number}", str(2 * (number % 2))
            moments: list[float] = []
            again = ["pareto", *LINE, "-o", str(run)]
            for _ in range(1 + int(rng.integers(2))):
                moment = float(rng.uniform(0.05, 1.0)) * seconds[workers]
                if kill_after(begin([*again, "--workers", workers]), moment):
                    moments.append(moment)
                if (run / "run.json").exists():
                    again = ["resume", str(run)]
            kept = (run / "journal.jsonl").read_bytes().count(b"\n") if again[0] == "resume" else 0
            took = done([*again, "--workers", workers])
            same = digest(run) == digest(whole)
            differs += not same
            at = ", ".join(f"{moment:.1f}" for moment in moments) or "never"
            print(
                f"{workers} workers, killed at {at} s: {kept} records, {again[0]} took {took:.1f} s, "
                f"{'same' if same else 'OTHER'} bytes",
                flush=True,
            )
    return 1 if differs else 0


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
