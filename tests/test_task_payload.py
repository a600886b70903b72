"""The payload of tasks: the largest, as an objective, and in a trajectory's file."""

import json
from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.symbolic import evaluate_objectives, motion_of

EXAMPLE = Path(__file__).parent.parent / "examples" / "tasks" / "ur5-via.toml"


def _task(**changes: object) -> Problem:
    return ot.problems.load("task", file=str(EXAMPLE), **changes)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["cubic", "quintic", "retime"])
def test_the_time_of_a_freed_payload_is_the_curves(kind: str) -> None:
    problem = _task(**{"curve.kind": kind, "free_payload": True, **({"curve.pieces": 1} if kind == "retime" else {})})
    x = problem.guess(np.random.default_rng(0))
    assert problem.labels[-1] == "payload" and x[-1] > 0.0
    assert evaluate_objectives(problem, x)["time"] == pytest.approx(float(motion_of(problem, x).curve.duration))


@pytest.mark.slow
def test_the_largest_payload_is_that_whose_shortest_motion_takes_the_time(tmp_path: Path) -> None:
    problem = _task()
    found = ot.payload(problem, max_time=3.5)
    static = ot.payload(problem)
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    assert found.payload < static.payload and f"no time law carries more than {static.payload:.6g} kg" in found.argument
    assert found.argument.startswith("the largest found")
    assert found.trajectory.duration <= 3.5
    shortest = ot.solve(_task(**{"robot.payload.mass": found.payload}))
    assert shortest.f == pytest.approx(3.5, rel=1e-6)
    again = ot.Trajectory.load(found.trajectory.save(tmp_path / "t.json"))
    assert again.audit().proved and again.parameters["payload"] == found.payload


@pytest.mark.slow
def test_the_command_finds_it_along_a_trajectory_and_writes_one_that_is_proved(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moved, carrying = tmp_path / "moved.json", tmp_path / "carrying.json"
    assert run(["solve", str(EXAMPLE), "-o", str(moved)]) == 0
    capsys.readouterr()
    assert run(["payload", str(EXAMPLE), "--along", str(moved), "-o", str(carrying), "--json"]) == 0
    mass = json.loads(capsys.readouterr().out)["payload"]
    assert 3.0 < mass < 17.8 and run(["audit", str(carrying)]) == 0
    data = json.loads(carrying.read_text())
    assert data["parameters"]["payload"] == mass
    data["parameters"]["payload"] = data["case"]["payload"] = mass + 0.01
    carrying.write_text(json.dumps(data))
    assert run(["audit", str(carrying)]) == 1


def test_without_limits_on_effort_there_is_no_largest_payload() -> None:
    with pytest.raises(InputError, match="no limit depends on the payload"):
        ot.payload(_task(**{"limits.effort": "none"}), max_time=4.0)


@pytest.mark.slow
def test_a_freed_payload_is_an_objective_and_weighs_against_the_others() -> None:
    with pytest.raises(InputError, match="payload_mass is one where free_payload = true"):
        _task(**{"objective.minimise": "payload_mass"})
    problem = _task(**{"objective.minimise": {"time": 1.0, "payload_mass": 2.0}, "free_payload": True})
    x = problem.guess(np.random.default_rng(1))
    values = evaluate_objectives(problem, x)
    assert values["cost"] == pytest.approx(values["time"] - 2.0 * values["payload_mass"] / 10.0)
    assert problem.reference_point["payload_mass"] == 0.0


@pytest.mark.slow
def test_a_front_of_time_against_payload() -> None:
    front = ot.pareto(_task(free_payload=True), ["time", "payload_mass"], points=5)
    table = front.table.sort_values("time [s]")
    assert len(table) == 5 and table["payload_mass [kg]"].is_monotonic_increasing
    assert (table["verdict"] == "proved").all()
