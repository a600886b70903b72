"""The swarms of Zhu and Wang as they ran them, a joint at a time: within how many iterations each has converged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ocp_traj import problems
from ocp_traj.api.solving import solve
from ocp_traj.arrays import Array
from ocp_traj.problems.m10id import JOINTS
from ocp_traj.solvers.pso import PSO

SCHEDULES = ("as_printed", "repaired", "linear")  # the improved one, as printed and repaired, and the usual one
WITHIN = 30  # iterations: "most of the joints are optimized to reach global convergence .. within 30", sect. 4
CLOSE = 0.01  # relative: a swarm this close to its joint's certified optimum has converged; our choice
MOST_SEEDS = 5  # for each joint and schedule: our choice
FREE = {"position_limits": False, "effort_limits": False}  # (14) and (15) are the paper's limits


@dataclass(frozen=True, eq=False)
class Followed:
    """How the swarms of one joint went.

    Attributes:
        joint: its name.
        least: its certified optimum [s].
        best: by schedule, of each seed the best time after each iteration ``(G,)`` [s], NaN before there is one.
        times: by schedule, of the first seed t1, t2, t3 of the best particle ``(G, 3)`` [s].
    """

    joint: str
    least: float
    best: dict[str, list[Array]] = field(default_factory=dict)
    times: dict[str, Array] = field(default_factory=dict)


def runs(seeds: int) -> int:
    """How many runs of a swarm ``convergence`` takes."""
    return len(SCHEDULES) * len(JOINTS) * min(seeds, MOST_SEEDS)


def convergence(seeds: int, told: Callable[[str], None]) -> tuple[pd.DataFrame, list[Followed]]:
    """Every joint alone, by every schedule: a row each, with the certified optimum of the joint; and how each went.

    A swarm looks at its limits on some instants, so that its values may be a little less than that.

    Args:
        seeds: runs of each, up to ``MOST_SEEDS``.
        told: before each run.
    """
    recipe = problems.load("rotor-353", timing="per_joint", **FREE).decomposition
    assert recipe is not None
    rows, followed = [], []
    for joint, part in zip(JOINTS, recipe.parts, strict=True):
        best = solve(part, certify=True).require()
        assert best.certificate is not None
        least = best.objectives["time"]
        one = Followed(joint, least)
        followed.append(one)
        for schedule in SCHEDULES:
            iterations, early, finals = [], [], []
            for seed in range(min(seeds, MOST_SEEDS)):
                told(f"PSO {schedule}, {joint} alone, seed {seed}")
                evolution, _ = PSO(seed, schedule=schedule).run(part, "time")
                if evolution.interrupted:
                    raise KeyboardInterrupt
                course = evolution.history["best"].to_numpy(dtype=float)
                reached = np.flatnonzero(course <= (1.0 + CLOSE) * least)
                iterations.append(float(reached[0]) + 1.0 if len(reached) else np.inf)
                early.append(course[min(WITHIN, len(course)) - 1] / least - 1.0)
                finals.append(course[-1] / least - 1.0)
                one.best.setdefault(schedule, []).append(course)
                one.times.setdefault(schedule, evolution.champions)
            rows.append(
                (
                    f"PSO {schedule.replace('_', ' ')}", joint, len(iterations),
                    sum(n <= WITHIN for n in iterations), float(np.median(iterations)),
                    float(np.median(early)), float(np.median(finals)), least, best.certificate.certified,
                )
            )  # fmt: skip
    columns = [
        "method",
        "joint",
        "runs",
        f"within {CLOSE:.0%} after {WITHIN} iterations (the paper: most joints)",
        "median iterations to get there (inf: never)",
        f"median gap after {WITHIN}",
        "median gap at the end",
        "least time [s]",
        "certified",
    ]
    return pd.DataFrame(rows, columns=columns).sort_values(["method", "joint"], ignore_index=True), followed
