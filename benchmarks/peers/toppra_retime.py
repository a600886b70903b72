"""TOPP-RA (Pham and Pham, 2018, IEEE T-RO 34(3)): the least time along a path, as the manual of ``toppra`` has it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import toppra
from numpy.typing import NDArray
from toppra import constraint as limit
from toppra.algorithm import TOPPRA

Array = NDArray[np.float64]
SETTINGS = {  # discretisation, intervals of the grid (0: the manual's own proposal), parametrizer
    "interpolation, 1000, constant acceleration": ("Interpolation", 1000, "ParametrizeConstAccel"),
    "interpolation, 100, constant acceleration": ("Interpolation", 100, "ParametrizeConstAccel"),
    "collocation, 1000, constant acceleration": ("Collocation", 1000, "ParametrizeConstAccel"),
    "interpolation, 1000, spline": ("Interpolation", 1000, "ParametrizeSpline"),
    "interpolation, proposed, constant acceleration": ("Interpolation", 0, "ParametrizeConstAccel"),
}
BEST = next(iter(SETTINGS))


def retime(
    knots: Array, points: Array, velocity: Array, acceleration: Array,
    torque: Callable[[Array, Array, Array], Array] | None, effort: Array | None, setting: str = BEST,
) -> tuple[Any, Any, Array]:  # fmt: skip
    """Times a cubic spline.

    Args:
        knots: of the spline ``(m,)``, and ``points`` there ``(m, n)``.
        points: see ``knots``.
        velocity: bounds ``(n, 2)``.
        acceleration: bounds ``(n, 2)``.
        torque: (q, v, a) -> ``(n,)``, with its bounds ``effort`` ``(n, 2)``; None for no such limit.
        effort: see ``torque``.
        setting: one of ``SETTINGS``.

    Returns:
        Trajectory, path, and the grid on it.
    """
    scheme, intervals, parametrizer = SETTINGS[setting]
    path = toppra.SplineInterpolator(knots, points)
    limits: list[Any] = [limit.JointVelocityConstraint(velocity), limit.JointAccelerationConstraint(acceleration)]
    if torque is not None:
        limits.append(limit.JointTorqueConstraint(torque, effort, np.zeros(len(velocity))))
    for each in limits[1:]:
        each.set_discretization_type(limit.DiscretizationType[scheme])
    even = np.linspace(knots[0], knots[-1], intervals + 1)
    if not intervals:
        even = toppra.interpolator.propose_gridpoints(path)
    grid = np.union1d(knots, even)
    grid = grid[np.append(True, np.diff(grid) > 1e-9)]  # a knot that is a grid point to rounding is there once
    grid[-1] = knots[-1]
    solver = TOPPRA(limits, path, gridpoints=grid, parametrizer=parametrizer)
    return solver.compute_trajectory(), path, np.asarray(solver.gridpoints)
