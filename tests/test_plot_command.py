"""``ocp-traj plot``: what is drawn follows from what the arguments are; what does not belong together is refused."""

import re
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from ocp_traj import problems
from ocp_traj.cli.commands import run
from ocp_traj.io import plot, plot_convergence, plot_fronts
from ocp_traj.io.plot import limit_panel
from ocp_traj.io.plot_convergence import read_histories, save_history
from ocp_traj.io.plot_style import COLOURS, LIMIT, STYLE, save_figure, styled
from ocp_traj.io.store import save_run
from ocp_traj.results.front import Front

HISTORY = pd.DataFrame({"evaluations": [30, 60], "best": [2.5, np.nan], "violation": [0.0, 0.0]})


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs of one problem, a trajectory of it and two histories."""
    folder = tmp_path_factory.mktemp("plots")
    problem, h = problems.load("hybrid-spline"), np.array(problems.module("hybrid-spline").TABLE_7)
    for name, factors in (("a", (1.0, 1.3)), ("b", (1.1, 1.6))):
        xs = [factor * h for factor in factors]
        front = Front.of(problem, ["time", "energy"], xs, method="dilated", seed=None, seconds=0.0)
        save_run(front, folder / name)
        front.trajectory(1).save(folder / f"{name}.json")
    for name in ("first", "second"):
        save_history(HISTORY.rename_axis("generation"), folder / f"{name}.csv", "time [s]")
    (folder / "words.txt").write_text("no trajectory")
    (folder / "other.csv").write_text("evaluations,least\n1,2\n")
    return folder


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """The figures that were drawn, instead of their files."""
    drawn: list[Figure] = []

    def keep(figure: Figure, path: str | Path) -> Path:
        drawn.append(figure)
        return Path(path)

    for module in (plot, plot_convergence, plot_fronts):
        monkeypatch.setattr(module, "save_figure", keep)
    return drawn


def labels(figure: Figure) -> list[str]:
    boxes = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [text.get_text() for box in boxes if box is not None for text in box.get_texts()]


@pytest.mark.parametrize(
    ("names", "told", "axis"),
    [
        (["a"], ["proved (2)", "paper: NSGA-II, best", "paper: fmincon"], ("time [s]", "energy [N² m²/s]")),
        (["a", "b"], [" (2), hypervolume"], ("time [s]", "energy [N² m²/s]")),
        (["a.json"], ["value", "knot"], ("", "position-limit")),
        (["a.json", "b.json"], ["a", "b", "limit (written above where far away)"], ("", "position-limit")),
        (["first.csv", "second.csv"], ["first", "second"], ("evaluations", "best time [s]")),
    ],
)
def test_what_is_drawn_follows_from_the_arguments(
    place: Path, figures: list[Figure], names: list[str], told: list[str], axis: tuple[str, str]
) -> None:
    assert run(["plot", *(str(place / name) for name in names), "-o", str(place / "p.svg")]) == 0
    (figure,) = figures
    assert all(any(word in label for label in labels(figure)) for word in told)
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == axis


@pytest.mark.parametrize(
    ("names", "picture", "words"),
    [
        (["none"], "p.png", "there is no .*none; give a run folder, a trajectory or a history"),
        (["a"], "p.gif", "a picture is written as .png, .pdf, .svg; 'p.gif' ends otherwise"),
        (["a", "a.json"], "p.png", "not of several kinds: .*a is of run folders, .*a.json is of trajectories"),
        (["a", "a"], "p.png", "is given twice; give each once"),
        (["words.txt"], "p.png", "words.txt"),
        (["other.csv"], "p.png", "is no history: it has no table with columns evaluations, best"),
        (["first.csv"], "nowhere/p.png", "cannot write .*nowhere"),
        (["a/trajectories"], "p.png", "run.json"),
    ],
)
def test_bad_input_is_one_line(
    place: Path, names: list[str], picture: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plot", *(str(place / name) for name in names), "-o", str(place / picture)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert re.search(words, line), line
    assert not (place / picture).exists()


def test_trajectories_of_different_limits_share_no_picture(
    tmp_path: Path, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (place / "a.json").read_text().replace('"case": {}', '"case": {"payload": 5.0}').replace("10.0\n", "5.0\n")
    (tmp_path / "c.json").write_text(text)
    assert run(["plot", str(place / "a.json"), str(tmp_path / "c.json"), "-o", str(tmp_path / "p.png")]) == 2
    assert "is of another problem or case than" in capsys.readouterr().err


def test_histories_keep_their_objective_their_gaps_and_their_parts(tmp_path: Path) -> None:
    parts = HISTORY.assign(part=["J1", "J2"])
    save_history(parts, tmp_path / "h.csv", "time [s]")
    found = read_histories([tmp_path / "h.csv"])
    assert list(found) == ["h, J1", "h, J2"]
    assert found["h, J1"]["best"].tolist() == [2.5] and np.isnan(found["h, J2"]["best"]).all()
    assert set(found["h, J1"]["objective"]) == {"time [s]"}


@pytest.mark.slow
def test_a_picture_has_the_same_bytes_and_the_one_style_whatever_the_users(tmp_path: Path) -> None:
    @styled
    def draw(name: str) -> bytes:
        figure = Figure(figsize=(2, 2))
        figure.subplots().plot([0, 1], [1, 0])
        return save_figure(figure, tmp_path / name).read_bytes()

    for name in ("one.svg", "one.pdf", "one.png"):
        with matplotlib.rc_context({"lines.linewidth": 9.0, "font.size": 20.0}):
            first = draw(name)
        assert first == draw(f"other{name[3:]}"), name
    assert matplotlib.rcParams["lines.linewidth"] != STYLE["lines.linewidth"]


def test_limits_have_a_colour_that_no_line_has() -> None:
    problem = problems.load("hybrid-spline")
    limit = problem.requirements.path_constraints[0]
    axes: Any = Figure().subplots()
    times = np.linspace(0.0, 1.0, 5)
    limit_panel(axes, [(times, np.full(5, 0.3 + 0.01 * i)) for i in range(8)], limit, 0)
    styles = {(line.get_color(), str(line._dash_pattern)) for line in axes.lines[:8]}
    assert len(styles) == 8 and all(colour in COLOURS and colour != LIMIT for colour, _ in styles)
