"""A front's table as a file, ``front.csv``: every number as it was written."""

from __future__ import annotations

from collections.abc import Iterable
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj.errors import FileFormatError
from ocp_traj.files import read_text
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, VIOLATED


def read_front_csv(path: Path) -> pd.DataFrame:
    """A ``front.csv``, every number as it was written, indexed by ``point``."""
    text = read_text(path, "front")
    try:
        table = pd.read_csv(StringIO(text), dtype=str, keep_default_na=False)
    except ValueError as error:  # of pandas' parser
        raise FileFormatError(f"{path} is not a front: {' '.join(str(error).split())}") from error
    if list(table.columns[:1]) != ["point"] or not {"margin", "verdict"} <= set(table.columns):
        raise FileFormatError(f"{path} is not a front: it has no columns point, margin and verdict")
    if table["point"].tolist() != [str(index) for index in range(len(table))]:
        raise FileFormatError(f"{path} is not a front: its points are not numbered 0, 1, 2, ..; a row is missing")
    unknown = set(table["verdict"]) - {PROVED, UNDECIDED, VIOLATED}
    if unknown:
        raise FileFormatError(f"{path} is not a front: it has the verdicts {sorted(unknown)}")
    numbers = {str(name): table[name] for name in table.columns.drop(["point", "verdict"])}
    read = pd.DataFrame({name: _numbers(path, name, column) for name, column in numbers.items()})
    read.insert(list(table.columns).index("verdict") - 1, "verdict", table["verdict"].astype(object))
    return read.rename_axis("point")


def _numbers(path: Path, name: str, texts: Iterable[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A column's numbers to the last bit, which not every version of pandas reads."""
    try:
        numbers = np.array([float(text) for text in texts], dtype=float)
    except ValueError as error:
        raise FileFormatError(f"{path} is not a front: {name} holds what is no number: {error}") from error
    if np.isnan(numbers).any() or (name != "margin" and np.isinf(numbers).any()):  # no path limit: margin inf
        raise FileFormatError(f"{path} is not a front: {name} holds what is no finite number")
    return numbers
