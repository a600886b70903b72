"""Jacobian and Hessian of an NLP from the small ones of each instant.

A limit or an integrand is a function V of few numbers Z at its instant. Written with derivatives in local time and the
segment's duration, Z is linear in the curve's shape Y, its durations, parameters and control points (and the variables
themselves): Z = A Y + b with constant A. With nu the gradient of the Lagrangian in Y,

    H = d2/dx2 (L with V held fixed + nu Y(x)) + (dY/dx)^T (sum A^T (d2/dZ2 of the Lagrangian) A) (dY/dx),

and the constraints' Jacobian is dg/dx with V held fixed + (sum (dg/dV) (dV/dZ) A) (dY/dx).

Differentiating the composition instead, in as many directions as the variables of neighbouring segments need colours,
evaluates every limit once a direction: more than ten times the work where the functions are long.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, NamedTuple

import casadi
import numpy as np

from ocp_traj.errors import ProblemDefinitionError

Cache = Callable[[Hashable, Callable[[], Any]], Any]  # (key, build) -> what was built on first use


class Derivatives(NamedTuple):
    """As ``nlpsol`` takes them: casadi Functions (x, p) -> g, dg/dx and (x, p, lam_f, lam_g) -> upper triangle."""

    jacobian: Any
    hessian: Any


class Lifted:
    """Collects calls of functions at instants, each replaced by symbols for its values.

    Args:
        shape: casadi SX Function x -> the curve's shape, in several outputs.
        cached: keeps compiled functions for the next NLP.
    """

    def __init__(self, shape: Any, cached: Cache) -> None:
        self.shape, self.cached = shape, cached
        self.symbols = [casadi.MX.sym(f"Y{i}", shape.size_out(i)) for i in range(shape.n_out())]
        self.calls: list[_Call] = []

    def __call__(self, key: Hashable, function: Any, *arguments: Any) -> Any:
        """Symbols ``(rows, N)`` in place of ``function.map(N)(*arguments)``; ``key`` names the function."""
        call = _Call(key, function, list(arguments), self.symbols, self.cached)
        self.calls.append(call)
        return call.values

    def resolved(self, expressions: list[Any], x: Any) -> list[Any]:
        """Expressions in terms of the variables x ``(n,)`` of the problem alone."""
        shape = casadi.vertcat(*(casadi.vec(part) for part in self.shape.call([x])))
        values = [call.function.map(call.count)(*call.arguments_at(shape)) for call in self.calls]
        found: list[Any] = casadi.graph_substitute(expressions, [call.values for call in self.calls], values)
        return found

    def derivatives(self, variables: Sequence[Any], f: Any, g: Any) -> Derivatives:
        """Jacobian of the constraints and Hessian of the Lagrangian.

        Args:
            variables: symbols, of which x is the concatenation ``(n,)``; the first are the problem's.
            f: objective, in terms of x and the symbols.
            g: constraints, likewise; both linear in the symbols, with factors that do not depend on x.
        """
        x = casadi.MX.sym("x", sum(v.numel() for v in variables))
        parts = casadi.vertsplit(x, np.cumsum([0, *(v.numel() for v in variables)]).tolist())
        f, g = casadi.graph_substitute([f, g], list(variables), parts)
        symbols = [call.values for call in self.calls]
        zeros = [casadi.MX(*values.shape) for values in symbols]

        def held(expression: Any) -> Any:
            return casadi.graph_substitute([expression], symbols, zeros)[0]

        p, lam_f, lam_g = casadi.MX.sym("p", 0), casadi.MX.sym("lam_f"), casadi.MX.sym("lam_g", g.numel())
        outer = lam_f * f + casadi.dot(lam_g, g)
        hessian, jacobian = held(casadi.hessian(outer, x)[0]), held(casadi.jacobian(g, x))
        value_and_slope, bend = self.cached("shape derivatives", lambda: _shape_derivatives(self.shape))
        shape, slope = value_and_slope(parts[0])
        others = x.numel() - parts[0].numel()
        slope = casadi.horzcat(slope, casadi.MX(slope.shape[0], others))
        size = shape.numel()
        nu, inner, values, rows = casadi.MX(size, 1), casadi.MX(size, size), [], casadi.MX(g.numel(), size)
        for call in self.calls:
            at, weights = call.arguments_at(shape), held(casadi.gradient(outer, call.values))
            gradient, bends = call.hessian(at, weights)
            nu, inner = nu + gradient, inner + bends
            factors = held(casadi.jacobian(g, call.values))
            value, slopes = call.slopes(at)
            values.append(value)
            if factors.nnz():
                rows = rows + casadi.mtimes(factors, slopes)
        hessian = hessian + casadi.diagcat(bend(parts[0], nu), casadi.MX(others, others))
        hessian = hessian + casadi.mtimes(slope.T, casadi.mtimes(inner, slope))
        jacobian = jacobian + casadi.mtimes(rows, slope)
        resolved = casadi.graph_substitute([g], symbols, values)[0]
        return Derivatives(
            casadi.Function("nlp_jac_g", [x, p], [resolved, jacobian], ["x", "p"], ["g", "jac_g_x"]),
            casadi.Function(
                "nlp_hess_l", [x, p, lam_f, lam_g], [casadi.triu(hessian)], ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        )  # fmt: skip


class _Call:
    """A function at instants, its arguments linear in the shape, with what differentiates it."""

    def __init__(self, key: Hashable, function: Any, arguments: list[Any], symbols: list[Any], cached: Cache) -> None:
        self.function, self.count = function, int(arguments[0].shape[1])
        self.values = casadi.MX.sym(f"V {key}", function.size1_out(0), self.count)
        stacked = casadi.vertcat(*arguments)
        whole = casadi.vertcat(*(casadi.vec(s) for s in symbols))
        linear = casadi.Function("z", symbols, [casadi.vec(stacked), casadi.jacobian(casadi.vec(stacked), whole)])
        self.constant, matrix = linear(*(casadi.DM(*s.shape) for s in symbols))
        other = linear(*(casadi.DM.ones(*s.shape) for s in symbols))[1]
        if any((other - matrix).nonzeros()):
            raise ProblemDefinitionError(f"{key}: local derivatives are for instants that do not move")
        self.matrix = casadi.sparsify(matrix)
        self.heights = [int(a.shape[0]) for a in arguments]
        height = sum(self.heights)
        varying = np.zeros(height, dtype=bool)
        varying[np.array(self.matrix.sparsity().row(), dtype=int) % height] = True
        name = "local", key, varying.tobytes()
        self.first, self.second, self.active = cached(name, lambda: _local(function, varying))
        chosen = [height * j + i for j in range(self.count) for i in self.active]
        self.active_matrix = self.matrix[chosen, :]

    def arguments_at(self, shape: Any) -> list[Any]:
        """The arguments, a column an instant."""
        stacked = casadi.reshape(casadi.mtimes(self.matrix, shape) + self.constant, sum(self.heights), self.count)
        parts: list[Any] = casadi.vertsplit(stacked, np.cumsum([0, *self.heights]).tolist())
        return parts

    def _blocks(self, rows: int, side_by_side: Any) -> Any:
        """A block-diagonal matrix from its blocks of so many rows, side by side: their nonzeros are the same."""
        block = casadi.Sparsity.dense(rows, len(self.active))
        return casadi.MX(casadi.diagcat(*[block] * self.count), casadi.vec(side_by_side))

    def slopes(self, arguments: list[Any]) -> tuple[Any, Any]:
        """The values ``(rows, N)``, and the Jacobian of all of them in the shape."""
        values, blocks = self.first.map(self.count)(*arguments)
        return values, casadi.mtimes(self._blocks(int(self.values.shape[0]), blocks), self.active_matrix)

    def hessian(self, arguments: list[Any], weights: Any) -> tuple[Any, Any]:
        """Gradient and Hessian in the shape of the sum of the values times weights ``(rows, N)``."""
        slopes, bends = self.second.map(self.count)(*arguments, weights)
        inner = casadi.mtimes(self._blocks(len(self.active), bends), self.active_matrix)
        across = self.active_matrix.T
        return casadi.mtimes(across, casadi.vec(slopes)), casadi.mtimes(across, inner)


def _shape_derivatives(shape: Any) -> tuple[Any, Any]:
    """Casadi SX Functions x -> stacked shape ``(m,)``, its Jacobian; (x, nu ``(m,)``) -> Hessian of nu . shape."""
    x = casadi.SX.sym("x", shape.numel_in(0))
    stacked = casadi.vertcat(*(casadi.vec(part) for part in shape.call([x])))
    nu = casadi.SX.sym("nu", stacked.numel())
    return (
        casadi.Function("shape_slope", [x], [stacked, casadi.jacobian(stacked, x)]),
        casadi.Function("shape_bend", [x, nu], [casadi.hessian(casadi.dot(nu, stacked), x)[0]]),
    )


def _local(function: Any, varying: Any) -> tuple[Any, Any, list[int]]:
    """Derivatives of a function in those of its arguments that vary and that it depends on.

    Returns:
        casadi SX Function arguments -> values ``(rows,)``, Jacobian ``(rows, a)``; casadi SX Function (arguments,
        weights) -> gradient ``(a,)`` and Hessian ``(a, a)`` of the weighted sum of the rows; the places of the a
        arguments among all of them, stacked.
    """
    arguments = [casadi.SX.sym("z", function.size1_in(i)) for i in range(function.n_in())]
    weights = casadi.SX.sym("w", function.size1_out(0))
    values = function(*arguments)
    stacked = casadi.vertcat(*arguments)
    used = casadi.which_depends(casadi.dot(weights, values), stacked, 1, False)
    active = [i for i, depends in enumerate(used) if depends and varying[i]] or [0]
    chosen = casadi.vertcat(*(stacked[i] for i in active))
    one = casadi.cse([casadi.densify(values), casadi.densify(casadi.jacobian(values, chosen))])
    bends, slopes = casadi.hessian(casadi.dot(weights, values), chosen)
    two = casadi.cse([casadi.densify(slopes), casadi.densify(bends)])
    return (
        casadi.Function("first", arguments, one),
        casadi.Function("second", [*arguments, weights], two),
        active,
    )
