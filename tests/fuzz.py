"""Mutated files against the audit: ``python -m tests.fuzz --count 2000 --seed 0``, or ``make fuzz``.

Each mutant is read and audited as the command line does it. Whatever is said to be proved is recomputed by
``tests.independent``; any exception but the package's own, any warning, and a command line that disagrees is a fault.
A mutant follows from seed and index alone: ``--only INDEX --keep FOLDER`` makes one again and leaves its files there.
"""

import argparse
import contextlib
import io
import json
import shutil
import sys
import tempfile
import time
import tomllib
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj.cli.commands import run as command_line
from ocp_traj.errors import OcpTrajError
from ocp_traj.io.requirements_file import read_requirements
from ocp_traj.io.run_reader import load_run
from ocp_traj.proof.audit import audit
from ocp_traj.results.trajectory import Trajectory
from tests.independent import limits
from tests.independent.check import broken, excesses
from tests.mutants import HEAVY, QUICK, Mutant, made

REFUSED, VIOLATED, UNDECIDED, PROVED = "refused", "violated", "undecided", "proved"
EVERY = 12  # of the mutants, one goes through the command line as well


@dataclass
class Tally:
    """What became of the mutants."""

    outcomes: Counter[str] = field(default_factory=Counter)
    kinds: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    slowest: tuple[float, str] = (0.0, "")

    @property
    def audited(self) -> int:
        """How many reached a verdict."""
        return sum(self.outcomes[outcome] for outcome in (VIOLATED, UNDECIDED, PROVED))


# --- what is said of it, and whether it is so ---


def judge(mutant: Mutant) -> tuple[str, str]:
    """The outcome, and what is wrong with it."""
    if mutant.subject == "run":
        return judge_run(mutant.path)
    moved = Trajectory.load(mutant.path)
    found = moved.audit() if mutant.limits is None else audit(moved, read_requirements(mutant.limits))
    if not found.proved:
        return str(found.verdict), ""
    data = json.loads(mutant.path.read_text())
    if mutant.limits is None:
        false = broken(excesses(data))
    else:
        false = broken(limits.excesses(data, tomllib.loads(mutant.limits.read_text()), mutant.limits.parent))
    return PROVED, f"FALSE PROOF {false}" if false else ""


def judge_run(folder: Path) -> tuple[str, str]:
    """The points of a run are what its front says of them, whatever its files say."""
    front = load_run(folder)
    for index, point in enumerate(front.points):
        data = json.loads(json.dumps(point.trajectory.to_dict()))
        if point.verdict == PROVED and (false := broken(excesses(data))):
            return PROVED, f"FALSE PROOF of point {index} {false}"
    return (PROVED if any(point.verdict == PROVED for point in front.points) else VIOLATED), ""


def by_command_line(mutant: Mutant, outcome: str) -> str:
    """What is wrong with what the command line says of it."""
    arguments = ["export", str(mutant.path), "--format", "csv", "-o", str(mutant.path.parent / "out.csv")]
    if mutant.subject != "run":
        arguments = ["audit", str(mutant.path), *(["--limits", str(mutant.limits)] if mutant.limits else [])]
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = command_line(arguments)
    # Where nothing is asked nothing is decided, which the command line takes for wrong input.
    expected = (
        {REFUSED: (1, 2), PROVED: (0,), UNDECIDED: (1, 2)}.get(outcome, (1,)) if mutant.subject != "run" else (0, 2)
    )
    if code not in expected or "Traceback" in out.getvalue() + err.getvalue():
        return f"EXIT CODE {code} of what is {outcome}: {err.getvalue()[-200:]}"
    if code == 2 and len(err.getvalue().strip().splitlines()) != 1:
        return f"NOT ONE LINE: {err.getvalue()[-300:]}"
    return ""


def tried(mutant: Mutant, also: bool) -> tuple[str, list[str]]:
    """The outcome of a mutant, and its faults."""
    faults: list[str] = []
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            outcome, fault = judge(mutant)
        except OcpTrajError as error:
            outcome, fault = REFUSED, f"NOT ONE LINE: {error}" if "\n" in str(error) else ""
        except Exception:  # whatever it is, it should have been refused in one line
            outcome, fault = "traceback", "TRACEBACK\n" + traceback.format_exc()
        faults.append(fault)
        if also and outcome != "traceback":
            try:
                faults.append(by_command_line(mutant, outcome))
            except BaseException:  # a command line ends with a number
                faults.append("TRACEBACK of the command line\n" + traceback.format_exc())
    faults += sorted({f"WARNING {w.category.__name__}: {w.message}" for w in warned})
    return outcome, [fault for fault in faults if fault]


def main(
    count: int, seed: int, *, only: int | None = None, keep: Path | None = None, heavy: bool = True,
    say: Callable[[str], None] = print,
) -> Tally:  # fmt: skip
    """Makes and judges ``count`` mutants, or the one numbered ``only``."""
    tally, subjects = Tally(), {**QUICK, **(HEAVY if heavy else {})}
    shares = np.array(list(subjects.values())) / sum(subjects.values())
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        for index in range(count) if only is None else [only]:
            rng, begun = np.random.default_rng([seed, index]), time.perf_counter()
            folder = keep or place / str(index)
            folder.mkdir(parents=True, exist_ok=True)
            subject = str(rng.choice(list(subjects), p=shares))
            mutant = made(rng, folder, subject, place)
            outcome, faults = tried(mutant, index % EVERY == 0)
            tally.outcomes[outcome] += 1
            tally.kinds[mutant.kind, outcome] += 1
            name = f"mutant {index} of seed {seed}: {subject}, {mutant.kind}: {mutant.words[:200]}"
            found = [f"{name}\n    {fault}" for fault in faults]
            tally.faults += found
            tally.slowest = max(tally.slowest, (time.perf_counter() - begun, name))
            for words in found:
                say(words)
            if only is not None:
                say(f"{name}: {outcome}")
            if keep is None:
                shutil.rmtree(folder)
    return tally


def report(tally: Tally) -> str:
    """Counts by outcome, and by what was changed."""
    columns = sorted({outcome for _, outcome in tally.kinds})
    lines = [f"{tally.outcomes.total()} mutants, {tally.audited} audited: {dict(sorted(tally.outcomes.items()))}"]
    lines.append(f"{'changed':16}" + "".join(f"{outcome:>11}" for outcome in columns))
    for kind in sorted({kind for kind, _ in tally.kinds}):
        lines.append(f"{kind:16}" + "".join(f"{tally.kinds[kind, outcome]:11}" for outcome in columns))
    return "\n".join([*lines, f"slowest: {tally.slowest[0]:.1f} s, {tally.slowest[1]}", f"faults: {len(tally.faults)}"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--heavy", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--only", type=int)
    parser.add_argument("--keep", type=Path)
    given: dict[str, Any] = vars(parser.parse_args())
    result = main(**given)
    print(report(result))
    sys.exit(bool(result.faults))
