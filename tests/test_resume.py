"""A run that was stopped is gone on with to the bytes of one that was not, and refused where it is another one."""

import json
from pathlib import Path
from typing import Any

import pytest

from ocp_traj.cli.commands import run
from ocp_traj.io.journal import Journal, records
from ocp_traj.io.resume import RESULTS, differences, is_finished
from ocp_traj.io.run_reader import load_run

LINE = ["tests.test_workers:arm", "--objectives", "time,effort", "--points", "7", "--reference", "3.5,90"]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("resume") / "whole"
    assert run(["pareto", *LINE, "-o", str(folder)]) == 0
    return folder


def killed(whole: Path, folder: Path, kept: int, **changes: Any) -> Path:
    """What a run leaves that is killed after so many records."""
    folder.mkdir()
    asked = json.loads((whole / "run.json").read_text())
    asked = {name: value for name, value in asked.items() if name not in RESULTS} | changes
    (folder / "run.json").write_text(json.dumps(asked))
    journal = Journal(folder / "journal.jsonl")
    for record in records(whole / "journal.jsonl")[:kept]:
        journal.append(record)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0, 1, 4, 7, 8])
def test_a_killed_run_is_gone_on_with_to_the_same_bytes(
    whole: Path, tmp_path: Path, kept: int, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = killed(whole, tmp_path / "run", kept)
    assert not is_finished(folder)
    assert run(["resume", str(folder)]) == 0
    said = capsys.readouterr().err
    assert (f"{kept} finished solves" in said) or kept in (0, 4, 7, 8)
    assert (folder / "front.csv").read_bytes() == (whole / "front.csv").read_bytes()
    manifests = [json.loads((one / "run.json").read_text()) for one in (whole, folder)]
    assert manifests[0]["hypervolume"] == manifests[1]["hypervolume"]
    assert manifests[0]["hypervolume"]["reference"] == {"time": 3.5, "effort": 90.0}
    keys = [record["key"] for record in records(folder / "journal.jsonl") if record.get("key")]
    assert len(keys) == len(set(keys)) and len(load_run(folder)) == 7


def test_a_finished_run_is_left_alone(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (whole / "journal.jsonl").read_bytes()
    assert run(["resume", str(whole)]) == 0
    assert "has ended by itself; there is nothing left to do" in capsys.readouterr().err
    assert (whole / "journal.jsonl").read_bytes() == before


@pytest.mark.slow
def test_what_is_left_of_a_budget_is_used(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = killed(whole, tmp_path / "run", 4, budget=600.0)
    assert run(["resume", str(folder)]) == 0
    assert "s of its budget are left; where that ends it depends on the machine" in capsys.readouterr().err
    folder = killed(whole, tmp_path / "short", 4, budget=1e-3)
    assert run(["resume", str(folder)]) == 2
    assert "is used up; run it again with a larger one" in capsys.readouterr().err
    assert len(records(folder / "journal.jsonl")) == 4


@pytest.mark.slow
def test_other_versions_are_told_and_their_work_is_done_again(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    versions = json.loads((whole / "run.json").read_text())["versions"]
    folder = killed(whole, tmp_path / "run", 4, versions={**versions, "casadi": "3.0.0"})
    assert run(["resume", str(folder)]) == 0
    assert "it was begun with casadi 3.0.0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("problem", "words"), [("mine", "there is no problem 'mine'; where it is one of your own"), ("", "no problem")]
)
def test_a_problem_that_nobody_can_build_is_refused(
    whole: Path, tmp_path: Path, problem: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = killed(whole, tmp_path / "run", 4, problem=problem)
    assert run(["resume", str(folder)]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


def test_what_is_no_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["resume", str(tmp_path / "nothing")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_differences_have_their_places() -> None:
    old = {"limits": {"jerk": 60.0, "velocity": [1.0, 2.0]}, "name": "a"}
    new = {"limits": {"jerk": 50.0, "velocity": [1.0, 3.0]}, "name": "a", "more": 1}
    assert differences(old, old) == []
    assert differences(old, new) == [
        "limits.jerk was 60.0 and is 50.0", "limits.velocity was [1.0, 2.0] and is [1.0, 3.0]", "more was None and is 1"
    ]  # fmt: skip


TASK = """
format = "ocp-traj/task/1"
name = "hand"

[robot]
description = "ur5"
tool_frame = "tool0"

[limits]
velocity = 1.5
acceleration = 4.0
jerk = "none"

[curve]
kind = "quintic"
pieces = 1

[[move]]
start = [0.0, -1.2, 1.2, 0.0, 0.0, 0.0]
goal = [0.4, -1.0, 1.0, 0.0, 0.2, 0.0]

[objective]
minimise = "time"
"""


@pytest.mark.slow
def test_a_task_file_that_has_changed_is_refused_with_the_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from ocp_traj import problems
    from ocp_traj.io.store import request

    file, folder = tmp_path / "task.toml", tmp_path / "run"
    file.write_text(TASK)
    problem = problems.load("task", file=str(file))
    asked = request(problem, ["time", "movement"], "trace", seed=0, task={"file": str(file), "changes": {}})
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps(asked))
    file.write_text(TASK.replace("acceleration = 4.0", "acceleration = 5.0"))
    assert run(["resume", str(folder)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "limits.acceleration was" in error
    assert json.loads((folder / "run.json").read_text()) == asked
