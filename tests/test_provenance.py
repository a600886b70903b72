"""What a trajectory's file says of itself is held against its problem: no edit of it passes for a proof."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.proof.verdicts import CHECKED, VIOLATED
from ocp_traj.results.provenance import AGREE, audit_motions, recovered_variables
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import Trajectory, audit_points
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.payload import along

File = dict[str, Any]
Edit = Callable[[File], None]
REFUSED = "refused"

# The case of each file that is edited, and what is minimised for it.
CASES: dict[str, tuple[str, dict[str, Any], str]] = {
    "hybrid-spline": ("hybrid-spline", {}, "cost"),
    "hybrid-spline, payload free": ("hybrid-spline", {"free_payload": True}, "time"),
    "rotor-353": ("rotor-353", {"jerk": (9000.0,) * 6}, "time"),
    "wrist-obstacle": ("wrist-obstacle", {"branch": "0", "effort_limits": True}, "time"),
    "air-move": ("weld-bezier", {"case": "air-move"}, "air_time"),
    "air-move at rest": ("weld-bezier", {"case": "air-move", "rest_at_tags": True}, "air_time"),
    "seam": ("weld-bezier", {"tcp_box": 0.05, "tcp_tolerance": 0.05, "max_tilt": 60.0, "max_air_time": 60.0}, ""),
}


@lru_cache
def proved_file(key: str) -> str:
    """A proved trajectory of a case as JSON; of the seam the start of its solves, with wider limits."""
    name, case, objective = CASES[key]
    problem = problems.load(name, **case)
    x0 = problem.guess(np.random.default_rng(0))
    if objective:
        found = Exchange().solve(problem, WeightedSum({objective: 1.0}), x0)
        motion, audit = found.trajectory, found.audit
    else:
        motion, audit = audit_points(problem, [x0])[0]
    assert motion is not None and audit is not None and audit.proved, (key, audit and audit.explain())
    return json.dumps(motion.to_dict())


@lru_cache(maxsize=8)
def built(name: str, case: str) -> Problem:
    return problems.load(name, **json.loads(case))


def outcome(file: File) -> str:
    """The verdict on a file, or that it is refused."""
    try:
        motion = Trajectory.from_dict(json.loads(json.dumps(file)))
        return audit_motions(built(file["problem"], json.dumps(file["case"])), [motion], [motion.variables])[0].verdict
    except InputError as error:
        assert "\n" not in str(error)
        return REFUSED


def parameter(name: str, value: float) -> Edit:
    return lambda file: file["parameters"].__setitem__(name, value)


def case_field(**fields: Any) -> Edit:
    return lambda file: file["case"].update(fields)


def slower(factor: float, *segments: int, forget: bool = False) -> Edit:
    """Durations of some segments, or of all, and the variables forgotten if wanted."""

    def edit(file: File) -> None:
        for k in segments or range(len(file["durations"])):
            file["durations"][k] *= factor
        if forget:
            file["variables"] = {}

    return edit


def moved(segment: int, row: int, by: float, forget: bool = False) -> Edit:
    """One control point of the first joint, and the variables forgotten if wanted."""

    def edit(file: File) -> None:
        file["control_points"][segment][row][0] += by
        if forget:
            file["variables"] = {}

    return edit


def variable(block: str, value: float, index: int = 0) -> Edit:
    return lambda file: file["variables"][block].__setitem__(index, value)


def renamed(file: File) -> None:
    file["joints"] = [*file["joints"][1:], file["joints"][0]]


COMMON: dict[str, Edit] = {
    "joints in another order": renamed,
    "a joint of another name": lambda file: file["joints"].__setitem__(0, "elsewhere"),
    "the whole slowed": slower(1.001),
    "the whole quickened": slower(0.99),
    "the start moved": moved(0, 0, 1e-6),
    "the start moved without variables": moved(0, 0, 1e-6, forget=True),
    "the end moved without variables": moved(-1, -1, 1e-6, forget=True),
    "the curve moved": moved(0, 2, 1e-6),
    "no parameters": lambda file: file["parameters"].clear(),
    "a variable too many": lambda file: next(iter(file["variables"].values())).append(1.0),
}
EDITS: dict[str, dict[str, Edit]] = {
    "hybrid-spline": {
        "payload of the parameters": parameter("payload", 0.0),
        "payload of the case": case_field(payload=100.0),
        "payload of the case, slightly": case_field(payload=10.000001),
        "longest interval": case_field(max_interval=0.5),
        "shortest interval": case_field(min_interval=0.9),
        "via points": case_field(via_points="table6"),
        "an interval": variable("h", 0.5),
        "past a via point": moved(3, 0, 1e-6, forget=True),
        "longer than allowed, without variables": slower(20.0, forget=True),
    },
    "hybrid-spline, payload free": {
        "payload of the parameters": parameter("payload", 0.0),
        "payload of the variables": variable("payload", 0.0),
        "largest payload": case_field(max_payload=1e-6),
    },
    "rotor-353": {
        "payload": parameter("payload", -10.0),
        "payload of the case": case_field(payload=80.0),
        "velocity": case_field(velocity=[20.0] * 6),
        "acceleration": case_field(acceleration=[20.0] * 6),
        "jerk": case_field(jerk=[100.0] * 6),
        "printed sign": case_field(as_printed=True),
        "quickened without variables": slower(0.99, forget=True),
        "shortest duration": case_field(min_duration=2.0),
        "longest duration": case_field(max_duration=0.1),
        "past a via point": moved(1, 0, 1e-6, forget=True),
    },
    "wrist-obstacle": {
        "clearance of the parameters": parameter("clearance", -0.6),
        "clearance of the case": case_field(min_clearance=0.09),
        "clearance of the variables": variable("margin", -0.6),
        "a block of variables missing": lambda file: file["variables"].pop("via"),
        "quickened without variables": slower(0.99, forget=True),
        "start": case_field(start=[-1.0, 1.0, -1.41]),
        "goal": case_field(goal=[1.0, 1.0, -1.4142]),
        "start of another case": case_field(case="open"),
        "obstacle": case_field(obstacles=[[0.5, 0.5, 0.0, 0.5]]),
        "another obstacle": case_field(obstacles=[[0.5, 0.5, 0.0, 0.4], [0.0, 1.5, 0.0, 1.3]]),
        "radius of the link": case_field(link_radius=0.2),
        "position": case_field(max_position=[0.5, 0.5, 0.5]),
        "velocity": case_field(max_velocity=[0.5, 0.5, 0.5]),
        "acceleration": case_field(max_acceleration=[1.0, 1.0, 1.0]),
        "effort": case_field(max_effort=[0.01, 0.01, 0.01]),
        "shortest time": case_field(min_time=2.0),
        "longest time": case_field(max_time=0.2),
        "branch": case_field(branch="1"),
    },
    "air-move": {
        "payload": case_field(payload=2000.0),
        "rest at the via point": case_field(rest_at_tags=True),
        "shortest air move": case_field(min_air_time=5.0),
        "longest air move": case_field(max_air_time=1.0),
        "past the via point": moved(1, 0, 1e-6, forget=True),
    },
    "air-move at rest": {
        "via point not at rest, without variables": moved(1, 1, 1e-4, forget=True),
    },
    "seam": {
        "a weld slowed": slower(100.0, 3),
        "a weld slowed without variables": slower(1.01, 3, forget=True),
        "the whole slowed a hundred times without variables": slower(100.0, forget=True),
        "weld speed": case_field(weld_speed=0.009),
        "tags": case_field(tags=8),
        "seam": case_field(psi=90.0),
        "place of the seam": case_field(origin=[2.05, 0.1, 1.0]),
        "height of the robot": case_field(riser=0.5),
        "home": case_field(home=[1.0, -90.0, 100.0, 0.0, -60.0, 180.0]),
        "box of the tip": case_field(tcp_box=1e-7),
        "distance of the tip": case_field(tcp_tolerance=1e-6),
        "tilt": case_field(max_tilt=0.01),
        "payload": case_field(payload=2000.0),
        "shortest air move": case_field(min_air_time=20.0),
        "longest air move": case_field(max_air_time=1.0),
    },
}


@pytest.mark.parametrize(
    "key", [pytest.param(key, marks=pytest.mark.slow) if key in ("seam", "air-move") else key for key in CASES]
)
def test_no_edit_of_a_proved_file_is_proved(key: str) -> None:
    assert outcome(json.loads(proved_file(key))) == "proved"
    passed = []
    # What all files have in common is edited in other cases: each edit of the seam is a problem of seconds to build.
    for what, edit in ((COMMON if key != "seam" else {}) | EDITS[key]).items():
        file = json.loads(proved_file(key))
        if what == "no parameters" and not file["parameters"]:
            continue
        edit(file)
        if outcome(file) == "proved":
            passed.append(what)
    assert passed == []


def test_every_field_of_a_case_that_bounds_something_is_edited() -> None:
    # What is left asks nothing of a trajectory: weights of sums, switches that take limits away, shapes of other cases.
    free = {
        "hybrid-spline": {"convention", "weights", "free_payload"},
        "rotor-353": {"position_limits", "effort_limits", "timing", "free_payload", "max_payload"},
        "wrist-obstacle": {"weights", "effort_limits", "d3"},
        "weld-bezier": {
            "case", "chord_radius", "brace_radius", "phi", "mirrored", "yaw", "seam_file", "as_printed", "weights",
        },
    }  # fmt: skip
    for name in problems.names():
        edited: set[str] = set()
        for key, (problem, _, _) in CASES.items():
            if problem == name:
                for edit in EDITS[key].values():
                    file: File = {"case": {}, "parameters": {}}
                    try:
                        edit(file)
                    except KeyError:
                        continue
                    edited |= set(file["case"])
        assert edited | free[name] == set(problems.case_class(name).__dataclass_fields__), name


def test_rounding_of_another_processor_is_no_edit() -> None:
    for key in ("hybrid-spline", "wrist-obstacle"):
        file = json.loads(proved_file(key))
        for points in file["control_points"]:
            for row in points:
                row[:] = [float(np.nextafter(value, np.inf)) for value in row]
        # The first and last points rest exactly; a bound of 1e-9 on that is far above one rounding.
        assert outcome(file) == "proved"


def test_a_slowed_trajectory_is_audited_with_the_variables_it_still_has(hybrid: Problem, cheapest: Solution) -> None:
    assert cheapest.trajectory is not None
    slow = cheapest.trajectory.dilate(1.5)
    x = recovered_variables(hybrid, slow)
    assert np.abs(x - 1.5 * cheapest.x).max() <= AGREE
    found = slow.audit()
    assert found.proved and [row.limit for row in found.rows].count("h") == 12
    (worst,) = {row.verdict for row in found.rows if row.limit == "h"}
    assert worst == CHECKED
    late = cheapest.trajectory.dilate(30.0).audit()
    assert late.verdict == VIOLATED and {row.limit for row in late.failures} == {"h"}


def test_a_motion_that_is_not_of_the_problem_has_no_variables(hybrid: Problem, cheapest: Solution) -> None:
    assert cheapest.trajectory is not None
    bent = replace(cheapest.trajectory, variables={}, curve=cheapest.trajectory.curve.elevate(4))
    (found,) = audit_motions(hybrid, [bent], [{}])
    assert [(row.limit, row.label) for row in found.failures] == [
        ("variables", "that give the degree or number of segments")
    ]


@pytest.mark.slow
def test_the_payload_along_a_trajectory_is_written_into_all_its_parts(hybrid: Problem, cheapest: Solution) -> None:
    assert cheapest.trajectory is not None
    carried = along(hybrid, cheapest.trajectory, 100.0).trajectory
    assert carried is not None
    again = Trajectory.from_dict(json.loads(json.dumps(carried.to_dict())))
    assert again.case["payload"] == again.parameters["payload"] > 10.0
    assert again.audit().proved and again.audit().parameters == dict(again.parameters)


def test_a_parameter_that_is_no_number_agrees_with_nothing(fastest: Solution) -> None:
    assert fastest.trajectory is not None
    with pytest.raises(InputError, match="parameter payload, nan against 10,"):
        replace(fastest.trajectory, parameters={"payload": np.nan}).audit()
