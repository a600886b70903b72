"""Seams: where a torch has to be, and how it has to point, at each length of arc; that of two tubes.

A seam is sampled by its arc length s. Its formula, in a parameter of its own, is what bounds are proved from.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite, pi
from typing import Any, NamedTuple, Protocol

import casadi
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import fixed_quad

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError

PARTS = 256  # of a seam, whose lengths are integrated by Gauss and Legendre's rule: our choice
NODES = 8  # of that rule
KINK = 1e-12  # of cos phi, by which rounding may take the end of a stretch past a kink: our choice


class SeamPoints(NamedTuple):
    """A seam at N lengths of arc, in its own frame or the world's.

    Attributes:
        position: ``(N, 3)`` [m].
        tangent: unit vectors ``(N, 3)``.
        axis: unit vectors ``(N, 3)`` along which the torch points, into the seam.
    """

    position: Array
    tangent: Array
    axis: Array


class Formula(NamedTuple):
    """A seam as casadi SX expressions of a parameter t that runs along it.

    Attributes:
        t: the parameter.
        constants: symbols ``(n,)``, whose values differ from stretch to stretch.
        position: ``(3,)`` [m], not by arc length but by t.
        axis: ``(3,)``, a unit vector.
    """

    t: Any
    constants: Any
    position: Any
    axis: Any


class Seam(Protocol):
    """What a torch follows."""

    @property
    def length(self) -> float:
        """Of the arc [m]."""

    @property
    def breaks(self) -> Array:
        """Lengths of arc [m] at which the constants of the formula change, ascending."""

    @property
    def formula(self) -> Formula:
        """The seam as an expression."""

    def at(self, s: ArrayLike) -> SeamPoints:
        """The seam at lengths of arc ``(N,)`` [m]."""

    def parameter(self, s: ArrayLike) -> Array:
        """The formula's parameter ``(N,)`` at lengths of arc ``(N,)`` [m]."""

    def constants(self, low: Array, high: Array) -> Array:
        """The formula's constants ``(n, N)`` on stretches of t between breaks; NaN where it does not hold all along."""


def unit(vectors: Array) -> Array:
    """Vectors ``(.., 3)`` of length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a part stands: turned about the vertical and put at a point.

    Attributes:
        origin: of the part's frame ``(3,)`` [m].
        yaw: of its x axis about the vertical [rad].
    """

    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.0

    def __post_init__(self) -> None:
        """Checks the numbers."""
        if len(self.origin) != 3 or not all(map(isfinite, (*self.origin, self.yaw))):
            raise InputError(f"a part stands at {self.origin}, turned by {self.yaw} rad; give finite numbers")

    @property
    def matrix(self) -> Array:
        """What turns a row vector of the part into the world's ``(3, 3)``."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def rotate(self, vectors: Array) -> Array:
        """Vectors ``(N, 3)`` of the part in the world."""
        return np.asarray(vectors @ self.matrix)

    def move(self, points: Array) -> Array:
        """Points ``(N, 3)`` of the part in the world [m]."""
        return np.asarray(self.rotate(points) + np.array(self.origin))


@dataclass(frozen=True, eq=False)
class TubeSeam:
    """Where a brace meets a chord: tube on tube, a T, Y or K joint.

    In the part's frame the chord's axis is x and the two axes cross at the origin; the brace rises at ``psi`` to the
    chord, towards +x (a T joint has psi = 90 deg; the other brace of a K joint is ``mirrored``). phi is the angle about
    the brace, 0 on its side towards +x (the heel is there for psi < 90 deg, the toe opposite).

    Attributes:
        chord_radius: R [m].
        brace_radius: r <= R [m].
        psi: angle between the axes, above 0 and up to pi/2 [rad].
        phi: first and last angle about the brace [rad].
        place: of the part in the world.
        mirrored: whether the brace leans towards -x.
    """

    chord_radius: float
    brace_radius: float
    psi: float
    phi: tuple[float, float]
    place: Placement = field(default_factory=Placement)
    mirrored: bool = False

    def __post_init__(self) -> None:
        """Checks the numbers and measures the arc."""
        if not 0.0 < self.brace_radius <= self.chord_radius < np.inf:
            raise InputError(
                f"the brace's radius is {self.brace_radius} m and the chord's {self.chord_radius} m; give "
                "0 < brace <= chord"
            )
        if not 0.0 < self.psi <= pi / 2.0:
            raise InputError(f"psi is {np.degrees(self.psi):g} deg; give an angle above 0 and up to 90")
        low, high = self.phi
        if not (isfinite(low) and isfinite(high) and low != high and abs(high - low) <= 2.0 * pi + 1e-12):
            raise InputError(f"phi runs from {low} to {high} rad; give two different angles at most one turn apart")
        edges = np.linspace(low, high, PARTS + 1)
        steps = [fixed_quad(self._speed, a, b, n=NODES)[0] for a, b in pairwise(edges)]
        object.__setattr__(self, "_edges", edges)
        object.__setattr__(self, "_lengths", np.concatenate([[0.0], np.cumsum(np.abs(steps))]))

    _edges: Array = field(init=False, repr=False)
    _lengths: Array = field(init=False, repr=False)

    @property
    def length(self) -> float:
        """Of the arc [m]."""
        return float(self._lengths[-1])

    def _height(self, phi: Array) -> tuple[Array, Array]:
        """Of the seam over the chord's axis, c, and its derivative c' = -r^2 sin cos / c."""
        c = np.sqrt(np.maximum(self.chord_radius**2 - (self.brace_radius * np.sin(phi)) ** 2, 0.0))
        if self.brace_radius == self.chord_radius:  # c = R |cos phi|, and c' steps at its kinks
            return c, np.asarray(-self.chord_radius * np.sin(phi) * np.where(np.cos(phi) < 0.0, -1.0, 1.0))
        return c, np.asarray(-(self.brace_radius**2) * np.sin(phi) * np.cos(phi) / c)

    def _derivative(self, phi: Array) -> Array:
        """D position / d phi ``(N, 3)``, of a brace that is not mirrored."""
        _, slope = self._height(phi)
        r, psi = self.brace_radius, self.psi
        along = (slope * np.cos(psi) - r * np.sin(phi)) / np.sin(psi)
        return np.stack([along, r * np.cos(phi), slope], axis=-1)

    def _speed(self, phi: Array) -> Array:
        return np.asarray(np.linalg.norm(self._derivative(np.asarray(phi)), axis=-1))

    @property
    def breaks(self) -> Array:
        """None: one formula holds all along, but for the kinks of tubes of one radius."""
        return np.zeros(0)

    @property
    def formula(self) -> Formula:
        """As in ``at``, of phi; the constant is the sign of cos phi, which tubes of one radius need."""
        phi, sign = casadi.SX.sym("phi"), casadi.SX.sym("sign")
        r, chord_radius, psi = self.brace_radius, self.chord_radius, self.psi
        sine, cosine = casadi.sin(phi), casadi.cos(phi)
        c = sign * chord_radius * cosine if r == chord_radius else casadi.sqrt(chord_radius**2 - (r * sine) ** 2)
        position = casadi.vertcat((c * np.cos(psi) + r * cosine) / np.sin(psi), r * sine, c)
        chord = casadi.vertcat(0.0, r * sine, c) / chord_radius
        inward = -chord - casadi.vertcat(cosine * np.sin(psi), sine, -cosine * np.cos(psi))
        turn = self.place.matrix.T @ np.diag([-1.0 if self.mirrored else 1.0, 1.0, 1.0])
        place = casadi.mtimes(casadi.DM(turn), position) + casadi.DM(self.place.origin)
        return Formula(phi, sign, place, casadi.mtimes(casadi.DM(turn), inward / casadi.norm_2(inward)))

    def parameter(self, s: ArrayLike) -> Array:
        """Phi ``(N,)`` [rad] at lengths of arc ``(N,)`` [m]."""
        return self.angle(s)

    def constants(self, low: Array, high: Array) -> Array:
        """Sign of cos phi ``(1, N)``; NaN where tubes of one radius have a kink within."""
        sign = np.where(np.cos((low + high) / 2.0) < 0.0, -1.0, 1.0)
        kinked = (np.minimum(sign * np.cos(low), sign * np.cos(high)) < -KINK) & (
            self.brace_radius == self.chord_radius
        )
        return np.where(kinked, np.nan, sign)[None]

    def angle(self, s: ArrayLike) -> Array:
        """Phi ``(N,)`` [rad] at lengths of arc ``(N,)`` [m], by Newton's method on the integral of the speed."""
        lengths = np.atleast_1d(np.asarray(s, dtype=float))
        if not ((lengths >= -1e-12) & (lengths <= self.length + 1e-12)).all():
            raise InputError(
                f"a seam of {self.length:.6g} m has no place at {lengths.min():.6g} .. {lengths.max():.6g} m"
            )
        part = np.clip(np.searchsorted(self._lengths, lengths, side="right") - 1, 0, PARTS - 1)
        base, sign = self._edges[part], np.sign(self.phi[1] - self.phi[0])
        left = np.clip(lengths - self._lengths[part], 0.0, None)
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        step = left / self._speed(base)
        for _ in range(8):
            inner = base[:, None] + sign * step[:, None] * (1.0 + nodes) / 2.0
            covered = step * (self._speed(inner) @ weights) / 2.0
            step = step - (covered - left) / self._speed(base + sign * step)
        return np.asarray(base + sign * step)

    def normals(self, phi: ArrayLike) -> tuple[Array, Array]:
        """Unit normals of chord and brace ``(N, 3)``, both outwards, in the world, at angles ``(N,)`` [rad]."""
        angle = np.atleast_1d(np.asarray(phi, dtype=float))
        c, _ = self._height(angle)
        zero, one = np.zeros_like(angle), np.ones_like(angle)
        chord = np.stack([zero, self.brace_radius * np.sin(angle), c], axis=-1) / self.chord_radius
        out = np.stack([np.sin(self.psi) * one, zero, -np.cos(self.psi) * one], axis=-1)
        brace = np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * np.array([0.0, 1.0, 0.0])
        return self._world(chord), self._world(brace)

    def dihedral(self, s: ArrayLike) -> Array:
        """Angle between the walls of chord and brace outside of the brace ``(N,)`` [rad], at lengths of arc [m]."""
        chord, brace = self.normals(self.angle(s))
        return np.asarray(pi - np.arccos(np.clip((chord * brace).sum(axis=-1), -1.0, 1.0)))

    def at(self, s: ArrayLike) -> SeamPoints:
        """The seam at lengths of arc ``(N,)`` [m]; the torch points along minus the bisector of the two normals."""
        phi = self.angle(s)
        c, _ = self._height(phi)
        along = (c * np.cos(self.psi) + self.brace_radius * np.cos(phi)) / np.sin(self.psi)
        position = np.stack([along, self.brace_radius * np.sin(phi), c], axis=-1)
        tangent = unit(np.sign(self.phi[1] - self.phi[0]) * self._derivative(phi))
        chord, brace = self.normals(phi)
        return SeamPoints(
            self._world(position) + np.array(self.place.origin), self._world(tangent), -unit(chord + brace)
        )

    def _world(self, vectors: Array) -> Array:
        return self.place.rotate(vectors * np.array([-1.0, 1.0, 1.0]) if self.mirrored else vectors)
