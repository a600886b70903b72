"""``[solve] start`` of a task: where the optimiser begins, when that is not the usual guess."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.route import route_of
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.ways import MOST, OMPL, PLAN, TOUCHING, Ways
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
            f"{task.name}: [solve] start is not of a {task.curve.kind} curve, whose guess is one path; leave it out, "
            "or take auto, quintic, septic or nonic"
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


def planned_path(problem: Problem, planner: str, seed: int) -> Array:
    """A path ``(W, n)`` past obstacles through the points of a task's moves.

    Args:
        problem: of a task.
        planner: ``PLAN`` or ``OMPL``.
        seed: of its random numbers.

    Raises:
        InputError: there is nothing to plan past.
        NoSolutionFound: no path was found.
    """
    task, limits = problem.case, problem.requirements.clearance_constraints
    if not limits:
        raise InputError(f"{task.name} has no [collision]: there is nothing to plan past")
    points = route_of(task, problem.robot.size).points
    ways = Ways(points, problem.robot, limits, planner, None, task.name)
    rng = np.random.default_rng(seed)
    legs = []
    for i in range(len(points) - 1):
        leg = ways.planned(i, rng)
        if leg is None:
            raise NoSolutionFound(
                f"{task.name}: no way was found from point {i + 1} to point {i + 2} in {MOST} postures; try another "
                "--seed, or give a via point between"
            )
        legs.append(leg if i == 0 else leg[1:])
    return np.concatenate(legs)


def _completed(curve: Array, x: Array) -> Array:
    """Variables of the curve, those after them of a whole start."""
    return np.concatenate([curve, x[len(curve) :]])
