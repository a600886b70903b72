"""Constraint exchange: closed forms, and the hybrid robot's known optima, feasible by an independent scan first."""

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj import problems
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.formulation.scalarise import EpsilonConstraint, GoalAttainment, Scalarisation, WeightedSum
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import slow_down
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange, NotWorth
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.transcription.instants import uniform_instants
from ocp_traj.transcription.nlp import NLP, Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from ocp_traj.transcription.transcription import BACK_OFF, transcribe
from ocp_traj.transcription.worst_instants import worst_instants
from tests.closed_form import Quintic, quintic_problem
from tests.independent.check import broken, excesses
from tests.independent.robots import LINKS, G

TIME, COST = WeightedSum({"time": 1.0}), WeightedSum({"cost": 1.0})
FASTEST = 2.4836242  # [s], least time of hybrid-spline
CHEAPEST, CHEAPEST_LITERAL = 2.550568, 2.957317  # least cost, physical and paper-literal


def solve(problem: Problem, scalar: Scalarisation, seed: int = 0, solver: Exchange | None = None) -> Solution:
    return (solver or Exchange()).solve(problem, scalar, problem.guess(np.random.default_rng(seed)))


# --- closed form ---


@pytest.mark.parametrize(
    "case",
    [
        Quintic(),  # acceleration decides; at the first grid's instants, both ends and the middle, it vanishes
        Quintic(velocity=0.5),  # velocity decides, and its peak is on the first grid
        Quintic(distance=0.3, velocity=1.0, acceleration=2.0),
    ],
    ids=str,
)
@pytest.mark.parametrize("start", [0.3, 3.0, 8.0])
def test_least_time_of_a_quintic_has_its_closed_form(case: Quintic, start: float) -> None:
    solution = Exchange().solve(quintic_problem(case), TIME, np.array([start]))
    assert solution.audit is not None and solution.audit.proved
    duration = solution.x[0]
    assert 15.0 / 8.0 * case.distance / duration <= case.velocity
    assert 10.0 / 3.0**0.5 * case.distance / duration**2 <= case.acceleration
    assert duration == pytest.approx(case.least_time, rel=10 * BACK_OFF)
    assert solution.status is Status.SOLVED
    assert solution.rounds <= 3


def test_a_narrow_dip_below_beside_a_peak_above_is_found() -> None:
    """Both bounds of one limit are near within one cell of the scan: each side has peaks of its own."""
    dip = 0.9695
    limit = PathConstraint(
        "two-sided", lambda s: -1.007 + 2.007 * ((s.u - dip) / (1.0 - dip)) ** 2, -1.0, 1.0, ("-",), ("row",)
    )
    problem = quintic_problem()
    problem = replace(problem, requirements=replace(problem.requirements, path_constraints=(limit,)))
    found, _ = worst_instants(problem, np.array([3.0]), BACK_OFF)
    assert min(abs(instant.u - dip) for instant in found) < 1e-9


def test_a_first_grid_blind_to_the_limit_gets_the_peaks_as_moving_instants() -> None:
    """At T = 0.5 the acceleration is broken at u = (3 -+ sqrt(3))/6, the velocity at 1/2: none of them moves with T."""
    case = Quintic()
    problem = quintic_problem(case)
    found, excess = worst_instants(problem, np.array([0.5]), BACK_OFF)
    assert excess > 0.0
    at = sorted((instant.limit, instant.u) for instant in found)
    assert [limit for limit, _ in at] == ["acceleration-limit", "acceleration-limit", "velocity-limit"]
    assert [u for _, u in at] == pytest.approx([(3 - 3**0.5) / 6, (3 + 3**0.5) / 6, 0.5], abs=1e-9)
    for instant in found:
        assert instant.slope is not None
        assert instant.slope == pytest.approx([0.0], abs=1e-6)


def test_peaks_near_their_bounds_are_found_where_those_are_wanted() -> None:
    """A hundredth slower than the fastest: the acceleration is 2 % below its bound, the velocity far below."""
    problem, x = quintic_problem(Quintic()), np.array([1.01 * Quintic().least_time])
    assert worst_instants(problem, x, BACK_OFF) == ([], 0.0)
    found, excess = worst_instants(problem, x, BACK_OFF, 0.03)
    assert excess == 0.0
    assert {instant.limit for instant in found} == {"acceleration-limit"}
    assert sorted(i.u for i in found) == pytest.approx([(3 - 3**0.5) / 6, (3 + 3**0.5) / 6], abs=1e-9)
    assert worst_instants(problem, x, BACK_OFF, 0.01)[0] == []


def test_a_first_grid_of_the_users_own_is_used() -> None:
    problem = quintic_problem()
    solution = solve(problem, TIME, solver=Exchange(first=uniform_instants(problem, 40)))
    assert solution.audit is not None and solution.audit.proved
    assert solution.x[0] == pytest.approx(Quintic().least_time, rel=10 * BACK_OFF)
    assert solution.row_count >= 80


def test_progress_is_told_of_every_round() -> None:
    told: list[tuple[int, int, str]] = []
    solution = solve(
        quintic_problem(), TIME, solver=Exchange(progress=lambda done, total, words: told.append((done, total, words)))
    )
    assert [done for done, _, _ in told] == list(range(1, solution.rounds + 1))
    assert "proved" in told[-1][2] and told[-1][1] == 10


@pytest.mark.parametrize(
    ("scalar", "expected"),
    [
        (EpsilonConstraint("effort", {"time": 2.0}), 2.0),
        (EpsilonConstraint("time", {"effort": 5.0}), (Quintic().effort_constant / 5.0) ** (1 / 3)),
        (EpsilonConstraint("effort", {"speed": 0.4}), 2.5),
    ],
    ids=str,
)
def test_every_scalarisation_ends_proved_and_on_its_closed_form(scalar: Scalarisation, expected: float) -> None:
    solution = solve(quintic_problem(), scalar)
    assert solution.audit is not None and solution.audit.proved
    assert solution.x == pytest.approx([expected], rel=1e-7)
    assert solution.objectives["time"] == solution.x[0]


def test_the_extra_variable_of_goal_attainment_is_no_part_of_x() -> None:
    """Goals out of reach, time alone weighted: gamma = (T_least - 0.1) / 1, and x holds T alone."""
    solution = solve(quintic_problem(), GoalAttainment({"time": 0.1}, {"time": 1.0}))
    assert solution.x.shape == (1,)
    assert solution.x[0] == pytest.approx(Quintic().least_time, rel=10 * BACK_OFF)
    assert solution.f == pytest.approx(Quintic().least_time - 0.1, rel=1e-7)


# --- hybrid-spline: least time ---


def test_least_time_is_feasible_by_a_scan_that_shares_nothing_with_the_solver(fastest: Solution) -> None:
    """4800 instants of the saved file by de Casteljau and pinocchio's rnea, and more where it is worst."""
    assert fastest.trajectory is not None
    found = excesses(fastest.trajectory.to_dict())
    assert not broken(found)
    assert max(found["velocity-limit"], found["effort-limit"]) >= -1e-6  # and used up, as it must be at the least time


def test_least_time_is_proved_in_few_rounds_with_few_rows(fastest: Solution) -> None:
    assert fastest.status is Status.SOLVED
    assert fastest.audit is not None and fastest.audit.proved
    assert fastest.rounds <= 6
    assert fastest.row_count <= 365  # DESIGN.md, idea 3
    assert fastest.objectives["time"] == fastest.f == pytest.approx(FASTEST, rel=1e-6)
    assert fastest.f == pytest.approx(fastest.x.sum(), rel=1e-14)


@pytest.mark.slow
def test_ten_instants_an_interval_are_more_rows_and_still_broken_between(hybrid: Problem, fastest: Solution) -> None:
    nlp = transcribe(hybrid, TIME, uniform_instants(hybrid, 10))
    gridded = Ipopt().solve(nlp, fastest.x).require()
    data = trajectory_of(hybrid, gridded.x).to_dict()
    assert len(nlp.rows) > 5 * fastest.row_count
    assert gridded.f < fastest.f - 1e-4
    assert max(excesses(data).values()) > 1e-4
    assert trajectory_of(hybrid, gridded.x).audit().verdict == "violated"


def test_one_round_is_repaired_by_slowing_down(hybrid: Problem) -> None:
    solution = solve(hybrid, TIME, solver=Exchange(max_exchanges=1))
    assert solution.status is Status.FEASIBLE
    assert solution.audit is not None and solution.audit.proved
    assert solution.trajectory is not None
    assert not broken(excesses(solution.trajectory.to_dict()))
    assert FASTEST < solution.objectives["time"] < 1.1 * FASTEST
    assert "slowed down" in solution.detail
    assert solution.objectives == evaluate_objectives(hybrid, solution.x)


def test_a_repaired_solution_has_the_value_of_what_it_returns(hybrid: Problem) -> None:
    solution = solve(hybrid, TIME, solver=Exchange(max_exchanges=1))
    assert solution.f == pytest.approx(solution.objectives["time"], rel=1e-12)


def test_a_repair_does_not_break_a_bound_on_an_objective(hybrid: Problem) -> None:
    """Slowed down, the trajectory takes longer than it may: it stays as it is, unproved."""
    solution = solve(hybrid, EpsilonConstraint("energy", {"time": 2.6}), solver=Exchange(max_exchanges=1))
    assert solution.status is Status.UNPROVED and solution.objectives["time"] <= 2.6 * (1.0 + 1e-7)
    (_,), (slowed,) = slow_down(hybrid, [solution.x])
    assert slowed.proved  # but for that bound it would be mended


def test_without_repair_one_round_ends_unproved(hybrid: Problem) -> None:
    solution = solve(hybrid, TIME, solver=Exchange(max_exchanges=1, repair=False))
    assert solution.audit is not None and not solution.audit.proved
    assert solution.objectives["time"] < FASTEST


@pytest.mark.slow
def test_exchange_repeats_itself_bit_by_bit(fastest: Solution) -> None:
    again = solve(problems.load("hybrid-spline"), TIME)
    assert_array_equal(again.x, fastest.x)
    assert (again.f, again.rounds, again.iterations) == (fastest.f, fastest.rounds, fastest.iterations)


def test_a_start_from_the_solutions_own_instants_takes_fewer_iterations(hybrid: Problem, fastest: Solution) -> None:
    warm = Exchange(first=fastest.instants).solve(hybrid, TIME, fastest.x)
    assert warm.audit is not None and warm.audit.proved
    assert warm.f == pytest.approx(FASTEST, rel=1e-6)
    assert warm.iterations < fastest.iterations


def test_a_warm_start_far_from_the_limits_begins_where_its_neighbour_is(hybrid: Problem, fastest: Solution) -> None:
    exchange = Exchange(first=fastest.instants)
    scalar = EpsilonConstraint("energy", {"time": 4.0})
    assert hybrid.dilate is not None
    slow, broken_by_far = (hybrid.dilate(fastest.x, factor) for factor in (1.4, 0.5))
    known = exchange.solve(hybrid, scalar, slow)
    one, other = (exchange.solve(hybrid, scalar, x, known) for x in (broken_by_far, known.x))
    assert_array_equal(one.x, other.x)


# --- hybrid-spline: least cost ---


def test_least_cost_is_feasible_by_scan_and_proved(cheapest: Solution) -> None:
    assert cheapest.trajectory is not None
    assert not broken(excesses(cheapest.trajectory.to_dict()))
    assert cheapest.audit is not None and cheapest.audit.proved
    assert cheapest.objectives["cost"] == pytest.approx(CHEAPEST, rel=1e-5)


def test_no_limit_is_active_at_the_least_cost(hybrid: Problem, cheapest: Solution) -> None:
    """guo2016.md, known results; so that the gradient of the cost vanishes there."""
    assert cheapest.audit is not None and cheapest.audit.margin > 1e-3
    step = 1e-5
    for i in range(12):
        e = step * np.eye(12)[i]
        up, down = (evaluate_objectives(hybrid, cheapest.x + s * e)["cost"] for s in (1.0, -1.0))
        assert abs(up - down) / (2 * step) < 1e-4
        assert min(up, down) >= cheapest.f


@pytest.mark.parametrize("seed", [1, 2])
def test_least_cost_does_not_depend_on_the_start(hybrid: Problem, seed: int) -> None:
    solution = solve(hybrid, COST, seed)
    assert solution.audit is not None and solution.audit.proved
    assert solution.f == pytest.approx(CHEAPEST, rel=1e-5)


@pytest.mark.slow
def test_least_cost_in_the_papers_convention_beats_the_papers_own() -> None:
    """Table 9: NSGA-II 3.093, fmincon 3.220 on the average."""
    problem = problems.load("hybrid-spline", convention="paper-literal")
    solution = solve(problem, COST)
    assert solution.trajectory is not None
    assert not broken(excesses(solution.trajectory.to_dict()))
    assert solution.audit is not None and solution.audit.proved
    assert solution.f == pytest.approx(CHEAPEST_LITERAL, rel=1e-5)
    assert solution.f < 3.093


@pytest.mark.slow
@pytest.mark.parametrize(
    ("convention", "name", "value", "starts"),
    [
        ("physical", "cost", CHEAPEST, 20),
        ("paper-literal", "cost", CHEAPEST_LITERAL, 20),
        ("physical", "time", FASTEST, 10),
    ],
)
def test_many_starts_end_at_the_same_proved_optimum(convention: str, name: str, value: float, starts: int) -> None:
    problem = problems.load("hybrid-spline", convention=convention)
    solutions = [solve(problem, WeightedSum({name: 1.0}), seed) for seed in range(starts)]
    assert all(solution.audit is not None and solution.audit.proved for solution in solutions)
    assert not any(broken(excesses(s.trajectory.to_dict())) for s in solutions if s.trajectory)
    assert [solution.f for solution in solutions] == pytest.approx([value] * starts, rel=1e-5)


# --- infeasible ---


@pytest.mark.slow
def test_a_payload_too_heavy_is_reported_with_the_force_it_takes() -> None:
    """At rest F3 = -(38.475 + 13) g, whatever the intervals: 4.8 N too much; in motion it can only be more."""
    problem = problems.load("hybrid-spline", payload=13.0)
    solution = solve(problem, TIME)
    assert solution.status is Status.LOCALLY_INFEASIBLE
    assert not solution.ok
    worst = solution.conflicts[0]
    assert (worst.row.limit, worst.row.label, worst.bound) == ("effort-limit", "F3", pytest.approx(-500.0, rel=1e-6))
    static = (sum(mass for mass, _, _ in LINKS[1:]) + 13.0) * G - 500.0
    assert worst.excess >= static - 1e-3
    assert worst.value == pytest.approx(-500.0 - worst.excess, rel=1e-6)
    assert "effort-limit F3" in solution.explain()


def test_a_bound_no_trajectory_meets_is_named_beside_what_stops_it() -> None:
    """T <= 1 s against a least time of 1.07 s."""
    solution = solve(quintic_problem(), EpsilonConstraint("effort", {"time": 1.0}))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    assert {conflict.row.limit for conflict in solution.conflicts} == {"time", "acceleration-limit"}
    assert "the one start found no trajectory; the nearest misses time" in solution.explain()
    assert solution.trajectory is None


# --- without a proof, and not worse than what was known ---


FAST, SLOW = np.array([0.3]), np.array([3.0])  # [s]: the first breaks limits, the second is proved


def test_a_problem_that_does_not_dilate_is_left_unproved_by_one_round_and_says_why() -> None:
    solution = Exchange(max_exchanges=1).solve(replace(quintic_problem(), dilate=None), TIME, FAST)
    assert solution.status is Status.UNPROVED and solution.audit is not None and not solution.audit.proved
    assert solution.x[0] < Quintic().least_time
    why = r"the one round is used up; acceleration-limit j is violated, .* rad/s2 from its bound"
    assert re.match(why + r" at t = .* s; its last solve ended with IPOPT: Solve_Succeeded$", solution.detail)
    assert solution.detail in solution.explain()


def test_rounds_that_gain_nothing_are_told() -> None:
    """Limits that the NLP has looser by 1e-3 than they are: every round ends beyond them by as much."""
    solution = Exchange(max_exchanges=4, back_off=-1e-3).solve(replace(quintic_problem(), dilate=None), TIME, FAST)
    assert solution.status is Status.UNPROVED
    assert re.match(
        "all 4 rounds are used up, the exchange has stalled; acceleration-limit j is violated, 0.0049", solution.detail
    )


def test_a_round_without_a_point_is_named_with_the_solvers_own_word() -> None:
    solution = Exchange(Ipopt(max_iter=1)).solve(quintic_problem(), TIME, FAST)
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.detail == "round 1 of 10 found no point: iteration limit, IPOPT: Maximum_Iterations_Exceeded"


def test_a_proved_start_is_returned_where_the_exchange_ends_without_a_proof() -> None:
    solution = Exchange(max_exchanges=1).solve(replace(quintic_problem(), dilate=None), TIME, SLOW)
    assert solution.status is Status.FEASIBLE and solution.audit is not None and solution.audit.proved
    assert (solution.x.tolist(), solution.f, solution.objectives["time"]) == ([3.0], 1.5, 3.0)
    assert solution.own.status is Status.UNPROVED and solution.own.detail in solution.detail


@dataclass(frozen=True)
class Elsewhere(Ipopt):
    """Begins at 9 s wherever it is told to begin."""

    def solve(self, nlp: NLP, x0: np.ndarray, warm: Solution | None = None) -> Solution:
        return super().solve(nlp, nlp.start(np.array([9.0])))


def two_valleys() -> Problem:
    """f = ((T - 3)^2 (T - 8)^2 + T) / 2: 1.5 at T = 3, 4 at T = 8."""
    valleys = Objective("valleys", "-", 2.0, of_variables=lambda x, p: ((x[0] - 3) * (x[0] - 8)) ** 2 + x[0])
    problem = quintic_problem()
    return replace(problem, objectives=(*problem.objectives, valleys))


@pytest.mark.parametrize(
    ("scalar", "value", "other"),
    [
        (WeightedSum({"valleys": 1.0}), 1.5, 4.0),
        (EpsilonConstraint("valleys", {"time": 9.5}), 1.5, 4.0),
        (GoalAttainment({"valleys": 1.0}, {"valleys": 1.0}, {"time": 9.5}), 2.0, 7.0),
    ],
)
def test_a_proved_start_that_is_better_than_the_optimum_found_is_returned(
    scalar: Scalarisation, value: float, other: float
) -> None:
    solution = Exchange(Elsewhere()).solve(two_valleys(), scalar, SLOW)
    assert (solution.x.tolist(), solution.f) == ([3.0], pytest.approx(value))
    assert solution.own.status is Status.SOLVED and solution.own.f == pytest.approx(other, rel=1e-2)
    assert solution.detail.startswith("the start is proved and better than what the solver came to, which ended at ")


def test_a_start_beyond_the_bounds_asked_for_or_without_a_proof_is_not_returned() -> None:
    bounded = EpsilonConstraint("valleys", {"speed": 0.12})  # at most 8.33 s
    assert Exchange(Elsewhere()).solve(two_valleys(), bounded, SLOW).x.tolist() == [3.0]
    slow = EpsilonConstraint("valleys", {"effort": 0.1})  # at least 5.56 s
    for scalar, start in ((slow, SLOW), (WeightedSum({"valleys": 1.0}), FAST)):
        assert Exchange(Elsewhere()).solve(two_valleys(), scalar, start).x[0] == pytest.approx(8.0, abs=0.1)


def test_the_start_of_a_warm_start_objective_counts_as_well() -> None:
    problem = replace(two_valleys(), tuning=Tuning(warm_start_objective="effort"), guess=lambda rng: SLOW)
    assert Multistart(Exchange(Elsewhere())).solve(problem, WeightedSum({"valleys": 1.0})).x.tolist() == [3.0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes", [{"weights": (0.9, 0.05, 0.05, 0.0), "payload": 0.0}, {"weights": (0.0, 0.0, 1.0, 0.0)}], ids=str
)
def test_flat_peaks_and_tiny_objectives_end_at_one_proved_optimum_from_every_start(changes: dict[str, Any]) -> None:
    """With much weight on time a velocity rests along its limit; with jerk alone the objective is 1e-5 in the end."""
    problem = problems.load("hybrid-spline", **changes)
    found = [solve(problem, WeightedSum({"cost": 1.0}), seed=seed) for seed in range(4)]
    assert all(s.status is Status.SOLVED and s.audit is not None and s.audit.proved for s in found)
    assert max(s.f for s in found) == pytest.approx(min(s.f for s in found), rel=1e-7)


def test_a_solve_that_cannot_end_as_well_as_it_has_to_is_given_up_on_the_way() -> None:
    problem, start = quintic_problem(), np.array([3.0])
    best = Exchange().solve(problem, WeightedSum({"time": 1.0}), start)
    same = Exchange(worth=best.f * (1.0 + 1e-6)).solve(problem, WeightedSum({"time": 1.0}), start)
    assert same.x.tolist() == best.x.tolist()
    with pytest.raises(NotWorth):
        Exchange(worth=best.f * (1.0 - 1e-6)).solve(problem, WeightedSum({"time": 1.0}), start)
