"""Random robots, curves and limits to attack the audit with.

The random attack puts limits at a trajectory's own peak, missed by a stated fraction, through parameters: a row is
s = (g - p_middle) / p_half, limited to 1, -1 or both, so that one compiled limit serves every trajectory of a robot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from itertools import islice, pairwise
from typing import Any, NamedTuple

import casadi
import numpy as np
from scipy.interpolate import BPoly, CubicSpline, PchipInterpolator

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import PiecewiseBezier, basis
from ocp_traj.curves.families import cubic_spline_free_ends
from ocp_traj.formulation.requirements import (
    PathConstraint,
    Requirements,
    State,
)
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.audit import audit_all
from ocp_traj.proof.verdicts import PROVED, VIOLATED, AuditRow
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.robot.robot import Robot
from tests.random_robots import random_robot

SCAN = 20_000  # points a trajectory
NOISE = 1e-10  # [of a limit's half range] what the scan's own rounding is allowed: a tenth of the smallest miss
MISSES = (0.0, *(sign * 10.0**-k for k in range(1, 10) for sign in (1.0, -1.0)))  # (bound - peak) / half range

# --- Curves -----------------------------------------------------------------------------------------------------------


def between(left: Array, right: Array, duration: float) -> Array:
    """Control points of the polynomial with these derivatives ``(k, dof)`` at its ends."""
    return np.asarray(BPoly.from_derivatives([0.0, duration], [list(left), list(right)]).c[:, 0, :])


def chain(rng: np.random.Generator, dof: int, orders: list[tuple[int, int]]) -> PiecewiseBezier:
    """Segments given by numbers of derivatives at both ends; each takes over from the one before."""
    durations, left = rng.uniform(0.3, 1.5, len(orders)), derivatives(rng, dof) * rng.integers(2)
    segments: list[Array] = []
    for (before, after), duration in zip(orders, durations, strict=True):
        right = derivatives(rng, dof)
        segments.append(between(left[:before], right[:after], float(duration)))
        curve = PiecewiseBezier([duration], [segments[-1]])
        left = np.array([curve.at(0, 1.0, order)[0] for order in range(5)])
    return PiecewiseBezier(durations, segments)


def derivatives(rng: np.random.Generator, dof: int) -> Array:
    """Random q, v, a, jerk, snap ``(5, dof)``."""
    return rng.normal(size=(5, dof)) * np.array([1.0, 1.0, 3.0, 20.0, 100.0])[:, None]


def _knots(rng: np.random.Generator, segments: int) -> Array:
    return np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, segments))])


def _control_points(rng: np.random.Generator, dof: int, segments: int) -> PiecewiseBezier:
    points: list[Array] = []
    for degree in rng.integers(3, 10, segments):
        segment = rng.normal(size=(degree + 1, dof))
        if points:
            segment[0] = points[-1][-1]
        points.append(segment)
    return PiecewiseBezier(rng.uniform(0.3, 2.0, segments), points)


def _bpoly(rng: np.random.Generator, dof: int, segments: int) -> PiecewiseBezier:
    ends = [derivatives(rng, dof)[: rng.integers(2, 6)] for _ in range(segments + 1)]
    return PiecewiseBezier.from_bpoly(BPoly.from_derivatives(_knots(rng, segments), ends))


def _spline(kind: Any) -> Callable[[np.random.Generator, int, int], PiecewiseBezier]:
    return lambda rng, dof, k: PiecewiseBezier.from_ppoly(kind(_knots(rng, k), rng.normal(size=(k + 1, dof))))


# Builders (rng, joints, segments), and the numbers of segments they can make.
CURVES: dict[str, tuple[Callable[[np.random.Generator, int, int], PiecewiseBezier], tuple[int, ...]]] = {
    "cubic spline, free ends": (
        lambda rng, dof, k: cubic_spline_free_ends(rng.normal(size=(k - 1, dof)), rng.uniform(0.2, 1.0, k)),
        (4, 5, 6),
    ),
    "any degree": (_control_points, (1, 2, 3, 4, 5, 6)),
    "nonic, C4": (lambda rng, dof, k: chain(rng, dof, [(5, 5)] * k), (1, 2, 3, 4, 5, 6)),
    "3-5-3": (lambda rng, dof, k: chain(rng, dof, [(3, 1), (3, 3), (3, 1)]), (3,)),
    "quartic-quintic": (lambda rng, dof, k: chain(rng, dof, [(3, 2), (3, 3)]), (2,)),
    "scipy's BPoly": (_bpoly, (1, 2, 3, 4, 5, 6)),
    "scipy's CubicSpline": (_spline(CubicSpline), (2, 3, 4, 5, 6)),
    "scipy's PCHIP": (_spline(PchipInterpolator), (2, 3, 4, 5, 6)),
}


@cache
def _basis(degree: int, count: int) -> Array:
    return basis(degree, np.linspace(0.0, 1.0, count))


class Scan:
    """Many instants of a curve, both sides of each knot: states ``(5 dof, N)``, local times and segments."""

    def __init__(self, curve: PiecewiseBezier, points: int = SCAN) -> None:
        self.count = points // curve.segments + 1
        blocks = [
            np.concatenate([(_basis(len(h) - 1, self.count) @ h).T for h in (curve.hodograph(k, m) for m in range(5))])
            for k in range(curve.segments)
        ]
        self.states = np.concatenate(blocks, axis=1)
        self.u = np.tile(np.linspace(0.0, 1.0, self.count), curve.segments)
        self.segment = np.repeat(np.arange(curve.segments), self.count)


def states_at(curve: PiecewiseBezier, segment: Index, u: Array) -> Array:
    states = np.empty((5 * curve.dof, len(u)))
    for k in np.unique(segment):
        there = segment == k
        states[:, there] = np.concatenate([curve.at(int(k), u[there], m).T for m in range(5)])
    return states


# --- Limits of a random robot -----------------------------------------------------------------------------------------


class Attack:
    """A robot's limits, all of them on scaled rows, and the trajectories and bounds to attack them with."""

    def __init__(self, rng: np.random.Generator, robot: Robot, segments: int) -> None:
        self.robot, n = robot, robot.size
        constants = rng.normal(size=(segments, 6))
        target = rng.normal(size=3)

        def dynamic(s: State) -> Any:
            effort = robot.effort(s.q, s.v, s.a, payload=s.p[0])
            return casadi.vertcat(effort, effort * s.v, effort[0] + casadi.tanh(3.0 * s.v[0]))

        def kinematic(s: State) -> Any:
            place = robot.tool_pose(s.q)[1]
            path = s.c[:3] + s.u * s.c[3:] + casadi.sin(3.0 * s.u) * s.p[0]
            return casadi.vertcat(
                place, place - path, casadi.sumsqr(place - path), casadi.sumsqr(place - target),
                casadi.sqrt(1.0 + casadi.sumsqr(place - target)), 1.0 / (2.0 + casadi.sin(s.q[0])),
            )  # fmt: skip

        def plain(s: State) -> Any:
            return casadi.vertcat(s.q[0] * s.u, s.v, s.a[-1], s.jerk[-1], s.snap[-1], s.v[0] * s.a[0] * s.q[-1])

        self.rows = {"dynamic": 2 * n + 1, "kinematic": 10, "plain": n + 5}
        first, limits = 1, []
        for name, expression in (("dynamic", dynamic), ("kinematic", kinematic), ("plain", plain)):
            rows = self.rows[name]
            sides = rng.integers(3, size=rows)  # upper, lower, both
            limits.append(
                PathConstraint(
                    name, self._scaled(expression, first, rows), np.where(sides == 0, -np.inf, -1.0),
                    np.where(sides == 1, np.inf, 1.0), ("-",) * rows, tuple(f"{name} {i}" for i in range(rows)),
                    constants=constants if name == "kinematic" else None,
                )
            )  # fmt: skip
            first += 2 * rows
        self.parameters = tuple(f"p{i}" for i in range(first))
        self.requirements = Requirements(robot.joints, robot.units, tuple(limits), parameters=self.parameters)

    @staticmethod
    def _scaled(expression: Callable[[State], Any], first: int, rows: int) -> Callable[[State], Any]:
        return lambda s: (expression(s) - s.p[first : first + rows]) / s.p[first + rows : first + 2 * rows]

    def values(self, limit: PathConstraint, p: Array, x: Array, u: Array, segment: Index) -> Array:
        """Rows of a limit at N states ``(rows, N)``, in floats."""
        tape: Tape = self.requirements.compiled(limit, "tape", lambda: Tape(self.requirements.function(limit)))
        constants = np.zeros((0, len(u))) if limit.constants is None else limit.constants[segment].T
        return tape.evaluate(x, u[None], np.repeat(p[:, None], len(u), axis=1), constants)[0]

    def extrema(self, limit: PathConstraint, curve: PiecewiseBezier, p: Array, scan: Scan) -> tuple[Array, Array]:
        """Least and greatest of each row: of the scan, then of three finer ones around its extrema."""
        values = self.values(limit, p, scan.states, scan.u, scan.segment)
        rows, found = np.arange(len(values)), []
        for best in (np.argmin, np.argmax):
            at, step = best(values, axis=1), 1.0 / (scan.count - 1)
            u, segment, peak = scan.u[at], scan.segment[at], values[rows, at]
            for _ in range(3):
                fine = np.clip(u[:, None] + step * np.linspace(-1.0, 1.0, 41), 0.0, 1.0)
                k = np.repeat(segment, 41)
                finer = self.values(limit, p, states_at(curve, k, fine.ravel()), fine.ravel(), k)
                own = finer.reshape(len(rows), len(rows), 41)[rows, rows]
                index = best(own, axis=1)
                u, step = fine[rows, index], step / 20.0
                both = np.stack([peak, own[rows, index]])
                peak = both[best(both, axis=0), rows]
            found.append(peak)
        return found[0], found[1]

    def noise(self, rng: np.random.Generator, curve: PiecewiseBezier, p: Array) -> dict[str, Array]:
        """What rounding does to each row: ten times the effect of moving the control points by some ulp."""
        moved = [points * (1.0 + 4e-16 * rng.normal(size=points.shape)) for points in curve.control_points]
        scan, other = Scan(curve, 200), Scan(PiecewiseBezier(curve.durations, moved), 200)
        p = np.concatenate([p[:1], *(x for n in self.rows.values() for x in (np.zeros(n), np.ones(n)))])
        values = [
            {c.id: self.values(c, p, x.states, x.u, x.segment) for c in self.requirements.path_constraints}
            for x in (scan, other)
        ]
        return {name: 10.0 * np.abs(values[0][name] - values[1][name]).max(axis=1) for name in values[0]}

    def aim(self, rng: np.random.Generator, curve: PiecewiseBezier, scan: Scan) -> Aimed:
        """Bounds near the curve's own peaks, as parameters."""
        p = np.ones(len(self.parameters))
        p[0] = rng.uniform(0.0, 3.0)
        first, parts, noise = 1, [], self.noise(rng, curve, p)
        for limit in self.requirements.path_constraints:
            rows = len(limit.labels)
            p[first : first + rows] = 0.0
            low, high = self.extrema(limit, curve, p, scan)
            # A middle between the extremes makes the half range as small as can be, but for what the scan can tell.
            least = np.maximum(noise[limit.id] / NOISE, 1e-3 * np.maximum(np.abs(low), np.abs(high)))
            middle = low + (high - low) * rng.choice([0.0, 0.3, 0.5, 1.0], size=rows)
            above, below = np.isfinite(limit.upper), np.isfinite(limit.lower)
            reach = np.maximum(np.where(above, high - middle, 0.0), np.where(below, middle - low, 0.0))
            shift = np.where(reach > least, 0.0, 1.0 + least)
            middle = np.where(above, np.minimum(middle, high - shift), np.maximum(middle, low + shift))
            reach = np.maximum(np.where(above, high - middle, 0.0), np.where(below, middle - low, 0.0))
            miss = rng.choice(MISSES, size=rows)
            half = reach / (1.0 - miss)
            p[first : first + rows], p[first + rows : first + 2 * rows] = middle, half
            parts.append((miss, (low - middle) / half, (high - middle) / half))
            first += 2 * rows
        parameters = dict(zip(self.parameters, p.tolist(), strict=True))
        return Aimed(
            Trajectory(curve, self.robot.joints, parameters=parameters),
            p,
            *map(np.concatenate, zip(*parts, strict=True)),
        )


class Aimed(NamedTuple):
    """A trajectory with bounds near its peaks.

    Attributes:
        miss: (bound - peak) / half range, per row of all limits.
        least, greatest: extrema the scan found, of the scaled rows.
    """

    trajectory: Trajectory
    p: Array
    miss: Array
    least: Array
    greatest: Array


def instants(curve: PiecewiseBezier, instant: float) -> tuple[Index, Array]:
    """Segments and local times of an instant, one for each side of a knot."""
    slack = 1e-12 * curve.duration
    k = np.flatnonzero((curve.knots[:-1] - slack <= instant) & (instant <= curve.knots[1:] + slack))
    return k, np.clip((instant - curve.knots[k]) / curve.durations[k], 0.0, 1.0)


def contradictions(row: AuditRow, lower: float, upper: float, least: float, greatest: float, there: Array) -> list[str]:
    """What a scan (least and greatest value, values at the reported instant) says against a row."""
    found = []
    if row.verdict == PROVED and not (lower - NOISE <= least and greatest <= upper + NOISE):
        found.append("proved, and the scan breaks it")
    if row.verdict == VIOLATED and not ((there > upper - NOISE) | (there < lower + NOISE)).any():
        found.append("violated, and the instant does not violate")
    above = row.bound == upper
    if (greatest > row.proved_bound + NOISE) if above else (least < row.proved_bound - NOISE):
        found.append("the scan leaves the enclosure")
    if (row.attained > max(greatest, *there) + NOISE) if above else (row.attained < min(least, *there) - NOISE):
        found.append("the attained value is never attained")
    return found


def attack(seed: int, joints: int, batch: int) -> Counter[str]:
    """Attacks one robot with a batch of trajectories; fails on a wrong row, and counts verdicts by miss."""
    rng = np.random.default_rng([seed, joints])
    segments = 1 + (seed + joints) % 6
    families = [make for make, possible in CURVES.values() if segments in possible]
    curves = [families[i % len(families)](rng, joints, segments) for i in range(batch)]
    assault, count = Attack(rng, random_robot(rng, joints), segments), Counter(trajectories=batch)
    aimed = [assault.aim(rng, curve, Scan(curve)) for curve in curves]
    for target, found in zip(aimed, audit_all([a.trajectory for a in aimed], assault.requirements), strict=True):
        rows = iter(zip(found.rows, target.miss, target.least, target.greatest, strict=True))
        for limit in assault.requirements.path_constraints:
            for i, (row, miss, least, greatest) in enumerate(islice(rows, len(limit.labels))):
                assert (row.limit, row.label) == (limit.id, limit.labels[i])
                k, u = instants(target.trajectory.curve, row.instant)
                there = assault.values(limit, target.p, states_at(target.trajectory.curve, k, u), u, k)[i]
                wrong = contradictions(row, limit.lower[i], limit.upper[i], least, greatest, there)
                assert not wrong, f"{wrong}: {row}, missed by {miss:g}; scan [{least!r}, {greatest!r}]"
                count["rows"] += 1
                count[f"{row.verdict}, missed by {miss:g}"] += 1
    return count


def exact_derivative(curve: PiecewiseBezier, segment: int, order: int, joint: int, u: Fraction) -> Fraction:
    points = [Fraction(x) for x in curve.control_points[segment][:, joint]]
    for _ in range(order):
        n = len(points) - 1
        points = [n * (y - x) / Fraction(curve.durations[segment]) for x, y in pairwise(points)] or [Fraction(0)]
    while len(points) > 1:
        points = [(1 - u) * x + u * y for x, y in pairwise(points)]
    return points[0]
