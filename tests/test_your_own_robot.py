"""The page on one's own robot: its files, its commands and what they print, its Python."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from ocp_traj.cli.commands import run

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
CLOSE = 1e-3  # relative, of figures: another processor rounds otherwise


def _alike(expected: str, line: str) -> bool:
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


@pytest.mark.slow
def test_the_page_is_what_happens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(ROOT / "examples" / "foreign" / "arm.urdf", tmp_path)
    monkeypatch.chdir(tmp_path)
    done = []
    for kind, text in BLOCK.findall((ROOT / "docs" / "your-own-robot.md").read_text(encoding="utf-8")):
        done.append(kind)
        if kind == "toml":
            Path(text.partition("\n")[0].removeprefix("# ")).write_text(text)
        elif kind == "python":
            exec(compile(text, "your-own-robot.md", "exec"), {})
        else:
            for command in text.split("$ ocp-traj ")[1:]:
                asked, *expected = command.splitlines()
                capsys.readouterr()
                code = run(shlex.split(asked))
                shown = capsys.readouterr()
                lines = (shown.out + shown.err).splitlines()
                assert code == (2 if any(line.startswith("error: ") for line in expected) else 0), asked
                for line in expected:
                    assert any(_alike(line, other) for other in lines), f"{asked}: {line}"
    assert sorted(set(done)) == ["console", "python", "toml"] and done.count("console") == 7
    assert {"arm.json", "heavy.json", "arm.ros.yaml", "slow.json", "own.json"} <= {p.name for p in tmp_path.iterdir()}
