"""A first time law along a path: speeds at knots from what limits allow there, and from knot to knot."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.robot.joint_limits import JointLimits

SHARE = 0.6  # of what limits allow: our choice; what is left is for the other terms of accelerations and jerks
SAMPLES = np.linspace(0.0, 1.0, 5)  # of an arc


def first_law(arcs: PiecewiseBezier, limits: JointLimits, moving: tuple[bool, bool]) -> tuple[Array, Array]:
    """Durations ``(K,)`` [s], and s' at knots ``(K + 1,)``, of a law near the limits, but not sure to be within them.

    Speeds are within what velocity, curvature and its change allow; from knot to knot they change no faster than
    accelerations allow, and, as from rest, jerks. There is one sweep forward and one back, as in Pham and Pham (2018).

    Args:
        arcs: of the path, between the knots; ``durations`` are the steps of s.
        limits: of the joints.
        moving: whether s' is not zero at the start and at the end.
    """
    count, step = arcs.segments, arcs.durations
    slopes = [np.array([np.abs(arcs.at(k, SAMPLES, order)).max(axis=0) for k in range(count)]) for order in range(1, 4)]
    reach = []
    for order in range(1, 4):
        pair = limits.bounds(order)
        reach.append(np.full(arcs.dof, np.inf) if pair is None else np.minimum(-pair[0], pair[1]))
    with np.errstate(divide="ignore"):
        caps = [(SHARE * reach[m] / slopes[m]).min(axis=1) ** (1 / (m + 1)) for m in range(3)]
        gains = (SHARE * reach[1] / slopes[0]).min(axis=1)
        jerks = (reach[2] / slopes[0]).min(axis=1)
    cap = np.min(caps, axis=0)
    cap = np.where(np.isfinite(cap), cap, step.sum())  # all of it in a second, where nothing is limited
    # A jerk j takes an arc of length h from rest to a speed whose square over 2 h is 1.36 (j^2 h)^(1/3).
    gains = np.minimum(np.where(np.isfinite(gains), gains, cap**2 / step), 1.36 * (jerks**2 * step) ** (1 / 3))
    square = np.concatenate([cap[:1], np.minimum(cap[1:], cap[:-1]), cap[-1:]]) ** 2
    square[[0, -1]] *= moving
    for k in range(count):
        square[k + 1] = min(square[k + 1], square[k] + 2.0 * gains[k] * step[k])
    for k in reversed(range(count)):
        square[k] = min(square[k], square[k + 1] + 2.0 * gains[k] * step[k])
    speed = np.sqrt(square)
    # One arc from rest to rest has no speed at its ends; in its middle it would have what is gained over half of it.
    middle = np.where(speed[1:] + speed[:-1] > 0.0, 0.0, np.minimum(np.sqrt(gains * step), cap))
    return 2.0 * step / (speed[1:] + speed[:-1] + middle), speed
