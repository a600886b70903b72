"""The code that recomputes limits knows every limit, shares nothing with the audit, and catches what is broken."""

import ast
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ocp_traj import problems
from ocp_traj.results.trajectory import Trajectory
from tests.independent import limits, motion
from tests.independent.check import ORDERS, PROBLEMS, broken, excesses
from tests.sound import VARIANTS, sound

Data = dict[str, Any]
FOLDER = Path(__file__).parent / "independent"


def test_nothing_of_the_package_is_used_but_a_table_of_numbers() -> None:
    for path in FOLDER.glob("*.py"):
        tree = ast.parse(path.read_text())
        froms = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        names = {f"{node.module}.{name.name}" for node in froms for name in node.names}
        names |= {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
        assert {name for name in names if name.startswith("ocp_traj")} <= {"ocp_traj.problems.kr90"}, path
        used = [node for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
        assert all(node.attr.isupper() for node in used if getattr(node.value, "id", "") == "kr90"), path


@pytest.mark.parametrize("problem", problems.names())
def test_every_field_of_a_case_is_known_with_its_default(problem: str) -> None:
    own = problems.case_class(problem)()
    assert {f.name: getattr(own, f.name) for f in fields(own)} == PROBLEMS[problem].DEFAULTS


HEAVY = ("air move, rest", "air move", "seam")
# Limits with symmetric bounds that the audit and this code measure alike.
SYMMETRIC = {
    *("velocity-limit", "acceleration-limit", "jerk-limit", "snap-limit"),
    "effort-limit",
    "yaw",
}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n in HEAVY else []) for n in VARIANTS])
def test_sound_trajectories_are_proved_and_every_row_of_their_audit_is_recomputed(name: str) -> None:
    data = sound(name)
    found, audited = excesses(data), Trajectory.from_dict(data).audit()
    assert audited.proved and not broken(found)
    assert {row.limit for row in audited.rows} <= set(found)
    for limit in found:
        if limit in SYMMETRIC:  # the peak itself, which the audit encloses to 1e-3 of the bound
            peak = max(abs(row.attained / row.bound) for row in audited.rows if row.limit == limit)
            assert found[limit] == pytest.approx(peak - 1.0, abs=1.1e-3)


# --- each limit, broken on purpose ---

Change = Callable[[Data], None]


def timed(factor: float, *segments: int) -> Change:
    """Scales the durations of all segments, or of some, in the curve alone."""

    def change(data: Data) -> None:
        for k in segments or range(len(data["durations"])):
            data["durations"][k] *= factor

    return change


def moved(joint: int, by: float, segment: int | None = None, points: tuple[int, ...] = ()) -> Change:
    """Moves a joint's control points: all of them, or some of a segment's."""

    def change(data: Data) -> None:
        for k, rows in enumerate(data["control_points"]):
            for i, row in enumerate(rows):
                if segment is None or (k == segment and i in points):
                    row[joint] += by

    return change


def put(block: str, **values: Any) -> Change:
    """Sets fields of the case, or parameters."""
    return lambda data: data[block].update(values)


def off(block: str, by: float) -> Change:
    """Changes the first number of a block of variables."""

    def change(data: Data) -> None:
        data["variables"][block][0] += by

    return change


def renamed(data: Data) -> None:
    data["joints"].reverse()


def shortened(data: Data) -> None:
    del data["durations"][-1], data["control_points"][-1]


BROKEN: list[tuple[str, str, Change]] = [
    ("hybrid", "position-limit", moved(0, 1.0)),
    ("hybrid", "velocity-limit", timed(0.5)),
    ("hybrid", "acceleration-limit", timed(0.1)),
    ("hybrid", "jerk-limit", timed(0.1)),
    ("hybrid", "effort-limit", put("case", payload=12.0)),
    ("hybrid, literal", "effort-limit", put("case", payload=14.0)),
    ("hybrid, free payload", "effort-limit", put("parameters", payload=12.0)),
    ("hybrid", "yaw", moved(1, 0.4)),
    ("hybrid", "rest", moved(2, 1e-7, 0, (1, 2))),
    ("hybrid", "rest", moved(3, 1e-7, 11, (1,))),
    ("hybrid", "via", moved(4, 1e-8, 5, (0, 1, 2, 3))),
    ("hybrid", "via", put("case", via_points="table6")),
    ("hybrid", "continuity of q", moved(4, 1e-8, 5, (3,))),
    ("hybrid", "continuity of v", moved(4, 1e-8, 5, (2,))),
    ("hybrid", "continuity of a", moved(4, 1e-8, 5, (1,))),
    ("hybrid", "parameter", put("parameters", payload=9.99)),
    ("hybrid", "h", timed(0.2, 5)),
    ("hybrid", "h", put("case", max_interval=0.8)),
    ("hybrid", "h", put("case", min_interval=0.35)),
    ("hybrid, free payload", "payload", put("case", max_payload=6.9)),
    ("hybrid, free payload", "payload", put("parameters", payload=-1e-6)),
    ("hybrid", "variables", off("h", 1e-3)),
    ("hybrid", "joints", renamed),
    ("hybrid", "segments", shortened),
    ("rotor", "position-limit", moved(1, 1.5)),
    ("rotor", "velocity-limit", timed(0.5)),
    ("rotor", "acceleration-limit", timed(0.9)),
    ("rotor, jerk", "jerk-limit", timed(0.9)),
    ("rotor", "effort-limit", put("case", payload=300.0)),
    ("rotor", "variables", off("t", 1e-3)),
    ("rotor, free payload", "payload", put("case", max_payload=3.9)),
    ("rotor", "rest", moved(0, 1e-7, 2, (2,))),
    ("rotor", "via", put("case", as_printed=True)),
    ("rotor", "continuity of q", moved(5, 1e-8, 1, (0,))),
    ("rotor", "continuity of v", moved(5, 1e-8, 1, (1,))),
    ("rotor", "continuity of a", moved(5, 1e-8, 1, (2,))),
    ("rotor", "parameter", put("parameters", payload=1e-6)),
    ("rotor", "t", put("case", max_duration=0.99)),
    ("rotor", "t", put("case", min_duration=0.61)),
    ("wrist", "position-limit", put("case", max_position=(2.0, 3.0, 3.0))),
    ("wrist", "velocity-limit", timed(0.9)),
    ("wrist", "acceleration-limit", put("case", max_acceleration=(10.0, 10.0, 9.0))),
    ("wrist, effort", "effort-limit", put("case", max_effort=(1.0, 0.5, 0.2))),
    ("wrist", "obstacles", put("case", obstacles=((0.5, 0.5, 0.0, 0.6),))),
    ("wrist", "obstacles", put("case", link_radius=0.15)),
    ("wrist, best", "obstacles", put("parameters", clearance=0.1)),
    ("wrist, clearance", "margin", put("parameters", clearance=0.0)),
    ("wrist", "margin", put("parameters", clearance=-0.6)),
    ("wrist", "margin", put("case", min_clearance=0.09)),
    ("wrist, far", "far-obstacles", put("case", obstacles=((0.0, 3.0, 0.0, 1.9),))),
    ("wrist, far", "far-obstacles", put("case", min_clearance=3.0)),
    ("wrist", "obstacles", put("case", min_clearance=3.1, obstacles=((0.0, -0.7, 0.0, 0.6),))),
    ("wrist", "start", put("case", case="open")),
    ("wrist", "start", moved(2, 1e-8, 0, (0,))),
    ("wrist", "goal", put("case", branch="1")),
    ("wrist", "goal", put("case", goal=(1.0, 1.0, 1.41))),
    ("wrist", "rest", moved(1, 1e-7, 0, (1,))),
    ("wrist", "continuity of q", moved(1, 1e-8, 1, (0,))),
    ("wrist", "continuity of v", moved(1, 1e-8, 1, (1,))),
    ("wrist", "continuity of a", moved(1, 1e-8, 1, (2,))),
    ("wrist", "via", put("case", max_position=(2.0, 3.0, 3.0))),
    ("wrist", "via_velocity", put("case", max_velocity=(2.0, 1.2, 3.0))),
    ("wrist", "theta_g", put("case", max_position=(3.0, 3.0, 0.19))),
    ("wrist", "t", put("case", max_time=2.0)),
    ("wrist", "variables", off("margin", 0.01)),
    ("air move", "position-limit", moved(2, 1.0)),
    ("air move", "velocity-limit", timed(0.05)),
    ("air move", "acceleration-limit", timed(0.3)),
    ("air move", "jerk-limit", timed(0.6)),
    ("air move", "snap-limit", timed(0.6)),
    ("air move", "effort-limit", put("case", payload=700.0)),
    ("air move", "effort-limit", lambda d: (put("case", payload=5000.0, as_printed=True)(d), timed(0.1)(d))[0]),
    ("air move", "start", moved(0, 1e-7, 0, (4,))),
    ("air move", "via", moved(0, 1e-8, 1, (0,))),
    ("air move", "via", put("case", rest_at_tags=True)),
    ("air move", "end", moved(0, 1e-7, 1, (5,))),
    ("air move", "T", put("case", max_air_time=3.0)),
    ("air move", "v at via", timed(0.001)),
    ("air move", "a at via", timed(0.01)),
    ("air move", "jerk at via", timed(0.01)),
    ("air move", "snap at via", timed(0.01)),
    ("air move", "variables", off("T", 1e-2)),
    *(("air move", f"continuity of {name}", moved(0, 1e-8, 1, (i,))) for i, name in enumerate(ORDERS)),
    ("seam", "tcp", moved(1, 1e-4, 1, (4, 5))),
    ("seam", "tcp-distance", moved(1, 2e-3, 1, (4, 5))),
    ("seam", "tcp", put("case", origin=(2.05, 0.0, 1.0001))),
    ("seam", "tcp", put("case", riser=0.6001)),
    ("seam", "tilt", put("case", max_tilt=0.01)),
    ("seam", "weld-time", timed(1.01, 1)),
    ("seam", "weld-time", put("case", weld_speed=0.00801)),
    ("seam", "weld-time", timed(100.0)),
    ("seam", "start", put("case", home=(0.0, -90.0, 100.0, 0.0, -61.0, 180.0))),
    ("seam", "T", put("case", max_air_time=3.0)),
    ("seam", "variables", off("q at tag 1", 1e-3)),
    ("seam", "q at tag 2", moved(1, 2.0)),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit", "change"), BROKEN, ids=[f"{name}: {limit}" for name, limit, _ in BROKEN])
def test_a_limit_that_is_broken_is_caught(
    name: str, limit: str, change: Change, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motion, "GRID", 40)  # coarse, for speed
    data = sound(name)
    change(data)
    assert limit in broken(excesses(data))


@pytest.mark.slow
def test_every_limit_is_broken_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the seam's tags one stands for all."""
    monkeypatch.setattr(motion, "GRID", 1)
    known = {(problem, limit) for problem, limit, _ in BROKEN}
    for name in VARIANTS:
        for limit in excesses(sound(name)):
            alike = [other for other, (problem, *_) in VARIANTS.items() if problem == VARIANTS[name][0]]
            if " at tag " not in limit:
                assert any((other, limit) in known for other in alike), (name, limit)


# --- limits files ---

ARM: Data = {
    "format": "ocp-traj/limits/1",
    "joints": ["A1", "A2", "A3"],
    "robot": {"urdf": "arm.urdf", "tool_frame": "flange"},
    "payload": {"mass": 2.0},
}
FOREIGN = Path(__file__).parent.parent / "examples" / "foreign"
QUINTIC: Data = {
    "format": "ocp-traj/trajectory/1",
    "joints": ["A1", "A2", "A3"],
    "durations": [1.0, 1.0],
    "control_points": [[[0.0, 0.2, 0.5]] * 3 + [[1.0, 0.6, -0.3]] * 3, [[1.0, 0.6, -0.3]] * 3 + [[1.0, 0.6, -0.4]] * 3],
}
# Of A1 from 0 to 1 in a second: peaks 15/8, 10/sqrt(3), 60, 360; efforts and the tool's place at the ends are statics.
TIGHT: list[tuple[str, str, Data]] = [
    ("position", "position-limit", {"lower": [-1.0] * 3, "upper": [0.999, 1.0, 1.0]}),
    ("position", "position-limit", {"lower": [-1e12] * 3, "upper": [0.999, 1e12, 1e12]}),
    ("velocity", "velocity-limit", {"limit": [1.874, 9.0, 9.0]}),
    ("acceleration", "acceleration-limit", {"limit": [5.773, 90.0, 90.0]}),
    ("jerk", "jerk-limit", {"limit": [59.9, 900.0, 900.0]}),
    ("snap", "snap-limit", {"limit": [359.9, 9e3, 9e3]}),
    ("effort", "effort-limit", {"limit": [60.0, 23.0, 14.0]}),
    ("tool", "tool-box", {"upper": [np.inf, np.inf, 0.55]}),
    ("rest", "rest", {"order": 3}),
]


@pytest.mark.parametrize(("table", "limit", "bounds"), TIGHT, ids=[f"{t}, {i}" for i, (t, *_) in enumerate(TIGHT)])
def test_a_tight_limit_of_a_file_is_caught(table: str, limit: str, bounds: Data) -> None:
    assert limit in broken(limits.excesses(QUINTIC, {**ARM, table: bounds}, FOREIGN))


@pytest.mark.parametrize(("table", "bounds"), [
    ("position", {"lower": [-1.0] * 3, "upper": [1.0] * 3}),
    ("velocity", {"limit": [1.876, 9.0, 9.0]}),
    ("acceleration", {"limit": [5.774, 90.0, 90.0]}),
    ("jerk", {"limit": [60.0, 900.0, 900.0]}),
    ("effort", {"limit": [60.0, 60.0, 60.0]}),
    ("tool", {"lower": [-1.0, -1.0, 0.0]}),
    ("rest", {"order": 2}),
])  # fmt: skip
def test_a_limit_of_a_file_that_is_met_is_not(table: str, bounds: Data) -> None:
    assert not broken(limits.excesses(QUINTIC, {**ARM, table: bounds}, FOREIGN))


def test_a_file_that_asks_for_nothing_or_for_other_joints_is_caught() -> None:
    one = {**QUINTIC, "durations": [1.0], "control_points": QUINTIC["control_points"][:1]}
    assert "nothing is asked for" in broken(limits.excesses(one, {**ARM, "continuity": 3}, FOREIGN))
    assert "joints" in broken(limits.excesses(QUINTIC, {**ARM, "joints": ["A1", "A3", "A2"]}, FOREIGN))
    held = {**ARM, "payload": {"parameter": True}, "effort": {"limit": [99.0] * 3}}
    assert "parameter" in broken(limits.excesses({**QUINTIC, "parameters": {"payload": -1.0}}, held, FOREIGN))


def test_jumps_of_a_foreign_motion_are_caught() -> None:
    for order, rows in enumerate(([[0.1] * 3] * 6, [[0.0] * 3, [0.1] * 3], [[0.0] * 3, [0.0] * 3, [0.1] * 3])):
        second = np.array(QUINTIC["control_points"][1])
        second[: len(rows)] += rows
        data = {**QUINTIC, "control_points": [QUINTIC["control_points"][0], second.tolist()]}
        assert f"continuity of {'qva'[order]}" in broken(limits.excesses(data, {**ARM, "continuity": 2}, FOREIGN))
