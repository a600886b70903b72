"""Refinement of a front's points by goal attainment: min gamma subject to F(x) - w gamma <= goal.

The goal is the point's own F and w its distance to the front's nadir, so that the point moves along the ray from the
nadir through itself: one at an end of the front moves in that end's objective, one in the middle in all of them, and
points that were apart stay apart. A proved point attains its goal with gamma = 0, so it need never get worse.
Gembicki and Haimes (1975), IEEE Trans. Autom. Control 20(6).
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.scalarise import GoalAttainment
from ocp_traj.progress import Progress, silent
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import slow_down
from ocp_traj.solvers.waves import WAVE, Request, Solves
from ocp_traj.stopping import STOPS, Stopping, current, stopping
from ocp_traj.transcription.symbolic import evaluate_objectives

LEAST = 1e-3  # of the front's range: smallest weight, so that the attainment factor acts on every goal; our choice


@dataclass
class Refined:
    """What became of some points.

    Attributes:
        xs: decision vectors, refined where that gave better ones.
        better: points that were refined.
        failed: points for which nothing proved was found.
        reached: points that were tried; the others, if Ctrl-C or a lack of time ended it, are as they were.
        interrupted: whether Ctrl-C ended it.
        seconds: spent.
    """

    xs: list[Array]
    better: int = 0
    failed: int = 0
    reached: int = 0
    interrupted: bool = False
    seconds: float = 0.0


def weights(f: Array, scales: Array) -> Array:
    """Weights ``(N, objectives)`` of the points of a front ``f (N, objectives)``, less is better: nadir - f.

    None is below ``LEAST`` of the front's range; where the front has no extent they are the objective's scale.
    """
    nadir = f.max(axis=0)
    extent = nadir - f.min(axis=0)
    return np.where(extent > 0.0, np.maximum(nadir - f, LEAST * extent), scales)


def well_spaced(f: Array, count: int) -> Index:
    """Indices of ``count`` points of ``f (N, objectives)``: the best of each objective, then the farthest away."""
    if len(f) <= count:
        return np.arange(len(f))
    extent = np.ptp(f, axis=0)
    scaled = (f - f.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
    chosen = [int(np.lexsort((scaled.sum(axis=1), scaled[:, k]))[0]) for k in range(f.shape[1])]
    chosen = list(dict.fromkeys(chosen))[:count]
    nearest = np.linalg.norm(scaled[:, None] - scaled[chosen], axis=2).min(axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
    return np.sort(np.array(chosen))


def attainment(objectives: Sequence[str], goal: Array, weight: Array) -> GoalAttainment:
    """Towards a goal ``(objectives,)``, in the objectives' own sense, with weights ``(objectives,)``."""
    return GoalAttainment(
        dict(zip(objectives, goal.tolist(), strict=True)), dict(zip(objectives, weight.tolist(), strict=True))
    )


def refine(
    work: Solves,
    objectives: Sequence[str],
    xs: Sequence[Array],
    among: Sequence[Array] = (),
    progress: Progress = silent,
) -> Refined:
    """Refines points, each from itself; those not proved to begin with are slowed down first where that proves them.

    A point that is proved is only ever replaced by one that is proved and as good in every objective.

    Args:
        work: solves, in waves; each begins with instants and multipliers of the nearest solution yet.
        objectives: traded.
        xs: decision vectors ``(n,)``.
        among: other points of the front, which stay as they are; with these the nadir is that of the whole front.
        progress: told after each point.
    """
    begun, found = time.perf_counter(), Refined([np.asarray(x, dtype=float) for x in xs])
    if found.xs:
        with stopping() as stop:
            _Refinement(work, tuple(objectives), found, among, progress).run(stop)
            found.interrupted = stop.tell()
    found.seconds = time.perf_counter() - begun
    return found


class _Refinement:
    """Points ``f (N, objectives)``, less is better, their ``weights``, and the solutions so far with their places."""

    def __init__(
        self, work: Solves, objectives: tuple[str, ...], found: Refined, among: Sequence[Array], progress: Progress
    ) -> None:
        problem = work.problem
        self.work, self.names, self.found, self.progress = work, objectives, found, progress
        found.xs[:], self.audits = slow_down(problem, found.xs)
        self.signs = np.array([1.0 if problem.objective(name).sense == "min" else -1.0 for name in objectives])
        f = np.array([self._values(evaluate_objectives(problem, x)) for x in (*found.xs, *among)])
        self.weights = weights(f, np.array([problem.objective(name).scale for name in objectives]))
        self.extent = np.where(np.ptp(f, axis=0) > 0.0, np.ptp(f, axis=0), 1.0)
        self.f = f[: len(found.xs)]
        self.known: list[tuple[Array, Solution]] = []
        self.solved: dict[int, Solution] = {}

    def run(self, stop: Stopping) -> None:
        """Refines all points, or as many as there is time for."""
        try:
            # Along as many parts of the front at once: each begins beside the one that its part has just solved.
            parts = np.array_split(np.lexsort(self.f.T[::-1]), WAVE)
            for wave in zip_longest(*(part.tolist() for part in parts)):
                self._solve([i for i in wave if i is not None])
            self.work.prove()
        except STOPS as reason:
            stop.take(reason)
            self.work.prove(again=False)
        for i, solution in self.solved.items():
            reached = self._values(solution.objectives) if solution.ok else np.full(self.f.shape[1], np.inf)
            self.found.failed += not solution.ok
            better = (reached <= self.f[i]).all() and (reached < self.f[i]).any()
            if solution.ok and (better or not self.audits[i].proved):
                self.found.xs[i] = solution.x
                self.found.better += 1

    def _solve(self, wave: Sequence[int]) -> None:
        """A wave of points."""
        current().check()
        begun = [self.work.begin(self._request(i)) for i in wave]
        for i, one in zip(wave, begun, strict=True):
            self.solved[i] = self.work.take(one, partial(self._replaced, i))
            self.found.reached += 1
            self.progress(self.found.reached, len(self.f), self.work.words)
        self.known += [(self.f[i], self.solved[i]) for i in wave if self.solved[i].ok]
        self.work.prove_many()

    def _request(self, i: int) -> Request:
        """With the neighbour's instants and multipliers first, then without."""
        goal, x = attainment(self.names, self.f[i] * self.signs, self.weights[i]), self.found.xs[i]
        apart = [np.linalg.norm((place - self.f[i]) / self.extent) for place, _ in self.known]
        warm = self.known[int(np.argmin(apart))][1] if apart else None
        return Request(goal, x, warm, fallbacks=[] if warm is None else [x])

    def _replaced(self, i: int, found: Solution, proved: Solution) -> None:
        self.solved[i] = proved

    def _values(self, objectives: Mapping[str, float]) -> Array:
        return np.asarray(self.signs * np.array([objectives[name] for name in self.names]))
