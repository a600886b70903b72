"""Limits that hold for all places along a link as well as at all times: proofs, attacks on them, and an NLP."""

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import pytest

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import KinkedExpression, ProblemDefinitionError
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.objective import Objective, gauss
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import SWEEP, PathConstraint, Requirements, State
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.proof.audit import audit
from ocp_traj.proof.values import limit_on, swept_on
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, VIOLATED
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.transcription.instants import Instant, few_instants
from ocp_traj.transcription.transcription import transcribe

JOINTS = ("A", "B")


def swept(expression: Any, upper: float, lower: float = -np.inf) -> Requirements:
    limit = PathConstraint(
        "swept", expression, np.array([lower]), np.array([upper]), ("-",), ("row",), "test", sweep=True
    )
    return Requirements(JOINTS, ("rad", "rad"), (limit,))


def moved(points: np.ndarray, durations: np.ndarray) -> Trajectory:
    return Trajectory(PiecewiseBezier(durations, tuple(points)), JOINTS)


def random_motion(rng: np.random.Generator, size: float = 1.0) -> Trajectory:
    segments, degree = rng.integers(1, 4), rng.integers(3, 7)
    return moved(size * rng.normal(size=(segments, degree + 1, 2)), np.exp(rng.uniform(-1.0, 1.0, segments)))


def scanned(trajectory: Trajectory, requirements: Requirements, times: int = 400, sweeps: int = 201) -> float:
    limit = requirements.path_constraints[0]
    grid = np.linspace(0.0, 1.0, times), np.linspace(0.0, 1.0, sweeps)
    return max(swept_on(trajectory, requirements, limit, k, *grid).max() for k in range(trajectory.curve.segments))


def link_and_disc(s: State) -> Any:
    """R^2 less the squared distance of a disc from a point of the second link of a planar arm."""
    elbow = casadi.vertcat(casadi.cos(s.q[0]), casadi.sin(s.q[0]))
    point = elbow + s.s * casadi.vertcat(casadi.cos(s.q[0] + s.q[1]), casadi.sin(s.q[0] + s.q[1]))
    return 0.04 - casadi.sumsqr(point - casadi.DM([1.2, 0.6]))


EXPRESSIONS = {
    "link and disc": link_and_disc,
    "product": lambda s: s.q[0] * casadi.sin(3.0 * s.s) + s.v[1] * s.s * (1.0 - s.s),
    "ends": lambda s: s.q[1] * (2.0 * s.s - 1.0) ** 2 + 0.1 * s.u * s.s,
    "wave": lambda s: casadi.sin(s.q[0] + 5.0 * s.s) * casadi.cos(s.q[1]),
}


# --- proofs ---


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPRESSIONS)
@pytest.mark.parametrize("seed", range(6))
def test_no_scan_contradicts_an_audit(name: str, seed: int) -> None:
    """Bounds at, above and below the largest value of a scan: what is proved is not found broken, and the reverse."""
    rng = np.random.default_rng(seed)
    motion = random_motion(rng)
    top = scanned(motion, swept(EXPRESSIONS[name], 1e9))
    for relative in (1e-1, 1e-3, 1e-6, 1e-9, 0.0, -1e-6, -1e-3, -1e-1):
        requirements = swept(EXPRESSIONS[name], top + relative * max(abs(top), 0.1))
        (row,) = audit(motion, requirements).rows
        bound = row.bound
        assert row.attained <= row.proved_bound
        assert row.proved_bound >= top - 1e-12 * max(1.0, abs(top))
        if top > bound + 1e-9:
            assert row.verdict == VIOLATED and row.attained > bound
            assert row.sweep is not None and 0.0 <= row.sweep <= 1.0
            if np.abs(motion.curve.knots - row.instant).min() > 1e-9:  # where motions jump, either side is meant
                (k,), u = motion.curve.locate(row.instant)
                value = swept_on(motion, requirements, requirements.path_constraints[0], int(k), u, [row.sweep])
                assert value.ravel()[0] == pytest.approx(row.attained, abs=1e-8 * max(1.0, abs(top)))
        if row.verdict == PROVED:
            assert top <= bound + 1e-12 * max(1.0, abs(bound))
        if relative >= 1e-3:
            assert row.verdict == PROVED


def test_no_tightness_is_asked_for_that_rounding_cannot_give() -> None:
    motion = random_motion(np.random.default_rng(0))
    row = audit(motion, swept(EXPRESSIONS["product"], 100.0), tightness=0.0).rows[0]
    assert row.verdict == PROVED and row.boxes < 2000


@pytest.mark.parametrize("sweep", [True, False])
def test_a_row_without_bounds_has_no_row_in_the_audit(sweep: bool) -> None:
    none, some = np.array([-np.inf, -9.0]), np.array([np.inf, 9.0])
    limit = PathConstraint("limit", lambda s: s.q[:2] * s.u, none, some, ("-",) * 2, ("free", "kept"), sweep=sweep)
    motion = random_motion(np.random.default_rng(0))
    assert [row.label for row in audit(motion, Requirements(JOINTS, ("rad", "rad"), (limit,))).rows] == ["kept"]


def test_maxima_inside_on_edges_and_at_corners_are_enclosed_tightly() -> None:
    """q runs from 0 to 1 linearly: maxima are known."""
    motion = moved(np.array([[[0.0, 0.0], [1.0, 1.0]]]), np.array([2.0]))
    known = {
        "inside": (lambda s: 1.0 - (s.q[0] - 0.3) ** 2 - (s.s - 0.7) ** 2, 1.0),
        "edge": (lambda s: s.s - (s.q[0] - 0.3) ** 2, 1.0),
        "corner": (lambda s: s.s + 2.0 * s.q[0], 3.0),
        "saddle": (lambda s: (s.q[0] - 0.5) * (s.s - 0.5), 0.25),
    }
    for name, (expression, top) in known.items():
        (row,) = audit(motion, swept(expression, top + 1e-5)).rows
        assert row.verdict == PROVED and row.boxes < 2000, (name, row)
        assert top <= row.proved_bound <= top + 1e-3 * (top + 1.0)
        (row,) = audit(motion, swept(expression, top - 1e-5)).rows
        assert row.verdict == VIOLATED, (name, row)


def test_both_sides_are_looked_at() -> None:
    motion = moved(np.array([[[0.0, 0.0], [1.0, 1.0]]]), np.array([2.0]))
    for lower, upper, verdict in ((-0.26, 0.26, PROVED), (-0.24, 0.26, VIOLATED), (-0.26, 0.24, VIOLATED)):
        (row,) = audit(motion, swept(lambda s: (s.q[0] - 0.5) * (s.s - 0.5), upper, lower)).rows
        assert row.verdict == verdict


def test_what_is_undefined_or_too_much_is_not_proved() -> None:
    motion = moved(np.array([[[0.0, 0.0], [1.0, 1.0]]]), np.array([1.0]))
    (row,) = audit(motion, swept(lambda s: casadi.sqrt(s.s - 0.5), 10.0)).rows
    assert row.verdict == UNDECIDED
    (row,) = audit(motion, swept(link_and_disc, 0.0), max_arcs=10).rows
    assert row.verdict in (UNDECIDED, VIOLATED)
    with pytest.raises(KinkedExpression):
        audit(motion, swept(lambda s: casadi.fabs(s.s - 0.5), 10.0))
    with pytest.raises(ProblemDefinitionError, match="has no sweep"):
        PathConstraint("x", lambda s: s.q, np.zeros(2), np.ones(2), ("-",) * 2, JOINTS, order=0, sweep=True)


# --- samples ---


def test_samples_take_the_worst_place_along_the_sweep() -> None:
    rng = np.random.default_rng(1)
    motion, requirements = random_motion(rng), swept(link_and_disc, 0.0)
    limit, u = requirements.path_constraints[0], np.linspace(0.0, 1.0, 9)
    whole = swept_on(motion, requirements, limit, 0, u, SWEEP)
    assert np.array_equal(limit_on(motion, requirements, limit, 0, u), whole.max(axis=2))


# --- an arm past a disc ---


@dataclass(frozen=True)
class Plain:
    """A case without fields."""


def arm() -> Problem:
    """Two links of 1 m from one posture to another in a given time, past a disc: least integral of squared speeds."""
    start, goal = np.array([-0.6, 0.9]), np.array([0.9, 0.6])

    def curve(x: Any) -> PiecewiseBezier:
        rows = [casadi.SX(start).T] * 3 + [x[:2].T, x[2:].T] + [casadi.SX(goal).T] * 3
        return PiecewiseBezier(casadi.SX(np.array([2.0])), (casadi.vertcat(*rows),))

    limit = PathConstraint(
        "clearance", link_and_disc, np.array([-np.inf]), np.zeros(1), ("m2",), ("disc",), "test", sweep=True
    )
    bounds = np.full(4, 8.0)
    return Problem(
        id="arm", case=Plain(),
        variables=(Variable("P", -bounds, bounds, "rad", ("a", "b", "c", "d")),),
        curve=curve,
        objectives=(
            Objective("speed", "rad2/s", integrand=lambda s: casadi.sumsqr(s.v), quadrature=gauss(8)),
        ),
        requirements=Requirements(JOINTS, ("rad", "rad"), (limit,)),
        guess=lambda r: r.normal(size=4), tuning=Tuning(instants=16),
    )  # fmt: skip


@pytest.mark.slow
def test_an_exchange_ends_with_the_whole_link_proved_clear() -> None:
    problem = arm()
    found = Exchange(first=few_instants(problem)).solve(
        problem, WeightedSum({"speed": 1.0}), np.array([0.0, 4.0, 0.2, 4.0])
    )
    assert found.audit is not None and found.audit.proved, found.explain()
    assert found.trajectory is not None and found.rounds <= 10
    assert scanned(found.trajectory, problem.requirements, 1500, 401) <= 0.0
    (row,) = [r for r in found.audit.rows if r.limit == "clearance"]
    assert row.margin < 1e-6 and row.sweep is not None and 0.0 < row.sweep < 1.0  # it is the link that passes closest


def test_an_instant_that_moves_along_the_sweep_alone_is_one_that_moves() -> None:
    problem, x = arm(), np.array([0.0, 4.0, 0.2, 4.0])
    sliding = Instant("clearance", 0, 0.5, (0,), sweep=0.5, sweep_slope=np.full(4, 0.1), anchor=x)
    assert sliding.moves and not Instant("clearance", 0, 0.5, (0,)).moves
    nlp = transcribe(problem, WeightedSum({"speed": 1.0}), [*few_instants(problem), sliding])
    (row,) = [j for j, row in enumerate(nlp.rows) if (row.instant, row.sweep) == (0.5, 0.5)]
    lam = casadi.DM.zeros(len(nlp.rows))
    lam[row] = 1.0
    symbolic = casadi.Function("g", [nlp.x], [nlp.g, casadi.triu(casadi.hessian(nlp.g[row], nlp.x)[0])])
    for y in (x, x + 0.3):
        g, bend = symbolic(y)
        assert nlp.program.values(y)[1] == pytest.approx(np.array(g).ravel(), abs=1e-14)
        found = casadi.DM(nlp.program.hessian_sparsity, nlp.program.hessian(y, 0.0, np.array(lam).ravel()))
        assert np.array(found) == pytest.approx(np.array(casadi.densify(bend)), abs=1e-12)


def test_rows_and_population_know_the_sweep() -> None:
    problem = arm()
    instants = few_instants(problem)
    assert {i.sweep for i in instants} == {0.0, 0.25, 0.5, 0.75, 1.0}
    nlp = transcribe(problem, WeightedSum({"speed": 1.0}), instants)
    assert len(set(nlp.rows)) == len(nlp.rows) == len(instants)
    x = np.array([0.0, 4.0, 0.2, 4.0])
    limit, motion = problem.requirements.path_constraints[0], trajectory_of(problem, x)
    direct = swept_on(motion, problem.requirements, limit, 0, np.linspace(0.0, 1.0, 5), SWEEP).max()
    assert Population(problem, ["speed"], 5).evaluate(x).violations[0, 0] * limit.scale[0] == pytest.approx(direct)
