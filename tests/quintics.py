"""C2 quintics of many pieces through via points, for a UR5 with limits up to jerk and on torques.

Decision variables  durations of the pieces, or one for all pieces between two via points [s]; position, velocity and
                    acceleration at inner knots, position not where a knot is a via point
Curve               Hermite quintics between knots, at rest at both ends
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

import ocp_traj as ot
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation import standard
from ocp_traj.formulation.objective import gauss
from ocp_traj.formulation.tuning import Tuning

Array = NDArray[np.float64]

UNIT = 0.4  # [s]: velocities and accelerations are variables in units of rad a unit of time
HULL = ("position-limit", "velocity-limit", "acceleration-limit", "jerk-limit")
ACCELERATION, JERK, PAYLOAD = 8.0, 60.0, 3.0  # [rad/s2], [rad/s3], [kg]: our choice
START, GOAL = np.array([-0.9, -1.2, 1.5, -1.8, -1.5, 0.0]), np.array([0.9, -1.0, 1.3, -1.8, -1.5, 0.0])  # [rad]


def ur5() -> ot.Robot:
    """The UR5 of the package ``example-robot-data``, read without its meshes."""
    (urdf,) = Path(sys.prefix).glob("lib/python3*/site-packages/**/robots/ur_description/urdf/ur5_robot.urdf")
    limits = ot.JointLimits(acceleration=(ACCELERATION,) * 6, jerk=(JERK,) * 6)
    return ot.Robot.from_urdf(urdf, limits=limits, tool_frame="tool0")


def wander(count: int, seed: int = 1) -> Array:
    """Via points of a walk through joint space ``(count, 6)`` [rad]."""
    middle = np.array([0.0, -1.3, 1.4, -1.6, -1.5, 0.0])
    walk = np.cumsum(0.45 * np.random.default_rng(seed).normal(size=(count, 6)), axis=0)
    walk -= walk.mean(axis=0)
    room = np.minimum(0.6 * (3.0 - np.abs(middle)), 1.2)
    return np.round(middle + walk / max(1.0, float((np.abs(walk) / room).max())), 3)


def quintics(robot: ot.Robot, points: Array, pieces: int, *, shared: bool = False) -> ot.Problem:
    """The problem through via points ``(L + 1, dof)``, with so many pieces from one to the next.

    ``shared``: the pieces between two via points have one duration.
    """
    n, legs = robot.size, len(points) - 1
    count = legs * pieces
    inner, vias = count - 1, np.arange(1, legs) * pieces
    free = np.setdiff1d(np.arange(1, count), vias)
    times = legs if shared else count

    def curve(x: Any) -> PiecewiseBezier:
        durations = x[[k // pieces for k in range(count)]] / pieces if shared else x[:times]
        q = casadi.SX(count + 1, n)
        q[[0, *vias.tolist(), count], :] = points
        q[free.tolist(), :] = casadi.reshape(x[times : times + len(free) * n], n, len(free)).T
        rates = casadi.reshape(x[times + len(free) * n :], n, 2 * inner).T
        rest = casadi.SX.zeros(1, n)
        v = casadi.vertcat(rest, rates[:inner, :] / UNIT, rest)
        a = casadi.vertcat(rest, rates[inner:, :] / UNIT**2, rest)
        segments = []
        for k in range(count):
            t = durations[k]
            begin, end = (
                (q[i, :], q[i, :] + way * v[i, :] * t / 5.0, q[i, :] + way * v[i, :] * 0.4 * t + a[i, :] * t**2 / 20.0)
                for i, way in ((k, 1.0), (k + 1, -1.0))
            )
            segments.append(casadi.vertcat(*begin, *end[::-1]))
        return PiecewiseBezier(durations, tuple(segments))

    def block(name: str, order: int, knots: Any) -> ot.Variable:
        bounds = [np.tile(bound * UNIT**order, len(knots)) for bound in robot.limits.bounds(order) or ()]
        return ot.Variable(name, *bounds, "rad", tuple(f"{name}{i} {joint}" for i in knots for joint in robot.joints))

    highest = np.array(robot.limits.bounds("effort"))

    def effort(state: Any) -> Any:
        return robot.effort(state.q, state.v, state.a, payload=PAYLOAD)

    def guess(rng: np.random.Generator) -> Array:
        least = np.maximum(np.abs(np.diff(points, axis=0)).max(axis=1), 0.3) * rng.uniform(1.4, 2.0)
        place = free / pieces
        leg = place.astype(int)
        share = place - leg
        share = (share**2 * (3.0 - 2.0 * share))[:, None]
        between = points[leg] * (1.0 - share) + points[leg + 1] * share
        spread = least if shared else np.repeat(least / pieces, pieces)
        return np.concatenate([spread, between.ravel(), np.zeros(2 * inner * n)])

    whole = np.arange(1, count)
    at = ((0, 0.0), *((int(k), 0.0) for k in vias), (-1, 1.0))
    return ot.Problem(
        id="quintics",
        robot=robot,
        variables=(
            ot.Variable("T", np.full(times, 0.004), np.full(times, 5.0), "s", tuple(f"T{k + 1}" for k in range(times))),
            block("q", 0, free), block("v", 1, whole), block("a", 2, whole),
        ),
        curve=curve,
        objectives=(
            ot.Objective("time", "s", of_variables=lambda x, p: casadi.sum1(x[:times])),
            ot.Objective(
                "energy", "N2 m2/s", 1000.0, integrand=lambda s: casadi.sumsqr(effort(s) * s.v), quadrature=gauss(4)
            ),
        ),
        requirements=ot.Requirements(
            robot.joints, robot.units,
            (
                *standard.joint_limits(robot.limits, robot.joints, robot.units),
                standard.effort_limit(effort, highest, robot.effort_units, robot.joints),
            ),
            (standard.rest(robot.joints, robot.units), standard.via_points(points, at, robot.joints, robot.units)),
            continuity=2,
        ),
        guess=guess,
        tuning=Tuning(hull_rows=HULL),
    )  # fmt: skip


def variables(curve: PiecewiseBezier, pieces: int) -> Array:
    """The decision vector of a C2 curve with so many pieces between via points, all of free durations."""
    q, v, a = (
        np.stack([curve.at(k, 0.0, order)[0] for k in range(1, curve.segments)]) * UNIT**order for order in range(3)
    )
    free = np.arange(1, curve.segments) % pieces > 0
    return np.concatenate([curve.durations, q[free].ravel(), v.ravel(), a.ravel()])


def halved(curve: PiecewiseBezier) -> PiecewiseBezier:
    """The same curve, each piece cut in two."""
    for k in reversed(range(curve.segments)):
        curve = curve.split(k, 0.5)
    return curve
