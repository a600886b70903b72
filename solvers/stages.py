"""The stages of a memetic search: what is handed to the local solver, what comes of it, and how much of it survives."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.injection import alive, inject, keys
from ocp_traj.formulation.problem import Problem
from ocp_traj.results.records import Found, of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.aims import Aim, Aims
from ocp_traj.solvers.archive import Archive, Known
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.refinement import attainment
from ocp_traj.stopping import STOPS, current, stopping


class Recipe(Protocol):
    """What the stages take of a memetic method; see ``memetic.Memetic``."""

    @property
    def every(self) -> int: ...  # noqa: D102
    @property
    def chosen(self) -> int: ...  # noqa: D102
    @property
    def points(self) -> int: ...  # noqa: D102
    @property
    def local_share(self) -> float: ...  # noqa: D102
    @property
    def far_share(self) -> float: ...  # noqa: D102
    @property
    def max_seconds(self) -> float: ...  # noqa: D102
    @property
    def solver(self) -> Exchange: ...  # noqa: D102
    @property
    def found(self) -> Found: ...  # noqa: D102


class Stages:
    """Local solves between generations, and their proved points.

    Args:
        recipe: numbers and shares.
        problem: whose limits hold.
        objectives: traded.
        target: the population's problem.
        ends: decision vectors ``(n,)`` that are proved.
        complete: whether these are the ends of the whole front, so that none is looked for beyond them.
        rng: of what is random.
    """

    def __init__(
        self, recipe: Recipe, problem: Problem, objectives: tuple[str, ...], target: PymooProblem,
        ends: Sequence[Array], complete: bool, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        """Takes the ends in; see the class."""
        self.recipe, self.problem, self.names, self.target = recipe, problem, objectives, target
        self.archive = Archive(len(objectives), target.scales)
        self.aims = Aims(self.archive, target, recipe.far_share, complete, rng)
        for x in ends:
            self.archive.add(Known(x, self.aims.values(x)))
            self.aims.tried.add(x.tobytes())
        self.seconds = self.seconds_within = 0.0
        self.solves = self.iterations = self.failed = self.better = self.stages = 0
        self.injected = self.survived = 0
        self.kinds = {"first rank": 0, "far": 0, "gap": 0, "beyond": 0}
        self._generation, self._begun = 0, time.perf_counter()
        self._fresh: set[bytes] = set()
        # Where solutions are compared, or asked for less than they keep, each is proved at once.
        self._at_once = problem.tighten_slacks is not None or problem.tuning.starts > 1
        self._algorithm: Any = None

    @property
    def xs(self) -> list[Array]:
        """The proved points."""
        return [point.x for point in self.archive.points]

    @property
    def info(self) -> dict[str, Any]:
        """What became of the local solves."""
        return {
            "stages": self.stages,
            "solves": self.solves,
            "iterations": self.iterations,
            "solves of": dict(self.kinds),
            "solves failed": self.failed,
            "solves that gained": self.better,
            "refined individuals": {"put back": self.injected, "alive a generation later": self.survived},
        }

    def after(self, algorithm: Any) -> bool:
        """A stage, if it is its turn; it never ends the run."""
        self._generation, self._algorithm = self._generation + 1, algorithm
        if self._fresh:
            self.survived += alive(algorithm, self._fresh)
            self.injected += len(self._fresh)
            self._fresh = set()
        if self._generation % self.recipe.every == 0:
            spent = self._stage(algorithm, self.recipe.chosen)
            self.seconds_within += spent
        return False

    def last(self) -> None:
        """The stage after the last generation."""
        if self._algorithm is not None:
            self._stage(self._algorithm, self.recipe.points, timed=False)

    def _left(self, begun: float) -> bool:
        """Whether local solves have had less than their share of the time so far."""
        now = time.perf_counter()
        return self.seconds + now - begun < self.recipe.local_share * (now - self._begun)

    def _stage(self, algorithm: Any, most: int, timed: bool = True) -> float:
        """Solves, proves and puts back; the seconds that took."""
        begun, timed = time.perf_counter(), timed and np.isfinite(self.recipe.max_seconds)
        waiting: list[Solution] = []
        new: list[Array] = []
        done = 0
        with stopping() as stop:
            try:
                for aim in self.aims.of(algorithm):
                    if not (self._left(begun) if timed else done < most):
                        break
                    current().check()
                    done += 1
                    self._attempt(aim, waiting, new)
            except STOPS as reason:
                stop.take(reason)
        self._prove(waiting)
        self.stages += 1
        new = [x for x in new if x.tobytes() in keys(self.xs)]
        inject(algorithm, self.target, new)
        self._fresh = keys(new)
        spent = time.perf_counter() - begun
        self.seconds += spent
        return spent

    # --- what comes of it ---

    def _attempt(self, aim: Aim, waiting: list[Solution], new: list[Array]) -> None:
        """One aim; of a gap, where it gains nothing, once more from its other side."""
        solution = self._solve(aim)
        if not self._takes(solution) and aim.pair is not None:
            other = aim.pair[1]
            solution = self._solve(replace(aim, x=other.x, near=other if other.solution is not None else None))
        if solution is None or not self._takes(solution):
            return
        self.archive.add(Known(solution.x, self._of(solution), solution))
        self.better += 1
        self.aims.tried.add(solution.x.tobytes())
        new.append(solution.x)
        if solution.audit is None:
            waiting.append(solution)

    def _takes(self, solution: Solution | None) -> bool:
        return solution is not None and self.archive.gains(self._of(solution))

    def _solve(self, aim: Aim) -> Solution | None:
        """A solution, with the neighbour's instants and multipliers first, then without; None where there is none."""
        signs = self.target.signs
        goal = attainment(self.names, aim.goal * signs, aim.weights)
        known = aim.near.solution if aim.near is not None else None
        plain = replace(self.recipe.solver, prove=self._at_once)
        tries = [(plain, None)] if known is None else [(replace(plain, first=known.instants), known), (plain, None)]
        for solver, warm in tries:
            self.kinds[aim.kind] += 1
            solution = solver.solve(self.problem, goal, aim.x, warm=warm).own
            self._count(goal, solution)
            if solution.ok and (solution.audit is None or solution.audit.proved):
                return solution
        return None

    def _count(self, goal: Any, solution: Solution) -> None:
        self.recipe.found(of_solve(goal, solution))
        self.solves += 1
        self.iterations += solution.iterations
        self.failed += not solution.ok

    def _prove(self, waiting: list[Solution]) -> None:
        """Proves together what was found without; what is not proved is taken out again."""
        audited = audit_points(self.problem, [solution.x for solution in waiting])
        for solution, (path, audit) in zip(waiting, audited, strict=True):
            if not audit.proved:
                self.archive.drop(solution.x)
                self.better -= 1
                continue
            proved = replace(solution, trajectory=path, audit=audit)
            self.archive.points = [
                replace(p, solution=proved) if p.solution is solution else p for p in self.archive.points
            ]

    def _of(self, solution: Solution) -> Array:
        return np.asarray(np.array([solution.objectives[name] for name in self.names]) * self.target.signs)
