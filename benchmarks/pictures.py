"""Pictures of the page: fronts of all tools after equal time, and cost against size."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks import methods
from benchmarks.lines import Lines
from benchmarks.tables import fronts, sizes

FOLDER = Path(__file__).resolve().parent
PROBLEM, TIME = "hybrid-spline", "3 s"  # of the fronts that are drawn


def draw_fronts(lines: Lines) -> str:
    """Proved points of the first seed of each tool on one problem; Markdown that shows it, empty without any."""
    kept = {}
    for tool in (fronts.OURS, *fronts.PEERS):
        setting = fronts.best_setting(lines, PROBLEM, tool, TIME)
        for cell, one in lines.items(tool=tool, subject=PROBLEM, setting=setting, repeat=0):
            if one.get("values"):
                kept[f"{cell.tool}: {one['proved']} of {one['points']} proved"] = np.array(one["values"])
    if not kept:
        return ""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for marker, (name, values) in zip("o^sDvP", kept.items(), strict=False):
        axes.plot(*values[np.argsort(values[:, 0])].T, marker, markersize=4, label=name)
    axes.set(xlabel=methods.ROWS[PROBLEM].objectives[0], ylabel=methods.ROWS[PROBLEM].objectives[1])
    axes.set_title(f"{PROBLEM} after {TIME}: proved points")
    axes.legend()
    figure.savefig(FOLDER / "fronts.png", dpi=110, metadata={"Software": None})
    return f"![Proved points of {PROBLEM} after {TIME}](fronts.png)"


def draw_sizes(lines: Lines) -> str:
    """Seconds against size; Markdown that shows it, empty where nothing has two sizes."""
    by = {axis: {size: one["cpu"] for size, one in sizes.by_size(lines, axis).items() if size} for axis in sizes.AXES}
    by = {axis: points for axis, points in by.items() if len(points) > 1}
    if not by:
        return ""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for axis, points in by.items():
        axes.loglog(list(points), list(points.values()), "o-", markersize=4, label=axis)
    axes.set(xlabel="how many", ylabel="seconds", title="Cost against size")
    axes.legend()
    figure.savefig(FOLDER / "sizes.png", dpi=110, metadata={"Software": None})
    return "![Seconds against size](sizes.png)"


DRAWN = {"fronts": draw_fronts, "sizes": draw_sizes}
