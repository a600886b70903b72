"""Pictures of a front and of a trajectory against its limits, as PNG, PDF or SVG."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, quoted
from ocp_traj.files import write_with
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.io.plot_certificate import shade
from ocp_traj.proof.values import limit_along
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, VIOLATED
from ocp_traj.results.front import Front
from ocp_traj.results.histories import PART, by_part
from ocp_traj.results.trajectory import Trajectory

SUFFIXES = (".png", ".pdf", ".svg")
LINE, LIMIT, KNOT = "#1f4e79", "#c0392b", "0.85"
VERDICTS = {PROVED: ("o", LINE), UNDECIDED: ("D", "#e08e0b"), VIOLATED: ("X", LIMIT)}  # marker, colour
COLUMNS = 6  # axes in a row of a trajectory's picture, at most: our choice
NEAR = 1.0  # a bound is drawn where it lies within this many ranges of the data, ...
CLOSE = 0.1  # ... or this share of the limit's scale: our choice, so that one that matters is always drawn
PER_SEGMENT = 60  # samples of a curve: our choice
_EXPONENTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def plot_front(front: Front, path: str | Path) -> Path:
    """Draws the traded objectives against each other: one plot for two, a grid of all pairs for more.

    The front's knee and ideal are marked, and so is every published point in ``front.info["paper"]``, a mapping
    ``{label: {objective: value}}`` in the objectives' units. Where the front has a certificate, what lies between its
    staircases is shaded.
    """
    count = len(front.objectives) - 1
    size = (7.0, 4.8) if count == 1 else (3.1 * count + 0.6, 2.7 * count + 0.9)
    figure = Figure(figsize=size, layout="constrained")
    grid: Any = figure.subplots(count, count, squeeze=False, sharex="col", sharey="row")
    published = {label: values for label, values in front.info.get("paper", {}).items() if isinstance(values, Mapping)}
    for row in range(count):
        for column in range(count):
            if column > row:
                grid[row, column].set_axis_off()
                continue
            _pair(grid[row, column], front, front.objectives[column], front.objectives[row + 1], published)
            if row == count - 1:
                grid[row, column].set_xlabel(quantity(front.problem, front.objectives[column]))
            if column == 0:
                grid[row, column].set_ylabel(quantity(front.problem, front.objectives[row + 1]))
    if front.certificate is not None:
        shade(grid[0, 0], front.certificate, front.objectives[0])
    figure.suptitle(_headline(front), fontsize=10)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if count == 1:
        grid[0, 0].legend(handles, labels, fontsize=8)
    else:
        grid[0, -1].legend(handles, labels, fontsize=9, loc="center", frameon=False)
    return save_figure(figure, path)


def plot_trajectory(trajectory: Trajectory, requirements: Requirements, path: str | Path) -> Path:
    """Draws every path limit over time, an axis a label, with its bounds and the knots.

    A bound far from the values is written above the axis, so that the values keep their scale.
    """
    limits = requirements.path_constraints
    if not limits:
        raise InputError("there is nothing to draw: the requirements have no path limits")
    columns = min(max(len(limit.labels) for limit in limits), COLUMNS)
    rows: list[list[tuple[PathConstraint, int]]] = []
    for limit in limits:
        entries = [(limit, index) for index in range(len(limit.labels))]
        rows += [entries[start : start + columns] for start in range(0, len(entries), columns)]
    figure = Figure(figsize=(max(2.75 * columns, 5.0) + 0.5, 1.6 * len(rows) + 1.1), layout="constrained")
    grid: Any = figure.subplots(len(rows), columns, squeeze=False, sharex=True)
    curves = {limit.id: limit_along(trajectory, requirements, limit, PER_SEGMENT) for limit in limits}
    for r, entries in enumerate(rows):
        for c, axes in enumerate(grid[r]):
            if c >= len(entries):
                axes.set_axis_off()
                continue
            limit, index = entries[c]
            times, values = curves[limit.id]
            _limit(axes, times, values[index], limit, index)
            everywhere = axes.get_xaxis_transform()  # from the bottom of the axes to the top
            axes.vlines(
                trajectory.curve.knots,
                0.0,
                1.0,
                transform=everywhere,
                color=KNOT,
                linewidth=0.6,
                zorder=0,
                label="knots",
            )
            if c == 0:
                axes.set_ylabel(limit.id, fontsize=9, fontweight="bold")
            if r == len(rows) - 1 or c >= len(rows[r + 1]):
                axes.set_xlabel("time [s]", fontsize=8)
                axes.tick_params(labelbottom=True)
    figure.align_ylabels(grid[:, 0])
    figure.legend(
        handles=[
            Line2D([], [], color=LINE, linewidth=1.3, label="value"),
            Line2D([], [], color=LIMIT, linestyle="--", linewidth=1.1, label="limit (written above where far away)"),
            Line2D([], [], color="0.7", linewidth=0.8, label="knot"),
        ],
        loc="outside lower center",
        ncols=3,
        fontsize=8,
        frameon=False,
    )
    whole = f"{trajectory.problem or 'trajectory'}, {trajectory.duration:.4g} s"
    given = ", ".join(f"{name} {value:g}" for name, value in trajectory.parameters.items())
    figure.suptitle(f"{whole}; {given}" if given else whole, fontsize=11)
    return save_figure(figure, path)


def _pair(axes: Axes, front: Front, first: str, second: str, published: Mapping[str, Mapping[str, float]]) -> None:
    for verdict, (marker, colour) in VERDICTS.items():
        found = [p.objectives for p in front.points if p.verdict == verdict]
        if found:
            x, y = ([values[name] for values in found] for name in (first, second))
            axes.scatter(
                x, y, s=22, marker=marker, color=colour, linewidths=0, label=f"{verdict} ({len(found)})", zorder=3
            )
    if front.points:
        knee = front.points[front.knee()].objectives
        x, y = [knee[first]], [knee[second]]
        axes.scatter(x, y, s=110, facecolors="none", edgecolors="#1e8449", linewidths=1.8, label="knee", zorder=4)
        ideal = front.ideal
        axes.scatter([ideal[first]], [ideal[second]], marker="+", s=90, color="0.35", label="ideal", zorder=2)
    else:
        axes.text(0.5, 0.5, "no proved point", transform=axes.transAxes, ha="center", va="center", color=LIMIT)
    for index, (label, values) in enumerate(published.items()):
        if first in values and second in values:
            marker = "^sv<>p"[index % 6]
            axes.scatter(
                [values[first]], [values[second]], marker=marker, s=45, color="#7d3c98", label=f"paper: {label}"
            )
    axes.grid(True, color="0.92", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)


def _headline(front: Front) -> str:
    tally = Counter(point.verdict for point in front.points)
    if not front.points:
        verdict = "no proved point"
    elif set(tally) == {PROVED}:
        verdict = f"all proved, smallest margin {min(point.margin for point in front.points):.2g}"
    else:
        verdict = ", ".join(f"{count} {name}" for name, count in tally.items())
    noun = "point" if len(front) == 1 else "points"
    return f"{front.problem.id}, {front.method}: {len(front)} {noun}, {verdict}"


def quantity(problem: Problem, name: str) -> str:
    """An objective with its unit, for an axis."""
    objective = problem.objective(name)
    return f"{name} [{pretty(objective.unit)}]" + (", more is better" if objective.sense == "max" else "")


def _limit(axes: Axes, times: Array, values: Array, limit: PathConstraint, index: int) -> None:
    """One row of a limit over time."""
    low, high = float(values.min()), float(values.max())
    room = max(high - low, 1e-3 * float(limit.scale[index]))  # a constant is drawn as one, not its rounding
    axes.plot(times, values, color=LINE, linewidth=1.3)
    shown, far = [low, high], []
    near = max(NEAR * room, CLOSE * float(limit.scale[index]))
    lower, upper = float(limit.lower[index]), float(limit.upper[index])
    for bound, words in ((lower, "≥"), (upper, "≤")):
        if not np.isfinite(bound):
            continue
        if low - near <= bound <= high + near:
            axes.axhline(bound, color=LIMIT, linestyle="--", linewidth=1.1)
            shown.append(bound)
        else:
            far.append(f"{words} {_number(bound)}")
    if len(far) == 2:
        far = [f"±{_number(upper)}" if lower == -upper else f"{_number(lower)} to {_number(upper)}"]
    broken = np.where((values > upper) | (values < lower), values, np.nan)
    if np.isfinite(broken).any():
        axes.plot(times, broken, color=LIMIT, linewidth=2.4)
    pad = 0.08 * max(max(shown) - min(shown), room)
    axes.set_ylim(min(shown) - pad, max(shown) + pad)
    axes.margins(x=0.02)
    axes.set_title(f"{limit.labels[index]} [{pretty(limit.units[index])}]", loc="left", fontsize=8.5, pad=3)
    if far:
        axes.set_title(f"limit {far[0]}", loc="right", fontsize=7.5, color=LIMIT, pad=3)
    axes.tick_params(labelsize=7.5)
    axes.locator_params(axis="y", nbins=4)
    axes.spines[["top", "right"]].set_visible(False)


def pretty(unit: str) -> str:
    """A unit with its exponents raised: ``m/s2`` as ``m/s²``."""
    return unit.translate(_EXPONENTS)


def _number(value: float) -> str:
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


def check_picture(path: str | Path) -> str:
    """The picture format a file name asks for; ``InputError`` if there is none such. To be called before long work."""
    kind = Path(path).suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(
            f"a picture is written as {', '.join(SUFFIXES)}; {quoted(Path(path).name)} ends otherwise: change its "
            "suffix"
        )
    return kind


def plot_convergence(histories: Mapping[str, pd.DataFrame], path: str | Path, lower: float | None = None) -> Path:
    """Draws the best value of populations over their evaluations, one line a run.

    Args:
        histories: by name; see ``ocp_traj.evolution.evolution.Evolution``.
        path: of the picture.
        lower: a value that no solution is below, drawn as a line.
    """
    figure = Figure(figsize=(7.0, 4.8), layout="constrained")
    axes: Axes = figure.subplots()
    for name, history in histories.items():
        axes.step(history["evaluations"], history["best"], where="post", label=name, linewidth=1.2)
    if lower is not None:
        axes.axhline(lower, color=LIMIT, linewidth=1.0, linestyle="--", label="lower bound")
    axes.set_xlabel("evaluations")
    axes.set_ylabel("best feasible value")
    axes.legend(fontsize=8)
    return save_figure(figure, path)


def save_history(history: pd.DataFrame, path: str | Path) -> Path:
    """How a population converged, as a CSV table or a picture, by the suffix."""
    if Path(path).suffix.lower() == ".csv":
        return write_with(path, lambda temporary: history.to_csv(temporary, index=PART not in history))
    return plot_convergence(by_part(history), path)


def save_figure(figure: Figure, path: str | Path) -> Path:
    """Writes a figure in the format its file name asks for."""
    target, kind = Path(path), check_picture(path)
    return write_with(target, lambda temporary: figure.savefig(temporary, format=kind[1:], dpi=150))
