"""One judge for the trajectories of all tools: a scan that knows nothing of the package, and the audit.

The scan asks the tool itself where it is at 20 000 even instants, and takes torques from pinocchio. The audit is of the
same motion as a piecewise Bezier curve, which the tool's polynomials are exactly; how far the two are apart is stated.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.interpolate import BPoly

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation import standard
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.proof.audit import audit
from ocp_traj.proof.verdicts import CHECKED, PROVED
from ocp_traj.results.trajectory import audit_points, trajectory_of
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot
from tests.independent import motion as motions
from tests.independent.check import excesses
from tests.independent.motion import beyond
from tests.independent.robots import Machine, efforts

INSTANTS = 20_000
ORDERS = ("position", "velocity", "acceleration", "jerk", "snap")
Sampler = Callable[[Array, int], Array]  # times (N,) [s], order of the derivative -> (N, dof)
Bounds = Mapping[str, Any]  # by quantity: lower and upper bounds (dof,) each


@dataclass(frozen=True)
class Made:
    """A trajectory as its tool has it.

    Attributes:
        duration: [s].
        sample: the tool's own evaluation.
        curve: the same as Bezier pieces.
    """

    duration: float
    sample: Sampler
    curve: PiecewiseBezier


def of_curve(curve: PiecewiseBezier) -> Made:
    """One of ours, evaluated by SciPy."""
    raised = curve.elevate(max(curve.degrees))
    by_scipy = BPoly(np.stack(raised.control_points, axis=1), curve.knots)

    def sample(t: Array, order: int) -> Array:
        return np.asarray(by_scipy(t, nu=order))

    return Made(float(curve.duration), sample, curve)


class PinArm:
    """Torques by pinocchio's own recursion, with a payload on the tool.

    Args:
        robot: its model, and where the tool is.
        mass: of the payload [kg].
        com: of it in the tool's frame ``(3,)`` [m].
    """

    def __init__(self, robot: Robot, mass: float = 0.0, com: tuple[float, ...] = (0.0, 0.0, 0.0)) -> None:
        model = robot.model.copy()
        joint = robot.tool_joint if robot.tool_joint is not None else model.njoints - 1
        joint = model.getJointId(joint) if isinstance(joint, str) else joint
        model.appendBodyToJoint(joint, pin.Inertia(mass, np.array(com), np.zeros((3, 3))), robot.tool)
        self.model, self.data = model, model.createData()

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """At one instant ``(n,)``."""
        return np.array(pin.rnea(self.model, self.data, q, v, a))


def requirements(robot: Robot, bounds: Bounds, payload: Any = 0.0) -> Requirements:
    """Limits on joints, on torques where ``bounds`` has ``effort``, and as much continuity as keeps them finite."""
    held = {name: pair for name, pair in bounds.items() if name in ORDERS}
    limits = standard.joint_limits(JointLimits(**held), robot.joints, robot.units)
    if "effort" in bounds:
        limits = (*limits, standard.effort_limit(
            lambda s: robot.effort(s.q, s.v, s.a, payload=payload), np.array(bounds["effort"]), robot.effort_units,
            robot.joints,
        ))  # fmt: skip
    smooth = max((ORDERS.index(name) - 1 for name in held), default=0)
    return Requirements(robot.joints, robot.units, limits, continuity=max(smooth, 0))


def scan(made: Made, bounds: Bounds, machine: Machine | None) -> tuple[float, str]:
    """Largest excess over a limit relative to that limit, and which limit it is; below zero where all are met.

    Args:
        made: the trajectory.
        bounds: lower and upper, of ``ORDERS`` and of ``effort``.
        machine: gives the torques where they are limited.
    """
    t = np.linspace(0.0, made.duration, INSTANTS)
    found = {name: made.sample(t, order) for order, name in enumerate(ORDERS) if name in bounds}
    if machine is not None and "effort" in bounds:
        found["effort"] = efforts(machine, *(made.sample(t, order) for order in range(3)))
    excess = {name: float(beyond(values, *bounds[name]).max()) for name, values in found.items()}
    worst = max(excess, key=lambda name: excess[name])
    return excess[worst], worst


def judged(made: Made, bounds: Bounds, machine: Machine | None, wanted: Requirements) -> dict[str, Any]:
    """What scan and audit find.

    Returns:
        ``duration`` [s]; ``excess`` and ``limit`` of the scan; ``proved``, whether the audit proves all limits along
        the path and that nothing jumps that must not; ``jumps``, what does; ``audit excess``, the largest that it has
        not ruled out; ``audit`` in words; ``gap`` between what was scanned and what was audited, in the joints' units;
        ``scan seconds`` and ``audit seconds`` of the processor.
    """
    begun = time.process_time()
    excess, limit = scan(made, bounds, machine)
    scanned = time.process_time()
    found = audit(Motion(made.curve, wanted.joints), wanted)
    audited = time.process_time()
    rows = [row for row in found.rows if row.verdict != CHECKED and row.boxes]
    jumps = [row.limit for row in found.rows if row.limit.startswith("continuity") and row.verdict != CHECKED]
    t = np.linspace(0.0, made.duration, 1001)
    gap = np.abs(made.curve(np.minimum(t, made.curve.duration)) - made.sample(t, 0)).max()
    return {
        "duration": made.duration, "excess": excess, "limit": limit, "jumps": sorted(set(jumps)),
        "proved": all(row.verdict == PROVED for row in rows) and not jumps,
        "audit excess": max(0.0, *(-row.margin for row in rows)), "audit": found.explain()[:300],
        "gap": float(gap), "scan seconds": scanned - begun, "audit seconds": audited - scanned,
    }  # fmt: skip


def judged_point(problem: Problem, x: Array) -> dict[str, Any]:
    """What scan and audit find of decision variables ``(n,)`` of a paper's problem: ``excess``, ``limit``, ``proved``.

    The scan is of the code in ``tests/independent``, which shares nothing with the package, at ``INSTANTS`` instants.
    """
    (_, found), trajectory = audit_points(problem, [x])[0], trajectory_of(problem, x)
    cells, motions.GRID = motions.GRID, INSTANTS // trajectory.curve.segments
    try:
        excess = excesses(trajectory.to_dict())
    finally:
        motions.GRID = cells
    worst = max(excess, key=lambda name: excess[name])
    return {"excess": float(excess[worst]), "limit": worst, "proved": found.proved, "audit": found.explain()[:300]}
