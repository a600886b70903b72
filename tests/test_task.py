"""Task files: what is understood, what is refused and how, and that a trajectory's file is enough to prove it."""

import json
from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.task_file import read_task
from ocp_traj.robot.robot import Robot
from tests.task_mutations import outcome

EXAMPLES = Path(__file__).parent.parent / "examples" / "tasks"
VIA = (EXAMPLES / "ur5-via.toml").read_text()

# What is written in place of what, and what the complaint says of it.
BROKEN = [
    ("acceleration = 8.0", "acceleratoin = 8.0", r"x.toml:11: \[limits\] acceleratoin is not allowed \(nearest is"),
    ("mass = 3.0", "mass = -3.0", r"x.toml:7: \[robot\] payload.mass is -3.0; give a mass \[kg\], 0 or more"),
    ("mass = 3.0, ", "", r"\[robot\] payload.mass is missing; give a mass"),
    ('"cubic"', '"cubik"', r"x.toml:15: \[curve\] kind is 'cubik'; give one of cubic, quintic"),
    ('description = "ur5"\n', 'description = "ur5"\nurdf = "a"\n', r"\[robot\] has description and urdf; give exactly"),
    ("[robot]", "[robott]", r"robott is not allowed \(nearest is 'robot'\)"),
    ("0.782", '"a"', r"x.toml:20: \[\[move\]\] 1: via: point 1, number 1 is 'a'; give a list of points"),
    ("rest = 2", "rest = 7", r"\[curve\] rest is 7; give a whole number from 0 to 4"),
    ("rest = 2", "rest = 1", r"\[curve\] rest is 1; a cubic rests to the 2nd derivative"),
    ("jerk = 60.0", 'jerk = "50 %"', r"jerk is a share of the description's; no URDF holds it"),
    ("jerk = 60.0", "", r"\[limits\] jerk is missing: no description holds it"),
    ("jerk = 60.0", "jerk = [1.0, 2.0]", r"\[limits\] jerk has 2 numbers; the robot has 6 joints"),
    ("[[move]]", "[[move]]\nblend = 0.01", r"\[\[move\]\] 1 has blend, which is of a tool path; give one of line"),
    ("[[move]]", "[move]", r"\[move\] is .* give one or more tables"),
    ('minimise = "time"', 'minimise = "tiem"', r"no objective 'tiem' \(nearest is 'time'\)"),
    ('"ur5"\ntool', '"ur55"\ntool', r"'ur55' is no robot of example-robot-data \(nearest is 'ur5'\)"),
    ("ocp-traj/task/1", "ocp-traj/task/2", r"its format is 'ocp-traj/task/2'; write format"),
    ("via = [", "vai = [", r"\[\[move\]\] 1: vai is not allowed \(nearest is 'via'\)"),
    ("rest = 2", "rest = 2\npieces = 2", r"\[curve\] pieces is not of cubic"),
]  # fmt: skip


def _load(folder: Path, text: str, **changes: object) -> ot.Problem:
    file = folder / "x.toml"
    file.write_text(text)
    return ot.problems.load("task", file=str(file), **changes)


@pytest.mark.parametrize(("old", "new", "words"), BROKEN)
def test_what_is_wrong_is_told_in_one_line(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in VIA
    with pytest.raises(InputError, match=words) as caught:
        _load(tmp_path, VIA.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_the_command_refuses_a_broken_file_with_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x.toml").write_text(VIA.replace("rest = 2", "rest = 7"))
    assert run(["show", str(tmp_path / "x.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_degrees_are_radians(tmp_path: Path) -> None:
    problem = _load(tmp_path, VIA.replace("[robot]", 'units = { angle = "deg" }\n\n[robot]'))
    plain = ot.problems.load("task", file=str(EXAMPLES / "ur5-via.toml"))
    jerk, own = (p.robot.limits.bounds("jerk")[1] for p in (problem, plain))
    np.testing.assert_allclose(jerk, np.radians(own), rtol=1e-15)
    assert np.array_equal(problem.robot.limits.bounds("velocity"), plain.robot.limits.bounds("velocity"))
    first, own_first = (p.case.move[0].via[0] for p in (problem, plain))
    np.testing.assert_allclose(first, np.radians(own_first), rtol=1e-15)


def test_a_share_is_of_the_descriptions_limit(tmp_path: Path) -> None:
    half = _load(tmp_path, VIA.replace("jerk =", 'velocity = "50 %"\njerk ='))
    own = Robot.from_description("ur5").limits.bounds("velocity")
    assert own is not None
    np.testing.assert_allclose(half.robot.limits.bounds("velocity")[1], 0.5 * own[1], rtol=1e-15)


def test_values_by_place_change_the_task() -> None:
    task = read_task(EXAMPLES / "ur5-via.toml", {"robot.payload.mass": "5", "move.0.via.1": [0.0] * 6})
    assert task.robot.payload is not None and task.robot.payload.mass == 5.0
    assert task.move[0].via is not None and task.move[0].via[1] == [0.0] * 6


def test_a_task_in_code_is_the_task_of_the_file() -> None:
    file = read_task(EXAMPLES / "ur5-via.toml")
    again = Task(**{k: v for k, v in file.fields().items() if k != "source"})
    assert again == file.model_copy(update={"source": None})


@pytest.mark.slow
def test_a_trajectorys_file_is_enough_to_prove_it_and_a_changed_one_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "t.json"
    assert run(["solve", str(EXAMPLES / "ur5-via.toml"), "-o", str(file)]) == 0
    moved = ot.Trajectory.load(file)
    assert moved.audit().proved and moved.duration < 2.8685  # [s]
    assert run(["export", str(file)]) == 2
    asked = tmp_path / "asked.json"
    with_export = json.loads(file.read_text())
    with_export["case"]["export"] = {"format": "ros", "at": "knots"}
    asked.write_text(json.dumps(with_export))
    assert run(["export", str(asked)]) == 0 and ot.Trajectory.load(tmp_path / "asked.ros.yaml").duration > 2.8
    data = json.loads(file.read_text())
    data["case"]["robot"]["payload"]["mass"] = 9.0
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match="parameter payload"):
        ot.Trajectory.load(file).audit()


@pytest.mark.slow
def test_a_move_of_two_points_stops_where_it_is_told_to(tmp_path: Path) -> None:
    text = (
        VIA[: VIA.index("[[move]]")].replace('"cubic"', '"quintic"')
        + """
[[move]]
via = [[0.0, -1.3, 1.4, -1.6, -1.5, 0.0], [0.4, -1.3, 1.4, -1.6, -1.5, 0.0]]
dwell = 0.25

[[move]]
goal = [0.4, -1.0, 1.4, -1.6, -1.5, 0.2]
"""
    )
    solution = ot.solve(_load(tmp_path, text))
    assert solution.audit is not None and solution.audit.proved and solution.trajectory is not None
    curve = solution.trajectory.curve
    dwell = [k for k in range(curve.segments) if curve.durations[k] == 0.25]
    assert len(dwell) == 1 and not np.ptp(curve.control_points[dwell[0]], axis=0).any()


@pytest.mark.slow
def test_finer_curves_are_faster_and_proved(tmp_path: Path) -> None:
    solution = ot.solve(_load(tmp_path, VIA.replace('"cubic"', '"auto"')))
    assert solution.audit is not None and solution.audit.proved and solution.f <= 2.40  # [s]
    assert solution.trajectory is not None and solution.trajectory.case["curve"]["pieces"] > 1


@pytest.mark.slow
def test_mutated_tasks_are_understood_or_refused_in_one_line() -> None:
    found = [outcome(seed) for seed in range(60)]
    assert "understood" in found and not any("\n" in words for words in found)


@pytest.mark.slow
def test_moves_of_different_tolerance_are_refused_and_a_tolerance_is_kept(tmp_path: Path) -> None:
    text = VIA.replace('"cubic"', '"quintic"').replace("[[move]]\n", "[[move]]\ntolerance = 0.02\n")
    solution = ot.solve(_load(tmp_path, text))
    assert solution.audit is not None and solution.audit.proved
    assert solution.f < ot.solve(_load(tmp_path, VIA.replace('"cubic"', '"quintic"'))).f - 1e-3
    with pytest.raises(InputError, match="moves have different tolerances"):
        _load(tmp_path, text + "\n[[move]]\ngoal = [0.0, -1.3, 1.4, -1.6, -1.5, 0.0]\n")


@pytest.mark.slow
def test_a_weighted_sum_is_what_is_minimised_by_default(tmp_path: Path) -> None:
    problem = _load(tmp_path, VIA.replace('minimise = "time"', "minimise = { time = 0.5, effort = 0.25 }"))
    found = ot.solve(problem)
    assert problem.default_objective == "cost"
    expected = 0.5 * found.objectives["time"] + 0.25 * found.objectives["effort"]
    assert found.f == pytest.approx(expected, rel=1e-12)


def test_masses_too_large_to_prove_efforts_of_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\[limits\] effort cannot be proved for masses of"):
        _load(tmp_path, VIA.replace("mass = 3.0", "mass = 1e9"))


def test_locked_joints_have_the_tasks_units(tmp_path: Path) -> None:
    text = VIA.replace('"ur5"\n', '"ur5"\nlocked = { wrist_3_joint = 90.0 }\n', 1).replace(
        "[robot]", 'units = { angle = "deg" }\n\n[robot]', 1
    )
    rows = text[: text.index("via = [")] + "via = [[0.0, -60.0, 60.0, 0.0, 0.0], [9.0, -60.0, 60.0, 0.0, 0.0]]\n"
    problem = _load(tmp_path, rows.replace('"cubic"', '"quintic"'))
    locked = Robot.from_description("ur5", locked={"wrist_3_joint": np.pi / 2}, tool_frame="tool0")
    q = np.full((1, 5), 0.3)
    np.testing.assert_allclose(problem.robot.poses(q)[0], locked.poses(q)[0], atol=1e-14)
