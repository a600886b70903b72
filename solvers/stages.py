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
    """One local solve: from ``x``, towards ``goal`` with ``weights``, less is better; ``near`` lends its multipliers."""

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
        rng: of what is random.
    """

    def __init__(
        self, recipe: Recipe, problem: Problem, objectives: tuple[str, ...], target: PymooProblem,
        ends: Sequence[Array], rng: np.random.Generator,
    ) -> None:  # fmt: skip
        self.recipe, self.problem, self.names, self.target, self.rng = recipe, problem, objectives, target, rng
        self.archive = Archive(len(objectives), target.scales)
        for x in ends:
            self.archive.add(Known(x, self._f(x)))
        self.seconds = self.seconds_within = 0.0
        self.solves = self.iterations = self.failed = self.better = self.stages = 0
        self.injected = self.survived = 0
        self.kinds = {"first rank": 0, "far": 0, "gap": 0}
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
        waiting: list[tuple[_Aim, Solution]] = []
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
        self._prove(waiting, new)
        self.stages += 1
        new = [x for x in new if x.tobytes() in keys(self.xs)]
        inject(algorithm, self.target, new)
        self._fresh = keys(new)
        spent = time.perf_counter() - begun
        self.seconds += spent
        return spent

    # --- what is handed over ---

    def _aims(self, algorithm: Any) -> Iterator[_Aim]:
        """Individuals and gaps in turn, as long as there are any."""
        individuals, gaps = self._individuals(algorithm), self._gaps()
        while True:
            found = [aim for aim in (next(individuals, None), next(gaps, None)) if aim is not None]
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
        near = self.archive.nearest(f) if self.archive.points else None
        return _Aim(kind, x, f, np.maximum(nadir - f, LEAST * extent), near if kind != "far" else None)

    def _gaps(self) -> Iterator[_Aim]:
        """From what is between two proved neighbours towards the best of both."""
        while (pair := self.archive.gap()) is not None:
            one, other = pair
            self.archive.close(one, other)
            yield self._between(one, other, pair)

    def _between(self, one: Known, other: Known, pair: tuple[Known, Known]) -> _Aim:
        goal = np.minimum(one.f, other.f)
        x = 0.5 * (one.x + other.x)
        f, worst = self._f(x), np.maximum(one.f, other.f)
        alike = bool(((goal <= f) & (f <= worst)).all())
        weights = np.maximum(worst - goal, LEAST * self.archive.extent)
        return _Aim("gap", x if alike else one.x, goal, weights, one, pair)

    # --- what comes of it ---

    def _attempt(self, aim: _Aim, waiting: list[tuple[_Aim, Solution]], new: list[Array]) -> None:
        """One aim; of a gap, where it gains nothing, once more from its other side."""
        solution = self._solve(aim)
        if not self._takes(solution) and aim.pair is not None:
            one, other = aim.pair
            solution = self._solve(replace(aim, x=other.x, near=other))
        if solution is None or not self._takes(solution):
            return
        point = self._add(solution, new)
        if solution.audit is None:
            waiting.append((aim, solution))
            assert point is not None

    def _takes(self, solution: Solution | None) -> bool:
        return solution is not None and self.archive.gains(self._of(solution))

    def _add(self, solution: Solution, new: list[Array]) -> Known | None:
        point = Known(solution.x, self._of(solution), solution)
        if not self.archive.add(point):
            return None
        self.better += 1
        self._tried.add(point.x.tobytes())
        new.append(point.x)
        return point

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

    def _prove(self, waiting: list[tuple[_Aim, Solution]], new: list[Array]) -> None:
        """Proves together what was found without; what is not proved is taken out again."""
        left = [solution for _, solution in waiting]
        for solution, (path, audit) in zip(
            left, audit_points(self.problem, [solution.x for solution in left]), strict=True
        ):
            for i, point in enumerate(self.archive.points):
                if point.solution is solution:
                    if audit.proved:
                        proved = replace(solution, trajectory=path, audit=audit)
                        self.archive.points[i] = replace(point, solution=proved)
                    else:
                        del self.archive.points[i]
                        self.archive.f = np.delete(self.archive.f, i, axis=0)
                        self.better -= 1
                    break

    def _of(self, solution: Solution) -> Array:
        return np.array([solution.objectives[name] for name in self.names]) * self.target.signs

    def _f(self, x: Array) -> Array:
        values = evaluate_objectives(self.problem, x)
        return np.array([values[name] for name in self.names]) * self.target.signs


def _dominated(f: Array, others: Array) -> bool:
    """Whether one of ``others (N, objectives)`` is as good in all and better in one."""
    return bool(((others <= f).all(axis=1) & (others < f).any(axis=1)).any())
