"""The folder of a run belongs to one process, and no moment of replacing an earlier run loses it."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from ocp_traj.errors import InputError
from ocp_traj.io.journal import Journal, records
from ocp_traj.io.run_folder import EARLIER, RunFolder, check_target

PROVED = {"kind": "solve", "points": [{"x": [1.0], "verdict": "proved"}]}
UNPROVED = {"kind": "population", "points": [{"x": [1.0]}]}


def contents(root: Path) -> dict[str, bytes]:
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.fixture
def earlier(tmp_path: Path) -> Path:
    """A run that is there, and something of the user's beside it."""
    root = tmp_path / "run"
    (root / "trajectories").mkdir(parents=True)
    for name in ("run.json", "journal.jsonl", "front.csv", "trajectories/000.json", "notes.txt"):
        (root / name).write_text(f"earlier {name}")
    return root


def write_new(root: Path, *found: dict[str, Any]) -> RunFolder:
    """What a run does to its folder, up to some records."""
    folder = RunFolder(root, force=True)
    journal = Journal(root / "journal.jsonl")
    (root / "run.json").write_text("new")
    for record in found:
        journal.append(record)
    return folder


# --- one process at a time ---


def test_a_second_writer_is_refused_at_once_with_force_too(tmp_path: Path) -> None:
    first = RunFolder(tmp_path / "run")
    for force in (False, True):
        with pytest.raises(InputError, match="run is being written by another process; wait for its end, or"):
            RunFolder(tmp_path / "run", force)
    first.close()
    with pytest.raises(InputError, match="run exists; choose another folder or pass --force"):
        RunFolder(tmp_path / "run")
    RunFolder(tmp_path / "run", force=True).discard()


def test_a_lock_deleted_by_its_owner_in_between_is_taken_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The owner ends between the other's opening of the lock and its locking: that lock is nobody's any more."""
    first, opened, opening = RunFolder(tmp_path / "run"), [], os.open

    def slow(path: Any, *arguments: Any, **options: Any) -> int:
        handle = opening(path, *arguments, **options)
        if str(path).endswith(".lock"):
            opened.append(path)
            first.close()
        return handle

    monkeypatch.setattr(os, "open", slow)
    second = RunFolder(tmp_path / "run", force=True)
    assert len(opened) == 2
    with pytest.raises(InputError, match="being written"):
        RunFolder(tmp_path / "run", force=True)
    second.close()


def test_a_run_that_came_first_is_not_replaced_without_force(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process writes a whole run between the check and the lock."""
    made = Path.mkdir

    def first(self: Path, *arguments: Any, **options: Any) -> None:
        made(self, *arguments, **options)
        if self.name == "run":
            (self / "run.json").write_text("first")

    monkeypatch.setattr(Path, "mkdir", first)
    with pytest.raises(InputError, match="run exists; choose another folder"):
        RunFolder(tmp_path / "run")
    assert contents(tmp_path / "run") == {"run.json": b"first"}


# --- the earlier run ---


def test_a_run_without_a_point_brings_the_earlier_back(earlier: Path) -> None:
    before = contents(earlier)
    folder = write_new(earlier, UNPROVED)
    assert contents(earlier / EARLIER) == {k: v for k, v in before.items() if k != "notes.txt"}
    folder.discard()
    folder.discard()  # the second time there is nothing to do
    assert contents(earlier) == before


def test_a_point_ends_the_earlier_run_and_nothing_else(earlier: Path) -> None:
    folder = write_new(earlier, PROVED)
    folder.forget_earlier()
    folder.close()
    assert set(contents(earlier)) == {"run.json", "journal.jsonl", "notes.txt"}
    assert (earlier / "notes.txt").read_text() == "earlier notes.txt"


def test_a_new_run_without_a_point_leaves_nothing(tmp_path: Path) -> None:
    write_new(tmp_path / "a" / "b" / "run", UNPROVED).discard()
    assert list(tmp_path.iterdir()) == []


@contextmanager
def moments(root: Path) -> Iterator[list[Path]]:
    """Copies of a folder, as it is before each change of its entries: what a kill at that moment leaves."""
    copies: list[Path] = []
    place = root.with_name("moments")
    shutil.rmtree(place, ignore_errors=True)
    busy = False

    def watched(change: Any) -> Any:
        def changing(*arguments: Any, **options: Any) -> Any:
            nonlocal busy
            if not busy:
                busy = True
                copies.append(Path(shutil.copytree(root, place / str(len(copies)))))
                busy = False
            return change(*arguments, **options)

        return changing

    with pytest.MonkeyPatch.context() as patch:
        for name in ("rename", "replace", "unlink", "rmdir", "mkdir"):
            patch.setattr(os, name, watched(getattr(os, name)))
        yield copies


def test_killed_at_any_moment_before_a_point_the_earlier_run_can_be_had(earlier: Path) -> None:
    before = contents(earlier)
    with moments(earlier) as killed:
        write_new(earlier, UNPROVED).discard()
    assert len(killed) > 15
    for root in killed:
        RunFolder(root, force=True).discard()
        assert contents(root) == before


def test_killed_at_any_moment_after_a_point_the_new_run_is_there(earlier: Path) -> None:
    folder = write_new(earlier, PROVED)
    with moments(earlier) as killed:
        folder.forget_earlier()
        folder.close()
    assert len(killed) > 5
    for root in killed:
        assert records(root / "journal.jsonl") == [PROVED]
        RunFolder(root, force=True).discard()
        assert records(root / "journal.jsonl") == [PROVED] and (root / "run.json").read_text() == "new"
        assert not (root / EARLIER).exists()


def test_an_interrupt_while_the_earlier_run_is_set_aside_brings_it_back(
    earlier: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, rename = contents(earlier), Path.rename

    def interrupted(self: Path, target: Any) -> Path:
        if self.name == "front.csv":
            monkeypatch.undo()
            raise KeyboardInterrupt
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        RunFolder(earlier, force=True)
    assert contents(earlier) == before
    RunFolder(earlier, force=True).discard()


# --- what is never replaced ---


def test_a_folder_that_is_no_run_is_refused_and_kept(tmp_path: Path) -> None:
    precious = tmp_path / "thesis"
    for name in ("chapter.tex", "front.csv", "journal.jsonl", "earlier/run.json"):
        (precious / name).parent.mkdir(parents=True, exist_ok=True)
        (precious / name).write_text("all my work")
        before = contents(precious)
        with pytest.raises(InputError, match="thesis is not a run folder: it holds files but no run.json"):
            RunFolder(precious, force=True)
        assert contents(precious) == before
        shutil.rmtree(precious)


def test_force_follows_a_link_to_the_run(earlier: Path, tmp_path: Path) -> None:
    link = tmp_path / "latest"
    link.symlink_to(earlier)
    folder = write_new(link, PROVED)
    folder.forget_earlier()
    folder.close()
    assert link.is_symlink() and (earlier / "run.json").read_text() == "new"


def test_the_current_folder_is_not_replaced(earlier: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(earlier / "trajectories")
    with pytest.raises(InputError, match="current folder or one above it"):
        check_target(earlier, force=True)


def test_a_target_that_cannot_be_made_is_refused_before_long_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    cases = {
        tmp_path / "file": "exists and is not a folder",
        tmp_path / "file" / "run": "cannot create .*Not a directory; choose a place",
        tmp_path / ("n" * 300): "cannot create",
        "bad\0name": "cannot create",
        "/proc/run": "cannot create",
    }
    for target, message in cases.items():
        for taking in (check_target, RunFolder):
            with pytest.raises(InputError, match=message):
                taking(target, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_check_leaves_nothing_behind(tmp_path: Path) -> None:
    assert check_target(tmp_path / "new" / "run") == tmp_path.resolve() / "new" / "run"
    assert list(tmp_path.iterdir()) == []
