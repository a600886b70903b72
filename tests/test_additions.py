"""Limits and objectives of one's own on top of a task: solved, proved, at every level, never silently left out."""

from pathlib import Path

import casadi
import numpy as np
import pytest

import ocp_traj as ot
from examples import own_limit
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.results.starts import levels_to
from ocp_traj.transcription.symbolic import evaluate_objectives

ARM = {
    "dh": [
        {"d": 0.4, "alpha": np.pi / 2, "mass": 8.0, "com": [0.0, -0.1, 0.0], "inertia": [0.1, 0.1, 0.05]},
        {"a": 0.5, "mass": 5.0, "com": [-0.25, 0.0, 0.0], "inertia": [0.02, 0.1, 0.1]},
        {"a": 0.4, "mass": 3.0, "com": [-0.2, 0.0, 0.0], "inertia": [0.01, 0.05, 0.05]},
    ],
    "payload": {"mass": 2.0},
}  # three joints, a tool in the last row's frame
LIMITS = {
    "position": [[-3.0] * 3, [3.0] * 3], "velocity": 2.0, "acceleration": 8.0, "jerk": 80.0,
    "effort": [200.0, 200.0, 100.0],
}  # fmt: skip
MOVE = [{"via": [[0.0, 0.9, -1.2], [0.6, 1.2, -1.6], [1.2, 0.7, -0.9]]}]


def _task(**curve: object) -> ot.Task:
    return ot.Task(robot=ARM, limits=LIMITS, curve=curve or {"kind": "quintic"}, move=MOVE)


def _load(**curve: object) -> ot.Problem:
    return ot.problems.load("task", task=_task(**curve))


def _height(s: ot.RobotState) -> casadi.SX:
    return s.position[2]


def _speeds(moved: ot.Trajectory, robot: ot.Robot) -> np.ndarray:
    """Squares of the tool's speed at many instants, by differences of its place [m2/s2]."""
    t = np.linspace(0.0, moved.duration, 20001)
    place = robot.poses(moved.curve(t))[1]
    return np.asarray((np.diff(place, axis=0) ** 2).sum(axis=1) / np.diff(t) ** 2)


@pytest.mark.slow
def test_a_limit_of_ones_own_is_proved_and_shapes_the_motion() -> None:
    plain = _load()
    free = ot.solve(plain)
    assert free.trajectory is not None
    most = 0.7 * float(_speeds(free.trajectory, plain.robot).max())
    problem = ot.with_limit(plain, "tool-speed", own_limit.tool_speed, upper=most, unit="m2/s2")
    found = ot.solve(problem)
    assert found.audit is not None and found.audit.proved and found.trajectory is not None
    (row,) = [row for row in found.audit.rows if row.limit == "tool-speed"]
    assert row.unit == "m2/s2" and row.attained == pytest.approx(most, rel=1e-6)
    reached = _speeds(found.trajectory, plain.robot).max()
    assert 0.999 * most < reached <= most * (1.0 + 1e-9)  # a chord is no faster than its arc
    assert found.f > free.f
    assert not ot.audit(free.trajectory, problem.requirements).proved


@pytest.mark.slow
def test_an_addition_holds_at_every_level() -> None:
    problem = ot.with_limit(_load(kind="auto", finest=2), "torque", lambda s: s.tau[0], -12.0, 12.0, "N m")
    problem = ot.with_objective(problem, "heat", lambda s: casadi.sumsqr(s.tau / 100.0), "s", worst=9.0)
    assert problem.levels is not None and problem.levels.finer is not None
    finer = problem.levels.finer()
    for level in (*levels_to(problem), finer, *levels_to(finer)):
        assert level.id == "task + torque + heat" and "torque" in level.requirements.ids
        assert level.objective("heat").unit == "s" and level.reference_point["heat"] == 9.0
    found = ot.solve(problem)
    assert found.trajectory is not None and found.trajectory.origin is not problem  # a finer level
    assert found.audit is not None and found.audit.proved
    (row,) = [row for row in found.audit.rows if row.limit == "torque"]
    assert abs(row.attained) <= 12.0 + 1e-9


def test_efforts_and_poses_are_those_of_the_robot() -> None:
    problem = _load()
    more = ot.with_limit(problem, "own", lambda s: [s.tau, s.position, s.rotation[:, 0]], upper=1e6)
    limit = more.requirements.path_constraints[-1]
    rng = np.random.default_rng(5)
    states = rng.normal(size=(15, 1))
    value = np.array(more.requirements.function(limit)(states, 0.0, 2.0, casadi.DM(0, 1))).ravel()
    q, v, a = np.split(states.ravel()[:9], 3)
    rotation, position = (part[0] for part in problem.robot.poses(q[None]))
    effort = next(one for one in problem.requirements.path_constraints if one.id == "effort-limit")
    tau = np.array(problem.requirements.function(effort)(states, 0.0, 2.0, casadi.DM(0, 1))).ravel()
    np.testing.assert_allclose(value, np.concatenate([tau, position, rotation[:, 0]]), rtol=1e-14, atol=1e-14)
    assert limit.labels[0] == "row 1" and len(limit.labels) == 9


@pytest.mark.slow
def test_an_objective_of_ones_own_is_the_integral_that_it_says() -> None:
    plain = _load()
    problem = ot.with_objective(plain, "squares", lambda s: casadi.sumsqr(s.v), "rad2/s", worst=20.0)
    found = ot.solve(problem, objective="time")
    assert found.trajectory is not None
    t = np.linspace(0.0, found.trajectory.duration, 4001)
    expected = np.trapezoid((found.trajectory.curve(t, 1) ** 2).sum(axis=1), t)
    assert found.objectives["squares"] == pytest.approx(float(expected), rel=1e-6)
    front = ot.pareto(problem, ["time", "squares"], points=3)
    assert len(front) == 3 and all(front.audit(i).proved for i in range(3))


@pytest.mark.slow
def test_a_file_of_it_is_not_audited_without_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = ot.with_limit(_load(), "ceiling", _height, upper=2.0, unit="m")
    found = ot.solve(problem)
    assert found.trajectory is not None
    file = found.trajectory.save(tmp_path / "t.json")
    capsys.readouterr()
    assert run(["audit", str(file)]) == 2
    words = capsys.readouterr().err
    assert "'task + ceiling' has what no file holds, ceiling, added to task in Python" in words
    assert words.count("\n") == 1
    assert ot.audit(ot.Trajectory.load(file), problem.requirements).proved


@pytest.mark.slow
def test_a_file_of_an_importable_problem_is_audited_with_it(tmp_path: Path) -> None:
    found = ot.solve(own_limit.build())
    assert found.trajectory is not None and found.audit is not None and found.audit.proved
    file = found.trajectory.save(tmp_path / "t.json")
    assert ot.Trajectory.load(file).problem == "examples.own_limit:build"
    again = ot.Trajectory.load(file).audit()
    assert again.proved and "tool-speed" in {row.limit for row in again.rows}
    assert run(["audit", str(file)]) == 0
    light = ot.problems.load("examples.own_limit:build", **{"robot.payload.mass": "1.5"})
    assert light.case.robot.payload.mass == 1.5 and "tool-speed" in light.requirements.ids


@pytest.mark.slow
def test_efforts_have_what_each_move_carries() -> None:
    first, *others = MOVE[0]["via"]
    moves = [{"via": [first, others[0]]}, {"goal": others[1], "payload": {"mass": 6.0}}]
    problem = ot.problems.load("task", robot=ARM, limits=LIMITS, curve={"kind": "quintic"}, move=moves)
    most = casadi.DM(LIMITS["effort"])
    problem = ot.with_objective(problem, "own", lambda s: casadi.sumsqr(s.tau / most), "s")
    problem = ot.with_limit(problem, "own-limit", lambda s: s.tau[1:], -150.0, 150.0, "N m")
    assert problem.requirements.path_constraints[-1].constants is not None
    values = evaluate_objectives(problem, problem.guess(np.random.default_rng(0)))
    assert values["own"] == pytest.approx(values["effort"], rel=1e-12)
    found = ot.solve(problem)
    assert found.audit is not None and found.audit.proved
    own, effort = ([r.attained for r in found.audit.rows if r.limit == n] for n in ("own-limit", "effort-limit"))
    np.testing.assert_allclose(own, effort[1:], rtol=1e-9)


def test_what_cannot_be_added_is_refused() -> None:
    plain = _load()
    with pytest.raises(InputError, match="the limit 'x' has no bound; give lower, upper or both"):
        ot.with_limit(plain, "x", _height)
    with pytest.raises(InputError, match="the objective 'x' has 3 rows; give a scalar"):
        ot.with_objective(plain, "x", lambda s: s.v)
    with pytest.raises(InputError, match="the id 'time' is used more than once"):
        ot.with_limit(plain, "time", _height, upper=1.0)
    free = ot.problems.load("task", task=_task(), **{"limits.effort": "none"})
    with pytest.raises(InputError, match="has no limit 'effort-limit', whose efforts tau are"):
        ot.with_limit(free, "x", lambda s: s.tau, upper=1.0)
    kinked = ot.with_limit(plain, "x", lambda s: casadi.fabs(s.v), upper=9.0)
    with pytest.raises(InputError, match="x"):
        ot.solve(kinked)


def test_a_task_in_code_says_in_one_line_what_is_wrong_and_is_that_of_a_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"the task: \[limits\] jrek is not allowed \(nearest is 'jerk'\)") as caught:
        ot.Task(robot=ARM, limits=LIMITS | {"jrek": 1.0}, move=MOVE)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="task is 3; give a Task"):
        ot.problems.load("task", task=3)
    changed = ot.problems.load("task", task=_task(), **{"robot.payload.mass": "0.5"})
    assert changed.case.robot.payload.mass == 0.5
    assert _load().case.move == ot.problems.load("task", **_task().fields()).case.move
