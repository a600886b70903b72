"""Every requirement of ``hybrid-spline`` (Guo et al., 2016), recomputed from a trajectory's file."""

from collections.abc import Mapping
from functools import cache
from math import pi
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from tests.independent.case import AGREEMENT, POINT, Blocks, Case, Excesses, parameter
from tests.independent.motion import Array, Motion, apart, worst
from tests.independent.robots import L1, HybridRobot, efforts

JOINTS = ("X_S1", "X_S2", "X_S3", "phi_4", "phi_5")
DEFAULTS: Case = {
    "payload": 10.0,
    "convention": "physical",
    "weights": (0.3, 0.3, 0.2, 0.2),
    "via_points": "rederived",
    "min_interval": 0.02,
    "max_interval": 4.0,
    "free_payload": False,
    "max_payload": 100.0,
}
# Table 2: position [m, rad], velocity, acceleration, jerk (100 000 mm/s^3 for joints 1-3), force [N, N m].
POSITION = np.array([[0.0, 0.0, 0.0, -pi, -pi], [1.0, 1.0, 0.5, pi, pi]])
VELOCITY = np.array([0.25, 0.25, 0.25, 1.96, 1.96])
ACCELERATION = np.array([5.0, 5.0, 5.0, 60.0, 60.0])
JERK = np.array([100.0, 100.0, 100.0, 1200.0, 1200.0])
FORCE = np.array([500.0, 500.0, 500.0, 17.0, 17.0])
# Table 6, rows of the via points: X_S1, X_S2, X_S3 [mm], phi4, phi5 [rad]. Row 6 prints X_S3 = 223.38; between 255.31
# and 201.39 it must read 226.38.
TABLE_6 = np.array(
    [
        (262.63, 142.92, 367.10, -1.030, 1.028),
        (279.40, 189.61, 325.12, -1.082, 0.993),
        (298.23, 236.26, 288.21, -1.117, 0.918),
        (319.14, 284.04, 255.31, -1.149, 0.838),
        (341.88, 333.02, 226.38, -1.179, 0.752),
        (366.21, 383.29, 201.39, -1.206, 0.662),
        (391.95, 434.95, 180.26, -1.232, 0.566),
        (418.93, 488.14, 162.95, -1.257, 0.466),
        (447.03, 543.04, 149.39, -1.280, 0.361),
        (476.11, 599.93, 139.50, -1.303, 0.252),
        (507.92, 662.77, 132.92, -1.350, 0.197),
    ]
)


@cache
def via_points(which: str) -> Array:
    """Via points ``(11, 5)``: Table 6's, or those whose tool poses are (156), by least squares from Table 6's."""
    table = TABLE_6 * np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0])
    if which == "table6":
        return table
    machine, eta = HybridRobot(0.0), np.arange(11.0)
    x, y = 600.0 + 40.0 * eta, -150.0 + 30.0 * eta  # [mm]
    z = (y - 100.0) ** 2 / 400.0 - x**2 / 6400.0 + 1100.0
    slope = np.array([z[1] - z[0], *(z[2:] - z[:-2]) / 2.0, z[-1] - z[-2]]) / 50.0  # 50 mm between points from above
    axes = np.stack([-0.8 * slope, -0.6 * slope, np.ones(11)], axis=1)
    axes /= np.linalg.norm(axes, axis=1)[:, None]

    def away(q: Array, position: Array, axis: Array) -> Array:
        rotation, origin = machine.tool_pose(q)
        return np.concatenate([origin - position, rotation[:, 2] - axis])

    places = np.stack([x, y, z], axis=1) * 1e-3
    found = [
        least_squares(away, q, args=pose, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        for q, *pose in zip(table, places, axes, strict=True)
    ]
    assert max(np.abs(f.fun).max() for f in found) < 1e-14
    return np.array([f.x for f in found])


def excesses(motion: Motion, case: Case, data: Mapping[str, Any]) -> Excesses:
    """Largest relative excess of every limit."""
    if motion.segments != 12:
        return {"segments": np.inf}
    said = parameter(data, "payload", case["payload"])
    payload = said if case["free_payload"] else case["payload"]
    machine = HybridRobot(payload, literal=case["convention"] == "paper-literal")
    points = via_points(case["via_points"])
    knots = [motion.knot(i) for i in (0, *range(2, 11), 12)]
    found = {
        f"{name}-limit": worst(motion, lambda k, u, order=order: motion.at(k, u, order), *bounds)  # type: ignore[misc]
        for order, (name, bounds) in enumerate(
            {
                "position": POSITION,
                "velocity": (-VELOCITY, VELOCITY),
                "acceleration": (-ACCELERATION, ACCELERATION),
                "jerk": (-JERK, JERK),
            }.items()
        )
    }
    found |= {
        "effort-limit": worst(motion, lambda k, u: efforts(machine, *motion.state(k, u)[:3]), -FORCE, FORCE),
        "yaw": worst(motion, lambda k, u: motion.at(k, u) @ np.array([[-1.0, 1.0, 0.0, 0.0, 0.0]]).T, -L1, L1),
        "rest": apart([knots[0][1:3], knots[-1][1:3]], 0.0, POINT),
        "via": apart([knot[0] for knot in knots], points, POINT),
        "parameter": apart(said, payload, AGREEMENT * (1.0 + payload)),
    }
    return found


def blocks(motion: Motion, case: Case, data: Mapping[str, Any]) -> Blocks:
    """The decision variables that the curve itself shows, with their bounds; (152)."""
    least = np.full(12, case["min_interval"])
    least[2:-2] = np.abs(np.diff(via_points(case["via_points"]), axis=0) / VELOCITY).max(axis=1)[1:-1]
    found: Blocks = {"h": (motion.durations, least, case["max_interval"])}
    if case["free_payload"]:
        found["payload"] = (parameter(data, "payload", case["payload"]), 0.0, case["max_payload"])
    return found
