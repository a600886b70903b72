"""The swarms of Zhu and Wang and the usual ones on many seeds, beside IPOPT and branch and bound, in one table."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj.api.solving import solve
from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.branch_and_bound import BranchAndBound
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.pso import PSO, SCHEDULES

TIME = WeightedSum({"time": 1.0})
HIT = 1e-3  # relative: a run this close to the certified optimum has found it; our choice
STARTS = 20  # of IPOPT beside the swarms, at most: our choice


@dataclass(frozen=True, eq=False)
class Together:
    """How the swarms went: best times after each iteration ``(G,)`` [s] of each seed, by method; the optimum [s]."""

    best: Mapping[str, list[Array]]
    least: float


def swarms(problem: Problem, seeds: int, told: Callable[[str], None]) -> tuple[pd.DataFrame, Together]:
    """Every schedule on the same seeds, with IPOPT and branch and bound in the same run; and how each swarm went.

    Args:
        problem: whose shortest time is looked for.
        seeds: runs of each swarm, and of IPOPT up to ``STARTS``.
        told: before each run of a swarm.
    """
    best = solve(problem).require()
    assert best.certificate is not None
    limit = best.objectives["time"] * (1.0 + HIT)
    rows: list[tuple[Any, ...]] = []
    went: dict[str, list[Array]] = {}
    for schedule in SCHEDULES:
        reached, finals, seconds, courses = [], [], [], list[Array]()
        for seed in range(seeds):
            solver = PSO(seed, schedule=schedule)
            told(f"PSO {schedule}, seed {seed}")
            begun = time.perf_counter()
            evolution, target = solver.run(problem, "time")
            if evolution.interrupted:
                raise KeyboardInterrupt
            seconds.append(time.perf_counter() - begun)
            reached.append(evolution.reached(limit))
            finals.append(float(evolution.history["best"].iloc[-1]))
            courses.append(evolution.history["best"].to_numpy(dtype=float))
        name = {"adaptive": "PSO, pymoo's own"}.get(schedule, f"PSO {schedule.replace('_', ' ')}")
        went[name] = courses
        rows.append(_row(name, [n for n in reached if n is not None], seeds, finals, seconds, best, "individuals"))
    local: list[Solution] = []
    for seed in range(min(STARTS, seeds)):
        local.append(Exchange().solve(problem, TIME, problem.guess(np.random.default_rng(seed))))
    hits = [s.iterations for s in local if s.ok and s.objectives["time"] <= limit]
    finals = [s.objectives["time"] for s in local if s.ok]
    rows.append(_row("IPOPT with exchange", hits, len(local), finals, [s.seconds for s in local], best, "iterations"))
    begun = time.perf_counter()
    certificate, _ = BranchAndBound().certify(problem, TIME, replace(best, certificate=None))
    seconds = [time.perf_counter() - begun]
    rows.append(
        _row("branch and bound, lower bound", [certificate.boxes], 1, [certificate.lower], seconds, best, "boxes")
    )
    columns = [
        "method",
        "runs",
        f"within {HIT:.1%}",
        "median effort to get there",
        "of",
        "median gap",
        "worst gap",
        "median [s]",
    ]
    return pd.DataFrame(rows, columns=columns), Together(went, best.objectives["time"])


def _row(
    name: str,
    hits: Sequence[int],
    runs: int,
    finals: Sequence[float],
    seconds: Sequence[float],
    best: Solution,
    of: str,
) -> tuple[Any, ...]:
    gaps = np.array(finals) / best.objectives["time"] - 1.0
    effort = float(np.median(hits)) if hits else np.nan
    return name, runs, len(hits), effort, of, float(np.median(gaps)), float(np.max(gaps)), float(np.median(seconds))
