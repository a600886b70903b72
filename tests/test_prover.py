"""Path limits made by hand: what is proved, violated and undecided, the traps, and how tightly peaks are enclosed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import casadi
import numpy as np
import pytest

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError, KinkedExpression, ProblemDefinitionError, UnsupportedOperation
from ocp_traj.formulation.requirements import (
    PathConstraint,
    Requirements,
    State,
)
from ocp_traj.proof.audit import audit
from ocp_traj.proof.verdicts import ALLOWANCE, PROVED, UNDECIDED, VIOLATED, AuditRow
from ocp_traj.results.trajectory import Trajectory
from tests.attack import (
    exact_derivative,
)


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


@pytest.mark.slow
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


def test_a_peak_at_its_limit_is_proved_with_the_allowance_and_undecided_without() -> None:
    arch = (lambda s: casadi.sin(s.q[0]), -INF, 1.0, [1.0, 2.0, 2.2])
    assert audit_of(*arch).verdict == PROVED
    row = audit_of(*arch, allowance=0.0)
    assert row.verdict == UNDECIDED and row.boxes <= 400
    assert audit_of(lambda s: s.q[0], -INF, 0.7, [0.7, 0.7], order=0, allowance=0.0).verdict == PROVED  # no rounding
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
        assert row.proved_bound >= exact - abs(exact) * rounding
        assert math.isfinite(row.proved_bound) or exact > Fraction(10) ** 300
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
