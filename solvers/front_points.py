"""The points of a front that is being traced, whoever finds them: each once, proved, none dominated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array, Flags
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.results.indicators import hypervolume_so_far
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.waves import Solves
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives

SAME = 1e-9  # of the front's extent: points closer than this in every objective are one; our choice
FLAT = 1e-7  # relative: ends closer than this are one point; our choice, far above what back-off and solver leave open
LITTLE = 1e-5  # of the front's extent: what an ideal point may be better by and count as dominated; our choice
EXACT = 4  # objectives up to which the hypervolume of a thousand points takes some milliseconds: it is told of


class FrontPoints:
    """The solutions so far and their objective values, less is better.

    Args:
        problem: whose front.
        objectives: traded.
        work: what is asked of the problem.
        wanted: how many points, at most.
        progress: told after each point.

    Attributes:
        names, signs: objectives, and 1 for one that is minimised, -1 for one that is maximised ``(m,)``.
        reference: the problem's reference point, infinite where it has none ``(m,)``.
        population: evaluates the objectives.
        solutions, values: the points, ``values (N, m)``.
        conflict: whether there is anything to trade.
        resolution: to which objectives are told ``(m,)``.
        unresolved: in which objectives neighbours are too near each other for a point between them.
        rays: by a trajectory's variables, what its dilations lead to; see ``front_rays``.
    """

    def __init__(
        self, problem: Problem, objectives: tuple[str, ...], work: Solves, wanted: int, progress: Progress = silent
    ) -> None:
        """No point yet; see the class."""
        self.problem, self.names, self.work, self.wanted, self.progress = problem, objectives, work, wanted, progress
        self.population = Population(problem, objectives)
        self.signs = np.array([1.0 if problem.objective(name).sense == "min" else -1.0 for name in objectives])
        self.reference = np.array(
            [s * problem.reference_point.get(n, s * np.inf) for s, n in zip(self.signs, objectives, strict=True)]
        )
        self.solutions: list[Solution] = []
        self.values = np.empty((0, len(objectives)))
        self.conflict = True
        self.resolution = np.array([problem.objective(name).resolution for name in objectives])
        self.unresolved: dict[str, float] = {}
        self.rays: dict[bytes, tuple[Array, Array]] = {}

    def __len__(self) -> int:
        return len(self.solutions)

    @property
    def ideal(self) -> dict[str, float]:
        """Best value of each objective, in its own sense."""
        return dict(zip(self.names, (self.values.min(axis=0) * self.signs).tolist(), strict=True))

    @property
    def flat(self) -> Flags:
        """In which objectives all points are one ``(m,)``."""
        return np.asarray(np.ptp(self.values, axis=0) <= FLAT * np.abs(self.values).max(axis=0))

    def adds_nothing_to(self, known: Sequence[Mapping[str, float]]) -> bool:
        """Whether the ideal point is dominated by one of some points that are known, each its objectives by id."""
        others = self.signs * np.array([[point[name] for name in self.names] for point in known]).reshape(
            -1, len(self.names)
        )
        best = self.values.min(axis=0) + LITTLE * np.ptp(self.values, axis=0)
        return bool((others <= best).all(axis=1).any())

    def value(self, solution: Solution) -> Array:
        """The values ``(m,)`` of a solution's objectives."""
        return np.asarray(np.array([solution.objectives[name] for name in self.names]) * self.signs)

    def evaluated(self, x: Array, like: Solution) -> Solution | None:
        """A decision vector as a solution, if it is proved and new."""
        path, found = audit_points(self.problem, [x])[0]
        if not found.proved or np.array_equal(x, like.x):
            return None
        values = evaluate_objectives(self.problem, x)
        return replace(
            like, x=x, status=Status.FEASIBLE, trajectory=path, audit=found, objectives=values, key=""
        )  # fmt: skip

    def take(self, solution: Solution, span: Array, ranks: bool = True) -> bool:
        """Adds a point, if it is not there already and, where that is wanted, none dominates it."""
        self.add(solution)
        known = self.values[:-1]
        if len(known) and (np.abs(self.values[-1] - known) / span).max(axis=1).min() <= SAME:
            self.drop()
            return False
        return self._ranked(span) if ranks else True

    def add(self, solution: Solution) -> None:
        """Adds a point."""
        self.solutions.append(solution)
        self.values = np.vstack([self.values, self.value(solution)])

    def drop(self) -> None:
        """Forgets the last point."""
        self.solutions.pop()
        self.values = self.values[:-1]

    def keep(self, chosen: Sequence[int]) -> None:
        """Forgets all but some points."""
        self.solutions = [self.solutions[i] for i in chosen]
        self.values = self.values[list(chosen)]

    def replace(self, one: Solution, solution: Solution) -> None:
        """Another solution in place of one that is there, or nothing where it is none."""
        i = next((i for i, known in enumerate(self.solutions) if known is one), None)
        if i is None:
            return
        if solution.ok:
            self.solutions[i], self.values[i] = solution, self.value(solution)
        else:
            self.keep([k for k in range(len(self)) if k != i])

    def _ranked(self, span: Array) -> bool:
        """Whether the last point is dominated by none; those that it dominates are dropped, else it is itself.

        A local solver ends now and then in a local optimum, beside which the next point is better in both.
        """
        last, room = self.values[-1], SAME * span
        if ((self.values[:-1] <= last + room).all(axis=1) & (self.values[:-1] < last - room).any(axis=1)).any():
            self.drop()
            return False
        worse = (self.values >= last - room).all(axis=1) & (self.values > last + room).any(axis=1)
        self.keep(np.flatnonzero(~worse).tolist())
        return True

    def tell(self, doing: str = "", done: int | None = None) -> None:
        """Tells how far it is: points, solves, hypervolume, workers."""
        if self.progress is silent:
            return
        words = [doing] if doing else []
        words.append(self.work.words)
        few = len(self.names) <= EXACT
        if few and (share := hypervolume_so_far(self.values, self.reference, self._best())) is not None:
            words.append(f"hypervolume {share:.4f}")
        self.progress(len(self) if done is None else done, self.wanted, ", ".join(words))

    def _best(self) -> Array:
        """The ideal point, less is better: the problem's own, else that of the points so far."""
        known = self.problem.ideal_point(self.names)
        if not known:
            return np.asarray(self.values.min(axis=0, initial=np.inf))
        return np.asarray(self.signs * np.array([known[name] for name in self.names]))
