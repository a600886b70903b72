"""Limits on distances between bodies: a robot's links and what is around them, whole bodies at every instant."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError, quoted
from ocp_traj.robot.bodies import Body, unique_names
from ocp_traj.robot.robot import Robot

SIZE = 0.1  # [m] by which distances are divided where limits are compared: our choice


@dataclass(frozen=True, eq=False)
class ClearanceConstraint:
    """Bodies of each pair keep a distance of at least ``clearance`` at every instant.

    Two bodies with cores a distance d > 0 apart are ``d - r_a - r_b`` from each other; below zero they overlap.

    Attributes:
        id: unique name.
        robot: whose joints carry the bodies, those of the trajectory in their order.
        bodies: of links and surroundings.
        pairs: indices of two bodies each, of which at least one moves against the other.
        clearance: least distance [m], zero or more.
        parameter: of the trajectory, which asks for that distance in place of ``clearance``; empty for none.
        eq: equation or table of the source.
    """

    id: str
    robot: Robot
    bodies: tuple[Body, ...]
    pairs: tuple[tuple[int, int], ...]
    clearance: float
    eq: str = ""
    parameter: str = ""
    _made: dict[Hashable, Any] = field(default_factory=dict, repr=False, init=False)

    def __post_init__(self) -> None:
        """Checks that bodies, pairs and robot fit."""
        unique_names(self.bodies)
        if not 0.0 <= self.clearance < np.inf:
            raise ProblemDefinitionError(
                f"limit {self.id!r}: the clearance is {self.clearance} m; give a finite number, zero or more"
            )
        for body in self.bodies:
            if not 0 <= body.joint < self.robot.model.njoints:
                raise ProblemDefinitionError(
                    f"limit {self.id!r}: body {quoted(body.name)} is on joint {body.joint}; the robot's joints are "
                    f"0 (the world) to {self.robot.model.njoints - 1}"
                )
        if not self.pairs:
            raise ProblemDefinitionError(f"limit {self.id!r} has no pairs of bodies; give one or more, or leave it out")
        for pair in self.pairs:
            if len(pair) != 2 or not all(0 <= index < len(self.bodies) for index in pair):
                raise ProblemDefinitionError(
                    f"limit {self.id!r}: the pair {pair} is not two of its {len(self.bodies)} bodies, counted from 0"
                )
            first, second = (self.bodies[index] for index in pair)
            if first.joint == second.joint:
                raise ProblemDefinitionError(
                    f"limit {self.id!r}: {quoted(first.name)} and {quoted(second.name)} do not move against each "
                    "other; leave the pair out"
                )

    def least(self, motion: Motion) -> float:
        """The distance that a motion has to keep [m]."""
        return float(motion.parameters[self.parameter]) if self.parameter else self.clearance

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """One a row: a row is all pairs of bodies of the same two links."""
        return tuple(dict.fromkeys(self._links))

    @cached_property
    def row_of(self) -> Index:
        """The row of each pair ``(pairs,)``."""
        rows = {label: row for row, label in enumerate(self.labels)}
        return np.array([rows[label] for label in self._links], dtype=np.intp)

    @property
    def scale(self) -> Array:
        """Size of each row ``(rows,)`` [m]."""
        return np.full(len(self.labels), SIZE)

    def made(self, key: Hashable, build: Callable[[], Any]) -> Any:
        """Something built from the constraint, kept for the next use."""
        if key not in self._made:
            self._made[key] = build()
        return self._made[key]

    @property
    def units(self) -> tuple[str, ...]:
        """One a row."""
        return ("m",) * len(self.labels)

    @property
    def _links(self) -> list[str]:
        return [f"{self.bodies[i].link} - {self.bodies[j].link}" for i, j in self.pairs]
