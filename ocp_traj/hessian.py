"""The Hessian of an NLP's Lagrangian from the small ones of each instant.

A limit or an integrand is a function V of few numbers Z at its instant, and these of the variables: with nu the
gradient of the Lagrangian in Z,

    H = d2/dx2 (L with V held fixed + nu Z(x)) + (dZ/dx)^T (d2/dZ2 of the Lagrangian) (dZ/dx).

Differentiating the composition instead, in as many directions as the variables of neighbouring segments need colours,
evaluates every limit once a direction: more than ten times the work where the functions are long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi
import numpy as np


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

    def hessian(self, variables: Sequence[Any], f: Any, g: Any) -> Any:
        """Casadi Function (x, p, lam_f, lam_g) -> upper triangle of the Hessian, as ``nlpsol`` takes it.

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
        calls = [(function, [next(given) for _ in arguments], v) for function, arguments, v in self.calls]
        p, lam_f, lam_g = casadi.MX.sym("p", 0), casadi.MX.sym("lam_f"), casadi.MX.sym("lam_g", g.numel())
        outer = lam_f * f + casadi.dot(lam_g, g)
        symbols = [values for _, _, values in calls]
        zeros = [casadi.MX(*values.shape) for values in symbols]
        whole: Any = casadi.MX(x.numel(), x.numel())
        for function, arguments, values in calls:
            count = values.shape[1]
            local, active = _local(function)
            weights = casadi.graph_substitute([casadi.gradient(outer, values)], symbols, zeros)[0]
            slopes, bends = local.map(count)(*arguments, weights)
            z = casadi.vertcat(*arguments)[active, :]
            jacobian = casadi.jacobian(casadi.vec(z), x)
            blocks = casadi.diagcat(*casadi.horzsplit(bends, len(active)))
            whole = whole + casadi.mtimes(jacobian.T, casadi.mtimes(blocks, jacobian))
            held = casadi.MX.sym("nu", slopes.shape)
            bent = casadi.hessian(casadi.dot(held, z), x)[0]
            whole = whole + casadi.graph_substitute([bent], [held], [slopes])[0]
        fixed = casadi.hessian(outer, x)[0]
        whole = whole + casadi.graph_substitute([fixed], symbols, zeros)[0]
        return casadi.Function(
            "nlp_hess_l", [x, p, lam_f, lam_g], [casadi.triu(whole)], ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        )  # fmt: skip


def _local(function: Any) -> tuple[Any, list[int]]:
    """Gradient and Hessian of a weighted sum of a function's rows, in those of its arguments that it depends on.

    Returns:
        casadi SX Function (arguments, weights) -> gradient ``(a,)``, Hessian ``(a, a)``; the places of the a arguments
        among all of them, stacked.
    """
    arguments = [casadi.SX.sym("z", function.size1_in(i)) for i in range(function.n_in())]
    weights = casadi.SX.sym("w", function.size1_out(0))
    value = casadi.dot(weights, function(*arguments))
    stacked = casadi.vertcat(*arguments)
    used = casadi.which_depends(value, stacked, 1, False)
    active = [i for i, depends in enumerate(used) if depends] or [0]
    chosen = casadi.vertcat(*(stacked[i] for i in active))
    bends, slopes = casadi.hessian(value, chosen)
    outputs = casadi.cse([casadi.densify(slopes), casadi.densify(bends)])
    return casadi.Function("local", [*arguments, weights], outputs), active
