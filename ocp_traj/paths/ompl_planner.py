"""RRT-Connect of OMPL, the Open Motion Planning Library (Sucan, Moll and Kavraki, 2012), of the extra ``plan``."""

from __future__ import annotations

from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.paths.connecting_trees import STEP, Space


def ompl_path(space: Space, start: Array, goal: Array, seed: int, most: int) -> Array | None:
    """A path from start to goal ``(W, n)``, simplified by OMPL, or None where none was found.

    Args:
        space: in which.
        start: clear, ``(n,)``.
        goal: likewise.
        seed: of OMPL's generators, of which the first in a process decides: it is then the sequence of calls that does.
        most: points to look at.

    Raises:
        InputError: OMPL is not installed.
    """
    try:
        from ompl import base, geometric, util
    except ImportError as error:
        raise InputError(
            'start = "ompl" needs OMPL: pip install "ocp-traj[plan]"; or give start = "plan", which needs nothing'
        ) from error
    util.setLogLevel(util.LOG_NONE)  # it would complain of a seed that comes after the first
    util.RNG.setSeed(seed)
    n, begun = len(start), space.looked
    # Coordinates over their scale, so that distances are those of the space.
    vectors = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for i in range(n):
        bounds.setLow(i, float(space.low[i] / space.scale[i]))
        bounds.setHigh(i, float(space.high[i] / space.scale[i]))
    vectors.setBounds(bounds)
    setup = geometric.SimpleSetup(vectors)

    def valid(state: Any) -> bool:
        space.looked += 1
        return bool(space.clear(np.array([[state[i] for i in range(n)]]) * space.scale)[0])

    setup.setStateValidityChecker(valid)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(STEP / vectors.getMaximumExtent())
    ends = []
    for point in (start, goal):
        state = vectors.allocState()
        for i in range(n):
            state[i] = float(point[i] / space.scale[i])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTConnect(information))
    setup.solve(base.PlannerTerminationCondition(lambda: space.looked - begun > most))
    if not setup.haveExactSolutionPath():
        return None
    setup.simplifySolution()
    states = setup.getSolutionPath().getStates()
    path = np.array([[state[i] for i in range(n)] for state in states]) * space.scale
    path[0], path[-1] = start, goal
    return path
