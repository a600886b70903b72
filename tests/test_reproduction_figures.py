"""Each figure of a paper from given small data: the axes, curves and printed points that it states."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pytest import approx

from ocp_traj import problems
from ocp_traj.curves.families import nonic, polynomial_353
from ocp_traj.curves.motion import Motion
from ocp_traj.problems import hybrid_spline, kr90, m10id, rotor_353
from ocp_traj.reproductions import (
    hybrid_spline_figures,
    rotor_353_figures,
    weld_bezier_figures,
    wrist_obstacle_figures,
)
from ocp_traj.reproductions.courses import Courses, Generations, objectives_of
from ocp_traj.reproductions.draft import Draft, ignore
from ocp_traj.reproductions.figure_parts import band
from ocp_traj.reproductions.gallery import NO_POPULATION, Listed, PaperFigure, gallery, listing
from ocp_traj.reproductions.rotor_353_convergence import Followed
from ocp_traj.results.trajectory import trajectory_of

MODULES = {
    "hybrid-spline": hybrid_spline_figures,
    "rotor-353": rotor_353_figures,
    "wrist-obstacle": wrist_obstacle_figures,
    "weld-bezier": weld_bezier_figures,
}
DOCS = Path(__file__).parents[1] / "docs" / "papers.md"


def draft(problem: str) -> Draft:
    return Draft(problem, "a paper", 1, lambda *told: None, ignore, MODULES[problem].FIGURES)


def drawn(of: Draft) -> dict[str, Figure]:
    """The figures that can be drawn, drawn."""
    return {one.listed.number: one.draw() for one in of.finish(()).figures if one.draw is not None}


def lines(axes: Any) -> list[np.ndarray]:
    return [np.asarray(line.get_xydata()) for line in axes.lines]


def circles(axes: Any) -> list[np.ndarray]:
    return [np.asarray(line.get_xydata()) for line in axes.lines if line.get_marker() == "o"]


def legend(figure: Figure) -> list[str]:
    boxes = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for box in boxes if box is not None for text in box.get_texts()]


def labels(figure: Figure) -> list[tuple[str, str]]:
    return [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes]


# --- the list ---


@pytest.mark.parametrize("problem", list(MODULES))
def test_the_list_of_a_paper_is_whole_and_in_the_docs(problem: str) -> None:
    figures = MODULES[problem].FIGURES
    numbers = [int(one.number.split()[1]) for one in figures if one.number.startswith("Figure ")]
    most = {"hybrid-spline": 15, "rotor-353": 5, "wrist-obstacle": 9, "weld-bezier": 21}[problem]
    assert numbers == list(range(1, most + 1))
    assert len({one.stem for one in figures}) == len(figures)
    assert listing(figures) in DOCS.read_text()


def test_a_figure_is_made_or_named_with_its_reason() -> None:
    listed = (Listed("Figure 1", "a", why_not="a drawing"), Listed("Figure 2", "b", "c"), Listed("Figure 10", "d", "e"))
    found = gallery(listed, {"Figure 2": (Figure, "")}, {})
    assert [(one.made, one.words) for one in found] == [(False, "a drawing"), (True, "c"), (False, NO_POPULATION)]
    assert [one.stem for one in listed] == ["figure-01", "figure-02", "figure-10"]
    assert isinstance(found[0], PaperFigure) and found[1].to_dict()["made"] is True
    with pytest.raises(AssertionError):
        Listed("Figure 3", "neither made nor explained")


# --- parts ---


def test_a_band_is_the_median_and_the_range_of_runs_of_any_length() -> None:
    axes: Any = Figure().subplots()
    band(axes, [np.array([np.nan, 4.0, 2.0]), np.array([5.0, 3.0]), np.array([6.0, 3.5, 1.0])], "three", 0)
    (median,) = lines(axes)
    assert median[:, 0].tolist() == [2.0, 3.0]  # before all have a value there is no median
    assert median[:, 1].tolist() == [3.5, 2.0]
    (shade,) = axes.collections
    heights = shade.get_paths()[0].vertices[:, 1]
    assert heights.min() == 1.0 and heights.max() == 4.0


def test_objectives_of_the_best_are_evaluated_once_each(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problems.load("hybrid-spline")
    h = np.array(hybrid_spline.TABLE_7)
    champions = np.array([np.full(12, np.nan), h, h, 1.5 * h])
    found = objectives_of(problem, champions, ("time", "cost"))
    assert np.isnan(found[0]).all() and found[1].tolist() == found[2].tolist()
    assert found[1:, 0] == approx([6.19, 6.19, 1.5 * 6.19])


# --- Guo ---


@pytest.fixture(scope="module")
def guo() -> dict[str, Figure]:
    problem = problems.load("hybrid-spline")
    slow, quick = (trajectory_of(problem, s * np.array(hybrid_spline.TABLE_7)) for s in (1.0, 0.8))
    of = draft("hybrid-spline")
    hybrid_spline_figures.motions(of, problem, quick, slow)
    run = np.linspace([5.0, 9.0, 5000.0, 9.0, 2.0], [2.6, 5.0, 3000.0, 4.0, 0.4], 7)
    falls = {"physical": [run, 1.1 * run], "paper-literal": [1.2 * run]}
    hybrid_spline_figures.descents(of, falls, {"physical": 2.55, "paper-literal": 2.96})
    return drawn(of)


def test_guo_every_figure_is_made(guo: dict[str, Figure]) -> None:
    assert list(guo) == [f"Figure {n}" for n in range(6, 16)]


def test_guo_displacements_hold_table_8_and_both_motions(guo: dict[str, Figure]) -> None:
    figure = guo["Figure 9"]
    assert labels(figure) == [("time [s]", "displacement [mm]"), ("time [s]", "displacement [rad]")]
    printed = circles(figure.axes[0])
    assert len(printed) == 3 and len(circles(figure.axes[1])) == 2
    assert printed[0][[0, -1]].tolist() == [[0.0, 262.63], [6.189, 507.92]]
    ends = sorted({round(float(line[-1, 0]), 3) for line in lines(figure.axes[1])} - {1.0, 6.189})
    assert ends == approx([0.8 * 6.19, 6.19])
    assert legend(figure)[:3] == ["our optimum", "Table 7's intervals", "paper, Table 8"]
    assert "500" in figure.axes[0].get_title(loc="right")  # X_S3's own, which X_S2 passes


@pytest.mark.parametrize(
    ("number", "units"),
    [(10, ("mm/s", "rad/s")), (11, ("mm/s²", "rad/s²")), (12, ("mm/s³", "rad/s³")), (13, ("N", "N m"))],
)
def test_guo_derivatives_and_efforts(guo: dict[str, Figure], number: int, units: tuple[str, str]) -> None:
    figure = guo[f"Figure {number}"]
    assert [label.split("[")[1].rstrip("]") for _, label in labels(figure)] == list(units)
    solid = [line for line in figure.axes[0].lines if line.get_linestyle() == "-"]
    assert len(solid) == 3  # ours, of three joints
    if number == 12:
        assert len({tuple(np.unique(line.get_ydata())) for line in solid}) == 3  # the jerk is constant on an interval
        assert all(len(np.unique(line.get_ydata())) <= 12 for line in solid)


def test_guo_costs_and_objectives_stand_beside_table_9(guo: dict[str, Figure]) -> None:
    flat = [line[0, 1] for line in lines(guo["Figure 7"].axes[0]) if len({*line[:, 1]}) == 1]
    assert sorted(flat) == [2.55, 2.96, 3.093, 3.22]
    printed = {ax.get_ylabel(): [line[0, 1] for line in lines(ax) if len(line) == 2] for ax in guo["Figure 8"].axes}
    assert printed == {
        "time [s]": [6.189], "energy [N² m²/s]": [3921.602], "jerk [(m²+rad²)/s⁵]": [1.068],
        "acceleration [(m²+rad²)/s³]": [0.194],
    }  # fmt: skip


def test_guo_paths_and_tracking_error(guo: dict[str, Figure]) -> None:
    space, over_time = guo["Figure 14"].axes
    assert len(circles(over_time)) == 3 and circles(over_time)[2][-1] == approx([6.189, 949.98])
    assert [space.get_xlabel(), space.get_ylabel()] == ["x [mm]", "y [mm]"]
    assert len(guo["Figure 6"].axes[0].lines) == 1 + 2 * 11 + 2 + 1  # path, frames and their key, Table 6
    table_7 = next(line for line in guo["Figure 15"].axes[0].lines if "Table 7" in str(line.get_label()))
    assert float(np.max(table_7.get_ydata())) == approx(0.2933, abs=1e-3)  # [mm], as printed; Table 7 is rounded


# --- Zhu ---


@pytest.fixture(scope="module")
def zhu() -> dict[str, Figure]:
    points = rotor_353.via_points(rotor_353.ZhuWang())
    of = draft("rotor-353")
    ours, theirs = (Motion(polynomial_353(points, t), m10id.JOINTS) for t in ([0.5, 0.6, 0.7], rotor_353.PHASES))
    rotor_353_figures.motions(of, ours, theirs)
    rng = np.random.default_rng(0)
    followed = []
    for joint in m10id.JOINTS:
        one = Followed(joint, 1.0)
        for schedule in ("as_printed", "repaired", "linear"):
            one.best[schedule] = [1.0 + np.sort(rng.random(40))[::-1] for _ in range(3)]
            one.times[schedule] = rng.random((40, 3))
        followed.append(one)
    rotor_353_figures.swarms_alone(of, followed)
    rotor_353_figures.swarms_together(of, {"PSO linear": followed[0].best["linear"]}, 1.0)
    return drawn(of)


def test_zhu_every_figure_is_made(zhu: dict[str, Figure]) -> None:
    assert list(zhu) == [one.number for one in rotor_353_figures.FIGURES]


def test_zhu_joints_pass_table_2_at_the_published_times(zhu: dict[str, Figure]) -> None:
    for j, axes in enumerate(zhu["Figure 3"].axes):
        (points,) = circles(axes)
        assert points[:, 0] == approx([0.0, 0.311, 0.971, 2.647])
        assert points[:, 1] == approx(rotor_353.TABLE_2.to_numpy()[j])
        theirs = lines(axes)[1]
        assert np.interp(points[:, 0], *theirs.T) == approx(points[:, 1], abs=1e-6)
    assert [label for _, label in labels(zhu["Figure 4"])[::3]] == ["velocity [deg/s]"] * 2
    bounds = [line[0, 1] for line in lines(zhu["Figure 5"].axes[1]) if len({*line[:, 1]}) == 1]
    assert sorted(bounds) == [-420.0, 420.0]


def test_zhu_swarms_show_particles_convergence_and_thirty_iterations(zhu: dict[str, Figure]) -> None:
    times, convergence = zhu["Figure 1"].axes
    assert len(times.lines) == 2 * 3 and len(convergence.lines) == 3 + 2
    assert [30.0, 30.0] in [line[:, 0].tolist() for line in lines(convergence)]
    assert [1.0, 1.0] in [line[:, 1].tolist() for line in lines(convergence)]
    whole = zhu["Swarms, every joint alone"]
    assert len(whole.axes) == 6 and all(axes.get_yscale() == "log" for axes in whole.axes)


# --- El Haiek ---


@pytest.fixture(scope="module")
def haiek() -> dict[str, Figure]:
    problem = problems.load("wrist-obstacle", branch="0")
    rng = np.random.default_rng(3)
    ours, genetic = (trajectory_of(problem, problem.guess(rng)) for _ in range(2))
    of = draft("wrist-obstacle")
    runs = [np.linspace([12.0, 4.0, 8.0], [4.8, 1.5, 3.3], 60) + k for k in (0.0, 0.1)]
    courses = Courses({"the feasible first": runs, "death penalty, as (19)": runs[:1]}, genetic)
    wrist_obstacle_figures.courses(of, courses, {"fitness": 4.47, "time": 1.33, "distance": 3.14}, "8.1", "0.2")
    wrist_obstacle_figures.motions(of, problem, ours, genetic)
    return drawn(of)


def test_haiek_every_figure_is_made_with_what_is_printed(haiek: dict[str, Figure]) -> None:
    assert list(haiek) == [f"Figure {n}" for n in range(3, 10)]
    fitness, time, distance = (haiek[f"Figure {n}"].axes[0] for n in (4, 8, 9))
    flat = [{line[0, 1] for line in lines(ax) if len({*line[:, 1]}) == 1} for ax in (fitness, time, distance)]
    assert flat == [{4.47, 8.1}, {1.33, 0.2}, {3.14}]
    assert [46.0, 46.0] in [line[:, 0].tolist() for line in lines(fitness)]
    units = [ax.get_ylabel().split(",")[0] for ax in (fitness, time, distance)]
    assert units == ["fitness [-]", "time of the motion [s]", "distance of the joints [rad]"]


def test_haiek_joints_and_the_way_past_the_obstacle(haiek: dict[str, Figure]) -> None:
    assert [label for _, label in labels(haiek["Figure 6"])] == ["velocity [rad/s]", "", ""]
    space, above = haiek["Figure 3"].axes
    assert sorted(map(tuple, np.concatenate(circles(above)).tolist())) == [(-1.0, 1.0), (0.5, 0.5), (1.0, 1.0)]
    (obstacle,) = above.patches
    assert (obstacle.center, obstacle.radius) == ((0.5, 0.5), 0.4)  # type: ignore[attr-defined]
    way = lines(above)[0]
    assert way[[0, -1]] == approx(np.array([[-1.0, 1.0], [1.0, 1.0]]))


# --- Ogbemhe ---


@pytest.fixture(scope="module")
def ogbemhe() -> dict[str, Any]:
    """How each figure is drawn: twelve of them are alike, and take a second together."""
    problem = problems.load("weld-bezier", case="air-move")
    ends = np.radians(np.array([[0.0, -90.0, 100.0, 0.0, 60.0, 0.0], [30.0, -65.0, 105.0, 45.0, 50.0, 40.0]]))
    states = [np.vstack([q, np.zeros((4, 6))]) for q in ends]
    motion = Motion(nonic(states, np.array([5.0])), kr90.JOINTS)
    of = draft("weld-bezier")
    for method in ("MOGA", "HMOGA"):
        weld_bezier_figures.motions(of, problem, method, motion, "", motion)
    history = {name: np.linspace(1.0, 0.2, 30) for name in ("spread", "average distance", "hypervolume")}
    values = np.random.default_rng(0).random((9, 2))
    distances = np.append(values[1:, 0], np.inf)
    went = Generations(pd.DataFrame(history), 60, 10, 1e-3, values, distances)
    weld_bezier_figures.generations(of, ("air_time", "dynamic_effort"), went)
    return {one.listed.number: one.draw for one in of.finish(()).figures if one.draw is not None}


def test_ogbemhe_every_figure_is_made_with_the_printed_cells(ogbemhe: dict[str, Any]) -> None:
    assert list(ogbemhe) == [f"Figure {n}" for n in range(8, 22) if n != 13]
    first = [axes.texts[0].get_text() for axes in ogbemhe["Figure 10"]().axes]
    assert first[0] == "paper: mean −56.3, max. −33.1" and len(first) == 6
    assert not any(axes.texts for axes in ogbemhe["Figure 14"]().axes)  # Table 8 repeats Table 9's numbers
    units = {n: ogbemhe[f"Figure {n}"]().axes[0].get_ylabel() for n in (9, 11, 20)}
    assert units == {9: "snap [deg/s⁴]", 11: "torque [N m]", 20: "jerk [deg/s³]"}


def test_ogbemhe_generations_say_how_far_they_came(ogbemhe: dict[str, Any]) -> None:
    axes: list[Axes] = ogbemhe["Figure 8"]().axes
    assert [round(float(line[0, 1]), 4) for ax in axes[:2] for line in lines(ax) if len(line) == 2] == [0.037, 0.0171]
    shares = [bar.get_width() for bar in axes[5].patches]  # type: ignore[attr-defined]
    assert shares == approx([50.0, 100.0 * 1e-3 / (0.8 / 29)])
