"""Seams: where a torch has to be, and how it has to point, at each length of arc; smooth polynomials of them by parts.

A seam is sampled by its arc length s; ``pieces`` writes it as one polynomial a segment, which is what a limit needs:
the place and the axis of the torch in closed form at any instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from io import StringIO
from itertools import pairwise
from math import isfinite, pi
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
import pandas as pd
from numpy.polynomial import chebyshev, polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import fixed_quad
from scipy.interpolate import make_interp_spline

from ocp_traj.errors import InputError, cut
from ocp_traj.files import read_text

Array = NDArray[np.float64]

DEGREE = 12  # of the polynomials of a piece: our choice; with 9 tags a tubular seam is met to 1e-10 of its length
PARTS = 256  # of a seam, whose lengths are integrated by Gauss and Legendre's rule: our choice
NODES = 8  # of that rule
CHECKS = 201  # places a piece at which polynomials are compared with the seam: our choice


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


class Seam(Protocol):
    """What a torch follows."""

    @property
    def length(self) -> float:
        """Of the arc [m]."""

    def at(self, s: ArrayLike) -> SeamPoints:
        """The seam at lengths of arc ``(N,)`` [m]."""


def _unit(vectors: Array) -> Array:
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

    def rotate(self, vectors: Array) -> Array:
        """Vectors ``(N, 3)`` of the part in the world."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.asarray(vectors @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))

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
        tangent = _unit(np.sign(self.phi[1] - self.phi[0]) * self._derivative(phi))
        chord, brace = self.normals(phi)
        return SeamPoints(
            self._world(position) + np.array(self.place.origin), self._world(tangent), -_unit(chord + brace)
        )

    def _world(self, vectors: Array) -> Array:
        return self.place.rotate(vectors * np.array([-1.0, 1.0, 1.0]) if self.mirrored else vectors)


class PolylineSeam:
    """A seam through given points, each with the axis of the torch: quintic splines through them, C4.

    Args:
        points: ``(N, 3)`` [m], six or more.
        axes: ``(N, 3)``, along which the torch points; any length but zero.
        place: of the points in the world.
    """

    def __init__(self, points: ArrayLike, axes: ArrayLike, place: Placement | None = None) -> None:
        """Checks the points and measures the arc."""
        place = place or Placement()
        given, directions = np.asarray(points, dtype=float), np.asarray(axes, dtype=float)
        if given.ndim != 2 or given.shape[1] != 3 or directions.shape != given.shape or len(given) < 6:
            raise InputError(
                f"a seam has points {given.shape} and axes {directions.shape}; give six or more points (N, 3) and as "
                "many axes"
            )
        steps = np.linalg.norm(np.diff(given, axis=0), axis=1)
        sizes = np.linalg.norm(directions, axis=1)
        if not (np.isfinite(given).all() and np.isfinite(directions).all()):
            raise InputError("a seam's points and axes have to be finite numbers")
        for what, values in (("points {0} and {1} of a seam are the same", steps), ("axis {0} of a seam is 0", sizes)):
            if not (values > 0.0).all():
                at = int(np.argmin(values)) + 1
                raise InputError(what.format(at, at + 1) + "; leave one out or correct it")
        chord = np.concatenate([[0.0], np.cumsum(steps)])
        self._position = make_interp_spline(chord, place.move(given), k=5)
        self._axis = make_interp_spline(chord, place.rotate(_unit(directions)), k=5)
        self._edges = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in pairwise(chord)]))
        arcs = [fixed_quad(self._speed, a, b, n=NODES)[0] for a, b in pairwise(self._edges)]
        self._lengths = np.concatenate([[0.0], np.cumsum(arcs)])

    @classmethod
    def read(cls, file: str | Path, place: Placement | None = None) -> Self:
        """From a CSV file with the columns x, y, z [m] and nx, ny, nz, the normal that points out of the seam."""
        path, wanted = Path(file), ["x", "y", "z", "nx", "ny", "nz"]
        text = read_text(path, "seam")
        try:
            table = pd.read_csv(StringIO(text))
        except ValueError as error:  # of pandas' parser
            raise InputError(f"{path} is no readable CSV file: {error}") from error
        table.columns = [str(name).split("[")[0].strip() for name in table.columns]
        missing = [name for name in wanted if name not in table.columns]
        if missing:
            raise InputError(f"{path} lacks the columns {', '.join(missing)}; a seam needs {', '.join(wanted)}")
        try:
            numbers = table[wanted].to_numpy(dtype=float)
        except ValueError as error:
            raise InputError(f"{path}: {cut(str(error))}; give numbers") from error
        return cls(numbers[:, :3], -numbers[:, 3:], place)

    @property
    def length(self) -> float:
        """Of the arc [m]."""
        return float(self._lengths[-1])

    def _speed(self, t: Array) -> Array:
        return np.asarray(np.linalg.norm(self._position(t, 1), axis=-1))

    def at(self, s: ArrayLike) -> SeamPoints:
        """The seam at lengths of arc ``(N,)`` [m]."""
        lengths = np.atleast_1d(np.asarray(s, dtype=float))
        if not ((lengths >= -1e-12) & (lengths <= self.length + 1e-12)).all():
            raise InputError(
                f"a seam of {self.length:.6g} m has no place at {lengths.min():.6g} .. {lengths.max():.6g} m"
            )
        part = np.clip(np.searchsorted(self._lengths, lengths, side="right") - 1, 0, len(self._edges) - 2)
        base, left = self._edges[part], np.clip(lengths - self._lengths[part], 0.0, None)
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        step = left / self._speed(base)
        for _ in range(8):
            inner = base[:, None] + step[:, None] * (1.0 + nodes) / 2.0
            step = step - (step * (self._speed(inner) @ weights) / 2.0 - left) / self._speed(base + step)
        t = base + step
        return SeamPoints(self._position(t), _unit(self._position(t, 1)), _unit(self._axis(t)))


@dataclass(frozen=True, eq=False)
class Pieces:
    """A seam in pieces of equal length, each a polynomial in w = 2 u - 1 of the local time u.

    Attributes:
        tags: lengths of arc at which pieces meet ``(K + 1,)`` [m].
        position: coefficients, lowest first ``(K, degree + 1, 3)`` [m].
        axis: likewise; not quite unit vectors.
        position_error: largest distance between seam and polynomials found [m].
        axis_error: likewise of the axis.
    """

    tags: Array
    position: Array
    axis: Array
    position_error: float
    axis_error: float

    @property
    def constants(self) -> Array:
        """Both polynomials' coefficients, one row a piece ``(K, 6 (degree + 1))``; see ``split``."""
        count = len(self.position)
        return np.concatenate([self.position.reshape(count, -1), self.axis.reshape(count, -1)], axis=1)

    def values(self, k: int, u: ArrayLike) -> tuple[Array, Array]:
        """Positions and axes ``(N, 3)`` of piece k at local times ``(N,)``."""
        w = 2.0 * np.atleast_1d(np.asarray(u, dtype=float)) - 1.0
        return (
            np.asarray(polynomial.polyval(w, self.position[k])).T,
            np.asarray(polynomial.polyval(w, self.axis[k])).T,
        )


def pieces(seam: Seam, tags: int, degree: int = DEGREE) -> Pieces:
    """Cuts a seam at ``tags`` places of equal distance and interpolates each piece at Chebyshev's nodes."""
    if tags < 2:
        raise InputError(f"a seam has {tags} tags; give two or more")
    cuts = np.linspace(0.0, seam.length, tags)
    nodes = chebyshev.chebpts1(degree + 1)
    inverse = np.linalg.inv(chebyshev.chebvander(nodes, degree))
    check = np.linspace(-1.0, 1.0, CHECKS)
    position, axis, errors = [], [], []
    for a, b in pairwise(cuts):
        sample = seam.at(a + (b - a) * (1.0 + nodes) / 2.0)
        powers = [
            np.stack([_power(column, degree) for column in (inverse @ values).T], axis=-1)
            for values in (sample.position, sample.axis)
        ]
        exact = seam.at(a + (b - a) * (1.0 + check) / 2.0)
        errors.append(
            [
                np.linalg.norm(np.asarray(polynomial.polyval(check, p)).T - e, axis=1).max()
                for p, e in zip(powers, (exact.position, exact.axis), strict=True)
            ]
        )
        position.append(powers[0])
        axis.append(powers[1])
    worst = np.max(errors, axis=0)
    return Pieces(cuts, np.array(position), np.array(axis), float(worst[0]), float(worst[1]))


def _power(coefficients: Sequence[float] | Array, degree: int) -> Array:
    """Powers' coefficients from Chebyshev's, of full length even where the highest are zero."""
    found = chebyshev.cheb2poly(coefficients)
    return np.pad(found, (0, degree + 1 - len(found)))


def at_piece(constants: Any, u: Any, degree: int = DEGREE) -> tuple[Any, Any]:
    """Place and axis ``(3,)`` of a torch at local time u of a piece, symbolic, from its row of ``Pieces.constants``."""
    w = 2.0 * u - 1.0
    found = []
    for part in range(2):
        value: Any = 0.0
        for power in range(degree, -1, -1):
            first = 3 * (degree + 1) * part + 3 * power
            value = value * w + constants[first : first + 3]
        found.append(value)
    return found[0], found[1]
