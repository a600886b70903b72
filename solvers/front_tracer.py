"""Front tracing: a Pareto front by warm-started local solves, each of them proved.

Two objectives: epsilon-constraints. Starting from the two ends of the front inside the reference box, the widest gap
between neighbours (measured by the area of the box they span, which bounds what hypervolume is still to be had there)
is halved along its longer side: one objective is bounded at the middle, the other minimised. More objectives: goal
attainment towards the ideal, inside the reference box, along a lattice of weights (Das and Dennis, 1998), and, where
that leaves points to be had, along the directions of finer lattices that are farthest from all points so far.

A solve between two neighbours begins in their middle, which is nearer by an order than they are. Elsewhere, and where
they are of two families, time scaling gives the start: a dilated solution keeps its path, so one solution is a whole
ray of candidates, evaluated in one pass of the tape; the best one that meets the bound is where the solver begins.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from pymoo.util.ref_dirs import get_reference_directions

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.case import check, count
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, GoalAttainment, Scalarisation
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.indicators import hypervolume_so_far
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet
from ocp_traj.results.records import Found, ignore, of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.by_levels import ByLevels
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.waves import Begun, Request, Solves
from ocp_traj.stopping import STOPS, stopping
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives

SAME = 1e-9  # of the front's extent: points closer than this in every objective are one; our choice
REFINEMENTS = 4  # how many finer lattices are tried where the first one leaves points to be had: our choice
# Points that wait to be proved, and their iterations times rows, some 2 s of work, after which they are: our choice.
# With the clock the front would depend on the machine.
TOGETHER, PATIENCE = 8, 2e5
FLAT = 1e-7  # relative: ends closer than this are one point; our choice, far above what back-off and solver leave open
# Of the front's extent: what an end may lose in its own objective, room that an interior point needs, and what it must
# gain in the other for that; our choice.
LOSS, WORTHWHILE = 1e-5, 1e-3
RAY = np.concatenate([np.linspace(0.5, 1.0, 40), np.linspace(1.0, 2.0, 41)[1:]])  # dilations tried: our choice


@dataclass(frozen=True)
class FrontTracer:
    """Traces a front of ``points`` points.

    Attributes:
        points: how many, at most.
        solver: of each point.
        starts: random starts at each end of the front, where nothing is known yet.
        seed: of those starts.
        max_seconds: stop after this, in the middle of a point, with those that are there.
        workers: who solves; the front does not depend on it.
        progress: told after each point.
        found: given a record of each solve.
    """

    points: int = count(40, least=2)
    solver: Exchange = field(default_factory=Exchange)
    starts: int = count(2)
    seed: int = 0
    max_seconds: float = np.inf
    workers: Workers = field(default_factory=Workers)
    progress: Progress = silent
    found: Found = ignore

    def __post_init__(self) -> None:
        """Checks the number of points."""
        check(self)

    @one_blas_thread
    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """Traces the front of two or more objectives; Ctrl-C ends it early with the points it has."""
        if len(objectives) < 2:
            raise InputError(f"a front trades two or more objectives; got {', '.join(objectives) or 'none'}")
        begun = time.perf_counter()
        trace = _Trace(self, problem, tuple(objectives))
        with stopping(self.max_seconds) as stop:
            complete = False
            try:
                trace.ends()
                if len(objectives) == 2 and problem.tuning.starts > 1:
                    trace.sharpen()
                trace.fill() if len(objectives) == 2 else trace.lattice()
                trace.work.prove()
                complete = True
            except STOPS as reason:
                stop.take(reason)
                trace.work.prove(again=False)
            interrupted = not complete and stop.tell()
        info: dict[str, Any] = {
            "solves": trace.work.solves,
            "iterations": trace.work.iterations,
            "failed": trace.work.failed,
            "unsolved ends": trace.unsolved,
        }
        if not trace.conflict:
            info["conflict"] = False
        if not complete:
            info[ENDED_AFTER] = f"{len(trace.solutions)} of {self.points} points"
        if trace.ended and not trace.unsolved:
            info["ideal"] = trace.ideal
        xs = [solution.x for solution in trace.solutions]
        return ParetoSet(xs, "trace", self.seed, time.perf_counter() - begun, info, interrupted)


@dataclass(frozen=True)
class _Gap:
    """Two neighbours on a front of two objectives, their values of the first, and the extent of the front."""

    one: Solution
    other: Solution
    ends: tuple[float, float]
    extent: bytes


class _Trace:
    """One run of the tracer: the solutions so far and their objective values, less is better."""

    def __init__(self, tracer: FrontTracer, problem: Problem, objectives: tuple[str, ...]) -> None:
        self.tracer, self.problem, self.names = tracer, problem, objectives
        self.population = Population(problem, objectives)
        self.signs = np.array([1.0 if problem.objective(name).sense == "min" else -1.0 for name in objectives])
        self.reference = np.array(
            [s * problem.reference_point.get(n, s * np.inf) for s, n in zip(self.signs, objectives, strict=True)]
        )
        self.work = Solves(problem, tracer.solver, tracer.workers, tracer.found)
        self.solutions: list[Solution] = []
        self.values = np.empty((0, len(objectives)))
        self.conflict, self.ended = True, False  # whether there is anything to trade; whether all ends were tried
        self.unsolved: list[str] = []  # objectives whose end is only the best point known

    def ends(self) -> None:
        """The best point of each objective, with the others inside the reference box.

        An end that no start reaches is tried once more from the other ends; if that fails as well, the best dilation of
        theirs stands in for it, and ``unsolved`` says so.
        """
        missing: list[tuple[str, Solution]] = []
        for k, name in enumerate(self.names):
            starts = max(self.tracer.starts, self.problem.tuning.starts)
            solution = self._from_guesses(self._end(name), starts, self.tracer.seed + k, f"the best {name}")
            self.work.count(self._end(name), solution)
            if solution.ok:
                self._add(solution)
            else:
                missing.append((name, solution))
        for name, failure in missing:
            if not self.solutions:
                raise NoSolutionFound(
                    f"{failure.explain()} (the least {name}, the others within the reference point); "
                    "no end of the front was found"
                )
            bounds = {self.names.index(n): self._sign(n) * bound for n, bound in self._end(name).bounds.items()}
            x0, nearest = self._start(list(range(len(self.solutions))), bounds)
            solution = self.work.again(Request(self._end(name), x0))
            if solution.ok:
                self._add(solution)
                continue
            self.unsolved.append(name)
            stand_in = self._evaluated(x0, self.solutions[nearest])
            if stand_in is not None:
                self.tracer.found(of_solve(self._end(name), stand_in))
                self._add(stand_in)
        self.ended = True

    def _from_guesses(self, scalar: Scalarisation, starts: int, seed: int, words: str) -> Solution:
        tracer = self.tracer

        def tell(done: int, total: int, _: str) -> None:
            self._tell(f"{words}, {done} of {total} starts")

        told = silent if tracer.progress is silent else tell
        many = Multistart(tracer.solver, starts, seed, progress=told, workers=tracer.workers, found=tracer.found)
        solver = many if self.problem.levels is None else ByLevels(many, refine=False)
        return solver.solve(self.problem, scalar)

    def _tell(self, doing: str = "") -> None:
        """Tells how far it is: points, solves, hypervolume, workers."""
        if self.tracer.progress is silent:
            return
        words = [doing] if doing else []
        words.append(self.work.words)
        if (share := hypervolume_so_far(self.values, self.reference, self._best())) is not None:
            words.append(f"hypervolume {share:.4f}")
        self.tracer.progress(len(self.solutions), self.tracer.points, ", ".join(words))

    def _best(self) -> Array:
        """The ideal point, less is better: the problem's own, else that of the points so far."""
        known = self.problem.ideal_point(self.names)
        if not known:
            return np.asarray(self.values.min(axis=0, initial=np.inf))
        return np.asarray(self.signs * np.array([known[name] for name in self.names]))

    @property
    def ideal(self) -> dict[str, float]:
        """Best value of each objective, in its own sense."""
        return dict(zip(self.names, (self.values.min(axis=0) * self.signs).tolist(), strict=True))

    def sharpen(self) -> None:
        """Makes each of two ends the best in the other objective as well, from random starts.

        Where one objective cannot be pushed further many trajectories have its best value, and in a problem with many
        local optima the augmentation alone does not find the best of those.
        """
        for k, name in enumerate(self.names):
            span = np.ptp(self.values, axis=0)
            if len(self.values) != 2 or (span <= FLAT * np.abs(self.values).max(axis=0)).any():
                return
            other, value = self.names[1 - k], self.values[k, k]
            scalar = EpsilonConstraint(other, {name: float(self.signs[k] * (value + LOSS * span[k]))})
            starts = max(self.tracer.starts, self.problem.tuning.starts)
            words = f"the best {other} of those"
            solution = self._from_guesses(scalar, starts, self.tracer.seed + len(self.names) + k, words)
            self.work.count(scalar, solution)
            if (
                solution.ok
                and self._sign(other) * solution.objectives[other] < self.values[k, 1 - k] - WORTHWHILE * span[1 - k]
            ):
                self.solutions[k] = solution
                self.values[k] = self.signs * np.array([solution.objectives[n] for n in self.names])

    def _end(self, name: str) -> EpsilonConstraint:
        known = self.problem.reference_point
        bounds = {n: known[n] for n in self.names if n != name and n in known}
        return EpsilonConstraint(name, bounds, augmentation=1e-6)

    def _sign(self, name: str) -> float:
        return float(self.signs[self.names.index(name)])

    def _evaluated(self, x: Array, like: Solution) -> Solution | None:
        """A decision vector as a solution, if it is proved and new."""
        candidate, found = audit_points(self.problem, [x])[0]
        if not found.proved or np.array_equal(x, like.x):
            return None
        values = evaluate_objectives(self.problem, x)
        return replace(
            like, x=x, status=Status.FEASIBLE, trajectory=candidate, audit=found, objectives=values, key=""
        )  # fmt: skip

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
        begun: dict[_Gap, Begun] = {}
        while (left := self.tracer.points - len(self.solutions)) > 0:
            gaps = self._widest(span, closed)
            if not gaps:
                return
            # Those that are likely to be next are begun by workers that have nothing else to do. Which one is taken,
            # and what is asked of it, does not depend on that.
            for gap in gaps[: 1 + min(self.tracer.workers.ahead, left - 1)]:
                if gap not in begun:
                    begun[gap] = self.work.begin(self._halved(gap, span))
            gap = gaps[0]
            if not self._merge(begun.pop(gap), span):
                closed.add(gap.ends)

    def _widest(self, span: Array, closed: set[tuple[float, float]]) -> list[_Gap]:
        """The gaps between neighbours that are still open, the widest first."""
        order = np.argsort(self.values[:, 0])
        values = self.values[order]
        areas = (np.abs(np.diff(values, axis=0)) / span).prod(axis=1)
        extent = np.ptp(self.values, axis=0).tobytes()
        gaps = []
        for i in np.argsort(-areas, kind="stable").tolist():
            pair = self.solutions[order[i]], self.solutions[order[i + 1]]
            gap = _Gap(*pair, (float(values[i, 0]), float(values[i + 1, 0])), extent)
            if areas[i] > 1e-12 and gap.ends not in closed:
                gaps.append(gap)
        return gaps

    def _halved(self, gap: _Gap, span: Array) -> Request:
        """What to solve for a point in the middle of a gap."""
        pair = [next(i for i, known in enumerate(self.solutions) if known is one) for one in (gap.one, gap.other)]
        values = self.values[pair]
        bounded = int(np.argmax(np.abs(np.diff(values, axis=0))[0] / span))
        middle = float(self.signs[bounded] * values[:, bounded].mean())
        scalar = EpsilonConstraint(self.names[1 - bounded], {self.names[bounded]: middle}, augmentation=1e-6)
        return self._request(scalar, pair, {bounded: self.signs[bounded] * middle})

    def lattice(self) -> None:
        """Goal attainment from the ideal along the directions of a lattice, and of finer ones, until points are enough.

        The first lattice is the finest with no more directions than points are wanted.
        """
        m, low = len(self.names), self.values.min(axis=0)
        span = np.maximum(self.values.max(axis=0) - low, 1e-12)
        partitions = 1
        while len(_directions(m, partitions + 1)) + m <= self.tracer.points:
            partitions += 1
        for direction in _directions(m, partitions):
            if len(self.solutions) >= self.tracer.points:
                return
            self._towards(direction, low, span)
        for finer in range(partitions + 1, partitions + 1 + REFINEMENTS):
            left = list(_directions(m, finer))
            while left and len(self.solutions) < self.tracer.points:
                known = (self.values - low) / span
                known = known / np.maximum(known.sum(axis=1), 1e-12)[:, None]
                gap = [np.abs(known - direction).max(axis=1).min() for direction in left]
                direction = left.pop(int(np.argmax(gap)))
                if max(gap) > 0.5 / finer:
                    self._towards(direction, low, span)

    def _towards(self, direction: Array, low: Array, span: Array) -> None:
        """One point of a lattice."""
        known = self.problem.reference_point
        goals = {n: float(s * v) for n, s, v in zip(self.names, self.signs, low, strict=True)}
        weights = {n: float(max(w, 1e-3) * d) for n, w, d in zip(self.names, direction, span, strict=True)}
        near = np.argsort(np.abs((self.values - low) / span / np.maximum(direction, 1e-3)).max(axis=1))
        bounds = {n: known[n] for n in self.names if n in known}
        self._point(GoalAttainment(goals, weights, bounds), near[:2].tolist(), {}, span)

    def _point(self, scalar: Scalarisation, neighbours: list[int], bounds: Mapping[int, float], span: Array) -> bool:
        """Solves for one more point; whether one was found that is not there already."""
        return self._merge(self.work.begin(self._request(scalar, neighbours, bounds)), span)

    def _request(self, scalar: Scalarisation, neighbours: list[int], bounds: Mapping[int, float]) -> Request:
        """What to solve for a point beside others."""
        x0, nearest = self._start(neighbours, bounds)
        middle = self._middle(neighbours) if bounds else None
        known = self.solutions[nearest]
        others = [self.solutions[i].x for i in neighbours if i != nearest]
        several = self.problem.tuning.starts > 1
        # Where solutions are compared, or asked for less than they keep, each is proved at once. Where one fails, once
        # more from the neighbours themselves and with all rows; of many local optima the other may lead to a better.
        return Request(
            scalar, x0 if middle is None else middle, known,
            prove=self.problem.tighten_slacks is not None or several,
            fallbacks=[known.x] if several else [known.x, *others], others=others if several else [],
        )  # fmt: skip

    def _merge(self, begun: Begun, span: Array) -> bool:
        """Adds the point that comes of a request, if there is one that is not there already."""
        solution = self.work.take(begun, self._replace)
        new = False
        if solution.ok:
            self._add(solution)
            new = bool((np.abs(self.values[-1] - self.values[:-1]) / span).max(axis=1).min() > SAME)
            if not new:
                self._drop()
            elif len(self.names) == 2:
                new = self._ranked(span)
        self._tell()
        waiting = self.work.waiting
        if len(waiting) >= TOGETHER or sum(one.iterations * one.row_count for one in waiting) > PATIENCE:
            self.work.prove()
        return new

    def solve_wave(self, requests: Sequence[Request]) -> list[Solution]:
        """The solutions of requests that do not depend on each other, in their order, each proved where it is ok.

        They are counted and told of; none is added to the front. The workers share them: what is asked must not depend
        on how many there are.
        """
        return self.work.solve_wave(requests)

    def _replace(self, one: Solution, solution: Solution) -> None:
        """Another solution in place of one that is there, or nothing where it is none."""
        i = next((i for i, known in enumerate(self.solutions) if known is one), None)
        if i is None:
            return
        if solution.ok:
            self.solutions[i] = solution
            self.values[i] = self.signs * np.array([solution.objectives[name] for name in self.names])
        else:
            del self.solutions[i]
            self.values = np.delete(self.values, i, axis=0)

    def _start(self, neighbours: list[int], bounds: Mapping[int, float]) -> tuple[Array, int]:
        """The best of the neighbours' rays: within the bounds first, then least in the sum of what is free."""
        candidates = [(self.solutions[i].x, i) for i in neighbours]
        if self.problem.dilate is not None:
            dilated = [(np.asarray(self.problem.dilate(x, s)), i) for x, i in candidates for s in RAY]
            lower, upper = self.problem.lower, self.problem.upper
            inside = [(x, i) for x, i in dilated if (x <= upper).all() and (x >= lower).all()]
            candidates += inside
        values = self.population.evaluate(np.array([x for x, _ in candidates]), limits=False).objectives * self.signs
        span = np.maximum(np.ptp(self.values, axis=0), 1e-12)
        over = sum(
            (np.maximum(values[:, k] - bound, 0.0) / span[k] for k, bound in bounds.items()), np.zeros(len(values))
        )
        free = [k for k in range(len(self.names)) if k not in bounds]
        merit = 1e3 * over + (values[:, free] / span[free]).sum(axis=1)
        return candidates[int(np.argmin(merit))]

    def _middle(self, pair: list[int]) -> Array | None:
        """The middle of two neighbours of one family of trajectories, which has its objectives between theirs."""
        x = np.mean([self.solutions[i].x for i in pair], axis=0)
        objectives, known = evaluate_objectives(self.problem, x), self.values[pair]
        values = self.signs * np.array([objectives[name] for name in self.names])
        return x if ((known.min(axis=0) <= values) & (values <= known.max(axis=0))).all() else None

    def _add(self, solution: Solution) -> None:
        self.solutions.append(solution)
        value = np.array([solution.objectives[name] for name in self.names]) * self.signs
        self.values = np.vstack([self.values, value])

    def _drop(self) -> None:
        self.solutions.pop()
        self.values = self.values[:-1]

    def _ranked(self, span: Array) -> bool:
        """Whether the last point is dominated by none; those that it dominates are dropped, else it is itself.

        A local solver ends now and then in a local optimum, beside which the next point is better in both.
        """
        last, room = self.values[-1], SAME * span
        if ((self.values[:-1] <= last + room).all(axis=1) & (self.values[:-1] < last - room).any(axis=1)).any():
            self._drop()
            return False
        worse = (self.values >= last - room).all(axis=1) & (self.values > last + room).any(axis=1)
        self.solutions = [s for s, out in zip(self.solutions, worse.tolist(), strict=True) if not out]
        self.values = self.values[~worse]
        return True


def _directions(objectives: int, partitions: int) -> Array:
    """A lattice of weights that sum to one, its corners left out: those are the ends of the front."""
    lattice = get_reference_directions("das-dennis", objectives, n_partitions=partitions)
    return np.asarray(lattice[lattice.max(axis=1) < 1.0 - 1e-9])
