"""What a hybrid of evolution and a local solver begins with: the ends of the front, and a generation between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.workers import Workers
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet
from ocp_traj.results.records import Found
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_tracer import FrontTracer

NEAR, FAR = 1e-4, 1e-1  # of a variable's range: steps from the ends' connection, evenly in their logarithm; our choice
SLOWEST = 1.3  # dilation of a seeded point at most: our choice


def ends_of(
    problem: Problem, objectives: Sequence[str], solver: Exchange, starts: int, seed: int, max_seconds: float,
    found: Found, workers: Workers,
) -> tuple[ParetoSet, dict[str, Any]]:  # fmt: skip
    """The ends of the front, each from some random starts, and what ``info`` says of them."""
    tracer = FrontTracer(
        len(objectives), solver=solver, starts=starts, seed=seed, max_seconds=max_seconds, workers=workers, found=found
    )
    ends = tracer.pareto(problem, objectives)
    info: dict[str, Any] = {"ends": {**ends.info, "points": len(ends.xs), "seconds": ends.seconds}}
    if ends.info.get("conflict") is False:
        info["conflict"] = False
    if "ideal" in ends.info:
        info["ideal"] = ends.info["ideal"]
    if ENDED_AFTER in ends.info:
        info[ENDED_AFTER] = f"{len(ends.xs)} of {len(objectives)} ends of the front"
    return ends, info


def first_generation(
    target: PymooProblem, problem: Problem, objectives: Sequence[str], known: Sequence[Array], size: int,
    seeded: float, rng: np.random.Generator,
) -> Array:  # fmt: skip
    """Individuals ``(size, n)``: the known points, a share ``seeded`` between and around them, and random points."""
    points = list(known[:size])
    inactive = problem.inactive(objectives)
    lower, upper = target.xl, target.xu
    while len(points) < size:
        if known and len(points) < seeded * size:
            one, other = rng.integers(len(known), size=2)
            x = known[one] + rng.uniform() * (known[other] - known[one])
            if problem.dilate is not None:
                x = np.asarray(problem.dilate(x, rng.uniform(1.0, SLOWEST)))
            step = NEAR * (FAR / NEAR) ** rng.uniform()
            x = np.clip(x + step * (upper - lower) * rng.standard_normal(problem.size), lower, upper)
        else:
            x = problem.guess(rng)
        points.append(np.where(inactive, lower, x))
    return np.array(points)


def inside(target: PymooProblem, xs: Array) -> list[Array]:
    """The points within the reference point, with nothing overlooked."""
    if not len(xs):
        return []
    return list(xs[(target.population.evaluate(xs).objectives * target.signs <= target.worst).all(axis=1)])
