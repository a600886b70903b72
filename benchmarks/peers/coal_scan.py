"""Distances by ``coal`` through pinocchio's collision module at many postures, as its manual has it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]


def geometry(shapes: Iterable[tuple[str, int, Any, pin.SE3]], pairs: Iterable[tuple[int, int]]) -> pin.GeometryModel:
    """Bodies of a robot and of its surroundings: name, joint, shape of coal, placement; and pairs to look at."""
    model = pin.GeometryModel()
    for name, joint, shape, placement in shapes:
        model.addGeometryObject(pin.GeometryObject(name, joint, placement, shape))
    for i, j in pairs:
        model.addCollisionPair(pin.CollisionPair(i, j))
    return model


def least(robot: pin.Model, bodies: pin.GeometryModel, postures: Sequence[Array] | Array) -> Array:
    """The least distance of each pair over postures ``(N, n)`` [m]."""
    data, distances = robot.createData(), bodies.createData()
    found = np.full(len(bodies.collisionPairs), np.inf)
    for q in postures:
        pin.computeDistances(robot, data, bodies, distances, q)
        found = np.minimum(found, [result.min_distance for result in distances.distanceResults])
    return found


def collides(robot: pin.Model, bodies: pin.GeometryModel, postures: Sequence[Array] | Array) -> int:
    """At how many of the postures some pair touches; quicker than distances, and says less."""
    data, found = robot.createData(), bodies.createData()
    return sum(pin.computeCollisions(robot, data, bodies, found, q, True) for q in postures)
