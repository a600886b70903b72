"""The printed numbers of Ogbemhe et al., and what they are: Table 2 decoded, the cells of Tables 5 to 11."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from ocp_traj.arrays import Array
from ocp_traj.curves.families import nonic
from ocp_traj.problems import kr90
from ocp_traj.problems.weld_bezier import PRINTED_EFFORT
from ocp_traj.reproductions.comparison import Sheet, half_unit

# Table 2, a line a joint: P0 .. P4 [deg]; P5 .. P9 are the same numbers.
TABLE_2 = """
-1102.40 -735.49 -367.90 0.5530 370
-504.68 -336.96 -168.69 0.2450 170
-831.06 -554.97 -277.85 0.4138 280
-2082200 -1389.90 -695.54 1.0302 700
-794.03 -531.28 -266.60 0.3724 270
-2077.20 -1387.20 -694.56 1.0316 700
"""
DIGITS = 5  # of Table 2's numbers, whatever zeros follow
MISPLACED = ("-2082.2", "the power of ten of a display in thousands was taken for digits")
LIMITS = {
    "velocity": kr90.VELOCITY,
    "acceleration": kr90.ACCELERATION,
    "jerk": kr90.JERK,
    "snap": kr90.SNAP,
    "torque": (PRINTED_EFFORT,) * 6,
}
# Mean and maximum a joint of what MOGA and HMOGA found; Table 8, of displacements, repeats Table 9's velocities.
CELLS: dict[tuple[str, str, str], tuple[tuple[float, ...], tuple[float, ...]]] = {
    ("Table 9", "velocity", "MOGA"): (
        (-393.60, -216.50, -265.20, -217.40, -169.60, -80.69),
        (-382.00, -215.40, -262.10, -204.70, -150.10, 11.51),
    ),
    ("Table 9", "velocity", "HMOGA"): (
        (-786.30, -1.1e4, -1.4e4, -1.2e4, -5.6e4, -5.9e4),
        (4331.0, 5.5e4, 9695.0, 7.15e4, 258.0, 284.0),
    ),
    ("Table 10", "acceleration", "MOGA"): (
        (-91.61, -162.20, -29.29, -23.17, -185.40, -177.90),
        (-90.04, -161.10, -24.36, -13.28, -115.10, -163.00),
    ),
    ("Table 10", "acceleration", "HMOGA"): (
        (-3.76e5, -2.87e5, -2.87e5, -2.86e5, -1.94e5, -13.26),
        (1.41e7, 4.23e4, 4.2e4, 4.27e4, 178.0, 107.10),
    ),
    ("Table 11", "jerk", "MOGA"): (
        (-67.64, -32.38, -52.44, -120.9, -32.75, -5.268),
        (-50.25, -27.59, -31.91, -117.4, -10.91, -4.322),
    ),
    ("Table 11", "jerk", "HMOGA"): (
        (-53.32, -71.53, -54.96, -131.6, -37.96, -12.96),
        (-45.19, -70.99, -37.91, -128.9, -36.89, -11.04),
    ),
    ("Table 5", "snap", "MOGA"): (
        (-86.31, -166.1, -61.66, -26.55, -12.19, -50.17),
        (-69.44, -103.4, -37.86, -24.46, -10.65, -33.90),
    ),
    ("Table 5", "snap", "HMOGA"): (
        (-56.30, -66.10, -78.13, -47.67, -31.19, -32.91),
        (-33.10, -55.78, -77.56, -46.22, -21.7, -8.34),
    ),
    ("Table 6", "torque", "MOGA"): (
        (-3.19e6, -1.782e6, -2.069e6, 1.75e6, -4.16e4, -3.89e4),
        (1.28e8, 1.691e7, 1.929e7, 9.87e7, 2.23e6, 2.23e6),
    ),
    ("Table 6", "torque", "HMOGA"): (
        (-2.4e11, -1.99e11, -2.58e10, 1.6e9, -1.67e8, -1.3e8),
        (1.5e12, 1.8e9, 4.27e7, 2.3e12, 4.71e9, -3.13e6),
    ),
}


@dataclass(frozen=True)
class Table7:
    """A line of Table 7."""

    iterations: int
    trajectory_time: float  # [s]
    evaluations: int
    distance: float  # average, [-]
    spread: float  # average, [-]
    seconds: float  # of computation


TABLE_7 = {
    "MOGA": Table7(10741, 1.36, 78401, 0.0171, 0.037, 5567.0),
    "HMOGA": Table7(6000, 1.15, 1448471, 0.670, 0.167, 815.0),
}
POPULATION, GENERATIONS = 200, 500  # Table 4
ANGLES = (1.0, 10.0, 60.0)  # [deg], moved from rest to rest
TIME = TABLE_7["HMOGA"].trajectory_time  # [s]
ORDERS = ("velocity", "acceleration", "jerk", "snap")


def decoded(end: float, derivatives: Array) -> Array:
    """Points in the place of P4, P3, .., P0 of Table 2 ``(5,)`` [deg]: the end conditions with two slips.

    For a segment of one second the last points are q, q - V, q - 2V + A, .., with V = v/9, A = a/72, J = j/504,
    S = s/3024. The table's are what that recursion gives if its second point is divided by 648 = 9 x 72, and counts
    2.5 times instead of twice in the third.

    Args:
        end: q, taken from the table [deg].
        derivatives: (v, a, jerk, snap) at the end ``(4,)``: the limits of Table 3.
    """
    V, A, J, S = derivatives / np.array([9.0, 72.0, 504.0, 3024.0])
    last = end
    second = (end - V) / 648.0
    third = A + 2.5 * second - last
    fourth = -J + 3.0 * third - 3.0 * second + last
    fifth = S + 4.0 * fourth - 6.0 * third + 4.0 * second - last
    return np.array([last, second, third, fourth, fifth])


def end_points(end: float, derivatives: Array) -> Array:
    """The last five control points, first of them last ``(5,)`` [deg], of a second that ends so: without the slips."""
    state = np.concatenate([[end], derivatives])[:, None]
    return np.asarray(nonic([np.zeros((5, 1)), state], np.ones(1)).control_points[0][:4:-1, 0])


def table_2(sheet: Sheet) -> pd.DataFrame:
    """Every number of Table 2 beside the decoded one; and what they should be."""
    rows = []
    for joint, line in enumerate(TABLE_2.strip().splitlines()):
        printed = line.split()
        limits = np.array([LIMITS[order][joint] for order in ORDERS])
        end = float(printed[4])
        ours, right = decoded(end, limits)[::-1], end_points(end, limits)[::-1]
        for i, (text, value) in enumerate(zip(printed, ours, strict=True)):
            for place in (i, i + 5):
                sheet.add(
                    "Table 2", f"joint {joint + 1} P{place}", text, float(value), "deg",
                    tolerance=_last_digit(text), misprint=MISPLACED if text == "-2082200" else None,
                    note="the limits of Table 3 as end derivatives, T = 1 s, and two slips; the same at both ends",
                )  # fmt: skip
        rows.append((kr90.JOINTS[joint], end, *right))
    return pd.DataFrame(rows, columns=["joint", "end [deg]", *(f"P{i} [deg]" for i in range(5, 10))])


def _last_digit(text: str) -> float:
    """Half a unit of the last of ``DIGITS`` digits, or of the last printed one if that is coarser."""
    size = int(np.floor(np.log10(abs(float(text)))))
    return max(half_unit(text), 0.5 * 10.0 ** (size - DIGITS + 1))


def peaks() -> Array:
    """Peaks of |v|, |a|, |jerk|, |snap| of the move of one unit in one second from rest to rest ``(4,)``."""
    rest = np.zeros((5, 1))
    move = nonic([rest, rest + np.eye(5)[:, :1]], np.ones(1))
    return np.array([max(-e.lower, e.upper) for order in range(1, 5) for e in move.extrema(order)])


def shortest(angle: float, joint: int) -> tuple[float, str]:
    """Least duration [s] of a move of one joint by an angle [deg] from rest to rest, and the limit that asks for it."""
    limits = np.array([LIMITS[order][joint] for order in ORDERS])
    times = (peaks() * angle / limits) ** (1.0 / np.arange(1, 5))
    return float(times.max()), ORDERS[int(np.argmax(times))]


def durations(sheet: Sheet) -> pd.DataFrame:
    """The least durations Table 3 allows, and how far a joint gets in the paper's time."""
    rows = []
    for joint, name in enumerate(kr90.JOINTS):
        found = [shortest(angle, joint) for angle in ANGLES]
        limits = np.array([LIMITS[order][joint] for order in ORDERS])
        rows.append(
            (name, *(t for t, _ in found), found[0][1], float((limits * TIME ** np.arange(1, 5) / peaks()).min()))
        )
    note = "from rest to rest, as sect. VI has it; the weld itself would take no time"
    for angle in ANGLES:
        slowest = max(shortest(angle, joint)[0] for joint in range(6))
        sheet.add("Table 7", f"time of the slowest joint for {angle:g} deg", f"{TIME}", slowest, "s", note=note)
    columns = [f"{angle:g} deg takes [s]" for angle in ANGLES]
    return pd.DataFrame(rows, columns=["joint", *columns, "limit", f"in {TIME} s [deg]"])


def outside() -> pd.DataFrame:
    """Cells, one a joint, quantity and method, whose mean or maximum is beyond the limit."""
    rows = []
    for (table, quantity, method), (mean, most) in CELLS.items():
        beyond = np.maximum(np.abs(mean), np.abs(most)) > np.array(LIMITS[quantity])
        worst = float((np.maximum(np.abs(mean), np.abs(most)) / np.array(LIMITS[quantity])).max())
        rows.append((table, quantity, method, int(beyond.sum()), len(beyond), worst))
    return pd.DataFrame(rows, columns=["table", "quantity", "method", "outside", "of", "largest share of the limit"])
