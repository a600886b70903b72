"""What a front method returns: decision vectors, and how it came by them; and the proved front that is made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.results.front import Front
from ocp_traj.results.time_scaling import slow_down

ENDED_AFTER = "ended after"  # key of ``info``: what was done, of how much, when Ctrl-C or a budget ended the method


@dataclass(frozen=True, eq=False)
class ParetoSet:
    """Decision vectors of an approximation of the Pareto set.

    Attributes:
        xs: vectors ``(n,)``, not yet audited.
        method: name of the method.
        seed: of its randomness, or None.
        seconds: spent.
        info: what else is worth recording.
        interrupted: whether Ctrl-C ended it.
        champions: of a population, after each generation the best feasible individual so far in the first objective
            ``(generations, n)``, NaN where there is none; None where there is no population, or nobody kept them.
    """

    xs: Sequence[Array]
    method: str
    seed: int | None
    seconds: float
    info: Mapping[str, Any] = field(default_factory=dict)
    interrupted: bool = False
    champions: Array | None = None


def check_traded(objectives: Sequence[str]) -> None:
    """Refuses less than two objectives."""
    if len(objectives) < 2:
        raise InputError(f"a front trades two or more objectives; got {', '.join(objectives) or 'none'}")


def proved_front(problem: Problem, objectives: Sequence[str], found: ParetoSet, keep_unproved: bool = False) -> Front:
    """The proved and non-dominated of what a method found, with tight slacks, slowed down where that helps."""
    tight = found.xs if problem.tighten_slacks is None else [problem.tighten_slacks(x) for x in found.xs]
    xs, checked = slow_down(problem, tight)
    # What was found may be proved where it is not with tight slacks: a little less is asked of it.
    unproved = [i for i, one in enumerate(checked) if not one.proved] if problem.tighten_slacks is not None else []
    for i, x in zip(unproved, slow_down(problem, [found.xs[i] for i in unproved])[0], strict=True):
        xs[i] = x
    info = {**found.info, "interrupted": found.interrupted}
    return Front.of(
        problem, tuple(objectives), xs,
        method=found.method, seed=found.seed, seconds=found.seconds, info=info, keep_unproved=keep_unproved,
    )  # fmt: skip
