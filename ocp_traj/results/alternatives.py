"""Fronts of the alternatives of a problem: which one to show, and what the others have that it has not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from ocp_traj.results.front import Front


def best_front(fronts: Mapping[str, Front], names: Iterable[str]) -> Front:
    """The front of the alternative that dominates most of the box of all; ``info`` says what the others have.

    Args:
        fronts: of the alternatives, by name, one or more.
        names: of all alternatives, those without a front too.
    """
    filled = [front for front in fronts.values() if len(front)]
    signs = {o.id: 1.0 if o.sense == "min" else -1.0 for front in filled for o in front.traded}
    ideal = {name: sign * min(sign * front.ideal[name] for front in filled) for name, sign in signs.items()}

    def worth(name: str) -> float:
        front = fronts[name]
        reference = front.problem.reference_point
        if not (len(front) and set(front.objectives) <= set(reference)):
            return float(len(front) > 0)
        # Where no point of any is better than the reference in every objective there is no box, and nothing in it.
        box = all(signs[name] * ideal[name] < signs[name] * reference[name] for name in front.objectives)
        return front.hypervolume(ideal=ideal).value if box else 0.0

    worths = {name: worth(name) for name in fronts}
    best = max(worths, key=lambda name: worths[name])
    chosen = fronts[best]
    missed = {name: count_not_dominated(chosen, front) for name, front in fronts.items()}
    others = {
        name: {
            "points": len(fronts[name]) if name in fronts else 0,
            "hypervolume": worths.get(name, 0.0),
            "points not dominated by the chosen front": missed.get(name, 0),
        }
        for name in names
    }
    seconds = sum(front.seconds for front in fronts.values())
    info = {**chosen.info, "alternative": best, "alternatives": others}
    ends = [front.info["ideal"] for front in fronts.values() if "ideal" in front.info]
    if len(ends) == len(fronts):
        info["ideal"] = {name: sign * min(sign * one[name] for one in ends) for name, sign in signs.items()}
    else:
        info.pop("ideal", None)
    return replace(chosen, seconds=seconds, info=info)


def count_not_dominated(front: Front, other: Front) -> int:
    """How many points of another front no point of this one weakly dominates; both trade the same objectives."""
    if front is other or not len(other):
        return 0
    signs = np.array([1.0 if o.sense == "min" else -1.0 for o in front.traded])
    ours, theirs = front.values * signs, other.values * signs
    return int((~(ours[None] <= theirs[:, None]).all(axis=2).any(axis=1)).sum())
