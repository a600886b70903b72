"""Transcription: a problem and the instants at which its limits are imposed become an NLP.

The curve is expanded in SX once per NLP and gives the states at all instants; limits and objectives are then mapped
over the columns of states, so that the NLP's size, not its build time, grows with the number of instants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, PointConstraint
from ocp_traj.formulation.rows import Row
from ocp_traj.formulation.scalarise import Scalarisation, check_names
from ocp_traj.transcription.local_derivatives import Lifted
from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.symbolic import (
    SymbolicCurve,
    degrees,
    objective_values,
    shape_function,
    states_at,
    variations,
)

Array = NDArray[np.float64]

FEW_SWEEPS = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a swept limit in the first grid: our choice
BACK_OFF = 1e-9  # tightening of every path limit, in its own scale: our choice; it costs about 2e-9 of an objective


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
        sweep: of a swept limit, s_0.
        sweep_slope: of s, like ``slope``.
    """

    limit: str
    segment: int
    u: float
    rows: tuple[int, ...] | None = None
    slope: Array | None = None
    anchor: Array | None = None
    sweep: float = 0.0
    sweep_slope: Array | None = None

    @property
    def moves(self) -> bool:
        """Whether it moves with the variables, in time or along the sweep."""
        return self.slope is not None or self.sweep_slope is not None


def few_instants(problem: Problem) -> tuple[Instant, ...]:
    """The first grid of constraint exchange: degree/2 + 1 instants a segment, at least 3, or as the problem has it.

    A limit on a derivative that is constant, or linear, on its segments gets the 1 or 2 instants that are exact.
    """
    degree = degrees(problem)
    wanted = problem.tuning.instants

    def places(k: int, limit: PathConstraint) -> Sequence[float]:
        if isinstance(wanted, Mapping):
            return wanted.get(limit.id, ())
        return _even(_count(degree[k], limit, wanted))

    return tuple(_grid(problem, places))


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


def _grid(problem: Problem, places: Callable[[int, PathConstraint], Sequence[float]]) -> Iterable[Instant]:
    segments = len(degrees(problem))
    for limit in problem.requirements.path_constraints:
        shared = problem.requirements.continuous(limit)
        for k in filter(limit.holds_on, range(segments)):
            for u in places(k, limit):
                if not (shared and u == 1.0 and k < segments - 1):
                    yield from (
                        Instant(limit.id, k, float(u), sweep=s) for s in (FEW_SWEEPS if limit.sweep else (0.0,))
                    )


def transcribe(
    problem: Problem, scalarisation: Scalarisation, instants: Sequence[Instant], back_off: float = BACK_OFF
) -> NLP:
    """Builds the NLP of a problem, with one objective and its limits imposed at ``instants``.

    Args:
        problem: what to optimise.
        scalarisation: many objectives to one.
        instants: where each path limit is imposed.
        back_off: tightening of the path limits, in units of their scale.

    Returns:
        An NLP over x, over the scalarisation's extra variable if it has one, and over the steps of total variations.
        Slacks of objectives that take no part stay at their lower bounds.
    """
    check_names(problem, scalarisation)
    x = casadi.MX.sym("x", problem.size)
    curve = SymbolicCurve.at(problem, x)
    g: list[Any] = []
    lower: list[float] = []
    upper: list[float] = []
    rows: list[Row] = []
    steps = [
        _step_rows(curve, objective, instants, g, lower, upper, rows)
        for objective in variations(problem, scalarisation.names)
    ]
    given = {s.objective.id: s.objective.scale * casadi.sum1(s.sizes) for s in steps}
    lifted = Lifted(shape_function(problem), problem.cached) if problem.tuning.local_derivatives else None
    shape = SymbolicCurve.at(problem, x, lifted) if lifted else curve
    values = objective_values(shape, dict.fromkeys((*scalarisation.names, *problem.tuning.regularisation)), given)
    scalar = scalarisation.apply(problem, values)
    traces = [w * values[name] / problem.objective(name).scale for name, w in problem.tuning.regularisation.items()]
    for limit in problem.requirements.path_constraints:
        members = [instant for instant in instants if instant.limit == limit.id]
        stay, move = [m for m in members if not m.moves], [m for m in members if m.moves]
        # Of those that move, only derivatives of the joints themselves are lifted: other limits depend on too much.
        lift_all = lifted is not None and limit.order is not None
        for on, some in ((shape, stay), (shape if lift_all else curve, move)):
            if some:
                _path_rows(on, limit, some, back_off, g, lower, upper, rows)
    for point in problem.requirements.point_constraints:
        if not point.structural:
            _point_rows(curve, point, g, lower, upper, rows)
    for name, value, bound in scalar.rows:
        objective = problem.objective(name)
        g.append(value)
        lower.append(-np.inf)
        upper.append(bound)
        label = "bound" if any(row.limit == name for row in rows) else ""  # the goal of an objective, then its bound
        rows.append(Row(name, label, unit=objective.unit, scale=objective.scale))
    extra = [] if scalar.extra is None else [scalar.extra]
    labels = [*("gamma" for _ in extra), *(label for s in steps for label in s.labels)]
    unbounded = np.full(len(labels), np.inf)
    upper_x = np.where(problem.inactive(scalarisation.names), problem.lower, problem.upper)
    functions = [casadi.Function("steps", [x], [s.differences]) for s in steps]

    def complete(numbers: Array) -> Array:
        sizes = [np.abs(np.array(function(numbers)).ravel()) for function in functions]
        return np.concatenate([np.zeros(len(extra)), *sizes])

    f, together = casadi.MX(scalar.f + sum(traces)), casadi.vertcat(*g) if g else casadi.MX(0, 1)
    own = [x, *extra, *(s.sizes for s in steps)]
    derivatives = lifted.derivatives(own, f, together) if lifted else None
    if lifted:
        f, together = lifted.resolved([f, together], x)
    return NLP(
        name=problem.id,
        x=casadi.vertcat(*own),
        f=f,
        g=together,
        derivatives=derivatives,
        lower_x=np.concatenate([problem.lower, -unbounded]),
        upper_x=np.concatenate([upper_x, unbounded]),
        lower_g=np.array(lower, dtype=float),
        upper_g=np.array(upper, dtype=float),
        rows=tuple(rows),
        labels=(*problem.labels, *labels),
        units=(*problem.units, *("-" for _ in labels)),
        complete=complete,
        expand=problem.tuning.expand,
        options=problem.tuning.solver_options,
        memory=problem.cached("solver memory", dict),
    )


@dataclass(frozen=True, eq=False)
class _Steps:
    """The steps e_k - e_{k-1} of a total variation from node to node, and their sizes, extra variables of the NLP."""

    objective: Objective
    differences: Any
    sizes: Any
    labels: tuple[str, ...]


def step_nodes(problem: Problem, objective: Objective, row: int, instants: Sequence[Instant]) -> list[Instant]:
    """The nodes of one row of a total variation: degree + 1 a segment, and the instants given, in order of time."""
    nodes = [
        Instant(objective.id, k, float(u), (row,))
        for k, degree in enumerate(degrees(problem))
        for u in np.linspace(0.0, 1.0, degree + 1)
    ]
    nodes += [instant for instant in instants if instant.limit == objective.id and instant.rows == (row,)]
    return sorted(nodes, key=lambda node: (node.segment, node.u))


def _step_rows(
    curve: SymbolicCurve, objective: Objective, instants: Sequence[Instant],
    g: list[Any], lower: list[float], upper: list[float], rows: list[Row],
) -> _Steps:  # fmt: skip
    """Appends sigma_k >= +-(e_k - e_{k-1}), so that sum sigma is the total variation from node to node at an optimum.

    With every turning point among the nodes that is the total variation; between them it falls short of it.
    """
    limit = curve.problem.variation(objective)
    differences, names = [], []
    for row, label in enumerate(limit.labels):
        nodes = step_nodes(curve.problem, objective, row, instants)
        values = limit_values(curve, limit, nodes)[row, :].T
        inner = [j for j in range(1, len(nodes)) if nodes[j].segment == nodes[j - 1].segment]
        differences.append((values[inner] - values[[j - 1 for j in inner]]) / objective.scale)
        names += [(label, nodes[j]) for j in inner]
    together = casadi.vertcat(*differences)
    sizes = casadi.MX.sym(f"steps of {objective.id}", len(names))
    for way, rows_ in (("rises", sizes - together), ("falls", sizes + together)):
        g.append(rows_)
        lower.extend([0.0] * len(names))
        upper.extend([np.inf] * len(names))
        for label, node in names:
            words = f"{label} {way}"
            rows.append(Row(objective.id, words, node.segment, node.u, objective.unit, objective.scale, defines=True))
    return _Steps(objective, together, sizes, tuple(f"step of {label}" for label, _ in names))


def _path_rows(
    curve: SymbolicCurve, limit: PathConstraint, members: list[Instant], back_off: float,
    g: list[Any], lower: list[float], upper: list[float], rows: list[Row],
) -> None:  # fmt: skip
    """Appends the rows of one path limit at its instants, scaled to order one."""
    entries = [(i, j) for j, m in enumerate(members) for i in (range(len(limit.labels)) if m.rows is None else m.rows)]
    if curve.lifted is not None and members[0].moves:
        values = _moving_derivatives(curve, limit, [(i, members[j]) for i, j in entries])
    else:
        values = casadi.vec(limit_values(curve, limit, members))[[i + j * len(limit.labels) for i, j in entries]]
    low, high = limit.lower / limit.scale + back_off, limit.upper / limit.scale - back_off
    g.append(values / casadi.DM([limit.scale[i] for i, _ in entries]))
    for i, j in entries:
        lower.append(low[i])
        upper.append(high[i])
        rows.append(
            Row(
                limit.id, limit.labels[i], members[j].segment, members[j].u, limit.units[i], float(limit.scale[i]),
                sweep=members[j].sweep,
            )
        )  # fmt: skip


def _moving_derivatives(curve: SymbolicCurve, limit: PathConstraint, entries: Sequence[tuple[int, Instant]]) -> Any:
    """MX expression of a derivative of joints, by (joint, instant that moves), on a lifted curve: ``(entries,)``."""
    assert curve.lifted is not None and limit.order is not None
    problem, x = curve.problem, curve.lifted.symbols[-1]
    values, places = [], []
    for degree in sorted({curve.points[m.segment].shape[0] - 1 for _, m in entries}):
        some = [e for e, (_, m) in enumerate(entries) if curve.points[m.segment].shape[0] - 1 == degree]
        slopes = np.array([entries[e][1].slope for e in some])
        anchors = np.array([entries[e][1].anchor for e in some])
        first = np.array([entries[e][1].u for e in some]) - (slopes * anchors).sum(axis=1)
        points = casadi.horzcat(*(curve.points[entries[e][1].segment][:, entries[e][0]] for e in some))
        durations = casadi.horzcat(*(curve.durations[entries[e][1].segment] for e in some))
        moved = (casadi.mtimes(casadi.sparsify(casadi.DM(slopes)), x) + casadi.DM(first)).T
        function = _moving_derivative(problem, degree, limit.order)
        key = "moving", limit.order, degree
        values.append(curve.lifted(key, function, points, durations, moved))
        places += some
    return casadi.horzcat(*values)[np.argsort(places).tolist()].T


def _moving_derivative(problem: Problem, degree: int, order: int) -> Any:
    """Casadi SX Function (control points of one joint ``(n + 1,)``, T, u, clipped) -> its derivative in time."""

    def build() -> Any:
        points, duration, u = casadi.SX.sym("P", degree + 1), casadi.SX.sym("T"), casadi.SX.sym("u")
        value = PiecewiseBezier(duration, (points,)).at(0, casadi.fmin(casadi.fmax(u, 0.0), 1.0), order)
        return casadi.Function("moving_derivative", [points, duration, u], [value])

    return problem.cached(("moving derivative", degree, order), build)


def limit_values(
    curve: SymbolicCurve,
    limit: PathConstraint,
    members: Sequence[Instant],
    u: Any = None,
    s: Any = None,
) -> Any:
    """MX expression of a path limit at instants: ``(rows, instants)``.

    ``u`` and ``s`` replace the instants' own local times and places along the sweep.
    """
    problem = curve.problem
    local = casadi.vertcat(*(_local_time(m, curve.x) for m in members)) if u is None else u
    segments, n = [m.segment for m in members], len(members)
    if limit.order is not None and curve.lifted is None:
        dof = problem.requirements.dof
        return states_at(curve, segments, local)[limit.order * dof : (limit.order + 1) * dof, :]
    constants = np.zeros((n, 0)) if limit.constants is None else limit.constants[segments]
    function = problem.requirements.function(limit)
    place = local.T
    if limit.sweep:
        along = casadi.vertcat(*(_along(m, curve.x) for m in members)) if s is None else s
        place = casadi.vertcat(place, along.T)
    parameters, given = casadi.repmat(curve.parameters, 1, n), casadi.MX(casadi.DM(constants.T))
    return curve.call(limit.id, function, segments, local, place, parameters, given)


def _local_time(instant: Instant, x: Any) -> Any:
    return _moved(instant.u, instant.slope, instant.anchor, x)


def _along(instant: Instant, x: Any) -> Any:
    return _moved(instant.sweep, instant.sweep_slope, instant.anchor, x)


def _moved(start: float, slope: Array | None, anchor: Array | None, x: Any) -> Any:
    if slope is None or anchor is None:
        return casadi.MX(start)
    few = np.nonzero(slope)[0].tolist()  # an instant moves with the variables of its own segment
    if not few:
        return casadi.MX(start)
    moved = start + casadi.dot(casadi.DM(slope[few]), x[few] - casadi.DM(anchor[few]))
    return casadi.fmin(casadi.fmax(moved, 0.0), 1.0)


def _point_rows(
    curve: SymbolicCurve, point: PointConstraint, g: list[Any], lower: list[float], upper: list[float], rows: list[Row]
) -> None:
    """Appends the rows of one point constraint; they are not scaled."""
    problem = curve.problem
    segments = len(degrees(problem))
    nodes = [(k % segments, u) for k, u in point.at]
    local = casadi.DM([u for _, u in nodes])
    states = states_at(curve, [k for k, _ in nodes], local)
    n = len(nodes)
    values = problem.requirements.function(point).map(n)(
        states, local.T, casadi.repmat(curve.parameters, 1, n), casadi.MX(0, n)
    )
    g.append(casadi.vec(values))
    for j, (k, u) in enumerate(nodes):
        for i, label in enumerate(point.labels):
            lower.append(point.lower[j, i])
            upper.append(point.upper[j, i])
            rows.append(Row(point.id, label, k, u, point.units[i]))
