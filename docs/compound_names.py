"""Of the API pages: keeps `lower, upper: bounds` of a docstring one entry, not a name and a type."""

import re
from typing import Any

import griffe

NAMES = re.compile(r"^( +)(\w+(?:, \w+)+): ", re.MULTILINE)


class CompoundNames(griffe.Extension):
    """Joins names that share a description by spaces that do not break, with the type of the first."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Rewrites the docstring of an object that was read."""
        if obj.docstring is None:
            return

        def joined(found: re.Match[str]) -> str:
            first = found[2].partition(",")[0]
            known = obj.parameters if isinstance(obj, griffe.Function) else obj.members
            kind = getattr(known[first], "annotation", None) if first in known else None
            return found[1] + found[2].replace(", ", ",\u00a0") + (f" ({kind}): " if kind is not None else ": ")

        obj.docstring.value = NAMES.sub(joined, obj.docstring.value)
