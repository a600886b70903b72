"""Direct collocation with CasADi's ``Opti``, as its example ``direct_collocation``: least time through points."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SETTINGS = {  # intervals from one point to the next, collocation points
    "10, radau": (10, "radau"),
    "20, radau": (20, "radau"),
    "40, radau": (40, "radau"),
    "10, legendre": (10, "legendre"),
}


def solve(points: Array, bounds: Any, torque: Any, effort: Array, guess: float, setting: str) -> Any:
    """Rest to rest by a chain of integrators, its last derivative constant an interval.

    Takes points ``(m, n)``; bounds, lower and upper ``(n,)``, of position .. and of the last derivative; a casadi
    function (q, v, a) -> ``(n,)`` and what it stays within; a guess of the time from point to point [s]; a setting.
    Returns durations ``(K,)``, states at their begins ``(K, order, n)``, controls ``(K, n)``, iterations.
    """
    per_phase, kind = SETTINGS[setting]
    n, order = points.shape[1], len(bounds) - 1
    C, D, _ = ca.collocation_coeff(ca.collocation_points(order, kind))
    low, high = (ca.vertcat(*(side[k] for side in bounds[:-1])) for k in (0, 1))
    opti, still = ca.Opti(), np.zeros(n * (order - 1))
    state = opti.variable(n * order)
    opti.set_initial(state, np.concatenate([points[0], still]))
    opti.subject_to(state == np.concatenate([points[0], still]))
    times, steps, states, controls = [], [], [], []
    for start, goal in zip(points, points[1:], strict=False):
        time = opti.variable()
        opti.set_initial(time, guess)
        opti.subject_to(time >= 1e-2)
        times.append(time)
        for k in range(per_phase):
            inner, control, after = opti.variable(n * order, order), opti.variable(n), opti.variable(n * order)
            opti.set_initial(inner, np.tile(np.append(start + k / per_phase * (goal - start), still)[:, None], order))
            opti.set_initial(after, np.append(start + (k + 1) / per_phase * (goal - start), still))
            rate = ca.vertcat(inner[n:, :], ca.repmat(control, 1, order))
            opti.subject_to(ca.vec(ca.horzcat(state, inner) @ C - time / per_phase * rate) == 0)
            opti.subject_to(after == ca.horzcat(state, inner) @ D)
            opti.subject_to(opti.bounded(bounds[-1][0], control, bounds[-1][1]))
            for x in (*ca.horzsplit(inner), after):
                opti.subject_to(opti.bounded(low, x, high))
                opti.subject_to(opti.bounded(-effort, torque(x[:n], x[n : 2 * n], x[2 * n : 3 * n]), effort))
            steps, states, controls = [*steps, time / per_phase], [*states, state], [*controls, control]
            state = after
        opti.subject_to(state[:n] == goal)
    opti.subject_to(state[n:] == 0)
    opti.minimize(sum(times))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 1000})
    found = opti.solve()
    nodes = found.value(ca.horzcat(*states)).T.reshape(len(states), order, n)
    return found.value(ca.vertcat(*steps)), nodes, found.value(ca.horzcat(*controls)).T, found.stats()["iter_count"]
