"""NSGA-II, NSGA-III and MOEA/D, a generation at a time, of pymoo (Blank and Deb, 2020), as its manual has them."""

from __future__ import annotations

from itertools import count
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.moead import ParallelMOEAD
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3
from pymoo.optimize import minimize
from pymoo.termination.max_time import TimeBasedTermination
from pymoo.util.ref_dirs import get_reference_directions

Array = NDArray[np.float64]
METHODS = ("NSGA-II", "NSGA-III", "MOEA/D")
SIZES = (100, 50, 200)  # of the population, or of the directions
CONSTRAINED = {"NSGA-II": True, "NSGA-III": True, "MOEA/D": False}  # what it does with constraints; MOEA/D refuses them


def algorithm(method: str, objectives: int, size: int) -> Any:
    """The algorithm with the operators that its class comes with."""
    if method == "NSGA-II":
        return NSGA2(pop_size=size)
    larger = next(
        p for p in count(1) if comb(p + objectives - 1, p) > size
    )  # a direction for each, if there are so many
    directions = get_reference_directions("uniform", objectives, n_partitions=larger - 1)
    if method == "NSGA-III":
        return NSGA3(pop_size=size, ref_dirs=directions)
    return ParallelMOEAD(directions, n_neighbors=15, prob_neighbor_mating=0.7)


def front(problem: Any, method: str, size: int, seconds: float, seed: int) -> tuple[Array, int]:
    """Decision vectors ``(M, n)`` of the best after so many seconds of the wall clock, and generations.

    Args:
        problem: of pymoo; without constraints where ``CONSTRAINED`` says so.
        method: one of ``METHODS``.
        size: of the population.
        seconds: given.
        seed: of everything random.
    """
    chosen = algorithm(method, problem.n_obj, size)
    found = minimize(problem, chosen, TimeBasedTermination(seconds), seed=seed, verbose=False)
    best = np.empty((0, problem.n_var)) if found.X is None else np.atleast_2d(found.X)
    return best.astype(float), int(found.algorithm.n_iter - 1)
