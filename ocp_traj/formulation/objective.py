"""Objectives of a problem, and the rules by which those that are integrals are summed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
from numpy.polynomial.legendre import leggauss

from ocp_traj.arrays import Array
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.requirements import Expression, State

Rule = tuple[tuple[float, float], ...]
"""Nodes and weights ((u_r, w_r), ..) on a segment of unit length."""


def gauss(points: int) -> Rule:
    """Gauss-Legendre rule on [0, 1]: exact for polynomials up to degree 2 points - 1."""
    nodes, weights = leggauss(points)
    return tuple(((1.0 + float(u)) / 2.0, float(w) / 2.0) for u, w in zip(nodes, weights, strict=True))


GAUSS = gauss(10)
"""The rule of integrals that name none: exact to degree 19 a segment, so for squares of derivatives of curves up to
degree 9; efforts squared are within 1e-3 along random motions of this package's arms (``tests/test_objective.py``)."""

# Rules that papers use; the trapezoid is not close where segments are few.
TRAPEZOID: Rule = ((0.0, 0.5), (1.0, 0.5))
MIDPOINT: Rule = ((0.5, 1.0),)


def rule_name(rule: Rule) -> str:
    """A rule in words; nothing for none."""
    if not rule:
        return ""
    if rule == TRAPEZOID:
        return "trapezoid: as the paper has it, not exact"
    if rule == gauss(len(rule)):
        return f"Gauss, exact to degree {2 * len(rule) - 1}"
    return f"{len(rule)} nodes"


@dataclass(frozen=True)
class SumOfSquares:
    """The integrand that is the sum of squares of an expression's rows; its curvature then costs half as much."""

    rows: Expression

    def __call__(self, state: State) -> Any:
        """Its value."""
        return casadi.sumsqr(self.rows(state))


@dataclass(frozen=True, eq=False)
class Objective:
    """A quantity to be made small (or large): exactly one way of computing it is given.

    Attributes:
        id: unique name, unlike any limit's.
        unit: SI unit.
        scale: what a weighted sum divides it by: sum_k w_k f_k / scale_k.
        sense: ``min`` or ``max``.
        eq: equation of the source.
        integrand: of the state, best a ``SumOfSquares`` where it is one; the objective is
            sum_k T_k sum_r w_r integrand(state(k, u_r)).
        constants: of an integrand, per segment ``(K, n_c)``, reaching it as ``state.c``.
        quadrature: the rule ((u_r, w_r), ..) on a segment of unit length; ``GAUSS`` if not given.
        of_variables: (x, p) -> scalar.
        variation: of the state, linear in q; the objective is the total variation of its rows, sum_r int |dg_r/dt| dt.
        terms: {objective id: factor}, a fixed sum of other objectives.
        resolution: differences of values up to this are none, such as of one that is told short of what it is.
    """

    id: str
    unit: str
    scale: float = 1.0
    sense: str = "min"
    eq: str = ""
    integrand: Expression | None = None
    quadrature: tuple[tuple[float, float], ...] = ()
    of_variables: Callable[[Any, Any], Any] | None = None
    terms: Mapping[str, float] | None = None
    variation: Expression | None = None
    constants: Array | None = None
    resolution: float = 0.0

    def __post_init__(self) -> None:
        """Checks that the objective is given in exactly one way."""
        ways = (self.integrand, self.of_variables, self.terms, self.variation)
        if sum(way is not None for way in ways) != 1:
            raise ProblemDefinitionError(
                f"objective {self.id!r}: give exactly one of integrand, of_variables, terms, variation"
            )
        if self.quadrature and self.integrand is None:
            raise ProblemDefinitionError(f"objective {self.id!r}: a quadrature rule is for an integrand; leave it out")
        if self.constants is not None and self.integrand is None:
            raise ProblemDefinitionError(f"objective {self.id!r}: constants are for an integrand; leave them out")
        if self.integrand is not None and not self.quadrature:
            object.__setattr__(self, "quadrature", GAUSS)
        if self.sense not in ("min", "max"):
            raise ProblemDefinitionError(f"objective {self.id!r}: sense {self.sense!r}; allowed 'min', 'max'")
        if not (np.isfinite(self.scale) and self.scale > 0.0):
            raise ProblemDefinitionError(f"objective {self.id!r}: scale {self.scale}; it must be positive")
