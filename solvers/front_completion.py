"""What a front that was stopped early can still be given: what lies between its points, and dilations, without a solve.

The points found so far and the starting points are trajectories of one family: those between two of them and the
dilations of all are candidates, evaluated in passes of the tape. Those that add most to the front are proved and join.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import moocore
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.population import Population
from ocp_traj.results.records import of_points
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.front_directions import well_spread
from ocp_traj.solvers.front_points import FrontPoints
from ocp_traj.solvers.front_rays import Rays
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import degrees, evaluate_objectives

FEW, ENOUGH = 5, 10  # a front of fewer points is completed, to as many; what takes time after its end: our choice
BETWEEN = (0.25, 0.5, 0.75)  # of the way from one point to the next: our choice


def complete_early(front: FrontPoints, starts: Sequence[Array]) -> int:
    """Adds what is proved of the candidates to a front of few points; how many.

    All of it is told of, and the front has no more points than are wanted.

    Args:
        front: that was stopped.
        starts: starting points ``(n,)`` of its solves.
    """
    wanted, known = min(ENOUGH, front.wanted), len(front)
    if known >= min(FEW, wanted):
        return 0
    problem = front.problem
    rays = Rays(problem, Population(problem, front.names, max(5, *degrees(problem)), refine=True), front.signs)
    order = np.argsort(front.values[:, 0], kind="stable")
    ends = [*(front.solutions[i].x for i in order), *starts]
    for x in [*ends, *(one + t * (other - one) for one, other in pairwise(ends) for t in BETWEEN)]:
        rays.add(x)
    new = (rays.owner >= known) | (rays.factor != 1.0)
    candidates = np.flatnonzero(new & rays.legal & (rays.values <= front.reference).all(axis=1))
    values = np.vstack([front.values, rays.values[candidates]])
    best = moocore.is_nondominated(values) if len(values) else np.empty(0, dtype=bool)
    best[:known] = True
    places = np.flatnonzero(best)
    if len(places) == known:
        return 0
    ideal, worst = values[places].min(axis=0), values[places].max(axis=0)
    reference = np.where(np.isfinite(front.reference), front.reference, worst)
    reference = np.where(reference > ideal, reference, ideal + 1.0)
    chosen = places[well_spread(values[places], ideal, reference, wanted, np.arange(known))]
    xs = [rays.x(int(candidates[place - known])) for place in chosen if place >= known]
    return _prove(front, xs, np.maximum(worst - ideal, np.finfo(float).tiny))


def _prove(front: FrontPoints, xs: Sequence[Array], span: Array) -> int:
    """Proves points, tells of them, and adds those that are proved."""
    audits = audit_points(front.problem, list(xs))
    values = [evaluate_objectives(front.problem, x) for x in xs]
    front.work.found(of_points((x, v, audit) for x, v, (_, audit) in zip(xs, values, audits, strict=True)))
    added = 0
    for x, objectives, (path, audit) in zip(xs, values, audits, strict=True):
        if audit.proved:
            point = Solution(
                name=front.problem.id, x=x, f=np.nan, status=Status.FEASIBLE, violation=0.0, iterations=0, seconds=0.0,
                objectives=objectives, trajectory=path, audit=audit,
            )  # fmt: skip
            added += front.take(point, span)
    return added
