"""NSGA-II: repeatable, one evaluation a generation, proof against NaN, and no better than the truth."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj.errors import InputError, NoSolutionFound, UnknownName
from ocp_traj.evolution.evolution import WORST, PymooProblem, gains_on
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.solvers.mopso import MOPSO
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.closed_form import Quintic, mixed_problem, quintic_problem, stairs_problem

PAIR = ["time", "effort"]
CHEAPEST = 2.550568  # least cost of hybrid-spline, by IPOPT from 20 starts (test_exchange.py)


def small(seed: int = 0, **changes: int) -> NSGA2:
    return NSGA2(seed, **({"population": 20, "generations": 15} | changes))


def test_the_same_seed_gives_the_same_front_bit_by_bit_and_another_seed_another(hybrid: Problem) -> None:
    one, two, other = (small(seed).pareto(hybrid, ["time", "energy"]) for seed in (3, 3, 4))
    assert_array_equal(one.xs, two.xs)
    assert not np.array_equal(one.xs[0], other.xs[0])
    assert (one.method, one.seed, one.interrupted) == ("nsga2", 3, False)


def test_a_whole_generation_is_evaluated_in_one_call(hybrid: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    plain = Population.evaluate

    def counted(self: Population, x: np.ndarray) -> object:
        sizes.append(len(x))
        return plain(self, x)

    monkeypatch.setattr(Population, "evaluate", counted)
    found = small(population=24, generations=6).pareto(hybrid, ["time", "energy"])
    assert sizes == [24] * 6
    assert (found.info["evaluation calls"], found.info["evaluations"]) == (6, 144)


def test_the_front_is_feasible_at_its_samples_within_bounds_and_mutually_non_dominated(hybrid: Problem) -> None:
    found = small(population=40, generations=30).pareto(hybrid, ["time", "energy"])
    evaluation = Population(hybrid, ["time", "energy"], 5).evaluate(np.array(found.xs))
    assert (evaluation.violations <= 0.0).all()
    assert (np.array(found.xs) >= hybrid.lower).all() and (np.array(found.xs) <= hybrid.upper).all()
    f = evaluation.objectives
    assert (f <= [hybrid.reference_point["time"], hybrid.reference_point["energy"]]).all()
    dominates = (f[:, None] <= f[None]).all(axis=2) & (f[:, None] < f[None]).any(axis=2)
    assert not dominates.any()
    assert len(f) >= 5


@pytest.mark.slow
def test_the_front_of_the_quintic_reaches_its_ends() -> None:
    """At 5 instants the acceleration's largest is 5.625 D/T^2, at u = 1/4: T >= sqrt(5.625 D/A), short of the truth.

    The other end is the reference point, T <= 4. Evolution stops short of either: within 1 % with 40 x 40.
    """
    case = Quintic()
    found = NSGA2(0, population=40, generations=40).pareto(quintic_problem(case), ["time", "effort"])
    t = np.sort(np.array(found.xs).ravel())
    sampled = (5.625 * case.distance / case.acceleration) ** 0.5
    assert t[0] >= sampled
    assert t[0] == pytest.approx(sampled, rel=0.01)
    assert t[-1] <= 4.0
    assert t[-1] == pytest.approx(4.0, rel=0.01)
    assert sampled < case.least_time  # which is why the audit has the last word


def test_an_objective_to_be_maximised_is_maximised() -> None:
    case = Quintic()
    found = NSGA2(0, population=20, generations=20, per_segment=41).pareto(quintic_problem(case), ["speed"])
    assert case.distance / found.xs[0][0] == pytest.approx(case.distance / case.least_time, rel=0.01)


def test_an_individual_of_nan_gets_finite_values_and_a_large_violation() -> None:
    problem = mixed_problem()
    target = PymooProblem(problem, ["time", "rough"], 5)
    x = np.array([problem.guess(np.random.default_rng(s)) for s in range(3)])
    x[1, 4] = np.nan
    out: dict[str, np.ndarray] = {}
    target._evaluate(x, out)
    assert np.isfinite(out["F"]).all() and np.isfinite(out["G"]).all()
    assert (out["F"][1] == WORST).any()
    assert (out["G"][1] == WORST).all()
    clean = Population(problem, ["time", "rough"], 5).evaluate(x[[0, 2]])
    assert_array_equal(out["F"][[0, 2]], clean.objectives)
    assert_array_equal(out["G"][[0, 2]], clean.violations)


def test_a_zero_duration_cannot_reach_the_front() -> None:
    """Division by T = 0 makes the limits infinite or NaN, though the objective T1 + T2 is a sound 0."""
    problem = stairs_problem()
    target = PymooProblem(problem, ["time"], 5)
    out: dict[str, np.ndarray] = {}
    with np.errstate(all="ignore"):
        target._evaluate(np.zeros((1, 2)), out)
    assert out["F"].tolist() == [[0.0]]
    assert out["G"].tolist() == [[WORST]]


@pytest.mark.slow
def test_the_seed_decides_evolution_as_well_as_the_first_generation(hybrid: Problem) -> None:
    rng = np.random.default_rng(0)
    points = [hybrid.guess(rng) for _ in range(20)]
    fronts = []
    for seed in (1, 2, 1):
        left = iter(points)
        same_start = replace(hybrid, guess=lambda rng, left=left: next(left))
        fronts.append(np.array(small(seed).pareto(same_start, ["time", "energy"]).xs))
    assert_array_equal(fronts[0], fronts[2])
    assert not np.array_equal(fronts[0], fronts[1])


def test_a_reference_point_bounds_a_front_but_not_a_single_objective() -> None:
    problem = quintic_problem()
    rows = sum(len(limit.labels) for limit in problem.requirements.path_constraints)
    assert PymooProblem(problem, ["time", "effort"], 5).n_ieq_constr == rows + 2
    assert PymooProblem(problem, ["time"], 5).n_ieq_constr == rows
    out: dict[str, np.ndarray] = {}
    PymooProblem(problem, ["time", "effort"], 5)._evaluate(np.array([[5.0]]), out)
    assert out["G"][0, -2] == pytest.approx((5.0 - 4.0) / 2.0)  # over the scale of time
    assert out["G"][0, -1] < 0.0


def test_where_nothing_is_feasible_it_says_so() -> None:
    problem = quintic_problem(Quintic(velocity=1e-3))  # T >= 1875 s, at most 10 s allowed
    with pytest.raises(NoSolutionFound, match="quintic: no individual of nsga2 met every .* in 3 generations of 8"):
        NSGA2(0, population=8, generations=3).pareto(problem, ["time", "effort"])


@pytest.mark.parametrize("method", [NSGA2, MOPSO])
def test_a_population_that_does_not_move_says_so(method: Any) -> None:
    """One generation has nothing to move from; from one point, and with no room around it, none leads away."""
    problem = quintic_problem()
    assert not method(0, population=8, generations=1).pareto(problem, ["time", "effort"]).info["moved"]
    assert method(0, population=8, generations=6).pareto(problem, ["time", "effort"]).info["moved"]
    stuck = replace(problem, variables=(Variable("T", np.array([3.0]), np.array([3.0]), "s", ("T",)),))
    found = method(0, population=8, generations=6).pareto(replace(stuck, guess=lambda rng: np.array([3.0])), PAIR)
    assert not found.info["moved"] and all(x.tolist() == [3.0] for x in found.xs)


@pytest.mark.parametrize(
    ("values", "on", "gains"),
    [
        ([[1.0, 2.0]], [[1.0, 2.0], [2.0, 1.0]], False),
        ([[1.0, 2.0], [1.5, 1.4]], [[1.0, 2.0], [2.0, 1.0]], True),  # between them
        ([[0.9, 9.0]], [[1.0, 2.0]], True),  # beyond one end
        ([[1.0 - 1e-10, 2.0]], [[1.0, 2.0]], False),  # by rounding
        ([[3.0, 3.0]], np.empty((0, 2)), True),
        (np.empty((0, 2)), [[1.0, 2.0]], False),
    ],
)
def test_a_front_gains_on_another_by_a_point_none_of_it_is_as_good_as(values: Any, on: Any, gains: bool) -> None:
    assert gains_on(np.array(values), np.array(on)) is gains


@pytest.mark.parametrize(
    ("population", "generations", "message"),
    [
        (3, 10, "population is 3; give a whole number, 4 or more"),
        (10, 0, "generations is 0; give a whole number, 1 or more"),
    ],
)
def test_too_few_of_either_is_refused(population: int, generations: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        NSGA2(0, population=population, generations=generations)


def test_an_unknown_objective_is_refused() -> None:
    with pytest.raises(UnknownName, match="quintic has no objective 'cost'"):
        small().pareto(quintic_problem(), ["time", "cost"])


def test_progress_is_told_after_every_generation() -> None:
    told: list[tuple[int, int, str]] = []
    NSGA2(0, population=8, generations=4, progress=lambda *words: told.append(words)).pareto(
        quintic_problem(), ["time", "effort"]
    )
    assert [(done, total) for done, total, _ in told] == [(i, 4) for i in range(1, 5)]


def test_ctrl_c_keeps_the_front_so_far() -> None:
    def stop(done: int, total: int, words: str) -> None:
        if done == 5:
            raise KeyboardInterrupt

    found = NSGA2(0, population=20, generations=1000, progress=stop).pareto(quintic_problem(), ["time", "effort"])
    assert found.interrupted
    assert found.info["evaluation calls"] == 5
    assert len(found.xs) > 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_papers_parameters_come_within_one_percent_of_ipopts_optimum(hybrid: Problem, seed: int) -> None:
    """Guo et al. (2016), sect. 6: 100 individuals, 200 generations; single objective Fc."""
    found = NSGA2(seed).pareto(hybrid, ["cost"])
    cost = evaluate_objectives(hybrid, found.xs[0])["cost"]
    assert CHEAPEST * (1.0 - 1e-6) <= cost <= 1.01 * CHEAPEST
    assert found.info["evaluations"] == 20_000
