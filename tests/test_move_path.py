"""The path of a move: points of a file, or a motion, whose geometry retiming keeps exactly."""

import json
import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.curves.families import cubic_spline_free_ends
from ocp_traj.errors import InputError
from ocp_traj.formulation.move_path import retimed_path
from ocp_traj.formulation.route import route_of
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_file import load_path
from ocp_traj.results.starts import levels_to

EXAMPLES = Path(__file__).parent.parent / "examples" / "tasks"
TEXT = (EXAMPLES / "ur5-retime.toml").read_text().replace('"retime"', '"retime"\npieces = 1')
POINTS = np.loadtxt(EXAMPLES / "ur5-path.csv", delimiter=",", skiprows=1)
NAMES = (EXAMPLES / "ur5-path.csv").read_text().splitlines()[0].replace(" ", "").split(",")


def task(folder: Path, path: str, *changes: tuple[str, str]) -> ot.Problem:
    text = TEXT.replace("ur5-path.csv", path)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "x.toml").write_text(text)
    return ot.problems.load("task", file=str(folder / "x.toml"))


def path_of(problem: ot.Problem) -> JointPath:
    robot = problem.robot
    return retimed_path(problem.case, route_of(problem.case, robot.size), robot.joints, robot.limits)


def motion(folder: Path) -> ot.Trajectory:
    found = ot.Trajectory(cubic_spline_free_ends(POINTS, np.full(len(POINTS) + 1, 0.8)), tuple(NAMES))
    found.save(folder / "motion.json")
    return found


def message(times: bool, velocities: bool) -> str:
    points = [
        {"positions": q.tolist()}
        | ({"time_from_start": {"sec": i, "nanosec": 0}} if times else {})
        | ({"velocities": [0.1 * i] * len(q)} if velocities else {})
        for i, q in enumerate(POINTS)
    ]
    return json.dumps({"joint_names": NAMES, "points": points})


@pytest.mark.slow
def test_a_trajectorys_own_curve_is_the_geometry_to_the_last_bit(tmp_path: Path) -> None:
    given = motion(tmp_path)
    problem = task(tmp_path, "motion.json")
    path = path_of(problem)
    assert path.continuity == 2 and np.array_equal(path.curve.durations, given.curve.durations)
    assert all(map(np.array_equal, path.curve.control_points, given.curve.control_points))
    again = ot.problems.load("task", **json.loads(json.dumps(problem.case.fields())))  # as a trajectory's file has it
    assert all(map(np.array_equal, path_of(again).curve.control_points, given.curve.control_points))


@pytest.mark.slow
def test_a_trajectory_is_retimed_and_proved(tmp_path: Path) -> None:
    given = motion(tmp_path)
    solution = ot.solve(task(tmp_path, "motion.json"))
    assert solution.audit is not None and solution.audit.proved and solution.trajectory is not None
    own = solution.trajectory.curve
    # Every place of the motion is on the given curve: there is an instant of that with the same joints.
    fine = given.curve(np.linspace(0.0, given.duration, 20_001))
    for q in own(np.linspace(0.0, float(own.duration), 20)):
        assert np.abs(fine - q).max(axis=1).min() < 2e-4  # half a step of the grid, 0.2 ms, at 2 rad/s


def test_other_curves_pass_the_knots_of_a_trajectory(tmp_path: Path) -> None:
    given = motion(tmp_path)
    problem = task(tmp_path, "motion.json", ('"retime"\npieces = 1', '"quintic"'))
    assert np.array_equal(problem.case.move[0].via, given.curve(given.curve.knots))


def test_a_message_with_times_and_velocities_is_a_motion_and_without_are_points(tmp_path: Path) -> None:
    for i, (times, velocities) in enumerate([(True, True), (True, False), (False, False), (False, True)]):
        (tmp_path / f"{i}.yaml").write_text(message(times, velocities))
    first = load_path(tmp_path / "0.yaml", NAMES)
    assert first.continuity == 1 and np.allclose(first.curve.at(2, 0.0, 1), 0.2)
    spline = JointPath.through(POINTS, NAMES)
    for i in (1, 2, 3):
        path = load_path(tmp_path / f"{i}.yaml", NAMES)
        assert all(map(np.array_equal, path.curve.control_points, spline.curve.control_points))
    with pytest.raises(InputError, match="jerk is limited, and the path's derivatives are continuous up to the 1."):
        task(tmp_path, "0.yaml")
    assert task(tmp_path, "0.yaml", ("jerk = 60.0", 'jerk = "none"')).size > 0


def test_a_table_of_samples_is_a_motion(tmp_path: Path) -> None:
    head = ",".join(["time [s]", *(f"{name} {k}" for k in "qv" for name in NAMES)])
    rows = [",".join(map(str, [i, *q, *(0.5 * q)])) for i, q in enumerate(POINTS)]
    (tmp_path / "t.csv").write_text("\n".join([head, *rows]) + "\n")
    path = load_path(tmp_path / "t.csv", NAMES)
    np.testing.assert_allclose(path.curve.at(1, 0.0, 1), 0.5 * POINTS[1:2], rtol=1e-12)


@pytest.mark.slow
def test_a_limit_on_snap_takes_a_spline_of_degree_five(tmp_path: Path) -> None:
    shutil.copy(EXAMPLES / "ur5-path.csv", tmp_path)
    path = path_of(task(tmp_path, "ur5-path.csv", ("jerk = 60.0", "jerk = 60.0\nsnap = 2000.0")))
    assert path.continuity == 4 and set(path.curve.degrees) == {5}
    np.testing.assert_allclose(path.points, POINTS, atol=1e-12)
    line = JointPath.through(POINTS[:2], NAMES, degree=5)
    np.testing.assert_allclose(line.curve.at(0, 0.5)[0], POINTS[:2].mean(axis=0), atol=1e-12)


def test_a_dwell_is_no_part_of_the_geometry(tmp_path: Path) -> None:
    given = motion(tmp_path)
    data = given.to_dict()
    data["durations"].append(0.5)
    data["control_points"].append([data["control_points"][-1][-1]] * 4)
    (tmp_path / "dwell.json").write_text(json.dumps(data))
    path = load_path(tmp_path / "dwell.json", NAMES)
    assert np.array_equal(path.curve.durations, given.curve.durations)


@pytest.mark.parametrize(
    ("path", "change", "words"),
    [
        ("run", "", "run has 2 trajectories; say which, point = 0 to 1"),
        ("run", "\npoint = 2", "there is no point 2"),
        ("motion.json", "\npoint = 0", "no run folder"),
        ("empty", "", "empty has no trajectories/000.json"),
        ("nothing.json", "", "nothing.json"),
        ("motion.json", "\npoint = -1", r"point is -1; give a whole number from 0 up"),
        ("other.json", "", "its joint 'a' is none of the robot's"),
        ("still.json", "", "does not move"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_path_is_told_in_one_line(tmp_path: Path, path: str, change: str, words: str) -> None:
    data = motion(tmp_path).to_dict()
    (tmp_path / "run" / "trajectories").mkdir(parents=True)
    (tmp_path / "empty").mkdir()
    for i in range(2):
        shutil.copy(tmp_path / "motion.json", tmp_path / "run" / "trajectories" / f"00{i}.json")
    (tmp_path / "other.json").write_text(json.dumps(data | {"joints": ["a", *NAMES[1:]]}))
    (tmp_path / "still.json").write_text(
        json.dumps(data | {"durations": [1.0], "control_points": [[POINTS[0].tolist()] * 4]})
    )
    with pytest.raises(InputError, match=words) as caught:
        task(tmp_path, path, (f'path = "{path}"', f'path = "{path}"{change}'))
    assert "\n" not in str(caught.value)


def test_a_point_of_a_run_is_a_path(tmp_path: Path) -> None:
    given = motion(tmp_path)
    (tmp_path / "run" / "trajectories").mkdir(parents=True)
    for i in range(2):
        given.dilate(1.0 + i).save(tmp_path / "run" / "trajectories" / f"00{i}.json")
    problem = task(tmp_path, "run", ('path = "run"', 'path = "run"\npoint = 1'))
    assert np.array_equal(path_of(problem).curve.durations, 2.0 * given.curve.durations)


def test_geometry_has_to_pass_the_points(tmp_path: Path) -> None:
    motion(tmp_path)
    fields = task(tmp_path, "motion.json").case.fields()
    fields["move"][0]["via"][1][0] += 0.1
    with pytest.raises(InputError, match="geometry does not pass the points of via"):
        ot.problems.load("task", **fields)


@pytest.mark.slow
def test_a_path_with_limits_up_to_snap_is_solved_by_levels_of_four_times_the_pieces(tmp_path: Path) -> None:
    rows = (EXAMPLES / "ur5-path.csv").read_text().splitlines()
    (tmp_path / "three.csv").write_text("\n".join(rows[:4]) + "\n")
    given = ('"retime"\npieces = 1', '"retime"'), ("jerk = 60.0", "jerk = 60.0\nsnap = 1500.0")
    problem = task(tmp_path, "three.csv", *given)
    assert path_of(problem).continuity >= 3
    found = ot.solve(problem)
    assert found.audit is not None and found.audit.proved and "snap-limit" in {row.limit for row in found.audit.rows}
    coarse, fine = levels_to(problem)
    assert [len(p.variables[0].labels) for p in (coarse, fine)] == [2, 8]
    alone = ot.solve(coarse)
    assert found.f < 0.99 * alone.f and f"by levels: {alone.f:.6g} of" in found.detail


@pytest.mark.slow
@pytest.mark.parametrize("pieces, factors", [(16, [4, 4]), (8, [2, 4]), (6, [2, 3]), (7, [7])])
def test_levels_have_at_most_four_times_the_pieces_of_the_coarser(
    tmp_path: Path, pieces: int, factors: list[int]
) -> None:
    (tmp_path / "two.csv").write_text("\n".join((EXAMPLES / "ur5-path.csv").read_text().splitlines()[:3]))
    problem = task(tmp_path, "two.csv", ('"retime"\npieces = 1', f'"retime"\npieces = {pieces}'))
    counts = [len(level.variables[0].labels) for level in levels_to(problem)]
    assert [fine / coarse for coarse, fine in pairwise(counts)] == factors
