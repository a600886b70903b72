"""What solvers have in common: of a nonlinear program, of a problem from a point, of a problem, of a Pareto front."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.results.pareto_set import ParetoSet
from ocp_traj.results.solution import Solution
from ocp_traj.transcription.nlp import NLP, NLPResult


class NLPSolver(Protocol):
    """A local solver of nonlinear programs, which sees an ``NLP`` and nothing of where it comes from."""

    @property
    def feasibility(self) -> float:
        """Scaled violation up to which a point counts as feasible."""

    def solve(self, nlp: NLP, x0: Array, warm: NLPResult | None = None) -> NLPResult:
        """Solves from ``x0 (n,)``, with the multipliers of a like NLP's solution if given; says so where it fails."""

    def limited(self, iterations: int) -> NLPSolver:
        """The same solver with at most so many iterations."""

    def near_start(self) -> NLPSolver:
        """The same solver, set to end in an optimum near its start."""


class LocalSolver(Protocol):
    """Solves a problem from a starting point."""

    def solve(self, problem: Problem, scalarisation: Scalarisation, x0: Array) -> Solution:
        """An optimum near ``x0 (n,)``, with its trajectory and audit."""


class ProblemSolver(Protocol):
    """Solves a problem, from starting points of its own."""

    def solve(self, problem: Problem, scalarisation: Scalarisation) -> Solution:
        """The best it finds, with its trajectory and audit."""


class FrontMethod(Protocol):
    """Approximates a Pareto set."""

    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """Decision vectors that trade two or more objectives of a problem."""
