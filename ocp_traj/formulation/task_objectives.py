"""Objectives of a task, and the worst values of them that are worth having."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.objective import Objective, SumOfSquares, gauss
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.requirements import Expression, state_function
from ocp_traj.formulation.task_payload import Carried
from ocp_traj.formulation.tool_motion import tool_objectives
from ocp_traj.robot.robot import Robot

SMOOTHING = 0.1  # [W] of |power|, a joint: work comes out at most so much times the duration too large; our choice
# Of integrals of efforts, by the number of pieces from one via point to the next: along motions of a Panda and a UR5
# the error is below 1e-6 with so many nodes from two pieces on, and below 1e-3 with one.
NODES = {1: 10, 2: 8, 4: 6, 8: 5}
WORST_TIME, WORST = 3.0, 5.0  # times what the first guess takes, and of the others what it has: our choice


def objectives_of(robot: Robot, load: Carried | None, made: Parametrisation) -> tuple[Objective, ...]:
    """Time, work, energy, effort, movement, acceleration, jerk, and of the tool how far and how evenly it goes.

    Squares of efforts and of the joints' derivatives are over the limits', where all are limited.

    Args:
        robot: whose limits.
        load: with the efforts of the actuators; None where the robot has no inertias, and no such objectives.
        made: the curve.
    """
    duration = made.duration
    found = [Objective("time", "s", of_variables=lambda x, p: duration(x))]

    def shares(name: str) -> tuple[Array, str]:
        """What a quantity is divided by, and whether that is its limits."""
        pair = robot.limits.bounds(name)
        if pair is None or not np.isfinite(pair).all():
            return np.ones(robot.size), ""
        return np.maximum(-pair[0], pair[1]), "s"

    if load is not None:
        effort, table = load.effort, load.constants
        rounded = f"each |P| as sqrt(P^2 + ({SMOOTHING:g} W)^2)"
        most, unit = shares("effort")
        pieces = min(len(leg) for leg in made.legs)
        rule = gauss(NODES[max(count for count in NODES if count <= pieces)])
        found += [
            Objective("work", "J", 100.0, eq=rounded, integrand=lambda s: _work(effort(s) * s.v), constants=table),
            Objective(
                "energy", "W2 s", 1000.0, integrand=SumOfSquares(lambda s: effort(s) * s.v), constants=table,
                quadrature=rule,
            ),
            Objective(
                "effort", unit or "(N m)2 s", integrand=SumOfSquares(lambda s: effort(s) / most), constants=table,
                quadrature=rule,
            ),
        ]  # fmt: skip
    unit = "rad" if set(robot.units) == {"rad"} else "rad or m"
    found.append(Objective("movement", unit, variation=lambda s: s.q))
    for order, name in ((2, "acceleration"), (3, "jerk")):
        top, unit = shares(name)
        found.append(Objective(name, unit or f"(rad/s{order})2 s", integrand=_squares(order, top)))
    return (*found, *tool_objectives(robot))


def _work(power: Any) -> Any:
    """The sum of sizes of powers, each smooth where it changes its sign and at most ``SMOOTHING`` too large."""
    return casadi.sum1(casadi.sqrt(power**2 + SMOOTHING**2))


def _squares(order: int, most: Array) -> Expression:
    """The sum of squares of a derivative, each joint's over ``most``."""
    return lambda s: casadi.sumsqr(s[order] / most)


def worst_values(
    objectives: Sequence[Objective], made: Parametrisation, dof: int, parameters: Array
) -> dict[str, float]:
    """The worst values worth having: those of the first guess, ``WORST`` times.

    Args:
        objectives: of ``objectives_of``.
        made: the curve.
        dof: joints.
        parameters: of the problem ``(n_p,)``.
    """
    x = made.guess(np.random.default_rng(0))
    curve = made.curve(x)
    found = {}
    for o in objectives:
        if o.of_variables is not None:
            value = float(made.duration(x))
        elif o.variation is not None:
            value = float(np.abs(np.diff(curve(np.linspace(0.0, float(curve.duration), 200)), axis=0)).sum())
        else:
            value = _integral(curve, o, dof, parameters)
        found[o.id] = max((WORST_TIME if o.of_variables is not None else WORST) * value, 1e-9)
    return found


def _integral(curve: PiecewiseBezier, objective: Objective, dof: int, parameters: Array) -> float:
    """An objective that is an integral, along a numeric curve."""
    assert objective.integrand is not None
    table = objective.constants
    width = 0 if table is None else table.shape[1]
    function = state_function(objective.id, objective.integrand, dof, len(parameters), width)
    nodes, weights = np.array(objective.quadrature).T
    total = 0.0
    for k, duration in enumerate(np.asarray(curve.durations, dtype=float)):
        states = np.vstack([np.reshape(curve.at(k, nodes, order), (-1, dof)).T for order in range(5)])
        constants = np.zeros(0) if table is None else table[k]
        values = np.array(function.map(len(nodes))(states, nodes[None], parameters, constants)).ravel()
        total += float(duration * values @ weights)
    return total
