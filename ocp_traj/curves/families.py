"""The curves the papers build their trajectories from, each returned as a ``PiecewiseBezier``.

Every builder takes numbers or casadi SX alike, so that the curve a solver sees and the curve that is checked are one.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, perm
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import ProblemDefinitionError


def cubic_spline_free_ends(via_points: ArrayLike, intervals: Any) -> PiecewiseBezier:
    """C2 cubic spline through via points, at rest in velocity and acceleration at both ends.

    Two extra knots, the second and the last but one, have free positions, which is what lets a cubic spline meet four
    more end conditions: q_2 = q_1 + h_1^2 a_2 / 6 and q_{m-1} = q_m + h_{m-1}^2 a_{m-1} / 6. Guo et al. (2016),
    sect. 3.2 (and Lin, Chang and Luh, 1983, who introduced it). The knot accelerations a_2 .. a_{m-1} solve one
    tridiagonal system; its pivots stay positive for positive intervals, so elimination needs no exchange of rows.

    Args:
        via_points: ``(m - 2, dof)`` with m >= 5, joint units.
        intervals: h ``(m - 1,)`` [s], numbers or a casadi column.

    Returns:
        The spline, m - 1 cubic segments over m knots.
    """
    points = np.asarray(via_points, dtype=float)
    count = points.shape[0] + 1  # intervals
    symbolic = isinstance(intervals, casadi.SX)
    h = casadi.vertsplit(intervals) if symbolic else list(np.asarray(intervals, dtype=float))
    if points.shape[0] < 3 or len(h) != count:
        raise ProblemDefinitionError(
            f"a spline with free end knots needs at least 3 via points and one interval more; "
            f"got {points.shape[0]} and {len(h)}"
        )
    rows = [casadi.SX(p).T if symbolic else p for p in points]
    first, last, inner = rows[0], rows[-1], rows[1:-1]
    steps = np.diff(points, axis=0)
    # Steps between the knots whose positions are known; the free knots are substituted below.
    between: list[Any] = [0.0 * steps[0], *steps, 0.0 * steps[0]]

    # Row i couples accelerations at knots i, i+1, i+2 (counted from 0): the usual spline condition.
    lower = [h[i] for i in range(count - 1)]
    diagonal = [2.0 * (h[i] + h[i + 1]) for i in range(count - 1)]
    upper = [h[i + 1] for i in range(count - 1)]
    between = [casadi.SX(s).T if symbolic else s for s in between]
    right = [between[i + 1] * (6.0 / h[i + 1]) - between[i] * (6.0 / h[i]) for i in range(count - 1)]
    # The free knots' displacements h_1^2 a_2 / 6 and h_{m-1}^2 a_{m-1} / 6 move to the left-hand side.
    diagonal[0] += h[0] + h[0] ** 2 / h[1]
    lower[1] -= h[0] ** 2 / h[1]
    diagonal[-1] += h[-1] + h[-1] ** 2 / h[-2]
    upper[-2] -= h[-1] ** 2 / h[-2]

    for i in range(1, count - 1):
        factor = lower[i] / diagonal[i - 1]
        diagonal[i] = diagonal[i] - factor * upper[i - 1]
        right[i] = right[i] - factor * right[i - 1]
    acceleration = [right[-1] / diagonal[-1]]
    for i in range(count - 3, -1, -1):
        acceleration.insert(0, (right[i] - upper[i] * acceleration[0]) / diagonal[i])

    knots = [first, first + h[0] ** 2 / 6.0 * acceleration[0], *inner, last + h[-1] ** 2 / 6.0 * acceleration[-1], last]
    a = [0.0 * first, *acceleration, 0.0 * last]
    stack = casadi.vertcat if symbolic else lambda *r: np.stack(r)
    segments = []
    for i in range(count):
        left, end, square = knots[i], knots[i + 1], h[i] ** 2 / 18.0
        one = (2.0 * left + end) / 3.0 - square * (2.0 * a[i] + a[i + 1])
        two = (left + 2.0 * end) / 3.0 - square * (a[i] + 2.0 * a[i + 1])
        segments.append([left, one, two, end])
    # Rest holds exactly, not up to rounding, so that the end states are constants of the problem.
    segments[0][1:3] = [first, first]
    segments[-1][1:3] = [last, last]
    return PiecewiseBezier(intervals if symbolic else np.asarray(h), tuple(stack(*s) for s in segments))


def polynomial_353(via_points: ArrayLike, durations: Any) -> PiecewiseBezier:
    """Cubic, quintic, cubic through four points, at rest in velocity and acceleration at both ends, C2 between.

    Zhu and Wang, (4)-(7), in closed form: three conditions at each end make the cubics X_0 + d_1 u^3 and
    X_3 - d_3 (1 - u)^3, with d_k = X_k - X_{k-1}; the quintic is Hermite's between what they leave at their inner ends.
    The paper's 14 x 14 system has the determinant +-16 t_1^3 t_2^9 t_3^3, so there is no other curve.

    Args:
        via_points: X ``(4, dof)``, joint units.
        durations: t ``(3,)`` [s], numbers or a casadi column.

    Returns:
        Three segments of degrees 3, 5, 3.
    """
    points = np.asarray(via_points, dtype=float)
    symbolic = isinstance(durations, casadi.SX)
    t = casadi.vertsplit(durations) if symbolic else list(np.asarray(durations, dtype=float))
    if points.ndim != 2 or points.shape[0] != 4 or len(t) != 3:
        raise ProblemDefinitionError(
            f"a 3-5-3 curve goes through 4 points in 3 durations; got points of shape {points.shape} and {len(t)}"
        )
    x = [casadi.SX(p).T if symbolic else p for p in points]
    first, last = x[1] - x[0], x[3] - x[2]
    start, end = t[1] / t[0], t[1] / t[2]
    # Of the quintic: q' t_2 / 5 and q'' t_2^2 / 20 at its ends, from q' = 3 d / t and q'' = +-6 d / t^2.
    v1, a1 = 0.6 * start * first, 0.3 * start**2 * first
    v2, a2 = 0.6 * end * last, -0.3 * end**2 * last
    quintic = [x[1], x[1] + v1, x[1] + 2.0 * v1 + a1, x[2] - 2.0 * v2 + a2, x[2] - v2, x[2]]
    segments = ([x[0], x[0], x[0], x[1]], quintic, [x[2], x[3], x[3], x[3]])
    stack = casadi.vertcat if symbolic else lambda *rows: np.stack(rows)
    return PiecewiseBezier(durations if symbolic else np.asarray(t), tuple(stack(*s) for s in segments))


def quartic_quintic(start: ArrayLike, via: Any, via_velocity: Any, goal: Any, durations: Any) -> PiecewiseBezier:
    """A quartic to a via point, then a quintic to the goal, at rest at both ends.

    The quartic runs from (q0; rest) to (q1, v1); what acceleration it ends with, a1 = 6 v1 / T1 - 12 (q1 - q0) / T1^2,
    the quintic begins with, so that the curve is C2. El Haiek et al. (2019), (4)-(15).

    Args:
        start: q0 ``(dof,)``.
        via: q1 ``(dof,)``, numbers or a casadi column.
        via_velocity: v1 ``(dof,)``, likewise.
        goal: q2 ``(dof,)``.
        durations: T1, T2 ``(2,)`` [s].

    Returns:
        Two segments, of degrees 4 and 5; numeric where every argument is.
    """
    given = (start, via, via_velocity, goal, durations)
    symbolic = any(isinstance(argument, casadi.SX) for argument in given)

    def row(value: Any) -> Any:
        return casadi.SX(value).T if symbolic else np.asarray(value, dtype=float)

    q0, q1, v1, q2 = row(start), row(via), row(via_velocity), row(goal)
    times = casadi.SX(durations) if symbolic else np.asarray(durations, dtype=float)
    if times.shape[0] != 2 or len({part.shape for part in (q0, q1, v1, q2)}) != 1:
        raise ProblemDefinitionError(
            f"a quartic and a quintic need two durations and four vectors of one size; got {times.shape[0]} durations "
            f"and vectors of {', '.join(str(max(part.shape)) for part in (q0, q1, v1, q2))}"
        )
    first, second = times[0], times[1]
    a1 = 6.0 * v1 / first - 12.0 * (q1 - q0) / first**2
    leave = q1 + v1 * (second / 5.0)
    stack = casadi.vertcat if symbolic else lambda *rows: np.stack(rows)
    quartic = stack(q0, q0, q0, q1 - v1 * (first / 4.0), q1)
    quintic = stack(q1, leave, 2.0 * leave - q1 + a1 * (second**2 / 20.0), q2, q2, q2)
    return PiecewiseBezier(times, (quartic, quintic))


NONIC = 5  # states (q, v, a, jerk, snap) that two ends of a nonic share: 10 control points
HERMITE = (2, 3, 4, 5)  # derivatives an end, q counted, that segments may share: degrees 3, 5, 7, 9


def at_rest(q: ArrayLike) -> Array:
    """The state (q, 0, 0, 0, 0) of a position ``(dof,)``: ``(5, dof)``."""
    where = np.asarray(q, dtype=float)
    return np.concatenate([where[None], np.zeros((NONIC - 1, len(where)))])


def nonic(states: Sequence[Any], durations: Any) -> PiecewiseBezier:
    """Bezier segments of degree 9 through tags whose derivatives up to snap are given: C4 throughout.

    Ogbemhe et al. (2019), (5)-(18), where (16) and (18) are misprinted: ``hermite`` of (q, v, a, jerk, snap) at each of
    K + 1 tags, ``(5, dof)`` each.
    """
    sizes = sorted({state.shape[0] for state in states})
    if sizes != [NONIC]:
        raise ProblemDefinitionError(f"nonic segments need states of {NONIC} rows at all tags; got rows {sizes}")
    return hermite(states, durations)


def hermite(states: Sequence[Any], durations: Any) -> PiecewiseBezier:
    """Segments of degree 2r - 1 between knots whose states of r rows are given: C^(r-1) throughout.

    With D_k = q^(k) T^k (n - k)! / n! at either end of a segment of degree n, its control points are
    P_i = sum_k binomial(i, k) D_k, i < r, and likewise back from the other end with the signs of odd k turned; Farin
    (2002), sect. 5.3. A segment depends on its own two states and its duration alone.

    Args:
        states: (q, v, a, ..) at each of K + 1 knots, ``(r, dof)`` each with r from 2 to 5, numbers or casadi SX.
        durations: T ``(K,)`` [s].

    Returns:
        K segments; numeric where every argument is.
    """
    symbolic = any(isinstance(argument, casadi.SX) for argument in (*states, durations))
    times = casadi.SX(durations) if symbolic else np.asarray(durations, dtype=float)
    sizes = {int(state.shape[0]) for state in states}
    if times.shape[0] != len(states) - 1 or len(sizes) != 1 or not sizes <= set(HERMITE):
        raise ProblemDefinitionError(
            f"segments between {len(states)} knots need {len(states) - 1} durations and q with 1 to 4 derivatives at "
            f"each, as many at all; got {times.shape[0]} durations and states of {sorted(sizes)} rows"
        )
    (r,) = sizes
    # Row i of (1, i, i (i - 1) / 2, ..): binomials turn scaled derivatives into control points from an end.
    pascal = np.array([[comb(i, k) for k in range(r)] for i in range(r)], dtype=float)
    binomials = casadi.SX(casadi.sparsify(casadi.DM(pascal)))
    signs = np.ones(r), (-1.0) ** np.arange(r)
    falling = np.array([perm(2 * r - 1, k) for k in range(r)], dtype=float)
    segments = []
    for k in range(len(states) - 1):
        scale = [times[k] ** order / falling[order] for order in range(r)]
        ends = []
        for state, sign in zip((states[k], states[k + 1]), signs, strict=True):
            rows = [state[order, :] * (scale[order] * sign[order]) for order in range(r)]
            ends.append(casadi.mtimes(binomials, casadi.vertcat(*rows)) if symbolic else pascal @ np.stack(rows))
        first, last = ends
        segments.append(casadi.vertcat(first, last[::-1, :]) if symbolic else np.concatenate([first, last[::-1]]))
    return PiecewiseBezier(times, tuple(segments))
