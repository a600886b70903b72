"""Runs of a population with seeds one after the other, each a job of workers; the best of them counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ocp_traj.errors import NoSolutionFound
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.workers import Pending, Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.records import of_start
from ocp_traj.results.solution import Solution
from ocp_traj.results.solution_records import solution_of
from ocp_traj.solvers import methods
from ocp_traj.solvers.multistart import best_of
from ocp_traj.stopping import current


def ran(
    problem: Problem, scalarisation: Scalarisation, method: str, options: Mapping[str, Any], progress: Progress = silent
) -> Answer:
    """The job of one run."""
    chosen = methods.configured(methods.SOLVE, method, progress=progress, **options)
    return of_start(scalarisation, chosen.solve(problem, scalarisation))


def best_run(
    problem: Problem, scalarisation: Scalarisation, method: str, runs: int, seed: int, progress: Progress,
    workers: Workers, **options: Any,
) -> Solution:  # fmt: skip
    """The best of some runs, with seeds ``seed``, ``seed + 1``, ..; Ctrl-C ends it early with those it has.

    Args:
        problem: what to solve.
        scalarisation: its one objective.
        method: of ``methods.SOLVE``.
        runs: how many.
        seed: of the first.
        progress: told after each generation, of workers after each run.
        workers: who runs.
        options: fields of the method's class.
    """
    methods.configured(methods.SOLVE, method, **options)  # a wrong option is refused before there is any work
    hints = {} if workers.count else {"progress": progress}
    begun: dict[int, Pending] = {}
    found: list[Solution] = []
    failure: NoSolutionFound | None = None
    stop = current()
    for k in range(runs):
        try:
            for j in range(k, min(k + 1 + workers.ahead, runs)):
                if j not in begun:
                    given = {"scalarisation": scalarisation, "method": method, "options": {**options, "seed": seed + j}}
                    begun[j] = workers.submit(Job("ocp_traj.solvers.runs:ran", problem, given, hints))
            found.append(solution_of(begun.pop(k).result()["solution"], problem))
            if workers.count:
                progress(k + 1, runs, f"best {best_of(found).f:.9g}")
        except NoSolutionFound as error:
            failure = error
        except KeyboardInterrupt as reason:
            if not found:
                raise
            stop.take(reason)
        if stop.interrupted:
            break
    if not found and failure is not None:
        stop.check()
        raise failure
    if stop.tell() and runs > 1:
        ended = [solution for solution in found if not solution.interrupted]
        return replace(best_of(found), interrupted=f"after {len(ended)} of {runs} starts")
    return best_of(found)
