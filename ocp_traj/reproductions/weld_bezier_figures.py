"""The figures of Ogbemhe et al. on the air move: the fastest point of each front, with the printed means and maxima."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.plot_style import BLUE, ORANGE, SKY, number, styled
from ocp_traj.problems import kr90
from ocp_traj.proof.values import limit_along
from ocp_traj.reproductions.courses import Generations
from ocp_traj.reproductions.draft import Draft
from ocp_traj.reproductions.figure_parts import (
    PANEL,
    Course,
    course,
    joint_panels,
    letter,
    printed_line,
)
from ocp_traj.reproductions.gallery import Listed
from ocp_traj.reproductions.weld_bezier_tables import CELLS, TABLE_7

CELL = "needs the cell's CAD, which is not published"
CHART = "a flow chart or a drawing, and no result"
QUANTITIES = (  # figures of MOGA and of HMOGA, order, quantity, unit
    (("Figure 9", "Figure 10"), 4, "snap", "deg/s4"),
    (("Figure 11", "Figure 12"), None, "torque", "N m"),
    (("Figure 14", "Figure 15"), 0, "displacement", "deg"),
    (("Figure 16", "Figure 17"), 1, "velocity", "deg/s"),
    (("Figure 18", "Figure 19"), 2, "acceleration", "deg/s2"),
    (("Figure 20", "Figure 21"), 3, "jerk", "deg/s3"),
)
METHODS = ("MOGA", "HMOGA")
LIMITS: dict[int | None, tuple[Array, Array]] = {
    0: (np.array(kr90.POSITION[0]), np.array(kr90.POSITION[1])),
    **{
        order: (-np.array(values), np.array(values))
        for order, values in enumerate((kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP), 1)
    },
}


def _listed() -> tuple[Listed, ...]:
    """The list, in the order of the paper."""
    printed = ", and the printed means and maxima"
    of = {method: f"the fastest point of {method}'s front on the air move, our least time" for method in METHODS}
    made = {
        figure: Listed(figure, f"joint {quantity}, {method}", of[method] + printed)
        for figures, _, quantity, _ in QUANTITIES
        for figure, method in zip(figures, METHODS, strict=True)
    }
    for figure in QUANTITIES[2][0]:
        words = made[figure].made_of.replace(printed, "; Table 8 repeats Table 9's numbers")
        made[figure] = Listed(figure, made[figure].shows, words)
    generations = "HMOGA's generations on the air move; (c) is the hypervolume: parents are not recorded"
    rest = {
        "Figure 1": Listed("Figure 1", "rail car body and bogie", why_not="photographs, and no result"),
        "Figure 2": Listed("Figure 2", "tubular joints", why_not=CHART),
        "Figure 3": Listed("Figure 3", "framework of the programming", why_not=CHART),
        "Figure 4": Listed("Figure 4", "work cell", why_not=CELL),
        "Figure 5": Listed("Figure 5", "simulation of the cell", why_not=CELL),
        "Figure 6": Listed("Figure 6", "approach", why_not=CHART),
        "Figure 7": Listed("Figure 7", "flow chart of the hybrid", why_not=CHART),
        "Figure 8": Listed("Figure 8", "spread, distances, scores and stopping over generations", generations),
        "Figure 13": Listed("Figure 13", "Euler angles", why_not="a drawing of a convention, and no result"),
    }
    whole = rest | made
    return tuple(whole[f"Figure {number}"] for number in range(1, 22))


FIGURES = _listed()


def motions(draft: Draft, problem: Problem, method: str, fastest: Motion, words: str, least: Motion) -> None:
    """The figures of a method.

    Args:
        draft: to which they are added.
        problem: the air move.
        method: ``MOGA`` or ``HMOGA``.
        fastest: of its front.
        words: where the front is not the one that the list says, what it is; else empty.
        least: our motion of least time.
    """
    both = {f"{method}, {fastest.duration:.3f} s": fastest, f"our least time, {least.duration:.3f} s": least}
    for figures, order, quantity, unit in QUANTITIES:
        number = figures[METHODS.index(method)]
        draft.figure(number, partial(joints_over_time, both, problem, order, quantity, unit, method), words)


def generations(draft: Draft, traded: Sequence[str], found: Generations) -> None:
    """Figure 8."""
    draft.figure("Figure 8", partial(figure_8, found, tuple(traded)))


def printed_cells(quantity: str, method: str) -> tuple[str, ...]:
    """What the paper prints of each joint; nothing where it prints the numbers of another quantity."""
    for (_, of, by), (mean, most) in CELLS.items():
        if (of, by) == (quantity, method):
            return tuple(f"paper: mean {number(a)}, max. {number(b)}" for a, b in zip(mean, most, strict=True))
    return ()


@styled
def joints_over_time(
    both: Mapping[str, Motion], problem: Problem, order: int | None, quantity: str, unit: str, method: str
) -> Figure:
    """Figures 9 to 12 and 14 to 21: a panel a joint; order None for torques."""
    if order is not None:
        courses = [course(name, motion, order, float(np.degrees(1.0))) for name, motion in both.items()]
        limits = LIMITS[order]
    else:
        (limit,) = (one for one in problem.requirements.path_constraints if one.id == "effort-limit")
        along = {name: limit_along(motion, problem.requirements, limit) for name, motion in both.items()}
        courses = [Course(name, times, values.T) for name, (times, values) in along.items()]
        limits = (limit.lower, limit.upper)
    notes = printed_cells(quantity, method)
    return joint_panels(courses, kr90.JOINTS, quantity, unit, limits=limits, notes=notes)


@styled
def figure_8(found: Generations, names: Sequence[str]) -> Figure:
    """Spread, average distance, hypervolume, distances, scores, and how near it came to stopping."""
    figure = Figure(figsize=(3.0 * PANEL[0] + 0.6, 2.0 * PANEL[1] + 0.9))
    grid = figure.subplots(2, 3)
    spread, distance, volume, individuals, scores, criteria = grid.flat
    moga = TABLE_7["MOGA"]
    _over_generations(spread, found.history, "spread", "average spread [-]")
    printed_line(spread, moga.spread, f"paper, Table 7: {moga.spread:g}")
    spread.legend()
    _over_generations(distance, found.history, "average distance", "average distance [-]")
    printed_line(distance, moga.distance, f"paper, Table 7: {moga.distance:g}")
    distance.legend()
    _over_generations(volume, found.history, "hypervolume", "hypervolume [-]")
    finite = np.where(np.isfinite(found.distances), found.distances, 0.0)
    individuals.bar(np.arange(1, len(finite) + 1), finite, color=BLUE, width=0.9)
    individuals.set_xlabel("individual of the last front")
    individuals.set_ylabel("distance [-]")
    least, extent = found.values.min(axis=0), np.maximum(np.ptp(found.values, axis=0), 1e-300)
    shares_of = list(((found.values - least) / extent).T)
    scores.hist(shares_of, bins=8, range=(0.0, 1.0), color=[BLUE, ORANGE][: len(names)], label=list(names))
    scores.set_ylim(top=1.35 * scores.get_ylim()[1])  # room for the legend
    scores.set_xlabel("score, as a share of its range [-]")
    scores.set_ylabel("individuals")
    scores.legend()
    shares = {"generations": len(found.history) / found.most, "stall of\nthe spread": min(_stall(found), 1.0)}
    criteria.barh(list(shares), [100.0 * share for share in shares.values()], color=SKY, height=0.5)
    criteria.set_xlim(0.0, 100.0)
    criteria.set_xlabel("met [%]")
    words = ("average spread", "average distance", "hypervolume", "distances", "scores", "stopping criteria")
    for k, axes in enumerate(grid.flat):
        letter(axes, k, words[k])
    return figure


def _stall(found: Generations) -> float:
    """How near the mean change of the spread is to its tolerance; 0 before there are as many generations."""
    values = found.history["spread"].to_numpy(dtype=float)[-found.stall - 1 :]
    if len(values) <= found.stall or not np.isfinite(values).all():
        return 0.0
    return float(found.tolerance / max(float(np.abs(np.diff(values)).mean()), 1e-300))


def _over_generations(axes: Axes, history: pd.DataFrame, column: str, words: str) -> None:
    style: dict[str, Any] = {"color": BLUE, "linewidth": 0.9}
    axes.plot(np.arange(1, len(history) + 1), history[column].to_numpy(dtype=float), **style)
    axes.set_xlabel("generation")
    axes.set_ylabel(words)
