"""NLP solvers are exchangeable: another one solves a problem, and only a solver's own file knows its options."""

import ast
import re
from collections.abc import Iterator

import casadi as ca
import numpy as np
import pytest

from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.fatrop import Fatrop
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.transcription import transcribe
from tests.closed_form import small_nlp
from tests.test_imports import modules

COST = WeightedSum({"cost": 1.0})


@pytest.mark.slow
def test_another_solver_ends_at_the_optimum_that_ipopt_ends_at(hybrid: Problem) -> None:
    nlp = transcribe(hybrid, WeightedSum({"time": 1.0}), few_instants(hybrid))
    start = hybrid.guess(np.random.default_rng(0))
    one, other = (solver.solve(nlp, start).require() for solver in (Ipopt(), Fatrop()))
    assert "IPOPT" in one.detail and "FATROP" in other.detail
    assert other.f == pytest.approx(one.f, rel=10 * Fatrop().tol)
    np.testing.assert_allclose(other.x, one.x, rtol=1e-4)
    assert other.violation <= 1e-12  # bounds are drawn in by what FATROP relaxes them
    active = {row for row, multiplier in one.multipliers.items() if abs(multiplier) > 1e-3}
    assert active == {row for row, multiplier in other.multipliers.items() if abs(multiplier) > 1e-3} != set()


@pytest.mark.slow
def test_exchange_proves_what_another_solver_finds(hybrid: Problem) -> None:
    solution = Multistart(Exchange(solver=Fatrop()), starts=2).solve(hybrid, COST)
    assert solution.audit is not None and solution.audit.proved and "FATROP" in solution.detail
    assert solution.f == pytest.approx(Multistart(Exchange(), starts=2).solve(hybrid, COST).f, rel=1e-7)


def test_a_solver_near_its_start_stays_where_the_usual_one_leaves() -> None:
    """A row of wells 0.004 wide, deeper ones farther from the bound; the start is at the bottom of the first."""
    nlp = small_nlp(1, lambda x: (x[0] - 1.0) ** 2 - 0.01 * ca.cos(500.0 * ca.pi * x[0]), (), 0.0, 3.0)
    for solver in (Ipopt(), Fatrop()):
        usual, near = (s.solve(nlp, np.array([0.004])).x[0] for s in (solver, solver.near_start()))
        assert abs(near - 0.004) < 2e-4 and usual > 0.006


def test_fatrop_says_no_more_than_it_knows() -> None:
    apart = (("A", lambda x: x[0], 2.0, np.inf), ("B", lambda x: x[0], -np.inf, 1.0))
    found = Fatrop().solve(small_nlp(1, lambda x: x[0] ** 2, apart), np.zeros(1))
    assert found.status is Status.FAILED and found.violation >= 0.5 - 1e-6
    unbounded = Fatrop().solve(small_nlp(1, lambda x: -(x[0] ** 3)), np.ones(1))
    assert not unbounded.ok


def strings(tree: ast.AST) -> Iterator[str]:
    """String constants, but for those that a problem gives as ``solver_options``, by the solver's name."""
    if isinstance(tree, ast.keyword) and tree.arg == "solver_options":
        return
    if isinstance(tree, ast.Constant) and isinstance(tree.value, str):
        yield tree.value
    for child in ast.iter_child_nodes(tree):
        yield from strings(child)


def test_no_other_module_names_an_option_of_ipopt(capfd: pytest.CaptureFixture[str]) -> None:
    x = ca.MX.sym("x")
    asked = {"print_options_documentation": "yes", "print_advanced_options": "yes", "sb": "yes"}
    ca.nlpsol("printer", "ipopt", {"x": x, "f": x**2}, {"print_time": False, "ipopt": asked})(x0=1.0)
    names = set(re.findall(r"^([a-z]\w+) ", capfd.readouterr().out, flags=re.MULTILINE))
    assert len(names) > 200 and {"mu_init", "tol", "warm_start_init_point"} <= names
    found = {name: names & set(strings(ast.parse(path.read_text("utf-8")))) for name, path in modules().items()}
    assert found.pop("ocp_traj.solvers.ipopt") > {"mu_init", "bound_push"}
    found.pop("ocp_traj.solvers.fatrop")  # some of its own have the same names
    found.pop("ocp_traj.formulation.knot_states")  # what ``Tuning`` says to a solver about curves of many knots
    assert {name: options for name, options in found.items() if options} == {}
