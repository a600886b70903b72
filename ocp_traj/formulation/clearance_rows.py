"""Clearance between bodies as the NLP has it: a row for each pair, by what is nearest of them at the posture."""

from __future__ import annotations

from typing import Any

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.requirements import Expression, State
from ocp_traj.robot.pair_distances import CONSTANTS, PairDistances

SIZE = 0.1  # [m] by which rows are divided, and within which pairs are looked at: our choice


def clearance_rows(constraint: ClearanceConstraint, parameters: tuple[str, ...]) -> ChosenLimit:
    """The rows of a constraint on distances, as functions of the state.

    Args:
        constraint: which bodies keep how far apart.
        parameters: of the trajectory; one of them may take the place of the clearance.
    """
    distances = PairDistances(constraint.robot, [(constraint.bodies[i], constraint.bodies[j]) for i, j in constraint.pairs])
    asked = parameters.index(constraint.parameter) if constraint.parameter else None
    made: dict[Any, Expression] = {}
    for distance in distances.expressions:
        if distance not in made:
            made[distance] = _beyond(distance, asked)

    def at_least(q: Array, p: Array) -> Array:
        bound = distances.at_least(q)
        return bound if asked is None else bound - p[:, asked, None]

    count = len(constraint.pairs)
    names = tuple(f"{constraint.bodies[i].name} - {constraint.bodies[j].name}" for i, j in constraint.pairs)
    rows: Index = constraint.row_of
    return ChosenLimit(
        constraint.id, made[distances.expressions[0]], np.full(count, constraint.clearance if asked is None else 0.0),
        np.full(count, np.inf), ("m",) * count, names, constraint.eq,
        expressions=tuple(made[distance] for distance in distances.expressions), choose=distances.constants,
        at_least=at_least, number=CONSTANTS, size=SIZE, proved_as=tuple(constraint.labels[row] for row in rows.tolist()),
    )  # fmt: skip


def _beyond(distance: Any, asked: int | None) -> Expression:
    """The distance, less the parameter that it has to reach."""

    def expression(state: State) -> Any:
        found = distance(state.q, state.c)
        return found if asked is None else found - state.p[asked]

    return expression
