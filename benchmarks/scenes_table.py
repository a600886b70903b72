"""What came of the scenes, as a section of the page: what was run, counts, medians, failures, each problem."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.machine import machine, versions

KINDS = {"own": "own starts", "from ompl": "from OMPL's path"}
NUMBERS = ("number", "own s", "own time", "own least", "ompl s", "toppra", "unobstructed", "from ompl s",
           "from ompl time", "from ompl least")  # fmt: skip
NUMERAL = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")


def contradicted(rows: Sequence[dict[str, Any]]) -> tuple[int, int, float]:
    """Proofs, how many of them samples contradict, and the least clearance of all [m]."""
    least = np.array([row[f"{kind} least"] for row in rows for kind in KINDS if f"{kind} least" in row])
    return len(least), int((least < 0.0).sum()), float(least.min(initial=np.inf))


def section_of(rows: Sequence[dict[str, Any]], command: str, seconds: float, samples: int, all_of: int) -> str:
    """Markdown.

    Args:
        rows: one a problem, as ``benchmarks.scenes`` keeps them.
        command: that they were made with.
        seconds: of the processor within which a problem counts.
        samples: of each proved motion.
        all_of: problems there are.
    """
    columns = {*NUMBERS, "robot", "scene", "own", "ompl", "from ompl"}
    table = pd.DataFrame(rows).reindex(columns=sorted(columns | {c for row in rows for c in row}))
    table[list(NUMBERS)] = table[list(NUMBERS)].astype(float)
    proofs, wrong, least = contradicted(rows)
    lines = [
        "## Scenes", f"`{command}`",
        f"{machine()}; {versions(('casadi', 'pin', 'ompl', 'toppra', 'ruckig'))}.",
        f"{len(rows)} of {all_of} problems of MotionBenchMaker, of each robot and kind of scene as many as the run "
        "came to. Seconds are of the processor, building and proof inside, on a machine with other work. Durations "
        "are held against TOPP-RA on OMPL's simplified path, with limits on velocity and acceleration alone: those of "
        "this package keep a limit on jerk as well. *Unobstructed* is the least duration with nothing in the way, all "
        "limits kept (Ruckig): no motion is below it.",
        f"{proofs} proofs, {wrong} contradicted by {samples} samples a motion, by code of the benchmark; the least "
        f"clearance of all is {1e3 * least:.3g} mm.",
        "\n".join(_summary(table, seconds)),
        "\n".join(["Failures, by reason:", "", *_failures(table, seconds)]),
        "\n".join(_each(table)),
    ]  # fmt: skip
    return "\n\n".join(lines)


def _summary(table: pd.DataFrame, seconds: float) -> list[str]:
    lines = [
        f"| robot | start | tried | proved | within {seconds:g} s | seconds, median | duration / TOPP-RA, median "
        "| unobstructed / TOPP-RA, median | duration / unobstructed, median |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for robot, part in [*table.groupby("robot"), ("both", table)]:
        asked = part[part["ompl"].notna()]
        lines.append(
            f"| {robot} | OMPL's RRT-Connect alone | {len(asked)} | {int(asked['ompl'].eq(True).sum())} found | "
            f"| {_median(asked['ompl s'])} | | | |"
        )
        for kind, words in KINDS.items():
            tried, done = part[part[kind].notna()], part[part[kind].eq(True)]
            bound = done["unobstructed"]
            lines.append(
                f"| {robot} | {words} | {len(tried)} | {len(done)} | {int((done[f'{kind} s'] <= seconds).sum())} "
                f"| {_median(done[f'{kind} s'])} | {_median(done[f'{kind} time'] / done['toppra'])} "
                f"| {_median(bound / done['toppra'])} | {_median(done[f'{kind} time'] / bound)} |"
            )
    return lines


def _failures(table: pd.DataFrame, seconds: float) -> list[str]:
    found: Counter[str] = Counter()
    for kind, words in KINDS.items():
        if f"{kind} reason" in table:
            failed = table[table[kind].eq(False)][f"{kind} reason"].fillna("")
            found.update(f"{words}: {NUMERAL.sub('..', reason) or 'out of time'}" for reason in failed)
        late = int((table[table[kind].eq(True)][f"{kind} s"] > seconds).sum())
        found.update({f"{words}: proved, after {seconds:g} s": late} if late else {})
    if "refused" in table:
        found.update(f"refused: {NUMERAL.sub('..', reason)}" for reason in table["refused"].dropna())
    return [f"* {count} x {reason}" for reason, count in found.most_common()] or ["* none"]


def _each(table: pd.DataFrame) -> list[str]:
    lines = [
        "| problem | OMPL, s | TOPP-RA, s | unobstructed, s | own: s | own: duration | own: least, mm | from OMPL: s "
        "| from OMPL: duration | from OMPL: least, mm |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for _, row in table.sort_values(["robot", "scene", "number"]).iterrows():
        cells = [f"{row['scene']} {int(row['number'])}", _number(row["ompl s"], 1), _number(row["toppra"], 3)]
        cells[1] += " none" if row["ompl"] is False else ""
        cells.append(_number(row["unobstructed"], 3))
        for kind in KINDS:
            cells += [_number(row[f"{kind} s"], 1), _number(row[f"{kind} time"], 3)]
            cells.append(_number(1e3 * row[f"{kind} least"], 3))
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _median(values: pd.Series[float]) -> str:
    known = values.dropna()
    return f"{known.median():.3g} of {len(known)}" if len(known) else ""


def _number(value: float, digits: int) -> str:
    return "" if np.isnan(value) else f"{value:.{digits}f}"
