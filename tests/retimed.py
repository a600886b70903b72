"""Paths of a UR5 whose geometry is kept: problems of the shortest time along them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import casadi
import numpy as np

import ocp_traj as ot
from ocp_traj.formulation import standard
from ocp_traj.formulation.levels import levels_of
from ocp_traj.formulation.objective import gauss
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.retiming import retiming
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.paths.joint_path import JointPath


def arm(**limits: float) -> ot.Robot:
    """The UR5 of the package ``example-robot-data``, with limits that all joints have alike."""
    (urdf,) = Path(sys.prefix).glob("lib/python3*/site-packages/**/robots/ur_description/urdf/ur5_robot.urdf")
    each: dict[str, Any] = {name: (value,) * 6 for name, value in limits.items()}
    return ot.Robot.from_urdf(urdf, limits=ot.JointLimits(**each), tool_frame="tool0")


def retimed(
    robot: ot.Robot, path: JointPath, pieces: int, *, rest: int = 1, payload: float | None = None,
    made: Parametrisation | None = None,
) -> ot.Problem:  # fmt: skip
    """The problem; torques are limited where there is a payload [kg]."""
    made = retiming(path, robot.limits, pieces=pieces, rest=rest) if made is None else made
    duration = made.duration

    def effort(state: Any) -> Any:
        return robot.effort(state.q, state.v, state.a, payload=payload or 0.0)

    limits = standard.joint_limits(robot.limits, robot.joints, robot.units)
    hull = tuple(limit.id for limit in limits if limit.order in made.hull_rows)
    if payload is not None:
        most = np.array(robot.limits.bounds("effort"))
        limits = (*limits, standard.effort_limit(effort, most, robot.effort_units, robot.joints))
    points = [standard.via_points(path.points, made.knots, robot.joints, robot.units)]
    if rest:
        points.append(standard.rest(robot.joints, robot.units, rest))
    return ot.Problem(
        id="retimed",
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
            robot.joints, robot.units, (*limits, *made.limits), tuple(points), continuity=made.continuity
        ),
        guess=made.guess,
        dilate=made.dilate,
        reference_point={"time": 10.0, "energy": 1e5},
        tuning=Tuning(hull_rows=hull),
    )


def refined(robot: ot.Robot, path: JointPath, pieces: int, finest: int | None = None, **more: Any) -> ot.Problem:
    """The problem by levels; ``more`` are further arguments of ``retimed``."""
    rest = more.get("rest", 1)
    return levels_of(
        lambda count: retiming(path, robot.limits, pieces=count, rest=rest),
        lambda count, made: retimed(robot, path, count, made=made, **more),
        pieces, finest=finest,
    )  # fmt: skip
