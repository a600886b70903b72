"""What must read otherwise in El Haiek et al., with the numbers that show it."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.reproductions.comparison import Erratum


def quartic(curve: PiecewiseBezier, *, printed: bool) -> Array:
    """Position at the via point ``(3,)`` by (5)-(9), with (8) as printed or as it must read."""
    T = float(curve.durations[0])
    q0, v0, a0 = (curve.at(0, 0.0, order)[0] for order in range(3))
    q1, v1 = (curve.at(0, 1.0, order)[0] for order in range(2))
    if printed:
        a3 = (4.0 * q1 - v1 * T - 4.0 * q0 - 3.0 * a0 * T**2) / T**3
    else:
        a3 = (4.0 * q1 - v1 * T - 4.0 * q0 - 3.0 * v0 * T - a0 * T**2) / T**3
    a4 = (v1 * T - 3.0 * q1 + 3.0 * q0 + 2.0 * v0 * T + a0 * T**2 / 2.0) / T**4
    return np.asarray(q0 + v0 * T + a0 / 2.0 * T**2 + a3 * T**3 + a4 * T**4)


def quintic(curve: PiecewiseBezier, *, printed: bool) -> Array:
    """Position at the goal ``(3,)`` by (11)-(15), without b4 as printed, or with it."""
    T = float(curve.durations[1])
    q0, v0, a0 = (curve.at(1, 0.0, order)[0] for order in range(3))
    q1, v1, a1 = (curve.at(1, 1.0, order)[0] for order in range(3))
    step = q1 - q0
    b3 = (20.0 * step - (8.0 * v1 + 12.0 * v0) * T - (3.0 * a0 - a1) * T**2) / (2.0 * T**3)
    b4 = (-30.0 * step + (14.0 * v1 + 16.0 * v0) * T + (3.0 * a0 - 2.0 * a1) * T**2) / (2.0 * T**4)
    b5 = (12.0 * step - (6.0 * v1 + 6.0 * v0) * T - (a0 - a1) * T**2) / (2.0 * T**5)
    return np.asarray(q0 + v0 * T + a0 / 2.0 * T**2 + b3 * T**3 + (not printed) * b4 * T**4 + b5 * T**5)


def misses(curve: PiecewiseBezier, *, printed: bool) -> tuple[float, float]:
    """By how much the coefficients miss the via point and the goal [rad], the joint that is worst."""
    via = np.abs(quartic(curve, printed=printed) - curve.at(0, 1.0)[0]).max()
    goal = np.abs(quintic(curve, printed=printed) - curve.at(1, 1.0)[0]).max()
    return float(via), float(goal)


def later_start(curve: PiecewiseBezier, share: float = 0.5) -> PiecewiseBezier:
    """The curve from a share of its first segment on: it does not start at rest, so that every term of (8) counts."""
    first = curve.control_points[0]
    rest = [first]
    while len(rest[-1]) > 1:  # de Casteljau: the last points of each row are the right part's
        rest.append((1.0 - share) * rest[-1][:-1] + share * rest[-1][1:])
    right = np.array([row[-1] for row in reversed(rest)])
    durations = np.array([(1.0 - share) * curve.durations[0], curve.durations[1]])
    return PiecewiseBezier(durations, (right, curve.control_points[1]))


def equation_errata(curve: PiecewiseBezier, turned: float) -> tuple[Erratum, ...]:
    """Errors in equations and example.

    Args:
        curve: the optimum of the blocked case.
        turned: how far theta3 moves along it [rad].
    """
    raised = curve.at(1, 1.0)[0]
    link = np.array([np.cos(raised[0]) * np.sin(raised[1]), np.sin(raised[0]) * np.sin(raised[1]), np.cos(raised[1])])
    aside = float(np.linalg.norm(np.cross([0.5, 0.5, 0.0], link)))
    via, _ = misses(later_start(curve), printed=True)
    _, goal = misses(curve, printed=True)
    return (
        Erratum(
            "(8)", "4 q1 - v1 T - 4 q0 - 3 a0 T^2", "4 q1 - v1 T - 4 q0 - 3 v0 T - a0 T^2",
            "the term in v0 is lost, its factor put on a0; on the second half of our quartic, which does not start at "
            f"rest, the printed one misses the via point by {via:.3g} rad",
        ),
        Erratum(
            "below (14)", "no b4", "(-30 (q1 - q0) + (14 v1 + 16 v0) T + (3 a0 - 2 a1) T^2) / (2 T^4)",
            f"it is not given; without that term our quintic misses the goal by {goal:.3g} rad",
        ),
        Erratum(
            "(19)", "F = (b1 T + b2 Fq) / Fo", "F = b1 T + b2 Fq, subject to (20)",
            "Fo is zero where the link meets the obstacle: a division by zero. As a death penalty it says that such "
            "an individual is infinitely bad, and not by how much",
        ),
        Erratum(
            "(1)-(3), sect. 4", "theta3 among the variables", "theta3 does not move the tip",
            f"it is free to stay where it is, and does: at the optimum it turns by {turned:.1e} rad, while the words "
            "about Figs. 3 and 6 have it move",
        ),
        Erratum(
            "sect. 5, points", "obstacle at (0.5, 0.5), goal at (1, 1)", "an obstacle off the line from base to goal",
            "(1)-(3) have the base at (0, 0). In the (x, y) plane, where sect. 2 puts the study, the three are on one "
            "line: the link collides at the goal, whatever its motion, and a test of the tip alone never sees the "
            "obstacle. That all have z = 0 is inferred, for heights and d3 are not given: with the goal raised as in "
            f"the case solved here the obstacle's centre is {aside:.3g} off the link",
        ),
        Erratum(
            "sect. 4", "real codification, and mutation as the inversion of a bit", "a mutation of real numbers",
            "a gene that is a real number has no bit of its own to invert, and how it would be coded in bits is not "
            "said; here it is put anywhere within its bounds, our choice",
        ),
        Erratum(
            "sect. 5", "0.2 s, fitness 8.1", "limits on velocity and acceleration, the weights b1 and b2",
            "without limits a slower or faster copy of a motion has the same path and distance: the time is its bound, "
            "whatever that is; without weights the fitness says nothing",
        ),
    )  # fmt: skip
