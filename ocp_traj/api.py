"""What most users call: solve, pareto and payload, the solvers composed with sensible defaults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ocp_traj import problems
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.fixed_states import fixed_conflicts
from ocp_traj.front import Front
from ocp_traj.nlp import Solution, Status
from ocp_traj.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.scalarise import Scalarisation, WeightedSum, check_names
from ocp_traj.solvers.by_parts import solve_by_parts
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_tracer import FrontTracer
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.solvers.pareto_set import FrontMethod
from ocp_traj.solvers.payload import LargestPayload, along, static_bound, within
from ocp_traj.solvers.repair import slow_down
from ocp_traj.trajectory import Trajectory

METHODS = ("trace", "nsga2")


def scalarisation(problem: Problem, objective: str | None, weights: Mapping[str, float] | None) -> Scalarisation:
    """One objective, a weighted sum of several, or the problem's own default."""
    if objective is not None and weights:
        raise InputError("give an objective or weights, not both")
    chosen = WeightedSum(weights if weights else {problem.default_objective if objective is None else objective: 1.0})
    check_names(problem, chosen)
    return chosen


def solve(
    problem: Problem,
    *,
    objective: str | None = None,
    weights: Mapping[str, float] | None = None,
    starts: int = 1,
    seed: int = 0,
    solver: Exchange | None = None,
    progress: Progress = silent,
) -> Solution:
    """Solves a problem for one objective or a weighted sum, and proves the result.

    Args:
        problem: from ``ocp_traj.problems.load``.
        objective: id of one objective; the problem's default if neither this nor weights are given.
        weights: {objective: weight}; what is minimised is sum_k w_k f_k / scale_k.
        starts: random starts.
        seed: of the starts.
        solver: of each start.
        progress: told how far it is.

    Returns:
        The best solution, with trajectory, objectives and audit; infeasible ones name the limits in conflict. A problem
        with a ``decomposition`` is solved by its parts: what they combine to may break limits of the whole.
    """
    if starts < 1:
        raise InputError(f"starts is {starts}; give one or more")
    scalar = scalarisation(problem, objective, weights)
    conflicts = fixed_conflicts(problem)
    if conflicts:
        # Broken where nothing can be changed: no solver needs to try.
        nothing = np.full(problem.size, np.nan)
        return Solution(
            problem.id, nothing, np.nan, Status.INFEASIBLE, conflicts[0].excess / conflicts[0].row.scale, 0, 0.0,
            conflicts=conflicts, detail="broken at an end, whatever the variables",
        )  # fmt: skip
    if problem.decomposition is not None:
        return solve_by_parts(problem, scalar, Multistart(solver or Exchange(), starts, seed, progress))
    one_start = solver or Exchange(progress=progress if starts == 1 else silent)
    return Multistart(one_start, starts, seed, progress if starts > 1 else silent).solve(problem, scalar)


def front_method(method: str, *, points: int, seed: int, progress: Progress, **options: Any) -> FrontMethod:
    """The front method of a name; ``options`` are fields of its class."""
    if method == "trace":
        return FrontTracer(points=points, seed=seed, progress=progress, **options)
    if method == "nsga2":
        return NSGA2(seed=seed, progress=progress, **options)
    raise InputError(f"there is no method {method!r}; methods are {', '.join(METHODS)}")


def pareto(
    problem: Problem,
    objectives: Sequence[str],
    *,
    method: str = "trace",
    points: int = 40,
    seed: int = 0,
    budget: float | None = None,
    keep_unproved: bool = False,
    progress: Progress = silent,
    **options: Any,
) -> Front:
    """Approximates a Pareto front, and proves every point of it.

    Args:
        problem: from ``ocp_traj.problems.load``.
        objectives: two or more ids.
        method: ``trace`` or ``nsga2``.
        points: how many the tracer looks for.
        seed: of everything random.
        budget: stop after this time [s] with what is there.
        keep_unproved: whether points stay that are not proved, even slowed down.
        progress: told how far it is.
        options: fields of the method's class, such as ``population``.

    Returns:
        The front: proved, non-dominated points.
    """
    if len(objectives) < 2 or len(set(objectives)) != len(objectives):
        raise InputError(f"a front trades two or more different objectives; got {', '.join(objectives) or 'none'}")
    for name in objectives:
        problem.objective(name)
    if problem.decomposition is not None:
        raise InputError(f"{problem.id} is solved by parts in this case, which gives one trajectory and no front")
    if budget is not None:
        if not budget > 0.0:
            raise InputError(f"the budget is {budget} s; give a time above zero")
        options["max_seconds"] = budget
    chosen = front_method(method, points=points, seed=seed, progress=progress, **options)
    conflicts = fixed_conflicts(problem)
    if conflicts:
        raise NoSolutionFound(
            f"{problem.id}: no trajectory meets these limits together: {'; '.join(map(str, conflicts))}"
        )
    found = chosen.pareto(problem, objectives)
    xs, _ = slow_down(problem, found.xs)
    info = {**found.info, "interrupted": found.interrupted}
    return Front.of(
        problem, tuple(objectives), xs,
        method=found.method, seed=found.seed, seconds=found.seconds, info=info, keep_unproved=keep_unproved,
    )  # fmt: skip


def payload(
    problem: Problem,
    *,
    trajectory: Trajectory | None = None,
    max_time: float | None = None,
    starts: int = 2,
    seed: int = 0,
    progress: Progress = silent,
) -> LargestPayload:
    """The largest payload: for every time law, along a trajectory, or of all trajectories within a time [s]."""
    if trajectory is not None and max_time is not None:
        raise InputError("give a trajectory or a time, not both")
    if trajectory is not None:
        return along(problem, trajectory)
    if max_time is not None:
        case = {name: getattr(problem.case, name) for name in problem.case.__dataclass_fields__}
        free = problems.load(problem.id, **{**case, "free_payload": True})
        return within(free, max_time, Multistart(Exchange(), starts, seed, progress))
    return static_bound(problem)
