"""``[collision]`` of a task file: what is wrong with it is one line that says where, and what is allowed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import OcpTrajError
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.task_file import read_task

# A UR5 by a rod for its forearm, so that nothing is fitted; start and goal as in examples/tasks/ur5-obstacles.toml.
ROBOT = """format = "ocp-traj/task/1"
name = "cell"

[robot]
description = "ur5"
tool_frame = "tool0"

[limits]
acceleration = 8.0
jerk = 60.0

[curve]
kind = "quintic"
pieces = 4

[[move]]
start = [-0.9, -1.2, 1.5, -1.8, -1.5, 0.0]
goal = [0.9, -1.0, 1.3, -1.8, -1.5, 0.0]

[collision]
self = false
"""
LINK = """
[[collision.link]]
name = "rod"
frame = "forearm_link"
from = [0.0, 0.0, 0.0]
to = [0.0, 0.0, 0.39]
radius = 0.05
"""
BALL = """
[[collision.obstacle]]
name = "ball"
sphere = { centre = [0.57, 0.02, 0.35], radius = 0.10 }
"""
CELL = ROBOT + LINK + BALL


def _swap(old: str, new: str) -> str:
    assert CELL.count(old) == 1
    return CELL.replace(old, new)


BROKEN = {
    "no obstacle": (ROBOT + LINK, r"\[collision\] has no \[\[collision.obstacle\]\] and self = false"),
    "unknown key": (_swap("self = false", "selfs = false"), r"selfs is not allowed \(nearest is 'self'\)"),
    "unknown links": (_swap("self = false", 'self = false\nlinks = "mesh"'), r"links is 'mesh'; give \"urdf\""),
    "given without links": (
        ROBOT.replace("self = false", 'self = false\nlinks = "given"') + BALL, r'has links = "given" and no',
    ),
    "self no truth": (_swap("self = false", "self = 3"), r"\[collision\] self is 3; give true or false"),
    "clearance below zero": (_swap("self = false", "clearance = -0.1"), r"clearance is -0.1; give a distance"),
    "clearance no number": (_swap("self = false", 'self = false\nclearance = "1 cm"'), r"clearance is '1 cm'; give"),
    "self clearance infinite": (_swap("self = false", "self_clearance = inf"), r"self_clearance is inf; give a dist"),
    "no frame": (_swap('frame = "forearm_link"\n', ""), r"link 1.frame is missing; give the name of a link"),
    "unknown frame": (
        _swap('"forearm_link"', '"forearm"'), r"link\]\] 1: there is no frame 'forearm' \(nearest is 'forearm_link'\)",
    ),
    "no radius": (_swap("radius = 0.05\n", ""), r"link 1 has from and to without radius; a capsule needs all three"),
    "radius zero": (_swap("radius = 0.05", "radius = 0"), r"link 1.radius is 0; give a radius above zero"),
    "from of two": (_swap("from = [0.0, 0.0, 0.0]", "from = [0.0, 0.0]"), r"link 1.from is \[0.0, 0.0\]; give three"),
    "two shapes of a link": (
        _swap("radius = 0.05", "radius = 0.05\nsphere = { centre = [0, 0, 0], radius = 0.1 }"),
        r"link 1 has sphere and from, to and radius; give",
    ),
    "no shape of a link": (
        _swap("from = [0.0, 0.0, 0.0]\nto = [0.0, 0.0, 0.39]\nradius = 0.05\n", ""), r"link 1 has no shape; give from",
    ),
    "a plane as a link": (
        _swap("radius = 0.05", "plane = { normal = [0, 0, 1], offset = 0 }"), r"link 1.plane is not allowed; allowed",
    ),
    "no shape": (
        _swap("sphere = { centre = [0.57, 0.02, 0.35], radius = 0.10 }", ""), r"obstacle 1 has no shape; give exactly",
    ),
    "two shapes": (
        CELL + "plane = { normal = [0, 0, 1], offset = -1 }\n", r"obstacle 1 has sphere and plane; give exactly one of",
    ),
    "sphere without centre": (_swap("centre = [0.57, 0.02, 0.35], ", ""), r"obstacle 1.sphere.centre is missing; give"),
    "sphere of size": (_swap("radius = 0.10", "size = 0.10"), r"obstacle 1.sphere.size is not allowed; allowed are"),
    "sphere of text": (_swap("radius = 0.10", 'radius = "10 cm"'), r"sphere.radius is '10 cm'; give a radius"),
    "flat box": (
        CELL + "\n[[collision.obstacle]]\nbox = { centre = [1, 1, 1], size = [1, 0, 1] }\n",
        r"obstacle 2.box has the size \[1.0, 0.0, 1.0\]; give three lengths above zero",
    ),
    "box turned twice": (
        CELL + "\n[[collision.obstacle]]\n"
        "box = { centre = [1, 1, 1], size = [1, 1, 1], rpy = [0, 0, 0], quat_wxyz = [1, 0, 0, 0] }\n",
        r"obstacle 2.box gives rpy and quat_wxyz; give one",
    ),
    "no rotation": (
        CELL + "\n[[collision.obstacle]]\nbox = { centre = [1, 1, 1], size = [1, 1, 1], quat_wxyz = [0, 0, 0, 0] }\n",
        r"obstacle 2.box gives a quat_wxyz that is no rotation",
    ),
    "plane without direction": (
        CELL + "\n[[collision.obstacle]]\nplane = { normal = [0, 0, 0], offset = 0 }\n",
        r"obstacle 2.plane has the normal \[0, 0, 0\]; give a direction",
    ),
    "plane without offset": (
        CELL + "\n[[collision.obstacle]]\nplane = { normal = [0, 0, 1] }\n", r"obstacle 2.plane.offset is missing",
    ),
    "cylinder without length": (
        CELL + "\n[[collision.obstacle]]\ncylinder = { from = [1, 1, 1], to = [1, 1, 1], radius = 0.1 }\n",
        r"obstacle\]\] 2: cylinder 'obstacle 2' begins and ends at",
    ),
    "capsule without end": (
        CELL + "\n[[collision.obstacle]]\ncapsule = { from = [1, 1, 1], radius = 0.1 }\n",
        r"obstacle 2.capsule.to is missing; give three numbers",
    ),
    "a name twice": (CELL + BALL, r"has 2 bodies 'ball'; give each a name"),
    "no SRDF": (_swap("self = false", 'self = true\nsrdf = "none.srdf"'), r"none.srdf"),
    "pairs without bodies": (_swap("self = false", 'self = false\npairs = [["rod", "ball"]]'), r"pairs without bodies"),
    "a body that never moves": (
        _swap('"forearm_link"', '"base_link"'), r"has obstacles, and no body of the robot that moves; give",
    ),
    "start in an obstacle": (
        _swap("[0.57, 0.02, 0.35]", "[0.3, -0.25, 0.4]"), r"at the start rod and ball overlap by [\d.]+ mm",
    ),
    "goal too near": (
        _swap("self = false", "self = false\nclearance = 0.5"), r"at the start rod and ball are \d+ mm apart; .* 500",
    ),
}  # fmt: skip


@pytest.mark.parametrize("text, words", BROKEN.values(), ids=BROKEN.keys())
def test_a_broken_table_is_one_line(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(OcpTrajError, match=words) as caught:
        ot.problems.load("task", file=str(path))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith((str(path), "cell: ", "'")) or "none.srdf" in str(caught.value)


def test_the_line_of_a_nested_table_is_told(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(CELL.replace("radius = 0.10", "radius = -1"))
    with pytest.raises(OcpTrajError) as caught:
        read_task(path)
    (line,) = (i for i, text in enumerate(path.read_text().splitlines(), 1) if "radius = -1" in text)
    assert f"cell.toml:{line}: " in str(caught.value)


def test_the_command_refuses_it_with_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cell.toml").write_text(BROKEN["goal too near"][0])
    assert run(["show", str(tmp_path / "cell.toml")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_millimetres_and_degrees_are_the_same_cell(tmp_path: Path) -> None:
    box = '\n[[collision.obstacle]]\nname = "crate"\nbox = {{ centre = {}, size = {}, rpy = {} }}\n'
    plain = CELL + box.format([0.45, -0.55, 0.05], [0.2, 0.2, 0.1], [0.0, 0.0, 0.3])
    degrees = [np.degrees(v).tolist() for v in ([-0.9, -1.2, 1.5, -1.8, -1.5, 0.0], [0.9, -1.0, 1.3, -1.8, -1.5, 0.0])]
    other = (
        ROBOT.replace("[robot]", 'units = { angle = "deg", length = "mm" }\n\n[robot]')
        .replace("acceleration = 8.0", f"acceleration = {np.degrees(8.0)}")
        .replace("jerk = 60.0", f"jerk = {np.degrees(60.0)}")
        .replace("[-0.9, -1.2, 1.5, -1.8, -1.5, 0.0]", str(degrees[0]))
        .replace("[0.9, -1.0, 1.3, -1.8, -1.5, 0.0]", str(degrees[1]))
        + LINK.replace("0.39", "390.0").replace("0.05", "50.0")
        + BALL.replace("[0.57, 0.02, 0.35]", "[570.0, 20.0, 350.0]").replace("0.10", "100.0")
        + box.format([450, -550, 50], [200, 200, 100], [0.0, 0.0, float(np.degrees(0.3))])
    )
    found = []
    for name, text in (("plain", plain), ("other", other)):
        (tmp_path / f"{name}.toml").write_text(text)
        found.append(ot.problems.load("task", file=str(tmp_path / f"{name}.toml")).case.collision)
    assert found[0].pairs == found[1].pairs == [["rod", "ball"], ["rod", "crate"]]
    for one, two in zip(found[0].bodies, found[1].bodies, strict=True):
        for key in ("centre", "axes", "half", "radius"):
            np.testing.assert_allclose(one[key], two[key], rtol=1e-13, atol=1e-15)


@pytest.mark.slow
def test_a_resolved_cell_is_plain_data_that_makes_it_again(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(CELL)
    problem = ot.problems.load("task", file=str(tmp_path / "cell.toml"))
    again = Task(**problem.case.fields())
    assert again == problem.case and again.resolved
    (limit,) = problem.requirements.clearance_constraints
    (other,) = ot.problems.load("task", **problem.case.fields()).requirements.clearance_constraints
    assert [body.to_data(limit.robot.model) for body in limit.bodies] == [
        body.to_data(other.robot.model) for body in other.bodies
    ]
    assert limit.pairs == other.pairs and limit.labels == ("rod - ball",)
