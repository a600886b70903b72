"""What the tool carries on the moves of a task: efforts with a payload that may change where the robot rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.requirements import Expression, State
from ocp_traj.formulation.route import Route
from ocp_traj.formulation.task import Held, Task
from ocp_traj.robot.inertias import inertia_matrix
from ocp_traj.robot.payload import ToolPayload
from ocp_traj.robot.robot import Robot

NOTHING = Held(mass=0.0)
UPPER = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class Carried:
    """Efforts with what is carried.

    Attributes:
        effort: of the actuators, of the state, its parameters and constants.
        mass: the parameter ``payload`` [kg]; None where no move that has none of its own is with one.
        heaviest: of all moves, the parameter at its value [kg].
        constants: of each segment ``(K, n_c)``; None where all moves carry the same.
    """

    effort: Expression
    mass: float | None
    heaviest: float
    constants: Array | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """Labels of the parameters."""
        return () if self.mass is None else ("payload",)


def carried(task: Task, robot: Robot, route: Route, made: Parametrisation) -> Carried:
    """What the moves of a task carry.

    Where all carry the same its mass is the parameter. Else that is the mass of the robot's payload, on moves that have
    no other; a dwell is with the payload of the move before it, and the next move begins with its own at rest, so that
    it may change hands at any moment between.
    """
    own, held = _held(task)
    if all(one == held[0] for one in held):
        com, inertia = held[0].com, held[0].inertia
        mass = held[0].mass if task.payload is None else task.payload

        def same(s: State) -> Any:
            return robot.effort(s.q, s.v, s.a, payload=ToolPayload(s.p[0], com, inertia))

        return Carried(same, mass, mass)
    _check_changes(task, route, held)
    given = task.robot.payload is not None or task.payload is not None or task.free_payload
    uses_own = given and any(move.payload is None for move in task.move)
    if task.free_payload and not uses_own:
        raise InputError(f"{task.name}: free_payload frees the robot's payload, and every [[move]] has its own instead")
    return Carried(
        _changing(robot, held, uses_own),
        own.mass if uses_own else None,
        max(one.mass for one in held),
        _table(task, route, made, held, uses_own),
    )


def payload_notes(task: Task) -> tuple[str, ...]:
    """A line on what each move carries, where that is not the same."""
    _, held = _held(task)
    if all(one == held[0] for one in held):
        return ()
    found = []
    for number, (move, one) in enumerate(zip(task.move, held, strict=True), 1):
        freed = move.payload is None and task.free_payload
        mass = "a mass that is freed" if freed else f"{one.mass:.6g} kg" if one.mass else "nothing"
        words = f"move {number} carries {mass}"
        if one.mass and move.payload is None and not freed:
            words += ", the robot's payload"
        if one.mass or freed:
            words += f", centred at {_row(one.com)} m in the tool frame"
            words += "" if one.inertia is None else f", inertia {_row(one.inertia)} kg m2"
        found.append(words)
    return tuple(found)


def _row(numbers: Sequence[float]) -> str:
    return f"({', '.join(f'{number:.6g}' for number in numbers)})"


def _held(task: Task) -> tuple[Held, list[Held]]:
    """What the robot carries, and each move."""
    own = task.robot.payload or NOTHING
    if task.payload is not None:
        own = own.model_copy(update={"mass": task.payload})
    return own, [own if move.payload is None else move.payload for move in task.move]


def _check_changes(task: Task, route: Route, held: list[Held]) -> None:
    """Refuses a payload that changes where the robot does not rest."""
    for point, (before, after) in enumerate(zip(route.moves, route.moves[1:], strict=False), 1):
        if held[before] == held[after]:
            continue
        if point not in route.stops:
            raise InputError(
                f"{task.name}: the payload changes after [[move]] {before + 1}, which has stop = false; the robot "
                "rests where it changes: leave stop out"
            )
        if task.curve.rest < 2:
            raise InputError(
                f"{task.name}: [curve] rest is {task.curve.rest}; where the payload changes velocity and acceleration "
                "vanish: give 2 or more"
            )


def _changing(robot: Robot, held: list[Held], uses_own: bool) -> Expression:
    """Efforts of the constants (whether the parameter is the mass, else the mass, centre, inertia)."""
    coms, inertias = (np.unique(np.array(rows), axis=0) for rows in ([h.com for h in held], _inertias(held)))
    com, inertia = coms[0], np.zeros((3, 3))
    inertia[UPPER] = inertias[0]
    inertia = inertia + np.triu(inertia, 1).T

    def effort(s: State) -> Any:
        mass = s.c[1] if not uses_own else s.c[0] * s.p[0] + s.c[1]
        turning: Any = inertia if inertia.any() else None
        if len(inertias) > 1:
            a, b, c, d, e, f = casadi.vertsplit(s.c[5:11])
            turning = casadi.vertcat(casadi.horzcat(a, b, c), casadi.horzcat(b, d, e), casadi.horzcat(c, e, f))
        body = ToolPayload(casadi.SX(mass), com if len(coms) == 1 else s.c[2:5], turning)
        return robot.effort(s.q, s.v, s.a, payload=body)

    return effort


def _inertias(held: list[Held]) -> Array:
    """Moments ``(moves, 6)`` ixx, ixy, ixz, iyy, iyz, izz."""
    return np.array([np.zeros(6) if h.inertia is None else inertia_matrix(h.inertia)[UPPER] for h in held])


def _table(task: Task, route: Route, made: Parametrisation, held: list[Held], uses_own: bool) -> Array:
    """The constants of each segment."""
    rows = [
        np.concatenate([[1.0, 0.0] if move.payload is None and uses_own else [0.0, one.mass], one.com, moments])
        for move, one, moments in zip(task.move, held, _inertias(held), strict=True)
    ]
    last = made.legs[-1].stop
    found = np.zeros((last, len(rows[0])))
    # Each leg's payload goes on to the start of the next one, over a dwell.
    for leg, end, move in zip(made.legs, [*(leg.start for leg in made.legs[1:]), last], route.moves, strict=True):
        found[leg.start : end] = rows[move]
    return found
