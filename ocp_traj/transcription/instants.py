"""Instants: where a limit is imposed, and where the instants go as the variables change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.transcription.symbolic import degrees

FEW_SWEEPS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a swept limit in the first grid: our choice


@dataclass(frozen=True, eq=False)
class Instant:
    """An instant at which a limit is imposed, or which is counted in the sum of a total variation.

    It may move with the variables, u(x) = clip(u_0 + s (x - x_0), 0, 1), so as to stay on the peak it was put on.

    Attributes:
        limit: id of the path constraint, or of the objective.
        segment: of the curve.
        u: local time u_0.
        rows: indices of the limit's rows, None for all.
        slope: s ``(n,)``, or None for an instant that stays.
        anchor: x_0 ``(n,)``.
        columns: the variables that slopes and anchor are given for, in order, where not for all ``n``.
        sweep: of a swept limit, s_0.
        sweep_slope: of s, like ``slope``.
        control: of a limit on a derivative, the control point of that derivative on the segment which is held within
            the limit in place of its value at u: all of them hold it on the whole segment (Farin 2002, sect. 4.4).
    """

    limit: str
    segment: int
    u: float
    rows: tuple[int, ...] | None = None
    slope: Array | None = None
    anchor: Array | None = None
    sweep: float = 0.0
    sweep_slope: Array | None = None
    control: int | None = None
    columns: Index | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves with the variables, in time or along the sweep."""
        return self.slope is not None or self.sweep_slope is not None


def few_instants(problem: Problem) -> tuple[Instant, ...]:
    """The first grid of constraint exchange: degree/2 + 1 instants a segment, at least 3, or as the problem has it.

    A limit on a derivative that is constant, or linear, on its segments gets the 1 or 2 instants that are exact; one
    that the problem wants hull rows for, the control points of its derivative.
    """
    degree = degrees(problem)
    wanted, hull = problem.tuning.instants, problem.tuning.hull_rows

    def places(k: int, limit: PathConstraint) -> Sequence[float]:
        if limit.id in hull:
            return _even(max(degree[k] - (limit.order or 0), 0) + 1)
        if isinstance(wanted, Mapping):
            return wanted.get(limit.id, ())
        return _even(_count(degree[k], limit, wanted))

    return tuple(_grid(problem, places, hull))


def few_with(problem: Problem, others: Iterable[Instant], x: Array) -> list[Instant]:
    """The first grid, and other instants where they are at ``x (n,)``, each once."""
    both = [*few_instants(problem), *(frozen(instant, x) for instant in others)]
    return list({(i.limit, i.segment, i.u, i.sweep, i.control, i.rows): i for i in both}.values())


def uniform_instants(problem: Problem, per_segment: int) -> tuple[Instant, ...]:
    """``per_segment`` instants on every segment for every limit, ends included."""
    return tuple(_grid(problem, lambda k, limit: _even(per_segment)))


def _even(count: int) -> Sequence[float]:
    return [float(u) for u in np.linspace(0.0, 1.0, count)] if count > 1 else [0.5]


def _count(degree: int, limit: PathConstraint, wanted: int | None) -> int:
    few = wanted or max(3, degree // 2 + 1)
    if limit.order is None:
        return few
    left = max(degree - limit.order, 0)
    return left + 1 if left < 2 else few


def _grid(
    problem: Problem, places: Callable[[int, PathConstraint], Sequence[float]], hull: Sequence[str] = ()
) -> Iterable[Instant]:
    segments = len(degrees(problem))
    for limit in problem.requirements.path_constraints:
        shared = problem.requirements.continuous(limit)
        for k in filter(limit.holds_on, range(segments)):
            for i, u in enumerate(places(k, limit)):
                if not (shared and u == 1.0 and k < segments - 1):
                    control = i if limit.id in hull else None
                    for sweep in FEW_SWEEPS if limit.sweep else (0.0,):
                        yield Instant(limit.id, k, float(u), sweep=sweep, control=control)


def step_nodes(problem: Problem, objective: Objective, row: int, instants: Sequence[Instant]) -> list[Instant]:
    """The nodes of one row of a total variation: degree + 1 a segment, and the instants given, in order of time."""
    nodes = [
        Instant(objective.id, k, float(u), (row,))
        for k, degree in enumerate(degrees(problem))
        for u in np.linspace(0.0, 1.0, degree + 1)
    ]
    nodes += [instant for instant in instants if instant.limit == objective.id and instant.rows == (row,)]
    return sorted(nodes, key=lambda node: (node.segment, node.u))


def where(instant: Instant, x: Array) -> float:
    """Local time of an instant at x."""
    return _moved(instant, instant.u, instant.slope, x)


def along(instant: Instant, x: Array) -> float:
    """Place along the sweep of an instant at x."""
    return _moved(instant, instant.sweep, instant.sweep_slope, x)


def _moved(instant: Instant, start: float, slope: Array | None, x: Array) -> float:
    if slope is None or instant.anchor is None:
        return start
    own = x if instant.columns is None else x[instant.columns]
    return float(np.clip(start + slope @ (own - instant.anchor), 0.0, 1.0))


def frozen(instant: Instant, x: Array) -> Instant:
    """The instant where it now is; that it has an anchor still tells it from the grid's."""
    return replace(instant, u=where(instant, x), slope=None, sweep=along(instant, x), sweep_slope=None)
