"""The audit attacked at random: whatever a dense scan or code that shares nothing with it finds lies in its bounds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from itertools import islice
from typing import Any

import casadi
import mpmath
import numpy as np
import pinocchio as pin
import pytest

from benchmarks.audit import JOINTS, six_joint_arm, tag_to_tag, torque
from ocp_traj.arrays import Array
from ocp_traj.formulation.requirements import (
    PathConstraint,
    Requirements,
)
from ocp_traj.proof.audit import audit, audit_all
from ocp_traj.proof.values import limit_on
from ocp_traj.proof.verdicts import ALLOWANCE, PROVED, UNDECIDED, VIOLATED
from ocp_traj.results.trajectory import Trajectory
from tests.attack import (
    CURVES,
    MISSES,
    SCAN,
    Attack,
    Scan,
    attack,
    exact_derivative,
    instants,
)
from tests.random_robots import random_robot


@pytest.mark.slow
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


@pytest.mark.slow
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
