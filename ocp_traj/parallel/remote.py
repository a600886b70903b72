"""What a worker does with a job that comes to it."""

from __future__ import annotations

import pickle
import threading

from ocp_traj.errors import InputError
from ocp_traj.parallel.job import Answer, Job, call
from ocp_traj.parallel.recipe import Recipe

# A problem's caches are not for several threads, and a cluster's worker may have more than one.
_one_at_a_time = threading.Lock()


def pickled(job: Job) -> bytes:
    """A job as it travels; raises ``InputError`` where it cannot, or its problem cannot be built elsewhere."""
    recipe = Recipe.of(job.problem)
    try:
        return pickle.dumps((recipe, job.function, dict(job.arguments), dict(job.hints)))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(f"{job.words}: it cannot be given to a worker: {error}") from error


def do(job: bytes) -> Answer:
    """The answer of a job that this run's own process has sent; its problem is built here, once."""
    recipe, function, arguments, hints = pickle.loads(job)
    with _one_at_a_time:
        return call(function, recipe.build(), arguments, hints)
