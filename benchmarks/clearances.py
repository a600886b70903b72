"""What a proof of clearances costs beside ``coal`` at 10 000 instants, of the same bodies, pairs and motion.

Run with ``python -m benchmarks.clearances`` (``make bench-clearance``). A UR5 goes over a ball, past a crate and above
a floor; its collision meshes are in capsules, or in capsules and cylinders. The proof holds for all instants and all
points of the bodies; ``coal`` looks at the bodies at its instants. Processor seconds, of one run.
"""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin
from rich.console import Console
from rich.table import Table

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.proof.audit import audit
from ocp_traj.robot.bodies import box, half_space, sphere
from ocp_traj.robot.body_pairs import obstacle_pairs, self_pairs
from ocp_traj.robot.descriptions import description_urdf
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf_bodies import urdf_bodies

INSTANTS = 10_000
CLEARANCE = 0.01  # [m] of what is around
VIA = np.array([
    [-0.9, -1.2, 1.5, -1.8, -1.5, 0.0],
    [0.0, -1.9, 1.3, -1.0, -1.5, 0.0],
    [0.9, -1.0, 1.3, -1.8, -1.5, 0.0],
])  # fmt: skip


def motion(robot: Robot) -> Motion:
    """From rest to rest over the ball, in quintic pieces of 0.7 s."""
    return Motion(
        PiecewiseBezier(np.full(2, 0.7), tuple(np.repeat(VIA[k : k + 2], 3, axis=0) for k in (0, 1))), robot.joints
    )


def constraints(robot: Robot, cylinders: bool) -> tuple[ClearanceConstraint, ...]:
    """Of links with what is around them, and with links that are no neighbours."""
    links = urdf_bodies(robot.model, description_urdf("ur5"), cylinders=cylinders)
    c, s = np.cos(0.3), np.sin(0.3)
    around = (
        sphere("ball", 0, [0.57, 0.02, 0.35], 0.1),
        box("crate", 0, [0.45, -0.55, 0.05], [0.2, 0.2, 0.1], [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
        half_space("floor", [0.0, 0.0, 1.0], -0.1),
    )
    bodies = (*links, *around)
    outer = obstacle_pairs(bodies, range(len(links), len(bodies)))
    inner = self_pairs(robot, bodies, range(len(links))).pairs
    return (
        ClearanceConstraint("clearance", robot, bodies, outer, CLEARANCE),
        ClearanceConstraint("self-clearance", robot, bodies, inner, 0.0),
    )


def by_coal(robot: Robot, limits: tuple[ClearanceConstraint, ...], postures: Array) -> tuple[float, list[float]]:
    """Processor seconds, and the least distance of each constraint's pairs at postures ``(N, n)`` [m]."""
    geometry = pin.GeometryModel()
    for body in limits[0].bodies:
        shape, placement = body.coal()
        geometry.addGeometryObject(pin.GeometryObject(body.name, body.joint, placement, shape))
    for limit in limits:
        for i, j in limit.pairs:
            geometry.addCollisionPair(pin.CollisionPair(i, j))
    data, distances = robot.model.createData(), geometry.createData()
    least = np.full(len(geometry.collisionPairs), np.inf)
    begun = time.process_time()
    for q in postures:
        pin.computeDistances(robot.model, data, geometry, distances, q)
        least = np.minimum(least, [result.min_distance for result in distances.distanceResults])
    took, first = time.process_time() - begun, len(limits[0].pairs)
    return took, [float(least[:first].min()), float(least[first:].min())]


def main() -> None:
    """Prints a line a constraint."""
    robot = Robot.from_description("ur5")
    moved = motion(robot)
    table = Table(
        "bodies", "pairs", "proof s", "coal s", "ratio", "limit", "proved mm", "coal mm", "attained mm", "verdict"
    )
    for cylinders in (False, True):
        limits = constraints(robot, cylinders)
        requirements = Requirements(robot.joints, robot.units, (), clearance_constraints=limits)
        audit(moved, requirements)  # builds the tape
        begun = time.process_time()
        found = audit(moved, requirements)
        took = time.process_time() - begun
        coal, scanned = by_coal(robot, limits, moved.curve(np.linspace(0.0, moved.duration, INSTANTS)))
        for limit, seen in zip(limits, scanned, strict=True):
            rows = [row for row in found.rows if row.limit == limit.id]
            row = min(rows, key=lambda row: row.attained)
            numbers = (f"{took:.3f}", f"{coal:.3f}", f"{took / coal:.3f}") if limit is limits[0] else ("", "", "")
            table.add_row(
                str(len(limit.bodies)), str(len(limit.pairs)), *numbers, f"{limit.id}, {row.label}",
                f"{1e3 * min(row.proved_bound for row in rows):.4f}", f"{1e3 * seen:.4f}", f"{1e3 * row.attained:.4f}",
                max(rows, key=lambda row: row.verdict == "violated").verdict,
            )  # fmt: skip
    Console(width=160).print(table)


if __name__ == "__main__":
    main()
