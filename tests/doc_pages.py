"""Runs the fenced blocks of a Markdown page: its files, its commands and what they print, its Python.

* ``console``: lines ``$ ocp-traj ..`` or ``$ python examples/..`` are run in this process; lines below one have to be
  among what it prints, figures to ``CLOSE``. Its exit code is 2 where ``error: `` is shown, 1 where its line ends with
  ``# exit code 1``, else 0.
* ``python``: one after the other, in one namespace a page.
* ``toml``, ``json``, ``yaml`` with a first line ``# name``: a file of that name.
* ``python`` or ``toml`` with a first line ``# examples/..``: lines of that file, as they stand there.
* ``text``: no command and no code.

A comment ``<!-- not run: reason -->`` before a block leaves it out. A reason begins with one of ``REASONS``, or names
the test file that has the block, or what it shows.
"""

from __future__ import annotations

import re
import runpy
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from ocp_traj.cli.commands import run

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
BLOCK = re.compile(r"^(?:<!-- not run: ([^\n]*) -->\n+)?```([^\n]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
REASONS = ("minutes", "a cluster", "installs", ".ci/run", "a controller")
COMMAND = re.compile(r"^\$? ?(ocp-traj |python |pip |make |apt-get |dask )", re.MULTILINE)
CLOSE = 1e-3  # relative, of figures: another processor rounds otherwise


@dataclass(frozen=True)
class Block:
    """A fenced block, with the reason why it is not run, if it is not."""

    kind: str
    text: str
    reason: str

    @property
    def name(self) -> str:
        """The file that it is, if it names one."""
        first = self.text.partition("\n")[0]
        return first.removeprefix("# ") if re.fullmatch(r"# [\w-]+\.\w+", first) else ""

    @property
    def source(self) -> str:
        """The file of the examples that it is an excerpt of, if it is one."""
        first = self.text.partition("\n")[0]
        return first.removeprefix("# ") if re.fullmatch(r"# examples/[\w/-]+\.\w+", first) else ""


def blocks(page: Path) -> list[Block]:
    """Those of a page, in its order."""
    return [Block(kind, text, reason) for reason, kind, text in BLOCK.findall(page.read_text(encoding="utf-8"))]


def complaint(block: Block) -> str:
    """Why a block is neither run nor rightly left out; empty where it is."""
    if block.reason:
        files = re.findall(r"tests/[\w.]+\.py", block.reason)
        if not files and not block.reason.startswith(REASONS):
            return f"no known reason: {block.reason}"
        gone = [name for name in files if not (ROOT / name).is_file()]
        return f"{gone[0]} is not there" if gone else ""
    if block.source:
        there = block.text.partition("\n")[2] in (ROOT / block.source).read_text(encoding="utf-8")
        return "" if there else f"not what {block.source} says"
    if block.kind == "text":
        return "a command in a block of text" if COMMAND.search(block.text) else ""
    if block.kind == "console":
        return "" if block.text.startswith("$ ") else "its first line is no command"
    if block.kind in ("toml", "json", "yaml"):
        return "" if block.name else "its first line does not name a file"
    return "" if block.kind == "python" else f"unknown kind {block.kind!r}"


def alike(expected: str, line: str) -> bool:
    """Whether two lines have the same words, and figures that are close."""
    pairs = expected.split(), line.split()
    if len(pairs[0]) != len(pairs[1]):
        return False
    for one, other in zip(*pairs, strict=True):
        try:
            if not abs(float(one) - float(other)) <= CLOSE * abs(float(one)):
                return False
        except ValueError:
            if one != other:
                return False
    return True


def run_page(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Runs what a page shows in the current folder, and looks for what it says is printed."""
    names: dict[str, Any] = {"__name__": "page"}
    for block in blocks(page):
        if block.reason or block.source or block.kind == "text":
            continue
        if block.kind == "python":
            shown = _shown(capsys, lambda code=block.text: exec(compile(code, page.name, "exec"), names))
            _require([line[2:] for line in re.findall(r"(?<=  )# > .*$", block.text, re.MULTILINE)], shown, page.name)
        elif block.kind == "console":
            for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
                _run_command(part.splitlines(), capsys)
        else:
            Path(block.name).write_text(block.text)


def _run_command(lines: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    asked, *expected = lines
    program, *arguments = shlex.split(asked, comments=True)
    if arguments[:2] == ["-m", "ocp_traj"]:
        program, arguments = "ocp-traj", arguments[2:]
    code = 0
    if program == "ocp-traj":
        shown, code = _shown(capsys, lambda: run(arguments), True)
    else:
        assert program == "python" and arguments[0].startswith("examples/"), asked
        shown = _shown(capsys, lambda: _run_script(arguments))
    wanted = 2 if any(line.startswith("error: ") for line in expected) else 1 if "# exit code 1" in asked else 0
    assert code == wanted, f"{asked}: exit code {code}\n" + "\n".join(shown)
    _require(expected, shown, asked)


def _run_script(arguments: list[str]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", arguments)
        runpy.run_path(arguments[0], run_name="__main__")


def _shown(capsys: pytest.CaptureFixture[str], call: Callable[[], Any], with_code: bool = False) -> Any:
    capsys.readouterr()
    code = call()
    shown = capsys.readouterr()
    lines = (shown.out + "\n" + shown.err).splitlines()
    return (lines, code) if with_code else lines


def _require(expected: list[str], shown: list[str], what: str) -> None:
    for line in expected:
        if line.strip() not in ("", ".."):
            assert any(alike(line, other) for other in shown), f"{what}: {line}\nis not in\n" + "\n".join(shown)
