"""Minimum-jerk movements of the hand in a plane. Flash and Hogan (1985), J. Neuroscience 5(7), 1688-1703.

Decision variables  two inner control points of the hand's path [m]
Curve               a Bezier segment of degree 7, at rest at both ends
Objectives          half the integral of the squared jerk    (1)
Subject to          the hand's speed: our choice
Deviations
  The optimum is the quintic (A6), which this curve holds: int |jerk|^2 dt = 720 |goal - start|^2 / T^5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

import ocp_traj as ot
from ocp_traj.formulation.case import Checked, number, numbers

JOINTS, UNITS = ("x", "y"), ("m", "m")


@dataclass(frozen=True)
class FlashHogan1985(Checked):
    """The numbers of a movement; our choice."""

    start: tuple[float, float] = (0.0, 0.3)  # [m]
    goal: tuple[float, float] = numbers((0.2, 0.5), "m")
    duration: float = number(0.8, "s", above=0.0)
    max_speed: float = number(1.0, "m/s", above=0.0)  # along each axis


Case = FlashHogan1985


def build(case: FlashHogan1985 | None = None) -> ot.Problem:
    """The problem of a case."""
    case = case or FlashHogan1985()
    start, goal = np.array(case.start), np.array(case.goal)

    def curve(x: Any) -> ot.PiecewiseBezier:
        rows = [*[casadi.SX(start).T] * 3, x[:2].T, x[2:].T, *[casadi.SX(goal).T] * 3]
        return ot.PiecewiseBezier([case.duration], (casadi.vertcat(*rows),))

    bounds = np.full(4, 2.0)
    limits = ot.JointLimits(velocity=(case.max_speed,) * 2)
    jerk = ot.Objective("jerk", "m2/s5", 100.0, eq="(1)", integrand=lambda s: 0.5 * casadi.sumsqr(s.jerk))
    return ot.Problem(
        id="hand-movements",
        case=case,
        variables=(ot.Variable("P", -bounds, bounds, "m", ("x3", "y3", "x4", "y4"), "our choice"),),
        curve=curve,
        objectives=(jerk,),
        requirements=ot.Requirements(
            JOINTS, UNITS, ot.standard.joint_limits(limits, JOINTS, UNITS, {"velocity": "our choice"}),
            (
                ot.standard.rest(JOINTS, UNITS, eq="sect. 2"),
                ot.standard.via_points([start, goal], ot.standard.ENDS, JOINTS, UNITS, "sect. 2"),
            ),
            continuity=2,
        ),
        guess=lambda rng: rng.uniform(0.0, 0.6, 4),
        about=ot.About(
            "hand movements of least jerk",
            "Flash and Hogan (1985), J. Neuroscience 5(7)",
            "Bezier of degree 7, one segment",
        ),
    )  # fmt: skip
