"""Every method tells of its finished work, in records that a front can be made of again."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ocp_traj.evolution import evolution
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, WeightedSum
from ocp_traj.io.run_reader import load_run
from ocp_traj.io.store import Run, request
from ocp_traj.results.records import Record, of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.results.solution_records import of_solution, solution_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_tracer import FrontTracer
from ocp_traj.solvers.hmoga import HMOGA
from ocp_traj.solvers.mopso import MOPSO
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.solvers.waves import TOGETHER
from tests.closed_form import Quintic, quintic_problem, stairs_problem

PAIR = ["time", "effort"]


@pytest.fixture(scope="module")
def quintic() -> Problem:
    return quintic_problem()


def xs(record: Record) -> list[list[float]]:
    return [point["x"] for point in record["points"]]


def test_a_solve_is_recorded_so_that_it_need_not_be_done_again(quintic: Problem) -> None:
    asked = EpsilonConstraint("time", {"effort": 1e4}, 1e-6)  # the limits bind
    solution = Exchange().solve(quintic, asked, np.array([3.0]))
    record = json.loads(json.dumps(of_solve(asked, solution)))
    (point,) = record["points"]
    assert (np.array(point["x"]) == solution.x).all() and point["objectives"] == solution.objectives
    told = dict(record["scalarisation"])
    assert told.pop("kind") == "EpsilonConstraint" and EpsilonConstraint(**told) == asked
    assert (record["status"], point["verdict"], record["f"]) == ("SOLVED", "proved", solution.f)
    again = solution_of(record["solution"], quintic)
    assert of_solution(again) == of_solution(solution) and repr(again.audit) == repr(solution.audit)
    for name, value in vars(solution).items():
        if name not in ("trajectory", "history") and not isinstance(value, np.ndarray | tuple):
            assert repr(getattr(again, name)) == repr(value), name
    assert again.trajectory is not None and solution.trajectory is not None
    assert again.trajectory.to_dict() == solution.trajectory.to_dict()


def test_a_failed_solve_is_recorded_and_is_no_point_of_the_front(tmp_path: Path) -> None:
    slow = quintic_problem(Quintic(velocity=0.1))
    failed = Exchange().solve(slow, WeightedSum({"time": 1.0}), np.array([3.0]))
    assert not failed.ok
    with Run(tmp_path / "run", request(slow, ["time", "effort"], "trace")) as run:
        run.found(of_solve(WeightedSum({"time": 1.0}), failed))
        assert len(load_run(tmp_path / "run", slow)) == 0


def test_a_run_that_was_stopped_has_its_points_by_time_scaling(tmp_path: Path) -> None:
    problem, names = stairs_problem(), ["time", "first", "second"]
    with Run(tmp_path / "run", request(problem, names, "trace")) as run:
        found = FrontTracer(points=4, starts=1, found=run.found).pareto(problem, names)
    stopped = load_run(tmp_path / "run", problem)  # of the journal: no front was written
    assert found.info["points by time scaling"] > found.info["solves"]
    assert len(stopped) > found.info["solves"] + 0.9 * found.info["points by time scaling"]
    assert {x.tobytes() for x in found.xs} <= {point.x.tobytes() for point in stopped.points}


# --- of each method ---


@pytest.mark.parametrize("objectives", [["time", "first"], ["time", "first", "second"]])
def test_trace_tells_of_each_solve_once_it_is_proved_with_a_few_others(
    objectives: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[Any] = []
    solve = Exchange.solve

    def solving(self: Exchange, *arguments: Any, **options: Any) -> Solution:
        solution = solve(self, *arguments, **options)
        events.append(solution.x.tolist())
        return solution

    monkeypatch.setattr(Exchange, "solve", solving)
    dilated: list[list[float]] = []

    def tell(record: Record) -> None:
        if record["kind"] == "solve":
            events.append(xs(record))
        elif record["kind"] == "points":
            dilated.extend(xs(record))

    found = FrontTracer(points=6, starts=1, found=tell).pareto(stairs_problem(), objectives)
    solved, told = ([e for e in events if isinstance(e[0], list) is record] for record in (False, True))
    assert sorted(told) == sorted([x] for x in solved) and len(told) == found.info["solves"]
    # None waits for more than so many others to be proved with it.
    before = [sum(isinstance(e[0], float) for e in events[: events.index([x])]) for x in solved]
    assert all(later - place <= TOGETHER for place, later in enumerate(before, 1))
    assert all([x.tolist()] in told or x.tolist() in dilated for x in found.xs)
    assert bool(dilated) == (len(objectives) == 3)


def test_hmoga_tells_of_its_ends_its_population_and_each_refined_point(quintic: Problem) -> None:
    told: list[Record] = []
    found = HMOGA(0, points=5, population=20, generations=5, found=told.append).pareto(quintic, PAIR)
    kinds = [record["kind"] for record in told if record["kind"] != "start"]
    ends = found.info["ends"]["solves"]
    assert kinds == ["solve"] * ends + ["population"] + ["solve"] * found.info["solves"]
    assert found.info["solves"] >= 3


@pytest.mark.parametrize("method", [NSGA2(1, 20, 6), MOPSO(1, 20, 6)], ids=["nsga2", "mopso"])
def test_a_population_is_told_of_now_and_then_and_at_the_end(
    quintic: Problem, monkeypatch: pytest.MonkeyPatch, method: Any
) -> None:
    for every, least in ((60.0, 1), (0.0, 4)):
        told: list[Record] = []
        monkeypatch.setattr(evolution, "EVERY", every)
        monkeypatch.setattr(evolution, "SHARE", every)
        found = replace(method, found=told.append).pareto(quintic, PAIR)
        assert xs(told[-1]) == [x.tolist() for x in found.xs]
        assert least <= len(told) <= (7 if least > 1 else 1)
