"""How a problem is solved well: settings that change the time of a solve and the optimum found, never the problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ocp_traj.errors import ProblemDefinitionError


def chebyshev(count: int, *, ends: bool = False) -> tuple[float, ...]:
    """Chebyshev's nodes on [0, 1], between which a polynomial held there cannot swing far; or his extremes."""
    turns = np.pi * np.arange(count) / (count - 1) if ends else np.pi * (np.arange(count) + 0.5) / count
    return tuple(float(u) for u in (1.0 - np.cos(turns)) / 2.0)


@dataclass(frozen=True)
class Tuning:
    """Defaults of the solvers for one problem.

    Attributes:
        starts: random starts of a local solver; several where there are several local optima.
        warm_start_objective: the objective whose optimum is the start of every other solve, where it is easily found
            from a guess and the others are not; empty for none.
        instants: first grid of constraint exchange, a number a segment: all of them stay, which keeps the first rounds
            from wandering between local optima. None: degree/2 + 1, at least 3, of which those far from their limits
            are dropped. A mapping {limit: local times}: limits without an entry are looked at between solves only,
            which leaves out rows that would never be active.
        hull_rows: ids of limits on derivatives of the joints that the NLP holds at that derivative's control points in
            place of instants. They hold it everywhere, so that no round is needed for them, and are tight where it
            rests on its bound along whole arcs, as in time-optimal motions of many pieces, where peaks would wander.
            Where it touches its bound at a peak they ask for more than the limit does.
        instants_move: whether instants follow the peaks they were put on. That saves rounds, and fills the Jacobian,
            which costs more where there are many variables.
        max_exchanges: rounds of constraint exchange; flat valleys need more.
        regularisation: {objective: weight}, added to the scalarised objective of every NLP, each over its scale: makes
            the optimum unique where many trajectories are equally good.
        descends: whether random starts keep all limits, so that a solver goes down from them by steps that keep them.
        solver_options: of NLP solvers, {solver: {its own name of an option: value}}, where its own converge badly.
    """

    starts: int = 1
    warm_start_objective: str = ""
    instants: int | Mapping[str, Sequence[float]] | None = None
    hull_rows: tuple[str, ...] = ()
    instants_move: bool = True
    max_exchanges: int = 10
    regularisation: Mapping[str, float] = field(default_factory=dict)
    solver_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    descends: bool = False

    def __post_init__(self) -> None:
        """Checks the numbers."""
        for name in ("starts", "max_exchanges"):
            if getattr(self, name) < 1:
                raise ProblemDefinitionError(f"tuning: {name} is {getattr(self, name)}; give 1 or more")
