"""The folder of a run while it is written: one process at a time, and an earlier run is kept until there is a better.

The process holds a lock on ``.ocp-traj.lock``, which ends with it, however it ends. A run that is to be replaced is
first moved into ``ocp-traj.earlier/`` and stays there, a run folder like any other, until the new one has a proved
point. Where the new one ends without, it is moved back. What a killed process leaves of this is put in order when the
folder is next written to.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.files import sync
from ocp_traj.io.journal import records
from ocp_traj.results.records import is_proved

MANIFEST, JOURNAL, TABLE, PICTURE, TRAJECTORIES = "run.json", "journal.jsonl", "front.csv", "front.png", "trajectories"
BOUNDS = "bounds.csv"  # of a certified front
PARTS = (
    MANIFEST,
    JOURNAL,
    TABLE,
    PICTURE,
    TRAJECTORIES,
    BOUNDS,
)  # what a run is made of; nothing else is moved or deleted
EARLIER = "ocp-traj.earlier"  # nobody else calls anything so
# On the way into it or out of it, and on the way out for good: a rename begins and ends each.
_MOVING, _GONE = f".{EARLIER}.moving", f".{EARLIER}.gone"
_LOCK = ".ocp-traj.lock"


def check_target(folder: str | Path, force: bool = False) -> Path:
    """Raises ``InputError`` unless a run can be written to ``folder``; to be called before long work.

    An existing run folder needs ``force``; a folder that holds files but no ``run.json`` is never replaced.
    """
    try:
        target = Path(os.path.realpath(folder))  # resolve() raises on loops of links
        if target.exists():
            _check_replaceable(Path(folder), target, force)
        above = next(parent for parent in target.parents if os.path.lexists(parent))  # a link may lead nowhere
        os.rmdir(tempfile.mkdtemp(prefix=f".{target.name}.", dir=above))  # the only sure way to know that one can
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise _cannot_create(folder, error) from error
    return target


def _cannot_create(folder: str | Path, error: Exception) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(f"cannot create {folder}: {reason}; choose a place that is writable")


def _check_replaceable(given: Path, target: Path, force: bool) -> None:
    if not target.is_dir():
        raise InputError(f"{given} exists and is not a folder; choose another folder")
    if not force:
        raise InputError(f"{given} exists; choose another folder or pass --force")
    if target in (Path.cwd(), *Path.cwd().parents):
        raise InputError(f"{given} is the current folder or one above it; choose another folder")
    if not _is_run(target) and any(map(_is_foreign, target.iterdir())):
        raise InputError(
            f"{given} is not a run folder: it holds files but no run.json, so --force does not delete it; "
            "choose another folder"
        )


def _is_run(root: Path) -> bool:
    return any((place / MANIFEST).is_file() for place in (root, root / EARLIER, root / _MOVING))


def _is_foreign(path: Path) -> bool:
    """Whether a killed process of ours, that had not come to writing ``run.json``, cannot have left it."""
    begun = path.name == JOURNAL and not path.stat().st_size
    return not (begun or path.name in (_LOCK, _MOVING) or _is_temporary(path))


def _is_temporary(path: Path) -> bool:
    return any(path.name.startswith(f".{part}.") for part in PARTS) or path.name == _GONE


class RunFolder:
    """A folder that is this process's to write a run to, until it is closed or discarded."""

    def __init__(self, folder: str | Path, force: bool = False, resume: bool = False) -> None:
        """Takes the folder; raises ``InputError`` where another process writes to it, or ``check_target`` does.

        With ``resume`` the run that is there stays, to be gone on with.
        """
        self._lock, checked = -1, False
        self._made: list[Path] = []
        try:
            self.root = Path(os.path.realpath(folder))  # resolve() raises on loops of links
            if resume:
                self._take_run(folder)
                return
            if (self.root / _LOCK).exists():
                self._take(folder)
            check_target(folder, force)
            self._made = [path for path in (self.root, *self.root.parents) if not path.exists()]
            self.root.mkdir(parents=True, exist_ok=True)
            if self._lock < 0:
                self._take(folder)
            if any(path.name != _LOCK for path in self.root.iterdir()):
                _check_replaceable(Path(folder), self.root, force)  # once more, now that nobody else can change it
            checked = True
            self._put_in_order()
            if (self.root / MANIFEST).exists():
                self._set_aside()
        except BaseException as error:
            if checked:
                self._put_in_order()
            self.close()
            self._remove_made()
            if isinstance(error, InputError) or not isinstance(error, OSError | ValueError):
                raise
            raise _cannot_create(folder, error) from error

    def forget_earlier(self) -> None:
        """Deletes the run that was replaced: the new one has something to show."""
        if (self.root / EARLIER / MANIFEST).exists():
            (self.root / EARLIER).rename(self.root / _GONE)
            shutil.rmtree(self.root / _GONE, ignore_errors=True)

    def discard(self) -> None:
        """Deletes the new run, brings back the one that it was to replace, and lets go of the folder."""
        if self._lock < 0:  # it was let go before
            return
        try:
            if (self.root / EARLIER / MANIFEST).exists():
                self._bring_back()
            else:
                self._delete()
        finally:
            self.close()
            self._remove_made()

    def forget_shown(self) -> None:
        """Deletes what was made of the journal for others: it is made again when the run ends."""
        _remove(self.root / name for name in (TABLE, PICTURE, TRAJECTORIES) if (self.root / name).exists())

    def close(self) -> None:
        """Lets go of the folder."""
        if self._lock >= 0:
            (self.root / _LOCK).unlink(missing_ok=True)
            os.close(self._lock)
            self._lock = -1

    def _take_run(self, folder: str | Path) -> None:
        """Takes a folder for the run that is in it."""
        if not _is_run(self.root):
            raise InputError(f"{folder} is no run folder: it has no {MANIFEST}; give the folder of a run")
        self._take(folder)
        _remove(filter(_is_temporary, self.root.iterdir()))
        if (self.root / _MOVING).exists():
            self._move_back()

    def _take(self, folder: str | Path) -> None:
        path = self.root / _LOCK
        while True:
            lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if path.exists() and os.path.samestat(os.fstat(lock), path.stat()):
                    self._lock = lock
                    return
                os.close(lock)  # its owner ended just now, and deleted it
            except BlockingIOError as error:
                os.close(lock)
                raise InputError(
                    f"{folder} is being written by another process; wait for its end, or choose another folder"
                ) from error

    def _put_in_order(self) -> None:
        """Ends what a process that was killed had begun."""
        _remove(filter(_is_temporary, self.root.iterdir()))
        if (self.root / _MOVING).exists():
            self._move_back()
        if (self.root / EARLIER / MANIFEST).exists():
            self.forget_earlier() if _has_proved(self.root / JOURNAL) else self._bring_back()

    def _set_aside(self) -> None:
        moving = self.root / _MOVING
        moving.mkdir()
        for path in self._parts():
            path.rename(moving / path.name)
        sync(moving)
        moving.rename(self.root / EARLIER)
        sync(self.root)

    def _bring_back(self) -> None:
        self._delete()
        (self.root / EARLIER).rename(self.root / _MOVING)
        self._move_back()

    def _move_back(self) -> None:
        moving = self.root / _MOVING
        for path in moving.iterdir():
            path.rename(self.root / path.name)
        sync(self.root)
        moving.rmdir()

    def _delete(self) -> None:
        _remove([*self._parts(), *filter(_is_temporary, self.root.iterdir())])

    def _remove_made(self) -> None:
        for path in self._made:
            with suppress(OSError):  # somebody has put something there, or deleted it
                path.rmdir()

    def _parts(self) -> list[Path]:
        return [self.root / name for name in PARTS if (self.root / name).exists()]


def _remove(paths: Iterable[Path]) -> None:
    for path in list(paths):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def _has_proved(journal: Path) -> bool:
    try:
        return journal.exists() and any(map(is_proved, records(journal)))
    except FileFormatError:
        return False
