"""The command line as a process: version, no arguments, and a stdout that cannot be written."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import ocp_traj
from ocp_traj.cli.commands import run

ROOT = Path(__file__).parents[1]


def test_version_is_the_package_s(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capfd.readouterr().out == f"ocp-traj {ocp_traj.__version__}\n"


def test_without_a_command_the_help_is_printed_as_it_is(capfd: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 2
    shown = capfd.readouterr()
    assert shown.err == ""
    assert "\n  solve " in shown.out and shown.out.startswith("Usage: ocp-traj")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line() -> None:
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "ocp_traj", "show", "hybrid-spline"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    assert done.returncode == 1
    assert done.stderr == "error: cannot write the result: No space left on device\n"


def test_exporting_the_folder_one_stands_in_needs_no_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["export", ".", "--format", "csv"]) == 2
    assert capfd.readouterr().err.startswith("error: cannot read the run file")


def test_an_error_is_a_json_object_where_json_was_asked_for(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "hybrid-spline", "--objective", "speed", "--json"]) == 2
    shown = capfd.readouterr()
    found = json.loads(shown.out)
    assert found["exit_code"] == 2 and "speed" in found["error"]
    assert shown.err == f"error: {found['error']}\n"
