"""Piecewise polynomial curves in Bernstein form, numeric and symbolic alike.

On segment k, of duration T_k and degree n_k, with local time u in [0, 1]:

    q(u) = sum_i C(n_k, i) u^i (1 - u)^(n_k - i) P_i

The control points of every derivative (the hodographs), exact extrema, hull bounds, splitting and degree elevation
are written here once; Farin, *Curves and Surfaces for CAGD* (2002), chapters 4 and 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import comb, factorial
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BPoly, PPoly

from ocp_traj.errors import InputError, ProblemDefinitionError

Array = NDArray[np.float64]
Points = Any  # a (n + 1, dof) matrix of control points: numpy.ndarray or casadi.SX


def basis(degree: int, u: Any) -> Any:
    """Bernstein basis B_i(u) = C(n, i) u^i (1 - u)^(n - i), one row an instant.

    Args:
        degree: n.
        u: local times ``(N,)``: numbers, or a casadi column vector.

    Returns:
        ``(N, n + 1)``, of the same kind as ``u``.
    """
    if isinstance(u, casadi.SX | casadi.MX):
        symbol: Any = u
        left = [(1.0 - symbol) ** i if i else symbol**0 for i in range(degree + 1)]
        right = [symbol**i if i else 1.0 for i in range(degree + 1)]
        return casadi.horzcat(*(comb(degree, i) * right[i] * left[degree - i] for i in range(degree + 1)))
    instants = np.atleast_1d(np.asarray(u, dtype=float))
    return np.stack(
        [comb(degree, i) * instants**i * (1.0 - instants) ** (degree - i) for i in range(degree + 1)], axis=1
    )


def derivative_basis(degree: int, u: Array, top: int) -> Array:
    """What takes control points to derivatives of order 0 .. ``top`` over a unit time at local times ``u (N,)``.

    Returns:
        ``(N, top + 1, n + 1)``.
    """
    right, left = (np.vander(values, degree + 1, increasing=True) for values in (u, 1.0 - u))
    found = np.zeros((len(u), top + 1, degree + 1))
    for order in range(min(top, degree) + 1):
        lower = degree - order
        found[:, order] = (right[:, : lower + 1] * left[:, lower::-1]) @ _differences(degree, order)
    return found


@lru_cache(maxsize=256)
def _differences(degree: int, order: int) -> Array:
    """``difference_matrix`` times the binomials of the derivative's own basis."""
    lower = degree - order
    binomials = np.array([float(comb(lower, i)) for i in range(lower + 1)])
    return np.asarray(binomials[:, None] * difference_matrix(degree, order))


def product(matrix: Any, points: Points) -> Any:
    """Matrix product of numbers or expressions; CasADi and NumPy do not share an operator for it."""
    if isinstance(matrix, np.ndarray) and isinstance(points, np.ndarray):
        return matrix @ points
    return casadi.mtimes(casadi.SX(matrix), casadi.SX(points))


@lru_cache(maxsize=256)
def difference_matrix(degree: int, order: int) -> Array:
    """Maps control points to those of the derivative over a unit time: n!/(n - m)! Delta^m, ``(n - m + 1, n + 1)``."""
    if order > degree:
        matrix = np.zeros((1, degree + 1))
    else:
        matrix = np.diff(np.eye(degree + 1), n=order, axis=0) * (factorial(degree) / factorial(degree - order))
    matrix.flags.writeable = False
    return matrix


def elevation_matrix(degree: int, to_degree: int) -> Array:
    """Maps control points of degree n to those of the same curve at a higher degree; Farin (2002), sect. 6.1."""
    matrix = np.eye(degree + 1)
    for n in range(degree, to_degree):
        step = np.zeros((n + 2, n + 1))
        for i in range(n + 2):
            if i > 0:
                step[i, i - 1] = i / (n + 1)
            if i <= n:
                step[i, i] = 1.0 - i / (n + 1)
        matrix = step @ matrix
    return matrix


def subdivision_matrix(degree: int, a: float, b: float) -> Array:
    """Maps control points to those of the sub-arc [a, b] (blossoming; Farin 2002, sect. 4.6), ``(n + 1, n + 1)``."""
    rows = []
    for i in range(degree + 1):
        # Row i is the blossom with i arguments b and n - i arguments a: de Casteljau on the identity.
        weights = np.eye(degree + 1)
        for argument in [b] * i + [a] * (degree - i):
            weights = (1.0 - argument) * weights[:-1] + argument * weights[1:]
        rows.append(weights[0])
    return np.array(rows)


def turning_times(points: Array) -> Array:
    """Local times in [0, 1] among which are all those where a scalar curve turns back, for many curves at once.

    The derivative's roots are eigenvalues of a companion matrix. Written in 1/(u - c), with c where the derivative is
    far from zero, its leading coefficient is never small, whatever the true degree. Real parts are clipped to [0, 1]:
    an instant too many changes no sum of |differences|, a missing one would.

    Args:
        points: control points ``(n + 1, N)``.

    Returns:
        ``(max(n - 1, 0), N)``, ascending; NaN for a curve that is not finite.
    """
    slopes = np.diff(np.asarray(points, dtype=float), axis=0)
    degree, count = len(slopes) - 1, slopes.shape[1]
    if degree < 1:
        return np.zeros((0, count))
    finite = np.isfinite(slopes).all(axis=0)
    slopes = np.where(finite, slopes, 0.0)
    size = np.abs(slopes).max(axis=0)
    slopes = np.where(size > 0.0, slopes / np.where(size > 0.0, size, 1.0), 1.0)  # a constant never turns
    centres, taylor = _taylor(degree)
    coefficients = taylor @ slopes  # (centres, orders, N)
    share = np.abs(coefficients[:, 0]) / np.abs(coefficients).sum(axis=1)
    best = np.argmax(share, axis=0)
    chosen = coefficients[best, :, np.arange(count)]  # (N, orders)
    companion = np.zeros((count, degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, 0] = -chosen[:, 1:] / chosen[:, :1]
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = centres[best][:, None] + (1.0 / np.linalg.eigvals(companion)).real
    inside = np.sort(np.clip(np.nan_to_num(roots, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0), axis=1).T
    return np.where(finite, inside, np.nan)


@lru_cache(maxsize=64)
def _taylor(degree: int) -> tuple[Array, Array]:
    """Centres ``(n + 1,)``, and what maps control points to Taylor coefficients there ``(n + 1, n + 1, n + 1)``.

    One more centre than a polynomial has roots: at one of them it is not small.
    """
    centres, orders = np.linspace(-0.75, 1.75, degree + 1), range(degree + 1)
    rows = [[basis(degree - k, c)[0] @ difference_matrix(degree, k) / factorial(k) for k in orders] for c in centres]
    return centres, np.array(rows)


def turning_values(points: Array) -> tuple[Array, Array]:
    """Local times, ascending, and values at the ends and turning points of scalar curves ``(n + 1, N)``.

    Largest and smallest value of each curve are among them; both ``(max(n + 1, 2), N)``.
    """
    times = turning_times(points)
    times = np.concatenate([np.zeros((1, times.shape[1])), times, np.ones((1, times.shape[1]))])
    weights = basis(len(points) - 1, times.ravel()).reshape(*times.shape, len(points))
    return times, np.einsum("kni,in->kn", weights, points)


def total_variation(points: Array) -> Array:
    """int_0^1 |de/du| du of many scalar curves, exact: ``(N,)`` from control points ``(n + 1, N)``."""
    return np.asarray(np.abs(np.diff(turning_values(points)[1], axis=0)).sum(axis=0))


@dataclass(frozen=True)
class Extremum:
    """Largest and smallest value of one joint's curve over all segments, each with its instant."""

    lower: float
    lower_time: float
    upper: float
    upper_time: float


@dataclass(frozen=True, eq=False)
class PiecewiseBezier:
    """A curve of K Bezier segments through joint space.

    Attributes:
        durations: T_k > 0 [s], ``(K,)``: numbers, or a casadi column.
        control_points: per segment ``(n_k + 1, dof)``, joint units; all numeric or any of them symbolic.
    """

    durations: Any
    control_points: tuple[Points, ...]

    def __post_init__(self) -> None:
        """Checks shapes, and, where numeric, that durations are positive and all numbers finite."""
        if isinstance(self.durations, list | tuple):
            symbolic = any(isinstance(d, casadi.SX | casadi.MX) for d in self.durations)
            object.__setattr__(
                self,
                "durations",
                casadi.vertcat(*self.durations) if symbolic else np.array(self.durations, dtype=float),
            )
        object.__setattr__(self, "control_points", tuple(self.control_points))
        if not self.control_points or self.durations.shape[0] != len(self.control_points):
            raise ProblemDefinitionError(
                f"a curve needs one duration per segment: {self.durations.shape[0]} durations, "
                f"{len(self.control_points)} segments"
            )
        widths = {points.shape[1] for points in self.control_points}
        if len(widths) != 1:
            raise ProblemDefinitionError(f"every segment needs the same number of joints; got {sorted(widths)}")
        if isinstance(self.durations, np.ndarray) and not (np.isfinite(self.durations) & (self.durations > 0)).all():
            raise ProblemDefinitionError(f"durations must be positive and finite; got {self.durations.tolist()}")
        for k, points in enumerate(self.control_points):
            if isinstance(points, np.ndarray) and not np.isfinite(points).all():
                raise ProblemDefinitionError(f"control points of segment {k} are not all finite")

    @property
    def segments(self) -> int:
        """Number of segments K."""
        return len(self.control_points)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.control_points[0].shape[1])

    @property
    def degrees(self) -> tuple[int, ...]:
        """Polynomial degree of each segment."""
        return tuple(points.shape[0] - 1 for points in self.control_points)

    @property
    def duration(self) -> Any:
        """Total time [s]: a number, or an expression."""
        return self.durations.sum() if isinstance(self.durations, np.ndarray) else casadi.sum1(self.durations)

    @cached_property
    def knots(self) -> Array:
        """Times of the K + 1 knots [s]; numeric curves only."""
        return np.concatenate([[0.0], np.cumsum(self.durations)])

    def derivative(self, order: int = 1) -> PiecewiseBezier:
        """The curve of the order-th time derivative; P'_i = n (P_{i+1} - P_i) / T, Farin (2002), eq. 5.3."""
        return PiecewiseBezier(self.durations, tuple(self.hodograph(k, order) for k in range(self.segments)))

    def hodograph(self, segment: int, order: int) -> Points:
        """Control points of the order-th time derivative on one segment, ``(max(n - order, 0) + 1, dof)``."""
        points = self.control_points[segment]
        if order == 0:
            return points
        return product(difference_matrix(points.shape[0] - 1, order), points) / self.durations[segment] ** order

    def at(self, segment: int, u: Any, order: int = 0) -> Any:
        """Values of the order-th derivative on one segment at local times ``u (N,)``: ``(N, dof)``."""
        points = self.hodograph(segment, order)
        return product(basis(points.shape[0] - 1, u), points)

    def locate(self, t: ArrayLike) -> tuple[NDArray[np.intp], Array]:
        """Segment and local time u of each time ``t (N,)`` [s]; a knot belongs to the segment it starts."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        slack = (
            1e-9 * self.knots[-1]
        )  # our choice: what rounding of a sum of durations can do, and far below any duration
        if times.size and not ((times >= -slack) & (times <= self.knots[-1] + slack)).all():
            raise InputError(
                f"times must lie in [0, {self.knots[-1]:.9g}] s; got {times.min():.9g} to {times.max():.9g}"
            )
        segment = np.clip(np.searchsorted(self.knots, times, side="right") - 1, 0, self.segments - 1)
        return segment, np.clip((times - self.knots[segment]) / self.durations[segment], 0.0, 1.0)

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Values of the order-th derivative at times ``t (N,)`` [s]: ``(N, dof)``; numeric curves only."""
        segment, u = self.locate(t)
        values = np.empty((len(u), self.dof))
        for k in np.unique(segment):
            values[segment == k] = self.at(int(k), u[segment == k], order)
        return values

    def restrict(self, segment: int, a: float, b: float) -> Points:
        """Control points of the sub-arc u in [a, b] of one segment."""
        points = self.control_points[segment]
        return product(subdivision_matrix(points.shape[0] - 1, a, b), points)

    def split(self, segment: int, u: float) -> PiecewiseBezier:
        """The same curve with one segment cut in two at local time ``0 < u < 1``."""
        if not 0.0 < u < 1.0:
            raise InputError(f"a segment is split inside it, 0 < u < 1; got {u}")
        halves = (self.restrict(segment, 0.0, u), self.restrict(segment, u, 1.0))
        times = [self.durations[k] for k in range(self.segments)]
        times[segment : segment + 1] = [u * times[segment], (1.0 - u) * times[segment]]
        return PiecewiseBezier(times, (*self.control_points[:segment], *halves, *self.control_points[segment + 1 :]))

    def elevate(self, degree: int) -> PiecewiseBezier:
        """The same curve with every segment written at ``degree``, which is at least the largest of ``degrees``."""
        if degree < max(self.degrees):
            raise InputError(f"degree elevation goes up: {degree} is below {max(self.degrees)}")
        raised = (
            product(elevation_matrix(n, degree), p) for n, p in zip(self.degrees, self.control_points, strict=True)
        )
        return PiecewiseBezier(self.durations, tuple(raised))

    def dilate(self, factor: float) -> PiecewiseBezier:
        """The same path, ``factor`` times slower: the m-th derivative falls as factor^-m."""
        return PiecewiseBezier(self.durations * factor, self.control_points)

    def hull(self, order: int = 0) -> tuple[Array, Array]:
        """Bounds of the order-th derivative by its control points: lower and upper, ``(K, dof)`` each."""
        hodographs = [self.hodograph(k, order) for k in range(self.segments)]
        return np.array([p.min(axis=0) for p in hodographs]), np.array([p.max(axis=0) for p in hodographs])

    def extrema(self, order: int = 0) -> tuple[Extremum, ...]:
        """Exact extrema of the order-th derivative, one per joint: segment ends and roots of the next derivative."""
        candidates = []  # (times (M, dof), values (M, dof))
        for k in range(self.segments):
            u, values = turning_values(self.hodograph(k, order))
            candidates.append((self.knots[k] + u * self.durations[k], values))
        times, values = (np.concatenate(parts) for parts in zip(*candidates, strict=True))
        low, high = np.argmin(values, axis=0), np.argmax(values, axis=0)
        return tuple(
            Extremum(
                float(values[low[j], j]), float(times[low[j], j]), float(values[high[j], j]), float(times[high[j], j])
            )
            for j in range(self.dof)
        )

    def variation(self) -> Array:
        """Total variation int |dq/dt| dt of each joint, exact to rounding: ``(dof,)``; jumps at knots do not count."""
        return np.asarray(sum(total_variation(points) for points in self.control_points))

    def jump(self, order: int = 0) -> Array:
        """Difference of the order-th derivative across each inner knot, right minus left: ``(K - 1, dof)``."""
        hodographs = [self.hodograph(k, order) for k in range(self.segments)]
        pairs = zip(hodographs[:-1], hodographs[1:], strict=True)
        return np.array([right[0] - left[-1] for left, right in pairs]).reshape(-1, self.dof)

    def to_bpoly(self) -> BPoly:
        """As scipy's ``BPoly`` over the knots (all segments at the highest degree)."""
        raised = self.elevate(max(self.degrees))
        return BPoly(np.stack(raised.control_points, axis=1), self.knots, extrapolate=False)

    @classmethod
    def from_bpoly(cls, bpoly: BPoly) -> PiecewiseBezier:
        """From scipy's ``BPoly``, whose coefficients are ``(n + 1, K, dof)`` or ``(n + 1, K)``; time restarts at 0."""
        coefficients = bpoly.c if bpoly.c.ndim == 3 else bpoly.c[:, :, None]
        return cls(np.diff(bpoly.x), tuple(coefficients[:, k, :] for k in range(coefficients.shape[1])))

    @classmethod
    def from_ppoly(cls, ppoly: PPoly) -> PiecewiseBezier:
        """From scipy's ``PPoly`` (so from ``CubicSpline`` and its kin as well)."""
        return cls.from_bpoly(BPoly.from_power_basis(ppoly))
