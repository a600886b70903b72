"""Multi-objective particle swarms through pymoo: CMOPSO (Zhang et al., 2018) and MOPSO-CD (Raquel and Naval, 2005).

pymoo's MOPSO-CD knows no constraints. Here an individual that breaks a limit is worse than every feasible one in every
objective, and the worse the more it breaks, so that domination itself puts the feasible first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pymoo.algorithms.moo.cmopso import CMOPSO
from pymoo.algorithms.moo.mopso_cd import MOPSO_CD
from pymoo.core.sampling import Sampling

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.legs import evolved
from ocp_traj.evolution.outcome import front_of
from ocp_traj.formulation.case import check, choice, count
from ocp_traj.formulation.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.results.pareto_set import ParetoSet
from ocp_traj.results.records import Found, ignore


class _Given(Sampling):  # type: ignore[misc]  # pymoo is untyped
    """Starting points as they are: MOPSO-CD takes no array."""

    def __init__(self, points: Array) -> None:
        super().__init__()
        self.points = points

    def _do(self, problem: Any, n_samples: int, *args: Any, **kwargs: Any) -> Array:
        return self.points[:n_samples]


class CompetitiveSwarm(CMOPSO):  # type: ignore[misc]  # pymoo is untyped
    """pymoo's, with its archive's tournaments drawn from the algorithm's generator: else they ignore the seed."""

    def _setup(self, problem: Any, **kwargs: Any) -> None:
        super()._setup(problem, **kwargs)
        survival = self.elites.truncation.survival
        self.elites.truncation = lambda pop, count: survival.do(
            problem, pop, n_survive=count, random_state=self.random_state
        )


@dataclass(frozen=True)
class MOPSO:
    """A multi-objective swarm on a problem's decision variables.

    Attributes:
        seed: of everything random.
        population, generations: particles and iterations.
        variant: ``competitive`` (CMOPSO) or ``crowding`` (MOPSO-CD).
        archive: largest number of points kept by MOPSO-CD.
        per_segment: instants a segment at which limits are looked at, at least its degree; the audit has the last word.
        dilate: whether individuals that break a limit are slowed down until they keep it, where that can be done.
        max_seconds: stop after the iteration that passes this.
        progress: told after each iteration.
        found: given a record of the feasible points that are best, now and then.
    """

    seed: int
    population: int = count(100, least=4)
    generations: int = count(200)
    variant: str = choice("competitive", ("competitive", "crowding"))
    archive: int = count(100)
    per_segment: int = count(5, least=2)
    dilate: bool = False
    max_seconds: float = np.inf
    progress: Progress = silent
    found: Found = ignore

    def __post_init__(self) -> None:
        """Checks the numbers and names."""
        check(self)

    @one_blas_thread
    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """The archive's feasible points; Ctrl-C ends it early with those it has."""
        rng = np.random.default_rng(self.seed)
        target = PymooProblem(problem, objectives, self.per_segment, "dominated", dilate=self.dilate)
        first = np.array([problem.guess(rng) for _ in range(self.population)])
        run = evolved(
            self._algorithm, target, first, self.generations, self.seed, self.max_seconds, self.progress,
            found=self.found,
        )  # fmt: skip
        return front_of(run, target, problem, "mopso", self.seed, self.population, self.generations)

    def _algorithm(self, first: Array) -> Any:
        """As pymoo has it, from a first generation."""
        if self.variant == "crowding":
            return MOPSO_CD(pop_size=self.population, sampling=_Given(first), archive_size=self.archive, seed=self.seed)
        return CompetitiveSwarm(pop_size=self.population, sampling=first, elite_size=max(10, self.population // 10))
