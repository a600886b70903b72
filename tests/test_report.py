"""What a page holds, and that nothing else is needed to open it."""

import base64
import gzip
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from pytest import approx

from ocp_traj import problems
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.store import save_run
from ocp_traj.proof.values import limit_on
from ocp_traj.report import page as page_module
from ocp_traj.report.packing import packed, unpacked
from ocp_traj.report.page import SCRIPTS, page, write_report
from ocp_traj.report.page_data import NUMBERS, VERDICTS, page_data
from ocp_traj.report.sampled import INSTANTS, local_times
from ocp_traj.report.sources import read_sources, source_of_front
from ocp_traj.results.front import Front
from ocp_traj.results.trajectory import audit_points
from tests.random_robots import random_model
from tests.report_gantry import build

STATIC = Path(page_module.__file__).parent / "static"
MOST = 3.5e6  # [bytes] of this page of 40 points; 6 MB is what any may have


def dilated(problem: Problem, x: np.ndarray, names: list[str], count: int) -> Front:
    xs = [factor * x for factor in np.linspace(1.0, 1.8, count)]
    return Front.of(problem, names, xs, method="dilated", seed=3, seconds=0.5)


@pytest.fixture(scope="module")
def hybrid_front(hybrid: Problem) -> Front:
    return dilated(hybrid, np.array(problems.module("hybrid-spline").TABLE_7), ["time", "energy"], 40)


@pytest.fixture(scope="module")
def gantry_front() -> Front:
    return dilated(build(), np.array([1.5, 1.8, 1.8, 1.5]), ["time", "jerk"], 3)


@pytest.fixture(scope="module")
def run_folder(hybrid_front: Front, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report") / "run"
    save_run(hybrid_front, folder)
    return folder


def data_of(front: Front) -> dict[str, Any]:
    (found,) = page_data([source_of_front(front, "front")])["sets"]
    return dict(found)


class Elements(HTMLParser):
    """Tags with their attributes, and the text of scripts and of the data."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1][0] == "script":
            self.texts.append(data)


# --- data ---


def test_packed_arrays_come_back() -> None:
    values = np.random.default_rng(0).normal(size=(3, 4)) * 10.0 ** np.arange(-200, 200, 100)
    assert np.array_equal(unpacked(packed(values)), values)
    short = np.random.default_rng(1).normal(size=(5, 2))
    assert np.abs(unpacked(packed(short, "f4")) - short).max() <= 2.0**-24 * np.abs(short).max()


def test_a_point_holds_its_curve_bit_by_bit_and_its_audit_row_by_row(hybrid_front: Front) -> None:
    found = data_of(hybrid_front)
    assert found["traded"] == ["time", "energy"]
    audits = [audit for _, audit in audit_points(hybrid_front.problem, [point.x for point in hybrid_front.points])]
    for point, audit, data in zip(hybrid_front.points, audits, found["points"], strict=True):
        curve = point.trajectory.curve
        assert np.array_equal(unpacked(data["control"]), np.concatenate(curve.control_points))
        assert np.array_equal(unpacked(data["durations"]), curve.durations)
        assert np.array_equal(unpacked(data["x"]), point.x)
        values = dict(zip([o["id"] for o in found["objectives"]], data["objectives"], strict=True))
        assert {name: values[name] for name in hybrid_front.objectives} == {
            name: point.objectives[name] for name in hybrid_front.objectives
        }
        numbers = unpacked(data["numbers"])
        for k, row in enumerate(audit.rows):
            assert found["rows"][data["row"][k]] == [row.limit, row.label, row.unit]
            assert VERDICTS[int(data["verdicts"][k])] == row.verdict
            assert numbers[k].tolist() == [getattr(row, name) for name in NUMBERS]
    assert found["knee"] == hybrid_front.knee()
    assert found["ends"] == [0, 39]
    assert {label.split(", ")[1] for label in found["paper"]} == {"NSGA-II", "fmincon"}
    assert found["paper"]["paper, NSGA-II, best"]["time"] == approx(6.189)


def test_sampled_limits_are_the_limits(gantry_front: Front) -> None:
    found = data_of(gantry_front)
    problem = gantry_front.problem
    (limit,) = (one for one in problem.requirements.path_constraints if one.order is None)
    for point, data in zip(gantry_front.points, found["points"], strict=True):
        values = unpacked(data["samples"][limit.id])
        u = local_times(point.trajectory.curve.segments, INSTANTS)
        assert values.shape == (point.trajectory.curve.segments, len(u), len(limit.labels))
        assert values[:, :, 0].size >= INSTANTS
        for k in range(len(values)):
            exact = limit_on(point.trajectory, problem.requirements, limit, k, u).T
            assert np.abs(values[k] - exact).max() <= 1e-7 * np.abs(exact).max()


def frames(robot: dict[str, Any], s: np.ndarray) -> list[pin.SE3]:
    """Joint frames as the page computes them, from its data alone."""
    found = [pin.SE3.Identity()]
    for joint in robot["joints"]:
        numbers, value, axis = joint["placement"], s[joint["column"]], np.array(joint["axis"])
        mount = pin.SE3(np.reshape(numbers[:9], (3, 3)), np.array(numbers[9:]))
        moved = pin.SE3(pin.exp3(axis * value), np.zeros(3)) if joint["turns"] else pin.SE3(np.eye(3), axis * value)
        found.append(found[joint["parent"]] * mount * moved)
    return found


def test_the_chain_is_that_of_pinocchio(gantry_front: Front) -> None:
    robot, rng = data_of(gantry_front)["robot"], np.random.default_rng(2)
    model = gantry_front.problem.robot.model
    assert [joint["turns"] for joint in robot["joints"]] == [False, False, True, True]
    for _ in range(5):
        s = rng.normal(size=4)
        data, q = model.createData(), pin.neutral(model)
        for joint, value in zip(model.joints[1:], s, strict=True):
            at = joint.idx_q
            q[at : at + joint.nq] = [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
        pin.forwardKinematics(model, data, q)
        for frame, exact in zip(frames(robot, s), data.oMi, strict=True):
            assert np.abs(frame.homogeneous - exact.homogeneous).max() <= 1e-12


def test_the_map_of_actuators_goes_along(hybrid: Problem, hybrid_front: Front) -> None:
    robot = data_of(hybrid_front)["robot"]
    values: dict[int, float] = {}
    operations = {
        "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
        "atan": np.arctan, "neg": lambda a: -a, "same": lambda a: a,
    }  # fmt: skip
    q, joints = np.array([0.2, 0.35, 0.1, -0.4, 0.9]), np.zeros(5)
    for name, written, *read in robot["actuators"]["steps"]:
        if name == "const":
            values[written] = read[0]
        elif name == "in":
            values[written] = q[read[0]]
        elif name == "out":
            joints[written] = values[read[0]]
        else:
            values[written] = operations[name](*(values[r] for r in read))
    tool = robot["tool"]
    held = pin.SE3(np.reshape(tool["placement"][:9], (3, 3)), np.array(tool["placement"][9:]))
    at = frames(robot, joints)[tool["joint"]] * held
    assert np.abs(at.translation - hybrid.robot.poses(q)[1][0]).max() <= 1e-12
    assert robot["up"] == approx([0.0, 0.0, -1.0])  # its z points down


def test_trees_and_axes_of_any_direction_are_told(gantry_front: Front) -> None:
    from ocp_traj.report.kinematics import _joint

    for seed in range(4):
        model = random_model(np.random.default_rng(seed), 6, branching=True)
        told = {"joints": [_joint(model, i) for i in range(1, model.njoints)]}
        s, data = np.random.default_rng(seed + 9).normal(size=6), model.createData()
        pin.forwardKinematics(model, data, s)
        for frame, exact in zip(frames(told, s), data.oMi, strict=True):
            assert np.abs(frame.homogeneous - exact.homogeneous).max() <= 1e-12


def test_what_cannot_be_drawn_is_said() -> None:
    from dataclasses import replace

    from ocp_traj.report.kinematics import NO_ROBOT, robot_data

    assert robot_data(replace(build(), robot=None)) == {"absent": NO_ROBOT}


def test_obstacles_of_the_wrist_are_in_metres() -> None:
    from ocp_traj.report.kinematics import robot_data

    robot = robot_data(problems.load("wrist-obstacle"))
    (ball, link) = robot["bodies"]
    assert (ball["kind"], ball["joint"], ball["radius"]) == ("sphere", 0, approx(0.04))
    assert (link["kind"], link["joint"], link["radius"]) == ("capsule", 3, approx(0.005))
    assert robot["tool"]["placement"][11] == approx(2.0 * link["half"][2])  # it ends at the tip


# --- page ---


@pytest.mark.slow
def test_a_page_of_forty_points_is_small_and_loads_nothing(run_folder: Path, tmp_path: Path) -> None:
    text = write_report([run_folder], tmp_path / "page.html").read_text(encoding="utf-8")
    assert len(text.encode()) <= MOST
    found = Elements(text)
    loaded = [
        attributes[name]
        for _, attributes in found.tags
        for name in ("src", "href", "srcset", "data", "action", "poster")
        if name in attributes
    ]
    assert loaded == ["data:,"]  # the icon, which a browser would ask for otherwise
    (policy,) = (a["content"] for _, a in found.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None and "default-src 'none'" in policy and "http" not in policy
    assert not re.search(r"url\(|@import", (STATIC / "page.css").read_text())
    own = [(STATIC / name).read_text() for name in SCRIPTS]
    addresses = {part for part in re.findall(r"https?://[^\"'` ]+", "\n".join(own))}
    assert addresses == {"http://www.w3.org/2000/svg"}  # a name, not a place
    data = json.loads(next(t for t in found.texts if t.startswith('{"format"')))
    assert data["sets"][0]["command"].startswith("ocp-traj pareto hybrid-spline --objectives time,energy")
    assert len(data["sets"][0]["points"]) == 40
    (packed_script,) = (t for t in found.texts if len(t) > 1e6)
    assert gzip.decompress(base64.b64decode(packed_script)).decode() == page_module.plotly_js()


def test_words_of_a_problem_are_not_markup(gantry_front: Front) -> None:
    text = page(page_data([source_of_front(gantry_front, "</script><b>")]))
    assert "<title>a &lt;gantry&gt; &amp; its marks</title>" in text
    assert "</script><b>" not in text
    data = json.loads(next(t for t in Elements(text).texts if t.startswith('{"format"')))
    assert (data["title"], data["sets"][0]["name"]) == ("a <gantry> & its marks", "</script><b>")


def test_every_script_is_in_the_page_and_in_the_package() -> None:
    assert sorted(path.name for path in STATIC.glob("*.js")) == sorted(SCRIPTS)
    assert max(len(path.read_text().splitlines()) for path in STATIC.iterdir()) < 300


def test_the_same_front_gives_the_same_bytes(gantry_front: Front) -> None:
    first, second = (page(page_data([source_of_front(gantry_front, "front")])) for _ in range(2))
    assert first == second


@pytest.mark.slow
def test_the_command_writes_a_page(run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, file = tmp_path / "page.html", run_folder / "trajectories" / "000.json"
    assert run(["report", str(run_folder), str(file), "-o", str(target), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["bytes"] == target.stat().st_size
    assert [(one["name"], one["points"]) for one in told["shown"]] == [("run", 40), ("000.json", 1)]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["report", "{run}", "{run}"], "given twice"),
        (["report", "{run}", "-o", "page.pdf"], "a page ends in .html"),
        (["report", "nowhere.json"], "cannot read"),
        (["report", "examples/foreign/samples.json"], "names no problem"),
    ],
)
def test_wrong_input_is_told_and_nothing_is_written(
    arguments: list[str], words: str, run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [a.replace("{run}", str(run_folder)) for a in arguments]
    target = tmp_path / "report.html"
    assert run(given if "-o" in given else [*given, "-o", str(target)]) == 2
    assert words in capsys.readouterr().err
    assert not target.exists() and not list(tmp_path.iterdir())


def test_without_plotly_it_says_what_to_install(
    run_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(InputError, match=r"pip install 'ocp-traj\[report\]'"):
        write_report([run_folder], tmp_path / "page.html")


def test_a_dilated_trajectory_is_shown_without_variables(hybrid_front: Front, tmp_path: Path) -> None:
    hybrid_front.trajectory(0).dilate(1.5).save(tmp_path / "slow.json")
    (source,) = read_sources([tmp_path / "slow.json"])
    point = page_data([source])["sets"][0]["points"][0]
    assert point["x"] is None and set(point["objectives"]) == {None}
    assert point["verdict"] == "proved"
