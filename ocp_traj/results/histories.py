"""How populations converged that solved a problem part by part: one table, with the part of each row."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

PART = "part"  # column of the part that a row is of


def histories(parts: Mapping[str, pd.DataFrame | None]) -> pd.DataFrame | None:
    """The histories of parts below each other, their names in the column ``PART``; None where a part has none."""
    tables = [
        table.reset_index(names="generation").assign(**{PART: n}) for n, table in parts.items() if table is not None
    ]
    if not tables or len(tables) < len(parts):
        return None
    whole = pd.concat(tables, ignore_index=True)
    return whole[[PART, *(name for name in whole if name != PART)]]


def by_part(history: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """A history by part, of a problem that was solved in one piece by the name ``best``."""
    if PART not in history:
        return {"best": history}
    return {str(name): table for name, table in history.groupby(PART, sort=False)}
