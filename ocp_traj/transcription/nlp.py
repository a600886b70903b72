"""A nonlinear program, and what a solver says of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Self

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import NoSolutionFound, ProblemDefinitionError
from ocp_traj.formulation.rows import VARIABLE, Conflict, Row
from ocp_traj.transcription.program import Program, SymbolicProgram

MOST = 6  # limits that are missed, and bounds that are in the way, in a message: our choice


@dataclass(frozen=True, eq=False)
class NLP:
    """Minimise f(x) subject to lower_x <= x <= upper_x and lower_g <= g(x) <= upper_g.

    Attributes:
        name: for messages.
        program: f and g ``(m,)`` with their derivatives at numbers ``x (n,)``, rows scaled to order one.
        lower_x, upper_x: ``(n,)``.
        lower_g, upper_g: ``(m,)``.
        rows: one a row of g.
        labels: one an entry of x.
        units: one an entry of x.
        initial_slacks: the problem's own variables -> starting values of the slacks that follow them in x.
        bounds_as_rows: of bounds on variables that are those of limits: (variable, factor, row); the factor takes the
            variable to the row's scale. All sides that are finite are the limit's.
        options: in place of a solver's usual ones: {solver: {its own name of an option: value}}.
        memory: a solver keeps here what it has built for this NLP.
    """

    name: str
    program: Program
    lower_x: Array
    upper_x: Array
    lower_g: Array
    upper_g: Array
    rows: tuple[Row, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    initial_slacks: Callable[[Array], Array] = lambda x: np.zeros(0)
    bounds_as_rows: tuple[tuple[int, float, Row], ...] = ()
    options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    memory: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        """Checks shapes."""
        n, m = self.program.size, self.program.rows
        for name, size, given in (
            ("x", n, self.lower_x),
            ("x", n, self.upper_x),
            ("g", m, self.lower_g),
            ("g", m, self.upper_g),
        ):
            if given.shape != (size,):
                raise ProblemDefinitionError(
                    f"{self.name}: a bound on {name} has shape {given.shape}, expected ({size},)"
                )
        if len(self.rows) != m or len(self.labels) != n or len(self.units) != n:
            raise ProblemDefinitionError(
                f"{self.name}: {len(self.rows)} row names for {m} rows, {len(self.labels)} labels for {n} variables"
            )

    @classmethod
    def symbolic(cls, name: str, x: Any, f: Any, g: Any, **rest: Any) -> Self:
        """An NLP of CasADi MX expressions ``x (n,)``, f, ``g (m,)``; ``rest`` are further fields."""
        return cls(name, SymbolicProgram(x, f, g), **rest)

    @property
    def x(self) -> Any:
        """Variables ``(n,)``, casadi MX."""
        return self.program.symbols[0]

    @property
    def f(self) -> Any:
        """The objective, casadi MX of ``x``."""
        return self.program.symbols[1]

    @property
    def g(self) -> Any:
        """The rows ``(m,)``, casadi MX of ``x``."""
        return self.program.symbols[2]

    def start(self, x: Array) -> Array:
        """A starting point of the NLP from the problem's own variables."""
        return np.concatenate([x, self.initial_slacks(x)])

    def violation(self, x: Array, g: Array) -> float:
        """Largest amount by which a bound is exceeded, >= 0; rows are scaled, variables in their own unit."""
        gaps = np.concatenate([self.lower_x - x, x - self.upper_x, self.lower_g - g, g - self.upper_g])
        return float(max(np.max(gaps, initial=0.0), 0.0)) if np.isfinite(gaps[~np.isinf(gaps)]).all() else np.inf

    def result(
        self, found: Mapping[str, Any], status: Status, feasibility: float, iterations: int, seconds: float, detail: str
    ) -> NLPResult:  # fmt: skip
        """What one of CasADi's solvers has found, its violation recomputed.

        Args:
            found: the solver's outputs.
            status: what it says of them; a point that breaks a row or bound by more than ``feasibility`` is FAILED.
            feasibility: up to which a point counts as feasible; one that it stopped at is then FEASIBLE.
            iterations: spent.
            seconds: spent.
            detail: its own words.
        """
        x, g, lam_g, lam_x = (np.array(found[k]).ravel() for k in ("x", "g", "lam_g", "lam_x"))
        violation = self.violation(x, g)
        if status.ok and not violation <= feasibility:
            status = Status.FAILED
        elif status in _STOPPED and violation <= feasibility:
            status = Status.FEASIBLE
        return NLPResult(
            name=self.name,
            x=x,
            f=float(found["f"]),
            status=status,
            violation=violation,
            iterations=iterations,
            seconds=seconds,
            multipliers=dict(zip(self.rows, lam_g.tolist(), strict=True)),
            rows=self.rows,
            row_multipliers=lam_g,
            bound_multipliers=lam_x,
            slacks=dict(zip(self.rows, np.minimum(g - self.lower_g, self.upper_g - g).tolist(), strict=True)),
            row_count=len(self.rows),
            detail=detail,
        )


class Status(Enum):
    """How a solve ended.

    ``INFEASIBLE`` is certain: no trajectory meets the limits. ``LOCALLY_INFEASIBLE`` is what a local solver can say:
    from where it began it came to a point that breaks limits, and to nothing better nearby.
    """

    SOLVED = "solved"
    ACCEPTABLE = "solved to the acceptable tolerance"
    FEASIBLE = "stopped at a feasible point"
    UNPROVED = "not proved"
    INFEASIBLE = "infeasible"
    LOCALLY_INFEASIBLE = "locally infeasible"
    ITERATION_LIMIT = "iteration limit"
    TIME_LIMIT = "time limit"
    INTERRUPTED = "interrupted"
    UNBOUNDED = "unbounded"
    FAILED = "failed"

    @property
    def ok(self) -> bool:
        """Whether the point returned is feasible and meant to be used."""
        return self in (Status.SOLVED, Status.ACCEPTABLE, Status.FEASIBLE)


_STOPPED = (Status.LOCALLY_INFEASIBLE, Status.ITERATION_LIMIT, Status.TIME_LIMIT)  # perhaps at a feasible point


@dataclass(frozen=True, eq=False)
class NLPResult:
    """What an NLP solver ended with.

    Attributes:
        name: of the problem.
        x: variables ``(n,)``.
        f: value of the objective.
        status: how it ended.
        violation: largest scaled amount by which a row or bound is exceeded, recomputed from x.
        iterations, seconds: spent.
        multipliers: of rows.
        rows, row_multipliers: of the NLP ``(m,)``, among which a row may stand twice, and their multipliers.
        bound_multipliers: of the bounds on x ``(n,)``.
        slacks: of rows, scaled distance to the nearer bound, < 0 where exceeded.
        conflicts: where infeasible: the limits that cannot hold together; where locally: those that the nearest point
            breaks, or is stopped by.
        row_count: how many rows there were.
        detail: the solver's own words; of a solution that is not proved, why.
        starts: how many this is the best of; 0 where none was needed.
    """

    name: str
    x: Array
    f: float
    status: Status
    violation: float
    iterations: int
    seconds: float
    multipliers: Mapping[Row, float] = field(default_factory=dict)
    rows: tuple[Row, ...] = ()
    row_multipliers: Array | None = None
    bound_multipliers: Array | None = None
    slacks: Mapping[Row, float] = field(default_factory=dict)
    conflicts: tuple[Conflict, ...] = ()
    row_count: int = 0
    detail: str = ""
    starts: int = 1

    @property
    def ok(self) -> bool:
        """Whether the point is feasible and meant to be used."""
        return self.status.ok

    def require(self) -> Self:
        """Returns itself, or raises ``NoSolutionFound`` saying why there is no usable point."""
        if self.ok:
            return self
        raise NoSolutionFound(self.explain())

    def explain(self) -> str:
        """One line: how it ended and, where infeasible, the limits in conflict, worst first."""
        # A bound on a variable may be the cause of all that is missed: it is not to be crowded out.
        missed = [conflict for conflict in self.conflicts if conflict.excess > 0.0]
        held = [conflict for conflict in self.conflicts if conflict.excess <= 0.0]
        held.sort(key=lambda conflict: conflict.row.limit != VARIABLE)
        worst = "; ".join(str(conflict) for conflict in (*missed[:MOST], *held[:MOST]))
        if self.status is Status.INFEASIBLE and worst:
            known = not any(conflict.words for conflict in missed)
            least = "; each has to give at least what it is off by" if known else ""
            return f"{self.name}: no trajectory meets these limits together: {worst}{least}"
        if self.status is Status.LOCALLY_INFEASIBLE:
            tried = "the one start found no" if self.starts == 1 else f"none of {self.starts} starts found a"
            words = worst or f"its limits by {self.violation:.3g} of their scale"
            return f"{self.name}: {tried} trajectory; the nearest misses {words}"
        effort = f"after {self.iterations} iterations, violation {self.violation:.3g}"
        return f"{self.name}: {self.status.value} {effort} ({self.detail})"
