"""Pictures of a front and of trajectories against their limits, as PNG, PDF or SVG."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.io.plot_certificate import shade
from ocp_traj.io.plot_style import (
    BLACK,
    COLOURS,
    DASHES,
    GREEN,
    KNOT,
    LIMIT,
    LINE,
    MARKERS,
    ORANGE,
    PURPLE,
    far_bounds,
    labelled,
    number,
    save_figure,
    styled,
)
from ocp_traj.proof.values import limit_along
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, VIOLATED
from ocp_traj.results.front import Front
from ocp_traj.results.trajectory import Trajectory

VERDICTS = {PROVED: ("o", LINE), UNDECIDED: ("D", ORANGE), VIOLATED: ("X", LIMIT)}  # marker, colour
COLUMNS = 6  # axes in a row of a trajectory's picture, at most: our choice
NEAR = 1.0  # a bound is drawn where it lies within this many ranges of the data, ...
CLOSE = 0.1  # ... or this share of the limit's scale: our choice, so that one that matters is always drawn
PER_SEGMENT = 60  # samples of a curve: our choice
MOST = len(COLOURS) * len(DASHES)  # trajectories that a picture tells apart


@styled
def plot_front(front: Front, path: str | Path) -> Path:
    """Draws the traded objectives against each other: one plot for two, a grid of all pairs for more.

    The front's knee and ideal are marked, and so is every published point in ``front.info["paper"]``, a mapping
    ``{label: {objective: value}}`` in the objectives' units. Where the front has a certificate, what lies between its
    staircases is shaded.
    """
    count = len(front.objectives) - 1
    size = (7.0, 4.8) if count == 1 else (3.1 * count + 0.6, 2.7 * count + 0.9)
    figure = Figure(figsize=size)
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
    figure.suptitle(_headline(front))
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if count == 1:
        grid[0, 0].legend(handles, labels)
    else:
        grid[0, -1].legend(handles, labels, loc="center", frameon=False)
    return save_figure(figure, path)


def plot_trajectory(trajectory: Trajectory, requirements: Requirements, path: str | Path) -> Path:
    """Draws every path limit over time, an axis a label, with its bounds and the knots.

    A bound far from the values is written above the axis, so that the values keep their scale.
    """
    return plot_trajectories({"": trajectory}, requirements, path)


@styled
def plot_trajectories(motions: Mapping[str, Trajectory], requirements: Requirements, path: str | Path) -> Path:
    """Draws trajectories over each other, each a colour of its own, see ``plot_trajectory``; knots of a lone one.

    Args:
        motions: by the name of the legend, at most ``MOST``, of the same joints.
        requirements: of all of them.
        path: of the picture (PNG, PDF or SVG).
    """
    limits = requirements.path_constraints
    if not limits:
        raise InputError("there is nothing to draw: the requirements have no path limits")
    if len(motions) > MOST:
        raise InputError(f"a picture tells {MOST} trajectories apart; got {len(motions)}")
    columns = min(max(len(limit.labels) for limit in limits), COLUMNS)
    rows: list[list[tuple[PathConstraint, int]]] = []
    for limit in limits:
        entries = [(limit, index) for index in range(len(limit.labels))]
        rows += [entries[start : start + columns] for start in range(0, len(entries), columns)]
    figure = Figure(figsize=(max(2.3 * columns, 5.0) + 0.5, 1.45 * len(rows) + 1.1))
    grid: Any = figure.subplots(len(rows), columns, squeeze=False, sharex=True)
    curves = {
        limit.id: [limit_along(moved, requirements, limit, PER_SEGMENT) for moved in motions.values()]
        for limit in limits
    }
    for r, entries in enumerate(rows):
        for c, axes in enumerate(grid[r]):
            if c >= len(entries):
                axes.set_axis_off()
                continue
            limit, index = entries[c]
            limit_panel(axes, [(t, values[index]) for t, values in curves[limit.id]], limit, index)
            if len(motions) == 1:
                _knots(axes, next(iter(motions.values())))
            if c == 0:
                axes.set_ylabel(limit.id, fontweight="bold")
            if r == len(rows) - 1 or c >= len(rows[r + 1]):
                axes.set_xlabel("time [s]")
                axes.tick_params(labelbottom=True)
    figure.align_ylabels(grid[:, 0])
    _key(figure, motions)
    return save_figure(figure, path)


def _key(figure: Figure, motions: Mapping[str, Trajectory]) -> None:
    """Legend and headline of a picture of trajectories."""
    limit = Line2D([], [], color=LIMIT, linestyle="--", linewidth=1.1, label="limit (written above where far away)")
    lines = [Line2D([], [], **line_style(i), label=name or "value") for i, name in enumerate(motions)]
    knots = [Line2D([], [], color="0.7", linewidth=0.8, label="knot")] if len(motions) == 1 else []
    handles = [*lines, limit, *knots]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 4), frameon=False)
    first = next(iter(motions.values()))
    whole = first.problem or "trajectory"
    if len(motions) == 1:
        whole += f", {first.duration:.4g} s"
        given = ", ".join(f"{name} {value:g}" for name, value in first.parameters.items())
        whole += f"; {given}" if given else ""
    figure.suptitle(whole)


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of a line, the first solid; vermillion is left to limits."""
    free = [colour for colour in COLOURS if colour != LIMIT]
    return {"color": free[index % len(free)], "linestyle": DASHES[(index // len(free) + index) % len(DASHES)]}


def _knots(axes: Axes, trajectory: Trajectory) -> None:
    everywhere = axes.get_xaxis_transform()  # from the bottom of the axes to the top
    style: dict[str, Any] = {"transform": everywhere, "color": KNOT, "linewidth": 0.6, "zorder": 0, "label": "knots"}
    axes.vlines(trajectory.curve.knots, 0.0, 1.0, **style)


def _pair(axes: Axes, front: Front, first: str, second: str, published: Mapping[str, Mapping[str, float]]) -> None:
    for verdict, (marker, colour) in VERDICTS.items():
        found = [p.objectives for p in front.points if p.verdict == verdict]
        if found:
            x, y = ([values[name] for values in found] for name in (first, second))
            words = f"{verdict} ({len(found)})"
            axes.scatter(x, y, s=22, marker=marker, color=colour, linewidths=0, label=words, zorder=3)
    if front.points:
        knee = front.points[front.knee()].objectives
        x, y = [knee[first]], [knee[second]]
        axes.scatter(x, y, s=110, facecolors="none", edgecolors=GREEN, linewidths=1.8, label="knee", zorder=4)
        ideal = front.ideal
        axes.scatter([ideal[first]], [ideal[second]], marker="+", s=90, color="0.35", label="ideal", zorder=2)
    else:
        axes.text(0.5, 0.5, "no proved point", transform=axes.transAxes, ha="center", va="center", color=LIMIT)
    for index, (label, values) in enumerate(published.items()):
        if first in values and second in values:
            marker = MARKERS[1:][index % (len(MARKERS) - 1)]  # the round one is ours
            place, words = ([values[first]], [values[second]]), f"paper: {label}"
            axes.scatter(*place, marker=marker, s=40, color=PURPLE, edgecolors=BLACK, linewidths=0.6, label=words)


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
    return labelled(name, objective.unit) + (", more is better" if objective.sense == "max" else "")


def limit_panel(axes: Axes, curves: Sequence[tuple[Array, Array]], limit: PathConstraint, index: int) -> None:
    """One row of a limit over time, a line a trajectory, with the limit's bounds.

    Args:
        axes: to draw on.
        curves: times ``(N,)`` [s] and values ``(N,)`` of the row, a pair a trajectory.
        limit: whose row it is.
        index: of the row.
    """
    low = min(float(np.nanmin(values)) for _, values in curves)
    high = max(float(np.nanmax(values)) for _, values in curves)
    room = max(high - low, 1e-3 * float(limit.scale[index]))  # a constant is drawn as one, not its rounding
    for i, (times, values) in enumerate(curves):
        axes.plot(times, values, **line_style(i))
    lower, upper = float(limit.lower[index]), float(limit.upper[index])
    bounds(axes, low, high, lower, upper, room, float(limit.scale[index]))
    for times, values in curves:
        broken = np.where((values > upper) | (values < lower), values, np.nan)
        if np.isfinite(broken).any():
            axes.plot(times, broken, color=LIMIT, linewidth=2.4)
    axes.set_title(labelled(limit.labels[index], limit.units[index]), loc="left", pad=3)


def bounds(axes: Axes, low: float, high: float, lower: float, upper: float, room: float, scale: float) -> None:
    """Draws bounds near values from ``low`` to ``high``, and writes those that are far above the axes.

    Args:
        axes: whose vertical range is set.
        low: least value that is drawn.
        high: largest value that is drawn.
        lower: bound of the values, may be infinite.
        upper: bound of the values, may be infinite.
        room: height that the values take.
        scale: of the values; a bound within ``CLOSE`` of it is near.
    """
    shown, far = [low, high], []
    near = max(NEAR * room, CLOSE * scale)
    for bound, words in ((lower, "≥"), (upper, "≤")):
        if not np.isfinite(bound):
            continue
        if low - near <= bound <= high + near:
            axes.axhline(bound, color=LIMIT, linestyle="--", linewidth=1.1)
            shown.append(bound)
        else:
            far.append(f"{words} {number(bound)}")
    if len(far) == 2:
        far = [f"±{number(upper)}" if lower == -upper else f"{number(lower)} to {number(upper)}"]
    pad = 0.08 * max(max(shown) - min(shown), room)
    axes.set_ylim(min(shown) - pad, max(shown) + pad)
    axes.margins(x=0.02)
    if far:
        far_bounds(axes, f"limit {far[0]}")
    axes.locator_params(axis="y", nbins=4)
