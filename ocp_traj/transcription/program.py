"""A nonlinear program as numbers: f, g, their gradients and the Hessian of the Lagrangian at any x."""

from __future__ import annotations

from typing import Any, Protocol

import casadi
import numpy as np

from ocp_traj.arrays import Array

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
