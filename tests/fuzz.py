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
from scipy.interpolate import CubicSpline

from ocp_traj import problems
from ocp_traj.audit import audit
from ocp_traj.cli import run as command_line
from ocp_traj.errors import OcpTrajError
from ocp_traj.front import Front
from ocp_traj.limits_file import read_requirements
from ocp_traj.run_reader import load_run
from ocp_traj.store import save_run
from ocp_traj.trajectory import Trajectory
from tests import mutations
from tests.independent import limits
from tests.independent.check import broken, excesses
from tests.mutations import Data, Rng, pick
from tests.sound import SLOW, TABLE_7, sound

REFUSED, VIOLATED, UNDECIDED, PROVED = "refused", "violated", "undecided", "proved"
EXAMPLES = Path(__file__).resolve().parent.parent / "examples" / "foreign"
# What is mutated, with its weight; seams and air moves take seconds to build, the rest tenths.
QUICK = {
    "hybrid": 3.0,
    "hybrid, literal": 1.5,
    "hybrid, table 6": 0.5,
    "hybrid, free payload": 1.5,
    "rotor": 2.0,
    "rotor, jerk": 1.0,
    "rotor, printed": 0.5,
    "rotor, free payload": 1.0,
    "wrist": 3.0,
    "wrist, best": 0.5,
    "wrist, effort": 1.0,
    "wrist, clearance": 1.5,
    "wrist, far": 1.5,
    "wrist, none": 0.5,
    "foreign": 6.0,
    "run": 2.0,
}
HEAVY = {"air move": 0.7, "air move, rest": 0.3, "seam": 0.7}
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


@dataclass
class Mutant:
    """A mutated file in a folder of its own, and what is asked of it."""

    subject: str
    kind: str
    words: str
    path: Path
    limits: Path | None = None


# --- what is mutated ---


def run_folder(place: Path, name: str) -> Path:
    """A run of three proved points and one that is violated, without its picture; written once."""
    if (place / name).exists():
        return place / name
    factors = np.array([0.6, 1.0, 1.2, 1.5])
    x = np.outer(factors, TABLE_7 if name == "hybrid-spline" else SLOW)
    traded = ("time", "energy" if name == "hybrid-spline" else "jerk")
    front = Front.of(problems.load(name), traded, x, method="trace", seed=0, seconds=1.0, keep_unproved=True)
    folder = save_run(front, place / name)
    (folder / "front.png").unlink()
    return folder


def foreign(rng: Rng) -> Data:
    """A motion from elsewhere: samples, the coefficients of their spline, or its control points."""
    data: Data = json.loads((EXAMPLES / "samples.json").read_text())
    kind = pick(rng, ("samples", "samples", "spline", "control points", "one segment"))
    if kind == "samples":
        return data
    if kind == "one segment":
        quintic = [data["positions"][0]] * 3 + [data["positions"][-1]] * 3
        form = {"format": "ocp-traj/trajectory/1", "durations": [2.5], "control_points": [quintic]}
        return {**form, "joints": data["joints"], "parameters": {"payload": 2.0}}
    if kind == "control points":
        return {**Trajectory.from_dict(data).to_dict(), "parameters": {"payload": 1.5}}
    powers = CubicSpline(data["times"], data["positions"], bc_type="clamped").c[::-1]
    pieces = [powers[:, k].tolist() for k in range(powers.shape[1])]
    return {"format": "ocp-traj/spline/1", "joints": data["joints"], "knots": data["times"], "coefficients": pieces}


def of_trajectory(rng: Rng, folder: Path, subject: str) -> Mutant:
    """One or two changes to a trajectory of a problem."""
    data = sound(subject, pick(rng, (1.0, 1.0, 1.0, 1.02, 1.3)))
    path, said, kinds = folder / "trajectory.json", [], []
    weights = np.array([weight for weight, _ in mutations.OF_TRAJECTORIES.values()])
    if rng.random() < 0.08:
        content, words = mutations.text(rng, json.dumps(data, indent=1).encode())
        if rng.random() < 0.3:
            content, words = mutations.doubled_key(rng, data)
        path.write_bytes(content)
        return Mutant(subject, "text", words, path)
    for _ in range(pick(rng, (1, 1, 1, 2))):
        kind = str(rng.choice(list(mutations.OF_TRAJECTORIES), p=weights / weights.sum()))
        try:
            said.append(mutations.OF_TRAJECTORIES[kind][1](rng, data))
        except (OcpTrajError, KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError):
            said.append("no second change: the first left nothing to change")
        kinds.append(kind)
    path.write_text(json.dumps(data))
    return Mutant(subject, kinds[0], "; ".join(said), path)


def of_foreign(rng: Rng, folder: Path) -> Mutant:
    """A motion from elsewhere or its limits, changed."""
    data, content = (
        foreign(rng),
        (EXAMPLES / pick(rng, ("limits.toml", "limits.toml", "limits_tight.toml"))).read_text(),
    )
    shutil.copy(EXAMPLES / "arm.urdf", folder)
    if "parameters" in data and rng.random() < 0.5:
        content = content.replace("mass = 2.0", "parameter = true")
    path, bounds, way = folder / "trajectory.json", folder / "limits.toml", rng.random()
    kind, words, raw = "limits", "", json.dumps(data).encode()
    if way < 0.6:
        content, words = mutations.limits(rng, content)
        if rng.random() < 0.3:
            content, more = mutations.limits(rng, content)
            words += "; " + more
    elif way < 0.9:
        kind, words = "foreign", mutations.structure(rng, data)
        raw = json.dumps(data).encode()
    elif way < 0.95:
        kind, (raw, words) = "foreign text", mutations.text(rng, raw)
    else:
        kind, (changed, words) = "limits text", mutations.text(rng, content.encode())
        content = changed.decode(errors="surrogateescape")
    path.write_bytes(raw)
    bounds.write_text(content, errors="surrogateescape")
    return Mutant("foreign", kind, words, path, bounds)


def of_run(rng: Rng, folder: Path, source: Path) -> Mutant:
    """A run folder of which one file is changed."""
    target = folder / "run"
    shutil.copytree(source, target)
    files = sorted(path for path in target.rglob("*") if path.is_file())
    path = target / "front.csv" if rng.random() < 0.4 else pick(rng, files)
    if rng.random() < 0.15 or path.suffix not in (".json", ".csv"):
        raw, words = mutations.text(rng, path.read_bytes())
        path.write_bytes(raw)
    elif path.suffix == ".csv":
        content, words = mutations.cell(rng, path.read_text())
        path.write_text(content)
    else:
        data = json.loads(path.read_text())
        change = pick(rng, (mutations.structure, mutations.points if "durations" in data else mutations.structure))
        words = change(rng, data)
        path.write_text(json.dumps(data))
    return Mutant("run", f"run, {path.suffix[1:]}", f"{path.relative_to(target)}: {words}", target)


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
            if subject == "run":
                mutant = of_run(rng, folder, run_folder(place, pick(rng, ("hybrid-spline", "rotor-353"))))
            else:
                mutant = of_foreign(rng, folder) if subject == "foreign" else of_trajectory(rng, folder, subject)
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
