"""Many objectives as one, in numbers: a scalarisation as a small function of the objectives' values."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.transcription.mapped import Mapped
from ocp_traj.transcription.symbolic import plain_objectives


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
        return np.array(self._slope(given[None])[0][0]).reshape(1 + len(self.rows), -1)

    def bend(self, given: Array, weights: Array) -> Array:
        """Hessian of the outputs times weights ``(1 + rows,)``."""
        return np.array(self._bend(given[None], weights[None])[0][0]).reshape(len(given), -1)
