"""What a worker does with a job that comes to it."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from ocp_traj.parallel.job import Answer, Job, call
from ocp_traj.parallel.recipe import Recipe

# MUMPS and a problem's caches are not for several threads, and a cluster's worker may have more than one.
_one_at_a_time = threading.Lock()

Sent = tuple[Recipe, str, Mapping[str, Any], Mapping[str, Any]]


def sent(job: Job) -> Sent:
    """A job as it travels; raises ``InputError`` where its problem cannot be built elsewhere."""
    return Recipe.of(job.problem), job.function, job.arguments, job.hints


def do(recipe: Recipe, function: str, arguments: Mapping[str, Any], hints: Mapping[str, Any]) -> Answer:
    """The answer of a job, its problem built here, once."""
    with _one_at_a_time:
        return call(function, recipe.build(), arguments, hints)
