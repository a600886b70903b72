"""Many individuals in one pass give what each gives alone, and what direct evaluation gives."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ocp_traj.errors import InputError, UnknownName
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from tests.closed_form import Direct, Quintic, mixed_problem, quintic_problem, stairs_problem

PER_SEGMENT = 4


def individuals(problem: Problem, count: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.array([problem.guess(rng) for _ in range(count)])


@pytest.mark.parametrize("make", [mixed_problem, quintic_problem, stairs_problem])
def test_objectives_are_their_definitions_on_numbers(make: type) -> None:
    problem: Problem = make()
    names = [o.id for o in problem.objectives if o.id != "area"]  # its integrand jumps where it promised not to
    xs = individuals(problem, 3)
    found = Population(problem, names).evaluate(xs).objectives
    expected = [[Direct(problem, x).objective(name) for name in names] for x in xs]
    assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("make", [mixed_problem, quintic_problem, stairs_problem])
def test_violations_are_the_largest_excess_over_the_instants(make: type) -> None:
    problem: Problem = make()
    xs = individuals(problem, 3)
    found = Population(problem, ["time"], PER_SEGMENT).evaluate(xs).violations
    for x, row in zip(xs, found, strict=True):
        direct, grid = Direct(problem, x), np.linspace(0.0, 1.0, PER_SEGMENT)
        expected = [
            # Where a limit is continuous at a knot, by promise, the right side stands for both.
            direct.excess(limit, grid, both_sides=not problem.requirements.continuous(limit))
            for limit in problem.requirements.path_constraints
        ]
        assert_allclose(row, np.concatenate(expected), rtol=1e-10, atol=1e-10)


def test_violation_of_the_quintic_has_its_closed_form() -> None:
    """With 3 instants the velocity's peak 15/8 D/T is seen; the acceleration is zero at all of them."""
    case = Quintic()
    t = np.array([0.5, 1.0, 2.0])
    found = Population(quintic_problem(case), ["time"], 3).evaluate(t[:, None]).violations
    assert_allclose(found[:, 0], 15.0 / 8.0 * case.distance / t / case.velocity - 1.0, rtol=1e-13)
    assert_allclose(found[:, 1], -1.0, atol=1e-13)


def test_a_population_gives_what_its_members_give_alone() -> None:
    problem = mixed_problem()
    names = [o.id for o in problem.objectives]
    population = Population(problem, names)
    xs = individuals(problem, 17)
    together = population.evaluate(xs)
    for i, x in enumerate(xs):
        alone = population.evaluate(x)  # one vector is a population of one
        assert alone.objectives.shape == (1, len(names))
        assert_allclose(together.objectives[i], alone.objectives[0], rtol=1e-13)
        assert_allclose(together.violations[i], alone.violations[0], rtol=1e-11, atol=1e-12)


def test_objectives_come_in_the_order_asked_for() -> None:
    problem = quintic_problem()
    xs = individuals(problem, 4)
    one = Population(problem, ["effort", "time"]).evaluate(xs).objectives
    other = Population(problem, ["time", "effort"]).evaluate(xs).objectives
    assert_array_equal(one, other[:, ::-1])
    assert_array_equal(Population(problem, ["time", "both"]).evaluate(xs).objectives[:, 0], xs[:, 0])


def test_an_individual_that_cannot_be_evaluated_is_infeasible_and_harms_no_other() -> None:
    problem = mixed_problem()
    population = Population(problem, ["time", "rough"])
    xs = individuals(problem, 5)
    clean = population.evaluate(xs)
    xs[2] = np.nan
    found = population.evaluate(xs)
    assert (found.violations[2] == np.inf).all()
    others = [0, 1, 3, 4]
    assert_array_equal(found.objectives[others], clean.objectives[others])
    assert_array_equal(found.violations[others], clean.violations[others])


def test_a_population_of_the_wrong_width_is_refused() -> None:
    with pytest.raises(InputError, match="quintic has 1 variables; the population has 2"):
        Population(quintic_problem(), ["time"]).evaluate(np.ones((3, 2)))


def test_an_unknown_objective_is_refused() -> None:
    with pytest.raises(UnknownName, match="quintic has no objective 'cost'"):
        Population(quintic_problem(), ["cost"])
