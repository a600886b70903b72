"""Broken task files: one clear line each with file, line, table, key, value and what is allowed; exit code 2."""

import re
from pathlib import Path

import pytest

from ocp_traj.cli.commands import run
from tests.broken_tasks import BROKEN, broken

CASES = [(anchor, instead, words) for anchor, edits in BROKEN.items() for instead, words in edits]
# What a complaint ends with: what may stand there, or what to do.
ADVICE = re.compile(
    r"; (give |allowed are |write |leave |take |those are |joints are |the robot |formats are |options are )"
)
ALSO = re.compile(r"not TOML|No such file|expected |no URDF holds it|stands still only where|to stand still is a dwell")
FILE_ALONE = re.compile(r"is not a task file|\[move\] is missing")  # what has no line


def test_there_are_many() -> None:
    assert len(CASES) >= 140 and len({broken(anchor, instead) for anchor, instead, _ in CASES}) == len(CASES)


@pytest.mark.parametrize(("anchor", "instead", "words"), CASES)
def test_what_is_wrong_with_a_task_is_told_in_one_line(
    anchor: str, instead: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    Path("x.toml").write_text(broken(anchor, instead))
    capsys.readouterr()
    assert run(["show", "x.toml"]) == 2
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err.count("\n") == 1
    said = shown.err.removeprefix("error: ").strip()
    assert said.startswith(words)
    assert re.match(r"x\.toml:\d+: ", said) or FILE_ALONE.search(said)
    assert ADVICE.search(said) or ALSO.search(said)
    assert len(said) < 600 and "Traceback" not in said
