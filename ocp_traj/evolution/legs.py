"""Populations that walk where they cannot jump: leg after leg, each in coordinates about one of the best so far.

Where a problem has one guess, and no step from it in the box of the variables keeps the limits, no crossover and no
mutation gets anywhere. Such a run is made of legs: a frame about a trajectory that keeps the limits (``local_frame``),
and some generations in its coordinates. The next one is about another of the best that were found, so that the
population goes on along the bends.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

import numpy as np
import pandas as pd
from pymoo.operators.survival.rank_and_crowding.metrics import get_crowding_function
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import Evolution, PymooProblem, evolve, gains_on
from ocp_traj.evolution.local_frame import LocalFrame
from ocp_traj.evolution.population import Population
from ocp_traj.progress import Progress
from ocp_traj.results.records import Found, ignore, of_population
from ocp_traj.transcription.symbolic import degrees

LEG = 40  # generations: our choice
NEAR, FAR = 1e-4, 1e-1  # of a variable's range: steps from what is known, evenly in their logarithm; our choice
LEAST = 1e-2  # of a frame's reach, a first step in it, likewise; our choice
TRIED = 100  # such steps: our choice
# Of a leg's first generation: points that are known, and steps on from one of these as far again as another is off, up
# to twice; the others are random steps from the reference. Our choice.
MEMBERS, FURTHER, TWICE = 0.4, 0.3, 2.0
CLOSER = 1.5  # times the degree: instants a segment, so that a step that is as long as limits allow allows no more


def stuck(target: PymooProblem, first: Array, rng: np.random.Generator) -> Array | None:
    """Where a first generation ``(N, n)`` can only stay: its one point, where no step from it keeps the limits.

    None where it is not one point, or that point breaks a limit itself.
    """
    if (first != first[0]).any():
        return None
    sizes = NEAR * (FAR / NEAR) ** rng.uniform(size=(TRIED, 1))
    steps = sizes * (target.xu - target.xl) * rng.standard_normal((TRIED, target.problem_size))
    tried = target.meant(np.concatenate([first[:1], np.clip(first[0] + steps, target.xl, target.xu)]))
    kept = _kept(target, tried)
    return np.asarray(tried[0]) if kept[0] and not kept[1:].any() else None


def _kept(target: PymooProblem, x: Array) -> Array:
    """Which individuals ``(N, n)`` break nothing and are within the reference point."""
    found = target.population.evaluate(x)
    f = found.objectives * target.signs
    met = (found.violations <= target.tolerance).all(axis=1) & np.isfinite(f).all(axis=1)
    return np.asarray(met & (target.beyond(f) <= 0.0).all(axis=1))


def _closer(target: PymooProblem) -> PymooProblem:
    """The same with more instants, and peaks between them."""
    known = target.population
    most = max(known.per_segment, *(ceil(CLOSER * degree) for degree in degrees(known.problem)))
    other = copy.copy(target)
    other.population = Population(known.problem, known.names, most, refine=True)
    return other


class Walk:
    """The points a walk has found, and the frame it is in.

    Args:
        target: the problem in its own variables.
        known: points ``(n,)`` that keep the limits, one or more.
        population: individuals.
        rng: of references and first generations.
    """

    def __init__(self, target: PymooProblem, known: Sequence[Array], population: int, rng: np.random.Generator) -> None:
        """Stands where it begins; see the class."""
        self.target = self.plain = _closer(target)
        self.population, self.rng = population, rng
        self.xs, self.f = np.empty((0, target.problem_size)), np.empty((0, target.n_obj))
        self.legs = 0
        self.add(np.array(known))

    def add(self, xs: Array) -> None:
        """Takes points ``(M, n)`` that keep the limits in; of all, those stay that nothing dominates, well spaced."""
        if not len(xs):
            return
        f = self.plain.population.evaluate(xs, limits=False).objectives * self.plain.signs
        xs, f = np.concatenate([self.xs, xs]), np.concatenate([self.f, f])
        f, first = np.unique(f, axis=0, return_index=True)
        xs = xs[first]
        best = NonDominatedSorting().do(f, only_non_dominated_front=True)
        xs, f = xs[best], f[best]
        while len(xs) > self.population:
            crowded = int(np.argmin(get_crowding_function("cd").do(f)))
            xs, f = np.delete(xs, crowded, axis=0), np.delete(f, crowded, axis=0)
        self.xs, self.f = xs, f

    def step(self, reference: Array | None = None) -> Array:
        """A frame for the next leg, about a reference or one of the best in turn, and a first generation in it."""
        if reference is None:
            turn = self.legs % (self.plain.n_obj + 1)
            i = int(np.argmin(self.f[:, turn])) if turn < self.plain.n_obj else int(self.rng.integers(len(self.xs)))
            reference = self.xs[i]
        self.legs += 1
        plain = self.plain
        frame = LocalFrame(
            plain.population.problem, plain.population, reference, (plain.xl, plain.xu), plain.inactive, plain.tolerance
        )
        self.target = self.target.within(frame)
        z = frame.z(self.xs)
        near = z[(np.abs(z) <= 1.0).all(axis=1)]
        members = near[self.rng.permutation(len(near))][: max(int(MEMBERS * self.population), 1) - 1]
        pairs = self.rng.integers(len(near), size=(2, int(FURTHER * self.population) * (len(near) > 1)))
        apart = self.rng.uniform(0.0, TWICE, (pairs.shape[1], 1)) * (near[pairs[0]] - near[pairs[1]])
        further = np.clip(near[pairs[0]] + apart, -1.0, 1.0)
        count = self.population - 1 - len(members) - len(further)
        sizes = LEAST ** self.rng.uniform(size=(count, 1))
        steps = self.rng.standard_normal((count, frame.size))
        steps *= sizes / np.linalg.norm(steps, axis=1, keepdims=True)
        return np.concatenate([frame.z(reference[None]), members, further, steps])


def evolved(
    make: Callable[[Array], Any], target: PymooProblem, first: Array, generations: int, seed: int, max_seconds: float,
    progress: Progress, before: Any = None, found: Found = ignore,
) -> Evolution:  # fmt: skip
    """``evolve`` from a first generation, or a walk where that can only stay where it is.

    Args:
        make: an algorithm of pymoo from its first generation ``(N, n)``.
        target: the problem; what a walk evaluates counts as its own.
        first: generation ``(N, n)``.
        generations: how many, of all legs.
        seed: of everything random.
        max_seconds: stop after the generation that passes this.
        progress: told after each generation.
        before: called with the algorithm and the number of the generation before it.
        found: given a record of the best individuals of several objectives, of a walk after each leg.
    """
    begun = time.perf_counter()
    start = stuck(target, first, np.random.default_rng([seed, 1]))
    left = max_seconds - (time.perf_counter() - begun)
    if start is None:
        return evolve(make(first), target, generations, seed, left, progress, before, found=found)
    rng = np.random.default_rng([seed, 2])
    walk = Walk(target, [start], len(first), rng)
    began, histories, champions, done = walk.f, [], [], 0
    while True:

        def shown(generation: int, _: int | None, words: str, offset: int = done) -> None:
            progress(offset + generation, generations, words)

        def told(algorithm: Any, generation: int, offset: int = done) -> None:
            if before is not None:
                before(algorithm, offset + generation)

        members = walk.step()
        left = max(max_seconds - (time.perf_counter() - begun), 0.0)
        leg = min(LEG, generations - done)
        run = evolve(make(members), walk.target, leg, seed + walk.legs, left, shown, told)
        walk.add(run.best)
        if target.n_obj > 1:
            found(of_population(walk.xs))  # of all legs: the last record counts
        histories.append(run.history)
        champions.append(run.champions)
        done += len(run.history)
        if run.interrupted or done >= generations or time.perf_counter() - begun >= max_seconds:
            break
    history = pd.concat(histories, ignore_index=True).rename_axis("generation")
    best = np.fmin.accumulate(history["best"])
    # A leg that found nothing better than the ones before it goes on with their champion.
    better = np.maximum.accumulate(np.where(history["best"] <= best, np.arange(len(best)), 0))
    history["best"] = best
    target.seconds, target.calls, target.individuals = (
        getattr(walk.target, name) for name in ("seconds", "calls", "individuals")
    )
    return Evolution(
        walk.xs, history, time.perf_counter() - begun, run.interrupted and done < generations,
        gains_on(walk.f, began), walk.target.meant(run.last), np.concatenate(champions)[better], walk.legs, start,
    )  # fmt: skip
