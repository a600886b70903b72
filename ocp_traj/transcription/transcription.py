"""Transcription: a problem and the instants at which its limits are imposed become an NLP."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, PointConstraint
from ocp_traj.formulation.rows import Row
from ocp_traj.formulation.scalarise import Scalarisation, check_names, value_of
from ocp_traj.transcription.chosen_values import chosen_values
from ocp_traj.transcription.derivative_values import DerivativeValues
from ocp_traj.transcription.instant_program import InstantProgram, Rows
from ocp_traj.transcription.instant_values import InstantValues
from ocp_traj.transcription.instants import Instant, step_nodes
from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.scalar_objective import ScalarObjective
from ocp_traj.transcription.shape import ShapeAt, shape_of
from ocp_traj.transcription.symbolic import degrees, evaluate_objectives, variations
from ocp_traj.transcription.symbolic_nlp import symbolic_nlp

BACK_OFF = 1e-9  # tightening of every path limit, in its own scale: our choice; it costs about 2e-9 of an objective


def transcribe(
    problem: Problem, scalarisation: Scalarisation, instants: Sequence[Instant], back_off: float = BACK_OFF,
    about: Array | None = None,
) -> NLP:  # fmt: skip
    """Builds the NLP of a problem, with one objective and its limits imposed at ``instants``.

    Args:
        problem: what to optimise.
        scalarisation: many objectives to one.
        instants: where each path limit is imposed.
        back_off: tightening of the path limits, in units of their scale.
        about: where limits whose constants are chosen are taken to first order in the joints ``(n,)``; None for as
            they are.

    Returns:
        An NLP over x, over the scalarisation's extra variable if it has one, and over the steps of total variations.
        Slacks of objectives that take no part stay at their lower bounds.
    """
    check_names(problem, scalarisation)
    scalar = _scalar(problem, scalarisation)
    table = _Table(problem, None if about is None else shape_of(problem).at(about))
    steps = [table.steps(objective, instants) for objective in variations(problem, scalarisation.names)]
    for limit in problem.path_limits:
        members = [instant for instant in instants if instant.limit == limit.id]
        if members:
            table.limit(limit, members, back_off)
    table.collect_derivatives()
    for point in problem.requirements.point_constraints:
        if not point.structural:
            table.point(point)
    count = len(table.rows)
    for name, bound in scalar.rows:
        objective = problem.objective(name)
        table.lower.append(-np.inf)
        table.upper.append(bound)
        label = "bound" if any(row.limit == name for row in table.rows) else ""  # an objective's goal, then its bound
        table.rows.append(Row(name, label, unit=objective.unit, scale=objective.scale))
    coupling = tuple(np.concatenate([*arrays, np.zeros(0)]) for arrays in (table.coupled, table.sigma, table.factor))
    labels = [*("gamma",) * scalar.extra, *(label for s in steps for label in s.labels)]
    unbounded = np.full(len(labels), np.inf)

    def initial_slacks(x: Array) -> Array:
        # The least of the scalarisation's own variable that its rows allow there.
        own = [value_of(problem, scalarisation, evaluate_objectives(problem, x))[0]] if scalar.extra else []
        return np.concatenate([np.array(own), *(s.sizes(problem, x) for s in steps)])

    program = InstantProgram(
        problem, scalar, table.parts, count, [(s.objective.id, len(s.labels)) for s in steps],
        (coupling[0].astype(np.intp), coupling[1].astype(np.intp), coupling[2]),
        lambda: symbolic_nlp(problem, scalarisation, instants),
    )  # fmt: skip
    return NLP(
        name=problem.id,
        program=program,
        lower_x=np.concatenate([problem.lower, -unbounded]),
        upper_x=np.concatenate(
            [np.where(problem.inactive(scalarisation.names), problem.lower, problem.upper), unbounded]
        ),
        lower_g=np.array(table.lower, dtype=float),
        upper_g=np.array(table.upper, dtype=float),
        rows=tuple(table.rows),
        labels=(*problem.labels, *labels),
        units=(*problem.units, *("-" for _ in labels)),
        initial_slacks=initial_slacks,
        bounds_as_rows=_bounds_as_rows(problem),
        options=problem.tuning.solver_options,
    )


def _bounds_as_rows(problem: Problem) -> tuple[tuple[int, float, Row], ...]:
    """The bounds on variables that a limit gives, as rows of it; see ``NLP``."""

    def build() -> tuple[tuple[int, float, Row], ...]:
        limits = {limit.id: limit for limit in problem.requirements.path_constraints}
        ranges = {point.id for point in problem.requirements.point_constraints}
        origins = [origin for v in problem.variables for origin in v.bounded_by or (("", ""),) * len(v.labels)]
        found = []
        for i, ((limit, label), low, high) in enumerate(zip(origins, problem.lower, problem.upper, strict=True)):
            if limit in ranges:
                found.append((i, 1.0, Row(limit, label, unit=problem.units[i])))
            elif limit in limits and high > 0.0 and np.isfinite(high):
                one, entry = limits[limit], limits[limit].labels.index(label)
                factor = float(one.upper[entry] / one.scale[entry] / high)
                if abs(low * factor - one.lower[entry] / one.scale[entry]) <= 1e-9:
                    found.append((i, factor, Row(limit, label, unit=one.units[entry], scale=float(one.scale[entry]))))
        return tuple(found)

    rows: tuple[tuple[int, float, Row], ...] = problem.cached("bounds as rows", build)
    return rows


def _scalar(problem: Problem, scalarisation: Scalarisation) -> ScalarObjective:
    """The objectives as one, compiled once for the rounds of a solve."""
    memory: dict[str, Any] = problem.cached("scalarisation", dict)
    if memory.get("of") is not scalarisation:
        memory["of"], memory["compiled"] = scalarisation, ScalarObjective(problem, scalarisation)
    compiled: ScalarObjective = memory["compiled"]
    return compiled


@dataclass(frozen=True, eq=False)
class _Steps:
    """The steps e_k - e_{k-1} of a total variation from node to node, and their sizes, extra variables of the NLP."""

    objective: Objective
    values: InstantValues
    ends: tuple[Index, Index, Index]  # node before, node after, entry
    labels: tuple[str, ...]

    def sizes(self, problem: Problem, x: Array) -> Array:
        """The sizes at x ``(n,)``."""
        values = self.values.at(shape_of(problem).at(x)).values
        before, after, entry = self.ends
        return np.asarray(np.abs(values[after, entry] - values[before, entry]) / self.objective.scale)


@dataclass(eq=False)
class _Table:
    """Rows of an NLP with their bounds, as they are collected."""

    problem: Problem
    about: ShapeAt | None
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    parts: list[Rows] = field(default_factory=list)
    derivatives: list[tuple[int, float, tuple[int, int, Instant]]] = field(default_factory=list)
    coupled: list[Any] = field(default_factory=list)
    sigma: list[Any] = field(default_factory=list)
    factor: list[Any] = field(default_factory=list)

    def steps(self, objective: Objective, instants: Sequence[Instant]) -> _Steps:
        """Rows sigma_k >= +-(e_k - e_{k-1}): sum sigma is the total variation from node to node at an optimum.

        With every turning point among the nodes that is the total variation; between them it falls short of it.
        """
        limit = self.problem.variation(objective)
        nodes: list[Instant] = []
        ends: list[tuple[int, int, int]] = []
        for row in range(len(limit.labels)):
            own = step_nodes(self.problem, objective, row, instants)
            places = range(len(nodes), len(nodes) + len(own))
            ends += [
                (a, b, row) for a, b in pairwise(places) if own[a - places[0]].segment == own[b - places[0]].segment
            ]
            nodes += own
        values = InstantValues.of(self.problem, objective.id, nodes)
        before, after, entry = np.array(ends, dtype=np.intp).reshape(-1, 3).T
        count, first, offset = len(ends), len(self.rows), sum(len(s) for s in self.sigma) // 2
        for side, way in ((-1.0, "rises"), (1.0, "falls")):
            begin = len(self.rows)
            both = np.arange(begin, begin + count)
            factor = np.full(count, side / objective.scale)
            self.parts.append(
                Rows(
                    values, np.tile(both, 2), np.concatenate([after, before]), np.tile(entry, 2),
                    np.concatenate([factor, -factor]),
                )
            )  # fmt: skip
            self.coupled.append(both)
            self.sigma.append(offset + np.arange(count))
            self.factor.append(np.ones(count))
            self.lower += [0.0] * count
            self.upper += [np.inf] * count
            for _, b, row in ends:
                words, node = f"{limit.labels[row]} {way}", nodes[b]
                self.rows.append(
                    Row(objective.id, words, node.segment, node.u, objective.unit, objective.scale, defines=True)
                )
        assert len(self.rows) == first + 2 * count
        labels = tuple(f"step of {limit.labels[row]}" for _, _, row in ends)
        return _Steps(objective, values, (before, after, entry), labels)

    def limit(self, limit: PathConstraint, members: Sequence[Instant], back_off: float) -> None:
        """Rows of one path limit at its instants, scaled to order one."""
        entries = [
            (i, j) for j, m in enumerate(members) for i in (range(len(limit.labels)) if m.rows is None else m.rows)
        ]
        entry, instant = np.array(entries, dtype=np.intp).reshape(-1, 2).T
        rows, factor = len(self.rows) + np.arange(len(entries)), 1.0 / limit.scale[entry]
        if isinstance(limit, ChosenLimit):
            chosen = chosen_values(self.problem, limit, entry.tolist(), [members[j] for _, j in entries])
            for some, values in chosen:
                count = np.arange(len(some))
                kept = values if self.about is None else values.linear(self.problem, self.about)
                self.parts.append(Rows(kept, rows[some], count, np.zeros_like(count), factor[some]))
        elif limit.order is None:
            self.parts.append(Rows(InstantValues.of(self.problem, limit.id, members), rows, instant, entry, factor))
        else:
            derivatives = [(limit.order, i, members[j]) for i, j in entries]
            self.derivatives += zip(rows.tolist(), factor.tolist(), derivatives, strict=True)
        self.lower += (limit.lower / limit.scale + back_off)[entry].tolist()
        self.upper += (limit.upper / limit.scale - back_off)[entry].tolist()
        self.rows += [row_of(limit, members[j], i) for i, j in entries]

    def collect_derivatives(self) -> None:
        """Puts the rows of all limits on derivatives of joints together."""
        if self.derivatives:
            rows, factor, entries = zip(*self.derivatives, strict=True)
            count = np.arange(len(rows))
            values = DerivativeValues(self.problem, entries)
            self.parts.append(
                Rows(values, np.array(rows, dtype=np.intp), count, np.zeros_like(count), np.array(factor))
            )

    def point(self, point: PointConstraint) -> None:
        """Rows of one point constraint; they are not scaled."""
        segments = len(degrees(self.problem))
        nodes = [Instant(point.id, k % segments, u) for k, u in point.at]
        shape = (len(nodes), len(point.labels))
        instant, entry = (index.ravel() for index in np.indices(shape))
        begin = len(self.rows)
        self.parts.append(
            Rows(
                InstantValues.of(self.problem, point.id, nodes), np.arange(begin, begin + len(entry)), instant, entry,
                np.ones(len(entry)),
            )
        )  # fmt: skip
        self.lower += point.lower.ravel().tolist()
        self.upper += point.upper.ravel().tolist()
        self.rows += [
            Row(point.id, label, node.segment, node.u, unit)
            for node in nodes
            for label, unit in zip(point.labels, point.units, strict=True)
        ]


def row_of(limit: PathConstraint, instant: Instant, i: int) -> Row:
    """The NLP's row of a limit's row i at an instant: what multipliers are matched by."""
    scale = float(limit.scale[i])
    place = instant.segment, instant.u
    return Row(
        limit.id, limit.labels[i], *place, limit.units[i], scale, sweep=instant.sweep, control=instant.control
    )  # fmt: skip
