"""What a front method returns: decision vectors, and how it came by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ocp_traj.problem import Problem

Array = NDArray[np.float64]

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
    """

    xs: Sequence[Array]
    method: str
    seed: int | None
    seconds: float
    info: Mapping[str, Any] = field(default_factory=dict)
    interrupted: bool = False


class FrontMethod(Protocol):
    """Anything that approximates a Pareto set."""

    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """Approximates the Pareto set of some objectives of a problem."""
