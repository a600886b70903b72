"""A limit or an objective of one's own on top of a problem that is there, at all its levels and alternatives.

What is added is a function of ``RobotState``: the state at one instant, with efforts and the tool's pose. No file holds
it, so the problem's id says so: ``task + reach``. Give the result an importable id, ``module:function`` of what makes
it, and commands and files find it again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.registry import AND
from ocp_traj.formulation.requirements import PathConstraint, State, state_function
from ocp_traj.formulation.standard import EFFORT


class RobotState:
    """The state of a problem's robot at one instant, symbolic.

    Attributes:
        q, v, a, jerk, snap: joint coordinates and their time derivatives ``(dof,)``, SI.
        parameters: of the problem, such as the payload ``(n_p,)``.
        u: local time in [0, 1] on the segment.
    """

    def __init__(self, problem: Problem, state: State) -> None:
        """Of a plain state."""
        self._problem, self._state = problem, state
        self.q, self.v, self.a, self.jerk, self.snap = state[:5]
        self.parameters, self.u = state.p, state.u

    @property
    def tau(self) -> Any:
        """Efforts of the actuators ``(dof,)`` [N m or N], the payload's among them."""
        limit = _effort_limit(self._problem)
        if limit is None:
            raise InputError(f"{self._problem.id} has no limit {EFFORT!r}, whose efforts tau are; give it one")
        return limit.expression(self._state)

    @property
    def position(self) -> Any:
        """Origin of the tool frame in the world ``(3,)`` [m]."""
        return self._pose()[1]

    @property
    def rotation(self) -> Any:
        """Axes of the tool frame in the world, by columns ``(3, 3)``."""
        return self._pose()[0]

    def _pose(self) -> Any:
        robot = self._problem.robot
        if not hasattr(robot, "tool_pose"):
            raise InputError(f"{self._problem.id} has no robot whose tool has a pose; leave out position and rotation")
        return robot.tool_pose(self.q)


Own = Callable[[RobotState], Any]


def _effort_limit(problem: Problem) -> PathConstraint | None:
    return next((limit for limit in problem.requirements.path_constraints if limit.id == EFFORT), None)


def with_limit(
    problem: Problem,
    name: str,
    expression: Own,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    unit: str = "-",
    *,
    labels: Sequence[str] = (),
) -> Problem:
    """The problem with lower <= expression <= upper at every instant as well, solved and proved like any other limit.

    The expression has to be smooth: of a norm take the square, of a maximum several rows.

    Args:
        problem: as it is loaded or built.
        name: unique among its limits and objectives.
        expression: of a ``RobotState``, ``(rows,)``.
        lower: bound, a number or one a row; None where there is none.
        upper: likewise.
        unit: of all rows.
        labels: one a row; ``row 1``, .. where not given.
    """
    if lower is None and upper is None:
        raise InputError(f"the limit {name!r} has no bound; give lower, upper or both")

    def added(problem: Problem) -> Problem:
        wanted = problem.requirements
        stacked = _function(problem, expression)
        rows, constants = _shape(problem, name, stacked)
        names = tuple(labels) or ((name,) if rows == 1 else tuple(f"row {i + 1}" for i in range(rows)))
        low, high = -np.inf if lower is None else lower, np.inf if upper is None else upper
        limit = PathConstraint(
            name, stacked, np.asarray(low, dtype=float), np.asarray(high, dtype=float), (unit,) * rows, names,
            constants=constants,
        )  # fmt: skip
        return replace(problem, requirements=replace(wanted, path_constraints=(*wanted.path_constraints, limit)))

    return _added(problem, name, added)


def with_objective(
    problem: Problem,
    name: str,
    integrand: Own,
    unit: str = "-",
    *,
    scale: float = 1.0,
    sense: str = "min",
    worst: float | None = None,
) -> Problem:
    """The problem with the integral of an expression over time as one more objective.

    Args:
        problem: as it is loaded or built.
        name: unique among its limits and objectives.
        integrand: of a ``RobotState``, a scalar.
        unit: of the integral.
        scale: what a weighted sum divides it by.
        sense: "min" or "max".
        worst: worst value worth having, which bounds fronts; without it they need a reference point.
    """

    def added(problem: Problem) -> Problem:
        stacked = _function(problem, integrand)
        rows, constants = _shape(problem, name, stacked)
        if rows != 1:
            raise InputError(f"the objective {name!r} has {rows} rows; give a scalar, such as casadi.sumsqr of them")
        own = Objective(name, unit, scale, sense, integrand=stacked, constants=constants)
        points = dict(problem.reference_point) | ({} if worst is None else {name: worst})
        return replace(problem, objectives=(*problem.objectives, own), reference_point=points)

    return _added(problem, name, added)


def _function(problem: Problem, expression: Own) -> Callable[[State], Any]:
    def stacked(state: State) -> Any:
        value = expression(RobotState(problem, state))
        return casadi.vertcat(*value) if isinstance(value, list | tuple) else value

    return stacked


def _shape(problem: Problem, name: str, expression: Callable[[State], Any]) -> tuple[int, Array | None]:
    """How many rows an expression has, and the constants of efforts, what is carried on each move, if it needs them."""
    efforts, wanted = _effort_limit(problem), problem.requirements
    constants = None if efforts is None else efforts.constants
    width = 0 if constants is None else constants.shape[1]
    function = state_function(name, expression, wanted.dof, len(wanted.parameters), width)
    return int(function.numel_out(0)), constants if width and function.jac_sparsity(0, 3).nnz() else None


def with_id(problem: Problem, id: str) -> Problem:
    """The problem under another id, such as ``my_cell:build``, of the function that makes it."""
    return _everywhere(problem, lambda own: replace(own, id=id))


def _added(problem: Problem, name: str, added: Callable[[Problem], Problem]) -> Problem:
    if problem.decomposition is not None:
        raise InputError(f"{problem.id} is solved by parts in this case, which would not know {name!r}; take another")
    return _everywhere(problem, lambda own: replace(added(own), id=own.id + AND + name))


def _everywhere(problem: Problem, change: Callable[[Problem], Problem]) -> Problem:
    """The problem changed, at all its levels and alternatives."""
    others = {choice: _everywhere(own, change) for choice, own in problem.alternatives.items()}
    whole = replace(change(problem), alternatives=others)
    if (levels := problem.levels) is None:
        return whole

    def of(neighbour: Callable[[], Problem] | None) -> Callable[[], Problem] | None:
        return None if neighbour is None else cache(lambda: _everywhere(neighbour(), change))

    return replace(whole, levels=replace(levels, coarser=of(levels.coarser), finer=of(levels.finer)))
