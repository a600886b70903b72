"""Kernels: the sum of squares of rows is what differentiating it as a whole gives; nodes of integrals suffice."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.formulation.levels import cut
from ocp_traj.formulation.objective import SumOfSquares, gauss
from ocp_traj.formulation.task_objectives import NODES, _integral
from ocp_traj.transcription.kernel import Kernel, SquaresKernel, limit_kernel
from ocp_traj.transcription.symbolic import integrand_function

UR5 = Path(__file__).parent.parent / "examples" / "tasks" / "ur5-via.toml"


@pytest.fixture(scope="module")
def problem() -> ot.Problem:
    return ot.problems.load("task", file=str(UR5))


@pytest.mark.parametrize("name", ["effort", "energy"])
def test_squares_have_the_derivatives_of_their_sum(problem: ot.Problem, name: str) -> None:
    objective, dof = problem.objective(name), problem.requirements.dof
    assert isinstance(objective.integrand, SumOfSquares)
    own, whole = limit_kernel(problem, name), Kernel(integrand_function(problem, objective), dof)
    assert isinstance(own, SquaresKernel) and (own.rows, own.orders, own.size) == (1, whole.orders, whole.size)
    assert np.array_equal(own.depends, whole.depends)
    rng = np.random.default_rng(0)
    count, none = 5, np.zeros((5, 0))
    given = (rng.normal(size=(count, 5 * dof)), rng.uniform(0.2, 1.0, (count, 1)), rng.uniform(size=(count, 1)),
             np.full((count, 1), 3.0), none)  # fmt: skip
    weights = rng.normal(size=(count, 1))
    pairs = [
        (own.values(given), whole.values(given)), *zip(own.first(given)[:2], whole.first(given)[:2], strict=True),
        (own.values(given), own.first(given).values),
        *zip(own.second(given, weights, own.first(given)), whole.second(given, weights), strict=True),
        *zip(own.second(given, weights), whole.second(given, weights), strict=True),
    ]  # fmt: skip
    for one, other in pairs:
        assert one.shape == other.shape
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-11 * np.abs(other).max())


@pytest.mark.slow
def test_few_nodes_are_enough_where_there_are_many_pieces(problem: ot.Problem) -> None:
    curve = ot.solve(problem).trajectory.curve
    legs = (range(curve.segments),)
    for name in ("effort", "energy"):
        objective = problem.objective(name)
        for pieces, nodes in NODES.items():
            finer = cut(curve, pieces, legs)
            found, exact = (
                _integral(finer, replace(objective, quadrature=gauss(n)), 6, np.array([3.0])) for n in (nodes, 30)
            )
            assert abs(found / exact - 1.0) < (1e-3 if pieces == 1 else 1e-6)
