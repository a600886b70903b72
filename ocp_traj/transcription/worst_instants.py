"""Where a curve breaks its limits: the instants that constraint exchange adds, each on a peak and moving with it.

At a peak g_u = 0 and, of a swept limit, g_s = 0, so that g_(us)x dx + H d(u, s) = 0 with H the Hessian over (u, s) says
how it moves with the variables; at an end of [0, 1] towards which the limit rises a coordinate stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import basis
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import SWEEP, PathConstraint
from ocp_traj.transcription.chosen_values import ChosenValues
from ocp_traj.transcription.instant_values import InstantValues, InstantValuesAt, Peak
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.kernel import chosen_kernel, limit_kernel
from ocp_traj.transcription.shape import ShapeAt, shape_of

SCAN = 48  # samples a segment when looking for peaks: our choice, far denser than the degrees in use have peaks
SCAN_CHOSEN = 17  # of limits whose constants are chosen, whose curves have many segments: our choice
FIRST_CHOSEN = 7  # instants a segment of such limits in the first grid, its end left out: our choice
SCAN_LOWEST, EVERY = 33, 2  # samples a segment of the lowest rows, and which of these are taken in any case: our choice
NEARBY = 1.0  # of its size: a row of such a limit that is farther above its bound is not looked at; our choice
FINE = 33  # samples about a sample that stands out, from one neighbour to the other: our choice
NEWTON, NEWTON_SWEPT = 4, 8  # steps: our choice
SETTLED = 1e-10  # of a segment: a step this short is the last; our choice
RACING = 1e3  # segments a peak moves when x doubles: it is so flat that an instant that stays holds it as well
FLAT = 1e-9  # of a curvature in local time: a peak no more curved than this stays where it is


def worst_instants(problem: Problem, x: Array, back_off: float, near: float = 0.0) -> tuple[list[Instant], float]:
    """The peaks of all path limits of x ``(n,)`` above their bounds less ``back_off`` and ``near``, in their scale.

    Returns:
        the peaks, as instants that move with the variables where the problem has instants move; and by how much the
        worst is above its bound, in its scale; 0 where none is.
    """
    shape = shape_of(problem).at(x)
    found: list[Instant] = []
    worst = 0.0
    for limit in problem.path_limits:
        # Hull rows hold a limit between instants: of it a peak is one that breaks the limit itself.
        inside = 0.0 if limit.id in problem.tuning.hull_rows else back_off
        peaks = _ChosenPeaks if isinstance(limit, ChosenLimit) else _Peaks
        members, excess = peaks(problem, limit, shape, inside, near).sharpened()
        found += members
        worst = max(worst, excess - inside)
    return found, worst


def follow(problem: Problem, name: str, members: Sequence[Instant], x: Array) -> list[Instant]:
    """Instants of a limit or total variation, a row each, on stationary points, made to move where sensible."""
    if not members:
        return []
    shape = shape_of(problem)
    values = InstantValues.of(problem, name, [replace(m, slope=None, anchor=None) for m in members])
    at = values.at(shape.at(x))
    rows = np.array([(m.rows or (0,))[0] for m in members])
    found = at.peak(_one_row(rows, values.kernel.rows))
    free = np.array([[0.0 < m.u < 1.0, False] for m in members])
    return _moving(list(members), found, free, values, x)


class _Peaks:
    """The peaks of one limit."""

    def __init__(self, problem: Problem, limit: PathConstraint, shape: ShapeAt, back_off: float, near: float) -> None:
        self.problem, self.limit, self.shape, self.near = problem, limit, shape, near
        self.low, self.high = limit.lower / limit.scale + back_off, limit.upper / limit.scale - back_off
        self.segments = np.array(list(filter(limit.holds_on, range(len(shape.durations)))), dtype=np.intp)

    def sharpened(self) -> tuple[list[Instant], float]:
        """Local maxima of the excess above ``-near``, by Newton's method from a scan; and the largest excess."""
        segments, rows, u, sweep = self._scanned()
        if not len(rows):
            return [], 0.0
        return self._sharpened(segments, rows, u, sweep)

    def _sharpened(self, segments: Index, rows: Index, u: Array, sweep: Array | None) -> tuple[list[Instant], float]:
        values = self._values(segments, u, sweep, rows)
        width = (
            np.array([1.0 / (SCAN - 1), SWEEP[1]])
            if self.limit.sweep
            else np.array([2.0 / (SCAN - 1) / (FINE - 1)] * 2)
        )
        weights = _one_row(self._entries(rows), values.kernel.rows) / self.limit.scale[rows][:, None]
        first = np.stack([u, np.zeros_like(u) if sweep is None else sweep], axis=1)
        places = first.copy()
        at = self._at(values, places)
        begun = self._excess(at, rows)
        side = np.where(begun[1], 1.0, -1.0)
        lowest, highest = np.maximum(first - width, 0.0), np.minimum(first + width, 1.0)
        found = at.peak(weights)
        free = self._free(places, found, side)
        for _ in range(NEWTON_SWEPT if self.limit.sweep else NEWTON):
            before, places = places, np.clip(places + _newton_step(found, free), lowest, highest)
            if np.abs(places - before).max() <= SETTLED:
                places = before
                break
            at = self._at(values, places)
            found = at.peak(weights)
            free = self._free(places, found, side)
        excess = self._excess(at, rows)
        # Newton's method may lead downhill: there the peak is a corner at the end of a segment, and stays.
        astray = excess[0] < begun[0]
        kept_places = np.where(astray[:, None], first, places).tolist()
        members = [
            Instant(self.limit.id, int(k), u, (int(i),), sweep=s if self.limit.sweep else 0.0)
            for k, i, (u, s) in zip(segments, rows, kept_places, strict=True)
        ]
        free &= ~astray[:, None] & self.problem.tuning.instants_move
        largest = np.maximum(excess[0], begun[0])
        kept = np.nonzero(largest > -self.near)[0]
        if not len(kept):
            return [], 0.0
        moved = _moving(members, found, free, values, self.shape.x)
        return [moved[i] for i in kept.tolist()], float(largest.max())

    def _entries(self, rows: Index) -> Index:
        """Which of the values at an instant belongs to a row, of rows ``(N,)``."""
        return rows

    def _values(self, segments: Index, u: Array, sweep: Array | None, rows: Index | None = None) -> InstantValues:
        limit = self.limit
        return InstantValues(
            self.shape.shape, limit_kernel(self.problem, limit.id), segments, u, sweep,
            constants=None if limit.constants is None else limit.constants[segments],
        )  # fmt: skip

    def _at(self, values: InstantValues, places: Array) -> InstantValuesAt:
        return InstantValuesAt(values, self.shape, places[:, 0], places[:, 1] if self.limit.sweep else None)

    def _excess(self, at: InstantValuesAt, rows: Index) -> tuple[Array, NDArray[np.bool_]]:
        """Scaled excess of one row an instant ``(N,)``, and whether that is over the upper bound."""
        own = at.values[np.arange(len(rows)), self._entries(rows)] / self.limit.scale[rows]
        over, under = own - self.high[rows], self.low[rows] - own
        return np.maximum(over, under), over >= under

    def _scanned(self) -> tuple[Index, Index, Array, Array | None]:
        """Segments, rows, local times and sweeps near which the excess has a peak above ``-near``, or may have one."""
        limit, key = self.limit, ("scan", self.limit.id)
        u = np.linspace(0.0, 1.0, SCAN)
        sweeps = len(SWEEP) if limit.sweep else 1
        segments = np.repeat(self.segments, SCAN * sweeps)
        each = np.tile(np.repeat(u, sweeps), len(self.segments))
        across = np.tile(SWEEP, SCAN * len(self.segments)) if limit.sweep else None
        grid: InstantValues = self.problem.cached(key, lambda: self._values(segments, each, across))
        values = grid.at(self.shape).values / limit.scale
        table = np.moveaxis(values.reshape(len(self.segments), SCAN, sweeps, -1), 3, 1)  # (K, rows, SCAN, sweeps)
        high, low = self.high[:, None, None], self.low[:, None, None]
        if limit.sweep:
            k, row, i, j = np.nonzero(_stands_out_swept(np.maximum(table - high, low - table) + self.near))
            return self.segments[k], row, u[i], SWEEP[j]
        parts: list[tuple[Index, Index, Array]] = []
        for side, bound in ((1.0, high), (-1.0, -low)):
            k, row, i, _ = np.nonzero(_stands_out(side * table - bound + self.near))
            if len(k):
                parts.append((k, row, self._closer(self.segments[k], row, u[i], side)))
        if not parts:
            return np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), None
        k, row, place = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        return self.segments[k], row, place, None

    def _closer(self, segments: Index, rows: Index, u: Array, side: float) -> Array:
        """The highest of finer samples about each: narrow peaks lie where Newton's method would go astray."""
        close = np.clip(u[:, None] + np.linspace(-1.0, 1.0, FINE) / (SCAN - 1), 0.0, 1.0)
        values = self._values(np.repeat(segments, FINE), close.ravel(), None, np.repeat(rows, FINE)).at(self.shape)
        table = values.values.reshape(*close.shape, -1)
        own = np.take_along_axis(table, self._entries(rows)[:, None, None], axis=2)[:, :, 0]
        own = np.where(np.isfinite(own), own, -side * np.inf)
        return np.asarray(close[np.arange(len(rows)), np.argmax(side * own, axis=1)])

    def _free(self, places: Array, found: Peak, side: Array) -> NDArray[np.bool_]:
        """Which of (u, s) ``(N, 2)`` are not held at an end of [0, 1] by a limit that still rises towards it."""
        rising = side[:, None] * np.stack([found.u, found.s], axis=1)
        held = ((places <= 0.0) & (rising < 0.0)) | ((places >= 1.0) & (rising > 0.0))
        free = ~held
        if not self.limit.sweep:
            free[:, 1] = False
        return np.asarray(free)


class _ChosenPeaks(_Peaks):
    """The peaks of one limit whose constants are chosen: of its rows only those near their bounds are looked at."""

    limit: ChosenLimit

    def sharpened(self) -> tuple[list[Instant], float]:
        """See ``_Peaks``; rows with one expression together."""
        segments, rows, u, _ = self._scanned()
        members: list[Instant] = []
        worst = 0.0
        for some in _alike(self.limit, rows):
            found, excess = self._sharpened(segments[some], rows[some], u[some], None)
            members += found
            worst = max(worst, excess)
        return members, worst

    def _entries(self, rows: Index) -> Index:
        return np.zeros_like(rows)

    def _values(self, segments: Index, u: Array, sweep: Array | None, rows: Index | None = None) -> InstantValues:
        assert rows is not None and len(rows)
        kernel = chosen_kernel(self.problem, self.limit, int(rows[0]))
        return ChosenValues(self.shape.shape, kernel, segments, u, self.limit, rows)

    def _scanned(self) -> tuple[Index, Index, Array, Array | None]:
        u = np.linspace(0.0, 1.0, SCAN_CHOSEN)
        excess = -near_values(self.limit, self.shape, self.segments, u, NEARBY) / self.limit.size
        k, row, i, _ = np.nonzero(_stands_out(excess[..., None] + self.near))
        segments, rows, place = self.segments[k], row.astype(np.intp), u[i]
        for some in _alike(self.limit, rows):
            place[some] = self._closer(segments[some], rows[some], place[some], -1.0)
        return segments, rows, place, None


def near_values(limit: ChosenLimit, shape: ShapeAt, segments: Index, u: Array, within: float) -> Array:
    """How far a chosen limit's rows are above their bounds ``(K, rows, instants)``, infinite where that is far.

    Args:
        limit: whose.
        shape: its curve at one x.
        segments: of the curve ``(K,)``.
        u: local times of the instants, on each of them.
        within: its sizes above its bounds up to which rows are looked at.
    """
    each = np.repeat(segments, len(u))
    q = np.concatenate(
        [
            basis(int(n), u) @ shape.points[k, : n + 1]
            for k, n in zip(segments, shape.shape.degrees[segments], strict=True)
        ]
    )
    found = limit.above(q, shape.parameters[each], within * limit.size)
    return found.reshape(len(segments), len(u), -1).swapaxes(1, 2)


def deepest(problem: Problem, x: Array) -> float:
    """By how much limits whose constants are chosen are broken most at ``x (n,)``, in their size; 0 where they hold."""
    shape, worst = shape_of(problem).at(x), 0.0
    u = np.linspace(0.0, 1.0, SCAN_CHOSEN)
    for limit in problem.chosen_limits:
        segments = np.array(list(filter(limit.holds_on, range(len(shape.durations)))), dtype=np.intp)
        worst = max(worst, -float(near_values(limit, shape, segments, u, 0.0).min()) / limit.size)
    return worst


def near_instants(problem: Problem, x: Array) -> list[Instant]:
    """A first grid of limits whose constants are chosen: where their rows are near their bounds at ``x (n,)``."""
    shape, found = shape_of(problem).at(x), []
    u = np.linspace(0.0, 1.0, FIRST_CHOSEN)
    for limit in problem.chosen_limits:
        segments = np.array(list(filter(limit.holds_on, range(len(shape.durations)))), dtype=np.intp)
        above = near_values(limit, shape, segments, u[:-1], limit.within)
        rows: dict[tuple[int, int], list[int]] = {}
        for k, row, i in np.argwhere(np.isfinite(above)).tolist():
            rows.setdefault((k, i), []).append(row)
        found += [Instant(limit.id, int(segments[k]), float(u[i]), tuple(own)) for (k, i), own in rows.items()]
    return found


def broken_instants(problem: Problem, x: Array) -> list[Instant]:
    """Peaks of what limits whose constants are chosen are broken by at ``x (n,)``, as instants that stay."""
    shape, found = shape_of(problem).at(x), []
    for limit in problem.chosen_limits:
        members, excess = _ChosenPeaks(problem, limit, shape, 0.0, 0.0).sharpened()
        found += [replace(m, slope=None, anchor=None, columns=None) for m in members if excess > 0.0]
    return found


def lowest_instants(problem: Problem, x: Array, within: float) -> list[Instant]:
    """Where rows of limits whose constants are chosen are lowest in time at ``x (n,)``, and every few samples between.

    Args:
        problem: whose.
        x: where.
        within: their sizes above their bounds up to which rows are looked at.
    """
    shape, found = shape_of(problem).at(x), []
    u = np.linspace(0.0, 1.0, SCAN_LOWEST)
    for limit in problem.chosen_limits:
        segments = np.array(list(filter(limit.holds_on, range(len(shape.durations)))), dtype=np.intp)
        above = near_values(limit, shape, segments, u, within * limit.within)
        around = np.pad(above, ((0, 0), (0, 0), (1, 1)), constant_values=np.inf)
        least = (above <= around[:, :, :-2]) & (above < around[:, :, 2:]) | (np.arange(len(u)) % EVERY == 0)
        rows: dict[tuple[int, int], list[int]] = {}
        for k, row, i in np.argwhere(
            np.isfinite(above) & least & (above < within * limit.within * limit.size)
        ).tolist():
            rows.setdefault((k, i), []).append(row)
        found += [Instant(limit.id, int(segments[k]), float(u[i]), tuple(own)) for (k, i), own in rows.items()]
    return found


def _alike(limit: ChosenLimit, rows: Index) -> list[Index]:
    """Places of rows that share an expression, of rows ``(N,)``."""
    numbers = {expression: i for i, expression in enumerate(dict.fromkeys(limit.expressions))}
    each = np.array([numbers[limit.expressions[row]] for row in rows.tolist()], dtype=np.intp)
    return [np.flatnonzero(each == number) for number in np.unique(each)]


def _one_row(rows: Index, count: int) -> Array:
    """Weights ``(N, count)`` that choose one row an instant."""
    weights = np.zeros((len(rows), count))
    weights[np.arange(len(rows)), rows] = 1.0
    return weights


def _stands_out(excess: Array) -> NDArray[np.bool_]:
    """Which samples, along the axis before the last, are peaks of an excess that is, or may be between, above zero."""
    edge = np.full_like(excess[..., :1, :], -np.inf)
    left, right = (
        np.concatenate(parts, axis=-2) for parts in ((edge, excess[..., :-1, :]), (excess[..., 1:, :], edge))
    )
    with np.errstate(invalid="ignore"):  # of a side without a bound
        falls = np.stack([excess - left, excess - right])
    fall = np.where(np.isfinite(falls), falls, 0.0).max(axis=0)
    return np.asarray((excess >= left) & (excess > right) & (excess > -fall))


def _stands_out_swept(excess: Array) -> NDArray[np.bool_]:
    """Likewise over local times and sweeps, the last two axes."""
    rows, columns = excess.shape[-2:]
    padded = np.pad(excess, ((0, 0), (0, 0), (1, 1), (1, 1)), constant_values=-np.inf)
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    around = np.stack([padded[..., i : i + rows, j : j + columns] for i, j in shifts])
    with np.errstate(invalid="ignore"):
        falls = np.where(np.isfinite(around), excess - around, 0.0)
    return np.asarray((excess >= around.max(axis=0)) & (excess > -np.abs(falls).max(axis=0)))


def _hessians(found: Peak, free: NDArray[np.bool_]) -> Array:
    """Hessians over (u, s) ``(N, 2, 2)``, with one where a coordinate is held."""
    both = free.all(axis=1)
    cross = np.where(both, found.us, 0.0)
    uu, ss = np.where(free[:, 0], found.uu, 1.0), np.where(free[:, 1], found.ss, 1.0)
    return np.stack([np.stack([uu, cross], axis=1), np.stack([cross, ss], axis=1)], axis=1)


def _newton_step(found: Peak, free: NDArray[np.bool_]) -> Array:
    """Steps ``(N, 2)`` towards the stationary point; none where the Hessian is singular."""
    gradient = np.where(free, np.stack([found.u, found.s], axis=1), 0.0)
    hessian = _hessians(found, free)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        determinant = hessian[:, 0, 0] * hessian[:, 1, 1] - hessian[:, 0, 1] ** 2
        step = -np.stack(
            [
                hessian[:, 1, 1] * gradient[:, 0] - hessian[:, 0, 1] * gradient[:, 1],
                hessian[:, 0, 0] * gradient[:, 1] - hessian[:, 0, 1] * gradient[:, 0],
            ],
            axis=1,
        ) / determinant[:, None]  # fmt: skip
    return np.nan_to_num(step, nan=0.0, posinf=0.0, neginf=0.0)


def _moving(
    members: list[Instant], found: Peak, free: NDArray[np.bool_], values: InstantValues, x: Array
) -> list[Instant]:
    """The instants with the slopes of their free coordinates; those that would race, or are on a flat peak, stay."""
    columns = values.shape.columns[values.segments]
    hessian, moved = _hessians(found, free), []
    curved = np.abs(np.linalg.eigvalsh(hessian)).min(axis=1) > FLAT
    for j, member in enumerate(members):
        member = replace(member, slope=None, sweep_slope=None, anchor=None, columns=None)
        if curved[j] and free[j].any():
            cross = np.where(free[j][:, None], np.stack([found.ux[j], found.sx[j]]), 0.0)
            own = columns[j][columns[j] < len(x)]
            slopes = -np.linalg.solve(hessian[j], cross)[:, : len(own)]
            if np.abs(slopes * x[own]).max(initial=0.0) <= RACING:
                u, sweep = (slope if here else None for slope, here in zip(slopes, free[j].tolist(), strict=True))
                member = replace(member, slope=u, sweep_slope=sweep, anchor=x[own], columns=own)
        moved.append(member)
    return moved
