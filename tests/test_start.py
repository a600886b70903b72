"""Solves that begin at an earlier result: where it is read, on which level, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.curve_variables import variables_of
from ocp_traj.formulation.knot_states import knot_states
from ocp_traj.robot.joint_limits import JointLimits
from tests.test_additions import ARM, LIMITS, MOVE


def _load(**curve: object) -> ot.Problem:
    return ot.problems.load("task", robot=ARM, limits=LIMITS, curve=curve or {"kind": "quintic"}, move=MOVE)


@pytest.fixture(scope="module")
def coarse() -> ot.Solution:
    return ot.solve(_load())


@pytest.fixture(scope="module")
def fine() -> ot.Solution:
    return ot.solve(_load(kind="auto", finest=4))


@pytest.mark.slow
def test_what_is_optimal_stays_so_at_its_own_level(fine: ot.Solution, coarse: ot.Solution) -> None:
    again = ot.solve(_load(kind="auto", finest=4), start=fine.trajectory)
    assert again.audit is not None and again.audit.proved and again.starts == 1
    assert again.f == pytest.approx(fine.f, rel=1e-8) and again.iterations < fine.iterations
    assert again.x.size == fine.x.size > coarse.x.size


@pytest.mark.slow
def test_a_curve_of_few_pieces_starts_one_of_many(fine: ot.Solution, coarse: ot.Solution) -> None:
    found = ot.solve(_load(kind="quintic", pieces=4), start=coarse.trajectory)
    assert found.audit is not None and found.audit.proved
    assert found.f == pytest.approx(fine.f, rel=1e-6) and found.f < coarse.f - 0.05


@pytest.mark.parametrize("dwells", [{}, {1: 0.3}, {2: 0.1}, {1: 0.3, 2: 0.1}])
def test_cut_pieces_are_the_same_motion(dwells: dict[int, float]) -> None:
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 2))
    limits = JointLimits(velocity=[1.0] * 2, acceleration=[4.0] * 2, jerk=[40.0] * 2)
    few, many = (knot_states(points, limits, pieces=pieces, dwells=dwells) for pieces in (2, 6))
    curve = few.curve(few.guess(np.random.default_rng(0)))
    again = many.curve(variables_of(many, curve))
    assert again.segments == curve.segments + 12 and again.duration == pytest.approx(float(curve.duration), rel=1e-14)
    t = np.linspace(0.0, float(curve.duration) * (1.0 - 1e-12), 301)
    for order in range(3):
        np.testing.assert_allclose(again(t, order), curve(t, order), rtol=0.0, atol=1e-9)


@pytest.mark.slow
def test_it_begins_at_a_file_of_the_command_line_and_through_other_points(coarse: ot.Solution, tmp_path: Path) -> None:
    assert coarse.trajectory is not None
    file = coarse.trajectory.save(tmp_path / "t.json")
    moved = [{"via": [MOVE[0]["via"][0], [0.62, 1.2, -1.6], MOVE[0]["via"][2]]}]
    task = ot.Task(robot=ARM, limits=LIMITS | {"velocity": 1.5}, curve={"kind": "quintic"}, move=moved)
    found = ot.solve(ot.problems.load("task", task=task), start=file)
    assert found.audit is not None and found.audit.proved and found.f > coarse.f
    assert run(["solve", "rotor-353", "--start", str(file)]) == 2


@pytest.mark.slow
def test_it_begins_at_the_best_point_of_a_run(tmp_path: Path) -> None:
    problem = _load()
    front = ot.pareto(problem, ["time", "acceleration"], points=3, output=tmp_path / "run")
    assert [point["time [s]"] for point in front.table.to_dict("records")] == sorted(front.table["time [s]"])
    found = ot.solve(problem, objective="acceleration", start=tmp_path / "run")
    assert found.f <= front.table["acceleration [s]"].min() * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_published_problem_begins_at_its_own_trajectory(fastest: ot.Solution) -> None:
    problem = ot.problems.load("hybrid-spline", payload=8.5)
    found = ot.solve(problem, objective="time", start=fastest.trajectory)
    assert found.audit is not None and found.audit.proved and found.starts == 1


@pytest.mark.slow
def test_what_does_not_fit_is_refused_with_the_reason(
    fine: ot.Solution, coarse: ot.Solution, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = _load()
    with pytest.raises(InputError, match="the trajectory is no start of task: it has 8 segments, and curves of this"):
        ot.solve(problem, start=fine.trajectory)
    with pytest.raises(InputError, match="rotor-353.*its joints are .*'joint1'"):
        ot.solve(ot.problems.load("rotor-353"), start=coarse.trajectory)
    with pytest.raises(InputError, match="a start is for the method exchange; pso makes its own"):
        ot.solve(problem, start=coarse.trajectory, method="pso")
    with pytest.raises(InputError, match="give a start or starts, not both"):
        ot.solve(problem, start=coarse.trajectory, starts=2)
    with pytest.raises(InputError, match="give a start or all_optima, not both"):
        ot.solve(problem, start=coarse.trajectory, all_optima=True)
    with pytest.raises(InputError, match="takes no start; give it to one of its alternatives"):
        ot.solve(ot.problems.load("wrist-obstacle"), start=coarse.trajectory)
    with pytest.raises(InputError, match="is solved by parts in this case, and takes no start"):
        ot.solve(ot.problems.load("rotor-353", timing="per_joint"), start=coarse.trajectory)
    capsys.readouterr()
    assert run(["solve", "rotor-353", "--start", str(tmp_path / "none.json")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_a_run_of_a_refined_task_is_opened_at_the_level_it_was_traced_at(tmp_path: Path) -> None:
    problem = _load(kind="auto", finest=2)
    front = ot.pareto(problem, ["time", "energy"], points=3, output=tmp_path / "run")
    again = ot.load_run(tmp_path / "run")
    assert front.problem.size == again.problem.size > problem.size
    assert again.table.equals(front.table) and all(point.verdict == "proved" for point in again.points)
    found = ot.solve(problem, objective="energy", start=tmp_path / "run")
    assert found.f <= front.table["energy [W2 s]"].min() * (1.0 + 1e-6) and found.x.size == again.problem.size
