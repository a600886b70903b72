"""Many random starts of a local solver, and the best proved solution among them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ocp_traj.nlp import Solution, Status
from ocp_traj.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.scalarise import Scalarisation
from ocp_traj.solvers.exchange import Exchange

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Multistart:
    """Runs ``solver`` from ``starts`` random points; start i depends on the seed and i alone.

    Attributes:
        solver: of one start.
        starts: how many.
        seed: of the starting points.
        progress: told after each start.
    """

    solver: Exchange = field(default_factory=Exchange)
    starts: int = 1
    seed: int = 0
    progress: Progress = silent

    def points(self, problem: Problem) -> list[Array]:
        """The starting points."""
        return [problem.guess(np.random.default_rng([self.seed, i])) for i in range(self.starts)]

    def solve_all(self, problem: Problem, scalarisation: Scalarisation) -> list[Solution]:
        """One solution a start; Ctrl-C ends it early with those it has."""
        solutions: list[Solution] = []
        for i, x0 in enumerate(self.points(problem)):
            try:
                solutions.append(self.solver.solve(problem, scalarisation, x0))
            except KeyboardInterrupt:
                if not solutions:
                    raise
                break
            best = best_of(solutions)
            self.progress(i + 1, self.starts, f"best {best.f:.9g}" if best.ok else best.status.value)
        return solutions

    def solve(self, problem: Problem, scalarisation: Scalarisation) -> Solution:
        """The best of all starts: proved before unproved, then the smaller value."""
        begun = time.perf_counter()
        best = best_of(self.solve_all(problem, scalarisation))
        return replace(best, seconds=time.perf_counter() - begun)


def best_of(solutions: Sequence[Solution]) -> Solution:
    """Proved before unproved, usable before failed, infeasible (it says why) before other failures, then least f."""

    def rank(solution: Solution) -> tuple[bool, bool, bool, float]:
        proved = solution.audit is not None and solution.audit.proved
        return not proved, not solution.ok, solution.status is not Status.INFEASIBLE, solution.f

    return min(solutions, key=rank)
