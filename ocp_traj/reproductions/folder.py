"""A folder of a reproduction: its tables as CSV and Markdown, its figures, and a page that leads to all of them.

What is finished is written as it is found, each file whole or not at all; a run that ends early leaves what it had.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd

from ocp_traj.errors import InputError, cut
from ocp_traj.files import check_writable, plain, write_text
from ocp_traj.reproductions.comparison import Reproduction
from ocp_traj.reproductions.gallery import PaperFigure
from ocp_traj.reproductions.readable import markdown, readable

TABLES, FIGURES, PAGE, VALUES = "tables", "figures", "README.md", "reproduction.json"
ENDINGS = ("png", "svg", "pdf")


class ReproductionFolder:
    """Where a reproduction is written to: a new folder, or an empty one.

    Args:
        root: the folder.
        endings: of the pictures, some of ``ENDINGS``.

    Raises:
        InputError: where the folder holds anything, or a picture cannot be written so.
    """

    def __init__(self, root: str | Path, endings: tuple[str, ...] = ("png",)) -> None:
        self.root, self.endings = Path(root), endings
        wrong = [ending for ending in endings if ending not in ENDINGS]
        if wrong or not endings:
            given = ", ".join(map(cut, wrong)) or "none"
            raise InputError(f"pictures are written as {', '.join(ENDINGS)}; got {given}")
        if self.root.exists() and (not self.root.is_dir() or any(self.root.iterdir())):
            what = "a folder that holds something already" if self.root.is_dir() else "a file"
            raise InputError(f"{cut(str(root))} is {what}; give a new folder, or remove it")
        self._new = not self.root.exists()
        if self._new:
            check_writable(self.root)  # says what is wrong with the place, before long work
            self.root.mkdir()
        self._written: dict[str, str] = {}
        self._drawn: set[str] = set()

    def keep(self, found: Reproduction) -> None:
        """Writes what is new."""
        tables = {title: table for title, table in found.tables.items() if len(table)}
        (self.root / TABLES).mkdir(exist_ok=True)
        for title, table in tables.items():
            self._table(title, table)
        for figure in found.figures:
            if figure.made and figure.listed.stem not in self._drawn:
                self._picture(figure)
        if found.finished:
            self._text(VALUES, json.dumps(plain(found.to_dict()), indent=1))
        self._text(PAGE, page(found, list(tables), self.endings[0]))

    def leave(self) -> bool:
        """Leaves what is written, and no new folder where that is nothing; whether there is anything."""
        if any(self.root.iterdir()):
            return True
        if self._new:
            self.root.rmdir()
        return False

    def _table(self, title: str, table: pd.DataFrame) -> None:
        place = f"{TABLES}/{stem(title)}"
        self._text(f"{place}.csv", table.to_csv(index=False).rstrip("\n"))
        self._text(f"{place}.md", f"# {title}\n\n{markdown(readable(table))}")

    def _text(self, name: str, text: str) -> None:
        if self._written.get(name) != text:
            write_text(self.root / name, text + "\n")
            self._written[name] = text

    def _picture(self, figure: PaperFigure) -> None:
        from ocp_traj.io.plot_style import save_figure  # Matplotlib is slow to import

        assert figure.draw is not None
        (self.root / FIGURES).mkdir(exist_ok=True)
        drawn = figure.draw()
        for ending in self.endings:
            save_figure(drawn, self.root / FIGURES / f"{figure.listed.stem}.{ending}")
        self._drawn.add(figure.listed.stem)


def stem(title: str) -> str:
    """A title as a file's name."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:80].rstrip("-")


def page(found: Reproduction, tables: list[str], ending: str) -> str:
    """The page: verdicts, figures and tables.

    Args:
        found: so far.
        tables: titles of those that are written.
        ending: of the pictures that it shows.
    """
    state = "" if found.finished else "**Not finished: this is what has been found so far.**\n\n"
    verdicts = markdown(readable(found.summary)) if found.comparisons else "none yet"
    rows = pd.DataFrame(
        [
            (
                f"[{one.listed.number}]({FIGURES}/{one.listed.stem}.{ending})" if one.made else one.listed.number,
                one.listed.shows,
                "made" if one.made else ("not made" if found.finished or one.listed.why_not else "not yet"),
                one.words if one.made or found.finished or one.listed.why_not else "",
            )
            for one in found.figures
        ],
        columns=["figure", "shows", "", "made of, or why not"],
    )
    listed = "\n".join(
        f"- [{title}]({TABLES}/{stem(title)}.md) ([CSV]({TABLES}/{stem(title)}.csv))" for title in tables
    )
    pictures = "\n\n".join(
        f"### {one.listed.number}: {one.listed.shows}\n\nOurs: {one.words}.\n\n"
        f"![{one.listed.number}]({FIGURES}/{one.listed.stem}.{ending})"
        for one in found.figures
        if one.made
    )
    sections = [
        (f"# {found.problem}: {found.reference}", f"{state}Made by `ocp-traj reproduce {found.problem}`."),
        ("## Verdicts", verdicts),
        ("## Figures", markdown(rows)),
        ("## Tables", listed),
        ("## Pictures", pictures),
    ]
    return "\n\n".join(f"{head}\n\n{body}" for head, body in sections)
