"""Every requirement of ``weld-bezier`` (Ogbemhe et al., 2019), recomputed from a trajectory's file."""

from collections.abc import Mapping
from functools import lru_cache
from math import cos, radians
from typing import Any

import numpy as np

from ocp_traj.problems import kr90
from tests.independent.case import POINT, Blocks, Case, Excesses
from tests.independent.motion import Array, Motion, apart, worst
from tests.independent.robots import WeldRobot, efforts
from tests.independent.seam import Seam, polyline, tube

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")
DEFAULTS: Case = {
    "case": "seam",
    "psi": 60.0,
    "chord_radius": 0.150,
    "brace_radius": 0.090,
    "phi": (-90.0, 90.0),
    "mirrored": False,
    "origin": (2.05, 0.0, 1.0),
    "yaw": 180.0,
    "seam_file": "",
    "riser": 0.6,
    "tags": 9,
    "weld_speed": 0.008,
    "tcp_box": 0.04e-3,
    "tcp_tolerance": 0.5e-3,
    "max_tilt": 5.0,
    "payload": 0.0,
    "home": (0.0, -90.0, 100.0, 0.0, -60.0, 180.0),
    "as_printed": False,
    "rest_at_tags": False,
    "weights": (1.0, 1.0, 1.0, 1e-3),
    "min_air_time": 0.5,
    "max_air_time": 30.0,
}
PRINTED_EFFORT = 35_000.0  # [N m], every joint
REST, VIA, GOAL = np.radians(
    [
        [0.0, -90.0, 100.0, 0.0, 60.0, 0.0],
        [15.0, -80.0, 110.0, 20.0, 65.0, 15.0],
        [30.0, -65.0, 105.0, 45.0, 50.0, 40.0],
    ]
)  # of the air move


@lru_cache(maxsize=16)
def _seam(file: str, fields: tuple[tuple[str, Any], ...]) -> Seam:
    return polyline(dict(fields)) if file else tube(dict(fields))


def seam(case: Case) -> Seam:
    """What is welded."""
    names = ("psi", "chord_radius", "brace_radius", "phi", "mirrored", "origin", "yaw", "seam_file")
    return _seam(case["seam_file"], tuple((name, case[name]) for name in names))


def excesses(motion: Motion, case: Case, data: Mapping[str, Any]) -> Excesses:
    """Largest relative excess of every limit."""
    if motion.segments != (case["tags"] + 1 if case["case"] == "seam" else 2):
        return {"segments": np.inf}
    machine = WeldRobot(case["payload"], case["riser"])
    strongest = np.full(6, PRINTED_EFFORT) if case["as_printed"] else np.array(kr90.EFFORT)
    found: Excesses = {
        "position-limit": worst(motion, motion.at, *np.radians(kr90.POSITION)),
        "effort-limit": worst(motion, lambda k, u: efforts(machine, *motion.state(k, u)[:3]), -strongest, strongest),
    }
    tables = {"velocity": kr90.VELOCITY, "acceleration": kr90.ACCELERATION, "jerk": kr90.JERK, "snap": kr90.SNAP}
    for order, (name, table) in enumerate(tables.items(), 1):
        bound = np.radians(table)
        found[f"{name}-limit"] = worst(motion, lambda k, u, o=order: motion.at(k, u, o), -bound, bound)  # type: ignore[misc]
    ends = [motion.knot(0), motion.knot(motion.segments)]
    if case["case"] == "seam":
        return found | _ends(ends, *[np.radians(case["home"])] * 2) | _along(motion, case, machine)
    via = motion.knot(1)
    found["via"] = apart(via[0], VIA, POINT)
    if case["rest_at_tags"]:
        found["via"] = max(found["via"], apart(via[1:], 0.0, POINT))
    return found | _ends(ends, REST, GOAL)


def _ends(ends: list[Array], first: Array, last: Array) -> Excesses:
    """At rest up to snap where a move begins and ends."""
    pairs = zip(("start", "end"), ends, (first, last), strict=True)
    return {name: apart(end, np.vstack([q, np.zeros((4, 6))]), POINT) for name, end, q in pairs}


def _along(motion: Motion, case: Case, machine: WeldRobot) -> Excesses:
    """The weld's time, and tip and tilt against the seam itself."""
    path, pieces = seam(case), case["tags"] - 1
    piece = path.length / pieces

    def off(k: int, u: Array) -> Array:
        """Error of the tip along each axis [m], its size [m], cosine of the tilt."""
        wanted, axis = path.at(piece * (k - 1 + u))
        found, torch = machine.tips(motion.at(k, u))
        error = found - wanted
        return np.column_stack([error, np.linalg.norm(error, axis=1), (axis * torch).sum(axis=1)])

    weld = range(1, pieces + 1)
    box, far, tilt = case["tcp_box"], case["tcp_tolerance"], cos(radians(case["max_tilt"]))
    return {
        "weld-time": apart(motion.durations[1:-1] * case["weld_speed"] / piece, 1.0, POINT),
        "tcp": worst(motion, lambda k, u: off(k, u)[:, :3], -box, box, weld),
        "tcp-distance": worst(motion, lambda k, u: off(k, u)[:, 3:4], -np.inf, far, weld),
        "tilt": worst(motion, lambda k, u: off(k, u)[:, 4:], tilt, np.inf, weld),
    }


def blocks(motion: Motion, case: Case, data: Mapping[str, Any]) -> Blocks:
    """The decision variables that the curve itself shows, with their bounds.

    Derivatives at the tags are times powers of a time: that between tags, or the mean of the air move's least ones.
    """
    if case["case"] == "seam":
        unit = seam(case).length / case["weld_speed"] / (case["tags"] - 1)
        tags, orders = {f"tag {i}": motion.knot(i) for i in range(1, case["tags"] + 1)}, range(5)
    else:
        unit = float(np.mean([least_time(a, b, case) for a, b in ((REST, VIA), (VIA, GOAL))]))
        tags, orders = ({} if case["rest_at_tags"] else {"via": motion.knot(1)}), range(1, 5)
    tables = (kr90.POSITION[1], kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP)
    found: Blocks = {"T": (motion.durations[[0, -1]], case["min_air_time"], case["max_air_time"])}
    for tag, state in tags.items():
        for order in orders:
            most = np.radians(tables[order]) * unit**order
            least = -most if order else np.radians(kr90.POSITION[0])
            found[f"{('q', 'v', 'a', 'jerk', 'snap')[order]} at {tag}"] = (state[order] * unit**order, least, most)
    return found


def least_time(first: Array, last: Array, case: Case) -> float:
    """Of 200 durations in geometric progression the least at which a nonic from rest to rest is within Table 3."""
    shape = np.polynomial.Polynomial([0.0] * 5 + [126.0, -420.0, 540.0, -315.0, 70.0])
    u, needed = np.linspace(0.0, 1.0, 20_001), 0.0
    for order, table in enumerate((kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP), 1):
        share = np.abs(shape.deriv(order)(u)).max() * np.abs(last - first) / np.radians(table)
        needed = max(needed, float(share.max()) ** (1.0 / order))
    grid = np.geomspace(case["min_air_time"], case["max_air_time"], 200)
    return float(grid[grid >= needed].min(initial=case["max_air_time"]))
