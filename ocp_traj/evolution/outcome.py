"""What a run of a population comes to: a Pareto set, a solution, or one line that says why there is none."""

from __future__ import annotations

import numpy as np

from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.evolution.evolution import Evolution, PymooProblem
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import slow_down
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives


def front_of(
    run: Evolution, target: PymooProblem, problem: Problem, method: str, seed: int, population: int, generations: int
) -> ParetoSet:
    """The Pareto set of a run; raises ``NoSolutionFound`` where nothing is feasible, unless it was interrupted."""
    if not len(run.best) and not run.interrupted:
        raise NoSolutionFound(_nothing(problem, method, population, generations, run))
    if run.legs and not run.moved and not run.interrupted:
        raise NoSolutionFound(
            f"{problem.id}: {method} found nothing better than the one guess it began with, in {len(run.history)} "
            f"generations of {population}, steps from it break limits; give it more of either, or use trace or memetic"
        )
    info = {
        "population": population,
        "generations": generations,
        "evaluation calls": target.calls,
        "evaluations": target.individuals,
        "evaluation seconds": target.seconds,
        "algorithm seconds": run.seconds - target.seconds,
        **ended_after(run, generations),
        "moved": run.moved,
        **({"legs": run.legs} if run.legs else {}),
    }
    return ParetoSet(list(run.best), method, seed, run.seconds, info, run.interrupted, run.champions)


def ended_after(run: Evolution, generations: int) -> dict[str, str]:
    """What ``info`` says of a run that Ctrl-C or its time ended before its last generation."""
    done = len(run.history)
    return {ENDED_AFTER: f"{done} of {generations} generations"} if done < generations else {}


def solution_of(
    run: Evolution, target: PymooProblem, problem: Problem, name: str, method: str, population: int, generations: int
) -> Solution:
    """The best individual, slowed down until it is proved where that can be done: feasible, with no claim beyond that.

    Args:
        run: of one objective.
        target: what it ran on.
        problem: whose limits are to be proved.
        name: of the objective.
        method: for messages.
        population: for messages.
        generations: for messages.
    """
    if not len(run.best):
        if run.interrupted:
            raise KeyboardInterrupt
        raise NoSolutionFound(_nothing(problem, method, population, generations, run))
    (x,), (found,) = slow_down(problem, [run.best[0]])
    mended = "" if np.array_equal(x, run.best[0]) else ", slowed down where limits were broken between its instants"
    claim = "not claimed to be optimal" if run.moved else "none is better than the best of those it began with"
    objectives = evaluate_objectives(problem, x)
    sign = 1.0 if problem.objective(name).sense == "min" else -1.0
    return Solution(
        name=problem.id,
        x=x,
        f=sign * objectives[name] / problem.objective(name).scale,
        status=Status.FEASIBLE if found.proved else Status.UNPROVED,
        violation=0.0 if found.proved else np.nan,
        iterations=len(run.history),
        seconds=run.seconds,
        objectives=objectives,
        trajectory=trajectory_of(problem, x),
        audit=found,
        detail=f"{method}: the best of {target.individuals} individuals{mended}; {claim}",
        moved=run.moved,
        history=run.history,
        interrupted=f"after {len(run.history)} of {generations} generations" if run.interrupted else "",
    )


def single_objective(problem: Problem, scalarisation: Scalarisation, method: str) -> str:
    """The one objective of a scalarisation, or an error: these methods rank individuals by one objective."""
    if len(scalarisation.names) != 1 or getattr(scalarisation, "bounds", None) or getattr(scalarisation, "goals", None):
        raise InputError(
            f"{method} minimises one objective of {problem.id}, not {', '.join(scalarisation.names)}; "
            "give --objective, or change the case's weights"
        )
    return scalarisation.names[0]


def _nothing(problem: Problem, method: str, population: int, generations: int, run: Evolution) -> str:
    done = len(run.history)
    ended = "" if done >= generations else f" ({done} of them were run before their time was over)"
    return (
        f"{problem.id}: no individual of {method} met every limit in {generations} generations of {population}{ended}; "
        "give it more of either, or use an exchange or trace, which name the limits in conflict"
    )
