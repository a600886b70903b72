"""``solve``: one trajectory, by the method asked for, with its proof and, where that can be had, a certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ocp_traj.api.parts import by_parts
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation, WeightedSum, check_names
from ocp_traj.io.start_file import earlier_results
from ocp_traj.parallel.choice import workers_for
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.limit_gains import limit_gains
from ocp_traj.results.solution import Solution
from ocp_traj.results.starts import start_of
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.solvers import methods
from ocp_traj.solvers.branch_and_bound import BranchAndBound, is_certifiable, require_certifiable
from ocp_traj.solvers.by_levels import ByLevels, finest
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.solvers.runs import best_run
from ocp_traj.stopping import current, stopping
from ocp_traj.transcription.end_states import fixed_conflicts
from ocp_traj.transcription.nlp import Status

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
        return _over_alternatives(
            problem, problem.alternatives, objective=objective, weights=weights, method=method, starts=starts,
            seed=seed, all_optima=all_optima, solver=solver, certify=certify, progress=progress, workers=workers,
            **options,
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
        return by_parts(
            problem, problem.decomposition, scalar,
            partial(
                solve, objective=objective, weights=weights, method=method, starts=starts, seed=seed, solver=solver,
                certify=False, **options,
            ),
        )  # fmt: skip
    if method != "exchange":
        found = best_run(problem, scalar, method, starts, seed, progress, workers, **options)
    else:
        many = _multistart(starts, seed, all_optima, solver, progress, workers, **options)
        problem, found = _by_exchange(problem, scalar, many, start)
    return _certified(problem, scalar, method, found, certify, progress)


def _over_alternatives(problem: Problem, alternatives: Mapping[str, Problem], **given: Any) -> Solution:
    """The best of all alternatives of a problem, with those of each."""
    solved: dict[str, Solution] = {}
    for name, alternative in alternatives.items():
        try:
            solved[name] = solve(alternative, **given)
        except KeyboardInterrupt as reason:
            if not solved:
                raise
            current().take(reason)
            break
    optima = sorted((o for s in solved.values() for o in s.optima), key=lambda o: o.solution.f)
    interrupted = ", ".join(f"{s.interrupted} of {name}" for name, s in solved.items() if s.interrupted)
    if len(solved) < len(alternatives):
        left = [name for name in alternatives if name not in solved]
        interrupted = f"{interrupted or 'after ' + ', '.join(solved)}, before {', '.join(left)}"
    return replace(
        best_of(list(solved.values())), alternatives=solved, optima=tuple(optima), interrupted=interrupted,
        seconds=sum(s.seconds for s in solved.values()), starts=sum(s.starts for s in solved.values()),
        given_up=sum(s.given_up for s in solved.values()),
    )  # fmt: skip


def _multistart(
    starts: int, seed: int, all_optima: bool, solver: Exchange | None, progress: Progress, workers: Workers,
    **options: Any,
) -> Multistart:  # fmt: skip
    """The random starts of exchange; of a single one the progress is that of its rounds."""
    if solver is not None and options:
        raise InputError(f"give a solver or its options ({', '.join(options)}), not both")
    each, all_ = (progress, silent) if starts == 1 else (silent, progress)
    one_start = solver or methods.configured(methods.SOLVE, "exchange", progress=each, **options)
    return Multistart(one_start, starts, seed, all_optima, all_, workers)


def _by_exchange(
    problem: Problem, scalar: Scalarisation, many: Multistart, start: Trajectory | str | Path | None
) -> tuple[Problem, Solution]:
    """What exchange finds, from random starts or an earlier result, and the problem whose variables it has."""
    if start is not None:
        given = [start] if isinstance(start, Trajectory) else earlier_results(start)
        source = "the trajectory" if isinstance(start, Trajectory) else str(start)
        found = ByLevels(many, progress=many.progress).solve(problem, scalar, start_of(problem, given, scalar, source))
    elif problem.levels is None:
        found = many.solve(problem, scalar)
    elif many.all_optima:
        found = many.solve(problem, scalar)
        words = f"all optima are of this one level, of {problem.size} variables; no finer one was looked at"
        found = replace(found, detail=f"{found.detail}; {words}")
    else:
        found = ByLevels(many, progress=many.progress).solve(problem, scalar)
    problem = finest(problem, found)
    return problem, replace(found, gains=limit_gains(problem, scalar, found))


def _certified(
    problem: Problem, scalar: Scalarisation, method: str, found: Solution, certify: bool | None, progress: Progress
) -> Solution:
    """The solution with a certificate of global optimality, where one is wanted and can be had."""
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
