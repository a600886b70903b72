"""IPOPT through CasADi: local solves of an ``NLP``, warm starts, and a word on why a problem is infeasible.

Waechter and Biegler (2006), Mathematical Programming 106(1). Of the linear solvers in CasADi's wheels, ``mumps`` and
``spral`` work; the others are refused, for they fail late or end the process.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.rows import Conflict
from ocp_traj.solvers.nlpsol import numeric_solver, raise_failures
from ocp_traj.stopping import current, stopping
from ocp_traj.transcription.elastic import Elastic
from ocp_traj.transcription.nlp import NLP, NLPResult, Status

LINEAR_SOLVERS = ("mumps", "spral")
TINY = 1e-3  # an objective below this, and below this share of the variables' size: our choice

_PUSHES = (
    "warm_start_bound_push", "warm_start_bound_frac", "warm_start_slack_bound_push", "warm_start_slack_bound_frac",
    "warm_start_mult_bound_push",
)  # fmt: skip

# IPOPT's return status, complete (IpReturnCodes_inc.h); an unknown one is FAILED, never SOLVED.
_STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.ACCEPTABLE,
    "Feasible_Point_Found": Status.FEASIBLE,
    "Infeasible_Problem_Detected": Status.LOCALLY_INFEASIBLE,
    "Search_Direction_Becomes_Too_Small": Status.FAILED,
    "Diverging_Iterates": Status.UNBOUNDED,
    "User_Requested_Stop": Status.INTERRUPTED,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "Restoration_Failed": Status.FAILED,
    "Error_In_Step_Computation": Status.FAILED,
    "Not_Enough_Degrees_Of_Freedom": Status.FAILED,
    "Invalid_Problem_Definition": Status.FAILED,
    "Invalid_Option": Status.FAILED,
    "Invalid_Number_Detected": Status.FAILED,
    "Unrecoverable_Exception": Status.FAILED,
    "NonIpopt_Exception_Thrown": Status.FAILED,
    "Insufficient_Memory": Status.FAILED,
    "Internal_Error": Status.FAILED,
}

# Of rows, in their scales: within the back-off of limits (transcription.BACK_OFF), so that what ends can be proved.
VIOLATED = 1e-9
# Our choice; IPOPT's own are 0.1, 0.01 and 0.01.
_NARROW = {"mu_init": 1e-6, "bound_push": 1e-8, "bound_frac": 1e-8}


class _AfterIteration(casadi.Callback):
    """Called by IPOPT after each iteration, which it ends where the work should end; takes some 0.1 ms."""

    def __init__(self) -> None:
        casadi.Callback.__init__(self)
        self.construct("after_iteration", {})

    def get_n_in(self) -> int:
        return int(casadi.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        return casadi.Sparsity(0, 0)  # the iterate is not looked at, so nothing is copied

    def eval(self, arguments: Any) -> list[float]:
        return [float(current().due)]


_AFTER_ITERATION = _AfterIteration()  # CasADi does not keep it alive
# CasADi lets other threads run meanwhile, and the MUMPS of its wheels does not say that it is made for several.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Ipopt:
    """IPOPT with exact Hessians.

    Attributes:
        tol: scaled KKT error. The last digits of a finer one cost: with 1e-10 the front of 40 points of
            ``hybrid-spline`` takes 393 iterations instead of 273, and where limits rest on many control points twice as
            many. Rows have to hold within ``VIOLATED`` in any case.
        max_iter: iterations.
        max_seconds: wall time.
        linear_solver: of ``LINEAR_SOLVERS``.
        feasibility: scaled violation up to which a point counts as feasible, whatever IPOPT says.
        options: further IPOPT options, by their own names.
        explain: whether limits in conflict are looked for where it ends infeasible, which takes some solves.
    """

    tol: float = 1e-8
    max_iter: int = 500
    max_seconds: float = 600.0
    linear_solver: str = "mumps"
    feasibility: float = 1e-7
    options: Mapping[str, Any] = field(default_factory=dict)
    explain: bool = True

    def __post_init__(self) -> None:
        """Checks the linear solver."""
        if self.linear_solver not in LINEAR_SOLVERS:
            raise InputError(f"linear solver {self.linear_solver!r}; allowed are {', '.join(LINEAR_SOLVERS)}")

    def limited(self, iterations: int) -> Ipopt:
        """The same with at most so many iterations."""
        return replace(self, max_iter=min(self.max_iter, iterations))

    def near_start(self) -> Ipopt:
        """The same with a narrow barrier, which ends in an optimum near its start; the usual one leads across."""
        return replace(self, options={**_NARROW, **self.options})

    @classmethod
    def rough(cls, accuracy: float, iterations: int) -> Ipopt:
        """For few iterations from a start that keeps the limits: a low barrier, rows no finer than the accuracy."""
        options = {"mu_init": accuracy, "constr_viol_tol": accuracy, "acceptable_tol": 10.0 * accuracy}
        return cls(tol=accuracy, max_iter=iterations, options=options, explain=False)

    @one_blas_thread
    def solve(self, nlp: NLP, x0: Array, warm: NLPResult | None = None) -> NLPResult:
        """Solves an NLP from ``x0 (n,)``; Ctrl-C raises ``KeyboardInterrupt`` after the iteration it comes in.

        Args:
            nlp: the problem.
            x0: starting point; clipped into the bounds.
            warm: an earlier solution of a like NLP; its multipliers are matched row by row.

        Returns:
            A solution, which says so if there is none; ``conflicts`` are found where IPOPT ends infeasible.
        """
        begun = time.perf_counter()
        solution = self._run(nlp, np.clip(x0, nlp.lower_x, nlp.upper_x), warm, begun)
        size = abs(solution.f) / max(float(np.abs(solution.x).max(initial=0.0)), 1e-300)
        # The tolerance is absolute: an objective this small needs a finer one.
        if solution.ok and 0.0 < max(size, abs(solution.f)) < TINY:
            scaled = replace(self, options={**self.options, "obj_scaling_factor": 1.0 / size})
            finer = scaled._run(nlp, solution.x, None, begun)
            if finer.ok and finer.f <= solution.f:
                solution = replace(finer, iterations=solution.iterations + finer.iterations)
        if solution.status is Status.LOCALLY_INFEASIBLE and self.explain:
            return replace(solution, conflicts=self.conflicts(nlp, solution.x), seconds=time.perf_counter() - begun)
        return solution

    def _settings(self, warm: bool, wanted: Mapping[str, Any]) -> dict[str, Any]:
        settings: dict[str, Any] = {
            "print_level": 0,
            "sb": "yes",
            "tol": self.tol,
            "constr_viol_tol": min(VIOLATED, self.tol),
            "acceptable_tol": max(1e-6, self.tol),
            "max_iter": self.max_iter,
            "max_wall_time": self.max_seconds,
            "linear_solver": self.linear_solver,
            "bound_relax_factor": 0.0,
            "fixed_variable_treatment": "make_parameter",
        }
        if warm:
            # Measured: from a start this far off its bounds fronts take fewest iterations; where the barrier stays high
            # that holds it off by itself, and more loses what is known.
            target = float(wanted.get("mu_target", 0.0))
            settings |= dict.fromkeys(_PUSHES, 1e-9 if target > 0.0 else 1e-4)
            settings |= {"warm_start_init_point": "yes", "mu_init": max(1e-9, target)}
            if not target:  # the first barrier that a problem wants is that of a cold start
                wanted = {**wanted, "mu_init": max(1e-9, 0.1 * float(wanted.get("tol", self.tol)))}
        return settings | dict(wanted) | dict(self.options)

    def _run(self, nlp: NLP, x0: Array, warm: NLPResult | None, begun: float) -> NLPResult:
        multipliers: dict[str, Array] = {}
        if warm is not None and warm.bound_multipliers is not None and len(warm.bound_multipliers) == len(x0):
            multipliers = {"lam_x0": warm.bound_multipliers, "lam_g0": matched_multipliers(nlp, warm)}
        options: dict[str, Any] = {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,  # of steps that lead to no number: IPOPT takes shorter ones
            "iteration_callback": _AFTER_ITERATION,
            "ipopt": self._settings(bool(multipliers), nlp.options.get("ipopt", {})),
        }
        solver, evaluations = numeric_solver(nlp, "ipopt", options)
        bounds = {"lbx": nlp.lower_x, "ubx": nlp.upper_x, "lbg": nlp.lower_g, "ubg": nlp.upper_g}
        with stopping() as stop:
            stop.check()
            with _ONE_AT_A_TIME:
                result = solver(x0=x0, **bounds, **multipliers)
                stats = solver.stats()
            raise_failures(evaluations)
            if not _STATUS.get(stats["return_status"], Status.FAILED).ok:
                stop.check()  # what ended well is kept, even if time is over
        said, iterations = stats["return_status"], int(stats.get("iter_count", 0))
        status, seconds = _STATUS.get(said, Status.FAILED), time.perf_counter() - begun
        return nlp.result(result, status, self.feasibility, iterations, seconds, f"IPOPT: {said}")

    def conflicts(self, nlp: NLP, x0: Array) -> tuple[Conflict, ...]:
        """The limits that do not hold together, and by how much each has to give at the best point found from here."""
        found = self.least_violation(nlp, x0)
        return () if found is None else found[0].conflicts(found[1])

    def least_violation(self, nlp: NLP, x0: Array) -> tuple[Elastic, NLPResult] | None:
        """The elastic problem and its solution from ``x0 (n,)``; None where there is none, and nothing is known."""
        solver, best, x = Ipopt(1e-8, self.max_iter, self.max_seconds, self.linear_solver), None, x0
        for shared in (True, False, True):
            elastic = Elastic(nlp, shared)
            found = solver._run(elastic.nlp, elastic.start(x), None, time.perf_counter())
            if found.ok:
                best, x = (elastic, found), found.x[: nlp.program.size]
            if shared == found.ok:  # solved as it should be, or not even with amounts of their own
                break
        return best


def matched_multipliers(nlp: NLP, warm: NLPResult) -> Array:
    """Multipliers of an earlier solution for the rows of a new NLP: zero for rows that are new."""
    return np.array([warm.multipliers.get(row, 0.0) for row in nlp.rows])
