"""The page of results: sections between markers, each written by its own command, and the figures that are cited.

A section stands between ``<!-- name -->`` and ``<!-- /name -->``. What a command writes replaces its own section, or
comes last; all else stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ocp_traj.files import write_text

RESULTS = Path(__file__).resolve().parent / "RESULTS.md"
TITLE = "# Results of the benchmarks"
MARKER = re.compile(r"<!-- results: ([\w.-]+) -->")
ROW = re.compile(r"^\| `([\w.-]+)` \| ([^|]+?) \| ([^|]+?) \|$", flags=re.MULTILINE)  # key, figure, what it is


def put(name: str, text: str, page: Path = RESULTS) -> None:
    """Puts a section in its place, and leaves the others as they are.

    Args:
        name: in its markers, such as ``speed``.
        text: Markdown, without the markers.
        page: made where it is missing.
    """
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    old = page.read_text(encoding="utf-8") if page.exists() else TITLE
    if old.count(start) != old.count(end):
        raise ValueError(f"{page}: {start} and {end} do not pair up; put it right by hand")
    head, _, rest = old.partition(start)
    tail = rest.partition(end)[2]
    parts = (head.strip(), f"{start}\n{text.strip()}\n{end}", tail.strip())
    write_text(page, "\n\n".join(filter(None, parts)) + "\n")


def section(name: str, page: Path = RESULTS) -> str:
    """What stands in a section; empty where there is none."""
    return _inside(page.read_text(encoding="utf-8"), name) if page.exists() else ""


def _inside(text: str, name: str) -> str:
    return text.partition(f"<!-- {name} -->")[2].partition(f"<!-- /{name} -->")[0]


def cited_figures(page: str) -> dict[str, str]:
    """Figures of the page that may be cited, by key: the table of its section ``cited``."""
    return {key: figure for key, figure, _ in ROW.findall(_inside(page, "cited"))}


def disagreements(document: str, figures: Mapping[str, str]) -> list[str]:
    """Where a document says otherwise than the page that it cites.

    Args:
        document: whose figures are followed by ``<!-- results: key -->`` each.
        figures: of the page, by key.
    """
    found = []
    for marker in MARKER.finditer(document):
        key, before = marker[1], document[: marker.start()].rstrip()
        if key not in figures:
            found.append(f"{key}: there is no such figure; there are {', '.join(figures) or 'none'}")
        elif not re.search(rf"(?<![\w.]){re.escape(figures[key])}$", before):
            found.append(f"{key}: {before[-30:]!r} does not end with {figures[key]!r}")
    return found
