"""Tasks from TOML files: what is wrong is one line with file, line, table, key, what was given and what is allowed."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from ocp_traj.errors import FileFormatError, InputError, cut, nearest, quoted
from ocp_traj.files import LONGEST_PATH, read_text
from ocp_traj.formulation.task import FORMAT, LATER, Source, Task, allowed_in, shown

Place = tuple[int | str, ...]
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
    for place, value in (changes or {}).items():
        _put(data, place, value)
    if "source" in data:
        raise FileFormatError(f"{name}{_line(text, ('source',))}: source is not allowed here; leave it out")
    data.setdefault("name", Path(path).stem)
    task = task_of(data, name, text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return task.model_copy(update={"source": Source(file=Path(path).name, sha256=digest)})


def task_of(data: Any, name: str = "the task", text: str = "") -> Task:
    """A task of plain values; ``name`` and, where there is one, ``text`` of the file are for complaints."""
    try:
        return Task.model_validate(data)
    except ValidationError as error:
        found = sorted(
            error.errors(), key=lambda e: e["type"] != "extra_forbidden"
        )  # a key misspelt is missing as well
        raise FileFormatError(_complaint(found[0], data, name, text)) from error
    except RecursionError as error:
        raise FileFormatError(f"{name} is nested too deep") from error


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


def _complaint(error: Any, data: Any, name: str, text: str) -> str:
    """One line of what pydantic found first."""
    place, value = _place(error["loc"], data), error["input"]
    where = f"{name}{_line(text, place)}: {_named(place)}"
    kind, table = error["type"], _model(place[:-1])
    if kind == "extra_forbidden":
        known = allowed_in(table) if table is not None else ()
        return f"{where} is not allowed{nearest(str(place[-1]), known)}; allowed are {', '.join(known)}"
    description = _description(place)
    if kind == "missing":
        return f"{where} is missing; give {description}"
    if kind == "value_error":
        words = str(error["ctx"]["error"])
        if words == LATER:
            return f"{where} {LATER}; leave it out"
        if _model(place) is not None and isinstance(value, Mapping | BaseModel):
            return f"{where} {words}"
    return f"{where} is {shown(value)}; give {description or error['msg']}"


def _place(loc: Sequence[int | str], data: Any) -> Place:
    """The place in the data; pydantic adds the branches of unions to it."""
    found: list[int | str] = []
    here = data
    for i, part in enumerate(loc):
        inside = (isinstance(here, Mapping) and part in here) or (isinstance(here, list) and isinstance(part, int))
        last = i == len(loc) - 1 and isinstance(here, Mapping) and str(part).isidentifier() and not _is_branch(part)
        if inside or last:
            found.append(part)
            here = here[part] if inside and (isinstance(here, Mapping) or int(part) < len(here)) else None
    return tuple(found)


def _is_branch(part: int | str) -> bool:
    return part in ("str", "dict") or not isinstance(part, str)


def _named(place: Place) -> str:
    """A place as a file has it: "[robot] payload.mass", "[[move]] 2: via"."""
    if not place:
        return "the task"
    top = _model(place[:1])
    if place[0] == "move" and len(place) > 1 and isinstance(place[1], int):
        rest = _dotted(place[2:])
        return f"[[move]] {place[1] + 1}{': ' + rest if rest else ''}"
    if top is None or len(place) == 1:
        return _dotted(place) if top is None else f"[{place[0]}]"
    return f"[{place[0]}] {_dotted(place[1:])}"


def _dotted(place: Place) -> str:
    return "".join(f" {p + 1}" if isinstance(p, int) else f".{cut(p)}" for p in place).lstrip(". ")


def _field(place: Place) -> Any:
    """The field of a task at a place, or None."""
    model: type[BaseModel] | None = Task
    found = None
    for part in place:
        if isinstance(part, int):
            continue
        if model is None or part not in model.model_fields:
            return None
        found = model.model_fields[part]
        model = _model_in(found.annotation)
    return found


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The table that a field's type speaks of, in a list or beside none as well."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, Union, UnionType):
        return next(filter(None, map(_model_in, get_args(annotation))), None)
    return None


def _model(place: Place) -> type[BaseModel] | None:
    """The table at a place; the task itself at none."""
    if not any(isinstance(part, str) for part in place):
        return Task
    field = _field(place)
    return None if field is None else _model_in(field.annotation)


def _description(place: Place) -> str:
    """What may stand at a place, from the innermost field that says so."""
    while place:
        if (field := _field(place)) is not None and field.description:
            return str(field.description)
        place = place[:-1]
    return ""


def _line(text: str, place: Place) -> str:
    """A colon and the line on which the innermost key of a place stands that is written down, or nothing.

    A key of an inline table has the line on which it, or at least its table, stands.
    """
    keys = [part for part in place if isinstance(part, str)]
    numbers = [part for part in place if isinstance(part, int)]
    lines, begin, end = text.splitlines(), 0, None
    found = ""
    for depth, key in enumerate(keys):
        pattern = re.compile(rf"""^\s*\[\[?\s*(?:[^\]#]*\.)?["']?{re.escape(key)}["']?\s*\]""")
        heads = [i for i, line in enumerate(lines) if pattern.match(line)]
        if heads and depth == 0:
            begin = heads[numbers[0]] if numbers and numbers[0] < len(heads) else heads[0]
            end = next((i for i in range(begin + 1, len(lines)) if re.match(r"^\s*\[", lines[i])), len(lines))
            found = f":{begin + 1}"
            continue
        inside = re.compile(rf"""(?:^|[\s{{,.])["']?{re.escape(key)}["']?\s*[=.]""")
        own = next((i for i in range(begin, len(lines) if end is None else end) if inside.search(lines[i])), None)
        if own is not None:
            begin, found = own, f":{own + 1}"
    return found
