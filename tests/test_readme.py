"""What the README says of its example is what the example is, and prints."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "first_front.py"


def section(title: str) -> list[str]:
    """The fenced blocks of a section of the README."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    body = text.split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]
    return re.findall(r"^```\w*\n(.*?)^```", body, flags=re.DOTALL | re.MULTILINE)


def test_the_first_python_block_is_the_example() -> None:
    _, code = EXAMPLE.read_text(encoding="utf-8").split('"""\n\n', 1)
    assert section("In Python")[0] == code


@pytest.mark.slow
def test_the_block_below_is_what_the_example_prints() -> None:
    run = subprocess.run([sys.executable, EXAMPLE], capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout == section("In Python")[1]


def test_it_is_read_in_a_minute() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120
