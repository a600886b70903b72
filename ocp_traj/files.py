"""Files: read with a clear word where they are not what they should be, written whole and for good, or not at all."""

from __future__ import annotations

import json
import os
import select
import stat
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj.errors import FileFormatError, cut
from ocp_traj.stopping import stopping

LARGEST = 64 * 2**20  # [bytes] of a file that is read: our choice, ten times what a weld of a thousand segments takes
CHUNK = 2**20  # [bytes]
LONGEST_PATH = 300  # [characters] of a path in a message: our choice


def read_text(path: str | Path, what: str) -> str:
    """Text of a file or of a pipe that somebody writes to, such as ``/dev/stdin``; at most ``LARGEST`` bytes.

    ``what`` says what it should have been.
    """
    shown = f"the {what} file {cut(str(path), LONGEST_PATH)}"
    try:
        return _content(path, shown).decode("utf-8")
    except FileFormatError:
        raise
    except UnicodeDecodeError as error:
        raise FileFormatError(f"cannot read {shown}: it is not text") from error
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise FileFormatError(f"cannot read {shown}: {getattr(error, 'strerror', None) or error}") from error


def _content(path: str | Path, shown: str) -> bytes:
    """Everything in a file or pipe; raises ``FileFormatError`` where there is no end to it, or nothing at all."""
    kind = os.stat(path).st_mode
    if not (stat.S_ISREG(kind) or stat.S_ISFIFO(kind)):
        raise FileFormatError(f"cannot read {shown}: it is {_kind(kind)}; give a file, or a pipe")
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # to open a pipe that nobody writes to would wait for ever
    try:
        content, ready = bytearray(), select.poll()
        ready.register(handle, select.POLLIN)
        while len(content) <= LARGEST:
            try:
                more = os.read(handle, CHUNK)
            except BlockingIOError:  # a pipe with a writer that has not written yet
                ready.poll()
                continue
            if not more:
                break
            content += more
    finally:
        os.close(handle)
    if len(content) > LARGEST:
        raise FileFormatError(f"cannot read {shown}: it has more than {LARGEST // 2**20} MiB; give a smaller one")
    if not content and stat.S_ISFIFO(kind):
        raise FileFormatError(f"cannot read {shown}: it is a pipe that nobody writes to; start its writer first")
    return bytes(content)


def _kind(mode: int) -> str:
    kinds = ((stat.S_ISDIR, "a folder"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"))
    return next((words for test, words in kinds if test(mode)), "no file")


def read_json(path: str | Path, what: str) -> Any:
    """JSON value of a file."""
    text = read_text(path, what)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise FileFormatError(f"{path} is not a {what} file: not JSON (line {error.lineno}: {error.msg})") from error
    except (RecursionError, ValueError) as error:  # nested beyond reason; a number of thousands of digits
        raise FileFormatError(f"{path} is not a {what} file: no JSON this program can hold") from error


def _require_plain(target: Path) -> None:
    if target.exists() and not target.is_file():
        what = "a folder" if target.is_dir() else "no plain file"
        raise FileFormatError(f"cannot write {target}: it is {what}; give a file name")


@stopping()
def write_with(path: str | Path, write: Callable[[Path], None]) -> Path:
    """Calls ``write`` with a temporary path beside ``path``, then renames it: a reader never sees half a file.

    It is on the disk when this returns: power that is lost later leaves it whole.
    """
    target = Path(path)
    _require_plain(target)
    temporary: Path | None = None
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        write(temporary)
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # mkstemp makes it private; give it the mode a plain write would have
        sync(temporary)
        temporary.replace(target)
        sync(target.parent)
    except OSError as error:
        raise FileFormatError(
            f"cannot write {target}: {error.strerror or error}; choose a folder that exists and is writable"
        ) from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
    return target


def write_text(path: str | Path, text: str) -> Path:
    """Writes text to a temporary name and renames it."""

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    return write_with(path, write)


def sync(path: Path) -> None:
    """Waits until a file's contents, or a folder's entries, are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError:
        if not path.is_dir():  # some network file systems cannot do this for a folder
            raise
    finally:
        os.close(handle)


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, numbers that are not finite as null, anything else as its text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)


@stopping()
def check_writable(path: str | Path) -> None:
    """Raises ``FileFormatError`` unless a file can be written to ``path``; to be called before long work."""
    target = Path(path)
    _require_plain(target)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        os.close(handle)
        Path(name).unlink()
    except OSError as error:
        raise FileFormatError(
            f"cannot write {target}: {error.strerror or error}; choose a folder that exists and is writable"
        ) from error
