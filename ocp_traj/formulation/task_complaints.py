"""What is wrong with a task in one line: file, line, table, key, what was given and what is allowed."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from ocp_traj.errors import cut, nearest, quoted

# Keys that the program writes into trajectories, and nobody into a file.
RESOLVED = ("source", "numbers", "geometry", "bodies", "pairs", "own_pairs", "touching")
HEADER = re.compile(r"""^\s*\[\[?\s*["']?[A-Za-z_][\w."' -]*\]""")  # of a table; no row of numbers
SPOKEN = re.compile(r"\[(\[?)(\w+)\]\]?(?: (\d+))?:? ?([a-z_.]*)")  # a place as a complaint names it

Place = tuple[int | str, ...]


class PartOf(ValueError):
    """What is wrong with an entry of a list, which is then told in place of the whole list."""


def allowed_in(cls: type[BaseModel]) -> tuple[str, ...]:
    """Names that a table of a file may have, those of later versions left out."""
    names = ((field.alias or name, field) for name, field in cls.model_fields.items())
    return tuple(name for name, field in names if field.description and name not in RESOLVED)


def complaint(
    failure: ValidationError, root: type[BaseModel], data: Any, name: str = "the task", text: str = ""
) -> str:
    """One line of what pydantic found first.

    Args:
        failure: of the validation.
        root: table of tables that was to be made.
        data: what was given.
        name: of the file, or of what stands for one.
        text: of the file, where there is one.
    """
    # A key that is misspelt is missing as well.
    error: Any = min(failure.errors(), key=lambda e: e["type"] != "extra_forbidden")
    place, value = _place(error["loc"], data), error["input"]
    where = f"{name}{line_of(text, place)}: {_named(root, place)}"
    kind, table = error["type"], _model(root, place[:-1])
    if kind == "extra_forbidden":
        known = allowed_in(table) if table is not None else ()
        return f"{where} is not allowed{nearest(str(place[-1]), known)}; allowed are {', '.join(known)}"
    description = _description(root, place)
    if kind == "missing":
        return f"{where} is missing; give {description}"
    if kind == "value_error":
        words = str(error["ctx"]["error"])
        if isinstance(error["ctx"]["error"], PartOf):
            return f"{where}: {words}; give {description}"
        if _model(root, place) is not None and isinstance(value, Mapping | BaseModel):
            return f"{where} {words}"
    return f"{where} is {_shown(value)}; give {description or error['msg']}"


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


def _named(root: type[BaseModel], place: Place) -> str:
    """A place as a file has it: "[robot] payload.mass", "[[move]] 2: via"."""
    if not place:
        return "the task"
    top = _model(root, place[:1])
    if place[0] == "move" and len(place) > 1 and isinstance(place[1], int):
        rest = _dotted(place[2:])
        return f"[[move]] {place[1] + 1}{': ' + rest if rest else ''}"
    if top is None or len(place) == 1:
        return _dotted(place) if top is None else f"[{place[0]}]"
    return f"[{place[0]}] {_dotted(place[1:])}"


def _dotted(place: Place) -> str:
    return "".join(f" {p + 1}" if isinstance(p, int) else f".{cut(p)}" for p in place).lstrip(". ")


def _field(root: type[BaseModel], place: Place) -> Any:
    """The field of a task at a place, or None."""
    model: type[BaseModel] | None = root
    found = None
    for part in place:
        if isinstance(part, int):
            continue
        known = {} if model is None else {field.alias or name: field for name, field in model.model_fields.items()}
        if part not in known:
            return None
        found = known[part]
        model = _model_in(found.annotation)
    return found


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The table that a field's type speaks of, in a list or beside none as well."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, Union, UnionType):
        return next(filter(None, map(_model_in, get_args(annotation))), None)
    return None


def _model(root: type[BaseModel], place: Place) -> type[BaseModel] | None:
    """The table at a place; the task itself at none."""
    if not any(isinstance(part, str) for part in place):
        return root
    field = _field(root, place)
    return None if field is None else _model_in(field.annotation)


def _description(root: type[BaseModel], place: Place) -> str:
    """What may stand at a place, from the innermost field that says so."""
    while place:
        if (field := _field(root, place)) is not None and field.description:
            return str(field.description)
        place = place[:-1]
    return ""


def located(words: str, task: str, file: str, text: str) -> str:
    """A complaint of a task, which names it and a place in it, as one of its file with the line of that place.

    Args:
        words: such as "my-arm: [limits] jerk has 2 numbers".
        task: its name.
        file: in place of that.
        text: of the file.
    """
    if words.startswith(file):
        return words
    said = words.removeprefix(f"{task}: ")
    if (place := SPOKEN.search(said)) is None:
        return f"{file}: {said}"
    several, table, number, key = place.groups()
    keys: Place = (table, *((int(number or 1) - 1,) if several else ()), *filter(None, key.split(".")))
    return f"{file}{line_of(text, keys)}: {said}"


def line_of(text: str, place: Place) -> str:
    """A colon and the line on which the innermost key of a place stands that is written down, or nothing.

    A key of an inline table has the line on which it, or at least its table, stands.
    """
    keys = [(i, part) for i, part in enumerate(place) if isinstance(part, str)]
    lines, begin, end = text.splitlines(), 0, None
    found = dotted = ""
    for i, key in keys:
        number = next((part for part in place[i + 1 : i + 2] if isinstance(part, int)), 0)
        joint = r"\s*\.\s*" if dotted else ""
        dotted += rf"""{joint}["']?{re.escape(key)}["']?"""
        pattern = re.compile(rf"^\s*\[\[?\s*{dotted}\s*\]")
        heads = [i for i, line in enumerate(lines) if pattern.match(line)]
        if heads:
            begin = heads[number] if number < len(heads) else heads[0]
            end = next((i for i in range(begin + 1, len(lines)) if HEADER.match(lines[i])), len(lines))
            found = f":{begin + 1}"
            continue
        inside = re.compile(rf"""(?:^|[\s{{,.])["']?{re.escape(key)}["']?\s*[=.]""")
        own = next((i for i in range(begin, len(lines) if end is None else end) if inside.search(lines[i])), None)
        if own is not None:
            begin, found = own, f":{own + 1}"
    return found


def _shown(value: Any) -> str:
    """A given value as a complaint quotes it."""
    return quoted(dict(value) if isinstance(value, Mapping) else value)
