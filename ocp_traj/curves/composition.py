"""Polynomials of polynomials: q(s(u)) of a path and a time law, one Bezier segment of the product of their degrees.

With S_i = C(d, i) s_i the scaled control points of the law and R those of 1 - s, those of a product are a convolution:

    q(s(u)) = sum_i P_i B_i(s(u)),   B_i(s) = C(n, i) s^i (1 - s)^(n - i)   has   C(n, i) S * .. * S * R * .. * R.

Where the law's control points are within [0, 1] all terms are positive, so that nothing cancels. DeRose (1988), ACM
Transactions on Graphics 7(3), has the general case.
"""

from __future__ import annotations

from functools import reduce
from math import comb
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import Points
from ocp_traj.errors import ProblemDefinitionError


def compose(path: ArrayLike, law: Any) -> Points:
    """Control points of q(s(u)), exact but for rounding.

    A law that stays at 0 or 1 with its first or last control points leaves the path's end there without rounding, so
    that rest at an end is exact.

    Args:
        path: control points of q(s) over s in [0, 1], ``(n + 1, dof)`` with n >= 1.
        law: control points of s(u) over u in [0, 1], ``(d + 1,)`` with d >= 1: numbers, or a casadi SX column.

    Returns:
        ``(n d + 1, dof)``, of the law's kind.
    """
    points = np.asarray(path, dtype=float)
    symbolic = isinstance(law, casadi.SX)
    places = casadi.vertsplit(law) if symbolic else list(np.asarray(law, dtype=float).ravel())
    n, d = len(points) - 1, len(places) - 1
    if points.ndim != 2 or n < 1 or d < 1:
        raise ProblemDefinitionError(
            f"a path and a time law need control points of degree 1 or more; got {points.shape} and {len(places)}"
        )
    forward = [comb(d, i) * s for i, s in enumerate(places)]
    backward = [comb(d, i) * (1.0 - s) for i, s in enumerate(places)]
    weights = [
        [
            comb(n, i) / comb(n * d, k) * w
            for k, w in enumerate(_product([forward] * i + [backward] * (n - i), symbolic))
        ]
        for i in range(n + 1)
    ]
    rows = []
    for k in range(n * d + 1):
        # From the nearer end: the weights of the others vanish there without rounding.
        end = 0 if 2 * k <= n * d else n
        others = [i for i in range(n + 1) if i != end]
        rows.append((end, [weights[i][k] for i in others], np.delete(points, end, axis=0) - points[end]))
    if symbolic:
        moved = (casadi.SX(points[end]).T + casadi.mtimes(casadi.horzcat(*w), casadi.SX(way)) for end, w, way in rows)
        return casadi.vertcat(*moved)
    return np.array([points[end] + np.array(w) @ way for end, w, way in rows])


def _product(factors: list[list[Any]], symbolic: bool) -> list[Any]:
    """Scaled control points of a product of polynomials."""
    return reduce(_convolve if symbolic else _convolve_numbers, factors)


def _convolve_numbers(a: list[Any], b: list[Any]) -> list[Any]:
    product: Array = np.convolve(a, b)
    return list(product)


def _convolve(a: list[Any], b: list[Any]) -> list[Any]:
    return [
        sum((a[i] * b[k - i] for i in range(max(0, k - len(b) + 1), min(k, len(a) - 1) + 1)), casadi.SX(0.0))
        for k in range(len(a) + len(b) - 1)
    ]
