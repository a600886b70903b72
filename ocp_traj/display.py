"""How large values show: a few lines at a prompt, tables in a notebook."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from textwrap import shorten
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd  # the tables bring it: what is never shown in a notebook needs none

WIDTH, INDENT = 120, 14  # characters of a line, and of the name of a fact in front of it
MOST_ROWS, MOST_COLUMNS = 60, 20  # of a table; of larger ones the middle is left out


def count(number: int, what: str) -> str:
    """A number of things, in words."""
    return f"{number} {what}{'' if number == 1 else 's'}"


class Shown:
    """Base of dataclasses that show as a headline and facts; they are decorated with ``repr=False``."""

    def _headline(self) -> str:
        """What it is, in one line."""
        raise NotImplementedError

    def _facts(self) -> Mapping[str, str]:
        """What is worth knowing, by its name; what is empty is left out."""
        raise NotImplementedError

    def _tables(self) -> Sequence[pd.DataFrame]:
        """For a notebook."""
        raise NotImplementedError

    def __repr__(self) -> str:
        facts = ((name, _line(words, WIDTH - INDENT)) for name, words in self._facts().items() if words)
        lines = (f"  {name}".ljust(INDENT) + words for name, words in facts)
        return "\n".join((_line(self._headline(), WIDTH), *lines))

    def _repr_html_(self) -> str:
        tables = (table.to_html(max_rows=MOST_ROWS, max_cols=MOST_COLUMNS) for table in self._tables())
        return "\n".join((f"<p>{escape(self._headline())}</p>", *tables))


def _line(words: str, width: int) -> str:
    return shorten(words, width, placeholder=" ..", break_on_hyphens=False)
