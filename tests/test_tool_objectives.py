"""How far the tool goes and how evenly: integrals beside those of Pinocchio, and motions that make little of them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import simpson

import ocp_traj as ot
from ocp_traj.errors import InputError
from ocp_traj.formulation.tool_motion import SMOOTHING
from ocp_traj.transcription.symbolic import evaluate_objectives

DH = [
    {"name": "lift", "d": 0.3, "alpha": 1.5707963, "mass": 3.0, "com": [0.0, -0.03, 0.0], "inertia": [9e-3] * 3},
    {"name": "elbow", "a": 0.5, "mass": 3.0, "com": [-0.2, 0.0, 0.0], "inertia": [0.01, 0.05, 0.05]},
    {"name": "wrist", "a": 0.4, "mass": 1.0, "com": [-0.2, 0.0, 0.0], "inertia": [2e-3, 2e-2, 2e-2]},
]
LIMITS = {
    "position": [[-3.0] * 3, [3.0] * 3], "velocity": 2.0, "acceleration": 6.0, "jerk": 60.0, "effort": "none",
}  # fmt: skip


def _problem(**objective: object) -> ot.Problem:
    return ot.problems.load(
        "task", robot={"dh": DH, "tool": {"xyz": [0.0, 0.1, 0.05]}}, limits=LIMITS,
        curve={"kind": "quintic", "pieces": 2},
        move=[{"via": [[0.0, 0.4, -0.8], [0.5, 0.7, -0.9], [1.0, 0.3, -0.5]], "stop": True}], objective=objective or {},
    )  # fmt: skip


@pytest.mark.slow
def test_they_are_the_integrals_of_the_tools_speed_and_of_the_square_of_its_derivative() -> None:
    problem = _problem()
    x = problem.guess(np.random.default_rng(3))
    found, curve = evaluate_objectives(problem, x), problem.curve(x)
    model, data, robot = problem.robot.model, problem.robot.model.createData(), problem.robot
    times = np.linspace(0.0, float(curve.duration), 4_001)
    velocities, accelerations = np.empty((len(times), 3)), np.empty((len(times), 3))
    for i, (q, v, a) in enumerate(zip(*(curve(times, order) for order in range(3)), strict=True)):
        pin.forwardKinematics(model, data, q, v, a)
        arm = data.oMi[3].rotation @ robot.tool.translation
        turn, twist = (getattr(data, name)[3] for name in ("v", "a"))
        spin, change = data.oMi[3].rotation @ turn.angular, data.oMi[3].rotation @ twist.angular
        velocities[i] = data.oMi[3].rotation @ turn.linear + np.cross(spin, arm)
        classical = pin.getClassicalAcceleration(model, data, 3, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED).linear
        accelerations[i] = classical + np.cross(change, arm) + np.cross(spin, np.cross(spin, arm))
    speed = np.sqrt((velocities**2).sum(axis=1) + SMOOTHING**2)
    along = (velocities * accelerations).sum(axis=1) / speed
    assert found["tool_path_length"] == pytest.approx(simpson(speed, x=times), rel=1e-5)
    assert found["tool_speed_uniformity"] == pytest.approx(simpson(along**2, x=times), rel=1e-3)
    length = np.linalg.norm(np.diff(robot.poses(curve(times))[1], axis=0), axis=1).sum()
    assert length < found["tool_path_length"] < length + SMOOTHING * times[-1]


@pytest.mark.slow
def test_they_are_made_small() -> None:
    """The shortest way is not the quickest; nor is the even one, whose tangential acceleration is less."""
    quick = ot.solve(_problem())
    short = ot.solve(_problem(minimise={"time": 0.05, "tool_path_length": 1.0}))
    even = ot.solve(_problem(minimise={"time": 1.0, "tool_speed_uniformity": 1.0}))
    for solution in (quick, short, even):
        assert solution.audit is not None and solution.audit.proved
    assert short.objectives["tool_path_length"] < quick.objectives["tool_path_length"] - 1e-3
    assert even.objectives["tool_speed_uniformity"] < 0.8 * quick.objectives["tool_speed_uniformity"]
    assert min(short.objectives["time"], even.objectives["time"]) > quick.objectives["time"]


def test_a_name_near_to_theirs_is_refused_with_it() -> None:
    with pytest.raises(InputError, match=r"no objective 'tool_length'.*tool_path_length, tool_speed_uniformity"):
        _problem(minimise="tool_length")
