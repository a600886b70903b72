"""A Pareto front of proved trajectories: its table, hypervolume, spread, knee, ideal and nadir."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import moocore
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.display import Shown, count
from ocp_traj.errors import InputError
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, VIOLATED, Audit
from ocp_traj.results import indicators
from ocp_traj.results.front_certificate import FrontCertificate
from ocp_traj.results.trajectory import Trajectory, audit_points
from ocp_traj.transcription.symbolic import evaluate_objectives

Point = Mapping[str, float] | Sequence[float]

SAME = 1e-9  # relative: points closer than this in every traded objective are one point; our choice
MOST_VARIABLES = 100  # of a problem, up to which a table has a column for each: our choice
GIVEN, OF_PROBLEM, ENDS, OWN = "given", "problem", "ends", "front"  # where an ideal comes from


@dataclass(frozen=True, eq=False)
class FrontPoint:
    """One trajectory of a front.

    Attributes:
        x: decision vector ``(n,)``.
        objectives: value of every plain objective of the problem, and of the traded ones, in their units.
        trajectory: that x stands for.
        margin: smallest relative margin of its audit; > 0 when every limit is met.
        verdict: of its audit, ``proved``, ``undecided`` or ``violated``.
        alternative: of the problem that it is of; empty where that has none.
    """

    x: Array
    objectives: Mapping[str, float]
    trajectory: Trajectory
    margin: float
    verdict: str
    alternative: str = ""


@dataclass(frozen=True)
class Hypervolume:
    """The volume a front dominates, and the box it is measured in.

    Attributes:
        value: share of the box between ideal and reference that is dominated, 0 to 1.
        volume: the same in the product of the objectives' units.
        reference, ideal: corners of the box, in the objectives' units.
        ideal_from: where the ideal comes from: ``given``; the ``problem``'s ideal point; local solves at the ``ends``
            of this front; or the best of the ``front`` itself, whatever it may be.
    """

    value: float
    volume: float
    reference: Mapping[str, float]
    ideal: Mapping[str, float]
    ideal_from: str

    @property
    def own_ideal(self) -> bool:
        """Whether the ideal is the front's own best, so that ``value`` does not compare with another front's."""
        return self.ideal_from == OWN

    def to_dict(self) -> dict[str, Any]:
        """As plain values."""
        return {**vars(self), "own_ideal": self.own_ideal}


@dataclass(frozen=True, eq=False, repr=False)
class Front(Shown):
    """Trajectories none of which is better than another in all traded objectives.

    Attributes:
        problem: whose front.
        objectives: ids of the traded objectives, two or more, in the order asked for.
        points: ascending in the first of them.
        method, seed, seconds: how it was found, and the time that took [s].
        info: what the method says of its run; ``dropped`` counts the points that were left out.
        certificate: how much hypervolume it leaves out at most, where that was asked for.
    """

    problem: Problem
    objectives: tuple[str, ...]
    points: tuple[FrontPoint, ...]
    method: str
    seed: int | None
    seconds: float
    info: Mapping[str, Any] = field(default_factory=dict)
    certificate: FrontCertificate | None = None

    def __post_init__(self) -> None:
        """Checks the traded objectives."""
        for name in self.objectives:
            self.problem.objective(name)
        if len(set(self.objectives)) < 2 or len(set(self.objectives)) < len(self.objectives):
            raise InputError(
                f"a front trades two or more different objectives; got {', '.join(self.objectives) or 'none'}; "
                f"{self.problem.id} has {', '.join(o.id for o in self.problem.objectives)}"
            )

    @classmethod
    def of(
        cls,
        problem: Problem,
        objectives: Sequence[str],
        xs: Iterable[ArrayLike],
        *,
        method: str,
        seed: int | None,
        seconds: float,
        info: Mapping[str, Any] | None = None,
        keep_unproved: bool = False,
    ) -> Front:
        """Audits decision vectors ``xs (N, n)`` and keeps the non-dominated among the proved ones.

        A point outside the bounds of the variables counts as violated; one whose objectives are not finite counts as
        undecided and is dropped whatever ``keep_unproved`` says; a repeated point counts as dominated.
        """
        empty = cls(problem, tuple(objectives), (), method, seed, seconds)
        vectors = [np.asarray(x, dtype=float) for x in xs]
        for x in vectors:
            if x.shape != (problem.size,):
                raise InputError(f"a point has shape {x.shape}; {problem.id} has {problem.size} variables")
        found = _audited(problem, empty.objectives, vectors)
        dropped = Counter({VIOLATED: 0, UNDECIDED: len(vectors) - len(found), "dominated": 0})
        if not keep_unproved:
            dropped.update(point.verdict for point in found if point.verdict != PROVED)
            found = [point for point in found if point.verdict == PROVED]
        best = non_dominated(empty.traded, found)
        dropped["dominated"] = len(found) - len(best)
        notes = {**(info or {}), "dropped": dict(dropped)}
        return cls(problem, empty.objectives, tuple(best), method, seed, seconds, notes)

    def __len__(self) -> int:
        return len(self.points)

    def _headline(self) -> str:
        words = ", ".join(f"{n} {verdict}" for verdict, n in Counter(point.verdict for point in self.points).items())
        return f"Front of {self.problem.id}: {count(len(self), 'point')}{', ' if words else ''}{words}"

    def _facts(self) -> dict[str, str]:
        ends = zip(self.traded, self.values.T, strict=True)
        return {
            "objectives": ", ".join(
                f"{o.id} [{o.unit}]{f' {v.min():.6g} to {v.max():.6g}' if len(self) else ''} ({o.sense})"
                for o, v in ends
            ),
            "method": self.method + ("" if self.seed is None else f", seed {self.seed}") + f", {self.seconds:.2f} s",
            "left out": ", ".join(f"{n} {why}" for why, n in self.info.get("dropped", {}).items() if n),
            "certificate": "" if self.certificate is None else self.certificate.explain(),
        }

    def _tables(self) -> list[pd.DataFrame]:
        return [self._table(variables=False)]

    @property
    def traded(self) -> tuple[Objective, ...]:
        """The traded objectives themselves."""
        return tuple(self.problem.objective(name) for name in self.objectives)

    @property
    def columns(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each number of a point: plain and traded objectives, then variables."""
        names = [(o.id, o.unit) for o in self.problem.objectives if o.terms is None or o.id in self.objectives]
        for variable in self.problem.variables:
            for label in variable.labels:
                taken = label in (name for name, _ in names)  # blocks may share labels, such as the joints'
                names.append((f"{variable.id} {label}" if taken else label, variable.unit))
        return tuple(names)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each objective and variable, by its name in the table."""
        return dict(self.columns)

    @property
    def table(self) -> pd.DataFrame:
        """One row a point: objectives and variables with units in the column names, ``margin``, ``verdict``.

        Variables are left out where there are more than ``MOST_VARIABLES``; ``full_table`` has them.
        """
        return self._table(variables=self.problem.size <= MOST_VARIABLES)

    @property
    def full_table(self) -> pd.DataFrame:
        """``table`` with every variable, however many there are."""
        return self._table(variables=True)

    def _table(self, *, variables: bool) -> pd.DataFrame:
        plain = [name for name, _ in self.columns[: len(self.columns) - self.problem.size]]
        names = [f"{name} [{unit}]" for name, unit in (self.columns if variables else self.columns[: len(plain)])]
        numbers = [
            [*(point.objectives[name] for name in plain), *(point.x if variables else ())] for point in self.points
        ]
        table = pd.DataFrame(np.array(numbers).reshape(len(self), len(names)), columns=names)
        table["margin"] = np.array([point.margin for point in self.points], dtype=float)
        table["verdict"] = pd.Series([point.verdict for point in self.points], dtype=object)
        return table.rename_axis("point")

    @property
    def values(self) -> Array:
        """Traded objectives ``(points, objectives)`` in their units and their own sense."""
        return _values(self.traded, self.points)

    @property
    def ideal(self) -> dict[str, float]:
        """Best value of each traded objective on the front."""
        return self._mapping(self._costs().min(axis=0))

    @property
    def nadir(self) -> dict[str, float]:
        """Worst value of each traded objective on the front."""
        return self._mapping(self._costs().max(axis=0))

    def trajectory(self, index: int) -> Trajectory:
        """The trajectory of one point."""
        if not -len(self) <= index < len(self):
            raise InputError(f"the front has {len(self)} points, numbered from 0; there is no point {index}")
        return self.points[index].trajectory

    def audit(self, index: int) -> Audit:
        """Every limit of one trajectory at every instant."""
        return self.trajectory(index).audit()

    def hypervolume(self, reference: Point | None = None, ideal: Point | None = None) -> Hypervolume:
        """Volume dominated by the front within the box from the ideal to the reference point, zero for an empty front.

        Points beyond the reference contribute nothing; where one is better than the ideal, it counts as the ideal.

        Args:
            reference: worst values worth having, per objective; by default the problem's reference point.
            ideal: best values; by default the problem's ideal point, else what local solves found at the front's ends
                (``info["ideal"]``), else the front's own, from which nothing compares.
        """
        worst = self._corner(self.problem.reference_point if reference is None else reference, "reference")
        best, source = self._ideal(ideal)
        if source == GIVEN and not (best < worst).all():
            name = self.objectives[int(np.argmin(best < worst))]
            raise InputError(f"the hypervolume's ideal is not better than its reference in {name!r}; move one of them")
        costs = self._costs() if self.points else np.empty((0, len(worst)))
        # None: no point is better than the reference in every objective.
        value = indicators.hypervolume_so_far(costs, worst, best) or 0.0
        volume = value * float(np.prod(worst - best)) if value else 0.0
        return Hypervolume(value, volume, self._mapping(worst), self._mapping(best), source)

    def spread(self) -> float:
        """How unevenly the points lie, 0 for equal gaps; NaN for fewer than three points; see ``indicators.spread``."""
        if len(self) < 3:
            return np.nan
        return indicators.spread(self.normalised())

    def knee(self) -> int:
        """Index of the point that bulges farthest towards the ideal; see ``indicators.knee``."""
        return indicators.knee(self.normalised())

    def normalised(self) -> Array:
        """Traded objectives ``(points, objectives)``, 0 at the ideal and 1 at the nadir; 0 where they are equal."""
        costs = self._costs()
        best = costs.min(axis=0)
        size = costs.max(axis=0) - best
        return np.asarray((costs - best) / np.where(size > 0.0, size, 1.0))

    def _costs(self) -> Array:
        """Traded objectives, signed so that less is better."""
        if not self.points:
            raise InputError(
                f"the front of {self.problem.id} is empty: no proved point was found (dropped: "
                f"{self.info.get('dropped', 'not known')}); give the method more time or another seed"
            )
        return self.values * _signs(self.traded)

    def _mapping(self, costs: Array) -> dict[str, float]:
        return dict(zip(self.objectives, (costs * _signs(self.traded)).tolist(), strict=True))

    def _ideal(self, given: Point | None) -> tuple[Array, str]:
        """The best corner of the hypervolume's box, signed so that less is better, and where it comes from."""
        if given is not None:
            return self._corner(given, "ideal"), GIVEN
        for source, point in (
            (OF_PROBLEM, self.problem.ideal_point(self.objectives)),
            (ENDS, self.info.get("ideal")),
        ):
            if isinstance(point, Mapping) and set(self.objectives) <= set(point):
                return self._corner(point, "ideal"), source
        return (self._costs().min(axis=0) if self.points else np.full(len(self.objectives), np.nan)), OWN

    def _corner(self, point: Point, what: str) -> Array:
        """A corner of the hypervolume's box, signed so that less is better."""
        wanted = ", ".join(self.objectives)
        if isinstance(point, Mapping):
            missing = ", ".join(name for name in self.objectives if name not in point)
            if missing:
                raise InputError(
                    f"the hypervolume's {what} point has no value for {missing}, it has {', '.join(point) or 'none'}; "
                    f"give {what}={{objective: value}} for {wanted}"
                )
            point = [point[name] for name in self.objectives]
        values = np.asarray(point, dtype=float)
        if values.shape != (len(self.objectives),) or not np.isfinite(values).all():
            raise InputError(
                f"the hypervolume's {what} point is {values.tolist()}; give one finite number for each of {wanted}"
            )
        return np.asarray(values * _signs(self.traded))


def _signs(objectives: Sequence[Objective]) -> Array:
    return np.array([1.0 if objective.sense == "min" else -1.0 for objective in objectives])


def _values(objectives: Sequence[Objective], points: Sequence[FrontPoint]) -> Array:
    rows = [[point.objectives[o.id] for o in objectives] for point in points]
    return np.array(rows, dtype=float).reshape(len(points), len(objectives))


def _audited(problem: Problem, traded: tuple[str, ...], vectors: Sequence[Array]) -> list[FrontPoint]:
    """The points whose objectives are finite, audited together."""
    kept = [o.id for o in problem.objectives if o.terms is None or o.id in traded]
    candidates = []
    for x in vectors:
        values = evaluate_objectives(problem, x) if np.isfinite(x).all() else dict.fromkeys(kept, np.nan)
        if all(np.isfinite(values[name]) for name in kept):
            candidates.append((x, {name: values[name] for name in kept}))
    audited = audit_points(problem, [x for x, _ in candidates])
    return [
        FrontPoint(x, values, path, float(audit.margin), audit.verdict)
        for (x, values), (path, audit) in zip(candidates, audited, strict=True)
    ]


def non_dominated(traded: Sequence[Objective], points: Sequence[FrontPoint]) -> list[FrontPoint]:
    """The points no other one dominates, each once, ascending in the first objective."""
    if not points:
        return []
    values = _values(traded, points)
    best = np.flatnonzero(moocore.is_nondominated(values * _signs(traded)))
    best = best[np.lexsort(values[best].T[::-1])]
    kept: list[int] = []
    for i in best:
        if not np.isclose(values[i], values[kept], rtol=SAME, atol=0.0).all(axis=1).any():
            kept.append(int(i))
    return [points[i] for i in kept]
