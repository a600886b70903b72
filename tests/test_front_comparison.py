"""Fronts side by side: figures by hand, one box for all, refusals that name the difference."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from ocp_traj.cli.commands import run as run_command
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.io import plot_fronts as plots
from ocp_traj.io.store import save_run
from ocp_traj.proof.verdicts import PROVED, VIOLATED
from ocp_traj.results.front import Front, FrontPoint
from ocp_traj.results.front_comparison import compare_fronts, require_alike
from ocp_traj.results.trajectory import trajectory_of
from tests.closed_form import quintic_problem


@pytest.fixture(scope="module")
def problem() -> Problem:
    return quintic_problem()


def front_of(
    problem: Problem, values: Sequence[Sequence[float]], names: tuple[str, str] = ("time", "effort"), **options: object
) -> Front:
    """A front with values of our choice; their trajectories do not matter here."""
    path = trajectory_of(problem, np.array([3.0]))
    points = tuple(
        FrontPoint(np.array([3.0]), dict(zip(names, map(float, v[:2]), strict=True)), path, 0.0,
                   VIOLATED if len(v) > 2 else PROVED)
        for v in values
    )  # fmt: skip
    return Front(problem, names, points, "made", 0, 1.5, options)


def test_figures_by_hand(problem: Problem) -> None:
    """Two points against one that dominates the second, in a box of 4 by 4."""
    a, b = front_of(problem, [(1, 3), (3, 2)], iterations=7), front_of(problem, [(2, 1)])
    found = compare_fronts({"a": a, "b": b}, reference={"time": 4.0, "effort": 4.0}, ideal=(0.0, 0.0))
    assert found.table.loc["a", "hypervolume"] == pytest.approx(4 / 16)  # 3 x 1 and 1 x 1
    assert found.table.loc["b", "hypervolume"] == pytest.approx(6 / 16)
    # Best of all: (1, 3) and (2, 1). From the second a lacks 0 and 2, or 1 and 1, of 4; from the first b lacks 1 and 0.
    assert found.table.loc["a", "IGD+"] == pytest.approx((0.0 + np.sqrt(2.0) / 4.0) / 2.0)
    assert found.table.loc["b", "IGD+"] == pytest.approx((1.0 / 4.0 + 0.0) / 2.0)
    assert found.coverage.loc["b", "a"] == 0.5 and found.coverage.loc["a", "b"] == 0.0
    assert found.table.loc["a", "iterations"] == 7 and np.isnan(float(found.table.loc["b", "iterations"]))  # type: ignore[arg-type]
    assert found.reference_from == found.ideal_from == "given"


def test_figures_do_not_depend_on_the_order_of_objectives_or_runs(problem: Problem) -> None:
    rng = np.random.default_rng(0)
    fronts = {name: front_of(problem, rng.uniform(0.0, 5.0, (12, 2)).tolist()) for name in "abc"}
    swapped = {
        name: front_of(problem, [(p.objectives["effort"], p.objectives["time"]) for p in front.points],
                       ("effort", "time"))
        for name, front in fronts.items()
    }  # fmt: skip
    box = {"time": 4.0, "effort": 4.0}, {"time": 0.0, "effort": 0.5}
    one, other = compare_fronts(fronts, *box), compare_fronts(dict(reversed(swapped.items())), *box)
    for name in "abc":
        for figure in ("hypervolume", "IGD+", "points"):
            assert one.table.loc[name, figure] == pytest.approx(other.table.loc[name, figure], rel=1e-12)
        for second in set("abc") - {name}:
            assert one.coverage.loc[name, second] == other.coverage.loc[name, second]
    mixed = compare_fronts({"a": fronts["a"], "s": swapped["a"]}, *box)
    np.testing.assert_array_equal(mixed.points["a"], mixed.points["s"])
    assert mixed.table["IGD+"].tolist() == pytest.approx([0.0, 0.0], abs=1e-15)


def test_corners_are_the_problems_or_else_of_all_points_and_unproved_points_do_not_count(problem: Problem) -> None:
    bare = replace(problem, reference_point={}, best_values={})
    a = front_of(bare, [(1, 3), (2, 2), (0.1, 0.1, 0)])  # the last is not proved
    b = front_of(bare, [(3, 1)])
    found = compare_fronts({"a": a, "b": b})
    assert found.table["points"].tolist() == [2, 1]
    assert found.ideal == {"time": 1.0, "effort": 1.0} and found.reference == pytest.approx(
        {"time": 3.2, "effort": 3.2}
    )
    assert found.reference_from == found.ideal_from == "of all fronts together"
    named = replace(problem, reference_point={"time": 9.0, "effort": 9.0}, best_values={})
    found = compare_fronts({"a": front_of(named, [(1, 3)]), "b": front_of(named, [(3, 1)])})
    assert found.reference == {"time": 9.0, "effort": 9.0} and found.reference_from == "the problem's"


def test_an_objective_that_is_made_large_counts_that_way(problem: Problem) -> None:
    larger = replace(
        problem, objectives=tuple(replace(o, sense="max") if o.id == "effort" else o for o in problem.objectives)
    )
    a, b = front_of(larger, [(1, 3)]), front_of(larger, [(1, 2)])
    found = compare_fronts({"a": a, "b": b}, reference=(2.0, 1.0), ideal=(0.0, 5.0))
    assert found.coverage.loc["a", "b"] == 1.0 and found.coverage.loc["b", "a"] == 0.0
    assert found.table.loc["a", "hypervolume"] == pytest.approx(0.5 * 0.5)
    assert found.points["a"].tolist() == [[1.0, 3.0]]


def test_what_cannot_be_compared_is_refused_with_the_difference(problem: Problem) -> None:
    front = front_of(problem, [(1, 3)])
    with pytest.raises(InputError, match="give two or more"):
        compare_fronts({"a": front})
    with pytest.raises(InputError, match="none of a, b has a proved point"):
        compare_fronts({"a": front_of(problem, []), "b": front_of(problem, [(1, 1, 0)])})
    with pytest.raises(InputError, match="problem is .* in a and 'other' in b"):
        compare_fronts({"a": front, "b": replace(front, problem=replace(problem, id="other"))})
    with pytest.raises(InputError, match="ideal is not better than the reference in 'effort'"):
        compare_fronts({"a": front, "b": front}, reference=(4.0, 1.0), ideal=(0.0, 2.0))
    same = {"problem": "p", "objectives": ["x", "y"]}
    task = {"name": "one", "robot": {"payload": {"mass": 1.0}}, "move": [{"to": [1, 2]}, {"to": [3, 4]}]}
    other = {"name": "two", "robot": {"payload": {"mass": 2.0}}, "move": [{"to": [1, 2]}, {"to": [3, 5]}]}
    with pytest.raises(InputError) as error:
        require_alike({"a": {**same, "case": task}, "b": {**same, "case": other}})
    words = str(error.value)
    assert "case.robot.payload.mass is 1.0 in a and 2.0 in b" in words
    assert "case.move[1].to is [3, 4] in a and [3, 5] in b" in words and "name" not in words
    require_alike({"a": {**same, "case": task}, "b": {**same, "objectives": ["y", "x"], "case": {**task, "name": "n"}}})
    with pytest.raises(InputError, match=r"objectives is \['x', 'y'\] in a and \['x', 'z'\] in b"):
        require_alike({"a": {**same, "case": task}, "b": {**same, "objectives": ["x", "z"], "case": task}})


def test_the_picture_has_every_front(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(plots, "save_figure", lambda figure, path: drawn.append(figure) or Path(path))
    fronts = {"first": front_of(problem, [(1, 3), (2, 2)]), "second": front_of(problem, [(3, 1)])}
    plots.plot_fronts(compare_fronts(fronts, (4.0, 4.0), (0.0, 0.0)), problem, "x.png")
    (axes,) = drawn[0].axes
    shown = {str(c.get_label()).split(" ")[0]: np.asarray(c.get_offsets()).tolist() for c in axes.collections}
    assert shown == {"first": [[1.0, 3.0], [2.0, 2.0]], "second": [[3.0, 1.0]]}


@pytest.mark.slow
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from ocp_traj import problems

    problem = problems.load("hybrid-spline", payload=8.0)
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    runs = []
    for name, factors in (("a", (1.0, 1.3)), ("b", (1.1, 1.2, 1.6))):
        front = Front.of(problem, ["time", "energy"], [s * h for s in factors], method="dilated", seed=0, seconds=2.0)
        runs.append(str(save_run(front, tmp_path / name)))
    picture = tmp_path / "both.svg"
    assert run_command(["compare", *runs, "--json", "-o", str(picture)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [run["points"] for run in found["runs"]] == [2, 3] and found["reference_from"] == "the problem's"
    assert set(found["coverage"][runs[0]]) == {runs[1]} and all(run["igd_plus"] > 0.0 for run in found["runs"])
    assert all(name in picture.read_text() for name in runs)
    assert run_command(["compare", *runs]) == 0
    assert "share of the column's points" in capsys.readouterr().out
    other = problems.load("hybrid-spline", payload=7.0)
    front = Front.of(other, ["time", "energy"], [h], method="dilated", seed=0, seconds=2.0)
    for arguments, words in (
        ([runs[0], str(save_run(front, tmp_path / "c"))], "case.payload is 8.0"),
        ([runs[0]], "give two or more"),
        ([runs[0], runs[0]], "twice"),
        ([*runs, "-o", "x.txt"], "a picture is written as"),
        ([*runs, "--reference", "1"], "give one for each"),
    ):
        assert run_command(["compare", *arguments]) == 2
        assert words in capsys.readouterr().err
