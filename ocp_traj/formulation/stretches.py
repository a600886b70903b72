"""Starts along tool paths: postures from inverse kinematics, timed from rest to rest within the limits.

With q(s), s from 0 to 1 over a stretch without corners, and a law s(t) of bounded derivatives V, A, J,

    |q'| V <= v,   |q''| V^2 + |q'| A <= a,   |q'''| V^3 + 3 |q''| V A + |q'| J <= j

hold each limit; each term gets an even share of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import make_interp_spline

from ocp_traj.arrays import Array
from ocp_traj.curves.families import hermite
from ocp_traj.curves.least_time import time_law
from ocp_traj.formulation.tool_moves import ROWS, ToolMove
from ocp_traj.paths.cartesian import Section
from ocp_traj.robot.joint_limits import JointLimits

INSIDE = 0.95  # of a limit on the tool's speed: our choice, as all that follow
FINE = 400  # places along a stretch where limits are looked at
USUAL = (1.0, 4.0, 40.0)  # [1/s, 1/s2, 1/s3] of the law, of a stretch that nothing limits
NEAR = 1e-4  # of a stretch, that a line goes on into what rounds its corner
RAMP = 0.9  # of the run-up, in which a constant speed is reached


@dataclass(frozen=True, eq=False)
class Stretch:
    """A start along some legs, at rest at both ends.

    Attributes:
        first: number of the first leg, counted from 0.
        times: of its legs ``(legs,)`` [s].
        states: instants from its beginning ``(N,)`` [s] -> q, v and a ``(3, N, n)``.
        even: whether its speed is given, so that no start is slower.
    """

    first: int
    times: Array
    states: Callable[[Array], Array]
    even: bool = False


def stretches_of(first: int, move: ToolMove, limits: JointLimits, tool_speed: float | None) -> list[Stretch]:
    """The starts along a tool path: one from corner to corner.

    Args:
        first: number of its first leg.
        move: along the path.
        limits: of the joints.
        tool_speed: bound on the tool's speed [m/s].
    """
    legs, path = move.legs, move.path
    begins = [float(path.ends[k]) for k in path.corners]
    edges = [leg.before + leg.low for leg in legs] + [path.length]
    bounds = [int(np.argmin(np.abs(np.array(edges) - s))) for s in (*begins, path.length)]
    return [
        _stretch(first, move, low, high, np.array(edges[low : high + 1]), limits, tool_speed)
        for low, high in zip(bounds, bounds[1:], strict=False)
    ]


@dataclass(frozen=True, eq=False)
class _Joined:
    """Splines one after the other, a section each: where a line goes on as an arc, postures have a kink in q''."""

    begins: Array
    splines: tuple[Callable[[Array, int], Array], ...]

    @classmethod
    def of(cls, s: Array, postures: Array, sections: Sequence[Section]) -> _Joined:
        """Through postures at places ``s``, ``ROWS`` a leg, whose sections are given."""
        firsts = [i for i in range(len(sections)) if i == 0 or sections[i] is not sections[i - 1]]
        rows = [slice(a * ROWS, b * ROWS + 1) for a, b in pairwise([*firsts, len(sections)])]
        splines = tuple(make_interp_spline(s[own], postures[own], k=5) for own in rows)
        begins = np.array([s[own.start] for own in rows])
        # A knot between a line and what rounds a corner has the line's q'', since it has to keep to the line.
        for k, i in enumerate(firsts):
            begins[k] += 0.0 if sections[i].ball is None else NEAR
            begins[k] -= NEAR if k and sections[i - 1].ball is not None else 0.0
        return cls(begins, splines)

    def __call__(self, places: Array, order: int = 0) -> Array:
        """The derivative of an order at places ``(N,)``, ``(N, n)``."""
        which = np.maximum(np.searchsorted(self.begins, places, side="right") - 1, 0)
        found = np.asarray(self.splines[0](places, order))
        for k in range(1, len(self.splines)):
            found[which == k] = self.splines[k](places[which == k], order)
        return found


def _stretch(
    first: int, move: ToolMove, low: int, high: int, edges: Array, limits: JointLimits, tool_speed: float | None
) -> Stretch:
    """The start along the legs ``low`` to ``high - 1`` of a move, between the lengths of path ``edges``."""
    length = float(edges[-1] - edges[0])
    rows = slice(low * ROWS, high * ROWS + 1)
    s = (move.places[rows] - edges[0]) / length
    spline = _Joined.of(s, move.postures[rows], [leg.section for leg in move.legs[low:high]])
    law = _law(spline, length, move, limits, tool_speed)
    phases, states = time_law(*law)
    ends, curve = float(phases.sum()), hermite([state[:, None] for state in states], phases)
    fine = np.linspace(0.0, ends, 20 * FINE)
    progress = np.asarray(curve(fine))[:, 0]
    at = np.interp((edges - edges[0]) / length, np.maximum.accumulate(progress), fine)
    at[[0, -1]] = 0.0, ends

    def along(t: Array) -> Array:
        p, rate, rate2 = (np.asarray(curve(np.clip(t, 0.0, ends), order)) for order in range(3))
        q, slope, bend = (spline(np.clip(p[:, 0], 0.0, 1.0), order) for order in range(3))
        return np.stack([q, slope * rate, bend * rate**2 + slope * rate2])

    return Stretch(first + low, np.diff(at), along, move.speed is not None)


def _law(
    spline: Callable[..., Array], length: float, move: ToolMove, limits: JointLimits, tool_speed: float | None
) -> tuple[float, float, float]:
    """Bounds on the derivatives of a law over a unit of path, or what a constant speed asks for."""
    if move.speed is not None:
        speed, _, run_up = move.speed
        v = speed / length
        ramp = 2.0 * RAMP * run_up / speed  # [s], at the mean of no speed and the whole
        return v, 2.0 * v / ramp, 4.0 * v / ramp**2
    places = np.linspace(0.0, 1.0, FINE)
    slopes = [np.abs(spline(places, order)) for order in (1, 2, 3)]
    reach = []
    for order in (1, 2, 3):
        pair = limits.bounds(order)
        reach.append(np.full(slopes[0].shape[1], np.inf) if pair is None else np.minimum(-pair[0], pair[1]))

    def least(bound: Array, size: Array) -> float:
        return float((bound / np.maximum(size, 1e-12)).min())

    v = min(USUAL[0] * 10.0, least(reach[0], slopes[0]))
    v = min(v, least(reach[1] / 2.0, slopes[1]) ** 0.5, least(reach[2] / 3.0, slopes[2]) ** (1.0 / 3.0))
    if tool_speed is not None:
        v = min(v, INSIDE * tool_speed / length)
    a = min(USUAL[1] * 10.0, least(reach[1] / 2.0, slopes[0]), least(reach[2] / 9.0, slopes[1]) / v)
    j = min(USUAL[2] * 10.0, least(reach[2] / 3.0, slopes[0]))
    return v, a, j
