"""Of the API pages: keeps `lower, upper: bounds` of a docstring one entry, not a name and a type."""

import re
from typing import Any

import griffe

NAMES = re.compile(r"^( +)(\w+(?:, \w+)+): ", re.MULTILINE)


class CompoundNames(griffe.Extension):
    """Joins names that share a description by spaces that do not break, with their types."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Rewrites the docstring of an object that was read."""
        if obj.docstring is None:
            return

        def joined(found: re.Match[str]) -> str:
            names = found[2].split(", ")
            known = obj.parameters if isinstance(obj, griffe.Function) else obj.members
            kinds = [str(known[name].annotation) if name in known else "None" for name in names]
            said = ", ".join(dict.fromkeys(kind for kind in kinds if kind != "None"))
            return found[1] + ",\u00a0".join(names) + (f" ({said}): " if said else ": ")

        obj.docstring.value = NAMES.sub(joined, obj.docstring.value)
