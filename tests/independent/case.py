"""A case as its file gives it: fields that differ from the defaults, as JSON holds them or as the command line does."""

from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

Case = dict[str, Any]
Excesses = dict[str, float]  # per limit, what it is exceeded by as a fraction of its bound; <= 0 where it is met
Blocks = dict[str, tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]]  # of variables: values, lower and upper bounds

POINT = 1e-9  # of rest, via points and the like, in their own units: the tolerance to which they are checked
AGREEMENT = 1e-9  # of 1 + a parameter's size, to which a file has to agree with its case


def complete(data: Mapping[str, Any], defaults: Mapping[str, Any]) -> Case:
    """All fields of a case: the file's in place of the defaults."""
    return {**defaults, **{name: like(value, defaults[name]) for name, value in dict(data.get("case", {})).items()}}


def like(value: Any, default: Any) -> Any:
    """A value read as one of the default's type; no numbers at all may be written ``none``."""
    if isinstance(default, bool):
        return value if isinstance(value, bool) else str(value).lower() == "true"
    if isinstance(default, tuple) or default is None:
        if value is None or (isinstance(value, str) and value.strip().lower() == "none"):
            return None if default is None else ()
        rows = bool(default) and isinstance(default[0], tuple)
        parts = value.split(";" if rows else ",") if isinstance(value, str) else value
        return tuple(_row(part) for part in parts) if rows else tuple(float(part) for part in parts)
    return type(default)(value)


def _row(value: Any) -> tuple[float, ...]:
    return tuple(float(part) for part in (value.split(":") if isinstance(value, str) else value))


def parameter(data: Mapping[str, Any], name: str, otherwise: float) -> float:
    """A parameter that the file states, else what the case says."""
    return float(data.get("parameters", {}).get(name, otherwise))
