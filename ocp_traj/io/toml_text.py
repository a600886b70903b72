"""Plain values as TOML: what the standard library reads and does not write."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_value(value: Any) -> str:
    """A number, text, truth value, list or table on one line; numbers come back bit by bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        text = repr(value)  # of inf and nan as TOML has them
        return text if not text.replace("e", "").lstrip("-").isdigit() or "e" in text else f"{text}.0"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml_key(k)} = {toml_value(v)}" for k, v in value.items()) + " }"
    return "[" + ", ".join(toml_value(v) for v in value) + "]"


def toml_key(key: str) -> str:
    """A key, in quotes where it needs them."""
    return key if BARE.fullmatch(key) else toml_value(key)


def toml_lines(table: Mapping[str, Any], place: str) -> list[str]:
    """The lines of a table under its own header; a list of tables in it has a header for each."""
    own = {k: v for k, v in table.items() if not _tables(v)}
    lines = [f"[{place}]", *(f"{toml_key(k)} = {toml_value(v)}" for k, v in own.items())]
    for key, value in table.items():
        if _tables(value):
            for item in value:
                lines += [
                    "",
                    f"[[{place}.{toml_key(key)}]]",
                    *(f"{toml_key(k)} = {toml_value(v)}" for k, v in item.items()),
                ]
    return lines


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)
