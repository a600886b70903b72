"""A user's own robot and path: the problem of a task file, ``ocp-traj/task/1``.

Decision variables  of the task's curve: durations, and states at knots; the payload's mass where it is freed
Objectives          time, energy, effort, movement, acceleration, jerk
Subject to          the limits of the task, rest or given derivatives at the ends, its points
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation import standard
from ocp_traj.formulation.about import About
from ocp_traj.formulation.global_cubic import global_cubic
from ocp_traj.formulation.knot_states import SOLVER_OPTIONS, knot_states
from ocp_traj.formulation.levels import levels_of, usual_levels
from ocp_traj.formulation.objective import GAUSS, Objective
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import Expression, PointConstraint, Requirements, State, state_function
from ocp_traj.formulation.retiming import retiming
from ocp_traj.formulation.task import (
    Derivatives,
    Held,
    MoveTable,
    Placement,
    RobotTable,
    Source,
    Task,
    Units,
    share_of,
)
from ocp_traj.formulation.task_file import read_task, task_of
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_points import read_points
from ocp_traj.robot.dh import robot_of_rows
from ocp_traj.robot.dynamics import Friction
from ocp_traj.robot.inertias import missing_inertias, require_inertias
from ocp_traj.robot.joint_limits import QUANTITIES, JointLimits
from ocp_traj.robot.numbers import from_numbers, to_numbers
from ocp_traj.robot.payload import ToolPayload
from ocp_traj.robot.robot import Robot

ID = "task"
ANGLES, LENGTHS = {"rad": 1.0, "deg": np.pi / 180.0}, {"m": 1.0, "mm": 1e-3}
HELD = ("position", "velocity", "effort")  # what a description may hold
ASKED = ("acceleration", "jerk")  # what none holds, and a motion needs: given, or waived
DEGREES = {"quintic": 5, "septic": 7, "nonic": 9}
RETIMED, GAIN = 16, 0.01  # pieces a leg of a path that is retimed: our choice, within 0.2 % of its optimum
WORST = {"time": 3.0}  # times the guess's value, the worst worth having; others 5: our choice
REST_TOLERANCE = 1e-9  # of given derivatives at the ends, as of rest

Case = Task


def make(id: str, changes: Mapping[str, Any]) -> Task:
    """A resolved task: of the file ``file``, with values by dotted place, or of all its fields."""
    given = dict(changes)
    file = given.pop("file", None)
    if file is None:
        return resolve(task_of(given), Path())
    return resolve(read_task(file, given), Path(file).parent)


def build(task: Task) -> Problem:
    """The problem of a task."""
    return _problem(task if task.resolved else resolve(task, Path()))


# --- resolving ---


def resolve(task: Task, folder: Path) -> Task:
    """The task with its robot in numbers, all in SI and its points in it, so that nothing else decides what it means.

    Args:
        task: as it was written.
        folder: from which its paths count.
    """
    if task.resolved:
        return task
    angle, length = ANGLES[task.units.angle], LENGTHS[task.units.length]
    bare = _robot(task.robot, folder, angle, length, JointLimits(), False)
    factor = np.array([angle if unit == "rad" else length for unit in bare.units])
    given, shares = _given_limits(task, bare, factor)
    own = task.limits.description and task.robot.dh is None and task.robot.numbers is None
    robot = _robot(task.robot, folder, angle, length, given, own)
    limits = {name: robot.limits.bounds(name) for name in QUANTITIES}
    for name, share in shares.items():
        if (pair := limits[name]) is None or not own:
            raise InputError(f"{task.name}: [limits] {name} is a share of the description's, which has none; give it")
        limits[name] = (pair[0] * share, pair[1] * share)
    for name in (*HELD, *ASKED):
        if getattr(task.limits, name) is None and limits[name] is None:
            raise InputError(
                f'{task.name}: [limits] {name} is missing: no description holds it; give it, or "none" for no limit'
            )
    friction = task.robot.friction
    if friction is not None:
        table = [
            np.broadcast_to(np.asarray(getattr(friction, k), dtype=float), (robot.size,)) for k in Friction._fields
        ]
        robot = replace(robot, friction=Friction(*table))
    robot = replace(robot, limits=JointLimits(**{name: pair for name, pair in limits.items() if pair is not None}))
    moves = [_resolved_move(move, task, folder, robot, factor, length) for move in task.move]
    payload = _resolved_held(task.robot.payload, length)
    changed = {
        "units": Units(), "robot": RobotTable(numbers=to_numbers(robot), payload=payload),
        "limits": task.limits.model_copy(update={name: None for name in QUANTITIES}), "move": moves,
        "source": task.source or Source(file="code", sha256=""),
    }  # fmt: skip
    return task.model_copy(update=changed)


def _robot(table: RobotTable, folder: Path, angle: float, length: float, limits: JointLimits, own: bool) -> Robot:
    more = {"limits": limits, "gravity": table.gravity}
    if table.numbers is not None:
        robot = from_numbers(table.numbers)
        return replace(robot, limits=robot.limits.overridden_by(limits))
    if table.dh is not None:
        scales = {"theta": angle, "alpha": angle, "d": length, "a": length}
        rows = [{k: _scaled(v, scales.get(k, 1.0)) for k, v in row.items()} for row in table.dh]
        base, tool = (None if p is None else _placed(p, angle, length) for p in (table.base, table.tool))
        return robot_of_rows(rows, convention=table.convention, base=base, tool=tool, **more)  # type: ignore[arg-type]
    named = {"tool_frame": table.tool_frame, "locked": table.locked, "file_limits": own}
    if table.description is not None:
        robot = Robot.from_description(table.description, **more, **named)  # type: ignore[arg-type]
    else:
        robot = Robot.from_urdf(folder / str(table.urdf), **more, **named)  # type: ignore[arg-type]
    if table.tool is not None:
        robot = replace(robot, tool=robot.tool * _placed(table.tool, angle, length))
    return robot


def _scaled(value: Any, factor: float) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return value * factor if number and factor != 1.0 else value


def _placed(placement: Placement, angle: float, length: float) -> pin.SE3:
    rotation = np.eye(3)
    if placement.rpy is not None:
        rotation = pin.rpy.rpyToMatrix(*(angle * np.array(placement.rpy)))
    elif placement.quat_wxyz is not None:
        w, x, y, z = np.array(placement.quat_wxyz) / np.linalg.norm(placement.quat_wxyz)
        rotation = pin.Quaternion(w, x, y, z).toRotationMatrix()
    return pin.SE3(rotation, length * np.array(placement.xyz))


def _given_limits(task: Task, robot: Robot, factor: Array) -> tuple[JointLimits, dict[str, float]]:
    """The limits that are given in numbers, "none" as infinite ones, and those that are shares."""
    pairs: dict[str, Array] = {}
    shares: dict[str, float] = {}
    n, infinite = robot.size, np.inf
    for name in QUANTITIES:
        value = getattr(task.limits, name)
        if value is None:
            continue
        if (share := share_of(value)) is not None:
            if name in (*ASKED, "snap"):
                raise InputError(f"{task.name}: [limits] {name} is a share of the description's; no URDF holds it")
            shares[name] = share
            continue
        two = isinstance(value, list) and value and isinstance(value[0], list)
        if value == "none":
            low, high = np.full(n, -infinite), np.full(n, infinite)
        elif two:
            low, high = (
                np.array([fill if v is None else v for v in side], dtype=float)
                for side, fill in zip(value, (-infinite, infinite), strict=True)
            )
        elif name == "position":
            raise InputError(f"{task.name}: [limits] position needs two lists, lower and upper, one number a joint")
        else:
            each = value if isinstance(value, list) else [value] * n
            high = np.array([infinite if v is None else v for v in each], dtype=float)
            low = -high
        if low.shape != (n,) or high.shape != (n,):
            raise InputError(
                f"{task.name}: [limits] {name} has {max(low.size, high.size)} numbers; the robot has {n} joints: "
                f"{', '.join(robot.joints)}"
            )
        scale = 1.0 if name == "effort" else factor
        pairs[name] = np.array([low * scale, high * scale])
    try:
        return JointLimits(**pairs), shares
    except InputError as error:
        raise InputError(f"{task.name}: [limits] {error}") from error


def _resolved_held(held: Held | None, length: float) -> Held | None:
    return held and held.model_copy(update={"com": [length * x for x in held.com]})


def _resolved_move(move: MoveTable, task: Task, folder: Path, robot: Robot, factor: Array, length: float) -> MoveTable:
    if move.path is not None:
        points = read_points(folder / move.path, robot.joints)[0]
    else:
        rows = move.via if move.via is not None else [row for row in (move.start, move.goal) if row is not None]
        if wrong := [row for row in rows if len(row) != robot.size]:
            raise InputError(
                f"{task.name}: a point of [[move]] has {len(wrong[0])} coordinates; the robot has {robot.size} joints: "
                f"{', '.join(robot.joints)}"
            )
        points = np.array(rows)
    changed: dict[str, Any] = {"via": (points * factor).tolist(), "start": None, "goal": None, "path": None}
    changed["payload"] = _resolved_held(move.payload, length)
    tolerance = np.broadcast_to(np.asarray(move.tolerance, dtype=float), np.shape(move.tolerance) or ())
    if tolerance.shape not in ((), (robot.size,)) or (tolerance < 0.0).any():
        raise InputError(f"{task.name}: the tolerance of [[move]] is {move.tolerance}; give numbers from 0 up")
    changed["tolerance"] = (np.broadcast_to(tolerance, (robot.size,)) * factor).tolist() if tolerance.any() else 0.0
    for side in ("begin", "end"):
        table = getattr(move, side)
        if table is not None:
            given = {k: v for k, v in dict(table).items() if v is not None}
            if any(len(v) != robot.size for v in given.values()):
                raise InputError(f"{task.name}: {side} of [[move]] needs {robot.size} numbers, one a joint")
            changed[side] = Derivatives(**{k: (np.array(v) * factor).tolist() for k, v in given.items()})
    return move.model_copy(update=changed)


# --- the problem ---


@dataclass(frozen=True, eq=False)
class _Route:
    """The moves as one path: its points, where it rests, and which move each leg belongs to."""

    points: Array
    stops: tuple[int, ...]
    dwells: dict[int, float]
    moves: tuple[int, ...]


def _route(task: Task) -> _Route:
    points: list[list[float]] = []
    stops, dwells, moves = [], {}, []
    for i, move in enumerate(task.move):
        rows = list(move.via or ())
        if points and rows and np.allclose(rows[0], points[-1], rtol=0.0, atol=1e-12):
            rows = rows[1:]
        moves += [i] * (len(rows) if points else len(rows) - 1)
        points += rows
        last = i == len(task.move) - 1
        if not last and move.stop:
            stops.append(len(points) - 1)
        if move.dwell:
            if last:
                raise InputError(f"{task.name}: the last [[move]] has a dwell; there is nothing after it: leave it out")
            dwells[len(points) - 1] = move.dwell
    if len(points) < 2:
        raise InputError(f"{task.name}: there is one point in all; give two or more, or start and goal")
    return _Route(np.array(points), tuple(stops), dwells, tuple(moves))


def _problem(task: Task) -> Problem:
    assert task.robot.numbers is not None
    robot, route = from_numbers(task.robot.numbers), _route(task)
    kind, rest = task.curve.kind, task.curve.rest
    _check_curve(task, route)
    if kind == "cubic":
        return _posed(task, robot, route, global_cubic(route.points, robot.limits))
    if kind == "retime":
        path = JointPath.through(route.points, robot.joints)
        pieces = task.curve.pieces or RETIMED
        return levels_of(
            lambda count: retiming(path, robot.limits, pieces=count, rest=rest),
            lambda count, made: _posed(task, robot, route, made),
            pieces,
        )  # fmt: skip
    begin, end = (
        None if table is None else np.array([table.velocity, *([table.acceleration] if table.acceleration else [])])
        for table in (task.move[0].begin, task.move[-1].end)
    )
    tolerance = np.max([np.broadcast_to(move.tolerance, (robot.size,)) for move in task.move], axis=0)
    degree = DEGREES.get(kind) or (5 if robot.limits.bounds("snap") is None else 7)
    if rest > degree // 2:
        raise InputError(f"{task.name}: [curve] rest is {rest}; {kind} segments hold up to {degree // 2}")

    def parametrised(count: int) -> Parametrisation:
        return knot_states(
            route.points, robot.limits, degree=degree, pieces=count, rest=rest, stops=route.stops, dwells=route.dwells,
            via_tolerance=tolerance, start=begin, end=end, joints=robot.joints, units=robot.units,
        )  # fmt: skip

    def posed(count: int, made: Parametrisation) -> Problem:
        # What is found is a curve of so many pieces, whatever led to it.
        curve = task.curve.model_copy(update={"kind": _kind(degree), "pieces": count})
        stays = kind != "auto" or count != pieces
        return _posed(task.model_copy(update={"curve": curve}) if stays else task, robot, route, made)

    stops_only = len(route.points) - 2 == len(route.stops)
    coarsest, usual = usual_levels(degree, stops_only=stops_only)
    if kind != "auto":
        pieces = task.curve.pieces or 1
        return levels_of(parametrised, posed, pieces)
    pieces = min(coarsest, task.curve.finest)
    problem = levels_of(parametrised, posed, pieces, finest=min(usual, task.curve.finest), gain=task.curve.gain)
    return problem


def _kind(degree: int) -> str:
    return next(kind for kind, own in DEGREES.items() if own == degree)


def _check_curve(task: Task, route: _Route) -> None:
    """Refuses by name what a kind of curve does not take."""
    kind, name = task.curve.kind, task.name
    if kind in ("cubic", "auto") and task.curve.pieces is not None:
        raise InputError(f"{name}: [curve] pieces is not of {kind}; leave it out, or take quintic, septic or nonic")
    if kind not in ("cubic", "retime"):
        return
    if len(task.move) > 1 or task.move[0].begin or task.move[0].end or np.any(task.move[0].tolerance):
        raise InputError(f"{name}: a {kind} curve is one [[move]] from rest to rest, without tolerance; take auto")
    if kind == "cubic" and task.curve.rest != 2:
        raise InputError(f"{name}: [curve] rest is {task.curve.rest}; a cubic rests to the 2nd derivative: give 2")


def _effort(task: Task, robot: Robot, route: _Route, made: Parametrisation) -> tuple[Expression, Array | None]:
    """The actuators' efforts, and the payload's numbers on each segment where moves carry different ones."""
    held = [move.payload or task.robot.payload for move in task.move]
    if len({repr(one) for one in held}) == 1:
        one = held[0]

        def alike(s: State) -> Any:
            com, inertia = ((0.0, 0.0, 0.0), None) if one is None else (one.com, one.inertia)
            return robot.effort(s.q, s.v, s.a, payload=ToolPayload(s.p[0], com, inertia))

        return alike, None
    raise InputError(f"{task.name}: moves with different payloads are not built in this version; give one payload")


def _posed(task: Task, robot: Robot, route: _Route, made: Parametrisation) -> Problem:
    axes = robot.joints, robot.units
    effort, _ = _effort(task, robot, route, made)
    limits = [*standard.joint_limits(robot.limits, *axes), *made.limits]
    pair = robot.limits.bounds("effort")
    limited = pair is not None and bool(np.isfinite(pair).any())
    massive = not missing_inertias(robot.model)
    if limited:
        require_inertias(robot.model, f"{task.name}: a limit on effort")
        limits.append(standard.effort_limit(effort, np.array(pair), robot.effort_units, robot.joints))
    hull = tuple(limit.id for limit in limits if limit.order in made.hull_rows)
    held = task.move[0].payload or task.robot.payload
    mass = task.payload if task.payload is not None else 0.0 if held is None else held.mass
    objectives = _objectives(robot, effort if massive else None, made)
    requirements = Requirements(
        *axes, tuple(limits), _points(task, robot, route, made), ("payload",), continuity=made.continuity
    )
    problem = Problem(
        ID, made.variables, made.curve, objectives, requirements, made.guess, task, robot,
        parameters=lambda x: casadi.SX(mass), default_objective=_default(task, objectives), dilate=made.dilate,
        scales_in_time=made.scales_in_time, reference_point=_reference(task, objectives, robot, made, mass),
        tuning=Tuning(starts=task.solve.starts, hull_rows=hull, solver_options=SOLVER_OPTIONS),
        about=About(title=task.name, curve_kind=f"{task.curve.kind}, {len(made.legs)} legs"),
    )  # fmt: skip
    return standard.free_payload(problem, 1e3, 1.0) if task.free_payload else problem


def _points(task: Task, robot: Robot, route: _Route, made: Parametrisation) -> tuple[PointConstraint, ...]:
    axes, n = (robot.joints, robot.units), robot.size
    found = []
    rests = [(0, 0.0)] if task.move[0].begin is None else []
    rests += [made.knots[i] for i in route.stops]
    rests += [(-1, 1.0)] if task.move[-1].end is None else []
    if task.curve.rest and rests:
        found.append(standard.rest(*axes, task.curve.rest, tuple(rests)))
    for side, at, table in (("begin", (0, 0.0), task.move[0].begin), ("end", (-1, 1.0), task.move[-1].end)):
        if table is not None:
            rows = [table.velocity, *([table.acceleration] if table.acceleration else [])]
            value = np.concatenate(rows)
            labels = tuple(f"{'va'[k]} {joint}" for k in range(len(rows)) for joint in robot.joints)
            units = tuple(unit for k in range(len(rows)) for unit in standard.units_of(robot.units, k + 1))
            derivatives = _derivatives(len(rows))
            found.append(
                PointConstraint(
                    side, derivatives, (at,), value, value, units, labels, structural=True, tolerance=REST_TOLERANCE
                )
            )
    tolerance = np.max([np.broadcast_to(move.tolerance, (n,)) for move in task.move], axis=0)
    if not tolerance.any():
        return (*found, standard.via_points(route.points, made.knots, *axes))
    ends = (0, len(route.points) - 1)
    found.append(standard.via_points(route.points[list(ends)], tuple(made.knots[i] for i in ends), *axes, id="ends"))
    inner = range(1, len(route.points) - 1)
    where = route.points[list(inner)]
    found.append(
        PointConstraint(
            "via", lambda s: s.q, tuple(made.knots[i] for i in inner), where - tolerance, where + tolerance,
            robot.units, robot.joints, structural=True,
        )
    )  # fmt: skip
    return tuple(found)


def _objectives(robot: Robot, effort: Expression | None, made: Parametrisation) -> tuple[Objective, ...]:
    duration = made.duration
    found = [Objective("time", "s", of_variables=lambda x, p: duration(x))]

    def shares(name: str) -> tuple[Array, str]:
        """What a quantity is divided by, and whether that is its limits."""
        pair = robot.limits.bounds(name)
        if pair is None or not np.isfinite(pair).all():
            return np.ones(robot.size), ""
        return np.maximum(-pair[0], pair[1]), "s"

    if effort is not None:
        most, unit = shares("effort")
        found += [
            Objective("energy", "W2 s", 1000.0, integrand=lambda s: casadi.sumsqr(effort(s) * s.v)),
            Objective("effort", unit or "(N m)2 s", integrand=lambda s: casadi.sumsqr(effort(s) / most)),
        ]
    unit = "rad" if set(robot.units) == {"rad"} else "rad or m"
    found.append(Objective("movement", unit, variation=lambda s: s.q))
    for order, name in ((2, "acceleration"), (3, "jerk")):
        top, unit = shares(name)
        found.append(Objective(name, unit or f"(rad/s{order})2 s", integrand=_squares(order, top)))
    return tuple(found)


def _derivatives(count: int) -> Expression:
    """The first so many derivatives of the joints."""
    return lambda s: casadi.vertcat(*s[1 : count + 1])


def _squares(order: int, most: Array) -> Expression:
    """The sum of squares of a derivative, each joint's over ``most``."""
    return lambda s: casadi.sumsqr(s[order] / most)


def _default(task: Task, objectives: Sequence[Objective]) -> str:
    names = [o.id for o in objectives]
    wanted = task.objective.minimise
    asked = [wanted] if isinstance(wanted, str) else list(wanted)
    if task.objective.front is not None:
        asked += [*task.objective.front.objectives, *task.objective.front.reference]
    known = [*names, "payload_mass"] if task.free_payload else names
    for name in asked:
        if name not in known:
            raise InputError(f"{task.name}: [objective] there is no objective {name!r}; give of {', '.join(known)}")
    return "time"


def _reference(
    task: Task, objectives: Sequence[Objective], robot: Robot, made: Parametrisation, mass: float
) -> dict[str, float]:
    """The worst values worth having: those of the first guess times ``WORST``, where the task says nothing."""
    x = made.guess(np.random.default_rng(0))
    curve = made.curve(x)
    found = {}
    for o in objectives:
        if o.of_variables is not None:
            value = float(made.duration(x))
        elif o.variation is not None:
            value = float(np.abs(np.diff(curve(np.linspace(0.0, float(curve.duration), 200)), axis=0)).sum())
        else:
            value = _integral(curve, o.integrand, robot.size, mass)
        found[o.id] = max(WORST.get(o.id, 5.0) * value, 1e-9)
    given = {} if task.objective.front is None else task.objective.front.reference
    return {**found, **given}


def _integral(curve: Any, integrand: Callable[[State], Any] | None, dof: int, mass: float) -> float:
    assert integrand is not None
    function = state_function("objective", integrand, dof, 1)
    total = 0.0
    for k, duration in enumerate(np.asarray(curve.durations, dtype=float)):
        u = np.array([node for node, _ in GAUSS])
        states = np.vstack([np.reshape(curve.at(k, u, order), (-1, dof)).T for order in range(5)])
        values = np.array(function.map(len(u))(states, u[None], mass, casadi.DM(0, 1))).ravel()
        total += float(duration * values @ [weight for _, weight in GAUSS])
    return total
