"""A problem solved by parts, as some papers do: each part alone, the results put together, and the whole audited.

That is neither optimal for the whole nor always within its limits; what comes out says which limits it breaks.
"""

from __future__ import annotations

import time
from dataclasses import replace

import casadi
import numpy as np

from ocp_traj.audit import audit
from ocp_traj.errors import InputError
from ocp_traj.nlp import Solution, Status
from ocp_traj.problem import Problem
from ocp_traj.progress import silent
from ocp_traj.scalarise import Scalarisation
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.repair import largest_excess
from ocp_traj.symbolic import evaluate_objectives
from ocp_traj.transcription import trajectory, transcribe


def solve_by_parts(problem: Problem, scalarisation: Scalarisation, solver: Multistart) -> Solution:
    """Solves the parts of a problem with a ``decomposition`` and combines them.

    Args:
        problem: the whole.
        scalarisation: of objectives that every part has.
        solver: of each part.

    Returns:
        The combined trajectory with its audit, ``FEASIBLE`` where that proves it and ``UNPROVED`` where not; the first
        part without a solution, if there is one.
    """
    assert problem.decomposition is not None
    begun, parts = time.perf_counter(), problem.decomposition.parts
    for part in parts:
        known = [objective.id for objective in part.objectives]
        for name in scalarisation.names:
            if name not in known:
                raise InputError(
                    f"{problem.id} is solved by parts here, and {part.title!r} has no objective {name!r}; "
                    f"it has {', '.join(known)}"
                )
    quiet = replace(solver, progress=silent)
    solutions = []
    for number, part in enumerate(parts, 1):
        solution = quiet.solve(part, scalarisation)
        if not solution.ok:
            return replace(solution, name=part.title, seconds=time.perf_counter() - begun)
        solutions.append(solution)
        solver.progress(number, len(parts), f"{part.title}: {solution.f:.9g}")
    x = np.asarray(problem.decomposition.combine([solution.x for solution in solutions]), dtype=float)
    nlp = transcribe(problem, scalarisation, ())
    value = float(np.array(casadi.Function("value", [nlp.x], [nlp.f])(x)).item())
    moved = trajectory(problem, x)
    checked = audit(moved, problem.requirements)
    return Solution(
        problem.id,
        x,
        value,
        Status.FEASIBLE if checked.proved else Status.UNPROVED,
        largest_excess(problem, checked),
        sum(solution.iterations for solution in solutions),
        time.perf_counter() - begun,
        objectives=evaluate_objectives(problem, x),
        trajectory=moved,
        audit=checked,
        rounds=sum(solution.rounds for solution in solutions),
        row_count=sum(solution.row_count for solution in solutions),
        detail=f"{len(parts)} parts solved alone and combined: not an optimum of the whole",
    )
