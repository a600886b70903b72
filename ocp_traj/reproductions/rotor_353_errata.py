"""What must read otherwise in Zhu and Wang, with the numbers that show it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.problems import m10id
from ocp_traj.problems import rotor_353 as paper
from ocp_traj.reproductions.comparison import Erratum

# (table, item): what it should read, and why. A comparison confirms each.
MISPRINTS = {
    ("Table 1", "row 4 a"): ("195", "the maker's description; the printed one repeats d_4"),
    ("Table 2", "joint 3 X2"): ("-63.179", "with it, and only with it, the move from X2 to X3 is a pure translation"),
}

# As printed: Table 1 [mm], rows i of a_{i-1} and d_i; Table 2 [deg], printed rad, X_0 .. X_3 a joint.
TABLE_1_PRINTED = (("0", "450"), ("75", "0"), ("840", "0"), ("1100", "1100"), ("0", "0"), ("0", "75"))
TABLE_2_PRINTED = """
-23.496 -20.128  -7.361  -8.055
 73.451  80.381  68.721  61.474
-62.949 -55.208  63.179 -68.520
 77.747  78.321 -35.605 -29.593
 41.879  35.783  27.940  32.293
 -2.099 -12.636  53.129  46.917
"""


def turn(one: ArrayLike, two: ArrayLike) -> tuple[float, Array]:
    """Angle [deg] and axis ``(3,)`` of the turn from one rotation to another; its vector is their product."""
    vector = np.asarray(pin.log3(np.asarray(two) @ np.asarray(one).T))
    angle = float(np.linalg.norm(vector))
    return float(np.degrees(angle)), vector / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])


def equation_errata(excess: float) -> tuple[Erratum, ...]:
    """Errors in equations, units and data, each with what shows it on the paper's own example.

    Args:
        excess: by how much the paper's recipe breaks an acceleration limit with the printed sign, relative.
    """
    first, plane, turned_round = inverse_as_printed()
    vector = "0 0 0 0 0 0 0 x3 0 0 x0 0 0 x2 x1".split()
    weights = [0.5 * np.cos(share) ** 2 for share in (0.0, 0.6)]
    repaired = [0.4 + 0.5 * np.cos(np.pi * share / 2.0) ** 2 for share in (0.0, 0.6)]
    largest = np.abs(np.array([line.split() for line in TABLE_2_PRINTED.strip().splitlines()], float)).max()
    case = paper.ZhuWang()
    wrong_turn = turn(*paper.forward_kinematics(m10id.table_1_to_pendant(paper.via_points(case)))[0][2:])[0]
    return (
        Erratum(
            "Table 2, caption", "rad", "deg",
            f"its largest entry, {largest:g}, would be {largest / (2.0 * np.pi):.1f} turns of joint 2, not 235 deg",
        ),
        Erratum(
            "Table 2, joints 2 to 6", "the angles theta of Table 1", "the teach pendant's angles",
            "theta = (J1, J2 - 90, -(J2 + J3), -J4, -J5, -J6): joint 3 is measured from the horizontal. Read as theta, "
            f"the move from X2 to X3 turns the flange by {wrong_turn:.1f} deg and is no translation",
        ),
        Erratum(
            "(3), theta_1", "atan2(py, px)", "px, py of the wrist's centre, 75 mm behind the flange",
            "p of (2) is the flange's, with d6 of Table 1; that (3) means the same p is inferred, no other is defined. "
            f"With it joint 1 of Table 2 comes out up to {first:.2f} deg off",
        ),
        Erratum(
            "(3), k1 and k2, or Table 1", "a3 c23 + d4 s23 and a3 s23 - d4 c23, with alpha_1 = alpha_3 = -90 deg",
            "a3 c23 - d4 s23 and a3 s23 + d4 c23, or theta_2 and theta_3 counted the other way",
            f"together they put the wrist of Table 2's points up to {plane:.0f} mm off; with both angles reversed (3) "
            f"is met to {turned_round:.1g} mm. It and Table 1 differ in the sense of these joints; which is meant is "
            "not said. That k1 and k2 are the wrist's distance and height from axis 2 is inferred: the text has "
            "neither, nor k3 nor h2",
        ),
        Erratum(
            "(6)", f"{len(vector)} entries", "14 entries: six zeros, not seven, before x3",
            "there are 14 coefficients; at the two inner points position, velocity and acceleration are continuous, "
            "six conditions",
        ),
        Erratum(
            "(10), first line", "(w_max - w_min) cos2(t / T_max)",
            "something that starts at w_max; ours: w_min + (w_max - w_min) cos2(pi t / (2 T_max))",
            f"as printed w falls from {weights[0]:.2f} to {weights[1]:.2f} at 0.6 T_max: never near w_max = 0.9, and "
            f"below w_min = 0.4 at the end; ours, from {repaired[0]:.2f} to {repaired[1]:.2f}. The w_min added is "
            "inferred, and so is the pi, which (11) and (12) have; the second line, 0.2 to 0.3, is below w_min as well",
        ),
        Erratum(
            "sect. 4, synchronisation", "the longest time of each phase keeps the constraints", "it need not",
            "longer phases slow a joint down only together: a longer t1 alone changes the ratios; with our a_max and "
            f"the printed sign joint 3, which keeps its limits alone, exceeds its acceleration by {excess:.1%}",
        ),
        Erratum(
            "sect. 4", "no limits", "v_max and a_max of (14) and (15)",
            "neither is given; results cannot be checked without them",
        ),
    )  # fmt: skip


def inverse_as_printed() -> tuple[float, float, float]:
    """What (3) misses at Table 2's four points, at worst.

    Returns:
        theta_1 [deg], and the wrist in the arm's plane [mm]: as Table 1 counts theta_2 and theta_3, and both reversed.
    """
    q = paper.via_points(paper.ZhuWang())
    theta, arm = m10id.pendant_to_table_1(q), m10id.arm()
    rotation, position = paper.forward_kinematics(q)
    angle = np.degrees(np.arctan2(position[:, 1], position[:, 0]) - theta[:, 0])
    wrist = position - arm.d6 * rotation[:, :, 2]
    along, up = np.hypot(wrist[:, 0], wrist[:, 1]) - arm.a1, wrist[:, 2] - arm.d1

    def missed(two: Array, three: Array, height: Array) -> float:
        k1, k2 = along - arm.a2 * np.cos(two), height - arm.a2 * np.sin(two)
        c23, s23 = np.cos(two + three), np.sin(two + three)
        gaps = np.hypot(k1 - arm.a3 * c23 - arm.d4 * s23, k2 - arm.a3 * s23 + arm.d4 * c23)
        return float(1000.0 * gaps.max())

    return float(np.abs(angle).max()), missed(theta[:, 1], theta[:, 2], -up), missed(-theta[:, 1], -theta[:, 2], up)
