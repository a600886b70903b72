"""How the tool frame's origin moves, as functions of the joints, and what tasks make small of it."""

from __future__ import annotations

from typing import Any

import casadi

from ocp_traj.formulation.objective import Objective, SumOfSquares
from ocp_traj.formulation.requirements import Expression, State
from ocp_traj.robot.robot import Robot

LENGTH, UNIFORMITY = "tool_path_length", "tool_speed_uniformity"
SMOOTHING = 1e-3  # [m/s] of the tool's speed, so that it is smooth at rest: our choice


def tool_velocity(robot: Robot) -> casadi.Function:
    """Of the tool frame's origin ``(3,)`` [m/s], as a function of q and v."""
    q, v = casadi.SX.sym("q", robot.size), casadi.SX.sym("v", robot.size)
    return casadi.Function("velocity", [q, v], [casadi.jtimes(robot.tool_pose(q)[1], q, v)])


def tool_speed_squared(robot: Robot) -> Expression:
    """The square of the tool's speed [m2/s2]."""
    velocity = tool_velocity(robot)
    return lambda s: casadi.sumsqr(velocity(s.q, s.v))


def tool_objectives(robot: Robot) -> tuple[Objective, ...]:
    """How far the tool goes, and how unevenly; less is more even.

    ``tool_path_length`` is the integral of the speed w = sqrt(|p'|^2 + ``SMOOTHING``^2), too large by at most that
    speed times the duration, and much less where the tool moves; ``tool_speed_uniformity`` is the integral of the
    square of w', which is the tangential acceleration, zero where the speed is constant.
    """
    q, v, a = (casadi.SX.sym(name, robot.size) for name in "qva")
    velocity = tool_velocity(robot)(q, v)
    speed = casadi.sqrt(casadi.sumsqr(velocity) + SMOOTHING**2)
    change = casadi.jtimes(speed, casadi.vertcat(q, v), casadi.vertcat(v, a))
    fast, along = casadi.Function("speed", [q, v], [speed]), casadi.Function("along", [q, v, a], [change])

    def tangential(s: State) -> Any:
        return along(s.q, s.v, s.a)

    rounded = f"w = sqrt(|p'|^2 + ({1e3 * SMOOTHING:g} mm/s)^2)"
    return (
        Objective(LENGTH, "m", eq=f"integral of {rounded}", integrand=lambda s: fast(s.q, s.v)),
        Objective(UNIFORMITY, "m2/s3", eq=f"integral of (dw/dt)^2, {rounded}", integrand=SumOfSquares(tangential)),
    )
