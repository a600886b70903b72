"""The real-coded genetic algorithm of El Haiek et al. (2019), sect. 4 and Table 1, through pymoo.

Tournaments of five, single-point crossover with probability 0.8, and a mutation that puts a gene anywhere within its
bounds with probability 0.05; 200 individuals, 80 generations. Of parents and offspring the better half survives (the
paper says nothing of survival), so the best individual is never lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pymoo.algorithms.soo.nonconvex.ga import GA as PymooGA
from pymoo.core.mutation import Mutation
from pymoo.operators.crossover.pntx import SinglePointCrossover
from pymoo.operators.selection.tournament import TournamentSelection

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.evolution.evolution import Evolution, PymooProblem
from ocp_traj.evolution.legs import evolved
from ocp_traj.evolution.outcome import single_objective, solution_of
from ocp_traj.formulation.case import check, choice, count, share
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.progress import Progress, silent
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.handover import handed_over


class _Anywhere(Mutation):  # type: ignore[misc]  # pymoo is untyped
    """Puts each gene anywhere within its bounds, with some probability."""

    def __init__(self, rate: float) -> None:
        super().__init__(prob=1.0)
        self.rate = rate

    def _do(self, problem: Any, x: Array, *args: Any, random_state: Any = None, **kwargs: Any) -> Array:
        fresh = random_state.uniform(problem.xl, problem.xu, x.shape)
        return np.where(random_state.random(x.shape) < self.rate, fresh, x)


def fittest(pop: Any, groups: Any, *args: Any, **kwargs: Any) -> Any:
    """Winners of tournaments of any size: the feasible first, then the fitter."""
    violation = pop.get("CV")[:, 0]
    fitness = pop.get("F")[:, 0]
    order = np.lexsort((fitness, np.maximum(violation, 0.0)))
    rank = np.empty(len(order), dtype=int)
    rank[order] = np.arange(len(order))
    return groups[np.arange(len(groups)), np.argmin(rank[groups], axis=1)][:, None]


@dataclass(frozen=True)
class GA:
    """The genetic algorithm on one objective of a problem.

    Attributes:
        seed: of everything random.
        population, generations: their numbers.
        tournament: individuals in each.
        crossover, mutation: probabilities, of a pair and of a gene.
        handling: of limits, ``feasibility`` (Deb's rules) or ``death``: an individual that breaks a limit counts as
            infinitely bad, which is what the paper's division by F_o in (19) comes to.
        scaling: whether each individual is slowed down, or sped up, along its own path until a limit is just reached.
        per_segment: instants a segment at which limits are looked at, peaks between them by parabolas; the audit has
            the last word.
        refine: whether the best individuals are handed to the local solver, whose result is proved and never worse.
        max_seconds: stop after the generation that passes this.
        progress: told after each generation.
    """

    seed: int = 0
    population: int = count(200, least=4)
    generations: int = count(80)
    tournament: int = count(5)
    crossover: float = share(0.8)
    mutation: float = share(0.05)
    handling: str = choice("feasibility", ("feasibility", "death"))
    scaling: bool = False
    per_segment: int = count(31, least=2)
    refine: bool = False
    max_seconds: float = np.inf
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the numbers and names."""
        check(self)

    @one_blas_thread
    def run(self, problem: Problem, name: str) -> tuple[Evolution, PymooProblem]:
        """The run on one objective; Ctrl-C ends it early with what it has."""
        rng = np.random.default_rng(self.seed)
        target = PymooProblem(problem, [name], self.per_segment, self.handling, refine=True, scaling=self.scaling)
        first = np.array([problem.guess(rng) for _ in range(self.population)])

        def algorithm(first: Array) -> Any:
            return PymooGA(
                pop_size=self.population,
                sampling=first,
                selection=TournamentSelection(pressure=self.tournament, func_comp=fittest),
                crossover=SinglePointCrossover(prob=self.crossover),
                mutation=_Anywhere(self.mutation),
            )

        return evolved(algorithm, target, first, self.generations, self.seed, self.max_seconds, self.progress), target

    @one_blas_thread
    def solve(self, problem: Problem, scalarisation: Scalarisation) -> Solution:
        """The best individual, proved where slowing it down can do that."""
        name = single_objective(problem, scalarisation, "ga")
        run, target = self.run(problem, name)
        if self.refine:
            return handed_over(run, target, problem, scalarisation, "ga", self.population, self.generations)
        return solution_of(run, target, problem, name, "ga", self.population, self.generations)
