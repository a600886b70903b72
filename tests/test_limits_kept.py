"""Solutions and fronts of every problem keep every limit, recomputed by code of the tests alone."""

from typing import Any

import pytest

import ocp_traj as ot
from ocp_traj import problems
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import Trajectory
from tests.independent.check import broken, excesses

Changes = dict[str, Any]


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


def kept(motion: Trajectory | None) -> bool:
    return motion is not None and not broken(excesses(motion.to_dict()))


@pytest.mark.parametrize("solved", ["fastest", "cheapest"])
def test_least_time_and_least_cost_of_the_hybrid_robot(solved: str, request: pytest.FixtureRequest) -> None:
    solution: Solution = request.getfixturevalue(solved)
    assert solution.audit is not None and solution.audit.proved and kept(solution.trajectory)


AIR, REST = {"case": "air-move"}, {"case": "air-move", "rest_at_tags": True}
SOLUTIONS = [
    slow("hybrid-spline", {"convention": "paper-literal", "via_points": "table6"}, "time"),
    slow("hybrid-spline", {"free_payload": True, "min_interval": 0.1}, "payload_mass"),
    slow("hybrid-spline", {"payload": 0.0, "max_interval": 0.9}, "energy"),
    ("rotor-353", {"payload": 40.0, "jerk": (4000.0,) * 6}, "time"),
    ("rotor-353", {"as_printed": True}, "effort"),
    slow("rotor-353", {"free_payload": True}, "payload_mass"),
    slow("rotor-353", {"acceleration": (), "min_duration": 0.3}, "time"),
    ("wrist-obstacle", {"branch": "0", "min_clearance": 0.03}, "fitness"),
    ("wrist-obstacle", {"branch": "1", "effort_limits": True, "obstacles": ((0.0, 2.2, 0.0, 0.3),)}, "time"),
    slow("wrist-obstacle", {"obstacles": ((0.5, 0.5, 0.0, 0.4), (-0.3, 0.9, 0.6, 0.2))}, "clearance"),
    slow("weld-bezier", AIR, "air_time"),
    slow("weld-bezier", {**AIR, "payload": 60.0}, "total"),
    slow("weld-bezier", REST, "effort"),
    slow("weld-bezier", {"tags": 7, "mirrored": True, "payload": 20.0}, "total"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "changes", "objective"), SOLUTIONS, ids=str)
def test_a_solution_keeps_every_limit(name: str, changes: Changes, objective: str) -> None:
    solution = ot.solve(problems.load(name, **changes), objective=objective, starts=1, certify=False)
    assert solution.audit is not None and solution.audit.proved and kept(solution.trajectory)


TRACED, GENETIC = {"points": 3, "starts": 1}, {"method": "nsga2", "population": 30, "generations": 40}
FRONTS = [
    slow("hybrid-spline", {"payload": 5.0}, ("time", "energy"), TRACED),  # one more in test_front_tracer
    slow("hybrid-spline", {}, ("time", "energy"), GENETIC),
    ("rotor-353", {}, ("time", "jerk"), TRACED),
    slow("rotor-353", {"payload": 10.0, "jerk": (4000.0,) * 6}, ("time", "effort"), TRACED),
    ("rotor-353", {}, ("time", "effort"), GENETIC),
    slow("wrist-obstacle", {"branch": "0"}, ("time", "clearance"), TRACED),
    ("wrist-obstacle", {"branch": "0"}, ("time", "distance"), GENETIC),
    slow("weld-bezier", REST, ("air_time", "movement"), {"points": 2, "starts": 1}),
    slow("weld-bezier", AIR, ("air_time", "movement"), TRACED),
    slow("weld-bezier", {}, ("air_time", "movement"), {"method": "nsga2", "population": 8, "generations": 3}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "changes", "traded", "options"), FRONTS, ids=str)
def test_a_front_keeps_every_limit(name: str, changes: Changes, traded: tuple[str, str], options: Changes) -> None:
    front = ot.pareto(problems.load(name, **changes), traded, **options)
    assert len(front) >= 2
    for i in range(len(front)):
        assert front.audit(i).proved and kept(front.trajectory(i))
