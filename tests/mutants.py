"""Mutants: files of every kind with one or two changes, each in a folder of its own."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from ocp_traj import problems
from ocp_traj.errors import OcpTrajError
from ocp_traj.io.store import save_run
from ocp_traj.results.front import Front
from ocp_traj.results.trajectory import Trajectory
from tests import mutations, text_mutations
from tests.mutations import Data, Rng, pick
from tests.sound import SLOW, TABLE_7, sound

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


@dataclass
class Mutant:
    """A mutated file in a folder of its own, and what is asked of it."""

    subject: str
    kind: str
    words: str
    path: Path
    limits: Path | None = None


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
        content, words = text_mutations.text(rng, json.dumps(data, indent=1).encode())
        if rng.random() < 0.3:
            content, words = text_mutations.doubled_key(rng, data)
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
        content, words = text_mutations.limits(rng, content)
        if rng.random() < 0.3:
            content, more = text_mutations.limits(rng, content)
            words += "; " + more
    elif way < 0.9:
        kind, words = "foreign", mutations.structure(rng, data)
        raw = json.dumps(data).encode()
    elif way < 0.95:
        kind, (raw, words) = "foreign text", text_mutations.text(rng, raw)
    else:
        kind, (changed, words) = "limits text", text_mutations.text(rng, content.encode())
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
        raw, words = text_mutations.text(rng, path.read_bytes())
        path.write_bytes(raw)
    elif path.suffix == ".csv":
        content, words = text_mutations.cell(rng, path.read_text())
        path.write_text(content)
    else:
        data = json.loads(path.read_text())
        change = pick(rng, (mutations.structure, mutations.points if "durations" in data else mutations.structure))
        words = change(rng, data)
        path.write_text(json.dumps(data))
    return Mutant("run", f"run, {path.suffix[1:]}", f"{path.relative_to(target)}: {words}", target)


def made(rng: Rng, folder: Path, subject: str, runs: Path) -> Mutant:
    """A mutant of a subject in ``folder``; runs to be changed are kept in ``runs``."""
    if subject == "run":
        return of_run(rng, folder, run_folder(runs, pick(rng, ("hybrid-spline", "rotor-353"))))
    return of_foreign(rng, folder) if subject == "foreign" else of_trajectory(rng, folder, subject)
