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
from scipy.interpolate import BPoly

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.proof.audit import audit
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


def scan(made: Made, bounds: Bounds, machine: Machine | None) -> tuple[float, str]:
    """Largest excess over a limit relative to that limit, and which limit it is; below zero where all are met.

    Args:
        made: the trajectory.
        bounds: lower and upper, of ``ORDERS`` and of ``effort``.
        machine: gives the torques where they are limited.
    """
    t = np.linspace(0.0, made.duration, INSTANTS)
    found = {
        name: made.sample(t, order) for order, name in enumerate(ORDERS) if name in bounds
    }
    if machine is not None and "effort" in bounds:
        found["effort"] = efforts(machine, *(made.sample(t, order) for order in range(3)))
    excess = {name: float(beyond(values, *bounds[name]).max()) for name, values in found.items()}
    worst = max(excess, key=lambda name: excess[name])
    return excess[worst], worst


def judged(made: Made, bounds: Bounds, machine: Machine | None, requirements: Requirements) -> dict[str, Any]:
    """What scan and audit find.

    Returns:
        ``duration`` [s]; ``excess`` and ``limit`` of the scan; ``verdict`` of the audit, ``audit excess``, the largest
        that it has not ruled out, and ``audit`` in words; ``gap`` between what was scanned and what was audited, in the
        joints' units; ``scan seconds`` and ``audit seconds`` of the processor.
    """
    begun = time.process_time()
    excess, limit = scan(made, bounds, machine)
    scanned = time.process_time()
    found = audit(Motion(made.curve, requirements.joints), requirements)
    audited = time.process_time()
    t = np.linspace(0.0, made.duration, 1001)
    gap = np.abs(made.curve(np.minimum(t, made.curve.duration)) - made.sample(t, 0)).max()
    return {
        "duration": made.duration, "excess": excess, "limit": limit, "verdict": found.verdict,
        "audit excess": max(0.0, *(-row.margin for row in found.rows if row.boxes)), "audit": found.explain()[:300],
        "gap": float(gap), "scan seconds": scanned - begun, "audit seconds": audited - scanned,
    }  # fmt: skip
