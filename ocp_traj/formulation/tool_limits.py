"""Limits of tool paths: how far the tool is off the path, along it and tilted, and how fast it goes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.requirements import PathConstraint, State, state_function
from ocp_traj.formulation.route import Route
from ocp_traj.formulation.tool_motion import tool_speed_squared
from ocp_traj.formulation.tool_moves import PAST, ToolMove
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.paths.cartesian import CONSTANTS, off_corner, places, progress, wanted_rotation
from ocp_traj.robot.robot import Robot

POSITION, PROGRESS, TILT, SPEED, CONSTANT, BLEND = (
    "tool-position",
    "tool-progress",
    "tool-tilt",
    "tool-speed",
    "tool-speed-band",
    "tool-blend",
)
PIECES = (2, 4, 8, 16, 32, 64)  # of a leg, that are tried: our choice, as all that follow
CLOSE = 0.5  # of the tolerance of position: what a start may be off
SAMPLES = 9  # of a piece
MANY = tuple(float(u) for u in np.linspace(0.0, 1.0, 7)[1:])  # first instants of limits that rest along whole arcs
FEW = (0.0, 0.5, 1.0)  # of the others
MOST_EXCHANGES = 16
# A wide barrier leads away from a start along the path, and IPOPT does not always find the way back; so does a narrow
# one where it begins nearer to the limits than the barrier keeps it. Many motions are equally quick: with a finer
# tolerance it goes from one to the other for ever; with this it ends in the middle of them, some 1e-5 s above the
# least time.
BARRIER, PUSH, TOLERANCE = 1e-4, 1e-4, 1e-6
# Where the speed is constant so is nearly all of the time, and what joints do besides is of no account: a little of
# their acceleration makes one motion the best, and costs 0.02 % of the time of a line along which a Panda goes.
TRACE = 1e-2


def tool_speed_limit(robot: Robot, most: float) -> PathConstraint:
    """``tool-speed``: the square of the speed of the tool frame's origin, at all times [m2/s2]."""
    speed = tool_speed_squared(robot)
    none, high = np.array([-np.inf]), np.array([most**2])
    return PathConstraint(SPEED, speed, none, high, ("m2/s2",), ("squared",))


def tool_limits(robot: Robot, route: Route, made: Parametrisation) -> list[PathConstraint]:
    """The limits of moves along tool paths, those of equal tolerances together.

    ``tool-position`` is the square of the distance from the path [mm2]; ``tool-tilt`` 1 - cos of the angle to the
    path's rotation where the tool is along it, or between the axes where it may turn; ``tool-progress`` says that the
    tool does not run past an end by more than the tolerance of position; ``tool-speed-band`` is the square of a speed
    that is constant. Where a corner is rounded ``tool-blend`` is the square of the distance from it over that of the
    blend, and the tilt is from the rotation at the corner. The second and later groups have their first move's number
    among tool paths behind the name.
    """
    groups: dict[tuple[Any, ...], list[tuple[int, ToolMove]]] = {}
    for first, move in route.tool_moves:
        groups.setdefault((move.position, move.tilt, move.free_turn), []).append((first, move))
    table = _table(route, made)
    numbers = [first for first, _ in route.tool_moves]
    found = []
    for (position, tilt, free_turn), moves in groups.items():
        every = {first + i for first, move in moves for i in range(len(move.legs))}
        around = {first + i for first, move in moves for i in move.round}
        name = _name(numbers.index(moves[0][0]))
        found += _along(robot, position, table, _segments(made, sorted(every - around)), name)
        found.append(_tilt(robot, tilt, free_turn, table, _segments(made, sorted(every)), name))
    if corners := [first + i for first, move in route.tool_moves for i in move.round]:
        found.append(
            PathConstraint(
                BLEND, lambda s: off_corner(s.c, robot.tool_pose(s.q)[1]), np.array([-np.inf]), np.ones(1), ("-",),
                ("squared, of the blend's",), constants=table, segments=_segments(made, corners),
            )
        )  # fmt: skip
    bands: dict[tuple[float, float], list[tuple[int, ToolMove]]] = {}
    for first, move in route.tool_moves:
        if move.speed is not None:
            bands.setdefault(move.speed[:2], []).append((first, move))
    for (value, band), moves in bands.items():
        legs = [first + i for first, move in moves for i in move.even]
        low, high = ((value * (1.0 + sign * band)) ** 2 for sign in (-1.0, 1.0))
        name = CONSTANT + _name(numbers.index(moves[0][0]))
        found.append(
            PathConstraint(
                name, tool_speed_squared(robot), np.array([low]), np.array([high]), ("m2/s2",), ("squared",),
                segments=_segments(made, legs),
            )
        )  # fmt: skip
    return found


def enough_pieces(robot: Robot, route: Route, parametrise: Callable[[int], Parametrisation]) -> int:
    """How many pieces a leg it takes until the start keeps to the tool paths within ``CLOSE`` of their tolerances."""
    for count in PIECES:
        made = parametrise(count)
        curve = made.curve(made.guess(np.random.default_rng(0)))
        shares = []
        for limit in tool_limits(robot, route, made):
            if limit.id.startswith(POSITION):
                assert limit.segments is not None and limit.constants is not None
                function = state_function("off", limit.expression, robot.size, 0, CONSTANTS)
                u = np.linspace(0.0, 1.0, SAMPLES)
                for k in limit.segments:
                    states = np.zeros((5 * robot.size, len(u)))
                    states[: robot.size] = np.asarray(curve.at(k, u)).T
                    value = function.map(len(u))(states, u[None], np.zeros((0, 1)), limit.constants[k])
                    shares.append(float(np.array(value).max() / limit.upper[0]))
        if max(shares) <= CLOSE**2:
            break
    return count


def tool_tuning(tuning: Tuning, route: Route, limits: Sequence[PathConstraint]) -> Tuning:
    """The tuning where there are tool paths, as measured on lines, arcs and poses; as it is where there are none."""
    if not route.tool_moves:
        return tuning
    instants: dict[str, Sequence[float]] = {}
    for limit in limits:
        many = limit.id.startswith("tool-")
        instants[limit.id] = MANY if many else () if limit.order is None else FEW
    known = tuning.solver_options.get("ipopt", {})
    constant = any(move.speed is not None for _, move in route.tool_moves)
    trace = {"acceleration": TRACE} if constant else {}
    return replace(
        tuning, instants=instants, max_exchanges=MOST_EXCHANGES, regularisation=trace,
        solver_options={
            **tuning.solver_options,
            "ipopt": {**known, "mu_init": BARRIER, "bound_push": PUSH, "bound_frac": PUSH, "tol": TOLERANCE},
        },
    )  # fmt: skip


def _name(number: int) -> str:
    return f"-{number + 1}" if number else ""


def _table(route: Route, made: Parametrisation) -> Array:
    """Constants of all segments ``(K, CONSTANTS)``, zero where there is no tool path."""
    table = np.zeros((max(leg.stop for leg in made.legs), CONSTANTS))
    for first, move in route.tool_moves:
        for i, leg in enumerate(move.legs):
            table[list(made.legs[first + i])] = leg.constants
    return table


def _segments(made: Parametrisation, legs: Sequence[int]) -> tuple[int, ...]:
    return tuple(k for i in legs for k in made.legs[i])


def _along(robot: Robot, position: float, table: Array, segments: tuple[int, ...], name: str) -> list[PathConstraint]:
    where: dict[str, Any] = {"constants": table, "segments": segments}

    def off(s: State) -> Any:
        outwards, across, _ = places(s.c, robot.tool_pose(s.q)[1])
        return (1e3 * outwards) ** 2 + (1e3 * across) ** 2

    def along(s: State) -> Any:
        return progress(s.c, places(s.c, robot.tool_pose(s.q)[1])[2], PAST * position)

    # With what it may run past an end, the tool is nowhere farther from the path than the tolerance.
    none, whole, mm2 = np.array([-np.inf]), np.ones(1), np.array([(1e3 * position) ** 2 * (1.0 - PAST**2)])
    return [
        PathConstraint(POSITION + name, off, none, mm2, ("mm2",), ("squared",), **where),
        PathConstraint(PROGRESS + name, along, -whole, whole, ("-",), ("of half its window",), **where),
    ]


def _tilt(
    robot: Robot, tilt: float, free_turn: bool, table: Array, segments: tuple[int, ...], name: str
) -> PathConstraint:
    def tilted(s: State) -> Any:
        rotation, place = robot.tool_pose(s.q)
        wanted = wanted_rotation(s.c, places(s.c, place)[2])
        if free_turn:
            return 1.0 - casadi.dot(wanted[:, 2], rotation[:, 2])
        return (3.0 - casadi.trace(casadi.mtimes(wanted.T, rotation))) / 2.0

    none, most = np.array([-np.inf]), np.array([1.0 - np.cos(tilt)])
    return PathConstraint(TILT + name, tilted, none, most, ("-",), ("1 - cos",), constants=table, segments=segments)
