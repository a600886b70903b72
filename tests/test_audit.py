"""What an audit checks beside path limits, and what it says on the whole."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import casadi
import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import InputError, ProblemDefinitionError
from ocp_traj.formulation.requirements import (
    ORDERS,
    DurationConstraint,
    ParameterBound,
    PathConstraint,
    PointConstraint,
    Requirements,
)
from ocp_traj.proof import prover as prover_module
from ocp_traj.proof.audit import audit, audit_all
from ocp_traj.proof.verdicts import CHECKED, PROVED, UNDECIDED, VIOLATED, Audit, AuditRow
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.results.trajectory import trajectory_of as of_vector
from tests.attack import (
    between,
    derivatives,
)

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
        knot = derivatives(rng, 2)
        other = knot.copy()
        other[order, 1] += size * max(1.0, abs(knot[order, 1]))
        ends = derivatives(rng, 2), derivatives(rng, 2)
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
    assert verdicts([9.0, 0.5 * (1.0 + 1.5e-9), 2.0], 0.0) == [VIOLATED, CHECKED, CHECKED]  # 1e-9 of it is allowed
    assert verdicts([9.0, 0.50001, 2.1], -1e-9) == [VIOLATED] * 3
    assert verdicts([9.0, 0.5, 2.0], math.nan) == [CHECKED, CHECKED, VIOLATED]
    with pytest.raises(InputError, match="on segment 1; the trajectory has segments 0 to 0"):
        audit(Trajectory(PiecewiseBezier([1.0], points[:1]), ("a",), parameters={"payload": 0.0}), requirements)
    with pytest.raises(ProblemDefinitionError, match="0 <= lower <= upper"):
        DurationConstraint("weld-time", (0,), np.array([2.0]), np.array([1.0]))
    with pytest.raises(ProblemDefinitionError, match=r"'mass'; parameters are \[\]"):
        Requirements(("a",), ("m",), (), parameter_bounds=(ParameterBound("mass", 0.0, 1.0, "kg"),))


# --- The whole --------------------------------------------------------------------------------------------------------


def test_verdict_of_the_whole_is_the_worst() -> None:
    row = AuditRow("limit", "row", "m", 1.0, 0.5, 0.0, 0.5, 0.5, PROVED, 1)
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
    assert (nothing.verdict, nothing.margin) == (UNDECIDED, math.inf) and "ask nothing" in nothing.explain()


@pytest.mark.slow
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
                if a.verdict == CHECKED:
                    assert a.attained == pytest.approx(b.attained, abs=1e-12)
                    continue
                sign = math.copysign(1.0, a.bound)
                for x, y in ((a.attained, b.proved_bound), (b.attained, a.proved_bound)):
                    assert sign * x <= sign * y + 1e-12
    assert {a.verdict for a in alone} == {PROVED, VIOLATED}
    assert audit_all([], problem.requirements) == []


def test_limits_on_derivatives_are_audited_together_as_alone() -> None:
    """In whatever order they come, and one of them on some segments only."""
    problem = problems.load("hybrid-spline")
    limits = [c for c in problem.requirements.path_constraints if c.order is not None][::-1]
    limits[1] = replace(limits[1], segments=(1, 2))
    rng = np.random.default_rng(10)
    trajectories = [of_vector(problem, problem.guess(rng)) for _ in range(3)]
    together = audit_all(trajectories, replace(problem.requirements, path_constraints=tuple(limits)))
    rows = [[row for row in found.rows if row.boxes] for found in together]
    alone = [audit_all(trajectories, replace(problem.requirements, path_constraints=(limit,))) for limit in limits]
    assert rows == [[row for audits in alone for row in audits[k].rows if row.boxes] for k in range(3)]
    assert {row.limit for row in rows[0]} == {limit.id for limit in limits}


def test_a_limit_on_segments_that_no_trajectory_has_is_refused() -> None:
    problem = problems.load("hybrid-spline")
    limits = [c for c in problem.requirements.path_constraints if c.order is not None]
    limits[1] = replace(limits[1], segments=(99,))
    with pytest.raises(ProblemDefinitionError, match=r"'velocity-limit' is for the segments \(99,\)"):
        audit(
            of_vector(problem, problem.guess(np.random.default_rng(0))),
            replace(problem.requirements, path_constraints=tuple(limits)),
        )


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


def test_replaced_limits_are_not_audited_with_the_old_ones_compiled_expression() -> None:
    """Same id, another expression: what was compiled for the first must not prove the second."""
    curve = PiecewiseBezier(np.array([1.0]), (np.array([[0.0], [0.5]]),))
    motion = Trajectory(curve, ("a",))

    def limit(factor: float) -> PathConstraint:
        return PathConstraint("g", lambda s: factor * s.q * s.u, np.array([-1.0]), np.array([1.0]), ("rad",), ("a",))

    first = Requirements(("a",), ("rad",), (limit(1.0),))
    assert audit(motion, first).verdict == PROVED
    assert audit(motion, replace(first, path_constraints=(limit(100.0),))).verdict == VIOLATED
