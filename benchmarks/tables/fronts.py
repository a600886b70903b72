"""Fronts after equal time: ours beside the evolution of pymoo and of pygmo, evaluated alike and audited alike.

The peers evaluate whole generations by our own tapes, the quickest evaluation there is here; what is feasible at its
instants counts for the column *as found*, what is proved for the other. Boxes and problems are those of
``benchmarks.methods``, whose cell is ours.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from importlib.util import find_spec
from typing import Any

import moocore
import numpy as np

from benchmarks import methods
from benchmarks.judge import judged_point
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.peers import pymoo_fronts
from benchmarks.tables.words import done, median, spread, subjects, table
from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.formulation.problem import Problem
from ocp_traj.results.indicators import hypervolume_so_far
from ocp_traj.results.trajectory import audit_points
from ocp_traj.transcription.symbolic import evaluate_objectives

TITLE = "Fronts after equal time, beside pymoo and pygmo"
APART = True  # its clocks are the process's
OURS = "ours, traced"
BY_PYGMO = ("pygmo NSGA-II", "pygmo MOEA/D")  # of the peer, which cannot be imported where pygmo is missing
PEERS = (*pymoo_fronts.METHODS, *BY_PYGMO)
SIZES = pymoo_fronts.SIZES
PER_SEGMENT = 5  # instants at which peers look at limits: our choice, more where curves are of high degree
WEIGHT = 1e3  # of the penalty for those that take no constraints, in objectives' scales: our choice
SCANNED = 3  # of a front, its ends and its middle


TEXT = """Hypervolumes are shares of one box a problem (its corners are in `benchmarks/methods.py`), after equal
seconds of the processor: *proved* counts points that the audit proves, *as found* all that are feasible at the
instants a tool looks at. IGD+ is to the best of all points of all tools, in shares of the box; of proved points.
Medians over seeds, least and largest. MOEA/D of pymoo, and pygmo's, take no constraints: they get penalties.
Objectives are scaled by the box. Each peer at the best of the populations below; ours has no setting. The scan of the
ends and the middle of each front of a paper's problem contradicts {wrong} of the proofs.

{rows}

All that was tried:

{tried}

What it means: a front that is traced by local solves, each from its neighbours, ends proved; what evolution finds
is feasible where it looks and often broken between, which can make it look larger than any front there is. Peers
are ahead where they fill a front with more points in a short time, or where a trace follows one of many local
optima; and they need no derivatives."""


class InBox(PymooProblem):
    """Objectives in shares of the row's box: decompositions weigh them against each other."""

    def __init__(self, problem: Problem, row: methods.Row, handling: str) -> None:
        super().__init__(problem, row.objectives, PER_SEGMENT, handling, WEIGHT)
        self.box = np.array(row.ideal) * self.signs, np.array(row.reference) * self.signs

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        super()._evaluate(x, out, *args, **kwargs)
        low, high = self.box
        out["F"] = (out["F"] - low) / (high - low)


def cells(quick: bool) -> Iterator[Cell]:
    """Six problems, 3 s and 30 s, five seeds, other sizes for 3 s; when quick one problem, 3 s, one seed."""
    problems = ("hybrid-spline",) if quick else tuple(methods.ROWS)
    for seconds in (3,) if quick else (3, 30):
        for seed in range(1 if quick else 5):
            for problem in problems:
                yield Cell(OURS, problem, f"{seconds} s", seed)
                for tool in PEERS:
                    for size in SIZES[:1] if quick or seconds > 3 else SIZES:
                        yield Cell(tool, problem, f"{seconds} s, {size}", seed)


def measure(cell: Cell) -> Figures:
    """A front by one tool; seconds are of the processor."""
    seconds, _, size = cell.setting.partition(" s")
    row = methods.ROWS[cell.subject]
    if cell.tool == OURS:
        found = methods.Cell("front", cell.subject, "trace", float(seconds), cell.repeat, cpu=True).measure()
        if "refused" in found:
            return {"failed": found["refused"]}
        return {
            "cpu": found["spent"], "as found": found["hypervolume"], "hypervolume": found["hypervolume"],
            "points": found["points"], "proved": found["points"], "values": found["values"],
        }  # fmt: skip
    if cell.tool in BY_PYGMO and find_spec("pygmo") is None:
        return {"failed": "pygmo is not installed"}
    time.perf_counter = time.time = time.process_time  # type: ignore[assignment]  # clocks of all tools
    problem = row.load()
    choices = list((problem.alternatives or {"": problem}).values())
    begun, found = time.process_time(), []
    for choice in choices:
        found.append(evolve(choice, row, cell, int(size.removeprefix(", ")), float(seconds) / len(choices)))
    spent = time.process_time() - begun
    return {"cpu": spent, **counted(row, choices, found)}


def evolve(problem: Problem, row: methods.Row, cell: Cell, size: int, seconds: float) -> Array:
    """Decision vectors ``(M, n)`` that a peer ends with, feasible at its instants."""
    begun = time.process_time()  # compiling what evaluates is part of it
    plain = cell.tool not in pymoo_fronts.METHODS or not pymoo_fronts.CONSTRAINED[cell.tool]
    handling = "penalty" if plain else "feasibility"
    target = InBox(problem, row, handling)
    left = seconds - (time.process_time() - begun)
    if cell.tool in BY_PYGMO:
        from benchmarks.peers import pygmo_fronts

        posed = pygmo_fronts.Penalised(lambda x: target.evaluate(x, return_values_of=["F"]), 2, target.xl, target.xu)
        found, _ = pygmo_fronts.front(posed, cell.tool, size - size % 4, left, cell.repeat + 1)
    else:
        found, _ = pymoo_fronts.front(target, cell.tool, size, left, cell.repeat)
    if not len(found):
        return found
    met = np.ravel(target.evaluate(found, return_values_of=["excess"])) <= 0.0
    return target.meant(found[met])


def counted(row: methods.Row, choices: list[Problem], found: list[Array]) -> Figures:
    """Hypervolumes as found and of what is proved, the proved values, and what the scan of some says."""
    values, proved, scans = [], [], []
    for problem, xs in zip(choices, found, strict=True):
        audits = [audit.proved for _, audit in audit_points(problem, list(xs))]
        values += [[evaluate_objectives(problem, x)[name] for name in row.objectives] for x in xs]
        proved += audits
        chosen = sorted({0, len(xs) // 2, len(xs) - 1}) if len(xs) and row.id != "task" else []
        scans += [(audits[k], judged_point(problem, xs[k])["excess"]) for k in chosen[:SCANNED]]
    every, sure = np.array(values).reshape(-1, len(row.objectives)), np.array(proved, dtype=bool)
    kept = every[sure]
    return {
        "as found": hypervolume(row, every), "points": len(every), "proved": int(sure.sum()),
        "hypervolume": hypervolume(row, kept),
        "values": kept[moocore.is_nondominated(shares(row, kept))].tolist() if len(kept) else [],
        "excess": max((excess for _, excess in scans), default=0.0),
        "contradictions": sum(ok and excess > 1e-9 for ok, excess in scans),
    }  # fmt: skip


def shares(row: methods.Row, values: Array) -> Array:
    """Objectives ``(N, m)`` in shares of the row's box: 0 at the ideal, 1 at the reference."""
    ideal, reference = np.array(row.ideal), np.array(row.reference)
    return (np.reshape(values, (-1, len(ideal))) - ideal) / (reference - ideal)


def hypervolume(row: methods.Row, values: Array) -> float:
    """Share of the row's box that values ``(N, m)`` dominate."""
    return hypervolume_so_far(shares(row, values), np.ones(len(row.ideal)), np.zeros(len(row.ideal))) or 0.0


def igd_plus(lines: Lines, problem: str) -> dict[Cell, float]:
    """IGD+ of every front of a problem to the best of all that was ever found of it, in shares of the box."""
    row = methods.ROWS[problem]
    fronts = {cell: shares(row, np.array(one["values"])) for cell, one in lines.items(subject=problem)
              if "failed" not in one}  # fmt: skip
    together = np.concatenate([np.empty((0, 2)), *fronts.values()])
    if not len(together):
        return {}
    best = together[moocore.is_nondominated(together)]
    return {cell: float(moocore.igd_plus(costs, ref=best)) for cell, costs in fronts.items() if len(costs)}


def _row(lines: Lines, problem: str, tool: str, setting: str, distance: dict[Cell, float]) -> list[str]:
    some = done(lines, subject=problem, tool=tool, setting=setting)
    far = [value for cell, value in distance.items() if (cell.tool, cell.setting) == (tool, setting)]
    proved, points = (sum(one[name] for one in some) for name in ("proved", "points"))
    return [
        problem, setting.partition(",")[0], tool, str(len(some)), spread([one["hypervolume"] for one in some], ".4f"),
        spread([one["as found"] for one in some], ".4f"), median(far, ".2g") if len(far) == len(some) else "no point",
        f"{proved} of {points}", median([one["cpu"] for one in some], ".1f"),
    ]  # fmt: skip


def best_setting(lines: Lines, problem: str, tool: str, seconds: str) -> str | None:
    """The setting of a tool with the largest median hypervolume as found, in its favour."""
    found = {cell.setting for cell, one in lines.items(subject=problem, tool=tool) if "failed" not in one}
    named = [setting for setting in found if setting.partition(",")[0] == seconds]
    return max(
        named, default=None,
        key=lambda s: float(np.median([o["as found"] for o in done(lines, subject=problem, tool=tool, setting=s)])),
    )  # fmt: skip


def text(lines: Lines) -> str:
    """The section."""
    rows, tried = [], []
    times = list(dict.fromkeys(cell.setting.partition(",")[0] for cell in lines.found))
    for problem in subjects(lines):
        distance = igd_plus(lines, problem)
        for seconds in times:
            for tool in (OURS, *PEERS):
                if (setting := best_setting(lines, problem, tool, seconds)) is not None:
                    rows.append(_row(lines, problem, tool, setting, distance))
        for tool in PEERS:
            for cell in dict.fromkeys((c.tool, c.setting) for c, _ in lines.items(subject=problem, tool=tool)):
                some = done(lines, subject=problem, tool=tool, setting=cell[1])
                tried.append([problem, *cell, str(len(some)), spread([o["as found"] for o in some], ".4f")])
    wrong = sum(one.get("contradictions", 0) for one in done(lines))
    head = (
        "problem", "time", "tool", "seeds", "hypervolume, proved", "hypervolume, as found", "IGD+", "points proved",
        "seconds, all in",
    )  # fmt: skip
    all_tried = table(("problem", "tool", "time, population", "seeds", "hypervolume, as found"), tried)
    return TEXT.format(rows=table(head, rows), tried=all_tried, wrong=wrong or "none")


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    found = {}
    for problem in subjects(lines):
        ours = done(lines, subject=problem, tool=OURS, setting="3 s")
        if ours:
            key = problem.replace(" ", "-")
            what = f"hypervolume of `{problem}` after 3 s, proved, median"
            found[f"fronts.{key}"] = (median([one["hypervolume"] for one in ours], ".3f"), what)
    return found


def behind(lines: Lines) -> list[str]:
    """Problems and times at which a peer's front, as it found it, is larger than ours."""
    words = []
    for problem in subjects(lines):
        distance = igd_plus(lines, problem)
        for seconds in dict.fromkeys(cell.setting.partition(",")[0] for cell in lines.found):
            ours = done(lines, subject=problem, tool=OURS, setting=seconds)
            if not ours:
                continue
            own = float(np.median([one["hypervolume"] for one in ours]))
            for tool in PEERS:
                setting = best_setting(lines, problem, tool, seconds)
                some = done(lines, subject=problem, tool=tool, setting=setting) if setting else []
                theirs = float(np.median([one["as found"] for one in some])) if some else 0.0
                far = [
                    [value for cell, value in distance.items() if (cell.tool, cell.setting) == one]
                    for one in ((OURS, seconds), (tool, setting))
                ]
                if all(far) and len(far[1]) == len(some) and np.median(far[1]) < np.median(far[0]):
                    words.append(
                        f"`{problem}`, {seconds}: IGD+ of {tool} ({setting}) is {median(far[1], '.2g')}, ours "
                        f"{median(far[0], '.2g')}: more points, each a little worse."
                    )
                if theirs > own + 5e-5:
                    proved = float(np.median([one["hypervolume"] for one in some]))
                    words.append(
                        f"`{problem}`, {seconds}: {tool} ({setting}) reaches a hypervolume of {theirs:.4f} as found, "
                        f"{proved:.4f} of it proved, ours {own:.4f}."
                    )
    return words
