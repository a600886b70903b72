"""Payloads that change between moves: efforts against Pinocchio, objectives, proof and what is refused."""

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.io.export import export
from ocp_traj.proof.values import limit_on
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.robot.robot import Robot
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.symbolic import evaluate_objectives, motion_of
from ocp_traj.transcription.transcription import transcribe

HELD = {"mass": 3.0, "com": [0.0, 0.02, 0.06], "inertia": [0.01, 0.02, 0.03]}
TASK = {
    "format": "ocp-traj/task/1",
    "robot": {"description": "ur5", "tool_frame": "tool0", "payload": {"mass": 0.5}},
    "limits": {"acceleration": 8.0, "jerk": 60.0, "effort": [60.0, 90.0, 60.0, 20.0, 20.0, 20.0]},
    "curve": {"kind": "quintic"},
    "move": [
        {"via": [[0.0, -1.3, 1.4, -1.6, -1.5, 0.0], [0.8, -1.0, 1.4, -1.6, -1.5, 0.0]], "dwell": 0.25},
        {"goal": [0.4, -0.6, 0.9, -1.6, -1.5, 0.2], "payload": HELD},
        {"goal": [0.0, -1.3, 1.4, -1.6, -1.5, 0.0]},
    ],
}
LEGS = {0: 0.5, 1: 0.5, 2: 3.0, 3: 0.5}  # [kg] on each segment: the dwell is with what the move before it carries


def _task(**changes: object) -> Problem:
    return ot.problems.load("task", **{**TASK, **changes})


def _moves(**changes: object) -> list[dict[str, object]]:
    return [TASK["move"][0], {**TASK["move"][1], **changes}, TASK["move"][2]]


@pytest.fixture(scope="module")
def problem() -> Problem:
    return _task()


def _efforts(problem: Problem, x: np.ndarray, segment: int, u: np.ndarray, mass: float) -> np.ndarray:
    """Efforts ``(N, 6)`` by Pinocchio with the body of a segment appended to the tool's joint."""
    robot, curve = problem.robot, motion_of(problem, x).curve
    heavy = mass == HELD["mass"]
    body = pin.Inertia(mass, np.array(HELD["com"]) * heavy, np.diag(HELD["inertia"]) * heavy)
    model = robot.model.copy()
    model.appendBodyToJoint(robot.tool_joint or model.njoints - 1, body, robot.tool)
    data = model.createData()
    states = (curve.at(segment, u, order) for order in range(3))
    return np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])


def test_efforts_are_with_what_each_move_carries(problem: Problem) -> None:
    x, u = problem.guess(np.random.default_rng(0)), np.linspace(0.0, 1.0, 5)
    motion = motion_of(problem, x)
    (limit,) = (c for c in problem.requirements.path_constraints if c.id == "effort-limit")
    for segment, mass in LEGS.items():
        expected = _efforts(problem, x, segment, u, mass)
        found = limit_on(motion, problem.requirements, limit, segment, u).T
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_objectives_are_with_what_each_move_carries_wherever_they_are_summed(problem: Problem) -> None:
    x = problem.guess(np.random.default_rng(1))
    curve = motion_of(problem, x).curve
    nodes, weights = np.array(problem.objective("energy").quadrature).T
    energy = 0.0
    for segment, mass in LEGS.items():
        power = _efforts(problem, x, segment, nodes, mass) * curve.at(segment, nodes, 1)
        energy += float(curve.durations[segment] * weights @ (power**2).sum(axis=1))
    assert evaluate_objectives(problem, x)["energy"] == pytest.approx(energy, rel=1e-9)
    population = Population(problem, ["energy", "effort"]).evaluate(x[None]).objectives[0]
    assert population[0] == pytest.approx(energy, rel=1e-9)
    assert population[1] == pytest.approx(evaluate_objectives(problem, x)["effort"], rel=1e-9)
    # In the NLP, numeric and symbolic, with the gradient.
    nlp = transcribe(problem, WeightedSum({"energy": 1.0}), few_instants(problem))
    f, g = nlp.program.values(nlp.start(x))
    assert f == pytest.approx(energy / 1000.0, rel=1e-9)
    symbols = nlp.program.symbols
    exact = ca.Function("exact", [symbols[0]], [symbols[1], symbols[2], ca.gradient(symbols[1], symbols[0])])
    for mine, theirs in zip((f, g, nlp.program.gradient(x)), exact(x), strict=True):
        theirs = np.array(theirs).ravel()
        assert np.abs(np.ravel(mine) - theirs).max() <= 1e-9 * (1.0 + np.abs(theirs).max())


@pytest.mark.slow
def test_it_is_solved_proved_and_proved_again_from_its_file(problem: Problem, tmp_path: Path) -> None:
    solution = ot.solve(problem)
    assert solution.audit is not None and solution.audit.proved and solution.trajectory is not None
    file = solution.trajectory.save(tmp_path / "t.json")
    assert ot.Trajectory.load(file).audit().proved
    data = json.loads(file.read_text())
    data["case"]["move"][1]["payload"]["mass"] = 9.0
    file.write_text(json.dumps(data))
    assert not ot.Trajectory.load(file).audit().proved
    heavier = ot.solve(_task(move=_moves(payload={**HELD, "mass": 4.5})))
    assert heavier.audit is not None and heavier.audit.proved and heavier.f > solution.f + 1e-3  # [s]
    (gain,) = (g for g in heavier.gains if (g.limit, g.label) == ("effort-limit", "shoulder_lift_joint"))
    assert gain.gain > 0.0


@pytest.mark.parametrize("rate", [None, 40.0])
def test_exported_efforts_are_with_what_each_move_carries(problem: Problem, tmp_path: Path, rate: float | None) -> None:
    x = problem.dilate(problem.guess(np.random.default_rng(2)), 1.5)  # far from its limits
    motion = trajectory_of(problem, x)
    points = json.loads(export(motion, "ros", tmp_path / "t.json", effort=True, rate=rate).path.read_text())["points"]
    robot, knots = problem.robot, motion.curve.knots
    times = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    assert len(times) == (len(knots) if rate is None else round(motion.duration * 40.0) + 1)
    for point, t in zip(points, times, strict=True):
        segment = min(int(np.searchsorted(knots, t + 1e-7, side="right")) - 1, len(LEGS) - 1)
        held = LEGS[segment] == HELD["mass"]
        body = pin.Inertia(LEGS[segment], np.array(HELD["com"]) * held, np.diag(HELD["inertia"]) * held)
        model = robot.model.copy()
        model.appendBodyToJoint(robot.tool_joint or model.njoints - 1, body, robot.tool)
        state = (np.array(point[name]) for name in ("positions", "velocities", "accelerations"))
        expected = pin.rnea(model, model.createData(), *state)
        assert np.abs(np.array(point["effort"]) - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.slow
def test_it_is_shown_what_each_move_carries_where_that_differs(problem: Problem) -> None:
    place = "centred at (0, 0, 0) m in the tool frame"
    assert problem.about.notes == (
        f"move 1 carries 0.5 kg, the robot's payload, {place}",
        "move 2 carries 3 kg, centred at (0, 0.02, 0.06) m in the tool frame, inertia (0.01, 0.02, 0.03) kg m2",
        f"move 3 carries 0.5 kg, the robot's payload, {place}",
    )
    assert _task(move=_moves(payload={"mass": 0.0})).about.notes[1] == "move 2 carries nothing"
    freed = _task(free_payload=True).about.notes[0]
    assert freed == f"move 1 carries a mass that is freed, {place}"
    assert _task(move=_moves(payload=None)).about.notes == () == _task(move=_moves(payload={"mass": 0.5})).about.notes


@pytest.mark.slow
def test_payloads_of_one_place_or_of_moves_alone(tmp_path: Path) -> None:
    same = _task(move=_moves(payload={"mass": 2.0}))  # centre and inertia alike: numbers, and only the mass differs
    x = same.guess(np.random.default_rng(0))
    assert same.requirements.parameters == ("payload",)
    robot = {"description": "ur5", "tool_frame": "tool0"}
    alone = _task(robot=robot)
    assert alone.requirements.parameters == () and _task(robot=robot, free_payload=True).labels[-1] == "payload"
    assert evaluate_objectives(alone, x)["energy"] > 0.0
    assert isinstance(alone.robot, Robot) and run(["payload", "hybrid-spline", "--max-time", "-1"]) == 2
    with pytest.raises(InputError, match="task has no payload"):
        ot.payload(alone)


def test_a_payload_changes_only_where_the_robot_rests() -> None:
    moves = [{**TASK["move"][0], "dwell": 0.0, "stop": False}, *TASK["move"][1:]]
    with pytest.raises(InputError, match=r"the payload changes after \[\[move\]\] 1, which has stop = false"):
        _task(move=moves)
    with pytest.raises(InputError, match="rest is 1; where the payload changes velocity and acceleration vanish"):
        _task(curve={"kind": "quintic", "rest": 1})
    carrying = [{**move, "payload": {"mass": 1.0 + i}} for i, move in enumerate(TASK["move"])]
    with pytest.raises(InputError, match="free_payload frees the robot's payload, and every"):
        _task(move=carrying, free_payload=True)
