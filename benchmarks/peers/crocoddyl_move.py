"""A move with crocoddyl (Mastalli et al., 2020), FDDP on a fully actuated arm, as its arm examples have it.

It takes a fixed time, penalties on states and points, and box bounds on torques only; the time is the one it is given.
"""

from __future__ import annotations

from typing import Any

import crocoddyl
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]
SETTINGS = {  # steps, weight of the points, weight of the limits
    "100 steps, 1e4, 1e2": (100, 1e4, 1e2),
    "100 steps, 1e6, 1e4": (100, 1e6, 1e4),
    "200 steps, 1e5, 1e3": (200, 1e5, 1e3),
}


def move(model: pin.Model, points: Array, times: Array, velocity: Array, effort: Array, setting: str) -> Any:
    """States ``(N + 1, 2 n)`` and torques ``(N, n)`` through points ``(m, n)`` at times ``(m,)``, and iterations."""
    count, at_points, at_limits = SETTINGS[setting]
    n, dt = model.nv, times[-1] / count
    state = crocoddyl.StateMultibody(model)
    actuation = crocoddyl.ActuationModelFull(state)
    low, high = (np.concatenate([side, sign * velocity]) for side, sign in (
        (model.lowerPositionLimit, -1.0), (model.upperPositionLimit, 1.0)))  # fmt: skip
    barrier = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(low, high))
    zero = np.zeros(2 * n)
    passes = {int(round(time / dt)): point for time, point in zip(times, points, strict=True)}

    def action(step: int) -> crocoddyl.ActionModelAbstract:
        costs = crocoddyl.CostModelSum(state)
        costs.addCost("torque", crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state)), 1e-4)
        held = crocoddyl.ResidualModelState(state, zero, n)
        costs.addCost("limits", crocoddyl.CostModelResidual(state, barrier, held), at_limits)
        if step in passes:
            still = float(step in (0, count))
            weights = crocoddyl.ActivationModelWeightedQuad(np.concatenate([np.ones(n), still * np.ones(n)]))
            goal = crocoddyl.ResidualModelState(state, np.concatenate([passes[step], np.zeros(n)]), n)
            costs.addCost("point", crocoddyl.CostModelResidual(state, weights, goal), at_points / dt)
        model_here = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        euler = crocoddyl.IntegratedActionModelEuler(model_here, 0.0 if step == count else dt)
        euler.u_lb, euler.u_ub = -effort, effort
        return euler

    begin = np.concatenate([points[0], np.zeros(n)])
    actions = [action(step) for step in range(count + 1)]
    solver = crocoddyl.SolverBoxFDDP(crocoddyl.ShootingProblem(begin, actions[:-1], actions[-1]))
    between = [np.interp(np.arange(count + 1) * dt, times, points[:, i]) for i in range(n)]
    states = [np.concatenate([q, np.zeros(n)]) for q in np.array(between).T]
    solver.solve(states, solver.problem.quasiStatic(states[:-1]), 500)
    return np.array(solver.xs), np.array(solver.us), int(solver.iter)
