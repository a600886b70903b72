"""A front of four objectives: traced for so many seconds, beside NSGA-II and NSGA-III with ten times as many.

    python -m benchmarks.four_objectives [--output runs/four_objectives.jsonl] [--tools ours,NSGA-II,NSGA-III]
                                         [--seeds 0,1,2] [--page]

Seconds are of the processor. What was measured is kept, a line of JSON each, and a run that was stopped goes on. The
peers are judged in their favour by all that they found feasible at their instants, and by what is proved of it.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import ocp_traj as ot
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.methods import UNBOUNDED, Row
from benchmarks.sections import put
from benchmarks.tables.fronts import counted, evolve, hypervolume
from benchmarks.tables.words import done, spread, table

ROW = Row(
    "hybrid-spline", ("time", "energy", "jerk", "acceleration"), (2.4836, 1573.6, 0.0, 0.0), (8.0, 6000.0, 100.0, 3.0),
    2.4836242,
)  # fmt: skip
OURS = "ours"
SECONDS, TIMES = 60, 10
SIZES = (500, 200)  # of the peers' populations: as many points as ours ends with, and the better of those at 60 s


def cells(tools: list[str], seeds: list[int]) -> list[Cell]:
    """Ours for 60 s, each peer for ten times that; with the first seed its smaller population, and equal time, too."""
    found = []
    for seed in seeds:
        for tool in tools:
            if tool == OURS:
                found.append(Cell(OURS, ROW.id, f"{SECONDS} s", seed))
                continue
            found.append(Cell(tool, ROW.id, f"{SECONDS * TIMES} s, {SIZES[0]}", seed))
            if seed == seeds[0]:
                found += [
                    Cell(tool, ROW.id, f"{seconds} s, {SIZES[1]}", seed) for seconds in (SECONDS * TIMES, SECONDS)
                ]
    return found


def measured(cell: Cell) -> Figures:
    """A front by one tool."""
    problem, seconds = ROW.load(), float(cell.setting.partition(" ")[0])
    begun = time.process_time()
    if cell.tool == OURS:
        front = ot.pareto(problem, ROW.objectives, method="trace", points=UNBOUNDED, seed=cell.repeat, budget=seconds)
        share = hypervolume(ROW, front.values)
        figures: Figures = {"as found": share, "hypervolume": share, "points": len(front), "proved": len(front)}
    else:
        found = evolve(problem, ROW, cell, int(cell.setting.rpartition(" ")[2]), seconds)
        figures = counted(ROW, [problem], [found])
    return {"cpu": time.process_time() - begun, **figures}


def text(lines: Lines) -> str:
    """The section of RESULTS.md."""
    rows = []
    for tool, setting in dict.fromkeys((cell.tool, cell.setting) for cell in lines.found):
        some = done(lines, tool=tool, setting=setting)
        shares = [spread([one[key] for one in some], ".4f") for key in ("hypervolume", "as found")]
        proved, points = (sum(one[key] for one in some) for key in ("proved", "points"))
        rows.append([tool, setting, str(len(some)), *shares, f"{proved} of {points}"])
    head = ("tool", "time, population", "seeds", "hypervolume, proved", "hypervolume, as found", "points proved")
    box = ", ".join(
        f"{name} {low:g} to {high:g}" for name, low, high in zip(ROW.objectives, ROW.ideal, ROW.reference, strict=True)
    )
    return (
        f"## Four objectives\n\n`python -m benchmarks.four_objectives --page`: `{ROW.id}`, {box}; hypervolumes are "
        "shares of that box, medians over seeds, least and largest. Seconds are of the processor, building and proof "
        f"inside for ours; the proof of the peers' points is not counted.\n\n{table(head, rows)}"
    )


def main() -> None:
    """Measures what is missing; writes the section if asked to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--output", type=Path, default=Path("runs/four_objectives.jsonl"), help="what was measured")
    parser.add_argument("--tools", default="ours,NSGA-II,NSGA-III")
    parser.add_argument("--seeds", default="0,1,2")
    parser.add_argument("--page", action="store_true", help="put what was measured on the page of results")
    asked = parser.parse_args()
    lines = Lines(asked.output)
    time.perf_counter = time.time = time.process_time  # type: ignore[assignment]  # clocks of all tools
    for cell in cells(asked.tools.split(","), [int(seed) for seed in asked.seeds.split(",")]):
        if cell not in lines.found:
            lines.add(cell, measured(cell))
            print(cell, lines.found[cell], flush=True)
    if asked.page:
        put("four objectives", text(lines))


if __name__ == "__main__":
    main()
