"""Trajectories of other tools as Bezier pieces, exact but for rounding, so that they can be audited."""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
from scipy.interpolate import BPoly, PPoly

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.composition import compose


def of_states(times: Array, states: Array) -> PiecewiseBezier:
    """Taylor polynomials from the state at each knot.

    Args:
        times: knots ``(K + 1,)`` [s].
        states: q, v, a .. up to the derivative that is constant on a piece, ``(K, order + 1, n)``.
    """
    powers = [states[:, order] / factorial(order) for order in range(states.shape[1])]
    return PiecewiseBezier.from_ppoly(PPoly(np.array(powers[::-1]), times))


def of_timed_path(spline: PPoly, times: Array, places: Array, speeds: Array) -> PiecewiseBezier:
    """A cubic spline q(s) run through with constant path acceleration between places.

    Args:
        spline: the path.
        times: when the places are passed ``(K + 1,)`` [s].
        places: along the path ``(K + 1,)``, every knot of the spline among them.
        speeds: there, ``(K + 1,)``.
    """
    control = np.moveaxis(BPoly.from_power_basis(spline).c, 1, 0)  # (segments, 4, n)
    durations, points = np.diff(times), []
    for k, T in enumerate(durations):
        segment = int(np.clip(np.searchsorted(spline.x, places[k] + 1e-9, side="right") - 1, 0, len(control) - 1))
        start, length = spline.x[segment], spline.x[segment + 1] - spline.x[segment]
        law = np.array([places[k], places[k] + 0.5 * speeds[k] * T, places[k + 1]])
        points.append(compose(control[segment], np.clip((law - start) / length, 0.0, 1.0)))
    return PiecewiseBezier(durations, tuple(points))


def of_toppra(found: Any, path: Any) -> PiecewiseBezier:
    """A trajectory of TOPP-RA, of either of its parametrizers."""
    if hasattr(found, "cspl"):
        return PiecewiseBezier.from_ppoly(found.cspl)
    return of_timed_path(path.cspl, found._ts, found._ss, found._velocities)
