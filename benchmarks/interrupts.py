"""Ctrl-C at random moments, the start included, of `solve` and `pareto` with every method.

    python benchmarks/interrupts.py [MOMENTS] [SEED]

Each command is run once to its end, then MOMENTS times (20 if not given) with SIGINT after a random part of that time.
It has to end within 3 s (of its own: the processor may be shared) with exit code 130, or with 0 if it was done;
without a traceback; with one line that says what is missing; and what it says it has written has to be there, whole and
proved. Prints a table; exits 1 if anything fails.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ocp_traj.results.trajectory import Trajectory

LIMIT = 3.0  # [s] of processor time from the signal to the end
OPTIONS = {  # so that a command takes some 5 to 10 s
    "exchange": ["--starts", "6"],
    "pso": ["--starts", "3", "--option", "generations=50"],
    "ga": ["--starts", "2", "--option", "generations=15"],
    "trace": ["--points", "10"],
    "nsga2": ["--option", "generations=80"],
    "mopso": ["--option", "generations=50"],
    "hmoga": ["--points", "5", "--option", "generations=25", "--option", "population=60"],
    "memetic": ["--points", "5", "--option", "generations=25", "--option", "population=60"],
}
SOLVE, PARETO = ("exchange", "pso", "ga"), ("trace", "nsga2", "mopso", "hmoga", "memetic")
PROBLEMS = {"hybrid-spline": ("time", "time,energy"), "wrist-obstacle": ("time", "time,distance")}
TITLE = (
    f"{'problem':<15} {'command':<7} {'method':<9} {'whole [s]':>9} {'130':>4} {'0':>4} {'kept':>5} "
    f"{'longest [s]':>11} {'own [s]':>8} faults"
)


@dataclass
class Row:
    """What became of a command's runs."""

    codes: Counter[int] = field(default_factory=Counter)
    kept: int = 0
    longest: float = 0.0
    own: float = 0.0
    faults: list[str] = field(default_factory=list)


def command(problem: str, method: str, target: Path) -> list[str]:
    """A command line that takes a while."""
    objective, objectives = PROBLEMS[problem]
    if method in SOLVE:
        chosen = ["solve", problem, "--objective", objective]
    else:
        chosen = ["pareto", problem, "--objectives", objectives]
    start = [sys.executable, "-m", "ocp_traj", *chosen, "--method", method, *OPTIONS[method]]
    return [*start, "-o", str(target)]


def begin(arguments: list[str]) -> subprocess.Popen[str]:
    """The process, as soon as it handles signals: what Python does before that is not this package's."""
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    caught = 0
    while not caught >> (signal.SIGTERM - 1) & 1:
        time.sleep(0.001)
        status = Path(f"/proc/{process.pid}/status").read_text()
        caught = int(status.split("SigCgt:")[1].split()[0], 16)
    return process


def spent(pid: int) -> float:
    """Processor time of a process so far [s]."""
    user, system = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def of_children() -> float:
    """Processor time of all processes that have ended [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def faults(code: int, seconds: float, out: str, err: str, target: Path) -> list[str]:
    """What is wrong with how a run has ended."""
    found = []
    if code not in (0, 130):
        found.append(f"exit code {code}: {err.strip()[-200:]}")
    if seconds > LIMIT:
        found.append(f"{seconds:.1f} s after the signal")
    if "Traceback" in out + err or "Exception ignored" in err:
        found.append(f"a traceback: {err.strip()[-300:]}")
    if code == 130 and "interrupted" not in err:
        found.append(f"not a word of the interruption: {err.strip()[-200:]}")
    said = "run: " in err or "trajectory: " in err
    if said != target.exists():
        found.append("what it says and what it has written differ")
    if list(target.parent.glob(f".{target.name}*")):
        found.append("something half written is left")
    return found


def proved(target: Path) -> bool:
    """Whether every trajectory that was written is whole, and proved anew."""
    files = sorted(target.glob("trajectories/*.json")) if target.is_dir() else [target]
    if target.is_dir() and len(files) != json.loads((target / "run.json").read_text())["points"]:
        return False
    return all(Trajectory.load(file).audit().proved for file in files)


def main(moments: int, seed: int) -> int:
    """Prints a row a command."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background the shell has it ignored
    rng = np.random.default_rng(seed)
    print(TITLE, flush=True)
    failed = 0
    for problem in PROBLEMS:
        for method in (*SOLVE, *PARETO):
            row = Row()
            with tempfile.TemporaryDirectory() as folder:
                place = Path(folder)
                begun = time.perf_counter()
                begin(command(problem, method, place / "whole")).communicate()
                whole = time.perf_counter() - begun
                for number in range(moments):
                    target = place / f"run{number}"
                    process = begin(command(problem, method, target))
                    time.sleep(rng.uniform(0.0, 1.0) ** 1.5 * whole)  # the start more often than the end
                    sent, before = time.perf_counter(), of_children() + spent(process.pid)
                    process.send_signal(signal.SIGINT)
                    out, err = process.communicate()
                    seconds, own = time.perf_counter() - sent, of_children() - before
                    row.codes[process.returncode] += 1
                    row.longest, row.own = max(row.longest, seconds), max(row.own, own)
                    row.faults += faults(process.returncode, own, out, err, target)
                    if target.exists():
                        row.kept += 1
                        row.faults += [] if proved(target) else ["not proved anew"]
            what = "solve" if method in SOLVE else "pareto"
            print(
                f"{problem:<15} {what:<7} {method:<9} {whole:9.1f} {row.codes[130]:4d} {row.codes[0]:4d} "
                f"{row.kept:5d} {row.longest:11.2f} {row.own:8.2f} {'; '.join(row.faults) or 'none'}",
                flush=True,
            )
            failed += len(row.faults)
    return 1 if failed else 0


if __name__ == "__main__":
    numbers = [int(text) for text in sys.argv[1:]]
    sys.exit(main(*(numbers + [20, 0][len(numbers) :])))
