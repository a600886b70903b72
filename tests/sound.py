"""Trajectories of every problem that keep every limit, as the plain JSON values of their files; none needs a solve."""

import json
from functools import cache
from typing import Any

import numpy as np

from ocp_traj import problems
from ocp_traj.results.trajectory import Trajectory, trajectory_of

TABLE_7 = (0.330, 0.837, 0.803, 0.569, 0.477, 0.382, 0.348, 0.348, 0.392, 0.552, 0.732, 0.420)  # h [s], Guo et al.
SLOW = (0.6, 1.0, 0.8)  # [s], within every limit of Zhu and Wang's arm
ROUND = (
    2.15,
    2.13,
    0.3,
    -0.8,
    -1.27,
    0.05,
    0.2,
    0.6,
    2.1,
)  # a wrist's via point, its velocities, th3 at the goal, times
SHORT = {"tags": 2, "phi": (-10.0, 10.0)}  # the shortest seam: it is fitted and proved soonest
# name: (problem, case, variables). ``None``: the problem's own start.
VARIANTS: dict[str, tuple[str, dict[str, Any], Any]] = {
    "hybrid": ("hybrid-spline", {}, TABLE_7),
    "hybrid, literal": ("hybrid-spline", {"convention": "paper-literal", "payload": 6.0}, TABLE_7),
    "hybrid, table 6": ("hybrid-spline", {"via_points": "table6"}, TABLE_7),
    "hybrid, free payload": ("hybrid-spline", {"free_payload": True}, (*TABLE_7, 7.0)),
    "rotor": ("rotor-353", {}, SLOW),
    "rotor, jerk": ("rotor-353", {"jerk": (1e4,) * 6, "payload": 5.0}, SLOW),
    "rotor, printed": ("rotor-353", {"as_printed": True, "timing": "per_joint"}, (1.0, 2.8, 3.0)),
    "rotor, free payload": ("rotor-353", {"free_payload": True, "effort_limits": False}, (*SLOW, 4.0)),
    "wrist": ("wrist-obstacle", {"branch": "0"}, (*ROUND, 0.01)),
    "wrist, best": ("wrist-obstacle", {}, (*ROUND, 0.0)),
    "wrist, effort": ("wrist-obstacle", {"branch": "0", "effort_limits": True}, (*ROUND, 0.01)),
    "wrist, clearance": ("wrist-obstacle", {"branch": "0", "min_clearance": 0.03}, (*ROUND, 0.04)),
    "wrist, far": ("wrist-obstacle", {"branch": "0", "obstacles": ((0.0, 2.5, 0.0, 0.2),)}, (*ROUND, 0.0)),
    "wrist, none": ("wrist-obstacle", {"branch": "0", "obstacles": ()}, ROUND),
    "air move": ("weld-bezier", {"case": "air-move"}, None),
    "air move, rest": ("weld-bezier", {"case": "air-move", "rest_at_tags": True}, None),
    "seam": ("weld-bezier", SHORT, None),
}


@cache
def _text(name: str, slower: float) -> str:
    problem, case, x = VARIANTS[name]
    built = problems.load(problem, **case)
    start = built.guess(np.random.default_rng(0)) if x is None else np.array(x)
    motion: Trajectory = trajectory_of(built, start)
    return json.dumps((motion if slower == 1.0 else motion.dilate(slower)).to_dict())


def sound(name: str, slower: float = 1.0) -> dict[str, Any]:
    """A fresh copy of a variant's file; a slower motion has forgotten its variables."""
    data: dict[str, Any] = json.loads(_text(name, slower))
    return data
