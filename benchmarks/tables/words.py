"""Words of the page: tables in Markdown, medians with their spread, ratios of cells that belong together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from benchmarks.lines import Cell, Figures, Lines

NOTHING = "-"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a pipe in a cell would end it."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "/") for cell in line) + " |" for line in lines)


def done(lines: Lines, **wanted: Any) -> list[Figures]:
    """Figures of cells that have not failed."""
    return [one for one in lines.of(**wanted) if "failed" not in one]


def failures(lines: Lines) -> str:
    """A sentence on what failed; empty where nothing did."""
    words = [
        f"{cell.tool}, {', '.join(filter(None, (cell.subject, cell.setting)))}, {cell.repeat}: {one['failed']}"
        for cell, one in lines.items()
        if "failed" in one
    ]
    return "" if not words else "Not done: " + "; ".join(words[:8]) + ("; .." if len(words) > 8 else "") + "."


def median(values: Sequence[float], digits: str = ".3g") -> str:
    """A median as it is printed."""
    return format(float(np.median(values)), digits) if len(values) else NOTHING


def spread(values: Sequence[float], digits: str = ".3g") -> str:
    """Median, least and largest."""
    if not len(values):
        return NOTHING
    low, high = (format(float(side), digits) for side in (np.min(values), np.max(values)))
    middle = median(values, digits)
    return middle if low == high else f"{middle} ({low} to {high})"


def percent(values: Sequence[float]) -> str:
    """Median and largest excess in percent; what is below rounding is none."""
    if not len(values):
        return NOTHING
    shown = [0.0 if value <= 1e-9 else 100.0 * value for value in (float(np.median(values)), float(np.max(values)))]
    return "none" if not any(shown) else f"{shown[0]:.2g} %, up to {shown[1]:.2g} %"


def ratios(lines: Lines, name: str, one: dict[str, Any], other: dict[str, Any]) -> list[float]:
    """A figure of one tool over that of another, of the same repeat."""
    theirs = {cell.repeat: figures for cell, figures in lines.items(**other) if "failed" not in figures}
    return [
        figures[name] / theirs[cell.repeat][name]
        for cell, figures in lines.items(**one)
        if "failed" not in figures and cell.repeat in theirs
    ]


def measured(lines: Lines, command: str) -> str:
    """When, by what command, how busy the machine was."""
    figures = list(lines.found.values())
    if not figures:
        return f"`{command}`. **Nothing is measured yet.**"
    stamps = [datetime.fromtimestamp(one["at"], UTC).strftime("%Y-%m-%d %H:%M") for one in (
        min(figures, key=lambda f: f["at"]), max(figures, key=lambda f: f["at"])
    )]  # fmt: skip
    busy = max(one["load"] for one in figures)
    commits = ", ".join(dict.fromkeys(one.get("commit", "unknown") for one in figures))
    when = f"{stamps[0]} to {stamps[1]} UTC, commit {commits}"
    return f"`{command}`: {len(figures)} measurements, {when}, load up to {busy:.1f}."


def subjects(lines: Lines, **wanted: Any) -> list[str]:
    """In the order they were measured."""
    return list(dict.fromkeys(cell.subject for cell, _ in lines.items(**wanted)))


def cells_of(found: Iterable[tuple[Cell, Figures]], name: str) -> list[float]:
    """One figure of those that have it."""
    return [float(figures[name]) for _, figures in found if name in figures]
