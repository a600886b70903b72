"""A trajectory optimisation problem, written symbolically: what a paper states, and nothing of how it is solved."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import ProblemDefinitionError, UnknownName, quoted
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.requirements import PathConstraint, Requirements, state_function

if TYPE_CHECKING:
    from ocp_traj.curves.motion import Motion
    from ocp_traj.formulation.rows import Conflict

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variable:
    """A block of decision variables with simple bounds.

    Attributes:
        id: name.
        lower, upper: bounds ``(n,)``, in ``unit``.
        unit: SI unit.
        labels: one name an entry.
        eq: equation or table of the source that gives the bounds.
        auxiliary_to: the objective that the block exists for, if it does not shape the curve: a margin to be made
            large, say. Its lower bound asks least of the limits, and there it stays while that objective is not traded.
    """

    id: str
    lower: Array
    upper: Array
    unit: str
    labels: tuple[str, ...]
    eq: str = ""
    auxiliary_to: str = ""

    def __post_init__(self) -> None:
        """Checks shapes and bounds."""
        lower, upper = (np.atleast_1d(np.asarray(b, dtype=float)) for b in (self.lower, self.upper))
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        if lower.shape != upper.shape or lower.shape != (len(self.labels),):
            raise ProblemDefinitionError(
                f"variable {self.id!r}: bounds {lower.shape} and {upper.shape} for {len(self.labels)} labels; "
                "give one of each per label"
            )
        for label, low, high in zip(self.labels, lower, upper, strict=True):
            if not low <= high:
                raise ProblemDefinitionError(
                    f"variable {self.id!r}: the bounds of {label} are empty, lower {low:.9g} > upper {high:.9g} "
                    f"{self.unit}; widen them"
                )


@dataclass(frozen=True, eq=False)
class Decomposition:
    """A recipe that solves parts of a problem alone and puts them together, whatever that does to the limits.

    Attributes:
        parts: problems with variables of the same kind each.
        combine: the parts' decision vectors -> x of the whole.
    """

    parts: tuple[Problem, ...]
    combine: Callable[[Sequence[Array]], Array]


@dataclass(frozen=True, eq=False)
class Problem:
    """A trajectory optimisation problem: a path of named variables, objectives and limits.

    Attributes:
        id: registry name.
        title, reference: for lists and reports.
        case: the paper's numbers, a frozen dataclass.
        variables: blocks of decision variables; x is their concatenation ``(n,)``.
        curve: x -> PiecewiseBezier, symbolic.
        objectives: what may be traded.
        requirements: limits, joints and promised continuity.
        guess: random starting point from a generator, within the bounds.
        parameters: x -> p ``(n_p,)``.
        curve_kind: for lists.
        dilate: (x, s) -> x of the same path s times slower, where the problem allows it.
        default_objective: what ``solve`` minimises when not told.
        reference_point: per objective, the worst value worth having: it bounds a front and its hypervolume.
        best_values: per objective and another one, the best value of the first that leaves the other within its
            reference point, as far as local solves know: the ends of fronts, from which ``ideal_point`` follows. Empty
            for a case whose ends nobody has looked for; ``benchmarks/ideal_points.py`` does.
        starts: random starts of a local solver when not told how many.
        stepping_stone: an objective that is easy to solve for from a guess; solves for others begin at its optimum.
        instants: a segment, of a first grid of constraint exchange that stays; if not given, degree/2 + 1, at least 3,
            of which those far from their limits are dropped; or the local times of each limit, with none of those not
            named, which are looked at between solves only.
        instants_move: whether instants of constraint exchange follow the peaks they were put on: fewer solves, each of
            more work where there are many variables.
        rounds: of constraint exchange, at most.
        expand: write the NLP's functions out, operation by operation, instead of mapping them over instants: many times
            quicker to evaluate where they are short, slow to build where they are long.
        local_derivatives: form Jacobian and Hessian of an NLP from those of each instant: many times quicker where
            there are many variables and long functions.
        alternatives: where the problem leaves a discrete choice open, the problem of each choice, by its name; they
            differ in nothing but the case and the curve. The problem itself is then the first of them.
        homotopy: the way a trajectory takes, in a word: what tells local optima apart.
        settle: x -> x with the auxiliary variables at what its curve really has.
        explain: what a limit broken at a fixed end means, in words.
        decomposition: solve by parts, as a paper does, in place of the whole.
        scales_in_time: the variables are the durations of the segments, all of them and nothing else, and the path
            depends on their ratios alone: s x is the same path, s times slower.
        regularisation: {objective: weight}, traces of objectives that every NLP adds to what it minimises, each over
            its scale, where many trajectories are as good as one another.
        figures: (name, value, unit) of a trajectory, which no objective says and a reader wants to know.
        solver_options: of NLP solvers, by their names, where the usual ones serve this problem badly.
        notes: what this case fills in where the paper says nothing; shown with the problem and with every result.
    """

    id: str
    title: str
    reference: str
    case: Any
    robot: Any
    variables: tuple[Variable, ...]
    curve: Callable[[Any], PiecewiseBezier]
    objectives: tuple[Objective, ...]
    requirements: Requirements
    guess: Callable[[np.random.Generator], Array]
    parameters: Callable[[Any], Any] = lambda x: casadi.SX(0, 1)
    curve_kind: str = ""
    dilate: Callable[[Array, float], Array] | None = None
    default_objective: str = ""
    reference_point: Mapping[str, float] = field(default_factory=dict)
    best_values: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    starts: int = 1
    stepping_stone: str = ""
    instants: int | Mapping[str, Sequence[float]] | None = None
    instants_move: bool = True
    rounds: int = 10
    expand: bool = False
    local_derivatives: bool = False
    alternatives: Mapping[str, Problem] = field(default_factory=dict)
    homotopy: Callable[[Motion], str] | None = None
    settle: Callable[[Array], Array] | None = None
    explain: Callable[[Conflict], str] | None = None
    decomposition: Decomposition | None = None
    scales_in_time: bool = False
    regularisation: Mapping[str, float] = field(default_factory=dict)
    figures: Callable[[Motion], Sequence[tuple[str, float, str]]] | None = None
    solver_options: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    _functions: dict[Hashable, Any] = field(default_factory=dict, repr=False, init=False)

    def __post_init__(self) -> None:
        """Checks ids, terms and the curve's joints."""
        names = [objective.id for objective in self.objectives]
        taken = [*names, *self.requirements.ids]
        for name in taken:
            if taken.count(name) > 1:
                raise ProblemDefinitionError(
                    f"{self.id}: the id {name!r} is used more than once; ids are unique over limits and objectives"
                )
        for objective in self.objectives:
            for term in objective.terms or ():
                if term not in names or self.objective(term).terms is not None:
                    raise ProblemDefinitionError(
                        f"{self.id}: objective {objective.id!r} sums {term!r}, which is no plain objective"
                    )
        if self.default_objective not in names:
            raise ProblemDefinitionError(
                f"{self.id}: default objective {self.default_objective!r} is not one of {names}"
            )
        if self.stepping_stone not in ("", *names):
            raise ProblemDefinitionError(f"{self.id}: stepping stone {self.stepping_stone!r} is not one of {names}")
        dof = self.curve(casadi.SX.sym("x", self.size)).dof
        if dof != self.requirements.dof:
            raise ProblemDefinitionError(f"{self.id}: the curve has {dof} joints, the limits {self.requirements.dof}")
        for variable in self.variables:
            if variable.auxiliary_to not in ("", *names):
                raise ProblemDefinitionError(
                    f"{self.id}: variable {variable.id!r} is auxiliary to {variable.auxiliary_to!r}, no objective of it"
                )
        for objective in self.objectives:
            if objective.variation is not None:
                self.variation(objective)

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return sum(len(v.labels) for v in self.variables)

    @property
    def lower(self) -> Array:
        """Lower bounds of x ``(n,)``."""
        return np.concatenate([v.lower for v in self.variables])

    @property
    def upper(self) -> Array:
        """Upper bounds of x ``(n,)``."""
        return np.concatenate([v.upper for v in self.variables])

    @property
    def labels(self) -> tuple[str, ...]:
        """Name of each entry of x."""
        return tuple(label for v in self.variables for label in v.labels)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each entry of x."""
        return tuple(v.unit for v in self.variables for _ in v.labels)

    def idle(self, traded: Iterable[str]) -> NDArray[np.bool_]:
        """Which entries of x ``(n,)`` are auxiliary to objectives that are not among the traded ones."""
        names = {""}
        for name in traded:
            names |= {name, *(self.objective(name).terms or ())}
        return np.array([v.auxiliary_to not in names for v in self.variables for _ in v.labels], dtype=bool)

    def variation(self, objective: Objective) -> PathConstraint:
        """The rows whose total variation an objective sums, as a limit without bounds, of the objective's id."""

        def build() -> PathConstraint:
            assert objective.variation is not None
            joints, parameters = self.requirements.joints, self.requirements.parameters
            function = state_function(objective.id, objective.variation, len(joints), len(parameters))
            q = casadi.SX.sym("q", 5 * len(joints))
            rest = [casadi.SX.sym("z", function.numel_in(i)) for i in range(1, 4)]
            slopes = casadi.jacobian(function(q, *rest), casadi.vertcat(q, *rest))
            if not slopes.is_constant() or slopes[:, len(joints) :].nnz():
                raise ProblemDefinitionError(
                    f"objective {objective.id!r}: the total variation is of expressions linear in q, of nothing else"
                )
            rows = function.numel_out(0)
            labels = joints if rows == len(joints) else tuple(f"row {i + 1}" for i in range(rows))
            free = np.full(rows, np.inf)
            return PathConstraint(objective.id, objective.variation, -free, free, (objective.unit,) * rows, labels)

        limit: PathConstraint = self.cached(("variation", objective.id), build)
        return limit

    def objective(self, name: str) -> Objective:
        """The objective called ``name``."""
        for objective in self.objectives:
            if objective.id == name:
                return objective
        raise UnknownName(
            f"{self.id} has no objective {quoted(name)}; objectives are {', '.join(o.id for o in self.objectives)}"
        )

    def ideal_point(self, names: Sequence[str]) -> dict[str, float]:
        """What no front of some objectives within the reference point is better than; empty where that is not known.

        Every further objective leaves less room: of each, the worst of its best values beside one other.
        """
        ideal = {}
        for name in names:
            known = self.best_values.get(name, {})
            ends = [known[other] for other in names if other != name and other in known]
            if not ends or len(ends) < len(names) - 1:
                return {}
            ideal[name] = max(ends) if self.objective(name).sense == "min" else min(ends)
        return ideal

    def unpack(self, x: ArrayLike) -> dict[str, Array]:
        """Splits a decision vector into its named blocks."""
        blocks = np.split(np.asarray(x, dtype=float), np.cumsum([len(v.labels) for v in self.variables])[:-1])
        return {v.id: block for v, block in zip(self.variables, blocks, strict=True)}

    def cached(self, key: Hashable, build: Callable[[], Any]) -> Any:
        """A compiled function kept with the problem, built on first use."""
        if key not in self._functions:
            self._functions[key] = build()
        return self._functions[key]
