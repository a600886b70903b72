"""What many via points cost: seconds, rows and peak memory, building and proof included.

Time-optimal quintics of a UR5, one piece from each point to the next, limits up to jerk, held at control points, and on
torques.

    python -m benchmarks.via_points [POINTS ..]

Every run has a process of its own, so that its memory is its own; the median of ``REPEAT``.
"""

from __future__ import annotations

import resource
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

import ocp_traj as ot
from tests.quintics import held_at_control_points, quintics, ur5, wander

COUNTS = (10, 100, 1000)
REPEAT = 3


def cost(count: int) -> dict[str, float]:
    """Figures of one run."""
    robot, points = ur5(), wander(count)
    ot.solve(quintics(robot, wander(3), 1))  # imports
    before, begun = _peak(), time.perf_counter()
    found = ot.solve(held_at_control_points(quintics(robot, points, 1)))
    proved = found.audit is not None and found.audit.proved
    return {
        "seconds": time.perf_counter() - begun, "rows": float(found.row_count), "MB": _peak() - before,
        "iterations": float(found.iterations), "rounds": float(found.rounds), "duration": found.f,
        "proved": float(proved),
    }  # fmt: skip


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    """Prints a line a number of points, and how each grows from the one before."""
    counts = [int(argument) for argument in sys.argv[1:]] or COUNTS
    last: dict[str, float] = {}
    for count in counts:
        runs = []
        for _ in range(REPEAT):
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                runs.append(pool.submit(cost, count).result())
        median = {name: float(np.median([run[name] for run in runs])) for name in runs[0]}
        growth = "".join(f", {name} x {median[name] / last[name]:.1f}" for name in ("seconds", "rows", "MB") if last)
        print(
            f"{count} points: " + ", ".join(f"{name} {value:.6g}" for name, value in median.items()) + growth,
            flush=True,
        )
        last = median
    raise SystemExit(last["proved"] != 1.0)


if __name__ == "__main__":
    main()
