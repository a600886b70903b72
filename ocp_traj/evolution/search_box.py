"""Where populations look: within the bounds of the variables, and where there are none as far as guesses suggest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem

GUESSES, ROOM = 32, 3.0  # guesses, and times the largest of a block among them that is looked at: our choice


def search_box(problem: Problem, known: Sequence[Array] = ()) -> tuple[Array, Array]:
    """Lower and upper bounds ``(n,)``, all finite; those of the problem where they are.

    A side without a bound is ``ROOM`` times as far from zero as the largest entry of its block in a guess or a point
    that is known; as many units where they leave the block at zero.
    """
    lower, upper = problem.lower.copy(), problem.upper.copy()
    open_ = ~(np.isfinite(lower) & np.isfinite(upper))
    if not open_.any():
        return lower, upper
    guesses = np.array([*(problem.guess(np.random.default_rng([0, i])) for i in range(GUESSES)), *known])
    largest, place = np.abs(guesses).max(axis=0), 0
    for block in problem.variables:
        own = slice(place, place + len(block.labels))
        largest[own] = largest[own].max(initial=0.0) or 1.0
        place = own.stop
    low, high = np.minimum(-ROOM * largest, upper - largest), np.maximum(ROOM * largest, lower + largest)
    return np.where(np.isfinite(lower), lower, low), np.where(np.isfinite(upper), upper, high)
