"""Local optima: the distinct ones among many solutions of one problem, and how many starts ended in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.problem import Problem
from ocp_traj.results.solution import Optimum, Solution
from ocp_traj.transcription.nlp import Status

SAME_VALUE = 1e-6  # relative: objectives further apart make two optima; our choice, 100 x what exchange leaves open
SAME_CURVE = 1e-2  # of the joints' ranges: curves of one value closer than this are one optimum; our choice


class First(Protocol):
    """What the first NLP of a start has ended with."""

    @property
    def f(self) -> float:
        """The value of its objective."""


def distinct(problem: Problem, solutions: Sequence[Solution], solves: int = 1) -> tuple[Optimum, ...]:
    """The distinct ones among converged solutions, best first; ``solves`` solutions belong to each start.

    Two are one optimum where their values agree to ``SAME_VALUE`` and either their curves to ``SAME_CURVE`` or, where
    the problem tells them apart, their homotopy classes: a joint that an objective does not see makes a continuum.
    """
    found: list[Optimum] = []
    ended: list[set[int]] = []  # which starts
    all_own = [(i // solves, s.own) for i, s in enumerate(solutions)]
    usable = [(start, s) for start, s in all_own if s.status is Status.SOLVED and s.trajectory]
    proved_first = sorted(usable, key=lambda entry: (entry[1].audit is None or not entry[1].audit.proved, entry[1].f))
    for start, solution in proved_first:
        one = _optimum(problem, solution)
        for known, starts in zip(found, ended, strict=True):
            if known.solution is solution or _same(known, one):
                starts.add(start)
                break
        else:
            found.append(one)
            ended.append({start})
    counted = [replace(optimum, starts=len(starts)) for optimum, starts in zip(found, ended, strict=True)]
    return tuple(sorted(counted, key=lambda optimum: optimum.solution.f))


def with_sampled(
    problem: Problem, optima: Sequence[Optimum], pairs: Sequence[tuple[First, Solution]]
) -> tuple[Optimum, ...]:
    """The optima with their ``sampled``, counted by value, from pairs (solution of the first NLP, what it led to)."""
    values: list[list[float]] = [[] for _ in optima]
    for first, solution in pairs:
        if solution.status is not Status.SOLVED or solution.trajectory is None:
            continue
        one = _optimum(problem, solution)
        for optimum, seen in zip(optima, values, strict=True):
            if optimum.solution is solution or _same(optimum, one):
                if all(abs(first.f - value) > SAME_VALUE * max(abs(value), 1e-300) for value in seen):
                    seen.append(first.f)
                break
    return tuple(replace(optimum, sampled=len(seen)) for optimum, seen in zip(optima, values, strict=True))


def _optimum(problem: Problem, solution: Solution) -> Optimum:
    """A solution with a trajectory, as the optimum that one start has led to."""
    motion, tell = solution.trajectory, problem.about.homotopy_class
    return Optimum(solution, 1, tell(motion) if tell is not None and motion is not None else "")


def _same(known: Optimum, other: Optimum) -> bool:
    one, two = known.solution, other.solution
    if abs(one.f - two.f) > SAME_VALUE * max(abs(two.f), 1e-300):
        return False
    if other.homotopy_class:
        return known.homotopy_class == other.homotopy_class
    assert one.trajectory is not None and two.trajectory is not None
    return distance(one.trajectory.curve, two.trajectory.curve) <= SAME_CURVE


def distance(one: PiecewiseBezier, other: PiecewiseBezier) -> float:
    """Largest difference of two curves at like fractions of their time, as a share of each joint's range of motion."""
    share = np.linspace(0.0, 1.0, 201)
    a, b = one(share * one.duration), other(share * other.duration)
    size = np.maximum(np.ptp(a, axis=0), np.ptp(b, axis=0))
    gap = np.abs(a - b).max(axis=0)
    return float((gap / np.where(size > 1e-9, size, 1.0)).max())
