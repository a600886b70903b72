"""``[solve] start`` of a task: where the optimiser begins, when that is not the usual guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.families import hermite
from ocp_traj.curves.stops import with_stops
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.polylines import clear_polyline
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.route import route_of
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.ways import MOST, OMPL, PLAN, TOUCHING, Ways, reach_of
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
    each = len(made.variables[0].labels) == sum(map(len, made.legs))  # a duration a piece
    stops = each and stops_at_corners(task, clearances)

    def guess(rng: np.random.Generator) -> Array:
        x = usual(rng)
        if start == AUTO:
            curve = made.curve(x[: sum(len(v.labels) for v in made.variables)])
            if ways.scan(0.0).least(curve(np.linspace(0.0, curve.duration, SAMPLES))).min() >= -TOUCHING:
                return x
        stopping = stopping_start(made, ways, rng) if stops else None
        return np.asarray(np.clip(_completed(along(rng, ways) if stopping is None else stopping, x), lower, upper))

    return replace(problem, guess=guess, tuning=replace(problem.tuning, descends=stops))


def stops_at_corners(task: Task, clearances: Sequence[Any]) -> bool:
    """Whether random starts of a task are polylines past obstacles, with a stop at every corner."""
    start = task.solve.start
    return bool(clearances) and (start in (PLAN, OMPL) if isinstance(start, str) else True)


def stopping_start(made: Parametrisation, ways: Ways, rng: np.random.Generator) -> Array | None:
    """Variables of the curve for a polyline on each leg, with a stop at every corner.

    None where there is none of so few edges as a leg has pieces, or where the ends are not at rest.
    """
    if made.dilate is None:
        return None
    base, rows, reach = made.curve(made.guess(rng)), made.continuity + 1, reach_of(ways.robot.limits)
    durations = np.array(base.durations, dtype=float)
    ends = [(k, 0.0) for k in range(base.segments)] + [(base.segments - 1, 1.0)]
    states = np.array([[base.at(k, np.array([u]), order)[0] for order in range(rows)] for k, u in ends])
    for i, leg in enumerate(made.legs):
        path = clear_polyline(ways, i, len(leg), rng)
        driven = None if path is None else with_stops(path, reach, rows, len(leg))
        if driven is None:
            return None
        durations[leg.start : leg.stop], states[leg.start : leg.stop + 1] = driven
    return made.variables_of(hermite(list(states), durations))


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
