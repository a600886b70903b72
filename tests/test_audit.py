"""The audit attacked: whatever a dense scan finds lies within its bounds; its traps; its tightness.

The random attack puts limits at a trajectory's own peak, missed by a stated fraction, through parameters: a row is
s = (g - p_middle) / p_half, limited to 1, -1 or both, so that one compiled limit serves every trajectory of a robot.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import islice, pairwise
from typing import Any, NamedTuple

import casadi
import mpmath
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BPoly, CubicSpline, PchipInterpolator

from benchmarks.audit import JOINTS, six_joint_arm, tag_to_tag, torque
from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier, basis
from ocp_traj.curves.families import cubic_spline_free_ends
from ocp_traj.errors import InputError, KinkedExpression, ProblemDefinitionError, UnsupportedOperation
from ocp_traj.formulation.requirements import (
    ORDERS,
    DurationConstraint,
    ParameterBound,
    PathConstraint,
    PointConstraint,
    Requirements,
    State,
)
from ocp_traj.interval.tape import Tape
from ocp_traj.proof import prover as prover_module
from ocp_traj.proof.audit import audit, audit_all
from ocp_traj.proof.limit_tapes import curvature_function, domain_function
from ocp_traj.proof.values import limit_on
from ocp_traj.proof.verdicts import ALLOWANCE, CHECKED, PROVED, UNDECIDED, VIOLATED, Audit, AuditRow
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.results.trajectory import trajectory_of as of_vector
from ocp_traj.robot.robot import Robot
from tests.random_robots import random_robot

Array = NDArray[np.float64]

SCAN = 20_000  # points a trajectory
NOISE = 1e-10  # [of a limit's half range] what the scan's own rounding is allowed: a tenth of the smallest miss
MISSES = (0.0, *(sign * 10.0**-k for k in range(1, 10) for sign in (1.0, -1.0)))  # (bound - peak) / half range

# --- Curves -----------------------------------------------------------------------------------------------------------


def between(left: Array, right: Array, duration: float) -> Array:
    """Control points of the polynomial with these derivatives ``(k, dof)`` at its ends."""
    return np.asarray(BPoly.from_derivatives([0.0, duration], [list(left), list(right)]).c[:, 0, :])


def chain(rng: np.random.Generator, dof: int, orders: list[tuple[int, int]]) -> PiecewiseBezier:
    """Segments given by numbers of derivatives at both ends; each takes over from the one before."""
    durations, left = rng.uniform(0.3, 1.5, len(orders)), _derivatives(rng, dof) * rng.integers(2)
    segments: list[Array] = []
    for (before, after), duration in zip(orders, durations, strict=True):
        right = _derivatives(rng, dof)
        segments.append(between(left[:before], right[:after], float(duration)))
        curve = PiecewiseBezier([duration], [segments[-1]])
        left = np.array([curve.at(0, 1.0, order)[0] for order in range(5)])
    return PiecewiseBezier(durations, segments)


def _derivatives(rng: np.random.Generator, dof: int) -> Array:
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
    ends = [_derivatives(rng, dof)[: rng.integers(2, 6)] for _ in range(segments + 1)]
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


def states_at(curve: PiecewiseBezier, segment: NDArray[np.intp], u: Array) -> Array:
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

    def values(self, limit: PathConstraint, p: Array, x: Array, u: Array, segment: NDArray[np.intp]) -> Array:
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


def instants(curve: PiecewiseBezier, instant: float) -> tuple[NDArray[np.intp], Array]:
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


@pytest.mark.parametrize(("joints", "batch"), [(1, 20), (2, 20), (3, 16), (5, 12), (7, 8)])
def test_random_trajectories_never_contradict_their_audit(joints: int, batch: int) -> None:
    _decides_what_is_clear(attack(0, joints, batch))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize(("joints", "batch"), [(1, 140), (2, 110), (3, 80), (4, 45), (5, 25), (6, 12), (7, 8)])
def test_2100_random_trajectories_never_contradict_their_audits(seed: int, joints: int, batch: int) -> None:
    _decides_what_is_clear(attack(seed, joints, batch))


def _decides_what_is_clear(count: Counter[str]) -> None:
    """Soundness by undecided rows is none: a miss of 1e-6 is always decided, one of 1e-9 nearly always."""
    for miss in MISSES:
        verdicts = {v: count[f"{v}, missed by {miss:g}"] for v in (PROVED, UNDECIDED, VIOLATED)}
        if abs(miss) >= 0.9e-6:
            assert verdicts[PROVED if miss > 0.0 else VIOLATED] == sum(verdicts.values()) > 0, (miss, verdicts)
        elif miss != 0.0:
            assert verdicts[UNDECIDED] <= 2 + 0.2 * sum(verdicts.values()), (miss, verdicts)


# --- Limits on the derivatives themselves, against rational arithmetic ------------------------------------------------


def exact_derivative(curve: PiecewiseBezier, segment: int, order: int, joint: int, u: Fraction) -> Fraction:
    points = [Fraction(x) for x in curve.control_points[segment][:, joint]]
    for _ in range(order):
        n = len(points) - 1
        points = [n * (y - x) / Fraction(curve.durations[segment]) for x, y in pairwise(points)] or [Fraction(0)]
    while len(points) > 1:
        points = [(1 - u) * x + u * y for x, y in pairwise(points)]
    return points[0]


@pytest.mark.parametrize("family", CURVES)
def test_limits_on_derivatives_hold_exactly(family: str) -> None:
    rng = np.random.default_rng(list(CURVES).index(family))
    make, possible = CURVES[family]
    decided: Counter[str] = Counter()
    for _ in range(5):
        curve = make(rng, 2, int(rng.choice(possible)))
        for order in range(5):
            peaks, miss = curve.extrema(order), rng.choice(MISSES, size=2)
            half = np.array([max(0.5 * (e.upper - e.lower), 1e-3) for e in peaks]) / (1.0 - miss)
            middle = np.array([0.5 * (e.upper + e.lower) for e in peaks])
            limit = PathConstraint.on_derivative("limit", order, middle - half, middle + half, ["-"] * 2, ["0", "1"])
            found = audit(Trajectory(curve, ("a", "b")), Requirements(("a", "b"), ("m", "m"), (limit,)))
            for joint, row in enumerate(found.rows):
                lower, upper, extreme = limit.lower[joint], limit.upper[joint], peaks[joint]
                exact = []
                for time in (extreme.lower_time, extreme.upper_time):
                    for k, u in zip(*instants(curve, time), strict=True):
                        exact += [exact_derivative(curve, int(k), order, joint, Fraction(float(x))) for x in _around(u)]
                below, above = (Fraction(ALLOWANCE) * abs(Fraction(float(b))) for b in (lower, upper))
                if row.verdict == PROVED:
                    assert Fraction(lower) - below <= min(exact) and max(exact) <= Fraction(upper) + above
                    assert miss[joint] > -1e-8 or extreme.upper - extreme.lower < 2e-3
                if row.verdict == VIOLATED:
                    there = [
                        exact_derivative(curve, int(k), order, joint, Fraction(float(x)))
                        for k, u in zip(*instants(curve, row.instant), strict=True)
                        for x in _around(u)
                    ]
                    assert max(there) > upper or min(there) < lower
                    assert miss[joint] < 1e-8
                if row.bound == upper:
                    assert max(exact) <= Fraction(row.proved_bound)
                else:
                    assert min(exact) >= Fraction(row.proved_bound)
                decided[row.verdict] += 1
    assert decided[PROVED] > 5 and decided[VIOLATED] > 5


def _around(u: float) -> Array:
    return np.clip(u + np.array([0.0, 1e-13, -1e-13, 1e-9, -1e-9]), 0.0, 1.0)


# --- Against code that shares nothing with the tape -------------------------------------------------------------------

_MP: dict[int, Callable[..., Any]] = {
    casadi.OP_ASSIGN: lambda x: x, casadi.OP_ADD: lambda x, y: x + y, casadi.OP_SUB: lambda x, y: x - y,
    casadi.OP_MUL: lambda x, y: x * y, casadi.OP_DIV: lambda x, y: x / y, casadi.OP_NEG: lambda x: -x,
    casadi.OP_INV: lambda x: 1 / x, casadi.OP_SQ: lambda x: x * x, casadi.OP_TWICE: lambda x: 2 * x,
    casadi.OP_SIN: mpmath.sin, casadi.OP_COS: mpmath.cos, casadi.OP_TANH: mpmath.tanh, casadi.OP_SQRT: mpmath.sqrt,
}  # fmt: skip


def in_60_digits(function: Any, inputs: list[list[Any]]) -> list[Any]:
    """A compiled limit, its constants as rounded, at one state."""
    register: dict[int, Any] = {}
    result = [mpmath.mpf(0)] * function.numel_out(0)
    for k in range(function.n_instructions()):
        operation, read, written = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        if operation == casadi.OP_CONST:
            register[written[0]] = mpmath.mpf(function.instruction_constant(k))
        elif operation == casadi.OP_INPUT:
            register[written[0]] = inputs[read[0]][read[1]]
        elif operation == casadi.OP_OUTPUT:
            result[written[1]] = register[read[0]]
        else:
            register[written[0]] = _MP[operation](*(register[i] for i in read))
    return result


@pytest.mark.parametrize("joints", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_bounds_hold_in_60_digits_where_the_limit_is_the_peak(joints: int) -> None:
    rng = np.random.default_rng([3, joints])
    assault = Attack(rng, random_robot(rng, joints), 2)
    with mpmath.workdps(60):
        for curve in (CURVES[name][0](rng, joints, 2) for name in ("nonic, C4", "any degree")):
            target = assault.aim(rng, curve, Scan(curve))
            rows = iter(audit(target.trajectory, assault.requirements).rows)
            for limit in assault.requirements.path_constraints:
                function = assault.requirements.function(limit)
                for i, row in enumerate(islice(rows, len(limit.labels))):
                    for k, centre in zip(*instants(curve, row.instant), strict=True):
                        for u in np.clip(centre + np.array([0.0, 1e-8, -1e-6]), 0.0, 1.0):
                            exact = Fraction(float(u))
                            state = [
                                _mpf(exact_derivative(curve, int(k), order, joint, exact))
                                for order in range(5)
                                for joint in range(joints)
                            ]
                            c = [] if limit.constants is None else [mpmath.mpf(x) for x in limit.constants[k]]
                            p = [mpmath.mpf(x) for x in target.p]
                            value = in_60_digits(function, [state, [_mpf(exact)], p, c])[i]
                            above = row.bound == limit.upper[i]
                            assert value <= row.proved_bound if above else value >= row.proved_bound
                            if row.verdict == PROVED:
                                assert limit.lower[i] - ALLOWANCE <= value <= limit.upper[i] + ALLOWANCE


def _mpf(x: Fraction) -> Any:
    return mpmath.mpf(x.numerator) / x.denominator


@pytest.mark.parametrize("joints", [1, 3, 6])
def test_torques_of_pinocchio_respect_the_audit(joints: int) -> None:
    rng = np.random.default_rng([4, joints])
    robot, payload = random_robot(rng, joints), 2.0
    curves = [make(rng, joints, k[-1]) for make, k in CURVES.values()]
    model = robot.model.copy()
    model.appendBodyToJoint(joints, pin.Inertia(payload, np.zeros(3), np.zeros((3, 3))), robot.tool)
    data, audited = model.createData(), Counter[str]()
    scans = []
    for curve in curves:
        t = np.linspace(0.0, curve.duration, 1000)
        states = zip(*(curve(t, order) for order in range(3)), strict=True)
        scans.append(np.array([pin.rnea(model, data, *state) for state in states]).T)
    # Bounds at the peaks of one curve, and next to them: what is right for one is wrong for others.
    for reference in scans[:3]:
        size = np.abs(reference).max(axis=1) * (1.0 + rng.choice([1e-6, -1e-6, 0.1], size=joints))
        limit = PathConstraint("torque", lambda s: robot.effort(s.q, s.v, s.a, payload=s.p[0]), -size, size,
                               robot.effort_units, robot.joints)  # fmt: skip
        requirements = Requirements(robot.joints, robot.units, (limit,), parameters=("payload",))
        trajectories = [Trajectory(curve, robot.joints, parameters={"payload": payload}) for curve in curves]
        for curve, scan, found in zip(curves, scans, audit_all(trajectories, requirements), strict=True):
            for j, row in enumerate(found.rows):
                noise = 1e-9 * (size[j] + np.abs(scan).max())
                if row.verdict == PROVED:
                    assert np.abs(scan[j]).max() <= size[j] + noise
                if row.verdict == VIOLATED:
                    there = [
                        pin.rnea(model, data, *(curve.at(int(k), u, order)[0] for order in range(3)))[j]
                        for k, u in zip(*instants(curve, row.instant), strict=True)
                    ]
                    assert np.abs(there).max() > size[j] - noise
                assert (
                    scan[j].max() <= row.proved_bound + noise
                    if row.bound > 0
                    else scan[j].min() >= row.proved_bound - noise
                )
                audited[row.verdict] += 1
    assert audited[PROVED] and audited[VIOLATED]


# --- Hand-made cases --------------------------------------------------------------------------------------------------


def audit_of(
    expression: Callable[[State], Any],
    lower: float,
    upper: float,
    *segments: Any,
    durations: Sequence[float] = (1.0,),
    p: Sequence[float] = (),
    **options: Any,
) -> AuditRow:
    """The row of one limit along a curve of one joint (or more, where control points are rows), given by segment."""
    points = [np.array(s, dtype=float).reshape(len(s), -1) for s in segments]
    curve = PiecewiseBezier(np.array(durations, dtype=float), points)
    names, labels = tuple(f"j{i}" for i in range(curve.dof)), tuple(f"p{i}" for i in range(len(p)))
    order = options.pop("order", None)
    limit = PathConstraint("limit", expression, np.array([lower]), np.array([upper]), ("-",), ("row",), order=order)
    requirements = Requirements(names, ("m",) * curve.dof, (limit,), parameters=labels)
    trajectory = Trajectory(curve, names, parameters=dict(zip(labels, p, strict=True)))
    return audit(trajectory, requirements, **options).rows[0]


INF = math.inf
MIDWAY = [1.0, -2.0, 1.0]  # from 1 down to -0.5 and back


@pytest.mark.parametrize(
    "expression",
    [
        lambda s: casadi.sqrt(s.q[0]),
        lambda s: casadi.log(s.q[0]),
        lambda s: 1.0 / s.q[0],
        lambda s: 2.0 / (s.q[0] * 1.0),
        lambda s: s.q[0] ** 2.5,
        lambda s: s.q[0] ** 0.5,
        lambda s: s.q[0] ** -2.0,
        lambda s: s.q[0] ** s.q[0],
        lambda s: casadi.acos(2.0 * s.q[0]),
        lambda s: casadi.asin(s.q[0] - 1.0),
        lambda s: casadi.atanh(1.5 * s.q[0]),
        lambda s: casadi.acosh(1.0 + s.q[0]),
        lambda s: casadi.log1p(s.q[0] - 0.9),
        lambda s: casadi.tan(3.0 * s.q[0]),
        lambda s: casadi.sqrt(-1.0 - s.q[0] ** 2),
        lambda s: casadi.sqrt(s.u - 0.5),
        lambda s: s.q[0] / (s.u - 0.3),
        lambda s: s.q[0] + casadi.SX(math.nan),
        lambda s: s.q[0] * casadi.SX(INF),
    ],
)
@pytest.mark.parametrize("factor", [1.0, 0.0])
def test_what_is_undefined_or_unbounded_somewhere_is_never_proved(expression: Any, factor: float) -> None:
    """The factor is a parameter: an interval times zero is zero, whatever the interval."""
    for lower, upper in ((-INF, 1e9), (-1e9, INF), (-1e9, 1e9)):
        row = audit_of(lambda s: s.p[0] * expression(s), lower, upper, MIDWAY, p=[factor])
        assert row.verdict == UNDECIDED or (row.verdict == VIOLATED and abs(row.attained) > 1e9)
        assert abs(row.proved_bound) == INF and row.margin == -INF
        assert row.boxes <= 2000


@pytest.mark.parametrize("value", [math.nan, INF, -INF])
def test_a_parameter_that_is_no_number_is_never_proved(value: float) -> None:
    for factor in (1.0, 0.0):
        row = audit_of(lambda s: s.q[0] * s.p[0] * s.p[1], -1.0, 1.0, [0.3, 0.3, 0.3], p=[factor, value])
        assert row.verdict == UNDECIDED and abs(row.proved_bound) == INF


@pytest.mark.parametrize(
    "expression",
    [
        lambda x: casadi.fabs(x),
        lambda x: casadi.fmax(x, -x),
        lambda x: -casadi.fmin(x, -x),
        lambda x: x * casadi.sign(x),
        lambda x: casadi.if_else(x > 0, x, -x),
        lambda x: casadi.sqrt(x**2),
        lambda x: casadi.sqrt(casadi.sumsqr(x)),
        lambda x: (x**2) ** 0.5,
        lambda x: 1.0 + casadi.floor(-x),
        lambda x: casadi.ceil(x),
        lambda x: 1 - casadi.fmod(1 - x, 2),
        lambda x: casadi.copysign(x, 1.0),
        lambda x: casadi.norm_1(x),
        lambda x: casadi.atan2(x, -1.0),
    ],
)
def test_kinks_and_jumps_are_refused(expression: Any) -> None:
    """On a straight line through 0 the second derivative misses them: the ends say 1 and more, the middle 0."""
    with pytest.raises(KinkedExpression):
        audit_of(lambda s: expression(s.q[0]), 0.5, INF, [1.0, -1.2])


def test_an_unknown_operation_is_refused() -> None:
    with pytest.raises(UnsupportedOperation):
        audit_of(lambda s: casadi.erfinv(s.q[0]), -1.0, 1.0, [0.1, 0.2])


def test_a_limit_that_is_not_the_derivative_it_claims_is_refused() -> None:
    with pytest.raises(ProblemDefinitionError, match="order=1"):
        audit_of(lambda s: 2.0 * s.v[0], -3.0, 3.0, [0.0, 2.0], order=1)


@pytest.mark.parametrize("durations", [(0.0,), (-1.0,), (math.nan,), (INF,)])
def test_durations_that_are_not_positive_are_refused(durations: tuple[float]) -> None:
    with pytest.raises(ProblemDefinitionError, match="positive"):
        audit_of(lambda s: s.q[0], -1.0, 1.0, [0.0, 0.5], durations=durations)


def far(x: Any) -> Any:
    """x, but for the 1e8 that its rounding is relative to; two parameters keep CasADi from folding it away."""
    return lambda s: (1e8 * s.p[0] + x(s)) - 1e8 * s.p[1]


def test_verdicts_do_not_lean_on_rounded_values() -> None:
    """With values known to some 1e-8, what is 1e-9 off the limit is neither proved nor violated; 1e-6 is."""
    rng = np.random.default_rng(5)
    for q in rng.uniform(0.1, 1.4, 12):
        for offset, verdict in ((1e-9, UNDECIDED), (-1e-9, UNDECIDED), (1e-6, PROVED), (-1e-6, VIOLATED)):
            rest = audit_of(far(lambda s: casadi.sin(s.q[0])), -INF, math.sin(q) + offset, [q, q, q], p=[1.0, 1.0])
            arch = audit_of(
                far(lambda s: casadi.sin(s.q[0])), -INF, math.sin(q) + offset, [0.0, 2.0 * q, 0.0], p=[1.0, 1.0]
            )
            assert (rest.verdict, arch.verdict) == (verdict, verdict)
            assert rest.boxes <= 64 and arch.boxes <= 600


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e6])
def test_what_rests_exactly_on_its_limit_is_proved(size: float) -> None:
    q = 0.7 * size
    flat = [q] * 10
    for order, limit in ((0, q), (1, 0.0), (2, 0.0), (4, 0.0)):
        row = audit_of(lambda s, m=order: s[m][0], -INF if order else 0.0, limit, flat, order=order)  # type: ignore[misc]
        assert row.verdict == PROVED and row.attained == pytest.approx(limit, abs=1e-300) and row.boxes == 1
    for sign in (1.0, -1.0):
        row = audit_of(lambda s: s.p[0] * s.q[0], *sorted((0.0, sign * q)), flat, p=[sign])
        assert row.verdict == PROVED and row.bound == sign * q
    # Cruising at the limit, a peak at the limit, and a torque that holds still.
    assert audit_of(lambda s: s.v[0], -INF, size, [0.0, size / 2, size], order=1).verdict == PROVED
    assert audit_of(lambda s: s.q[0] * s.p[0], -INF, 0.5 * size, [0.0, size, 0.0], p=[1.0]).verdict == PROVED
    gravity = 9.81 * size
    row = audit_of(lambda s: gravity * casadi.cos(s.q[0]), -INF, gravity * math.cos(0.3), [0.3] * 4)
    assert row.verdict == PROVED


@pytest.mark.parametrize("order", [None, 0])
def test_the_allowance_is_of_the_bound_that_is_tested_not_of_the_range(order: int | None) -> None:
    # A placeholder on the other side excuses nothing: 1e-12 of the range would be 1 here.
    for sign in (1.0, -1.0):
        lower, upper = sorted((-sign * 1e12, sign))
        row = audit_of(lambda s: s.q[0], lower, upper, [0.0, sign * 1.4], order=order)
        assert (row.verdict, row.bound) == (VIOLATED, sign)
        assert row.allowance == pytest.approx(ALLOWANCE) and row.attained == pytest.approx(sign * 1.4)
    row = audit_of(lambda s: s.q[0], 0.0, 1e12, [-1e-9, 1.0], order=order)
    assert (row.verdict, row.bound) == (VIOLATED, 0.0) and row.allowance <= 1e-300


def test_an_allowance_is_relative_to_each_bound_and_can_be_given() -> None:
    row = audit_of(lambda s: s.q[0], -1.0, 100.0, [0.0, 100.0 * (1.0 + 9e-10)], allowance=1e-9)
    assert row.verdict == PROVED and row.allowance == pytest.approx(1e-7)
    assert audit_of(lambda s: s.q[0], -1.0, 100.0, [0.0, 100.0 * (1.0 + 9e-10)]).verdict == VIOLATED
    for allowance in (-1e-9, 1.0, math.nan):
        with pytest.raises(InputError, match="give a number from 0 to below 1"):
            audit_of(lambda s: s.q[0], -1.0, 100.0, [0.0, 1.0], allowance=allowance)


def test_durations_and_parameters_are_rows_that_are_checked() -> None:
    weld = DurationConstraint("weld-time", (1, -1), np.array([0.5, 0.0]), np.array([0.5, 2.0]))
    requirements = Requirements(
        ("a",), ("m",), (), (), ("payload",),
        duration_constraints=(weld,), parameter_bounds=(ParameterBound("payload", 0.0, np.inf, "kg"),),
    )  # fmt: skip
    points = [np.zeros((2, 1))] * 3

    def verdicts(durations: Sequence[float], payload: float) -> list[str]:
        motion = Trajectory(PiecewiseBezier(durations, points), ("a",), parameters={"payload": payload})
        return [row.verdict for row in audit(motion, requirements).rows]

    assert verdicts([9.0, 0.5, 2.0], 0.0) == [CHECKED] * 3
    assert verdicts([9.0, 0.5 * (1.0 + 1e-10), 2.0], 1e9) == [CHECKED] * 3
    assert verdicts([9.0, 0.50001, 2.1], -1e-9) == [VIOLATED] * 3
    assert verdicts([9.0, 0.5, 2.0], math.nan) == [CHECKED, CHECKED, VIOLATED]
    with pytest.raises(InputError, match="on segment 1; the trajectory has segments 0 to 0"):
        audit(Trajectory(PiecewiseBezier([1.0], points[:1]), ("a",), parameters={"payload": 0.0}), requirements)
    with pytest.raises(ProblemDefinitionError, match="0 <= lower <= upper"):
        DurationConstraint("weld-time", (0,), np.array([2.0]), np.array([1.0]))
    with pytest.raises(ProblemDefinitionError, match=r"'mass'; parameters are \[\]"):
        Requirements(("a",), ("m",), (), parameter_bounds=(ParameterBound("mass", 0.0, 1.0, "kg"),))


def test_a_peak_at_its_limit_is_proved_with_the_allowance_and_undecided_without() -> None:
    arch = (lambda s: casadi.sin(s.q[0]), -INF, 1.0, [1.0, 2.0, 2.2])
    assert audit_of(*arch).verdict == PROVED
    row = audit_of(*arch, allowance=0.0)
    assert row.verdict in (PROVED, UNDECIDED) and row.boxes <= 400
    row = audit_of(lambda s: s.q[0] + s.p[0], -INF, 0.1 + 0.2, [0.1, 0.1], p=[0.2], allowance=0.0)
    assert row.verdict == UNDECIDED and row.boxes <= 64


def test_what_cannot_be_decided_stops_at_the_stated_number_of_boxes_with_its_bound() -> None:
    for budget in (1, 100, 2000):
        row = audit_of(lambda s: casadi.sin(s.q[0]), -INF, 0.999, [0.0, 300.0], max_arcs=budget, tightness=1e-9)
        assert row.proved_bound >= 1.0 and row.boxes <= 4 * budget + 64
    row = audit_of(lambda s: casadi.sin(s.q[0]), -INF, 1.0 + 1e-9, [0.0, 300.0], max_arcs=100)
    assert row.verdict == UNDECIDED and row.proved_bound > 1.0


@pytest.mark.parametrize("reach", [1e5, 1e7, 1e9, 1e17, 1e300])
def test_huge_angles_are_never_proved_within_what_sine_exceeds(reach: float) -> None:
    for bound in (0.5, 0.999_999):
        row = audit_of(lambda s: casadi.sin(s.q[0]), -INF, bound, [0.0, reach], max_arcs=2000)
        assert row.verdict != PROVED and row.proved_bound >= 1.0 - 1e-9
    assert audit_of(lambda s: casadi.sin(s.q[0]), -INF, 0.5, [reach, reach], max_arcs=2000).proved_bound >= math.sin(
        reach
    )


@pytest.mark.parametrize("duration", [1e-320, 1e-150, 1e-30, 1e30, 1e150, 1e300])
@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_extreme_durations_and_sizes_give_bounds_and_no_warning(duration: float, size: float) -> None:
    points = [0.0, size, -0.3 * size, 0.5 * size, 0.0]
    for order in range(5):
        row = audit_of(lambda s, m=order: s[m][0], -INF, 1.0, points, durations=[duration], order=order)  # type: ignore[misc]
        curve = PiecewiseBezier([1.0], [np.array(points)[:, None]])
        exact = Fraction(curve.extrema(order)[0].upper) / Fraction(duration) ** order
        rounding = Fraction(1, 10**9)
        assert row.proved_bound == INF or Fraction(row.proved_bound) >= exact - abs(exact) * rounding
        assert row.verdict != (PROVED if exact > Fraction(1.001) else VIOLATED if exact < Fraction(0.999) else "")
    row = audit_of(lambda s: s.q[0] * s.p[0], -INF, 0.6 * size, points, durations=[duration], p=[1.0])
    peak = PiecewiseBezier([1.0], [np.array(points)[:, None]]).extrema(0)[0].upper
    assert row.proved_bound >= peak * (1.0 - 1e-12) and row.verdict != VIOLATED
    assert row.verdict == PROVED or not 1e-300 < Fraction(size) / Fraction(duration) ** 2 < 1e300


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e8])
def test_tiny_motions_far_from_the_origin_are_bounded(offset: float) -> None:
    rng = np.random.default_rng(6)
    for _ in range(8):
        points = offset + 1e-6 * rng.normal(size=(8, 1))
        peak = max(exact_derivative(PiecewiseBezier([0.5], [points]), 0, 0, 0, Fraction(i, 64)) for i in range(65))
        for miss in (1e-8, -1e-8):
            row = audit_of(lambda s: s.q[0] * s.p[0], -INF, float(peak) + miss, points, durations=[0.5], p=[1.0])
            assert Fraction(row.proved_bound) >= peak
            if miss < 0.0 and offset < 1e8:
                assert row.verdict == VIOLATED


def test_peaks_at_knots_and_ends_are_found_on_their_side() -> None:
    jumping = ([0.0, 0.0, 0.0, 1.0], [1.0, 3.0, 3.0, 3.0])  # acceleration 6, then -12
    for expression, order in ((lambda s: s.a[0], 2), (lambda s: s.a[0] * s.p[0], None)):
        high = audit_of(expression, -INF, 6.0, *jumping, durations=(1.0, 1.0), p=[1.0], order=order)
        assert (high.verdict, high.instant, high.boxes <= 64) == (PROVED, 1.0, True)
        assert high.attained == pytest.approx(6.0, rel=1e-14) and high.proved_bound == pytest.approx(6.0, rel=1e-14)
        low = audit_of(expression, -12.0 + 1e-9, INF, *jumping, durations=(1.0, 1.0), p=[1.0], order=order)
        assert (low.verdict, low.instant) == (VIOLATED, 1.0) and low.attained == pytest.approx(-12.0, rel=1e-14)
        start = audit_of(expression, -INF, 12.0 - 1e-9, [3.0, 3.0, 5.0, 1.0], p=[1.0], order=order)
        assert (start.verdict, start.instant) == (VIOLATED, 0.0)


def test_a_limit_touched_from_inside_many_times_is_proved_and_undershot_is_violated() -> None:
    """cos has maxima 1 along a long straight line; nine of them."""
    line = [-0.5, 50.5]
    for miss, verdict in ((0.0, PROVED), (1e-9, PROVED), (-1e-9, VIOLATED), (-1e-6, VIOLATED)):
        row = audit_of(lambda s: casadi.cos(s.q[0]), -INF, 1.0 + miss, line)
        assert row.verdict == verdict and 1.0 <= row.proved_bound <= 1.002 and row.attained <= 1.0


def test_the_worse_side_is_reported() -> None:
    line = [-1.0, 2.0]
    side = [audit_of(lambda s: s.q[0] * s.p[0], low, high, line, p=[1.0]).bound for low, high in ((-3, 3), (-1.5, 5))]
    assert side == [3.0, -1.5]
    row = audit_of(lambda s: s.q[0] * s.p[0], -0.5, 3.0, line, p=[1.0])
    assert (row.verdict, row.bound, row.instant) == (VIOLATED, -0.5, 0.0)
    assert row.attained == pytest.approx(-1.0) and row.proved_bound <= -1.0 and row.margin == pytest.approx(-0.5 / 1.75)
    row = audit_of(lambda s: s.q[0] * s.p[0], -INF, 3.0, line, p=[1.0])
    assert (row.verdict, row.bound, row.instant, row.margin) == (PROVED, 3.0, 1.0, pytest.approx(1.0 / 3.0))


def test_rows_hold_python_numbers() -> None:
    for row in (
        audit_of(lambda s: s.q[0] * s.p[0], -1.0, 1.0, [0.0, 0.5], p=[1.0]),
        audit_of(lambda s: s.q[0], -1.0, 1.0, [0.0, 0.5], order=0),
        audit_of(lambda s: casadi.sqrt(s.q[0]), -1.0, 1.0, [0.0, -0.5]),
    ):
        for name in ("bound", "attained", "instant", "proved_bound", "margin"):
            assert type(getattr(row, name)) is float
        assert type(row.boxes) is int


# --- What is checked, not proved --------------------------------------------------------------------------------------


def requirements_of(joints: int, *points: PointConstraint, continuity: int = -1) -> Requirements:
    names = tuple(f"j{i}" for i in range(joints))
    return Requirements(names, ("m",) * joints, (), points, continuity=continuity)


@pytest.mark.parametrize(
    ("error", "verdict"), [(0.0, CHECKED), (1e-13, CHECKED), (1e-8, VIOLATED), (math.nan, VIOLATED)]
)
def test_point_constraints_are_checked_to_their_tolerance(error: float, verdict: str) -> None:
    curve = PiecewiseBezier([1.0, 2.0], [np.array([[0.5], [1.0]]), np.array([[1.0], [1.0], [3.0]])])
    target = [[0.5], [1.0], [3.0 + (0.0 if math.isnan(error) else error)]]
    point = PointConstraint(
        "via", lambda s: s.q + (casadi.SX(error) if math.isnan(error) else 0.0), ((0, 0.0), (1, 0.0), (-1, 1.0)),
        np.array(target), np.array(target), ("m",), ("j0",),
    )  # fmt: skip
    found = audit(Trajectory(curve, ("j0",)), requirements_of(1, point))
    assert [row.verdict for row in found.rows] == [verdict] and found.proved == (verdict == CHECKED)
    if error == 1e-8:
        assert found.rows[0].instant == 3.0 and found.rows[0].margin == pytest.approx(-9.0)
    assert found.rows[0].bound in (0.5, target[2][0])


def test_rest_is_checked_on_derivatives() -> None:
    rest = PointConstraint(
        "rest", lambda s: casadi.vertcat(s.v, s.a), ((0, 0.0), (-1, 1.0)), 0.0, 0.0, ("-",) * 2, ("v", "a")
    )
    still = between(np.zeros((3, 1)), np.array([[1.0], [0.0], [0.0]]), 0.7)
    moving = between(np.zeros((3, 1)), np.array([[1.0], [1e-7], [0.0]]), 0.7)
    verdicts = [
        audit(Trajectory(PiecewiseBezier([0.7], [x]), ("j0",)), requirements_of(1, rest)) for x in (still, moving)
    ]
    assert [[row.verdict for row in a.rows] for a in verdicts] == [[CHECKED, CHECKED], [VIOLATED, CHECKED]]
    assert verdicts[0].verdict == PROVED and verdicts[1].verdict == VIOLATED


def test_a_point_constraint_beyond_the_last_segment_is_refused() -> None:
    point = PointConstraint("via", lambda s: s.q, ((3, 0.0),), 0.0, 0.0, ("m",), ("j0",))
    with pytest.raises(InputError, match="segments 0 to 0"):
        audit(Trajectory(PiecewiseBezier([1.0], [np.zeros((3, 1))]), ("j0",)), requirements_of(1, point))


@pytest.mark.parametrize("order", range(5))
def test_jumps_at_knots_are_found_in_the_derivative_that_jumps(order: int) -> None:
    rng = np.random.default_rng([7, order])
    for size in (1e-6, 1.0):
        knot = _derivatives(rng, 2)
        other = knot.copy()
        other[order, 1] += size * max(1.0, abs(knot[order, 1]))
        ends = _derivatives(rng, 2), _derivatives(rng, 2)
        curve = PiecewiseBezier([0.5, 0.8], [between(ends[0], knot, 0.5), between(other, ends[1], 0.8)])
        rows = audit(Trajectory(curve, ("j0", "j1")), requirements_of(2, continuity=4)).rows
        assert len(rows) == 10
        for row in rows:
            jumps = row.limit == f"continuity of {ORDERS[order]}" and row.label == "j1"
            assert (row.verdict == VIOLATED) == jumps, row
            assert row.instant == 0.5


@pytest.mark.parametrize("offset", [0.0, 0.1, 3.0, 100.0])
def test_rounding_is_no_jump(offset: float) -> None:
    """Standing still, or moving little on short segments: high derivatives are rounding noise and nothing else."""
    rng = np.random.default_rng(8)
    for motion in (0.0, 1e-9, 1e-3, 1.0):
        knots = [offset + motion * rng.normal(size=(5, 1)) * np.array([1, 0, 0, 0, 0])[:, None] for _ in range(5)]
        durations = rng.uniform(0.05, 2.0, 4)
        curve = PiecewiseBezier(
            durations, [between(*k, float(t)) for k, t in zip(pairwise(knots), durations, strict=False)]
        )
        found = audit(Trajectory(curve, ("j0",)), requirements_of(1, continuity=4))
        assert found.proved, found.explain()


# --- The whole --------------------------------------------------------------------------------------------------------


def test_verdict_of_the_whole_is_the_worst() -> None:
    row = audit_of(lambda s: s.q[0], -1.0, 1.0, [0.0, 0.5], order=0)
    rows = {
        v: replace(row, verdict=v, margin=m)
        for v, m in ((PROVED, 0.5), (CHECKED, 0.1), (UNDECIDED, 0.0), (VIOLATED, -0.1))
    }
    for worst, names in ((PROVED, (CHECKED, PROVED)), (UNDECIDED, (PROVED, UNDECIDED)), (VIOLATED, tuple(rows))):
        found = Audit(tuple(rows[n] for n in names))
        assert (found.verdict, found.proved) == (worst, worst == PROVED)
        assert found.failures == tuple(
            sorted((rows[n] for n in names if n in (UNDECIDED, VIOLATED)), key=lambda r: r.margin)
        )
        assert worst in found.explain() and len(found.table) == len(names)
    assert Audit((rows[CHECKED], rows[PROVED])).margin == 0.5
    nothing = Audit(())
    assert (nothing.verdict, nothing.margin) == (UNDECIDED, INF) and "ask nothing" in nothing.explain()


def test_trajectories_are_audited_together_as_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problems.load("hybrid-spline")
    rng = np.random.default_rng(9)
    trajectories = [of_vector(problem, problem.guess(rng)).dilate(1.4) for _ in range(12)]
    alone = [audit(t, problem.requirements) for t in trajectories]
    for batch in (prover_module.BATCH, 40):
        monkeypatch.setattr(prover_module, "BATCH", batch)
        together = audit_all(trajectories, problem.requirements)
        for one, other in zip(alone, together, strict=True):
            for a, b in zip(one.rows, other.rows, strict=True):
                assert (a.limit, a.label, a.verdict, a.bound) == (b.limit, b.label, b.verdict, b.bound)
                for x, y in ((a.attained, b.proved_bound), (b.attained, a.proved_bound)):
                    assert x <= y + 1e-12 if a.bound > 0 else x >= y - 1e-12 or a.verdict == CHECKED
    assert {a.verdict for a in alone} == {PROVED, VIOLATED}
    assert audit_all([], problem.requirements) == []


def test_what_does_not_fit_the_limits_is_refused() -> None:
    limit = PathConstraint(
        "g", lambda s: s.q[0] * s.c[0], np.zeros(1), np.ones(1), ("-",), ("row",), constants=np.ones((2, 1))
    )
    requirements = Requirements(("a", "b"), ("m", "m"), (limit,), parameters=("payload",))
    curve = PiecewiseBezier([1.0], [np.zeros((3, 2))])
    with pytest.raises(InputError, match=r"joints are \['a'\], those of the limits \['a', 'b'\]"):
        audit(Trajectory(PiecewiseBezier([1.0], [np.zeros((3, 1))]), ("a",)), requirements)
    with pytest.raises(InputError, match="same order"):
        audit(Trajectory(curve, ("b", "a"), parameters={"payload": 1.0}), requirements)
    with pytest.raises(InputError, match="payload"):
        audit(Trajectory(curve, ("a", "b")), requirements)
    with pytest.raises(ProblemDefinitionError, match="2 segments"):
        audit(Trajectory(curve, ("a", "b"), parameters={"payload": 1.0}), requirements)


def test_curvature_is_the_second_derivative_along_a_curve() -> None:
    rng = np.random.default_rng(10)
    assault = Attack(rng, random_robot(rng, 3), 1)
    curve = CURVES["any degree"][0](rng, 3, 1)
    time, step = float(curve.durations[0]), 1e-3
    p = np.abs(rng.normal(size=len(assault.parameters))) + 1.0
    u = np.linspace(0.1, 0.9, 41)
    for limit in assault.requirements.path_constraints:
        c = np.zeros((0, len(u))) if limit.constants is None else np.repeat(limit.constants.T, len(u), axis=1)
        x = np.concatenate([curve.at(0, u, m).T for m in range(7)])
        tape = Tape(curvature_function(assault.requirements, limit))
        ours = tape.evaluate(x, u[None], np.repeat(p[:, None], len(u), axis=1), c, np.full((1, len(u)), 1.0 / time))[0]
        zeros = np.zeros(len(u), dtype=np.intp)
        near = [
            assault.values(limit, p, states_at(curve, zeros, v), v, zeros)
            for v in (u + k * step / time for k in range(-2, 3))
        ]
        differences = (-near[0] + 16.0 * near[1] - 30.0 * near[2] + 16.0 * near[3] - near[4]) / (12.0 * step**2)
        assert np.abs(ours - differences).max() <= 1e-6 * (1.0 + np.abs(ours).max() + np.abs(near[2]).max() / step)


@pytest.mark.parametrize(
    ("expression", "inside", "outside"),
    [
        (casadi.sqrt, [0.1, 5.0], [0.0, -1.0]),
        (casadi.log, [0.1, 5.0], [0.0, -1.0]),
        (lambda x: 1 / x, [-1.0, 2.0], [0.0]),
        (lambda x: 3 / (x - 1), [0.0, 2.0], [1.0]),
        (casadi.asin, [-0.9, 0.9], [-1.0, 1.0, 2.0]),
        (lambda x: x**-1.5, [0.1], [0.0, -1.0]),
        (casadi.acos, [-0.9, 0.9], [-1.0, 1.0, 2.0]),
        (casadi.atanh, [-0.9, 0.9], [-1.0, 1.0, 2.0]),
        (lambda x: x**-2, [-1.0, 1.0], [0.0]),
        (casadi.acosh, [1.1, 2.0], [1.0, 0.0]),
        (casadi.log1p, [-0.9, 2.0], [-1.0, -2.0]),
        (lambda x: x**x, [0.1, 2.0], [0.0, -1.0]),
        (lambda x: x**2.5, [0.1, 2.0], [-1.0]),
        (lambda x: casadi.sin(x) / 3 + x**3 + casadi.exp(x) + casadi.atan(x), [0.0, -1.0], []),
        (casadi.tan, [0.0, 1.5], []),
    ],
)
def test_domain_is_where_operations_are_defined(expression: Any, inside: list[float], outside: list[float]) -> None:
    x = casadi.SX.sym("x")
    domain = domain_function(casadi.Function("f", [x], [expression(x)]))
    for values, defined in ((inside, True), (outside, False)):
        for value in values:
            assert (np.array(domain(value)) > 0.0).all() == defined


# --- Tightness --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rest", [True, False], ids=["rest to rest", "through a via point"])
@pytest.mark.parametrize("friction", [False, True], ids=["smooth", "friction"])
def test_torque_of_a_six_joint_arm_is_bounded_within_a_thousandth_in_a_thousand_boxes(
    rest: bool, friction: bool
) -> None:
    trajectory, plain = Trajectory(tag_to_tag(rest), JOINTS), torque(six_joint_arm(), friction)
    free = PathConstraint("torque", plain.expression, -np.full(6, 1e5), np.full(6, 1e5), plain.units, plain.labels)
    scan = np.abs(
        np.concatenate(
            [
                limit_on(trajectory, Requirements(JOINTS, ("rad",) * 6, (free,)), free, k, np.linspace(0.0, 1.0, SCAN))
                for k in range(trajectory.curve.segments)
            ],
            axis=1,
        )
    ).max(axis=1)
    # With the limit 5 % above its peak, each joint's tightness is one of the peak.
    limit = PathConstraint("torque", plain.expression, -1.05 * scan, 1.05 * scan, plain.units, plain.labels)
    rows = audit(trajectory, Requirements(JOINTS, ("rad",) * 6, (limit,)), tightness=0.95e-3).rows
    for row, peak in zip(rows, scan, strict=True):
        assert row.verdict == PROVED
        assert abs(row.proved_bound) >= peak * (1.0 - 1e-12)
        assert abs(row.proved_bound) <= 1.001 * abs(row.attained) <= 1.001 * peak * (1.0 + 1e-6)
        assert row.boxes <= 1000


def test_replaced_limits_are_not_audited_with_the_old_ones_compiled_expression() -> None:
    """Same id, another expression: what was compiled for the first must not prove the second."""
    curve = PiecewiseBezier(np.array([1.0]), (np.array([[0.0], [0.5]]),))
    motion = Trajectory(curve, ("a",))

    def limit(factor: float) -> PathConstraint:
        return PathConstraint("g", lambda s: factor * s.q * s.u, np.array([-1.0]), np.array([1.0]), ("rad",), ("a",))

    first = Requirements(("a",), ("rad",), (limit(1.0),))
    assert audit(motion, first).verdict == PROVED
    assert audit(motion, replace(first, path_constraints=(limit(100.0),))).verdict == VIOLATED
