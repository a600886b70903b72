"""Signed distances of points from bodies that do not move, in closed form."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.robot.bodies import CYLINDER, HALF_SPACE, Body


def outside(body: Body, points: Array) -> Array:
    """Of points ``(.., 3)`` in the body's frame of reference [m], below zero inside."""
    local = (points - body.centre) @ body.axes
    if body.kind == HALF_SPACE:
        return np.asarray(local[..., 2] - body.radius)
    if body.kind == CYLINDER:
        local = np.stack([np.hypot(local[..., 0], local[..., 1]), local[..., 2]], axis=-1)
        return outside_box(local, body.half[[0, 2]]) - body.radius
    return outside_box(local, body.half) - body.radius


def outside_box(local: Array, half: Array) -> Array:
    """Of points ``(.., d)`` in the axes of a box with half lengths ``(.., d)`` [m], below zero inside."""
    beyond = np.abs(local) - half
    outer = np.maximum(beyond, 0.0)
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", outer, outer)) + np.minimum(beyond.max(axis=-1), 0.0))
