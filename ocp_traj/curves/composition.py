"""Polynomials of polynomials: q(s(u)) of a path and a time law, one Bezier segment of the product of their degrees.

With S_i = C(d, i) s_i the scaled control points of the law and R those of 1 - s, those of a product are a convolution:

    q(s(u)) = sum_i P_i B_i(s(u)),   B_i(s) = C(n, i) s^i (1 - s)^(n - i)   has   C(n, i) S * .. * S * R * .. * R.

Where the law's control points are within [0, 1] all terms are positive, so that nothing cancels. DeRose (1988), ACM
Transactions on Graphics 7(3), has the general case.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

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
    places = law if symbolic else np.asarray(law, dtype=float).ravel()
    n, d = len(points) - 1, places.shape[0] - 1
    if points.ndim != 2 or n < 1 or d < 1:
        raise ProblemDefinitionError(
            f"a path and a time law need control points of degree 1 or more; got {points.shape} and {places.shape}"
        )
    (found,) = _composition(n, d, points.shape[1]).call([casadi.SX(points) if symbolic else points, places])
    return found if symbolic else np.array(found)


@lru_cache(maxsize=64)
def _composition(n: int, d: int, dof: int) -> Any:
    """Control points of a path ``(n + 1, dof)`` and of a law ``(d + 1,)`` to those of their composition."""
    points, law = casadi.SX.sym("p", n + 1, dof), casadi.SX.sym("s", d + 1)
    forward = [comb(d, i) * s for i, s in enumerate(casadi.vertsplit(law))]
    backward = [comb(d, i) * (1.0 - s) for i, s in enumerate(casadi.vertsplit(law))]
    powers: list[tuple[list[Any], list[Any]]] = [([casadi.SX(1.0)], [casadi.SX(1.0)])]
    for _ in range(n):
        powers.append((_convolve(powers[-1][0], forward), _convolve(powers[-1][1], backward)))
    weights = [[comb(n, i) * w for w in _convolve(powers[i][0], powers[n - i][1])] for i in range(n + 1)]
    rows = []
    for k in range(n * d + 1):
        end = 0 if 2 * k <= n * d else n  # from the nearer end: the others' weights vanish there without rounding
        others = [i for i in range(n + 1) if i != end]
        own = casadi.horzcat(*(weights[i][k] for i in others)) / comb(n * d, k)
        rows.append(
            points[end, :] + casadi.mtimes(own, casadi.vertcat(*(points[i, :] - points[end, :] for i in others)))
        )
    return casadi.Function("composition", [points, law], [casadi.vertcat(*rows)])


def _convolve(a: list[Any], b: list[Any]) -> list[Any]:
    """Scaled control points of the product of two polynomials of given ones."""
    return [
        sum((a[i] * b[k - i] for i in range(max(0, k - len(b) + 1), min(k, len(a) - 1) + 1)), casadi.SX(0.0))
        for k in range(len(a) + len(b) - 1)
    ]
