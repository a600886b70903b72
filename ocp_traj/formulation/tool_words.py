"""What is said of tool paths to people: what was understood of them, and how closely a motion keeps to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ocp_traj.curves.motion import Motion
from ocp_traj.display import count
from ocp_traj.formulation.requirements import PathConstraint, state_function
from ocp_traj.formulation.route import Route
from ocp_traj.formulation.tool_limits import BLEND, CONSTANT, POSITION, SPEED, TILT
from ocp_traj.paths.cartesian import CONSTANTS

SAMPLES = 200  # of a segment: our choice


def tool_notes(route: Route, variables: int, pieces: int) -> tuple[str, ...]:
    """A line on each tool path, and one on the curve."""
    found = []
    for number, (_, move) in enumerate(route.tool_moves, 1):
        own = [section for section in move.path.sections if section.ball is None]
        arcs = sum(section.curvature > 0.0 for section in own)
        kinds = [count(len(own) - arcs, "line"), count(arcs, "arc")]
        shape = " and ".join(kind for kind in kinds if not kind.startswith("0 "))
        x, y, z = (round(float(c), 6) + 0.0 for c in move.path.at(move.path.length).translation)
        turn = ", free to turn about its axis" if move.free_turn else ""
        words = (
            f"tool path {number}: {shape}, {move.path.length:.6g} m to ({x:.6g}, {y:.6g}, {z:.6g}); position within "
            f"{1e3 * move.position:.6g} mm, tilt within {move.tilt:.6g} rad{turn}"
        )
        if balls := [section.ball for section in move.path.sections if section.ball is not None]:
            words += f"; {count(len(balls), 'corner')} rounded within {1e3 * min(b.radius for b in balls):.6g} mm"
            if min(b.radius for b in balls) != max(b.radius for b in balls):
                words += f" to {1e3 * max(b.radius for b in balls):.6g} mm"
        if move.speed is not None:
            value, band, run_up = move.speed
            words += f"; {value:.6g} m/s within {100.0 * band:g} % but for {run_up:.6g} m at either end"
        branch = move.branch or "as given"
        words += (
            f"; posture at its beginning: {branch}; at its end: ({', '.join(f'{q:.4g}' for q in move.postures[-1])})"
        )
        found.append(words)
    if found:
        found.append(f"curve: {count(pieces, 'piece')} between via points, {count(variables, 'variable')}")
    return tuple(found)


def tool_figures(
    dof: int, limits: Sequence[PathConstraint]
) -> Callable[[Motion], Sequence[tuple[str, float, str]]] | None:
    """Distance, tilt and speed of the tool at samples of a motion, in plain units; None without such limits."""
    own = [
        limit
        for limit in limits
        if limit.id.startswith((POSITION, TILT, SPEED, BLEND)) and limit.id[: len(CONSTANT)] != CONSTANT
    ]
    if not own:
        return None

    def figures(motion: Motion) -> list[tuple[str, float, str]]:
        found = []
        u = np.linspace(0.0, 1.0, SAMPLES)
        for limit in own:
            table = limit.constants
            function = state_function("value", limit.expression, dof, 0, 0 if table is None else CONSTANTS)
            most = 0.0
            for k in filter(limit.holds_on, range(motion.curve.segments)):
                states = np.zeros((5 * dof, len(u)))
                for order in range(2):
                    states[order * dof : (order + 1) * dof] = np.reshape(motion.curve.at(k, u, order), (-1, dof)).T
                constants = np.zeros((0, 1)) if table is None else table[k]
                most = max(
                    most, float(np.array(function.map(len(u))(states, u[None], np.zeros((0, 1)), constants)).max())
                )
            found.append(_plain(limit.id, most))
        return found

    return figures


def _plain(limit: str, value: float) -> tuple[str, float, str]:
    """The largest value of a limit in plain units."""
    number = limit.rpartition("-")[2]
    which = f" {number}" if number.isdigit() else ""
    if limit.startswith(POSITION):
        return f"tool off its path{which}, largest", max(value, 0.0) ** 0.5, "mm"
    if limit == BLEND:
        return "tool off a corner, largest, of its blend", max(value, 0.0) ** 0.5, "-"
    if limit.startswith(TILT):
        return f"tilt of the tool{which}, largest", float(np.arccos(1.0 - max(value, 0.0))), "rad"
    return "speed of the tool, largest", max(value, 0.0) ** 0.5, "m/s"
