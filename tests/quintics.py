"""C2 quintics of many pieces through via points, for a UR5 with limits up to jerk and on torques."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation import standard
from ocp_traj.formulation.knot_states import knot_states
from ocp_traj.formulation.levels import cut, levels_of
from ocp_traj.formulation.objective import gauss
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.tuning import Tuning

HULL = ("position-limit", "velocity-limit", "acceleration-limit", "jerk-limit")
ACCELERATION, JERK, PAYLOAD = 8.0, 60.0, 3.0  # [rad/s2], [rad/s3], [kg]: our choice
HOME = np.array([0.0, -1.3, 1.4, -1.6, -1.5, 0.0])  # [rad]
START, GOAL = np.array([-0.9, -1.2, 1.5, -1.8, -1.5, 0.0]), np.array([0.9, -1.0, 1.3, -1.8, -1.5, 0.0])  # [rad]


def ur5(**more: Any) -> ot.Robot:
    """The UR5 of the package ``example-robot-data``, read without its meshes; ``more`` are further limits."""
    (urdf,) = Path(sys.prefix).glob("lib/python3*/site-packages/**/robots/ur_description/urdf/ur5_robot.urdf")
    limits = ot.JointLimits(acceleration=(ACCELERATION,) * 6, jerk=(JERK,) * 6, **more)
    return ot.Robot.from_urdf(urdf, limits=limits, tool_frame="tool0")


def wander(count: int, seed: int = 1) -> Array:
    """Via points of a walk through joint space ``(count, 6)`` [rad]."""
    walk = np.cumsum(0.45 * np.random.default_rng(seed).normal(size=(count, 6)), axis=0)
    walk -= walk.mean(axis=0)
    room = np.minimum(0.6 * (3.0 - np.abs(HOME)), 1.2)
    return np.round(HOME + walk / max(1.0, float((np.abs(walk) / room).max())), 3)


def move(seed: int) -> Array:
    """A random move ``(2, 6)`` [rad], each joint within a radian of home."""
    return np.asarray(HOME + np.random.default_rng(seed).uniform(-1.0, 1.0, size=(2, 6)))


def curves(robot: ot.Robot, points: Array, pieces: int, **more: Any) -> Parametrisation:
    """The curve through via points ``(L + 1, dof)``; ``more`` are further arguments of ``knot_states``."""
    return knot_states(points, robot.limits, pieces=pieces, joints=robot.joints, units=robot.units, **more)


def quintics(
    robot: ot.Robot,
    points: Array,
    pieces: int,
    *,
    made: Parametrisation | None = None,
    torque: bool = True,
    **more: Any,
) -> ot.Problem:
    """The problem through via points ``(L + 1, dof)``, with so many pieces from one to the next.

    ``made`` in place of ``curves(robot, points, pieces, **more)``; ``torque``: whether torques are limited.
    """
    made = curves(robot, points, pieces, **more) if made is None else made
    duration = made.duration

    def effort(state: Any) -> Any:
        return robot.effort(state.q, state.v, state.a, payload=PAYLOAD)

    limits = standard.joint_limits(robot.limits, robot.joints, robot.units)
    hull = tuple(limit.id for limit in limits if limit.order in made.hull_rows)
    if torque:
        highest = np.array(robot.limits.bounds("effort"))
        limits = (*limits, standard.effort_limit(effort, highest, robot.effort_units, robot.joints))
    return ot.Problem(
        id="quintics",
        robot=robot,
        variables=made.variables,
        curve=made.curve,
        objectives=(
            ot.Objective("time", "s", of_variables=lambda x, p: duration(x)),
            ot.Objective(
                "energy", "N2 m2/s", 1000.0, integrand=lambda s: casadi.sumsqr(effort(s) * s.v), quadrature=gauss(4)
            ),
        ),
        requirements=ot.Requirements(
            robot.joints, robot.units, limits,
            (
                standard.rest(robot.joints, robot.units),
                standard.via_points(points, made.knots, robot.joints, robot.units),
            ),
            continuity=made.continuity,
        ),
        guess=made.guess,
        dilate=made.dilate,
        reference_point={"time": 10.0, "energy": 1e5},
        tuning=Tuning(hull_rows=hull),
    )  # fmt: skip


def refined(robot: ot.Robot, points: Array, pieces: int, finest: int | None = None, **more: Any) -> ot.Problem:
    """The problem with so many pieces, by levels; ``finest`` and ``gain`` as of ``levels_of``."""
    torque, gain = more.pop("torque", True), {k: more.pop(k) for k in ("gain",) if k in more}
    return levels_of(
        lambda count: curves(robot, points, count, **more),
        lambda count, made: quintics(robot, points, count, made=made, torque=torque),
        pieces, finest=finest, **gain,
    )  # fmt: skip


def halved(curve: PiecewiseBezier) -> PiecewiseBezier:
    """The same curve, each piece cut in two."""
    return cut(curve, 2, (range(curve.segments),))


def held_at_control_points(problem: ot.Problem) -> ot.Problem:
    """The problem with hull rows for one piece as well."""
    return replace(problem, tuning=replace(problem.tuning, hull_rows=HULL))
