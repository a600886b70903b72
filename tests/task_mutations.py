"""Tasks changed at random: understood, or refused in one line. ``python -m tests.task_mutations [COUNT]``."""

from __future__ import annotations

import copy
import random
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj.errors import InputError
from ocp_traj.formulation.task_file import task_of
from ocp_traj.formulation.task_resolution import resolve
from ocp_traj.problems import task as problem_of_task

EXAMPLES = Path(__file__).parent.parent / "examples" / "tasks"
VALUES: list[Any] = [
    None, True, -1, 0, 1, 7, 2**70, 1e300, 1e-320, -0.0, float("nan"), float("inf"), "", "x", "50 %", "none", "deg", [],
    [1], [[1]], [[1, 2], [3, 4]], [1, [2]], [None] * 6, [0.0] * 6, [1e12] * 6, [[0.0] * 6], [{}], {}, {"a": 1},
    {"mass": 1},
]  # fmt: skip
MORE: dict[str, dict[str, Any]] = {
    "robot": {
        "friction": {"coulomb": [1.0] * 6},
        "tool": {"xyz": [0, 0, 0.1], "rpy": [0, 0, 1]},
        "gravity": [0, 0, -9],
    },
    "limits": {"snap": [1500.0] * 6, "velocity": "50 %"},
    "units": {"angle": "deg"},
    "solve": {"starts": 2},
}


def tasks() -> list[dict[str, Any]]:
    """The examples, and one with more in it."""
    found = [tomllib.loads(file.read_text()) for file in sorted(EXAMPLES.glob("*.toml"))]
    last = copy.deepcopy(found[-1])
    return [*found, last | {name: last.get(name, {}) | table for name, table in MORE.items()}]


def places(data: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The places of all values in plain data."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        yield (*place, key)
        yield from places(value, (*place, key))


def mutated(seed: int) -> dict[str, Any]:
    """A task with one or two changes."""
    rng = random.Random(seed)
    data = copy.deepcopy(rng.choice(tasks()))
    for _ in range(rng.choice((1, 1, 2))):
        known = list(places(data))
        *above, key = rng.choice(known if rng.random() < 0.5 else [place for place in known if len(place) <= 3])
        here: Any = data
        for part in above:
            here = here[part]
        kind = rng.random()
        if kind < 0.2:
            del here[key]
        elif kind < 0.4 and isinstance(here, dict):
            here[f"{key}x"] = copy.deepcopy(rng.choice(VALUES))
        else:
            here[key] = copy.deepcopy(rng.choice(VALUES))
    return data


def outcome(seed: int) -> str:
    """What becomes of a mutated task: "understood", or what it is refused with; anything else is raised."""
    try:
        with np.errstate(all="ignore"):
            problem_of_task.build(resolve(task_of(mutated(seed)), EXAMPLES))
    except InputError as error:
        return str(error)
    return "understood"


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    found = [outcome(seed) for seed in range(count)]
    lines = sum("\n" in words for words in found)
    print(f"{count} mutated tasks: {found.count('understood')} understood, {lines} refused in more than one line")
    sys.exit(lines > 0)
