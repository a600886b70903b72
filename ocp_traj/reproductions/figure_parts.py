"""What the papers' figures are built of: joints over time, values over generations, ways in space; in the one style."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.io.plot import bounds, line_style
from ocp_traj.io.plot_style import BLACK, BLUE, DASHES, GREEN, LIMIT, PAPER, PURPLE, far_bounds, labelled, number

PER_SEGMENT = 60  # samples of a curve: our choice
PANEL = (2.35, 1.75)  # [in] of one of many axes
WIDE = (3.5, 2.9)  # [in] of one of a few axes
LETTERS = "abcdefghijkl"
JOINT_COLOURS = (BLUE, GREEN, PURPLE)
PRINTED: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.0, "markeredgecolor": PAPER}


@dataclass(frozen=True, eq=False)
class Course:
    """Values of several joints over time.

    Attributes:
        name: of the legend.
        times: ``(N,)`` [s]; what jumps has an instant twice.
        values: ``(N, joints)``.
    """

    name: str
    times: Array
    values: Array


def course(name: str, motion: Motion, order: int, scale: float | Array = 1.0, per_segment: int = PER_SEGMENT) -> Course:
    """A derivative of a motion's joints, both ends of each segment included.

    Args:
        name: of the legend.
        motion: whose it is.
        order: of the derivative, 0 for the joints themselves.
        scale: by which values are multiplied, one or one a joint.
        per_segment: samples of each segment.
    """
    curve, u = motion.curve, np.linspace(0.0, 1.0, per_segment)
    times = np.concatenate([curve.knots[k] + u * curve.durations[k] for k in range(curve.segments)])
    values = np.concatenate([curve.at(k, u, order) for k in range(curve.segments)])
    return Course(name, times, values * scale)


def letter(axes: Axes, index: int, words: str) -> None:
    """Titles the panels of a figure as papers do."""
    axes.set_title(f"({LETTERS[index]}) {words}", loc="left", pad=3)


def joint_panels(
    courses: Sequence[Course], joints: Sequence[str], quantity: str, unit: str, *, limits: tuple[Array, Array] | None,
    points: Course | None = None, notes: Sequence[str] = (), columns: int = 3,
) -> Figure:  # fmt: skip
    """A panel a joint, each course a line of its own.

    Args:
        courses: of the same joints.
        joints: their names.
        quantity: what is shown, for the axes.
        unit: of it.
        limits: lower and upper ``(joints,)``, drawn where near and written where far; None for none.
        points: as printed in the paper, drawn as circles.
        notes: what else the paper prints of each joint, written into its panel.
        columns: of panels.
    """
    count = len(joints)
    rows = -(-count // columns)
    figure = Figure(figsize=(PANEL[0] * columns + 0.3, PANEL[1] * rows + 0.6))
    grid: Any = figure.subplots(rows, columns, squeeze=False, sharex=True)
    for j, name in enumerate(joints):
        axes = grid.flat[j]
        for i, one in enumerate(courses):
            axes.plot(one.times, one.values[:, j], **line_style(i))
        drawn = [one.values[:, j] for one in courses]
        if points is not None:
            axes.plot(points.times, points.values[:, j], **PRINTED, markerfacecolor="none", zorder=4)
            drawn.append(points.values[:, j])
        low, high = min(float(v.min()) for v in drawn), max(float(v.max()) for v in drawn)
        lower, upper = (-np.inf, np.inf) if limits is None else (float(limits[0][j]), float(limits[1][j]))
        reach = max((abs(x) for x in (lower, upper) if np.isfinite(x)), default=1.0)
        bounds(axes, low, high, lower, upper, max(high - low, 1e-3 * reach), reach)
        letter(axes, j, name)
        if notes:
            bottom, top = axes.get_ylim()
            axes.set_ylim(bottom, top + 0.22 * (top - bottom))  # room for the note
            axes.text(0.98, 0.99, notes[j], transform=axes.transAxes, ha="right", va="top", fontsize=6.0)
        if j % columns == 0:
            axes.set_ylabel(labelled(quantity, unit))
        if j >= count - columns:
            axes.set_xlabel("time [s]")
            axes.tick_params(labelbottom=True)
    for axes in grid.flat[count:]:
        axes.set_axis_off()
    figure.align_ylabels(grid[:, 0])
    key = [Line2D([], [], **line_style(i), label=one.name) for i, one in enumerate(courses)]
    if points is not None:
        key.append(Line2D([], [], **PRINTED, markerfacecolor="none", label=points.name))
    if limits is not None and np.isfinite(limits).any():
        key.append(Line2D([], [], color=LIMIT, linestyle="--", linewidth=1.1, label="limit"))
    figure.legend(handles=key, loc="outside lower center", ncols=min(len(key), 4), frameon=False)
    return figure


@dataclass(frozen=True, eq=False)
class Group:
    """Joints that share axes: their places, what is shown of them, and the unit."""

    joints: tuple[int, ...]
    quantity: str
    unit: str


def grouped_panels(
    courses: Sequence[Course], joints: Sequence[str], groups: Sequence[Group], *, limits: tuple[Array, Array] | None,
    points: Course | None = None,
) -> Figure:  # fmt: skip
    """A panel a group of joints: a colour a joint, dashes a course; printed points are circles.

    Args:
        courses: of the same joints.
        joints: names of all.
        groups: which share axes.
        limits: of all joints ``(joints,)``; one that the joints of a group do not share is written above.
        points: as printed in the paper.
    """
    figure = Figure(figsize=(WIDE[0] * len(groups), WIDE[1] + 0.35))
    grid: Any = figure.subplots(1, len(groups), squeeze=False)
    for index, group in enumerate(groups):
        axes = grid.flat[index]
        drawn = []
        for place, j in enumerate(group.joints):
            for i, one in enumerate(courses):
                axes.plot(one.times, one.values[:, j], color=JOINT_COLOURS[place], linestyle=DASHES[i])
                drawn.append(one.values[:, j])
            if points is not None:
                axes.plot(points.times, points.values[:, j], **PRINTED, markerfacecolor=JOINT_COLOURS[place], zorder=4)
        low, high = min(float(v.min()) for v in drawn), max(float(v.max()) for v in drawn)
        if limits is not None:
            ends = ((-1.0, limits[0]), (1.0, limits[1]))
            chosen = list(group.joints)
            lower, upper = (of[chosen[0]] if len({*of[chosen].tolist()}) == 1 else np.inf * sign for sign, of in ends)
            reach = max((abs(x) for x in (lower, upper) if np.isfinite(x)), default=high - low)
            bounds(axes, low, high, float(lower), float(upper), high - low, reach)
            own = [number(x) for sign, of in ends for x in of[chosen] if len({*of[chosen].tolist()}) > 1]
            if own:
                far_bounds(axes, f"limits {', '.join(own)}")
            axes.locator_params(axis="y", nbins=6)
        letter(axes, index, ", ".join(joints[j] for j in group.joints))
        axes.set_ylabel(labelled(group.quantity, group.unit))
        axes.set_xlabel("time [s]")
        named = zip(group.joints, JOINT_COLOURS, strict=False)
        axes.legend(handles=[Line2D([], [], color=colour, label=joints[j]) for j, colour in named])
    key = [Line2D([], [], color=BLACK, linestyle=DASHES[i], label=one.name) for i, one in enumerate(courses)]
    if points is not None:
        key.append(Line2D([], [], **PRINTED, markerfacecolor="white", label=points.name))
    figure.legend(handles=key, loc="outside lower center", ncols=min(len(key), 4), frameon=False)
    return figure


def band(axes: Axes, courses: Sequence[Array], name: str, index: int, first: int = 1) -> None:
    """Runs of a population on several seeds: their median over generations, and all that lies between them.

    Args:
        axes: to draw on.
        courses: a value a generation ``(G,)`` of each run; NaN where there is none yet.
        name: of the legend.
        index: of the line, for its style.
        first: number of the first generation.
    """
    length = max(len(one) for one in courses)
    padded = np.array([np.append(one, np.full(length - len(one), one[-1])) for one in courses])
    known = np.isfinite(padded).all(axis=0)  # before all have a value there is no median of them
    generations = np.arange(first, first + length)[known]
    style = line_style(index)
    axes.step(generations, np.median(padded[:, known], axis=0), where="post", label=name, **style)
    if len(courses) > 1:
        low, high = padded[:, known].min(axis=0), padded[:, known].max(axis=0)
        axes.fill_between(generations, low, high, step="post", color=style["color"], alpha=0.18, linewidth=0)


def printed_line(axes: Axes, value: float, words: str, *, dashes: Any = (0, (1.2, 1.4)), upright: bool = False) -> None:
    """A number of the paper as a line across the axes, or upright."""
    (axes.axvline if upright else axes.axhline)(value, color=PAPER, linewidth=1.0, linestyle=dashes, label=words)


def space(figure: Figure, place: tuple[int, int, int], labels: tuple[str, str, str]) -> Any:
    """Axes in space, with one scale in all directions left to the caller."""
    axes: Any = figure.add_subplot(*place, projection="3d")
    axes.set_xlabel(labels[0], labelpad=2)
    axes.set_ylabel(labels[1], labelpad=2)
    axes.set_zlabel(labels[2], labelpad=2)
    axes.tick_params(pad=0)
    axes.locator_params(nbins=5)
    for side in (axes.xaxis, axes.yaxis, axes.zaxis):
        side.set_pane_color((1.0, 1.0, 1.0, 0.0))
    return axes


def one_scale(axes: Any, points: Array) -> None:
    """The same length of a unit in all directions, around points ``(N, 3)``."""
    extent = np.maximum(np.ptp(points, axis=0), 0.3 * np.ptp(points, axis=0).max())
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    for set_range, middle, size in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), centre, extent, strict=True):
        set_range(middle - 0.53 * size, middle + 0.53 * size)
    axes.set_box_aspect(extent)
