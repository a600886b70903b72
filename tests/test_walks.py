"""Populations in a narrow tube: no step of the variables stays in it, steps in coordinates about a trajectory do."""

import json
import re
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ocp_traj.arrays import Array
from ocp_traj.cli.commands import run
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import NoSolutionFound
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.legs import Walk, stuck
from ocp_traj.evolution.local_frame import LocalFrame
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.front import Front
from ocp_traj.results.records import Record
from ocp_traj.solvers.ga import GA
from ocp_traj.solvers.handover import chosen_of
from ocp_traj.solvers.mopso import MOPSO
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.solvers.pso import PSO

PAIR = ["across", "along"]
WIDTH = 1e-5


@dataclass(frozen=True)
class Tube:
    """Two joints on cubics with free control points, whose sum of squares, or sum, is 1 within a width."""

    bent: bool = True
    width: float = WIDTH


def tube_problem(case: Tube) -> Problem:
    """Joints a and b stay on a circle, or a line, to 1e-5, and what is traded is how far they go there either way."""
    start = np.array([1.0, 0.0] if case.bent else [0.5, 0.5])

    def held(s: ca.SX) -> ca.SX:
        return s.q[0] ** 2 + s.q[1] ** 2 - 1.0 if case.bent else s.q[0] + s.q[1] - 1.0

    return Problem(
        id="tube",
        case=case,
        variables=(
            Variable("P", np.full(8, -5.0), np.full(8, 5.0), "rad", tuple(f"P{k}{j}" for k in range(4) for j in "ab")),
        ),
        curve=lambda x: PiecewiseBezier(np.ones(1), (ca.reshape(x, 2, 4).T,)),
        objectives=(
            Objective("across", "rad", of_variables=lambda x, p: ca.sum1(x[1::2]) + 0.01 * ca.sumsqr(x)),
            Objective("along", "rad", of_variables=lambda x, p: ca.sumsqr(x[1::2] - 1.0)),
        ),
        default_objective="across",
        requirements=Requirements(
            ("a", "b"),
            ("rad", "rad"),
            (
                PathConstraint("tube", held, -case.width, case.width, ("rad2",), ("r",)),
                PathConstraint.on_derivative("velocity-limit", 1, -2.0, 2.0, ("rad/s",) * 2, ("a", "b")),
            ),
        ),
        guess=lambda rng: np.tile(start, 4),
    )


def frame_of(problem: Problem, x: Array) -> tuple[PymooProblem, LocalFrame]:
    target = PymooProblem(problem, PAIR, 5)
    return target, LocalFrame(problem, target.population, x, (target.xl, target.xu), target.inactive)


def test_coordinates_and_variables_are_one_to_one() -> None:
    problem = tube_problem(Tube())
    x = problem.guess(np.random.default_rng(0))
    _, frame = frame_of(problem, x)
    z = np.random.default_rng(1).uniform(-0.1, 0.1, (20, frame.size))
    assert frame.size == problem.size
    assert_allclose(frame.z(frame.x(z)), z, atol=1e-6)
    assert_array_equal(frame.x(np.zeros((1, frame.size)))[0], x)


def test_where_rows_are_linear_the_ellipsoid_keeps_every_limit() -> None:
    """Dikin's: sum of squares of steps over what is left is |z|^2, so none is above |z|."""
    problem = tube_problem(Tube(bent=False))
    target, frame = frame_of(problem, problem.guess(np.random.default_rng(0)))
    rng = np.random.default_rng(0)
    z = rng.standard_normal((200, frame.size))
    unit = z / np.linalg.norm(z, axis=1, keepdims=True) / np.maximum(frame.reach, 1.0)
    assert (target.population.evaluate(frame.x(unit)).violations <= 1e-9).all()
    # And an axis goes about as far as it can, to one of its sides.
    ends = np.concatenate([np.eye(frame.size), -np.eye(frame.size)])
    kept = (target.population.evaluate(frame.x(ends)).violations <= 0.0).all(axis=1).reshape(2, -1)
    assert kept.any(axis=0).all()
    longer = (target.population.evaluate(frame.x(11.0 * ends)).violations <= 0.0).all(axis=1)
    assert not longer.any()


def test_only_a_guess_that_no_step_leaves_is_walked_from(hybrid: Problem) -> None:
    rng = np.random.default_rng(0)
    for case, expected in ((Tube(), True), (Tube(width=0.5), False)):
        problem = tube_problem(case)
        first = np.array([problem.guess(rng)] * 4)
        found = stuck(PymooProblem(problem, PAIR, 5), first, rng)
        assert (found is not None) == expected
        assert stuck(PymooProblem(problem, PAIR, 5), first + 1.0, rng) is None  # it breaks the tube itself
    guesses = np.array([hybrid.guess(rng) for _ in range(4)])
    assert stuck(PymooProblem(hybrid, ["time", "energy"], 5), guesses, rng) is None


def test_a_walk_keeps_what_nothing_dominates_and_no_more_than_its_population() -> None:
    problem = tube_problem(Tube())
    target = PymooProblem(problem, PAIR, 5)
    rng = np.random.default_rng(0)
    walk = Walk(target, rng.uniform(-1.0, 1.0, (50, 8)), 6, rng)
    best = walk.f.min(axis=0)
    walk.add(rng.uniform(-1.0, 1.0, (200, 8)))
    assert len(walk.xs) <= 6 and (walk.f.min(axis=0) <= best).all()
    assert not any((a <= b).all() and (a < b).any() for a in walk.f for b in walk.f)


@pytest.mark.slow
@pytest.mark.parametrize("method", [NSGA2, MOPSO])
def test_a_population_walks_along_a_tube_and_stays_in_it(method: type[NSGA2] | type[MOPSO]) -> None:
    """From (1, 0) both ways along the circle, all proved; the same seed gives the same points."""
    problem = tube_problem(Tube())
    told: list[Record] = []
    one, two = (method(1, population=20, generations=45, found=told.append).pareto(problem, PAIR) for _ in range(2))
    assert_array_equal(np.array(one.xs), np.array(two.xs))
    start = Front.of(problem, PAIR, [problem.guess(np.random.default_rng(0))], method="", seed=None, seconds=0.0)
    front = Front.of(problem, PAIR, one.xs, method="", seed=None, seconds=0.0)
    assert len(told) == 4 and [point["x"] for point in told[1]["points"]] == [x.tolist() for x in one.xs]
    assert one.info["moved"] and one.info["legs"] == 2 and len(front) > 3
    assert all(front.ideal[name] < start.ideal[name] - 1e-4 for name in PAIR)


@pytest.mark.parametrize("method", [PSO(1, population=20, generations=45), GA(1, population=20, generations=45)])
def test_swarm_and_genes_walk_too(method: PSO | GA) -> None:
    problem = tube_problem(Tube())
    run, target = method.run(problem, "across")
    assert run.moved and run.legs == 2 and len(run.history) == 45
    assert (np.diff(run.history["best"]) <= 0.0).all()
    assert (target.population.evaluate(run.best).violations <= 0.0).all()
    assert 800 < target.individuals == run.history["evaluations"].iloc[-1] <= 45 * 20


def still() -> Problem:
    """Both objectives are least at the guess."""
    problem = tube_problem(Tube())
    x = problem.guess(np.random.default_rng(0))
    objectives = tuple(
        Objective(name, "rad2", of_variables=lambda v, p, k=k: 1.0 + k * ca.sumsqr(v - ca.DM(x)))
        for k, name in enumerate(PAIR, 1)
    )
    return replace(problem, id="tests.test_walks:still", objectives=objectives)


def test_what_cannot_move_is_refused_with_the_reason() -> None:
    with pytest.raises(NoSolutionFound, match="nothing better than the one guess it began with"):
        NSGA2(1, population=8, generations=4).pareto(still(), PAIR)


def test_a_best_individual_that_is_the_start_is_no_success(capsys: pytest.CaptureFixture[str]) -> None:
    sizes = ["--option", "population=8", "--option", "generations=2"]
    assert run(["solve", still().id, "--objective", "across", "--method", "ga", *sizes, "--json"]) == 1
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert (found["moved"], found["audit"]["verdict"]) == (False, "proved")
    assert re.search(r"ga: the best of \d+ individuals; none is better than the best of those it began with", said.err)


def test_of_a_walk_its_best_and_its_start_are_refined() -> None:
    """Both lead to the end of what is across; it is no farther than the walk's best, and proved."""
    problem = tube_problem(Tube())
    swarm = PSO(1, population=20, generations=10)
    run, target = swarm.run(problem, "across")
    best, start = chosen_of(run, target)
    assert_array_equal(start, problem.guess(np.random.default_rng(0)))
    assert_array_equal(best, run.best[0])
    found = replace(swarm, refine=True).solve(problem, WeightedSum({"across": 1.0}))
    assert found.audit is not None and found.audit.proved
    assert found.f < target.population.evaluate(best).objectives[0, 0] - 0.1
