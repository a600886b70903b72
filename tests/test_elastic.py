"""By how much limits in conflict have to give, and what is certain at given places."""

from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.rows import Row
from ocp_traj.formulation.scalarise import EpsilonConstraint
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.transcription.elastic import Elastic
from ocp_traj.transcription.nlp import NLP, Status

EXAMPLES = Path(__file__).parent.parent / "examples" / "tasks"
# The arm stretched out level in the middle: with 14 kg its shoulder cannot hold it as slowly as a cubic passes.
STRETCHED = [[0.0, -1.5, 1.5, -1.5, -1.5, 0.0], [0.3, 0.0, 0.0, 0.0, -1.5, 0.0], [0.6, -1.5, 1.5, -1.5, -1.5, 0.0]]


def _task(**changes: object) -> Problem:
    return ot.problems.load("task", file=str(EXAMPLES / "ur5-via.toml"), **changes)


@pytest.mark.slow
def test_what_a_time_has_to_give_is_what_the_shortest_motion_takes_beyond_it() -> None:
    problem = _task()
    least = ot.solve(problem).f
    solution = Multistart().solve(problem, EpsilonConstraint("effort", {"time": 2.0}))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    (conflict,) = (c for c in solution.conflicts if c.excess > 0.0)
    assert conflict.row.limit == "time" and conflict.excess == pytest.approx(least - 2.0, abs=1e-5)
    assert f"off by {least - 2.0:.3g} s, {50 * (least - 2.0):.3g} %" in solution.explain()
    held = {c.row.limit for c in solution.conflicts if c.excess == 0.0}
    assert held == {"acceleration-limit", "jerk-limit"}  # those that the shortest motion rests on


@pytest.mark.slow
def test_the_limit_that_a_payload_breaks_between_the_ends_is_named() -> None:
    solution = ot.solve(_task(**{"move.0.via": STRETCHED, "robot.payload.mass": 14.0}))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    (conflict,) = (c for c in solution.conflicts if c.excess > 0.0)
    assert (conflict.row.limit, conflict.row.label) == ("effort-limit", "shoulder_lift_joint")
    assert conflict.share == pytest.approx(conflict.excess / 150.0, rel=1e-8)
    assert "the one start found no trajectory; the nearest misses effort-limit" in solution.explain()


def test_one_amount_serves_all_rows_of_a_limit_and_its_bounds_on_variables() -> None:
    """x0 >= 3 and x1 / 10 >= 3 against one limit of 1, which is a row of x0 and a bound on x1."""
    x = ca.MX.sym("x", 2)
    names = ("A", "B", "top")
    rows = tuple(Row(name, "", unit="rad") for name in names)
    top = Row("top", "", unit="rad")
    nlp = NLP.symbolic(
        "small", x, x[0] ** 2, ca.vertcat(x[0], 0.1 * x[1], x[0]), lower_x=np.full(2, -np.inf),
        upper_x=np.array([np.inf, 10.0]), lower_g=np.array([3.0, 3.0, -np.inf]),
        upper_g=np.array([np.inf, np.inf, 1.0]), rows=rows, labels=("x0", "x1"), units=("rad", "rad"),
        bounds_as_rows=((1, 0.1, top),),
    )  # fmt: skip
    # One amount s of `top` serves both: least s + 2 (3 - 1 - s) within s <= 2, so s = 2 and A, B give none.
    found = {c.row.limit: c.excess for c in Ipopt().conflicts(nlp, np.zeros(2)) if c.excess > 0.0}
    assert found == pytest.approx({"top": 2.0}, abs=1e-5)
    elastic = Elastic(nlp)
    point = np.random.default_rng(0).normal(size=elastic.nlp.program.size)
    symbols = elastic.nlp.program.symbols
    values = ca.Function("values", [symbols[0]], [symbols[1], symbols[2]])
    f, g = elastic.nlp.program.values(point)
    assert f == pytest.approx(float(values(point)[0])) and g == pytest.approx(np.array(values(point)[1]).ravel())
    jacobian = ca.DM(elastic.nlp.program.jacobian_sparsity, elastic.nlp.program.jacobian(point))
    exact = ca.Function("jacobian", [symbols[0]], [ca.jacobian(symbols[2], symbols[0])])(point)
    assert np.abs(np.array(jacobian - exact)).max() <= 1e-14


@pytest.mark.slow
def test_what_given_points_break_is_certain() -> None:
    inner = [list(row) for row in STRETCHED]
    inner[1][2] = 7.0
    solution = ot.solve(_task(**{"move.0.via": inner}))
    assert solution.status is Status.INFEASIBLE and len(solution.conflicts) == 1
    conflict = solution.conflicts[0]
    assert (conflict.row.limit, conflict.row.label, conflict.value) == ("position-limit", "elbow_joint", 7.0)
    assert "each has to give at least what it is off by" in solution.explain()
    moves = [{"via": STRETCHED[:2]}, {"goal": STRETCHED[2]}]
    for mass, status in ((11.0, Status.SOLVED), (16.0, Status.INFEASIBLE)):  # at the stop, where the arm is at rest
        stopped = _task(**{"move": moves, "robot.payload.mass": mass, "curve.kind": "quintic"})
        found = ot.solve(replace(stopped, levels=None))
        assert found.status is status
    assert {c.row.limit for c in found.conflicts} == {"effort-limit"}
