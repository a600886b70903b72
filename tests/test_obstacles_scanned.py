"""The least clearance of a motion past obstacles, beside dense scans of its bodies and of the URDF's own meshes."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import ocp_traj as ot
from ocp_traj.proof.audit import audit_all
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.robot.descriptions import description_urdf, package_folders
from tests.independent.bodies import Pair, curve_at

EXAMPLE = Path(__file__).parents[1] / "examples" / "tasks" / "ur5-obstacles.toml"
INSTANTS = 200
WIDTH = 1e-4  # [m] of what the least clearance is enclosed to


def _scanned(found: Any, distances: Any) -> float:
    """The least of distances (q -> several) along a motion: at even instants, and ever finer about the least."""
    durations, points = np.asarray(found.curve.durations), [np.asarray(rows) for rows in found.curve.control_points]
    times, least = np.linspace(0.0, found.duration, INSTANTS), np.inf
    for _ in range(4):
        values = [min(distances(curve_at(durations, points, t))) for t in times]
        best = int(np.argmin(values))
        least = min(least, values[best])
        low, high = times[max(best - 1, 0)], times[min(best + 1, len(times) - 1)]
        times = np.linspace(low, high, 40)
    return least


def _corners(shape: Any) -> np.ndarray:
    """Of a mesh or, as of the place for a tool, a box."""
    if isinstance(shape, coal.Box):
        return np.array(list(product(*([-half, half] for half in shape.halfSide))))
    return np.asarray(shape.vertices())


def mesh_distances(model: pin.Model, obstacles: list[Any]) -> Any:
    """q -> distances [m] of a UR5's collision meshes, those that move, from balls, boxes and floors."""
    urdf = description_urdf("ur5")
    whole = pin.buildModelFromUrdf(str(urdf))  # of the same joints
    folders = [str(folder) for folder in package_folders(urdf, "collision")]
    geometry = pin.buildGeomFromUrdf(whole, str(urdf), pin.GeometryType.COLLISION, package_dirs=folders)
    assert list(whole.names) == list(model.names)
    pieces = [piece for piece in geometry.geometryObjects if piece.parentJoint > 0]
    corners = [_corners(piece.geometry) for piece in pieces]
    data, asked = model.createData(), coal.DistanceRequest()

    def distances(q: np.ndarray) -> list[float]:
        pin.forwardKinematics(model, data, q)
        found = []
        for piece, vertices in zip(pieces, corners, strict=True):
            at = data.oMi[piece.parentJoint] * piece.placement
            for body in obstacles:
                if body.kind == "half-space":
                    normal = body.axes[:, 2]
                    found.append(
                        float((vertices @ (at.rotation.T @ normal)).min() + normal @ (at.translation - body.centre))
                    )
                    continue
                shape = coal.Sphere(body.radius) if body.kind == "sphere" else coal.Box(*(2.0 * body.half))
                where = coal.Transform3s(body.axes, body.centre)
                result = coal.DistanceResult()
                found.append(
                    coal.distance(
                        piece.geometry, coal.Transform3s(at.rotation, at.translation), shape, where, asked, result
                    )
                )
        return found

    return distances


@pytest.mark.slow
def test_the_least_clearance_is_what_a_scan_of_the_bodies_finds_and_the_meshes_have_more() -> None:
    via = [[0.6, -1.0, 1.3, -1.8, -1.5, 0.0], [2.0, -0.9, 1.7, -1.8, -1.5, 0.0]]  # a start away from the ball
    changes = {"curve.kind": "quintic", "curve.pieces": 4, "move.0.via": via}
    problem = ot.problems.load("task", file=str(EXAMPLE), **changes)
    motion = trajectory_of(problem, problem.guess(np.random.default_rng(0)))
    rows = [row for row in audit_all([motion], problem.requirements)[0].rows if row.limit == "obstacles"]
    assert len(rows) > 20 and all(row.verdict == "proved" for row in rows)
    low, high = min(row.proved_bound for row in rows), min(row.attained for row in rows)
    assert 0.01 - 1e-9 <= low <= high <= low + WIDTH
    (limit,) = (c for c in problem.requirements.clearance_constraints if c.id == "obstacles")
    pairs = [Pair(limit.robot.model, *(limit.bodies[i] for i in pair)) for pair in limit.pairs]
    scanned = _scanned(motion, lambda q: [pair.distance(q) for pair in pairs])
    assert low - 1e-9 <= scanned <= high + 1e-6
    obstacles = list(
        {b.name: b for i, j in limit.pairs for b in (limit.bodies[i], limit.bodies[j]) if not b.joint}.values()
    )
    assert sorted(body.kind for body in obstacles) == ["box", "half-space", "sphere"]
    meshes = _scanned(motion, mesh_distances(limit.robot.model, obstacles))
    assert meshes >= scanned - 1e-9
