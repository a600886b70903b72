"""Spheres in the way of a straight link that turns about its base: where it is clear of them, and by how much.

The base is the origin of one unit of length; where the link points is a unit vector, its direction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import asin, hypot, isfinite, pi, sqrt
from typing import Any

import casadi
import numpy as np
from scipy.optimize import minimize_scalar

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A sphere in the way of a link, grown by the link's radius, so that the link is a line.

    Its clearance is the angle by which it may grow, seen from the base, until the link touches it.

    Attributes:
        number: from 1.
        sphere: x, y, z of its centre c, and its radius r.
        link: the link's length.
        link_radius: rho.
    """

    number: int
    sphere: tuple[float, ...]
    link: float
    link_radius: float

    def __post_init__(self) -> None:
        """Checks that there is a sphere, and that it is off the base."""
        if len(self.sphere) != 4 or not all(map(isfinite, self.sphere)) or not self.sphere[3] > 0.0:
            raise InputError(f"obstacle {self.number} is {self.sphere}; give x:y:z:radius, the radius above zero")
        if self.size <= self.radius:
            raise InputError(
                f"obstacle {self.number} at {self.sphere[:3]} with radius {self.sphere[3]} reaches the link's base at "
                f"the origin (link radius {self.link_radius}); no motion could be clear of it: move or shrink it"
            )

    @cached_property
    def centre(self) -> Array:
        """The centre c ``(3,)``."""
        return np.array(self.sphere[:3])

    @property
    def radius(self) -> float:
        """Of the grown sphere, R = r + rho."""
        return self.sphere[3] + self.link_radius

    @cached_property
    def size(self) -> float:
        """The centre's distance from the base, |c|."""
        return hypot(*self.centre)

    @cached_property
    def half_angle(self) -> float:
        """Half the angle under which it is seen from the base, asin(R / |c|) [rad]."""
        return asin(self.radius / self.size)

    @property
    def within_reach(self) -> bool:
        """Whether the link is as long as the tangents from the base: then it is clear where its direction is."""
        return self.link >= sqrt(self.size**2 - self.radius**2)

    @property
    def most_clearance(self) -> float:
        """The clearance of a link that points away from it, or, beyond reach, of one that ends at the base [rad]."""
        return (pi if self.within_reach else pi / 2.0) - self.half_angle

    def describe(self, tip: Array, where: str, asked: float) -> str:
        """In words, how a link with its tip at a place ``(3,)`` touches it, or is nearer than a clearance [rad]."""
        x, y, z, radius = self.sphere
        named = (
            f"obstacle {self.number} (centre {x:g}, {y:g}, {z:g}, radius {radius:g}, link radius {self.link_radius:g})"
        )
        share = float(np.clip(self.centre @ tip / (tip @ tip), 0.0, 1.0))
        depth = float(self.radius - np.linalg.norm(share * tip - self.centre))
        if depth > 0.0:
            return f"{named} touches the link {where}: they overlap by {depth:.4g}"
        found = float(self.clearance(tip[None] / hypot(*tip))[0])
        return f"{named} leaves {found:.4g} rad of clearance {where}, {asked:g} is asked for"

    def clearance(self, directions: Array) -> Array:
        """Clearance of directions ``(N, 3)`` from it ``(N,)`` [rad]."""
        if not self.within_reach:
            along = np.clip(directions @ self.centre, 0.0, self.link)
            distance = np.linalg.norm(self.centre - along[:, None] * directions, axis=1)
            return np.asarray(np.arcsin(np.minimum(distance / self.size, 1.0)) - self.half_angle)
        return np.asarray(np.arccos(np.clip(directions @ self.centre / self.size, -1.0, 1.0)) - self.half_angle)

    def excess(self, direction: Any, clearance: Any, along: Any) -> Any:
        """At most zero where the link keeps a clearance [rad], symbolic and smooth.

        Within reach it is a difference of cosines, of the direction alone; beyond, how far the point at a share
        ``along`` of the link lies inside the sphere grown by the clearance, of squared distances over |c|^2.
        """
        grown = self.half_angle + clearance
        if self.within_reach:
            return casadi.dot(self.centre / self.size, direction) - casadi.cos(grown)
        point = self.link * along * direction
        return casadi.sin(grown) ** 2 - casadi.sumsqr((point - casadi.DM(self.centre)) / self.size)


def least_clearance(
    curve: PiecewiseBezier, directions: Callable[[Array], Array], obstacles: Sequence[Obstacle]
) -> float:
    """The clearance along a curve [rad]: least over time and obstacles, by a scan and a search in its best cells.

    Args:
        curve: of the joints.
        directions: of the link ``(N, 3)`` from joints ``(N, dof)``.
        obstacles: all of them.
    """
    least = np.inf
    u = np.linspace(0.0, 1.0, 129)
    for sphere in obstacles:
        for k in range(curve.segments):
            values = sphere.clearance(directions(curve.at(k, u)))
            least = min(least, float(values.min()))
            inner = np.nonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:]))[0] + 1
            for i in inner[values[inner] < values.min() + 0.01]:  # a cell's least value is closer to its samples' [rad]
                found = minimize_scalar(
                    lambda t, k=k, sphere=sphere: float(sphere.clearance(directions(curve.at(k, t)))[0]),
                    bounds=(u[i - 1], u[i + 1]), method="bounded", options={"xatol": 1e-12},
                )  # fmt: skip
                least = min(least, float(found.fun))
    return least
