"""A journal: a record a line, each on the disk before the next is begun, each with the checksum of all up to it.

A line is ``{"crc":"1a2b3c4d","record":{..}}``, JSON. Its checksum is the CRC-32 of the record's text, continued from
the line before, so that a line which was changed, moved or taken out is noticed. The last line may be torn, by a crash,
a full disk or lost power: nobody was told that it is written, so it does not count, and is cut off before the next.
"""

from __future__ import annotations

import json
import os
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ocp_traj.errors import FileFormatError
from ocp_traj.files import sync

_LINE = re.compile(rb'\{"crc":"([0-9a-f]{8})","record":(\{.*\})\}')


class Journal:
    """A journal to append to, new or continued."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.touch()
            sync(path.parent)
            _, self._size, self._checksum = _read(path)
        except OSError as error:
            raise self._failure(error) from error

    def append(self, record: Mapping[str, Any]) -> None:
        """Adds a record of plain JSON values; it is on the disk when this returns."""
        text = json.dumps(record, separators=(",", ":"), allow_nan=False).encode()
        checksum = zlib.crc32(text, self._checksum)
        line = b'{"crc":"%08x","record":%s}\n' % (checksum, text)
        try:
            with open(self.path, "r+b", buffering=0) as file:
                file.truncate(self._size)  # what follows the last whole record is torn
                file.seek(self._size)
                written = 0
                while written < len(line):  # a disk that is nearly full takes a part
                    written += file.write(line[written:])
                os.fsync(file.fileno())
        except OSError as error:
            raise self._failure(error) from error
        self._size, self._checksum = self._size + len(line), checksum

    def _failure(self, error: OSError) -> FileFormatError:
        return FileFormatError(
            f"cannot write {self.path}: {error.strerror or error}; what it holds so far is kept: make room, or choose "
            "a place that is writable"
        )


def records(path: Path) -> list[dict[str, Any]]:
    """The records of a journal, but for a torn last one; raises ``FileFormatError`` where one is damaged."""
    try:
        return _read(path)[0]
    except OSError as error:
        raise FileFormatError(f"cannot read the journal {path}: {error.strerror or error}") from error


def _read(path: Path) -> tuple[list[dict[str, Any]], int, int]:
    """The records, the length of their lines together [bytes] and the last one's checksum."""
    *lines, torn = path.read_bytes().split(b"\n")
    if lines and not torn and b"\0" in lines[-1]:  # where power was lost, parts of a file may be zeros
        lines.pop()
    found: list[dict[str, Any]] = []
    checksum = 0
    for number, line in enumerate(lines, 1):
        match = _LINE.fullmatch(line)
        checksum = zlib.crc32(match[2], checksum) if match else 0
        if not match or int(match[1], 16) != checksum:
            raise FileFormatError(
                f"{path} is damaged: line {number} is not as it was written, or the one before it is missing; "
                f"to keep the {number - 1} records before it, delete it and all that follows"
            )
        try:
            found.append(json.loads(match[2]))
        except (RecursionError, ValueError) as error:
            raise FileFormatError(f"{path} is damaged: line {number} holds no JSON record") from error
    return found, sum(map(len, lines)) + len(lines), checksum
