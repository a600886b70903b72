"""Limits of a robot's actuators: bounds on position, its derivatives and effort, each of them optional."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import RobotDefinitionError

QUANTITIES = ("position", "velocity", "acceleration", "jerk", "snap", "effort")  # the first five by order of derivative
UNLIMITED = 1e300  # [any], pinocchio writes the largest float where a joint has no limit


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Bounds on q, its derivatives and the effort, one entry per actuator; ``None`` is no limit.

    Each field is ``(2, n)`` (lower, upper), or ``(n,)`` for symmetric ones (not the position); infinite entries are
    allowed.  Stored as read-only ``(2, n)`` arrays; with u the actuator's unit (m or rad), in [u], [u/s], [u/s^2],
    [u/s^3], [u/s^4] and [N or N m].
    """

    position: Any = None
    velocity: Any = None
    acceleration: Any = None
    jerk: Any = None
    snap: Any = None
    effort: Any = None

    def __post_init__(self) -> None:
        """Check and store every bound as (2, n)."""
        for name in QUANTITIES:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _bound_pair(name, getattr(self, name)))
        sizes = {name: getattr(self, name).shape[1] for name in QUANTITIES if getattr(self, name) is not None}
        if len(set(sizes.values())) > 1:
            raise RobotDefinitionError(f"limits are of different numbers of joints: {sizes}")

    @property
    def size(self) -> int | None:
        """Number of actuators; ``None`` if nothing is limited."""
        return next((getattr(self, name).shape[1] for name in QUANTITIES if getattr(self, name) is not None), None)

    def bounds(self, quantity: int | str) -> tuple[Array, Array] | None:
        """(lower, upper), each ``(n,)``, of a derivative order 0..4 or a field's name; ``None`` if not limited."""
        name = dict(enumerate(QUANTITIES[:5])).get(quantity) if isinstance(quantity, int) else quantity
        if name not in QUANTITIES:
            raise RobotDefinitionError(f"{quantity!r} has no limits; allowed are 0..4 and {', '.join(QUANTITIES)}")
        pair = getattr(self, name)
        return None if pair is None else (pair[0], pair[1])

    def overridden_by(self, other: "JointLimits | None") -> "JointLimits":
        """These limits, each replaced by the other's where that is given."""
        if other is None:
            return self
        chosen = ((name, getattr(other, name), getattr(self, name)) for name in QUANTITIES)
        return JointLimits(**{name: theirs if theirs is not None else ours for name, theirs, ours in chosen})


def _bound_pair(name: str, value: Any) -> Array:
    """A bound as a read-only (2, n) array, checked."""
    try:
        pair = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise RobotDefinitionError(f"{name} limit is {value!r}, expected numbers of shape (2, n) or (n,)") from None
    if pair.ndim == 1 and name != "position":
        pair = np.stack((-pair, pair))
    if pair.ndim != 2 or pair.shape[0] != 2 or pair.shape[1] == 0:
        allowed = "(2, n)" if name == "position" else "(2, n) or (n,)"
        raise RobotDefinitionError(f"{name} limit has shape {np.shape(value)}, expected {allowed}")
    pair = np.where(np.abs(pair) >= UNLIMITED, np.copysign(np.inf, pair), pair)
    bad = np.flatnonzero(~(pair[0] < pair[1]))
    if bad.size:
        given = pair[:, bad[0]].tolist()
        raise RobotDefinitionError(f"{name} limit of joint {bad[0] + 1} is {given}, expected lower < upper, no NaN")
    pair.flags.writeable = False
    return pair
