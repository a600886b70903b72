"""Where a problem has no finite number: why a solver that came to none could not go on.

A root of what vanishes, such as the norm of a velocity at rest, has a value there and no slope; its square has both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.symbolic import (
    constants_at,
    curve_function,
    integrand_function,
    motion_of,
    plain_objectives,
    quadrature,
    variables_function,
)


def not_finite(problem: Problem, names: Sequence[str], instants: Sequence[Instant], x: Array) -> str:
    """What has no finite value or derivative at ``x (n,)``, where, and what to do; empty where all are finite.

    Args:
        problem: whose curve, limits and objectives.
        names: of the objectives that take part.
        instants: at which its path limits are looked at.
        x: decision vector.
    """
    if not np.isfinite(x).all():
        return f"its start is not finite: {problem.labels[int(np.argmin(np.isfinite(x)))]}"
    for k, points in enumerate(curve_function(problem)(x)[2:]):
        if not np.isfinite(np.array(points)).all():
            return f"its curve is not finite on segment {k}; look at the points and durations it is made from"
    for what, k, u, function, arguments in _places(problem, names, instants, x):
        symbols = [casadi.SX.sym("z", function.numel_in(i)) for i in range(function.n_in())]
        value = function(*symbols)
        both = casadi.Function("both", symbols, [value, casadi.jacobian(value, symbols[0])])
        found, slopes = (np.array(output) for output in both(*arguments))
        where = f" at segment {k}, u = {u:g}" if k >= 0 else ""
        if not np.isfinite(found).all():
            return f"{what} has no finite value{where}"
        if not np.isfinite(slopes).all():
            return f"{what} has no finite derivative{where}: a root of what vanishes there has none; square it"
    return ""


def _places(
    problem: Problem, names: Sequence[str], instants: Sequence[Instant], x: Array
) -> Iterator[tuple[str, int, float, Any, list[Any]]]:
    """What is computed where: words, segment (-1 for none), local time, casadi Function and its arguments."""
    motion, requirements = motion_of(problem, x), problem.requirements
    p = np.array(list(motion.parameters.values()))

    def state(k: int, u: float) -> Array:
        return np.concatenate([motion.curve.at(k, u, order).ravel() for order in range(len(ORDERS))])

    limits = {limit.id: limit for limit in requirements.path_constraints if limit.order is None}
    for instant in (i for i in instants if i.limit in limits):
        limit, k, u = limits[instant.limit], instant.segment, instant.u
        place = [u, instant.sweep] if limit.sweep else u
        constants = [] if limit.constants is None else limit.constants[k]
        yield f"limit {limit.id!r}", k, u, requirements.function(limit), [state(k, u), place, p, constants]
    for point in requirements.point_constraints:
        for k, u in point.at if not point.structural else ():
            k %= motion.curve.segments
            yield f"point constraint {point.id!r}", k, u, requirements.function(point), [state(k, u), u, p, []]
    for name, objective in plain_objectives(problem, names).items():
        if objective.integrand is not None:
            for k, u in quadrature(problem, objective)[0]:
                c = constants_at(objective, [k])[0]
                yield f"objective {name!r}", k, u, integrand_function(problem, objective), [state(k, u), u, p, c]
        elif objective.of_variables is not None:
            yield f"objective {name!r}", -1, 0.0, variables_function(problem, objective), [x]
