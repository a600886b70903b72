"""The stages of a memetic search: what is handed to the local solver, what comes of it, and how much of it survives."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem
from ocp_traj.evolution.injection import alive, inject, keys
from ocp_traj.formulation.problem import Problem
from ocp_traj.results.records import Found, of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.archive import Archive, Known
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.refinement import LEAST, attainment
from ocp_traj.stopping import STOPS, current, stopping
from ocp_traj.transcription.symbolic import evaluate_objectives

STEP = 0.3  # of the front's extent, or of an only point's values, by which one goes beyond an end; our choice


class Recipe(Protocol):
    """What the stages take of a memetic method; see ``memetic.Memetic``."""

    @property
    def every(self) -> int: ...  # noqa: D102
    @property
    def chosen(self) -> int: ...  # noqa: D102
    @property
    def points(self) -> int: ...  # noqa: D102
    @property
    def local_share(self) -> float: ...  # noqa: D102
    @property
    def far_share(self) -> float: ...  # noqa: D102
    @property
    def max_seconds(self) -> float: ...  # noqa: D102
    @property
    def solver(self) -> Exchange: ...  # noqa: D102
    @property
    def found(self) -> Found: ...  # noqa: D102


@dataclass(frozen=True, eq=False)
class _Aim:
    """One local solve, from ``x`` towards ``goal`` with ``weights``, less is better.

    Attributes:
        kind: of what it improves.
        x: start ``(n,)``.
        goal, weights: ``(objectives,)``.
        near: whose instants and multipliers it begins with.
        pair: the neighbours it lies between.
    """

    kind: str
    x: Array
    goal: Array
    weights: Array
    near: Known | None
    pair: tuple[Known, Known] | None = None


class Stages:
    """Local solves between generations, and their proved points.

    Args:
        recipe: numbers and shares.
        problem: whose limits hold.
        objectives: traded.
        target: the population's problem.
        ends: decision vectors ``(n,)`` that are proved.
        complete: whether these are the ends of the whole front, so that none is looked for beyond them.
        rng: of what is random.
    """

    def __init__(
        self, recipe: Recipe, problem: Problem, objectives: tuple[str, ...], target: PymooProblem,
        ends: Sequence[Array], complete: bool, rng: np.random.Generator,
    ) -> None:  # fmt: skip
        """Takes the ends in; see the class."""
        self.recipe, self.problem, self.names, self.target, self.rng = recipe, problem, objectives, target, rng
        self.archive = Archive(len(objectives), target.scales)
        for x in ends:
            self.archive.add(Known(x, self._f(x)))
        self.seconds = self.seconds_within = 0.0
        self.solves = self.iterations = self.failed = self.better = self.stages = 0
        self.injected = self.survived = 0
        self.kinds = {"first rank": 0, "far": 0, "gap": 0, "beyond": 0}
        self._complete, self._ended = complete, [set[bytes]() for _ in objectives]
        self._generation, self._begun = 0, time.perf_counter()
        self._fresh: set[bytes] = set()
        self._tried = keys(list(ends))
        # Where solutions are compared, or asked for less than they keep, each is proved at once.
        self._at_once = problem.tighten_slacks is not None or problem.tuning.starts > 1
        self._algorithm: Any = None

    @property
    def xs(self) -> list[Array]:
        """The proved points."""
        return [point.x for point in self.archive.points]

    @property
    def info(self) -> dict[str, Any]:
        """What became of the local solves."""
        return {
            "stages": self.stages,
            "solves": self.solves,
            "iterations": self.iterations,
            "solves of": dict(self.kinds),
            "solves failed": self.failed,
            "solves that gained": self.better,
            "refined individuals": {"put back": self.injected, "alive a generation later": self.survived},
        }

    def after(self, algorithm: Any) -> bool:
        """A stage, if it is its turn; it never ends the run."""
        self._generation, self._algorithm = self._generation + 1, algorithm
        if self._fresh:
            self.survived += alive(algorithm, self._fresh)
            self.injected += len(self._fresh)
            self._fresh = set()
        if self._generation % self.recipe.every == 0:
            spent = self._stage(algorithm, self.recipe.chosen)
            self.seconds_within += spent
        return False

    def last(self) -> None:
        """The stage after the last generation."""
        if self._algorithm is not None:
            self._stage(self._algorithm, self.recipe.points, timed=False)

    def _left(self, begun: float) -> bool:
        """Whether local solves have had less than their share of the time so far."""
        now = time.perf_counter()
        return self.seconds + now - begun < self.recipe.local_share * (now - self._begun)

    def _stage(self, algorithm: Any, most: int, timed: bool = True) -> float:
        """Solves, proves and puts back; the seconds that took."""
        begun, timed = time.perf_counter(), timed and np.isfinite(self.recipe.max_seconds)
        waiting: list[Solution] = []
        new: list[Array] = []
        done = 0
        with stopping() as stop:
            try:
                for aim in self._aims(algorithm):
                    if not (self._left(begun) if timed else done < most):
                        break
                    current().check()
                    done += 1
                    self._attempt(aim, waiting, new)
            except STOPS as reason:
                stop.take(reason)
        self._prove(waiting)
        self.stages += 1
        new = [x for x in new if x.tobytes() in keys(self.xs)]
        inject(algorithm, self.target, new)
        self._fresh = keys(new)
        spent = time.perf_counter() - begun
        self.seconds += spent
        return spent

    # --- what is handed over ---

    def _aims(self, algorithm: Any) -> Iterator[_Aim]:
        """Individuals, gaps and what is beyond the ends in turn, as long as there are any."""
        individuals, gaps, beyond = self._individuals(algorithm), self._gaps(), self._beyond()
        while True:
            found = [aim for aim in (next(individuals, None), next(gaps, None), next(beyond, None)) if aim is not None]
            if not found:
                return
            yield from found

    def _individuals(self, algorithm: Any) -> Iterator[_Aim]:
        """Of the first rank, those in the widest gaps first; now and then one that is far from all proved points."""
        pop = algorithm.pop
        x, excess = pop.get("X").astype(float), np.ravel(pop.get("excess").astype(float))
        fresh = np.array([row.tobytes() not in self._tried for row in x], dtype=bool)
        met = np.flatnonzero((excess <= 0.0) & fresh)
        if not len(met):  # then those that break limits least
            order = np.argsort(excess, kind="stable")
            for i in (i for i in order.tolist() if fresh[i] and excess[i] > 0.0):
                yield self._of_individual("far", x[i])
            return
        f = pop.get("F").astype(float)
        box = self.target.xu - self.target.xl
        left = list(met.tolist())
        while left:
            some = np.array(left)
            if self.rng.uniform() < self.recipe.far_share and self.archive.points:
                apart = (x[some][:, None] - np.array(self.xs)) / np.where(box > 0.0, box, 1.0)
                i, kind = int(some[np.argmax(np.linalg.norm(apart, axis=2).min(axis=1))]), "far"
            else:
                first = [k for k in left if self.archive.gains(f[k]) and not _dominated(f[k], f[met])]
                if not first:
                    return
                i, kind = first[int(np.argmax(self.archive.distances(f[first])))], "first rank"
            left.remove(i)
            yield self._of_individual(kind, x[i])

    def _of_individual(self, kind: str, x: Array) -> _Aim:
        """Along the ray from the nadir through the individual itself."""
        self._tried.add(x.tobytes())
        f, extent = self._f(x), self.archive.extent
        nadir = np.vstack([self.archive.f, f]).max(axis=0)
        near = None if kind == "far" else self.archive.nearest(f)
        return _Aim(kind, x, f, np.maximum(nadir - f, LEAST * extent), near)

    def _gaps(self) -> Iterator[_Aim]:
        """From what is between two proved neighbours towards the best of both."""
        while (pair := self.archive.gap()) is not None:
            one, other = pair
            self.archive.close(one, other)
            yield self._between(one, other)

    def _between(self, one: Known, other: Known) -> _Aim:
        """From the middle of two of one family, whose objectives lie between theirs; else from one of them."""
        goal, worst = np.minimum(one.f, other.f), np.maximum(one.f, other.f)
        if one.solution is None:
            one, other = other, one
        x = 0.5 * (one.x + other.x)
        f = self._f(x)
        alike = bool(((goal <= f) & (f <= worst)).all())
        weights = np.maximum(worst - goal, LEAST * self.archive.extent)
        near = one if one.solution is not None else self.archive.nearest(one.f)
        return _Aim("gap", x if alike else one.x, goal, weights, near, (one, other))

    def _beyond(self) -> Iterator[_Aim]:
        """From each end of what is known outwards: better in its objective, and no more than that worse in others."""
        tried: set[int] = set()
        while not self._complete:
            for k in range(len(self.names)):
                if not self.archive.points:
                    return
                end = self.archive.points[int(np.argmin(self.archive.f[:, k]))]
                size = np.abs(end.f) if len(self.archive.points) == 1 else self.archive.extent
                step = np.maximum(STEP * size, LEAST * self.target.scales)
                goal = end.f.copy()
                goal[k] -= step[k]
                if end.name in self._ended[k] or (goal + step > self.target.worst)[np.arange(len(goal)) != k].any():
                    tried.add(k)
                    continue
                self._ended[k].add(end.name)
                tried.discard(k)
                yield _Aim("beyond", end.x, goal, step, end if end.solution is not None else None)
            if len(tried) == len(self.names):
                return

    # --- what comes of it ---

    def _attempt(self, aim: _Aim, waiting: list[Solution], new: list[Array]) -> None:
        """One aim; of a gap, where it gains nothing, once more from its other side."""
        solution = self._solve(aim)
        if not self._takes(solution) and aim.pair is not None:
            other = aim.pair[1]
            solution = self._solve(replace(aim, x=other.x, near=other if other.solution is not None else None))
        if solution is None or not self._takes(solution):
            return
        self.archive.add(Known(solution.x, self._of(solution), solution))
        self.better += 1
        self._tried.add(solution.x.tobytes())
        new.append(solution.x)
        if solution.audit is None:
            waiting.append(solution)

    def _takes(self, solution: Solution | None) -> bool:
        return solution is not None and self.archive.gains(self._of(solution))

    def _solve(self, aim: _Aim) -> Solution | None:
        """A solution, with the neighbour's instants and multipliers first, then without; None where there is none."""
        signs = self.target.signs
        goal = attainment(self.names, aim.goal * signs, aim.weights)
        known = aim.near.solution if aim.near is not None else None
        plain = replace(self.recipe.solver, prove=self._at_once)
        tries = [(plain, None)] if known is None else [(replace(plain, first=known.instants), known), (plain, None)]
        for solver, warm in tries:
            self.kinds[aim.kind] += 1
            solution = solver.solve(self.problem, goal, aim.x, warm=warm).own
            self._count(goal, solution)
            if solution.ok and (solution.audit is None or solution.audit.proved):
                return solution
        return None

    def _count(self, goal: Any, solution: Solution) -> None:
        self.recipe.found(of_solve(goal, solution))
        self.solves += 1
        self.iterations += solution.iterations
        self.failed += not solution.ok

    def _prove(self, waiting: list[Solution]) -> None:
        """Proves together what was found without; what is not proved is taken out again."""
        audited = audit_points(self.problem, [solution.x for solution in waiting])
        for solution, (path, audit) in zip(waiting, audited, strict=True):
            if not audit.proved:
                self.archive.drop(solution.x)
                self.better -= 1
                continue
            proved = replace(solution, trajectory=path, audit=audit)
            self.archive.points = [
                replace(p, solution=proved) if p.solution is solution else p for p in self.archive.points
            ]

    def _of(self, solution: Solution) -> Array:
        return np.array([solution.objectives[name] for name in self.names]) * self.target.signs

    def _f(self, x: Array) -> Array:
        values = evaluate_objectives(self.problem, x)
        return np.array([values[name] for name in self.names]) * self.target.signs


def _dominated(f: Array, others: Array) -> bool:
    """Whether one of ``others (N, objectives)`` is as good in all and better in one."""
    return bool(((others <= f).all(axis=1) & (others < f).any(axis=1)).any())
