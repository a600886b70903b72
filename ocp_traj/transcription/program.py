"""A nonlinear program as numbers: f, g, their gradients and the Hessian of the Lagrangian at any x.

Nothing is built for a set of instants but index arrays: the functions at instants are compiled once for a problem (see
``kernel``), evaluated for all instants together, and their small derivatives are summed where they belong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.transcription.instant_values import InstantValues, InstantValuesAt
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.mapped import Mapped
from ocp_traj.transcription.shape import ShapeAt, shape_of
from ocp_traj.transcription.symbolic import plain_objectives, quadrature

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Symbols = tuple[Any, Any, Any]  # casadi MX: x ``(n,)``, f, g ``(m,)``


class Program(Protocol):
    """What an NLP solver evaluates: minimise f(x) with bounds on x and on g(x).

    Attributes:
        size, rows: of x and g.
        jacobian_sparsity: of dg/dx ``(m, n)``.
        hessian_sparsity: upper triangle ``(n, n)``.
    """

    @property
    def size(self) -> int: ...  # noqa: D102

    @property
    def rows(self) -> int: ...  # noqa: D102

    @property
    def jacobian_sparsity(self) -> Any: ...  # noqa: D102

    @property
    def hessian_sparsity(self) -> Any: ...  # noqa: D102

    def values(self, x: Array) -> tuple[float, Array]:
        """F and g ``(m,)``."""

    def gradient(self, x: Array) -> Array:
        """Of f ``(n,)``."""

    def jacobian(self, x: Array) -> Array:
        """Nonzeros of dg/dx, column by column."""

    def hessian(self, x: Array, factor: float, multipliers: Array) -> Array:
        """Nonzeros of the upper triangle of the Hessian of factor f + multipliers . g, column by column."""

    @property
    def symbols(self) -> Symbols:
        """The same program as CasADi expressions."""


class SymbolicProgram:
    """A program given as CasADi MX expressions."""

    def __init__(self, x: Any, f: Any, g: Any) -> None:
        """Compiles the derivatives."""
        self.symbols: Symbols = x, casadi.MX(f), casadi.MX(g)
        self.size, self.rows = x.numel(), g.numel()
        factor, multipliers = casadi.MX.sym("lam_f"), casadi.MX.sym("lam_g", self.rows)
        slope = casadi.jacobian(self.symbols[2], x)
        bend = casadi.triu(casadi.hessian(factor * self.symbols[1] + casadi.dot(multipliers, self.symbols[2]), x)[0])
        self.jacobian_sparsity, self.hessian_sparsity = slope.sparsity(), bend.sparsity()
        self._values = casadi.Function("values", [x], [*self.symbols[1:]])
        self._gradient = casadi.Function("gradient", [x], [casadi.densify(casadi.gradient(self.symbols[1], x))])
        self._jacobian = casadi.Function("jacobian", [x], [slope])
        self._hessian = casadi.Function("hessian", [x, factor, multipliers], [bend])

    def values(self, x: Array) -> tuple[float, Array]:
        """See ``Program``."""
        f, g = self._values(x)
        return float(f), np.array(g).ravel()

    def gradient(self, x: Array) -> Array:
        """See ``Program``."""
        return np.array(self._gradient(x)).ravel()

    def jacobian(self, x: Array) -> Array:
        """See ``Program``."""
        return np.array(self._jacobian(x).nonzeros())

    def hessian(self, x: Array, factor: float, multipliers: Array) -> Array:
        """See ``Program``."""
        return np.array(self._hessian(x, factor, multipliers).nonzeros())


class ElasticProgram:
    """Least sum of excesses over the bounds of another program's rows: x, then over and under ``(m,)`` each."""

    def __init__(self, program: Program) -> None:
        """Adds the columns."""
        self._program, m = program, program.rows
        self.size, self.rows = program.size + 2 * m, m
        unit = casadi.Sparsity.diag(m)
        self.jacobian_sparsity = casadi.horzcat(program.jacobian_sparsity, unit, unit)
        self.hessian_sparsity = casadi.diagcat(program.hessian_sparsity, casadi.Sparsity(2 * m, 2 * m))

    def values(self, x: Array) -> tuple[float, Array]:
        """See ``Program``."""
        inner, over, under = self._split(x)
        return float(over.sum() + under.sum()), self._program.values(inner)[1] - over + under

    def gradient(self, x: Array) -> Array:
        """See ``Program``."""
        return np.concatenate([np.zeros(self._program.size), np.ones(2 * self.rows)])

    def jacobian(self, x: Array) -> Array:
        """See ``Program``."""
        ones = np.ones(self.rows)
        return np.concatenate([self._program.jacobian(self._split(x)[0]), -ones, ones])

    def hessian(self, x: Array, factor: float, multipliers: Array) -> Array:
        """See ``Program``."""
        return self._program.hessian(self._split(x)[0], 0.0, multipliers)

    @property
    def symbols(self) -> Symbols:
        """See ``Program``."""
        x, _, g = self._program.symbols
        over, under = casadi.MX.sym("over", self.rows), casadi.MX.sym("under", self.rows)
        return casadi.vertcat(x, over, under), casadi.sum1(over) + casadi.sum1(under), g - over + under

    def _split(self, x: Array) -> Sequence[Array]:
        return np.split(x, [self._program.size, self._program.size + self.rows])


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of g that are sums of values at instants times factors, g[row[e]] += factor[e] V[instant[e], entry[e]].

    Attributes:
        values: of the function at its instants.
        row, instant, entry: ``(E,)``.
        factor: ``(E,)``.
    """

    values: InstantValues
    row: Index
    instant: Index
    entry: Index
    factor: Array


class _Sum:
    """A Hessian while it is summed: by segment, of the curve's bend, and nonzero by nonzero."""

    def __init__(self, at: ShapeAt, nonzeros: int) -> None:
        segments, width = at.shape.columns.shape
        self.local = np.zeros((segments, width, width))
        self.points, self.durations, self.parameters = (
            np.zeros_like(v) for v in (at.points, at.durations, at.parameters)
        )
        self.nonzeros = np.zeros(nonzeros)

    def add(self, values: InstantValuesAt, weights: Array) -> None:
        """Adds the second derivatives of values at instants times weights ``(N, rows)``."""
        found = values.curvature(weights)
        values.of.add_by_segment(self.local, found.local)
        self.points += found.points
        self.durations += found.durations
        self.parameters += found.parameters


class _Integral:
    """An objective that is a sum of an integrand at nodes, each times its share of the durations."""

    def __init__(self, problem: Problem, objective: Objective) -> None:
        nodes, self.weights = quadrature(problem, objective)
        self.values = InstantValues.of(problem, objective.id, [Instant(objective.id, k, u) for k, u in nodes])
        shape = self.values.shape
        durations = shape.depends[:, shape.dof]  # (K, m)
        touched = self.weights != 0.0
        some = [np.unique(shape.columns[here][durations[here]]) for here in touched]
        width = max((len(s) for s in some), default=0)
        self.columns = np.full((len(nodes), width), shape.size, dtype=np.intp)  # of the durations of each node
        for j, s in enumerate(some):
            self.columns[j, : len(s)] = s

    def pairs(self) -> Index:
        """Places in the Hessian of gradient times slope of durations: (i, j) ``(P, 2)``."""
        left = np.broadcast_to(self._rows()[:, :, None], self._outer())
        right = np.broadcast_to(self.columns[:, None, :], self._outer())
        return np.stack([left.ravel(), right.ravel()], axis=1)

    def _rows(self) -> Index:
        return self.values.shape.columns[self.values.segments]

    def _outer(self) -> tuple[int, int, int]:
        return (*self._rows().shape, self.columns.shape[1])

    def value(self, at: ShapeAt, values: InstantValuesAt) -> float:
        return float((self.weights @ at.durations) @ values.values[:, 0])

    def gradient(self, at: ShapeAt, values: InstantValuesAt) -> Array:
        found = np.zeros(at.shape.size + 1)
        shares = self.weights @ at.durations
        np.add.at(found, self._rows(), shares[:, None] * values.slopes[:, 0])
        of_durations = self.weights.T @ values.values[:, 0]
        np.add.at(found, at.shape.columns, of_durations[:, None] * at.slopes[1])
        return found[:-1]

    def add(self, total: _Sum, at: ShapeAt, values: InstantValuesAt, weight: float, places: Index) -> None:
        total.add(values, weight * (self.weights @ at.durations)[:, None])
        total.durations += weight * (self.weights.T @ values.values[:, 0])
        slopes = np.zeros((len(self.weights), at.shape.size + 1))
        full = np.zeros((len(at.durations), at.shape.size + 1))
        np.put_along_axis(full, at.shape.columns, at.slopes[1], axis=1)
        slopes = np.take_along_axis(self.weights @ full, self.columns, axis=1)
        slopes[self.columns == at.shape.size] = 0.0
        outer = weight * values.slopes[:, 0][:, :, None] * slopes[:, None, :]
        # A pair and its mirror: off the diagonal each stands once above it, on it both do.
        doubled = self._rows()[:, :, None] == self.columns[:, None, :]
        outer = np.where(doubled, 2.0 * outer, outer).ravel()
        total.nonzeros += _gathered(places, outer, len(total.nonzeros))


class _OfVariables:
    """An objective that is a function of x."""

    def __init__(self, problem: Problem, objective: Objective) -> None:
        assert objective.of_variables is not None
        x = casadi.SX.sym("x", problem.size)
        value = casadi.densify(casadi.SX(objective.of_variables(x, problem.parameters(x))))
        bend, gradient = casadi.hessian(value, x)
        bend = casadi.triu(bend)
        self.triplet = np.array(bend.sparsity().get_triplet(), dtype=np.intp).T.reshape(-1, 2)
        self._first = Mapped(casadi.Function("first", [x], [value, casadi.densify(gradient)]))
        self._second = Mapped(casadi.Function("second", [x], [bend.nz[:]]))

    def value(self, x: Array) -> float:
        return float(self._first(x[None])[0][0, 0])

    def gradient(self, x: Array) -> Array:
        return self._first(x[None])[1][0].copy()

    def nonzeros(self, x: Array) -> Array:
        return self._second(x[None])[0][0].copy()


def _gathered(places: Index, values: Array, size: int) -> Array:
    """Sum of values by place; those at -1 are left out."""
    kept = places >= 0
    return np.bincount(places[kept], weights=values[kept], minlength=size).astype(float, copy=False)


class _Pattern:
    """Where things stand in the Hessian of a problem, whatever its instants: compiled once for a set of objectives."""

    def __init__(self, problem: Problem, names: Sequence[str]) -> None:
        shape = shape_of(problem)
        n = self.size = problem.size
        columns = shape.columns
        self.integrals: dict[str, _Integral] = {}
        self.functions: dict[str, _OfVariables] = {}
        for name in names:
            objective = problem.objective(name)
            if objective.integrand is not None:
                self.integrals[name] = problem.cached(("integral", name), lambda o=objective: _Integral(problem, o))
            elif objective.of_variables is not None:
                self.functions[name] = problem.cached(
                    ("of variables", name), lambda o=objective: _OfVariables(problem, o)
                )
        outer = (*columns.shape, columns.shape[1])
        blocks = np.stack(
            [np.broadcast_to(c, outer).ravel() for c in (columns[:, :, None], columns[:, None, :])], axis=1
        )
        bend = np.array(shape.bend_sparsity.get_triplet(), dtype=np.intp).T.reshape(-1, 2)
        pairs = [blocks, bend, *(i.pairs() for i in self.integrals.values())]
        pairs += [f.triplet for f in self.functions.values()]
        keys = [_upper_keys(p, n) for p in pairs]
        together = np.concatenate(keys)
        self.keys = np.unique(together[together >= 0])
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


class ScalarObjective:
    """A scalarisation of a problem's objectives: a small function of their values, with derivatives.

    Attributes:
        names: of the plain objectives it is a function of.
        extra: 1 where the scalarisation has a variable of its own, else 0.
        rows: (objective id, bound) a row.
    """

    def __init__(self, problem: Problem, scalarisation: Scalarisation) -> None:
        """Compiles the function."""
        wanted = dict.fromkeys((*scalarisation.names, *problem.tuning.regularisation))
        plain = plain_objectives(problem, wanted)
        self.names = tuple(name for name, objective in plain.items() if objective.terms is None)
        symbols = {name: casadi.MX.sym(name) for name in self.names}
        values: dict[str, Any] = dict(symbols)
        for name, objective in plain.items():
            if objective.terms is not None:
                values[name] = sum(factor * values[term] for term, factor in objective.terms.items())
        scalar = scalarisation.apply(problem, values)
        traces = [w * values[name] / problem.objective(name).scale for name, w in problem.tuning.regularisation.items()]
        self.extra = int(scalar.extra is not None)
        self.rows = tuple((name, bound) for name, _, bound in scalar.rows)
        inputs = casadi.vertcat(*symbols.values(), *([] if scalar.extra is None else [scalar.extra]))
        given = casadi.MX.sym("v", inputs.numel())
        outputs = casadi.vertcat(casadi.MX(scalar.f + sum(traces)), *(value for _, value, _ in scalar.rows))
        (outputs,) = casadi.graph_substitute([outputs], list(symbols.values()), casadi.vertsplit(given)[: len(symbols)])
        if scalar.extra is not None:
            (outputs,) = casadi.graph_substitute([outputs], [scalar.extra], [given[-1]])
        weights = casadi.MX.sym("w", outputs.numel())
        bend = casadi.hessian(casadi.dot(weights, outputs), given)[0]
        self.linear = bend.nnz() == 0
        self.values = Mapped(casadi.Function("scalar", [given], [casadi.densify(outputs)]))
        slope = casadi.densify(casadi.jacobian(outputs, given))
        self._slope = Mapped(casadi.Function("slope", [given], [casadi.vec(slope.T)]))
        self._bend = Mapped(casadi.Function("bend", [given, weights], [casadi.vec(casadi.densify(bend))]))

    def slope(self, given: Array) -> Array:
        """Derivatives ``(1 + rows, values)`` of f and the rows in the values, and in the extra variable."""
        return self._slope(given[None])[0][0].reshape(1 + len(self.rows), -1).copy()

    def bend(self, given: Array, weights: Array) -> Array:
        """Hessian of the outputs times weights ``(1 + rows,)``."""
        return self._bend(given[None], weights[None])[0][0].reshape(len(given), -1).copy()


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
        together = np.concatenate(keys)
        known = np.unique(together[together >= 0])
        places = [np.where(k >= 0, np.searchsorted(known, k), -1) for k in keys]
        self._places, self._constant = places[: len(rows)], _gathered(places[-2], factor, len(known))
        self._coupling = coupling
        self._last = places[-1].reshape(self.size, len(last))
        column, at = np.divmod(known, max(self.rows, 1))
        self.jacobian_sparsity = casadi.Sparsity.triplet(self.rows, self.size, at.tolist(), column.tolist())
        whole = self._pattern.sparsity
        if not scalar.linear:
            raise NotImplementedError
        self.hessian_sparsity = casadi.diagcat(whole, casadi.Sparsity(self.size - n, self.size - n))
        self._key, self._at = b"", None

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
        g = np.zeros(self.rows)
        for part, values in zip(self._parts, here.parts, strict=True):
            np.add.at(g, part.row, part.factor * values.values[part.instant, part.entry])
        row, sigma, factor = self._coupling
        np.add.at(g, row, factor * x[self._first_step + sigma])
        outputs = self._scalar.values(here.scalars[None])[0][0]
        g[self._count :] = outputs[1:]
        return float(outputs[0]), g

    def gradient(self, x: Array) -> Array:
        """See ``Program``."""
        return np.asarray(self._here(x).slopes[0])

    def jacobian(self, x: Array) -> Array:
        """See ``Program``."""
        here = self._here(x)
        found = self._constant.copy()
        for part, values, places in zip(self._parts, here.parts, self._places, strict=True):
            slopes = values.slopes[part.instant, part.entry] * part.factor[:, None]
            found += _gathered(places, slopes.ravel(), len(found))
        found[self._last] = here.slopes[1:].T
        return found

    def hessian(self, x: Array, factor: float, multipliers: Array) -> Array:
        """See ``Program``."""
        here, pattern = self._here(x), self._pattern
        total = _Sum(here.at, len(pattern.keys))
        for part, values in zip(self._parts, here.parts, strict=True):
            weights = np.zeros_like(values.values)
            np.add.at(weights, (part.instant, part.entry), multipliers[part.row] * part.factor)
            total.add(values, weights)
        outer = np.concatenate([[factor], multipliers[self._count :]])
        weighed = dict(zip(self._scalar.names, outer @ here.scalar_slope, strict=False))
        for name, integral in pattern.integrals.items():
            integral.add(total, here.at, here.integrals[name], weighed[name], pattern.of_integrals[name])
        for name, function in pattern.functions.items():
            total.nonzeros += _gathered(
                pattern.of_functions[name], weighed[name] * function.nonzeros(here.at.x), len(total.nonzeros)
            )
        found = total.nonzeros + _gathered(pattern.blocks, total.local.ravel(), len(total.nonzeros))
        bend = here.at.bend(total.points, total.durations, total.parameters)
        return found + _gathered(pattern.bend, bend, len(found))


class _Here:
    """What a program has computed at one x."""

    def __init__(self, program: InstantProgram, x: Array) -> None:
        self._program, self._x = program, x.copy()
        self.at = program._shape.at(x[: program._shape.size])
        self.parts = [part.values.at(self.at) for part in program._parts]
        self.integrals = {name: i.values.at(self.at) for name, i in program._pattern.integrals.items()}
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
    def scalar_slope(self) -> Array:
        """Derivatives of f and the scalarisation's rows in the objectives' values."""
        return self._program._scalar.slope(self.scalars)

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
        return self.scalar_slope @ gradients
