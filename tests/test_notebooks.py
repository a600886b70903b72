"""The notebooks of the examples run from the first cell to the last, and print what they are stored with."""

import re
import shutil
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from tests.doc_pages import alike

EXAMPLES = Path(__file__).parents[1] / "examples"
NOTEBOOKS = sorted(EXAMPLES.glob("*.ipynb"))


def printed(notebook: Any) -> list[str]:
    """Lines of text that the cells show; not where an object lies in memory, nor what follows it."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    texts = [output.get("text") or output.get("data", {}).get("text/plain", "") for output in outputs]
    return [re.sub(r" at 0x[0-9a-f]+.*", "", line) for text in texts for line in text.splitlines()]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")  # of the kernel's client
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_prints_what_it_is_stored_with(path: Path, tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples")
    stored = nbformat.read(path, as_version=4)
    again = nbformat.read(path, as_version=4)
    NotebookClient(again, timeout=200, resources={"metadata": {"path": str(tmp_path / "examples")}}).execute()
    expected, found = printed(stored), printed(again)
    assert len(expected) > 10 and len(found) == len(expected)
    assert not [(a, b) for a, b in zip(expected, found, strict=True) if not alike(a, b)]
