"""Cubic splines for a 5-DOF hybrid robot with a payload. Guo et al. (2016), Shock and Vibration, 1302537.

Decision variables  the 12 intervals h between 13 knots [s]; the payload [kg] if it is freed      sect. 3.2, 5
Curve               cubic splines through 11 via points, at rest at both ends, two free end knots  (130)-(143)
Objectives          time z1, energy z2, jerk z3, acceleration z4, their weighted sum Fc  (112)-(116), (153), (154)
Subject to          position (118), velocity (119), acceleration (120), jerk (121), force (122) for all t; Table 2
Deviations
  The payload is a point mass at the tool frame, so its weight is a force of gravity. The paper's own numbers are met
  closest by a constant force along the tool's axis, of which it says nothing: ``convention="paper-literal"``, which
  also sums |U||v| before squaring.
  Jerk limits of joints 1-3 are 100 m/s^3 (Table 2 prints 100 000 m/s^3, meant are mm). Z0 points down.
  Row 6 of Table 6 must read X_S3 = 226.38; rows 2 and 12 follow from h and are no data. (60) and (67) mix frames, (30)
  lacks a division of A1 by L3. The yaw range below (4) is a limit as well. Bounds on h: (152) where an interval has a
  given displacement, else ``min_interval`` (our choice), and ``max_interval`` (our choice).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import pandas as pd

from ocp_traj.arrays import Array
from ocp_traj.curves.families import cubic_spline_free_ends
from ocp_traj.formulation import standard
from ocp_traj.formulation.about import About
from ocp_traj.formulation.case import Checked, choice, number, numbers
from ocp_traj.formulation.objective import MIDPOINT, TRAPEZOID, Objective, SumOfSquares
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import PathConstraint, Requirements, State
from ocp_traj.problems.hybrid_robot import GRAVITY, JOINTS, L1, LIMITS, UNITS, joints_of
from ocp_traj.problems.hybrid_robot import forward_kinematics as forward_kinematics
from ocp_traj.problems.hybrid_robot import inverse_kinematics as inverse_kinematics
from ocp_traj.problems.hybrid_robot import robot as robot

CONVENTIONS = ("physical", "paper-literal")


@dataclass(frozen=True)
class Guo2016(Checked):
    """The paper's numbers; a field is what a user may change."""

    payload: float = number(10.0, "kg", "a finite mass", least=0.0)  # m_p, sect. 6
    convention: str = choice("physical", CONVENTIONS)
    weights: tuple[float, float, float, float] = numbers((0.3, 0.3, 0.2, 0.2), least=0.0, some=True)  # w of z1 .. z4
    via_points: str = choice("rederived", ("rederived", "table6"))  # of (156), or Table 6 with row 6 corrected
    min_interval: float = number(0.02, "s", above=0.0, under="max_interval")  # of the four without a displacement: ours
    max_interval: float = number(4.0, "s", above=0.0)  # of every interval: our choice
    free_payload: bool = False  # whether the payload is a decision variable; sect. 5
    max_payload: float = number(100.0, "kg", "a finite mass", above=0.0)  # if freed: our choice


Case = Guo2016

# Table 6, the 11 via points; its row 6 prints X_S3 = 223.38.
TABLE_6 = pd.DataFrame(columns=["X_S1 [mm]", "X_S2 [mm]", "X_S3 [mm]", "phi_4 [rad]", "phi_5 [rad]"], data=(
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
))  # fmt: skip


def task_points() -> tuple[Array, Array]:
    """Positions ``(11, 3)`` [m] of (156), tool axes ``(11, 3)``: normal to the curve in its vertical plane, a_z > 0."""
    eta = np.arange(11.0)
    x, y = 600.0 + 40.0 * eta, -150.0 + 30.0 * eta
    z = (y - 100.0) ** 2 / 20.0**2 - x**2 / 80.0**2 + 1100.0
    slope = np.gradient(z, 50.0)  # dz/ds_xy: 50 mm between points, seen from above
    axis = np.stack([-0.8 * slope, -0.6 * slope, np.ones(11)], axis=1) / np.sqrt(1.0 + slope**2)[:, None]
    return np.stack([x, y, z], axis=1) * 1e-3, axis


def via_points(case: Guo2016 | None = None) -> Array:
    """The 11 via points in joint space ``(11, 5)`` [m, rad]."""
    if case and case.via_points == "table6":
        return np.asarray(TABLE_6.to_numpy() * np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0]))
    return joints_of(*task_points())


# Of the default case, each with another within the reference point; python benchmarks/ideal_points.py hybrid-spline
BEST = {
    "time": {"energy": 2.63615, "jerk": 2.56714, "acceleration": 2.48362},
    "energy": {"time": 1565.21, "jerk": 355.639, "acceleration": 355.639},
    "jerk": {"time": 0.0805246, "energy": 6.56202e-05, "acceleration": 6.56202e-05},
    "acceleration": {"time": 0.0531675, "energy": 0.00050263, "jerk": 0.00050263},
}


def build(case: Guo2016 | None = None) -> Problem:
    """The problem of a case."""
    case = case or Guo2016()
    machine, points = robot(), via_points(case)
    literal = case.convention == "paper-literal"

    def force(s: State) -> Any:
        if literal:  # (73) with 5f5 not turned into the world: a constant force along the tool's own axis
            return machine.effort(s.q, s.v, s.a, tool_force=casadi.vertcat(0.0, 0.0, -s.p[0] * GRAVITY))
        return machine.effort(s.q, s.v, s.a, payload=s.p[0])

    def power(s: State) -> Any:
        each = force(s) * s.v
        return casadi.sum1(casadi.fabs(each)) if literal else each

    def guess(rng: np.random.Generator) -> Array:  # step 3 of sect. 4: at random above (152), ends cut in two
        whole, cut = least * rng.uniform(1.2, 4.0, 10), rng.uniform(0.2, 0.8, 2)
        first, last = whole[0] * np.array([cut[0], 1 - cut[0]]), whole[-1] * np.array([cut[1], 1 - cut[1]])
        return np.asarray(np.clip(np.concatenate([first, whole[1:-1], last]), lower, case.max_interval))

    least = (np.abs(np.diff(points, axis=0)) / LIMITS.velocity[1]).max(axis=1)  # (152)
    lower = np.concatenate([np.full(2, case.min_interval), least[1:-1], np.full(2, case.min_interval)])
    names = tuple(f"h{i}" for i in range(1, 13))
    objectives = [
        Objective("time", "s", 1.0, eq="(113)", of_variables=lambda x, p: casadi.sum1(x[:12])),
        Objective("energy", "N2 m2/s", 1000.0, "min", "(114)", SumOfSquares(power), TRAPEZOID),
        Objective("jerk", "(m2+rad2)/s5", 10.0, "min", "(115)", SumOfSquares(lambda s: s.jerk), MIDPOINT),
        Objective("acceleration", "(m2+rad2)/s3", 1.0, "min", "(116)", SumOfSquares(lambda s: s.a), TRAPEZOID),
    ]
    terms = {o.id: w / o.scale for o, w in zip(objectives, case.weights, strict=True)}
    kinds = {"position": "(118)", "velocity": "(119)", "acceleration": "(120)", "jerk": "(121)"}
    yaw = np.array([L1])
    limits = (
        *standard.joint_limits(LIMITS, JOINTS, UNITS, kinds),
        standard.effort_limit(force, LIMITS.effort, machine.effort_units, ("F1", "F2", "F3", "tau4", "tau5"), "(122)"),
        PathConstraint("yaw", lambda s: s.q[1] - s.q[0], -yaw, yaw, ("m",), ("X_S2 - X_S1",), "below (4)"),
    )
    knots = ((0, 0.0), *((k, 0.0) for k in range(2, 11)), (-1, 1.0))
    ends = standard.rest(JOINTS, UNITS, eq="sect. 3.2"), standard.via_points(points, knots, JOINTS, UNITS, "(127)")
    problem = Problem(
        id="hybrid-spline",
        case=case,
        robot=machine,
        variables=(Variable("h", lower, np.full(12, case.max_interval), "s", names, "(152)"),),
        curve=lambda x: cubic_spline_free_ends(points, x),
        parameters=lambda x: casadi.SX(case.payload),
        objectives=(*objectives, Objective("cost", "-", 1.0, eq="(112), (153)", terms=terms)),
        default_objective="cost",
        reference_point={"time": 8.0, "energy": 6000.0, "jerk": 100.0, "acceleration": 5.0},
        best_values=BEST if case == Guo2016() else {},
        requirements=Requirements(JOINTS, UNITS, limits, ends, ("payload",), continuity=2),
        guess=guess,
        dilate=lambda x, s: np.asarray(x) * s,
        about=About(
            "5-DOF hybrid robot, cubic splines, payload", "Guo et al. (2016), doi:10.1155/2016/1302537",
            "cubic spline, 12 segments, free end knots",
        ),
    )  # fmt: skip
    return standard.free_payload(problem, case.max_payload, 10.0, "(123)") if case.free_payload else problem


# What the paper reports.
TABLE_7 = pd.Series((0.330, 0.837, 0.803, 0.569, 0.477, 0.382, 0.348, 0.348, 0.392, 0.552, 0.732, 0.420), name="h [s]")
TABLE_9 = {  # by objective, in its unit: Fc, z1 .. z4
    "NSGA-II, best": {"cost": 3.093, "time": 6.189, "energy": 3921.602, "jerk": 1.068, "acceleration": 0.194},
    "fmincon, mean of 100": {"cost": 3.220, "time": 7.146, "energy": 3250.239, "jerk": 2.510, "acceleration": 0.252},
}
LARGEST_PAYLOAD = 12.65  # [kg], sect. 6
