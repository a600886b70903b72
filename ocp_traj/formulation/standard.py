"""Requirements that most problems have, each written once: limits on joints and efforts, rest, via points, tool box."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import cos
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import ORDERS, Expression, PathConstraint, PointConstraint, Points, State
from ocp_traj.paths.pieces import Pieces, at_piece
from ocp_traj.robot.collision import Obstacle
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

QUANTITIES = ("position", "velocity", "acceleration", "jerk", "snap")  # of ORDERS
PER_TIME = ("", "/s", "/s2", "/s3", "/s4")  # of ORDERS
ENDS: Points = ((0, 0.0), (-1, 1.0))
AXES = ("x", "y", "z")
EFFORT = "effort-limit"  # id of the limit on what the actuators do, forces and torques alike


def units_of(units: Sequence[str], order: int) -> tuple[str, ...]:
    """Units of the order-th time derivative of joints."""
    return tuple(unit + PER_TIME[order] for unit in units)


def joint_limits(
    limits: JointLimits, joints: Sequence[str], units: Sequence[str], eq: Mapping[str, str] | None = None
) -> tuple[PathConstraint, ...]:
    """``position-limit`` .. ``snap-limit``, those that are given and finite on some side.

    Args:
        limits: of the joints.
        joints: one name a joint.
        units: "m" or "rad", one a joint.
        eq: equations or tables of the source, by quantity.
    """
    found = []
    for order, name in enumerate(QUANTITIES):
        pair = limits.bounds(name)
        if pair is not None and np.isfinite(pair).any():
            labels, source = tuple(joints), (eq or {}).get(name, "")
            found.append(
                PathConstraint.on_derivative(f"{name}-limit", order, *pair, units_of(units, order), labels, source)
            )
    return tuple(found)


def effort_limit(
    effort: Expression, bounds: ArrayLike, units: Sequence[str], labels: Sequence[str], eq: str = ""
) -> PathConstraint:
    """The limit called ``EFFORT``: forces [N] and torques [N m] of the actuators, as an expression of the state.

    Bounds are ``(2, n)``, or ``(n,)`` for the same on both sides.
    """
    given = np.asarray(bounds, dtype=float)
    lower, upper = given if given.ndim == 2 else (-given, given)
    return PathConstraint(EFFORT, effort, lower, upper, tuple(units), tuple(labels), eq)


def tool_box(robot: Robot, lower: ArrayLike, upper: ArrayLike, eq: str = "") -> PathConstraint:
    """``tool-box``: the tool frame's origin within a box of the world [m]; infinite where a side is open."""
    low, high = (np.asarray(bound, dtype=float) for bound in (lower, upper))
    return PathConstraint("tool-box", lambda s: robot.tool_pose(s.q)[1], low, high, ("m",) * 3, AXES, eq)


def clear_of(
    obstacles: Sequence[Obstacle], direction: Callable[[Any], Any], clearance: Callable[[State], Any], eq: str = ""
) -> tuple[PathConstraint, ...]:
    """``obstacles`` and ``far-obstacles``: a link keeps clear of spheres within its reach, and of those beyond.

    Args:
        obstacles: grown by the link's radius.
        direction: of the link ``(3,)``, of q.
        clearance: by how much each may grow [rad], of the state.
        eq: equation of the source.
    """
    found = []
    for id, within in (("obstacles", True), ("far-obstacles", False)):
        if some := [o for o in obstacles if o.within_reach == within]:

            def excess(s: State, some: Sequence[Obstacle] = some) -> Any:
                return casadi.vertcat(*(o.excess(direction(s.q), clearance(s), s.s) for o in some))

            labels, none = tuple(f"obstacle {o.number}" for o in some), np.full(len(some), -np.inf)
            units = ("-",) * len(some)
            found.append(PathConstraint(id, excess, none, np.zeros(len(some)), units, labels, eq, sweep=not within))
    return tuple(found)


def follow(
    robot: Robot, cut: Pieces, segments: range, count: int, box: float, distance: float, tilt: float, eq: str = ""
) -> tuple[PathConstraint, ...]:
    """``tcp``, ``tcp-distance`` and ``tilt``: the tool keeps to a seam, whose pieces are segments of the curve.

    What the polynomials miss of the seam comes off the bounds.

    Args:
        robot: whose tool has its axis along z.
        cut: the seam in pieces.
        segments: of the curve, one a piece.
        count: of all segments of the curve.
        box: largest error of the tool frame's origin along each axis of the world [m].
        distance: largest distance of it from the seam [m].
        tilt: largest angle between the axes [rad].
        eq: equation of the source.
    """
    table = np.zeros((count, cut.constants.shape[1]))
    table[segments] = cut.constants
    where: dict[str, Any] = {"eq": eq, "constants": table, "segments": tuple(segments)}

    def error(s: State) -> Any:
        return robot.tool_pose(s.q)[1] - at_piece(s.c, s.u)[0]

    def turned(s: State) -> Any:
        return 1.0 - casadi.dot(robot.tool_pose(s.q)[0][:, 2], at_piece(s.c, s.u)[1])

    side, radius, none = box - cut.position_error, 1e3 * (distance - cut.position_error), np.array([-np.inf])
    most = 1.0 - cos(tilt) - cut.axis_error
    return (
        PathConstraint("tcp", error, np.full(3, -side), np.full(3, side), ("m",) * 3, AXES, **where),
        PathConstraint(
            "tcp-distance", lambda s: casadi.sumsqr(1e3 * error(s)), none, np.array([radius**2]), ("mm2",),
            ("squared",), **where,
        ),
        PathConstraint("tilt", turned, none, np.array([most]), ("-",), ("1 - cos",), **where),
    )  # fmt: skip


def rest(
    joints: Sequence[str], units: Sequence[str], order: int = 2, at: Points = ENDS, eq: str = "", **more: Any
) -> PointConstraint:
    """``rest``: derivatives 1 to ``order`` of all joints vanish, at both ends unless told otherwise.

    ``more`` are further fields of ``PointConstraint``.
    """
    count = order * len(joints)
    labels = tuple(f"{ORDERS[k]} {joint}" for k in range(1, order + 1) for joint in joints)
    per_time = tuple(unit for k in range(1, order + 1) for unit in units_of(units, k))
    fixed = np.zeros(count), np.zeros(count), per_time, labels, eq
    return PointConstraint(
        "rest", lambda s: casadi.vertcat(*s[1 : order + 1]), at, *fixed, **{"structural": True} | more
    )


def via_points(
    points: ArrayLike,
    at: Points,
    joints: Sequence[str],
    units: Sequence[str],
    eq: str = "",
    id: str = "via",
    **more: Any,
) -> PointConstraint:
    """``via``: positions ``(instants, joints)`` passed at given instants; a joint that is NaN in all is free."""
    where = np.atleast_2d(np.asarray(points, dtype=float))
    held = [j for j in range(len(joints)) if not np.isnan(where[:, j]).all()]
    units, labels = (tuple(names[j] for j in held) for names in (units, joints))
    fixed = where[:, held]
    return PointConstraint(id, lambda s: s.q[held], at, fixed, fixed, units, labels, eq, **{"structural": True} | more)


def posture(
    id: str, q: ArrayLike, at: Points, joints: Sequence[str], units: Sequence[str], eq: str = ""
) -> PointConstraint:
    """A place ``(joints,)`` in joint space at which all derivatives up to snap vanish."""
    place = np.asarray(q, dtype=float)
    state = np.concatenate([place, np.zeros((len(ORDERS) - 1) * len(place))])
    labels = tuple(f"{order} {joint}" for order in ORDERS for joint in joints)
    per_time = tuple(unit for k in range(len(ORDERS)) for unit in units_of(units, k))
    return PointConstraint(
        id, lambda s: casadi.vertcat(*s[: len(ORDERS)]), at, state, state, per_time, labels, eq, structural=True
    )


def free_payload(problem: Problem, most: float, likely: float, eq: str = "") -> Problem:
    """A problem whose first parameter is the payload, with that mass as one more variable and objective.

    Args:
        problem: the first of its parameters is the payload [kg].
        most: largest payload [kg].
        likely: random starts have up to this [kg].
        eq: equation of the source.
    """
    n, dilate, read = problem.size, problem.dilate, problem.variables_of
    parameters, tighten = problem.parameters, problem.tighten_slacks
    mass = Variable("payload", np.zeros(1), np.array([most]), "kg", ("payload",), eq)
    largest = Objective("payload_mass", "kg", 10.0, "max", eq, of_variables=lambda x, p: p[0])
    return replace(
        problem,
        variables=(*problem.variables, mass),
        curve=lambda x: problem.curve(x[:n]),
        parameters=lambda x: casadi.vertcat(x[n:], *casadi.vertsplit(casadi.vec(casadi.SX(parameters(x[:n]))))[1:]),
        objectives=(*problem.objectives, largest),
        guess=lambda rng: np.append(problem.guess(rng), rng.uniform(0.0, min(likely, most))),
        dilate=dilate and (lambda x, s: np.append(dilate(x[:n], s), x[n:])),
        scales_in_time=False,
        tighten_slacks=tighten and (lambda x: np.append(tighten(x[:n]), x[n:])),
        variables_of=read and (lambda motion: np.append(read(motion), motion.parameters.get("payload", 0.0))),
    )
