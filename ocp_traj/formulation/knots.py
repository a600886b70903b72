"""Knots of a curve of Hermite segments: which of their states, and of the durations, are decision variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
from scipy.interpolate import CubicSpline

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import hermite
from ocp_traj.curves.least_time import least_time, time_law
from ocp_traj.curves.rounded import Rounded
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.problem import Variable
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.formulation.stretches import Stretch
from ocp_traj.robot.joint_limits import QUANTITIES, JointLimits

PHASES = 7  # of constant jerk, of a shortest motion from rest to rest: that many pieces may hold it exactly
NEAR = "near"  # id of the limit that inner via points are passed within a tolerance
SHORTEST, LONGEST = 1e-3, 1e2  # bounds of durations, of the guessed ones: our choice, far from any optimum met
# Random starts are so many times slower than a shortest motion from rest to rest along a straight line: our choice.
SLOWER, SLOWER_ALONE = (1.0, 1.4), (1.0, 1.02)  # through via points, and where there are none


def least_times(points: Array, limits: JointLimits) -> Array:
    """What each leg between via points ``(L + 1, n)`` takes at least from rest to rest ``(L,)`` [s].

    No derivative's bound allows less; where nothing is limited, one unit a second. A leg that goes nowhere, or hardly,
    is given a tenth of the longest.
    """
    steps = np.abs(np.diff(points, axis=0))
    bounds = [limits.bounds(order) for order in range(1, 5)]
    reach = np.array([np.full(steps.shape[1], np.inf) if b is None else np.minimum(-b[0], b[1]) for b in bounds]).T
    found = least_time(steps, reach).max(axis=1)
    found = np.where(found > 0.0, found, steps.max(axis=1))
    return np.asarray(np.maximum(found, 0.1 * (found.max() or 1.0)))


# (first and last via point from one stop to the next, generator) -> a motion between them, or None where none is known.
Ways = Callable[[int, int, np.random.Generator], Rounded | None]


@dataclass(frozen=True, eq=False)
class Knots:
    """Knots, their states and the segments between them, and which of them are variables.

    Attributes:
        points ``(L + 1, n)``, limits, pieces, even, rest, stops, dwells, joints, units, stretches: as of
            ``knot_states``.
        tolerance: by which each via point may be missed ``(L + 1, n)``.
        rows: q and its derivatives at a knot.
        given: derivatives ``(k, n)`` at the first (0) and last (-1) knot.
    """

    points: Array
    limits: JointLimits
    rows: int
    pieces: int
    even: bool
    rest: int
    stops: frozenset[int]
    dwells: Mapping[int, float]
    tolerance: Array
    given: Mapping[int, Array]
    joints: tuple[str, ...]
    units: tuple[str, ...]
    stretches: tuple[Stretch, ...] = ()

    @cached_property
    def via(self) -> tuple[int, ...]:
        """The knot at which each via point is reached."""
        waits = np.cumsum([0, *(i in self.dwells for i in range(len(self.points) - 1))])
        return tuple(int(i * self.pieces + waits[i]) for i in range(len(self.points)))

    @cached_property
    def legs(self) -> tuple[range, ...]:
        """The segments of each leg, dwells left out."""
        return tuple(range(k - self.pieces, k) for k in self.via[1:])

    @cached_property
    def durations_at(self) -> Index:
        """Of each segment, which duration is its own ``(K,)``; -1 for a dwell."""
        found = np.full(self.via[-1], -1)
        for i, leg in enumerate(self.legs):
            found[list(leg)] = i if self.even else i * self.pieces + np.arange(self.pieces)
        return found

    @cached_property
    def waits(self) -> Array:
        """Seconds of each segment that is a dwell ``(K,)``, else 0."""
        found = np.zeros(self.via[-1])
        for i, seconds in self.dwells.items():
            found[self.via[i]] = seconds
        return found

    @cached_property
    def times(self) -> int:
        """Number of durations that are variables."""
        return len(self.legs) * (1 if self.even else self.pieces)

    @cached_property
    def least(self) -> Array:
        """What each leg takes at least from rest to rest, of a stretch what it takes in the start ``(L,)`` [s]."""
        found = least_times(self.points, self.limits)
        for stretch in self.stretches:
            found[stretch.first : stretch.first + len(stretch.times)] = stretch.times
        return found

    @cached_property
    def unit(self) -> float:
        """A time near the pieces' [s]: the k-th derivative is a variable times its k-th power."""
        return float(np.median(self.least)) * (1.0 if self.pieces == 1 else 0.5)

    @cached_property
    def places(self) -> tuple[Index, Array]:
        """Which variable each entry of the states is, -1 for none, and the value of those that are none.

        Both ``(K + 1, rows, n)``.
        """
        count, n = self.via[-1] + 1, len(self.joints)
        free, fixed = np.ones((count, self.rows, n), dtype=bool), np.zeros((count, self.rows, n))
        twins = {}
        for i, k in enumerate(self.via):
            free[k, 0] = self.tolerance[i] > 0.0
            fixed[k, 0] = self.points[i]
            if i in self.dwells:
                free[k, 1:] = free[k + 1] = False
                fixed[k + 1, 0] = self.points[i]
                twins[k + 1] = k
            elif i in self.stops:
                free[k, 1 : self.rest + 1] = False
        for k, rows in self.given.items():
            free[k, 1 : len(rows) + 1] = False
            fixed[k, 1 : len(rows) + 1] = rows
        index = np.full(free.shape, -1)
        number = self.times
        for order, joints in self.blocks:
            own = np.zeros_like(free)
            own[:, order, joints] = free[:, order, joints]
            index[own] = number + np.arange(own.sum())
            number += int(own.sum())
        for k, twin in twins.items():
            index[k, 0] = index[twin, 0]
        return index, np.where(index < 0, fixed, 0.0)

    @cached_property
    def blocks(self) -> list[tuple[int, list[int]]]:
        """Order and joints of each block of variables: joints of one unit together."""
        kinds = dict.fromkeys(self.units)
        return [
            (order, [j for j, u in enumerate(self.units) if u == kind]) for order in range(self.rows) for kind in kinds
        ]

    @cached_property
    def first(self) -> tuple[Index, Index, Index, Index]:
        """Of each variable that is part of a state, in order: itself, its knot, order and joint."""
        index, _ = self.places
        knot, order, joint = np.nonzero(index >= 0)
        variable, which = np.unique(index[knot, order, joint], return_index=True)
        return variable, knot[which], order[which], joint[which]

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """The blocks."""
        guessed = self.spread(self.least)
        names = [f"T{k + 1}" for k in range(self.times)]
        found = [Variable("T", SHORTEST * guessed, LONGEST * guessed, "s", tuple(names))]
        lower, upper = self.bounds
        _, knot, order, joint = self.first
        several = len(set(self.units)) > 1
        for k, joints in self.blocks:
            own = np.flatnonzero((order == k) & np.isin(joint, joints))
            if len(own):
                unit = self.units[joints[0]]
                labels = tuple(f"{ORDERS[k]}{knot[i]} {self.joints[joint[i]]}" for i in own)
                name = f"{ORDERS[k]} [{unit}]" if several else ORDERS[k]
                limits = tuple(self._bounded_by(int(knot[i]), k, int(joint[i])) for i in own)
                found.append(Variable(name, lower[own], upper[own], unit, labels, bounded_by=limits))
        return tuple(found)

    def _bounded_by(self, knot: int, order: int, joint: int) -> tuple[str, str]:
        """The limit that bounds a variable: at a via point the distance by which it may be missed."""
        near = order == 0 and knot in self.via
        return (NEAR if near else f"{QUANTITIES[order]}-limit"), self.joints[joint]

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the variables that are part of states: of limits, and of via points within a tolerance."""
        _, knot, order, joint = self.first
        low, high = np.full(len(knot), -np.inf), np.full(len(knot), np.inf)
        for k in range(self.rows):
            pair = self.limits.bounds(k)
            if pair is not None:
                own = order == k
                low[own], high[own] = pair[0][joint[own]] * self.unit**k, pair[1][joint[own]] * self.unit**k
        point = np.full(self.via[-1] + 1, -1)
        point[list(self.via)] = np.arange(len(self.points))
        held = (order == 0) & (point[knot] >= 0)
        middle, room = (table[point[knot[held]], joint[held]] for table in (self.points, self.tolerance))
        low[held], high[held] = np.maximum(low[held], middle - room), np.minimum(high[held], middle + room)
        return low, high

    def spread(self, legs: Array) -> Array:
        """Durations of the variables ``(times,)`` of those of legs ``(L,)``."""
        return legs if self.even else np.repeat(legs / self.pieces, self.pieces)

    def durations(self, x: Any) -> Any:
        """Durations of the segments ``(K,)``, of numbers or symbols."""
        index, moves = self.durations_at, self.durations_at >= 0
        share = 1.0 / self.pieces if self.even else 1.0
        if isinstance(x, casadi.SX):
            symbols = casadi.SX(self.waits)
            symbols[np.flatnonzero(moves).tolist()] = x[index[moves].tolist()] * share
            return symbols
        found = self.waits.copy()
        found[moves] = x[index[moves]] * share
        return found

    def duration(self, x: Any) -> Any:
        """Total time [s]."""
        moving = casadi.sum1(x[: self.times]) if isinstance(x, casadi.SX | casadi.MX) else x[: self.times].sum()
        return moving + float(self.waits.sum())

    def curve(self, x: Any) -> PiecewiseBezier:
        """The curve."""
        index, fixed = self.places
        moves = index >= 0
        scale = self.unit ** -np.arange(self.rows, dtype=float)
        each = np.broadcast_to(scale[None, :, None], index.shape)[moves]
        if not isinstance(x, casadi.SX):
            x = np.asarray(x, dtype=float)
            states = fixed.copy()
            states[moves] = x[index[moves]] * each
            return hermite(list(states), self.durations(x))
        flat = casadi.SX(casadi.sparsify(casadi.DM(fixed.ravel())))
        if moves.any():
            flat[np.flatnonzero(moves.ravel()).tolist()] = x[index[moves].tolist()] * casadi.DM(each)
        n = len(self.joints)
        table = casadi.reshape(flat, n, -1).T  # a row a knot and order
        return hermite([table[k * self.rows : (k + 1) * self.rows, :] for k in range(len(index))], self.durations(x))

    def variables_of(self, curve: PiecewiseBezier) -> Array:
        """The decision vector of a numeric curve of this shape."""
        if curve.segments != self.via[-1] or curve.dof != len(self.joints):
            raise ProblemDefinitionError(
                f"a curve of {curve.segments} segments and {curve.dof} joints was given; "
                f"it has to have {self.via[-1]} and {len(self.joints)}"
            )
        ends = [(k, 0.0) for k in range(curve.segments)] + [(curve.segments - 1, 1.0)]
        states = np.array([[curve.hodograph(k, order)[-int(u)] for order in range(self.rows)] for k, u in ends])
        return self.packed(np.asarray(curve.durations, dtype=float), states)

    def packed(self, durations: Array, states: Array) -> Array:
        """The decision vector of durations ``(K,)`` and states ``(K + 1, rows, n)``."""
        variable, knot, order, joint = self.first
        x = np.zeros(self.times + len(variable))
        np.add.at(x, self.durations_at[self.durations_at >= 0], durations[self.durations_at >= 0])
        x[variable] = states[knot, order, joint] * self.unit**order
        return x

    def dilate(self, x: Array, factor: float) -> Array:
        """The decision vector of the same path, ``factor`` times slower; dwells last what they last."""
        variable, _, order, _ = self.first
        slower = np.array(x, dtype=float)
        slower[: self.times] *= factor
        slower[variable] /= factor ** order.astype(float)
        return slower

    def guess(self, rng: np.random.Generator, ways: Ways | None = None) -> Array:
        """A start within the bounds, a little slower than a shortest motion with stops.

        From stop to stop it is a cubic spline through the via points between; where there are none, straight; along
        stretches as they are. Where ``ways`` know a motion it is that in its place.
        """
        durations, states = self.waits.copy(), self.places[1].copy()
        given = {stretch.first: stretch for stretch in self.stretches}
        ends = {i for s in self.stretches for i in (s.first, s.first + len(s.times))}
        halts = sorted({0, *self.stops, *self.dwells, *ends, len(self.legs)})
        for begin, end in pairwise(halts):
            if begin in given:
                own = rng.uniform(*SLOWER_ALONE)
                self._along(given[begin], 1.0 if given[begin].even else own, durations, states)
                continue
            alone = end == begin + 1
            slower = rng.uniform(*(SLOWER_ALONE if alone else SLOWER), size=end - begin)
            if alone:
                self._straight(begin, float(slower[0]), durations, states)
            else:
                self._smooth(begin, self.least[begin:end] * slower, durations, states)
            motion = None if ways is None else ways(begin, end, rng)
            if motion is not None:
                self._follow(begin, motion, durations, states)
        lower, upper = (np.concatenate([getattr(v, side) for v in self.variables]) for side in ("lower", "upper"))
        return np.clip(self.packed(durations, states), lower, upper)

    def _straight(self, i: int, slower: float, durations: Array, states: Array) -> None:
        """Puts a leg along a straight line, by its shortest law made slower, into durations and states."""
        step, leg, (times, law) = self.points[i + 1] - self.points[i], self.legs[i], self.law(i)
        durations[list(leg)] = times * slower
        states[leg.start + 1 : leg.stop, 0] = self.points[i] + law[1:-1, :1] * step
        for order in (1, 2):
            states[leg.start + 1 : leg.stop, order] = law[1:-1, order : order + 1] * step / slower**order

    def _smooth(self, i: int, times: Array, durations: Array, states: Array) -> None:
        """Puts legs of given times, along a cubic spline from leg i on, into durations and states."""
        legs, ends = self.legs[i : i + len(times)], np.append(0.0, np.cumsum(times))
        first, last = legs[0].start, legs[-1].stop
        spline = CubicSpline(
            ends, self.points[i : i + len(ends)], bc_type=((1, states[first, 1]), (1, states[last, 1]))
        )
        durations[first:last] = np.repeat(times / self.pieces, self.pieces)
        inner = np.append(0.0, np.cumsum(durations[first:last]))[1:-1]
        for order in range(3):
            states[first + 1 : last, order] = spline(inner, order)

    def _along(self, stretch: Stretch, slower: float, durations: Array, states: Array) -> None:
        """Puts the legs of a stretch, made slower, into durations and states."""
        legs = self.legs[stretch.first : stretch.first + len(stretch.times)]
        first, last = legs[0].start, legs[-1].stop
        durations[first:last] = np.repeat(stretch.times * slower / self.pieces, self.pieces)
        inner = np.append(0.0, np.cumsum(durations[first:last]))[:-1]
        found = stretch.states(inner / slower)
        states[[first, last], 0] = self.points[[stretch.first, stretch.first + len(legs)]]
        for order in range(3):
            states[first + 1 : last, order] = found[order, 1:] / slower**order

    def _follow(self, i: int, motion: Rounded, durations: Array, states: Array) -> None:
        """Puts legs from leg i on along a motion, into durations and states."""
        times = np.diff(motion.passed)
        first, last = self.legs[i].start, self.legs[i + len(times) - 1].stop
        durations[first:last] = np.repeat(times / self.pieces, self.pieces)
        inner = np.append(0.0, np.cumsum(durations[first:last]))[1:-1]
        states[first + 1 : last, :3] = motion.at(inner)

    def law(self, leg: int) -> tuple[Array, Array]:
        """Durations ``(pieces,)`` [s] of a leg's pieces, and (s, s', s'') at their ends ``(pieces + 1, 3)``.

        The shortest law of seven phases from rest to rest along the straight line, where no joint is beyond its limits.
        """
        step, least = np.abs(self.points[leg + 1] - self.points[leg]), float(self.least[leg])
        bounds = []
        for order, usual in ((1, 4.0), (2, 16.0), (3, 128.0)):  # usual: far from binding; where there is no limit
            pair = self.limits.bounds(order)
            reach = np.full(len(step), np.inf) if pair is None else np.minimum(-pair[0], pair[1])
            lowest = float((reach / np.maximum(step, 1e-12)).min())
            bounds.append(min(lowest, usual / least**order))
        phases, states = time_law(*bounds)
        if self.pieces == PHASES and not self.even:
            return phases, states
        knots = np.append(0.0, np.cumsum(phases))
        u = np.linspace(0.0, 1.0, self.pieces + 1)
        curve = hermite([state[:, None] for state in states], phases)
        return np.diff(u) * knots[-1], np.hstack([curve(u * knots[-1], order) for order in range(3)])
