"""A certificate of global optimality for the shortest time: interval branch and bound over the ratios of durations.

Where every variable is the duration of a segment and the path depends on their ratios alone, durations x = s (1, z)
move along the same path for every s, and the m-th derivative falls as s^-m. So the shortest time of a given z that
keeps the limits on derivatives is

    T(z) = (1 + sum z) max_i (g_i(u_i; 1, z) / b_i)^(1/m_i)

over all their rows and sides i and all instants u_i: one variable less, and no constraints. Any instant gives a lower
bound of that maximum; the peaks at a box's middle give one that is tight there. Other limits (positions, efforts) are
rows e_j(z, T) <= 0; those that matter at the solution, or at a point that looks better, take part.

A box of ratios, with the times between its bound so far and the best known, is bounded by the largest of

* every row's mean value form phi(c) + grad phi(Z) (Z - c), of phi_i = (1 + sum z)^m g_i / b_i, to the power 1/m;
* the end of the times at which some e_j is positive all over the box;
* the Lagrangian sum lambda_i T_i(z) + (1 - sum lambda_i) T + sum mu_j e_j(z, T), which no feasible time is below, with
  the multipliers of the best solution. Its gradient nearly vanishes there: a bound of second order, without which boxes
  pile up around the optimum.

All of it in outward-rounded intervals (``tape``); Moore, Kearfott and Cloud, *Introduction to Interval
Analysis* (2009), chapters 6 and 11.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.progress import Progress, silent
from ocp_traj.results.solution import Certificate, Solution
from ocp_traj.solvers.duration_rows import scaling_limits
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.protocols import LocalSolver
from ocp_traj.solvers.ratio_search import Search
from ocp_traj.stopping import STOPS, Stopping, stopping
from ocp_traj.transcription.time_degrees import is_total_time, path_is_of_ratios

RESTARTS = 5  # solves from better points that the search comes upon


@dataclass(frozen=True)
class BranchAndBound:
    """Certifies, or finds, the globally shortest time.

    Attributes:
        tolerance: relative gap between lower and upper bound that counts as certified.
        max_boxes: stop after so many.
        max_seconds: stop after this time.
        solver: local, for the upper bound.
        progress: told after each pass.
    """

    tolerance: float = 1e-6
    max_boxes: int = 200_000
    max_seconds: float = 60.0
    solver: LocalSolver = Exchange()
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the tolerance."""
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(f"the gap that counts as certified is {self.tolerance}; give a number between 0 and 1")

    @one_blas_thread
    def solve(self, problem: Problem, scalarisation: Scalarisation, x0: Array) -> Solution:
        """The shortest time, certified; ``x0`` starts the first local solve."""
        require_certifiable(problem, scalarisation)
        found = self.solver.solve(problem, scalarisation, x0)
        proved = found.audit is not None and found.audit.proved
        return self.improve(problem, scalarisation, found) if proved else found

    @one_blas_thread
    def improve(self, problem: Problem, scalarisation: Scalarisation, solution: Solution) -> Solution:
        """The solution with its certificate, or a better one that the search led to, with its own.

        Ctrl-C ends it early: with the solution so far and, where the search had begun, with what it had proved.
        """
        certificate: Certificate | None = None
        with stopping() as stop:
            try:
                for _ in range(RESTARTS):
                    certificate, better = self.certify(problem, scalarisation, solution, until_better=True)
                    if better is None:
                        return _certified(solution, certificate, stop)
                    again = self.solver.solve(problem, scalarisation, better)
                    if again.audit is None or not again.audit.proved or again.f >= solution.f:
                        break  # the better point led nowhere: the search has to go on beside it
                    solution, certificate = again, None
                certificate, _ = self.certify(problem, scalarisation, solution)
            except STOPS as reason:
                stop.take(reason)
            return _certified(solution, certificate, stop)

    @one_blas_thread
    def certify(
        self, problem: Problem, scalarisation: Scalarisation, solution: Solution, until_better: bool = False
    ) -> tuple[Certificate, Array | None]:
        """Bounds the shortest time from below.

        Args:
            problem: whose variables are durations; see ``Problem.scales_in_time``.
            scalarisation: of the total time alone.
            solution: a proved one: the upper bound.
            until_better: whether to stop at a point that may take less time.

        Returns:
            The certificate, and a decision vector that may lead to less time, if one was come upon.
        """
        require_certifiable(problem, scalarisation)
        if solution.audit is None or not solution.audit.proved:
            raise InputError(
                f"{problem.id}: only a proved solution can be certified; this one is {solution.status.value}"
            )
        begun = time.perf_counter()
        upper = float(np.sum(solution.x)) * (1.0 + problem.size * 2.0**-52)
        search = Search(problem, solution, upper, upper * (1.0 - 0.9 * self.tolerance))
        with stopping(self.max_seconds) as stop:
            while search.open and search.boxes < self.max_boxes and not stop.due:
                search.step()
                lower = search.lower
                self.progress(search.boxes, 0, f"{len(search.low)} boxes open, gap {(upper - lower) / upper:.2e}")
                if until_better and search.better() is not None:
                    break
        lower = min(search.lower, upper)
        certificate = Certificate(
            lower=lower,
            upper=upper,
            certified=bool(upper - lower <= self.tolerance * upper),
            boxes=search.boxes,
            seconds=time.perf_counter() - begun,
            argument="interval branch and bound over ratios of durations",
        )
        return certificate, search.better()


def _certified(solution: Solution, certificate: Certificate | None, stop: Stopping) -> Solution:
    """The solution with its certificate, and a word where Ctrl-C came before that was done."""
    cut_short = stop.tell() and not (certificate is not None and certificate.certified)
    return replace(
        solution, certificate=certificate, interrupted="before its certificate was done" if cut_short else ""
    )


def is_certifiable(problem: Problem, scalarisation: Scalarisation) -> bool:
    """Whether ``BranchAndBound`` applies: time alone, durations alone, limits on derivatives."""
    return _obstacle(problem, scalarisation) is None


def require_certifiable(problem: Problem, scalarisation: Scalarisation) -> None:
    """Raises ``InputError`` where ``BranchAndBound`` does not apply."""
    obstacle = _obstacle(problem, scalarisation)
    if obstacle is not None:
        raise InputError(f"{problem.id} cannot be certified: {obstacle}")


def ratios_obstacle(problem: Problem) -> str | None:
    """Why boxes of ratios of durations say nothing of a problem, if they do not."""
    if not (problem.scales_in_time and path_is_of_ratios(problem)):
        return "its variables are not durations of segments alone"
    if problem.size < 2:
        return "it has one duration, and no ratios of durations to search"
    if not ((problem.lower > 0.0).all() and np.isfinite(problem.upper).all()):
        return "its durations need bounds above zero on both sides"
    if not scaling_limits(problem):
        return "no derivative of its joints is limited"
    return None


def _obstacle(problem: Problem, scalarisation: Scalarisation) -> str | None:
    obstacle = ratios_obstacle(problem)
    if obstacle is not None:
        return obstacle
    names = scalarisation.names
    bounded = getattr(scalarisation, "bounds", None) or getattr(scalarisation, "goals", None)
    objective = problem.objective(names[0])
    if len(names) != 1 or bounded or objective.of_variables is None or objective.sense != "min":
        return f"only the total time alone can be, not {', '.join(names)}"
    if not is_total_time(problem, objective.id):
        return f"only the total time can be, not {objective.id}"
    return None
