"""Tasks from TOML files: what is wrong is one line with file, line, table, key, what was given and what is allowed."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ocp_traj.errors import FileFormatError, InputError, cut, quoted
from ocp_traj.files import LONGEST_PATH, read_text
from ocp_traj.formulation.task import FORMAT, Source, Task
from ocp_traj.formulation.task_complaints import complaint, line_of

NO_PLACE = "is no place in a task; give one such as robot.payload.mass or move.0.via"


def read_task(path: str | Path, changes: Mapping[str, Any] | None = None) -> Task:
    """Reads a task file.

    Args:
        path: of the file.
        changes: values by dotted place, such as ``robot.payload.mass`` or ``move.0.dwell``, in place of the file's;
            text is read as a TOML value, and taken as it is where it is none.

    Raises:
        FileFormatError: one line, see the module.
    """
    text, name = read_text(path, "task"), cut(str(path), LONGEST_PATH)
    try:
        data = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError, RecursionError) as error:
        raise FileFormatError(f"{name} is not a task file: not TOML ({cut(str(error), 200)})") from error
    if (kind := data.get("format")) != FORMAT:
        raise FileFormatError(f'{name} is not a task file: its format is {quoted(kind)}; write format = "{FORMAT}"')
    changed(data, changes or {})
    if "source" in data:
        raise FileFormatError(f"{name}{line_of(text, ('source',))}: source is not allowed here; leave it out")
    data.setdefault("name", Path(path).stem)
    task = task_of(data, name, text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return task.model_copy(update={"source": Source(file=Path(path).name, sha256=digest)})


def task_of(data: Any, name: str = "the task", text: str = "") -> Task:
    """A task of plain values; ``name`` and, where there is one, ``text`` of the file are for complaints."""
    try:
        return Task(**data)
    except InputError as error:
        if not isinstance(error.__cause__, ValidationError):
            raise
        raise FileFormatError(complaint(error.__cause__, Task, data, name, text)) from error
    except RecursionError as error:
        raise FileFormatError(f"{name} is nested too deep") from error


def changed(data: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Puts values at dotted places of a task's plain values; text is read as TOML, as of ``read_task``."""
    for place, value in changes.items():
        _put(data, place, value)


def _put(data: dict[str, Any], place: str, value: Any) -> None:
    """Puts a value at a dotted place."""
    *tables, key = place.split(".")
    here: Any = data
    for part in tables:
        if isinstance(here, list) and part.isdigit() and int(part) < len(here):
            here = here[int(part)]
        elif isinstance(here, dict):
            here = here.setdefault(part, {})
        else:
            raise InputError(f"{quoted(place)} {NO_PLACE}")
    if isinstance(here, list) and key.isdigit() and int(key) < len(here):
        here[int(key)] = _value(value)
    elif isinstance(here, dict):
        here[key] = _value(value)
    else:
        raise InputError(f"{quoted(place)} {NO_PLACE}")


def _value(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    try:
        return tomllib.loads(f"value = {value}")["value"]
    except (tomllib.TOMLDecodeError, ValueError, KeyError, RecursionError):
        return value
