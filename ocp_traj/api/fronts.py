"""``pareto``: a front by the method asked for, every point of it proved; and what bounds what it leaves out."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ocp_traj.api.solving import scalarisation
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, NoSolutionFound, cut
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.store import Run, request
from ocp_traj.parallel.choice import workers_for
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.verdicts import PROVED
from ocp_traj.results.alternatives import merged_front
from ocp_traj.results.front import Front, Point
from ocp_traj.results.pareto_set import ENDED_AFTER, proved_front
from ocp_traj.results.records import KEY, Found, Record, ignore
from ocp_traj.solvers import methods
from ocp_traj.solvers.by_levels import ByLevels, finest
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_certifier import FrontCertifier, require_front_certifiable
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.protocols import FrontMethod
from ocp_traj.stopping import current, stopping
from ocp_traj.transcription.end_states import fixed_conflicts

WORTHWHILE = 0.1  # of a budget: with less left no alternative goes on; our choice


@one_blas_thread
def pareto(
    problem: Problem,
    objectives: Sequence[str],
    *,
    method: str = "trace",
    seed: int = 0,
    budget: float | None = None,
    keep_unproved: bool = False,
    certify: bool = False,
    output: str | Path | None = None,
    force: bool = False,
    found: Found = ignore,
    progress: Progress = silent,
    workers: int | Workers = 0,
    cluster: str | None = None,
    **options: Any,
) -> Front:
    """Approximates a Pareto front, and proves every point of it.

    Args:
        problem: from ``ocp_traj.problems.load``.
        objectives: two or more ids.
        method: one of ``solvers.methods.FRONT``.
        seed: of everything random.
        budget: stop after this time [s] with what is there; to prove that takes a little longer.
        keep_unproved: whether points stay that are not proved, even slowed down.
        certify: whether to bound what the front leaves out; see ``certify_front``. Refused at once where it cannot be.
        output: folder to write the run to, as ``ocp-traj pareto -o`` does: what is finished is on the disk at once.
        force: whether a run that is there is replaced.
        found: given a record of each finished solve, or of a population now and then.
        progress: told how far it is.
        workers: processes of this machine that solve; the front does not depend on how many, unless a budget ends it.
        cluster: address of a Dask scheduler whose workers solve, in place of them.
        options: fields of the method's class, such as ``points`` of trace and ``population`` of nsga2.

    Returns:
        The front: proved, non-dominated points. Ctrl-C ends it early with those it has, within the time of an iteration
        of IPOPT or of a generation: then ``front.info["interrupted"]`` is true, and ``front.info["ended after"]`` says
        what was done of how much, as it does where the budget was too small.
    """
    if not isinstance(workers, Workers):
        with workers_for(problem, workers, cluster) as chosen:
            return pareto(
                problem, objectives, method=method, seed=seed, budget=budget, keep_unproved=keep_unproved,
                certify=certify, output=output, force=force, found=found, progress=progress, workers=chosen, **options,
            )  # fmt: skip
    if certify:
        require_front_certifiable(problem, objectives)
    run = partial(
        _pareto, problem, objectives, method=method, seed=seed, budget=budget, keep_unproved=keep_unproved,
        progress=progress, workers=workers, **options,
    )  # fmt: skip
    with stopping():
        if output is None:
            front = run(found=found)
            return certify_front(front, progress=progress) if certify and not current().interrupted else front
        asked = request(
            problem,
            objectives,
            method,
            seed=seed,
            budget=budget,
            keep_unproved=keep_unproved,
            certify=certify,
            options=options,
        )
        with Run(output, asked, force=force) as kept:

            def keep(record: Record) -> None:
                kept.found(record)
                found(record)

            front = run(found=keep)
            if certify and len(front) and not current().interrupted:
                front = certify_front(front, progress=progress)
            if len(front):
                kept.finish(front)
            else:
                kept.discard()
        return front


def certify_front(
    front: Front, *, reference: Point | None = None, tolerance: float = 0.01, max_seconds: float = 60.0,
    progress: Progress = silent,
) -> Front:  # fmt: skip
    """The front with ``front.certificate``: a lower staircase that no trajectory is below, and the gap to its points.

    Where ``BranchAndBound`` applies, for an objective that grows with time and one that does not, each a power of time.

    Args:
        front: whose proved points count, as many as there are and nothing between them.
        reference: worst values worth having, per objective; by default the problem's reference point.
        tolerance: gap, as a share of the hypervolume above the lower staircase, that counts as certified.
        max_seconds: stop after this time, with what holds by then.
        progress: told after each pass.
    """
    return FrontCertifier(tolerance, max_seconds=max_seconds, progress=progress).certify(front, reference)


def _pareto(
    problem: Problem, objectives: Sequence[str], *, method: str, seed: int, budget: float | None, keep_unproved: bool,
    found: Found, progress: Progress, workers: Workers, **options: Any,
) -> Front:  # fmt: skip
    if len(objectives) < 2 or len(set(objectives)) != len(objectives):
        raise InputError(f"a front trades two or more different objectives; got {cut(', '.join(objectives)) or 'none'}")
    for name in objectives:
        problem.objective(name)
    if problem.decomposition is not None:
        raise InputError(f"{problem.id} is solved by parts in this case, which gives one trajectory and no front")
    if budget is not None:
        if not budget > 0.0:
            raise InputError(f"the budget is {budget} s; give a time above zero")
        options["max_seconds"] = budget
    if problem.alternatives:
        options.pop("max_seconds", None)
        return _merged_front(
            problem,
            {
                name: partial(
                    pareto, alternative, objectives, method=method, seed=seed, keep_unproved=keep_unproved,
                    found=partial(_of_alternative, found, workers, name), progress=progress, workers=workers, **options,
                )
                for name, alternative in problem.alternatives.items()
            },
            budget,
            compared=method == "trace",
        )  # fmt: skip
    options |= methods.workers_option(methods.FRONT, method, workers)
    chosen: FrontMethod = methods.configured(
        methods.FRONT, method, seed=seed, progress=progress, found=found, **options
    )
    conflicts = fixed_conflicts(problem)
    if conflicts:
        raise NoSolutionFound(
            f"{problem.id}: no trajectory meets these limits together: {'; '.join(map(str, conflicts))}"
        )
    if method == "trace" and problem.levels is not None and problem.levels.finer is not None:
        # All points share one discretisation: the one that the default objective gains by.
        many = Multistart(Exchange(), max(2, problem.tuning.starts), seed, workers=workers, found=found)
        problem = finest(problem, ByLevels(many, progress=progress).solve(problem, scalarisation(problem, None, None)))
    xs = chosen.pareto(problem, objectives)
    interrupted = current().tell()
    if not xs.xs and not interrupted:
        within = "" if budget is None else " within its budget; give it more"
        raise NoSolutionFound(f"{problem.id}: {method} found no point{within}")
    return proved_front(problem, objectives, replace(xs, interrupted=interrupted), keep_unproved)


def _of_alternative(found: Found, workers: Workers, name: str, record: Record) -> None:
    """Tells of a record, and remembers what it answers, for an alternative that goes on later."""
    if key := record.get(KEY):
        workers.known.setdefault(key, record)
    found({**record, "alternative": name})


def _merged_front(
    problem: Problem, runs: Mapping[str, Callable[..., Front]], budget: float | None, compared: bool
) -> Front:
    """The front of all alternatives; ``info`` says what each has given.

    Each gets a share of what the ones before it have left of the budget: an even one, or, where its method compares
    itself with their points, twice that of a later one. What is left in the end goes to those that were stopped, the
    one with most points first.
    """
    fronts: dict[str, Front] = {}
    reasons: list[NoSolutionFound] = []
    begun, stop = time.perf_counter(), current()

    def left() -> float | None:
        return None if budget is None else max(budget - (time.perf_counter() - begun), 1e-3)

    def go(name: str, seconds: float | None) -> None:
        points = [point for other, front in fronts.items() if other != name for point in front.points]
        known = [point.objectives for point in points if point.verdict == PROVED]
        try:
            front = runs[name](budget=seconds, **({"beside": known} if compared else {}))
        except NoSolutionFound as error:
            reasons.append(error)
        else:
            if name not in fronts or len(front) >= len(fronts[name]):
                fronts[name] = front

    for number, name in enumerate(runs):
        rest = left()
        after = len(runs) - number - 1
        # Of those that are compared a later one often ends with its ends.
        go(name, rest if rest is None else rest / (1 + (0.5 * after if compared else after)))
        if stop.interrupted:
            break
    stopped = [name for name, front in fronts.items() if ENDED_AFTER in front.info]
    for name in sorted(stopped, key=lambda name: -len(fronts[name])) if compared else ():
        rest = left()
        if budget is not None and rest is not None and rest > WORTHWHILE * budget and not stop.interrupted:
            go(name, rest)
    if not fronts:
        stop.check()
        raise reasons[0]
    best = merged_front(problem, fronts, runs)
    ended = [f"{front.info[ENDED_AFTER]} of {name}" for name, front in fronts.items() if ENDED_AFTER in front.info]
    ended += [f"nothing of {name}" for name in runs if name not in fronts and stop.interrupted]
    info = {**best.info, "interrupted": stop.tell()}
    return replace(best, info={**info, ENDED_AFTER: ", ".join(ended)} if ended else info)
