"""Time of an individual of a population, and that of its limits alone.

python benchmarks/population.py
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from ocp_traj import problems
from ocp_traj.evolution.population import Population

INDIVIDUALS, REPEATS = 100, 25


def main() -> None:
    """Prints a line a set of objectives."""
    problem = problems.load("hybrid-spline")
    rng = np.random.default_rng(0)
    xs = np.array([problem.guess(rng) for _ in range(INDIVIDUALS)])
    for names in (["time"], ["time", "energy"], ["time", "cost"]):
        population = Population(problem, names)
        population.evaluate(xs)
        times = []
        for _ in range(REPEATS):
            begun = time.process_time()
            population.evaluate(xs)
            times.append(time.process_time() - begun)
        each = 1e6 * statistics.median(times) / INDIVIDUALS
        print(f"{problem.id}, {len(problem.requirements.path_constraints)} limits, {', '.join(names)}: {each:.1f} us")


if __name__ == "__main__":
    main()
