"""The figures of Guo et al. (2016): our optimum beside the motion of Table 7 and the points of Tables 6 and 8."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.io.plot import line_style
from ocp_traj.io.plot_style import GREEN, VERMILLION, labelled, styled
from ocp_traj.problems import hybrid_robot
from ocp_traj.problems import hybrid_spline as paper
from ocp_traj.proof.values import limit_along
from ocp_traj.reproductions.draft import Draft
from ocp_traj.reproductions.figure_parts import (
    PRINTED,
    Course,
    Group,
    band,
    course,
    grouped_panels,
    letter,
    one_scale,
    printed_line,
    space,
)
from ocp_traj.reproductions.gallery import Listed
from ocp_traj.reproductions.hybrid_spline_tables import (
    FMINCON,
    NSGA_II,
    TABLE_6_PRINTED,
    TABLE_8_PRINTED,
    TRACKING_ERROR,
    lines,
    saddle,
    tool_positions,
    tracking_distance,
)

BOTH = "our optimum of the cost beside the motion of Table 7's intervals, with"
DRAWING = "a drawing of the robot, its frames or its forces, and no result"
FIGURES = (
    *(Listed(f"Figure {n}", "robot, frames, forces on its links", why_not=DRAWING) for n in range(1, 6)),
    Listed("Figure 6", "desired path, via points and their frames", "(156), our frames, and Table 6's positions"),
    Listed("Figure 7", "cost over generations", "NSGA-II on our seeds, with Table 9's costs and the true optimum"),
    Listed("Figure 8", "the four objectives over generations", "the same runs, with Table 9's values"),
    Listed("Figure 9", "joint displacements", f"{BOTH} Table 8's knots"),
    Listed("Figure 10", "joint velocities", f"{BOTH} Table 2's limits"),
    Listed("Figure 11", "joint accelerations", f"{BOTH} Table 2's limits"),
    Listed("Figure 12", "joint jerks", f"{BOTH} Table 2's limits"),
    Listed("Figure 13", "joint forces and torques", f"{BOTH} Table 2's limits; payload 10 kg"),
    Listed("Figure 14", "path of the tool", f"{BOTH} Table 8's positions"),
    Listed("Figure 15", "tracking error of the tool", f"{BOTH} the printed standard deviation and maximum"),
)
MILLI = np.array([1e3, 1e3, 1e3, 1.0, 1.0])
SCREWS, TURNS = (0, 1, 2), (3, 4)
ORDERS = (  # figure, order, quantity, limit, units of the screws and of the turns
    ("Figure 9", 0, "displacement", "position-limit", "mm", "rad"),
    ("Figure 10", 1, "velocity", "velocity-limit", "mm/s", "rad/s"),
    ("Figure 11", 2, "acceleration", "acceleration-limit", "mm/s2", "rad/s2"),
    ("Figure 12", 3, "jerk", "jerk-limit", "mm/s3", "rad/s3"),
)
OURS, TABLE_7 = "our optimum", "Table 7's intervals"
FOUR = ("time", "energy", "jerk", "acceleration")
ARROW = 55.0  # [mm] of the frames at the via points: our choice


Descents = Mapping[str, Sequence[Array]]


def motions(draft: Draft, problem: Problem, ours: Motion, table_7: Motion) -> None:
    """Figures 6 and 9 to 15."""
    both = {OURS: ours, TABLE_7: table_7}
    draft.figure("Figure 6", desired_path)
    for figure, order, quantity, limit, *units in ORDERS:
        draft.figure(figure, partial(joints_over_time, both, problem, order, quantity, limit, (units[0], units[1])))
    draft.figure("Figure 13", partial(efforts, both, problem))
    draft.figure("Figure 14", partial(tool_path, both))
    draft.figure("Figure 15", partial(tracking, both))


def descents(draft: Draft, found: Descents, least: Mapping[str, float]) -> None:
    """Figures 7 and 8.

    Args:
        draft: to which they are added.
        found: cost and the four objectives ``(G, 5)`` of the best individual, of each seed, by convention.
        least: true optimum of the cost, by convention.
    """
    draft.figure("Figure 7", partial(costs, found, least))
    draft.figure("Figure 8", partial(four_objectives, found))


def table_8() -> tuple[Array, Array]:
    """Times ``(13,)`` [s], and joints and positions ``(13, 8)`` [mm, rad] as Table 8 prints them."""
    rows = np.array([[float(cell) for cell in row] for row in lines(TABLE_8_PRINTED).values()])
    return rows[:, 0], rows[:, 1:]


def _limit(problem: Problem, name: str) -> PathConstraint:
    (limit,) = (one for one in problem.requirements.path_constraints if one.id == name)
    return limit


@styled
def joints_over_time(
    both: Mapping[str, Motion], problem: Problem, order: int, quantity: str, limit: str, units: tuple[str, str]
) -> Figure:
    """Figures 9 to 12: joints, or a derivative of them, in the paper's two panels."""
    found = _limit(problem, limit)
    times, printed = table_8()
    return grouped_panels(
        [course(name, motion, order, MILLI) for name, motion in both.items()],
        hybrid_robot.JOINTS,
        [Group(SCREWS, quantity, units[0]), Group(TURNS, quantity, units[1])],
        limits=(found.lower * MILLI, found.upper * MILLI),
        points=Course("paper, Table 8", times, printed[:, :5]) if order == 0 else None,
    )


@styled
def efforts(both: Mapping[str, Motion], problem: Problem) -> Figure:
    """Figure 13: forces of the screws, and torques."""
    limit = _limit(problem, "effort-limit")
    courses = []
    for name, motion in both.items():
        times, values = limit_along(motion, problem.requirements, limit)
        courses.append(Course(name, times, values.T))
    groups = [Group(SCREWS, "force", "N"), Group(TURNS, "torque", "N m")]
    return grouped_panels(courses, limit.labels, groups, limits=(limit.lower, limit.upper))


@styled
def desired_path() -> Figure:
    """Figure 6: the curve, its via points with their frames, and the positions that Table 6 prints."""
    figure = Figure(figsize=(6.2, 4.4))
    axes = space(figure, (1, 1, 1), ("x [mm]", "y [mm]", "z [mm]"))
    fine = saddle(np.linspace(0.0, 10.0, 201))
    axes.plot(*fine.T, **line_style(0), label="desired path, (156)")
    points, normals = paper.task_points()
    points = points * 1e3
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    frames = ((normals, ARROW, GREEN, "a, the tool's axis"), (along, 0.4 * ARROW, VERMILLION, "o, along the path"))
    for vectors, size, colour, words in frames:
        ends = points + size * vectors
        for start, end in zip(points, ends, strict=True):
            axes.plot(*np.stack([start, end]).T, color=colour, linewidth=1.0)
        axes.plot([], [], color=colour, linewidth=1.0, label=words)
        axes.scatter(*ends.T, color=colour, s=5, depthshade=False)
    printed = np.array([[float(cell) for cell in row[5:]] for row in lines(TABLE_6_PRINTED).values()])
    kept = printed[:, 2] > 100.0  # row 12's z is a misprint, 9.51221
    axes.plot(*printed[kept].T, **PRINTED, markerfacecolor="none", label="paper, Table 6 (row 12 misprinted)")
    one_scale(axes, np.concatenate([fine, points + ARROW * normals]))
    axes.invert_zaxis()  # Z0 points down
    axes.view_init(elev=22.0, azim=-65.0)
    axes.legend(loc="upper left")
    return figure


@styled
def costs(found: Descents, least: Mapping[str, float]) -> Figure:
    """Figure 7: the cost of the best individual over generations."""
    figure = Figure(figsize=(6.4, 4.0))
    axes = figure.subplots()
    for index, (convention, runs) in enumerate(found.items()):
        band(axes, [run[:, 0] for run in runs], f"NSGA-II, {convention}, {_seeds(len(runs))}", index)
        style = line_style(index)
        words = f"true optimum, {convention}: {least[convention]:.4f}"
        axes.axhline(least[convention], color=style["color"], linewidth=0.9, linestyle=(0, (5, 1.5)), label=words)
    printed_line(axes, paper.TABLE_9[NSGA_II]["cost"], f"paper, NSGA-II: {paper.TABLE_9[NSGA_II]['cost']:.3f}")
    words = f"paper, fmincon, mean of 100: {paper.TABLE_9[FMINCON]['cost']:.3f}"
    printed_line(axes, paper.TABLE_9[FMINCON]["cost"], words, dashes=(0, (5.0, 1.5, 1.2, 1.5)))
    lowest = min(least.values())
    most = max(float(np.nanmax(run[:, 0])) for runs in found.values() for run in runs)
    axes.set_ylim(0.985 * lowest, min(most, 2.0 * lowest))
    axes.set_xlabel("generation")
    axes.set_ylabel("cost Fc [-] of the best individual")
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


@styled
def four_objectives(found: Descents) -> Figure:
    """Figure 8: time, energy, jerk and acceleration of the best individual over generations."""
    problem = paper.build()
    figure = Figure(figsize=(7.0, 4.9))
    grid = figure.subplots(2, 2, sharex=True)
    for k, name in enumerate(FOUR):
        axes = grid.flat[k]
        for index, (convention, runs) in enumerate(found.items()):
            band(axes, [run[:, k + 1] for run in runs], f"NSGA-II, {convention}", index)
        printed_line(axes, paper.TABLE_9[NSGA_II][name], "paper, NSGA-II, Table 9")
        letter(axes, k, ("total time", "energy", "jerk squared", "acceleration squared")[k])
        axes.set_ylabel(labelled(name, problem.objective(name).unit))
        values = np.concatenate([run[:, k + 1] for runs in found.values() for run in runs])
        high = np.nanpercentile(values, 97.0)
        low = min(float(np.nanmin(values)), paper.TABLE_9[NSGA_II][name])
        high = max(float(high), paper.TABLE_9[NSGA_II][name])
        axes.set_ylim(low - 0.06 * (high - low), high + 0.1 * (high - low))
        if k > 1:
            axes.set_xlabel("generation")
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _seeds(count: int) -> str:
    return "one seed" if count == 1 else f"median and range of {count} seeds"


@styled
def tool_path(both: Mapping[str, Motion]) -> Figure:
    """Figure 14: the tool's path in space, and its coordinates over time."""
    figure = Figure(figsize=(8.2, 3.9))
    layout = figure.get_layout_engine()
    assert layout is not None
    layout.set(wspace=0.14)  # type: ignore[call-arg]  # of the constrained layout: room for the label of z
    axes = space(figure, (1, 2, 1), ("x [mm]", "y [mm]", "z [mm]"))
    times, printed = table_8()
    places = printed[:, 5:]
    over_time = figure.add_subplot(1, 2, 2)
    for i, (name, motion) in enumerate(both.items()):
        joints = course(name, motion, 0)
        tool = tool_positions(joints.values)
        axes.plot(*tool.T, **line_style(i))
        for k, axis in enumerate("xyz"):
            over_time.plot(joints.times, tool[:, k], **line_style(i))
            if i == 0:
                beside: dict[str, Any] = {"xytext": (-9, 0), "textcoords": "offset points", "va": "center"}
                over_time.annotate(axis, (0.0, tool[0, k]), **beside)
    style = {**PRINTED, "markerfacecolor": "none"}
    axes.plot(*places.T, **style)
    over_time.plot(times, places, **style)
    one_scale(axes, places)
    axes.invert_zaxis()  # Z0 points down
    axes.view_init(elev=22.0, azim=-65.0)
    axes.set_title("(a) path", loc="left")
    letter(over_time, 1, "coordinates")
    over_time.set_xlabel("time [s]")
    over_time.set_ylabel("position of the tool [mm]")
    key = [Line2D([], [], **line_style(i), label=name) for i, name in enumerate(both)]
    key.append(Line2D([], [], **style, label="paper, Table 8"))
    figure.legend(handles=key, loc="outside lower center", ncols=3, frameon=False)
    return figure


@styled
def tracking(both: Mapping[str, Motion]) -> Figure:
    """Figure 15: the tool's distance to the desired path over time."""
    figure = Figure(figsize=(5.6, 3.4))
    axes = figure.subplots()
    for i, (name, motion) in enumerate(both.items()):
        times, distance = tracking_distance(motion.curve)
        axes.plot(times, distance, **line_style(i), label=f"{name}: standard deviation {distance.std():.4f} mm")
    printed_line(axes, float(TRACKING_ERROR["maximum"]), f"paper, maximum: {TRACKING_ERROR['maximum']} mm")
    deviation = TRACKING_ERROR["standard deviation"]
    words = f"paper, standard deviation: {deviation} mm"
    printed_line(axes, float(deviation), words, dashes=(0, (5.0, 1.5, 1.2, 1.5)))
    axes.set_ylim(0.0, 1.35 * float(TRACKING_ERROR["maximum"]))
    axes.set_xlabel("time [s]")
    axes.set_ylabel("distance to the desired path [mm]")
    axes.legend()
    return figure
