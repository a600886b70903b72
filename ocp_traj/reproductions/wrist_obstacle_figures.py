"""The figures of El Haiek et al. for the case solved instead: the genetic algorithm beside our optimum."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.plot import line_style
from ocp_traj.io.plot_style import GREEN, PAPER, VERMILLION, styled
from ocp_traj.problems import wrist_obstacle as paper
from ocp_traj.reproductions.courses import FOLLOWED, Courses
from ocp_traj.reproductions.draft import Draft
from ocp_traj.reproductions.figure_parts import (
    band,
    course,
    joint_panels,
    letter,
    one_scale,
    printed_line,
    space,
)
from ocp_traj.reproductions.gallery import Listed

BOTH = "our optimum of the case blocked beside the genetic algorithm's best; limits are our choice"
COURSE = "the genetic algorithm on our seeds, with our optimum"
FIGURES = (
    Listed("Figure 1", "the wrist's joints", why_not="a drawing of the robot, and no result"),
    Listed("Figure 2", "flowchart of the genetic algorithm", why_not="a drawing of the method, and no result"),
    Listed("Figure 3", "path past the obstacle", "our optimum of the case blocked, with the paper's points"),
    Listed("Figure 4", "fitness over generations", f"{COURSE}, and the printed 8.1 and 46 generations"),
    Listed("Figure 5", "joint positions", BOTH),
    Listed("Figure 6", "joint velocities", BOTH),
    Listed("Figure 7", "joint accelerations", BOTH),
    Listed("Figure 8", "time of the motion over generations", f"{COURSE}, and the printed 0.2 s"),
    Listed("Figure 9", "distance of the joints over generations", COURSE),
)
SETTLED = 46  # generations after which the paper's fitness has settled, sect. 5
POINTS = {"start": (-1.0, 1.0), "goal": (1.0, 1.0), "obstacle": (0.5, 0.5)}  # sect. 5, in the plane
JOINTS = ("theta1", "theta2", "theta3")
OURS, GENETIC = "our optimum", "genetic algorithm"
LINKS = 5  # places of the link that are drawn: our choice


def motions(draft: Draft, problem: Problem, ours: Motion, genetic: Motion | None = None) -> None:
    """Figures 3 and 5 to 7; beside the genetic algorithm's best where there is one."""
    both = {OURS: ours} if genetic is None else {OURS: ours, GENETIC: genetic}
    alone = "" if genetic is not None else "our optimum of the case blocked; no population was run"
    draft.figure("Figure 3", partial(past_the_obstacle, both, problem.case))
    case = problem.case
    for figure, order, quantity, unit, limit in (
        ("Figure 5", 0, "position", "rad", case.max_position),
        ("Figure 6", 1, "velocity", "rad/s", case.max_velocity),
        ("Figure 7", 2, "acceleration", "rad/s2", case.max_acceleration),
    ):
        draft.figure(figure, partial(joints_over_time, both, order, quantity, unit, np.array(limit)), alone)


def courses(draft: Draft, found: Courses, ours: Mapping[str, float], fitness: str, time: str) -> None:
    """Figures 4, 8 and 9.

    Args:
        draft: to which they are added.
        found: of the genetic algorithm.
        ours: objectives of our optimum.
        fitness: as printed.
        time: as printed [s].
    """
    printed = {"fitness": f"paper, fitness {fitness}, weights not given", "time": f"paper, {time} s", "distance": ""}
    values = {"fitness": float(fitness), "time": float(time), "distance": np.nan}
    units = {"fitness": "fitness [-]", "time": "time of the motion [s]", "distance": "distance of the joints [rad]"}
    for figure, k in (("Figure 4", 0), ("Figure 8", 1), ("Figure 9", 2)):
        name = FOLLOWED[k]
        by_variant = {words: [run[:, k] for run in runs] for words, runs in found.values.items()}
        line = (values[name], printed[name]) if printed[name] else None
        draft.figure(figure, partial(over_generations, by_variant, ours[name], units[name], line, k == 0))


@styled
def over_generations(
    runs: Mapping[str, Sequence[Array]], ours: float, quantity: str, printed: tuple[float, str] | None, settled: bool
) -> Figure:
    """Figures 4, 8 and 9: a value of the best individual over generations."""
    figure = Figure(figsize=(5.4, 3.7))
    axes = figure.subplots()
    for index, (words, found) in enumerate(runs.items()):
        band(axes, found, words, index)
    axes.axhline(ours, color="0.35", linewidth=0.9, linestyle=(0, (5.0, 1.5)), label=f"our optimum: {ours:.4f}")
    if printed is not None:
        printed_line(axes, *printed)
    if settled:
        printed_line(
            axes, SETTLED, f"paper, settled after about {SETTLED}", upright=True, dashes=(0, (5, 1.5, 1.2, 1.5))
        )
    axes.set_xlabel("generation")
    axes.set_ylabel(f"{quantity}, best individual")
    count = max(len(found) for found in runs.values())
    title = "" if count == 1 else f"median and range of {count} seeds"
    figure.legend(loc="outside lower center", ncols=2, frameon=False, title=title or None)
    return figure


@styled
def joints_over_time(both: Mapping[str, Motion], order: int, quantity: str, unit: str, limit: Array) -> Figure:
    """Figures 5 to 7: a panel a joint."""
    courses = [course(f"{name}, {motion.duration:.3f} s", motion, order) for name, motion in both.items()]
    return joint_panels(courses, JOINTS, quantity, unit, limits=(-limit, limit))


@styled
def past_the_obstacle(both: Mapping[str, Motion], case: paper.ElHaiek2019) -> Figure:
    """Figure 3: the tip's way in space, and from above with the paper's points in its plane."""
    figure = Figure(figsize=(8.0, 4.0))
    axes, above = space(figure, (1, 2, 1), ("x [-]", "y [-]", "z [-]")), figure.add_subplot(1, 2, 2)
    layout: Any = figure.get_layout_engine()
    layout.set(wspace=0.12)
    tips = {name: tip(motion, case) for name, motion in both.items()}
    for i, way in enumerate(tips.values()):
        axes.plot(*way.T, **line_style(i))
        above.plot(*way[:, :2].T, **line_style(i))
    first = next(iter(tips.values()))
    for place in first[np.linspace(0, len(first) - 1, LINKS).astype(int)]:
        axes.plot(*np.stack([np.zeros(3), place]).T, color="0.3", linewidth=1.6)
    u, v = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(0.0, np.pi, 13))
    for x, y, z, radius in case.obstacles:
        ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
        axes.plot_surface(
            x + radius * ball[0], y + radius * ball[1], z + radius * ball[2], color=VERMILLION, alpha=0.35
        )
        above.add_patch(Circle((x, y), radius, color=VERMILLION, alpha=0.35, linewidth=0))
    for axes_of, count in ((axes, 3), (above, 2)):
        axes_of.plot(*first[[0, -1], :count].T, linestyle="none", marker="s", color=GREEN, markersize=5)
    one_scale(axes, np.concatenate([first, np.zeros((1, 3)), np.array([[0.9, 0.9, 0.4]])]))
    axes.view_init(elev=25.0, azim=160.0)
    axes.set_title("(a) in space, the link at five instants", loc="left")
    _plane(above)
    key = [Line2D([], [], **line_style(i), label=f"tip, {name}") for i, name in enumerate(both)]
    ends = {"linestyle": "none", "color": GREEN, "marker": "s", "markersize": 5.0}
    printed = {"linestyle": "none", "marker": "o", "markerfacecolor": "none", "markeredgecolor": PAPER}
    key += [
        Line2D([], [], **ends, label="start and goal"),  # type: ignore[arg-type]
        Line2D([], [], color=VERMILLION, alpha=0.35, linewidth=6.0, label="obstacle"),
        Line2D([], [], **printed, label="paper, sect. 5, in the plane"),  # type: ignore[arg-type]
    ]
    figure.legend(handles=key, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _plane(axes: Axes) -> None:
    """The paper's points, seen from above."""
    for name, (x, y) in POINTS.items():
        axes.plot(x, y, linestyle="none", marker="o", markerfacecolor="none", markeredgecolor=PAPER, markersize=8.0)
        beside: dict[str, Any] = {"xytext": (0, -15), "textcoords": "offset points", "ha": "center", "fontsize": 7.0}
        axes.annotate(name, (x, y), **beside)
    axes.plot(0.0, 0.0, marker="+", color=PAPER)
    axes.annotate("base", (0.0, 0.0), xytext=(0, -11), textcoords="offset points", ha="center", fontsize=7.0)
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.6", linewidth=0.8, linestyle=(0, (1.2, 1.4)))
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    axes.set_xlabel("x [-]")
    axes.set_ylabel("y [-]")
    letter(axes, 1, "from above: base, obstacle and goal on one line")


def tip(motion: Motion, case: paper.ElHaiek2019) -> Array:
    """Places of the tip along a motion ``(N, 3)``, in the paper's unit of length."""
    q = course("", motion, 0).values
    away = np.stack([np.cos(q[:, 0]) * np.sin(q[:, 1]), np.sin(q[:, 0]) * np.sin(q[:, 1]), np.cos(q[:, 1])], axis=1)
    return np.asarray(case.d3 * away)
