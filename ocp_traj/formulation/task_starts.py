"""``[solve] start`` of a task: where the optimiser begins, when that is not the usual guess."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.ways import OMPL, PLAN, TOUCHING, Ways
from ocp_traj.robot.robot import Robot

AUTO, STRAIGHT = "auto", "straight"
SAMPLES = 200  # postures of a guess that are looked at: our choice


def ways_of(task: Task, robot: Robot, points: Array, clearances: tuple[ClearanceConstraint, ...]) -> Ways:
    """The ways of a resolved task, from via point to via point ``(L + 1, n)``."""
    start = task.solve.start
    given = None if isinstance(start, str) else np.array(start)
    return Ways(points, robot, clearances, OMPL if start == OMPL else PLAN, given, task.name)


def with_start(
    problem: Problem, task: Task, made: Parametrisation, points: Array, clearances: tuple[ClearanceConstraint, ...]
) -> Problem:
    """A problem whose random starts are what the task asks for.

    Args:
        problem: of the task; its variables may go on after the curve's.
        task: resolved.
        made: its curve.
        points: via points ``(L + 1, n)``.
        clearances: that it keeps.
    """
    start, usual, along = task.solve.start, problem.guess, made.guess_along
    if start == AUTO and (along is None or not clearances):
        return problem
    if along is None:
        raise InputError(
            f"{task.name}: [solve] start is not of a {task.curve.kind} curve, whose guess is one path; leave it out, or "
            "take auto, quintic, septic or nonic"
        )
    if start in (PLAN, OMPL) and not clearances:
        raise InputError(f'{task.name}: [solve] start = "{start}" plans past obstacles, and there is no [collision]')
    if start == STRAIGHT:
        return replace(problem, guess=lambda rng: _completed(made.guess(rng), usual(rng)))
    ways = ways_of(task, problem.robot, points, clearances)
    lower, upper = problem.lower, problem.upper

    def guess(rng: np.random.Generator) -> Array:
        x = usual(rng)
        if start == AUTO:
            curve = made.curve(x[: sum(len(v.labels) for v in made.variables)])
            if ways.scan(0.0).least(curve(np.linspace(0.0, curve.duration, SAMPLES))).min() >= -TOUCHING:
                return x
        return np.asarray(np.clip(_completed(along(rng, ways), x), lower, upper))

    return replace(problem, guess=guess)


def _completed(curve: Array, x: Array) -> Array:
    """Variables of the curve, those after them of a whole start."""
    return np.concatenate([curve, x[len(curve) :]])
