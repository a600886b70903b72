"""A seam through given points, from a file or from elsewhere."""

from __future__ import annotations

from io import StringIO
from itertools import pairwise
from math import factorial
from pathlib import Path
from typing import Any, Self

import casadi
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import fixed_quad
from scipy.interpolate import make_interp_spline

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, cut
from ocp_traj.files import read_text
from ocp_traj.paths.seam import NODES, Formula, Placement, SeamPoints, unit

SPLINE = 5  # degree
PARTS = 8  # between two points, whose lengths are integrated by Gauss and Legendre's rule: our choice


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
        self._position = make_interp_spline(chord, place.move(given), k=SPLINE)
        self._axis = make_interp_spline(chord, place.rotate(unit(directions)), k=SPLINE)
        self._edges = np.unique(np.concatenate([np.linspace(a, b, PARTS + 1) for a, b in pairwise(chord)]))
        arcs = [fixed_quad(self._speed, a, b, n=NODES)[0] for a, b in pairwise(self._edges)]
        self._lengths = np.concatenate([[0.0], np.cumsum(arcs)])

    @classmethod
    def read(cls, file: str | Path, place: Placement | None = None) -> Self:
        """From a CSV file with the columns x, y, z [m] and nx, ny, nz, the normal that points out of the seam."""
        path, wanted = Path(file), ["x", "y", "z", "nx", "ny", "nz"]
        text = read_text(path, "seam")
        import pandas as pd  # costs 0.3 s, which problems need not

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

    @property
    def breaks(self) -> Array:
        """Lengths of arc at the points [m], between which the splines are polynomials."""
        return np.asarray(self._lengths[::PARTS])

    @property
    def formula(self) -> Formula:
        """Polynomials of the chords' length, about one such length; constants are that and the coefficients of both."""
        t, constants = casadi.SX.sym("t"), casadi.SX.sym("c", 1 + 6 * (SPLINE + 1))
        parts = casadi.vertsplit(constants[1:], 3)  # of position and axis in turn, highest power first
        position: Any = 0.0
        axis: Any = 0.0
        for power in range(SPLINE + 1):
            position = position * (t - constants[0]) + parts[2 * power]
            axis = axis * (t - constants[0]) + parts[2 * power + 1]
        return Formula(t, constants, position, axis / casadi.norm_2(axis))

    def constants(self, low: Array, high: Array) -> Array:
        """Of the polynomials that hold between two points, about the middle of a stretch ``(1 + 6 x 6, N)``."""
        middle = (low + high) / 2.0
        rows = [
            spline(middle, order).T / factorial(order)
            for order in range(SPLINE, -1, -1)
            for spline in (self._position, self._axis)
        ]
        return np.concatenate([middle[None], *rows])

    def parameter(self, s: ArrayLike) -> Array:
        """Length along the chords ``(N,)`` [m] at lengths of arc ``(N,)`` [m]."""
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
        return np.asarray(base + step)

    def at(self, s: ArrayLike) -> SeamPoints:
        """The seam at lengths of arc ``(N,)`` [m]."""
        t = self.parameter(s)
        return SeamPoints(self._position(t), unit(self._position(t, 1)), unit(self._axis(t)))
