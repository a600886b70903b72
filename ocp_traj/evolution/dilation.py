"""Individuals that break a limit are slowed down along their own paths until they keep it.

Dilated by s, a path's m-th derivative falls as s^-m, and an effort as the sum of such a part and of gravity's, which
stays. So a row's excess is taken as e(s) = (e(1) + b) s^-m - b: of a derivative b is its bound exactly; of others it is
corrected by what the first dilation gave. That makes legal most of what crossover and mutation break, wherever what is
broken is no matter of the path itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.population import Evaluation, Population
from ocp_traj.formulation.problem import Problem

TRIES = 2  # dilations of an individual: our choice; a third mends hardly one more
ROOM = 1e-9  # relative, by which s is larger, so that rounding breaks no limit; our choice
LEAST = 1e-3  # of a limit's scale: the least b, below which gravity leaves next to nothing to move with; our choice


class Dilation:
    """Slows down the individuals of one problem.

    Args:
        problem: it must say how x dilates, else nothing is changed.
        population: evaluates its individuals.
        tolerance: excess that is overlooked, in units of a limit's scale.
    """

    def __init__(self, problem: Problem, population: Population, tolerance: float = 0.0) -> None:
        """Notes the order and the bound of each row; see the class."""
        self.problem, self.population, self.tolerance = problem, population, tolerance
        orders, rooms = [np.zeros(0)], [np.zeros(0)]
        for limit in problem.requirements.path_constraints:
            rows = len(limit.labels)
            order = problem.requirements.order(limit) if limit.order is None else limit.order
            sizes = np.minimum(*(np.where(np.isfinite(b), np.abs(b), np.inf) for b in (limit.lower, limit.upper)))
            orders.append(np.full(rows, max(order, 0)))
            rooms.append(np.where(np.isfinite(sizes), sizes, 1.0) / limit.scale)
        chosen = sum(len(limit.labels) for limit in problem.chosen_limits)  # of places alone
        self._orders = np.concatenate([*orders, np.zeros(chosen)])
        self._rooms = np.maximum(np.concatenate([*rooms, np.ones(chosen)]), LEAST)

    def apply(self, x: Array, evaluation: Evaluation) -> tuple[Array, Evaluation]:
        """Individuals ``x (N, n)``, and their values, slowed down where that makes them break less."""
        dilate, moves = self.problem.dilate, self._orders > 0
        if dilate is None or not moves.any():
            return x, evaluation
        before = evaluation.violations
        rows, powers = before[:, moves] - self.tolerance, 1.0 / self._orders[moves]
        left = np.flatnonzero((rows > 0.0).any(axis=1) & np.isfinite(before).all(axis=1))
        room = np.tile(self._rooms[moves], (len(x), 1))
        best, objectives, violations = x.copy(), evaluation.objectives.copy(), before.copy()
        for number in range(TRIES):
            if not len(left):
                break
            over = np.maximum(rows[left], 0.0)
            factors = (((over + room[left]) / room[left]) ** powers).max(axis=1) * (1.0 + ROOM)
            slower = np.array([dilate(x[i], s) for i, s in zip(left, factors.tolist(), strict=True)])
            inside = ((slower >= self.problem.lower) & (slower <= self.problem.upper)).all(axis=1)
            left, factors, slower = left[inside], factors[inside], slower[inside]
            if not len(left):
                break
            found = self.population.evaluate(slower)
            better = _excess(found.violations) < _excess(violations[left])
            taken = left[better]
            best[taken], objectives[taken] = slower[better], found.objectives[better]
            violations[taken] = found.violations[better]
            if number + 1 < TRIES:
                now, share = found.violations[:, moves] - self.tolerance, factors[:, None] ** -self._orders[moves]
                still = (now > 0.0).any(axis=1)
                # e(s) = (e(1) + b) s^-m - b solved for b, of the rows that still break.
                new = (rows[left] * share - now) / (1.0 - share)
                room[left] = np.where(now > 0.0, np.maximum(new, LEAST), room[left])
                left = left[still]
        return best, replace(evaluation, objectives=objectives, violations=violations)


def _excess(violations: Array) -> Array:
    """Sum of what is broken ``(N,)``."""
    return np.asarray(np.maximum(violations, 0.0).sum(axis=1))
