import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest import approx

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import FileFormatError, InputError, ProblemDefinitionError, UnknownName
from ocp_traj.files import read_json, read_text, write_text, write_with
from ocp_traj.results.trajectory import Trajectory

RNG = np.random.default_rng(5)


def wavy(**fields: Any) -> Trajectory:
    """Two joints, three segments of different degree."""
    rng = np.random.default_rng(7)
    points = tuple(rng.normal(size=(n + 1, 2)) for n in (3, 5, 1))
    return Trajectory(PiecewiseBezier(np.array([0.5, 1.25, 2.0]), points), ("lift", "turn"), **fields)


def linear(**changes: Any) -> dict[str, Any]:
    plain = {"joints": ["a"], "durations": [2.0], "control_points": [[[0.0], [1.0]]]}
    return {"format": "ocp-traj/trajectory/1", **plain, **changes}


# --- sampling and time scaling ---


def test_samples_are_the_curve_and_its_derivatives() -> None:
    line = Trajectory(PiecewiseBezier(np.array([2.0]), (np.array([[0.0, 1.0], [3.0, 1.0], [12.0, 1.0]]),)), ("a", "b"))
    # q_a = 6 u (1 - u) + 12 u^2 with u = t/2: q = 3 t + 1.5 t^2.
    table = line.sample(5)
    t = np.linspace(0.0, 2.0, 5)
    assert table.index.name == "time [s]" and table.index.tolist() == approx(t.tolist())
    assert table["q"]["a"].tolist() == approx((3.0 * t + 1.5 * t**2).tolist())
    assert table["v"]["a"].tolist() == approx((3.0 + 3.0 * t).tolist())
    assert table["a"]["a"].tolist() == approx([3.0] * 5)
    assert not table[["jerk", "snap"]].to_numpy().any()
    assert table["q"]["b"].tolist() == approx([1.0] * 5)


def test_samples_at_given_times() -> None:
    trajectory = wavy()
    table = trajectory.sample(times=[0.1, 3.0])
    assert table["q"].to_numpy() == approx(trajectory.curve([0.1, 3.0]))
    with pytest.raises(InputError, match="times must lie in"):
        trajectory.sample(times=[4.0])


def test_dilation_keeps_the_path_and_scales_each_derivative() -> None:
    trajectory = wavy(problem="p", variables={"h": np.ones(3)}, parameters={"payload": 2.0})
    slow = trajectory.dilate(1.5)
    before, after = trajectory.sample(40), slow.sample(40)
    for order, name in enumerate(("q", "v", "a", "jerk", "snap")):
        assert after[name].to_numpy() == approx(before[name].to_numpy() / 1.5**order, rel=1e-9, abs=1e-9)
    assert slow.duration == approx(1.5 * trajectory.duration)
    assert slow.variables == {} and slow.parameters == {"payload": 2.0} and slow.problem == "p"


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_dilation_needs_a_positive_factor(factor: float) -> None:
    with pytest.raises(InputError, match="positive number"):
        wavy().dilate(factor)


def test_joints_and_curve_must_fit() -> None:
    with pytest.raises(ProblemDefinitionError, match="2 joints was given 1 names"):
        Trajectory(wavy().curve, ("lift",))


def test_an_audit_needs_a_known_problem() -> None:
    with pytest.raises(InputError, match="names no problem; give its limits"):
        wavy().audit()
    with pytest.raises(UnknownName, match="no problem 'nowhere'"):
        wavy(problem="nowhere").audit()


# --- files ---


def test_a_saved_trajectory_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    trajectory = wavy(
        problem="p", case={"payload": 3.0}, variables={"h": np.array([0.1, 1.0 / 3.0])}, parameters={"payload": 3.0}
    )
    loaded = Trajectory.load(trajectory.save(tmp_path / "t.json"))
    assert loaded.to_dict() == trajectory.to_dict()
    assert all(
        (a == b).all() for a, b in zip(loaded.curve.control_points, trajectory.curve.control_points, strict=True)
    )
    assert (loaded.variables["h"] == trajectory.variables["h"]).all()
    assert [path.name for path in tmp_path.iterdir()] == ["t.json"]


def test_samples_become_a_spline_through_the_points() -> None:
    times, positions = [1.0, 1.5, 2.5, 3.0, 4.0], RNG.normal(size=(5, 2))
    data = {"format": "ocp-traj/samples/1", "joints": ["a", "b"], "times": times, "positions": positions.tolist()}
    trajectory = Trajectory.from_dict(data)
    assert trajectory.duration == approx(3.0)
    assert trajectory.curve(np.array(times) - 1.0) == approx(positions)
    for order in range(3):
        assert np.abs(trajectory.curve.jump(order)).max() < 1e-9
    resting = Trajectory.from_dict({**data, "rest": True})
    assert resting.curve([0.0, 3.0], 1) == approx(np.zeros((2, 2)), abs=1e-12)
    assert np.abs(trajectory.curve([0.0, 3.0], 1)).max() > 0.1


def test_spline_coefficients_are_of_powers_of_the_time_in_the_segment() -> None:
    # 1 + 2 t + 3 t^2 up to t = 2, then the constant 17.
    data = {"format": "ocp-traj/spline/1", "joints": ["a"], "knots": [0.0, 2.0, 3.0]}
    trajectory = Trajectory.from_dict({**data, "coefficients": [[[1.0], [2.0], [3.0]], [[17.0]]]})
    t = np.linspace(0.0, 1.9, 7)
    assert trajectory.curve(t).ravel() == approx(1.0 + 2.0 * t + 3.0 * t**2)
    assert trajectory.curve(t, 1).ravel() == approx(2.0 + 6.0 * t)
    assert trajectory.curve([2.0, 2.5]).ravel() == approx([17.0, 17.0])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "its format is None; allowed ocp-traj/trajectory/1, ocp-traj/samples/1, ocp-traj/spline/1"),
        ({"format": ["ocp-traj/trajectory/1"]}, "its format is "),
        (linear(format="ocp-traj/trajectory/9"), "its format is 'ocp-traj/trajectory/9'"),
        ({"format": "ocp-traj/trajectory/1", "joints": ["a"]}, "the field 'durations' of format"),
        (linear(durations=[-1.0]), "durations must be positive"),
        (linear(durations=[float("inf")]), "durations must be finite"),
        (linear(durations=[1.0, 1.0]), "2 durations, 1 segments"),
        (linear(durations=2.0), "durations must be nested 1 deep, not 0"),
        (linear(control_points=[[0.0, 1.0]]), "control points must be nested 2 deep, not 1"),
        (linear(control_points=[[[0.0], [float("nan")]]]), "control points must be finite"),
        (linear(control_points=[[[0.0], ["x"]]]), "could not convert string"),
        (linear(joints=["a", "b"]), "1 joints was given 2 names"),
        (linear(joints="a"), "joints are 'a'; give a list of different names"),
        (linear(parameters={"payload": float("nan")}), "the parameter payload must be finite"),
        (linear(parameters=[1.0]), "not a sound"),
        (linear(case=[1.0]), "not a sound"),
    ],
)
def test_a_trajectory_that_is_not_sound_is_refused(data: Any, message: str) -> None:
    with pytest.raises(FileFormatError, match=message):
        Trajectory.from_dict(data)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"times": [0.0, 1.0, 1.0]}, "strictly increasing"),
        ({"positions": [0.0, 1.0, 2.0]}, "positions must be nested 2 deep"),
        ({"positions": [[0.0], [1.0]]}, "not a sound"),
        ({"rest": "false"}, "rest is 'false'; give true or false"),
    ],
)
def test_samples_that_are_not_sound_are_refused(changes: dict[str, Any], message: str) -> None:
    data = {"joints": ["a"], "times": [0.0, 1.0, 2.0], "positions": [[0.0], [1.0], [2.0]]}
    assert Trajectory.from_dict({"format": "ocp-traj/samples/1", **data}).duration == 2.0
    with pytest.raises(FileFormatError, match=message):
        Trajectory.from_dict({"format": "ocp-traj/samples/1", **data, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coefficients": [[0.0, 1.0, 2.0, 3.0]]}, "coefficients must be nested 2 deep"),
        ({"knots": [1.0, 0.0]}, "durations must be positive"),
        ({"knots": [0.0, 1.0, 2.0]}, "not a sound"),
        ({"joints": ["a", "b", "c", "c"]}, "different names"),
    ],
)
def test_spline_coefficients_that_are_not_sound_are_refused(changes: dict[str, Any], message: str) -> None:
    data = {"joints": list("abcd"), "knots": [0.0, 1.0], "coefficients": [[[0.0, 1.0, 2.0, 3.0]]]}
    assert Trajectory.from_dict({"format": "ocp-traj/spline/1", **data}).curve.dof == 4
    with pytest.raises(FileFormatError, match=message):
        Trajectory.from_dict({"format": "ocp-traj/spline/1", **data, **changes})


def test_files_that_cannot_be_read_say_why(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text('{"format":\n oops}')
    (tmp_path / "picture.json").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(FileFormatError, match=r"broken.json is not a trajectory file: not JSON \(line 2"):
        Trajectory.load(tmp_path / "broken.json")
    with pytest.raises(FileFormatError, match="it is not text"):
        Trajectory.load(tmp_path / "picture.json")
    with pytest.raises(FileFormatError, match="cannot read the trajectory file .*No such file"):
        Trajectory.load(tmp_path / "none.json")
    with pytest.raises(FileFormatError, match="it is a folder"):
        read_text(tmp_path, "run")


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    target = write_text(tmp_path / "a.txt", "old")

    def fail_midway(path: Path) -> None:
        path.write_text("ha")
        raise RuntimeError("midway")

    with pytest.raises(RuntimeError, match="midway"):
        write_with(target, fail_midway)
    assert target.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_file_is_replaced_whole_and_gets_the_usual_mode(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    write_text(target, "old")
    write_text(target, json.dumps({"new": "ü"}, ensure_ascii=False))
    assert read_json(target, "test") == {"new": "ü"}
    mask = os.umask(0)
    os.umask(mask)
    assert target.stat().st_mode & 0o777 == 0o666 & ~mask


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="cannot write .*No such file.*choose a folder that exists"):
        write_text(tmp_path / "none" / "a.txt", "x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileFormatError, match="cannot write .*folder"):
        write_text(tmp_path / "folder", "x")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]
