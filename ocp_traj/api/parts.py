"""Problems that a paper solves by parts, such as joint by joint."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ocp_traj.errors import InputError, quoted
from ocp_traj.formulation.problem import Decomposition, Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.results.histories import histories
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import largest_excess
from ocp_traj.results.trajectory import audit_points
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives


def by_parts(
    problem: Problem, recipe: Decomposition, scalar: Scalarisation, solve: Callable[[Problem], Solution]
) -> Solution:
    """Parts solved alone and put together: the audit says what that is worth."""
    begun = time.perf_counter()
    parts: list[Solution] = []
    for part in recipe.parts:
        known = [o.id for o in part.objectives]
        for name in scalar.names:
            if name not in known:
                raise InputError(
                    f"{problem.id} is solved by parts here, and {part.about.title!r} has no objective {quoted(name)}; "
                    f"it has {', '.join(known)}"
                )
        solution = solve(part)
        if not solution.ok:
            return replace(solution, name=part.about.title, seconds=time.perf_counter() - begun)
        parts.append(solution)
    x = np.clip(recipe.combine([part.x for part in parts]), problem.lower, problem.upper)
    candidate, found = audit_points(problem, [x])[0]
    values = evaluate_objectives(problem, x)
    return Solution(
        name=problem.id,
        x=x,
        f=float(sum(w * values[n] / problem.objective(n).scale for n, w in getattr(scalar, "weights", {}).items())),
        status=Status.FEASIBLE if found.proved else Status.UNPROVED,
        violation=0.0 if found.proved else largest_excess(problem, found),
        iterations=sum(part.iterations for part in parts),
        seconds=time.perf_counter() - begun,
        objectives=values,
        trajectory=candidate,
        audit=found,
        detail=f"{len(parts)} parts solved alone and put together: not an optimum of the whole",
        interrupted="; ".join(f"{p.interrupted} of {p.name}" for p in parts if p.interrupted),
        history=histories({p.about.title: s.history for p, s in zip(recipe.parts, parts, strict=True)}),
    )
