"""A trajectory optimisation problem, written symbolically: what a paper states, and nothing of how it is solved."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.display import Shown, count
from ocp_traj.errors import ProblemDefinitionError, UnknownName, cut, quoted
from ocp_traj.formulation.about import About
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.clearance_rows import clearance_rows
from ocp_traj.formulation.objective import Objective, rule_name
from ocp_traj.formulation.requirements import PathConstraint, Requirements, state_function
from ocp_traj.formulation.tuning import Tuning

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Variable:
    """A block of decision variables with simple bounds.

    Attributes:
        id: name.
        lower, upper: bounds ``(n,)``, in ``unit``.
        unit: SI unit.
        labels: one name an entry.
        eq: equation or table of the source that gives the bounds.
        slack_of: the objective of which the block is a slack: bounded by limits, and no part of the curve, such as the
            least clearance where clearance is maximised. At its lower bound it tightens no limit, and it is fixed there
            unless that objective is traded. Empty for a variable of the curve.
        bounded_by: (id, label) of the limit that gives each entry its bounds, perhaps in another unit; empty where the
            bounds are the block's own.
    """

    id: str
    lower: Array
    upper: Array
    unit: str
    labels: tuple[str, ...]
    eq: str = ""
    slack_of: str = ""
    bounded_by: tuple[tuple[str, str], ...] = ()

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
        if self.bounded_by and len(self.bounded_by) != len(self.labels):
            raise ProblemDefinitionError(
                f"variable {self.id!r}: {len(self.bounded_by)} limits for {len(self.labels)} labels; give one per label"
            )
        for label, low, high in zip(self.labels, lower, upper, strict=True):
            if not low <= high:
                raise ProblemDefinitionError(
                    f"variable {self.id!r}: the bounds of {label} are empty, lower {low:.9g} > upper {high:.9g} "
                    f"{self.unit}; widen them"
                )

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each entry."""
        return (self.unit,) * len(self.labels)


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
class Levels:
    """Where a problem is among those of the same motion with fewer and with more pieces; see ``levels.levels_of``.

    Attributes:
        coarser: the problem with fewer pieces, whose optimum is the start of this one; None for the coarsest.
        prolong: x of the coarser -> x of the same motion here, a little slower.
        finer: the problem with more pieces, to which refinement goes on from this; None where it ends.
        gain: relative gain of the objective from one level to the next below which it ends as well.
    """

    coarser: Callable[[], Problem] | None
    prolong: Callable[[Array], Array]
    finer: Callable[[], Problem] | None
    gain: float


@dataclass(frozen=True, eq=False, repr=False)
class Problem(Shown):
    """A trajectory optimisation problem: a path of named variables, objectives and limits.

    Attributes:
        id: by which files name it: registered, or ``module:function`` of what makes it; else it has to be given with
            them.
        variables: blocks of decision variables; x is their concatenation ``(n,)``.
        curve: x -> PiecewiseBezier, symbolic.
        objectives: what may be traded.
        requirements: limits, joints and promised continuity.
        guess: random starting point ``(n,)`` from a generator, within the bounds.
        case: the numbers the problem is built from, a frozen dataclass.
        robot: the robot that moves, for what asks for it by name.
        parameters: x -> p ``(n_p,)``, symbolic.
        default_objective: minimised or maximised where no objective is named; the first one if not given.
        dilate: (x, s) -> x of the same path s times slower, where the problem allows it.
        scales_in_time: whether the variables are the durations of the segments, all of them and nothing else, and the
            path depends on their ratios alone: s x is the same path, s times slower.
        reference_point: per objective, the worst value worth having: it bounds a front and its hypervolume.
        best_values: per objective and another one, the best value of the first that leaves the other within its
            reference point, as far as local solves know: the ends of fronts, from which ``ideal_point`` follows. Empty
            for a case whose ends nobody has looked for; ``benchmarks/ideal_points.py`` does.
        alternatives: where the problem leaves a discrete choice open, the problem of each choice, by its name; they
            differ in nothing but the case and the curve. The problem itself is then the first of them.
        decomposition: solution by parts, as a paper does, in place of the whole.
        variables_of: motion -> x of it, the inverse of ``curve`` and ``parameters``, for starts; None where it has to
            be found by search.
        tighten_slacks: x -> x with the slacks of objectives at what its curve really has.
        tuning: how it is solved well.
        levels: the problems of the same motion with fewer and more pieces, by which it is solved; None for none.
        about: what is said of it to people.
    """

    id: str
    variables: tuple[Variable, ...]
    curve: Callable[[Any], PiecewiseBezier]
    objectives: tuple[Objective, ...]
    requirements: Requirements
    guess: Callable[[np.random.Generator], Array]
    case: Any = None
    robot: Any = None
    parameters: Callable[[Any], Any] = lambda x: casadi.SX(0, 1)
    default_objective: str = ""
    dilate: Callable[[Array, float], Array] | None = None
    scales_in_time: bool = False
    reference_point: Mapping[str, float] = field(default_factory=dict)
    best_values: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    alternatives: Mapping[str, Problem] = field(default_factory=dict)
    decomposition: Decomposition | None = None
    variables_of: Callable[[Motion], Array] | None = None
    tighten_slacks: Callable[[Array], Array] | None = None
    tuning: Tuning = Tuning()
    levels: Levels | None = None
    about: About = About()
    _functions: dict[Hashable, Any] = field(default_factory=dict, init=False)

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
        if not names:
            raise ProblemDefinitionError(f"{self.id}: there is no objective; give one or more")
        if not self.default_objective:
            object.__setattr__(self, "default_objective", names[0])
        if self.default_objective not in names:
            raise ProblemDefinitionError(
                f"{self.id}: default objective {self.default_objective!r} is not one of {names}"
            )
        for word, used in (
            ("warm start objective", {self.tuning.warm_start_objective} - {""}),
            ("objective of the regularisation", self.tuning.regularisation),
        ):
            for name in used:
                if name not in names:
                    raise ProblemDefinitionError(f"{self.id}: {word} {name!r} is not one of {names}")
        known = [limit.id for limit in self.requirements.path_constraints if limit.order is not None]
        for name in self.tuning.hull_rows:
            if name not in known:
                raise ProblemDefinitionError(
                    f"{self.id}: hull rows of {name!r}, no limit on a derivative of the joints; those are {known}"
                )
        dof = self.at_symbols[1].dof
        if dof != self.requirements.dof:
            raise ProblemDefinitionError(f"{self.id}: the curve has {dof} joints, the limits {self.requirements.dof}")
        for variable in self.variables:
            if variable.slack_of not in ("", *names):
                raise ProblemDefinitionError(
                    f"{self.id}: variable {variable.id!r} is a slack of {variable.slack_of!r}, no objective of it"
                )
        for objective in self.objectives:
            if objective.variation is not None:
                self.variation(objective)

    @property
    def chosen_limits(self) -> tuple[ChosenLimit, ...]:
        """What the NLP imposes in place of requirements that are no expressions, the distances between bodies."""
        requirements = self.requirements
        return tuple(clearance_rows(limit, requirements.parameters) for limit in requirements.clearance_constraints)

    @property
    def path_limits(self) -> tuple[PathConstraint, ...]:
        """The path limits that the NLP imposes at instants."""
        return (*self.requirements.path_constraints, *self.chosen_limits)

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return sum(len(v.labels) for v in self.variables)

    @property
    def at_symbols(self) -> tuple[Any, PiecewiseBezier]:
        """A casadi SX x ``(n,)`` and the curve of it, made once: of a long path that takes a while."""

        def build() -> tuple[Any, PiecewiseBezier]:
            x = casadi.SX.sym("x", self.size)
            return x, self.curve(x)

        found: tuple[Any, PiecewiseBezier] = self.cached("at symbols", build)
        return found

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
        return tuple(unit for v in self.variables for unit in v.units)

    def inactive(self, traded: Iterable[str]) -> NDArray[np.bool_]:
        """Which entries of x ``(n,)`` are slacks of objectives that are not among the traded ones."""
        names = {""}
        for name in traded:
            names |= {name, *(self.objective(name).terms or ())}
        return np.array([v.slack_of not in names for v in self.variables for _ in v.labels], dtype=bool)

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

    def _headline(self) -> str:
        return f"Problem {self.id}" + (f": {self.about.title}" if self.about.title else "")

    def _facts(self) -> dict[str, str]:
        return {
            "variables": f"{self.size}: {', '.join(v.id for v in self.variables)}",
            "curve": ", ".join(filter(None, (count(self.requirements.dof, "joint"), self.about.curve_kind))),
            "objectives": ", ".join(f"{o.id} [{o.unit}]" for o in self.objectives),
            "limits": ", ".join(self.requirements.ids),
            "case": "" if self.case is None else cut(repr(self.case), 300),
            "source": self.about.reference,
        }

    def _tables(self) -> list[pd.DataFrame]:
        import pandas as pd  # slow to import, and wanted in a notebook alone

        return [pd.DataFrame(rows) for rows in self.summary().values() if rows]

    def summary(self) -> dict[str, list[dict[str, Any]]]:
        """Rows of plain values for lists: ``variables``, ``objectives``, ``limits`` and ``point_constraints``."""

        def bounds(blocks: Sequence[Variable | PathConstraint]) -> list[dict[str, Any]]:
            return [
                {"id": b.id, "label": label, "lower": float(low), "upper": float(high), "unit": unit, "eq": b.eq}
                for b in blocks
                for label, low, high, unit in zip(b.labels, b.lower, b.upper, b.units, strict=True)
            ]

        objectives = [
            {
                "id": o.id, "unit": o.unit, "scale": o.scale, "sense": o.sense, "eq": o.eq,
                "reference": self.reference_point.get(o.id), "integral by": rule_name(o.quadrature),
            }
            for o in self.objectives
        ]  # fmt: skip
        points = [
            {"id": c.id, "rows": len(c.labels), "instants": len(c.at), "tolerance": c.tolerance, "eq": c.eq}
            for c in self.requirements.point_constraints
        ]
        return {
            "variables": bounds(self.variables), "objectives": objectives,
            "limits": bounds(self.requirements.path_constraints), "point_constraints": points,
        }  # fmt: skip

    def cached(self, key: Hashable, build: Callable[[], Any]) -> Any:
        """A compiled function kept with the problem, built on first use."""
        if key not in self._functions:
            self._functions[key] = build()
        return self._functions[key]
