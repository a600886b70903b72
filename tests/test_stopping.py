"""Ctrl-C and budgets: obeyed soon, in every method, with what there is; the caller's handlers are put back."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import casadi
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.errors import NoSolutionFound
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.progress import Progress
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.branch_and_bound import BranchAndBound
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.stopping import OutOfTime, stopping
from ocp_traj.transcription.nlp import NLP
from tests.closed_form import quintic_problem, small_nlp
from tests.test_branch_and_bound import small_problem

TIME = WeightedSum({"time": 1.0})
BOTH = ["time", "effort"]
SMALL = {"population": 20, "generations": 10}


@pytest.fixture(autouse=True)
def _python_handles_ctrl_c() -> Iterator[None]:
    """Where the tests run in the background the shell has it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def ctrl_c_at(call: int) -> Progress:
    """Presses Ctrl-C when progress is told for the ``call``-th time."""
    told: list[object] = []

    def progress(*words: object) -> None:
        told.append(words)
        if len(told) == call:
            signal.raise_signal(signal.SIGINT)

    return progress


def long_program() -> tuple[Ipopt, NLP, np.ndarray]:
    """An NLP that takes IPOPT many minutes: a chain of Rosenbrock's valleys, to a tolerance it cannot reach."""
    size = 60
    options = {"hessian_approximation": "limited-memory", "acceptable_tol": 1e-300, "dual_inf_tol": 1e-300}
    solver = Ipopt(tol=1e-300, max_iter=10**8, options=options)
    nlp = small_nlp(size, lambda x: casadi.sumsqr(10.0 * (x[1:] - x[:-1] ** 2)) + casadi.sumsqr(1.0 - x[:-1]))
    return solver, nlp, np.random.default_rng(0).normal(size=size)


# --- inside a solve ---


def test_ctrl_c_stops_ipopt_after_the_iteration_it_comes_in() -> None:
    solver, nlp, x0 = long_program()
    sent: list[float] = []

    def press() -> None:
        sent.append(time.perf_counter())
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    timer = threading.Timer(0.3, press)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        solver.solve(nlp, x0)
    assert time.perf_counter() - sent[0] < 1.0


def test_ipopt_stops_when_its_time_is_over() -> None:
    solver, nlp, x0 = long_program()
    begun = time.perf_counter()
    with pytest.raises(OutOfTime), stopping(0.3):
        solver.solve(nlp, x0)
    assert time.perf_counter() - begun < 2.0


# --- solve ---


def test_solve_returns_the_best_of_the_starts_that_ended_and_says_how_many() -> None:
    """Of the first wave the others have ended too: they are given up without a solve."""
    found = ot.solve(quintic_problem(), objective="time", starts=5, certify=False, progress=ctrl_c_at(1))
    assert found.ok and found.audit is not None and found.audit.proved
    assert found.interrupted == "after 4 of 5 starts"


def test_solve_raises_where_no_start_has_ended() -> None:
    with pytest.raises(KeyboardInterrupt):
        ot.solve(quintic_problem(), objective="time", starts=1, certify=False, progress=ctrl_c_at(1), seed=3)


@pytest.mark.parametrize("method", ["pso", "ga"])
def test_no_further_start_of_a_population_is_begun(method: str) -> None:
    found = ot.solve(
        quintic_problem(), objective="time", method=method, starts=9, progress=ctrl_c_at(14), **SMALL
    )  # of 10 generations each
    assert found.interrupted == "after 1 of 9 starts"


def test_no_further_alternative_is_begun() -> None:
    one = quintic_problem()
    problem = replace(one, alternatives={"left": quintic_problem(), "right": quintic_problem()})
    found = ot.solve(problem, objective="time", starts=5, certify=False, progress=ctrl_c_at(1))
    assert list(found.alternatives) == ["left"]
    assert found.interrupted == "after 4 of 5 starts of left, before right"


def test_an_interrupted_certificate_keeps_the_solution_and_the_bound_so_far() -> None:
    problem = small_problem(0)
    found = ot.solve(problem, starts=1, certify=False)
    certified = BranchAndBound(tolerance=1e-12, progress=ctrl_c_at(5)).improve(problem, TIME, found)
    assert certified.x is found.x
    assert certified.interrupted
    assert certified.certificate is not None and 0.0 < certified.certificate.lower < certified.certificate.upper


# --- pareto ---


@pytest.mark.parametrize(
    ("method", "options", "call", "ended"),
    [
        ("trace", {"points": 20}, 7, "5 of 20 points"),
        ("nsga2", {"population": 20, "generations": 50}, 9, "9 of 50 generations"),
        ("mopso", {"population": 20, "generations": 50}, 9, "9 of 50 generations"),
        ("hmoga", {"points": 6, "population": 20, "generations": 50}, 9, "9 of 50 generations"),
        ("hmoga", {"points": 6, "population": 20, "generations": 5}, 7, "refining 2 of 4 points"),
    ],
)
def test_pareto_returns_what_it_has_and_says_how_much(
    method: str, options: dict[str, int], call: int, ended: str
) -> None:
    front = ot.pareto(quintic_problem(), BOTH, method=method, progress=ctrl_c_at(call), **options)
    assert front.info["interrupted"] is True
    assert front.info["ended after"] == ended
    assert len(front) > 1 and all(point.verdict == "proved" for point in front.points)


def test_pareto_without_a_point_is_an_empty_front() -> None:
    def at_once(problem: Problem) -> Problem:
        return replace(problem, guess=lambda rng: (signal.raise_signal(signal.SIGINT), np.array([3.0]))[1])

    front = ot.pareto(at_once(quintic_problem()), BOTH, points=5)
    assert len(front) == 0 and front.info["interrupted"] is True


def test_a_front_of_alternatives_says_which_are_missing() -> None:
    problem = replace(quintic_problem(), alternatives={"left": quintic_problem(), "right": quintic_problem()})
    front = ot.pareto(problem, BOTH, points=9, progress=ctrl_c_at(7))
    assert front.info["interrupted"] is True
    assert front.info["ended after"] == "5 of 9 points of left, nothing of right"


@pytest.mark.parametrize("method", ["hmoga", "nsga2", "mopso"])
def test_a_budget_that_ends_before_anything_is_found_is_one_line(method: str) -> None:
    with pytest.raises(NoSolutionFound, match="within its budget; give it more|0 of them were run before their time"):
        ot.pareto(quintic_problem(), BOTH, method=method, budget=1e-9)


def test_a_front_that_its_budget_ends_says_how_much_there_is() -> None:
    front = ot.pareto(quintic_problem(), BOTH, points=1000, budget=1.5)
    assert front.info["interrupted"] is False
    assert front.info["ended after"] == f"{len(front)} of 1000 points"


# --- handlers ---


def test_a_second_ctrl_c_is_obeyed_at_once() -> None:
    with pytest.raises(KeyboardInterrupt), stopping():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        pytest.fail("it went on")


def test_ctrl_c_nobody_was_told_of_is_delivered_at_the_end() -> None:
    done = []
    with pytest.raises(KeyboardInterrupt), stopping():
        signal.raise_signal(signal.SIGINT)
        done.append("the rest of the block")
    assert done


def test_a_handler_of_the_caller_s_is_left_alone() -> None:
    received: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: received.append(number))
    with stopping() as stop:
        signal.raise_signal(signal.SIGINT)
        assert received == [signal.SIGINT] and not stop.interrupted
    signal.signal(signal.SIGINT, signal.default_int_handler)


def test_another_thread_may_solve() -> None:
    found: list[Solution] = []
    worker = threading.Thread(target=lambda: found.append(ot.solve(quintic_problem(), objective="time", certify=False)))
    worker.start()
    worker.join()
    assert found[0].ok
