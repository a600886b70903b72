"""Signals, standard streams and strange files, as a process sees them: never a traceback, nothing half written."""

from __future__ import annotations

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from ocp_traj import files
from ocp_traj.cli import console
from ocp_traj.cli.commands import run
from ocp_traj.io.run_reader import load_run
from ocp_traj.results.trajectory import Trajectory
from tests.test_stopping import ctrl_c_at

ROOT = Path(__file__).parents[1]
LIMIT = 60.0  # [s] within which a process has to end on a busy machine: our choice
MANY = ["solve", "hybrid-spline", "--objective", "time", "--starts", "1000"]


def begin(arguments: Sequence[str], **options: Any) -> subprocess.Popen[str]:
    """The command line as a process, as soon as it handles signals."""
    # In the background the shell has Ctrl-C ignored, and nohup the end of the terminal; a child would inherit that.
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL}
    before = {number: signal.signal(number, handler) for number, handler in usual.items()}
    process = subprocess.Popen(
        [sys.executable, "-m", "ocp_traj", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, **options,
    )  # fmt: skip
    for number, handler in before.items():
        signal.signal(number, handler)
    caught = 0
    while not caught >> (signal.SIGTERM - 1) & 1:
        time.sleep(0.001)
        caught = int(Path(f"/proc/{process.pid}/status").read_text().split("SigCgt:")[1].split()[0], 16)
    return process


needs_proc = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads /proc")


@needs_proc
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_while_the_program_is_loaded_ends_it_at_once(number: int, code: int) -> None:
    process = begin(MANY)
    process.send_signal(number)
    out, err = process.communicate(timeout=LIMIT)
    assert (process.returncode, out, err) == (code, "", "interrupted\n")


@needs_proc
@pytest.mark.slow
def test_what_nohup_has_ignored_stays_ignored() -> None:
    process = begin(["problems", "--json"], preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    process.send_signal(signal.SIGHUP)
    assert json.loads(process.communicate(timeout=LIMIT)[0])["problems"]
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("redirection", "code", "words"),
    [
        (">&-", 1, "error: cannot write the result: Bad file descriptor\n"),
        pytest.param(
            ">/dev/full", 1, "error: cannot write the result: No space left on device\n", marks=pytest.mark.slow
        ),
        pytest.param("2>&-", 0, "", marks=pytest.mark.slow),
        pytest.param("2>/dev/full", 0, "", marks=pytest.mark.slow),
    ],
)
def test_a_stream_that_cannot_be_written_is_one_line_or_none(
    redirection: str, code: int, words: str, tmp_path: Path
) -> None:
    """A file that is written must not take the number of a stream that was closed."""
    target = tmp_path / "t.csv"
    command = f'"$0" -m ocp_traj export "$1" --format csv -o "$2" --json {redirection}'
    trajectory = tmp_path / "t.json"
    trajectory.write_text(json.dumps(MOTION))
    done = subprocess.run(
        ["bash", "-c", command, sys.executable, str(trajectory), str(target)],
        capture_output=True, text=True, cwd=ROOT, timeout=LIMIT,
    )  # fmt: skip
    assert done.returncode == code
    assert [line for line in done.stderr.splitlines(keepends=True) if not line.startswith("written")] == (
        [words] if words else []
    )
    assert target.read_text().startswith("time [s],a q")


# --- within a process ---


@pytest.fixture
def pressed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], None]]:
    """Has Ctrl-C pressed when progress is told for the given time."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)

    def press_at(call: int) -> None:
        monkeypatch.setattr(console, "progress", lambda title: nullcontext(ctrl_c_at(call)))

    yield press_at
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
def test_solve_shows_and_writes_the_best_so_far(
    pressed: Callable[[int], None], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pressed(1)
    target = tmp_path / "best.json"
    arguments = ["solve", "hybrid-spline", "--objective", "time", "--starts", "9", "--json"]
    assert run([*arguments, "-o", str(target)]) == 130
    out, err = capfd.readouterr()
    assert err.splitlines()[-1] == "interrupted after 4 of 9 starts"
    assert json.loads(out)["interrupted"] == "after 4 of 9 starts"
    assert Trajectory.load(target).audit().proved
    assert list(tmp_path.iterdir()) == [target]


def test_without_a_result_it_says_so(
    pressed: Callable[[int], None], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pressed(1)  # after the first of several rounds
    arguments = ["solve", "hybrid-spline", "--objective", "time", "--starts", "1", "-o", str(tmp_path / "t.json")]
    assert run(arguments) == 130
    assert capfd.readouterr() == ("", "interrupted before there was a result\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_pareto_writes_the_front_so_far(
    pressed: Callable[[int], None], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pressed(15)
    arguments = [
        "pareto",
        "hybrid-spline",
        "--objectives",
        "time,energy",
        "--method",
        "nsga2",
        "--option",
        "population=40",
    ]
    assert run([*arguments, "-o", str(tmp_path / "run"), "--json"]) == 130
    out, err = capfd.readouterr()
    assert err.splitlines()[-1] == "interrupted after 15 of 200 generations"
    assert json.loads(out)["info"]["interrupted"] is True
    front = load_run(tmp_path / "run")
    assert len(front) == json.loads(out)["points"] > 0 and front.info["ended after"] == "15 of 200 generations"


def test_nothing_is_written_where_nothing_was_found(
    pressed: Callable[[int], None], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pressed(1)
    arguments = [
        "pareto",
        "wrist-obstacle",
        "--objectives",
        "time,distance",
        "--method",
        "nsga2",
        "--option",
        "population=4",
    ]
    assert run([*arguments, "-o", str(tmp_path / "run")]) == 130
    assert capfd.readouterr().err == "interrupted before the first point was found; nothing is written\n"
    assert not list(tmp_path.iterdir())


MOTION = {
    "format": "ocp-traj/trajectory/1",
    "joints": ["a"],
    "durations": [1.0],
    "control_points": [[[0.0], [0.0], [1.0], [1.0]]],
}
LIMITS = 'format = "ocp-traj/limits/1"\njoints = ["a"]\nunits = ["rad"]\n[velocity]\nlimit = [2.0]\n'
HUGE = "x" * 100_000


@pytest.fixture
def strange(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with files nobody should read."""
    monkeypatch.chdir(tmp_path)
    Path("loop").symlink_to("pool")
    Path("pool").symlink_to("loop")
    os.mkfifo("fifo")
    Path("zero.json").symlink_to("/dev/zero")
    Path("good.json").write_text(json.dumps(MOTION))
    Path("limits.toml").write_text(LIMITS)
    Path("names.json").write_text(json.dumps({**MOTION, "joints": [HUGE]}))
    Path("format.json").write_text(json.dumps({"format": HUGE}))
    Path("degree.json").write_text(json.dumps({**MOTION, "control_points": [[[0.0]] * 3000]}))
    return tmp_path


STRANGE = {
    "the root": (["export", "/", "--format", "csv"], "/ has no name"),
    "a loop": (["export", "loop", "--format", "csv"], "Too many levels of symbolic links"),
    "a loop to a run": (["pareto", "hybrid-spline", "--objectives", "time,energy", "-o", "loop/run"], "cannot create"),
    "a device": (["audit", "/dev/zero"], "it is a device; give a file, or a pipe"),
    "a link to a device": (["export", "zero.json", "--format", "csv"], "it is a device"),
    "a pipe nobody writes to": (["audit", "fifo"], "a pipe that nobody writes to"),
    "a folder": (["audit", "."], "it is a folder"),
    "limits from a device": (["audit", "good.json", "--limits", "/dev/zero"], "limits file /dev/zero: it is a device"),
    "a seam from a device": (["show", "weld-bezier", "--set", "seam_file=/dev/zero"], "it is a device"),
    "a long path": (["audit", HUGE], "File name too long"),
    "a long path to write": (["export", "good.json", "--format", "csv", "-o", HUGE], "File name too long"),
    "a long value": (["show", "hybrid-spline", "--set", f"payload={HUGE}"], r"payload is .* \(100002 characters\)"),
    "a long field": (["show", "hybrid-spline", "--set", f"{HUGE}=1"], "no case field"),
    "a long option": (["show", "hybrid-spline", f"--{HUGE}"], "No such option"),
    "a long command": ([HUGE], "No such command"),
    "a long format": (["audit", "format.json"], r"its format is 'xxx.* \(100002 characters\)"),
    "long names": (["audit", "names.json", "--limits", "limits.toml"], r"joints are \['xxx"),
    "a high degree": (["audit", "degree.json", "--limits", "limits.toml"], "of degree 2999; allowed are .* up to 60"),
    "too many starts": (["solve", "hybrid-spline", "--starts", "9" * 30], "--starts"),
    "a name that is no text": (["audit", os.fsdecode(b"\xff.json")], "No such file"),
}


@pytest.mark.parametrize("name", STRANGE)
def test_what_is_strange_is_refused_in_one_short_line(
    name: str, strange: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments, words = STRANGE[name]
    assert run(arguments) == 2
    shown = capfd.readouterr()
    assert shown.out == "" and len(shown.err) < 1000 and len(shown.err.splitlines()) == 1
    assert re.search(words, shown.err), shown.err


def test_a_file_beyond_what_a_sane_one_holds_is_not_read_to_its_end(
    strange: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(files, "LARGEST", 2**20)
    with open("large.json", "wb") as file:
        file.truncate(10 * 2**20)
    assert run(["audit", "large.json"]) == 2
    assert "it has more than 1 MiB" in capfd.readouterr().err


def test_a_pipe_is_read_to_its_end(strange: Path) -> None:
    both_ends = os.open("fifo", os.O_RDWR)  # so that the writer need not wait for a reader

    def write() -> None:
        with open("fifo", "w") as pipe:
            pipe.write(json.dumps(MOTION)[:50])
            pipe.flush()
            while int.from_bytes(fcntl.ioctl(both_ends, termios.FIONREAD, bytes(4)), sys.byteorder):
                time.sleep(0.01)  # until it is read, and the reader waits for more
            os.close(both_ends)
            pipe.write(json.dumps(MOTION)[50:])

    writer = threading.Thread(target=write)
    writer.start()
    assert run(["audit", "fifo", "--limits", "limits.toml"]) == 0
    writer.join()
