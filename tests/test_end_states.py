"""What no variable moves, and what follows for the payload."""

from dataclasses import replace

import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.transcription.end_states import fixed_conflicts, fixed_values
from tests.closed_form import quintic_problem, septic_problem
from tests.independent.hybrid import FORCE
from tests.independent.robots import LINKS, G, HybridRobot

MOVED_BY_F3 = sum(mass for mass, _, _ in LINKS[1:])  # links 2, 3 and 4 hang on the lift [kg]


def test_a_rest_to_rest_quintic_has_its_end_states_fixed() -> None:
    """Velocity and acceleration at both ends, nothing else: two limits, two ends."""
    found = {(v.limit.id, v.segment, v.instant) for v in fixed_values(quintic_problem())}
    assert found == {(name, 0, u) for name in ("velocity-limit", "acceleration-limit") for u in (0.0, 1.0)}
    assert all(float(v.value([])) == 0.0 for v in fixed_values(quintic_problem()))


def test_fixed_rows_of_the_hybrid_robot_are_all_but_those_of_jerk(hybrid: Problem) -> None:
    found = [(v.limit.id, v.row, v.instant) for v in fixed_values(hybrid)]
    expected = [
        (limit.id, row, u)
        for u in (0.0, 1.0)
        for limit in hybrid.requirements.path_constraints
        if limit.id != "jerk-limit"
        for row in range(len(limit.labels))
    ]
    assert found == expected


@pytest.mark.parametrize("payload", [0.0, 7.0, 20.0])
def test_fixed_forces_equal_pinocchios_at_rest(hybrid: Problem, payload: float) -> None:
    machine = HybridRobot(payload)
    for fixed in fixed_values(hybrid):
        if fixed.limit.id == "effort-limit":
            via = hybrid.requirements.point_constraints[1].lower
            q = via[0] if fixed.instant == 0.0 else via[-1]
            expected = machine.effort(q, np.zeros(5), np.zeros(5))[fixed.row]
            assert float(fixed.value([payload])) == pytest.approx(expected, rel=1e-12, abs=1e-10)


def test_a_payload_of_13_kg_is_too_heavy_for_the_lift_by_what_statics_says() -> None:
    """F3 = -(38.475 + m_p) g at rest, 500 N allowed."""
    (conflict,) = fixed_conflicts(problems.load("hybrid-spline", payload=13.0))
    assert (conflict.row.limit, conflict.row.label, conflict.row.unit) == ("effort-limit", "F3", "N")
    assert MOVED_BY_F3 == pytest.approx(38.475, abs=1e-12)
    assert conflict.value == pytest.approx(-(MOVED_BY_F3 + 13.0) * G, rel=1e-13)
    assert conflict.bound == -500.0
    assert conflict.excess == pytest.approx((MOVED_BY_F3 + 13.0) * G - 500.0, rel=1e-10)
    assert "effort-limit F3" in str(conflict)


def test_the_largest_static_payload_is_12_5108_kg() -> None:
    """(38.475 + m_p) g <= 500 N; the paper's 12.65 kg would need 501.4 N."""
    largest = FORCE[2] / G - MOVED_BY_F3
    assert largest == pytest.approx(12.5108, abs=5e-5)
    assert fixed_conflicts(problems.load("hybrid-spline", payload=largest - 1e-6)) == ()
    assert len(fixed_conflicts(problems.load("hybrid-spline", payload=largest + 1e-6))) == 1
    (paper,) = fixed_conflicts(problems.load("hybrid-spline", payload=12.65))
    assert -paper.value == pytest.approx(501.4, abs=0.05)


def test_nothing_is_in_conflict_where_the_payload_is_itself_a_variable() -> None:
    assert fixed_conflicts(problems.load("hybrid-spline", payload=13.0, free_payload=True)) == ()


def test_conflicts_come_worst_first_one_a_row_with_both_sides_looked_at() -> None:
    """The end position 1 lies beyond 0.4 by 0.6; the start position 0 lies below 0.1; scales 0.15 each."""
    plain = quintic_problem()
    limits = (
        PathConstraint.on_derivative("low", 0, 0.1, np.inf, ("rad",), ("j",)),
        PathConstraint.on_derivative("high", 0, -np.inf, 0.4, ("rad",), ("j",)),
        PathConstraint.on_derivative("fine", 0, -1.0, 2.0, ("rad",), ("j",)),
    )
    found = fixed_conflicts(replace(plain, requirements=Requirements(("j",), ("rad",), limits)))
    assert [(c.row.limit, c.value, c.bound, c.row.instant) for c in found] == [
        ("high", 1.0, 0.4, 1.0),
        ("low", 0.0, 0.1, 0.0),
    ]
    assert [c.excess for c in found] == pytest.approx([0.6, 0.1])


def test_positions_are_fixed_where_the_control_points_beside_them_are_not() -> None:
    found = {(v.limit.id, v.instant, float(v.value([]))) for v in fixed_values(septic_problem())}
    assert found == {("position-limit", 0.0, 0.0), ("position-limit", 1.0, 0.7)}
