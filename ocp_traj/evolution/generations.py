"""What a generation's front looks like, and whether it still changes: spread, average distance, hypervolume.

The spread is that of the Global Optimization Toolbox's manual: (mu + sigma) / (mu + Q d) with d and sigma the mean and
the standard deviation of the crowding distances of the Q front points where they are finite, and mu the sum over the
objectives of the norm of the move of that objective's best point since the last generation. It says how evenly the
points lie and how far the ends still move, and nothing of how good they are: that is for the hypervolume.
"""

from __future__ import annotations

from typing import Any

import moocore
import numpy as np
import pandas as pd
from pymoo.operators.survival.rank_and_crowding.metrics import get_crowding_function

from ocp_traj.arrays import Array

COLUMNS = ("evaluations", "front", "spread", "average distance", "hypervolume")


def crowding_distances(f: Array) -> Array:
    """Crowding distances ``(N,)`` of a front ``f (N, objectives)``: inf at its ends, all inf for two points or fewer.

    Mean over the objectives of the gap between both neighbours in that objective over its range; Deb et al. (2002).
    """
    return np.asarray(get_crowding_function("cd").do(f))


def spread(distances: Array, moves: Array) -> float:
    """(mu + sigma) / (mu + Q d), see the module; 1 where nothing can be said.

    Args:
        distances: crowding distances ``(N,)``, of which the finite ones count.
        moves: of the best point of each objective ``(objectives,)``.
    """
    finite, mu = distances[np.isfinite(distances)], float(moves.sum())
    below = mu + float(finite.sum())
    return (mu + (float(finite.std()) if len(finite) else 0.0)) / below if below > 0.0 else 1.0


def best_points(f: Array) -> Array:
    """The best point of each objective ``(objectives, objectives)``; of several, the one best in the others."""
    return np.array([f[np.lexsort((f.sum(axis=1), f[:, k]))[0]] for k in range(f.shape[1])])


class Watch:
    """Follows an algorithm: called after each generation, it says whether to stop.

    Moves of the best points are measured in units of the front's range, as crowding distances are (our choice).

    Args:
        stall: generations over which the change of the spread is averaged.
        tolerance: it stops when that average is below this.
        box: ideal and reference point ``(2, objectives)``, less is better, for the hypervolume; None for none.
    """

    def __init__(self, stall: int, tolerance: float, box: Array | None) -> None:
        self.stall, self.tolerance, self.box = stall, tolerance, box
        self.rows: list[tuple[int, int, float, float, float]] = []
        self.stalled = False
        self._best: Array | None = None

    def __call__(self, algorithm: Any) -> bool:
        """Takes note of a generation of a pymoo algorithm; whether the spread has stalled."""
        opt = algorithm.opt
        met = np.ravel(opt.get("excess").astype(float)) <= 0.0
        self.note(algorithm.problem.individuals, opt.get("F").astype(float)[met])
        return self.stalled

    def note(self, evaluations: int, f: Array) -> None:
        """Takes note of a front ``f (N, objectives)``, which may be empty."""
        if not len(f):
            self.rows.append((evaluations, 0, np.nan, np.nan, 0.0))
            return
        extent = np.ptp(f, axis=0)
        extent[extent <= 0.0] = 1.0
        best = best_points(f)
        before = best if self._best is None else self._best
        self._best = best
        distances = crowding_distances(f)
        value = spread(distances, np.linalg.norm((best - before) / extent, axis=1))
        finite = distances[np.isfinite(distances)]
        average = float(finite.mean()) if len(finite) else np.nan
        self.rows.append((evaluations, len(f), value, average, self._hypervolume(f)))
        self.stalled = self.change() < self.tolerance

    def change(self) -> float:
        """Mean change of the spread over the last ``stall`` generations; inf before there are as many."""
        values = np.array([row[2] for row in self.rows[-self.stall - 1 :]])
        known = len(values) == self.stall + 1 and np.isfinite(values).all()
        return float(np.abs(np.diff(values)).mean()) if known else np.inf

    def _hypervolume(self, f: Array) -> float:
        if self.box is None:
            return np.nan
        ideal, reference = self.box
        if not (ideal < reference).all():
            return np.nan
        scaled = np.maximum((f - ideal) / (reference - ideal), 0.0)
        return float(moocore.hypervolume(scaled, ref=np.ones(len(ideal))))

    @property
    def history(self) -> pd.DataFrame:
        """A row a generation, of ``COLUMNS``."""
        return pd.DataFrame(self.rows, columns=list(COLUMNS)).rename_axis("generation")
