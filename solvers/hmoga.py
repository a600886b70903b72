"""The hybrid multi-objective genetic algorithm of Ogbemhe et al. (2019), sect. V-B and Table 4.

NSGA-II with controlled elitism, then goal attainment from the points of its front: evolution spreads the points over
the front, the local solver takes them down onto it. Both fronts are merged and ranked anew.

Of Table 4: 200 individuals, tournaments of two, crossover 0.8, Pareto fraction 0.35, at most 500 generations, stall of
the spread over 500 generations with tolerance 1e-6, and 1e-6 on the constraints (of a generation: what is returned is
proved, with nothing overlooked).

With a stall as long as the run itself the spread cannot end it; with a shorter one ``function_tolerance`` has to be
larger too: on hybrid-spline (time, energy; seed 0) the spread still changes by 5e-4 a generation on average from the
51st to the 100th. Migration cannot act with one population; parallel evaluation changes nothing of the result.

Where the table says "constraint dependent" it names no method. Here the first generation holds the ends of the front,
found and proved by the local solver, and points between and around them; then SBX and polynomial mutation follow.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.evolution.elitism import ControlledElitism
from ocp_traj.evolution.evolution import WORST, PymooProblem, evolve
from ocp_traj.evolution.generations import Watch
from ocp_traj.evolution.outcome import ended_after
from ocp_traj.formulation.case import check, count, number, share
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet, check_traded
from ocp_traj.results.records import Found, ignore
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.refinement import refine, well_spaced
from ocp_traj.solvers.seeding import ends_of, first_generation, inside
from ocp_traj.solvers.waves import Solves
from ocp_traj.stopping import Stopping, stopping

SHARE = 0.5  # of the time that is left, for evolution; the rest is for refinement: our choice
CANNOT_ACT = {
    "migration": "both directions, every 20 generations, fraction 0.2: there is one population",
    "parallel evaluation": "a generation is one call",
}


@dataclass(frozen=True)
class HMOGA:
    """The hybrid on a problem's decision variables.

    Attributes:
        seed: of everything random.
        points: how many of the genetic front are refined at most, those that lie farthest apart, its ends
            among them.
        population, generations: their numbers.
        crossover: probability of a pair.
        mutation: probability of a variable; 1/n if not given.
        crossover_index, mutation_index: distribution indices of SBX and polynomial mutation; our choice.
        pareto_fraction: of the population, for the first rank.
        stall: generations over which the change of the spread is averaged.
        function_tolerance: evolution ends when that average is below this.
        constraint_tolerance: excess of a limit, in its scale, that a generation overlooks.
        seeded: share of the first generation that lies between and around the ends of the front; the rest is random.
        starts: random starts at each end.
        solver: of the ends, and of each point that is refined.
        per_segment: instants a segment at which limits are looked at in a generation, at least its degree.
        max_seconds: time for all; of what the ends leave, evolution gets one half.
        workers: who does the local solves; the front does not depend on it.
        progress: told after each generation, then after each refined point.
        found: given a record of each solve, and of the population now and then.
    """

    seed: int
    points: int = count(40, least=2)
    population: int = count(200, least=4)
    generations: int = count(500)
    crossover: float = share(0.8)
    mutation: float | None = share(None)
    crossover_index: float = number(15.0, least=0.0)
    mutation_index: float = number(20.0, least=0.0)
    pareto_fraction: float = number(0.35, above=0.0, most=1.0)
    stall: int = count(500)
    function_tolerance: float = number(1e-6, least=0.0)
    constraint_tolerance: float = number(1e-6, least=0.0)
    seeded: float = share(0.5)
    starts: int = count(2)
    solver: Exchange = field(default_factory=Exchange)
    per_segment: int = count(5, least=2)
    max_seconds: float = np.inf
    workers: Workers = field(default_factory=Workers)
    progress: Progress = silent
    found: Found = ignore

    def __post_init__(self) -> None:
        """Checks the numbers."""
        check(self)

    @one_blas_thread
    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """Ends, evolution and refinement; Ctrl-C ends it early with the points it has."""
        check_traded(objectives)
        with stopping(self.max_seconds) as stop:
            return self._run(problem, objectives, stop)

    def _run(self, problem: Problem, objectives: Sequence[str], stop: Stopping) -> ParetoSet:
        begun = time.perf_counter()
        ends, info = ends_of(problem, objectives, self.solver, self.starts, self.seed, np.inf, self.found, self.workers)
        info["cannot act"] = CANNOT_ACT
        if ENDED_AFTER in info or "conflict" in info:
            return ParetoSet(ends.xs, "hmoga", self.seed, ends.seconds, info, ends.interrupted)
        rng = np.random.default_rng(self.seed)
        target = PymooProblem(problem, objectives, self.per_segment, tolerance=self.constraint_tolerance, known=ends.xs)
        first = first_generation(target, problem, objectives, list(ends.xs), self.population, self.seeded, rng)
        watch = Watch(self.stall, self.function_tolerance, _box(target, first[: len(ends.xs)]))
        algorithm = PymooNSGA2(
            pop_size=self.population,
            sampling=first,
            crossover=SBX(prob=self.crossover, eta=self.crossover_index),
            mutation=PM(prob=1.0, prob_var=self.mutation, eta=self.mutation_index),
            survival=ControlledElitism(self.pareto_fraction),
        )
        algorithm.tournament_type = "comp_by_rank_and_crowding"
        left = SHARE * max(stop.deadline - time.perf_counter(), 0.0)
        run = evolve(algorithm, target, self.generations, self.seed, left, self.progress, after=watch, found=self.found)
        info |= {
            "population": self.population,
            "generations": len(run.history),
            "stalled": watch.stalled,
            "evaluation calls": target.calls,
            "evaluations": target.individuals,
            "evaluation seconds": target.seconds,
            "evolution seconds": run.seconds,
            "moved": run.moved,
            "history": {"generation": list(range(1, len(watch.rows) + 1)), **watch.history.to_dict("list")},
            **({} if watch.stalled else ended_after(run, self.generations)),
        }
        genetic = [x for x in inside(target, run.best) if not any(np.array_equal(x, end) for end in ends.xs)]
        if run.interrupted or not len(run.history):
            return self._merged([*ends.xs, *genetic], begun, info, run.interrupted)
        # The ends solve an NLP already: goal attainment has nothing to give them.
        known = len(ends.xs)
        f = target.population.evaluate(np.array([*ends.xs, *genetic])).objectives * target.signs
        chosen = [genetic[i - known] for i in well_spaced(f, self.points) if i >= known]
        chosen += _least_broken(algorithm.pop, self.points - known - len(chosen))
        work = Solves(problem, self.solver, self.workers, self.found)
        refined = refine(work, objectives, chosen, ends.xs, self.progress)
        if refined.reached < len(chosen):
            info[ENDED_AFTER] = f"refining {refined.reached} of {len(chosen)} points"
        info |= {
            "moved": run.moved or refined.better > 0,
            "genetic front": len(genetic),
            "points to refine": len(chosen),
            "points refined": refined.better,
            "refinements failed": refined.failed,
            "solves": work.solves,
            "iterations": work.iterations,
            "refinement seconds": refined.seconds,
        }
        return self._merged([*ends.xs, *genetic, *refined.xs], begun, info, refined.interrupted)

    def _merged(self, xs: list[Array], begun: float, info: dict[str, Any], interrupted: bool) -> ParetoSet:
        """All points; whoever makes a front of them proves and ranks them."""
        return ParetoSet(xs, "hmoga", self.seed, time.perf_counter() - begun, info, interrupted)


def _least_broken(pop: Any, count: int) -> list[Array]:
    """The ``count`` individuals that break limits least: what is refined where feasible ones are too few."""
    violation = np.ravel(pop.get("excess").astype(float))
    order = [i for i in np.argsort(violation, kind="stable") if 0.0 < violation[i] < WORST]
    return [np.array(pop[i].X, dtype=float) for i in order[: max(count, 0)]]


def _box(target: PymooProblem, ends: Array) -> Array | None:
    """Ideal of the ends and the problem's reference point, less is better; None where there is no reference."""
    if not np.isfinite(target.worst).all():
        return None
    return np.array([(target.population.evaluate(ends).objectives * target.signs).min(axis=0), target.worst])
