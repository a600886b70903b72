"""A nonlinear program whose rows know which limit they came from, and what a solver says of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ocp_traj.errors import NoSolutionFound, ProblemDefinitionError
from ocp_traj.local_derivatives import Derivatives
from ocp_traj.rounding import rounded_down, rounded_up

if TYPE_CHECKING:
    from ocp_traj.optima import Optimum
    from ocp_traj.trajectory import Trajectory
    from ocp_traj.transcription import Instant
    from ocp_traj.verdicts import Audit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """Where a constraint row comes from, and how to turn it back into its unit.

    Attributes:
        limit: id of the limit, or of the objective a bound is put on.
        label: joint, or whatever the limit calls its rows.
        segment: of the curve; -1 where the row belongs to no instant.
        instant: local time in [0, 1] at the point of transcription.
        unit: of the row's value before scaling.
        scale: the row is the limit's value divided by this.
        sweep: where along the sweep of a swept limit.
        defines: the row only says what an extra variable is; it can always be met and is in nobody's way.
    """

    limit: str
    label: str
    segment: int = -1
    instant: float = 0.0
    unit: str = ""
    scale: float = 1.0
    defines: bool = False
    sweep: float = 0.0


@dataclass(frozen=True, eq=False)
class NLP:
    """Minimise f(x) subject to lower_x <= x <= upper_x and lower_g <= g(x) <= upper_g.

    Attributes:
        name: for messages.
        x, f, g: casadi MX; ``x (n,)``, ``g (m,)``, rows scaled to order one.
        lower_x, upper_x: ``(n,)``.
        lower_g, upper_g: ``(m,)``.
        rows: one a row of g.
        labels: one an entry of x.
        units: one an entry of x.
        complete: the problem's own variables -> the extra variables that go with them, after those.
        expand: the functions are short: write them out (casadi's ``expand``).
        derivatives: Jacobian and Hessian, where there are quicker ones than the solver would make.
        options: for the solver, by IPOPT's names, in place of its usual ones.
        memory: outlives the NLP: a solver leaves its compiled derivatives here for the next NLP of the same problem.
    """

    name: str
    x: Any
    f: Any
    g: Any
    lower_x: Array
    upper_x: Array
    lower_g: Array
    upper_g: Array
    rows: tuple[Row, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    complete: Callable[[Array], Array] = lambda x: np.zeros(0)
    expand: bool = False
    derivatives: Derivatives | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    memory: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks shapes."""
        n, m = self.x.numel(), self.g.numel()
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

    def start(self, x: Array) -> Array:
        """A starting point of the NLP from the problem's own variables."""
        return np.concatenate([x, self.complete(x)])

    def violation(self, x: Array, g: Array) -> float:
        """Largest amount by which a bound is exceeded, >= 0; rows are scaled, variables in their own unit."""
        gaps = np.concatenate([self.lower_x - x, x - self.upper_x, self.lower_g - g, g - self.upper_g])
        return float(max(np.max(gaps, initial=0.0), 0.0)) if np.isfinite(gaps[~np.isinf(gaps)]).all() else np.inf


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


@dataclass(frozen=True)
class Conflict:
    """One limit of those that did not hold together.

    Attributes:
        row: the limit's row.
        value: what the least-violating point gives [row.unit].
        bound: what the limit allows [row.unit].
        excess: by how much it is exceeded, >= 0; 0 for a limit that is met but stands in the way of the others.
        words: what that means, where the problem can say it better than the numbers.
    """

    row: Row
    value: float
    bound: float
    excess: float
    words: str = ""

    def __str__(self) -> str:
        """The limit, where, and by how much."""
        if self.words:
            return self.words
        name = f"{self.row.limit} {self.row.label}".strip()
        where = f" at segment {self.row.segment}, u = {self.row.instant:.3f}" if self.row.segment >= 0 else ""
        if self.excess > 0.0:
            return (
                f"{name}{where}: {self.value:.6g}, allowed {self.bound:.6g} {self.row.unit} (off by {self.excess:.3g})"
            )
        return f"{name}{where}: held at its bound {self.bound:.6g} {self.row.unit}"


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


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solver found, the same type for every solver.

    Attributes:
        name: of the problem.
        x: decision variables ``(n,)``.
        f: value of the scalar that was minimised.
        status: how it ended.
        violation: largest scaled amount by which a row or bound is exceeded, recomputed from x.
        iterations, seconds: spent.
        multipliers: of rows.
        bound_multipliers: of the bounds on x ``(n,)``.
        slacks: of rows, scaled distance to the nearer bound, < 0 where exceeded.
        conflicts: where infeasible: the limits that cannot hold together; where locally: those that the nearest point
            breaks, or is stopped by.
        objectives: value of each objective of the problem.
        trajectory, audit: where a problem solver made and checked one.
        instants: where constraint exchange ended up imposing the limits.
        rounds, row_count: of constraint exchange.
        alternatives: of a problem with discrete choices: the solution of each, by its name; this is the best of them.
        optima: the distinct local optima, best first, where they were asked for.
        detail: the solver's own words; of a solution that is not proved, why.
        starts: how many this is the best of; 0 where none was needed.
        instead_of: what the solver ended with, where this is an earlier point that is proved and better.
        moved: of a population, whether it found anything better than its first generation.
        certificate: of global optimality, where one was asked for.
        history: of a population, a row a generation.
    """

    name: str
    x: Array
    f: float
    status: Status
    violation: float
    iterations: int
    seconds: float
    multipliers: Mapping[Row, float] = field(default_factory=dict)
    bound_multipliers: Array | None = None
    slacks: Mapping[Row, float] = field(default_factory=dict)
    conflicts: tuple[Conflict, ...] = ()
    objectives: Mapping[str, float] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    audit: Audit | None = None
    instants: tuple[Instant, ...] = ()
    rounds: int = 1
    row_count: int = 0
    alternatives: Mapping[str, Solution] = field(default_factory=dict)
    optima: tuple[Optimum, ...] = ()
    detail: str = ""
    starts: int = 1
    instead_of: Solution | None = None
    moved: bool = True
    certificate: Certificate | None = None
    history: pd.DataFrame | None = None

    @property
    def ok(self) -> bool:
        """Whether the point is feasible and meant to be used."""
        return self.status.ok

    def require(self) -> Solution:
        """Returns itself, or raises ``NoSolutionFound`` saying why there is no usable point."""
        if self.ok:
            return self
        raise NoSolutionFound(self.explain())

    @property
    def own(self) -> Solution:
        """What the solver itself ended with."""
        return self.instead_of or self

    def explain(self) -> str:
        """One line: how it ended and, where infeasible, the limits in conflict, worst first."""
        worst = "; ".join(str(conflict) for conflict in self.conflicts[:6])
        if self.status is Status.UNPROVED and self.audit is not None:
            return f"{self.name}: {self.audit.explain()} ({self.detail})"
        if self.status is Status.INFEASIBLE and worst:
            return f"{self.name}: no trajectory meets these limits together: {worst}"
        if self.status is Status.LOCALLY_INFEASIBLE:
            tried = "the one start found no" if self.starts == 1 else f"none of {self.starts} starts found a"
            missed = worst or f"its limits by {self.violation:.3g} of their scale"
            return f"{self.name}: {tried} trajectory; the nearest misses {missed}"
        effort = f"after {self.iterations} iterations, violation {self.violation:.3g}"
        return f"{self.name}: {self.status.value} {effort} ({self.detail})"
