"""Which workers a number and an address mean."""

from __future__ import annotations

from collections.abc import Mapping

from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.job import Answer
from ocp_traj.parallel.processes import Processes
from ocp_traj.parallel.recipe import Recipe
from ocp_traj.parallel.workers import Workers


def workers_for(
    problem: Problem, count: int = 0, cluster: str | None = None, known: Mapping[str, Answer] | None = None
) -> Workers:
    """Workers for a problem, to be closed: this process, some of this machine, or a Dask cluster that is running.

    Args:
        problem: that they are to build again; refused where they cannot.
        count: processes of this machine; 0 for this one alone.
        cluster: address of a Dask scheduler, in place of them.
        known: answers that need no work, by the key of their job.
    """
    if count < 0:
        raise InputError(f"workers is {count}; give 0, for this process alone, or more")
    if count and cluster is not None:
        raise InputError("give a number of workers or a cluster, not both")
    if not count and cluster is None:
        return Workers(known)
    for own in (problem, *problem.alternatives.values()):
        Recipe.of(own)
    if cluster is None:
        return Processes(count, known)
    from ocp_traj.parallel.cluster import Cluster  # Dask is an extra

    return Cluster(cluster, known)
