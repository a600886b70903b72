"""Many objectives as one, in numbers: a scalarisation as a small function of the objectives' values."""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.transcription.symbolic import plain_objectives


class ScalarObjective:
    """A scalarisation of a problem's objectives, a linear function of their values.

    Attributes:
        names: of the plain objectives it is a function of.
        extra: 1 where the scalarisation has a variable of its own, else 0.
        rows: (objective id, bound) a row.
        slope: derivatives ``(1 + rows, values)`` of f and the rows in the values, and in the extra variable.
    """

    def __init__(self, problem: Problem, scalarisation: Scalarisation) -> None:
        """Finds its coefficients; raises ``ProblemDefinitionError`` where it is not linear."""
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
        if any(casadi.which_depends(outputs, given, 2, True)):
            raise ProblemDefinitionError(
                f"{problem.id}: {type(scalarisation).__name__} is not linear in the objectives' values; state it by "
                "rows and a variable of its own, as goal attainment does"
            )
        linear = casadi.Function("scalar", [given], [outputs, casadi.densify(casadi.jacobian(outputs, given))])
        constant, slope = linear(np.zeros(given.numel()))
        self._constant, self.slope = np.array(constant).ravel(), np.array(slope).reshape(outputs.numel(), given.numel())

    def values(self, given: Array) -> Array:
        """f, then the rows' values ``(1 + rows,)``, at the objectives' values and that of the extra variable."""
        return np.asarray(self.slope @ given + self._constant)
