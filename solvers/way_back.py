"""Back to a start that is clear, where a solve has gone through what is in the way.

The first NLPs see distances between bodies at few instants: a solution of theirs may be on both sides of a thin wall at
two of these. Begun from there, the next would have to bring the motion back through the wall, or would never end; begun
from the clear start, with an instant more in the wall, it stays on its side.
"""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.worst_instants import deepest

FAR = 0.1  # of the size of the limits on distances: one broken by more has gone through something; our choice
CLEARER = 0.5  # times the depth of a solution that a known point has to have at most


class WayBack:
    """The clearest point that is known of a problem.

    Args:
        problem: with limits on distances, or without: then there is no way back.
        x0: where its first solve begins.
    """

    def __init__(self, problem: Problem, x0: Array) -> None:
        """Looks at the start."""
        self.problem, self.x = problem, np.asarray(x0, dtype=float)
        self.depth = deepest(problem, self.x) if problem.chosen_limits else np.inf

    def after(self, x: Array, *, stalled: bool) -> Array | None:
        """Where to begin after a solution ``x (n,)``; None to go on from it, as long as that has not stalled."""
        if not self.problem.chosen_limits:
            return None
        depth = deepest(self.problem, x)
        if depth <= max(self.depth, FAR):
            self.x, self.depth = np.array(x), depth
            return None
        return self.x if stalled and self.depth <= CLEARER * depth else None
