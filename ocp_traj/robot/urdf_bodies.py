"""The bodies of a URDF's collision geometry: spheres, boxes, cylinders and capsules as they are, meshes in capsules."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import RobotDefinitionError
from ocp_traj.robot.bodies import Body, box, capsule, cylinder, sphere
from ocp_traj.robot.capsule_fit import MOST, STANDOFF, fit_capsules
from ocp_traj.robot.descriptions import package_folders
from ocp_traj.robot.urdf import urdf_root, urdf_text


def urdf_bodies(
    model: pin.Model, source: str | Path, *, standoff: float = STANDOFF, most: int = MOST, cylinders: bool = True
) -> tuple[Body, ...]:
    """Bodies of all links that have collision geometry, on the joints of a robot's model.

    Args:
        model: of the robot of the same file, some of its joints locked or not.
        source: the URDF, a path or the XML itself; meshes are found beside a path, as packages lie in a workspace.
        standoff: see ``fit_capsules`` [m].
        most: capsules a mesh.
        cylinders: whether meshes may be in cylinders as well, which fit the housings of joints more closely.

    Returns:
        In the order of the file; a link's bodies are named ``LINK/0``, ``LINK/1``, ..
    """
    bodies: list[Body] = []
    count: dict[str, int] = {}
    for link, shape, joint, placement in _geometry(model, source):
        for body in _bodies_of(shape, link, joint, placement, standoff, most, cylinders):
            number = count.setdefault(link, 0)
            count[link] += 1
            bodies.append(_named(body, f"{link}/{number}", link))
    return tuple(bodies)


def mesh_triangles(shape: Any) -> Array:
    """Corners of a mesh's triangles ``(N, 3, 3)``, in its own frame [m]."""
    corners = np.asarray(shape.vertices())
    return corners[[[triangle[k] for k in range(3)] for triangle in map(shape.tri_indices, range(shape.num_tris))]]


def _geometry(model: pin.Model, source: str | Path) -> list[tuple[str, Any, int, pin.SE3]]:
    """Link, shape, joint of the model and placement in its frame, of each piece of collision geometry."""
    text, origin = urdf_text(source)
    urdf_root(text, origin)  # refuses what is no URDF
    inline = str(source).lstrip().startswith("<")
    folders = [] if inline else [*package_folders(source, "collision"), Path(source).resolve().parent]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about the keyword by which folders are given
            whole = pin.buildModelFromXML(text)
            geometry = pin.buildGeomFromUrdfString(
                whole, text, pin.GeometryType.COLLISION, [str(folder) for folder in folders]
            )
    except (ValueError, RuntimeError) as error:
        raise RobotDefinitionError(f"collision geometry of {origin} cannot be read: {error}") from error
    found = []
    for piece in geometry.geometryObjects:
        frame = whole.frames[piece.parentFrame]
        if not model.existFrame(frame.name, pin.FrameType.BODY):
            raise RobotDefinitionError(f"{origin} has a link {frame.name!r}, which the robot's model has not")
        own = model.frames[model.getFrameId(frame.name, pin.FrameType.BODY)]
        placement = own.placement * frame.placement.inverse() * piece.placement
        found.append((frame.name, piece.geometry, int(own.parentJoint), placement))
    return found


def _bodies_of(
    shape: Any, link: str, joint: int, at: pin.SE3, standoff: float, most: int, cylinders: bool
) -> list[Body]:
    if isinstance(shape, coal.Sphere):
        return [sphere(link, joint, at.translation, shape.radius)]
    if isinstance(shape, coal.Box):
        return [box(link, joint, at.translation, 2.0 * shape.halfSide, at.rotation)]
    if isinstance(shape, coal.Capsule | coal.Cylinder):
        ends = [at.act(np.array([0.0, 0.0, sign * shape.halfLength])) for sign in (-1.0, 1.0)]
        made = capsule if isinstance(shape, coal.Capsule) else cylinder
        return [made(link, joint, ends[0], ends[1], shape.radius)]
    if not hasattr(shape, "tri_indices"):
        raise RobotDefinitionError(
            f"link {link!r} has collision geometry of type {type(shape).__name__}; allowed are meshes, spheres, boxes, "
            "cylinders and capsules"
        )
    triangles = mesh_triangles(shape) @ at.rotation.T + at.translation
    found, _ = fit_capsules(triangles, standoff, most, cylinders)
    return [(cylinder if c.flat else capsule)(link, joint, c.start, c.end, c.radius) for c in found]


def _named(body: Body, name: str, link: str) -> Body:
    return Body(name, body.kind, body.joint, body.centre, body.axes, body.half, body.radius, link)
