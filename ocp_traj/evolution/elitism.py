"""Controlled elitism: how much of the next generation each rank may be. Deb and Goel (2001), EMO 2001, LNCS 1993.

Of N places the first rank gets at most a fraction p, the Pareto fraction; the others get shares that fall
geometrically, p (1 - p)^(i - 1) N for rank i, which is the published law with ratio r = 1 - p and no end of ranks. What
a rank does not need passes to the next one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pymoo.core.survival import Survival
from pymoo.operators.survival.rank_and_crowding.metrics import get_crowding_function
from pymoo.util.nds.non_dominated_sorting import NonDominatedSorting

ROUNDING = 1e-9  # a share this little below a whole number is that number


def places_of_ranks(sizes: Sequence[int], places: int, fraction: float) -> list[int]:
    """How many of each rank survive.

    Args:
        sizes: individuals of each rank, best first.
        places: survivors in all, at most the sum of the sizes.
        fraction: the Pareto fraction p.

    Returns:
        One number a rank. The first is at most ``fraction * places``, unless all others together cannot fill the rest.
    """
    taken: list[int] = []
    room = 0.0
    for i, size in enumerate(sizes):
        room += fraction * (1.0 - fraction) ** i * places
        taken.append(min(size, int(room + ROUNDING)))
        room -= taken[-1]
    left = places - sum(taken)
    for i in (*range(1, len(sizes)), 0):  # the tail of the geometric law: the better ranks first, the elite last
        more = min(left, sizes[i] - taken[i])
        taken[i] += more
        left -= more
    return taken


class ControlledElitism(Survival):  # type: ignore[misc]  # pymoo is untyped
    """Ranks by domination, crowding within a rank, places by ``places_of_ranks``.

    Individuals that break a limit rank behind all others, as one last rank, the least broken first.

    Args:
        fraction: the Pareto fraction.
    """

    def __init__(self, fraction: float) -> None:
        super().__init__(filter_infeasible=False)
        self.fraction = fraction
        self.sorting = NonDominatedSorting()
        self.crowding = get_crowding_function("cd")

    def _do(self, problem: Any, pop: Any, *args: Any, n_survive: int, **kwargs: Any) -> Any:
        violation = np.maximum(pop.get("CV")[:, 0].astype(float), 0.0)
        met, broken = np.flatnonzero(violation <= 0.0), np.flatnonzero(violation > 0.0)
        f = pop.get("F").astype(float)
        ranks, distances = [], []
        for front in self.sorting.do(f[met]) if len(met) else []:
            distance = self.crowding.do(f[met[front]])
            order = np.argsort(-distance, kind="stable")
            ranks.append(met[front][order])
            distances.append(distance[order])
        if len(broken):
            order = np.argsort(violation[broken], kind="stable")
            ranks.append(broken[order])
            distances.append(np.zeros(len(broken)))
        if not len(met):
            ranks.insert(0, met)  # nobody of the first rank
            distances.insert(0, np.zeros(0))
        taken = places_of_ranks([len(rank) for rank in ranks], n_survive, self.fraction)
        for number, (rank, distance) in enumerate(zip(ranks, distances, strict=True)):
            for i, d in zip(rank, distance, strict=True):
                pop[i].set("rank", number)
                pop[i].set("crowding", d)
        return pop[np.concatenate([rank[:count] for rank, count in zip(ranks, taken, strict=True)]).astype(int)]
