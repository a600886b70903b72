"""Every requirement of ``rotor-353`` (Zhu and Wang), recomputed from a trajectory's file."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.independent.case import AGREEMENT, POINT, Blocks, Case, Excesses, parameter
from tests.independent.motion import Array, Motion, apart, worst
from tests.independent.robots import RotorRobot, efforts

JOINTS = ("J1", "J2", "J3", "J4", "J5", "J6")
# The maker's: [deg/s], [N m], [deg]; positions are of J1, J2, J2 + J3, J4, J5, J6.
SPEED = np.array([210.0, 210.0, 220.0, 430.0, 450.0, 720.0])
EFFORT = np.array([2000.0, 3000.0, 1000.0, 100.0, 100.0, 50.0])
POSITION = np.array([[-185.0, -90.0, -90.0, -190.0, -179.999, -450.0], [185.0, 145.0, 222.0, 190.0, 179.999, 450.0]])
DEFAULTS: Case = {
    "as_printed": False,
    "velocity": tuple(SPEED.tolist()),
    "acceleration": tuple((2.0 * SPEED).tolist()),
    "jerk": (),
    "payload": 0.0,
    "position_limits": True,
    "effort_limits": True,
    "timing": "synchronised",
    "min_duration": 0.05,
    "max_duration": 4.0,
    "free_payload": False,
    "max_payload": 150.0,
}
# Table 2 [deg]: a line a joint, X0 .. X3; joint 3 of X2 prints 63.179.
TABLE_2 = np.array(
    [
        [-23.496, -20.128, -7.361, -8.055],
        [73.451, 80.381, 68.721, 61.474],
        [-62.949, -55.208, -63.179, -68.520],
        [77.747, 78.321, -35.605, -29.593],
        [41.879, 35.783, 27.940, 32.293],
        [-2.099, -12.636, 53.129, 46.917],
    ]
)
PRINTED = 63.179


def via_points(as_printed: bool) -> Array:
    """X0 .. X3 ``(4, 6)`` [deg]."""
    points = TABLE_2.T.copy()
    if as_printed:
        points[2, 2] = PRINTED
    return points


def excesses(motion: Motion, case: Case, data: Mapping[str, Any]) -> Excesses:
    """Largest relative excess of every limit."""
    if motion.segments != 3:
        return {"segments": np.inf}
    said = parameter(data, "payload", case["payload"])
    payload = said if case["free_payload"] else case["payload"]
    machine = RotorRobot(payload)
    found: Excesses = {}
    for order, name in enumerate(("velocity", "acceleration", "jerk"), 1):
        if case[name]:
            bound = np.radians(case[name])
            found[f"{name}-limit"] = worst(motion, lambda k, u, o=order: motion.at(k, u, o), -bound, bound)  # type: ignore[misc]
    if case["position_limits"]:
        found["position-limit"] = worst(motion, lambda k, u: motion.at(k, u) @ machine.couple.T, *np.radians(POSITION))
    if case["effort_limits"]:
        found["effort-limit"] = worst(
            motion, lambda k, u: efforts(machine, *motion.state(k, u)[:3]), -EFFORT, EFFORT
        )  # fmt: skip
    knots = [motion.knot(i) for i in range(4)]
    return found | {
        "rest": apart([knots[0][1:3], knots[-1][1:3]], 0.0, POINT),
        "via": apart([knot[0] for knot in knots], np.radians(via_points(case["as_printed"])), POINT),
        "parameter": apart(said, payload, AGREEMENT * (1.0 + payload)),
    }


def blocks(motion: Motion, case: Case, data: Mapping[str, Any]) -> Blocks:
    """The decision variables that the curve itself shows, with their bounds."""
    found: Blocks = {"t": (motion.durations, case["min_duration"], case["max_duration"])}
    if case["free_payload"]:
        found["payload"] = (parameter(data, "payload", case["payload"]), 0.0, case["max_payload"])
    return found
