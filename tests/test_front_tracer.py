"""Traced fronts: proved, non-dominated, on the closed form where there is one, and better than NSGA-II's."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj import problems
from ocp_traj.errors import InputError, NoSolutionFound, UnknownName
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, Scalarisation
from ocp_traj.proof.audit import audit_all
from ocp_traj.results.front import Front
from ocp_traj.results.pareto_set import ParetoSet
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


@pytest.fixture(scope="module")
def lattice() -> ParetoSet:
    return FrontTracer(points=18).pareto(stairs_problem(), ["time", "first", "second"])


def test_a_lattice_of_three_objectives_gives_proved_non_dominated_points(lattice: ParetoSet) -> None:
    """15 directions of 4 partitions, the 3 corners known already, and the ends: 3 + 12; 3 of finer lattices."""
    problem = stairs_problem()
    f = values(problem, lattice, ["time", "first", "second"])
    assert len(f) == 18
    assert all(proved(problem, lattice))
    assert not dominated(f).any()


def test_points_of_the_lattice_lie_on_their_directions_from_the_ideal(lattice: ParetoSet) -> None:
    """(f - ideal) / (span direction) is one number, gamma, for every objective whose direction is not zero."""
    f = values(stairs_problem(), lattice, ["time", "first", "second"])
    ends, rest = f[:3], f[3:15]
    low, span = ends.min(axis=0), np.ptp(ends, axis=0)
    shares = (rest - low) / span
    shares /= shares.sum(axis=1)[:, None]
    inner = shares[(shares > 0.05).all(axis=1)]
    assert len(inner) == 3  # (2, 1, 1)/4 and its turns
    expected = np.array([[0.5, 0.25, 0.25], [0.25, 0.5, 0.25], [0.25, 0.25, 0.5]])
    for direction in expected:
        assert np.abs(inner - direction).max(axis=1).min() < 1e-5


def test_points_of_the_lattice_lie_within_the_reference_box() -> None:
    """A box that cuts the stairs' front: without its bounds on every solve, directions lead out of it."""
    problem = stairs_problem()
    names = ["time", "first", "second"]
    free = values(problem, FrontTracer(points=12).pareto(problem, names), names)
    corner = np.median(free, axis=0) * 1.05
    boxed = replace(problem, reference_point=dict(zip(names, corner.tolist(), strict=True)))
    assert (free > corner).any()
    assert (values(boxed, FrontTracer(points=12).pareto(boxed, names), names) <= corner * (1 + 1e-9)).all()


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
def test_a_lattice_of_three_objectives_of_the_hybrid_robot_is_non_dominated(hybrid: Problem) -> None:
    names = ["time", "energy", "jerk"]
    found = FrontTracer(points=16, starts=1).pareto(hybrid, names)
    assert len(_check_front(hybrid, found, names)) >= 10
