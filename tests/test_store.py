import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ocp_traj import problems, store
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.front import Front
from ocp_traj.store import check_target, load_run, plain, save_run

Edit = Callable[[Any], Any]


@pytest.fixture(scope="module")
def front() -> Front:
    """Three dilations of the published trajectory, with another payload than the default."""
    problem = problems.load("hybrid-spline", payload=8.0, weights=[0.1, 0.2, 0.3, 0.4])
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    info = {
        "rounds": np.int64(3),
        "steps": np.array([0.5, np.nan]),
        "paper": {"best": {"time": 6.189, "energy": 3921.6}},
    }
    return Front.of(
        problem, ["time", "energy"], [s * h for s in (1.0, 1.3, 1.6)], method="dilated", seed=4, seconds=2.5, info=info
    )


@pytest.fixture(scope="module")
def saved(front: Front, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_run(front, tmp_path_factory.mktemp("runs") / "first")


@pytest.fixture
def run(saved: Path, tmp_path: Path) -> Path:
    """A copy of the saved run, to be damaged or replaced."""
    return Path(shutil.copytree(saved, tmp_path / "first"))


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def edit_json(path: Path, change: Edit) -> None:
    data = json.loads(path.read_text())
    path.write_text(json.dumps(change(data)))


# --- round trip ---


def test_a_run_comes_back_as_it_was(front: Front, run: Path) -> None:
    loaded = load_run(run)
    assert loaded.table.equals(front.table)  # to the last bit
    assert (loaded.values == front.values).all()
    assert [t.trajectory.to_dict() for t in loaded.points] == [t.trajectory.to_dict() for t in front.points]
    assert (loaded.objectives, loaded.method, loaded.seed, loaded.seconds) == (("time", "energy"), "dilated", 4, 2.5)
    assert loaded.problem.case == front.problem.case
    assert loaded.hypervolume() == front.hypervolume()
    assert loaded.info["rounds"] == 3 and loaded.info["dropped"] == front.info["dropped"]
    assert loaded.audit(2).proved


def test_a_run_folder_holds_what_made_it(front: Front, run: Path) -> None:
    assert files(run) == ["front.csv", "front.png", "run.json", *(f"trajectories/00{i}.json" for i in range(3))]
    data = json.loads((run / "run.json").read_text())
    assert data["format"] == "ocp-traj/run/1"
    assert data["problem"] == "hybrid-spline"
    assert data["case"] == {"payload": 8.0, "weights": [0.1, 0.2, 0.3, 0.4]}
    assert set(data["versions"]) == {"ocp-traj", "casadi", "pin", "pymoo", "numpy"}
    assert data["versions"]["numpy"] == np.__version__
    assert data["hypervolume"]["reference"] == {"time": 8.0, "energy": 6000.0}
    assert data["hypervolume"]["value"] == front.hypervolume().value
    assert data["info"]["steps"] == [0.5, None]
    header = (run / "front.csv").read_text().splitlines()[0]
    assert header.startswith("point,time [s],energy [N2 m2/s],") and header.endswith(",h12 [s],margin,verdict")


def test_an_empty_front_comes_back_empty(front: Front, tmp_path: Path) -> None:
    loaded = load_run(save_run(replace(front, points=()), tmp_path / "none"))
    assert len(loaded) == 0 and list(loaded.table.columns) == list(front.table.columns)
    assert json.loads((tmp_path / "none" / "run.json").read_text())["hypervolume"]["ideal"] == {
        "time": None,
        "energy": None,
    }


def test_a_run_without_a_reference_point_has_no_hypervolume(front: Front, tmp_path: Path) -> None:
    bare = replace(front, problem=replace(front.problem, reference_point={}))
    save_run(bare, tmp_path / "bare")
    assert json.loads((tmp_path / "bare" / "run.json").read_text())["hypervolume"]["value"] is None


def test_missing_parents_are_made_and_the_mode_is_the_usual_one(front: Front, tmp_path: Path) -> None:
    target = save_run(front, tmp_path / "a" / "b" / "run")
    (tmp_path / "plain").mkdir()
    assert target.stat().st_mode == (tmp_path / "plain").stat().st_mode
    assert sorted(path.name for path in target.parent.iterdir()) == ["run"]


# --- refusals ---


def test_an_existing_folder_is_refused_and_kept_without_force(front: Front, run: Path) -> None:
    before = {name: (run / name).read_bytes() for name in files(run)}
    with pytest.raises(InputError, match="first exists; choose another folder or pass --force"):
        save_run(front, run)
    with pytest.raises(InputError, match="first exists"):
        check_target(run)
    assert {name: (run / name).read_bytes() for name in files(run)} == before


def test_force_replaces_the_whole_run(front: Front, run: Path) -> None:
    save_run(replace(front, points=front.points[:1], method="again"), run, force=True)
    loaded = load_run(run)
    assert len(loaded) == 1 and loaded.method == "again"
    assert not (run / "trajectories" / "001.json").exists()
    assert [path.name for path in run.parent.iterdir()] == ["first"]


def test_force_does_not_delete_a_folder_that_is_no_run(front: Front, tmp_path: Path) -> None:
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "chapter.tex").write_text("all my work")
    with pytest.raises(InputError, match="thesis is not a run folder: it holds files but no run.json"):
        save_run(front, precious, force=True)
    assert files(precious) == ["chapter.tex"]


def test_force_takes_an_empty_folder(front: Front, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert len(load_run(save_run(front, tmp_path / "empty", force=True))) == 3


def test_force_follows_a_link_to_the_run(front: Front, run: Path, tmp_path: Path) -> None:
    link = tmp_path / "latest"
    link.symlink_to(run)
    save_run(replace(front, method="again"), link, force=True)
    assert link.is_symlink() and load_run(run).method == "again"


def test_the_current_folder_is_not_replaced(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(run / "trajectories")
    with pytest.raises(InputError, match="current folder or one above it"):
        check_target(run, force=True)


def test_a_target_that_cannot_be_made_is_refused_before_long_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="exists and is not a folder"):
        check_target(tmp_path / "file", force=True)
    with pytest.raises(InputError, match="cannot create .*Not a directory; choose a place"):
        check_target(tmp_path / "file" / "run")
    with pytest.raises(InputError, match="cannot create"):
        check_target(tmp_path / ("n" * 300))
    with pytest.raises(InputError, match="cannot create"):
        check_target("bad\0name")
    with pytest.raises(InputError, match="cannot create"):
        check_target("/proc/run")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_check_leaves_nothing_behind(tmp_path: Path) -> None:
    assert check_target(tmp_path / "new" / "run") == tmp_path.resolve() / "new" / "run"
    assert list(tmp_path.iterdir()) == []


# --- failures half way ---


@pytest.mark.parametrize("error", [RuntimeError("midway"), KeyboardInterrupt()])
def test_a_failure_while_writing_leaves_nothing(
    front: Front, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr(store, "plot_front", fail)
    with pytest.raises(type(error)):
        save_run(front, tmp_path / "first")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_while_replacing_brings_the_old_run_back(
    front: Front, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = Path.rename

    def fail_for_the_new(self: Path, target: Any) -> Path:
        if self.name == "new":
            raise OSError(28, os.strerror(28))
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail_for_the_new)
    with pytest.raises(FileFormatError, match="cannot write the run .*No space left"):
        save_run(replace(front, method="again"), run, force=True)
    assert load_run(run).method == "dilated"
    assert [path.name for path in run.parent.iterdir()] == ["first"]


# --- damaged runs ---


def without(key: str) -> Edit:
    return lambda data: {k: v for k, v in data.items() if k != key}


def having(**changes: Any) -> Edit:
    return lambda data: {**data, **changes}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (having(format="ocp-traj/run/2"), "not a run: its format is 'ocp-traj/run/2'; allowed is 'ocp-traj/run/1'"),
        (lambda data: [data], "not a run: its format is None"),
        (without("method"), "the field 'method' of format ocp-traj/run/1 is missing"),
        (having(problem="wrist"), "does not describe a run: there is no problem 'wrist'"),
        (having(case={"paylod": 1.0}), "no case field 'paylod'"),
        (having(case=3), "does not describe a run"),
        (having(objectives=["time"]), "two or more different objectives"),
        (having(seconds="long"), "does not describe a run"),
        (having(info=None), "does not describe a run"),
        (having(points=4), "front.csv has 3 rows; run.json says 4"),
        (having(case={"payload": 7.0}), "000.json and point 0 of front.csv do not belong together"),
        (having(case={"payload": 8.0, "free_payload": True}), "its columns are time"),
    ],
)
def test_a_damaged_manifest_is_refused(run: Path, change: Edit, message: str) -> None:
    edit_json(run / "run.json", change)
    with pytest.raises(FileFormatError, match=message):
        load_run(run)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "", "not a front: No columns"),
        (lambda text: "a,b\n1,2\n", "no columns point, margin and verdict"),
        (lambda text: text.replace("energy [N2 m2/s]", "energy [J]"), "its columns are time .*those of hybrid-spline"),
        (lambda text: "\n".join(text.splitlines()[:-1]), "front.csv has 2 rows; run.json says 3"),
        (lambda text: "\n".join([*text.splitlines()[:2], *text.splitlines()[3:]]), "not numbered 0, 1, 2"),
        (lambda text: text[: len(text) - 30], "not a front"),
        (lambda text: text.replace("0,6.19", "0,fast", 1), r"time \[s\] holds what is no number: .*fast"),
        (lambda text: text.replace("0,6.19", "0,inf", 1), r"time \[s\] holds what is no finite number"),
        (lambda text: text.replace("0,6.19", "0,6.29", 1), "point 0 of front.csv do not belong together"),
        (lambda text: text.replace("proved", "fine"), r"has the verdicts \['fine'\]"),
        (lambda text: text.replace(",proved", ",proved,1"), "not a front"),
    ],
)
def test_a_damaged_table_is_refused(run: Path, change: Callable[[str], str], message: str) -> None:
    text = (run / "front.csv").read_text()
    assert change(text) != text
    (run / "front.csv").write_text(change(text))
    with pytest.raises(FileFormatError, match=message):
        load_run(run)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: {**data, "durations": [1.01 * t for t in data["durations"]]},
        having(problem="hybrid-twist"),
        having(case={}),
        having(parameters={"payload": 1.0}),
        lambda data: {
            **data,
            "durations": data["durations"][:-1],
            "control_points": data["control_points"][:-1],
        },
    ],
)
def test_a_trajectory_that_is_not_that_of_its_row_is_refused(run: Path, change: Edit) -> None:
    edit_json(run / "trajectories" / "001.json", change)
    with pytest.raises(FileFormatError, match="001.json and point 1 of front.csv do not belong together"):
        load_run(run)


def test_a_missing_file_is_named(run: Path) -> None:
    (run / "trajectories" / "002.json").unlink()
    with pytest.raises(FileFormatError, match="cannot read the trajectory file .*002.json: No such file"):
        load_run(run)
    with pytest.raises(FileFormatError, match="cannot read the run file .*none/run.json: No such file"):
        load_run(run / "none")


def test_notes_become_plain_json() -> None:
    notes = {1: (np.float64("inf"), np.arange(2)), "deep": {"path": Path("a"), "flag": np.True_, "none": None}}
    assert plain(notes) == {"1": [None, [0, 1]], "deep": {"path": "a", "flag": True, "none": None}}
    json.dumps(plain(notes), allow_nan=False)
