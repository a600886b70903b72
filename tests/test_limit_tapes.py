"""The second derivative of a limit along a curve, and where a limit is defined."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np
import pytest

from ocp_traj.interval.tape import Tape
from ocp_traj.proof.limit_tapes import curvature_function, domain_function
from tests.attack import (
    CURVES,
    Attack,
    states_at,
)
from tests.random_robots import random_robot


def test_curvature_is_the_second_derivative_along_a_curve() -> None:
    rng = np.random.default_rng(10)
    assault = Attack(rng, random_robot(rng, 3), 1)
    curve = CURVES["any degree"][0](rng, 3, 1)
    time, step = float(curve.durations[0]), 1e-3
    p = np.abs(rng.normal(size=len(assault.parameters))) + 1.0
    u = np.linspace(0.1, 0.9, 41)
    for limit in assault.requirements.path_constraints:
        c = np.zeros((0, len(u))) if limit.constants is None else np.repeat(limit.constants.T, len(u), axis=1)
        x = np.concatenate([curve.at(0, u, m).T for m in range(7)])
        tape = Tape(curvature_function(assault.requirements, limit))
        ours = tape.evaluate(x, u[None], np.repeat(p[:, None], len(u), axis=1), c, np.full((1, len(u)), 1.0 / time))[0]
        zeros = np.zeros(len(u), dtype=np.intp)
        near = [
            assault.values(limit, p, states_at(curve, zeros, v), v, zeros)
            for v in (u + k * step / time for k in range(-2, 3))
        ]
        differences = (-near[0] + 16.0 * near[1] - 30.0 * near[2] + 16.0 * near[3] - near[4]) / (12.0 * step**2)
        assert np.abs(ours - differences).max() <= 1e-6 * (1.0 + np.abs(ours).max() + np.abs(near[2]).max() / step)


@pytest.mark.parametrize(
    ("expression", "inside", "outside"),
    [
        (casadi.sqrt, [0.1, 5.0], [0.0, -1.0]),
        (casadi.log, [0.1, 5.0], [0.0, -1.0]),
        (lambda x: 1 / x, [-1.0, 2.0], [0.0]),
        (lambda x: 3 / (x - 1), [0.0, 2.0], [1.0]),
        (casadi.asin, [-0.9, 0.9], [-1.0, 1.0, 2.0]),
        (lambda x: x**-1.5, [0.1], [0.0, -1.0]),
        (casadi.acos, [-0.9, 0.9], [-1.0, 1.0, 2.0]),
        (casadi.atanh, [-0.9, 0.9], [-1.0, 1.0, 2.0]),
        (lambda x: x**-2, [-1.0, 1.0], [0.0]),
        (casadi.acosh, [1.1, 2.0], [1.0, 0.0]),
        (casadi.log1p, [-0.9, 2.0], [-1.0, -2.0]),
        (lambda x: x**x, [0.1, 2.0], [0.0, -1.0]),
        (lambda x: x**2.5, [0.1, 2.0], [-1.0]),
        (lambda x: casadi.sin(x) / 3 + x**3 + casadi.exp(x) + casadi.atan(x), [0.0, -1.0], []),
        (casadi.tan, [0.0, 1.5], []),
    ],
)
def test_domain_is_where_operations_are_defined(expression: Any, inside: list[float], outside: list[float]) -> None:
    x = casadi.SX.sym("x")
    domain = domain_function(casadi.Function("f", [x], [expression(x)]))
    for values, defined in ((inside, True), (outside, False)):
        for value in values:
            assert (np.array(domain(value)) > 0.0).all() == defined
