"""Every limit of a limits file, recomputed from the file and a trajectory's, with the robot of its URDF."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from tests.independent.case import Excesses
from tests.independent.motion import Array, Motion, apart, worst
from tests.independent.robots import efforts, point_mass

ORDERS = ("q", "v", "a", "jerk", "snap")
DERIVATIVES = ("position", "velocity", "acceleration", "jerk", "snap")
JUMP = 1e-9  # of the largest value of a derivative, what it may jump by at a knot
Bounds = tuple[Array, Array]


class UrdfRobot:
    """A URDF's arm with a point mass at its tool frame.

    Args:
        path: of the URDF.
        table: the limits file's table ``robot``.
        payload: [kg].
    """

    def __init__(self, path: Path, table: Mapping[str, Any], payload: float) -> None:
        model = pin.buildModelFromUrdf(str(path))
        model.gravity.linear = np.array(table.get("gravity", [0.0, 0.0, -9.81]), dtype=float)
        self.joint, self.tool = model.njoints - 1, pin.SE3.Identity()
        if "tool_frame" in table:
            frame = model.frames[model.getFrameId(table["tool_frame"])]
            self.joint, self.tool = frame.parentJoint, frame.placement
        model.appendBodyToJoint(self.joint, point_mass(payload), self.tool)
        self.model, self.data = model, model.createData()
        own = {
            "position": (model.lowerPositionLimit, model.upperPositionLimit),
            "velocity": (-model.upperVelocityLimit, model.upperVelocityLimit),
            "effort": (-model.upperEffortLimit, model.upperEffortLimit),
        }
        self.own = own if table.get("limits", False) else {}

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """Joint torques and forces."""
        return np.array(pin.rnea(self.model, self.data, q, v, a))

    def tools(self, q: Array) -> Array:
        """Places of the tool frame's origin ``(N, 3)`` [m]."""
        places = []
        for posture in q:
            pin.forwardKinematics(self.model, self.data, posture)
            places.append((self.data.oMi[self.joint] * self.tool).translation)
        return np.array(places)


def excesses(data: Mapping[str, Any], limits: Mapping[str, Any], folder: Path) -> Excesses:
    """Largest relative excess of every limit.

    Args:
        data: the trajectory's file.
        limits: the limits file.
        folder: where it lies.
    """
    motion = Motion.read(data)
    if [str(name) for name in data["joints"]] != limits["joints"] or motion.dof != len(limits["joints"]):
        return {"joints": np.inf}
    table, held = limits.get("robot", {}), limits.get("payload", {})
    mass = float(data["parameters"]["payload"] if held.get("parameter") else held.get("mass", 0.0))
    machine = UrdfRobot(folder / table["urdf"], table, mass) if table else None
    own = machine.own if machine else {}
    bounds = {name: _bounds(limits.get(name), own.get(name)) for name in (*DERIVATIVES, "effort")}
    found: Excesses = {"parameter": -mass if held.get("parameter") else -np.inf}
    smooth = 0
    for order, name in enumerate(DERIVATIVES):
        if (pair := bounds[name]) is not None:
            derivative, rounding = _derivative(motion, order), motion.rounding(order)
            found[f"{name}-limit"] = worst(motion, derivative, pair[0] - rounding, pair[1] + rounding)
            smooth = max(smooth, order - 1)
    if machine is not None:
        if (pair := bounds["effort"]) is not None:
            found["effort-limit"] = worst(motion, lambda k, u: efforts(machine, *motion.state(k, u)[:3]), *pair)
            smooth = max(smooth, 1)
        if (box := _bounds(limits.get("tool"), None, 3)) is not None:
            found["tool-box"] = worst(motion, lambda k, u: machine.tools(motion.at(k, u)), *box)
    if rest := limits.get("rest"):
        still = [motion.knot(i)[1 : rest["order"] + 1] for i in (0, motion.segments)]
        found["rest"] = apart(still, 0.0, rest.get("tolerance", 1e-9))
    for order in range(limits.get("continuity", smooth) + 1):
        found[f"continuity of {ORDERS[order]}"] = motion.jump(order) - JUMP
    return {name: excess for name, excess in found.items() if excess > -np.inf} or {"nothing is asked for": np.inf}


def _derivative(motion: Motion, order: int) -> Callable[[int, Array], Array]:
    return lambda k, u: motion.at(k, u, order)


def _bounds(table: Mapping[str, Any] | None, own: Bounds | None, size: int = 0) -> Bounds | None:
    """Lower and upper bounds, the file's before the robot's; None where there is none that is finite."""
    if not table:
        pair = own
    elif "limit" in table:
        pair = -np.array(table["limit"], dtype=float), np.array(table["limit"], dtype=float)
    else:
        lower, upper = (table.get(key, [sign * np.inf] * size) for key, sign in (("lower", -1.0), ("upper", 1.0)))
        pair = np.array(lower, dtype=float), np.array(upper, dtype=float)
    return pair if pair is not None and np.isfinite(pair).any() else None
