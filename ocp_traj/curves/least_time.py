"""Shortest times from rest to rest along a straight line, of bounded derivatives: starts of what is optimised."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array

LEAST_PHASE = 1e-2  # of the whole: what a phase that the shortest law has no use for still gets; our choice
JERKS = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])  # of the phases, over the bound


def least_time(distance: ArrayLike, bounds: ArrayLike) -> Array:
    """Time [s] that no rest-to-rest motion of one joint is below, by each derivative's bound alone.

    With a bound b on the m-th derivative it is (2^(m (m + 1) / 2 - 1) d / b)^(1/m), m <= 4.

    Args:
        distance: d ``(...)``, at least 0.
        bounds: of derivatives 1, 2, .. in the last axis ``(..., M)``, infinite where there is none.

    Returns:
        The largest over the derivatives ``(...)``; 0 where nothing is bounded.
    """
    order = np.arange(1, np.shape(bounds)[-1] + 1)
    ratio = 2.0 ** (order * (order + 1) / 2 - 1) * np.asarray(distance, dtype=float)[..., None] / np.asarray(bounds)
    return np.asarray((ratio ** (1.0 / order)).max(axis=-1))


def phases(speed: float, acceleration: float, jerk: float) -> Array:
    """Durations ``(7,)`` [s] of the phases, of constant jerk, of the shortest motion over a unit distance.

    Biagiotti and Melchiorri (2008), Trajectory Planning for Automatic Machines and Robots, sect. 3.4.

    Args:
        speed: finite bound on the first derivative [1/s].
        acceleration: on the second [1/s2].
        jerk: on the third [1/s3].
    """
    if speed * jerk >= acceleration**2:
        rise, whole = acceleration / jerk, acceleration / jerk + speed / acceleration
    else:
        rise = (speed / jerk) ** 0.5
        whole = 2.0 * rise
    even = 1.0 / speed - whole
    if even < 0.0:  # the speed is not reached
        even, rise = 0.0, acceleration / jerk
        whole = rise / 2.0 + ((rise / 2.0) ** 2 + 1.0 / acceleration) ** 0.5
        if whole < 2.0 * rise:  # nor is the acceleration
            rise = (0.5 / jerk) ** (1.0 / 3.0)
            whole = 2.0 * rise
    held = max(whole - 2.0 * rise, 0.0)
    return np.array([rise, held, rise, even, rise, held, rise])


def time_law(speed: float, acceleration: float, jerk: float) -> tuple[Array, Array]:
    """A law s(t) over a unit distance, at rest at both ends, of seven phases within the bounds.

    It is the shortest where that has a use for every phase.

    Args:
        speed: finite bound on the first derivative [1/s].
        acceleration: on the second [1/s2].
        jerk: on the third [1/s3].

    Returns:
        Durations of the phases ``(7,)`` [s], and (s, s', s'') at their ends ``(8, 3)``.
    """
    shortest = phases(speed, acceleration, jerk)
    times = np.maximum(shortest, LEAST_PHASE * shortest.sum())
    states = [np.zeros(3)]
    for h, j in zip(times, JERKS, strict=True):
        s, v, a = states[-1]
        states.append(np.array([s + v * h + a * h**2 / 2.0 + j * h**3 / 6.0, v + a * h + j * h**2 / 2.0, a + j * h]))
    law = np.array(states) / states[-1][0]
    peaks = np.array([law[:, 1].max(), np.abs(law[:, 2]).max(), 1.0 / states[-1][0]])
    slower = float(((peaks / [speed, acceleration, jerk]) ** (1.0 / np.arange(1, 4))).max())
    return times * slower, law / slower ** np.arange(3)
