"""Guo's multi-start SQP as it was: 100 SLSQP starts beside 100 IPOPT starts, on one NLP and from the same points.

    python -m benchmarks.guo_starts [--starts 100] [--convention paper-literal]

Guo et al. (2016), sect. 6, run MATLAB's fmincon (SQP) from 100 random points and give the mean cost. SLSQP is SciPy's.
Both see the same rows at the same few instants with exact gradients; IPOPT has exact second derivatives too, which SQP
of this kind has no use for. A start has converged where its solver says so and the rows hold; what it ends in is proved
or not as it is, since limits are looked at on instants alone. The last line is IPOPT with exchange, as the package has
it. Seconds are of the CPU and without proofs, but for exchange, whose rounds end with one.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import NonlinearConstraint, minimize

from ocp_traj import problems
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.trajectory import audit_points
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.transcription import transcribe

COST = WeightedSum({"cost": 1.0})
CLOSE = 1e-3  # relative: an end this close to the best of all is that optimum; our choice
FEASIBLE = 1e-6  # of a row's scale: excess that is overlooked; our choice
MOST_ITERATIONS = 400  # of SLSQP, MATLAB's default of sqp

Array = NDArray[np.float64]


@dataclass
class Ends:
    """What the starts of a method ended in."""

    method: str
    xs: list[Array] = field(default_factory=list)
    costs: list[float] = field(default_factory=list)
    converged: list[bool] = field(default_factory=list)
    iterations: list[int] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, x: Array, cost: float, converged: bool, iterations: int, seconds: float) -> None:
        """One start."""
        self.xs.append(np.asarray(x))
        self.costs.append(cost)
        self.converged.append(converged)
        self.iterations.append(iterations)
        self.seconds.append(seconds)

    def row(self, problem: Problem, best: float) -> dict[str, object]:
        """Its line of the table; costs are of the starts that converged."""
        kept = np.array(self.costs)[self.converged]
        proved = [
            found.proved
            for _, found in audit_points(problem, [x for x, ok in zip(self.xs, self.converged, strict=True) if ok])
        ]
        return {
            "method": self.method, "starts": len(self.costs), "converged": int(np.sum(self.converged)),
            "proved as found": int(np.sum(proved)),
            "mean cost": float(kept.mean()) if len(kept) else np.nan,
            "best": float(kept.min(initial=np.inf)), "worst": float(kept.max(initial=-np.inf)),
            f"within {CLOSE:.1%}": int(np.sum(kept <= (1.0 + CLOSE) * best)),
            "iterations (median)": float(np.median(self.iterations)),
            "seconds (median)": float(np.median(self.seconds)), "seconds (all)": float(np.sum(self.seconds)),
        }  # fmt: skip


def excess(nlp: NLP, x: Array) -> float:
    """Largest excess of a row or a bound, rows in their scale."""
    g = nlp.program.values(x)[1]
    return float(
        max((nlp.lower_g - g).max(), (g - nlp.upper_g).max(), (nlp.lower_x - x).max(), (x - nlp.upper_x).max())
    )


def slsqp(nlp: NLP) -> Callable[[Array], tuple[Array, float, bool, int]]:
    """SciPy's SLSQP on an NLP: start -> end, cost, whether it converged, iterations."""
    program = nlp.program
    row, column = (np.array(index) for index in program.jacobian_sparsity.get_triplet())

    def jacobian(x: Array) -> Array:
        dense = np.zeros((program.rows, program.size))
        dense[row, column] = program.jacobian(x)
        return dense

    rows = NonlinearConstraint(lambda x: program.values(x)[1], nlp.lower_g, nlp.upper_g, jac=jacobian)
    bounds = list(zip(nlp.lower_x, nlp.upper_x, strict=True))

    def solve(x0: Array) -> tuple[Array, float, bool, int]:
        found = minimize(
            lambda x: program.values(x)[0], x0, jac=program.gradient, method="SLSQP", bounds=bounds, constraints=[rows],
            options={"maxiter": MOST_ITERATIONS, "ftol": 1e-9},
        )  # fmt: skip
        x = np.clip(found.x, nlp.lower_x, nlp.upper_x)
        converged = bool(found.success) and np.isfinite(found.fun) and excess(nlp, x) <= FEASIBLE
        return x, float(program.values(x)[0]), converged, int(found.nit)

    return solve


def compare(starts: int, convention: str) -> pd.DataFrame:
    """The table: a line a method."""
    problem = problems.load("hybrid-spline", convention=convention)
    nlp = transcribe(problem, COST, few_instants(problem), back_off=0.0)
    by_slsqp = slsqp(nlp)
    sqp, ipopt, exchange = Ends("SLSQP"), Ends("IPOPT, the same rows"), Ends("IPOPT with exchange")
    for seed in range(starts):
        x0 = problem.guess(np.random.default_rng([0, seed]))
        begun = time.process_time()
        x, cost, converged, iterations = by_slsqp(x0)
        sqp.add(x, cost, converged, iterations, time.process_time() - begun)
        begun = time.process_time()
        found = Ipopt().solve(nlp, x0)
        fine = found.ok and excess(nlp, found.x) <= FEASIBLE
        ipopt.add(found.x, found.f, fine, found.iterations, time.process_time() - begun)
        begun = time.process_time()
        solution = Exchange().solve(problem, COST, x0)
        proved = solution.audit is not None and solution.audit.proved
        exchange.add(solution.x, solution.f, solution.ok and proved, solution.iterations, time.process_time() - begun)
    best = min(cost for cost, ok in zip(exchange.costs, exchange.converged, strict=True) if ok)
    return pd.DataFrame([ends.row(problem, best) for ends in (sqp, ipopt, exchange)]).set_index("method")


def main() -> None:
    """Prints the table below the paper's own line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--convention", default="paper-literal", choices=("paper-literal", "physical"))
    given = parser.parse_args()
    print("paper: fmincon, 100 random starts, mean cost 3.220; NSGA-II 3.093")
    print(compare(given.starts, given.convention).T.to_string(float_format="{:.6g}".format))


if __name__ == "__main__":
    main()
