import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ocp_traj as ot
from benchmarks import kill as killing
from ocp_traj import problems
from ocp_traj.cli.commands import run as run_command
from ocp_traj.errors import FileFormatError, InputError, NoSolutionFound
from ocp_traj.files import plain
from ocp_traj.formulation.problem import Problem
from ocp_traj.io import plot
from ocp_traj.io.export import export
from ocp_traj.io.journal import Journal, records
from ocp_traj.io.plot import plot_front
from ocp_traj.io.run_folder import RunFolder
from ocp_traj.io.run_reader import load_run
from ocp_traj.io.store import Run, request, save_run
from ocp_traj.report.sources import source_of_front
from ocp_traj.results.alternatives import problem_of
from ocp_traj.results.front import Front
from ocp_traj.results.records import of_front, of_population
from tests.closed_form import Quintic, quintic_problem

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
def quintic() -> Problem:
    return quintic_problem()


@pytest.fixture(scope="module")
def written(quintic: Problem, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a problem in no registry, of three points."""
    front = Front.of(quintic, ["time", "effort"], [[2.5], [3.0], [3.5]], method="", seed=0, seconds=1.0)
    return save_run(front, tmp_path_factory.mktemp("runs") / "first")


@pytest.fixture
def small(written: Path, tmp_path: Path) -> Path:
    """A copy of it, to be damaged."""
    return Path(shutil.copytree(written, tmp_path / "first"))


@pytest.fixture(scope="module")
def saved(front: Front, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_run(front, tmp_path_factory.mktemp("runs") / "first")


@pytest.fixture
def run(saved: Path, tmp_path: Path) -> Path:
    """A copy of the saved run, to be damaged or replaced."""
    return Path(shutil.copytree(saved, tmp_path / "first"))


def files(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def write_journal(folder: Path, *found: Any) -> None:
    """A journal of these records, with sound checksums."""
    (folder / "journal.jsonl").unlink(missing_ok=True)
    journal = Journal(folder / "journal.jsonl")
    for record in found:
        journal.append(record)


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
    assert files(run) == [
        "front.csv", "front.png", "journal.jsonl", "run.json", *(f"trajectories/00{i}.json" for i in range(3))
    ]  # fmt: skip
    data = json.loads((run / "run.json").read_text())
    assert data["format"] == "ocp-traj/run/2"
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


# --- replacing ---


def test_an_existing_folder_is_refused_and_kept_without_force(front: Front, run: Path) -> None:
    before = {name: (run / name).read_bytes() for name in files(run)}
    with pytest.raises(InputError, match="first exists; choose another folder or pass --force"):
        save_run(front, run)
    assert {name: (run / name).read_bytes() for name in files(run)} == before


def test_force_replaces_the_whole_run(front: Front, run: Path) -> None:
    save_run(replace(front, points=front.points[:1], method="again"), run, force=True)
    loaded = load_run(run)
    assert len(loaded) == 1 and loaded.method == "again"
    assert not (run / "trajectories" / "001.json").exists()
    assert [path.name for path in run.parent.iterdir()] == ["first"]


def test_force_takes_an_empty_folder(quintic: Problem, written: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert len(load_run(save_run(load_run(written, quintic), tmp_path / "empty", force=True), quintic)) == 3


@pytest.mark.parametrize("error", [RuntimeError("midway"), KeyboardInterrupt()])
def test_a_front_that_cannot_be_saved_leaves_nothing_and_the_earlier_run(
    quintic: Problem, small: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    front = replace(load_run(small, quintic), method="again")
    before = {name: (small / name).read_bytes() for name in files(small)}

    def fail(*_: Any) -> None:
        raise error

    monkeypatch.setattr(plot, "plot_front", fail)
    for folder in (small, small.with_name("new")):
        with pytest.raises(type(error)):
            save_run(front, folder, force=True)
    assert {name: (small / name).read_bytes() for name in files(small)} == before
    assert [path.name for path in small.parent.iterdir()] == ["first"]


@pytest.mark.slow
def test_a_run_that_finds_nothing_leaves_the_earlier_run(small: Path) -> None:
    before = {name: (small / name).read_bytes() for name in files(small)}
    slow = quintic_problem(Quintic(velocity=1e-3))
    for folder in (small, small.with_name("new")):
        with pytest.raises(NoSolutionFound):
            ot.pareto(slow, ["time", "effort"], output=folder, force=True)
    assert {name: (small / name).read_bytes() for name in files(small)} == before
    assert [path.name for path in small.parent.iterdir()] == ["first"]


# --- while it runs ---


@pytest.mark.slow
@pytest.mark.parametrize("method", ["trace", "nsga2", "mopso", "hmoga", "memetic"])
def test_what_is_read_is_what_the_method_gave_to_the_last_bit(quintic: Problem, tmp_path: Path, method: str) -> None:
    options = {"points": 5} if method == "trace" else {"population": 16, "generations": 4}
    front = ot.pareto(quintic, ["time", "effort"], method=method, output=tmp_path / "run", **options)
    loaded = load_run(tmp_path / "run", quintic)
    assert len(front) > 2 and loaded.table.equals(front.table)
    assert loaded.info == plain(front.info) and loaded.seconds == front.seconds
    asked = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (asked["method"], asked["options"], asked["keep_unproved"]) == (method, options, False)


@pytest.mark.slow
def test_at_every_moment_of_a_run_its_points_are_read_proved_and_drawn(quintic: Problem, tmp_path: Path) -> None:
    folder, seen = tmp_path / "run", []

    def look(record: Any) -> None:
        loaded = load_run(folder, quintic)
        if record["kind"] == "start":  # on the way to an end of the front
            return
        seen.append([point.verdict for point in loaded.points])
        assert loaded.info["interrupted"] and loaded.seconds > 0.0
        if len(loaded) == 1:  # the front that a picture might find hardest
            plot_front(loaded, tmp_path / "front.png")

    front = ot.pareto(quintic, ["time", "effort"], points=5, output=folder, found=look)
    assert seen == [["proved"] * number for number in range(1, 6)] and len(front) == 5


def test_before_the_first_point_the_front_is_empty(quintic: Problem, tmp_path: Path) -> None:
    with Run(tmp_path / "run", request(quintic, ["time", "effort"], "trace")):
        loaded = load_run(tmp_path / "run", quintic)
        assert len(loaded) == 0 and loaded.info["interrupted"]
    assert not (tmp_path / "run").exists()


@pytest.mark.slow
def test_a_run_that_ends_early_keeps_what_was_found(quintic: Problem, tmp_path: Path) -> None:
    """An error in the middle, of a full disk for example; the torn line that it may leave does not count."""
    found: list[Any] = []

    def fail(record: Any) -> None:
        found.extend([record] if record["kind"] == "solve" else [])
        if len(found) == 4:
            raise OSError("full")

    with pytest.raises(OSError, match="full"):
        ot.pareto(quintic, ["time", "effort"], points=9, output=tmp_path / "run", found=fail)
    with open(tmp_path / "run" / "journal.jsonl", "ab") as file:
        file.write(b'{"crc":"00000000","rec')
    assert files(tmp_path / "run") == ["journal.jsonl", "run.json"]
    loaded = load_run(tmp_path / "run", quintic)
    assert sorted(p.x[0] for p in loaded.points) == sorted(r["points"][0]["x"][0] for r in found)
    assert len(ot.pareto(quintic, ["time", "effort"], points=3, output=tmp_path / "run", force=True)) == 3


def test_a_population_is_mended_and_proved_when_it_is_read(quintic: Problem, tmp_path: Path) -> None:
    """Slowed down where that proves it, dropped where not; only the last population counts."""
    least = Quintic().least_time
    with Run(tmp_path / "run", request(quintic, ["time", "effort"], "nsga2")) as run:
        run.found(of_population([[2.6], [2.7], [2.8]]))
        run.found(of_population([[least * (1.0 - 1e-6)], [0.5 * least], [3.0]]))
        loaded = load_run(tmp_path / "run", quintic)
    assert [p.x[0] for p in loaded.points] == [pytest.approx(least, rel=1e-5), 3.0]
    assert loaded.points[0].x[0] >= least
    assert loaded.info["dropped"] == {"violated": 1, "undecided": 0, "dominated": 0}


@pytest.mark.slow
def test_of_alternatives_one_front_is_read_at_the_end_and_before(tmp_path: Path) -> None:
    """Slow moves from 1.875 s on, fast ones 1 % farther from 1.07 s: the front is of both."""
    fast, slow = quintic_problem(Quintic(distance=1.01)), quintic_problem(Quintic(velocity=1.0))
    both = replace(slow, alternatives={"slow": slow, "fast": fast})
    seen: list[Any] = []

    def look(record: Any) -> None:
        if record["kind"] == "solve":
            seen.append((record["alternative"], load_run(tmp_path / "run", both)))

    front = ot.pareto(both, ["time", "effort"], points=3, output=tmp_path / "run", found=look)
    loaded = load_run(tmp_path / "run", both)
    assert loaded.table.equals(front.table) and loaded.problem is both
    assert [p.alternative for p in loaded.points] == [p.alternative for p in front.points]
    assert {p.alternative: problem_of(loaded, p) for p in loaded.points} == both.alternatives
    shares = {name: one["points of the front"] for name, one in front.info["alternatives"].items()}
    assert shares == {"slow": 3, "fast": len(front) - 3} and 0 < len(front) - 3 < 3
    assert [name for name, _ in seen] == ["slow"] * 3 + ["fast"] * 3
    assert [len(f) for _, f in seen[:3]] == [1, 2, 3]
    assert seen[2][1].info["alternative"] == "slow" and seen[5][1].table.equals(front.table)
    assert seen[2][1].problem.case == slow.case
    audited = source_of_front(loaded, "run").points
    assert [point.audit.proved for point in audited] == [True] * len(front)


@pytest.mark.slow
def test_killed_at_any_moment_nothing_reported_is_lost_and_the_folder_can_be_written_to(tmp_path: Path) -> None:
    """A sample of ``make kill``, with what others may do while it runs."""
    root = tmp_path / "run"

    def due(seconds: float, left: killing.Left) -> bool:
        if len(left.records) < 6:  # two starts of each end, and the best of them
            return False
        with pytest.raises(InputError, match="run is being written by another process"):
            RunFolder(root, force=True)
        assert run_command(["export", str(root), "--format", "csv", "-o", str(tmp_path / "front.csv")]) == 0
        return True

    before, after = killing.kill(root, due)
    assert len(before.records) >= 2 and not killing.lost([], before, after)
    front = load_run(root)
    assert {point.verdict for point in front.points} == {"proved"}
    assert killing.missing(front, after.records) == 0
    assert len((tmp_path / "front.csv").read_text().splitlines()) >= 3
    save_run(front, root, force=True)
    assert load_run(root).table.equals(front.table)


# --- of the version before ---


@pytest.mark.slow
def test_a_folder_without_a_journal_is_read_and_proved_anew(tmp_path: Path) -> None:
    """Written by the version before, as it is."""
    run = Path(shutil.copytree(Path(__file__).parent / "run_1", tmp_path / "run"))
    front = load_run(run)
    assert [p.verdict for p in front.points] == ["proved"] * 3
    assert front.table["time [s]"].tolist() == pytest.approx([1.7314, 1.7923, 1.8532], abs=5e-5)
    assert (front.method, front.info["solves"]) == ("trace", 3)
    table = run / "front.csv"
    table.write_text(table.read_text().replace("proved", "violated", 1))
    with pytest.raises(FileFormatError, match="says that point 0 is violated; the proof says proved"):
        load_run(run)


# --- damaged runs ---


def without(key: str) -> Edit:
    return lambda data: {k: v for k, v in data.items() if k != key}


def having(**changes: Any) -> Edit:
    return lambda data: {**data, **changes}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            having(format="ocp-traj/run/3"),
            "not a run: its format is 'ocp-traj/run/3'; allowed are 'ocp-traj/run/2' and",
        ),
        (lambda data: [data], "not a run: its format is None"),
        (without("method"), "the field 'method' of format ocp-traj/run/2 is missing"),
        (without("keep_unproved"), "the field 'keep_unproved' of format ocp-traj/run/2 is missing"),
        (having(problem="wrist"), "is a run of wrist with the case {}, and not of the problem that was given, quintic"),
        (having(case={"distance": 2.0}), "is a run of quintic with the case {'distance': 2.0}, and not of"),
        (having(objectives=["time"]), "two or more different objectives"),
        (having(seconds="long"), "does not describe a run"),
        (having(info=None), "does not describe a run"),
        (having(points=4), "says that the front has 4 points; it has 3"),
    ],
)
def test_a_damaged_manifest_is_refused(quintic: Problem, small: Path, change: Edit, message: str) -> None:
    edit_json(small / "run.json", change)
    with pytest.raises(FileFormatError, match=message):
        load_run(small, quintic)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (having(problem="wrist"), r"there is no problem 'wrist'; .*give it, load_run\(folder, problem\), or make"),
        (having(case={"paylod": 1.0}), "no case field 'paylod'"),
        (having(case=3), "does not describe a run"),
        (having(case={"payload": 7.0}), "journal.jsonl and run.json do not belong together"),
        (having(case={"payload": 8.0, "free_payload": True}), "its columns are time"),
    ],
)
def test_a_manifest_of_another_problem_is_refused(run: Path, change: Edit, message: str) -> None:
    edit_json(run / "run.json", change)
    with pytest.raises(FileFormatError, match=message):
        load_run(run)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "", "not a front: No columns"),
        (lambda text: "a,b\n1,2\n", "no columns point, margin and verdict"),
        (lambda text: text.replace("effort [rad2/s3]", "effort [J]"), "its columns are time .*those of quintic are"),
        (lambda text: "\n".join(text.splitlines()[:-1]), "front.csv has 2 rows; the front has 3 points"),
        (lambda text: "\n".join([*text.splitlines()[:2], *text.splitlines()[3:]]), "not numbered 0, 1, 2"),
        (lambda text: text[: len(text) - 30], "not a front"),
        (lambda text: text.replace("0,2.5", "0,fast", 1), r"time \[s\] holds what is no number: .*fast"),
        (lambda text: text.replace("0,2.5", "0,inf", 1), r"time \[s\] holds what is no finite number"),
        (lambda text: text.replace("0,2.5", "0,2.6", 1), "point 0 of front.csv do not belong together"),
        (lambda text: text.replace(",3.5,", ",3.5000000001,"), "point 2 of front.csv do not belong together"),
        (lambda text: text.replace("proved", "fine"), r"has the verdicts \['fine'\]"),
        (lambda text: text.replace("proved", "undecided", 1), "point 0 is undecided; the proof says proved"),
        (lambda text: text.replace(",proved", ",proved,1"), "not a front"),
        (lambda text: text.replace("\n1,", "\n1,1,1,"), "not a front: Error tokenizing data.* in line 3"),
    ],
)
def test_a_damaged_table_is_refused(quintic: Problem, small: Path, change: Callable[[str], str], message: str) -> None:
    text = (small / "front.csv").read_text()
    assert change(text) != text
    (small / "front.csv").write_text(change(text))
    with pytest.raises(FileFormatError, match=message) as caught:
        load_run(small, quintic)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: {**data, "durations": [1.01 * t for t in data["durations"]]},
        having(problem="hybrid-twist"),
        having(case={"distance": 2.0}),
        having(parameters={"payload": 1.0}),
        lambda data: {
            **data,
            "durations": data["durations"] * 2,
            "control_points": data["control_points"] * 2,
        },
    ],
)
def test_a_trajectory_that_is_not_that_of_its_row_is_refused(quintic: Problem, small: Path, change: Edit) -> None:
    edit_json(small / "trajectories" / "001.json", change)
    with pytest.raises(FileFormatError, match="001.json and point 1 of front.csv do not belong together"):
        load_run(small, quintic)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda front: [], "journal.jsonl ends before the front that run.json tells of"),
        (lambda front: [{**front, "points": front["points"][:2]}], "front.csv has 3 rows; the front has 2 points"),
        (lambda front: [having(points=[{"x": [3.0, 1.0]}] * 3)(front)], "a point has 2 variables; quintic has 1"),
        (lambda front: [having(points=[{"x": ["fast"]}] * 3)(front)], "does not hold the records of a run"),
        (lambda front: [having(points=3)(front)], "does not hold the records of a run"),
        (lambda front: [without("kind")(front)], "does not hold the records of a run: KeyError"),
        (lambda front: [{**front, "points": [{**p, "x": [3.1]} for p in front["points"]]}], "do not belong together"),
    ],
)
def test_a_journal_that_does_not_fit_the_rest_is_refused(
    quintic: Problem, small: Path, change: Callable[[Any], list[Any]], message: str
) -> None:
    (front,) = records(small / "journal.jsonl")
    write_journal(small, *change(front))
    with pytest.raises(FileFormatError, match=message):
        load_run(small, quintic)


@pytest.mark.slow
def test_no_verdict_is_believed_neither_by_load_run_nor_by_export(tmp_path: Path) -> None:
    """Table 7 under 12 kg breaks a force; table, journal and run.json say that it is proved."""
    problem = problems.load("hybrid-spline", payload=12.0)
    h = np.array(problems.module("hybrid-spline").TABLE_7)
    front = Front.of(problem, ["time", "energy"], [h, 1.3 * h], method="", seed=0, seconds=1.0, keep_unproved=True)
    assert [p.verdict for p in front.points] == ["violated", "proved"]
    run = save_run(front, tmp_path / "run")
    assert load_run(run).table.equals(front.table)  # as it was, as long as it is told as it is
    said = replace(front, points=tuple(replace(p, verdict="proved") for p in front.points))
    write_journal(run, of_front(said))
    said.table.to_csv(run / "front.csv")
    message = "says that point 0 is proved; the proof says violated"
    with pytest.raises(FileFormatError, match=message):
        load_run(run)
    for source in (run, run / "front.csv"):
        with pytest.raises(FileFormatError, match=message):
            export(source, "csv", tmp_path / "out.csv")
    edit_json(run / "run.json", having(keep_unproved=False))
    with pytest.raises(FileFormatError, match="front.csv has 2 rows; the front has 1 points"):
        load_run(run)
    assert not (tmp_path / "out.csv").exists()


def test_a_missing_file_is_named(quintic: Problem, small: Path) -> None:
    (small / "trajectories" / "002.json").unlink()
    with pytest.raises(FileFormatError, match="cannot read the trajectory file .*002.json: No such file"):
        load_run(small, quintic)
    (small / "journal.jsonl").unlink()
    with pytest.raises(FileFormatError, match="cannot read the journal .*journal.jsonl: No such file"):
        load_run(small, quintic)
    with pytest.raises(FileFormatError, match="cannot read the run file .*none/run.json: No such file"):
        load_run(small / "none")


def test_notes_become_plain_json() -> None:
    notes = {1: (np.float64("inf"), np.arange(2)), "deep": {"path": Path("a"), "flag": np.True_, "none": None}}
    assert plain(notes) == {"1": [None, [0, 1]], "deep": {"path": "a", "flag": True, "none": None}}
    json.dumps(plain(notes), allow_nan=False)
