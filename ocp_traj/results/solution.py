"""What a problem solver found: the same type for every solver, with its trajectory and its proof."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import pandas as pd

from ocp_traj.display import Shown, count
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.limit_gains import LimitGain
from ocp_traj.results.quadrature import quadrature_errors
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.rounding import rounded_down, rounded_up
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.nlp import NLPResult, Status


@dataclass(frozen=True)
class Certificate:
    """How far from the global optimum a solution is at most.

    Attributes:
        lower: no feasible trajectory has a smaller objective.
        upper: the solution's own, proved feasible.
        certified: whether the gap is within the tolerance asked for.
        boxes: bounded on the way.
        seconds: spent.
        argument: what was proved, and what was left out of the lower bound.
    """

    lower: float
    upper: float
    certified: bool
    boxes: int
    seconds: float
    argument: str

    @property
    def gap(self) -> float:
        """Upper - lower, relative to upper."""
        return (self.upper - self.lower) / abs(self.upper) if self.upper else 0.0

    def explain(self) -> str:
        """One line."""
        word = "certified" if self.certified else "not certified"
        lower, upper, gap = rounded_down(self.lower, 10), rounded_up(self.upper, 10), rounded_up(self.gap, 2)
        return (
            f"{word}: no solution is below {lower:.10g}, this one is {upper:.10g}, a relative gap of "
            f"{gap:.1e} ({self.argument}; {self.boxes} boxes, {self.seconds:.2f} s)"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Shown, NLPResult):
    """What a solver found; its x are the problem's own variables.

    Attributes:
        objectives: value of each objective of the problem.
        trajectory, audit: where a problem solver made and checked one.
        instants: where constraint exchange ended up imposing the limits.
        rounds: of constraint exchange.
        alternatives: of a problem with discrete choices: the solution of each, by its name; this is the best of them.
        optima: the distinct local optima, best first, where they were asked for.
        instead_of: what the solver ended with, where this is an earlier point that is proved and better.
        moved: of a population, whether it found anything better than its first generation.
        given_up: of the starts, those whose first NLP already ended worse than the best that was proved by then.
        interrupted: what Ctrl-C left undone, such as "after 3 of 40 starts"; empty where nothing was.
        certificate: of global optimality, where one was asked for.
        history: of a population, a row a generation.
        gains: what each limit costs, largest first, where a local solver ended in an optimum.
        key: of the job that has found it just so; empty for any other.
    """

    objectives: Mapping[str, float] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    audit: Audit | None = None
    instants: tuple[Instant, ...] = ()
    rounds: int = 1
    alternatives: Mapping[str, Solution] = field(default_factory=dict)
    optima: tuple[Optimum, ...] = ()
    instead_of: Solution | None = None
    moved: bool = True
    given_up: int = 0
    interrupted: str = ""
    certificate: Certificate | None = None
    history: pd.DataFrame | None = None
    gains: tuple[LimitGain, ...] = ()
    key: str = ""

    @classmethod
    def of(cls, result: NLPResult, **more: Any) -> Self:
        """What an NLP solver ended with, as a solution with further fields."""
        return cls(**{**vars(result), **more})

    @property
    def own(self) -> Solution:
        """What the solver itself ended with."""
        return self.instead_of or self

    @cached_property
    def quadrature_errors(self) -> dict[str, float]:
        """Of each objective that is an integral, the error of its rule along the trajectory, as far as can be told."""
        origin = None if self.trajectory is None else self.trajectory.origin
        return {} if origin is None or self.trajectory is None else quadrature_errors(origin, self.trajectory)

    def explain(self) -> str:
        """One line: how it ended and, where it is not proved, or infeasible, the limits at fault, worst first."""
        if self.status is Status.UNPROVED and self.audit is not None:
            return f"{self.name}: {self.audit.explain()} ({self.detail})"
        return super().explain()

    def _headline(self) -> str:
        return f"Solution of {self.name}: {self.status.value}"

    def _facts(self) -> dict[str, str]:
        return {
            "objectives": ", ".join(f"{name} {value:.6g} {unit}".rstrip(" -") for name, value, unit in self._values()),
            "outcome": self.audit.explain() if self.audit is not None else self.explain(),
            "optimality": self.certificate.explain() if self.certificate is not None else "",
            "effort": ", ".join(
                (
                    count(self.starts, "start") + (f" ({self.given_up} given up)" if self.given_up else ""),
                    count(self.rounds, "round"),
                    count(self.iterations, "iteration"),
                    f"{self.seconds:.2f} s",
                )
            ),
            "optima": str(len(self.optima) or ""),
            "interrupted": self.interrupted,
        }

    def _values(self) -> list[tuple[str, float, str]]:
        """Name, value and, where the problem is at hand, unit of each objective."""
        origin = self.trajectory.origin if self.trajectory is not None else None
        units = {o.id: o.unit for o in origin.objectives} if origin is not None else {}
        return [(name, value, units.get(name, "")) for name, value in self.objectives.items()]

    def _tables(self) -> list[pd.DataFrame]:
        values = pd.DataFrame(self._values(), columns=["objective", "value", "unit"])
        return [values] if self.audit is None else [values, self.audit.table]


@dataclass(frozen=True, eq=False)
class Optimum:
    """A local optimum.

    Attributes:
        solution: the best of those that ended there.
        starts: how many ended there.
        homotopy_class: which it is in, by ``About.homotopy_class``; empty where the problem tells none apart.
        sampled: how many distinct local optima of the first NLP, which sees the first instants only, led there.
    """

    solution: Solution
    starts: int
    homotopy_class: str = ""
    sampled: int = 0
