"""Constraint exchange beside a uniform grid on the time-optimal hybrid-spline: rows, rounds, seconds, verdict.

Run with ``python benchmarks/exchange.py``. Both start from the same points and are audited alike; seconds are medians.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from statistics import median

import numpy as np
from rich.console import Console
from rich.table import Table

from ocp_traj import problems
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.proof.audit import audit
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import Instant, few_instants, uniform_instants
from ocp_traj.transcription.transcription import transcribe

STARTS = 3


def grid(instants: Sequence[Instant]) -> list[tuple[float, str, int, int]]:
    """One solve on a fixed grid per start: seconds without the audit, verdict, rows, iterations; and the duration."""
    results = []
    for seed in range(STARTS):
        problem = problems.load("hybrid-spline")
        begun = time.perf_counter()
        nlp = transcribe(problem, WeightedSum({"time": 1.0}), instants, back_off=0.0)
        solution = Ipopt().solve(nlp, problem.guess(np.random.default_rng([0, seed])))
        seconds = time.perf_counter() - begun
        checked = audit(trajectory_of(problem, solution.x), problem.requirements)
        results.append((seconds, f"{solution.f:.7f} s, {checked.explain()}", len(nlp.rows), solution.iterations))
    return results


def exchange() -> list[tuple[float, str, int, int, int]]:
    """The same by exchange; its seconds include its audits."""
    results = []
    for seed in range(STARTS):
        problem = problems.load("hybrid-spline")
        begun = time.perf_counter()
        start = problem.guess(np.random.default_rng([0, seed]))
        solution = Exchange().solve(problem, WeightedSum({"time": 1.0}), start)
        seconds = time.perf_counter() - begun
        assert solution.audit is not None
        words = f"{solution.f:.7f} s, {solution.audit.explain()}"
        results.append((seconds, words, solution.row_count, solution.iterations, solution.rounds))
    return results


def main() -> None:
    """Prints the table."""
    problem = problems.load("hybrid-spline")
    exchanged = exchange()
    transcribed = transcribe(problem, WeightedSum({"time": 1.0}), few_instants(problem))
    table = Table(title=f"time-optimal hybrid-spline, {STARTS} starts")
    for name in ("method", "rows", "rounds", "iterations", "seconds (median)", "result"):
        table.add_column(name)
    last = exchanged[0]
    rows = f"{len(transcribed.rows)}, then {last[2]}"
    table.add_row("exchange", rows, str(last[4]), str(last[3]), f"{median(r[0] for r in exchanged):.2f}", last[1])
    for per_segment in (10, 20):
        found = grid(uniform_instants(problem, per_segment))
        first = found[0]
        seconds = f"{median(r[0] for r in found):.2f}"
        table.add_row(f"grid, {per_segment} per interval", str(first[2]), "1", str(first[3]), seconds, first[1])
    Console(width=170).print(table)


if __name__ == "__main__":
    main()
