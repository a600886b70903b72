"""What most users call: solve, pareto and payload, the solvers composed with sensible defaults."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

from ocp_traj import problems
from ocp_traj.audit import audit
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.fixed_states import fixed_conflicts
from ocp_traj.front import Front
from ocp_traj.nlp import Solution, Status
from ocp_traj.problem import Decomposition, Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.scalarise import Scalarisation, WeightedSum, check_names
from ocp_traj.solvers.branch_and_bound import BranchAndBound, is_certifiable, require_certifiable
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_tracer import FrontTracer
from ocp_traj.solvers.ga import GA
from ocp_traj.solvers.hmoga import HMOGA
from ocp_traj.solvers.mopso import MOPSO
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.solvers.pareto_set import FrontMethod
from ocp_traj.solvers.payload import LargestPayload, along, static_bound, within
from ocp_traj.solvers.pso import PSO
from ocp_traj.solvers.repair import largest_excess, slow_down
from ocp_traj.symbolic import evaluate_objectives
from ocp_traj.trajectory import Trajectory
from ocp_traj.transcription import trajectory

FRONT_METHODS: dict[str, type[Any]] = {"trace": FrontTracer, "nsga2": NSGA2, "mopso": MOPSO, "hmoga": HMOGA}
METHODS = tuple(FRONT_METHODS)
POPULATION_METHODS: dict[str, type[Any]] = {"pso": PSO, "ga": GA}
SOLVE_METHODS = ("exchange", *POPULATION_METHODS)
MOST_DURATIONS = 4  # branch and bound by default up to here: its boxes multiply with every duration; our choice
OPTIMA_STARTS = 30  # random starts when all local optima are asked for: our choice


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
    method: str = "exchange",
    starts: int | None = None,
    seed: int = 0,
    all_optima: bool = False,
    solver: Exchange | None = None,
    certify: bool | None = None,
    progress: Progress = silent,
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
        all_optima: whether ``solution.optima`` lists every distinct local optimum; ``OPTIMA_STARTS`` if not given.
        solver: of each start of exchange.
        certify: whether to prove global optimality by branch and bound, and to look for a better optimum where that
            fails; by default where it applies, which is to what exchange finds for the shortest time of few durations.
        progress: told how far it is.
        options: fields of the class of ``pso`` or ``ga``, such as ``population``.

    Returns:
        The best solution, with trajectory, objectives and audit; one that is infeasible, or locally so from every
        start, names the limits in conflict. A problem with a ``decomposition`` is solved by its parts: what they
        combine to may break limits of the whole. ``solution.alternatives`` holds those of all alternatives, where the
        problem leaves a choice open.
    """
    if starts is None:
        starts = max(problem.starts, OPTIMA_STARTS if all_optima else 1)
    if starts < 1:
        raise InputError(f"starts is {starts}; give one or more")
    if method not in SOLVE_METHODS:
        raise InputError(f"there is no method {method!r}; methods are {', '.join(SOLVE_METHODS)}")
    scalar = scalarisation(problem, objective, weights)
    if certify:
        require_certifiable(problem, scalar)
    if problem.alternatives:
        solved = {
            name: solve(
                alternative, objective=objective, weights=weights, method=method, starts=starts, seed=seed,
                all_optima=all_optima, solver=solver, certify=certify, progress=progress, **options,
            )
            for name, alternative in problem.alternatives.items()
        }  # fmt: skip
        optima = sorted((o for s in solved.values() for o in s.optima), key=lambda o: o.solution.f)
        seconds = sum(s.seconds for s in solved.values())
        started = sum(s.starts for s in solved.values())
        return replace(
            best_of(list(solved.values())), alternatives=solved, optima=tuple(optima), seconds=seconds, starts=started
        )
    conflicts = fixed_conflicts(problem)
    if conflicts:
        # Broken where nothing can be changed: no solver needs to try.
        nothing = np.full(problem.size, np.nan)
        return Solution(
            problem.id, nothing, np.nan, Status.INFEASIBLE, conflicts[0].excess / conflicts[0].row.scale, 0, 0.0,
            conflicts=conflicts, detail="broken at an end, whatever the variables", starts=0,
        )  # fmt: skip
    if problem.decomposition is not None:
        return _by_parts(problem, problem.decomposition, objective, weights, method, starts, seed, solver, **options)
    if method in POPULATION_METHODS:
        found = _population(problem, scalar, method, starts, seed, progress, **options)
    else:
        if options:
            raise InputError(f"exchange has no options {', '.join(options)}; they belong to a population's method")
        one_start = solver or Exchange(progress=progress if starts == 1 else silent)
        told = progress if starts > 1 else silent
        found = Multistart(one_start, starts, seed, all_optima, told).solve(problem, scalar)
    proved = found.audit is not None and found.audit.proved
    default = method == "exchange" and problem.size <= MOST_DURATIONS and is_certifiable(problem, scalar)
    wanted = default if certify is None else certify
    if not (wanted and proved and found.ok):
        return found
    judge = BranchAndBound(progress=progress)
    if method == "exchange":
        return judge.improve(problem, scalar, found)
    return replace(found, certificate=judge.certify(problem, scalar, found)[0])


def _population(
    problem: Problem, scalar: Scalarisation, method: str, runs: int, seed: int, progress: Progress, **options: Any
) -> Solution:
    """The best of some runs of a population, with seeds ``seed``, ``seed + 1``, .."""
    chosen = configured(POPULATION_METHODS, method, seed=seed, progress=progress, **options)
    found: list[Solution] = []
    failure: NoSolutionFound | None = None
    for k in range(runs):
        try:
            found.append(replace(chosen, seed=seed + k).solve(problem, scalar))
        except NoSolutionFound as error:
            failure = error
    if not found and failure is not None:
        raise failure
    return best_of(found)


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
                    f"{problem.id} is solved by parts here, and {part.title!r} has no objective {name!r}; "
                    f"it has {', '.join(known)}"
                )
        solution = solve(
            part, objective=objective, weights=weights, method=method, starts=starts, seed=seed, solver=solver,
            certify=False, **options,
        )  # fmt: skip
        if not solution.ok:
            return replace(solution, name=part.title, seconds=time.perf_counter() - begun)
        parts.append(solution)
    x = np.clip(recipe.combine([part.x for part in parts]), problem.lower, problem.upper)
    candidate = trajectory(problem, x)
    found = audit(candidate, problem.requirements)
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
    )


def configured(table: Mapping[str, type[Any]], method: str, **options: Any) -> Any:
    """A method's object; options it does not have are refused."""
    if method not in table:
        raise InputError(f"there is no method {method!r}; methods are {', '.join(table)}")
    known = [f.name for f in fields(table[method])]
    for name in options:
        if name not in known:
            raise InputError(f"{method} has no option {name!r}; its options are {', '.join(known)}")
    return table[method](**options)


def pareto(
    problem: Problem,
    objectives: Sequence[str],
    *,
    method: str = "trace",
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
        method: one of ``METHODS``.
        seed: of everything random.
        budget: stop after this time [s] with what is there.
        keep_unproved: whether points stay that are not proved, even slowed down.
        progress: told how far it is.
        options: fields of the method's class, such as ``points`` of trace and ``population`` of nsga2.

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
    if problem.alternatives:
        if budget is not None:
            budget /= len(problem.alternatives)
        return _best_front(
            {
                name: partial(
                    pareto, alternative, objectives, method=method, seed=seed, budget=budget,
                    keep_unproved=keep_unproved, progress=progress, **options,
                )
                for name, alternative in problem.alternatives.items()
            }
        )  # fmt: skip
    chosen: FrontMethod = configured(FRONT_METHODS, method, seed=seed, progress=progress, **options)
    conflicts = fixed_conflicts(problem)
    if conflicts:
        raise NoSolutionFound(
            f"{problem.id}: no trajectory meets these limits together: {'; '.join(map(str, conflicts))}"
        )
    found = chosen.pareto(problem, objectives)
    settled = found.xs if problem.settle is None else [problem.settle(x) for x in found.xs]
    xs, checked = slow_down(problem, settled)
    for i, one in enumerate(checked):
        if (
            not one.proved and problem.settle is not None
        ):  # what was found may be proved, if a little less was asked of it
            xs[i] = slow_down(problem, [found.xs[i]])[0][0]
    info = {**found.info, "interrupted": found.interrupted}
    return Front.of(
        problem, tuple(objectives), xs,
        method=found.method, seed=found.seed, seconds=found.seconds, info=info, keep_unproved=keep_unproved,
    )  # fmt: skip


def _best_front(runs: Mapping[str, Callable[[], Front]]) -> Front:
    """The front of the alternative that dominates most of the box of all; ``info`` says what the others have."""
    fronts: dict[str, Front] = {}
    reasons = []
    for name, run in runs.items():
        try:
            fronts[name] = run()
        except NoSolutionFound as error:
            reasons.append(error)
        if name in fronts and fronts[name].info.get("interrupted"):
            break
    if not fronts:
        raise reasons[0]
    filled = [front for front in fronts.values() if len(front)]
    signs = {o.id: 1.0 if o.sense == "min" else -1.0 for front in filled for o in front.traded}
    ideal = {name: sign * min(sign * front.ideal[name] for front in filled) for name, sign in signs.items()}

    def worth(name: str) -> float:
        front = fronts[name]
        known = set(front.objectives) <= set(front.problem.reference_point)
        return front.hypervolume(ideal=ideal).value if len(front) and known else float(len(front) > 0)

    worths = {name: worth(name) for name in fronts}
    best = max(worths, key=lambda name: worths[name])
    chosen = fronts[best]
    others = {
        name: {
            "points": len(fronts[name]) if name in fronts else 0,
            "hypervolume": worths.get(name, 0.0),
            "points not dominated by the chosen front": _beyond(chosen, fronts[name]) if name in fronts else 0,
        }
        for name in runs
    }
    seconds = sum(front.seconds for front in fronts.values())
    info = {**chosen.info, "alternative": best, "alternatives": others}
    ends = [front.info["ideal"] for front in fronts.values() if "ideal" in front.info]
    if len(ends) == len(fronts):
        info["ideal"] = {name: sign * min(sign * one[name] for one in ends) for name, sign in signs.items()}
    else:
        info.pop("ideal", None)
    return replace(chosen, seconds=seconds, info=info)


def _beyond(front: Front, other: Front) -> int:
    """How many points of another front none of this front is as good as in every objective."""
    if front is other or not len(other):
        return 0
    signs = np.array([1.0 if o.sense == "min" else -1.0 for o in front.traded])
    ours, theirs = front.values * signs, other.values * signs
    return int((~(ours[None] <= theirs[:, None]).all(axis=2).any(axis=1)).sum())


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
        return within(free, max_time, Multistart(Exchange(), starts, seed, progress=progress))
    return static_bound(problem)
