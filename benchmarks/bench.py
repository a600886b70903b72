"""Side by side with what people would use instead: measures a table, and writes the page from what was measured.

    python -m benchmarks.bench TABLE .. [--quick] [--lines FOLDER] [--fresh]
    python -m benchmarks.bench page [--lines FOLDER]

What is measured is kept at once, a line of JSON each, in FOLDER/TABLE.jsonl: a run that was stopped goes on where it
was, and tries once more what failed. The page is benchmarks/RESULTS.md, each table a section of it. One process, one
thread; what may break the process, or whose memory counts, runs in one of its own.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.lines import Cell, Figures, Lines
from benchmarks.machine import commit_of, machine, versions
from benchmarks.pictures import DRAWN
from benchmarks.sections import RESULTS, ROW, put, section
from benchmarks.tables.words import failures, measured
from benchmarks.tables.words import table as markdown

ROOT = Path(__file__).resolve().parent.parent
TABLES = ("toppra", "ruckig", "guo", "fronts", "collocation", "clearance", "sizes")
LONGEST = 1200.0  # [s] of a process of its own, after which it is ended: our choice
HOW = """## Side by side: how it was measured

{machine};
{versions}.

Seconds are of the processor, one thread, building and, for ours, proof included; imports and a first call to warm up
are not. Every trajectory of every tool is judged by `benchmarks/judge.py`: a scan of 20 000
instants of the tool's own evaluation, torques by pinocchio, and the audit of the same motion as Bezier pieces. Excess
is relative to the limit. Peers are scripts of at most 60 lines in `benchmarks/peers/`, as their manuals write them.
Planning in clutter beside OMPL and TOPP-RA is a table of its own, `make bench-scenes SCENES=FOLDER`, and left out
without a folder. {sample}"""
SAMPLE = "Tables with `QUICK=1` are of a small sample, `make bench-quick`; `make bench` measures more."
QUICK, WHOLE = ROOT / "runs" / "bench-quick", ROOT / "runs" / "bench"


def load(name: str) -> Any:
    """The module of a table."""
    return import_module(f"benchmarks.tables.{name}")


def measure(name: str, quick: bool, folder: Path, fresh: bool) -> None:
    """Measures what is missing of a table."""
    path = folder / f"{name}.jsonl"
    if fresh:
        path.unlink(missing_ok=True)
    module, lines = load(name), Lines(path)
    wanted, commit = list(module.cells(quick)), commit_of(ROOT)
    for number, cell in enumerate(wanted, 1):
        if "failed" not in lines.found.get(cell, {"failed": "not tried"}):
            continue
        begun = time.perf_counter()
        figures = apart(name, cell) if getattr(module, "APART", False) else one(module, cell)
        lines.add(cell, {**figures, "commit": commit})
        words = figures.get("failed") or ", ".join(
            f"{key} {value:.4g}" for key, value in figures.items() if isinstance(value, float) and key != "at"
        )
        took = time.perf_counter() - begun
        print(f"{name} {number}/{len(wanted)} {' '.join(map(str, asdict(cell).values()))}: {words} [{took:.1f} s]",
              flush=True)  # fmt: skip


def one(module: Any, cell: Cell) -> Figures:
    """Measures a cell in this process; a tool that fails has failed, and the table goes on."""
    try:
        with threadpool_limits(1):
            found: Figures = module.measure(cell)
    except Exception as error:  # whatever another tool raises is its result
        return {"failed": f"{type(error).__name__}: {error}"[:300]}
    return found


def apart(name: str, cell: Cell) -> Figures:
    """Measures a cell in a process of its own."""
    words = [sys.executable, "-m", "benchmarks.bench", name, "--one", json.dumps(asdict(cell))]
    try:
        ended = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return {"failed": f"no end after {LONGEST:g} s"}
    if ended.returncode:
        last = (ended.stderr.strip().splitlines() or ["no word"])[-1]
        return {"failed": f"exit code {ended.returncode}: {last[:200]}"}
    found: Figures = json.loads(ended.stdout.splitlines()[-1])
    return found


def page(folders: Sequence[Path], target: Path = RESULTS) -> None:
    """Writes the section of each table from the first folder that has lines of it, and the parts made of them all.

    What is cited of other tables, and where they are behind, stays as it stands on the page.
    """
    found: dict[str, tuple[Any, Lines, bool]] = {}
    for name in TABLES:
        for folder in folders:
            if name not in found and (lines := Lines(folder / f"{name}.jsonl")).found:
                found[name] = load(name), lines, folder == QUICK
    some = any(quick for _, _, quick in found.values())
    put("machine", HOW.format(machine=machine(), versions=versions(), sample=SAMPLE if some else ""), target)
    for name, (module, lines, quick) in found.items():
        command = f"make bench-{name}" + (" QUICK=1" if quick else "")
        picture = DRAWN[name](lines) if name in DRAWN else ""
        parts = (f"## {module.TITLE}", measured(lines, command), module.text(lines), picture, failures(lines))
        put(name, "\n\n".join(filter(None, parts)), target)
    old = [line for line in section("behind", target).splitlines() if line.startswith("* ")]
    told = {name: [line for line in old if line.startswith(f"* {name}: ")] for name in TABLES}
    told |= {
        name: [f"* {name}: {words}" for words in module.behind(lines)] for name, (module, lines, _) in found.items()
    }
    put("behind", "## Behind\n\n" + "\n".join(line for lines in told.values() for line in lines), target)
    rows = ROW.findall(section("cited", target))
    kept = {key: words for key, *words in rows if key.partition(".")[0] not in found}
    for module, lines, _ in found.values():
        kept |= {key: list(words) for key, words in module.cited(lines).items()}
    head = ("key", "figure", "what it is")
    figures = markdown(head, ([f"`{key}`", *kept[key]] for key in sorted(kept)))
    put("cited", f"## Figures that are cited\n\n{figures}", target)


def main() -> None:
    """Reads the arguments; measures tables, or writes the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="+", choices=(*TABLES, "all", "page"), metavar="TABLE")
    parser.add_argument("--quick", action="store_true", help="the smaller sample")
    parser.add_argument("--lines", type=Path, help=f"folder of what was measured (default: {WHOLE}, or {QUICK})")
    parser.add_argument("--fresh", action="store_true", help="measure all anew")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(one(load(given.tables[0]), Cell(**json.loads(given.one)))))
        return
    begun = time.perf_counter()
    folders = (given.lines,) if given.lines else (QUICK, WHOLE) if given.quick else (WHOLE, QUICK)
    for name in TABLES if "all" in given.tables else given.tables:
        if name != "page":
            measure(name, given.quick, folders[0], given.fresh)
    page(folders)
    print(f"{RESULTS}: written after {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
