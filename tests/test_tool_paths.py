"""Tasks with tool paths: solved and proved, seen by an independent scan, told to people, and refused in one line."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.route import route_of
from ocp_traj.formulation.task import ToleranceTable

FILE = Path(__file__).parent.parent / "examples" / "tasks" / "ur5-line.toml"
LINE = FILE.read_text()
START = [0.0, -1.3, 1.4, -1.6, -1.5, 0.0]
PLACE = np.array([0.5925832, 0.1149717, 0.3709281])  # of the tool there
BY = "line = { by = [0.0, 0.3, 0.05] }"
TOLERANCE = "tolerance = { position = 1e-3, tilt = 0.035 }"
ARC = "arc = { centre = [0.6, 0.2, 0.4], axis = [0, 0, 1], angle = 0.5 }"
WEST = "quat_wxyz = [0, -0.7053, 0.7071, 0.05]"

# What stands in place of what, and what the complaint says of it.
BROKEN = [
    (BY, "line = { }", r"\[\[move\]\] 1: line gives no end; give by or to"),
    (BY, "line = { by = [0, 0.3, 0], to = [1, 1, 1] }", r"line gives by and to; give one of them"),
    (BY, "line = { by = [0.0, 0.3] }", r"line.by is \[0.0, 0.3\]; give three numbers"),
    (BY, "line = { by = [0.0, 0.0, 0.0] }", r"\[\[move\]\] 1.*it goes 0 m; a tool path goes 1e-06 m or more"),
    (BY, "line = { by = [0.0, 0.3, 0.0], rpy = [0, 0, 1], " + WEST + " }", r"gives rpy and quat_wxyz; give one"),
    (BY, "line = { by = [0.0, 0.3, 0.0], quat_wxyz = [0, 0, 0, 0] }", r"quat_wxyz that is no rotation; give four"),
    (BY, "line = { bye = [0.0, 0.3, 0.0] }", r"line.bye is not allowed \(nearest is 'by'\)"),
    (BY, f"{BY}\nvia = [[0, 0, 0, 0, 0, 0]]", r"has via and line; give exactly one of via, goal, path, line, arc"),
    (BY, "arc = { via = [0.6, 0.2, 0.4] }", r"arc has via; give via and to, or centre, axis and angle"),
    (BY, ARC.replace("0, 0, 1", "0, 0, 0"), r"arc has an axis of zeros; give three numbers"),
    (BY, ARC.replace("angle = 0.5", "angle = 7"), r"its angle is 7 rad; give one that is not zero and at most"),
    (BY, ARC.replace("angle = 0.5", "angle = 0.5, with_arc = true, rpy = [0, 0, 1]"), r"with_arc and a rotation"),
    (BY, "arc = { via = [0.5925832, 0.2, 0.3709281], to = [0.5925832, 0.3, 0.3709281] }", r"three points lie on"),
    (BY, "poses = []", r"poses is \[\]; give a list of poses"),
    (BY, "poses = [[0.5, 0.2, 0.4]]", r"poses is \[0.5, 0.2, 0.4\]; give seven numbers"),
    (BY, "poses = [{ xyz = [0.5, 0.2, 0.4] }]", r"no rotation; give rpy or quat_wxyz"),
    (BY, "line = { by = [1.5, 0.0, 0.0] }", r"at 0.22\d+ m of 1.5 m along it, at \(.*\) m: out of the arm's reach"),
    (BY, "line = { by = [-0.6, 0.0, 0.0] }", r"at 0.5\d+ m of 0.6 m along it, at \(.*\) m: a singular posture"),
    (BY, "line = { by = [0.0, 0.3, 0.0], quat_wxyz = [0, 0.7071, 0.7053, 0] }", r"half turn, either way"),
    (TOLERANCE, "", r"\[\[move\]\] 1 has no tolerance of its tool path; give tolerance"),
    (TOLERANCE, "tolerance = 1e-3", r"\[\[move\]\] 1 has no tolerance of its tool path; give tolerance"),
    (TOLERANCE, "tolerance = { position = 1e-3 }", r"tolerance.tilt is missing; give an angle above zero"),
    (TOLERANCE, "tolerance = { position = 0.0, tilt = 0.1 }", r"tolerance.position is 0.0; give a length above zero"),
    (TOLERANCE, "tolerance = { position = 1.0, tilt = 0.1 }", r"tolerance of position is 1 m, on a path of 0.304138 m"),
    (TOLERANCE, "tolerance = { position = 1e-3, tilt = 4.0 }", r"tolerance of tilt is 4 rad; give less than a half"),
    (TOLERANCE, TOLERANCE + "\nspeed = -0.1", r"speed is -0.1; give a speed above zero"),
    (TOLERANCE, TOLERANCE + "\nspeed = { value = 0.1, band = 2.0 }", r"speed.band is 2.0; give a share below 1"),
    (TOLERANCE, TOLERANCE + "\nspeed = { value = 0.1, run_up = 0.2 }", r"its run_up is 0.2 m; give more than"),
    (TOLERANCE, TOLERANCE + "\nbegin = { velocity = [0, 0, 0, 0, 0, 0] }", r"a tool path begins and ends at rest"),
    (TOLERANCE, TOLERANCE + "\nblend = 0.01", r"the blend of move 1 has no corner to round"),
    ("start = [0.0, -1.3, 1.4, -1.6, -1.5, 0.0] ", "", r"start is missing; give the joints at which it begins"),
    ("start = [0.0, -1.3, 1.4, -1.6, -1.5, 0.0]", "start = [0.0, 1.0]", r"start has 2 coordinates"),
    ("start = [0.0, -1.3", "start = [9.0, -1.3", r"its start has shoulder_pan_joint beyond its range"),
    ("tool_speed = 0.25", "tool_speed = 0.0", r"\[limits\] tool_speed is 0.0; give a speed above zero"),
    ('kind = "auto"', 'kind = "cubic"', r"a cubic curve goes through points; for tool paths take auto"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words"), BROKEN)
def test_what_is_wrong_with_a_tool_path_is_told_in_one_line(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in LINE
    (tmp_path / "x.toml").write_text(LINE.replace(old, new, 1))
    with pytest.raises(InputError, match=words) as caught:
        ot.problems.load("task", file=str(tmp_path / "x.toml"))
    assert "\n" not in str(caught.value)


def _task(move: dict[str, Any] | list[dict[str, Any]], **changes: Any) -> ot.Problem:
    data = tomllib.loads(LINE)
    moves = move if isinstance(move, list) else [move]
    moves[0].setdefault("start", START)
    for one in moves:
        one.setdefault("tolerance", {"position": 1e-3, "tilt": 0.035})
    data["move"] = moves
    for place, value in changes.items():
        data[place] = data.get(place, {}) | value
    return ot.problems.load("task", **data)


def _scan(problem: ot.Problem, trajectory: Any, count: int = 4000) -> dict[str, np.ndarray]:
    """Distance [m], tilt [rad], speed [m/s] at instants, by Pinocchio and the nearest of many points of the path."""
    ((_, move),) = route_of(problem.case, problem.robot.size).tool_moves
    frames = [move.path.at(s) for s in np.linspace(0.0, move.path.length, 8001)]
    places, spacing = np.array([f.translation for f in frames]), move.path.length / 8000.0
    model, robot = problem.robot.model, problem.robot
    data = model.createData()
    joint = model.njoints - 1 if robot.tool_joint is None else robot.tool_joint
    times = np.linspace(0.0, trajectory.duration, count)
    found: dict[str, list[float]] = {"off": [], "tilt": [], "speed": [], "along": []}
    for q, v in zip(trajectory.curve(times), trajectory.curve(times, 1), strict=True):
        pin.forwardKinematics(model, data, q, v)
        tool = data.oMi[joint] * robot.tool
        gap = np.linalg.norm(places - tool.translation, axis=1)
        i = int(np.argmin(gap))
        goal = frames[i].rotation
        cosine = goal[:, 2] @ tool.rotation[:, 2] if move.free_turn else (np.trace(goal.T @ tool.rotation) - 1.0) / 2.0
        found["off"].append(float(np.sqrt(max(gap[i] ** 2 - (spacing / 2.0) ** 2, 0.0))))
        found["tilt"].append(float(np.arccos(np.clip(cosine, -1.0, 1.0))))
        found["speed"].append(float(np.linalg.norm(robot.tool.actInv(data.v[joint]).linear)))
        found["along"].append(i * spacing)
    return {name: np.array(values) for name, values in found.items()}


def _end(problem: ot.Problem, trajectory: Any) -> tuple[np.ndarray, np.ndarray]:
    rotation, place = problem.robot.poses(trajectory.curve(np.array([trajectory.duration])))
    return rotation[0], place[0]


@pytest.mark.slow
def test_a_line_is_solved_proved_exact_at_its_end_and_keeps_its_tolerances_in_a_scan() -> None:
    problem = ot.problems.load("task", file=str(FILE), **{"curve.finest": 4})
    solution = ot.solve(problem)
    assert solution.audit is not None and solution.audit.proved and solution.trajectory is not None
    assert 0.3041 / 0.25 < solution.trajectory.duration < 1.463  # [s]; the speed allows no less
    found = _scan(problem, solution.trajectory)
    assert found["off"].max() <= 1e-3 + 1e-9 and found["tilt"].max() <= 0.035 + 1e-6
    assert 0.249 < found["speed"].max() <= 0.25 + 1e-9
    rotation, place = _end(problem, solution.trajectory)
    np.testing.assert_allclose(place, problem.robot.poses([START])[1][0] + [0.0, 0.3, 0.05], atol=1e-9)
    np.testing.assert_allclose(rotation, problem.robot.poses([START])[0][0], atol=1e-9)
    rows = {row.limit: row for row in solution.audit.rows}
    assert {"tool-position", "tool-tilt", "tool-speed", "tool-progress"} <= set(rows)
    figures = {name: value for name, value, _ in problem.about.figures(solution.trajectory)}
    assert abs(figures["tool off its path, largest"] - 1e3 * found["off"].max()) < 1e-3


SLOW: list[dict[str, Any]] = [
    {
        "arc": {
            "via": (PLACE + [0.05, 0.1, -0.02]).tolist(), "to": (PLACE + [0.0, 0.2, -0.05]).tolist(), "with_arc": True,
        }
    },
    {"line": {"to": (PLACE + [0.0, 0.2, 0.1]).tolist(), "rpy": [3.1, 0.1, -1.4]}, "free_turn": True},
    {
        "poses": [
            [*(PLACE + [0.0, 0.1, 0.0]), 0, -0.7053, 0.7071, 0.05],
            [*(PLACE + [0.0, 0.1, 0.1]), 0, -0.7, 0.7, 0.1],
        ]
    },
    {"line": {"by": [0.0, 0.3, 0.05]}, "speed": {"value": 0.1, "band": 0.02, "run_up": 0.03}},
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("move", SLOW, ids=["arc", "line that turns", "poses", "constant speed"])
def test_tool_paths_of_every_kind_are_proved_and_keep_their_tolerances_in_a_scan(move: dict[str, Any]) -> None:
    problem = _task(dict(move), curve={"finest": 2})
    solution = ot.solve(problem)
    assert solution.audit is not None and solution.audit.proved and solution.trajectory is not None
    found = _scan(problem, solution.trajectory)
    tolerance = problem.case.move[0].tolerance
    assert isinstance(tolerance, ToleranceTable)
    assert found["off"].max() <= tolerance.position + 1e-8 and found["speed"].max() <= 0.25 + 1e-9
    assert found["tilt"].max() <= tolerance.tilt + 5e-4  # the nearest point of a corner's two sides may be of the other
    if "speed" in move:
        length = float(np.hypot(0.3, 0.05))
        even = (found["along"] > 0.03 + 1e-4) & (found["along"] < length - 0.03 - 1e-4)
        assert even.sum() > 1000
        assert 0.098 - 1e-9 <= found["speed"][even].min() and found["speed"][even].max() <= 0.102 + 1e-9


@pytest.mark.slow
def test_a_line_is_refined_by_levels_which_are_told(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The bound on the tool's speed makes many motions equally quick: a solve must not go from one to the other."""
    assert run(["solve", str(FILE), "-o", str(tmp_path / "t.json")]) == 0
    told = re.search(r"by levels: (.*)", "".join(capsys.readouterr()))
    assert told is not None
    values = [float(value) for value in re.findall(r"([\d.]+) of \d+ variables", told[1])]
    assert len(values) == 3 and values == sorted(values, reverse=True) and values[-1] < 1.3815  # [s]
    assert ot.Trajectory.load(tmp_path / "t.json").audit().proved


@pytest.mark.slow
def test_a_start_along_a_path_keeps_to_it_and_to_its_limits() -> None:
    problem = _task({"arc": {"via": (PLACE + [0.05, 0.1, -0.02]).tolist(), "to": (PLACE + [0.0, 0.2, -0.05]).tolist()}})
    curve = problem.curve(problem.guess(np.random.default_rng(0)))
    times = np.linspace(0.0, float(curve.duration), 500)
    ((_, move),) = route_of(problem.case, problem.robot.size).tool_moves
    places = np.array([move.path.at(s).translation for s in np.linspace(0.0, move.path.length, 4001)])
    _, tool = problem.robot.poses(curve(times))
    assert max(np.linalg.norm(places - p, axis=1).min() for p in tool) < 0.6e-3
    for order in (1, 2):
        assert (np.abs(curve(times, order)) <= 1.05 * problem.robot.limits.bounds(order)[1]).all()


@pytest.mark.slow
def test_moves_follow_one_another_and_the_first_of_poses_may_open_the_branch() -> None:
    pose = [*PLACE, 0.0, -0.7053, 0.7071, 0.05]
    moves = [
        {"poses": [pose, [*(PLACE + [0.0, 0.1, 0.0]), *pose[3:]]], "stop": False},
        {"goal": [0.3, -1.2, 1.3, -1.6, -1.5, 0.3], "tolerance": 0.0},
        {"line": {"by": [0.0, 0.0, -0.1]}},
    ]
    data = tomllib.loads(LINE)
    for one in moves:
        one.setdefault("tolerance", {"position": 1e-3, "tilt": 0.035})
    problem = ot.problems.load("task", **(data | {"move": moves}))
    first, second, third = problem.case.move
    assert first.tool_path is not None and first.tool_path.branch.startswith("the quickest of")
    assert second.tool_path is None and third.tool_path is not None and third.via is not None
    np.testing.assert_allclose(third.via[0], moves[1]["goal"], atol=0.0)
    np.testing.assert_allclose(third.tool_path.pose[:3], problem.robot.poses([moves[1]["goal"]])[1][0], atol=1e-12)
    segments = [limit.segments for limit in problem.requirements.path_constraints if limit.id == "tool-position"]
    count = sum(len(leg) for leg in route_legs(problem))
    assert len(segments) == 1 and 0 in segments[0] and count - 1 in segments[0] and len(segments[0]) < count


def route_legs(problem: ot.Problem) -> list[range]:
    """Ranges of segments, two pieces a leg, as many legs as points allow."""
    legs = len(route_of(problem.case, problem.robot.size).points) - 1
    pieces = problem.curve(problem.guess(np.random.default_rng(0))).segments // legs
    return [range(i * pieces, (i + 1) * pieces) for i in range(legs)]


@pytest.mark.slow
def test_a_corner_is_refused_at_constant_speed_and_units_are_taken_off() -> None:
    pose = [0.0, -0.7053, 0.7071, 0.05]
    poses = [[*(PLACE + [0.0, 0.1, 0.0]), *pose], [*(PLACE + [0.0, 0.1, 0.1]), *pose]]
    with pytest.raises(InputError, match=r"at 0\.1 m of 0\.2 m along it is a corner"):
        _task({"poses": poses, "speed": 0.05})
    mm = LINE.replace('name = "ur5-line"', 'name = "ur5-line"\nunits = { length = "mm", angle = "deg" }')
    changes = [
        ("0.3, 0.05]", "300.0, 50.0]"), ("position = 1e-3, tilt = 0.035", "position = 1.0, tilt = 2.0053523"),
        ("tool_speed = 0.25", "tool_speed = 250.0"), ("= 8.0", "= 458.3662361"), ("= 60.0", "= 3437.7467708"),
        (str(START), str(np.degrees(START).tolist())),
    ]  # fmt: skip
    for old, new in changes:
        mm = mm.replace(old, new)
    ours, plain = (ot.problems.load("task", **tomllib.loads(text)).case for text in (mm, LINE))
    assert ours.move[0].tolerance.position == pytest.approx(1e-3) and ours.limits.tool_speed == pytest.approx(0.25)
    assert ours.move[0].tolerance.tilt == pytest.approx(0.035, rel=1e-7)
    np.testing.assert_allclose(ours.move[0].via, plain.move[0].via, atol=1e-9)


def test_show_tells_what_was_understood_of_a_path(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", str(FILE), "--json"]) == 0
    text = capsys.readouterr().out
    assert "tool path 1: 1 line, 0.304138 m to (0.592583, 0.414972, 0.420928)" in text
    assert "position within 1 mm, tilt within 0.035 rad" in text and "posture at its beginning: as given" in text


def _past(centre: np.ndarray, radius: float, **move: Any) -> ot.Problem:
    ball = {"name": "ball", "sphere": {"centre": centre.tolist(), "radius": radius}}
    flange = {"frame": "tool", "name": "flange", "sphere": {"centre": [0.0, 0.0, 0.03], "radius": 0.03}}
    collision = {"links": "given", "self": False, "link": [flange], "obstacle": [ball], "clearance": 0.005}
    return _task({"line": {"by": [0.0, 0.3, 0.05]}} | move, collision=collision)


@pytest.mark.slow
def test_a_path_through_an_obstacle_is_refused_with_the_place_and_the_bodies() -> None:
    rotation, (place, *_) = ot.Robot.from_description("ur5", tool_frame="tool0").poses([START])
    middle = place + [0.0, 0.15, 0.025] + rotation[0] @ [0.0, 0.0, 0.03]  # of the flange, halfway
    words = (
        r"at 0\.15\d* m of 0\.3041 m along tool path 1, at \(.*\) m: .*(flange and ball|ball and flange) come nearer"
    )
    with pytest.raises(InputError, match=words):
        _past(middle, 0.02)
    # Beside the path by the sum of radii, the clearance and less than the tolerances: they leave room.
    aside = np.cross([0.0, 0.3, 0.05], [1.0, 0.0, 0.0])
    for off, fits in ((0.0545, True), (0.05, False)):
        centre = middle + off * aside / np.linalg.norm(aside)
        if fits:
            _past(centre, 0.02)
        else:
            with pytest.raises(InputError, match=r"by .* mm more than the tolerances of the path make room for"):
                _past(centre, 0.02)
