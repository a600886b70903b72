"""Traced fronts: proved, non-dominated, on the closed form where there is one, and better than NSGA-II's."""

from dataclasses import replace
from functools import partial
from typing import Any

import moocore
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj import problems
from ocp_traj.api.fronts import _merged_front, pareto
from ocp_traj.errors import InputError, NoSolutionFound, UnknownName
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, GoalAttainment, Scalarisation
from ocp_traj.proof.audit import audit_all
from ocp_traj.results.front import Front
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_tracer import FrontTracer
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.closed_form import Quintic, quintic_problem, stairs_problem
from tests.independent.check import broken, excesses

PAIR = ["time", "energy"]


def values(problem: Problem, found: ParetoSet, names: list[str]) -> np.ndarray:
    return np.array([[evaluate_objectives(problem, x)[name] for name in names] for x in found.xs])


def dominated(f: np.ndarray) -> np.ndarray:
    """Which points another one dominates, all objectives to be made small."""
    better = (f[:, None] <= f[None]).all(axis=2) & (f[:, None] < f[None]).any(axis=2)
    return better.any(axis=0)


def hypervolume(f: np.ndarray, ideal: tuple[float, float], reference: tuple[float, float]) -> float:
    """Share of the box that two objectives dominate, by a sweep over the staircase."""
    inside = f[(f < reference).all(axis=1)]
    best, area = reference[1], 0.0
    for first, second in sorted(map(tuple, inside)):
        if second < best:
            area += (reference[0] - first) * (best - second)
            best = second
    return area / ((reference[0] - ideal[0]) * (reference[1] - ideal[1]))


def proved(problem: Problem, found: ParetoSet) -> list[bool]:
    return [a.proved for a in audit_all([trajectory_of(problem, x) for x in found.xs], problem.requirements)]


# --- closed form ---


@pytest.fixture(scope="module")
def quintic_front() -> ParetoSet:
    return FrontTracer(points=9).pareto(quintic_problem(), ["time", "effort"])


def test_the_front_of_the_quintic_has_as_many_points_as_asked_for_all_proved(quintic_front: ParetoSet) -> None:
    problem = quintic_problem()
    assert len(quintic_front.xs) == 9
    assert all(proved(problem, quintic_front))
    assert not dominated(values(problem, quintic_front, ["time", "effort"])).any()
    assert (quintic_front.method, quintic_front.seed, quintic_front.interrupted) == ("trace", 0, False)


def test_the_front_of_the_quintic_ends_at_its_least_time_and_at_the_reference(quintic_front: ParetoSet) -> None:
    t = np.sort(np.array(quintic_front.xs).ravel())
    assert t[0] == pytest.approx(Quintic().least_time, rel=1e-7)
    assert t[-1] == pytest.approx(4.0, rel=1e-7)


def test_points_bisect_the_widest_gap(quintic_front: ParetoSet) -> None:
    """The first cut, of the whole box, halves one of its sides; nine points leave no box of a ninth of its area."""
    c, t = Quintic().effort_constant, np.sort(np.array(quintic_front.xs).ravel())
    low, high = Quintic().least_time, 4.0
    middle_time, middle_effort = (low + high) / 2, (c / ((c / low**3 + c / high**3) / 2)) ** (1 / 3)
    assert min(np.abs(t - middle_time).min(), np.abs(t - middle_effort).min()) < 1e-6
    span = np.array([high - low, c / low**3 - c / high**3])
    areas = np.diff(t) * -np.diff(c / t**3) / span.prod()
    assert areas.max() < 1.0 / 9.0


def test_the_trace_repeats_itself_bit_by_bit(quintic_front: ParetoSet) -> None:
    again = FrontTracer(points=9).pareto(quintic_problem(), ["time", "effort"])
    assert_array_equal(again.xs, quintic_front.xs)
    assert again.info == quintic_front.info


def test_the_order_of_the_objectives_does_not_change_the_ends(quintic_front: ParetoSet) -> None:
    swapped = FrontTracer(points=9).pareto(quintic_problem(), ["effort", "time"])
    assert len(swapped.xs) == 9
    ours, theirs = (np.sort(np.array(s.xs).ravel())[[0, -1]] for s in (quintic_front, swapped))
    assert theirs == pytest.approx(ours, rel=1e-6)


def test_an_objective_to_be_maximised_is_traded_as_well() -> None:
    """The mean speed D/T against the effort: the same curve, from the least time to the bound on effort."""
    case = Quintic()
    problem = replace(quintic_problem(case), reference_point={"speed": 0.25, "effort": 100.0})
    found = FrontTracer(points=6).pareto(problem, ["speed", "effort"])
    t = np.sort(np.array(found.xs).ravel())
    assert len(t) == 6
    assert all(proved(problem, found))
    assert t[0] == pytest.approx(case.least_time, rel=1e-7)
    assert t[-1] == pytest.approx(case.distance / 0.25, rel=1e-7)


def test_objectives_that_do_not_conflict_leave_no_gap_to_fill() -> None:
    """Time and -speed are least together: both ends are that one point, but for what the back-off leaves open."""
    problem = replace(quintic_problem(), reference_point={})
    found = FrontTracer(points=5).pareto(problem, ["time", "speed"])
    assert len(found.xs) == 1 and found.info["conflict"] is False
    assert float(found.xs[0][0]) == pytest.approx(Quintic().least_time, rel=1e-8)


def test_a_gap_as_narrow_as_an_objective_is_told_is_not_filled_and_that_is_said() -> None:
    problem = quintic_problem()
    told = tuple(replace(one, resolution=0.3) if one.id == "time" else one for one in problem.objectives)
    found = FrontTracer(points=40).pareto(replace(problem, objectives=told), ["time", "effort"])
    steps = np.diff(np.sort(np.array(found.xs).ravel()))
    assert 3 < len(found.xs) < 40 and found.info["unresolved"] == {"time": 0.3}
    assert steps.max() <= 0.3 and steps.min() > 1e-3


THREE = ["time", "first", "second"]


@pytest.fixture(scope="module")
def surface() -> ParetoSet:
    return FrontTracer(points=18).pareto(stairs_problem(), THREE)


def test_a_front_of_three_objectives_has_as_many_points_as_asked_for_all_proved(surface: ParetoSet) -> None:
    problem = stairs_problem()
    assert len(surface.xs) == 18
    assert all(proved(problem, surface))
    assert not dominated(values(problem, surface, THREE)).any()
    assert surface.info["points by time scaling"] > 18  # of which the best were kept
    assert surface.info["solves"] <= 18 + 3


def test_points_of_three_objectives_dominate_most_of_what_all_trajectories_do(surface: ParetoSet) -> None:
    """Every (T1, T2) within the limits is on the front: 0.867 of the box between the ends, 18 points 0.795 of it."""
    problem = stairs_problem()
    f = values(problem, surface, THREE)
    grid = np.stack(np.meshgrid(*2 * [np.linspace(0.5, 6.0, 150)]), axis=-1).reshape(-1, 2)
    found = Population(problem, THREE, per_segment=21).evaluate(grid)
    every = found.objectives[(found.violations <= 0.0).all(axis=1)]
    corner = np.array([problem.reference_point[name] for name in THREE])
    ours, all_of_them = (
        moocore.hypervolume((v - f.min(axis=0)) / np.ptp(f, axis=0), ref=np.ones(3)) for v in (f, every)
    )
    assert (f <= corner * (1.0 + 1e-9)).all()
    assert ours > 0.9 * all_of_them


@pytest.mark.slow
def test_a_front_of_three_objectives_repeats_itself_bit_by_bit(surface: ParetoSet) -> None:
    again = FrontTracer(points=18).pareto(stairs_problem(), THREE)
    assert_array_equal(again.xs, surface.xs)
    assert again.info == surface.info


def test_an_objective_that_all_ends_share_is_kept_and_not_traded() -> None:
    """With the first stair's time fixed its effort is one number: what is left is the curve of the second."""
    problem = stairs_problem()
    (blocks,) = problem.variables
    narrow = replace(problem, variables=(replace(blocks, lower=np.array([2.0, 0.5]), upper=np.array([2.0, 6.0])),))
    narrow = replace(narrow, dilate=None)
    found = FrontTracer(points=8).pareto(narrow, THREE)
    assert len(found.xs) >= 7
    assert all(proved(narrow, found))
    assert np.array(found.xs)[:, 0] == pytest.approx(2.0)
    assert not dominated(values(narrow, found, THREE)).any()


@pytest.mark.slow
def test_three_objectives_that_do_not_conflict_have_one_best_point() -> None:
    problem = replace(quintic_problem(), reference_point={})
    twice = replace(problem.objective("speed"), id="twice", scale=2.0)
    found = FrontTracer(points=5).pareto(
        replace(problem, objectives=(*problem.objectives, twice)), ["time", "speed", "twice"]
    )
    assert len(found.xs) == 1 and found.info["conflict"] is False


@pytest.mark.slow
def test_ctrl_c_keeps_the_points_of_three_objectives_that_there_are() -> None:
    def stop(done: int, total: int, words: str) -> None:
        if "dilations" in words:  # the first wave between the ends has come in
            raise KeyboardInterrupt

    found = FrontTracer(points=30, progress=stop).pareto(stairs_problem(), THREE)
    assert found.interrupted
    assert 8 < len(found.xs) <= 30
    assert all(proved(stairs_problem(), found))


class _Aimless(Exchange):
    """Gives up on goal attainment."""

    def solve(self, problem: Problem, scalarisation: Scalarisation, *given: Any, **more: Any) -> Solution:
        found = super().solve(problem, scalarisation, *given, **more)
        if isinstance(scalarisation, GoalAttainment):
            return replace(found, status=Status.ITERATION_LIMIT, audit=None, trajectory=None)
        return found


@pytest.mark.slow
def test_targets_that_are_not_reached_are_given_up_and_the_rays_of_the_ends_stay() -> None:
    found = FrontTracer(points=6, solver=_Aimless()).pareto(stairs_problem(), THREE)
    assert found.info["failed"] >= 6
    assert len(found.xs) == 6
    assert all(proved(stairs_problem(), found))


@pytest.mark.slow
def test_points_of_three_objectives_lie_within_the_reference_box() -> None:
    """A box that cuts the stairs' front: some targets beside it are out of reach."""
    problem = stairs_problem()
    free = values(problem, FrontTracer(points=12).pareto(problem, THREE), THREE)
    corner = np.median(free, axis=0) * 1.05
    boxed = replace(problem, reference_point=dict(zip(THREE, corner.tolist(), strict=True)))
    assert (free > corner).any()
    assert (values(boxed, FrontTracer(points=12).pareto(boxed, THREE), THREE) <= corner * (1 + 1e-9)).all()


class _Stubborn(Exchange):
    """Gives up on every solve for the least of one objective that is not time."""

    def solve(self, problem: Problem, scalarisation: Scalarisation, *given: Any, **more: Any) -> Solution:
        found = super().solve(problem, scalarisation, *given, **more)
        if isinstance(scalarisation, EpsilonConstraint) and scalarisation.minimise == "effort":
            return replace(found, status=Status.ITERATION_LIMIT, audit=None, trajectory=None)
        return found


def test_an_end_that_no_start_reaches_is_replaced_by_a_dilation_of_the_other_and_named() -> None:
    found = FrontTracer(points=4, solver=_Stubborn()).pareto(quintic_problem(), ["time", "effort"])
    assert found.info["unsolved ends"] == ["effort"]
    t = np.sort(np.array(found.xs).ravel())
    assert t[0] == pytest.approx(Quintic().least_time, rel=1e-7)
    assert t[-1] == pytest.approx(2.0 * t[0], rel=1e-6)  # twice as slow is the end of the ray
    assert all(proved(quintic_problem(), found))


# --- bad input, interruption ---


@pytest.mark.parametrize("points", [1, 0, -3])
def test_a_front_of_one_point_is_refused(points: int) -> None:
    with pytest.raises(InputError, match=f"points is {points}; give a whole number, 2 or more"):
        FrontTracer(points=points)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "pair"),
    [
        ("rotor-353", {}, ("time", "effort")),
        ("hybrid-spline", {}, ("time", "energy")),
        ("hybrid-spline", {}, ("jerk", "acceleration")),
        ("wrist-obstacle", {"branch": "0"}, ("time", "clearance")),
        ("weld-bezier", {"case": "air-move"}, ("air_time", "movement")),
    ],
)
def test_ends_of_a_front_reach_the_ideal_point_that_a_problem_stores_and_no_more(
    name: str, changes: dict[str, str], pair: tuple[str, str]
) -> None:
    problem = problems.load(name, **changes)
    found = FrontTracer(points=2, seed=11).pareto(problem, pair).info["ideal"]
    for objective, stored in problem.ideal_point(pair).items():
        sign = 1.0 if problem.objective(objective).sense == "min" else -1.0
        assert sign * stored <= sign * found[objective]
        assert found[objective] == pytest.approx(stored, rel=2e-5)


@pytest.mark.parametrize(("names", "words"), [(["time"], "time"), ([], "none")])
def test_a_front_of_one_objective_is_refused(names: list[str], words: str) -> None:
    with pytest.raises(InputError, match=f"a front trades two or more objectives; got {words}"):
        FrontTracer().pareto(quintic_problem(), names)


def test_an_unknown_objective_is_refused() -> None:
    with pytest.raises(UnknownName, match="quintic has no objective 'cost'"):
        FrontTracer().pareto(quintic_problem(), ["time", "cost"])


def test_an_infeasible_problem_says_which_limits_conflict() -> None:
    problem = quintic_problem(Quintic(velocity=0.1))  # T >= 18.75 s, at most 10 s allowed
    with pytest.raises(NoSolutionFound, match="the one start found no trajectory; the nearest misses .*velocity-limit"):
        FrontTracer(starts=1).pareto(problem, ["time", "effort"])


def test_ctrl_c_keeps_the_points_so_far() -> None:
    def stop(done: int, total: int, words: str) -> None:
        if done == 5:
            raise KeyboardInterrupt

    found = FrontTracer(points=20, progress=stop).pareto(quintic_problem(), ["time", "effort"])
    assert found.interrupted
    assert len(found.xs) == 5


def test_progress_is_told_after_every_start_and_every_point() -> None:
    told: list[tuple[int, int, str]] = []
    found = FrontTracer(points=5, progress=lambda *words: told.append(words)).pareto(
        quintic_problem(), ["time", "effort"]
    )
    assert [done for done, _, _ in told] == [0, 0, 1, 1, 3, 4, 5]
    assert all(total == 5 for _, total, _ in told)
    assert told[0][2] == "the best time, 1 of 2 starts, 0 solves, 0 failed"
    assert told[3][2].startswith("the best effort, 2 of 2 starts, 1 solves, 0 failed")
    t = np.sort(np.array(found.xs).ravel())
    c = Quintic().effort_constant
    share = hypervolume(np.column_stack([t, c / t**3]), (t[0], c / t[-1] ** 3), (4.0, 100.0))
    assert (
        told[-1][2] == f"{found.info['solves'] - 3} solves, 0 failed, hypervolume {share:.4f}"
    )  # 3 are not yet proved


# --- hybrid-spline ---


def _check_front(problem: Problem, found: ParetoSet, names: list[str]) -> np.ndarray:
    """Feasible by a scan that shares nothing with the solver, proved, non-dominated; the values in ascending order."""
    for x in found.xs:
        assert not broken(excesses(trajectory_of(problem, x).to_dict()))
    assert all(proved(problem, found))
    f = values(problem, found, names)
    assert not dominated(f).any()
    return f[np.argsort(f[:, 0])]


def test_a_small_front_of_the_hybrid_robot_is_feasible_proved_and_ends_at_the_reference(hybrid: Problem) -> None:
    found = FrontTracer(points=3, starts=1).pareto(hybrid, PAIR)
    f = _check_front(hybrid, found, PAIR)
    assert len(f) == 3
    assert f[0, 1] == pytest.approx(6000.0, rel=1e-6)  # least time with the energy of the reference
    assert f[-1, 0] == pytest.approx(8.0, rel=1e-6)  # least energy within the time of the reference
    assert f[-1, 1] == pytest.approx(1565.2, abs=0.05)


@pytest.fixture(scope="module")
def forty(hybrid: Problem) -> ParetoSet:
    return FrontTracer(points=40).pareto(hybrid, PAIR)


@pytest.mark.slow
def test_forty_points_are_feasible_proved_and_non_dominated(hybrid: Problem, forty: ParetoSet) -> None:
    assert len(_check_front(hybrid, forty, PAIR)) == 40


@pytest.mark.slow
def test_forty_points_dominate_more_than_nsga2_and_than_the_bound(hybrid: Problem, forty: ParetoSet) -> None:
    """Reference (8 s, 6000), ideal (2.4836 s, 1565.2): 0.708 of the box; NSGA-II with the paper's 100 x 200."""
    box = ((2.4836, 1565.2), (8.0, 6000.0))
    traced = hypervolume(values(hybrid, forty, PAIR), *box)
    genetic = NSGA2(0).pareto(hybrid, PAIR)
    ours = Front.of(hybrid, PAIR, forty.xs, method="trace", seed=0, seconds=0.0)
    assert ours.hypervolume(ideal=dict(zip(PAIR, box[0], strict=True))).value == pytest.approx(traced, rel=1e-9)
    assert traced >= 0.708
    assert traced > hypervolume(values(hybrid, genetic, PAIR), *box)


@pytest.mark.slow
def test_points_of_the_front_are_optimal_whatever_the_start(hybrid: Problem, forty: ParetoSet) -> None:
    """The least energy within a point's time, from two random starts, is the point's energy."""
    f = values(hybrid, forty, PAIR)
    for time, energy in f[np.argsort(f[:, 0])][[5, 20, 35]]:
        scalar = EpsilonConstraint("energy", {"time": float(time)})
        best = Multistart(starts=2, seed=11).solve(hybrid, scalar)
        assert best.objectives["energy"] == pytest.approx(energy, rel=1e-4)


@pytest.mark.slow
def test_three_objectives_of_the_hybrid_robot_dominate_most_of_their_box(hybrid: Problem) -> None:
    """Reference (8 s, 6000, 100), ideal (2.4836 s, 1565.2, 0): 0.612 of the box with 24 points."""
    names = ["time", "energy", "jerk"]
    found = FrontTracer(points=24, starts=1).pareto(hybrid, names)
    f = _check_front(hybrid, found, names)
    assert len(f) == 24
    ideal, reference = np.array([2.4836, 1565.2, 0.0]), np.array([8.0, 6000.0, 100.0])
    assert moocore.hypervolume(np.maximum((f - ideal) / (reference - ideal), 0.0), ref=np.ones(3)) >= 0.60


# --- stopped early ---


@pytest.mark.slow
def test_a_front_whose_time_is_over_before_any_solve_has_what_its_starting_points_give() -> None:
    problem = problems.load("weld-bezier", case="air-move")
    found = FrontTracer(max_seconds=1e-9).pareto(problem, ["air_time", "dynamic_effort"])
    assert found.info["solves"] == 0
    assert 0 < len(found.xs) == found.info["points without a solve"] <= 10
    assert all(proved(problem, found))
    assert not dominated(values(problem, found, ["air_time", "dynamic_effort"])).any()


@pytest.mark.slow
def test_a_stopped_front_keeps_its_solved_points() -> None:
    solved: list[str] = []

    def stop(_: dict[str, Any]) -> None:
        solved.append("")
        if len(solved) == 3:
            raise KeyboardInterrupt

    problem = problems.load("hybrid-spline")
    found = FrontTracer(found=stop).pareto(problem, PAIR)
    f = values(problem, found, PAIR)
    assert len(f) <= 10 and all(proved(problem, found)) and not dominated(f).any()
    whole = values(problem, FrontTracer(2).pareto(problem, PAIR), PAIR)
    assert f[:, 0].min() <= whole[:, 0].min() + 1e-9


@pytest.mark.parametrize(("better", "traced"), [(0.0, False), (-1.0, False), (1.0, True)])
def test_nothing_is_traced_between_ends_that_a_point_of_another_front_dominates(better: float, traced: bool) -> None:
    """``better`` is how far that point is above the ideal point, in shares of it."""
    problem, names = quintic_problem(), ["time", "effort"]
    ideal = FrontTracer(points=2).pareto(problem, names).info["ideal"]
    point = {name: (1.0 + 0.1 * better) * value for name, value in ideal.items()}
    found = FrontTracer(points=5, beside=[point]).pareto(problem, names)
    assert (len(found.xs) == 5) is traced
    assert ("nothing traced" in found.info) is not traced


def test_what_alternatives_leave_of_a_budget_goes_to_those_that_were_stopped() -> None:
    front = pareto(quintic_problem(), ["time", "effort"], points=3)
    stopped = replace(front, info={**front.info, ENDED_AFTER: "3 of 9 points"})
    asked: list[tuple[str, float, int]] = []

    def run(name: str, budget: float, beside: list[Any]) -> Front:
        asked.append((name, budget, len(beside)))
        if name == "slow":
            return stopped if len(asked) == 1 else front
        return front

    runs = {name: partial(run, name) for name in ("slow", "quick")}
    found = _merged_front(quintic_problem(), runs, 100.0, compared=True)
    assert [(name, beside) for name, _, beside in asked] == [("slow", 0), ("quick", 3), ("slow", 3)]
    assert asked[0][1] == pytest.approx(100.0 / 1.5, rel=0.1) and min(asked[1][1], asked[2][1]) > 90.0
    assert ENDED_AFTER not in found.info
