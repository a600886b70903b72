"""Evolution of populations through pymoo: the problem as it sees it, and the loop that all methods share.

Limits are looked at on a few instants a segment: what they miss between them is for the audit to find, and for a
dilation to mend.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pandas as pd
import pymoo.core.problem

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.evolution.dilation import Dilation
from ocp_traj.evolution.local_frame import LocalFrame
from ocp_traj.evolution.population import Population
from ocp_traj.evolution.search_box import search_box
from ocp_traj.formulation.problem import Problem
from ocp_traj.progress import Progress
from ocp_traj.results.records import Found, ignore, of_population
from ocp_traj.results.time_scaling import TimeScaling
from ocp_traj.stopping import STOPS, stopping
from ocp_traj.transcription.symbolic import degrees

# Between two records of a population: seconds, or this share of the time so far where that is longer; our choice.
EVERY, SHARE = 1.0, 0.05
WORST = 1e12  # finite stand-in for a value that could not be computed: NaN would reach the front
SAME = 1e-9  # relative: a value better by less is the same; our choice
# Feasibility: Deb's rules, the feasible before the infeasible. Penalty: the sum of excesses, weighted, on top of the
# objective. Death: an infeasible individual is as bad as any other. Dominated: any feasible one is better than it.
HANDLING = ("feasibility", "penalty", "death", "dominated")


class PymooProblem(pymoo.core.problem.Problem):  # type: ignore[misc]  # pymoo is untyped
    """A problem as pymoo sees it: a generation a call, every limit a constraint, objectives to be minimised.

    It has a box of finite bounds, see ``search_box``, which holds the points that are ``known``.

    Attributes:
        handling: of constraints, one of ``HANDLING``.
        weight: of ``penalty``, in units of the objectives' scales.
        tolerance: excess of a limit, in its scale, that is overlooked.
        dilation: slows individuals down that break a limit, which changes them; None for none.
        frame: whose coordinates individuals are given in; None for the problem's own variables.
        seconds, calls, individuals: spent on evaluation.
        last: the individuals of the last call, their first objective and sums of excesses.
    """

    def __init__(
        self, problem: Problem, objectives: Sequence[str], per_segment: int,
        handling: str = "feasibility", weight: float = 1e3, refine: bool = False, scaling: bool = False,
        tolerance: float = 0.0, known: Sequence[Array] = (), dilate: bool = False,
    ) -> None:  # fmt: skip
        if handling not in HANDLING:
            raise InputError(f"constraint handling is {handling!r}; allowed are {', '.join(HANDLING)}")
        self.handling, self.weight, self.tolerance = handling, weight, tolerance
        self.last: tuple[Array, Array, Array] = (np.empty((0, problem.size)), np.empty(0), np.empty(0))
        # Of a curve of high degree fewer instants hide too much: evolution goes where nobody looks.
        self.population = Population(problem, objectives, max(per_segment, *degrees(problem)), refine)
        self.scaling = TimeScaling(problem) if scaling else None
        self.dilation = Dilation(problem, self.population, tolerance) if dilate else None
        self.frame: LocalFrame | None = None
        self.inactive, self.least = problem.inactive(objectives), problem.lower
        chosen = [problem.objective(name) for name in objectives]
        self.signs = np.array([1.0 if o.sense == "min" else -1.0 for o in chosen])
        self.scales = np.array([o.scale for o in chosen])
        # Beyond its reference point an objective is not worth having; alone, it needs no such bound.
        bounds = problem.reference_point if len(chosen) > 1 else {}
        self.worst = np.array([self.signs[i] * bounds.get(o.id, np.inf) for i, o in enumerate(chosen)])
        self.seconds, self.calls, self.individuals = 0.0, 0, 0
        rows = sum(len(limit.labels) for limit in problem.path_limits)
        self.problem_size, box = problem.size, search_box(problem, known)
        super().__init__(
            n_var=problem.size,
            n_obj=len(chosen),
            n_ieq_constr=rows + int(np.isfinite(self.worst).sum()) if handling == "feasibility" else 0,
            xl=box[0],
            xu=box[1],
        )

    def meant(self, x: Array) -> Array:
        """Decision vectors ``(N, n)`` of individuals, as they are evaluated.

        Slacks of objectives that are not traded are put at their lower bounds; time is scaled if wanted.
        """
        x = x if self.frame is None else self.frame.x(x)
        fixed = np.where(self.inactive, self.least, x)
        return fixed if self.scaling is None else self.scaling.apply(fixed)

    def within(self, frame: LocalFrame) -> Self:
        """The same of individuals in the coordinates of a frame, of which none is slowed down."""
        other = copy.copy(self)
        other.frame, other.dilation, other.n_var = frame, None, frame.size
        other.xl, other.xu = -np.ones(frame.size), np.ones(frame.size)
        return other

    def beyond(self, f: Array) -> Array:
        """By how much objectives ``(N, objectives)``, less is better, exceed the reference point, in their scales."""
        bounded = np.isfinite(self.worst)
        return np.asarray((f[:, bounded] - self.worst[bounded]) / self.scales[bounded])

    def handled(self, f: Array, excess: Array) -> Array:
        """Objectives ``(N, objectives)`` as the ``handling`` has them for a sum of excesses ``(N,)``."""
        if self.handling == "penalty":
            return f + self.weight * self.scales * excess[:, None]
        if self.handling == "death":
            return np.where(excess[:, None] > 0.0, WORST, f)
        if self.handling == "dominated":  # beyond every feasible point, and the farther the more it is broken
            return np.where(excess[:, None] > 0.0, WORST * (1.0 + np.minimum(excess, WORST)[:, None]), f)
        return f

    def _evaluate(self, x: Array, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        begun = time.perf_counter()
        x = self.meant(x)
        evaluation = self.population.evaluate(x)
        if self.dilation is not None:
            x, evaluation = self.dilation.apply(x, evaluation)
            out["X"] = x  # the individuals themselves: their descendants inherit it
        f = evaluation.objectives * self.signs
        g = np.concatenate([evaluation.violations, self.beyond(f)], axis=1)
        broken = ~np.isfinite(f).all(axis=1)
        g[broken] = WORST
        f = np.where(np.isfinite(f), f, WORST)
        g = np.clip(np.where(np.isnan(g), WORST, g - self.tolerance), -WORST, WORST)
        excess = np.maximum(g, 0.0).sum(axis=1)
        if self.handling == "feasibility":
            out["G"] = g
        f = self.handled(f, excess)
        out["F"], out["excess"] = f, excess
        self.last = (x, f[:, 0], excess)
        self.seconds += time.perf_counter() - begun
        self.calls += 1
        self.individuals += len(x)


@dataclass(frozen=True, eq=False)
class Evolution:
    """How a run went.

    Attributes:
        best: decision vectors ``(M, n)`` of the feasible individuals that are best (not dominated); M may be 0.
        history: a row a generation: ``evaluations``, ``best`` (least feasible value so far of the first objective, NaN
            where there is none) and ``violation`` (least sum of excesses in the generation).
        seconds: spent.
        interrupted: whether Ctrl-C ended it before its last generation.
        moved: whether it found anything better than its first generation: a feasible individual that none of the first
            is as good as in every objective, to ``SAME``.
        last: individuals ``(N, n)`` of the last population; the least broken first, of those the best in the first
            objective.
        champions: decision vectors ``(generations, n)`` of the best feasible individual so far in the first objective;
            NaN where there is none.
        legs: frames in which it walked, see ``legs``; 0 where it searched in the problem's own variables.
        start: from where it walked ``(n,)``; None where it did not.
    """

    best: Array
    history: pd.DataFrame
    seconds: float
    interrupted: bool
    moved: bool
    last: Array
    champions: Array
    legs: int = 0
    start: Array | None = None

    def reached(self, value: float) -> int | None:
        """Evaluations after which the best value was at most this, or None."""
        rows = self.history[self.history["best"] <= value]
        return int(rows["evaluations"].iloc[0]) if len(rows) else None


def evolve(
    algorithm: Any, target: PymooProblem, generations: int, seed: int, max_seconds: float, progress: Progress,
    before: Any = None, after: Callable[[Any], bool] | None = None, found: Found = ignore,
) -> Evolution:  # fmt: skip
    """Runs a pymoo algorithm for some generations, or some time; Ctrl-C ends it early with what it has.

    Args:
        algorithm: of pymoo.
        target: the problem.
        generations: how many.
        seed: of everything random in the algorithm.
        max_seconds: stop after the generation that passes this.
        progress: told after each generation.
        before: called with the algorithm and the number of the generation before it.
        after: called with the algorithm after each generation; the run ends where it says so.
        found: given a record of the best individuals of several objectives, now and then and at the end.
    """
    begun = told = time.perf_counter()
    algorithm.setup(target, termination=("n_gen", generations), seed=seed, verbose=False)
    rows: list[tuple[int, float, float]] = []
    least = np.nan
    champion: Array | None = None
    champions: list[Array] = []
    begun_with = np.empty((0, target.n_obj))

    def feasible() -> Array:
        """Objectives ``(M, objectives)`` of the best so far, less is better."""
        if target.n_obj == 1:
            return np.array([[least]])[[champion is not None]]
        if algorithm.opt is None or not len(algorithm.opt) or not algorithm.opt.has("excess"):
            return np.empty((0, target.n_obj))
        met = np.ravel(algorithm.opt.get("excess").astype(float)) <= 0.0
        return np.asarray(algorithm.opt.get("F").astype(float)[met])

    with stopping(max_seconds) as stop:
        try:
            while algorithm.has_next() and not stop.due:
                if before is not None:
                    before(algorithm, len(rows))
                algorithm.next()
                x, f, excess = target.last
                met = excess <= 0.0
                if met.any() and not f[met].min() >= least:
                    least = float(f[met].min())
                    champion = np.array(x[met][np.argmin(f[met])], dtype=float)
                rows.append((target.individuals, least, float(excess.min())))
                champions.append(np.full(target.problem_size, np.nan) if champion is None else champion)
                if len(rows) == 1:
                    begun_with = feasible()
                now = time.perf_counter()
                if target.n_obj > 1 and now - told >= max(EVERY, SHARE * (now - begun)):
                    _tell(found, _best(algorithm, target))
                    told = now
                over = after is not None and after(algorithm)
                progress(len(rows), generations, f"best {least:.6g}" if np.isfinite(least) else "nothing feasible yet")
                if over:
                    break
        except STOPS as reason:
            stop.take(reason)
        interrupted = algorithm.has_next() and stop.tell()
    if target.n_obj > 1:
        best = _best(algorithm, target) if rows else np.empty((0, target.problem_size))
        _tell(found, best)
    else:
        best = champion[None] if champion is not None else np.empty((0, target.problem_size))
    history = pd.DataFrame(rows, columns=["evaluations", "best", "violation"]).rename_axis("generation")
    moved = gains_on(feasible(), begun_with)
    return Evolution(
        best, history, time.perf_counter() - begun, interrupted, moved, _last(algorithm, target),
        np.reshape(champions, (len(rows), target.problem_size)),
    )  # fmt: skip


def gains_on(values: Array, on: Array) -> bool:
    """Whether one of some values ``(M, objectives)`` is better than each of others ``(N, objectives)`` in something."""
    better = np.any(values[:, None] < on - SAME * np.abs(on), axis=2)  # (M, N)
    return bool(np.any(np.all(better, axis=1)))


def _best(algorithm: Any, target: PymooProblem) -> Array:
    """The feasible and non-dominated individuals ``(M, n)``, as they are evaluated."""
    best = algorithm.opt
    if best is None or not len(best) or not best.has("excess"):
        return np.empty((0, target.problem_size))
    met = np.ravel(best.get("excess").astype(float)) <= 0.0
    return target.meant(np.atleast_2d(best.get("X").astype(float))[met])


def _last(algorithm: Any, target: PymooProblem) -> Array:
    """The population, see ``Evolution.last``."""
    pop = algorithm.pop
    if pop is None or not len(pop) or not pop.has("excess"):
        return np.empty((0, target.problem_size))
    order = np.lexsort((pop.get("F").astype(float)[:, 0], np.ravel(pop.get("excess").astype(float))))
    return np.asarray(pop.get("X").astype(float)[order])


def _tell(found: Found, best: Array) -> None:
    if len(best):
        found(of_population(best))
