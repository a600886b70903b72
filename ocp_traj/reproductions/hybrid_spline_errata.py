"""What must read otherwise in Guo et al. (2016): misprinted numbers, and equations, with the numbers that show it."""

from __future__ import annotations

from math import sqrt

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.problems import hybrid_robot
from ocp_traj.problems import hybrid_spline as paper
from ocp_traj.proof.values import limit_on
from ocp_traj.reproductions import hybrid_spline_tables as tables
from ocp_traj.reproductions.comparison import Erratum
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.solvers.payload import static_bound
from ocp_traj.transcription.symbolic import evaluate_objectives

_CUT = "inverse kinematics: cut off, not rounded"
_DIGIT = "inverse kinematics, and the z of Table 8 needs it, too"
_KNOT = "Table 7 gives it, and x, y in the same row need it"
# (table, item): what it should read, and why. A comparison confirms each.
MISPRINTS = {
    ("Table 6", "row 3 X_S3"): ("325.13", _CUT),
    ("Table 6", "row 6 X_S3"): ("226.38", _DIGIT),
    ("Table 6", "row 12 z"): ("951.221", "the decimal point is two places too far left"),
    ("Table 8", "row 2 X_S1"): ("263.47", _KNOT),
    ("Table 8", "row 3 X_S3"): ("325.13", _CUT),
    ("Table 8", "row 5 t"): ("2.539", "t4 + h4 of Table 7"),
    ("Table 8", "row 6 X_S3"): ("226.38", _DIGIT),
    ("Table 8", "row 12 X_S2"): ("657.51", _KNOT),
    ("Table 8", "row 12 phi_5"): ("0.1997", "Table 7 gives it; the printed one is row 13's to four decimals"),
}


def equation_errata(physical: Problem, literal: Problem) -> tuple[Erratum, ...]:
    """Errors in equations, units and data, each with what shows it on the paper's own example.

    Args:
        physical: the problem with a payload that is a weight.
        literal: the problem with a payload that pulls along the tool.
    """
    motion = trajectory_of(physical, paper.TABLE_7)
    printed = paper.TABLE_9[next(iter(paper.TABLE_9))]
    (forces, energy), (light, heavy) = energies(literal), energies(physical)
    off = tangent_angles()
    jerk = evaluate_objectives(physical, paper.TABLE_7)["jerk"]
    mass, _, centre = hybrid_robot.TABLE_4[0]
    upright, tilted = static_bound(physical).payload, static_bound(literal).payload
    return (
        Erratum(
            "Table 1, m_pu", f"{tables.PAYLOAD_RANGE[1]} kg", "more than the largest payload reported",
            f"(123) with it rules out the {paper.LARGEST_PAYLOAD} kg of sect. 6",
        ),
        Erratum(
            "Table 2, JC of joints 1-3", "100000 m/s3", "100000 mm/s3",
            f"along Table 7 no screw exceeds {np.abs(motion.curve.hull(3)).max(axis=(0, 1))[:3].max():.2g} m/s3, "
            "and the columns beside it count in mm",
        ),
        Erratum(
            "Table 5", "inertia about the centre of mass", "inertia about the origin of the frame",
            "(102) integrates over positions in the frame; J33 of no. 2, for one, lacks m z2 = "
            f"{mass * centre[2] ** 2:.0f} kg mm2. With Table 4's taken so, Table 9's energy agrees",
        ),
        Erratum(
            "(30), A1 and B1", "A1", "A1/L3",
            f"(32) has sin(alpha) = A1/L3; without it phi_4 of a via point is up to {yaw_error():.3f} rad off with "
            "lengths in m, and with lengths in mm the root is of a negative number",
        ),
        Erratum(
            "(60)", "3R2 (2w2 x 3z2)", "(3R2 2w2) x 3z2",
            "a vector in frame 2 meets one in frame 3; both point along the vertical and the true product is 0, the "
            f"printed one up to {vertical_product(motion):.2g} rad/s2 along Table 7",
        ),
        Erratum("(67)", "4R3 (3w3 x 4z3)", "(4R3 3w3) x 4z3", "as (60), one link further"),
        Erratum(
            "(73), 5f5 of a payload", "an external force, without its direction", "the weight, turned from frame 0",
            "(73) is right for a force in frame 5. That the weight was taken along the tool's axis is inferred: so, z2 "
            f"at Table 7 is {energy:.0f}, with it upright {heavy:.0f}, {printed['energy']:.0f} is reported; and F3 "
            f"seems to carry {tilted:.4f} kg at rest, with it upright {upright:.4f} kg, {paper.LARGEST_PAYLOAD} kg "
            "are reported",
        ),
        Erratum(
            "sect. 6, orientation of the tool", "o along the tangent, a along the normal", "a alone",
            "five joints leave nothing to choose beside a: (18) and (22) have o_z = 1 - a_z >= 0, and z falls along "
            f"the curve. With a normal to it, from which Table 6 follows, (20)-(22) put o {off[0].min():.0f} to "
            f"{off[0].max():.0f} deg off the tangent; n is {off[1].min():.0f} to {off[1].max():.0f} deg off it",
        ),
        Erratum(
            "(95)", "rho of a prismatic joint with its 1 in row 3", "for d1, the 1 in row 1",
            "A1 of (89) translates along x, so that its derivative has its only entry there",
        ),
        Erratum("(96)", "Q_j", "rho_j", "the matrix of (94); there is no Q_j"),
        Erratum("(108), D_ijk", "Gamma_pj", "Gamma_pjk", "as printed, D_ijk is D_ij"),
        Erratum(
            "(114), (154), z2", "the sum over joints of (|U||v|)^2", "the square of the sum over joints of |U||v|",
            f"inferred, together with (73): at Table 7 {forces:.0f} as printed, {energy:.0f} so, "
            f"{printed['energy']:.0f} reported; with the weight upright {light:.0f} and {heavy:.0f}",
        ),
        Erratum("before (145)", "(26)", "(119)", "the bound on velocity; (26) is a component of the tool's normal"),
        Erratum(
            "(154), z3", "a mean of two intervals' jerks, weighted with the first's h", "sum of h_i J_i^2",
            f"at Table 7 {jerk_as_printed(motion):.3f} as printed, {jerk:.3f} so, {printed['jerk']} reported",
        ),
        Erratum(
            "sect. 6, largest payload", f"{paper.LARGEST_PAYLOAD} kg", f"at most {upright:.4f} kg",
            "at rest at both ends a mass that large breaks the limit of F3 whatever the time law; see (73)",
        ),
    )  # fmt: skip


def yaw_error() -> float:
    """Error [rad] of (30) as printed at the worst via point, with lengths in m."""
    q = paper.via_points(paper.Guo2016())
    alpha = np.arctan((q[:, 1] - q[:, 0]) / hybrid_robot.L1)
    a1 = hybrid_robot.L3 * np.sin(alpha)
    return float(np.abs(np.arctan2(a1, np.sqrt(1.0 - a1**2)) - alpha).max())


def vertical_product(motion: Trajectory) -> float:
    """Largest |2w2 x 3z2| |dphi_4/dt| [rad/s2], components of the two frames multiplied as printed in (60)."""
    t = np.arange(0.0, motion.duration, 1e-3)
    q, v = motion.curve(t), motion.curve(t, 1)
    yaw = hybrid_robot.L1 * (v[:, 1] - v[:, 0]) / (hybrid_robot.L1**2 + (q[:, 1] - q[:, 0]) ** 2)  # (43)
    product = np.cross(np.stack([0.0 * yaw, 0.0 * yaw, yaw], axis=1), [0.0, sqrt(0.5), sqrt(0.5)])  # (65)
    return float((np.linalg.norm(product, axis=1) * np.abs(v[:, 3])).max())


def energies(problem: Problem) -> tuple[float, float]:
    """z2 at Table 7 with a problem's payload: |U||v| summed over joints after squaring, and before."""
    motion = trajectory_of(problem, paper.TABLE_7)
    limit = next(c for c in problem.requirements.path_constraints if c.id == "effort-limit")
    after = before = 0.0
    for k, h in enumerate(paper.TABLE_7):
        force = limit_on(motion, problem.requirements, limit, k, [0.0, 1.0])
        power = np.abs(force * motion.curve.at(k, np.array([0.0, 1.0]), 1).T)
        after += h / 2.0 * float((power**2).sum())
        before += h / 2.0 * float((power.sum(axis=0) ** 2).sum())
    return after, before


def tangent_angles() -> Array:
    """Angles [deg] between the tangent of (156) and the tool's o by (20)-(22), and its n by (24)-(26) ``(2, 11)``."""
    q, eta = paper.via_points(paper.Guo2016()), np.arange(11.0)
    x, y = 600.0 + 40.0 * eta, -150.0 + 30.0 * eta
    tangent = np.stack([40.0 + 0.0 * eta, 30.0 + 0.0 * eta, 0.15 * (y - 100.0) - x / 80.0], axis=1)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    turn, tilt = np.arctan((q[:, 1] - q[:, 0]) / hybrid_robot.L1) + q[:, 3], q[:, 4]
    c, s, root = np.cos(turn), np.sin(turn), np.sin(tilt) / sqrt(2.0)
    up, down = (1.0 + np.cos(tilt)) / 2.0, (1.0 - np.cos(tilt)) / 2.0
    o = np.stack([s * root - c * up, -c * root - s * up, down], axis=1)
    n = np.stack([-s * np.cos(tilt) - c * root, c * np.cos(tilt) - s * root, -root], axis=1)
    return np.asarray(np.degrees(np.arccos(np.stack([(o * tangent).sum(axis=1), (n * tangent).sum(axis=1)]))))


def jerk_as_printed(motion: Trajectory) -> float:
    """z3 of (154) as printed."""
    h = np.array(paper.TABLE_7)
    squares = np.array([(motion.curve.at(k, 0.5, 3) ** 2).sum() for k in range(len(h))])
    return float((h[:-1] / 2.0 * (squares[:-1] + squares[1:])).sum())
