"""An NLP solver of one's own: SciPy's SLSQP in place of IPOPT, with the proof as it is."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import NonlinearConstraint, minimize

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.transcription.nlp import NLP, NLPResult, Status


@dataclass(frozen=True)
class Slsqp:
    """SciPy's SLSQP; it gives no multipliers, and begins every solve anew.

    Attributes:
        max_iter: iterations.
        feasibility: scaled violation up to which a point counts as feasible.
    """

    max_iter: int = 500
    feasibility: float = 1e-8

    def limited(self, iterations: int) -> Slsqp:
        """The same with at most so many iterations."""
        return replace(self, max_iter=min(self.max_iter, iterations))

    def near_start(self) -> Slsqp:
        """The same: its steps are short near an optimum as they are."""
        return self

    def solve(self, nlp: NLP, x0: Array, warm: NLPResult | None = None) -> NLPResult:
        """Solves from ``x0 (n,)``; ``warm`` is of no use to it."""
        begun, program = time.perf_counter(), nlp.program
        row, column = (np.array(index) for index in program.jacobian_sparsity.get_triplet())

        def jacobian(x: Array) -> Array:
            dense = np.zeros((program.rows, program.size))
            dense[row, column] = program.jacobian(x)
            return dense

        rows = NonlinearConstraint(lambda x: program.values(x)[1], nlp.lower_g, nlp.upper_g, jac=jacobian)
        found = minimize(
            lambda x: program.values(x)[0], np.clip(x0, nlp.lower_x, nlp.upper_x), jac=program.gradient, method="SLSQP",
            bounds=list(zip(nlp.lower_x, nlp.upper_x, strict=True)), constraints=[rows],
            options={"maxiter": self.max_iter, "ftol": 1e-12},
        )  # fmt: skip
        x = np.clip(found.x, nlp.lower_x, nlp.upper_x)
        f, g = program.values(x)
        ended = {"x": x, "f": f, "g": g, "lam_g": np.zeros(program.rows), "lam_x": np.zeros(program.size)}
        status = Status.SOLVED if found.success else Status.FAILED  # nlp.result recomputes the violation
        seconds = time.perf_counter() - begun
        return nlp.result(ended, status, self.feasibility, int(found.nit), seconds, f"SLSQP: {found.message}")


if __name__ == "__main__":
    problem = ot.problems.load("hybrid-spline")
    start = problem.guess(np.random.default_rng(0))
    for solver in (Exchange(), Exchange(solver=Slsqp())):
        solution = solver.solve(problem, WeightedSum({"cost": 1.0}), start)
        assert solution.audit is not None
        name, rounds = type(solver.solver).__name__, solution.rounds
        print(f"{name}: cost {solution.f:.6f}, {rounds} rounds, {solution.iterations} iterations")
        print(solution.audit.explain())
