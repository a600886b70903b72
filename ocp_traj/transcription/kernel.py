"""A function of the state at one instant, with its derivatives in the few numbers it depends on.

Written with derivatives in local time and the segment's duration, these numbers Z are the curve's derivatives in local
time that the function uses, the duration T, the parameters p, the local time u and the sweep s.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.arrays import Array
from ocp_traj.formulation.chosen import ChosenLimit
from ocp_traj.formulation.objective import SumOfSquares
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, PathConstraint, PointConstraint, state_function
from ocp_traj.mapped import Mapped
from ocp_traj.transcription.symbolic import integrand_function


class First(NamedTuple):
    """A function at instants, to first order.

    Attributes:
        values: ``(N, rows)``.
        slopes: in Z ``(N, rows, size)``.
        squared: where the function is the sum of squares of rows, their values and slopes likewise.
    """

    values: Array
    slopes: Array
    squared: tuple[Array, Array] | None = None


class Kernel:
    """Value, gradient and Hessian of a function at many instants.

    Args:
        function: casadi SX Function (stacked derivatives in time ``(5 dof,)``, u or (u, s), p, c) -> ``(rows,)``.
        dof: joints.

    Attributes:
        rows: of the function.
        orders: derivatives in local time that it uses.
        size: of Z = (derivatives of those orders, T, p, u, s), with only those that the function uses.
        duration, parameters, time, sweep: places in Z, slices that are empty where the function does not use them.
        depends: which rows use which joints, T and p: bool ``(rows, dof + 1 + n_p)``; all of them on u or s.
    """

    def __init__(self, function: Any, dof: int) -> None:
        """Compiles the derivatives."""
        states, duration = casadi.SX.sym("D", len(ORDERS) * dof), casadi.SX.sym("T")
        place, p, c = (casadi.SX.sym(name, function.numel_in(i)) for name, i in (("u", 1), ("p", 2), ("c", 3)))
        timed = [part / duration**order for order, part in enumerate(casadi.vertsplit(states, dof))]
        value = casadi.densify(casadi.vec(function(casadi.vertcat(*timed), place, p, c)))
        self.rows, weights = value.numel(), casadi.SX.sym("w", value.numel())

        def used(inputs: Any) -> NDArray[np.bool_]:
            return np.array(casadi.DM(casadi.jacobian_sparsity(value, inputs), 1.0), dtype=bool).reshape(
                self.rows, inputs.numel()
            )

        derivatives = used(states).reshape(self.rows, len(ORDERS), dof)
        self.orders = tuple(np.nonzero(derivatives.any(axis=(0, 2)))[0].tolist())
        uses = used(duration), used(p), used(place)
        self.depends = np.concatenate([derivatives.any(axis=1), uses[0], uses[1]], axis=1)
        active = [casadi.vertcat(*(states[o * dof : (o + 1) * dof] for o in self.orders))]
        places = []
        for numbers, wanted in (
            (duration, uses[0].any()), (p, uses[1].any()), (place[0], uses[2][:, 0].any()),
            (place[1:], uses[2][:, 1:].any()),
        ):  # fmt: skip
            begin = sum(part.numel() for part in active)
            active.append(numbers if wanted else casadi.SX(0, 1))
            places.append(slice(begin, begin + active[-1].numel()))
        self.duration, self.parameters, self.time, self.sweep = places
        chosen = casadi.vertcat(*active)
        self.size = chosen.numel()
        inputs = [states, duration, place, p, c]
        slope = casadi.densify(casadi.jacobian(value, chosen))
        bend, gradient = casadi.hessian(casadi.dot(weights, value), chosen)
        # Without `cse`: it takes longer than all the rest here, and finds less than a twentieth of the operations.
        second = [casadi.densify(gradient), casadi.vec(casadi.densify(bend))]
        self._values = Mapped(casadi.Function("value", inputs, [value]))
        self._first = Mapped(casadi.Function("first", inputs, [value, casadi.vec(slope.T)]))
        self._second = Mapped(casadi.Function("second", [*inputs, weights], second))

    def values(self, arguments: tuple[Array, ...]) -> Array:
        """Values ``(N, rows)`` at arguments ``(N, ..)``: derivatives in local time, T, (u, s), p, c."""
        return self._values(*arguments)[0].copy()

    def first(self, arguments: tuple[Array, ...]) -> First:
        """Values and their derivatives in Z, together in little more time than the values alone."""
        values, slopes = self._first(*arguments)
        return First(values.copy(), slopes.reshape(len(slopes), -1, self.size).copy())

    def second(
        self, arguments: tuple[Array, ...], weights: Array, first: First | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Gradient ``(N, size)`` and Hessian ``(N, size, size)`` in Z of the rows times weights ``(N, rows)``.

        It takes most of a solve's time, and is not evaluated where all weights are zero.

        Args:
            arguments: see ``values``.
            weights: of the rows.
            first: what ``first`` has found for the same arguments, where that is known.
        """
        weighed = np.flatnonzero(weights.any(axis=1))
        gradient, bend = np.zeros((len(weights), self.size)), np.zeros((len(weights), self.size, self.size))
        if len(weighed):
            found = self._second(*(values[weighed] for values in (*arguments, weights)))
            gradient[weighed], bend[weighed] = found[0], found[1].reshape(-1, self.size, self.size)
        return gradient, bend


class SquaresKernel(Kernel):
    """The sum of squares of a function's rows r(Z), from derivatives of those.

    The Hessian of w r.r is 2 w (r'^T r' + sum_i r_i r_i''): the second term is that of a weighted sum of the rows, and
    far less than what differentiating r.r as a whole takes.

    Args:
        function: of the rows, see ``Kernel``.
        dof: joints.
    """

    def __init__(self, function: Any, dof: int) -> None:
        """Compiles the derivatives of the rows."""
        super().__init__(function, dof)
        self.rows, self.depends = 1, np.asarray(self.depends.any(axis=0, keepdims=True))

    def values(self, arguments: tuple[Array, ...]) -> Array:
        """Values ``(N, 1)``."""
        return np.asarray((self._values(*arguments)[0] ** 2).sum(axis=1, keepdims=True))

    def first(self, arguments: tuple[Array, ...]) -> First:
        """Values ``(N, 1)`` and their derivatives in Z ``(N, 1, size)``."""
        rows, slopes = squared = super().first(arguments)[:2]
        return First((rows**2).sum(axis=1, keepdims=True), 2.0 * (rows[:, None, :] @ slopes), squared)

    def second(
        self, arguments: tuple[Array, ...], weights: Array, first: First | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Gradient ``(N, size)`` and Hessian ``(N, size, size)`` in Z times weights ``(N, 1)``."""
        squared = (self.first(arguments) if first is None else first).squared
        assert squared is not None
        rows, slopes = squared
        gradient, bend = self._second(*arguments, 2.0 * weights * rows)
        twice = 2.0 * weights[:, :, None] * slopes
        return gradient.copy(), bend.reshape(-1, self.size, self.size) + np.swapaxes(twice, 1, 2) @ slopes


def limit_kernel(problem: Problem, name: str) -> Kernel:
    """The kernel of a path or point constraint, or of an objective's integrand or total variation, compiled once."""
    requirements = problem.requirements

    def build() -> Kernel:
        limits: list[PathConstraint | PointConstraint] = [
            *requirements.path_constraints, *requirements.point_constraints,
        ]  # fmt: skip
        for limit in limits:
            if limit.id == name:
                return Kernel(requirements.function(limit), requirements.dof)
        objective = problem.objective(name)
        if objective.variation is not None:
            return Kernel(requirements.function(problem.variation(objective)), requirements.dof)
        if isinstance(objective.integrand, SumOfSquares):
            rows = objective.integrand.rows
            return SquaresKernel(integrand_function(problem, objective, rows), requirements.dof)
        return Kernel(integrand_function(problem, objective), requirements.dof)

    kernel: Kernel = problem.cached(("kernel", name), build)
    return kernel


def chosen_kernel(problem: Problem, limit: ChosenLimit, row: int) -> Kernel:
    """The kernel of a row of a limit whose constants are chosen, one for all rows that share its expression."""
    expression, requirements = limit.expressions[row], problem.requirements

    key = expression, requirements.dof, len(requirements.parameters)
    if key not in limit.kernels:
        limit.kernels[key] = Kernel(state_function(limit.id, *key, limit.number), requirements.dof)
    kernel: Kernel = limit.kernels[key]
    return kernel


def linear_kernel(problem: Problem) -> Kernel:
    """The kernel of c_0 + c_q . q + c_p . p, its constants c ``(1 + dof + n_p,)``, compiled once."""

    def build() -> Kernel:
        dof, count = problem.requirements.dof, len(problem.requirements.parameters)
        sizes = {"s": len(ORDERS) * dof, "u": 1, "p": count, "c": 1 + dof + count}
        states, place, p, c = (casadi.SX.sym(name, size) for name, size in sizes.items())
        value = c[0] + casadi.dot(c[1:], casadi.vertcat(states[:dof], p))
        return Kernel(casadi.Function("linear", [states, place, p, c], [value]), dof)

    kernel: Kernel = problem.cached("linear kernel", build)
    return kernel
