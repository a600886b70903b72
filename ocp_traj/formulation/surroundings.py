"""What is around a robot and on its links, for pictures; nothing is computed from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.route import Route
from ocp_traj.robot.bodies import Body

SAMPLES = 161  # of a path: our choice


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Bodies and paths beside those that a problem's limits on clearance hold.

    Attributes:
        bodies: of links and of what stands still.
        paths: lines in the world ``(N, 3)`` [m] by name, such as a seam.
    """

    bodies: tuple[Body, ...] = ()
    paths: Mapping[str, Array] = field(default_factory=dict)


def tool_paths(route: Route) -> Surroundings:
    """The tool paths of a task."""
    return Surroundings(
        paths={
            f"tool path {number}": np.array(
                [move.path.at(s).translation for s in np.linspace(0.0, move.path.length, SAMPLES)]
            )
            for number, (_, move) in enumerate(route.tool_moves, 1)
        }
    )
