"""NLP solvers on programs with a known answer: feasibility first, recomputed; then the value. And what IPOPT adds."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.solution import Solution
from ocp_traj.solvers import ipopt
from ocp_traj.solvers.fatrop import Fatrop
from ocp_traj.solvers.ipopt import Ipopt, matched_multipliers
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.nlp import NLP, Status
from ocp_traj.transcription.transcription import transcribe
from tests.closed_form import Septic, septic_problem, small_nlp, via_constraint

Rows = tuple[tuple[str, Callable[[Any], Any], float, float], ...]


@dataclass(frozen=True, eq=False)
class Known:
    """A program with a known minimum."""

    name: str
    f: Callable[[Any], Any]
    start: tuple[float, ...]
    optimum: tuple[float, ...]
    value: float
    rows: Rows = ()
    lower: float | np.ndarray = -np.inf
    upper: float | np.ndarray = np.inf

    @property
    def nlp(self) -> NLP:
        return small_nlp(len(self.start), self.f, self.rows, self.lower, self.upper)

    def excess(self, x: np.ndarray) -> float:
        """Largest excess over rows and bounds, by Python's own arithmetic."""
        rows = [max(low - g(x), g(x) - high) for _, g, low, high in self.rows]
        return float(max(0.0, *rows, *(self.lower - x), *(x - self.upper)))


KNOWN = (
    Known("Rosenbrock", lambda x: 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2, (-1.2, 1.0), (1.0, 1.0), 0.0),
    Known(
        "projection on a half-plane", lambda x: (x[0] - 2) ** 2 + (x[1] - 1) ** 2, (0.0, 0.0), (1.0, 0.0), 2.0,
        (("plane", lambda x: x[0] + x[1], -np.inf, 1.0),),
    ),
    Known(
        "least of a line over the disc", lambda x: x[0] + 2 * x[1], (0.3, 0.3), (-1 / 5**0.5, -2 / 5**0.5), -(5**0.5),
        (("disc", lambda x: x[0] ** 2 + x[1] ** 2, -np.inf, 1.0),),
    ),
    Known(
        "nearest point of a line", lambda x: x[0] ** 2 + x[1] ** 2, (3.0, -1.0), (0.5, 0.5), 0.5,
        (("line", lambda x: x[0] + x[1], 1.0, 1.0),),
    ),
    Known("at a bound", lambda x: (x[0] - 3) ** 2, (0.0,), (1.0,), 4.0, (), -5.0, 1.0),
    Known(
        "with a fixed variable", lambda x: (x[0] - x[1]) ** 2 + x[0], (0.0, 0.0), (1.5, 2.0), 1.75,
        (), np.array([-9.0, 2.0]), np.array([9.0, 2.0]),
    ),
    Known(  # Hock and Schittkowski (1981), no. 71; digits as printed there
        "Hock-Schittkowski 71", lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2], (1.0, 5.0, 5.0, 1.0),
        (1.0, 4.7429994, 3.8211503, 1.3794082), 17.0140173,
        (
            ("product", lambda x: x[0] * x[1] * x[2] * x[3], 25.0, np.inf),
            ("sphere", lambda x: x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2, 40.0, 40.0),
        ),
        1.0, 5.0,
    ),
)  # fmt: skip

TOL = Ipopt().tol
SOLVERS = {"mumps": Ipopt(), "spral": Ipopt(linear_solver="spral"), "fatrop": Fatrop()}

any_solver = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS.keys())


# --- optima ---


@any_solver
@pytest.mark.parametrize("case", KNOWN, ids=lambda case: case.name)
def test_known_optimum_is_reached(case: Known, solver: Ipopt | Fatrop) -> None:
    solution = solver.solve(case.nlp, np.array(case.start))
    assert solution.status is Status.SOLVED
    assert case.excess(solution.x) <= 100 * solver.tol
    assert solution.violation == pytest.approx(case.excess(solution.x), abs=1e-14)
    printed = 5e-8 if case.name.startswith("Hock") else 0.0  # half a unit of the last digit
    assert solution.f == pytest.approx(case.value, abs=100 * solver.tol * max(1.0, abs(case.value)) + printed)
    assert_allclose(solution.x, case.optimum, atol=solver.tol**0.5 + printed)
    assert solution.row_count == len(case.rows)


@any_solver
def test_least_jerk_between_rests_is_the_quintic(solver: Ipopt | Fatrop) -> None:
    """Two free control points of a septic; int jerk^2 dt = 720 D^2 / T^5."""
    case = Septic()
    points, value = case.optimum
    problem = septic_problem(case)
    nlp = transcribe(problem, WeightedSum({"jerk": 1.0}), few_instants(problem))
    solution = solver.solve(nlp, np.array([2.0, -2.0]))
    assert solution.status is Status.SOLVED
    assert_allclose(solution.x, points, rtol=100 * solver.tol)
    assert solution.f * 10.0 == pytest.approx(value, rel=100 * solver.tol)


@any_solver
def test_a_point_constraint_is_met_as_an_equality(solver: Ipopt | Fatrop) -> None:
    case = Septic()
    plain = septic_problem(case)
    problem = replace(
        plain,
        requirements=replace(plain.requirements, point_constraints=(via_constraint(0.5, 0.6),)),
    )
    nlp = transcribe(problem, WeightedSum({"jerk": 1.0}), few_instants(problem))
    solution = solver.solve(nlp, np.zeros(2)).require()
    weights = np.array([1, 7, 21, 35, 35, 21, 7, 1]) / 128  # B_i(1/2)
    points = np.array([0, 0, 0, *solution.x, 0.7, 0.7, 0.7])
    assert weights @ points == pytest.approx(0.6, abs=100 * TOL)
    assert solution.f * 10.0 > case.optimum[1]


@pytest.mark.parametrize(
    ("size", "value", "runs"),
    [
        (1.0, 1e-5, 2),  # a small objective: the tolerance is absolute, so it is solved for again, scaled
        (1e5, 1.0, 1),  # large variables alone make no objective small
        (1.0, 1.0, 1),
    ],
)
def test_only_a_small_objective_is_solved_for_again(
    size: float, value: float, runs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    nlp = small_nlp(1, lambda x: value * (1.0 + (x[0] / size - 1.0) ** 2))
    made, solver = [], ca.nlpsol
    monkeypatch.setattr(ca, "nlpsol", lambda *a, **k: made.append(a) or solver(*a, **k))
    solution = Ipopt().solve(nlp, np.array([0.3 * size]))
    assert len(made) == runs
    assert solution.x[0] == pytest.approx(size, rel=1e-4)


@any_solver
def test_a_start_outside_the_bounds_is_clipped_into_them(solver: Ipopt | Fatrop) -> None:
    nlp = small_nlp(1, lambda x: ca.log(x[0]) ** 2, (), 0.5, 3.0)  # not defined below zero
    solution = solver.solve(nlp, np.array([-7.0]))
    assert solution.x[0] == pytest.approx(1.0, abs=1e-6)


@any_solver
def test_slacks_and_multipliers_belong_to_their_rows(solver: Ipopt | Fatrop) -> None:
    """min (x0 - 2)^2 + (x1 - 1)^2: the active row has slack 0 and multiplier 2, the other its distance and 0."""
    nlp = small_nlp(
        2,
        lambda x: (x[0] - 2) ** 2 + (x[1] - 1) ** 2,
        (("active", lambda x: x[0] + x[1], -np.inf, 1.0), ("idle", lambda x: x[0], -1.0, 5.0)),
    )
    solution = solver.solve(nlp, np.zeros(2))
    by_name = {row.limit: (solution.slacks[row], solution.multipliers[row]) for row in nlp.rows}
    assert by_name["active"] == pytest.approx((0.0, 2.0), abs=1e-6)
    assert by_name["idle"] == pytest.approx((2.0, 0.0), abs=1e-6)


# --- statuses ---


def test_the_status_table_names_every_code_of_ipopts_header() -> None:
    """IpReturnCodes_inc.h, as CasADi ships it: a code left out would be FAILED without a reason."""
    header = Path(ca.__file__).parent / "include" / "coin-or" / "IpReturnCodes_inc.h"
    if not header.is_file():
        pytest.skip("this casadi comes without IPOPT's headers")
    block = header.read_text(encoding="utf-8").split("enum ApplicationReturnStatus")[1].split("}")[0]
    codes = re.findall(r"^\s*(\w+)\s*=\s*-?\d+", block, flags=re.MULTILINE)
    assert len(codes) >= 20
    assert set(ipopt._STATUS) == set(codes)


def test_only_success_is_called_solved() -> None:
    good = {name for name, status in ipopt._STATUS.items() if status.ok}
    assert good == {"Solve_Succeeded", "Solved_To_Acceptable_Level", "Feasible_Point_Found"}
    assert [name for name, status in ipopt._STATUS.items() if status is Status.SOLVED] == ["Solve_Succeeded"]


def test_an_unknown_status_is_failed_never_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ipopt, "_STATUS", {})
    solution = Ipopt().solve(KNOWN[1].nlp, np.zeros(2))
    assert solution.status is Status.FAILED
    with pytest.raises(NoSolutionFound, match="small: failed after .* iterations.*IPOPT: Solve_Succeeded"):
        solution.require()


def test_a_point_that_breaks_a_row_is_failed_whatever_ipopt_says() -> None:
    """With a loose constr_viol_tol IPOPT calls a point optimal that misses its row; we recompute and do not."""
    nlp = small_nlp(1, lambda x: x[0] ** 2, (("far", lambda x: x[0] ** 3, 1.0, 1.0),))
    loose = {"constr_viol_tol": 10.0, "acceptable_iter": 1, "acceptable_constr_viol_tol": 10.0, "acceptable_tol": 1e3}
    solution = Ipopt(options=loose).solve(nlp, np.array([3.0]))
    assert "Acceptable" in solution.detail
    assert solution.violation > 1e-7
    assert solution.status is Status.FAILED


@any_solver
def test_the_iteration_limit_is_reported_and_a_feasible_point_then_kept(solver: Ipopt | Fatrop) -> None:
    rosenbrock = KNOWN[0]
    feasible = solver.limited(3).solve(rosenbrock.nlp, np.array(rosenbrock.start))
    assert (feasible.status, feasible.iterations) == (Status.FEASIBLE, 3)
    hs71 = KNOWN[-1]
    infeasible = solver.limited(2).solve(hs71.nlp, np.array(hs71.start))
    assert infeasible.violation > 1e-7
    assert infeasible.status is Status.ITERATION_LIMIT
    assert not infeasible.ok


def test_the_time_limit_is_reported() -> None:
    solution = Ipopt(max_seconds=1e-9).solve(KNOWN[-1].nlp, np.array(KNOWN[-1].start))
    assert "WallTime" in solution.detail
    assert solution.status is Status.TIME_LIMIT


def test_an_unbounded_program_is_said_to_be_unbounded() -> None:
    solution = Ipopt(options={"diverging_iterates_tol": 1e6}).solve(small_nlp(1, lambda x: -(x[0] ** 3)), np.ones(1))
    assert solution.status is Status.UNBOUNDED


# --- conflicts ---


@pytest.mark.parametrize("scale", [1.0, 5.0])
def test_limits_in_conflict_are_named_with_the_amount_and_no_other(scale: float) -> None:
    """x >= 2 and x <= 1 miss each other by 1, however the least sum of excesses is shared between them."""
    nlp = small_nlp(
        2,
        lambda x: x[1] ** 2,
        (
            ("A", lambda x: x[0], 2.0, np.inf),
            ("B", lambda x: x[0], -np.inf, 1.0),
            ("C", lambda x: x[1] + 0.0 * x[0], -np.inf, 3.0),
        ),
        scale=scale,
    )
    solution = Ipopt().solve(nlp, np.zeros(2))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    assert {conflict.row.limit for conflict in solution.conflicts} == {"A", "B"}
    assert sum(conflict.excess for conflict in solution.conflicts) == pytest.approx(1.0 * scale, abs=1e-5 * scale)
    bounds = {conflict.row.limit: conflict.bound for conflict in solution.conflicts}
    assert bounds == {"A": 2.0 * scale, "B": 1.0 * scale}
    with pytest.raises(
        NoSolutionFound, match=r"small: the one start found no trajectory; the nearest misses [AB]: .*; [AB]: "
    ):
        solution.require()


def test_a_bound_on_a_variable_that_stands_in_the_way_is_named() -> None:
    nlp = small_nlp(1, lambda x: x[0], (("A", lambda x: x[0], 2.0, np.inf),), -5.0, 1.0)
    solution = Ipopt().solve(nlp, np.zeros(1))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    limit, variable = solution.conflicts
    assert (limit.row.limit, limit.bound) == ("A", 2.0)
    assert (limit.value, limit.excess) == pytest.approx((1.0, 1.0), abs=1e-6)
    assert (variable.row.limit, variable.row.label, variable.bound, variable.excess) == ("variable", "x0", 1.0, 0.0)
    assert "held at its bound 1 m" in str(variable)


def test_a_chain_of_limits_names_every_link() -> None:
    """x0 >= x1 + 1, x1 >= x2 + 1, x2 >= x0 - 1.5: round the chain they ask for 0 >= 0.5."""
    nlp = small_nlp(
        3,
        lambda x: ca.sumsqr(x),
        (
            ("one", lambda x: x[0] - x[1], 1.0, np.inf),
            ("two", lambda x: x[1] - x[2], 1.0, np.inf),
            ("three", lambda x: x[2] - x[0], -1.5, np.inf),
            ("loose", lambda x: x[0] + x[1], -9.0, 9.0),
        ),
    )
    solution = Ipopt().solve(nlp, np.zeros(3))
    assert solution.status is Status.LOCALLY_INFEASIBLE
    assert {c.row.limit for c in solution.conflicts} == {"one", "two", "three"}
    assert sum(c.excess for c in solution.conflicts) == pytest.approx(0.5, abs=1e-5)


# --- warm starts, repeatability ---


@pytest.fixture(scope="module")
def cost(hybrid: Problem) -> NLP:
    return transcribe(hybrid, WeightedSum({"cost": 1.0}), few_instants(hybrid))


def test_a_warm_start_takes_fewer_iterations_to_the_same_point(hybrid: Problem, cost: NLP) -> None:
    start = hybrid.guess(np.random.default_rng(0))
    cold = Ipopt().solve(cost, start).require()
    warm = Ipopt().solve(cost, cold.x, cold).require()
    same_point = Ipopt().solve(cost, cold.x).require()
    assert warm.iterations < same_point.iterations
    assert warm.iterations <= cold.iterations // 3
    assert warm.f == pytest.approx(cold.f, rel=100 * TOL)


def test_multipliers_are_matched_by_row(hybrid: Problem) -> None:
    problem = septic_problem()
    scalar = WeightedSum({"jerk": 1.0})
    instants = few_instants(problem)
    first, second = (transcribe(problem, scalar, chosen) for chosen in (instants[:3], instants[1:]))
    warm = Solution(
        "septic", np.zeros(2), 0.0, Status.SOLVED, 0.0, 1, 0.0, {row: i + 1.0 for i, row in enumerate(first.rows)}
    )
    assert_array_equal(matched_multipliers(second, warm), [2.0, 3.0] + [0.0] * (len(second.rows) - 2))


def test_the_same_solve_gives_the_same_bits(hybrid: Problem, cost: NLP) -> None:
    start = hybrid.guess(np.random.default_rng(1))
    one, two = (Ipopt().solve(cost, start) for _ in range(2))
    assert_array_equal(one.x, two.x)
    assert (one.f, one.iterations, list(one.multipliers.values())) == (
        two.f,
        two.iterations,
        list(two.multipliers.values()),
    )


@pytest.mark.parametrize("name", ["ma57", "MUMPS", ""])
def test_a_linear_solver_that_does_not_work_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"linear solver '{name}'; allowed are mumps, spral"):
        Ipopt(linear_solver=name)
