"""Fields of a problem's case: each says what it may be, and is read from text and checked by that.

A case is a frozen dataclass of numbers. ``number(10.0, "kg", least=0.0)`` declares a field with its default and what is
allowed; ``convert`` turns what a user or a file gives into the field's type, ``check`` looks at a whole case.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields
from math import isfinite
from typing import Any

from ocp_traj.errors import InputError, UnknownName, nearest, quoted


def number(
    default: float | int | None, unit: str = "", what: str = "a finite number", *, least: float | None = None,
    above: float | None = None, most: float | None = None, below: float | None = None, under: str = "",
    whole: bool = False,
) -> Any:  # fmt: skip
    """A number; whole ones stay whole where the default is one.

    Args:
        default: its value where none is given; with None there need not be one, which is written "none".
        unit: for messages.
        what: it is, in words.
        least: it is at least this.
        above: it is larger than this.
        most: it is at most this.
        below: it is smaller than this.
        under: the field that it is smaller than.
        whole: it is a whole number, where the default does not say so.
    """
    bounds = {"least": least, "above": above, "most": most, "below": below, "under": under, "whole": whole}
    return field(default=default, metadata={"kind": "number", "unit": unit, "what": what, **bounds})


def count(default: int | None, least: int = 1) -> Any:
    """A whole number of things."""
    return number(default, what="a whole number", least=least, whole=True)


def share(default: float | None) -> Any:
    """A probability, or a part of a whole."""
    return number(default, least=0.0, most=1.0)


def numbers(
    default: Sequence[float] = (), unit: str = "", *, size: int | None = None, empty: bool = False, some: bool = False,
    least: float | None = None, above: float | None = None, ranges: Mapping[str, tuple[float, float]] | None = None,
) -> Any:  # fmt: skip
    """A tuple of numbers, as many as the default unless ``size`` says otherwise.

    Args:
        default: its value where none is given.
        unit: for messages.
        size: how many.
        empty: whether there may be none, which is written "none".
        some: whether not all may be zero.
        least: each is at least this.
        above: each is larger than this.
        ranges: ends between which each lies, by its name.
    """
    count = len(default) if size is None else size
    more = {"size": count, "empty": empty, "some": some, "least": least, "above": above, "ranges": ranges or {}}
    return field(default=tuple(default), metadata={"kind": "numbers", "unit": unit, **more})


def choice(default: str, among: Sequence[str]) -> Any:
    """One of some words."""
    return field(default=default, metadata={"kind": "choice", "among": tuple(among)})


def convert(
    owner: str, cls: Any, changes: dict[str, Any], word: str = "case field", among: Sequence[str] | None = None
) -> dict[str, Any]:
    """What a user gives for a case's fields as values of their types, or an error that says what is wanted.

    Args:
        owner: whose case, for messages.
        cls: the case's dataclass.
        changes: by field; text is read, lists become tuples.
        word: what a field is called, in messages.
        among: the fields that may be given, if not all.
    """
    known = {f.name: f for f in fields(cls) if among is None or f.name in among}
    for name in changes:
        if name not in known:
            words = f"{word.split()[-1]}s are {', '.join(known)}"
            raise UnknownName(f"{owner} has no {word} {quoted(name)}{nearest(name, known)}; {words}")

    def converted(name: str, value: Any) -> Any:
        return _converted(f"{owner}: {name} is {quoted(value)}; give", known[name], value)

    return {name: converted(name, value) for name, value in changes.items()}


@dataclass(frozen=True)
class Checked:
    """Base of a case whose fields are checked when it is made."""

    def __post_init__(self) -> None:
        """Checks the fields."""
        check(self)


def check(case: Any) -> None:
    """Raises ``InputError`` where a field of a case is not what it may be."""
    for f in fields(case):
        value, kind = getattr(case, f.name), f.metadata.get("kind")
        if kind == "choice" and value not in f.metadata["among"]:
            raise InputError(f"{f.name} is {quoted(value)}; allowed are {', '.join(f.metadata['among'])}")
        may_be_none = value is None and f.default is None
        if kind == "number" and not may_be_none and not _within(value, f.metadata):
            unit = f" {f.metadata['unit']}" if f.metadata["unit"] else ""
            raise InputError(f"{f.name} is {value}{unit}; give {f.metadata['what']}{_bounds(f.metadata)}")
        if kind == "numbers":
            _check_numbers(f, value)
    for f in fields(case):
        if (upper := f.metadata.get("under")) and not getattr(case, f.name) < getattr(case, upper):
            given = (f"{name} {getattr(case, name)} {f.metadata['unit']}".strip() for name in (f.name, upper))
            raise InputError(f"{' and '.join(given)} leave nothing between; give {f.name} < {upper}")


def _check_numbers(f: Field[Any], value: Any) -> None:
    allowed = f.metadata
    if not value and allowed["empty"]:
        return
    unit = f" {allowed['unit']}" if allowed["unit"] else ""
    sound = len(value) == allowed["size"] and all(_within(v, allowed) for v in value)
    for (name, (low, high)), v in zip(allowed["ranges"].items(), value if sound else (), strict=False):
        if not low < v < high:
            raise InputError(f"{f.name} has {name} at {v}{unit}; its range is {low:g} to {high:g}{unit}")
    if sound and (any(value) or not allowed["some"]):
        return
    zero = " and not all zero" if allowed["some"] else ""
    none = ", or none" if allowed["empty"] else ""
    wanted = f"{allowed['size']} finite numbers{_bounds(allowed)}{zero}{none}"
    raise InputError(f"{f.name} is {quoted(value)}{unit}; give {wanted}")


def _within(value: float, allowed: Any) -> bool:
    least, above, most, below = (allowed.get(name) for name in ("least", "above", "most", "below"))
    return (
        isfinite(value)
        and (value == int(value) or not allowed.get("whole"))
        and (least is None or value >= least)
        and (above is None or value > above)
        and (most is None or value <= most)
        and (below is None or value < below)
    )


def _bounds(allowed: Any) -> str:
    """What bounds mean in words, such as ", zero or more" and " from 2 to 40"."""
    least, above, most, below = (allowed.get(name) for name in ("least", "above", "most", "below"))
    end = f"{most:g}" if most is not None else f"below {below:g}" if below is not None else ""
    if least is not None:
        return f" from {least:g} to {end}" if end else ", zero or more" if least == 0 else f", {least:g} or more"
    if above is not None:
        at_most = "at most " if most is not None else ""
        return f" above {above:g} and {at_most}{end}" if end else f" above {above:g}".replace(" 0", " zero")
    return f" up to {end}" if end else ""


def _converted(wanted: str, f: Field[Any], value: Any) -> Any:
    default = f.default if f.default is not MISSING else None
    if default is None and f.metadata.get("kind") == "number":
        if value is None or value == "none":
            return None
        return _number(f"{wanted} a number, or none", int if f.metadata["whole"] else float, value)
    if default is None and f.type in ("str | None", str | None):
        return None if value is None else str(value)
    if default is None:
        return None if value is None else _floats(value, f"{wanted} numbers, such as 1,0,0.5")
    if isinstance(default, tuple) and default and isinstance(default[0], tuple):
        return _rows(value, len(default[0]), wanted, default)
    if isinstance(default, bool):
        if isinstance(value, bool):
            return value
        if str(value).lower() in ("true", "false"):
            return str(value).lower() == "true"
        raise InputError(f"{wanted} true or false")
    if isinstance(default, tuple):
        return _tuple(wanted, f, value, default)
    if isinstance(default, float | int):
        return _number(f"{wanted} a number, such as {default}", type(default), value)
    return str(value)


def _number(wanted: str, kind: type[float | int], value: Any) -> float | int:
    try:
        return kind(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(wanted) from error


def _tuple(wanted: str, f: Field[Any], value: Any, default: tuple[Any, ...]) -> tuple[float, ...]:
    size, empty = f.metadata.get("size", len(default)), f.metadata.get("empty", False)
    such = f", such as {','.join(map(str, default))}" if default else ""
    wanted = f"{wanted} {size} numbers{such}{', or none' if empty else ''}"
    if empty and (value is None or value == "none"):
        return ()
    found = _floats(value, wanted)
    if len(found) != size and not (empty and not found):
        raise InputError(wanted)
    return found


def _floats(value: Any, wanted: str, between: str = ",") -> tuple[float, ...]:
    try:
        return tuple(float(item) for item in (value.split(between) if isinstance(value, str) else value))
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(wanted) from error


def _rows(value: Any, width: int, wanted: str, default: Any) -> tuple[tuple[float, ...], ...]:
    """Any number of rows of ``width`` numbers: ``a:b:c; d:e:f`` or a list of lists; ``none`` for none."""
    example = ";".join(":".join(f"{number:g}" for number in row) for row in default)
    wanted += f" rows of {width} numbers, such as {example}, more of them after a semicolon, or none"
    if isinstance(value, str):
        value = [] if value.strip().lower() == "none" else value.split(";")
    try:
        rows = tuple(_floats(row, wanted, ":") for row in value)
    except TypeError as error:
        raise InputError(wanted) from error
    if any(len(row) != width for row in rows):
        raise InputError(wanted)
    return rows
