"""By how much limits would have to give for an NLP to have a point: the elastic problem of an NLP.

Every limit, of all its rows at instants and control points and its bounds on variables together, may be exceeded by one
amount on each side, and the sum of these amounts, each in its limit's scale, is least. Where that is found by a local
solver, another point may need less.
"""

from __future__ import annotations

import casadi
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.rows import VARIABLE, Conflict, Row
from ocp_traj.transcription.nlp import NLP, NLPResult
from ocp_traj.transcription.program import Program, Symbols

GIVES, HOLDS = 1e-6, 1e-4  # an excess and a multiplier above these count, both scaled: our choice


class ElasticProgram:
    """Least sum of amounts by which groups of rows are exceeded: x, then over and under, one a group each.

    Args:
        program: whose rows; after them come rows of its variables.
        variables, factors: (variable, factor) of each further row ``(r,)``.
        group: of each row, those of variables last ``(m + r,)``; -1 of one that has to hold.
    """

    def __init__(self, program: Program, variables: Index, factors: Array, group: Index) -> None:
        """Adds rows and columns."""
        self._program, self._variables, self._factors, self._group = program, variables, factors, group
        self._count = int(group.max(initial=-1)) + 1
        n, m, r, q = program.size, program.rows, len(variables), self._count
        self.size, self.rows = n + 2 * q, m + r
        self._gives = np.nonzero(group >= 0)[0]
        places = self._gives.tolist(), group[self._gives].tolist()
        gives = casadi.Sparsity.triplet(m + r, q, *places)
        own = casadi.Sparsity.triplet(r, n, list(range(r)), variables.tolist())
        known = casadi.vertcat(program.jacobian_sparsity, own)
        self.jacobian_sparsity = casadi.horzcat(known, gives, gives)
        self.hessian_sparsity = casadi.diagcat(program.hessian_sparsity, casadi.Sparsity(2 * q, 2 * q))
        # Which nonzeros of the first n columns are the program's, in order, and what the others are.
        row, column = (np.array(index, dtype=np.intp) for index in known.get_triplet())
        self._own = row < m
        self._constant = np.zeros(len(row))
        self._constant[~self._own] = factors[row[~self._own] - m]

    def values(self, x: Array) -> tuple[float, Array]:
        """See ``Program``."""
        inner, over, under = self._split(x)
        g = np.concatenate([self._program.values(inner)[1], inner[self._variables] * self._factors])
        g[self._gives] -= (over - under)[self._group[self._gives]]
        return float(over.sum() + under.sum()), g

    def gradient(self, x: Array) -> Array:
        """See ``Program``."""
        return np.concatenate([np.zeros(self._program.size), np.ones(2 * self._count)])

    def jacobian(self, x: Array) -> Array:
        """See ``Program``."""
        found = self._constant.copy()
        found[self._own] = self._program.jacobian(self._split(x)[0])
        ones = np.ones(len(self._gives))
        return np.concatenate([found, -ones, ones])

    def hessian(self, x: Array, factor: float, multipliers: Array) -> Array:
        """See ``Program``."""
        return self._program.hessian(self._split(x)[0], 0.0, multipliers[: self._program.rows])

    @property
    def symbols(self) -> Symbols:
        """See ``Program``."""
        x, _, g = self._program.symbols
        over, under = casadi.MX.sym("over", self._count), casadi.MX.sym("under", self._count)
        g = casadi.vertcat(g, x[self._variables.tolist()] * casadi.DM(self._factors))
        gives = np.zeros((self.rows, self._count))
        gives[self._gives, self._group[self._gives]] = 1.0
        f = casadi.sum1(over) + casadi.sum1(under)
        return casadi.vertcat(x, over, under), f, g - casadi.mtimes(casadi.sparsify(casadi.DM(gives)), over - under)

    def _split(self, x: Array) -> list[Array]:
        n = self._program.size
        return np.split(x, [n, n + self._count])


class Elastic:
    """The elastic problem of an NLP.

    Args:
        nlp: whose limits give.
        shared: whether all rows of a limit's label give the same; else each gives its own, which is solved from where
            the other is not, and the largest counts.

    Attributes:
        nlp: its variables are those of the original, then what limits give over their upper and under their lower
            bounds.
    """

    def __init__(self, nlp: NLP, shared: bool = True) -> None:
        """Groups rows by limit and label; rows that define a variable can always be met and do not give."""
        self._original = nlp
        variables = np.array([i for i, _, _ in nlp.bounds_as_rows], dtype=np.intp)
        factors = np.array([factor for _, factor, _ in nlp.bounds_as_rows])
        self._rows = (*nlp.rows, *(row for _, _, row in nlp.bounds_as_rows))
        names = [(row.limit, row.label, 0 if shared else i) for i, row in enumerate(self._rows)]
        gives = [name for name, row in zip(names, self._rows, strict=True) if not row.defines]
        number = {name: i for i, name in enumerate(dict.fromkeys(gives))}
        self._group = np.array([number.get(name, -1) for name in names], dtype=np.intp)
        self._count, n = len(number), nlp.program.size
        lower, upper = nlp.lower_x.copy(), nlp.upper_x.copy()
        free = variables[lower[variables] < upper[variables]]  # one that is fixed stays
        lower[free], upper[free] = -np.inf, np.inf
        slacks = ("over",) * self._count + ("under",) * self._count
        self.nlp = NLP(
            name=f"{nlp.name} (elastic)",
            program=ElasticProgram(nlp.program, variables, factors, self._group),
            lower_x=np.concatenate([lower, np.zeros(len(slacks))]),
            upper_x=np.concatenate([upper, np.full(len(slacks), np.inf)]),
            lower_g=np.concatenate([nlp.lower_g, nlp.lower_x[variables] * factors]),
            upper_g=np.concatenate([nlp.upper_g, nlp.upper_x[variables] * factors]),
            rows=self._rows,
            labels=(*nlp.labels, *slacks),
            units=(*nlp.units, *("-" for _ in slacks)),
        )
        self._size = n

    def start(self, x: Array) -> Array:
        """A start from x of the original, a little inside."""
        inner = np.concatenate([x, np.zeros(2 * self._count)])
        _, g = self.nlp.program.values(inner)
        over, under = np.zeros(self._count), np.zeros(self._count)
        gives = self._group >= 0
        for total, excess in ((over, g - self.nlp.upper_g), (under, self.nlp.lower_g - g)):
            known = np.where(np.isfinite(excess), np.maximum(excess, 0.0), 1.0)
            known[np.isneginf(excess)] = 0.0
            np.maximum.at(total, self._group[gives], known[gives])
        return np.concatenate([x, over + 1e-3, under + 1e-3])

    def conflicts(self, result: NLPResult) -> tuple[Conflict, ...]:
        """Limits that give there, with the amount; and those that do not and have a multiplier: they are in the way."""
        nlp, n, q = self.nlp, self._size, self._count
        over, under = result.x[n : n + q], result.x[n + q :]
        _, g = nlp.program.values(np.concatenate([result.x[:n], np.zeros(2 * q)]))
        multipliers = np.zeros(len(g)) if result.row_multipliers is None else result.row_multipliers
        found: dict[tuple[str, str], tuple[float, Conflict]] = {}
        for i, row in enumerate(self._rows):
            k, multiplier = int(self._group[i]), float(multipliers[i])
            if k < 0:
                continue
            amount = float(max(over[k], under[k]))
            if amount <= GIVES and abs(multiplier) <= HOLDS:
                continue
            upper = over[k] >= under[k] if amount > GIVES else multiplier > 0.0
            bound = float(nlp.upper_g[i] if upper else nlp.lower_g[i])
            beyond = float(g[i]) - bound if upper else bound - float(g[i])
            excess = amount * row.scale if amount > GIVES else 0.0
            beyond = max(beyond, -1.0) if excess > 0.0 else beyond - 2.0  # what gives comes before what is in the way
            if (row.limit, row.label) not in found or beyond > found[row.limit, row.label][0]:
                conflict = Conflict(row, float(g[i]) * row.scale, bound * row.scale, excess)
                found[row.limit, row.label] = beyond, conflict
        conflicts = [conflict for _, conflict in found.values()]
        bounds = result.bound_multipliers
        for i, label in enumerate(self._original.labels):
            multiplier = float(bounds[i]) if bounds is not None else 0.0
            low, high = float(nlp.lower_x[i]), float(nlp.upper_x[i])
            if abs(multiplier) > HOLDS and low < high:
                held = high if multiplier > 0.0 else low
                conflicts.append(Conflict(Row(VARIABLE, label, unit=nlp.units[i]), float(result.x[i]), held, 0.0))
        return tuple(sorted(conflicts, key=lambda c: -c.excess / c.row.scale))
