"""What a memetic search hands to its local solver: individuals, gaps between proved points, and what is beyond them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.solvers.archive import Archive, Known
from ocp_traj.solvers.refinement import LEAST
from ocp_traj.transcription.symbolic import evaluate_objectives

# Of the front's extent, and of an only point's values, by which one goes beyond an end; our choice.
STEP, FIRST = 1.0, 0.3


@dataclass(frozen=True, eq=False)
class Aim:
    """One local solve, from ``x`` towards ``goal`` with ``weights``, less is better.

    Attributes:
        kind: of what it improves.
        x: start ``(n,)``.
        goal, weights: ``(objectives,)``.
        near: whose instants and multipliers it begins with.
        other: the neighbour on the other side of a gap, from where it may be tried once more.
    """

    kind: str
    x: Array
    goal: Array
    weights: Array
    near: Known | None
    other: Known | None = None

    @property
    def turned(self) -> Aim | None:
        """The same gap from its other side."""
        return None if self.other is None else replace(self, x=self.other.x, near=_solved(self.other), other=None)


class Aims:
    """Chooses what is to be improved.

    Args:
        archive: the proved points.
        target: the population's problem.
        far_share: of the individuals, those that are far from all proved points.
        complete: whether the archive holds the ends of the whole front, so that none is looked for beyond them.
        rng: of what is random.
    """

    def __init__(
        self, archive: Archive, target: PymooProblem, far_share: float, complete: bool, rng: np.random.Generator
    ) -> None:
        """Has tried nothing yet; see the class."""
        self.archive, self.target, self.far_share, self.rng = archive, target, far_share, rng
        self.tried = {point.name for point in archive.points}
        self._complete, self._ended = complete, [set[bytes]() for _ in range(target.n_obj)]

    def values(self, x: Array) -> Array:
        """Traded objectives ``(objectives,)`` of ``x (n,)``, less is better."""
        values = evaluate_objectives(self.target.population.problem, x)
        return np.asarray(np.array([values[name] for name in self.target.population.names]) * self.target.signs)

    def of(self, algorithm: Any) -> Iterator[Aim]:
        """What is beyond the ends, individuals and gaps in turn, as long as there are any."""
        individuals = self._individuals(algorithm)
        while True:  # what is beyond and between changes with every point that is found
            found = [aim for aim in (self.beyond(), next(individuals, None), self._gap()) if aim is not None]
            if not found:
                return
            yield from found

    def _individuals(self, algorithm: Any) -> Iterator[Aim]:
        """Of the first rank, those in the widest gaps first; now and then one that is far from all proved points."""
        pop = algorithm.pop
        x, excess = pop.get("X").astype(float), np.ravel(pop.get("excess").astype(float))
        fresh = np.array([row.tobytes() not in self.tried for row in x], dtype=bool)
        legal = excess <= 0.0
        met = np.flatnonzero(legal & fresh)
        if not len(met):  # then those that break limits least
            order = np.argsort(excess, kind="stable")
            for i in (i for i in order.tolist() if fresh[i] and excess[i] > 0.0):
                yield self._of_individual("far", x[i])
            return
        f, aimed = pop.get("F").astype(float), np.empty((0, self.target.n_obj))
        box = self.target.xu - self.target.xl
        left = list(met.tolist())
        while left:
            some = np.array(left)
            if self.rng.uniform() < self.far_share and self.archive.points:
                apart = (x[some][:, None] - np.array([point.x for point in self.archive.points])) / np.where(
                    box > 0.0, box, 1.0
                )
                i, kind = int(some[np.argmax(np.linalg.norm(apart, axis=2).min(axis=1))]), "far"
            else:
                first = [k for k in left if self.archive.gains(f[k]) and not _dominated(f[k], f[legal])]
                if not first:
                    return
                i, kind = first[int(np.argmax(self.archive.distances(f[first], aimed)))], "first rank"
            aimed = np.vstack([aimed, f[i]])  # what comes of it is not known before the next is chosen
            left.remove(i)
            yield self._of_individual(kind, x[i])

    def _of_individual(self, kind: str, x: Array) -> Aim:
        """Along the ray from the nadir through the individual itself."""
        self.tried.add(x.tobytes())
        f, extent = self.values(x), self.archive.extent
        nadir = np.vstack([self.archive.f, f]).max(axis=0)
        near = None if kind == "far" else self.archive.nearest(f)
        return Aim(kind, x, f, np.maximum(nadir - f, LEAST * extent), near)

    def _gap(self) -> Aim | None:
        """From what is between two proved neighbours towards the best of both."""
        pair = self.archive.gap()
        if pair is None:
            return None
        self.archive.close(*pair)
        return self._between(*pair)

    def _between(self, one: Known, other: Known) -> Aim:
        """From the middle of two of one family, whose objectives lie between theirs; else from one of them."""
        goal, worst = np.minimum(one.f, other.f), np.maximum(one.f, other.f)
        if one.solution is None:
            one, other = other, one
        x = 0.5 * (one.x + other.x)
        f = self.values(x)
        alike = bool(((goal <= f) & (f <= worst)).all())
        weights = np.maximum(worst - goal, LEAST * self.archive.extent)
        near = _solved(one) or self.archive.nearest(one.f)
        return Aim("gap", x if alike else one.x, goal, weights, near, other)

    def beyond(self) -> Aim | None:
        """From an end of what is known outwards: better in its objective, and no more than that worse in the others."""
        for k in range(0 if self._complete or not self.archive.points else self.target.n_obj):
            end = self.archive.points[int(np.argmin(self.archive.f[:, k]))]
            size = FIRST * np.abs(end.f) if len(self.archive.points) == 1 else STEP * self.archive.extent
            step, goal = np.maximum(size, LEAST * self.target.scales), end.f.copy()
            goal[k] -= step[k]
            others = np.arange(len(goal)) != k
            step[others] = np.minimum(step, self.target.worst - goal)[others]
            if end.name not in self._ended[k] and (step > LEAST * size).all():
                self._ended[k].add(end.name)
                return Aim("beyond", end.x, goal, step, _solved(end))
        return None


def _solved(point: Known) -> Known | None:
    return point if point.solution is not None else None


def _dominated(f: Array, others: Array) -> bool:
    """Whether one of ``others (N, objectives)`` is as good in all and better in one."""
    return bool(((others <= f).all(axis=1) & (others < f).any(axis=1)).any())
