"""What a path of many pieces costs: CPU time and memory of building its NLP and of evaluating all it consists of once.

Run with ``python -m benchmarks.pieces [PIECES ..]``: time-optimal quintics of a UR5, two pieces between via points,
limits up to jerk on control points and torques at instants, some of which move. Every length has a process of its own;
an exponent is the slope from the length before in a plot of logarithms, 1 where the cost is linear.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from math import log
from multiprocessing import get_context
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from ocp_traj.blas import one_blas_thread
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.proof.audit import audit
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.shape import shape_of
from ocp_traj.transcription.transcription import BACK_OFF, transcribe
from ocp_traj.transcription.worst_instants import worst_instants
from tests.quintics import quintics, ur5, wander

LENGTHS = (10, 100, 1000)
ITERATIONS = 5


@one_blas_thread
def cost(pieces: int, objective: str) -> dict[str, float]:
    """What a path of so many pieces costs: CPU time of the quickest call, peak memory, and sizes."""
    found: dict[str, float] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        begun = time.process_time()
        value = work()
        found[name] = min(1e3 * (time.process_time() - begun), found.get(name, np.inf))
        return value

    robot, scalar = ur5(), WeightedSum({objective: 1.0})
    before = _peak()
    problem = timed("problem, ms", lambda: quintics(robot, wander(pieces // 2 + 1), 2))
    timed("shape, ms", lambda: shape_of(problem))
    few = few_instants(problem)
    timed("first NLP, ms", lambda: transcribe(problem, scalar, few))
    x = problem.guess(np.random.default_rng(0))
    worst_instants(problem, x, BACK_OFF)
    peaks, _ = timed("scan, ms", lambda: worst_instants(problem, x, BACK_OFF))
    nlp = timed("next NLP, ms", lambda: transcribe(problem, scalar, [*few, *peaks]))
    program, multipliers = nlp.program, np.ones(len(nlp.rows))
    for start in (nlp.start(x + 1e-9 * i) for i in range(4)):
        timed("f and g, ms", lambda start=start: program.values(start))
        timed("gradient, ms", lambda start=start: program.gradient(start))
        timed("Jacobian, ms", lambda start=start: program.jacobian(start))
        timed("Hessian, ms", lambda start=start: program.hessian(start, 1.0, multipliers))
    found["memory, MB"] = _peak() - before
    found["variables"], found["rows"] = program.size, program.rows
    found["nonzeros of Jacobian"], found["of Hessian"] = program.jacobian_sparsity.nnz(), program.hessian_sparsity.nnz()
    solver = Ipopt(max_iter=ITERATIONS)
    result = timed("IPOPT", lambda: solver.solve(nlp, nlp.start(x)))
    found["iteration of IPOPT, ms"] = found.pop("IPOPT") / max(result.iterations, 1)
    slow = trajectory_of(problem, x)
    timed("audit, ms", lambda: audit(slow, problem.requirements))
    return found


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main(lengths: tuple[int, ...]) -> None:
    """Prints a table an objective."""
    for objective in ("time", "energy"):
        found = []
        for pieces in lengths:
            with ProcessPoolExecutor(1, get_context("spawn")) as pool:
                found.append(pool.submit(cost, pieces, objective).result())
        table = Table(title=f"least {objective}, pieces")
        table.add_column("")
        for pieces in lengths:
            table.add_column(str(pieces), justify="right")
        for _ in lengths[1:]:
            table.add_column("exponent", justify="right")
        for name in found[0]:
            values = [max(one[name], 1e-3) for one in found]
            pairs = zip(values, values[1:], lengths, lengths[1:], strict=False)
            exponents = [f"{log(b / a) / log(n / m):.2f}" for a, b, m, n in pairs]
            table.add_row(name, *(f"{value:.4g}" for value in values), *exponents)
        Console(width=120).print(table)


if __name__ == "__main__":
    main(tuple(map(int, sys.argv[1:])) or LENGTHS)
