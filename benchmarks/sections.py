"""The page of results: sections between markers, each written by its own command, and the figures that are cited.

A section stands between ``<!-- name -->`` and ``<!-- /name -->``. What a command writes replaces its own section, or
comes last; all else stays as it is.
"""

from __future__ import annotations

from pathlib import Path

from ocp_traj.files import write_text

RESULTS = Path(__file__).resolve().parent / "RESULTS.md"
TITLE = "# Results of the benchmarks"


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
