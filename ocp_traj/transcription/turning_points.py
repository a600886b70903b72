"""Turning points: what makes the sum of steps in an NLP the total variation itself.

Between two nodes a row that turns back is counted too short. The instant where it turns, added to the nodes, mends
that; as it follows its turning point to first order (see ``peaks``), its error is of second order in the step that the
next solve makes, and of fourth in the sum: two or three rounds leave none. Two turning points that melt into one race
along the curve: they are held by instants that stay, all that were ever seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.bernstein import turning_times
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.transcription.instants import Instant, step_nodes, where
from ocp_traj.transcription.symbolic import row_variations, variation_matrix, variations
from ocp_traj.transcription.worst_instants import follow

Array = NDArray[np.float64]

AGREE = 1e-9  # of the total variation (and of the objective's scale): a row whose sum falls short by less is exact

FAST = 2.0  # segments a turning point moves when x doubles: one that is faster melts into another; our choice


def turned(
    problem: Problem, scalarisation: Scalarisation, instants: Sequence[Instant], x: Array, candidate: Motion
) -> list[Instant] | None:
    """The instants with turning points brought up to date; None where all sums of steps are already exact."""
    updated, exact = list(instants), True
    for objective in variations(problem, scalarisation.names):
        short = shortfalls(problem, objective, instants, x, candidate)
        for row in np.nonzero(short)[0].tolist():
            exact = False
            updated = [i for i in updated if (i.limit, i.rows) != (objective.id, (row,)) or i.slope is None]
            updated += _turning_points(problem, objective, row, x, candidate)
    return None if exact else updated


def shortfalls(
    problem: Problem, objective: Objective, instants: Sequence[Instant], x: Array, candidate: Motion
) -> NDArray[np.bool_]:
    """Of which rows ``(rows,)`` the sum of steps between the nodes is not the total variation."""
    matrix, curve = variation_matrix(problem, objective), candidate.curve
    exact = row_variations(problem, objective, [points[:, :, None] for points in curve.control_points])[:, 0]
    sums = np.zeros(len(matrix))
    for row in range(len(matrix)):
        nodes = [(node.segment, where(node, x)) for node in step_nodes(problem, objective, row, instants)]
        for k in range(curve.segments):
            values = curve.at(k, np.array([u for segment, u in nodes if segment == k])) @ matrix[row]
            sums[row] += np.abs(np.diff(values)).sum()
    return np.asarray(np.abs(exact - sums) > AGREE * max(float(exact.sum()), objective.scale))


def _turning_points(problem: Problem, objective: Objective, row: int, x: Array, candidate: Motion) -> list[Instant]:
    weights = variation_matrix(problem, objective)[row]
    members = []
    for k, points in enumerate(candidate.curve.control_points):
        values = points @ weights
        times = turning_times(values[:, None])[:, 0]
        members += [Instant(objective.id, k, float(u), (row,)) for u in np.unique(times) if 0.0 < u < 1.0]
    found = follow(problem, objective.id, members, x)
    fast = [i.slope is not None and np.abs(i.slope * x[i.columns]).max(initial=0.0) > FAST for i in found]
    return [replace(i, slope=None) if races else i for i, races in zip(found, fast, strict=True)]
