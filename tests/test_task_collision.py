"""A task with obstacles: solved, proved, and clear by a scan that knows nothing of how."""

from __future__ import annotations

import json
import tomllib
from functools import cache
from pathlib import Path

import casadi
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.formulation.task_file import task_of
from ocp_traj.formulation.task_resolution import resolve
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.symbolic import motion_of
from ocp_traj.transcription.transcription import transcribe
from ocp_traj.transcription.worst_instants import near_instants, worst_instants
from tests.independent.bodies import Pair, curve_at
from tests.test_collision_table import LINK, ROBOT

EXAMPLE = Path(__file__).parents[1] / "examples" / "tasks" / "ur5-obstacles.toml"
TOOL = """
[[collision.link]]
name = "gripper"
frame = "tool"
sphere = { centre = [0.0, 0.0, 0.05], radius = 0.05 }
"""
POST = """
[[collision.obstacle]]
name = "post"
capsule = { from = [0.5, 0.0, -0.2], to = [0.5, 0.0, 0.55], radius = 0.12 }
"""
# The straight way runs through the post, and the shortest motion comes as near to it as it may.
CELL = ROBOT.replace("self = false", "self = false\nclearance = 0.02") + LINK + TOOL + POST


@cache
def _problem() -> ot.Problem:
    return ot.problems.load("task", **resolve(task_of(tomllib.loads(CELL)), Path()).fields())


@cache
def _solution() -> ot.Solution:
    return ot.solve(_problem(), seed=0)


def _scanned(solution: ot.Solution, number: int) -> float:
    """The least distance to obstacles of a solution at evenly spread instants."""
    trajectory = solution.trajectory
    (limit,) = (c for c in trajectory.origin.requirements.clearance_constraints if c.id == "obstacles")
    pairs = [Pair(limit.robot.model, limit.bodies[i], limit.bodies[j]) for i, j in limit.pairs]
    durations, points = np.asarray(trajectory.curve.durations), list(trajectory.curve.control_points)
    times = np.linspace(0.0, float(durations.sum()), number)
    return min(pair.distance(curve_at(durations, points, t)) for t in times.tolist() for pair in pairs)


@pytest.mark.slow
def test_a_motion_past_an_obstacle_is_solved_and_proved() -> None:
    solution = _solution()
    assert solution.ok and solution.audit.proved
    rows = [row for row in solution.audit.rows if row.limit == "obstacles"]
    assert {row.label for row in rows} == {"rod - post", "gripper - post"}
    nearest = min(rows, key=lambda row: row.attained)
    assert nearest.attained - min(row.proved_bound for row in rows) <= 1e-4
    assert nearest.attained == pytest.approx(0.02, abs=1e-6)
    # Between instants 0.6 ms apart the distance differs by less than 1 mm, and near its least by far less.
    scanned = _scanned(solution, 2000)
    assert nearest.attained - 1e-9 <= scanned <= nearest.attained + 1e-5
    assert nearest.attained - 1.01e-4 <= solution.objectives["clearance"] <= nearest.attained


@pytest.mark.slow
def test_without_the_obstacle_it_is_faster() -> None:
    free = ot.problems.load("task", **{k: v for k, v in _problem().case.fields().items() if k != "collision"})
    assert ot.solve(free, seed=0).objectives["time"] < _solution().objectives["time"] - 1e-3


def test_the_trajectory_file_is_enough_to_prove_it_again(tmp_path: Path) -> None:
    again = ot.Trajectory.load(_solution().trajectory.save(tmp_path / "t.json")).audit()
    assert again.proved
    assert [r.attained for r in again.rows if r.limit == "obstacles"] == [
        r.attained for r in _solution().audit.rows if r.limit == "obstacles"
    ]


def test_a_file_that_claims_more_clearance_than_it_keeps_is_refused(tmp_path: Path) -> None:
    data = _solution().trajectory.to_dict()
    data["parameters"]["clearance"] += 1e-3
    data["variables"]["margin"][0] += 1e-3
    (row,) = (r for r in ot.Trajectory.from_dict(data).audit().rows if r.verdict == "violated")
    assert row.limit == "obstacles"


@pytest.mark.slow
def test_most_clearance_is_what_start_and_goal_leave() -> None:
    found = ot.solve(_problem(), objective="clearance", seed=0)
    assert found.audit.proved
    assert found.objectives["clearance"] == pytest.approx(_problem().upper[-1], abs=2e-6)


def test_derivatives_of_the_rows_are_those_of_their_values() -> None:
    problem = _problem()
    x = _solution().x + 1e-3 * np.random.default_rng(0).normal(size=problem.size)
    first = near_instants(problem, x)
    rows = [(i, row) for i in first for row in i.rows or ()][::5]
    moving = [i for i in worst_instants(problem, x, 0.02)[0] if i.limit == "obstacles"]
    assert any(i.moves for i in moving)
    instants = [*(Instant(i.limit, i.segment, i.u + 0.01, (row,)) for i, row in rows), *moving]
    nlp = transcribe(problem, WeightedSum({"time": 1.0}), instants)
    program, step = nlp.program, 1e-6
    multipliers = np.random.default_rng(1).normal(size=program.rows)

    def jacobian(at: np.ndarray) -> np.ndarray:
        return np.array(casadi.DM(program.jacobian_sparsity, program.jacobian(at)))

    start = nlp.start(x)
    bend = np.array(casadi.DM(program.hessian_sparsity, program.hessian(start, 1.0, multipliers)))
    bend = bend + np.triu(bend, 1).T
    near = start + step * np.concatenate([np.eye(len(start)), -np.eye(len(start))])
    values = np.array([program.values(point)[1] for point in near])
    slopes = np.array([jacobian(point).T @ multipliers + program.gradient(point) for point in near])
    n = len(start)
    np.testing.assert_allclose(jacobian(start), (values[:n] - values[n:]).T / (2.0 * step), atol=1e-6)
    np.testing.assert_allclose(bend, (slopes[:n] - slopes[n:]).T / (2.0 * step), atol=1e-4)


@pytest.mark.slow
def test_starts_go_around_and_are_the_same_from_the_same_seed() -> None:
    problem = _problem()
    (limit,) = problem.chosen_limits
    shape = [problem.guess(np.random.default_rng([0, i])) for i in range(6)]
    assert all(np.array_equal(x, problem.guess(np.random.default_rng([0, i]))) for i, x in enumerate(shape))

    def least(q: np.ndarray) -> float:
        """By how much the nearest bodies are farther apart than they have to be, over postures."""
        p = [0.02 if name == "clearance" else 0.0 for name in problem.requirements.parameters]
        return float(limit.above(q, np.tile(p, (len(q), 1)), 1.0).min())

    times = np.linspace(0.0, 1.0, 60)
    assert least(np.linspace(*(np.array(q) for q in problem.case.move[0].via), 60)) < -0.1  # straight, through the post
    for x in shape:
        curve = problem.curve(x)
        assert least(curve(times * float(curve.duration))) > -0.02  # nothing overlaps


@pytest.mark.slow
def test_the_example_with_whole_links_is_proved() -> None:
    problem = ot.problems.load("task", file=str(EXAMPLE), **{"curve.finest": 2})
    solution = ot.solve(problem, seed=0, starts=1)
    assert solution.audit.proved
    rows = [row for row in solution.audit.rows if row.limit in ("obstacles", "self-collision")]
    nearest = min((row for row in rows if row.limit == "obstacles"), key=lambda row: row.attained)
    least = min(row.proved_bound for row in rows if row.limit == "obstacles")
    assert nearest.attained - least <= 1e-4
    assert least - 1e-9 <= _scanned(solution, 1000) <= nearest.attained + 1e-4


def test_a_free_payload_and_the_clearance_are_both_parameters() -> None:
    problem = ot.problems.load("task", **_problem().case.fields(), free_payload=True)
    assert problem.requirements.parameters == ("payload", "clearance")
    x = problem.guess(np.random.default_rng(0))
    assert motion_of(problem, x).parameters == {"payload": x[-1], "clearance": x[-2]}
    assert problem.tighten_slacks(x).shape == x.shape and problem.dilate(x, 2.0)[-2] == x[-2]


@pytest.mark.slow
def test_links_that_are_left_out_are_told_with_every_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert not _problem().about.notes
    fields = _problem().case.fields()
    fields["collision"] = {**fields["collision"], "touching": [["rod", "gripper"]]}
    (note,) = ot.problems.load("task", **fields).about.notes
    assert "not looked at" in note and note.endswith("rod - gripper")
    data = _solution().trajectory.to_dict()
    data["case"]["collision"] = {**data["case"]["collision"], "touching": [["rod", "gripper"]]}
    ot.Trajectory.from_dict(data).save(tmp_path / "t.json")
    assert run(["audit", str(tmp_path / "t.json"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["notes"] == [note]
    assert run(["audit", str(tmp_path / "t.json")]) == 0
    assert "rod - gripper" in capsys.readouterr().out
