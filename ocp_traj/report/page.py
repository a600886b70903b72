"""The page itself: template, style, scripts and data put into one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import gzip
import html
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, quoted
from ocp_traj.files import plain, write_text
from ocp_traj.report.page_data import page_data
from ocp_traj.report.sources import Source, read_sources

# In the order in which they need each other.
SCRIPTS = (
    "base.js", "curve.js", "kinematics.js", "camera.js", "bodies.js", "scene.js", "player.js", "front.js", "panels.js",
    "tables.js", "main.js",
)  # fmt: skip
NEEDS = "a report needs plotly.js of the package plotly: pip install 'ocp-traj[report]'"


@one_blas_thread
def write_report(places: Sequence[str | Path], target: str | Path) -> Path:
    """Writes the page of run folders and trajectory files, whole or not at all.

    Args:
        places: of runs and trajectories; several are shown together.
        target: the HTML file.

    Raises:
        InputError: where something cannot be shown, or plotly is not installed.
    """
    check_page(target)
    return write_page(read_sources(places), target)


def check_page(target: str | Path) -> None:
    """Raises ``InputError`` unless plotly is there and the file's name ends in .html; to be called before long work."""
    if Path(target).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"-o is {quoted(str(target))}; a page ends in .html")
    plotly_js()


def write_page(sources: Sequence[Source], target: str | Path) -> Path:
    """Writes the page of what was read."""
    return write_text(target, page(page_data(sources)))


def page(data: Mapping[str, Any]) -> str:
    """The HTML text of a page's data."""
    parts = {
        "title": html.escape(str(data["title"])),
        "style": _static("page.css"),
        "data": json.dumps(plain(data), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        "plotly": base64.b64encode(gzip.compress(plotly_js().encode(), mtime=0)).decode("ascii"),
        "scripts": "\n".join(f"<script>\n{_script_text(_static(name))}</script>" for name in SCRIPTS),
    }
    text = _static("page.html")
    for name, part in parts.items():
        head, mark, tail = text.partition(f"<!-- {name} -->")
        assert mark, f"page.html has no place for {name}"
        text = head + part + tail
    return text


def plotly_js() -> str:
    """The script of plotly.js, which the package plotly brings along."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError as error:
        raise InputError(NEEDS) from error
    return str(get_plotlyjs())


def _static(name: str) -> str:
    return files("ocp_traj.report").joinpath("static", name).read_text(encoding="utf-8")


def _script_text(text: str) -> str:
    """Text that does not end the script element it stands in."""
    return text.replace("</", "<\\/").replace("<!--", "<\\!--")
