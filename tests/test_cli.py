"""The command line: what it prints, what it writes, and how it refuses."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from ocp_traj import problems
from ocp_traj.cli.commands import run
from ocp_traj.problems import hybrid_spline
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.solvers.methods import FRONT, SOLVE, options_from_text

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(capfd: pytest.CaptureFixture[str]) -> Call:
    """Runs a command line; gives exit code, stdout, stderr."""

    def calling(*arguments: str | Path) -> tuple[int, str, str]:
        code = run([str(a) for a in arguments])
        captured = capfd.readouterr()
        return code, captured.out, captured.err

    return calling


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Table 7's trajectory, as a file."""
    problem = problems.load("hybrid-spline")
    return trajectory_of(problem, hybrid_spline.TABLE_7).save(tmp_path_factory.mktemp("saved") / "table7.json")


def one_line(err: str) -> str:
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    assert "Traceback" not in err
    return lines[0]


def test_problems_lists_every_registered_problem(call: Call) -> None:
    code, out, err = call("problems", "--json")
    assert (code, err) == (0, "")
    assert [entry["id"] for entry in json.loads(out)["problems"]] == list(problems.names())
    assert "hybrid-spline" in call("problems")[1]


def test_show_names_every_limit_with_bounds_unit_and_equation(call: Call) -> None:
    code, out, _ = call("show", "hybrid-spline", "--json")
    sheet = json.loads(out)
    assert code == 0
    force = [row for row in sheet["limits"] if row["id"] == "effort-limit"]
    assert [row["upper"] for row in force] == [500.0, 500.0, 500.0, 17.0, 17.0]
    assert {row["eq"] for row in sheet["limits"]} == {"(118)", "(119)", "(120)", "(121)", "(122)", "below (4)"}
    assert all(row["unit"] for row in sheet["limits"])
    table = call("show", "hybrid-spline", "--set", "payload=7.25")[1]
    assert "7.25" in table and "jerk-limit" in table


@pytest.mark.slow
def test_solve_prints_writes_and_proves(call: Call, tmp_path: Path) -> None:
    target, picture = tmp_path / "fast.json", tmp_path / "fast.png"
    code, out, err = call("solve", "hybrid-spline", "--json", "-o", target, "--plot", picture)
    found = json.loads(out)
    assert code == 0
    assert set(found) >= {"problem", "status", "objectives", "units", "variables", "seconds", "audit"}
    assert found["objectives"]["cost"] == pytest.approx(2.550568, abs=1e-5)
    assert found["audit"]["verdict"] == "proved"
    assert {"limit", "label", "bound", "attained", "instant", "margin", "verdict"} <= set(found["audit"]["rows"][0])
    assert "proved" in err and str(target) in err
    assert picture.read_bytes().startswith(b"\x89PNG")
    again = Trajectory.load(target)
    np.testing.assert_allclose(again.variables["h"], found["variables"]["h"])
    code, out, _ = call("audit", target, "--json")
    assert code == 0 and json.loads(out)["verdict"] == "proved"


SUM = (("time", 0.6, 1.0), ("energy", 0.2, 1000.0), ("jerk", 0.1, 10.0), ("acceleration", 0.1, 1.0))  # (112)


@pytest.mark.slow
def test_case_fields_and_weights_change_the_problem(call: Call) -> None:
    weighted = json.loads(call("solve", "hybrid-spline", "--set", "weights=0.6,0.2,0.1,0.1", "--json")[1])
    summed = json.loads(
        call(
            "solve", "hybrid-spline", "--weight", "time=0.6", "--weight", "energy=0.2", "--weight", "jerk=0.1",
            "--weight", "acceleration=0.1", "--json",
        )[1]
    )  # fmt: skip
    assert weighted["objectives"]["cost"] == pytest.approx(
        sum(w * summed["objectives"][name] / scale for name, w, scale in SUM), rel=1e-8
    )
    assert weighted["objectives"]["time"] < 4.98  # more weight on time than the paper's 0.3 gives


@pytest.mark.slow
def test_same_seed_same_answer(call: Call) -> None:
    answers = [json.loads(call("solve", "hybrid-spline", "--seed", "5", "--json")[1]) for _ in range(2)]
    assert answers[0]["variables"] == answers[1]["variables"]


@pytest.mark.slow
def test_payload_for_every_time_law_and_along_a_trajectory(call: Call, saved: Path, tmp_path: Path) -> None:
    code, out, _ = call("payload", "hybrid-spline", "--json")
    found = json.loads(out)
    assert code == 0 and found["payload"] == pytest.approx(500.0 / 9.80665 - 38.475, abs=1e-9)  # F3 at rest
    assert found["binding"] == "effort-limit F3" and found["instant"] == 0.0
    target = tmp_path / "loaded.json"
    code, out, _ = call("payload", "hybrid-spline", "--along", saved, "--json", "-o", target)
    found = json.loads(out)
    assert code == 0 and found["payload"] == pytest.approx(11.88, abs=0.005)
    assert found["instant"] == pytest.approx(0.33, abs=1e-6)
    assert call("audit", target)[0] == 0


@pytest.mark.slow
def test_payload_within_a_time_lies_between_the_trajectory_and_the_static_bound(call: Call) -> None:
    found = json.loads(call("payload", "hybrid-spline", "--max-time", "6.19", "--json")[1])
    assert 11.88 < found["payload"] < 12.5108 and found["verdict"] == "proved"
    faster = json.loads(call("payload", "hybrid-spline", "--max-time", "3", "--json")[1])
    assert faster["payload"] < found["payload"]


def test_audit_of_a_violated_trajectory_exits_1_and_says_where(call: Call, tmp_path: Path) -> None:
    problem = problems.load("hybrid-spline", payload=12.0)
    heavy = trajectory_of(problem, hybrid_spline.TABLE_7).save(tmp_path / "heavy.json")
    code, _, err = call("audit", heavy)
    assert code == 1
    assert re.search(r"effort-limit F3 violated: -501.*t = 0.33", one_line(err))


def test_pareto_writes_a_run_and_never_overwrites_it(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    arguments = ["pareto", "hybrid-spline", "--objectives", "time,energy", "--points", "3", "-o", str(folder), "--json",
                 "--reference", "8,6000", "--ideal", "2.4836,1565.2"]  # fmt: skip
    code, out, err = call(*arguments)
    found = json.loads(out)
    assert code == 0 and found["points"] == 3 and 0.3 < found["hypervolume"]["value"] < 0.75
    assert str(folder / "front.png") in err
    table = pd.read_csv(folder / "front.csv")
    assert [c for c in table.columns if "[" in c][:4] == [
        "time [s]", "energy [N2 m2/s]", "jerk [(m2+rad2)/s5]", "acceleration [(m2+rad2)/s3]",
    ]  # fmt: skip
    assert (table["verdict"] == "proved").all() and (table["margin"] > -1e-9).all()
    assert sorted(p.name for p in folder.iterdir()) == [
        "front.csv", "front.png", "journal.jsonl", "run.json", "trajectories",
    ]  # fmt: skip
    assert call("audit", folder / "trajectories" / "000.json")[0] == 0
    exported = tmp_path / "front.parquet"
    assert call("export", folder, "--format", "parquet", "-o", exported)[0] == 0
    assert len(pd.read_parquet(exported)) == 3
    code, out, err = call(*arguments)
    assert code == json.loads(out)["exit_code"] == 2 and "--force" in one_line(err)
    evolved = ["--force", "--method", "nsga2", "--option", "population=40", "--option", "generations=40"]
    code, out, err = call(*arguments, *evolved)
    assert code == 2 and "nsga2 has no option 'points'" in one_line(err)
    without = [a for a in arguments if a not in ("--points", "3")]
    assert call(*without, *evolved)[0] == 0
    assert json.loads((folder / "run.json").read_text())["method"] == "nsga2"


@pytest.mark.slow
def test_nsga2_front_is_proved_and_non_dominated(call: Call, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, out, _ = call(
        "pareto", "hybrid-spline", "--objectives", "time,energy", "--method", "nsga2", "--option", "population=40",
        "--option", "generations=40", "-o", folder, "--json",
    )  # fmt: skip
    table = pd.read_csv(folder / "front.csv")
    assert code == 0 and (table["verdict"] == "proved").all()
    values = table[["time [s]", "energy [N2 m2/s]"]].to_numpy()
    assert (np.diff(values[:, 0]) > 0).all() and (np.diff(values[:, 1]) < 0).all()
    assert json.loads(out)["info"]["evaluation calls"] == 40


def test_options_reach_the_method_by_their_types(call: Call, tmp_path: Path) -> None:
    """A budget of one exchange, and none of a mutation's own choice, which is 1/n."""
    found = json.loads(call("solve", "hybrid-spline", "--objective", "time", "--no-certify", "--json",
                            "--option", "max_exchanges=1", "--option", "repair=false")[1])  # fmt: skip
    assert found["status"] == "not proved" and found["rounds"] == 1 and "the one round is used up" in found["detail"]
    read = options_from_text(FRONT, "hmoga", {"mutation": "none", "stall": "7", "seeded": "0.25"})
    assert read == {"mutation": None, "stall": 7, "seeded": 0.25} and isinstance(read["stall"], int)
    assert options_from_text(SOLVE, "ga", {"scaling": "true", "handling": "death"}) == {
        "scaling": True, "handling": "death",
    }  # fmt: skip


HEAVY = ("casadi", "pinocchio", "scipy", "pandas", "pymoo", "matplotlib")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "imported"),
    [
        (["--help"], set()),
        (["solve", "--help"], set()),
        (["problems"], {"casadi", "pinocchio", "scipy", "pandas"}),
        (["show", "weld-bezier", "--set", "case=air-move"], {"casadi", "pinocchio", "scipy", "pandas"}),
    ],
    ids=["help", "help of solve", "problems", "show"],
)
def test_a_command_imports_no_more_than_it_needs(arguments: list[str], imported: set[str]) -> None:
    """Counted, not timed: each of these costs 0.1 to 0.5 s of a start."""
    code = (
        f"from ocp_traj.cli.commands import run; import sys; code = run({arguments}); print(*sys.modules); exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert set(HEAVY) & set(done.stdout.splitlines()[-1].split()) == imported


def test_export_of_a_trajectory_to_ros(call: Call, saved: Path, tmp_path: Path) -> None:
    target = tmp_path / "t.yaml"
    assert call("export", saved, "--format", "ros", "-o", target)[0] == 0
    assert "joint_names" in target.read_text()


BAD_INPUT = {
    "unknown problem": (["solve", "hybrid"], "there is no problem 'hybrid'.*hybrid-spline"),
    "unknown objective": (["solve", "hybrid-spline", "--objective", "speed"], "no objective 'speed'.*time, energy"),
    "unknown weight": (["solve", "hybrid-spline", "--weight", "speed=1"], "no objective 'speed'"),
    "negative weight": (["solve", "hybrid-spline", "--weight", "time=-1"], "weight of 'time' is -1"),
    "weight no number": (["solve", "hybrid-spline", "--weight", "time=much"], "'much'; give a number"),
    "weight without =": (["solve", "hybrid-spline", "--weight", "time"], "'time' is not NAME=VALUE"),
    "objective and weight": (["solve", "hybrid-spline", "--objective", "time", "--weight", "time=1"], "not both"),
    "unknown field": (["solve", "hybrid-spline", "--set", "mass=3"], "no case field 'mass'.*payload"),
    "field no number": (["show", "hybrid-spline", "--set", "payload=heavy"], "payload is 'heavy'; give a number"),
    "negative payload": (["solve", "hybrid-spline", "--set", "payload=-1"], "payload is -1.*zero or more"),
    "nan payload": (["solve", "hybrid-spline", "--set", "payload=nan"], "payload is nan"),
    "bad convention": (["show", "hybrid-spline", "--set", "convention=new"], "physical, paper-literal"),
    "three weights": (["show", "hybrid-spline", "--set", "weights=1,2,3"], "give 4 numbers"),
    "empty bounds": (["solve", "hybrid-spline", "--set", "max_interval=0.1"], "bounds of h3 are empty.*widen"),
    "one objective": (["pareto", "hybrid-spline", "--objectives", "time", "-o", "run"], "two or more"),
    "unknown option of a method": (
        ["solve", "hybrid-spline", "--method", "ga", "--option", "populaton=9"],
        r"ga has no option 'populaton' \(nearest is 'population'\); options are population, generations, tournament",
    ),
    "option that is a flag": (
        ["pareto", "hybrid-spline", "--objectives", "time,energy", "--option", "points=9", "-o", "run"],
        "trace has no option 'points'; options are starts",
    ),
    "option that is no text": (
        ["solve", "hybrid-spline", "--option", "solver=ipopt"],
        "exchange has no option 'solver'; options are max_exchanges, back_off, repair",
    ),
    "option no number": (
        ["solve", "hybrid-spline", "--method", "ga", "--option", "population=2.5"],
        "ga: population is '2.5'; give a number, such as 200",
    ),
    "option too large": (
        ["solve", "hybrid-spline", "--method", "ga", "--option", "population=100001"],
        "ga: population is 100001; give at most 100000",
    ),
    "option no truth": (
        ["solve", "hybrid-spline", "--method", "ga", "--option", "scaling=perhaps"],
        "ga: scaling is 'perhaps'; give true or false",
    ),
    "option not finite": (
        ["solve", "hybrid-spline", "--method", "pso", "--option", "weight=nan"],
        "weight is nan; give a finite number, zero or more",
    ),
    "unknown schedule": (
        ["solve", "hybrid-spline", "--method", "pso", "--option", "schedule=new"],
        "schedule is 'new'; allowed are as_printed, repaired",
    ),
    "no rounds": (
        ["solve", "hybrid-spline", "--option", "max_exchanges=0"],
        "max_exchanges is 0; give a whole number, 1 or more",
    ),
    "unknown method": (
        ["pareto", "hybrid-spline", "--objectives", "time,energy", "--method", "magic", "-o", "run"],
        "no method 'magic'; methods are trace, nsga2",
    ),
    "bad reference": (
        ["pareto", "hybrid-spline", "--objectives", "time,energy", "--reference", "8", "-o", "run"],
        "--reference has 1 numbers; give one for each of time, energy",
    ),
    "no output": (["pareto", "hybrid-spline", "--objectives", "time,energy"], "output"),
    "missing file": (["audit", "nowhere.json"], "cannot read.*nowhere.json"),
    "unwritable": (["solve", "hybrid-spline", "-o", "no/such/folder/t.json"], "cannot write.*folder"),
    "empty objective": (["solve", "hybrid-spline", "--objective", ""], "no objective ''"),
    "no picture": (["solve", "hybrid-spline", "--plot", "t.txt"], "png, .pdf, .svg"),
    "one file for two": (
        ["solve", "hybrid-spline", "-o", "t.png", "--plot", "t.png"],
        "t.png, t.png name one file twice",
    ),
    "a device": (["solve", "hybrid-spline", "-o", os.devnull], "no plain file"),
    "unknown option": (["solve", "hybrid-spline", "--fast"], "--fast"),
    "unknown command": (["optimise"], "optimise"),
    "both payloads": (["payload", "hybrid-spline", "--max-time", "-3"], "-3"),
}


@pytest.mark.parametrize("name", BAD_INPUT)
def test_bad_input_is_one_clear_line_and_exit_2(
    name: str, call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, words = BAD_INPUT[name]
    code, out, err = call(*arguments)
    assert code == 2 and out == ""
    assert re.search(words, one_line(err)), err
    assert list(tmp_path.iterdir()) == []  # nothing half-written


OURS = '{"format": "ocp-traj/trajectory/1", "joints": ["a"]'


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("not json", "not JSON"),
        ('{"format": "other/1"}', "format is 'other/1'"),
        ("[1, 2]", "format is None"),
        (OURS + "}", "'durations'"),
        ("[" * 100_000, "no JSON this program can hold"),
        (OURS + ', "durations": [1' + "0" * 400 + '], "control_points": [[[0], [1]]]}', "sound"),
        (OURS + ', "durations": [0], "control_points": [[[0], [1]]]}', "positive"),
        (OURS + ', "durations": [1], "control_points": [[["x"]]]}', "sound"),
    ],
)
def test_a_foreign_or_broken_trajectory_file_is_refused(call: Call, tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(content)
    code, out, err = call("audit", path)
    assert (code, out) == (2, "") and words in one_line(err)


def test_a_trajectory_of_no_problem_needs_limits(call: Call, saved: Path, tmp_path: Path) -> None:
    data = json.loads(saved.read_text()) | {"problem": ""}
    path = tmp_path / "t.json"
    path.write_text(json.dumps(data))
    code, _, err = call("audit", path)
    assert code == 2 and "names no problem" in one_line(err)


def test_a_payload_no_time_law_can_carry_exits_1_and_names_f3(call: Call, tmp_path: Path) -> None:
    code, out, err = call("solve", "hybrid-spline", "--set", "payload=12.6", "--json")
    assert code == 1 and "effort-limit F3" in one_line(err) and "-500" in err
    found: dict[str, Any] = json.loads(out)
    assert found["status"] == "infeasible" and found["conflicts"][0]["label"] == "F3"
    assert found["conflicts"][0]["excess"] == pytest.approx((38.475 + 12.6) * 9.80665 - 500.0, abs=1e-6)
    code, out, err = call(
        "pareto", "hybrid-spline", "--objectives", "time,energy", "--set", "payload=12.6", "-o", tmp_path / "run"
    )
    assert code == 1 and "effort-limit F3" in one_line(err)
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_an_unreachable_time_names_time_and_what_stands_in_its_way(call: Call) -> None:
    code, _, err = call("payload", "hybrid-spline", "--max-time", "2")
    assert code == 1
    assert "time" in one_line(err) and "velocity-limit X_S2" in err


def test_every_command_has_help_with_an_example(call: Call) -> None:
    for command in ("problems", "show", "solve", "pareto", "payload", "audit", "reproduce", "export"):
        code, out, _ = call(command, "--help")
        assert code == 0
        assert f"Example: ocp-traj {command}" in out
        assert "--json" in out


@pytest.mark.slow
def test_the_module_runs_as_a_program(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent)}
    line = [sys.executable, "-m", "ocp_traj", "show", "nothing"]
    done = subprocess.run(line, capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == "" and "there is no problem 'nothing'" in one_line(done.stderr)
