"""Times of this package beside those of an earlier commit, in one run on one machine: ``benchmarks/RESULTS.md``.

    python benchmarks/speed.py [--repeat 5] [--repeat-long 3] [--seeds 5] [--rows front,cost] [--fresh]

The earlier commit gets an environment of its own with the versions of this one, made once. Every measurement is a
process of its own on one core; the two commits take turns. What is measured is kept at once, a line of JSON each, in
the folder of ``--baseline``: a run that was stopped goes on where it was, for the same sources.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import distributions, version
from pathlib import Path
from queue import SimpleQueue
from statistics import median
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
BEFORE = "e0d53f0"
RESULTS = ROOT / "benchmarks" / "RESULTS.md"
START, END = "<!-- speed -->", "<!-- /speed -->"  # of this script's part of it
SAME = 1e-4  # relative: objectives that are the same
BUSY = 1.1  # wall clock over processor time of a measurement, above which the machine was not quiet
NSGA2_HYPERVOLUME = 0.709  # to reach with 40 points
SIZES, METHODS, BUDGETS = (50, 100, 200), ("nsga2", "mopso"), ("3 s", "10 s", "30 s")
LIBRARIES = ("casadi", "numpy", "scipy", "pymoo", "pin")

Figures = dict[str, Any]


@dataclass(frozen=True)
class Row:
    """One line of the table that compares times.

    Attributes:
        name: of its function in ``speed_rows.py``.
        work: in words, with what is inside the time.
        today, target: seconds of the earlier commit and to reach, on a quiet machine: their ratio is the target.
        unit: of the seconds, as shown.
        long: whether it takes more than 20 s.
    """

    name: str
    work: str
    today: float
    target: float
    unit: str = "s"
    long: bool = False


ROWS = (
    Row("cost", "`hybrid-spline` cost, one start; building of the problem and proof inside", 1.04, 0.4),
    Row("wrist", "`wrist-obstacle`, 20 starts a branch; proofs inside", 50.7, 8.0, long=True),
    Row("weld", "`weld-bezier` default; proof inside", 10.0, 5.0),
    Row("weld_air_time", "`weld-bezier` air time; proof inside", 27.1, 12.0, long=True),
    Row("rotor", "`rotor-353`, certified", 1.9, 1.0),
    Row("ur5_solve", "UR5 through 20 points, least time; proof inside", 2.3, 0.6),
    Row("ur5_front", "UR5 through 20 points, front of 15 of time and effort; proofs inside", 98.0, 10.0, long=True),
    Row("audit", "audit of the nonic arm of 6 joints, rest to rest; the second in a process", 0.097, 0.05, "ms"),
    Row("individual", "an individual of `hybrid-spline`, 100 together, 49 instants, six limits", 100e-6, 60e-6, "us"),
)
SCALE = {"s": 1.0, "ms": 1e3, "us": 1e6}


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
        install = [python, "-m", "pip", "--disable-pip-version-check", "install", "-q", "-c", same]
        subprocess.run([*install, sources, "example-robot-data"], check=True)
        ready.touch()
    return python, sources


class Bench:
    """Measures, and keeps what it has measured."""

    def __init__(self, folder: Path, fresh: bool) -> None:
        self.folder = folder
        self.python = {"before": earlier(folder), "now": (Path(sys.executable), ROOT)}
        self.kept = folder / f"{_sources()}.jsonl"
        if fresh:
            self.kept.unlink(missing_ok=True)
        lines = self.kept.read_text().splitlines() if self.kept.exists() else []
        self.found: dict[str, Figures] = {one["key"]: one for one in map(json.loads, lines)}

    def measure(self, together: Sequence[Measurement]) -> None:
        """Runs those that are not known yet: one on the first core, several on all of them."""
        missing = [one for one in together if one.key not in self.found]
        cores: SimpleQueue[int] = SimpleQueue()
        usable = sorted(os.sched_getaffinity(0))[: min(len(missing), len(os.sched_getaffinity(0)))]
        for core in usable:
            cores.put(core)
        if missing:
            with ThreadPoolExecutor(len(usable)) as pool:
                for one, figures in zip(missing, pool.map(lambda one: self._run(one, cores), missing), strict=True):
                    self._keep(one, figures)

    def _run(self, one: Measurement, cores: SimpleQueue[int]) -> Figures:
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
        return figures

    def _keep(self, one: Measurement, figures: Figures) -> None:
        self.found[one.key] = {"key": one.key, "at": time.time(), **figures}
        with self.kept.open("a") as file:
            file.write(json.dumps(self.found[one.key]) + "\n")
        print(f"{one.key}: {figures['seconds']:.4g} s", flush=True)

    def of(self, row: str, side: str, *options: str) -> list[Figures]:
        """All that is known of a row in an environment."""
        found = []
        for key, figures in self.found.items():
            words = key.split()
            if words[:2] == [row, side] and set(options) <= set(words[3:]):
                found.append(figures)
        return found


def _sources() -> str:
    """Name of what is measured: the commit, and what differs from it in this checkout's packages and rows."""
    head = _git("rev-parse", "--short", "HEAD")
    changed = _git("diff", "HEAD", "--", "ocp_traj", "problems", "solvers", "benchmarks/speed_rows.py")
    return head + (f"-{hashlib.sha256(changed.encode()).hexdigest()[:8]}" if changed else "")


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()


# --- table ---


def middle(found: Sequence[Figures], name: str = "seconds") -> float:
    """Median of one figure; NaN where nothing is known."""
    return median(one[name] for one in found) if found else float("nan")


def verdict(met: bool, known: bool) -> str:
    """As the table has it."""
    return ("yes" if met else "**no**") if known else "to be measured"


def ratio_lines(bench: Bench) -> Iterator[Sequence[str]]:
    """Work | before | now | ratio | target | met, of the rows that compare times."""
    before, now, other = (bench.of(*row) for row in (("front", "before"), ("front", "now"), ("nsga2", "before")))
    times, reference = (middle(before), middle(now)), middle(other)
    ours, theirs = middle(now, "hypervolume"), max(middle(other, "as found"), middle(other, "hypervolume"))
    shown = [f"{t:.2f} s, {t / reference:.2f} x NSGA-II" if t == t else "-" for t in times]
    if now and other:
        shown[1] += f" ({reference:.2f} s); hypervolume {ours:.4f}, its {theirs:.4f}; {now[0]['proved']} points proved"
    met = times[1] <= reference and ours >= max(NSGA2_HYPERVOLUME, theirs)
    yield (
        "`hybrid-spline` front of 40 points, proofs inside, against NSGA-II 100 x 200 without proof", *shown,
        _ratio(*times), f"1.0 x NSGA-II, hypervolume {NSGA2_HYPERVOLUME}", verdict(met, bool(now and other)),
    )  # fmt: skip
    for row in ROWS:
        before, now = bench.of(row.name, "before"), bench.of(row.name, "now")
        times = middle(before), middle(now)
        shown = [f"{t * SCALE[row.unit]:.3g} {row.unit}" if t == t else "-" for t in times]
        if row.name == "audit":
            shown = [f"{text}, scan {1e3 * middle(f, 'scan'):.0f} ms" for text, f in zip(shown, (before, now), strict=True)]
        aim = row.target / row.today
        target = f"{aim:.2f} ({row.target * SCALE[row.unit]:g} of {row.today * SCALE[row.unit]:g} {row.unit})"
        known = bool(before and now)
        kept = known and _same(row, before[0], now[0])
        words = "" if kept or not known else "; not the same result"
        yield row.work, *shown, _ratio(*times), target, verdict(kept and times[1] <= aim * times[0], known) + words


def _ratio(before: float, now: float) -> str:
    return f"{now / before:.2f}" if now / before == now / before else "-"


def _same(row: Row, before: Figures, now: Figures) -> bool:
    """Whether as much is proved as before, and an objective is no worse."""
    objective = now.get("objective", 0.0) <= before.get("objective", 0.0) + SAME * abs(before.get("objective", 0.0))
    return objective and bool(now.get("proved", 0) >= before.get("proved", 0))


def equal_time_lines(bench: Bench) -> Iterator[Sequence[str]]:
    """Time | before | now | NSGA-II | MOPSO | met: hypervolumes, medians over the seeds with least and largest."""
    for budget in BUDGETS:
        own = [bench.of("trace", side, f"budget={budget.split()[0]}") for side in ("before", "now")]
        best = []
        for method in METHODS:
            runs = [bench.of("population", "before", f"method={method}", f"size={size}") for size in SIZES]
            values = [[max(run[budget]["as found"], run[budget]["hypervolume"]) for run in some] for some in runs]
            best.append(max(zip(values, SIZES, strict=True), key=lambda one: median(one[0]) if one[0] else 0.0))
        ours = [one["hypervolume"] for one in own[1]]
        known = bool(ours) and all(values for values, _ in best)
        met = known and all(median(ours) > median(values) for values, _ in best)
        took = f"; {middle(own[1]):.2f} s with proofs, {middle(own[1], 'proved'):.0f} points" if ours else ""
        yield (
            budget, _span([one["hypervolume"] for one in own[0]]), _span(ours) + took,
            *(f"{_span(values)}; population {size}" if values else "-" for values, size in best), verdict(met, known),
        )  # fmt: skip


def _span(values: Sequence[float]) -> str:
    return f"{median(values):.4f} ({min(values):.4f} to {max(values):.4f})" if values else "-"


def markdown(head: Sequence[str], lines: Iterator[Sequence[str]]) -> str:
    """A table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *lines))


def report(bench: Bench, command: str) -> str:
    """This script's part of the results."""
    found = list(bench.found.values())
    stamps = [datetime.fromtimestamp(one["at"], UTC).strftime("%Y-%m-%d %H:%M") for one in found] or ["never"]
    busiest = max((one["seconds"] / one["cpu"] for one in found if one["cpu"] > 0.0), default=0.0)
    noise = f"; NOT A QUIET MACHINE: up to {busiest:.1f} s of wall clock a second of processor" if busiest > BUSY else ""
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    count = max((len(bench.of(row.name, "now")) for row in ROWS), default=0)
    return f"""{START}
## Speed

Before: commit {BEFORE}; now: {_sources()}. {min(stamps)} to {max(stamps)} UTC{noise}. {_processor()}, {os.cpu_count()} cores;
Python {platform.python_version()}, {versions}. `{command}`

Medians of up to {count} processes of one core each, the two commits in turn. Imports are outside the time; the building
of the problem too where it is not named. The target is a ratio: seconds to reach over those of the commit before, as both
were measured on a quiet machine. *Met* asks for no worse an objective (to {SAME:g}) and as many proofs as well.

{markdown(("work", "before", "now", "ratio", "target", "met"), ratio_lines(bench))}

Hypervolume of `hybrid-spline`, time and energy, after equal wall time (share of the box from (2.4836 s, 1565.2) to
(8 s, 6000)): median, least and largest of the seeds. Ours is of proved points, with as many as there is time for.
NSGA-II and MOPSO are pymoo's, evaluated as on the commit before, at the best of populations {", ".join(map(str, SIZES))}, without
proof in their time, and with the larger of the hypervolumes as found (limits looked at between its instants by nobody)
and proved. Two processes at a time, on two cores, all of them alike.

{markdown(("time", "before", "now", "NSGA-II", "MOPSO", "met"), equal_time_lines(bench))}
{END}"""


def _processor() -> str:
    cpu = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in cpu.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()


def write(part: str) -> None:
    """Puts this script's part in its place, and leaves the others as they are."""
    text = RESULTS.read_text() if RESULTS.exists() else "# Results of the benchmarks\n"
    head, _, rest = text.partition(START)
    tail = rest.partition(END)[2].lstrip("\n")
    RESULTS.write_text("\n\n".join(filter(None, (head.rstrip(), part, tail.rstrip()))) + "\n")


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
    command = " ".join(["python benchmarks/speed.py", *sys.argv[1:]])
    for together in plan(rows, given.repeat, repeat_long, given.seeds):
        bench.measure(together)
        write(report(bench, command))


if __name__ == "__main__":
    main()
