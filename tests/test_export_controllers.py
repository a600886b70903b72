import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pinocchio as pin
import pytest
import yaml
from scipy.interpolate import BPoly

import ocp_traj as ot
from examples.own_robot import build
from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.cli.commands import run as run_command
from ocp_traj.errors import FileFormatError
from ocp_traj.io.export import export
from ocp_traj.io.export.fanuc import coupling_of
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from tests.test_playback import FASTEST


@pytest.fixture(scope="module")
def fast() -> Trajectory:
    return trajectory_of(build(), FASTEST * (1.0 + 1e-9))


def limits(trajectory: Trajectory) -> ot.Requirements:
    assert trajectory.origin is not None
    return trajectory.origin.requirements


# --- ROS, tables and BPoly, there and back ---


@pytest.mark.parametrize("name", ["t.yaml", "t.json", "t.csv"])
def test_at_knots_what_is_read_back_is_proved(fast: Trajectory, tmp_path: Path, name: str) -> None:
    written = export(fast, "csv" if name == "t.csv" else "ros", tmp_path / name, at="knots")
    assert written.proved and "every limit holds" in written.path.read_text()
    again = Trajectory.load(written)
    assert again.curve.degrees == (5,) * 7 and again.joints == fast.joints
    assert 0.0 <= again.duration - fast.duration < 1e-7
    assert ot.audit(again, limits(fast)).proved


def test_a_message_has_nanoseconds_efforts_and_other_names(fast: Trajectory, tmp_path: Path) -> None:
    written = export(fast, "ros", tmp_path / "t.yaml", effort=True, frame="base", joints={"elbow_joint": "elbow"})
    message = yaml.safe_load(written.path.read_text())
    assert message["header"]["frame_id"] == "base" and message["joint_names"][2] == "elbow"
    stamps = [point["time_from_start"] for point in message["points"]]
    assert all(0 <= s["nanosec"] < 10**9 and isinstance(s["sec"], int) for s in stamps)
    assert stamps[-1]["sec"] + stamps[-1]["nanosec"] * 1e-9 == pytest.approx(written.about["duration [s]"], abs=1e-12)
    assert [len(point) for point in message["points"]] == [5] * 8
    assert np.abs([point["effort"][1] for point in message["points"]]).max() > 10.0  # [N m]: the arm is heavy


@pytest.mark.slow
def test_points_have_what_the_interpolation_takes(fast: Trajectory, tmp_path: Path) -> None:
    for interpolation, fields in (("linear", 2), ("cubic", 3), ("quintic", 4)):
        written = export(fast, "ros", tmp_path / "t.json", interpolation=interpolation)
        data = json.loads(written.path.read_text())
        assert {len(point) for point in data["points"]} == {fields}
        assert data["about"]["verdict"] == written.about["verdict"]
        assert written.proved == (interpolation == "quintic")
        if interpolation == "cubic":
            assert Trajectory.load(written).curve.degrees == (3,) * 7


@pytest.mark.slow
def test_at_a_rate_the_excess_stands_in_the_file_and_the_exit_code_is_1(fast: Trajectory, tmp_path: Path) -> None:
    source, target = fast.save(tmp_path / "t.json"), tmp_path / "o.csv"
    assert run_command(["export", str(source), "--format", "csv", "--rate", "100", "-o", str(target)]) == 1
    text = target.read_text()
    (excess,) = re.findall(r"# excess \[share of a limit\]: (\S+)", text)
    again = Trajectory.load(target)
    worst = max(max(abs(e.lower), abs(e.upper)) for e in again.curve.extrema(3))
    assert float(excess) == pytest.approx(worst / 60.0 - 1.0, rel=1e-3) and worst > 80.0
    assert run_command(["export", str(source), "--format", "ros", "-o", str(tmp_path / "o.yaml")]) == 0


@pytest.mark.slow
def test_a_bpoly_is_scipys_and_is_read_back_with_the_same_verdict(fast: Trajectory, tmp_path: Path) -> None:
    rotor = problems.load("rotor-353")  # of degrees 3, 5, 3
    for problem, trajectory in ((build(), fast), (rotor, trajectory_of(rotor, np.full(rotor.size, 1.0)))):
        written = export(trajectory, "bpoly", tmp_path / "b.json")
        data = json.loads(written.path.read_text())
        times = np.linspace(0.0, trajectory.duration * (1.0 - 1e-12), 50)
        np.testing.assert_allclose(BPoly(np.array(data["c"]), data["x"])(times), trajectory.curve(times), atol=1e-12)
        again = replace(Trajectory.load(written), origin=problem)
        assert again.curve.degrees == trajectory.curve.degrees
        assert again.audit().verdict == trajectory.audit().verdict == written.verdict


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("t.yaml", "joint_names: [a\n", "not YAML"),
        ("t.yaml", "joint_names: [a]\npoints: []\n", "not a sound trajectory_msgs/JointTrajectory file"),
        ("t.yaml", "joint_names: [a]\npoints: [{positions: [0.0]}]\n", "'time_from_start' .* is missing"),
        ("t.csv", "time [s],a q [deg]\n0,1\n1,2\n", r"'a q \[deg\]' is in deg; give rad or m"),
        ("t.csv", "time [s],a q [rad]\n0,1\n1,x\n", "give numbers"),
        ("t.csv", "time,a q [rad]\n0,1\n", "no column 'time"),
        ("t.csv", "time [s],a q [rad],b\n0,1,2\n", "the column 'b' is not"),
    ],
)
def test_messages_and_tables_that_are_not_sound_are_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(FileFormatError, match=message) as error:
        Trajectory.load(tmp_path / name)
    assert "\n" not in str(error.value)


# --- programs ---


def setpoints(text: str, first: Array, steptime: float = 0.002) -> Array:
    """What a URScript program sends to ``servoj``: its text as Python, which it nearly is."""
    code = re.sub(r"^\s*end$|\blocal |\bglobal ", "", text, flags=re.M)
    code = re.sub(r"^(\s*)halt$", r"\1raise SystemExit", code, flags=re.M)
    code = code.replace(
        "def ocp_quintic(q, v, a, T):", "def ocp_quintic(q, v, a, T):\n    global ocp_q, ocp_v, ocp_a, ocp_late"
    )
    code = re.sub(r"(def play_\w+\(\):)", r"\1\n  global ocp_q, ocp_v, ocp_a, ocp_late", code)
    sent: list[list[float]] = []
    names: dict[str, Any] = {
        "servoj": lambda q, **options: sent.append(list(q)), "stopj": lambda a: None, "norm": abs,
        "get_steptime": lambda: steptime, "get_actual_joint_positions": lambda: list(first),
        "popup": lambda *words, **options: None,
    }  # fmt: skip
    exec(code, names)
    return np.array(sent)


def test_a_urscript_sends_points_of_the_proved_motion(fast: Trajectory, tmp_path: Path) -> None:
    written = export(fast, "urscript", tmp_path / "a.script")
    assert written.proved and "# verdict: proved" in written.path.read_text()
    sent = setpoints(written.path.read_text(), fast.curve(0.0)[0])
    times = 0.002 * np.arange(len(sent) - 1)
    assert times[-1] == pytest.approx(fast.duration, abs=0.002)
    np.testing.assert_allclose(sent[:-1], fast.curve(np.minimum(times, fast.duration)), atol=1e-6)
    np.testing.assert_allclose(sent[-1], fast.curve(fast.duration)[0], atol=1e-9)
    with pytest.raises(SystemExit):
        setpoints(written.path.read_text(), fast.curve(0.0)[0] + 0.02)


def test_a_urscript_at_a_rate_proves_nothing(fast: Trajectory, tmp_path: Path) -> None:
    written = export(fast, "urscript", tmp_path / "a.script", rate=125.0)
    assert not written.proved and "nothing is proved of what servoj makes between them" in written.path.read_text()
    sent = setpoints(written.path.read_text(), fast.curve(0.0)[0])
    np.testing.assert_allclose(sent[:-1], fast.curve(np.minimum(np.arange(len(sent) - 1) / 125.0, fast.duration)))


@pytest.mark.parametrize(("format", "names"), [("krl", ["move.src", "move.dat"]), ("fanuc", ["move.ls"])])
def test_programs_are_the_golden_ones(fast: Trajectory, tmp_path: Path, format: str, names: list[str]) -> None:
    written = export(fast, format, tmp_path / names[0])
    assert not written.proved and [path.name for path in written.paths] == names
    for name in names:
        text = re.sub(r"ocp-traj \d\S*", "ocp-traj VERSION", (tmp_path / name).read_text())
        assert text == (Path(__file__).parent / "golden" / name).read_text()


@pytest.mark.parametrize(("format", "name", "moves"), [("krl", "m.src", r"^PTP"), ("fanuc", "m.ls", r"\d:J P")])
def test_many_points_are_split_into_files_that_the_first_calls(
    fast: Trajectory, tmp_path: Path, format: str, name: str, moves: str
) -> None:
    written = export(fast, format, tmp_path / name, rate=10.0, most_points=10)
    programs = [path for path in written.paths if path.suffix == Path(name).suffix]
    assert [path.stem for path in programs] == ["m", "m_01", "m_02", "m_03"]
    assert [len(re.findall(moves, path.read_text(), re.M)) for path in programs] == [0, 10, 10, 10]
    calls = re.findall(r"(?i)\bm_\d\d", programs[0].read_text())
    assert [call.lower() for call in calls] == ["m_01", "m_02", "m_03"]
    stops = [len(re.findall("FINE|^PTP P\\d+$", path.read_text(), re.M)) for path in programs]
    assert stops == [0, 0, 0, 1]  # the arm stops at the end only


@pytest.mark.slow
def test_joint_3_is_shown_from_the_ground(fast: Trajectory, tmp_path: Path) -> None:
    assert fast.origin is not None
    robot = fast.origin.robot
    assert robot is not None and coupling_of(robot) == 1  # a UR5: both axes point the same way
    turned = robot.model.copy()
    half_turn = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # about x, across the joint's own axis z or y
    turned.jointPlacements[3] = turned.jointPlacements[3] * half_turn
    assert coupling_of(replace(robot, model=turned)) == -1
    q = np.degrees(fast.curve(0.0)[0])
    for coupling in (1, -1, 0):
        text = export(fast, "fanuc", tmp_path / "m.ls", coupling=coupling).path.read_text()
        (shown,) = re.findall(r"P\[1\]{[^}]*J3= (\S+) deg", text)
        assert float(shown) == pytest.approx(q[2] + coupling * q[1], abs=1e-6)


def test_prismatic_joints_are_in_millimetres(tmp_path: Path) -> None:
    problem = problems.load("hybrid-spline")
    trajectory = trajectory_of(problem, np.array(problems.module("hybrid-spline").TABLE_7))
    text = export(trajectory, "krl", tmp_path / "m.src").paths[1].read_text()
    first = dict(part.split() for part in re.findall(r"P1={(.*)}", text)[0].split(","))
    q = trajectory.curve(0.0)[0]
    assert [float(first[f"A{j}"]) for j in (1, 2, 3)] == pytest.approx(1000.0 * q[:3], abs=1e-6)
    assert [float(first[f"A{j}"]) for j in (4, 5)] == pytest.approx(np.degrees(q[3:]), abs=1e-6)


def test_tables_at_a_rate_hold_what_is_said_in_their_metadata(fast: Trajectory, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    table = pd.read_parquet(export(fast, "parquet", tmp_path / "t.parquet", rate=50.0))
    assert table.attrs["verdict"].startswith("not proved: jerk-limit")
