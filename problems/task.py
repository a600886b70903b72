"""A user's own robot and path: the problem of a task file, ``ocp-traj/task/1``.

Decision variables  of the task's curve: durations, and states at knots; the payload's mass where it is freed
Objectives          time, work, energy, effort, movement, acceleration, jerk, length and evenness of the tool's path,
                    clearance; a weighted sum of them
Subject to          the limits of the task, rest or given derivatives at the ends, its points
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np

from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation import standard
from ocp_traj.formulation.about import About
from ocp_traj.formulation.curve_variables import variables_of
from ocp_traj.formulation.global_cubic import global_cubic
from ocp_traj.formulation.knot_states import knot_states
from ocp_traj.formulation.knots import NEAR
from ocp_traj.formulation.levels import levels_of, usual_levels
from ocp_traj.formulation.move_path import RETIMED_FACTOR, retimed_path, retimed_pieces
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import (
    ORDERS,
    DurationConstraint,
    Expression,
    PathConstraint,
    PointConstraint,
    Requirements,
)
from ocp_traj.formulation.retiming import retiming
from ocp_traj.formulation.route import Route, exact_points, route_of
from ocp_traj.formulation.stretches import stretches_of
from ocp_traj.formulation.surroundings import tool_paths
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.task_collision import Clear, collision_notes, with_clearance
from ocp_traj.formulation.task_file import changed, read_task, task_of, told
from ocp_traj.formulation.task_objectives import objectives_of, worst_values
from ocp_traj.formulation.task_payload import carried, payload_notes
from ocp_traj.formulation.task_resolution import resolve
from ocp_traj.formulation.task_starts import stops_at_corners, with_start
from ocp_traj.formulation.tool_clear import require_tool_clear
from ocp_traj.formulation.tool_limits import enough_pieces, tool_limits, tool_speed_limit, tool_tuning
from ocp_traj.formulation.tool_words import tool_figures, tool_notes
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.robot.inertias import missing_inertias, require_exact, require_inertias
from ocp_traj.robot.numbers import from_numbers
from ocp_traj.robot.robot import Robot

ID = "task"
DEGREES = {"quintic": 5, "septic": 7, "nonic": 9}
HEAVIEST, LIKELY = 1e3, 1.0  # of a payload that is freed, at most and of random starts [kg]: our choice
PAYLOAD = "payload_mass"  # id of its objective
COST = "cost"  # id of the weighted sum that a task minimises
REST_TOLERANCE = 1e-9  # of given derivatives at the ends, as of rest

Case = Task


def make(id: str, changes: Mapping[str, Any]) -> Task:
    """A resolved task: of the file ``file`` or of ``task``, with values by dotted place, or of all its fields."""
    given = dict(changes)
    file, task = given.pop("file", None), given.pop("task", None)
    if task is not None:
        if file is not None or not isinstance(task, Task):
            raise InputError(f"task is {quoted(task)}; give a Task, and no file beside it")
        return resolve(changed(task, given), Path())
    if file is None:
        return resolve(task_of(given), Path())
    task = read_task(file, given)
    try:
        return resolve(task, Path(file).parent)
    except InputError as error:
        raise told(error, task.name, file) from error


def build(task: Task) -> Problem:
    """The problem of a task."""
    return _problem(task if task.resolved else resolve(task, Path()))


def _problem(task: Task) -> Problem:
    robot = from_numbers(task.robot.numbers)
    route, kind, rest = route_of(task, robot.size), task.curve.kind, task.curve.rest
    _check_curve(task)
    clear = None if task.collision is None else Clear.of(task.name, task.collision, robot)
    if clear is not None:
        clear.require_clear(exact_points(route))
        require_tool_clear(clear, route.tool_moves)
    if kind == "cubic":
        return _posed(task, robot, route, clear, global_cubic(route.points, robot.limits))
    if kind == "retime":
        path = retimed_path(task, route, robot.joints, robot.limits)
        return levels_of(
            lambda count: retiming(path, robot.limits, pieces=count, rest=rest, units=robot.units),
            lambda _, made: _posed(task, robot, route, clear, made),
            retimed_pieces(task, path, robot.limits),
            factor=RETIMED_FACTOR,
        )
    degree = DEGREES.get(kind) or (5 if robot.limits.bounds("snap") is None else 7)
    stretches = [
        s for at, move in route.tool_moves for s in stretches_of(at, move, robot.limits, task.limits.tool_speed)
    ]
    if rest > degree // 2:
        raise InputError(f"{task.name}: [curve] rest is {rest}; {kind} segments hold up to {degree // 2}")

    # Straight edges with a stop at each corner take pieces of a duration each.
    even = clear is None or bool(route.tool_moves) or not stops_at_corners(task, clear.constraints)

    def parametrised(count: int) -> Parametrisation:
        return knot_states(
            route.points, robot.limits, degree=degree, pieces=count, even=even, rest=rest, stops=route.stops,
            dwells=route.dwells, via_tolerance=route.tolerance, start=route.begin, end=route.end, joints=robot.joints,
            units=robot.units, stretches=stretches,
        )  # fmt: skip

    enough = enough_pieces(robot, route, parametrised) if route.tool_moves else 1
    if kind != "auto":
        number = task.curve.pieces or enough
        return levels_of(parametrised, lambda _, made: _posed(task, robot, route, clear, made), number, coarsest=enough)
    coarsest, usual = usual_levels(degree, stops_only=len(route.points) - 2 == len(route.stops))
    pieces, finest = min(coarsest, task.curve.finest), min(usual, task.curve.finest)
    if route.tool_moves:  # fewer do not keep to the path
        pieces, finest = enough, max(enough, min(max(usual, 2 * enough), task.curve.finest))
    fixed = next(kind for kind, own in DEGREES.items() if own == degree)

    def posed(count: int, made: Parametrisation) -> Problem:
        # What refinement finds is a curve of so many pieces, whatever led to it.
        curve = task.curve.model_copy(update={"kind": fixed, "pieces": count})
        return _posed(task if count == pieces else task.model_copy(update={"curve": curve}), robot, route, clear, made)

    return levels_of(parametrised, posed, pieces, finest=finest, gain=task.curve.gain)


def _check_curve(task: Task) -> None:
    """Refuses by name what a kind of curve does not take."""
    kind, name = task.curve.kind, task.name
    if kind in ("cubic", "auto") and task.curve.pieces is not None:
        raise InputError(f"{name}: [curve] pieces is not of {kind}; leave it out, or take quintic, septic or nonic")
    if kind not in ("cubic", "retime"):
        return
    if any(move.tool_path is not None for move in task.move):
        raise InputError(f"{name}: [curve] kind: a {kind} curve goes through points; for tool paths take auto")
    if len(task.move) > 1 or task.move[0].begin or task.move[0].end or np.asarray(task.move[0].tolerance).any():
        raise InputError(
            f"{name}: [curve] kind: a {kind} curve is one move from rest to rest, without tolerance; take auto"
        )
    if kind == "cubic" and task.curve.rest != 2:
        raise InputError(f"{name}: [curve] rest is {task.curve.rest}; a cubic rests to the 2nd derivative: give 2")


def _posed(task: Task, robot: Robot, route: Route, clear: Clear | None, made: Parametrisation) -> Problem:
    axes = robot.joints, robot.units
    load = carried(task, robot, route, made)
    masses = np.array([load.mass] if load.mass is not None else [])
    limits = [*standard.joint_limits(robot.limits, *axes), *made.limits]
    limits += tool_limits(robot, route, made)
    if task.limits.tool_speed is not None:
        limits.append(tool_speed_limit(robot, task.limits.tool_speed))
    hull = tuple(limit.id for limit in limits if limit.order in made.hull_rows)
    pair = robot.limits.bounds("effort")
    if pair is not None and np.isfinite(pair).any():
        require_inertias(robot.model, f"{task.name}: a limit on effort")
        require_exact(robot.model, robot.tool.translation, load.heaviest, pair, f"{task.name}: [limits] effort")
        limit = standard.effort_limit(load.effort, np.array(pair), robot.effort_units, robot.joints)
        limits.append(replace(limit, constants=load.constants))
    objectives = objectives_of(robot, None if missing_inertias(robot.model) else load, made)
    worst = worst_values(objectives, made, robot.size, masses)
    if task.objective.front is not None:
        worst |= task.objective.front.reference
    wanted = _requirements(task, robot, route, made, limits, load.parameters)
    tuning = Tuning(starts=task.solve.starts, hull_rows=hull)
    problem = Problem(
        ID, made.variables, made.curve, objectives, wanted, made.guess, task, robot,
        parameters=lambda x: casadi.SX(masses), dilate=made.dilate, scales_in_time=made.scales_in_time,
        variables_of=lambda motion: variables_of(made, motion.curve), reference_point=worst,
        about=About(
            title=task.name, curve_kind=f"{task.curve.kind}, {len(made.legs)} legs",
            notes=(
                *payload_notes(task), *collision_notes(task.collision),
                *tool_notes(route, sum(len(v.labels) for v in made.variables), len(made.legs[0])),
            ),
            figures=tool_figures(robot.size, limits), surroundings=lambda: tool_paths(route),
        ),
        tuning=tool_tuning(tuning, route, limits),
    )  # fmt: skip
    if clear is not None:
        problem = with_clearance(problem, clear, made, exact_points(route), bent=not route.tool_moves)
    problem = with_start(problem, task, made, route.points, problem.requirements.clearance_constraints)
    if task.free_payload:
        bounds = {**problem.reference_point, PAYLOAD: 0.0}
        problem = replace(standard.free_payload(problem, HEAVIEST, LIKELY), reference_point=bounds)
    objectives, default = _minimised(task, problem.objectives)
    return replace(problem, objectives=objectives, default_objective=default)


def _minimised(task: Task, objectives: tuple[Objective, ...]) -> tuple[tuple[Objective, ...], str]:
    """The objectives, a weighted sum that is asked for among them, and which one is minimised."""
    wanted, front = task.objective.minimise, task.objective.front
    weights = {wanted: 1.0} if isinstance(wanted, str) else wanted
    known = {o.id: o for o in objectives}
    traded = {} if front is None else {"front.objectives": front.objectives, "front.reference": front.reference}
    freed = " (payload_mass is one where free_payload = true)" if PAYLOAD not in known else ""
    for key, name in ((key, name) for key, names in ({"minimise": weights} | traded).items() for name in names):
        if name not in known:
            raise InputError(
                f"{task.name}: [objective] {key}: there is no objective {quoted(name)}{nearest(name, known)}; give of "
                f"{', '.join(known)}{freed}"
            )
    if isinstance(wanted, str):
        return objectives, wanted
    sign = {"min": 1.0, "max": -1.0}
    terms = {name: sign[known[name].sense] * weight / known[name].scale for name, weight in weights.items()}
    return (*objectives, Objective(COST, "-", terms=terms)), COST


def _requirements(
    task: Task,
    robot: Robot,
    route: Route,
    made: Parametrisation,
    limits: Sequence[PathConstraint],
    parameters: tuple[str, ...],
) -> Requirements:
    axes = robot.joints, robot.units
    points = []
    ends = ("begin", (0, 0.0), route.begin), ("end", (-1, 1.0), route.end)
    rests = [*(at for _, at, given in ends if given is None), *(made.knots[i] for i in route.stops)]
    if task.curve.rest and rests:
        points.append(standard.rest(*axes, task.curve.rest, tuple(rests)))
    for side, at, given in ends:
        if given is not None:
            orders = range(1, len(given) + 1)
            labels = tuple(f"{ORDERS[k]} {joint}" for k in orders for joint in robot.joints)
            units = tuple(unit for k in orders for unit in standard.units_of(robot.units, k))
            value = given.ravel()
            points.append(
                PointConstraint(
                    side, _derivatives(len(given)), (at,), value, value, units, labels, structural=True,
                    tolerance=REST_TOLERANCE,
                )
            )  # fmt: skip
    loose = (route.tolerance > 0.0).any(axis=1)
    if inner := np.flatnonzero(loose & np.isfinite(route.tolerance).all(axis=1)).tolist():
        low, high = (route.points[inner] + sign * route.tolerance[inner] for sign in (-1.0, 1.0))
        places = tuple(made.knots[i] for i in inner)
        points.append(
            PointConstraint(NEAR, lambda s: s.q, places, low, high, robot.units, robot.joints, structural=True)
        )
    exact = np.flatnonzero(~loose).tolist()
    points.append(standard.via_points(route.points[exact], tuple(made.knots[i] for i in exact), *axes))
    waits = tuple(
        DurationConstraint(f"dwell at point {i + 1}", (made.legs[i].start - 1,), *np.full((2, 1), seconds))
        for i, seconds in route.dwells.items()
    )
    return Requirements(
        *axes, tuple(limits), tuple(points), parameters, continuity=made.continuity, duration_constraints=waits
    )


def _derivatives(count: int) -> Expression:
    """The first so many derivatives of the joints."""
    return lambda s: casadi.vertcat(*s[1 : count + 1])
