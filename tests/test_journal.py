"""A journal keeps every record it was given, whatever ends the writing, and notices what was changed."""

import errno
import json
import os
import resource
import zlib
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from typing import Any

import pytest

from ocp_traj.errors import FileFormatError
from ocp_traj.io.journal import Journal, records

THREE = [{"kind": "a", "x": [0.1, 1e-300]}, {"kind": "b", "x": [1 / 3]}, {"kind": "c", "words": "\n\u2028 }"}]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    target = tmp_path / "journal.jsonl"
    add(target, *THREE)
    return target


def add(path: Path, *found: dict[str, Any]) -> None:
    journal = Journal(path)
    for record in found:
        journal.append(record)


def test_records_come_back_to_the_last_bit_and_lines_are_json_with_a_running_checksum(path: Path) -> None:
    assert records(path) == THREE
    checksum = 0
    for line, record in zip(path.read_text().splitlines(), THREE, strict=True):
        assert json.loads(line)["record"] == record
        checksum = zlib.crc32(line.partition('"record":')[2][:-1].encode(), checksum)
        assert json.loads(line)["crc"] == f"{checksum:08x}"


def test_a_record_is_synced_before_append_returns(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda handle: synced.append(os.fstat(handle).st_size))
    add(path, {"kind": "d"})
    assert synced[-1] == path.stat().st_size


def test_torn_at_any_byte_the_last_record_is_dropped_and_cut_off_before_the_next(path: Path) -> None:
    whole = path.read_bytes()
    before = whole.rindex(b"\n", 0, -1) + 1
    for size in range(before, len(whole)):
        path.write_bytes(whole[:size])
        assert records(path) == THREE[:2]
        for number in range(2):  # opened twice: a torn line that stays would be found by the second
            add(path, {"kind": "d", "number": number})
        assert records(path) == [*THREE[:2], {"kind": "d", "number": 0}, {"kind": "d", "number": 1}]


@pytest.mark.parametrize("zeros", [slice(-40, None), slice(-40, -10)])
def test_a_last_record_of_which_lost_power_left_zeros_is_dropped(path: Path, zeros: slice) -> None:
    content = bytearray(path.read_bytes())
    content[zeros] = bytes(len(content[zeros]))
    path.write_bytes(content)
    assert records(path) == THREE[:2]
    add(path, THREE[2])
    assert records(path) == THREE


class Filling(FileIO):
    """A file on a disk that takes half of what is written, and then nothing."""

    full = False

    def write(self, data: Any) -> int:
        if self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.full = True
        return super().write(data[: len(data) // 2])


def test_a_full_disk_loses_the_record_that_did_not_fit_and_no_other(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(path)
    with monkeypatch.context() as patch:
        patch.setattr("ocp_traj.io.journal.open", lambda path, mode, **_: Filling(path, mode), raising=False)
        with pytest.raises(FileFormatError, match="cannot write .*journal.jsonl: No space left on device; what it"):
            journal.append({"kind": "d"})
    assert records(path) == THREE and not path.read_bytes().endswith(b"\n")
    journal.append({"kind": "e"})  # there is room again
    assert records(path) == [*THREE, {"kind": "e"}]


def test_a_limit_on_the_size_of_files_is_a_full_disk(path: Path) -> None:
    journal, limits = Journal(path), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 20, limits[1]))
    try:
        with pytest.raises(FileFormatError, match="cannot write .*File too large"):
            journal.append({"kind": "d", "long": "d" * 100})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert records(path) == THREE
    journal.append({"kind": "e"})
    assert records(path) == [*THREE, {"kind": "e"}]


def test_a_record_that_could_not_be_synced_does_not_count(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(path)

    def fail(handle: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", fail)
        with pytest.raises(FileFormatError, match="Input/output error"):
            journal.append({"kind": "d"})
    journal.append({"kind": "e"})
    assert records(path) == [*THREE, {"kind": "e"}]


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda lines: [lines[0].replace(b"0.1", b"0.2"), *lines[1:]], 1),
        (lambda lines: [lines[0], lines[1].replace(b'"b"', b'"a"'), lines[2]], 2),
        (lambda lines: [*lines[:2], lines[2].replace(b"words", b"Words")], 3),
        (lambda lines: [lines[0], b"\n", *lines[1:]], 2),
        (lambda lines: [lines[0], lines[2]], 2),
        (lambda lines: lines[1:], 1),
        (lambda lines: [lines[1], lines[0], lines[2]], 1),
        (lambda lines: [*lines, lines[2]], 4),
        (lambda lines: [lines[0], lines[1][:20], lines[2]], 2),
    ],
)
def test_a_line_that_was_changed_moved_or_taken_out_is_refused(
    path: Path, change: Callable[[list[bytes]], list[bytes]], line: int
) -> None:
    path.write_bytes(b"".join(change(path.read_bytes().splitlines(keepends=True))))
    for reading in (records, Journal):
        with pytest.raises(FileFormatError, match=f"is damaged: line {line} is not as .* keep the {line - 1} records"):
            reading(path)


def test_a_journal_that_is_not_there_or_a_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="cannot read the journal .*none: No such file"):
        records(tmp_path / "none")
    with pytest.raises(FileFormatError, match="cannot write .*: Is a directory"):
        Journal(tmp_path)
