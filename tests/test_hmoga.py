"""HMOGA: its spread and its elitism as published, refinement that worsens nothing, and a front of proved points."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pymoo.core.individual import Individual
from pymoo.core.population import Population as PymooPopulation

import ocp_traj as ot
from ocp_traj.cli import sheets
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.evolution.elitism import ControlledElitism, places_of_ranks
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.generations import Watch, best_points, crowding_distances, spread
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.workers import Workers
from ocp_traj.results.front import Front
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.hmoga import HMOGA
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.solvers.refinement import LEAST, refine, weights, well_spaced
from ocp_traj.solvers.waves import Solves
from ocp_traj.stopping import stopping
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.closed_form import Quintic, quintic_problem, stairs_problem

PAIR = ["time", "energy"]
SMALL = {"population": 40, "generations": 20}


def values(problem: Problem, xs: list[np.ndarray], names: list[str]) -> np.ndarray:
    return np.array([[evaluate_objectives(problem, x)[name] for name in names] for x in xs])


def solves(problem: Problem) -> Solves:
    return Solves(problem, Exchange(), Workers())


# --- the published definitions ---


def test_spread_is_mu_plus_sigma_over_mu_plus_q_d() -> None:
    """Distances 1, 2, 3: d = 2, sigma = sqrt(2/3), Q = 3; the ends' infinite distances do not count."""
    distances = np.array([np.inf, 1.0, 2.0, 3.0, np.inf])
    assert spread(distances, np.zeros(2)) == pytest.approx((2 / 3) ** 0.5 / 6.0, rel=1e-14)
    assert spread(distances, np.array([0.5, 1.0])) == pytest.approx((1.5 + (2 / 3) ** 0.5) / 7.5, rel=1e-14)


def test_spread_is_zero_for_an_even_front_at_rest_and_one_where_it_only_moves() -> None:
    assert spread(np.array([np.inf, 0.5, 0.5, 0.5, np.inf]), np.zeros(2)) == 0.0
    assert spread(np.array([np.inf, np.inf]), np.array([0.3, 0.0])) == 1.0
    assert spread(np.array([np.inf, np.inf]), np.zeros(2)) == 1.0  # 0/0: nothing can be said


def test_crowding_distance_is_the_mean_gap_between_neighbours_over_the_range() -> None:
    """(0, 8), (1, 4), (3, 2), (4, 0): ranges 4 and 8; inner points (3/4 + 6/8)/2 and (3/4 + 4/8)/2."""
    f = np.array([[3.0, 2.0], [0.0, 8.0], [4.0, 0.0], [1.0, 4.0]])
    assert_allclose(crowding_distances(f), [0.625, np.inf, np.inf, 0.75], rtol=1e-14)


def test_the_watch_measures_moves_of_the_best_points_in_the_fronts_range() -> None:
    """The second front moves its first end by (-1, 2), the range is then (5, 10): mu = sqrt((1/5)^2 + (2/10)^2)."""
    watch = Watch(5, 1e-6, None)
    watch.note(10, np.array([[0.0, 8.0], [1.0, 4.0], [4.0, 0.0]]))
    watch.note(20, np.array([[-1.0, 10.0], [1.0, 4.0], [4.0, 0.0]]))
    mu = 0.08**0.5
    first, second = watch.history["spread"]
    assert first == 0.0  # one distance, no move
    assert second == pytest.approx(mu / (mu + 1.0), rel=1e-14)  # its one distance is (5/5 + 10/10)/2
    assert watch.history["average distance"].tolist() == [1.0, 1.0]


def test_of_equal_best_points_the_one_best_in_the_others_counts() -> None:
    f = np.array([[0.0, 9.0], [0.0, 8.0], [3.0, 1.0], [2.0, 1.0]])
    assert_array_equal(best_points(f), [[0.0, 8.0], [2.0, 1.0]])


def test_evolution_ends_when_the_spreads_mean_change_is_below_the_tolerance() -> None:
    still = np.array([[0.0, 8.0], [1.0, 4.0], [3.0, 2.0], [4.0, 0.0]])
    moved = still + np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.0], [0.0, 0.0]])
    watch = Watch(3, 1e-6, None)
    stalled = []
    for f in (still, moved, moved, moved, moved, moved):
        watch.note(0, f)
        stalled.append(watch.stalled)
    assert stalled == [False, False, False, False, True, True]  # after three changes of nothing
    assert watch.change() == 0.0


def test_the_hypervolume_of_a_generation_is_that_within_the_box() -> None:
    """Box (0, 0) to (4, 8), points (1, 4) and (2, 0): they dominate 3 x 4 and 2 x 8, in common 2 x 4; of 32."""
    watch = Watch(3, 1e-6, np.array([[0.0, 0.0], [4.0, 8.0]]))
    watch.note(0, np.array([[1.0, 4.0], [2.0, 0.0]]))
    watch.note(0, np.empty((0, 2)))
    assert watch.history["hypervolume"].tolist() == [pytest.approx((12.0 + 16.0 - 8.0) / 32.0), 0.0]


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        ([400], [200]),  # all of one rank: there is nobody else
        ([300, 100], [100, 100]),
        ([150, 250], [70, 130]),
        ([100, 100, 100, 100], [70, 81, 30, 19]),  # shares 70, 45.5, 29.575, 19.2; the tail of 36 to the second rank
        ([30, 170, 200], [30, 140, 30]),  # 30, 40 + 45.5, 0.5 + 29.575; the tail of 55 to the second rank
    ],
)
def test_places_of_ranks(sizes: list[int], expected: list[int]) -> None:
    """N = 200, p = 0.35: shares 70, 45.5, 29.575, .. and what a rank does not need passes on."""
    assert places_of_ranks(sizes, 200, 0.35) == expected
    assert sum(expected) == 200


def test_places_are_all_given_and_never_more_than_there_are() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        sizes = rng.integers(0, 60, size=rng.integers(1, 8)).tolist()
        places, fraction = int(rng.integers(0, sum(sizes) + 1)), float(rng.uniform(0.01, 1.0))
        taken = places_of_ranks(sizes, places, fraction)
        assert sum(taken) == places
        assert all(0 <= t <= s for t, s in zip(taken, sizes, strict=True))
        others = sum(sizes[1:])
        assert taken[0] <= max(fraction * places + 1e-6, places - others)


def crowd(f: np.ndarray, violation: np.ndarray) -> PymooPopulation:
    members = [
        Individual(F=a, G=np.array([v]), H=np.zeros(0), X=np.array([float(i)]))
        for i, (a, v) in enumerate(zip(f, violation, strict=True))
    ]
    return PymooPopulation.create(*members)


def test_at_most_the_pareto_fraction_of_the_next_generation_is_of_rank_one() -> None:
    """Three rows of 30 points, each dominated by the row before; 60 survive, of the first row 21."""
    t = np.linspace(0.0, 1.0, 30)
    f = np.concatenate([np.column_stack([t, 1.0 - t]) + k for k in range(3)])
    survivors = ControlledElitism(0.35).do(None, crowd(f, np.full(90, -1.0)), n_survive=60)
    rank = survivors.get("rank").astype(int)
    assert len(survivors) == 60
    assert (rank == 0).sum() == 21
    assert_array_equal(rank, np.floor(survivors.get("F").min(axis=1)))
    ends = survivors[rank == 0].get("F")
    assert ends.min(axis=0).tolist() == [0.0, 0.0]  # the ends are never lost


def test_those_that_break_a_limit_come_last_and_the_least_broken_first() -> None:
    f = np.tile([0.0, 0.0], (10, 1))
    f[:4] = [[0, 3], [1, 2], [2, 1], [3, 0]]
    violation = np.array([-1.0, -1.0, 0.0, 0.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0])
    survivors = ControlledElitism(0.4).do(None, crowd(f, violation), n_survive=5)
    assert sorted(survivors.get("X").ravel().astype(int)) == [0, 3, 7, 8, 9]
    nobody = ControlledElitism(0.4).do(None, crowd(f, np.arange(1.0, 11.0)), n_survive=4)
    assert nobody.get("X").ravel().tolist() == [0.0, 1.0, 2.0, 3.0]
    assert (nobody.get("rank") > 0).all()


# --- goal attainment ---


def test_weights_are_the_distance_to_the_nadir_and_never_zero() -> None:
    f = np.array([[1.0, 30.0], [2.0, 20.0], [5.0, 10.0]])
    scales = np.array([2.0, 7.0])
    assert_allclose(weights(f, scales), [[4.0, 20.0 * LEAST], [3.0, 10.0], [4.0 * LEAST, 20.0]], rtol=1e-14)
    assert weights(f[:1], scales).tolist() == [[2.0, 7.0]]  # no front to speak of


def test_well_spaced_points_hold_the_ends_and_are_evenly_apart() -> None:
    t = np.random.default_rng(1).permutation(np.linspace(0.0, 1.0, 41))
    f = np.column_stack([t, 1.0 - t])
    chosen = well_spaced(f, 5)
    assert_allclose(np.sort(t[chosen]), np.linspace(0.0, 1.0, 5), atol=1e-12)
    assert_array_equal(well_spaced(f, 41), np.arange(41))


@pytest.mark.slow
def test_refinement_worsens_no_point_and_betters_slow_ones(hybrid: Problem, fastest: Solution) -> None:
    """A dilated time-optimum is far from the front: there is something to be had in both objectives."""
    assert hybrid.dilate is not None
    slow = [np.asarray(hybrid.dilate(fastest.x, s)) for s in (1.5, 2.0)]
    before = values(hybrid, slow, PAIR)
    others = [fastest.x, np.asarray(hybrid.dilate(fastest.x, 2.5))]
    found = refine(solves(hybrid), PAIR, slow, others)
    after = values(hybrid, found.xs, PAIR)
    assert (after < before * 0.99).all()
    front = Front.of(hybrid, PAIR, found.xs, method="", seed=None, seconds=0.0)
    assert front.info["dropped"]["violated"] == front.info["dropped"]["undecided"] == 0
    assert (found.better, found.failed, found.interrupted) == (2, 0, False)


def test_where_no_point_can_be_better_all_stay_bit_by_bit() -> None:
    """Of the quintic every feasible T is Pareto-optimal; those within rounding of the optimum may not be replaced."""
    problem = quintic_problem()
    xs = [np.array([t]) for t in (2.5, 3.0, 3.5)]
    found = refine(solves(problem), ["time", "effort"], xs)
    assert_allclose(np.ravel(found.xs), np.ravel(xs), rtol=1e-7)
    before, after = (values(problem, list(p), ["time", "effort"]) for p in (xs, found.xs))
    assert (after <= before).all()


def test_an_infeasible_point_is_replaced_by_a_proved_one() -> None:
    """T a fifth below the least: slowing down by a tenth cannot mend it, goal attainment finds the nearest that can."""
    case = Quintic()
    problem = quintic_problem(case)
    (x,) = refine(solves(problem), ["time", "effort"], [np.array([0.8 * case.least_time])]).xs
    assert x[0] == pytest.approx(case.least_time, rel=1e-6)
    assert x[0] >= case.least_time


def test_refinement_stops_when_its_time_is_over_and_on_ctrl_c_and_keeps_all_points() -> None:
    problem = quintic_problem()
    xs = [np.array([t]) for t in (2.5, 3.0, 3.5)]
    with stopping(0.0):
        late = refine(work := solves(problem), ["time", "effort"], xs)
    assert (work.solves, late.interrupted, len(late.xs)) == (0, False, 3)

    def stop(*words: object) -> None:
        raise KeyboardInterrupt

    stopped = refine(work := solves(problem), ["time", "effort"], xs, progress=stop)
    assert (work.solves, stopped.interrupted, len(stopped.xs)) == (1, True, 3)


# --- the whole ---


@pytest.fixture(scope="module")
def front(hybrid: Problem) -> Front:
    return ot.pareto(hybrid, PAIR, method="hmoga", seed=1, points=5, starts=1, **SMALL)


def test_every_point_of_the_front_is_proved_and_none_dominates_another(front: Front) -> None:
    assert len(front) >= 5
    assert all(front.audit(i).proved for i in range(len(front)))
    f = front.values
    dominates = (f[:, None] <= f[None]).all(axis=2) & (f[:, None] < f[None]).any(axis=2)
    assert not dominates.any()
    assert front.method == "hmoga"


def test_its_hypervolume_is_at_least_that_of_nsga2_with_the_same_seed_and_numbers(
    hybrid: Problem, front: Front
) -> None:
    genetic = ot.pareto(hybrid, PAIR, method="nsga2", seed=1, **SMALL)
    ideal = {name: min(front.ideal[name], genetic.ideal[name]) for name in PAIR}
    assert front.hypervolume(ideal=ideal).value >= genetic.hypervolume(ideal=ideal).value


def test_refinement_adds_to_the_hypervolume_of_the_last_generation(front: Front) -> None:
    """Even though that generation overlooks what happens between its instants, by which it is too good."""
    history = front.info["history"]
    assert front.info["points refined"] > 0
    # The history's box has the ends of the front as its ideal, as this front has.
    assert front.hypervolume().value > history["hypervolume"][-1]


def test_the_history_has_a_row_a_generation(front: Front) -> None:
    history = front.info["history"]
    assert list(history) == ["generation", "evaluations", "front", "spread", "average distance", "hypervolume"]
    assert history["generation"] == list(range(1, 21))
    assert history["evaluations"] == [40 * i for i in range(1, 21)]
    assert max(history["front"][1:]) <= 14  # 0.35 of 40
    assert all(0.0 < value < 1.0 for value in history["hypervolume"])
    json.dumps(front.info)
    assert "migration" in front.info["cannot act"]


def test_it_says_that_not_all_of_the_genetic_front_was_refined(front: Front) -> None:
    assert front.info["points to refine"] == 3 < front.info["genetic front"]  # five with the ends
    words = f"3 points of the genetic front's {front.info['genetic front']} were to be refined; --points refines more"
    assert words in list(sheets.front_remarks(front))


@pytest.mark.slow
def test_the_same_seed_gives_the_same_points_bit_by_bit_and_another_seed_others() -> None:
    def points(seed: int) -> np.ndarray:
        found = HMOGA(seed, points=4, population=20, generations=8).pareto(stairs_problem(), ["first", "second"])
        return np.array(found.xs)

    one, two, other = (points(seed) for seed in (3, 3, 4))
    assert_array_equal(one, two)
    assert not np.array_equal(one[:20], other[:20])


@pytest.mark.slow
def test_three_objectives_and_one_to_be_maximised() -> None:
    stairs = ot.pareto(
        stairs_problem(), ["time", "first", "second"], method="hmoga", points=4, population=20, generations=5
    )
    assert len(stairs) >= 4
    problem = quintic_problem()
    fast = ot.pareto(problem, ["speed", "effort"], method="hmoga", points=4, population=20, generations=5)
    case = Quintic()
    assert fast.ideal["speed"] == pytest.approx(case.distance / case.least_time, rel=1e-6)


def test_objectives_without_conflict_give_one_point_and_say_so() -> None:
    front = ot.pareto(quintic_problem(), ["time", "speed"], method="hmoga", population=20, generations=5)
    assert len(front) == 1
    assert front.info["conflict"] is False


def test_a_spread_that_rests_ends_evolution_early() -> None:
    found = HMOGA(0, points=2, population=20, generations=50, stall=3, function_tolerance=10.0).pareto(
        quintic_problem(), ["time", "effort"]
    )
    assert found.info["stalled"]
    assert found.info["generations"] == 4  # three changes


def test_ctrl_c_keeps_what_there_is_at_every_stage() -> None:
    def stop_after(calls: int) -> HMOGA:
        told: list[object] = []

        def stop(*words: object) -> None:
            told.append(words)
            if len(told) == calls:
                raise KeyboardInterrupt

        return HMOGA(0, points=4, population=20, generations=6, progress=stop)

    problem = quintic_problem()
    evolving = stop_after(3).pareto(problem, ["time", "effort"])
    assert evolving.interrupted
    assert evolving.info["generations"] == 3
    assert "solves" not in evolving.info
    refining = stop_after(8).pareto(problem, ["time", "effort"])
    assert refining.interrupted
    assert refining.info["solves"] == 2
    for found in (evolving, refining):
        assert len(Front.of(problem, ["time", "effort"], found.xs, method="", seed=None, seconds=0.0)) > 2


@pytest.mark.slow
def test_a_budget_ends_it() -> None:
    front = ot.pareto(quintic_problem(), ["time", "effort"], method="hmoga", generations=10**6, budget=2.0)
    assert front.seconds < 20.0
    assert front.info["generations"] < 10**6
    assert len(front) > 2


@pytest.mark.slow
def test_where_nothing_is_feasible_it_says_so() -> None:
    with pytest.raises(NoSolutionFound, match="quintic"):
        HMOGA(0).pareto(quintic_problem(Quintic(velocity=1e-3)), ["time", "effort"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"population": 3}, "population is 3; give a whole number, 4 or more"),
        ({"generations": 0}, "generations is 0; give a whole number, 1 or more"),
        ({"generations": 2.5}, "generations is 2.5; give a whole number, 1 or more"),
        ({"pareto_fraction": 0.0}, "pareto_fraction is 0.0; give a finite number above 0 and at most 1"),
        ({"seeded": 1.5}, "seeded is 1.5; give a finite number from 0 to 1"),
        ({"points": 1}, "points is 1; give a whole number, 2 or more"),
        ({"stall": 0}, "stall is 0; give a whole number, 1 or more"),
        ({"mutation": -0.1}, "mutation is -0.1; give a finite number from 0 to 1"),
    ],
)
def test_wrong_numbers_are_refused(options: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        ot.pareto(quintic_problem(), ["time", "effort"], method="hmoga", **options)


def test_the_tolerance_is_overlooked_in_a_generation() -> None:
    case = Quintic(velocity=1.0)
    problem = quintic_problem(case)
    slow = np.array([[1.875 * case.distance / case.velocity * (1.0 - 1e-7)]])  # peak velocity 1.875 D/T, at u = 1/2
    excess = []
    for tolerance in (0.0, 1e-6):
        out: dict[str, np.ndarray] = {}
        PymooProblem(problem, ["time", "effort"], 5, tolerance=tolerance)._evaluate(slow, out)
        excess.append(float(out["excess"][0]))
    assert excess[0] > 0.0 == excess[1]


@pytest.mark.slow
def test_it_comes_within_one_percent_of_trace(hybrid: Problem) -> None:
    traced = ot.pareto(hybrid, PAIR)
    front = ot.pareto(hybrid, PAIR, method="hmoga", generations=30)
    ideal = {name: min(front.ideal[name], traced.ideal[name]) for name in PAIR}
    assert front.hypervolume(ideal=ideal).value >= 0.99 * traced.hypervolume(ideal=ideal).value
    unrefined = NSGA2(0, population=200, generations=30).pareto(hybrid, PAIR)
    assert front.info["evaluations"] == unrefined.info["evaluations"]


@pytest.mark.slow
def test_the_command_line_traces_rotor_353(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["pareto", "rotor-353", "--objectives", "time,effort", "--method", "hmoga", "--points", "5",
                 "--option", "population=40", "--option", "generations=20", "-o", str(tmp_path / "run"),
                 "--json"]  # fmt: skip
    assert run(arguments) == 0
    capsys.readouterr()
    described = json.loads((tmp_path / "run" / "run.json").read_text())
    assert described["method"] == "hmoga"
    assert len(described["info"]["history"]["spread"]) == 20
