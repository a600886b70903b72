"""What must read otherwise in Ogbemhe et al., with the numbers that show it."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.families import nonic
from ocp_traj.reproductions.comparison import Erratum
from ocp_traj.reproductions.weld_bezier_tables import GENERATIONS, POPULATION, TABLE_7

# (8), coefficients of t^9 .. t^0 beside each control point, as printed: (label, coefficients), in the printed order.
PRINTED_8: tuple[tuple[int, tuple[float, ...]], ...] = (
    (0, (-1, 9, -36, 84, -126)),
    (1, (0, 0, 0, 0, 0, 126, -84, 36, -9, 1)),
    (1, (9, -72, 252, -504, 630)),
    (4, (0, 0, 0, 0, 0, -504, 252, -72, 9)),
)
ROW_16 = np.array([-1.0, -4.0, 6.0, -4.0, 1.0])  # last row of D_0, as printed
ROWS_18 = np.array([[1, 0, 0, 0, 0], [-1, 1, 0, 0, 0], [1, -2, 1, 0, 0], [-1, 3, -3, 1, 0], ROW_16])  # D_1, as printed
MENDED_18 = np.array(  # on p9, p8, .., p5
    [[1, 0, 0, 0, 0], [1, -1, 0, 0, 0], [1, -2, 1, 0, 0], [1, -3, 3, -1, 0], [1, -4, 6, -4, 1]], dtype=float
)
SHARE = 0.3  # of the time, at which the sum of (6) is shown; any would do
AWAY = np.array([0.4, -0.7, 1.1, 0.9])  # [rad] Euler angles at which (26) is shown, and a time for b: any would do
FALLING = np.array([1.0, 9.0, 72.0, 504.0, 3024.0])


def sum_of_6(t: float, *, printed: bool) -> float:
    """Sum of the basis of (6): the exponent of (1 - t) is n - 1 for every i as printed, n - i as it must be."""
    return float(sum(comb(9, i) * t**i * (1.0 - t) ** (8 if printed else 9 - i) for i in range(10)))


def coefficients_of_8(label: int, *, printed: bool) -> Array:
    """Coefficients ``(10,)`` of t^9 .. t^0 that (8) has for P0 or P1, by its printed labels or by the right ones."""
    right = (0, 0, 1, 1)
    found = np.zeros(10)
    for (name, values), meant in zip(PRINTED_8, right, strict=True):
        if (name if printed else meant) == label:
            found[: len(values)] += np.array(values, dtype=float)
    return found


def end_residual(rows: ArrayLike, state: Array, duration: float, *, first: int, scaled: bool = True) -> float:
    """By how much D p = b is missed at the end of a segment that ends in a state ``(5, 1)`` [rad].

    Args:
        rows: D ``(5, 5)``.
        state: (q, v, a, jerk, snap) at the end.
        duration: T [s].
        first: whether D acts on p5, p6, .. (5) or on p9, p8, .. (9).
        scaled: whether b has the powers of T.
    """
    points = nonic([np.zeros((5, 1)), state], np.array([duration])).control_points[0][:, 0]
    chosen = points[5:] if first == 5 else points[:4:-1]
    b = state[:, 0] / FALLING * (duration ** np.arange(5) if scaled else 1.0)
    return float(np.abs(np.asarray(rows) @ chosen - b).max())


def zyz(angles: Array, *, printed: bool) -> Array:
    """The rotation of (26) ``(3, 3)`` for (phi, beta, psi) [rad], with its third row as printed or as it must be."""
    (s1, s2, s3), (c1, c2, c3) = np.sin(angles[:3]), np.cos(angles[:3])
    third = [-s1 * c3, s1 * s3, c2] if printed else [-s2 * c3, s2 * s3, c2]
    return np.array(
        [
            [c1 * c2 * c3 - s1 * s3, -c1 * c2 * s3 - s1 * c3, c1 * s2],
            [s1 * c2 * c3 + c1 * s3, -s1 * c2 * s3 + c1 * c3, s1 * s2],
            third,
        ]
    )


def skewness(rotation: Array) -> float:
    """How far a matrix is from a rotation, largest entry of |R R^T - 1|."""
    return float(np.abs(rotation @ rotation.T - np.eye(3)).max())


def equation_errata(signed: tuple[float, float]) -> tuple[Erratum, ...]:
    """Errors in equations and in what is said of tables, each with what shows it.

    Args:
        signed: least sum of the joints' torques along one path [N m], and along it twice as fast.
    """
    moga, hmoga = TABLE_7["MOGA"], TABLE_7["HMOGA"]
    at_most = POPULATION * GENERATIONS
    rates = [1e3 * line.seconds / line.evaluations for line in (moga, hmoga)]
    state = np.array([[0.3], [-0.2], [0.5], [0.1], [0.7]])
    rotation = [skewness(zyz(AWAY, printed=printed)) for printed in (True, False)]
    missed = [
        end_residual(ROWS_18, state, 1.0, first=5),
        end_residual(MENDED_18, state, 1.0, first=9),
        end_residual(MENDED_18, state, 5.0, first=9, scaled=False),
    ]
    first = coefficients_of_8(0, printed=True)
    return (
        Erratum(
            "(6)", "(1 - t)^(n - 1)", "(1 - t)^(n - i)",
            f"the basis must sum to 1; at t = {SHARE:g} it sums to {sum_of_6(SHARE, printed=True):.4g} as printed, to "
            f"{sum_of_6(SHARE, printed=False):.4g} mended",
        ),
        Erratum(
            "(8)", "second line with p1, fourth with p4", "p0, p1",
            f"as printed p0 has no constant term: at t = 0 the curve would start at {first[-1]:g} p0 + p1, not at p0",
        ),
        Erratum(
            "(16), D_0, last row", "-1 -4 6 -4 1", "1 -4 6 -4 1",
            f"a difference of equal points is 0; the printed row makes {ROW_16.sum():g} times the point of them",
        ),
        Erratum(
            "(18), D_1", "D_0 again, on p5 .. p9", "(1), (1 -1), (1 -2 1), (1 -3 3 -1), (1 -4 6 -4 1) on p9 .. p5",
            f"for a segment that ends in (q, v, a, j, s) = {state[:, 0].tolist()} the printed one misses by "
            f"{missed[0]:.3g}, the other by {missed[1]:.1g}",
        ),
        Erratum(
            "(16), (18), b", "q, v/n, a/(n(n-1)), ..", "q, v T/n, a T^2/(n(n-1)), ..",
            f"t runs from 0 to 1; for a segment of 5 s the same end is missed by {missed[2]:.3g}",
        ),
        Erratum(
            "(20), joint 2", "-x2 <= -140", "-x2 <= 140",
            "with x2 <= -5 the printed one leaves no angle at all: x2 >= 140",
        ),
        Erratum(
            "(21)-(25)", "x <= max", "-max <= x <= max",
            "one-sided limits allow any speed backwards; (1) has them with bars",
        ),
        Erratum(
            "(1), (19)", "torques with their signs, summed in (1)", "their squares, or sizes",
            f"signed torques have no least sum: {signed[0]:.4g} N m at worst along the air move, {signed[1]:.4g} along "
            "the same path twice as fast, lower without end as it gets faster; and those of opposite signs cancel",
        ),
        Erratum(
            "Table 2", "P0 .. P4 = P5 .. P9", "two different ends",
            "ten points that repeat five fix no motion from one tag to another; all decode as one end at the limits of "
            "Table 3, of a second, with two slips",
        ),
        Erratum(
            "Table 8", "joint displacement", "missing", "its 36 numbers and its unit are those of Table 9, velocity"
        ),
        Erratum(
            "Tables 5, 9-11", "maxima below zero for every joint of MOGA but one", "maxima of at least zero",
            "at rest the velocity is zero, and from rest to rest the means of acceleration, jerk and snap are: none of "
            "them stays below zero",
        ),
        Erratum(
            "Table 7", "HMOGA improves spread and distance", "MOGA has the better ones",
            f"its spread is {hmoga.spread:g} against {moga.spread:g}, its distance {hmoga.distance:g} against "
            f"{moga.distance:g}, where less is more even; and both say how evenly points lie, not how good they are",
        ),
        Erratum(
            "Table 7, iterations and function counts",
            f"{moga.iterations} and {hmoga.iterations}; {moga.evaluations} and {hmoga.evaluations}",
            f"at most {GENERATIONS} generations, {at_most} individuals before refinement",
            f"Table 4 has {GENERATIONS} generations of {POPULATION}: {moga.iterations} iterations are "
            f"{moga.iterations / GENERATIONS:.0f} times as many as it allows, {moga.evaluations / moga.iterations:.1f} "
            f"evaluations each; {hmoga.evaluations} evaluations are {hmoga.evaluations / at_most:.1f} times as many, "
            f"unless goal attainment took the rest; and HMOGA's take {rates[1]:.2g} ms each, MOGA's {rates[0]:.2g}",
        ),
        Erratum(
            "Table 4", "migration both ways, fraction 0.2, every 20 generations", "no migration",
            "there is one population, so nothing can migrate; a stall of 500 in 500 generations cannot end a run",
        ),
        Erratum(
            "Sect. III-A, appendix A", "ZYX, then ZYZ", "one of them", "they are different angles of one orientation"
        ),
        Erratum(
            "(26), third row", "-sin phi cos psi, sin phi sin psi, cos beta",
            "-sin beta cos psi, sin beta sin psi, cos beta",
            f"at phi, beta, psi = {AWAY[0]:g}, {AWAY[1]:g}, {AWAY[2]:g} rad the printed matrix is off a rotation by "
            f"{rotation[0]:.3g}, the other by {rotation[1]:.1g}",
        ),
        Erratum(
            "Sect. III-C", "the first three joint axes intersect", "the last three",
            "A1 and A2 of this arm are 0.35 m apart; the wrist's axes meet, and that point is the reference",
        ),
        Erratum(
            "Tables 5, 6, 8-11", "R-square", "no measure of what it is of",
            "the fit is not named; limits used, error of the tip and jumps at tags are in its place here",
        ),
    )  # fmt: skip
