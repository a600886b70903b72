"""Distances of pairs of bodies: equal to coal's, and what is nearest gives their slopes and curvature."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import casadi
import coal
import numpy as np
import pinocchio as pin
import pytest

from ocp_traj.formulation.requirements import state_function
from ocp_traj.robot.bodies import Body, box, capsule, cylinder, half_space, sphere
from ocp_traj.robot.pair_distances import CONSTANTS, PairDistances
from ocp_traj.robot.robot import Robot

TURNED = pin.rpy.rpyToMatrix(0.3, 0.2, 0.5)
HELD = (  # on the joints of a UR5
    capsule("arm", 3, [0.0, 0.0, 0.0], [0.0, 0.0, 0.39], 0.05), sphere("wrist", 5, [0.0, 0.0, 0.05], 0.06),
    box("gripper", 6, [0.0, 0.1, 0.0], [0.05, 0.2, 0.1]), cylinder("bottle", 6, [0.0, 0.1, 0], [0.05, 0.3, 0.1], 0.04),
)  # fmt: skip
AROUND = (
    sphere("ball", 0, [0.5, 0.1, 0.3], 0.1), capsule("bar", 0, [0.4, -0.3, 0.2], [0.5, 0.3, 0.5], 0.03),
    box("crate", 0, [0.45, -0.4, 0.1], [0.3, 0.2, 0.4], TURNED), half_space("floor", [0.1, 0.0, 1.0], -0.1),
    cylinder("post", 0, [0.4, 0.3, -0.1], [0.5, 0.3, 0.6], 0.1),
)  # fmt: skip
SMOOTH = [("arm", o) for o in ("ball", "bar", "crate", "floor")] + [("wrist", o) for o in ("ball", "bar", "crate")]


@cache
def _robot() -> Robot:
    return Robot.from_description("ur5")


@cache
def _distances() -> PairDistances:
    own = [(HELD[0], HELD[2]), (HELD[0], HELD[3]), (HELD[0], HELD[1])]
    return PairDistances(_robot(), [*((held, body) for held in HELD for body in AROUND), *own])


def _postures(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-2.5, 2.5, size=(count, 6)), rng.integers(0, len(_distances().pairs), count)


def _by_coal(one: Body, two: Body, q: np.ndarray) -> float:
    model, data = _robot().model, _robot().model.createData()
    pin.forwardKinematics(model, data, q)
    parts: list[object] = []
    for body in (one, two):
        shape, placement = body.coal()
        pose = data.oMi[body.joint] * placement
        parts += [shape, coal.Transform3s(pose.rotation, pose.translation)]
    return float(coal.distance(*parts, coal.DistanceRequest(), coal.DistanceResult()))


def test_distances_are_those_of_coal() -> None:
    q, rows = _postures(1000, 0)
    found, kinds = _distances().distances(q, rows), set()
    for angles, row, distance in zip(q, rows.tolist(), found.tolist(), strict=True):
        one, two = _distances().pairs[row]
        deep = distance < -one.radius - two.radius and "half-space" not in (one.kind, two.kind)
        if deep and {one.kind, two.kind} & {"box", "cylinder"}:  # more than one way out: none is far from the least
            assert distance <= 0.0
            continue
        # coal iterates to 1e-6 where a cylinder is one of them.
        tolerance = 5e-6 if "cylinder" in (one.kind, two.kind) else 1e-9
        assert distance == pytest.approx(_by_coal(one, two, angles), abs=tolerance), (one.name, two.name)
        kinds.add((one.kind, two.kind, distance > 0.0))
    assert {k[:2] for k in kinds} == {(a.kind, b.kind) for a, b in _distances().pairs}
    assert sum(not positive for *_, positive in kinds) >= 5


def test_bounds_by_balls_are_below() -> None:
    q, rows = _postures(2000, 1)
    assert (_distances().at_least(q)[np.arange(2000), rows] <= _distances().distances(q, rows) + 1e-12).all()


def _derivatives(row: int) -> casadi.Function:
    """Casadi Function (q, c) -> value, gradient and Hessian of a pair's expression."""
    return _compiled(_distances().expressions[row])


@cache
def _compiled(expression: Callable[[Any, Any], Any]) -> casadi.Function:
    function = state_function("d", lambda s: expression(s.q, s.c), 6, 0, CONSTANTS)
    q, c = casadi.SX.sym("q", 6), casadi.SX.sym("c", CONSTANTS)
    value = function(casadi.vertcat(q, casadi.SX.zeros(24)), 0.0, casadi.SX(0, 1), c)
    bend, slope = casadi.hessian(value, q)
    return casadi.Function("d", [q, c], [value, slope, bend])


@pytest.mark.slow
def test_what_is_nearest_gives_value_and_slope_of_the_distance_everywhere() -> None:
    q, rows = _postures(160, 2)
    step, constants = 1e-5, _distances().constants(q, rows)
    for angles, row, c in zip(q, rows.tolist(), constants, strict=True):
        value, slope, _ = (np.array(part).ravel() for part in _derivatives(row)(angles, c))
        near = angles + step * np.concatenate([np.eye(6), -np.eye(6)])
        values = _distances().distances(near, np.full(12, row))
        assert value[0] == pytest.approx(_distances().distances(angles[None], np.array([row]))[0], abs=1e-12)
        # An edge of what is nearest may lie within the step: one in a thousand, so of 160 none that matters.
        np.testing.assert_allclose(slope, (values[:6] - values[6:]) / (2.0 * step), atol=2e-4)


def test_of_points_edges_and_flat_faces_it_gives_the_curvature_too() -> None:
    pairs = _distances().pairs
    names = [(a.name, b.name) for a, b in pairs]
    step, rng = 1e-5, np.random.default_rng(3)
    for name in SMOOTH:
        row = names.index(name)
        function = _derivatives(row)
        for angles in rng.uniform(-2.5, 2.5, size=(6, 6)):
            near = angles + step * np.concatenate([np.eye(6), -np.eye(6)])
            constants = _distances().constants(np.vstack([angles, near]), np.full(13, row))
            bend = np.array(function(angles, constants[0])[2])
            slopes = np.array([
                np.array(function(q, c)[1]).ravel() for q, c in zip(near, constants[1:], strict=True)
            ])  # fmt: skip
            np.testing.assert_allclose(bend, (slopes[:6] - slopes[6:]) / (2.0 * step), atol=1e-4)


def test_bodies_that_cross_are_pushed_apart() -> None:
    """Where cores cross there is a normal, and along it the distance grows."""
    robot = _robot()
    pairs = PairDistances(robot, [(capsule("arm", 3, [0, 0, 0], [0, 0, 0.39], 0.05), other) for other in AROUND])
    q = np.array([[0.3, -1.2, 1.5, -1.8, -1.5, 0.0]])
    middle = np.einsum("ij,j->i", pairs.placements(q)[0][0, -1], [0.0, 0.0, 0.2]) + pairs.placements(q)[1][0, -1]
    through = (
        sphere("ball", 0, middle, 0.1), capsule("bar", 0, middle - [0.0, 0.0, 0.2], middle + [0.0, 0.0, 0.2], 0.03),
        box("crate", 0, middle, [0.3, 0.2, 0.4], TURNED), cylinder("post", 0, middle - 0.1, middle + 0.1, 0.1),
    )  # fmt: skip
    pairs = PairDistances(robot, [(HELD[0], other) for other in through])
    rows = np.arange(len(through))
    found = pairs.distances(np.repeat(q, len(rows), axis=0), rows)
    assert (found < -0.05).all()
    for row, distance in zip(rows.tolist(), found.tolist(), strict=True):
        c = pairs.constants(q, np.array([row]))[0]
        expression = pairs.expressions[row]
        function = state_function("d", lambda s, e=expression: e(s.q, s.c), 6, 0, CONSTANTS)
        angles = casadi.SX.sym("q", 6)
        value = function(casadi.vertcat(angles, casadi.SX.zeros(24)), 0.0, casadi.SX(0, 1), casadi.DM(c))
        slope = np.array(casadi.Function("s", [angles], [casadi.gradient(value, angles)])(q[0])).ravel()
        assert np.isfinite(slope).all() and np.linalg.norm(slope) > 1e-3
        moved = q + 1e-3 * slope / np.linalg.norm(slope)
        assert pairs.distances(moved, np.array([row]))[0] > distance
