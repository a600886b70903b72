"""Clearance between bodies as the NLP has it: a row for each pair, by what is nearest of them at the posture."""

from __future__ import annotations

from typing import Any

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.clearance import SIZE, ClearanceConstraint
from ocp_traj.formulation.requirements import Expression, State
from ocp_traj.robot.pair_distances import CONSTANTS, PairDistances

# Of the size: how near pairs are at a start that the first grid has. Many of a robot's own are near each other at every
# posture and seldom get nearer; obstacles may be gone through between two instants. Our choice.
WITHIN, WITHIN_OWN = 1.0, 0.3


def clearance_rows(constraint: ClearanceConstraint, parameters: tuple[str, ...]) -> ChosenLimit:
    """The rows of a constraint on distances, as functions of the state, made once.

    Args:
        constraint: which bodies keep how far apart.
        parameters: of the trajectory; one of them may take the place of the clearance.
    """
    rows: ChosenLimit = constraint.made(("rows", parameters), lambda: _made(constraint, parameters))
    return rows


def distances_of(constraint: ClearanceConstraint) -> PairDistances:
    """Of the constraint's pairs, made once."""
    bodies, pairs = constraint.bodies, constraint.pairs
    found: PairDistances = constraint.made(
        "distances", lambda: PairDistances(constraint.robot, [(bodies[i], bodies[j]) for i, j in pairs])
    )
    return found


def _made(constraint: ClearanceConstraint, parameters: tuple[str, ...]) -> ChosenLimit:
    bodies, distances = constraint.bodies, distances_of(constraint)
    asked = parameters.index(constraint.parameter) if constraint.parameter else None
    made: dict[Any, Expression] = {}
    for distance in distances.expressions:
        if distance not in made:
            made[distance] = _beyond(distance, asked)

    def at_least(q: Array, p: Array) -> Array:
        bound = distances.at_least(q)
        return bound if asked is None else bound - p[:, asked, None]

    def value(q: Array, rows: Index, p: Array) -> Array:
        found = distances.distances(q, rows)
        return found if asked is None else found - p[:, asked]

    count = len(constraint.pairs)
    names = tuple(f"{bodies[i].name} - {bodies[j].name}" for i, j in constraint.pairs)
    proved_as = tuple(constraint.labels[row] for row in constraint.row_of.tolist())
    return ChosenLimit(
        constraint.id, made[distances.expressions[0]], np.full(count, constraint.clearance if asked is None else 0.0),
        np.full(count, np.inf), ("m",) * count, names, constraint.eq,
        expressions=tuple(made[distance] for distance in distances.expressions), choose=distances.constants,
        value=value, at_least=at_least, number=CONSTANTS, size=SIZE, proved_as=proved_as,
        within=WITHIN if constraint.parameter else WITHIN_OWN,  # the distance to obstacles is a parameter
    )  # fmt: skip


def _beyond(distance: Any, asked: int | None) -> Expression:
    """The distance, less the parameter that it has to reach."""

    def expression(state: State) -> Any:
        found = distance(state.q, state.c)
        return found if asked is None else found - state.p[asked]

    return expression
