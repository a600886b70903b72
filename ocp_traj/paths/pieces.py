"""A seam as polynomials, one a segment, which is what a limit needs: place and axis in closed form at any instant.

How far a polynomial p(s) is from its seam r(s) at most is bounded, not sampled: with e = r - p, on a stretch of the arc
of length h

    |e| <= max(|e| at both ends) + h^2 / 8 max |e''|

and e'' is enclosed by running the tape of the seam's formula and of the polynomial in intervals. Stretches are halved
until the bound is close to what was found at their ends. It holds for the lengths of arc that the seam itself goes by,
which come from Gauss and Legendre's rule, and includes ``ROUNDING`` of the coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
from numpy.polynomial import chebyshev, polynomial
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array, Index
from ocp_traj.errors import InputError
from ocp_traj.interval.tape import Tape
from ocp_traj.paths.seam import Formula, Seam
from ocp_traj.rounding import rounded_up

DEGREE = 12  # of the polynomials of a piece: our choice; with 9 tags a tubular seam is met to 1e-10 of its length
STRETCHES = 64  # a piece to begin with: our choice
CLOSE, TINY = 0.02, 1e-10  # a bound above what was found by no more than this share, or amount [m], is close enough
MOST_HALVINGS, MOST_STRETCHES = 40, 50_000  # at a time: our choice; bounds that are wide after that stay wide
DIGITS = 3  # of a bound: our choice
ROUNDING = 1e-14  # of coordinates, in seam and polynomial


@dataclass(frozen=True, eq=False)
class Pieces:
    """A seam in pieces of equal length, each a polynomial in w = 2 u - 1 of the local time u.

    Attributes:
        tags: lengths of arc at which pieces meet ``(K + 1,)`` [m].
        position: coefficients, lowest first ``(K, degree + 1, 3)`` [m].
        axis: likewise; not quite unit vectors.
        position_error: the seam is nowhere farther from its polynomials, both at the same length of arc [m].
        axis_error: likewise of the axis.
    """

    tags: Array
    position: Array
    axis: Array
    position_error: float
    axis_error: float

    @property
    def constants(self) -> Array:
        """Both polynomials' coefficients, one row a piece ``(K, 6 (degree + 1))``; see ``at_piece``."""
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
    position, axis = [], []
    for a, b in pairwise(cuts):
        sample = seam.at(a + (b - a) * (1.0 + nodes) / 2.0)
        powers = [
            np.stack([_power(column, degree) for column in (inverse @ values).T], axis=-1)
            for values in (sample.position, sample.axis)
        ]
        position.append(powers[0])
        axis.append(powers[1])
    errors = _Errors(seam, cuts, np.array(position), np.array(axis)).bound()
    # Limits are tightened by these: their last bits, which differ between processors, would reach every solution.
    return Pieces(cuts, np.array(position), np.array(axis), *(rounded_up(float(e), DIGITS) for e in errors))


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


class _Errors:
    """Bounds on the distance of a seam, place and axis, from its polynomials."""

    def __init__(self, seam: Seam, cuts: Array, position: Array, axis: Array) -> None:
        self.seam, self.cuts = seam, cuts
        self.coefficients = np.stack([position, axis], axis=1)  # (K, 2, degree + 1, 3)
        self.tape = _second_differences(seam.formula, position.shape[1] - 1)

    def bound(self) -> Array:
        """Bounds of both errors ``(2,)``."""
        edges = np.concatenate([np.linspace(a, b, STRETCHES + 1)[:-1] for a, b in pairwise(self.cuts)])
        edges = np.unique(np.concatenate([edges, self.cuts, self.seam.breaks]))
        edges = edges[(edges >= 0.0) & (edges <= self.cuts[-1])]
        a, b = edges[:-1], edges[1:]
        piece = np.clip(np.searchsorted(self.cuts, (a + b) / 2.0, side="right") - 1, 0, len(self.cuts) - 2)
        at_a, at_b = self.found(piece, a), self.found(piece, b)
        found, proved = np.maximum(at_a, at_b).max(axis=0), np.zeros(2)
        for halvings in range(MOST_HALVINGS + 1):
            bounds = np.maximum(at_a, at_b) + ((b - a) ** 2 / 8.0)[:, None] * self.second(piece, a, b)
            wide = (bounds > np.maximum(found * (1.0 + CLOSE), found + TINY)).any(axis=1)
            wide &= halvings < MOST_HALVINGS and wide.sum() <= MOST_STRETCHES
            proved = np.maximum(proved, bounds[~wide].max(axis=0, initial=0.0))
            if not wide.any():
                break
            piece, a, b, at_a, at_b = (values[wide] for values in (piece, a, b, at_a, at_b))
            middle = (a + b) / 2.0
            at_middle = self.found(piece, middle)
            found = np.maximum(found, at_middle.max(axis=0))
            piece, a, b = np.tile(piece, 2), np.concatenate([a, middle]), np.concatenate([middle, b])
            at_a, at_b = np.concatenate([at_a, at_middle]), np.concatenate([at_middle, at_b])
        return np.asarray(proved + ROUNDING * np.abs(self.coefficients).sum(axis=2).max(axis=(0, 2)))

    def found(self, piece: Index, s: Array) -> Array:
        """Both errors ``(N, 2)`` at lengths of arc in given pieces."""
        exact, w = self.seam.at(s), self._local(piece, s)
        powers = w[:, None] ** np.arange(self.coefficients.shape[2])
        values = np.einsum("nd,ncdj->cnj", powers, self.coefficients[piece])
        return np.asarray(np.linalg.norm(np.stack([exact.position, exact.axis]) - values, axis=2).T)

    def second(self, piece: Index, a: Array, b: Array) -> Array:
        """Largest second derivatives of both errors ``(N, 2)`` [1/m] on stretches of the arc."""
        t = np.sort(np.stack([self.seam.parameter(a), self.seam.parameter(b)]), axis=0)
        t = t + np.array([[-1.0], [1.0]]) * ROUNDING * (1.0 + np.abs(t))
        constants = self.seam.constants(t[0], t[1])
        coefficients = self.coefficients[piece].reshape(len(piece), -1).T
        rate = (2.0 / np.diff(self.cuts)[piece])[None]
        squares = self.tape.enclose(
            (t[:1], t[1:]),
            (constants, constants),
            (self._local(piece, a)[None], self._local(piece, b)[None]),
            (rate, rate),
            (coefficients, coefficients),
        )[0][1]
        return np.sqrt(np.maximum(squares, 0.0)).T

    def _local(self, piece: Index, s: Array) -> Array:
        low, high = self.cuts[piece], self.cuts[piece + 1]
        return np.clip(2.0 * (s - low) / (high - low) - 1.0, -1.0, 1.0)


def _second_differences(formula: Formula, degree: int) -> Tape:
    """Squares of the second derivatives by arc length of seam minus polynomial, of place and axis.

    Its arguments are t, the formula's constants, w, dw/ds and the coefficients of both polynomials.
    """
    w, rate = casadi.SX.sym("w"), casadi.SX.sym("rate")
    coefficients = casadi.SX.sym("p", 6 * (degree + 1))
    speed = casadi.norm_2(casadi.jacobian(formula.position, formula.t))
    outputs = []
    for part, expression in enumerate((formula.position, formula.axis)):
        once = casadi.jacobian(expression, formula.t) / speed
        bend: Any = 0.0
        for power in range(degree, 1, -1):
            first = 3 * (degree + 1) * part + 3 * power
            bend = bend * w + power * (power - 1) * coefficients[first : first + 3]
        outputs.append(casadi.sumsqr(casadi.jacobian(once, formula.t) / speed - rate**2 * bend))
    arguments = [formula.t, formula.constants, w, rate, coefficients]
    return Tape(casadi.Function("second", arguments, [casadi.cse(casadi.vertcat(*outputs))]))
