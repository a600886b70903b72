"""Corners of tool paths rounded: their geometry, motions that do not stop there, and what is refused in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import ocp_traj as ot
from ocp_traj.errors import InputError
from ocp_traj.formulation.route import route_of
from ocp_traj.paths.blending import INSIDE, blended
from ocp_traj.paths.cartesian import Section

TASK = tomllib.loads((Path(__file__).parent.parent / "examples" / "tasks" / "ur5-line.toml").read_text())
START = [0.0, -1.3, 1.4, -1.6, -1.5, 0.0]
PLACE = np.array([0.5925832, 0.1149717, 0.3709281])  # of the tool there
TOLERANCE = {"position": 1e-3, "tilt": 0.035}
LINES = [{"line": {"by": by}} for by in ([0.0, 0.15, 0.0], [-0.1, 0.05, 0.0], [0.0, 0.0, -0.1])]
ARC = {"arc": {"centre": (PLACE + [0.1, 0.15, 0.0]).tolist(), "axis": [0.0, 0.0, 1.0], "angle": 0.5}}
RADIUS = 0.02


def _problem(*moves: dict[str, Any]) -> ot.Problem:
    full = [{"tolerance": TOLERANCE} | move for move in moves]
    full[0] = {"start": START} | full[0]
    return ot.problems.load("task", **(TASK | {"move": full, "curve": {"kind": "auto", "finest": 2}}))


def test_arcs_touch_both_lines_and_are_well_inside_their_balls() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        here = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
        first = Section.line(here, rng.normal(size=3), 0.3 * rng.normal(size=3))
        corner = first.at(first.length)
        second = Section.line(corner, rng.normal(size=3), 0.3 * rng.normal(size=3))
        if first.tangent @ second.tangent < -0.9:
            continue
        radius, tilt = rng.uniform(0.05, 0.5) * min(first.length, second.length), rng.uniform(0.02, 0.5)
        path = blended([first, second], [0.0, radius], tilt)
        line, arc, other = path.sections
        assert arc.ball is not None and arc.ball.radius == radius and path.corners == (0,)
        np.testing.assert_allclose(arc.ball.frame.translation, corner.translation, atol=1e-12)
        for at, before, after in ((path.ends[1], line, arc), (path.ends[2], arc, other)):
            np.testing.assert_allclose(before.direction(before.length)[0], after.tangent, atol=1e-9)
            np.testing.assert_allclose(before.at(before.length).homogeneous, path.at(at).homogeneous, atol=1e-9)
        np.testing.assert_allclose(path.at(path.length).homogeneous, second.at(second.length).homogeneous, atol=1e-9)
        for s in np.linspace(path.ends[1], path.ends[2], 20):
            off = path.at(s)
            assert np.linalg.norm(off.translation - corner.translation) <= INSIDE * radius * (1.0 + 1e-9)
            assert np.linalg.norm(pin.log3(corner.rotation.T @ off.rotation)) <= tilt
        before, round_, after = path.legs()
        assert round_.section is arc
        reach = np.linalg.norm(corner.translation - line.at(line.length).translation)
        assert before.window == pytest.approx((0.0, line.length + reach))  # up to the corner, on either side
        assert after.window == pytest.approx((-reach, other.length))


BROKEN = [
    ([LINES[0] | {"blend": RADIUS}], r"\[\[move\]\] 1: the blend of move 1 has no corner to round"),
    (
        [LINES[0] | {"blend": RADIUS}, {"goal": START, "tolerance": 0.0}],
        r"\[\[move\]\] 1: the blend of move 1 has no corner to round",
    ),
    ([LINES[0] | {"blend": 0.06}, LINES[1]], r"its blend is 0.06 m, at the corner of a line of 0.1118\d+ m; give at"),
    ([LINES[0] | {"blend": 5e-4}, LINES[1]], r"its blend is 0.0005 m; give more than the tolerance of position, 0.001"),
    ([LINES[0] | {"blend": -1.0}, LINES[1]], r"blend is -1.0; give a length above zero"),
    ([LINES[0] | {"blend": RADIUS}, ARC], r"at the end of an arc; it rounds the corner between two lines"),
    (
        [LINES[0] | {"blend": RADIUS}, {"line": {"by": [0.0, -0.1, 0.001]}}],
        r"turns back by 179\.4 degrees at the corner of its blend, which rounds corners of up to 170",
    ),
    ([LINES[0] | {"blend": RADIUS, "dwell": 1.0}, LINES[1]], r"has dwell and blend; the robot does not stand still"),
    (
        [LINES[0] | {"blend": RADIUS}, LINES[1] | {"free_turn": True}],
        r"its blend leads to move 2, which has another free_turn; give both the same",
    ),
    ([LINES[0] | {"blend": RADIUS}, LINES[1] | {"start": START}], r"those behind a blend begin where it ends"),
    (
        [LINES[0] | {"blend": RADIUS, "speed": {"value": 0.1, "run_up": 0.15}}]
        + [LINES[1] | {"speed": {"value": 0.1, "run_up": 0.15}}],
        r"its run_up is 0.15 m; give more|its run_up of 0.15 m ends within a blend",
    ),
    ([{"goal": START, "tolerance": 0.0, "blend": RADIUS}], r"has blend, which is of a tool path"),
]  # fmt: skip


@pytest.mark.parametrize(("moves", "words"), BROKEN)
def test_what_is_wrong_with_a_blend_is_told_in_one_line(moves: list[dict[str, Any]], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        _problem(*moves)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_poses_and_moves_are_rounded_alike_and_told() -> None:
    problem = _problem(LINES[0] | {"blend": RADIUS}, LINES[1] | {"blend": RADIUS}, LINES[2])
    ((first, move),) = route_of(problem.case, 6).tool_moves
    assert first == 0 and move.round == (1, 3) and len(move.legs) == 5 and len(problem.case.move) == 1
    straight = [0.0, -0.7053, 0.7071, 0.05]
    ends = np.cumsum([one["line"]["by"] for one in LINES], axis=0) + PLACE
    poses = {"poses": [[*place, *straight] for place in ends], "blend": RADIUS}
    ((_, other),) = route_of(_problem(poses).case, 6).tool_moves
    assert other.round == (1, 3)
    assert other.path.length == pytest.approx(move.path.length, rel=1e-4)
    assert any("3 lines" in note and "2 corners rounded within 20 mm" in note for note in problem.about.notes)
    assert ot.problems.load("task", **problem.case.fields()).case == problem.case  # a trajectory's file is enough


@pytest.mark.slow
def test_a_motion_round_corners_does_not_stop_and_is_where_it_may_be_at_every_instant_of_a_scan(tmp_path: Path) -> None:
    problem = _problem(LINES[0] | {"blend": RADIUS}, LINES[1] | {"blend": RADIUS}, LINES[2])
    solution = ot.solve(problem)
    assert solution.audit is not None and solution.audit.proved and solution.trajectory is not None
    assert solution.trajectory.duration < 1.65  # [s]; 2.16 with stops
    found = solution.trajectory
    times = np.linspace(0.0, found.duration, 8001)
    _, tool = problem.robot.poses(found.curve(times))
    corners = np.cumsum([[0.0] * 3, *(one["line"]["by"] for one in LINES)], axis=0) + problem.robot.poses([START])[1][0]
    off = []
    for a, b in zip(corners, corners[1:], strict=False):
        share = np.clip((tool - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        off.append(np.linalg.norm(tool - a - share[:, None] * (b - a), axis=1))
    near = np.min([np.linalg.norm(tool - corner, axis=1) for corner in corners[1:-1]], axis=0)
    assert ((np.min(off, axis=0) <= 1e-3 + 1e-9) | (near <= RADIUS + 1e-9)).all()
    assert near.min() > 2e-3  # it does leave the corners
    speed = np.linalg.norm(np.diff(tool, axis=0), axis=1) / np.diff(times)
    assert speed[1000:-1000].min() > 0.1  # [m/s]
    assert ot.Trajectory.load(found.save(tmp_path / "t.json")).audit().proved
