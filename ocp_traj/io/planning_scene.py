"""MoveIt planning scenes: the bodies in the world and those that the robot holds, as shapes with poses.

A ``moveit_msgs/PlanningScene`` message in YAML, vectors as lists or as tables. Boxes, cylinders and spheres are read;
what else a scene may hold is refused by name, since a body left out would make a proof of what is left worthless.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from ocp_traj.io.robot_state import RobotState, robot_state
from ocp_traj.io.ros_values import Node, read_message

WHAT = "planning scene"
NUMBERS = {1: "box", 2: "sphere", 3: "cylinder", 4: "cone", 5: "prism"}  # shape_msgs/SolidPrimitive
DIMENSIONS = {"box": ("x, y, z", 3), "sphere": ("radius", 1), "cylinder": ("height, radius", 2)}
SCENE = (
    "name", "robot_state", "robot_model_name", "fixed_frame_transforms", "allowed_collision_matrix", "link_padding",
    "link_scale", "object_colors", "world", "is_diff",
)  # fmt: skip
OBJECT = (
    "header", "pose", "id", "type", "primitives", "primitive_poses", "meshes", "mesh_poses", "planes", "plane_poses",
    "subframe_names", "subframe_poses", "operation",
)  # fmt: skip
SAME = 1e-9  # how far a transform may be from the identity [m], and in its rotation's entries: our choice


@dataclass(frozen=True, eq=False)
class Shape:
    """A body.

    Attributes:
        name: unique in its scene.
        kind: "box", "sphere" or "cylinder".
        dimensions: x, y, z; radius; height and radius [m].
        pose: of its centre, in the world, or in the link that holds it.
    """

    name: str
    kind: str
    dimensions: tuple[float, ...]
    pose: pin.SE3


@dataclass(frozen=True, eq=False)
class Held:
    """A body that a link holds: ``link``, ``shape`` in the link's frame, and links that it may touch."""

    link: str
    shape: Shape
    touches: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Scene:
    """What a planning scene holds.

    Attributes:
        robot: the robot's name, empty where there is none.
        bodies: in the world.
        held: by the robot.
        state: of the robot.
        between_links: whether it says which links may touch each other.
    """

    robot: str
    bodies: tuple[Shape, ...]
    held: tuple[Held, ...]
    state: RobotState
    between_links: bool


def read_scene(path: str | Path) -> Scene:
    """The scene of a file.

    Raises:
        FileFormatError: one line with file and place.
    """
    root = read_message(path, WHAT)
    root.known(SCENE)
    world = root.at("world")
    if world.value is None:
        raise world.wrong("a table with collision_objects, empty where there are none")
    world.known(("collision_objects", "octomap"))
    _without_octomap(world.at("octomap"))
    for item in root.at("fixed_frame_transforms").items():
        item.known(("header", "child_frame_id", "transform"))
        if not _is_identity(item.at("transform").transform()):
            raise item.at("transform").refused(
                "moves a frame against the world; not supported: give bodies in the robot's first frame"
            )
    for name in ("link_padding", "link_scale"):
        for item in root.at(name).items():
            key = name.removeprefix("link_")
            if item.at(key).number() != (0.0 if key == "padding" else 1.0):
                raise item.refused("changes the size of a link; not supported: change the URDF, or ask for a clearance")
    state = robot_state(root.at("robot_state"))
    names: dict[str, str] = {}
    bodies = [shape for item in world.at("collision_objects").items() for shape in _shapes(item, names)]
    held = [one for node in (state.attached or Node(None, root.file, WHAT)).items() for one in held_bodies(node, names)]
    matrix = root.at("allowed_collision_matrix")
    _check_matrix(matrix, {name for name in names})
    return Scene(
        root.at("robot_model_name").text() if root.at("robot_model_name").value else "", tuple(bodies), tuple(held),
        state, bool(matrix.at("entry_names").items()),
    )  # fmt: skip


def held_bodies(node: Node, names: dict[str, str]) -> list[Held]:
    """The shapes of an attached object; ``names`` of the bodies so far, by place."""
    node.known(("link_name", "object", "touch_links", "detach_posture", "weight"))
    link = node.at("link_name").text()
    touches = tuple(item.text() for item in node.at("touch_links").items())
    return [Held(link, shape, touches) for shape in _shapes(node.at("object"), names, link)]


def _shapes(node: Node, names: dict[str, str], link: str = "") -> list[Shape]:
    """The shapes of a collision object; ``link`` in whose frame they have to be, the world where empty."""
    node.known(OBJECT)
    name = node.at("id").text()
    if name in names:
        raise node.at("id").refused(f"is {name!r}, as is {names[name]}; give each body its own name")
    names[name] = node.at("id").place
    for other in ("meshes", "planes"):
        if node.at(other).items():
            raise node.at(other).refused(
                f"are a part of {name!r}; {other} are not supported: give boxes, cylinders or spheres around it"
            )
    if (operation := node.at("operation")).value not in (None, 0, "ADD"):
        raise operation.refused(f"of {name!r} is {operation.value!r}; a body can only be added, which is 0")
    frame = node.at("header", "frame_id")
    allowed = (link,) if link else ("", "world")
    if frame.value is not None and frame.value not in allowed:
        where = f"the link that holds it, {link!r}" if link else "the world, which is empty or 'world'"
        raise frame.wrong(f"{where}, in whose frame the poses of {name!r} are")
    primitives, poses = node.at("primitives").items(), node.at("primitive_poses").items()
    if not primitives:
        raise node.at("primitives").wrong(f"a list of one or more boxes, cylinders or spheres that make up {name!r}")
    if len(poses) != len(primitives):
        raise node.at("primitive_poses").refused(
            f"of {name!r} has {len(poses)} poses for {len(primitives)} primitives; give one each"
        )
    base = node.at("pose").pose()
    several = len(primitives) > 1
    return [
        _shape(primitive, f"{name} {i + 1}" if several else name, base * pose.pose())
        for i, (primitive, pose) in enumerate(zip(primitives, poses, strict=True))
    ]


def _shape(node: Node, name: str, pose: pin.SE3) -> Shape:
    node.known(("type", "dimensions", "polygon"))
    value = node.at("type").value
    kind = NUMBERS.get(value) if isinstance(value, int) and not isinstance(value, bool) else str(value).lower()
    if kind not in DIMENSIONS:
        raise node.at("type").wrong(f"box, cylinder or sphere for {name!r} (1, 3 or 2)")
    words, count = DIMENSIONS[kind]
    given = node.at("dimensions")
    if not isinstance(given.value, list) or len(given.value) != count:
        raise given.wrong(f"{words} [m] of the {kind} {name!r}")
    sizes = [item.number("a length above zero [m]") for item in given.items()]
    for item, size in zip(given.items(), sizes, strict=True):
        if not size > 0.0:
            raise item.wrong("a length above zero [m]")
    return Shape(name, kind, tuple(sizes), pose)


def _without_octomap(node: Node) -> None:
    """Refuses an octomap that says anything; an empty one is part of many messages."""
    data = node.at("octomap", "data")
    if data.value not in (None, [], "") or (data.value is None and node.value not in (None, {}) and _leaves(node)):
        raise node.refused("is an octomap, which is not supported: give boxes, cylinders or spheres in its place")


def _leaves(node: Node) -> bool:
    """Whether an octomap without data is something else than an empty message."""
    return any(key not in ("header", "origin", "octomap") for key in node.table())


def _is_identity(pose: pin.SE3) -> bool:
    return bool(np.abs(pose.homogeneous - np.eye(4)).max() <= SAME)


def _check_matrix(node: Node, bodies: set[str]) -> None:
    """Refuses a matrix that lets a link touch a body; which links may touch each other is the SRDF's to say."""
    node.known(("entry_names", "entry_values", "default_entry_names", "default_entry_values"))
    names, rows = [item.text() for item in node.at("entry_names").items()], node.at("entry_values").items()
    if len(rows) != len(names):
        raise node.at("entry_values").refused(f"has {len(rows)} rows for {len(names)} entry_names; give one each")
    for name, row in zip(names, rows, strict=True):
        row = row.at("enabled") if isinstance(row.value, dict) else row
        entries = row.items()
        if len(entries) != len(names):
            raise row.refused(f"has {len(entries)} values for {len(names)} entry_names; give one each")
        for other, entry in zip(names, entries, strict=True):
            if not isinstance(entry.value, bool | int):
                raise entry.wrong("true or false")
            if entry.value and other != name and (name in bodies) != (other in bodies):
                _refuse_touching(entry, name, other)
    defaults = node.at("default_entry_names").items()
    for item, value in zip(defaults, node.at("default_entry_values").items(), strict=False):
        if value.value and item.text() in bodies:
            _refuse_touching(value, item.text(), "any link")


def _refuse_touching(node: Node, one: str, other: str) -> None:
    raise node.refused(f"lets {one!r} touch {other!r}; not supported: leave the body out, or let nothing touch it")
