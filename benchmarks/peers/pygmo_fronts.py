"""NSGA-II and MOEA/D of pygmo (Biscani and Izzo, 2020), a problem of one's own as its manual has it.

Its algorithms of several objectives take no constraints, so the problem comes with penalties; evaluation is of whole
generations. ``evolve`` has no clock: it is called for a few generations at a time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pygmo
from numpy.typing import NDArray

Array = NDArray[np.float64]
AT_A_TIME = 5  # generations between two looks at the clock


class Penalised:
    """What pygmo asks of a problem."""

    def __init__(self, evaluate: Callable[[Array], Array], objectives: int, lower: Array, upper: Array) -> None:
        """``evaluate`` takes ``(N, n)`` to objectives ``(N, m)`` with their penalties."""
        self.evaluate, self.objectives, self.bounds = evaluate, objectives, (lower.tolist(), upper.tolist())

    def fitness(self, x: Array) -> Array:
        """Of one individual."""
        return self.evaluate(np.asarray(x)[None])[0]

    def batch_fitness(self, xs: Array) -> Array:
        """Of many, one after the other in one vector."""
        return self.evaluate(np.asarray(xs).reshape(-1, len(self.bounds[0]))).ravel()

    def get_bounds(self) -> tuple[list[float], list[float]]:
        """Of the variables."""
        return self.bounds

    def get_nobj(self) -> int:
        """How many objectives."""
        return self.objectives


def front(problem: Any, method: str, size: int, seconds: float, seed: int) -> tuple[Array, int]:
    """The last population ``(size, n)`` after so many seconds of the wall clock, and generations."""
    begun, generations = time.perf_counter(), 0
    by = pygmo.nsga2(gen=AT_A_TIME, seed=seed) if "NSGA" in method else pygmo.moead_gen(gen=AT_A_TIME, seed=seed)
    by.set_bfe(pygmo.bfe(pygmo.member_bfe()))
    algorithm = pygmo.algorithm(by)
    population = pygmo.population(pygmo.problem(problem), size, b=pygmo.bfe(pygmo.member_bfe()), seed=seed)
    while time.perf_counter() - begun < seconds:
        population, generations = algorithm.evolve(population), generations + AT_A_TIME
    return np.asarray(population.get_x()), generations
