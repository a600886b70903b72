from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from pytest import approx

from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.io import plot
from ocp_traj.io.plot import plot_front, plot_trajectory
from ocp_traj.io.plot_style import LIMIT, pretty
from ocp_traj.results.front import Front
from ocp_traj.results.trajectory import Trajectory


@pytest.fixture(scope="module")
def problem() -> Problem:
    return problems.load("hybrid-spline")


def front_of(problem: Problem, names: list[str], **options: Any) -> Front:
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    xs = [factor * h for factor in (1.0, 1.15, 1.3, 1.6)]
    return Front.of(problem, names, xs, method="dilated", seed=None, seconds=0.0, **options)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were drawn, instead of their files."""
    drawn: list[Figure] = []

    def keep(figure: Figure, path: str | Path) -> Path:
        drawn.append(figure)
        return Path(path)

    monkeypatch.setattr(plot, "save_figure", keep)
    return drawn


def visible(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.axes if axes.axison]


def legend(figure: Figure) -> list[str]:
    found = [axes.get_legend() for axes in figure.axes]
    return [text.get_text() for box in found if box is not None for text in box.get_texts()]


def title(figure: Figure) -> str:
    return figure.get_suptitle()


# --- fronts ---


def test_two_objectives_are_drawn_with_units_knee_ideal_and_paper(
    problem: Problem, figures: list[Figure], tmp_path: Path
) -> None:
    paper = {"best": {"time": 6.189, "energy": 3921.602}}
    front = front_of(problem, ["time", "energy"], info={"paper": paper})
    plot_front(front, tmp_path / "front.png")
    (axes,) = visible(figures[0])
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "energy [N² m²/s]")
    assert legend(figures[0]) == ["proved (4)", "knee", "ideal", "paper: best"]
    drawn = {str(c.get_label()): np.asarray(c.get_offsets()) for c in axes.collections}
    assert drawn["proved (4)"] == approx(front.values)
    assert drawn["knee"][0] == approx(front.values[front.knee()])
    assert drawn["ideal"][0] == approx(front.values.min(axis=0))
    assert drawn["paper: best"][0] == approx([6.189, 3921.602])
    assert title(figures[0]).startswith("hybrid-spline, dilated: 4 points, all proved, smallest margin 0.037")


def test_more_objectives_are_drawn_as_a_grid_of_pairs(problem: Problem, figures: list[Figure], tmp_path: Path) -> None:
    names = ["time", "energy", "jerk", "acceleration"]
    for count, pairs in ((3, 3), (4, 6)):
        plot_front(front_of(problem, names[:count]), tmp_path / "front.png")
        assert len(visible(figures[-1])) == pairs
        assert legend(figures[-1]) == ["proved (4)", "knee", "ideal"]
    bottom = [axes.get_xlabel() for axes in visible(figures[0])[1:]]
    assert bottom == ["time [s]", "energy [N² m²/s]"]


def test_points_that_are_not_proved_are_told_apart(problem: Problem, figures: list[Figure], tmp_path: Path) -> None:
    front = front_of(problem, ["time", "energy"])
    points = (replace(front.points[0], verdict="violated"), replace(front.points[1], verdict="undecided"))
    plot_front(replace(front, points=(*points, *front.points[2:])), tmp_path / "front.png")
    assert legend(figures[0])[:3] == ["proved (2)", "undecided (1)", "violated (1)"]
    assert "all proved" not in title(figures[0]) and "1 violated" in title(figures[0])


def test_an_objective_that_is_maximised_says_so(figures: list[Figure], tmp_path: Path) -> None:
    free = problems.load("hybrid-spline", free_payload=True)
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    xs = [np.append(factor * h, load) for factor, load in ((1.2, 5.0), (1.3, 6.0))]
    front = Front.of(free, ["time", "payload_mass"], xs, method="given", seed=None, seconds=0.0)
    assert len(front) == 2
    plot_front(front, tmp_path / "front.png")
    assert visible(figures[0])[0].get_ylabel() == "payload_mass [kg], more is better"


def test_an_empty_front_says_so(problem: Problem, figures: list[Figure], tmp_path: Path) -> None:
    front = replace(front_of(problem, ["time", "energy"]), points=())
    plot_front(front, tmp_path / "front.png")
    assert "no proved point" in title(figures[0])
    assert [text.get_text() for text in visible(figures[0])[0].texts] == ["no proved point"]


# --- trajectories ---


def line(upper: float, lower: float = -1.0, **options: Any) -> tuple[Trajectory, Requirements]:
    """A joint from 0 to 1 in two segments of 1 s, and its limits."""
    halves = (np.array([[0.0], [0.5]]), np.array([[0.5], [1.0]]))
    trajectory = Trajectory(PiecewiseBezier(np.array([1.0, 1.0]), halves), ("slide",))
    limit = PathConstraint.on_derivative("place", 0, [lower], [upper], ["m"], ["slide"])
    return trajectory, Requirements(("slide",), ("m",), (limit,), **options)


def drawn_bounds(axes: Axes) -> list[float]:
    return sorted(float(np.asarray(x.get_ydata())[0]) for x in axes.lines if x.get_linestyle() == "--")


@pytest.mark.slow
def test_every_row_of_every_path_limit_has_an_axis(problem: Problem, figures: list[Figure], tmp_path: Path) -> None:
    trajectory = front_of(problem, ["time", "energy"]).trajectory(0)
    plot_trajectory(trajectory, problem.requirements, tmp_path / "t.png")
    titles = [axes.get_title(loc="left") for axes in visible(figures[0])]
    assert len(titles) == 5 * 5 + 1
    assert "X_S1 [m/s²]" in titles and "phi_4 [rad/s³]" in titles and "tau5 [N m]" in titles
    names = [axes.get_ylabel() for axes in visible(figures[0]) if axes.get_ylabel()]
    assert names == ["position-limit", "velocity-limit", "acceleration-limit", "jerk-limit", "effort-limit", "yaw"]
    assert title(figures[0]) == "hybrid-spline, 6.19 s; payload 10"
    jerk = next(axes for axes in visible(figures[0]) if axes.get_title(loc="left") == "X_S1 [m/s³]")
    assert jerk.get_title(loc="right") == "limit ±100" and drawn_bounds(jerk) == []


def test_near_bounds_are_drawn_and_far_ones_are_written(figures: list[Figure], tmp_path: Path) -> None:
    for lower, upper, drawn, words in (
        (-1.0, 1.5, [-1.0, 1.5], ""),
        (-7.0, 1.5, [1.5], "limit ≥ −7"),
        (-0.5, np.inf, [-0.5], ""),
        (-np.inf, 40.0, [], "limit ≤ 40"),
        (-40.0, 40.0, [], "limit ±40"),
        (-9.0, 40.0, [], "limit −9 to 40"),
        (-15.0, 0.5, [0.5], "limit ≥ −15"),
        (-40.0, 3.5, [], "limit −40 to 3.5"),  # 2.5 ranges from the data, 0.115 of the scale
        (-50.0, 3.5, [3.5], "limit ≥ −50"),  # as far, but 0.093 of the scale
    ):
        plot_trajectory(*line(upper, lower), tmp_path / "t.png")
        (axes,) = visible(figures[-1])
        assert (drawn_bounds(axes), axes.get_title(loc="right")) == (drawn, words), (lower, upper)
        low, high = axes.get_ylim()
        assert all(low < value < high for value in (0.0, 1.0, *drawn))


def test_the_values_are_the_limits_and_the_knots_are_marked(figures: list[Figure], tmp_path: Path) -> None:
    plot_trajectory(*line(0.75), tmp_path / "t.png")
    (axes,) = visible(figures[0])
    times, values = (np.asarray(data) for data in axes.lines[0].get_data())
    assert values == approx(0.5 * times) and times[-1] == approx(2.0)
    (lines,) = [c for c in axes.collections if c.get_label() == "knots"]
    knots = [float(path.vertices[0, 0]) for path in lines.get_paths()]
    assert knots == approx([0.0, 1.0, 2.0])
    red = [x for x in axes.lines if x.get_color() == LIMIT and x.get_linestyle() == "-"]
    outside = np.asarray(red[0].get_ydata(), dtype=float)
    assert np.nanmin(outside) > 0.75 and np.nanmax(outside) == approx(1.0)


def test_what_meets_its_limit_has_no_red_part(figures: list[Figure], tmp_path: Path) -> None:
    plot_trajectory(*line(1.5), tmp_path / "t.png")
    assert not [x for x in visible(figures[0])[0].lines if x.get_color() == LIMIT and x.get_linestyle() == "-"]


def test_a_constant_is_not_blown_up_to_its_rounding(figures: list[Figure], tmp_path: Path) -> None:
    points = np.array([[0.3], [0.3 + 1e-16], [0.3]])
    trajectory = Trajectory(PiecewiseBezier(np.array([1.0]), (points,)), ("slide",))
    plot_trajectory(trajectory, line(1.0)[1], tmp_path / "t.png")
    low, high = visible(figures[0])[0].get_ylim()
    assert high - low > 1e-5


def test_many_labels_go_on_in_the_next_row(figures: list[Figure], tmp_path: Path) -> None:
    trajectory = line(1.0)[0]
    labels = [f"link {i}" for i in range(8)]
    distances = PathConstraint(
        "distance",
        lambda s: np.ones(8).tolist() * s.q[0],
        np.full(8, -np.inf),
        np.full(8, 2.0),
        ("m",) * 8,
        tuple(labels),
    )
    requirements = Requirements(("slide",), ("m",), (distances,))
    plot_trajectory(trajectory, requirements, tmp_path / "t.png")
    assert [axes.get_title(loc="left") for axes in visible(figures[0])] == [f"{label} [m]" for label in labels]


def test_no_limits_means_nothing_to_draw(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no path limits"):
        plot_trajectory(line(1.0)[0], Requirements(("slide",), ("m",), ()), tmp_path / "t.png")


# --- files ---


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "start"), [("t.png", b"\x89PNG"), ("t.pdf", b"%PDF"), ("t.svg", b"<?xml"), ("T.PNG", b"\x89PNG")]
)
def test_the_suffix_chooses_the_format(tmp_path: Path, name: str, start: bytes) -> None:
    assert plot_trajectory(*line(1.0), tmp_path / name).read_bytes().startswith(start)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_other_suffixes_and_places_are_refused(problem: Problem, tmp_path: Path) -> None:
    front = front_of(problem, ["time", "energy"])
    for name in ("front.jpg", "front"):
        with pytest.raises(InputError, match=f"written as .png, .pdf, .svg; '{name}' ends otherwise"):
            plot_front(front, tmp_path / name)
    with pytest.raises(FileFormatError, match="cannot write .*none"):
        plot_front(front, tmp_path / "none" / "front.png")
    assert list(tmp_path.iterdir()) == []


def test_a_picture_is_not_blank(problem: Problem, tmp_path: Path) -> None:
    pixels = imread(plot_front(front_of(problem, ["time", "energy"]), tmp_path / "front.png"))
    assert pixels.shape[0] > 400 and 0.001 < float((pixels[..., 0] < 0.5).mean()) < 0.5


def test_units_have_raised_exponents() -> None:
    assert [pretty(unit) for unit in ("m/s2", "N2 m2/s", "-")] == ["m/s²", "N² m²/s", "-"]
