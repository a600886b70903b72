"""Tasks from TOML files: what is wrong is one line with file, line, table, key, what was given and what is allowed."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ocp_traj.errors import FileFormatError, InputError, cut, quoted
from ocp_traj.files import LONGEST_PATH, read_text
from ocp_traj.formulation.task import FORMAT, Source, Task
from ocp_traj.formulation.task_complaints import complaint, line_of, located

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
        raise FileFormatError(_not_toml(cut(str(error), 200), name)) from error
    if (kind := data.get("format")) != FORMAT:
        raise FileFormatError(f'{name} is not a task file: its format is {quoted(kind)}; write format = "{FORMAT}"')
    put_all(data, changes or {})
    if "source" in data:
        raise FileFormatError(f"{name}{line_of(text, ('source',))}: source is not allowed here; leave it out")
    data.setdefault("name", Path(path).stem)
    task = task_of(data, name, text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return task.model_copy(update={"source": Source(file=Path(path).name, sha256=digest)})


def _not_toml(words: str, name: str) -> str:
    """What the reader says, with its line where every complaint has it, and tables as they are written."""
    words = re.sub(r"\('(\w+)',\)", r"[\1]", words)
    if (at := re.fullmatch(r"(.*) \(at line (\d+), column (\d+)\)", words)) is None:
        return f"{name} is not a task file: not TOML ({words})"
    return f"{name}:{at[2]}: this is not TOML: {at[1][0].lower()}{at[1][1:]} (column {at[3]})"


def told(error: InputError, task: str, path: str | Path) -> InputError:
    """What is wrong with the task of a file, with the file and the line.

    Args:
        error: of its resolution, or of its problem.
        task: its name.
        path: of the file.
    """
    return type(error)(located(str(error), task, cut(str(path), LONGEST_PATH), read_text(path, "task")))


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


def put_all(data: dict[str, Any], changes: Mapping[str, Any]) -> None:
    """Puts values at dotted places of a task's plain values; text is read as TOML, as of ``read_task``."""
    for place, value in changes.items():
        _put(data, place, value)


def changed(task: Task, changes: Mapping[str, Any]) -> Task:
    """A task with values by dotted place in place of its own; see ``read_task``."""
    data = task.fields()
    for place, value in changes.items():
        _put(data, place, value)
    return task_of(data) if changes else task


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
