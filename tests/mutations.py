"""Random changes to trajectories: what a person or another program may do to one, each said in words."""

import copy
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from ocp_traj import problems
from ocp_traj.results.trajectory import trajectory_of
from tests.independent.check import PROBLEMS

Data = dict[str, Any]
Rng = np.random.Generator

FACTORS = (0.5, 0.9, 0.99, 1.0 + 1e-9, 1.01, 1.1, 1.5, 2.0, 10.0, 100.0)
ODD: tuple[Any, ...] = (
    None,
    True,
    -1,
    0,
    1e-300,
    1e300,
    float("inf"),
    float("nan"),
    10**400,
    "1",
    "x",
    "",
    [],
    {},
    [1.0],
)
CHOICES = {
    "convention": ("physical", "paper-literal"),
    "via_points": ("rederived", "table6"),
    "timing": ("synchronised", "per_joint"),
    "case": ("blocked", "open", "air-move", "seam"),
    "branch": ("best", "0", "1"),
    "seam_file": ("nowhere.csv",),
}


def pick(rng: Rng, items: Any) -> Any:
    """One of some things, unchanged in type."""
    return items[int(rng.integers(len(items)))]


def number(rng: Rng, value: float) -> Any:
    """Another number in the place of one: nudged, scaled, of the other sign, or no number at all."""
    way = rng.integers(8)
    if way < 3:
        return float(value + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-16.0, 0.0))
    if way < 6:
        return float(value * pick(rng, FACTORS))
    return -value if way == 6 else pick(rng, ODD)


# --- trajectories of a problem; each says what it did ---


def parameter(rng: Rng, data: Data) -> str:
    """A parameter says something else than the case."""
    if not data["parameters"] or rng.random() < 0.1:
        data["parameters"]["extra"] = 1.0
        return "an extra parameter"
    name = pick(rng, sorted(data["parameters"]))
    value = data["parameters"][name]
    chosen = pick(rng, (0.0, -0.6, 1e9, value + 1.0, value * 0.5, None))
    data["parameters"][name] = number(rng, value) if chosen is None else chosen
    return f"parameter {name} = {data['parameters'][name]!r}"


def case_field(rng: Rng, data: Data) -> str:
    """A field of the case says something else."""
    defaults = PROBLEMS[data["problem"]].DEFAULTS
    name = pick(rng, sorted(defaults))
    data["case"][name] = other_value(rng, name, data["case"].get(name, defaults[name]))
    return f"case {name} = {data['case'][name]!r}"


def other_value(rng: Rng, name: str, value: Any) -> Any:
    """A value for a field of a case: most are such as it may have."""
    if rng.random() < 0.1:
        return pick(rng, ODD)
    if isinstance(value, bool):
        return not value
    if name in CHOICES:
        return pick(rng, CHOICES[name])
    if isinstance(value, int):
        return value + int(rng.integers(-2, 3))
    if isinstance(value, float):
        return (
            value * pick(rng, FACTORS)
            if value and rng.random() < 0.8
            else pick(rng, (0.0, 1e-3, 0.09, 1.0, 3.0, 100.0))
        )
    if value is None:  # start and goal of a wrist
        point = rng.normal(size=3)
        return (2.0 * point / np.linalg.norm(point)).tolist()
    rows = np.array(value, dtype=float)
    way = rng.integers(5)
    if way == 0 or not rows.size:
        return pick(rng, ("none", None, [], np.full(6, 1e4).tolist()))
    if way == 1:
        return rows[:-1].tolist()
    if way == 2:
        return (rows * pick(rng, FACTORS)).tolist()
    rows[tuple(rng.integers(rows.shape))] *= pick(rng, (*FACTORS, -1.0, 0.0))
    return rows.tolist()


def variables(rng: Rng, data: Data) -> str:
    """A variable, or a block of them, says something else than the curve."""
    if not data["variables"]:
        data["variables"] = {"h": [0.1]}
        return "variables of another problem"
    name = pick(rng, sorted(data["variables"]))
    if rng.random() < 0.2:
        block = data["variables"].pop(name)
        if rng.random() < 0.5:
            data["variables"]["other"] = block
        return f"no variables {name}"
    i = int(rng.integers(len(data["variables"][name])))
    data["variables"][name][i] = number(rng, data["variables"][name][i])
    return f"variable {name}[{i}] = {data['variables'][name][i]!r}"


def durations(rng: Rng, data: Data) -> str:
    """The curve is slower or faster than its variables say, as a whole or in one segment."""
    factor = pick(rng, (*FACTORS, 1.001, 1.05, 0.1))
    chosen = range(len(data["durations"])) if rng.random() < 0.6 else [int(rng.integers(len(data["durations"])))]
    for k in chosen:
        data["durations"][k] *= factor
    return f"durations {list(chosen)} times {factor}"


def points(rng: Rng, data: Data) -> str:
    """A control point is nudged; a few of them now and then."""
    size = 10.0 ** rng.uniform(-14.0, 0.0)
    for _ in range(pick(rng, (1, 1, 1, 20))):
        row = pick(rng, pick(rng, data["control_points"]))
        row[int(rng.integers(len(row)))] += size * rng.choice([-1.0, 1.0])
    return f"control points by {size:.3g}"


def joints(rng: Rng, data: Data) -> str:
    """Names of joints are exchanged, others, fewer or the same."""
    way, names = rng.integers(4), data["joints"]
    if way == 0:
        rng.shuffle(names)
    elif way == 1:
        names[0] = "other"
    elif way == 2:
        del names[0]
    else:
        names[0] = names[-1]
    return f"joints {names}"


def agreeing(rng: Rng, data: Data) -> str:
    """A payload or a clearance in case, parameters and variables alike."""
    factor = pick(rng, (0.0, 0.5, 0.99, 1.01, 1.2, 3.0))
    for name, value in list(data["parameters"].items()):
        other = factor * value if value else factor
        data["parameters"][name] = other
        if name == "payload" or rng.random() < 0.5:
            data["case"][{"clearance": "min_clearance"}.get(name, name)] = other
        for block in ("payload", "margin"):
            if block in data["variables"]:
                data["variables"][block] = [other]
    return f"parameters times {factor}, in all places"


def rebuilt(rng: Rng, data: Data) -> str:
    """Other variables, and the curve they give: an honest file, of a motion that may break its limits."""
    problem = problems.load(data["problem"], **data["case"])
    blocks = data["variables"] or problem.unpack(problem.guess(rng))
    x = np.concatenate([np.ravel(blocks[v.id]) for v in problem.variables])
    x = x * (1.0 + 10.0 ** rng.uniform(-4.0, -0.7) * rng.normal(size=len(x)))
    data.update(json.loads(json.dumps(trajectory_of(problem, x).to_dict())))
    return "other variables and their curve"


def harmless(rng: Rng, data: Data) -> str:
    """What changes nothing that a limit asks for."""
    way = rng.integers(5)
    if way == 0:
        for name in reversed(list(data)):
            data[name] = data.pop(name)
        return "keys in another order"
    if way == 1:
        data["note"] = {"author": "somebody"}
        return "an extra key"
    if way == 2:
        data["variables"] = {}
        return "no variables"
    defaults = PROBLEMS[data["problem"]].DEFAULTS
    if way == 3:
        data["case"]["weights"] = [2.0] * len(defaults.get("weights", (1.0,)))
        return "other weights"
    data["case"].update({name: value for name, value in defaults.items() if name not in data["case"]})
    return "defaults written out"


def structure(rng: Rng, data: Any) -> str:
    """Somewhere in the tree a key is gone, or something else stands there, or it is nested deeper."""
    node, path = data, ""
    while True:
        keys = sorted(node) if isinstance(node, dict) else list(range(len(node)))
        key = pick(rng, keys)
        path += f"/{key}"
        child = node[key]
        if not isinstance(child, dict | list) or not child or rng.random() < 0.25:
            break
        node = child
    way = rng.integers(6)
    if way == 0:
        del node[key]
    elif way == 1:
        node[key] = pick(rng, ODD)
    elif way == 2:
        node[key] = [child]
    elif way == 3 and isinstance(child, list):
        node[key] = child[: len(child) // 2] if rng.random() < 0.5 else child + copy.deepcopy(child[-1:])
    elif way == 4 and isinstance(node, dict):
        node[f"{key}_"] = node.pop(key)
    elif isinstance(child, float | int) and not isinstance(child, bool):
        node[key] = number(rng, child)
    else:
        node[key] = str(child)
    return f"structure at {path}: {way}"


OF_TRAJECTORIES: dict[str, tuple[float, Callable[[Rng, Data], str]]] = {
    "parameter": (2.0, parameter),
    "case": (5.0, case_field),
    "variables": (1.0, variables),
    "durations": (2.0, durations),
    "control points": (2.0, points),
    "joints": (0.5, joints),
    "agreeing": (1.5, agreeing),
    "rebuilt": (2.5, rebuilt),
    "harmless": (1.5, harmless),
    "structure": (2.0, structure),
}
