"""Tables of a reproduction as text: every number with the digits that its comparison needs, as Markdown too."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd

DIGITS = 6  # significant, at least: the paper that prints most prints so many of most numbers


def readable(table: pd.DataFrame) -> pd.DataFrame:
    """A table with its cells as text: ours with as many digits as what it is held against, or ``DIGITS``."""
    rows = []
    for row in table.to_dict("records"):
        held = [row[name] for name in ("paper", "expected") if row.get(name) is not None]
        digits = max([DIGITS, *(significant(str(value)) for value in held)]) if "ours" in row else DIGITS
        rows.append([cell(value, digits if name == "ours" else DIGITS) for name, value in row.items()])
    return pd.DataFrame(rows, columns=[str(name) for name in table.columns], dtype=object)


def significant(text: str) -> int:
    """How many significant digits a number has as it is written; trailing zeros of a whole number count."""
    try:
        return len(Decimal(text).as_tuple().digits)
    except ArithmeticError:  # no number
        return 0


def cell(value: Any, digits: int = DIGITS) -> str:
    """A value as a cell of a table shows it."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return ""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return f"{value:.{digits}g}"
    return str(value)


def markdown(table: pd.DataFrame) -> str:
    """A table of text as Markdown, with its columns aligned."""
    names = [_escaped(str(name)) for name in table.columns]
    rows = [[_escaped(value) for value in row] for row in table.to_numpy(dtype=object).tolist()]
    widths = [max(3, len(name), *(len(row[i]) for row in rows)) for i, name in enumerate(names)]
    return "\n".join(
        [_line(names, widths), _line(["-" * w for w in widths], widths), *(_line(r, widths) for r in rows)]
    )


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    return f"| {' | '.join(text.ljust(width) for text, width in zip(cells, widths, strict=True))} |"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
