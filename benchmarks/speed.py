"""Times of this package beside those of an earlier commit, in one run on one machine: ``benchmarks/RESULTS.md``.

    python -m benchmarks.speed [--repeat 5] [--repeat-long 3] [--seeds 5] [--rows front,cost] [--fresh]

The earlier commit gets an environment of its own with the versions of this one, made once. Every measurement is a
process of its own on one core; the two commits take turns. What is measured is kept at once, a line of JSON each, in
the folder of ``--baseline``: a run that was stopped goes on where it was, for the same sources.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from importlib.metadata import distributions
from pathlib import Path
from queue import SimpleQueue

from benchmarks.sections import put
from benchmarks.speed_table import BUDGETS, METHODS, ROWS, SIZES, Figures, report

ROOT = Path(__file__).resolve().parent.parent
BEFORE = "e0d53f0"
MEASURED = ("ocp_traj", "problems", "solvers", "benchmarks/speed_rows.py")


@dataclass(frozen=True)
class Measurement:
    """One process to run: a row in one of the two environments."""

    row: str
    side: str  # before or now
    repeat: int
    options: tuple[str, ...] = field(default=())

    @property
    def key(self) -> str:
        """What tells it from others."""
        return " ".join((self.row, self.side, str(self.repeat), *self.options))


def plan(rows: Sequence[str], repeat: int, repeat_long: int, seeds: int) -> Iterator[list[Measurement]]:
    """What is to be measured: those of one list may run side by side, each on a core of its own."""
    for name in ("front", *(row.name for row in ROWS)):
        if name in rows:
            long = any(row.name == name and row.long for row in ROWS)
            for k in range(repeat_long if long else repeat):
                yield [Measurement(name, "before", k)]
                yield [Measurement(name, "now", k)]
                if name == "front":
                    yield [Measurement("nsga2", "before", k)]
    if "equal" in rows:
        for side in ("before", "now"):
            yield [
                Measurement("trace", side, 0, (f"budget={budget.split()[0]}", f"seed={seed}"))
                for budget in BUDGETS
                for seed in range(seeds)
            ]
        yield [
            Measurement("population", "before", 0, (f"method={method}", f"size={size}", f"seed={seed}"))
            for seed in range(seeds)
            for method in METHODS
            for size in SIZES
        ]


# --- environments and processes ---


def earlier(folder: Path) -> tuple[Path, Path]:
    """Interpreter and sources of the earlier commit; made where they are missing, with the libraries of this one."""
    sources, python = folder / BEFORE, folder / f"{BEFORE}-venv" / "bin" / "python"
    ready = folder / f"{BEFORE}-ready"
    if not ready.exists():
        sources.mkdir(parents=True, exist_ok=True)
        packed = subprocess.run(["git", "archive", BEFORE], cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", sources], input=packed, check=True)
        same = folder / "constraints.txt"
        same.write_text("".join(f"{d.name}=={d.version}\n" for d in distributions() if d.name != "ocp-traj"))
        subprocess.run([sys.executable, "-m", "venv", "--clear", python.parent.parent], check=True)
        install = [python, "-m", "pip", "--disable-pip-version-check", "install", "-qq", "-c", same]
        subprocess.run([*install, sources, "example-robot-data"], check=True)
        ready.touch()
    return python, sources


class Bench:
    """Measures, and keeps what it has measured."""

    def __init__(self, folder: Path, fresh: bool) -> None:
        self.folder = folder
        self.python = {"before": earlier(folder), "now": (Path(sys.executable), ROOT)}
        self.kept = folder / f"{_contents()}.jsonl"
        if fresh:
            self.kept.unlink(missing_ok=True)
        lines = self.kept.read_text().splitlines() if self.kept.exists() else []
        self.found: dict[str, Figures] = {one["key"]: one for one in map(json.loads, lines)}

    def measure(self, together: Sequence[Measurement]) -> None:
        """Runs those that are not known yet: one on the first core, several on all of them."""
        missing = [one for one in together if one.key not in self.found]
        cores: SimpleQueue[int] = SimpleQueue()
        usable = sorted(os.sched_getaffinity(0))[: len(missing)]
        for core in usable:
            cores.put(core)
        if missing:
            with ThreadPoolExecutor(len(usable)) as pool:
                list(pool.map(lambda one: self._run(one, cores), missing))

    def _run(self, one: Measurement, cores: SimpleQueue[int]) -> None:
        python, sources = self.python[one.side]
        core = cores.get()
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS")}
        line = [python, ROOT / "benchmarks" / "speed_rows.py", one.row, str(core), *one.options]
        done = subprocess.run(
            line, cwd=self.folder, env={**os.environ, **threads, "PYTHONPATH": str(sources)}, capture_output=True,
            text=True,
        )  # fmt: skip
        cores.put(core)
        if done.returncode:
            sys.exit(f"{one.key}: {done.stderr}")
        figures: Figures = json.loads(done.stdout.splitlines()[-1])
        if not Path(figures["package"]).is_relative_to(sources):
            sys.exit(f"{one.key} ran {figures['package']}, not the package in {sources}")
        self.found[one.key] = {"key": one.key, "at": time.time(), **figures}
        with self.kept.open("a") as file:
            file.write(json.dumps(self.found[one.key]) + "\n")
        print(f"{one.key}: {figures['seconds']:.4g} s", flush=True)


def _contents() -> str:
    """A name of what is measured that does not change with the rest of the checkout."""
    text = _git("ls-tree", "HEAD", *MEASURED) + _git("diff", "HEAD", "--", *MEASURED)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def _now() -> str:
    return _git("rev-parse", "--short", "HEAD") + (", changed" if _git("diff", "HEAD", "--", *MEASURED) else "")


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


def main() -> None:
    """Measures what is missing and writes the table."""
    names = ["front", *(row.name for row in ROWS), "equal"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5, help="processes of each row and commit")
    parser.add_argument("--repeat-long", type=int, help="of rows that take more than 20 s; as the others if not given")
    parser.add_argument("--seeds", type=int, default=5, help="of the rows of equal time")
    parser.add_argument("--rows", default=",".join(names), help="some of them, with commas between (default: all)")
    parser.add_argument("--baseline", type=Path, default=ROOT / "runs" / "speed", help="folder of the commit before")
    parser.add_argument("--fresh", action="store_true", help="measure all anew")
    given = parser.parse_args()
    rows = given.rows.split(",")
    if unknown := set(rows) - set(names):
        parser.error(f"there is no row {', '.join(sorted(unknown))}; rows are {', '.join(names)}")
    bench = Bench(given.baseline.resolve(), given.fresh)
    repeat_long = given.repeat if given.repeat_long is None else given.repeat_long
    command = " ".join(["python -m benchmarks.speed", *sys.argv[1:]])
    put("speed", report(bench.found, command, BEFORE, _now()))
    for together in plan(rows, given.repeat, repeat_long, given.seeds):
        bench.measure(together)
        put("speed", report(bench.found, command, BEFORE, _now()))


if __name__ == "__main__":
    main()
