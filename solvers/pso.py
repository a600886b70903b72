"""Particle swarm optimisation of one objective, with the schedules that Zhu and Wang compare. Through pymoo's PSO.

Kennedy and Eberhart (1995); eqs (8)-(12) of Zhu and Wang. The update is pymoo's: velocities are clipped to a share of
the bounds' range, a particle that leaves the bounds draws its step again and is put back at random after twenty draws.
The paper states neither that nor its population, bounds and treatment of limits: all of them are fields.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Any

import numpy as np
from pymoo.algorithms.soo.nonconvex.pso import PSO as PymooPSO

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.evolution.evolution import Evolution, PymooProblem
from ocp_traj.evolution.legs import evolved
from ocp_traj.evolution.outcome import single_objective, solution_of
from ocp_traj.formulation.case import check, choice, count, number, share
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.progress import Progress, silent
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.handover import handed_over

W_MAX, W_MIN = 0.9, 0.4  # sect. 4 of Zhu and Wang
CONSTRICTION = 2.0 / (4.1 - 2.0 + sqrt(4.1**2 - 4.0 * 4.1))  # Clerc and Kennedy (2002), phi = 4.1: 0.7298

Coefficients = tuple[float, float, float]  # inertia w, cognitive c1, social c2


def _learning(share: float) -> tuple[float, float]:
    """(11), (12) of Zhu and Wang; ``share`` is t / T_max."""
    return 2.0 * cos(pi * share / 3.0) ** 2, 2.0 * sin(pi * share / 1.5) ** 2


def as_printed(share: float, random: float) -> Coefficients:
    """(10)-(12) as printed: the cosine's argument lacks pi / 2, the sum lacks w_min."""
    inertia = (W_MAX - W_MIN) * cos(share) ** 2 if share <= 0.6 else 0.2 + 0.1 * random
    return (inertia, *_learning(share))


def repaired(share: float, random: float) -> Coefficients:
    """(10)-(12) with w = w_min + (w_max - w_min) cos^2(pi t / (2 T_max)) in its first branch."""
    inertia = W_MIN + (W_MAX - W_MIN) * cos(pi * share / 2.0) ** 2 if share <= 0.6 else 0.2 + 0.1 * random
    return (inertia, *_learning(share))


def linear(share: float, random: float) -> Coefficients:
    """Inertia falling linearly from 0.9 to 0.4, c1 = c2 = 2: Shi and Eberhart (1999)."""
    return W_MAX - (W_MAX - W_MIN) * share, 2.0, 2.0


def constriction(share: float, random: float) -> Coefficients:
    """Constant, by the constriction factor: Clerc and Kennedy (2002)."""
    return CONSTRICTION, 2.05 * CONSTRICTION, 2.05 * CONSTRICTION


SCHEDULES: dict[str, Callable[[float, float], Coefficients] | None] = {
    "as_printed": as_printed,
    "repaired": repaired,
    "linear": linear,
    "constriction": constriction,
    "adaptive": None,  # pymoo's own: Zhan et al. (2009), with a mutation of the best particle
}


@dataclass(frozen=True)
class PSO:
    """A particle swarm on one objective of a problem.

    Attributes:
        seed: of everything random.
        population: particles.
        generations: iterations, T_max.
        schedule: of inertia and learning factors, one of ``SCHEDULES``.
        handling: of limits, ``feasibility`` (Deb's rules) or ``penalty`` (the sum of excesses times ``weight``).
        weight: of the penalty, in units of the objective's scale.
        max_velocity: of a particle, a share of the bounds' range an iteration.
        per_segment: instants a segment at which limits are looked at, peaks between them by parabolas; the audit has
            the last word.
        refine: whether the best individuals are handed to the local solver, whose result is proved and never worse.
        max_seconds: stop after the iteration that passes this.
        progress: told after each iteration.
    """

    seed: int = 0
    population: int = count(30, least=2)
    generations: int = count(200)
    schedule: str = choice("repaired", tuple(SCHEDULES))
    handling: str = choice("feasibility", ("feasibility", "penalty"))
    weight: float = number(1e3, least=0.0)
    max_velocity: float = share(0.2)
    per_segment: int = count(31, least=2)
    refine: bool = False
    max_seconds: float = np.inf
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the numbers and names."""
        check(self)

    @one_blas_thread
    def run(self, problem: Problem, name: str) -> tuple[Evolution, PymooProblem]:
        """The swarm's run on one objective; Ctrl-C ends it early with what it has."""
        rng = np.random.default_rng(self.seed)
        target = PymooProblem(problem, [name], self.per_segment, self.handling, self.weight, refine=True)
        schedule = SCHEDULES[self.schedule]
        first = np.array([problem.guess(rng) for _ in range(self.population)])

        def algorithm(first: Array) -> Any:
            return PymooPSO(
                pop_size=self.population,
                sampling=first,
                adaptive=schedule is None,
                pertube_best=schedule is None,
                max_velocity_rate=self.max_velocity,
            )

        def before(swarm: Any, iteration: int) -> None:
            if schedule is not None:
                swarm.w, swarm.c1, swarm.c2 = schedule(iteration / self.generations, rng.random())

        return evolved(
            algorithm, target, first, self.generations, self.seed, self.max_seconds, self.progress, before
        ), target

    @one_blas_thread
    def solve(self, problem: Problem, scalarisation: Scalarisation) -> Solution:
        """The best particle, proved where slowing it down can do that."""
        name = single_objective(problem, scalarisation, "pso")
        run, target = self.run(problem, name)
        if self.refine:
            return handed_over(run, target, problem, scalarisation, "pso", self.population, self.generations)
        return solution_of(run, target, problem, name, "pso", self.population, self.generations)
