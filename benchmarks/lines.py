"""Measurements as lines of JSON: each is kept as soon as it is there, so that a run that was stopped goes on."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

Figures = dict[str, Any]


@dataclass(frozen=True)
class Cell:
    """What is measured once.

    Attributes:
        tool: what does the work, such as ``toppra``.
        subject: what it is given, such as a path.
        setting: of the tool, as its manual names it; empty for none.
        repeat: of several measurements alike, or the seed.
    """

    tool: str
    subject: str
    setting: str = ""
    repeat: int = 0


class Lines:
    """The measurements in a file, by cell; the last line of a cell counts.

    A line that a stop has cut short is left out, and its cell is measured again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: dict[Cell, Figures] = {}
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
            try:
                one = json.loads(line)
            except json.JSONDecodeError:
                continue
            self.found[Cell(**one["cell"])] = one["figures"]

    def add(self, cell: Cell, figures: Mapping[str, Any]) -> None:
        """Keeps a measurement, on the disk when this returns."""
        kept = {**figures, "at": time.time(), "load": os.getloadavg()[0]}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        cut_short = self.path.exists() and not self.path.read_bytes().endswith(b"\n")
        with self.path.open("a", encoding="utf-8") as file:
            file.write(("\n" if cut_short else "") + json.dumps({"cell": asdict(cell), "figures": kept}) + "\n")
            file.flush()
            os.fsync(file.fileno())
        self.found[cell] = kept

    def of(self, **wanted: Any) -> list[Figures]:
        """Figures of all cells with these fields."""
        return [figures for _, figures in self.items(**wanted)]

    def items(self, **wanted: Any) -> Iterator[tuple[Cell, Figures]]:
        """Cells with these fields, and their figures."""
        for cell, figures in self.found.items():
            if all(getattr(cell, name) == value for name, value in wanted.items()):
                yield cell, figures
