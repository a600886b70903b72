"""Tool paths through obstacles, refused for certain: where what is fixed to the tool would overlap whatever joints do.

Along a section the tool passes every place, off it by no more than the tolerance of position and turned by no more than
that of tilt: no point of a body fixed to it, at most a reach R from the tool frame's origin, is farther than
``position + 2 sin(tilt / 2) R`` from where it would be on the path. Bodies that overlap by more cannot be apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp_traj.errors import InputError
from ocp_traj.formulation.task_collision import OBSTACLES, Clear
from ocp_traj.formulation.tool_moves import ToolMove
from ocp_traj.robot.dynamics import joint_index
from ocp_traj.robot.pair_distances import PairDistances

PLACES = 65  # of a section: our choice


def require_tool_clear(clear: Clear, moves: Sequence[tuple[int, ToolMove]]) -> None:
    """Refuses tool paths on which bodies of the tool cannot keep their clearance: where, which, and by how much.

    Args:
        clear: a task's limits on distances.
        moves: along tool paths, each with the number of its first leg; those with a free turn are not looked at.
    """
    for constraint in clear.constraints:
        robot = constraint.robot
        tool = joint_index(robot.model, robot.tool_joint)
        pairs = [(constraint.bodies[i], constraint.bodies[j]) for i, j in constraint.pairs]
        pairs = [pair for pair in pairs if sorted(body.joint for body in pair) == [0, tool]]
        if constraint.id != OBSTACLES or not pairs:
            continue
        distances = PairDistances(robot, pairs)
        moving = [a if a.joint else b for a, b in distances.pairs]
        reach = np.array([
            np.linalg.norm(body.centre - robot.tool.translation) + np.linalg.norm(body.half) + body.radius
            for body in moving
        ])  # fmt: skip
        for number, (_, move) in enumerate(moves, 1):
            if move.free_turn:
                continue
            room = move.position + 2.0 * np.sin(move.tilt / 2.0) * reach
            worst = (0.0, 0, 0.0)  # what is missing, of which pair, where
            for section, begin in zip(move.path.sections, move.path.ends, strict=False):
                margin = 2.0 * move.position
                if section.ball is not None or section.length <= 2.0 * margin:
                    continue
                for s in np.linspace(margin, section.length - margin, PLACES):
                    at = section.at(float(s)) * robot.tool.inverse()
                    rows = np.arange(len(pairs))
                    turn = np.broadcast_to(np.stack([np.eye(3), at.rotation]), (len(rows), 2, 3, 3))
                    place = np.broadcast_to(np.stack([np.zeros(3), at.translation]), (len(rows), 2, 3))
                    found = distances.nearest(np.zeros((len(rows), 0)), rows, (turn, place)).distance - distances.radius
                    missing = constraint.clearance - room - found
                    if missing.max() > worst[0]:
                        row = int(np.argmax(missing))
                        worst = float(missing[row]), row, float(begin + s)
            if worst[0] > 0.0:
                missing_, row, s = worst
                links = " and ".join(body.link for body in distances.pairs[row])
                x, y, z = (round(float(c), 6) + 0.0 for c in move.path.at(s).translation)
                raise InputError(
                    f"{clear.name}: at {s:.4g} m of {move.path.length:.4g} m along tool path {number}, at ({x:.4g}, "
                    f"{y:.4g}, {z:.4g}) m: {links} come nearer than [collision] clearance allows, by "
                    f"{1e3 * missing_:.3g} mm more than the tolerances of the path make room for: move one of them"
                )
