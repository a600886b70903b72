"""Front tracing: a Pareto front by warm-started local solves, each of them proved.

Two objectives: epsilon-constraints. Starting from the two ends of the front inside the reference box, the widest gap
between neighbours (measured by the area of the box they span, which bounds what hypervolume is still to be had there)
is halved along its longer side: one objective is bounded at the middle, the other minimised. More objectives: goal
attainment towards the ideal along a lattice of weights (Das and Dennis, 1998).

Time scaling gives the starts: a dilated solution keeps its path, so one solution is a whole ray of candidates,
evaluated in one pass of the tape; the best one that meets the bound is where the local solver begins.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymoo.util.ref_dirs import get_reference_directions

from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.nlp import Solution
from ocp_traj.population import Population
from ocp_traj.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.scalarise import EpsilonConstraint, GoalAttainment, Scalarisation
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.pareto_set import ParetoSet

Array = NDArray[np.float64]

FLAT = 1e-7  # relative: ends closer than this are one point; our choice, far above what back-off and solver leave open
RAY = np.concatenate([np.linspace(0.5, 1.0, 40), np.linspace(1.0, 2.0, 41)[1:]])  # dilations tried: our choice


@dataclass(frozen=True)
class FrontTracer:
    """Traces a front of ``points`` points.

    Attributes:
        points: how many, at most.
        solver: of each point.
        starts: random starts at each end of the front, where nothing is known yet.
        seed: of those starts.
        max_seconds: stop after the point that passes this.
        progress: told after each point.
    """

    points: int = 40
    solver: Exchange = field(default_factory=Exchange)
    starts: int = 2
    seed: int = 0
    max_seconds: float = np.inf
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the number of points."""
        if self.points < 2:
            raise InputError(f"a front needs at least 2 points; got {self.points}")

    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """Traces the front of two or more objectives; Ctrl-C ends it early with the points it has."""
        if len(objectives) < 2:
            raise InputError(f"a front trades two or more objectives; got {', '.join(objectives) or 'none'}")
        begun = time.perf_counter()
        trace = _Trace(self, problem, tuple(objectives), begun + self.max_seconds)
        interrupted = False
        try:
            trace.ends()
            trace.fill() if len(objectives) == 2 else trace.lattice()
        except KeyboardInterrupt:
            interrupted = True
        info: dict[str, Any] = {"solves": trace.solves, "iterations": trace.iterations, "failed": trace.failed}
        if not trace.conflict:
            info["conflict"] = False
        xs = [solution.x for solution in trace.solutions]
        return ParetoSet(xs, "trace", self.seed, time.perf_counter() - begun, info, interrupted)


class _Trace:
    """One run of the tracer: the solutions so far and their objective values, less is better."""

    def __init__(self, tracer: FrontTracer, problem: Problem, objectives: tuple[str, ...], deadline: float) -> None:
        self.tracer, self.problem, self.names, self.deadline = tracer, problem, objectives, deadline
        self.population = Population(problem, objectives)
        self.signs = np.array([1.0 if problem.objective(name).sense == "min" else -1.0 for name in objectives])
        self.reference = np.array(
            [s * problem.reference_point.get(n, s * np.inf) for s, n in zip(self.signs, objectives, strict=True)]
        )
        self.solutions: list[Solution] = []
        self.values = np.empty((0, len(objectives)))
        self.solves = self.iterations = self.failed = 0
        self.conflict = True

    def ends(self) -> None:
        """The best point of each objective, with the others inside the reference box."""
        for k, name in enumerate(self.names):
            bounds = {
                n: self.problem.reference_point[n]
                for n in self.names
                if n != name and n in self.problem.reference_point
            }
            scalar = EpsilonConstraint(name, bounds, augmentation=1e-6)
            starts = max(self.tracer.starts, self.problem.starts)
            start = Multistart(self.tracer.solver, starts, self.tracer.seed + k)
            solution = start.solve(self.problem, scalar)
            self._count(solution)
            if not solution.ok:
                raise NoSolutionFound(solution.explain())
            self._add(solution)

    def fill(self) -> None:
        """Halves the widest gap until there are enough points or no gap is left."""
        span = np.ptp(self.values, axis=0)
        flat = span <= FLAT * np.abs(self.values).max(axis=0)
        if flat.any():  # there is nothing to trade: the end that is better where they differ is best in both
            best = int(np.argmin(self.values[:, ~flat].sum(axis=1)))
            self.solutions, self.values = [self.solutions[best]], self.values[[best]]
            self.conflict = False
            return
        closed: set[tuple[float, float]] = set()  # gaps in which nothing new was found
        while len(self.solutions) < self.tracer.points and time.perf_counter() < self.deadline:
            order = np.argsort(self.values[:, 0])
            values = self.values[order]
            gaps = np.abs(np.diff(values, axis=0)) / span
            area = np.array(
                [
                    0.0 if (a[0], b[0]) in closed else g.prod()
                    for a, b, g in zip(values[:-1], values[1:], gaps, strict=True)
                ]
            )
            if not (area > 1e-12).any():
                return
            i = int(np.argmax(area))
            pair = [int(order[i]), int(order[i + 1])]
            bounded = int(np.argmax(gaps[i]))
            middle = float(self.signs[bounded] * values[i : i + 2, bounded].mean())
            scalar = EpsilonConstraint(self.names[1 - bounded], {self.names[bounded]: middle}, augmentation=1e-6)
            before = len(self.solutions)
            self._point(scalar, pair, {bounded: self.signs[bounded] * middle})
            new = len(self.solutions) > before and bool(
                (np.abs(self.values[-1] - self.values[:-1]) / span).max(axis=1).min() > 1e-9
            )
            if not new:
                closed.add((values[i, 0], values[i + 1, 0]))
                if len(self.solutions) > before:
                    self._drop()

    def lattice(self) -> None:
        """Goal attainment from the ideal along each direction of a lattice of about the right number of weights."""
        m, low = len(self.names), self.values.min(axis=0)
        span = np.maximum(self.values.max(axis=0) - low, 1e-12)
        partitions = 1
        while len(get_reference_directions("das-dennis", m, n_partitions=partitions + 1)) <= self.tracer.points - m:
            partitions += 1
        for direction in get_reference_directions("das-dennis", m, n_partitions=partitions):
            if direction.max() > 1.0 - 1e-9:
                continue  # the ends are known
            if time.perf_counter() >= self.deadline:
                return
            goals = {n: float(s * v) for n, s, v in zip(self.names, self.signs, low, strict=True)}
            weights = {n: float(max(w, 1e-3) * d) for n, w, d in zip(self.names, direction, span, strict=True)}
            near = np.argsort(np.abs((self.values - low) / span / np.maximum(direction, 1e-3)).max(axis=1))
            self._point(GoalAttainment(goals, weights), near[:2].tolist(), {})

    def _point(self, scalar: Scalarisation, neighbours: list[int], bounds: Mapping[int, float]) -> None:
        x0, nearest = self._start(neighbours, bounds)
        known = self.solutions[nearest]
        solver = replace(self.tracer.solver, first=known.instants)
        solution = solver.solve(self.problem, scalar, x0)
        self._count(solution)
        if not solution.ok:  # once more, from the neighbour itself and with all rows
            solution = self.tracer.solver.solve(self.problem, scalar, known.x)
            self._count(solution)
        if solution.ok:
            self._add(solution)
        self.tracer.progress(len(self.solutions), self.tracer.points, self._words())

    def _start(self, neighbours: list[int], bounds: Mapping[int, float]) -> tuple[Array, int]:
        """The best of the neighbours' rays: within the bounds first, then least in the sum of what is free."""
        candidates = [(self.solutions[i].x, i) for i in neighbours]
        if self.problem.dilate is not None:
            dilated = [(np.asarray(self.problem.dilate(x, s)), i) for x, i in candidates for s in RAY]
            inside = [(x, i) for x, i in dilated if (x <= self.problem.upper).all() and (x >= self.problem.lower).all()]
            candidates += inside
        values = self.population.evaluate(np.array([x for x, _ in candidates])).objectives * self.signs
        span = np.maximum(np.ptp(self.values, axis=0), 1e-12)
        over = sum(
            (np.maximum(values[:, k] - bound, 0.0) / span[k] for k, bound in bounds.items()), np.zeros(len(values))
        )
        free = [k for k in range(len(self.names)) if k not in bounds]
        merit = 1e3 * over + (values[:, free] / span[free]).sum(axis=1)
        return candidates[int(np.argmin(merit))]

    def _count(self, solution: Solution) -> None:
        self.solves += 1
        self.iterations += solution.iterations
        self.failed += not solution.ok

    def _add(self, solution: Solution) -> None:
        self.solutions.append(solution)
        value = np.array([solution.objectives[name] for name in self.names]) * self.signs
        self.values = np.vstack([self.values, value])

    def _drop(self) -> None:
        self.solutions.pop()
        self.values = self.values[:-1]

    def _words(self) -> str:
        last = self.values[-1] * self.signs
        return ", ".join(f"{name} {value:.6g}" for name, value in zip(self.names, last, strict=True))
