"""Collocation with rockit (Gillis et al., 2020), a stage from point to point, as its example ``bouncing_ball``."""

from __future__ import annotations

from typing import Any

import numpy as np
from casadi import DM, vertcat
from numpy.typing import NDArray
from rockit import DirectCollocation, FreeTime, MultipleShooting, Ocp

Array = NDArray[np.float64]
SETTINGS = {  # intervals from one point to the next, method, where limits are looked at
    "10, multiple shooting": (10, "shooting", "control"),
    "10, collocation, at its points": (10, "collocation", "integrator_roots"),
    "20, collocation, at its points": (20, "collocation", "integrator_roots"),
    "10, collocation, at the intervals' ends": (10, "collocation", "control"),
}


def solve(points: Array, bounds: Any, torque: Any, effort: Array, guess: float, setting: str) -> Any:
    """Rest to rest by a chain of integrators, its last derivative constant an interval.

    Arguments and result are those of ``casadi_collocation.solve``.
    """
    intervals, method, grid = SETTINGS[setting]
    n, order = points.shape[1], len(bounds) - 1
    ocp, stages, chains, inputs = Ocp(), [], [], []
    for k, (start, goal) in enumerate(zip(points, points[1:], strict=False)):
        stage = ocp.stage(t0=FreeTime(k * guess) if k else 0, T=FreeTime(guess))
        chain, control = [stage.state(n) for _ in range(order)], stage.control(n)
        for one, rate in zip(chain, [*chain[1:], control], strict=True):
            stage.set_der(one, rate)
        for one, (low, high) in zip(chain, bounds, strict=False):
            stage.subject_to(DM(low) <= (one <= DM(high)), grid=grid)
        stage.subject_to(DM(bounds[-1][0]) <= (control <= DM(bounds[-1][1])))
        stage.subject_to(-DM(effort) <= (torque(*chain[:3]) <= DM(effort)), grid=grid)
        stage.subject_to(stage.T >= 0.01)
        stage.subject_to(stage.at_t0(chain[0]) == DM(start))
        stage.subject_to(stage.at_tf(chain[0]) == DM(goal))
        stage.set_initial(chain[0], DM(start) + (stage.t - stage.t0) / stage.T * DM(goal - start))
        stage.add_objective(stage.T)
        collocation = DirectCollocation(N=intervals, M=1, degree=order, scheme="radau")
        stage.method(collocation if method == "collocation" else MultipleShooting(N=intervals, M=1, intg="rk"))
        if stages:
            ocp.subject_to(stages[-1].tf == stage.t0)
            ocp.subject_to(stages[-1].at_tf(vertcat(*chains[-1][1:])) == stage.at_t0(vertcat(*chain[1:])))
        stages, chains, inputs = [*stages, stage], [*chains, chain], [*inputs, control]
    ocp.subject_to(stages[0].at_t0(vertcat(*chains[0][1:])) == 0)
    ocp.subject_to(stages[-1].at_tf(vertcat(*chains[-1][1:])) == 0)
    ocp.solver("ipopt", {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 1000}})
    found, steps, states, controls = ocp.solve(), [], [], []
    for stage, chain, control in zip(stages, chains, inputs, strict=True):
        times, _ = found(stage).sample(stage.t, grid="control")
        steps.append(np.diff(times))
        states.append(np.stack([found(stage).sample(one, grid="control")[1][:-1] for one in chain], axis=1))
        controls.append(found(stage).sample(control, grid="control")[1][:-1])
    return *map(np.concatenate, (steps, states, controls)), found.stats["iter_count"]
