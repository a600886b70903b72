"""The figures of Zhu and Wang: our times beside the published ones, and how the swarms converge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.io.plot_style import BLUE, DASHES, GREEN, PURPLE, styled
from ocp_traj.problems import m10id
from ocp_traj.problems import rotor_353 as paper
from ocp_traj.reproductions.draft import Draft
from ocp_traj.reproductions.figure_parts import (
    LETTERS,
    PANEL,
    WIDE,
    Course,
    band,
    course,
    joint_panels,
    letter,
    printed_line,
)
from ocp_traj.reproductions.gallery import Listed
from ocp_traj.reproductions.rotor_353_convergence import WITHIN, Followed

SWARMS = "our swarms, with the certified optimum of the joint and the iterations the paper speaks of"
BOTH = "our certified optimum beside the published times, with"
ALONE, TOGETHER = "Swarms, every joint alone", "Swarms, all joints together"
FIGURES = (
    Listed("Figure 1", "best particle and convergence, joint 1", SWARMS),
    Listed("Figure 2", "best particle and convergence, joint 2", SWARMS),
    Listed("Figure 3", "joint positions", f"{BOTH} Table 2's points"),
    Listed("Figure 4", "joint velocities", f"{BOTH} the maker's limits; the paper gives none"),
    Listed("Figure 5", "joint accelerations", f"{BOTH} our limits; the paper gives none"),
    Listed(ALONE, "convergence of the paper's recipe, all six joints", SWARMS),
    Listed(TOGETHER, "convergence with one set of times for all joints", "our swarms, with the certified optimum"),
)
ORDERS = (
    ("Figure 3", 0, "position", "deg", None),
    ("Figure 4", 1, "velocity", "deg/s", m10id.VELOCITY),
    ("Figure 5", 2, "acceleration", "deg/s2", paper.ACCELERATION),
)
DRAWN = ("as_printed", "linear")  # improved as printed, and the usual one: of which the paper shows particles
PHASE_COLOURS = (BLUE, GREEN, PURPLE)


def motions(draft: Draft, ours: Motion, published: Motion) -> None:
    """Figures 3 to 5."""
    both = {f"ours, {ours.duration:.3f} s": ours, f"published times, {published.duration:.3f} s": published}
    for figure, order, quantity, unit, limit in ORDERS:
        points = table_2(published) if order == 0 else None
        draft.figure(figure, partial(joints_over_time, both, order, quantity, unit, limit, points))


def swarms_alone(draft: Draft, followed: Sequence[Followed]) -> None:
    """Figures 1 and 2, and all the joints."""
    for number, one in zip(("Figure 1", "Figure 2"), followed, strict=False):
        draft.figure(number, partial(particle, one))
    draft.figure(ALONE, partial(every_joint, followed))


def swarms_together(draft: Draft, runs: Mapping[str, Sequence[Array]], least: float) -> None:
    """All joints with one set of times: best times ``(G,)`` of each seed by method, and the certified optimum [s]."""
    draft.figure(TOGETHER, partial(together, runs, least))


def table_2(published: Motion) -> Course:
    """The points of Table 2 [deg] at the published times."""
    return Course("paper, Table 2", published.curve.knots, np.degrees(paper.via_points(paper.ZhuWang())))


@styled
def joints_over_time(
    both: Mapping[str, Motion],
    order: int,
    quantity: str,
    unit: str,
    limit: Sequence[float] | None,
    points: Course | None,
) -> Figure:
    """Figures 3 to 5: a panel a joint."""
    scale = float(np.degrees(1.0))
    limits = None if limit is None else (-np.array(limit), np.array(limit))
    courses = [course(name, motion, order, scale) for name, motion in both.items()]
    return joint_panels(courses, m10id.JOINTS, quantity, unit, limits=limits, points=points)


@styled
def particle(one: Followed) -> Figure:
    """Figures 1 and 2: times of the three phases of the best particle, and how the best time falls."""
    figure = Figure(figsize=(2.0 * WIDE[0], WIDE[1] + 0.4))
    times, convergence = figure.subplots(1, 2)
    for i, schedule in enumerate(DRAWN):
        for k in range(3):
            phases = one.times[schedule][:, k]
            words = f"t{k + 1}, {words_of(schedule)}"
            iterations = np.arange(1, len(phases) + 1)
            times.step(iterations, phases, where="post", color=PHASE_COLOURS[k], linestyle=DASHES[i], label=words)
    letter(times, 0, f"times of the best particle, {one.joint}, seed 0")
    times.set_xlabel("iteration")
    times.set_ylabel("time of a phase [s]")
    low, high = times.get_ylim()
    times.set_ylim(low, high + 0.3 * (high - low))  # room for the legend
    times.legend(ncols=2, loc="upper center")
    _converging(convergence, one)
    letter(convergence, 1, "convergence")
    convergence.set_ylabel("best t1 + t2 + t3 [s]")
    convergence.legend()
    return figure


def _converging(axes: Axes, one: Followed) -> None:
    for index, (schedule, runs) in enumerate(one.best.items()):
        band(axes, runs, words_of(schedule), index)
    axes.axhline(
        one.least, color="0.35", linewidth=0.9, linestyle=(0, (5.0, 1.5)), label=f"certified: {one.least:.4f} s"
    )
    printed_line(axes, WITHIN, f"paper: most within {WITHIN}", upright=True)
    values = np.concatenate([run for runs in one.best.values() for run in runs])
    high = float(np.nanmax(values))
    axes.set_ylim(one.least - 0.06 * (high - one.least), high + 0.06 * (high - one.least))
    axes.set_xlabel("iteration")


def words_of(schedule: str) -> str:
    """What a schedule is called."""
    return {"as_printed": "(10)-(12) as printed", "repaired": "(10)-(12) repaired", "linear": "usual, w linear"}.get(
        schedule, schedule
    )


@styled
def every_joint(followed: Sequence[Followed]) -> Figure:
    """The six joints, each alone, by every schedule."""
    figure = Figure(figsize=(3.0 * PANEL[0] + 0.4, 2.0 * PANEL[1] + 0.9))
    grid = figure.subplots(2, 3, sharex=True)
    for j, one in enumerate(followed):
        axes = grid.flat[j]
        for index, (schedule, runs) in enumerate(one.best.items()):
            band(axes, [np.maximum(run / one.least - 1.0, 1e-9) for run in runs], words_of(schedule), index)
        printed_line(axes, WITHIN, f"paper: most within {WITHIN} iterations", upright=True)
        axes.set_yscale("log")
        axes.set_ylim(1e-7, 3.0)
        axes.set_title(f"({LETTERS[j]}) {one.joint}, certified {one.least:.4f} s", loc="left", pad=3)
        if j >= 3:
            axes.set_xlabel("iteration")
    for row in grid:
        row[0].set_ylabel("above the optimum [-]")
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    return figure


@styled
def together(runs: Mapping[str, Sequence[Array]], least: float) -> Figure:
    """One set of times for all joints, by every schedule."""
    figure = Figure(figsize=(5.6, 3.8))
    axes = figure.subplots()
    for index, (method, best) in enumerate(runs.items()):
        band(axes, [np.maximum(run / least - 1.0, 1e-9) for run in best], method, index)
    axes.set_yscale("log")
    axes.set_xlabel("iteration")
    axes.set_ylabel(f"time above the certified optimum, {least:.4f} s [-]")
    count = max(len(best) for best in runs.values())
    title = "one seed" if count == 1 else f"median and range of {count} seeds"
    axes.legend(title=title)
    return figure
