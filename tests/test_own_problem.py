"""A problem that is in no registry can do what a registered one can."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import ocp_traj as ot
from examples import hand_movements as fifth_paper
from examples import own_robot
from ocp_traj.cli.commands import run
from ocp_traj.cli.sheets import problem_sheet
from ocp_traj.errors import InputError
from ocp_traj.formulation import registry
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.io.export import trajectory_table
from ocp_traj.results.trajectory import case_fields
from tests.closed_form import Quintic, quintic_problem


@dataclass(frozen=True)
class WithNumbers:
    """A case with a field that has to be given, and one that holds an array."""

    distance: float
    bounds: np.ndarray = field(default_factory=lambda: np.ones(2))


CASES: dict[str, tuple[Any, dict[str, Any]]] = {
    "none": (None, {}),
    "a dictionary": ({"distance": 1.0}, {}),
    "defaults": (Quintic(), {}),
    "a field changed": (Quintic(velocity=3.0), {"velocity": 3.0}),
    "a field that has to be given": (WithNumbers(1.0), {"distance": 1.0}),
    "an array": (WithNumbers(1.0, np.array([1.0, 2.0])), {"distance": 1.0, "bounds": [1.0, 2.0]}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_case_of_any_kind_is_solved_audited_and_shown(name: str) -> None:
    case, expected = CASES[name]
    problem = replace(quintic_problem(), case=case)
    assert case_fields(problem) == expected
    solution = ot.solve(problem)
    assert solution.trajectory is not None and dict(solution.trajectory.case) == expected
    assert solution.trajectory.audit().proved
    assert problem_sheet(problem).tables


def test_solution_front_and_table_know_their_problem() -> None:
    problem = quintic_problem()
    front = ot.pareto(problem, ["time", "effort"], points=3)
    assert len(front) == 3 and all(front.audit(i).proved for i in range(3))
    assert list(trajectory_table(front.trajectory(0), 2).columns[:3]) == ["time [s]", "j q [rad]", "j v [rad/s]"]
    with pytest.raises(InputError, match="quintic has no payload"):
        ot.payload(problem)
    with pytest.raises(InputError, match="quintic has no objective 'payload_mass': give it the payload as a variable"):
        ot.payload(problem, max_time=1.0)


@pytest.mark.parametrize("name", ["v tape", "v proof", "v order", "expression"])
def test_names_of_limits_do_not_collide_with_what_is_kept_of_others(name: str) -> None:
    base = quintic_problem(velocity_limit="v")
    bound = PathConstraint(name, lambda s: casadi.sin(s.q[0]), np.array([-1.0]), np.array([1.0]), ("-",), ("j",))
    problem = _with(base, bound)
    solution = ot.solve(problem)
    assert solution.audit is not None and solution.audit.proved
    assert {row.limit for row in solution.audit.rows} >= {"v", name}


def _with(problem: Problem, *limits: PathConstraint) -> Problem:
    old = problem.requirements
    more = (*limits, *(replace(limit) for limit in old.path_constraints))
    return replace(problem, requirements=Requirements(old.joints, old.joint_units, more, old.point_constraints))


# --- registered by a user ---


@pytest.fixture
def fifth(monkeypatch: pytest.MonkeyPatch) -> None:
    """A paper's file, registered for one test."""
    monkeypatch.setattr(registry, "_registered", {})
    ot.register("hand-movements", fifth_paper.build, fifth_paper.Case)


@pytest.mark.slow
def test_another_paper_is_one_file_and_one_line(fifth: None, tmp_path: Path, capsys: Any) -> None:
    assert ot.problems.names()[-1] == "hand-movements"
    assert run(["solve", "hand-movements", "--set", "goal=0.1,0.1", "-o", str(tmp_path / "t.json")]) == 0
    assert run(["audit", str(tmp_path / "t.json")]) == 0
    assert run(["problems", "--json"]) == 0 and "hand movements of least jerk" in capsys.readouterr().out
    assert run(["export", str(tmp_path / "t.json"), "--format", "csv"]) == 0
    assert "x jerk [m/s3]" in (tmp_path / "t.export.csv").read_text()
    problem = ot.problems.load("hand-movements")
    case = problem.case
    exact = 0.5 * 720.0 * float(np.sum(np.subtract(case.goal, case.start) ** 2)) / case.duration**5
    assert ot.solve(problem).objectives["jerk"] == pytest.approx(exact, rel=1e-8)
    with pytest.raises(InputError, match="hand-movements: goal is 'a,b'; give 2 numbers"):
        ot.problems.load("hand-movements", goal="a,b")
    with pytest.raises(InputError, match="duration is -1.0 s; give a finite number above zero"):
        ot.problems.load("hand-movements", duration=-1.0)
    with pytest.raises(InputError, match="there is a problem 'hand-movements' already"):
        ot.register("hand-movements", fifth_paper.build, fifth_paper.Case)


def test_problems_of_other_packages_appear_by_their_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_of_other_packages", lambda: {"hand-movements": "examples.hand_movements"})
    assert "hand-movements" in ot.problems.names()
    assert type(ot.problems.load("hand-movements").case) is fifth_paper.FlashHogan1985
    assert registry.GROUP == "ocp_traj.problems"


def test_public_names_are_all_there() -> None:
    for name in ot._PUBLIC:
        assert getattr(ot, name) is not None
    assert {"Problem", "Variable", "Objective", "PathConstraint", "PointConstraint", "standard", "audit"} <= set(
        dir(ot)
    )


# --- a robot and a path of one's own ---

OWN = "examples.own_robot:build"


@pytest.mark.slow
def test_an_own_robot_in_35_lines_does_all_that_a_papers_does(tmp_path: Path) -> None:
    lines = Path(str(own_robot.__file__)).read_text().splitlines()
    assert sum(bool(line.strip()) for line in lines) <= 35
    problem = own_robot.build()
    orders = ("position-limit", "velocity-limit", "acceleration-limit", "jerk-limit", "effort-limit")
    assert list(problem.requirements.ids) == [*orders, "rest", "via"]
    solution = ot.solve(problem)
    assert solution.trajectory is not None and solution.trajectory.audit().proved
    knots = solution.trajectory.curve.knots[[0, 2, 3, 4, 5, 7]]
    assert solution.trajectory.curve(knots) == pytest.approx(own_robot.VIA, abs=1e-9)
    assert ot.plot_trajectory(solution.trajectory, problem.requirements, tmp_path / "t.png").stat().st_size

    front = ot.pareto(problem, ["time", "effort"], points=3)
    assert front.values[:, 0].min() == pytest.approx(solution.objectives["time"], rel=1e-6)
    run_folder = ot.save_run(front, tmp_path / "run")
    for again in (ot.load_run(run_folder), ot.load_run(run_folder, problem=problem)):
        assert np.array_equal(again.values, front.values) and again.audit(0).proved
    assert ot.plot_front(again, tmp_path / "front.png").stat().st_size
    table = ot.export(run_folder, "csv", tmp_path / "front.csv").path.read_text()
    assert table.startswith("point,time [s],effort [s],h1 [s]")
    samples = ot.export(run_folder / "trajectories" / "000.json", "csv", tmp_path / "t.csv").path.read_text()
    assert "shoulder_pan_joint jerk [rad/s3]" in samples


def test_a_problem_by_module_and_function_is_loaded_with_its_case(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    def without_case() -> Problem:
        return quintic_problem()

    monkeypatch.setattr(fifth_paper, "without_case", without_case, raising=False)
    assert ot.problems.load("examples.hand_movements:without_case").id == "quintic"
    assert ot.problems.load(OWN, payload=1).case == own_robot.Case(1.0)
    assert ot.problems.load("examples.hand_movements:build", duration=1.0).case.duration == 1.0
    assert OWN not in ot.problems.names() and ot.problems.known(OWN)
    with pytest.raises(InputError, match="has no case field 'mass'"):
        ot.problems.load(OWN, mass=1.0)
    assert run(["show", OWN]) == 0 and "Gauss, exact to degree 19" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("id", "words"),
    [
        ("mine", "and any module:function that makes one"),
        ("tests:", "and any module:function that makes one"),
        (":build", "and any module:function that makes one"),
        ("..tests:build", "and any module:function that makes one"),
        ("nowhere.at_all:build", "No module named 'nowhere'"),
        ("examples.own_robot:built", "has no attribute 'built'"),
        ("os:abort", "makes no problem; give a function that is annotated"),
        ("examples.own_robot:Case", "makes no problem"),
    ],
)
def test_what_is_no_function_that_makes_a_problem_is_not_called(id: str, words: str) -> None:
    assert not ot.problems.known(id)
    with pytest.raises(InputError, match=words):
        ot.problems.load(id)


@pytest.mark.slow
def test_the_run_of_a_problem_that_no_id_finds_says_how_to_load_it(tmp_path: Path) -> None:
    problem = quintic_problem()
    folder = ot.save_run(ot.pareto(problem, ["time", "effort"], points=3), tmp_path / "run")
    assert len(ot.load_run(folder, problem)) == 3
    with pytest.raises(InputError, match="load_run.folder, problem., or make its id an importable 'module:function'"):
        ot.load_run(folder)
