"""What ``[collision]`` of a task adds to its problem: limits, the clearance as an objective, starts that are clear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.clearance_rows import distances_of
from ocp_traj.formulation.collision_resolution import bodies_of, pairs_of
from ocp_traj.formulation.collision_table import CollisionTable
from ocp_traj.formulation.detours import around
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.robot.pair_distances import PairDistances
from ocp_traj.robot.robot import Robot

CLEARANCE = "clearance"  # objective, and parameter of a trajectory: the distance to all obstacles that it keeps
OBSTACLES, OWN = "obstacles", "self-collision"  # limits
ROOM = 1e-3  # [m] of the clearance above the least one, even where the ends leave less: our choice
RESERVE = (
    1e-4  # [m] by which a clearance is told short of what was found: what a controller makes of a motion is within
)
DENSE = 65  # samples a segment of a search for the least distance: our choice


@dataclass(frozen=True, eq=False)
class Clear:
    """A task's limits on distances.

    Attributes:
        name: of the task.
        constraints: one on obstacles, one on the robot's own bodies, or either.
    """

    name: str
    constraints: tuple[ClearanceConstraint, ...]

    @classmethod
    def of(cls, name: str, table: CollisionTable, robot: Robot) -> Clear:
        """Of a resolved table."""
        bodies = bodies_of(table, robot)
        found = []
        for id, names, distance, parameter in (
            (OBSTACLES, table.pairs or (), table.clearance, CLEARANCE),
            (OWN, table.own_pairs, table.self_clearance, ""),
        ):
            if names:
                pairs = pairs_of(names, bodies)
                used = sorted({i for pair in pairs for i in pair})
                index = {i: place for place, i in enumerate(used)}
                found.append(
                    ClearanceConstraint(
                        id, robot, tuple(bodies[i] for i in used), tuple((index[i], index[j]) for i, j in pairs),
                        distance, parameter=parameter,
                    )
                )  # fmt: skip
        return cls(name, tuple(found))

    @cached_property
    def distances(self) -> tuple[PairDistances, ...]:
        """Of the pairs of each constraint."""
        return tuple(distances_of(constraint) for constraint in self.constraints)

    def room(self, q: Array) -> Array:
        """By how much the nearest bodies are farther apart than they have to be, at postures ``(N, dof)``: ``(N,)``."""
        least = np.full(len(q), np.inf)
        for constraint, distances in zip(self.constraints, self.distances, strict=True):
            least = np.minimum(least, distances.least(q) - constraint.clearance)
        return least

    def require_clear(self, points: Sequence[tuple[str, Array]]) -> None:
        """Refuses places ``(dof,)`` at which bodies are nearer than they may be: which, and by how much."""
        for constraint, distances in zip(self.constraints, self.distances, strict=True):
            rows = np.arange(len(constraint.pairs))
            for words, q in points:
                found = distances.distances(np.repeat(q[None], len(rows), axis=0), rows)
                i, j = constraint.pairs[int(np.argmin(found))]
                links, least = f"{constraint.bodies[i].link} and {constraint.bodies[j].link}", float(found.min())
                if least < 0.0:
                    raise InputError(
                        f"{self.name}: at {words} {links} overlap by {-1e3 * least:.3g} mm; no motion could be "
                        "clear of that: move one of them"
                    )
                if least < constraint.clearance:
                    key = "clearance" if constraint.id == OBSTACLES else "self_clearance"
                    raise InputError(
                        f"{self.name}: at {words} {links} are {1e3 * least:.3g} mm apart; [collision] {key} asks for "
                        f"{1e3 * constraint.clearance:.3g} mm: ask for less, or move one of them"
                    )

    def most(self, points: Sequence[Array]) -> float:
        """The clearance of obstacles that no motion through points exceeds [m]."""
        (distances,) = (d for c, d in zip(self.constraints, self.distances, strict=True) if c.id == OBSTACLES)
        return float(distances.least(np.array(points)).min())

    @property
    def keeps_off_obstacles(self) -> bool:
        """Whether there are obstacles."""
        return any(constraint.id == OBSTACLES for constraint in self.constraints)


def with_clearance(
    problem: Problem, clear: Clear, made: Parametrisation, points: Sequence[tuple[str, Array]], *, bent: bool = True
) -> Problem:
    """A problem with limits on distances; where there are obstacles, with their clearance as an objective as well.

    Args:
        problem: of the curve alone.
        clear: the limits.
        made: its curve.
        points: that every motion passes, in words and ``(dof,)``.
        bent: whether starts may leave the way between points, to go around.
    """
    own_guess = not bent or made.refine is not None or len(made.legs[0]) == 1
    guess = made.guess if own_guess else around(made, problem.robot.limits, clear.room)
    requirements = problem.requirements
    if not clear.keeps_off_obstacles:
        requirements = replace(requirements, clearance_constraints=clear.constraints)
        return replace(problem, requirements=requirements, guess=guess)
    n, dilate, parameters, read = problem.size, problem.dilate, problem.parameters, problem.variables_of
    (asked,) = (c.clearance for c in clear.constraints if c.id == OBSTACLES)
    most = max(clear.most([q for _, q in points]), asked + ROOM)
    margin = Variable("margin", np.array([asked]), np.array([most]), "m", ("least clearance",), slack_of=CLEARANCE)
    requirements = replace(
        requirements, parameters=(*requirements.parameters, CLEARANCE), clearance_constraints=clear.constraints
    )

    def tighten(x: Array) -> Array:
        tight = np.array(x, dtype=float)
        tight[n] = np.clip(_along(clear, made.curve(tight[:n])) - RESERVE, tight[n], most)
        return tight

    return replace(
        problem,
        variables=(*problem.variables, margin),
        curve=_of_first(problem.curve, n),
        parameters=lambda x: casadi.vertcat(parameters(x[:n]), x[n]),
        objectives=(
            *problem.objectives,
            Objective(CLEARANCE, "m", SCALE, "max", of_variables=lambda x, p: x[n], resolution=RESERVE),
        ),
        requirements=requirements,
        guess=lambda rng: np.append(guess(rng), asked),
        dilate=dilate and (lambda x, s: np.append(dilate(x[:n], s), x[n:])),
        scales_in_time=False,
        variables_of=read and (lambda motion: np.append(read(motion), motion.parameters.get(CLEARANCE, asked))),
        reference_point={**problem.reference_point, CLEARANCE: asked},
        tighten_slacks=tighten,
    )


SCALE = 0.01  # [m] of the objective: our choice


def collision_notes(table: CollisionTable | None) -> tuple[str, ...]:
    """Which pairs of links a resolved table leaves out, so that "proved" is never read to be of them."""
    if table is None or not table.touching:
        return ()
    pairs = ", ".join(" - ".join(pair) for pair in table.touching)
    return (f"collision: not looked at, since their bodies overlap at most postures: {pairs}",)


def _of_first(function: Callable[[Any], Any], n: int) -> Callable[[Any], Any]:
    return lambda x: function(x[:n])


def _along(clear: Clear, curve: Any) -> float:
    """The least distance to obstacles along a curve [m]: by samples, and finer ones about the least of them."""
    (distances,) = (d for c, d in zip(clear.constraints, clear.distances, strict=True) if c.id == OBSTACLES)
    times = np.concatenate([
        curve.knots[k] + np.linspace(0.0, 1.0, DENSE) * curve.durations[k] for k in range(curve.segments)
    ])  # fmt: skip
    step = float(np.diff(times).max())
    least = distances.least(curve(times))
    for _ in range(8):
        centres = times[np.argsort(least)[:DENSE]]
        step /= 4.0
        times = np.clip(np.unique(centres[:, None] + step * np.arange(-4, 5)), 0.0, float(curve.duration))
        least = distances.least(curve(times))
    return float(least.min())
