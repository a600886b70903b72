"""Jacobian and Hessian of an NLP from the small ones of each instant.

A limit or an integrand is a function V of few numbers Z at its instant, and these of the variables: with nu the
gradient of the Lagrangian in Z,

    H = d2/dx2 (L with V held fixed + nu Z(x)) + (dZ/dx)^T (d2/dZ2 of the Lagrangian) (dZ/dx),

and the constraints' Jacobian is dg/dx with V held fixed + (dg/dV) (dV/dZ) (dZ/dx).

Differentiating the composition instead, in as many directions as the variables of neighbouring segments need colours,
evaluates every limit once a direction: more than ten times the work where the functions are long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi
import numpy as np


class Derivatives(NamedTuple):
    """As ``nlpsol`` takes them: casadi Functions (x, p) -> g, dg/dx and (x, p, lam_f, lam_g) -> upper triangle."""

    jacobian: Any
    hessian: Any


@dataclass(eq=False)
class Lifted:
    """Collects calls of functions at instants, each replaced by symbols for its values.

    Attributes:
        calls: (function, its arguments a column an instant, symbols of its values).
    """

    calls: list[tuple[Any, list[Any], Any]] = field(default_factory=list)

    def __call__(self, function: Any, *arguments: Any) -> Any:
        """Symbols ``(rows, N)`` in place of ``function.map(N)(*arguments)``."""
        values = casadi.MX.sym(f"V{len(self.calls)}", function.size1_out(0), arguments[0].shape[1])
        self.calls.append((function, list(arguments), values))
        return values

    def resolved(self, expressions: list[Any]) -> list[Any]:
        """Expressions in terms of the variables alone."""
        values = [function.map(symbols.shape[1])(*arguments) for function, arguments, symbols in self.calls]
        found: list[Any] = casadi.graph_substitute(expressions, [symbols for _, _, symbols in self.calls], values)
        return found

    def derivatives(self, variables: Sequence[Any], f: Any, g: Any) -> Derivatives:
        """Jacobian of the constraints and Hessian of the Lagrangian.

        Args:
            variables: symbols, of which x is the concatenation ``(n,)``.
            f: objective, in terms of x and the symbols.
            g: constraints, likewise; both linear in the symbols, with factors that do not depend on x.
        """
        x = casadi.MX.sym("x", sum(v.numel() for v in variables))
        parts = casadi.vertsplit(x, np.cumsum([0, *(v.numel() for v in variables)]).tolist())
        flat = [argument for _, arguments, _ in self.calls for argument in arguments]
        f, g, *flat = casadi.graph_substitute([f, g, *flat], list(variables), parts)
        given = iter(flat)
        calls = [_Call(function, [next(given) for _ in arguments], v, x) for function, arguments, v in self.calls]
        symbols = [call.values for call in calls]
        zeros = [casadi.MX(*values.shape) for values in symbols]

        def held(expression: Any) -> Any:
            return casadi.graph_substitute([expression], symbols, zeros)[0]

        p, lam_f, lam_g = casadi.MX.sym("p", 0), casadi.MX.sym("lam_f"), casadi.MX.sym("lam_g", g.numel())
        outer = lam_f * f + casadi.dot(lam_g, g)
        hessian, jacobian = held(casadi.hessian(outer, x)[0]), held(casadi.jacobian(g, x))
        values = []
        for call in calls:
            hessian = hessian + call.hessian(x, held(casadi.gradient(outer, call.values)))
            factors = held(casadi.jacobian(g, call.values))
            value, slopes = call.slopes()
            values.append(value)
            if factors.nnz():
                jacobian = jacobian + casadi.mtimes(casadi.mtimes(factors, slopes), call.jacobian)
        resolved = casadi.graph_substitute([g], symbols, values)[0]
        return Derivatives(
            casadi.Function("nlp_jac_g", [x, p], [resolved, jacobian], ["x", "p"], ["g", "jac_g_x"]),
            casadi.Function(
                "nlp_hess_l", [x, p, lam_f, lam_g], [casadi.triu(hessian)], ["x", "p", "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        )  # fmt: skip


class _Call:
    """A function at instants, with what differentiates it."""

    def __init__(self, function: Any, arguments: list[Any], values: Any, x: Any) -> None:
        self.function, self.arguments, self.values = function, arguments, values
        self.first, self.second, self.active = _local(function)
        self.z = casadi.vertcat(*arguments)[self.active, :]
        self.jacobian = casadi.jacobian(casadi.vec(self.z), x)

    def slopes(self) -> tuple[Any, Any]:
        """The values ``(rows, N)``, and their Jacobian in Z, block by block."""
        values, blocks = self.first.map(self.values.shape[1])(*self.arguments)
        return values, casadi.diagcat(*casadi.horzsplit(blocks, len(self.active)))

    def hessian(self, x: Any, weights: Any) -> Any:
        """Of the sum of the values times weights ``(rows, N)``."""
        slopes, bends = self.second.map(self.values.shape[1])(*self.arguments, weights)
        blocks = casadi.diagcat(*casadi.horzsplit(bends, len(self.active)))
        held = casadi.MX.sym("nu", slopes.shape)
        bent = casadi.hessian(casadi.dot(held, self.z), x)[0]
        composed = casadi.mtimes(self.jacobian.T, casadi.mtimes(blocks, self.jacobian))
        return composed + casadi.graph_substitute([bent], [held], [slopes])[0]


def _local(function: Any) -> tuple[Any, Any, list[int]]:
    """Derivatives of a function in those of its arguments that it depends on.

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
    active = [i for i, depends in enumerate(used) if depends] or [0]
    chosen = casadi.vertcat(*(stacked[i] for i in active))
    one = casadi.cse([casadi.densify(values), casadi.densify(casadi.jacobian(values, chosen))])
    bends, slopes = casadi.hessian(casadi.dot(weights, values), chosen)
    two = casadi.cse([casadi.densify(slopes), casadi.densify(bends)])
    return (
        casadi.Function("first", arguments, one),
        casadi.Function("second", [*arguments, weights], two),
        active,
    )
