"""Convex cores of bodies in one frame, many at once: segments (points included), cylinders, boxes and half-spaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.robot.bodies import CYLINDER, HALF_SPACE, Body

SEGMENTS, CYLINDERS, BOXES, HALF_SPACES = range(4)  # the simpler first


@dataclass(frozen=True, eq=False)
class Cores:
    """N cores in the world, or any one frame.

    Attributes:
        group: ``SEGMENTS``, ``CYLINDERS``, .. of each ``(N,)``.
        centre: ``(N, 3)`` [m].
        axes: columns are the core's axes ``(N, 3, 3)``.
        half: half lengths along them ``(N, 3)`` [m]; of a cylinder radius, radius and half the height.
    """

    group: Index
    centre: Array
    axes: Array
    half: Array

    def take(self, which: Any) -> Cores:
        """Those at some indices."""
        return Cores(self.group[which], self.centre[which], self.axes[which], self.half[which])

    def local(self, points: Array) -> Array:
        """Points ``(N, 3)`` in the cores' own axes."""
        return self.turned_in(points - self.centre)

    def turned_in(self, vectors: Array) -> Array:
        """Vectors ``(N, 3)`` in the cores' own axes."""
        return np.asarray(np.einsum("nij,ni->nj", self.axes, vectors))

    def world(self, local: Array) -> Array:
        """The reverse of ``local``."""
        return self.centre + self.turned_out(local)

    def turned_out(self, local: Array) -> Array:
        """The reverse of ``turned_in``."""
        return np.asarray(np.einsum("nij,nj->ni", self.axes, local))

    def project(self, points: Array) -> Array:
        """The nearest points of the cores ``(N, 3)``."""
        return self.world(projected(self.local(points), self.half, self.group == CYLINDERS))

    def shrunk(self, by: Array) -> Cores:
        """Boxes and cylinders whose half lengths are less by ``(N,)`` [m]."""
        return Cores(self.group, self.centre, self.axes, self.half - by[:, None])

    @property
    def axis(self) -> Array:
        """Third axes ``(N, 3)``: along segments and cylinders, out of half-spaces."""
        return np.asarray(self.axes[:, :, 2])

    @property
    def runs(self) -> Array:
        """From the middle of segments to their ends ``(N, 3)`` [m]."""
        return self.axis * self.half[:, 2:]


def group_of(body: Body) -> int:
    """How distances to a body are found."""
    if body.kind == HALF_SPACE:
        return HALF_SPACES
    if body.kind == CYLINDER:
        return CYLINDERS
    return BOXES if (body.half[:2] > 0.0).any() else SEGMENTS


def projected(local: Array, half: Array, cylinder: NDArray[np.bool_]) -> Array:
    """Nearest points of cores of half lengths ``(N, 3)`` to points in their own axes ``(N, 3)``."""
    found = np.clip(local, -half, half)
    if cylinder.any():
        flat = local[cylinder, :2]
        size = np.hypot(flat[:, 0], flat[:, 1])
        radius = half[cylinder, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(size > radius, radius / size, 1.0)
        found[cylinder, :2] = flat * share[:, None]
    return found


def dot(a: Array, b: Array) -> Array:
    """Scalar products of vectors."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def unit(vectors: Array) -> Array:
    """Unit vectors of ``(N, 3)``; zero of those that are zero."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0.0))
