"""The stages of a memetic search: what is handed to the local solver, what comes of it, and how much of it survives."""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import islice
from typing import Any, Protocol

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.injection import alive, inject, keys
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.workers import Workers
from ocp_traj.results.records import Found
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.aims import Aim, Aims
from ocp_traj.solvers.archive import Archive, Known
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.refinement import attainment
from ocp_traj.solvers.waves import WAVE, Begun, Request, Solves
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
    def workers(self) -> Workers: ...  # noqa: D102
    @property
    def found(self) -> Found: ...  # noqa: D102


class Stages:
    """Local solves between generations, and their proved points.

    Args:
        recipe: numbers and shares.
        problem: whose limits hold.
        objectives: traded.
        target: the population's problem.
        ends: decision vectors ``(n,)`` that are proved; their NLPs are too unlike goal attainment's to begin with.
        complete: whether these are the ends of the whole front, so that none is looked for beyond them.
        rng: of what is random.
    """

    def __init__(
        self, recipe: Recipe, problem: Problem, objectives: tuple[str, ...], target: PymooProblem,
        ends: Sequence[Array], complete: bool, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        """Takes the ends in; see the class."""
        self.recipe, self.names, self.target = recipe, objectives, target
        self.work = Solves(problem, recipe.solver, recipe.workers, recipe.found)
        self.archive = Archive(len(objectives), target.scales)
        self.aims = Aims(self.archive, target, recipe.far_share, complete, rng)
        for x in ends:
            self.archive.add(Known(x, self.aims.values(x)))
            self.aims.tried.add(x.tobytes())
        self.seconds = self.seconds_within = 0.0
        self.better = self.stages = self.injected = self.survived = 0
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
            "solves": self.work.solves,
            "iterations": self.work.iterations,
            "solves of": dict(self.kinds),
            "solves failed": self.work.failed,
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
        """Solves in waves, proves and puts back; the seconds that took."""
        begun, timed = time.perf_counter(), timed and np.isfinite(self.recipe.max_seconds)
        before, done = keys(self.xs), 0
        with stopping() as stop:
            try:
                while self._left(begun) if timed else done < most:
                    current().check()
                    wave = list(islice(self.aims.of(algorithm), WAVE if timed else min(WAVE, most - done)))
                    if not wave:
                        break
                    done += len(wave)
                    self._solve(wave)
                self.work.prove()
            except STOPS as reason:
                stop.take(reason)
                self.work.prove(again=False)
        self.stages += 1
        new = [x for x in self.xs if x.tobytes() not in before]
        inject(algorithm, self.target, new)
        self._fresh = keys(new)
        spent = time.perf_counter() - begun
        self.seconds += spent
        return spent

    # --- what comes of it ---

    def _solve(self, wave: Sequence[Aim]) -> None:
        """A wave of aims; of gaps, where that gains nothing, once more from their other sides."""
        begun = [self.work.begin(self._request(aim)) for aim in wave]
        missed = [aim.turned for aim, one in zip(wave, begun, strict=True) if not self._takes(self._taken(one))]
        self.work.prove_many()
        again = [aim for aim in missed if aim is not None]
        if again:
            self._solve(again)

    def _request(self, aim: Aim) -> Request:
        """With the neighbour's instants and multipliers first, then without."""
        self.kinds[aim.kind] += 1
        goal = attainment(self.names, aim.goal * self.target.signs, aim.weights)
        warm = None if aim.near is None else aim.near.solution
        return Request(goal, aim.x, warm, prove=self._at_once, fallbacks=[] if warm is None else [aim.x])

    def _taken(self, begun: Begun) -> Solution:
        return self.work.take(begun, self._replaced)

    def _takes(self, solution: Solution) -> bool:
        """Whether a solution gains anything; then it is kept."""
        gains = solution.ok and self.archive.add(Known(solution.x, self._of(solution), solution))
        if gains:
            self.better += 1
            self.aims.tried.add(solution.x.tobytes())
        return gains

    def _replaced(self, found: Solution, proved: Solution) -> None:
        """What was found is now proved, or is another, or none."""
        if self.archive.drop(found):
            self.better -= 1
            self._takes(proved)

    def _of(self, solution: Solution) -> Array:
        return np.asarray(np.array([solution.objectives[name] for name in self.names]) * self.target.signs)
