"""``payload``: the largest one that can be carried."""

from __future__ import annotations

from ocp_traj import problems
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.task import Task
from ocp_traj.progress import Progress, silent
from ocp_traj.results.trajectory import Trajectory, case_fields
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.payload import OBJECTIVE as PAYLOAD_MASS
from ocp_traj.solvers.payload import LargestPayload, along, static_bound, within


def _with_free_payload(problem: Problem) -> Problem:
    """The problem with its payload among its variables and its objectives."""
    if any(objective.id == PAYLOAD_MASS for objective in problem.objectives):
        return problem
    if problem.id not in problems.names() and not isinstance(problem.case, Task):
        raise InputError(
            f"{problem.id} has no objective {PAYLOAD_MASS!r}: give it the payload as a variable and as that objective"
        )
    return problems.load(problem.id, **{**case_fields(problem), "free_payload": True})


@one_blas_thread
def payload(
    problem: Problem,
    *,
    trajectory: Trajectory | None = None,
    max_time: float | None = None,
    starts: int = 2,
    seed: int = 0,
    progress: Progress = silent,
) -> LargestPayload:
    """The largest payload: for every time law, along a trajectory, or of all trajectories within a time [s].

    Ctrl-C raises ``KeyboardInterrupt``, unless a start of the last has ended: then the best so far is returned, and
    ``found.solution.interrupted`` says so.
    """
    if trajectory is not None and max_time is not None:
        raise InputError("give a trajectory or a time, not both")
    if trajectory is not None:
        return along(problem, trajectory)
    if max_time is not None:
        return within(_with_free_payload(problem), max_time, Multistart(Exchange(), starts, seed), progress)
    return static_bound(problem)
