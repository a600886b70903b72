"""Ruckig (Berscheid and Kroeger, 2021): least time from rest to rest, bounds up to jerk, as its manual has it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

Array = NDArray[np.float64]
SETTINGS = {"time": Synchronization.Time, "phase": Synchronization.Phase}  # how joints are kept together
BEST = "time"


def move(
    start: Array, goal: Array, velocity: Array, acceleration: Array, jerk: Array, setting: str = BEST
) -> Trajectory:
    """The trajectory between two postures ``(n,)`` under symmetric bounds ``(n,)``."""
    n = len(start)
    asked, found = InputParameter(n), Trajectory(n)
    asked.current_position, asked.target_position = start.tolist(), goal.tolist()
    asked.max_velocity, asked.max_acceleration = velocity.tolist(), acceleration.tolist()
    asked.max_jerk = jerk.tolist()
    asked.synchronization = SETTINGS[setting]
    result = Ruckig(n).calculate(asked, found)
    if result != Result.Working:
        raise RuntimeError(f"Ruckig: {result}")
    return found


def at(found: Trajectory, times: Array, order: int) -> Array:
    """Position, velocity, acceleration or jerk ``(N, n)`` at times ``(N,)`` [s]."""
    if order < 3:
        return np.array([found.at_time(float(t))[order] for t in times])
    jerks = []
    for profile in found.profiles[0]:
        part = np.searchsorted(np.cumsum(profile.t), times, side="right")
        jerks.append(np.array(profile.j)[np.minimum(part, len(profile.j) - 1)])
    return np.stack(jerks, axis=1)


def breaks(found: Trajectory) -> Array:
    """Times [s] at which some joint's jerk changes, with both ends."""
    ends = [np.cumsum([*profile.t]) for section in found.profiles for profile in section]
    times = np.unique(np.concatenate([[0.0, found.duration], *ends]))
    inside = times[(times > 0.0) & (times < found.duration)]
    return np.concatenate([[0.0], inside[np.diff(inside, prepend=0.0) > 1e-9], [found.duration]])
