"""Solutions that several test modules look at, solved once a session."""

import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.exchange import Exchange


@pytest.fixture(scope="session")
def hybrid() -> Problem:
    """The hybrid-spline problem with the paper's numbers."""
    return problems.load("hybrid-spline")


@pytest.fixture(scope="session")
def fastest(hybrid: Problem) -> Solution:
    """Its time-optimal solution, from one random start."""
    return Exchange().solve(hybrid, WeightedSum({"time": 1.0}), hybrid.guess(np.random.default_rng(0)))


@pytest.fixture(scope="session")
def cheapest(hybrid: Problem) -> Solution:
    """Its solution of least cost, from one random start."""
    return Exchange().solve(hybrid, WeightedSum({"cost": 1.0}), hybrid.guess(np.random.default_rng(0)))
