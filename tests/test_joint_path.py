import json
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

import ocp_traj as ot
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import cubic_spline_free_ends, nonic
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_file import load_path
from ocp_traj.paths.path_points import read_points
from ocp_traj.results.trajectory import Trajectory

JOINTS = ("shoulder", "elbow", "wrist")
POINTS = np.array(
    [[0.0, 0.5, 1.0], [0.3, 0.4, 1.2], [0.5, 0.1, 0.9], [0.2, -0.3, 0.4], [0.0, 0.0, 0.1], [0.4, 0.2, 0.0]]
)
MESSAGE = {
    "joint_names": ["wrist", "shoulder", "elbow"],
    "points": [
        {"positions": q[[2, 0, 1]].tolist(), "time_from_start": {"sec": i, "nanosec": 0}} for i, q in enumerate(POINTS)
    ],
}


def parameter(points: np.ndarray) -> np.ndarray:
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def table(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "path.csv"
    file.write_text(text)
    return file


@pytest.mark.parametrize("count", [2, 3, 4, 6])
def test_a_cubic_is_scipys_spline_over_chord_length(count: int) -> None:
    points = POINTS[:count]
    path, at = JointPath.through(points, JOINTS), parameter(points)
    dense = np.linspace(0.0, at[-1], 101)
    assert path.curve.segments == count - 1
    for order in range(3):
        assert np.allclose(path.curve(dense, order), CubicSpline(at, points)(dense, order), atol=1e-12)
    assert np.abs(path.points - points).max() < 1e-15
    assert path.continuity == 2


def test_a_quintic_is_scipys_spline_and_continuous_up_to_the_fourth_derivative() -> None:
    path, at = JointPath.through(POINTS, JOINTS, degree=5), parameter(POINTS)
    dense = np.linspace(0.0, at[-1], 101)
    assert np.allclose(path.curve(dense, 3), make_interp_spline(at, POINTS, k=5)(dense, 3), atol=1e-8)
    assert np.abs(path.points - POINTS).max() < 1e-13
    assert (
        path.continuity == 4
        and np.abs(path.curve.jump(4)).max() < 1e-6 * np.abs(path.curve.derivative(4).control_points[0]).max()
    )


def test_a_curve_keeps_its_geometry_and_its_continuity_is_found() -> None:
    spline = cubic_spline_free_ends(POINTS, np.full(7, 0.4))
    path = JointPath.of_curve(spline, JOINTS)
    assert path.curve is spline and path.continuity == 2
    states = [np.vstack([q, np.random.default_rng(i).normal(size=(4, 3))]) for i, q in enumerate(POINTS)]
    assert JointPath.of_curve(nonic(states, np.full(5, 0.3)), JOINTS).continuity == 4
    corner = PiecewiseBezier([1.0, 1.0], (POINTS[:2], POINTS[1:3]))
    assert JointPath.of_curve(corner, JOINTS).continuity == 0
    with pytest.raises(InputError, match="jumps at a knot"):
        JointPath.of_curve(PiecewiseBezier([1.0, 1.0], (POINTS[:2], POINTS[2:4])), JOINTS)


@pytest.mark.parametrize(
    ("points", "more", "words"),
    [
        (POINTS[[0, 1, 1, 2]], {}, "point 2 and point 3 of the path are the same"),
        (POINTS[[0, 0]], {}, "point 1 and point 2"),
        (POINTS[[0, 1, 1]], {"places": ("a", "b", "c")}, "b and c of the path"),
        (POINTS[:1], {}, "needs 2 points or more; got 1"),
        (POINTS, {"degree": 4}, "degree 4; give 3 or 5"),
        (POINTS[:, :2], {}, r"of shape \(6, 2\)"),
        (POINTS * np.nan, {}, "a finite row"),
    ],
)  # fmt: skip
def test_points_that_make_no_path_are_named(points: np.ndarray, more: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        JointPath.through(points, JOINTS, **more)


def test_columns_of_a_table_are_matched_by_name(tmp_path: Path) -> None:
    lines = ["wrist, shoulder,elbow", "", *(f"{q[2]}, {q[0]},{q[1]}" for q in POINTS)]
    points, places = read_points(table(tmp_path, "\ufeff" + "\r\n".join(lines) + "\n"), JOINTS)
    assert (points == POINTS).all()
    assert places[0] == f"line 3 of {tmp_path / 'path.csv'}"


@pytest.mark.parametrize("suffix", [".yaml", ".yml", ".json"])
def test_joints_of_a_message_are_matched_by_name(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"path{suffix}"
    lines = ["joint_names: [wrist, shoulder, elbow]", "points:"]
    lines += [f"- positions: {p['positions']}\n  time_from_start: {{sec: 0, nanosec: 0}}" for p in MESSAGE["points"]]
    file.write_text(json.dumps(MESSAGE) if suffix == ".json" else "\n".join(lines) + "\n---\n")
    points, places = read_points(file, JOINTS)
    assert (points == POINTS).all() and places[1].startswith("point 2 of ")


HEAD = "shoulder,elbow,wrist\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("shoulder,elbo,wrist\n1,2,3\n", r"line 1: there is no joint 'elbo' \(nearest is 'elbow'\)"),
        ("shoulder,wrist\n1,2\n", "line 1: the joint 'elbow' is missing"),
        ("shoulder,elbow,wrist,wrist\n1,2,3,4\n", "line 1: the joint 'wrist' is named twice"),
        (HEAD + "1,2,3\n\n4,5\n", "line 4: 2 numbers; the first line names 3 columns"),
        (HEAD + "1,2,3\n4,five,6\n", "line 3, elbow: 'five' is no finite number"),
        (HEAD + "1,2,3\n4,nan,6\n", "line 3, elbow: 'nan' is no finite number"),
        (HEAD + "1,2,3\n", "has 1 points"),
        ("", "has 0 points"),
    ],
)
def test_what_is_wrong_with_a_table_is_named_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(FileFormatError, match=words):
        read_points(table(tmp_path, text), JOINTS)


def message(positions: list) -> str:
    return json.dumps(MESSAGE | {"points": [{"positions": positions}]})


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.json", "{", "not JSON"),
        ("a.yaml", "a: [1", "not YAML"),
        ("a.yaml", "", "no lists joint_names and points"),
        ("a.json", '{"joint_names": ["wrist"], "points": []}', "the joint 'shoulder' is missing"),
        ("a.json", message([1, 2]), r"point 1: positions are \[1, 2\]; give 3"),
        ("a.json", message([1, True, 2]), "point 1, shoulder: True is no"),
        ("a.txt", "", "read from .csv"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_message_is_named(tmp_path: Path, name: str, text: str, words: str) -> None:
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(FileFormatError, match=words):
        read_points(file, JOINTS)


def test_points_given_twice_are_named_with_their_lines(tmp_path: Path) -> None:
    points, places = read_points(table(tmp_path, HEAD + "1,2,3\n4,5,6\n4,5,6\n"), JOINTS)
    with pytest.raises(InputError, match="line 3 of .*path.csv and line 4 of"):
        JointPath.through(points, JOINTS, places=places)


def saved(tmp_path: Path, order: list[int]) -> tuple[Trajectory, Path]:
    curve = cubic_spline_free_ends(POINTS, np.full(7, 0.4))
    mixed = PiecewiseBezier(curve.durations, tuple(points[:, order] for points in curve.control_points))
    trajectory = Trajectory(mixed, tuple(JOINTS[i] for i in order))
    return trajectory, trajectory.save(tmp_path / "motion.json")


def test_a_trajectory_file_gives_its_geometry_with_joints_matched_by_name(tmp_path: Path) -> None:
    _, file = saved(tmp_path, [2, 0, 1])
    path = load_path(file, JOINTS)
    assert path.joints == JOINTS and path.continuity == 2
    assert np.abs(path.points[[0, 2, 3, 4, 5, 7]] - POINTS).max() < 1e-15
    with pytest.raises(FileFormatError, match="its joint 'wrist' is none of the robot's"):
        load_path(file, ("shoulder", "elbow", "hand"))
    with pytest.raises(FileFormatError, match="the joint 'hand' is missing"):
        load_path(file, (*JOINTS, "hand"))
    with pytest.raises(InputError, match="no run folder"):
        load_path(file, JOINTS, point=1)


def test_points_of_a_file_are_joined_by_a_spline(tmp_path: Path) -> None:
    file = tmp_path / "path.json"
    file.write_text(json.dumps(MESSAGE))
    for degree, continuity in ((3, 2), (5, 4)):
        path = load_path(file, JOINTS, degree=degree)
        assert np.abs(path.points - POINTS).max() < 1e-13 and path.continuity == continuity


@pytest.mark.slow
def test_a_run_with_many_trajectories_is_asked_which(tmp_path: Path) -> None:
    problem = ot.problems.load("rotor-353")
    front = ot.pareto(problem, ["time", "effort"], points=2)
    folder = ot.save_run(front, tmp_path / "run")
    names = front.points[0].trajectory.joints
    with pytest.raises(InputError, match="has 2 trajectories; say which, point = 0 to 1"):
        load_path(folder, names)
    with pytest.raises(InputError, match="there is no point 2"):
        load_path(folder, names, point=2)
    path = load_path(folder, names, point=1)
    assert path.curve.durations.tolist() == front.points[1].trajectory.curve.durations.tolist()
