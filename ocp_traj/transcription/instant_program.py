"""The NLP of a problem at instants, in numbers.

Nothing is built for a set of instants but index arrays: the functions at instants are compiled once for a problem (see
``kernel``), evaluated for all instants together, and their small derivatives are summed where they belong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import casadi
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.problem import Problem
from ocp_traj.transcription.derivative_values import DerivativeValues
from ocp_traj.transcription.hessian_sum import HessianSum, distinct, gathered
from ocp_traj.transcription.instant_values import InstantValues
from ocp_traj.transcription.objective_parts import Integral, OfVariables
from ocp_traj.transcription.program import Symbols
from ocp_traj.transcription.scalar_objective import ScalarObjective
from ocp_traj.transcription.shape import shape_of

IDLE = 1e-7  # of the largest multiplier: a row with less is at rest, and its curvature left out; our choice


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of g that are sums of values at instants times factors, g[row[e]] += factor[e] V[instant[e], entry[e]].

    Attributes:
        values: of the function at its instants.
        row, instant, entry: ``(E,)``.
        factor: ``(E,)``.
    """

    values: InstantValues | DerivativeValues
    row: Index
    instant: Index
    entry: Index
    factor: Array


class _Pattern:
    """Where things stand in the Hessian of a problem, whatever its instants: compiled once for a set of objectives."""

    def __init__(self, problem: Problem, names: Sequence[str]) -> None:
        shape = shape_of(problem)
        n = self.size = problem.size
        columns = shape.columns
        self.integrals: dict[str, Integral] = {}
        self.functions: dict[str, OfVariables] = {}
        for name in names:
            objective = problem.objective(name)
            if objective.integrand is not None:
                self.integrals[name] = problem.cached(("integral", name), partial(Integral, problem, objective))
            elif objective.of_variables is not None:
                self.functions[name] = problem.cached(("of variables", name), partial(OfVariables, problem, objective))
        outer = (*columns.shape, columns.shape[1])
        blocks = np.stack(
            [np.broadcast_to(c, outer).ravel() for c in (columns[:, :, None], columns[:, None, :])], axis=1
        )
        bend = np.array(shape.bend_sparsity.get_triplet(), dtype=np.intp).T.reshape(-1, 2)
        pairs = [blocks, bend, *(i.pairs() for i in self.integrals.values())]
        pairs += [f.triplet for f in self.functions.values()]
        keys = [_upper_keys(p, n) for p in pairs]
        self.keys = distinct(np.concatenate(keys))
        places = [np.where(k >= 0, np.searchsorted(self.keys, k), -1) for k in keys]
        # Of a segment's symmetric block the entries below the diagonal are those above it once more.
        below = blocks[:, 0] > blocks[:, 1]
        self.blocks, self.bend = np.where(below, -1, places[0]), places[1]
        self.of_integrals = dict(zip(self.integrals, places[2 : 2 + len(self.integrals)], strict=True))
        self.of_functions = dict(zip(self.functions, places[2 + len(self.integrals) :], strict=True))
        column, row = np.divmod(self.keys, max(n, 1))
        self.sparsity = casadi.Sparsity.triplet(n, n, row.tolist(), column.tolist())


def _upper_keys(pairs: Index, n: int) -> Index:
    """Column * n + row of places moved above the diagonal; -1 for those of padding."""
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    return np.where(high < n, high * n + low, -1)


class InstantProgram:
    """The NLP of a problem at instants.

    Args:
        problem: whose.
        scalar: its objectives as one.
        rows: of limits and point constraints; the rows of the scalarisation follow after ``count`` of them.
        count: how many rows those are.
        steps: extra variables sigma of total variations, (objective id, number) in order, after that of the
            scalarisation; the objective is its scale times the sum of them.
        coupling: (row, sigma, factor) arrays ``(C,)``: what sigma add to rows.
        symbols: the same program as CasADi expressions, made on demand.
    """

    def __init__(
        self, problem: Problem, scalar: ScalarObjective, rows: Sequence[Rows], count: int,
        steps: Sequence[tuple[str, int]], coupling: tuple[Index, Index, Array], symbols: Callable[[], Symbols],
    ) -> None:  # fmt: skip
        self._problem, self._scalar, self._parts, self._count = problem, scalar, rows, count
        self._make_symbols = symbols
        self._shape = shape_of(problem)
        n = self._shape.size
        self._first_step = n + scalar.extra
        self.size = self._first_step + sum(number for _, number in steps)
        self.rows = count + len(scalar.rows)
        self._steps: dict[str, slice] = {}
        begin = self._first_step
        for name, number in steps:
            self._steps[name] = slice(begin, begin + number)
            begin += number
        self._pattern: _Pattern = problem.cached(("Hessian", scalar.names), lambda: _Pattern(problem, scalar.names))
        keys = []
        for part in rows:
            columns = self._shape.columns[part.values.segments[part.instant]]
            used = part.values.depends()[part.instant, part.entry] & (columns < n)
            keys.append(np.where(used, columns * self.rows + part.row[:, None], -1).ravel())
        row, sigma, factor = coupling
        keys.append((self._first_step + sigma) * self.rows + row)
        last = np.arange(count, self.rows)
        keys.append((np.arange(self.size)[:, None] * self.rows + last).ravel())
        known = distinct(np.concatenate(keys))
        places = [np.where(k >= 0, np.searchsorted(known, k), -1) for k in keys]
        self._places, self._constant = places[: len(rows)], gathered(places[-2], factor, len(known))
        self._coupling = coupling
        self._last = places[-1].reshape(self.size, len(last))
        column, at = np.divmod(known, max(self.rows, 1))
        self.jacobian_sparsity = casadi.Sparsity.triplet(self.rows, self.size, at.tolist(), column.tolist())
        whole = self._pattern.sparsity
        self.hessian_sparsity = casadi.diagcat(whole, casadi.Sparsity(self.size - n, self.size - n))
        self._key = b""
        self._at: _Here | None = None

    @cached_property
    def symbols(self) -> Symbols:
        """See ``Program``."""
        return self._make_symbols()

    def _here(self, x: Array) -> _Here:
        key = x.tobytes()
        if key != self._key or self._at is None:
            self._key, self._at = key, _Here(self, x)
        return self._at

    def values(self, x: Array) -> tuple[float, Array]:
        """See ``Program``."""
        here = self._here(x)
        if here.outputs is not None:
            return here.outputs
        g = np.zeros(self.rows)
        for part, values in zip(self._parts, here.parts, strict=True):
            np.add.at(g, part.row, part.factor * values.values[part.instant, part.entry])
        row, sigma, factor = self._coupling
        np.add.at(g, row, factor * x[self._first_step + sigma])
        outputs = self._scalar.values(here.scalars)
        g[self._count :] = outputs[1:]
        here.outputs = float(outputs[0]), g
        return here.outputs

    def gradient(self, x: Array) -> Array:
        """See ``Program``."""
        return np.asarray(self._here(x).slopes[0])

    def jacobian(self, x: Array) -> Array:
        """See ``Program``."""
        here = self._here(x)
        found = self._constant.copy()
        for part, values, places in zip(self._parts, here.parts, self._places, strict=True):
            slopes = values.slopes[part.instant, part.entry] * part.factor[:, None]
            found += gathered(places, slopes.ravel(), len(found))
        found[self._last] = here.slopes[1:].T
        return found

    def hessian(self, x: Array, factor: float, multipliers: Array) -> Array:
        """See ``Program``."""
        here, pattern = self._here(x), self._pattern
        total = HessianSum(here.at, len(pattern.keys))
        sizes = np.abs(multipliers)
        active = np.where(sizes < IDLE * max(abs(factor), float(sizes.max(initial=0.0))), 0.0, multipliers)
        for part, values in zip(self._parts, here.parts, strict=True):
            weights = np.zeros_like(values.values)
            np.add.at(weights, (part.instant, part.entry), active[part.row] * part.factor)
            values.add_curvature(total, weights)
        outer = np.concatenate([[factor], multipliers[self._count :]])
        weighed = dict(zip(self._scalar.names, outer @ self._scalar.slope, strict=False))
        for name, integral in pattern.integrals.items():
            integral.add(total, here.at, here.integrals[name], weighed[name], pattern.of_integrals[name])
        for name, function in pattern.functions.items():
            total.nonzeros += gathered(
                pattern.of_functions[name], weighed[name] * function.nonzeros(here.at.x), len(total.nonzeros)
            )
        found = total.nonzeros + gathered(pattern.blocks, total.local.ravel(), len(total.nonzeros))
        bend = here.at.bend(total.points, total.durations, total.parameters)
        return found + gathered(pattern.bend, bend, len(found))


class _Here:
    """What a program has computed at one x."""

    def __init__(self, program: InstantProgram, x: Array) -> None:
        self._program, self._x = program, x.copy()
        self.outputs: tuple[float, Array] | None = None
        self.at = program._shape.at(x[: program._shape.size])
        self.parts = [part.values.at(self.at, slopes=True) for part in program._parts]
        self.integrals = {name: i.values.at(self.at, slopes=True) for name, i in program._pattern.integrals.items()}
        extra = x[program._shape.size : program._first_step]
        self.scalars = np.array([*(self._value(name) for name in program._scalar.names), *extra])

    def _value(self, name: str) -> float:
        pattern, program = self._program._pattern, self._program
        if name in pattern.integrals:
            return pattern.integrals[name].value(self.at, self.integrals[name])
        if name in pattern.functions:
            return pattern.functions[name].value(self.at.x)
        return float(program._problem.objective(name).scale * self._x[program._steps[name]].sum())

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of f and the scalarisation's rows in the program's variables ``(1 + rows, n)``."""
        program, pattern = self._program, self._program._pattern
        n = program._shape.size
        gradients = np.zeros((len(self.scalars), program.size))
        for j, name in enumerate(program._scalar.names):
            if name in pattern.integrals:
                gradients[j, :n] = pattern.integrals[name].gradient(self.at, self.integrals[name])
            elif name in pattern.functions:
                gradients[j, :n] = pattern.functions[name].gradient(self.at.x)
            else:
                gradients[j, program._steps[name]] = program._problem.objective(name).scale
        if program._scalar.extra:
            gradients[-1, n] = 1.0
        return program._scalar.slope @ gradients
