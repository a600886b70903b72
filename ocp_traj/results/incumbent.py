"""The incumbent: a point that is known and proved, which no solve that begins from it may end worse than."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation, value_of
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import audit_points
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives

BETTER = 1e-6  # relative: an incumbent is better that gains more than this; our choice, 100 x what exchange leaves open


def no_worse_than(
    problem: Problem, scalarisation: Scalarisation, solution: Solution, x: Array, words: str = "the start"
) -> Solution:
    """The solution, or in its place an incumbent ``x (n,)`` that is proved and better.

    The incumbent is audited only if its value is better, or if the solution is not proved. Slacks of objectives that
    take no part are put at their lower bounds. It counts only within the bounds that the scalarisation puts on
    objectives.

    Args:
        problem: whose limits hold.
        scalarisation: what is minimised.
        solution: what a solver ended with.
        x: the incumbent.
        words: what it is, for the solution's ``detail``.
    """
    x = np.where(problem.inactive(scalarisation.names), problem.lower, x)
    if np.array_equal(x, solution.x) or not ((x >= problem.lower) & (x <= problem.upper)).all():
        return solution
    objectives = evaluate_objectives(problem, x)
    value, excess = value_of(problem, scalarisation, objectives)
    if not (np.isfinite(value) and excess <= 0.0):
        return solution
    later = solution.ok and bool(solution.objectives)  # without an audit: it is proved later
    proved = later if solution.audit is None else solution.audit.proved
    if proved:
        ended, _ = value_of(problem, scalarisation, solution.objectives)
        if not value < ended - BETTER * abs(ended):
            return solution
    candidate, checked = audit_points(problem, [x])[0]
    if not checked.proved:
        return solution
    result = f"ended at {solution.f:.9g}" if proved else f"ended without a proof ({solution.status.value})"
    return replace(
        solution,
        x=x,
        f=value,
        status=Status.FEASIBLE,
        violation=0.0,
        multipliers={},
        bound_multipliers=None,
        slacks={},
        conflicts=(),
        objectives=objectives,
        trajectory=candidate,
        audit=checked,
        instead_of=solution.own,
        key="",
        detail=f"{words} is proved and better than what the solver came to, which {result}: {solution.detail}",
    )
