"""Evolution and local solves in turns: what is put back lives on, what is found is proved, and never worse."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.evolution.dilation import Dilation
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.front import Front
from ocp_traj.results.pareto_set import ParetoSet
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.aims import STEP, Aim, Aims
from ocp_traj.solvers.archive import Archive, Known
from ocp_traj.solvers.ga import GA
from ocp_traj.solvers.memetic import OUTER, Memetic
from ocp_traj.solvers.pso import PSO
from ocp_traj.transcription.nlp import Status
from tests.closed_form import Quintic, quintic_problem, stairs_problem

PAIR = ["time", "effort"]
SMALL = {"population": 20, "generations": 8, "every": 3, "chosen": 2, "points": 3}


def proved(problem: Problem, objectives: list[str], found: ParetoSet) -> Front:
    return Front.of(problem, objectives, found.xs, method="", seed=None, seconds=0.0)


def known(x: float, f: np.ndarray) -> Known:
    """A point of an archive, of one variable."""
    x_ = np.array([x])
    return Known(x_, f, Solution("", x_, float(f[0]), Status.SOLVED, 0.0, 0, 0.0))


# --- the archive ---


def test_an_archive_holds_what_nothing_dominates_whatever_the_order() -> None:
    rng = np.random.default_rng(0)
    f = rng.uniform(size=(200, 2))
    best = [p for p in f if not ((f <= p).all(axis=1) & (f < p).any(axis=1)).any()]
    for order in (np.arange(200), rng.permutation(200)):
        archive = Archive(2, np.ones(2))
        for i in order:
            archive.add(Known(np.array([float(i)]), f[i]))
        assert sorted(map(tuple, archive.f)) == sorted(map(tuple, best))
        assert all((f[int(point.x[0])] == point.f).all() for point in archive.points)
        assert not archive.gains(f[0])  # a point that is known gains nothing


def test_the_widest_gap_is_between_neighbours_and_is_looked_into_once() -> None:
    """(0, 10), (1, 4), (5, 1), (10, 0): areas 6, 12 and 5."""
    archive = Archive(2, np.ones(2))
    for i, f in enumerate([[5.0, 1.0], [0.0, 10.0], [10.0, 0.0], [1.0, 4.0]]):
        archive.add(known(float(i), np.array(f)))
    last = archive.points[3]
    assert last.solution is not None
    found = []
    while (pair := archive.gap()) is not None:
        archive.close(*pair)
        found.append(tuple(sorted(point.f[0] for point in pair)))
    assert found == [(1.0, 5.0), (0.0, 1.0), (5.0, 10.0)]
    assert archive.drop(last.solution) and not archive.drop(last.solution)
    assert archive.gap() is not None  # its neighbours are now neighbours


def test_of_three_objectives_the_nearest_point_is_the_neighbour() -> None:
    archive = Archive(3, np.ones(3))
    for i, f in enumerate([[0.0, 1.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.1, 0.9, 0.9]]):
        archive.add(Known(np.array([float(i)]), np.array(f)))
    pair = archive.gap()
    assert pair is not None and {point.name for point in pair} != {np.array([0.0]).tobytes(), np.array([3.0]).tobytes()}


# --- slowing down ---


def test_an_individual_that_breaks_limits_is_slowed_down_just_enough() -> None:
    """Peak velocity 1.875 D/T: T twice too short becomes the least; who breaks nothing stays bit by bit."""
    case = Quintic(velocity=1.0)
    problem = quintic_problem(case)
    least = 1.875 * case.distance / case.velocity
    population = Population(problem, PAIR, 41)
    x = np.array([[0.5 * least], [1.5 * least], [0.9 * least]])
    slower, evaluation = Dilation(problem, population).apply(x, population.evaluate(x))
    assert slower[1] == x[1]
    assert slower[[0, 2], 0] == pytest.approx(least, rel=1e-6)
    assert (evaluation.violations <= 0.0).all()
    again = population.evaluate(slower)
    assert_array_equal(again.violations, evaluation.violations)
    assert_array_equal(again.objectives, evaluation.objectives)


def test_slowing_down_worsens_no_individual_and_mends_efforts_too(hybrid: Problem) -> None:
    names = ["time", "energy"]
    population = Population(hybrid, names, 5)
    x = np.array([hybrid.guess(np.random.default_rng(i)) for i in range(40)])
    before = population.evaluate(x)
    slower, after = Dilation(hybrid, population).apply(x, before)
    broken = [np.maximum(one.violations, 0.0).sum(axis=1) for one in (before, after)]
    assert (broken[1] <= broken[0]).all()
    assert (broken[1] <= 0.0).sum() >= 2 * (broken[0] <= 0.0).sum()
    assert (slower >= hybrid.lower).all() and (slower <= hybrid.upper).all()
    assert_array_equal(population.evaluate(slower).objectives, after.objectives)


def test_what_was_slowed_down_is_what_descendants_inherit() -> None:
    problem = quintic_problem(Quintic(velocity=1.0))
    out: dict[str, np.ndarray] = {}
    PymooProblem(problem, PAIR, 41, dilate=True)._evaluate(np.array([[1.5]]), out)
    assert out["X"][0, 0] > 1.5 and out["excess"][0] == 0.0


# --- fronts ---


@pytest.mark.slow
@pytest.mark.parametrize("outer", OUTER)
def test_every_outer_search_gives_the_same_proved_front_for_the_same_seed(outer: str) -> None:
    problem = quintic_problem()
    one, two = (Memetic(1, outer, **SMALL).pareto(problem, PAIR) for _ in range(2))
    assert_array_equal(np.array(one.xs), np.array(two.xs))
    front = proved(problem, PAIR, one)
    assert len(front) > 5
    assert one.info["outer"] == outer and one.info["generations"] == 8 and one.info["stages"] == 3
    assert front.ideal["time"] == pytest.approx(Quintic().least_time, rel=1e-6)
    assert one.info["moved"] and sum(one.info["shares of time"].values()) == pytest.approx(1.0, abs=0.2)


@pytest.mark.slow
def test_refined_individuals_are_alive_a_generation_later(hybrid: Problem) -> None:
    front = ot.pareto(hybrid, ["time", "energy"], method="memetic", seed=1, starts=1, **SMALL)
    lived = front.info["refined individuals"]
    assert 0 < lived["alive a generation later"] <= lived["put back"] <= front.info["solves that gained"]
    assert (front.table["verdict"] == "proved").all() and len(front) > 5


def test_three_objectives() -> None:
    front = ot.pareto(stairs_problem(), ["time", "first", "second"], method="memetic", **SMALL)
    assert len(front) >= 4
    assert front.info["refined individuals"]["alive a generation later"] > 0


def test_beyond_each_end_is_looked_once_and_not_past_the_reference() -> None:
    """From T = 2.5 and 3.9 outwards, in time and in effort; effort's end may be 0.1 s slower, to the reference at 4."""
    problem = quintic_problem()
    target = PymooProblem(problem, PAIR, 5)

    def looked(complete: bool) -> list[Aim]:
        archive = Archive(2, target.scales)
        aims = Aims(archive, target, 0.2, complete, np.random.default_rng(0))
        assert aims.beyond() is None  # of nothing
        for t in (2.5, 3.9):
            archive.add(Known(np.array([t]), aims.values(np.array([t]))))
        return list(iter(aims.beyond, None))

    assert looked(complete=True) == []
    fast, slow = looked(complete=False)
    assert (fast.x[0], slow.x[0]) == (2.5, 3.9)
    assert fast.goal[0] == pytest.approx(2.5 - STEP * 1.4) and fast.weights[0] == pytest.approx(STEP * 1.4)
    assert slow.goal[1] < 0.999 * problem.reference_point["effort"] and slow.weights[0] == pytest.approx(0.1)


def test_ctrl_c_keeps_what_there_is() -> None:
    def stop(done: int, total: int, words: str) -> None:
        if done == 5:
            raise KeyboardInterrupt

    found = Memetic(0, **SMALL, progress=stop).pareto(quintic_problem(), PAIR)
    assert found.interrupted and found.info["generations"] == 5 and found.info["stages"] == 1
    assert len(proved(quintic_problem(), PAIR, found)) > 2


@pytest.mark.slow
def test_where_nothing_is_feasible_and_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(NoSolutionFound, match="quintic"):
        Memetic(0, **SMALL).pareto(quintic_problem(Quintic(velocity=1e-3)), PAIR)
    with pytest.raises(InputError, match="outer is 'de'; allowed are nsga2, nsga3, mopso"):
        Memetic(0, outer="de")
    with pytest.raises(InputError, match="local_share is 1.5; give a finite number from 0 to 1"):
        Memetic(0, local_share=1.5)


# --- one objective ---


@pytest.mark.slow
@pytest.mark.parametrize("method", [PSO(1, 8, 5), GA(1, 8, 5)], ids=["pso", "ga"])
def test_a_refined_population_ends_in_the_optimum_proved(hybrid: Problem, method: PSO | GA) -> None:
    scalar = WeightedSum({"time": 1.0})
    plain, refined = method.solve(hybrid, scalar), replace(method, refine=True).solve(hybrid, scalar)
    assert refined.audit is not None and refined.audit.proved
    assert refined.f <= plain.f
    assert refined.f == pytest.approx(2.4836242, rel=1e-6)
    assert refined.history is not None and len(refined.history) == 5


def test_a_population_without_a_feasible_individual_is_refined_as_well() -> None:
    """Guesses are twice as fast as allowed, and a generation does not mend that."""
    case = Quintic()
    tight = replace(quintic_problem(case), guess=lambda rng: np.array([0.5 * case.least_time]), dilate=None)
    with pytest.raises(NoSolutionFound):
        PSO(0, 4, 1).solve(tight, WeightedSum({"time": 1.0}))
    found = PSO(0, 4, 1, refine=True).solve(tight, WeightedSum({"time": 1.0}))
    assert found.x[0] == pytest.approx(case.least_time, rel=1e-6)
    assert audit_points(tight, [found.x])[0][1].proved


def test_the_command_line_refines_populations_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "rotor-353", "--refine"]) == 2
    assert "--refine hands a population to exchange, which needs none" in capsys.readouterr().err
