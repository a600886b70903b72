"""How populations converged: the best value over evaluations, one line a run, as a picture or a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from ocp_traj.errors import FileFormatError, InputError, cut
from ocp_traj.files import read_text, write_with
from ocp_traj.io.plot_style import COLOURS, DASHES, LIMIT, pretty, save_figure, styled
from ocp_traj.results.histories import PART, by_part

NEEDED = ("evaluations", "best")  # columns of a history, see ``ocp_traj.evolution.evolution.Evolution``
OBJECTIVE = "objective"  # column of a file: whose best value it is, with its unit
VALUE = "feasible value"  # where nothing says of what


@styled
def plot_convergence(
    histories: Mapping[str, pd.DataFrame], path: str | Path, lower: float | None = None, quantity: str = ""
) -> Path:
    """Draws the best value of populations over their evaluations, one line a run.

    Args:
        histories: by name; see ``ocp_traj.evolution.evolution.Evolution``.
        path: of the picture.
        lower: a value that no solution is below, drawn as a line.
        quantity: whose best value it is, with its unit, for the axis; what all the histories name, if not given.
    """
    figure = Figure(figsize=(6.0, 4.0))
    axes: Axes = figure.subplots()
    for index, (name, history) in enumerate(histories.items()):
        convergence_line(axes, history["evaluations"].to_numpy(), history["best"].to_numpy(), name, index)
    if lower is not None:
        axes.axhline(lower, color=LIMIT, linewidth=1.0, linestyle="--", label="lower bound")
    axes.set_xlabel("evaluations")
    axes.set_ylabel(f"best {quantity or _objective(histories)}")
    axes.legend()
    return save_figure(figure, path)


def _objective(histories: Mapping[str, pd.DataFrame]) -> str:
    """What all histories are of, if they say so."""
    named = {str(table[OBJECTIVE].iloc[0]) if OBJECTIVE in table else "" for table in histories.values()}
    if len(named) > 1:
        raise InputError(f"the histories are of several objectives: {', '.join(sorted(named))}; draw each alone")
    return pretty(named.pop()) or VALUE


def convergence_line(axes: Axes, effort: ArrayLike, best: ArrayLike, name: str, index: int) -> None:
    """One run's best value, which holds until the next: a staircase, told apart by colour and dashes."""
    colour, dashes = COLOURS[index % len(COLOURS)], DASHES[(index // len(COLOURS)) % len(DASHES)]
    axes.step(np.asarray(effort), np.asarray(best), where="post", label=name, color=colour, linestyle=dashes)


def read_histories(paths: Sequence[Path]) -> dict[str, pd.DataFrame]:
    """Histories that ``ocp-traj solve --history FILE.csv`` wrote, by the file's name, and part where it has several.

    Raises:
        FileFormatError: where one is no such table.
    """
    found: dict[str, pd.DataFrame] = {}
    for path in paths:
        names = [other.stem for other in paths]
        name = path.stem if names.count(path.stem) == 1 else str(path)
        parts = by_part(_read(path))
        for part, table in parts.items():
            found[name if len(parts) == 1 and PART not in table else f"{name}, {part}"] = table
    return found


def _read(path: Path) -> pd.DataFrame:
    lines = [line.split(",") for line in read_text(path, "history").splitlines()]
    columns = lines[0] if lines else []
    if not set(NEEDED) <= set(columns) or len(lines) < 2 or any(len(line) != len(columns) for line in lines):
        raise FileFormatError(
            f"{cut(str(path))} is no history: it has no table with columns {', '.join(NEEDED)}; give what "
            "`ocp-traj solve --method pso --history FILE.csv` wrote"
        )
    table = pd.DataFrame(lines[1:], columns=columns)
    for name in NEEDED:
        try:
            table[name] = [float(cell) if cell else np.nan for cell in table[name]]
        except ValueError as error:
            raise FileFormatError(f"{cut(str(path))} is no history: {cut(str(error))} in column {name}") from error
    return table


def save_history(history: pd.DataFrame, path: str | Path, quantity: str = "") -> Path:
    """How a population converged, as a CSV table or a picture, by the suffix.

    Args:
        history: of one run, or of the parts of one.
        path: of the table or the picture.
        quantity: as ``objective [unit]``.
    """
    if quantity:
        history = history.assign(**{OBJECTIVE: quantity})
    if Path(path).suffix.lower() == ".csv":
        return write_with(path, lambda temporary: history.to_csv(temporary, index=PART not in history))
    return plot_convergence(by_part(history), path)
