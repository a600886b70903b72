"""What a trajectory's file promises, recomputed: every limit of its problem, at many instants, by this folder alone.

Nothing of ``ocp_traj`` is used but a table of numbers: the file is plain JSON, polynomials are evaluated here, robots
are pinocchio's. ``excesses`` says by how much each limit is exceeded; a trajectory that is proved exceeds none.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.independent import hybrid, rotor, weld, wrist
from tests.independent.case import Blocks, Excesses, complete
from tests.independent.motion import Motion, within

# A proof allows 1e-12 of a bound; rounding in the fourth derivative of a nonic is some 1e-10 of it.
TOLERANCE = 1e-9
# What a curve shows of a scaled snap at a tag is 48384 times as far off as its control points, which agree to 1e-9.
SHOWN = 1e-4
JUMP = 1e-9  # of the largest value of a derivative, what it may jump by at a knot
PROBLEMS: dict[str, Any] = {"hybrid-spline": hybrid, "rotor-353": rotor, "wrist-obstacle": wrist, "weld-bezier": weld}
CONTINUITY = {"hybrid-spline": 2, "rotor-353": 2, "wrist-obstacle": 2, "weld-bezier": 4}
ORDERS = ("q", "v", "a", "jerk", "snap")


def excesses(data: Mapping[str, Any]) -> Excesses:
    """By how much a trajectory exceeds each limit of the problem its file names; see ``broken``.

    Limits are relative to their bounds; what has to be equal is in its own unit, less what it may differ.
    """
    problem = PROBLEMS[data["problem"]]
    case, motion = complete(data, problem.DEFAULTS), Motion.read(data)
    if tuple(data["joints"]) != problem.JOINTS or motion.dof != len(problem.JOINTS):
        return {"joints": np.inf}
    found: Excesses = dict(problem.excesses(motion, case, data))
    if "segments" in found:
        return found
    for order in range(CONTINUITY[data["problem"]] + 1):
        found[f"continuity of {ORDERS[order]}"] = motion.jump(order) - JUMP
    blocks = problem.blocks(motion, case, data)
    for name, (values, lower, upper) in blocks.items():
        found[name] = max(found.get(name, -np.inf), within(values, lower, upper))
    if data.get("variables"):
        found["variables"] = disagreement(data["variables"], blocks)
    return found


def disagreement(said: Mapping[str, Any], shown: Blocks) -> float:
    """Largest difference of a file's variables from those its curve shows, over 1 + their size, less what may be."""
    if set(said) != set(shown):
        return np.inf
    gaps = []
    for name, (values, *_) in shown.items():
        given, here = np.atleast_1d(np.array(said[name], dtype=float)), np.atleast_1d(np.array(values, dtype=float))
        if given.shape != here.shape:
            return np.inf
        gaps.append(float(np.abs(given - here).max() / (1.0 + np.abs(here).max())))
    return np.inf if np.isnan(gaps).any() else max(gaps) - SHOWN


def broken(found: Excesses) -> Excesses:
    """The limits that are exceeded by more than rounding explains."""
    return {name: excess for name, excess in found.items() if not excess <= TOLERANCE}
