"""``[collision]`` of a task resolved: bodies in numbers, fixed to joints, and the pairs that have to keep apart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation.collision_table import BoxTable, CollisionTable, LinkTable, ObstacleTable, ShapeTable
from ocp_traj.robot.bodies import Body, box, capsule, cylinder, half_space, sphere
from ocp_traj.robot.body_pairs import disabled_collisions, obstacle_pairs, self_pairs
from ocp_traj.robot.dynamics import joint_index
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf_bodies import urdf_bodies

TOOL = "tool"  # the name of the tool frame of a task, whatever frame or place it has


def resolved_collision(
    table: CollisionTable, name: str, robot: Robot, urdf: Path | None, folder: Path, angle: float, length: float
) -> CollisionTable:
    """The table with all bodies in numbers, in SI.

    Args:
        table: as it was written.
        name: of the task, for complaints.
        robot: that moves.
        urdf: the robot's own description; None where it has none.
        folder: from which its path counts.
        angle: a unit of the task's [rad].
        length: a unit of the task's [m].
    """
    if table.bodies is not None:
        return table
    own = [*_links(table, name, robot, urdf), *_given(table, name, robot, angle, length)]
    around = [
        _obstacle(one, f"{name}: [[collision.obstacle]] {i + 1}", i, angle, length)
        for i, one in enumerate(table.obstacle)
    ]
    bodies = [*own, *around]
    names = [body.name for body in bodies]
    for body in bodies:
        if names.count(body.name) > 1:
            raise InputError(
                f"{name}: [collision] has {names.count(body.name)} bodies {quoted(body.name)}; give each a name"
            )
    pairs = obstacle_pairs(bodies, range(len(own), len(bodies)))
    if around and not pairs:
        raise InputError(
            f"{name}: [collision] has obstacles, and no body of the robot that moves; give [[collision.link]]"
        )
    disabled = frozenset() if table.srdf is None else _disabled(folder / table.srdf, name, robot)
    kept = self_pairs(robot, bodies, range(len(own)), disabled) if table.own else None
    own_pairs = () if kept is None else kept.pairs
    if not pairs and not own_pairs:
        raise InputError(f"{name}: [collision] leaves no pair of bodies to keep apart; give obstacles, or leave it out")

    def named(found: Sequence[tuple[int, int]]) -> list[list[str]]:
        return [[bodies[i].name, bodies[j].name] for i, j in found]

    return CollisionTable.model_validate({
        "clearance": table.clearance * length, "self_clearance": table.self_clearance * length,
        "bodies": [body.to_data(robot.model) for body in bodies], "pairs": named(pairs),
        "own_pairs": named(own_pairs), "touching": [] if kept is None else [list(pair) for pair in kept.touching],
    })  # fmt: skip


def _links(table: CollisionTable, name: str, robot: Robot, urdf: Path | None) -> list[Body]:
    """Bodies of the robot's description."""
    links = table.links or ("given" if urdf is None or table.link else "urdf")
    if links == "given":
        if not table.link:
            raise InputError(
                f"{name}: [collision] has no bodies of the robot, and a robot by rows or numbers has none of "
                "its own; give [[collision.link]]"
            )
        return []
    if urdf is None:
        raise InputError(
            f'{name}: [collision] links = "urdf" needs a robot by description or urdf; give [[collision.link]]'
        )
    found = urdf_bodies(robot.model, urdf)
    if not found:
        raise InputError(
            f'{name}: [collision] links = "urdf", and the URDF has no collision geometry; give [[collision.link]]'
        )
    return list(found)


def _given(table: CollisionTable, name: str, robot: Robot, angle: float, length: float) -> list[Body]:
    """Bodies of ``[[collision.link]]``."""
    found = []
    for i, link in enumerate(table.link):
        where = f"{name}: [[collision.link]] {i + 1}"
        joint, placement = _frame(link, where, robot)
        label = link.name or f"{link.frame}/given {i + 1}"
        found.append(_moved(_shape(link, label, where, angle, length), joint, placement, link.name or link.frame))
    return found


def _frame(link: LinkTable, where: str, robot: Robot) -> tuple[int, pin.SE3]:
    """The joint that carries a frame, and where the frame is in the joint's."""
    if link.frame == TOOL:
        return joint_index(robot.model, robot.tool_joint), robot.tool
    # A link and a joint may have one name: the link's comes last, and counts.
    frames = {f.name: f for f in sorted(robot.model.frames, key=lambda f: f.type == pin.FrameType.BODY)}
    if link.frame not in frames:
        known = [TOOL, *frames]
        raise InputError(
            f"{where}: there is no frame {quoted(link.frame)}{nearest(link.frame, known)}; give one of "
            f"{', '.join(known)}"
        )
    frame = frames[link.frame]
    return int(frame.parentJoint), frame.placement


def _obstacle(table: ObstacleTable, where: str, number: int, angle: float, length: float) -> Body:
    label = table.name or f"obstacle {number + 1}"
    if table.plane is not None:
        return half_space(label, table.plane.normal, table.plane.offset * length)
    return _shape(table, label, where, angle, length)


def _shape(table: ShapeTable, label: str, where: str, angle: float, length: float) -> Body:
    """A body at the world's origin, as its table has it."""
    try:
        if table.sphere is not None:
            return sphere(label, 0, length * np.array(table.sphere.centre), length * table.sphere.radius)
        if table.box is not None:
            size, axes = length * np.array(table.box.size), _axes(table.box, angle)
            return box(label, 0, length * np.array(table.box.centre), size, axes)
        ends = table.cylinder or table.capsule or table
        made = capsule if table.cylinder is None else cylinder
        begin, end, radius = (getattr(ends, part) for part in ("begin", "end", "radius"))
        return made(label, 0, length * np.array(begin), length * np.array(end), length * radius)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _axes(table: BoxTable, angle: float) -> Array:
    if table.rpy is not None:
        return np.asarray(pin.rpy.rpyToMatrix(*(angle * np.array(table.rpy))))
    if table.quat_wxyz is not None:
        w, x, y, z = np.array(table.quat_wxyz) / np.linalg.norm(table.quat_wxyz)
        return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())
    return np.eye(3)


def _moved(body: Body, joint: int, placement: pin.SE3, link: str) -> Body:
    """The body in a frame of a joint."""
    centre, axes = placement.act(body.centre), placement.rotation @ body.axes
    return Body(body.name, body.kind, joint, centre, axes, body.half, body.radius, link)


def _disabled(path: Path, name: str, robot: Robot) -> frozenset[frozenset[str]]:
    found = disabled_collisions(path)
    known = {frame.name for frame in robot.model.frames}
    if found and not any(link in known for pair in found for link in pair):
        some = ", ".join(sorted(next(iter(found))))
        raise InputError(f"{name}: [collision] srdf names no link of the robot, but {some}; give that of this robot")
    return found


def bodies_of(table: CollisionTable, robot: Robot) -> tuple[Body, ...]:
    """The bodies of a resolved table."""
    return tuple(Body.from_data(robot.model, data) for data in table.bodies or ())


def pairs_of(names: Sequence[Sequence[str]], bodies: Sequence[Body]) -> tuple[tuple[int, int], ...]:
    """Pairs of indices of pairs of names."""
    index: dict[str, int] = {body.name: i for i, body in enumerate(bodies)}
    for pair in names:
        if len(pair) != 2 or any(name not in index for name in pair):
            raise InputError(f"[collision] has the pair {quoted(list(pair))}, which is not of two of its bodies")
    return tuple((index[a], index[b]) for a, b in names)
