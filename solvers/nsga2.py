"""NSGA-II through pymoo, with one tape pass a generation. Deb et al. (2002), IEEE Trans. Evol. Comp. 6(2).

The defaults are the parameters of Guo et al. (2016), sect. 6: 100 individuals, 200 generations, crossover 0.9 with
index 10, mutation 0.1 with index 100.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.core.problem import Problem as PymooProblem
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM

from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.population import Population
from ocp_traj.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.solvers.pareto_set import ParetoSet

Array = NDArray[np.float64]

WORST = 1e12  # finite stand-in for a value that could not be computed: NaN would reach the front


class _Vectorised(PymooProblem):  # type: ignore[misc]  # pymoo is untyped
    """A problem as pymoo sees it: a generation a call, every limit a constraint, objectives to be minimised."""

    def __init__(self, problem: Problem, objectives: Sequence[str], per_segment: int) -> None:
        self.population = Population(problem, objectives, per_segment)
        chosen = [problem.objective(name) for name in objectives]
        self.signs = np.array([1.0 if o.sense == "min" else -1.0 for o in chosen])
        self.scales = np.array([o.scale for o in chosen])
        # Beyond its reference point an objective is not worth having; alone, it needs no such bound.
        bounds = problem.reference_point if len(chosen) > 1 else {}
        self.bounds = np.array([self.signs[i] * bounds.get(o.id, np.inf) for i, o in enumerate(chosen)])
        self.seconds, self.calls, self.individuals = 0.0, 0, 0
        rows = sum(len(limit.labels) for limit in problem.requirements.path_constraints)
        super().__init__(
            n_var=problem.size,
            n_obj=len(chosen),
            n_ieq_constr=rows + int(np.isfinite(self.bounds).sum()),
            xl=problem.lower,
            xu=problem.upper,
        )

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        begun = time.perf_counter()
        evaluation = self.population.evaluate(x)
        f = evaluation.objectives * self.signs
        bounded = np.isfinite(self.bounds)
        beyond = (f[:, bounded] - self.bounds[bounded]) / self.scales[bounded]
        g = np.concatenate([evaluation.violations, beyond], axis=1)
        broken = ~np.isfinite(f).all(axis=1)
        g[broken] = WORST
        out["F"] = np.where(np.isfinite(f), f, WORST)
        out["G"] = np.clip(np.where(np.isnan(g), WORST, g), -WORST, WORST)
        self.seconds += time.perf_counter() - begun
        self.calls += 1
        self.individuals += len(x)


@dataclass(frozen=True)
class NSGA2:
    """NSGA-II on a problem's decision variables.

    Attributes:
        seed: of everything random.
        population, generations: their numbers.
        crossover, mutation: probabilities, of a pair and of a variable.
        crossover_index, mutation_index: distribution indices of SBX and polynomial mutation.
        per_segment: instants a segment at which limits are looked at; the audit has the last word.
        max_seconds: stop after the generation that passes this.
        progress: told after each generation.
    """

    seed: int
    population: int = 100
    generations: int = 200
    crossover: float = 0.9
    mutation: float = 0.1
    crossover_index: float = 10.0
    mutation_index: float = 100.0
    per_segment: int = 5
    max_seconds: float = np.inf
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the numbers."""
        if self.population < 4 or self.generations < 1:
            raise InputError(
                f"NSGA-II needs a population of 4 or more and 1 or more generations; "
                f"got {self.population}, {self.generations}"
            )

    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """The last generation's non-dominated feasible individuals; Ctrl-C ends it early with those it has."""
        begun = time.perf_counter()
        rng = np.random.default_rng(self.seed)
        target = _Vectorised(problem, objectives, self.per_segment)
        algorithm = PymooNSGA2(
            pop_size=self.population,
            sampling=np.array([problem.guess(rng) for _ in range(self.population)]),
            crossover=SBX(prob=self.crossover, eta=self.crossover_index),
            mutation=PM(prob=1.0, prob_var=self.mutation, eta=self.mutation_index),
        )
        algorithm.setup(target, termination=("n_gen", self.generations), seed=self.seed, verbose=False)
        interrupted = False
        try:
            while algorithm.has_next() and time.perf_counter() - begun < self.max_seconds:
                algorithm.next()
                self.progress(algorithm.n_iter - 1, self.generations, _words(algorithm))
        except KeyboardInterrupt:
            interrupted = True
        best = algorithm.opt
        if best is None or len(best) == 0 or not best.get("feas").any():
            raise NoSolutionFound(
                f"{problem.id}: no individual of NSGA-II met every limit in {self.generations} generations of "
                f"{self.population}; give it more of either, or use method trace, which names the limits in conflict"
            )
        seconds = time.perf_counter() - begun
        info = {
            "population": self.population,
            "generations": self.generations,
            "evaluation calls": target.calls,
            "evaluations": target.individuals,
            "evaluation seconds": target.seconds,
            "algorithm seconds": seconds - target.seconds,
        }
        return ParetoSet(list(np.atleast_2d(best.get("X"))), "nsga2", self.seed, seconds, info, interrupted)


def _words(algorithm: Any) -> str:
    best = algorithm.opt
    if best is None or not best.get("feas").any():
        return "nothing feasible yet"
    return f"{len(best)} points, best {', '.join(f'{value:.6g}' for value in best.get('F').min(axis=0))}"
