"""What most users call: solve, pareto and payload, the solvers composed with sensible defaults."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj import problems
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, NoSolutionFound, cut, quoted
from ocp_traj.formulation.problem import Decomposition, Problem
from ocp_traj.formulation.scalarise import Scalarisation, WeightedSum, check_names
from ocp_traj.formulation.task import Task
from ocp_traj.io.start_file import earlier_results
from ocp_traj.io.store import Run, request
from ocp_traj.parallel.choice import workers_for
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.alternatives import merged_front
from ocp_traj.results.front import Front, Point
from ocp_traj.results.histories import histories
from ocp_traj.results.limit_gains import limit_gains
from ocp_traj.results.pareto_set import ENDED_AFTER, proved_front
from ocp_traj.results.records import Found, Record, ignore
from ocp_traj.results.solution import Solution
from ocp_traj.results.starts import start_of
from ocp_traj.results.time_scaling import largest_excess
from ocp_traj.results.trajectory import Trajectory, audit_points, case_fields
from ocp_traj.solvers import methods
from ocp_traj.solvers.branch_and_bound import BranchAndBound, is_certifiable, require_certifiable
from ocp_traj.solvers.by_levels import ByLevels, finest
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_certifier import FrontCertifier, require_front_certifiable
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.solvers.payload import OBJECTIVE as PAYLOAD_MASS
from ocp_traj.solvers.payload import LargestPayload, along, static_bound, within
from ocp_traj.solvers.protocols import FrontMethod
from ocp_traj.solvers.runs import best_run
from ocp_traj.stopping import current, stopping
from ocp_traj.transcription.end_states import fixed_conflicts
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives

MOST_DURATIONS = 4  # branch and bound by default up to here: its boxes multiply with every duration; our choice
OPTIMA_STARTS = 30  # random starts when all local optima are asked for: our choice


def scalarisation(problem: Problem, objective: str | None, weights: Mapping[str, float] | None) -> Scalarisation:
    """One objective, a weighted sum of several, or the problem's own default."""
    if objective is not None and weights:
        raise InputError("give an objective or weights, not both")
    chosen = WeightedSum(weights if weights else {problem.default_objective if objective is None else objective: 1.0})
    check_names(problem, chosen)
    return chosen


@one_blas_thread
def solve(
    problem: Problem,
    *,
    objective: str | None = None,
    weights: Mapping[str, float] | None = None,
    method: str = "exchange",
    starts: int | None = None,
    seed: int = 0,
    start: Trajectory | str | Path | None = None,
    all_optima: bool = False,
    solver: Exchange | None = None,
    certify: bool | None = None,
    progress: Progress = silent,
    workers: int | Workers = 0,
    cluster: str | None = None,
    **options: Any,
) -> Solution:
    """Solves a problem for one objective or a weighted sum, and proves the result.

    Args:
        problem: from ``ocp_traj.problems.load``.
        objective: id of one objective; the problem's default if neither this nor weights are given.
        weights: {objective: weight}; what is minimised is sum_k w_k f_k / scale_k.
        method: ``exchange`` (IPOPT, proved optimal to first order), ``pso`` or ``ga`` (the best of a population).
        starts: random starts, or runs of a population, of each alternative of the problem; as many as the problem asks
            for if not given.
        seed: of the starts.
        start: an earlier result to begin from, in place of random starts: a trajectory, its file, or a run folder, the
            best of whose points is taken. It need not keep this problem's limits; a curve of fewer pieces will do.
        all_optima: whether ``solution.optima`` lists every distinct local optimum; ``OPTIMA_STARTS`` if not given.
            Of a problem with levels those of the problem itself: it is not refined, and ``detail`` says so.
        solver: of each start of exchange.
        certify: whether to prove global optimality by branch and bound, and to look for a better optimum where that
            fails; by default where it applies, which is to what exchange finds for the shortest time of few durations.
        progress: told how far it is.
        workers: processes of this machine that solve, each a start; what is found does not depend on how many.
        cluster: address of a Dask scheduler whose workers solve, in place of them.
        options: fields of the method's class, such as ``population`` of ``pso`` and ``ga``.

    Returns:
        The best solution, with trajectory, objectives and audit; one that is infeasible, or locally so from every
        start, names the limits in conflict. A problem with a ``decomposition`` is solved by its parts: what they
        combine to may break limits of the whole. ``solution.alternatives`` holds those of all alternatives, where the
        problem leaves a choice open.

    Raises:
        KeyboardInterrupt: after Ctrl-C before the first start has ended; later on the best so far is returned, and its
            ``interrupted`` says what was left undone. It takes the time of an iteration of IPOPT, or of a generation.
    """
    if not isinstance(workers, Workers):
        with workers_for(problem, workers, cluster) as chosen:
            return solve(
                problem, objective=objective, weights=weights, method=method, starts=starts, seed=seed, start=start,
                all_optima=all_optima, solver=solver, certify=certify, progress=progress, workers=chosen, **options,
            )  # fmt: skip
    with stopping() as stop:
        found = _solve(
            problem, objective=objective, weights=weights, method=method, starts=starts, seed=seed, start=start,
            all_optima=all_optima, solver=solver, certify=certify, progress=progress, workers=workers, **options,
        )  # fmt: skip
        return replace(found, interrupted=found.interrupted or "at its very end") if stop.tell() else found


def _solve(
    problem: Problem, *, objective: str | None, weights: Mapping[str, float] | None, method: str, starts: int | None,
    seed: int, start: Trajectory | str | Path | None, all_optima: bool, solver: Exchange | None, certify: bool | None,
    progress: Progress, workers: Workers, **options: Any,
) -> Solution:  # fmt: skip
    if start is not None:
        _check_start(problem, method, starts, all_optima)
    if starts is None:
        starts = max(problem.tuning.starts, OPTIMA_STARTS if all_optima else 1)
    if starts < 1:
        raise InputError(f"starts is {starts}; give one or more")
    methods.method_class(methods.SOLVE, method)
    scalar = scalarisation(problem, objective, weights)
    if certify:
        require_certifiable(problem, scalar)
    if problem.alternatives:
        solved: dict[str, Solution] = {}
        for name, alternative in problem.alternatives.items():
            try:
                solved[name] = solve(
                    alternative, objective=objective, weights=weights, method=method, starts=starts, seed=seed,
                    all_optima=all_optima, solver=solver, certify=certify, progress=progress, workers=workers,
                    **options,
                )  # fmt: skip
            except KeyboardInterrupt as reason:
                if not solved:
                    raise
                current().take(reason)
                break
        optima = sorted((o for s in solved.values() for o in s.optima), key=lambda o: o.solution.f)
        seconds = sum(s.seconds for s in solved.values())
        started = sum(s.starts for s in solved.values())
        interrupted = ", ".join(f"{s.interrupted} of {name}" for name, s in solved.items() if s.interrupted)
        if len(solved) < len(problem.alternatives):
            left = [name for name in problem.alternatives if name not in solved]
            interrupted = f"{interrupted or 'after ' + ', '.join(solved)}, before {', '.join(left)}"
        return replace(
            best_of(list(solved.values())), alternatives=solved, optima=tuple(optima), seconds=seconds,
            interrupted=interrupted, starts=started, given_up=sum(s.given_up for s in solved.values()),
        )  # fmt: skip
    conflicts = fixed_conflicts(problem)
    if conflicts:
        # Broken where nothing can be changed: no solver needs to try.
        nothing = np.full(problem.size, np.nan)
        return Solution(
            problem.id, nothing, np.nan, Status.INFEASIBLE, conflicts[0].excess / conflicts[0].row.scale, 0, 0.0,
            conflicts=conflicts, detail="broken at an end, whatever the variables", starts=0,
        )  # fmt: skip
    if problem.decomposition is not None:
        # In this process, whatever the workers: parts are no problems that another one could build again by an id.
        return _by_parts(problem, problem.decomposition, objective, weights, method, starts, seed, solver, **options)
    if method != "exchange":
        found = best_run(problem, scalar, method, starts, seed, progress, workers, **options)
    else:
        if solver is not None and options:
            raise InputError(f"give a solver or its options ({', '.join(options)}), not both")
        each, all_ = (progress, silent) if starts == 1 else (silent, progress)
        one_start = solver or methods.configured(methods.SOLVE, method, progress=each, **options)
        many = Multistart(one_start, starts, seed, all_optima, all_, workers)
        if start is not None:
            given = [start] if isinstance(start, Trajectory) else earlier_results(start)
            source = "the trajectory" if isinstance(start, Trajectory) else str(start)
            found = ByLevels(many, progress=all_).solve(problem, scalar, start_of(problem, given, scalar, source))
        else:
            by_levels = problem.levels is not None and not all_optima
            found = (ByLevels(many, progress=all_) if by_levels else many).solve(problem, scalar)
            if problem.levels is not None and all_optima:
                words = f"all optima are of this one level, of {problem.size} variables; no finer one was looked at"
                found = replace(found, detail=f"{found.detail}; {words}")
        problem = finest(problem, found)
        found = replace(found, gains=limit_gains(problem, scalar, found))
    proved = found.audit is not None and found.audit.proved
    default = method == "exchange" and problem.size <= MOST_DURATIONS and is_certifiable(problem, scalar)
    wanted = default if certify is None else certify
    if not (wanted and proved and found.ok) or found.interrupted:
        return found
    judge = BranchAndBound(progress=progress)
    if method == "exchange":
        found = judge.improve(problem, scalar, found)
        return replace(found, gains=limit_gains(problem, scalar, found))
    return replace(found, certificate=judge.certify(problem, scalar, found)[0])


def _check_start(problem: Problem, method: str, starts: int | None, all_optima: bool) -> None:
    """Refuses what does not go with an earlier result to begin from."""
    if method != "exchange":
        raise InputError(f"a start is for the method exchange; {method} makes its own: leave one of them out")
    if starts is not None or all_optima:
        raise InputError(f"give a start or {'all_optima' if starts is None else 'starts'}, not both")
    if problem.decomposition is not None:
        raise InputError(f"{problem.id} is solved by parts in this case, and takes no start; leave it out")
    if problem.alternatives:
        choices = ", ".join(problem.alternatives)
        raise InputError(f"{problem.id} is {choices} in one, and takes no start; give it to one of its alternatives")


def _by_parts(
    problem: Problem, recipe: Decomposition, objective: str | None, weights: Mapping[str, float] | None,
    method: str, starts: int, seed: int, solver: Exchange | None, **options: Any,
) -> Solution:  # fmt: skip
    """Parts solved alone and put together: the audit says what that is worth."""
    begun, scalar = time.perf_counter(), scalarisation(problem, objective, weights)
    parts: list[Solution] = []
    for part in recipe.parts:
        known = [o.id for o in part.objectives]
        for name in scalar.names:
            if name not in known:
                raise InputError(
                    f"{problem.id} is solved by parts here, and {part.about.title!r} has no objective {quoted(name)}; "
                    f"it has {', '.join(known)}"
                )
        solution = solve(
            part, objective=objective, weights=weights, method=method, starts=starts, seed=seed, solver=solver,
            certify=False, **options,
        )  # fmt: skip
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
                    found=partial(_of_alternative, found, name), progress=progress, workers=workers, **options,
                )
                for name, alternative in problem.alternatives.items()
            },
            budget,
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


def _of_alternative(found: Found, name: str, record: Record) -> None:
    found({**record, "alternative": name})


def _merged_front(problem: Problem, runs: Mapping[str, Callable[..., Front]], budget: float | None) -> Front:
    """The front of all alternatives; ``info`` says what each has given.

    Each gets an even share of what the ones before it have left of the budget.
    """
    fronts: dict[str, Front] = {}
    reasons: list[NoSolutionFound] = []
    begun, stop = time.perf_counter(), current()
    for number, (name, run) in enumerate(runs.items()):
        left = None if budget is None else max(budget - (time.perf_counter() - begun), 1e-3) / (len(runs) - number)
        try:
            fronts[name] = run(budget=left)
        except NoSolutionFound as error:
            reasons.append(error)
        if stop.interrupted:
            break
    if not fronts:
        stop.check()
        raise reasons[0]
    best = merged_front(problem, fronts, runs)
    ended = [f"{front.info[ENDED_AFTER]} of {name}" for name, front in fronts.items() if ENDED_AFTER in front.info]
    ended += [f"nothing of {name}" for name in runs if name not in fronts and stop.interrupted]
    info = {**best.info, "interrupted": stop.tell()}
    return replace(best, info={**info, ENDED_AFTER: ", ".join(ended)} if ended else info)


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
