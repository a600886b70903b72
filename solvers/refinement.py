"""Refinement of a front's points by goal attainment: min gamma subject to F(x) - w gamma <= goal.

The goal is the point's own F and w its distance to the front's nadir, so that the point moves along the ray from the
nadir through itself: one at an end of the front moves in that end's objective, one in the middle in all of them, and
points that were apart stay apart. A proved point attains its goal with gamma = 0, so it need never get worse.
Gembicki and Haimes (1975), IEEE Trans. Autom. Control 20(6).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import GoalAttainment
from ocp_traj.progress import Progress, silent
from ocp_traj.results.records import Found, ignore, of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import slow_down
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.stopping import STOPS, current, stopping
from ocp_traj.transcription.symbolic import evaluate_objectives

LEAST = 1e-3  # of the front's range: smallest weight, so that the attainment factor acts on every goal; our choice


@dataclass
class Refined:
    """What became of some points.

    Attributes:
        xs: decision vectors, refined where that gave better ones.
        solves, iterations: of the NLPs.
        better: points that were refined.
        failed: points whose NLP gave nothing proved.
        reached: points that were tried; the others, if Ctrl-C or a lack of time ended it, are as they were.
        interrupted: whether Ctrl-C ended it.
        seconds: spent.
    """

    xs: list[Array]
    solves: int = 0
    iterations: int = 0
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
    problem: Problem,
    objectives: Sequence[str],
    xs: Sequence[Array],
    solver: Exchange,
    among: Sequence[Array] = (),
    progress: Progress = silent,
    tell: Found = ignore,
) -> Refined:
    """Refines points, each from itself; those not proved to begin with are slowed down first where that proves them.

    A point that is proved is only ever replaced by one that is proved and as good in every objective.

    Args:
        problem: whose limits hold.
        objectives: traded.
        xs: decision vectors ``(n,)``.
        solver: of each NLP; it begins with the instants at which its neighbour's ended.
        among: other points of the front, which stay as they are; with these the nadir is that of the whole front.
        progress: told after each point.
        tell: given a record of each solve.
    """
    begun, found = time.perf_counter(), Refined([np.asarray(x, dtype=float) for x in xs])
    with stopping() as stop:
        try:
            _refine(problem, tuple(objectives), found, solver, list(among), progress, tell)
        except STOPS as reason:
            stop.take(reason)
            found.interrupted = stop.tell()
    found.seconds = time.perf_counter() - begun
    return found


def _refine(
    problem: Problem, objectives: tuple[str, ...], found: Refined, solver: Exchange, among: list[Array],
    progress: Progress, tell: Found,
) -> None:  # fmt: skip
    """Refines the points of ``found`` in place, neighbour after neighbour."""
    if not found.xs:
        return
    points, audits = slow_down(problem, found.xs)
    found.xs[:] = points
    signs = np.array([1.0 if problem.objective(name).sense == "min" else -1.0 for name in objectives])
    scales = np.array([problem.objective(name).scale for name in objectives])
    f = np.array([_values(problem, objectives, x) for x in (*points, *among)]) * signs
    w, f = weights(f, scales), f[: len(points)]
    neighbour: Solution | None = None
    for done, i in enumerate(np.lexsort(f.T[::-1]).tolist()):  # along the front
        current().check()
        goal = attainment(objectives, f[i] * signs, w[i])
        solution = _solved(problem, goal, points[i], solver, neighbour, found, tell)
        if solution is None:
            found.failed += 1
        else:
            neighbour = solution
            reached = np.array([solution.objectives[name] for name in objectives]) * signs
            if not audits[i].proved or ((reached <= f[i]).all() and (reached < f[i]).any()):
                found.xs[i] = solution.x
                found.better += 1
        found.reached = done + 1
        progress(found.reached, len(points), f"{found.better} refined")


def _solved(
    problem: Problem, goal: GoalAttainment, x: Array, solver: Exchange, neighbour: Solution | None, found: Refined,
    tell: Found,
) -> Solution | None:  # fmt: skip
    """A proved solution, or None: with the neighbour's instants, and once more with the solver's own grid."""
    tries = [solver] if neighbour is None else [replace(solver, first=neighbour.instants), solver]
    for attempt in tries:
        solution = attempt.solve(problem, goal, x).own  # the point itself stays in any case
        tell(of_solve(goal, solution))
        found.solves += 1
        found.iterations += solution.iterations
        if solution.ok and solution.audit is not None and solution.audit.proved:
            return solution
    return None


def _values(problem: Problem, objectives: Sequence[str], x: Array) -> list[float]:
    values = evaluate_objectives(problem, x)
    return [values[name] for name in objectives]
