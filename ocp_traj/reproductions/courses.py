"""How populations went, generation by generation: what figures are drawn of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.symbolic import evaluate_objectives

FOLLOWED = ("fitness", "time", "distance")  # of El Haiek's genetic algorithm


@dataclass(frozen=True, eq=False)
class Courses:
    """How runs of a genetic algorithm went.

    Attributes:
        values: ``FOLLOWED`` of the best individual, ``(G, 3)`` of each seed, by variant.
        best: the motion of the best proved individual of all, or None.
    """

    values: Mapping[str, Sequence[Array]]
    best: Motion | None


@dataclass(frozen=True, eq=False)
class Generations:
    """How a run of the genetic algorithm went.

    Attributes:
        history: a row a generation, see ``ocp_traj.evolution.generations.Watch``.
        most: generations it was given.
        stall, tolerance: it ends when the spread changes by less than this, on average over so many generations.
        values: objectives of its last front ``(N, objectives)``, in their units.
        distances: crowding distances of the same ``(N,)``, infinite at the ends.
    """

    history: pd.DataFrame
    most: int
    stall: int
    tolerance: float
    values: Array
    distances: Array


def objectives_of(problem: Problem, champions: Array, names: Sequence[str]) -> Array:
    """Values ``(G, names)`` in the objectives' units; NaN where no individual was feasible yet.

    Args:
        problem: whose objectives they are.
        champions: decision vectors ``(G, n)``, see ``ocp_traj.evolution.evolution.Evolution``.
        names: of objectives.
    """
    found = np.full((len(champions), len(names)), np.nan)
    for i, x in enumerate(champions):
        if i and np.array_equal(x, champions[i - 1], equal_nan=True):
            found[i] = found[i - 1]  # the best holds over many generations
        elif np.isfinite(x).all():
            values = evaluate_objectives(problem, x)
            found[i] = [values[name] for name in names]
    return found
