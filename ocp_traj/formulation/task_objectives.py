"""Objectives of a task, and the worst values of them that are worth having."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.objective import Objective, SumOfSquares, gauss
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.requirements import Expression, state_function
from ocp_traj.robot.robot import Robot

# Of integrals of efforts, by the number of pieces from one via point to the next: along motions of a Panda and a UR5
# the error is below 1e-6 with so many nodes from two pieces on, and below 1e-3 with one.
NODES = {1: 10, 2: 8, 4: 6, 8: 5}
WORST_TIME, WORST = 3.0, 5.0  # times what the first guess takes, and of the others what it has: our choice


def objectives_of(robot: Robot, effort: Expression | None, made: Parametrisation) -> tuple[Objective, ...]:
    """Time, energy, effort, movement, acceleration and jerk: squares are over the limits', where all are limited.

    Args:
        robot: whose limits.
        effort: of the actuators, of the state; None where the robot has no inertias, and no such objectives.
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

    if effort is not None:
        most, unit = shares("effort")
        pieces = min(len(leg) for leg in made.legs)
        rule = gauss(NODES[max(count for count in NODES if count <= pieces)])
        found += [
            Objective("energy", "W2 s", 1000.0, integrand=SumOfSquares(lambda s: effort(s) * s.v), quadrature=rule),
            Objective(
                "effort", unit or "(N m)2 s", integrand=SumOfSquares(lambda s: effort(s) / most), quadrature=rule
            ),
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


def worst_values(objectives: Sequence[Objective], made: Parametrisation, dof: int, mass: float) -> dict[str, float]:
    """The worst values worth having: those of the first guess, ``WORST`` times.

    Args:
        objectives: of ``objectives_of``.
        made: the curve.
        dof: joints.
        mass: of the payload [kg].
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
            value = _integral(curve, o, dof, mass)
        found[o.id] = max((WORST_TIME if o.of_variables is not None else WORST) * value, 1e-9)
    return found


def _integral(curve: PiecewiseBezier, objective: Objective, dof: int, mass: float) -> float:
    """An objective that is an integral, along a numeric curve."""
    assert objective.integrand is not None
    function = state_function(objective.id, objective.integrand, dof, 1)
    nodes, weights = np.array(objective.quadrature).T
    total = 0.0
    for k, duration in enumerate(np.asarray(curve.durations, dtype=float)):
        states = np.vstack([np.reshape(curve.at(k, nodes, order), (-1, dof)).T for order in range(5)])
        values = np.array(function.map(len(nodes))(states, nodes[None], mass, casadi.DM(0, 1))).ravel()
        total += float(duration * values @ weights)
    return total
