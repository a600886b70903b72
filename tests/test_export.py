import json
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pytest import approx

from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.io.export import check_table, export, tables
from ocp_traj.io.run_reader import load_run
from ocp_traj.io.store import Run, request, save_run
from ocp_traj.results.front import Front
from ocp_traj.results.records import of_population
from ocp_traj.results.trajectory import Trajectory
from tests.closed_form import quintic_problem

needs_pyarrow = pytest.mark.skipif(find_spec("pyarrow") is None, reason="needs ocp-traj[parquet]")


@pytest.fixture(scope="module")
def front() -> Front:
    problem = problems.load("hybrid-spline", payload=8.0)
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    xs = [factor * h for factor in (1.0, 1.3, 1.6)]
    return Front.of(problem, ["time", "energy"], xs, method="dilated", seed=4, seconds=2.5)


@pytest.fixture(scope="module")
def run(front: Front, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_run(front, tmp_path_factory.mktemp("runs") / "first")


@pytest.fixture
def homeless(tmp_path: Path) -> Path:
    """A trajectory of no problem: from 0 to 1e-5 in 2.5 s at constant speed 4e-6, and a joint at rest."""
    points = np.array([[0.0, 1.0], [1e-5, 1.0]])
    return Trajectory(PiecewiseBezier(np.array([2.5]), (points,)), ("a: b", "yes")).save(tmp_path / "homeless.json")


LAST_BITS = 1e-14  # relative: what pandas' own reading of a number's text may lose


# --- fronts ---


@pytest.mark.parametrize("source", [".", "front.csv"])
def test_a_front_in_csv_is_its_table(front: Front, run: Path, tmp_path: Path, source: str) -> None:
    table = pd.read_csv(export(run / source, "csv", tmp_path / "out.csv"))
    pd.testing.assert_frame_equal(table.set_index("point"), front.table, check_dtype=False, rtol=LAST_BITS, atol=0.0)


@needs_pyarrow
def test_a_front_in_parquet_is_its_table(front: Front, run: Path, tmp_path: Path) -> None:
    table = pd.read_parquet(export(run, "parquet", tmp_path / "out.parquet"))
    pd.testing.assert_frame_equal(table.set_index("point"), front.table, check_dtype=False, rtol=0.0, atol=0.0)


@pytest.mark.parametrize("source", [".", "front.csv"])
def test_a_front_in_json_has_a_record_a_point_and_what_made_it(
    front: Front, run: Path, tmp_path: Path, source: str
) -> None:
    data = json.loads(export(run / source, "json", tmp_path / "out.json").path.read_text())
    assert (data["format"], data["kind"]) == ("ocp-traj/table/1", "front")
    assert data["metadata"]["case"] == {"payload": 8.0} and data["metadata"]["method"] == "dilated"
    assert [row["energy [N2 m2/s]"] for row in data["rows"]] == front.table["energy [N2 m2/s]"].tolist()
    assert [row["point"] for row in data["rows"]] == [0, 1, 2]
    assert {row["verdict"] for row in data["rows"]} == {"proved"}


def test_a_table_without_a_run_has_no_metadata(run: Path, tmp_path: Path) -> None:
    (tmp_path / "front.csv").write_bytes((run / "front.csv").read_bytes())
    data = json.loads(export(tmp_path / "front.csv", "json", tmp_path / "out.json").path.read_text())
    assert data["metadata"] == {} and len(data["rows"]) == 3


def test_a_run_that_goes_on_is_exported_as_far_as_it_is(front: Front, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with Run(folder, request(front.problem, front.objectives, "nsga2")) as run:
        for rows in (0, 1):
            table = pd.read_csv(export(folder, "csv", tmp_path / "out.csv"))
            assert len(table) == rows and list(table.columns[1:]) == list(front.table.columns)
            run.found(of_population([front.points[1].x]))
    assert table["time [s]"].tolist() == approx([1.3 * 6.19]) and table["verdict"].tolist() == ["proved"]


def test_a_run_of_no_known_problem_is_exported_as_its_table_says(tmp_path: Path) -> None:
    """There is nothing to prove its points with: only who names the table itself gets it."""
    quintic = quintic_problem()
    run = save_run(
        Front.of(quintic, ["time", "effort"], [[2.5], [3.0]], method="", seed=0, seconds=1.0), tmp_path / "run"
    )
    data = json.loads(export(run / "front.csv", "json", tmp_path / "out.json").path.read_text())
    assert data["metadata"]["problem"] == "quintic" and [row["T [s]"] for row in data["rows"]] == [2.5, 3.0]
    with pytest.raises(FileFormatError, match="there is no problem 'quintic'"):
        export(run, "json", tmp_path / "again.json")
    assert len(load_run(run, quintic)) == 2


# --- trajectories ---


def test_a_trajectory_in_csv_has_units_and_the_samples(front: Front, run: Path, tmp_path: Path) -> None:
    table = pd.read_csv(export(run / "trajectories" / "001.json", "csv", tmp_path / "out.csv", samples=31))
    assert list(table.columns[:3]) == ["time [s]", "X_S1 q [m]", "X_S2 q [m]"]
    assert {"phi_5 q [rad]", "X_S1 v [m/s]", "phi_4 jerk [rad/s3]", "X_S3 snap [m/s4]"} <= set(table.columns)
    curve, times = front.trajectory(1).curve, np.linspace(0.0, 1.3 * 6.19, 31)
    assert table["time [s]"].to_numpy() == approx(times)
    assert table["X_S2 q [m]"].to_numpy() == approx(curve(times)[:, 1], rel=1e-12)
    assert table["phi_4 a [rad/s2]"].to_numpy() == approx(curve(times, 2)[:, 3], rel=1e-9, abs=1e-12)


@needs_pyarrow
def test_a_trajectory_in_parquet_equals_the_csv(run: Path, tmp_path: Path) -> None:
    source = run / "trajectories" / "000.json"
    whole = pd.read_parquet(export(source, "parquet", tmp_path / "out.parquet"))
    assert len(whole) == 200
    pd.testing.assert_frame_equal(
        whole, pd.read_csv(export(source, "csv", tmp_path / "out.csv")), rtol=LAST_BITS, atol=0.0
    )


def test_a_trajectory_in_json_has_a_record_a_time_and_where_it_is_from(run: Path, tmp_path: Path) -> None:
    data = json.loads(
        export(run / "trajectories" / "000.json", "json", tmp_path / "o.json", samples=3).path.read_text()
    )
    assert (data["format"], data["kind"]) == ("ocp-traj/table/1", "trajectory")
    assert data["metadata"] == {"problem": "hybrid-spline", "case": {"payload": 8.0}, "parameters": {"payload": 8.0}}
    assert [row["time [s]"] for row in data["rows"]] == approx([0.0, 3.095, 6.19])


@pytest.mark.parametrize("problem", ["", "nowhere"])
def test_a_trajectory_of_no_known_problem_has_no_units(homeless: Path, tmp_path: Path, problem: str) -> None:
    homeless.write_text(json.dumps({**json.loads(homeless.read_text()), "problem": problem}))
    table = pd.read_csv(export(homeless, "csv", tmp_path / "out.csv", samples=2))
    assert list(table.columns[:4]) == ["time [s]", "a: b q", "yes q", "a: b v"]
    assert table["a: b v"].tolist() == approx([4e-6, 4e-6])


# --- what goes wrong ---


def test_ros_and_the_programs_are_for_one_trajectory(run: Path, tmp_path: Path) -> None:
    for source in (run, run / "front.csv"):
        with pytest.raises(InputError, match="is a front; ros is for one trajectory"):
            export(source, "ros", tmp_path / "t.yaml")
    with pytest.raises(InputError, match="is a front, which has no options: rate"):
        export(run, "csv", tmp_path / "t.csv", rate=10.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("format", "name", "options", "message"),
    [
        ("xlsx", "o.xlsx", {}, "no export format 'xlsx'; formats are csv, parquet, json, ros, urscript"),
        ("csv", "o.csv", {"samples": 1}, "samples is 1; give a whole number from 2 to 1e"),
        ("csv", "o.csv", {"samples": 9, "rate": 10.0}, "samples, or points at knots or at a rate"),
        ("csv", "o.csv", {"joints": {"yes": "no"}}, "renamed in tables at knots or at a rate"),
        ("ros", "o.txt", {}, r"written as .yaml, .yml, .json; 'o.txt' ends otherwise"),
        ("ros", "o.yaml", {"rate": -1.0}, "rate is -1.0 Hz; give a finite number above 0"),
        ("ros", "o.yaml", {"rate": 1e9}, "1e[+]09 Hz over 2.5 s are more than 1000000 points"),
        ("ros", "o.yaml", {"at": "vias"}, "points are at 'vias'; give knots, or a rate"),
        ("ros", "o.yaml", {"at": "knots", "rate": 2.0}, "at knots or at a rate; give one"),
        ("ros", "o.yaml", {"tolerance": 0.0}, "tolerance is 0.0 rad or m; give a finite number above zero"),
        ("ros", "o.yaml", {"interpolation": "spline"}, "interpolation is 'spline'; allowed are linear, cubic, quintic"),
        ("ros", "o.yaml", {"joints": {"yess": "no"}}, r"no joint 'yess' to rename \(nearest is 'yes'\)"),
        ("ros", "o.yaml", {"joints": {"yes": "a: b"}}, "two joints would have one name"),
        ("ros", "o.yaml", {"efort": True}, r"ros has no option 'efort' \(nearest is 'effort'\); options are at, rate"),
        ("ros", "o.yaml", {"effort": True}, "has no effort limit, one a joint, to take efforts from"),
        ("bpoly", "o.txt", {}, "a bpoly is written as .json"),
        ("urscript", "o.script", {}, "URScript moves 6 revolute joints; the trajectory has 2: a: b rad, yes rad"),
        ("urscript", "o.script", {"gain": 1.0}, "gain is 1.0; give a finite number from 100 to 2000"),
        ("krl", "o.src", {}, "speeds in per cent need the joints' units and velocity limits"),
        ("krl", "1.src", {}, "a program is called by its file's name, '1'"),
        ("krl", "o.txt", {}, "written as .src"),
        ("fanuc", "o.ls", {}, "joint 3 as shown needs the robot's axes; give the coupling"),
        ("fanuc", "o.ls", {"coupling": 2}, "coupling is 2; give -1, 0 or 1: from -1 to 1"),
    ],
)
def test_what_a_format_cannot_do_is_said_in_a_line(
    homeless: Path, tmp_path: Path, format: str, name: str, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError, match=message) as error:
        export(homeless, format, tmp_path / name, **options)
    assert "\n" not in str(error.value)
    assert not (tmp_path / name).exists()


def test_parquet_without_pyarrow_names_the_extra(
    homeless: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'ocp-traj\[parquet\]'"):
        export(homeless, "parquet", tmp_path / "out.parquet")
    assert not (tmp_path / "out.parquet").exists()


@pytest.mark.parametrize(("format", "suffix"), [("csv", "csv"), ("json", "json"), ("ros", "yaml")])
def test_an_output_that_cannot_be_written_is_named(homeless: Path, tmp_path: Path, format: str, suffix: str) -> None:
    with pytest.raises(FileFormatError, match="cannot write .*none.*choose a folder that exists"):
        export(homeless, format, tmp_path / "none" / f"out.{suffix}")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.json", None, "cannot read the trajectory file"),
        ("none.csv", None, "cannot read the front file"),
        ("a.json", "{", "not JSON"),
        ("a.json", '{"format": "ocp-traj/run/1"}', "not a trajectory: its format is 'ocp-traj/run/1'"),
        ("a.csv", "x,y\n1,2\n", "no columns point, margin and verdict"),
    ],
)
def test_a_source_that_is_neither_front_nor_trajectory_is_refused(
    tmp_path: Path, name: str, content: Any, message: str
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(FileFormatError, match=message):
        export(tmp_path / name, "csv", tmp_path / "out.csv")
    assert not (tmp_path / "out.csv").exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="cannot read the run file .*run.json"):
        export(tmp_path, "csv", tmp_path / "out.csv")


@pytest.mark.parametrize("path", sorted(Path("examples/tasks").glob("*.toml")), ids=lambda path: path.stem)
def test_what_the_examples_ask_for_can_be_exported(path: Path) -> None:
    table = tomllib.loads(path.read_text()).get("export", {"format": "csv"})
    check_table(table)
