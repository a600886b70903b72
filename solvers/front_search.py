"""Boxes of ratios of durations, and the curve that no trajectory of each lies below, in the plane of two objectives.

Durations x = T w(z), w = (1, z) / (1 + sum z), move along one path for every T. Where both objectives scale with time,
f_i(x) = T^d_i c_i(w), d_1 > 0 >= d_2, a motion of ratios z in a box, which takes T >= T_low and has c_i >= c_i,low, has

    f_1 >= c_1,low T_low^d_1    and    f_2 >= c_2,low (f_1 / c_1,low)^(d_2 / d_1) >= c_2,low T_high^d_2:

a curve for the box, whatever T is. All boxes share the exponent, and the lower envelope of their curves is a lower
bound of the whole front at once. Boxes are cut where their curves leave most room below what the boxes' middles reach.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.interval.tape import Tape
from ocp_traj.solvers.duration_rows import DOWN, ScalingRows
from ocp_traj.solvers.interval_forms import mean_value
from ocp_traj.solvers.ratio_search import all_ratios, halves
from ocp_traj.transcription.time_degrees import is_total_time, scalar_function, time_degree

CELLS = 2000  # of the first objective's range, in each of which the bound is one number: our choice
BATCH = 256  # boxes cut in one pass: our choice
EVEN = 0.1  # weight of the mean relative height of what is left below the front: our choice
TINY = 1e-6  # of the reference: the least that a height is relative to; our choice


@dataclass(frozen=True)
class Curves:
    """Of each box, the curve max(level f_1^exponent, floor) for f_1 >= start ``(N,)`` each."""

    start: Array
    level: Array
    floor: Array

    def select(self, chosen: NDArray[Any]) -> Curves:
        """Those of some boxes."""
        return Curves(self.start[chosen], self.level[chosen], self.floor[chosen])

    def at_least(self, other: Curves) -> Curves:
        """The higher of two curves of each box."""
        return self._with(other, lambda a, b: np.maximum(a, b))

    def joined(self, other: Curves) -> Curves:
        """Those of some boxes and of others."""
        return self._with(other, lambda a, b: np.concatenate([a, b]))

    def _with(self, other: Curves, made: Callable[[Array, Array], Array]) -> Curves:
        return Curves(made(self.start, other.start), made(self.level, other.level), made(self.floor, other.floor))


class FrontRows:
    """The objectives' factors c_1, c_2 over ratios, beside the rows of the limits that scale.

    Args:
        problem: whose path is of ratios.
        names: of the objective that grows with time, and of the one that does not.
    """

    def __init__(self, problem: Problem, names: tuple[str, str]) -> None:
        self.names = names
        self.limits: ScalingRows = problem.cached("branch and bound rows", lambda: ScalingRows(problem))
        found = [time_degree(problem, name) for name in names]
        assert found[0] is not None and found[1] is not None
        self.degrees: tuple[Fraction, Fraction] = (found[0], found[1])
        self.exponent = self.degrees[1] / self.degrees[0]
        self.factors = [None if is_total_time(problem, name) else _factor(problem, name) for name in names]

    def over(self, low: Array, high: Array) -> tuple[Curves, Curves]:
        """What no motion of boxes ``(N, n - 1)`` is below, and what those of their middles are on, not rounded."""
        box, centre = (low.T, high.T), np.clip(0.5 * (low + high), low, high).T
        u = self.limits.peaks(centre)
        least, most = self.limits.times_over(box, centre, u)
        bounds = [np.ones(len(low)) if f is None else mean_value(*f, box, centre)[0][0] for f in self.factors]
        times = self.limits.times(self.limits.value.evaluate(centre, u)[0]).max(axis=0)
        floor, ceiling = self.limits.times_over((centre, centre), centre, u)
        values = [np.ones(len(low)) if f is None else f[0].evaluate(centre)[0][0] for f in self.factors]
        reached = self._curves(np.maximum(times, floor), ceiling, values)
        return self._curves(least, most, bounds), reached

    def _curves(self, least: Array, most: Array, factors: list[Array]) -> Curves:
        """Curves of boxes with times and factors; none, which is infinite, where the times contradict each other."""
        first, second = (np.nan_to_num(factor, nan=-np.inf) for factor in factors)
        rise, fall = self.degrees
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            known = first > 0.0
            start = np.where(known, first * power_below(least, rise) * DOWN, -np.inf)
            sloped = known & (second > 0.0)
            level = np.where(sloped, second * power_below(np.where(known, first, 1.0), -self.exponent) * DOWN, 0.0)
            # A factor below zero is worst where time is least: the other way round.
            floor = np.where(second > 0.0, second * power_below(most, fall), second * power_above(least, fall))
            floor = np.where(second > 0.0, floor * DOWN, floor / DOWN)
            level = np.where(second > 0.0, level, -np.inf)
        none = least > most
        infinite = np.full(len(least), np.inf)
        return Curves(*(np.where(none, infinite, value) for value in (start, level, floor)))


def _factor(problem: Problem, name: str) -> tuple[Tape, Tape]:
    """Tapes z -> c and z -> dc/dz of an objective at durations of one second in all."""
    z = casadi.SX.sym("z", problem.size - 1)
    value = scalar_function(problem, name)(casadi.vertcat(1.0, z) / (1.0 + casadi.sum1(z)))
    slopes = casadi.vec(casadi.densify(casadi.jacobian(value, z)))
    return (
        Tape(casadi.Function("factor", [z], [casadi.cse(casadi.densify(value))])),
        Tape(casadi.Function("slopes", [z], [casadi.cse(slopes)])),
    )


def power_below(base: Array, exponent: Fraction) -> Array:
    """Lower bounds of powers of numbers above zero."""
    return np.minimum(*_powers(base, exponent)) * DOWN


def power_above(base: Array, exponent: Fraction) -> Array:
    """Upper bounds of powers of numbers above zero."""
    return np.maximum(*_powers(base, exponent)) / DOWN


def _powers(base: Array, exponent: Fraction) -> tuple[Array, Array]:
    """Powers with the floats on both sides of an exponent, each up to 4 units in the last place off."""
    near = float(exponent)
    ends = (near, near) if Fraction(near) == exponent else (np.nextafter(near, -np.inf), np.nextafter(near, np.inf))
    return np.power(base, ends[0]), np.power(base, ends[1])


class FrontSearch:
    """Open boxes with their curves, the envelope of those that are closed, and what middles of boxes reach.

    The range of the first objective is divided into cells. What is looked for is a bound of the second in each; of a
    box, the one at the cell's end holds in all of it.

    Args:
        problem: whose path is of ratios.
        rows: of the problem and its objectives.
        first: the range of the first objective that is looked at, from below any value of interest to the reference.
        worst: the second objective's reference: nothing beyond is of interest.
        volume: that room between bound and middles is measured by.
    """

    def __init__(
        self, problem: Problem, rows: FrontRows, first: tuple[float, float], worst: float, volume: float
    ) -> None:
        self.rows, self.worst = rows, worst
        self.edges = np.linspace(*first, CELLS + 1)
        self._scale = power_below(self.edges[1:], rows.exponent)
        self._area = (self.edges[1] - self.edges[0]) / volume
        self.low, self.high = all_ratios(problem)
        self.curves, middles = rows.over(self.low, self.high)
        self.values = self._values(self.curves)  # of each open box in each cell
        self.closed, self.closed_start = np.full(CELLS, worst), np.inf  # of all closed boxes
        self.reached = np.full(CELLS, worst)  # by middles of boxes, at the end of each cell
        self._reach(middles)
        self.boxes = 1

    @property
    def open(self) -> bool:
        """Whether a box is left to cut."""
        return bool(len(self.low))

    @property
    def lower(self) -> Array:
        """What the second objective is not below in each cell, at most its reference ``(CELLS,)``."""
        return np.asarray(np.minimum(self.closed, self.values.min(axis=0, initial=self.worst)))

    @property
    def start(self) -> float:
        """What the first objective is not below, of motions within the reference point."""
        return float(min(self.closed_start, self._starts(self.curves, self.values).min(initial=np.inf)))

    def room(self) -> float:
        """Room between what middles of boxes reach and the bound; see ``_room``."""
        return float(self._room(self.lower[None])[0])

    def step(self, worthwhile: float) -> None:
        """Cuts the boxes that leave most room; those that leave no more than ``worthwhile`` are closed."""
        room = self._room(self.values)
        done = np.flatnonzero(room <= worthwhile)
        self._close(self.curves.select(done), self.values[done])
        order = np.argsort(-room, kind="stable")[:BATCH]
        chosen = order[room[order] > worthwhile]
        keep = np.ones(len(self.low), dtype=bool)
        keep[chosen] = keep[done] = False
        low, high, stuck = halves(self.low[chosen], self.high[chosen])
        self.boxes += len(low)
        made, middles = self.rows.over(low, high)
        self._reach(middles)
        made = made.at_least(self.curves.select(np.tile(chosen, 2)))  # what holds of a box holds of its halves
        values = self._values(made)
        self._close(made.select(stuck), values[stuck])
        self.low = np.concatenate([self.low[keep], low[~stuck]])
        self.high = np.concatenate([self.high[keep], high[~stuck]])
        self.curves = self.curves.select(keep).joined(made.select(~stuck))
        self.values = np.concatenate([self.values[keep], values[~stuck]])

    def _values(self, curves: Curves) -> Array:
        """The least of each curve in each cell, which is at the cell's end ``(N, CELLS)``; at most the reference."""
        values = np.maximum(curves.level[:, None] * self._scale * DOWN, curves.floor[:, None])
        np.minimum(values, self.worst, out=values)
        values[curves.start[:, None] > self.edges[1:]] = self.worst
        return values

    def _room(self, values: Array) -> Array:
        """Area below what middles reach, a share of the volume, and a part of its mean height, relative ``(N,)``.

        The second has the bound close in all cells, where the second objective is small as well.
        """
        below = self._aim - values
        np.maximum(below, 0.0, out=below)
        return np.asarray(below @ (self._area + EVEN / (CELLS * self._span)))

    def _starts(self, curves: Curves, values: Array) -> Array:
        """Where each curve starts, infinite for one that is nowhere within the reference point."""
        return np.where((values < self.worst).any(axis=1), curves.start, np.inf)

    def _close(self, curves: Curves, values: Array) -> None:
        self.closed = np.minimum(self.closed, values.min(axis=0, initial=self.worst))
        self.closed_start = min(self.closed_start, float(self._starts(curves, values).min(initial=np.inf)))

    def _reach(self, curves: Curves) -> None:
        self.reached = np.minimum(self.reached, self._values(curves).min(axis=0, initial=self.worst))
        # Where the front begins within a cell, no middle may ever reach that: the next one's will do.
        self._aim = np.where(self.reached < self.worst, self.reached, np.append(self.reached[1:], self.worst))
        self._span = np.maximum(np.abs(self._aim), TINY * abs(self.worst))
