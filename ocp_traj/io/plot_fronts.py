"""Fronts of one problem in one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp_traj.formulation.problem import Problem
from ocp_traj.io.plot import quantity
from ocp_traj.io.plot_style import COLOURS, MARKERS, save_figure, styled
from ocp_traj.results.front_comparison import FrontComparison

SMALLEST, LARGER, MOST_SIZES = 14.0, 16.0, 4  # [points^2] of the last front's, more for each before it: our choice


@styled
def plot_fronts(compared: FrontComparison, problem: Problem, path: str | Path) -> Path:
    """Draws the proved points of compared fronts, two objectives against each other, a grid of all pairs for more.

    Args:
        compared: the fronts.
        problem: of all of them, for units.
        path: of the picture (PNG, PDF or SVG).
    """
    names = compared.objectives
    count = len(names) - 1
    size = (7.0, 4.8) if count == 1 else (3.1 * count + 0.6, 2.7 * count + 0.9)
    figure = Figure(figsize=size)
    grid: Any = figure.subplots(count, count, squeeze=False, sharex="col", sharey="row")
    for row in range(count):
        for column in range(count):
            if column > row:
                grid[row, column].set_axis_off()
                continue
            _pair(grid[row, column], compared, column, row + 1)
            if row == count - 1:
                grid[row, column].set_xlabel(quantity(problem, names[column]))
            if column == 0:
                grid[row, column].set_ylabel(quantity(problem, names[row + 1]))
    figure.suptitle(f"{problem.id}: {len(compared.points)} fronts, proved points")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    if count == 1:
        grid[0, 0].legend(handles, labels)
    else:
        grid[0, -1].legend(handles, labels, loc="center", frameon=False)
    return save_figure(figure, path)


def _pair(axes: Axes, compared: FrontComparison, first: int, second: int) -> None:
    for i, (name, points) in enumerate(compared.points.items()):
        later = min(len(compared.points) - 1 - i, MOST_SIZES)  # drawn over it: it shows around them
        volume, count = float(compared.table["hypervolume"][name]), len(points)
        axes.scatter(
            points[:, first],
            points[:, second],
            s=SMALLEST + LARGER * later,
            marker=MARKERS[i % len(MARKERS)],
            color=COLOURS[i % len(COLOURS)],
            linewidths=0,
            alpha=0.75,
            zorder=3,
            label=f"{name} ({count}), hypervolume {volume:.4f}",
        )
