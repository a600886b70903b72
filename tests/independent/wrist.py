"""Every requirement of ``wrist-obstacle`` (El Haiek et al., 2019), recomputed from a trajectory's file."""

from collections.abc import Mapping, Sequence
from math import acos, asin, pi, sqrt
from typing import Any

import numpy as np

from tests.independent.case import POINT, Blocks, Case, Excesses, parameter
from tests.independent.motion import Array, Motion, apart, worst
from tests.independent.robots import WristRobot, efforts

JOINTS = ("theta1", "theta2", "theta3")
DEFAULTS: Case = {
    "case": "blocked",
    "start": None,
    "goal": None,
    "obstacles": ((0.5, 0.5, 0.0, 0.4),),
    "link_radius": 0.05,
    "d3": 2.0,
    "weights": (1.0, 1.0),
    "branch": "best",
    "min_clearance": 0.0,
    "max_position": (pi, pi, pi),
    "max_velocity": (2.0, 2.0, 3.0),
    "max_acceleration": (10.0, 10.0, 15.0),
    "min_time": 0.1,
    "max_time": 4.0,
    "effort_limits": False,
    "max_effort": (1.0, 2.0, 0.2),
}
# Start and goal of the tip, lifted off the plane of sect. 5.
ENDS = {
    "blocked": ((-1.0, 1.0, -sqrt(2.0)), (1.0, 1.0, sqrt(2.0))),
    "open": ((-1.0, 1.0, sqrt(2.0)), (1.0, 1.0, sqrt(2.0))),
}


def rotation_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_y(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def tip(q: Sequence[float] | Array, d3: float = 2.0) -> Array:
    """(1)-(3), by rotations."""
    return np.asarray(rotation_z(q[0]) @ rotation_y(q[1]) @ rotation_z(q[2]) @ np.array([0.0, 0.0, d3]))


def tips(q: Array, d3: float = 2.0) -> Array:
    """The same of many postures, ``(N, 3)``."""
    across = np.sin(q[:, 1])
    return d3 * np.stack([np.cos(q[:, 0]) * across, np.sin(q[:, 0]) * across, np.cos(q[:, 1])], axis=1)


def segment_distance(ends: Array, centre: Array) -> Array:
    """Distance of a point from segments between the origin and ``ends (.., 3)``: ``(..)``."""
    along = np.clip(ends @ centre / (ends**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(along[..., None] * ends - centre, axis=-1))


def wrist_angles(point: Sequence[float] | Array, branch: int) -> tuple[float, float]:
    """Angles that point the link at a point, from the polar angle; the other branch turns half round and bends back."""
    polar = acos(point[2] / float(np.linalg.norm(point)))
    azimuth = float(np.angle(complex(point[0], point[1])))
    if branch == 0:
        return azimuth, polar
    return azimuth - pi if azimuth > 0.0 else azimuth + pi, -polar


def within_reach(sphere: Sequence[float], case: Case) -> bool:
    """Whether the link is as long as the tangents from the base to a sphere grown by the link's radius."""
    return bool(case["d3"] >= sqrt(np.sum(np.square(sphere[:3])) - (sphere[3] + case["link_radius"]) ** 2))


def overlap(q: Array, sphere: Sequence[float], case: Case, clearance: float) -> Array:
    """By how much the link is too near to a sphere ``(N,)``, over the centre's distance from the base; <= 0 if clear.

    The link is a capsule from the base to the tip. It stays clear by an angle, seen from the base: of a sphere within
    reach it keeps its direction away from the centre's by that angle more than the sphere's half angle; one farther out
    may grow by that angle. Neither can be had where the angles exceed two right angles, or one.
    """
    centre, radius = np.array(sphere[:3]), sphere[3] + case["link_radius"]
    size = float(np.linalg.norm(centre))
    half, ends = asin(radius / size), tips(q, case["d3"])
    touching = (radius - segment_distance(ends, centre)) / size
    if half + clearance > (pi if within_reach(sphere, case) else pi / 2.0):
        near = np.full(len(q), np.inf)
    elif within_reach(sphere, case):
        near = ends @ centre / (size * case["d3"]) - np.cos(half + clearance)
    else:
        near = np.sin(half + clearance) - segment_distance(ends, centre) / size
    return np.maximum(touching, near)


def excesses(motion: Motion, case: Case, data: Mapping[str, Any]) -> Excesses:
    """Largest relative excess of every limit."""
    if motion.segments != 2:
        return {"segments": np.inf}
    machine = WristRobot(case["d3"])
    start, goal = (case[name] or ENDS[case["case"]][i] for i, name in enumerate(("start", "goal")))
    branches = (0, 1) if case["branch"] == "best" else (int(case["branch"]),)
    first, last = motion.knot(0), motion.knot(2)
    found: Excesses = {}
    for order, name in enumerate(("position", "velocity", "acceleration")):
        bound = np.array(case[f"max_{name}"])
        found[f"{name}-limit"] = worst(motion, lambda k, u, o=order: motion.at(k, u, o), -bound, bound)  # type: ignore[misc]
    if case["effort_limits"]:
        bound = np.array(case["max_effort"])
        found["effort-limit"] = worst(motion, lambda k, u: efforts(machine, *motion.state(k, u)[:3]), -bound, bound)
    if case["obstacles"]:
        said = parameter(data, "clearance", case["min_clearance"])
        clearance = max(said, case["min_clearance"])
        for name, reached in (("obstacles", True), ("far-obstacles", False)):
            spheres = [sphere for sphere in case["obstacles"] if within_reach(sphere, case) == reached]

            def near(k: int, u: Array, spheres: Any = spheres) -> Array:
                return np.stack([overlap(motion.at(k, u), sphere, case, clearance) for sphere in spheres], axis=1)

            if spheres:
                found[name] = worst(motion, near, -np.inf, 0.0)
    return found | {
        "rest": apart([first[1:3], last[1:3]], 0.0, POINT),
        "start": apart(first[0], [*wrist_angles(start, 0), 0.0], POINT),
        "goal": min(apart(last[0, :2], wrist_angles(goal, branch), POINT) for branch in branches),
    }


def blocks(motion: Motion, case: Case, data: Mapping[str, Any]) -> Blocks:
    """The decision variables that the curve itself shows, with their bounds; a clearance may be as large as it is."""
    via, goal, position, speed = motion.knot(1), motion.knot(2), np.array(case["max_position"]), case["max_velocity"]
    found: Blocks = {
        "via": (via[0], -position, position),
        "via_velocity": (via[1], -np.array(speed), speed),
        "theta_g": (goal[0, 2], -position[2], position[2]),
        "t": (motion.durations, case["min_time"], case["max_time"]),
    }
    if case["obstacles"]:
        found["margin"] = (parameter(data, "clearance", case["min_clearance"]), case["min_clearance"], np.inf)
    return found
