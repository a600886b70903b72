"""What the command line prints on: tables for people, the same as one JSON object for programs, messages, progress."""

from __future__ import annotations

import json as json_module
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ocp_traj import progress as progress_module
from ocp_traj.errors import cut
from ocp_traj.files import plain
from ocp_traj.stopping import exit_code

WIDE = 160  # columns of a table that does not go to a terminal
LONGEST_WORD = 24  # [characters] that a column keeps whole, however narrow the terminal: our choice
LONGEST_MESSAGE = 2000  # [characters]: our choice

Rows = tuple[str, Sequence[str], Sequence[Sequence[Any]]]  # title, column names, rows


@dataclass(frozen=True)
class Sheet:
    """What a command found: as plain values, and as tables."""

    data: Mapping[str, Any]
    tables: Sequence[Rows]


def show(sheet: Sheet, json: bool) -> None:
    """Prints a sheet on stdout."""
    if json:
        print(json_module.dumps(plain(dict(sheet.data))))
        return
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table
    from rich.text import Text

    console = Console(width=None if sys.stdout.isatty() else WIDE)
    for title, columns, rows in sheet.tables:
        table = Table(title=Text(title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
        cells = [[text(value) for value in row] for row in rows]
        for index, name in enumerate(columns):
            words = [word for cell in (name, *(row[index] for row in cells)) for word in cell.split()]
            longest = min(max(map(len, words), default=0), LONGEST_WORD)
            table.add_column(Text(name), overflow="fold", min_width=longest)  # as Text: brackets are units, not markup
        for row in cells:
            table.add_row(*map(Text, row))
        needed = Measurement.get(console, console.options.update(max_width=WIDE), table).minimum
        if needed > console.width:  # else words would be cut where the terminal is narrow
            Console(width=needed).print(table)
        else:
            console.print(table)


def say(words: str) -> None:
    """Prints a message on stderr, its middle left out where it is very long; one that cannot be written is lost."""
    with suppress(OSError):  # nobody is there to be told
        print(cut(words, LONGEST_MESSAGE), file=sys.stderr, flush=True)


def interrupted(words: str) -> int:
    """Says what was left undone, if anything was; the exit code of that."""
    say(f"interrupted {words or 'when all was done'}")
    return exit_code()


@contextmanager
def progress(title: str) -> Iterator[progress_module.Progress]:
    """A progress bar on stderr while the block runs, with the time that is likely left; nothing off a terminal."""
    if not sys.stderr.isatty():
        yield progress_module.silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    done = TextColumn("{task.completed}/{task.total}")
    words_column = TextColumn("{task.fields[words]}")
    left = TimeRemainingColumn(), TextColumn("left")
    columns = (TextColumn("{task.description}"), BarColumn(), done, TimeElapsedColumn(), *left, words_column)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=None, words="")
        yield lambda done, total, words: bar.update(task, completed=done, total=total or None, words=words)


def text(value: Any) -> str:
    """A value as a cell of a table shows it."""
    if isinstance(value, bool) or value is None:
        return "" if value is None else ("yes" if value else "no")
    if isinstance(value, float | np.floating):
        return f"{value:.5g}"
    return str(value)
