"""Rays of trajectories: every dilation of a solution, evaluated in one pass of the tape.

A dilated trajectory keeps its path. Along its ray time grows while energy, effort, acceleration and jerk fall, so that
none of it dominates another: one solve gives a whole line of candidates for a front, and of starts for other solves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ocp_traj.arrays import Array, Flags, Index
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.job import Answer
from ocp_traj.results.records import of_points
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.front_points import FrontPoints
from ocp_traj.transcription.symbolic import evaluate_objectives

RAY = np.exp(np.linspace(-np.log(2.0), np.log(2.0), 81))  # dilations looked at; the 41st is none: our choice
BROKEN = 1e-9  # of a limit's scale: a candidate that breaks one by more, as far as a scan tells, is none; our choice
PROVED = "ocp_traj.solvers.front_rays:proved"


def proved(problem: Problem, xs: Sequence[Array]) -> Answer:
    """The job of proving some points ``(n,)``: a record of them."""
    vectors = [np.array(x, dtype=float) for x in xs]
    audits = [audit for _, audit in audit_points(problem, vectors)]
    return of_points(
        (x, evaluate_objectives(problem, x), audit) for x, audit in zip(vectors, audits, strict=True)
    )  # fmt: skip


class Rays:
    """The rays of some trajectories; each is itself alone where the problem knows no dilation.

    Args:
        problem: whose trajectories.
        population: evaluates the objectives that are wanted.
        signs: 1 for an objective that is minimised, -1 for one that is maximised ``(m,)``.

    Attributes:
        values: objectives of every candidate, less is better ``(K, m)``.
        owner: which trajectory it is a dilation of ``(K,)``.
        factor: by which ``(K,)``.
        legal: whether a scan finds no limit broken ``(K,)``.
    """

    def __init__(self, problem: Problem, population: Population, signs: Array) -> None:
        """No trajectory yet; see the class."""
        self.problem, self.population, self.signs = problem, population, signs
        self.values, self.factor = np.empty((0, len(signs))), np.empty(0)
        self.owner: Index = np.empty(0, dtype=np.intp)
        self.legal: Flags = np.empty(0, dtype=np.bool_)
        self._xs: list[Array] = []

    def add(self, x: Array) -> Index:
        """Takes a trajectory's variables ``(n,)``; which candidates its dilations are."""
        factors = np.ones(1) if self.problem.dilate is None else RAY
        candidates = np.array([self._dilated(x, factor) for factor in factors.tolist()])
        inside = ((candidates >= self.problem.lower) & (candidates <= self.problem.upper)).all(axis=1)
        inside |= factors == 1.0
        found = self.population.evaluate(candidates[inside])
        first = len(self.values)
        self.values = np.vstack([self.values, found.objectives * self.signs])
        self.factor = np.concatenate([self.factor, factors[inside]])
        self.owner = np.concatenate([self.owner, np.full(int(inside.sum()), len(self._xs), dtype=np.intp)])
        self.legal = np.concatenate([self.legal, (found.violations <= BROKEN).all(axis=1)])
        self._xs.append(x)
        return np.arange(first, len(self.values))

    def x(self, candidate: int) -> Array:
        """A candidate's variables ``(n,)``."""
        return self._dilated(self._xs[self.owner[candidate]], float(self.factor[candidate]))

    def _dilated(self, x: Array, factor: float) -> Array:
        return x if factor == 1.0 or self.problem.dilate is None else np.asarray(self.problem.dilate(x, factor))


def start_within(front: FrontPoints, among: list[int], bounds: Mapping[int, float]) -> tuple[Array, int]:
    """The best of the rays of some points: within the bounds first, then least in the sum of what is free.

    Returns:
        its variables ``(n,)``, and of which of the points it is a dilation.
    """
    rays = [_ray(front, front.solutions[i].x) for i in among]
    values = np.concatenate([objectives for _, objectives in rays])
    span = np.maximum(np.ptp(front.values, axis=0), 1e-12)
    over = sum((np.maximum(values[:, k] - bound, 0.0) / span[k] for k, bound in bounds.items()), np.zeros(len(values)))
    free = [k for k in range(len(front.names)) if k not in bounds]
    merit = 1e3 * over + (values[:, free] / span[free]).sum(axis=1)
    lengths = [len(factors) for factors, _ in rays]
    best = int(np.argmin(merit))
    which = int(np.searchsorted(np.cumsum(lengths), best, side="right"))
    x, factor = front.solutions[among[which]].x, float(np.concatenate([factors for factors, _ in rays])[best])
    dilate = front.problem.dilate
    return x if factor == 1.0 or dilate is None else np.asarray(dilate(x, factor)), among[which]


def _ray(front: FrontPoints, x: Array) -> tuple[Array, Array]:
    """Dilations of a trajectory ``(K,)``, none first, and the objectives they lead to ``(K, m)``; evaluated once."""
    problem, key = front.problem, x.tobytes()
    if key not in front.rays:
        factors, candidates = np.ones(1), x[None]
        if problem.dilate is not None:
            dilated = np.array([problem.dilate(x, factor) for factor in RAY.tolist()])
            inside = ((dilated <= problem.upper) & (dilated >= problem.lower)).all(axis=1)
            factors, candidates = np.append(1.0, RAY[inside]), np.vstack([x, dilated[inside]])
        values = front.population.evaluate(candidates, limits=False).objectives * front.signs
        front.rays[key] = factors, values
    return front.rays[key]
