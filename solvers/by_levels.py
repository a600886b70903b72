"""Solving by levels: from the optimum with few pieces to that with many, each from the one before."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.progress import Progress, silent
from ocp_traj.results.solution import Solution
from ocp_traj.results.starts import Start, levels_to
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.solvers.starts import solved_from
from ocp_traj.stopping import STOPS, current


@dataclass(frozen=True)
class ByLevels:
    """Solves a problem with levels: random starts at the coarsest, the best of which is refined.

    Attributes:
        starts: solver at the coarsest level, and of a level that is not reached from the one before.
        refine: whether it goes on to the problem's finer ones, while they gain.
        progress: told after each level.
    """

    starts: Multistart
    refine: bool = True
    progress: Progress = silent

    @one_blas_thread
    def solve(self, problem: Problem, scalarisation: Scalarisation, start: Start | None = None) -> Solution:
        """The best proved solution, from random starts or from one that is given.

        Its ``trajectory.origin`` is the problem of its level: the problem itself, or a finer one, which its ``detail``
        tells with the values of all levels. A level that is not reached, or does not gain, leaves the solution of the
        one before.
        """
        begun = time.perf_counter()
        chain = levels_to(problem) if start is None else start[0]
        found: list[tuple[Problem, Solution]] = []
        solution: Solution | None = None
        interrupted = ""
        try:
            for level in chain:
                if start is not None and not found:
                    solution = self._from(*start, scalarisation)
                else:
                    solution = self._level(level, scalarisation, solution)
                found.append((level, solution))
                self.progress(len(found), len(chain), _value(solution))
            while self.refine and _is_proved(solution) and (finer := _finer(found[-1][0])) is not None:
                solution = self._level(finer, scalarisation, found[-1][1], cold=False)
                gained = (found[-1][1].f - solution.f) / max(abs(found[-1][1].f), 1e-300)
                if not (_is_proved(solution) and gained > 0.0):
                    break
                found.append((finer, solution))
                self.progress(len(found), len(found) + 1, _value(solution))
                if finer.levels is None or gained < finer.levels.gain:
                    break
        except STOPS as reason:
            if len(found) < len(chain):
                raise
            current().take(reason)
            interrupted = f"after {len(found)} levels"
        best = found[-1][1]
        steps = ", ".join(f"{s.f:.6g} of {p.size} variables" for p, s in found)
        levels = "" if problem.levels is None else f"; by levels: {steps}"
        return replace(
            best, detail=best.detail + levels, seconds=time.perf_counter() - begun,
            iterations=sum(s.iterations for _, s in found), starts=found[0][1].starts,
            interrupted=best.interrupted or interrupted, key="",
        )  # fmt: skip

    def _from(self, chain: Sequence[Problem], x: Array, scalarisation: Scalarisation) -> Solution:
        """From given variables of the first problem: in their neighbourhood, and from there as from a random start."""
        solver = self.starts.solver
        near = replace(solver, solver=solver.solver.near_start())
        tries = [self._solved(chain[0], near, scalarisation, x)]
        if not _is_proved(tries[0]):
            tries.append(self._solved(chain[0], solver, scalarisation, x))
        return replace(best_of(tries), starts=1, key="")

    def _level(
        self, problem: Problem, scalarisation: Scalarisation, coarser: Solution | None, *, cold: bool = True
    ) -> Solution:
        """From the solution of the level before; from random starts where there is none, or it does not lead on."""
        tries: list[Solution] = []
        if coarser is not None and coarser.ok and problem.levels is not None:
            near = replace(self.starts.solver, solver=self.starts.solver.solver.near_start())
            tries.append(self._solved(problem, near, scalarisation, problem.levels.prolong(coarser.x)))
        if not tries or (cold and not _is_proved(tries[0])):
            tries.append(self.starts.solve(problem, scalarisation))
        return best_of(tries)

    def _solved(self, problem: Problem, solver: Exchange, scalarisation: Scalarisation, x: Array) -> Solution:
        """One solve from ``x (n,)``, as a job."""
        return solved_from(problem, solver, scalarisation, x, self.starts.workers, self.starts.found)


def _finer(problem: Problem) -> Problem | None:
    return None if problem.levels is None or problem.levels.finer is None else problem.levels.finer()


def finest(problem: Problem, solution: Solution) -> Problem:
    """The problem whose variables a solution by levels has."""
    origin = None if solution.trajectory is None else solution.trajectory.origin
    return problem if origin is None else origin


def _is_proved(solution: Solution | None) -> bool:
    return solution is not None and solution.ok and solution.audit is not None and solution.audit.proved


def _value(solution: Solution) -> str:
    return f"{solution.f:.9g}" if solution.ok else solution.status.value
