"""Fronts on the command line: found, written, shown, and what is said of how they ended."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ocp_traj.api.fronts import certify_front, pareto
from ocp_traj.cli import console, sheets
from ocp_traj.errors import OcpTrajError
from ocp_traj.results.pareto_set import ENDED_AFTER

if TYPE_CHECKING:
    from ocp_traj.formulation.problem import Problem
    from ocp_traj.io.resume import Resumed
    from ocp_traj.io.store import Run
    from ocp_traj.parallel.workers import Workers
    from ocp_traj.stopping import Stopping

DONE, NOT_PROVED = 0, 1


def trace(
    problem: Problem, asked: Mapping[str, Any], kept: Run, workers: Workers, stop: Stopping, json: bool,
    budget: float | None = None,
) -> int:  # fmt: skip
    """Finds the front that a request asks for, into its run; the exit code.

    Args:
        problem: whose front.
        asked: a ``request``.
        kept: the run.
        workers: who solve.
        stop: the block in which Ctrl-C is noted.
        json: whether to print JSON.
        budget: what is left of the one that was asked for [s].
    """
    method, limit = asked["method"], budget if budget is not None else asked["budget"]
    try:
        with console.progress(method) as progress:
            front = pareto(
                problem, asked["objectives"], method=method, seed=asked["seed"], budget=limit,
                keep_unproved=asked["keep_unproved"], found=kept.found, progress=progress, workers=workers,
                **asked["options"],
            )  # fmt: skip
        reference, ideal = asked.get("corners", (None, None))
        if asked.get("certify") and len(front) and not stop.interrupted:
            with console.progress("certifying") as progress:
                front = certify_front(front, reference=reference, progress=progress)
        if len(front):
            volume = front.hypervolume(reference, ideal)
            folder = kept.finish(front, volume)
        else:
            kept.discard()
    except (OcpTrajError, KeyboardInterrupt):
        if kept.holds_points:
            console.say(f"what was found until then is kept: {kept.folder}")
        raise
    if not len(front):
        if stop.interrupted:
            return console.interrupted("before the first point was found; nothing is written")
        console.say(
            f"{problem.id}: {method} found no proved point ({front.info['dropped']}); --keep-unproved keeps the others"
        )
        return NOT_PROVED
    console.show(sheets.front_sheet(front, volume, folder), json)
    for words in sheets.front_remarks(front):
        console.say(words)
    if workers.answered:
        console.say(f"{workers.answered} finished solves were in its journal")
    console.say(f"run: {folder}\npicture: {folder / 'front.png'}")
    ended = front.info.get(ENDED_AFTER, "")
    if stop.interrupted:
        return console.interrupted(f"after {ended}" if ended else "")
    if ended:
        console.say(f"the budget ended it after {ended}")
    return NOT_PROVED if front.info.get("moved") is False else DONE


def say_of(found: Resumed) -> None:
    """Says what a run is gone on with."""
    if found.other_versions:
        words = ", ".join(f"{name} {version}" for name, version in found.other_versions.items())
        console.say(f"it was begun with {words}: what that has finished is done again")
    if found.budget is not None:
        console.say(f"{found.budget:.4g} s of its budget are left; where that ends it depends on the machine")
