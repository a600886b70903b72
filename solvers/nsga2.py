"""NSGA-II through pymoo, with one tape pass a generation. Deb et al. (2002), IEEE Trans. Evol. Comp. 6(2).

The defaults are the parameters of Guo et al. (2016), sect. 6: 100 individuals, 200 generations, crossover 0.9 with
index 10, mutation 0.1 with index 100.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.legs import evolved
from ocp_traj.evolution.outcome import front_of
from ocp_traj.formulation.case import check, count, number, share
from ocp_traj.formulation.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.results.pareto_set import ParetoSet
from ocp_traj.results.records import Found, ignore


@dataclass(frozen=True)
class NSGA2:
    """NSGA-II on a problem's decision variables.

    Attributes:
        seed: of everything random.
        population, generations: their numbers.
        crossover, mutation: probabilities, of a pair and of a variable.
        crossover_index, mutation_index: distribution indices of SBX and polynomial mutation.
        per_segment: instants a segment at which limits are looked at, at least its degree; the audit has the last word.
        dilate: whether individuals that break a limit are slowed down until they keep it, where that can be done.
        max_seconds: stop after the generation that passes this.
        progress: told after each generation.
        found: given a record of the feasible points that are best, now and then.
    """

    seed: int
    population: int = count(100, least=4)
    generations: int = count(200)
    crossover: float = share(0.9)
    mutation: float = share(0.1)
    crossover_index: float = number(10.0, least=0.0)
    mutation_index: float = number(100.0, least=0.0)
    per_segment: int = count(5, least=2)
    dilate: bool = False
    max_seconds: float = np.inf
    progress: Progress = silent
    found: Found = ignore

    def __post_init__(self) -> None:
        """Checks the numbers."""
        check(self)

    @one_blas_thread
    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """The last generation's non-dominated feasible individuals; Ctrl-C ends it early with those it has."""
        rng = np.random.default_rng(self.seed)
        target = PymooProblem(problem, objectives, self.per_segment, dilate=self.dilate)
        first = np.array([problem.guess(rng) for _ in range(self.population)])
        run = evolved(
            self._algorithm, target, first, self.generations, self.seed, self.max_seconds, self.progress,
            found=self.found,
        )  # fmt: skip
        return front_of(run, target, problem, "nsga2", self.seed, self.population, self.generations)

    def _algorithm(self, first: Array) -> Any:
        """As pymoo has it, from a first generation."""
        return PymooNSGA2(
            pop_size=self.population,
            sampling=first,
            crossover=SBX(prob=self.crossover, eta=self.crossover_index),
            mutation=PM(prob=1.0, prob_var=self.mutation, eta=self.mutation_index),
        )
