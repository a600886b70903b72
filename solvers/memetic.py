"""A memetic search for fronts: evolution outside, IPOPT inside, each handing to the other.

The outer search is NSGA-II, NSGA-III or a competitive swarm. Every few generations some individuals are improved by
goal attainment, proved, and put back among the population, whose descendants they lead on: the best of its first rank
where they are least crowded, some that are far from all proved points, and between two proved neighbours that are far
apart what lies there. The hybrid of Ogbemhe et al., ``hmoga``, is the special case of one such stage, at the very end.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.algorithms.moo.nsga3 import NSGA3 as PymooNSGA3
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.util.ref_dirs import get_reference_directions

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import NoSolutionFound
from ocp_traj.evolution.evolution import PymooProblem, evolve
from ocp_traj.evolution.outcome import ended_after
from ocp_traj.formulation.case import check, choice, count, number, share
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet, check_traded
from ocp_traj.results.records import Found, ignore
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.mopso import CompetitiveSwarm
from ocp_traj.solvers.seeding import ends_of, first_generation, inside
from ocp_traj.solvers.stages import Stages
from ocp_traj.stopping import Stopping, stopping

OUTER = ("nsga2", "nsga3", "mopso")


@dataclass(frozen=True)
class Memetic:
    """Evolution and local solves in turns.

    Attributes:
        seed: of everything random.
        outer: search, one of ``OUTER``.
        population, generations: their numbers.
        every: generations between two stages of local solves.
        chosen: local solves of a stage, where no time is set.
        points: local solves of the last stage, after the last generation.
        local_share: of the time that is set, for local solves: a stage goes on until it has had it.
        ends_share: of the time that is set, for the ends of the front, at most.
        far_share: of the individuals chosen, those that are far from all proved points.
        crossover: probability of a pair.
        mutation: probability of a variable; 1/n if not given.
        crossover_index, mutation_index: distribution indices of SBX and polynomial mutation; our choice.
        seeded: share of the first generation that lies between and around the ends of the front; the rest is random.
        starts: random starts at each end.
        solver: of the ends, and of each local solve.
        per_segment: instants a segment at which limits are looked at in a generation, at least its degree.
        dilate: whether individuals that break a limit are slowed down until they keep it, where that can be done.
        max_seconds: time for all.
        workers: who does the local solves; the front does not depend on it.
        progress: told after each generation.
        found: given a record of each solve, and of the population now and then.
    """

    seed: int
    outer: str = choice("nsga2", OUTER)
    population: int = count(100, least=4)
    generations: int = count(100)
    every: int = count(10)
    chosen: int = count(8)
    points: int = count(20, least=0)
    local_share: float = share(0.75)
    ends_share: float = share(0.35)
    far_share: float = share(0.2)
    crossover: float = share(0.9)
    mutation: float | None = share(None)
    crossover_index: float = number(15.0, least=0.0)
    mutation_index: float = number(20.0, least=0.0)
    seeded: float = share(0.5)
    starts: int = count(2)
    solver: Exchange = field(default_factory=Exchange)
    per_segment: int = count(5, least=2)
    dilate: bool = True
    max_seconds: float = np.inf
    workers: Workers = field(default_factory=Workers)
    progress: Progress = silent
    found: Found = ignore

    def __post_init__(self) -> None:
        """Checks the numbers and names."""
        check(self)

    @one_blas_thread
    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """The proved points of all stages, and the last generation's best; Ctrl-C ends it early with those it has."""
        check_traded(objectives)
        with stopping(self.max_seconds) as stop:
            return self._run(problem, tuple(objectives), stop)

    def _run(self, problem: Problem, objectives: tuple[str, ...], stop: Stopping) -> ParetoSet:
        begun = time.perf_counter()
        most = self.ends_share * self.max_seconds if np.isfinite(self.max_seconds) else np.inf
        ends, info = ends_of(problem, objectives, self.solver, self.starts, self.seed, most, self.found, self.workers)
        info["outer"] = self.outer
        if "conflict" in info or ends.interrupted:
            return ParetoSet(ends.xs, "memetic", self.seed, ends.seconds, info, ends.interrupted)
        rng = np.random.default_rng(self.seed)
        handling = "dominated" if self.outer == "mopso" else "feasibility"
        target = PymooProblem(
            problem, objectives, self.per_segment, handling, refine=True, known=ends.xs, dilate=self.dilate
        )
        known = list(ends.xs) or inside(target, np.array([problem.guess(rng)]))
        first = first_generation(target, problem, objectives, known, self.population, self.seeded, rng)
        complete = ENDED_AFTER not in info and not ends.info["unsolved ends"]
        stages = Stages(self, problem, objectives, target, ends.xs, complete, rng)
        run = evolve(
            self._algorithm(first, len(objectives)), target, self.generations, self.seed,
            max(stop.deadline - time.perf_counter(), 0.0), self.progress, after=stages.after, found=self.found,
        )  # fmt: skip
        if not run.interrupted and not stop.due:
            stages.last()
        interrupted = stop.tell()
        info.pop(ENDED_AFTER, None)  # the ends have had their share of the time
        xs = [*stages.xs, *inside(target, run.best)]
        if not xs and not interrupted and not stop.due:
            raise NoSolutionFound(
                f"{problem.id}: no individual of {self.outer} met every limit in {self.generations} generations of "
                f"{self.population}, nor did a local solve from one; use trace, which names the limits in conflict"
            )
        seconds = time.perf_counter() - begun
        info |= {
            "population": self.population,
            "generations": len(run.history),
            "evaluation calls": target.calls,
            "evaluations": target.individuals,
            "evaluation seconds": target.seconds,
            "moved": run.moved or stages.better > 0 or bool(ends.xs),
            **stages.info,
            "shares of time": {
                "ends": ends.seconds / seconds,
                "local solves": stages.seconds / seconds,
                "evolution": (run.seconds - stages.seconds_within) / seconds,
            },
            **ended_after(run, self.generations),
        }
        return ParetoSet(xs, "memetic", self.seed, seconds, info, interrupted)

    def _algorithm(self, first: Array, objectives: int) -> Any:
        """The outer search, as pymoo has it."""
        if self.outer == "mopso":
            return CompetitiveSwarm(pop_size=self.population, sampling=first, elite_size=max(10, self.population // 10))
        operators = {
            "sampling": first,
            "crossover": SBX(prob=self.crossover, eta=self.crossover_index),
            "mutation": PM(prob=1.0, prob_var=self.mutation, eta=self.mutation_index),
        }
        if self.outer == "nsga2":
            return PymooNSGA2(pop_size=self.population, **operators)
        return PymooNSGA3(_directions(objectives, self.population), pop_size=self.population, **operators)


def _directions(objectives: int, most: int) -> Array:
    """The finest lattice of directions with at most so many."""
    partitions = 1
    found = get_reference_directions("das-dennis", objectives, n_partitions=partitions)
    while True:
        partitions += 1
        finer = get_reference_directions("das-dennis", objectives, n_partitions=partitions)
        if len(finer) > most:
            return np.asarray(found)
        found = finer
