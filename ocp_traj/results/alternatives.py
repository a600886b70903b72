"""Fronts of the alternatives of a problem as one: what nothing of any of them dominates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace

from ocp_traj.formulation.problem import Problem
from ocp_traj.results.front import Front, FrontPoint, non_dominated

CHOSEN, ALL = "alternative", "alternatives"  # keys of ``info``: of a front of one of them, and what each has given


def merged_front(problem: Problem, fronts: Mapping[str, Front], names: Iterable[str]) -> Front:
    """The front of all alternatives; each of its points says which one it is of, and ``info`` what each has given.

    Where all points are of one alternative the front is that one's. ``info`` is otherwise that of the alternative that
    gives most points.

    Args:
        problem: whose alternatives they are.
        fronts: of the alternatives, by name, one or more.
        names: of all alternatives, those without a front too.
    """
    found = [replace(point, alternative=name) for name, front in fronts.items() for point in front.points]
    traded = next(iter(fronts.values())).traded
    kept = non_dominated(traded, found)
    counts = Counter(point.alternative for point in kept)
    most = max(fronts, key=lambda name: counts[name])
    chosen = fronts[most]
    shares = {
        name: {"points": len(fronts[name]) if name in fronts else 0, "points of the front": counts[name]}
        for name in names
    }
    info = {**chosen.info, ALL: shares}
    if len(counts) < 2:
        info[CHOSEN] = most
    dropped: Counter[str] = Counter()
    for front in fronts.values():
        dropped.update(front.info.get("dropped", {}))
    if dropped:
        dropped["dominated"] += len(found) - len(kept)
        info["dropped"] = dict(dropped)
    ends = [front.info["ideal"] for front in fronts.values() if "ideal" in front.info]
    if len(ends) == len(fronts):
        best = {o.id: min if o.sense == "min" else max for o in traded}
        info["ideal"] = {name: pick(one[name] for one in ends) for name, pick in best.items()}
    else:
        info.pop("ideal", None)
    if len({front.info.get("conflict") for front in fronts.values()}) > 1 or len(kept) > 1:
        info.pop("conflict", None)
    return replace(
        chosen,
        problem=problem if len(counts) > 1 else chosen.problem,
        points=tuple(kept),
        seconds=sum(front.seconds for front in fronts.values()),
        info=info,
    )


def problem_of(front: Front, point: FrontPoint) -> Problem:
    """The problem that a point of a front solves: an alternative of the front's, or the front's own."""
    return front.problem.alternatives.get(point.alternative, front.problem)
