"""Large values show in a few lines at a prompt, and as tables in a notebook."""

from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import pytest

import ocp_traj as ot
from ocp_traj import problems
from tests.closed_form import quintic_problem
from tests.test_front import front_of


def assert_short(value: Any, *words: str) -> None:
    lines = repr(value).splitlines()
    assert len(lines) <= 8 and max(map(len, lines)) <= 120
    for word in words:
        assert word in repr(value)


def tables(value: Any) -> list[list[list[str]]]:
    """Cells of each table of the HTML, which pandas writes as sound XML; rows of column names come first."""
    root = ElementTree.fromstring(f"<div>{value._repr_html_()}</div>")
    return [[[cell.text or "" for cell in row] for row in table.iter("tr")] for table in root.iter("table")]


@pytest.fixture(scope="module")
def solution() -> ot.Solution:
    return ot.solve(quintic_problem(), objective="time", starts=1)


@pytest.mark.slow
@pytest.mark.parametrize("id", problems.names())
def test_a_problem_shows_in_a_few_lines_and_as_tables(id: str) -> None:
    problem = problems.load(id)
    assert_short(problem, f"Problem {id}: {problem.about.title}", f"{problem.size}: ", "position-limit", "time [s]")
    variables, objectives, limits, points = tables(problem)
    assert variables[0] == ["", "id", "label", "lower", "upper", "unit", "eq"]
    assert [row[1] for row in objectives] == ["id", *(o.id for o in problem.objectives)]
    assert {row[1] for row in limits[1:]} <= {c.id for c in problem.requirements.path_constraints} | {"..."}
    assert [row[1] for row in points] == ["id", *(c.id for c in problem.requirements.point_constraints)]


def test_a_problem_of_six_fields_shows_as_well() -> None:
    plain = quintic_problem()
    bare = ot.Problem("bare", plain.variables, plain.curve, plain.objectives, plain.requirements, plain.guess)
    assert repr(bare).splitlines()[0] == "Problem bare"
    assert_short(bare, "1: T", "curve       1 joint\n", "velocity-limit")


def test_a_solution_and_its_trajectory_show_values_with_units_and_the_verdict(solution: ot.Solution) -> None:
    value = solution.objectives["time"]
    assert_short(solution, "Solution of quintic: solved", f"time {value:.6g} s", "outcome     proved: every limit")
    values, rows = tables(solution)
    assert values[1] == ["0", "time", f"{value:.6f}", "s"]
    verdict = rows[0].index("verdict")
    assert {(row[1], row[verdict]) for row in rows[1:]} == {
        ("velocity-limit", "proved"), ("acceleration-limit", "proved"), ("T", "checked")
    }  # fmt: skip

    assert solution.trajectory is not None
    assert_short(solution.trajectory, f"Trajectory of quintic: {value:.6g} s", "1 segment, up to degree 5")
    (extrema,) = tables(solution.trajectory)
    place = extrema[0].index("v") * 2  # least and largest of q, then those of v
    assert float(extrema[-1][place]) == pytest.approx(15.0 / 8.0 * float(extrema[-1][2]) / value, abs=1e-6)


def test_a_solve_without_a_trajectory_says_why() -> None:
    found = ot.solve(problems.load("hybrid-spline", payload=13.0))
    assert_short(found, "infeasible", "no trajectory meets these limits together: effort-limit")
    assert len(tables(found)) == 1


def test_a_long_message_is_cut_to_the_line(solution: ot.Solution) -> None:
    assert_short(
        replace(solution, audit=None, detail="word " * 99, interrupted="after 1 of 9 starts"), " ..", "after 1"
    )


def test_a_front_shows_its_ranges_and_its_table_without_the_variables() -> None:
    front = front_of([(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)])
    assert_short(front, "Front of chooser: 3 points, 3 proved", "f1 [s] 1 to 3 (min), f2 [s]", "given")
    (table,) = tables(front)
    assert [row[1] for row in table if row[-1] == "proved"] == ["1.0", "2.0", "3.0"]
    assert "margin" in table[0] and not set(table[0]) & {f"{v.id} [{v.unit}]" for v in front.problem.variables}
    assert_short(replace(front, points=()), "0 points")
    assert "<table" in replace(front, points=())._repr_html_()
