"""The best of a population handed to the local solver: evolution finds the basins, IPOPT their bottoms.

What comes back is proved, and never worse than the best individual slowed down until that is proved.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import NoSolutionFound
from ocp_traj.evolution.evolution import Evolution, PymooProblem
from ocp_traj.evolution.outcome import solution_of
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.results.incumbent import no_worse_than
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.stopping import STOPS, stopping

HANDED = 4  # individuals: our choice
HALF = 0.5  # of a population, the better one, among which they are chosen: our choice


@dataclass(frozen=True)
class FromPoints(Multistart):
    """Local solves from points that are given.

    Attributes:
        given: decision vectors ``(n,)``, one or more.
    """

    given: tuple[Array, ...] = ()

    def points(self, problem: Problem) -> list[Array]:
        """Those that are given."""
        return list(self.given)


def chosen_of(run: Evolution, target: PymooProblem, count: int = HANDED) -> tuple[Array, ...]:
    """The best individual of all, and of the better half of the last generation those that are farthest apart.

    A population that walked is about its best, which goes for all; from where it began there may be another way down.
    """
    if run.start is not None:
        return (run.best[0], run.start)
    x = target.meant(run.last[: max(int(HALF * len(run.last)), 1)])
    found = [run.best[0] if len(run.best) else x[0]]
    box = np.where(target.xu > target.xl, target.xu - target.xl, 1.0)
    while len(found) < count:
        apart = np.linalg.norm((x[:, None] - np.array(found)) / box, axis=2).min(axis=1)
        if not apart.max(initial=0.0) > 0.0:
            break
        found.append(x[int(np.argmax(apart))])
    return tuple(found)


def handed_over(
    run: Evolution, target: PymooProblem, problem: Problem, scalarisation: Scalarisation, method: str,
    population: int, generations: int,
) -> Solution:  # fmt: skip
    """What local solves make of a run of one objective; of one that Ctrl-C ended its best individual."""
    name = scalarisation.names[0]
    plain: Solution | None = None
    if len(run.best) or run.interrupted:
        plain = solution_of(run, target, problem, name, method, population, generations)
    if run.interrupted or not len(run.last):
        assert plain is not None
        return plain
    points = chosen_of(run, target)
    begun = time.perf_counter()
    with stopping() as stop:
        try:
            found = FromPoints(given=points).solve(problem, scalarisation)
        except STOPS as reason:
            if plain is None:
                raise
            stop.take(reason)
            words = f"in the local solves after {len(run.history)} generations" if stop.tell() else ""
            return replace(plain, interrupted=words)
    if not found.ok and plain is None:
        raise NoSolutionFound(
            f"{problem.id}: no individual of {method} met every limit, and from {len(points)} of them the local solver "
            f"found none that does: {found.explain()}"
        )
    if plain is not None:
        found = no_worse_than(problem, scalarisation, found, plain.x, f"the best individual of {method}")
    words = f"from {len(points)} of {method}'s {target.individuals} individuals"
    return replace(
        found,
        seconds=run.seconds + time.perf_counter() - begun,
        starts=1,
        given_up=0,
        history=run.history,
        detail=f"{found.detail}; {words}",
    )
