from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin, sqrt
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest
from pytest import approx

from ocp_traj import problems
from ocp_traj.cli import sheets
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError, UnknownName
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.results.front import Front
from ocp_traj.results.indicators import knee


@dataclass(frozen=True)
class NoNumbers:
    pass


def position(order: int) -> Any:
    return lambda x, p: x[order]


def chooser(senses: Sequence[str] = ("min", "min"), **changes: Any) -> Problem:
    """A problem whose first variables are its objectives, f1, f2, ..; the last one is a joint that may be -1 to 1."""
    count = len(senses)
    objectives = [Objective(f"f{i + 1}", "s", sense=s, of_variables=position(i)) for i, s in enumerate(senses)]
    objectives.append(Objective("total", "-", terms={"f1": 2.0, "f2": 1.0}))
    labels = (*(f"x{i + 1}" for i in range(count)), "place")
    fields = {
        "variables": (Variable("x", np.full(count + 1, -100.0), np.full(count + 1, 100.0), "m", labels),),
        "reference_point": {"f1": 4.0, "f2": 4.0},
        **changes,
    }
    inside = PathConstraint.on_derivative("range", 0, -1.0, 1.0, ("m",), ("slide",))
    return Problem(
        id="chooser",
        case=NoNumbers(),
        curve=lambda x: PiecewiseBezier(casadi.SX(1.0), (casadi.vertcat(x[count], x[count]),)),
        objectives=tuple(objectives),
        requirements=Requirements(("slide",), ("m",), (inside,)),
        guess=lambda rng: np.zeros(count + 1),
        default_objective="total",
        **fields,
    )


def front_of(values: Any, problem: Problem | None = None, place: float = 0.0, **options: Any) -> Front:
    """The front of points with the given objectives (N, objectives)."""
    points = np.asarray(values, dtype=float)
    chosen = problem or chooser(("min",) * points.shape[1])
    names = [o.id for o in chosen.objectives if o.terms is None]
    xs = [np.append(point, place) for point in points]
    return Front.of(chosen, names, xs, method="given", seed=None, seconds=0.0, **options)


STAIRS = [(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)]


# --- what is kept ---


def test_dominated_points_are_left_out_and_counted_and_the_rest_is_sorted() -> None:
    front = front_of([(3.0, 1.0), (3.0, 3.0), (1.0, 3.0), (2.0, 2.0), (2.0, 2.5)])
    assert front.values.tolist() == [[1.0, 3.0], [2.0, 2.0], [3.0, 1.0]]
    assert front.info["dropped"] == {"violated": 0, "undecided": 0, "dominated": 2}


def test_no_point_dominates_another_and_every_other_one_is_dominated() -> None:
    cloud = np.random.default_rng(1).uniform(0.0, 1.0, (60, 3))
    front = front_of(cloud)
    kept = {tuple(row) for row in front.values}

    def dominates(a: Any, b: Any) -> bool:
        return bool(np.all(np.asarray(a) <= b) and np.any(np.asarray(a) < b))

    assert 3 < len(kept) < 60
    assert not any(dominates(a, b) for a in kept for b in kept)
    assert all(any(dominates(a, b) for a in kept) for b in map(tuple, cloud) if b not in kept)


def test_more_is_better_for_an_objective_that_is_maximised() -> None:
    front = front_of([(1.0, 1.0), (2.0, 5.0), (2.0, 4.0), (3.0, 5.0)], chooser(("min", "max")))
    assert front.values.tolist() == [[1.0, 1.0], [2.0, 5.0]]
    assert front.ideal == {"f1": 1.0, "f2": 5.0}
    assert front.nadir == {"f1": 2.0, "f2": 1.0}


def test_points_closer_than_1e_9_are_one_point() -> None:
    assert len(front_of([(1.0, 3.0), (1.0, 3.0), (1.0 + 1e-10, 3.0 - 1e-10)])) == 1
    assert len(front_of([(1.0, 3.0), (1.0 + 1e-7, 3.0 - 1e-7)])) == 2


def test_violated_points_are_left_out_even_where_they_are_best() -> None:
    problem = chooser()
    xs = [[1.0, 1.0, 1.5], [2.0, 2.0, 0.5]]
    front = Front.of(problem, ["f1", "f2"], xs, method="given", seed=3, seconds=1.5, info={"rounds": 7})
    assert front.values.tolist() == [[2.0, 2.0]]
    assert front.info == {"rounds": 7, "dropped": {"violated": 1, "undecided": 0, "dominated": 0}}
    assert (front.method, front.seed, front.seconds) == ("given", 3, 1.5)
    assert front.points[0].verdict == "proved"
    assert front.points[0].margin == approx(0.5)  # half of the way from 0 to the limit 1 is left


def test_unproved_points_are_kept_with_their_verdict_when_asked_for() -> None:
    front = Front.of(
        chooser(), ["f1", "f2"], [[1.0, 1.0, 1.5]], method="given", seed=None, seconds=0.0, keep_unproved=True
    )
    assert [point.verdict for point in front.points] == ["violated"]
    assert front.points[0].margin == approx(-0.5)
    assert front.info["dropped"]["violated"] == 0


def test_a_point_outside_the_bounds_of_the_variables_is_violated() -> None:
    front = front_of([(1.0, 101.0), (2.0, 100.0)])
    assert front.values.tolist() == [[2.0, 100.0]]
    assert front.info["dropped"]["violated"] == 1


def test_a_point_without_finite_numbers_is_undecided() -> None:
    front = front_of([(np.nan, 1.0), (1.0, np.inf), (2.0, 2.0)], keep_unproved=True)
    assert front.values.tolist() == [[2.0, 2.0]]
    assert front.info["dropped"]["undecided"] == 2


def test_a_sum_of_objectives_can_be_traded() -> None:
    xs = [[1.0, 3.0, 0.0], [2.0, 2.0, 0.0]]
    front = Front.of(chooser(), ["f2", "total"], xs, method="given", seed=None, seconds=0.0)
    assert front.values.tolist() == [[2.0, 6.0], [3.0, 5.0]]
    assert list(front.table.columns[:3]) == ["f1 [s]", "f2 [s]", "total [-]"]


# --- the table ---


def test_the_table_has_units_in_its_columns_and_a_row_a_point() -> None:
    front = front_of(STAIRS)
    table = front.table
    assert list(table.columns) == ["f1 [s]", "f2 [s]", "x1 [m]", "x2 [m]", "place [m]", "margin", "verdict"]
    assert table.index.name == "point"
    assert table["f2 [s]"].tolist() == [3.0, 2.0, 1.0]
    assert table["x1 [m]"].tolist() == [1.0, 2.0, 3.0]
    assert set(table["verdict"]) == {"proved"}
    assert front.units == {"f1": "s", "f2": "s", "x1": "m", "x2": "m", "place": "m"}
    assert len(front) == 3


def test_a_label_used_twice_is_told_apart_by_the_name_of_its_block() -> None:
    blocks = tuple(Variable(name, np.zeros(1), np.ones(1), "m", ("f1",)) for name in ("a", "b", "c"))
    names = list(front_of(STAIRS, chooser(variables=blocks), keep_unproved=True).table.columns)
    assert names == ["f1 [s]", "f2 [s]", "a f1 [m]", "b f1 [m]", "c f1 [m]", "margin", "verdict"]


# --- hypervolume ---


def test_hypervolume_of_a_staircase() -> None:
    # Below (4, 4): 3 x 1 + 2 x 1 + 1 x 1 = 6 of the 3 x 3 box from the own ideal (1, 1), of the 4 x 4 one from (0, 0).
    front = front_of(STAIRS)
    own = front.hypervolume()
    assert (own.value, own.volume) == approx((6.0 / 9.0, 6.0))
    assert own.own_ideal and own.ideal == {"f1": 1.0, "f2": 1.0} and own.reference == {"f1": 4.0, "f2": 4.0}
    given = front.hypervolume(ideal=(0.0, 0.0))
    assert (given.value, given.volume, given.own_ideal) == (approx(6.0 / 16.0), approx(6.0), False)


def test_an_ideal_is_given_or_the_problems_or_that_of_the_ends_or_at_last_the_fronts_own() -> None:
    ends = {"info": {"ideal": {"f1": 0.5, "f2": 0.5}}}
    stored = chooser(best_values={"f1": {"f2": 0.0}, "f2": {"f1": 0.0}})
    measured = [
        front_of(STAIRS, stored, **ends).hypervolume(ideal=(1.0, 1.0)),
        front_of(STAIRS, stored, **ends).hypervolume(),
        front_of(STAIRS, **ends).hypervolume(),
        front_of(STAIRS, chooser(best_values={"f1": {"f2": 0.0}})).hypervolume(),  # it says nothing of f2
    ]
    assert [m.ideal_from for m in measured] == ["given", "problem", "ends", "front"]
    assert [m.value for m in measured] == approx([6.0 / 9.0, 6.0 / 16.0, 6.0 / 3.5**2, 6.0 / 9.0])
    assert [m.own_ideal for m in measured] == [False, False, False, True]
    assert measured[1].to_dict()["ideal_from"] == "problem" and not measured[1].to_dict()["own_ideal"]
    assert front_of([(2.0, 2.0)], stored).hypervolume().value == approx(4.0 / 16.0)  # one point is no full box
    assert front_of([(5.0, 5.0)], stored).hypervolume((-1.0, -1.0)).value == 0.0
    titles = [sheets.front_sheet(front_of(STAIRS), m, Path("run")).tables[0][0] for m in measured]
    assert ["from its own ideal: not comparable" in title for title in titles] == [False, False, False, True]


def test_the_ideal_of_several_objectives_is_the_worst_of_each_ones_best_values() -> None:
    best = {"f1": {"f2": 1.0, "f3": 2.0}, "f2": {"f1": 5.0, "f3": 4.0}, "f3": {"f1": 0.5}}
    problem = chooser(("min", "max", "min"), best_values=best)
    assert problem.ideal_point(["f1", "f2"]) == {"f1": 1.0, "f2": 5.0}
    assert problem.ideal_point(["f2", "f1", "f3"]) == {}  # nothing is known of f3 beside f2
    known = replace(problem, best_values={**best, "f3": {"f1": 0.5, "f2": 0.1}})
    assert known.ideal_point(["f2", "f1", "f3"]) == {"f2": 4.0, "f1": 2.0, "f3": 0.5}


def test_hypervolume_of_a_box_in_three_objectives() -> None:
    front = front_of([(1.0, 1.0, 1.0)])
    measured = front.hypervolume((3.0, 3.0, 3.0), (0.0, 0.0, 0.0))
    assert (measured.value, measured.volume) == approx((8.0 / 27.0, 8.0))


def test_hypervolume_takes_the_sense_of_each_objective() -> None:
    front = front_of([(1.0, 5.0)], chooser(("min", "max")))
    measured = front.hypervolume({"f2": 1.0, "f1": 2.0}, {"f1": 0.0, "f2": 9.0})
    assert (measured.value, measured.volume) == approx((4.0 / 16.0, 4.0))
    assert measured.ideal == {"f1": 0.0, "f2": 9.0}


def test_points_beyond_the_reference_contribute_nothing() -> None:
    front = front_of([*STAIRS, (0.5, 9.0)])
    assert len(front) == 4
    assert front.hypervolume(ideal=(0.0, 0.0)).volume == approx(6.0)
    assert front_of([(5.0, 5.0)]).hypervolume().value == 0.0


def test_a_point_better_than_the_ideal_counts_as_the_ideal() -> None:
    assert front_of([(-5.0, -5.0)]).hypervolume(ideal=(0.0, 0.0)).value == approx(1.0)


def test_hypervolume_names_what_it_lacks() -> None:
    front = front_of([(1.0, 1.0, 1.0)])
    with pytest.raises(InputError, match="reference point has no value for f3, it has f1, f2; give reference="):
        front.hypervolume()
    with pytest.raises(InputError, match="reference point is .* one finite number for each of f1, f2, f3"):
        front.hypervolume((1.0, 2.0))
    with pytest.raises(InputError, match="ideal is not better than its reference in 'f2'"):
        front_of(STAIRS).hypervolume(ideal=(0.0, 4.0))


# --- spread ---


def test_spread_of_equal_gaps_is_zero() -> None:
    line = np.linspace(0.0, 1.0, 9)
    assert front_of(np.stack([line, 50.0 * (1.0 - line)], axis=1)).spread() == approx(0.0, abs=1e-12)
    assert front_of(np.eye(3)).spread() == approx(0.0, abs=1e-12)


def test_spread_of_gaps_one_to_three() -> None:
    # Gaps 1 and 3 about their mean 2: (1 + 1) / (2 x 2).
    assert front_of([(0.0, 4.0), (1.0, 3.0), (4.0, 0.0)]).spread() == approx(0.5)


def test_spread_in_three_objectives_is_of_the_nearest_neighbours() -> None:
    # (0, 0, 1), (0, 1, 0), (1, 0, 0) and (.5, .5, 0): nearest at d, e, e, e with d = sqrt(1.5), e = sqrt(.5).
    far, near = sqrt(1.5), sqrt(0.5)
    mean = (far + 3.0 * near) / 4.0
    expected = (abs(far - mean) + 3.0 * abs(near - mean)) / (4.0 * mean)
    assert front_of([*np.eye(3), (0.5, 0.5, 0.0)]).spread() == approx(expected)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_spread_of_fewer_than_three_points_is_not_a_number(count: int) -> None:
    assert np.isnan(front_of(np.array(STAIRS)[:count]).spread())


# --- knee ---


def test_the_knee_of_a_quarter_circle_is_at_45_degrees() -> None:
    angles = np.linspace(0.0, pi / 2.0, 9)
    front = front_of([(1.0 - cos(t), 70.0 * (1.0 - sin(t))) for t in angles])
    assert front.knee() == 4


def test_the_knee_is_farthest_from_the_line_not_closest_to_the_ideal() -> None:
    # Both sums of (.3, .3) and (.02, .57) say .6 and .59: the second lies farther from the line, the first nearer to 0.
    front = front_of([(0.0, 1.0), (0.02, 0.57), (0.3, 0.3), (1.0, 0.0)])
    assert front.knee() == 1


def test_the_knee_takes_the_sense_of_each_objective() -> None:
    front = front_of([(0.0, 0.0), (1.0, 9.0), (10.0, 10.0)], chooser(("min", "max")))
    assert front.knee() == 1


def test_the_knee_in_three_objectives_bulges_from_the_plane() -> None:
    front = front_of([*np.eye(3), (0.2, 0.2, 0.2), (0.3, 0.3, 0.1)])
    assert front.values[front.knee()].tolist() == [0.2, 0.2, 0.2]


def test_extreme_points_whose_plane_leans_away_from_the_ideal_have_no_knee() -> None:
    """The plane through the first three is (-2 x + 5 y + 5 z) / 3 = 1: more of x would be a merit."""
    points = [[0.0, 0.3, 0.3], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.5, 0.2, 0.25]]
    assert knee(np.array(points)) == 0  # the closest to the ideal, not the last


def test_without_a_bulge_the_knee_is_the_point_closest_to_the_ideal() -> None:
    line = np.linspace(0.0, 1.0, 5)
    assert front_of(np.stack([line, 1.0 - line], axis=1)).knee() == 2
    assert front_of([(0.0, 1.0), (0.9, 0.9), (1.0, 0.0)]).knee() in (0, 2)
    assert front_of([(1.0, 1.0)]).knee() == 0


# --- what goes wrong ---


def test_an_empty_front_says_so() -> None:
    front = front_of([(1.0, 1.0)], place=2.0)
    assert len(front) == 0 and front.values.shape == (0, 2)
    assert list(front.table.columns) == list(front_of(STAIRS).table.columns) and len(front.table) == 0
    assert front.hypervolume().value == 0.0
    for ask in (front.knee, lambda: front.ideal, lambda: front.nadir):
        with pytest.raises(InputError, match="no proved point was found .*'violated': 1"):
            ask()
    with pytest.raises(InputError, match="has 0 points"):
        front.trajectory(0)


def test_unknown_or_too_few_objectives_are_refused() -> None:
    options: dict[str, Any] = {"method": "given", "seed": None, "seconds": 0.0}
    with pytest.raises(UnknownName, match="no objective 'mass'; objectives are f1, f2, total"):
        Front.of(chooser(), ["f1", "mass"], [], **options)
    for names in (["f1"], ["f1", "f1"], []):
        with pytest.raises(InputError, match="two or more different objectives"):
            Front.of(chooser(), names, [], **options)


def test_a_point_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match=r"shape \(2,\); chooser has 3 variables"):
        Front.of(chooser(), ["f1", "f2"], [[1.0, 2.0]], method="given", seed=None, seconds=0.0)


def test_a_point_that_is_not_there_is_refused() -> None:
    with pytest.raises(InputError, match="3 points, numbered from 0; there is no point 3"):
        front_of(STAIRS).trajectory(3)


# --- a published problem ---


def test_a_published_problem_gives_a_front_whose_points_audit_as_they_say() -> None:
    problem = problems.load("hybrid-spline")
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    xs = [factor * h for factor in (1.6, 1.0, 0.3, 1.3)]
    front = Front.of(problem, ["time", "energy"], xs, method="dilated", seed=None, seconds=0.0)
    assert front.table["time [s]"].tolist() == approx([6.19, 8.047, 9.904])  # the sum of Table 7, times the factor
    assert front.info["dropped"] == {"violated": 1, "undecided": 0, "dominated": 0}
    for index in range(3):
        audit = front.audit(index)
        assert audit.proved and audit.margin == approx(front.points[index].margin, rel=1e-6)
    assert front.trajectory(0).duration == approx(6.19)
