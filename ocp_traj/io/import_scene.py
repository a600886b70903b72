"""A task of a MoveIt planning scene and a motion request: what they hold, and nothing that they do not.

Neither holds limits on acceleration and jerk: they are given with the other changes, or left to be filled in, marked so
that the task is refused until they are.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.errors import FileFormatError, InputError, nearest, quoted
from ocp_traj.formulation.task import FORMAT
from ocp_traj.formulation.task_file import put_all, task_of
from ocp_traj.io.motion_request import Request, read_request
from ocp_traj.io.planning_scene import Held, Scene, Shape, held_bodies, read_scene
from ocp_traj.io.toml_text import toml_lines, toml_value
from ocp_traj.robot.descriptions import description_urdf
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf import urdf_root, urdf_text

TO_FILL = "TO FILL IN"  # in place of a limit that is not known
ASKED = ("acceleration", "jerk")
SHORT = 1e-12  # [m], entries of placements below it are what rounding has left of zero


@dataclass(frozen=True)
class Imported:
    """A task file's text, and what there is to be said of it.

    Attributes:
        text: TOML.
        bodies: in the world.
        held: by the robot.
        locked: joints that stay where they are.
        to_fill: places in it that have to be filled in before it can be solved.
        remarks: what of the two files has no part in it.
    """

    text: str
    bodies: int
    held: int
    locked: tuple[str, ...]
    to_fill: tuple[str, ...]
    remarks: tuple[str, ...]


def import_scene(
    scene_file: str | Path, request_file: str | Path, target: Path, *, urdf: Path | None = None,
    srdf: Path | None = None, changes: Mapping[str, str] | None = None,
) -> Imported:  # fmt: skip
    """The task that a scene and a request make.

    Args:
        scene_file: ``moveit_msgs/PlanningScene`` in YAML.
        request_file: ``moveit_msgs/MotionPlanRequest`` in YAML.
        target: where the text will be written; paths in it count from that folder.
        urdf: of the robot; None where the changes name one of the package example-robot-data.
        srdf: whose pairs of links may touch each other.
        changes: values by dotted place, as of ``--set``.

    Raises:
        InputError: one line; of a file's content with the file and the place in it.
    """
    scene, request = read_scene(scene_file), read_request(request_file)
    given = dict(changes or {})
    source = urdf if urdf is not None else _described(given, scene, str(scene_file))
    moving = _moving(source)
    locked = _locked(request, moving, str(request_file))
    robot = _robot(source, {**locked, **_given_locks(given)})
    start, goal = _ends(request, robot, locked, str(request_file))
    held = [*scene.held]
    if request.start.attached is not None:
        names: dict[str, str] = {}
        held = [one for node in request.start.attached.items() for one in held_bodies(node, names)]
    folder = target.resolve().parent
    table: dict[str, Any] = {"format": FORMAT, "name": target.stem or "imported"}
    table["robot"] = {} if urdf is None else {"urdf": os.path.relpath(urdf.resolve(), folder)}
    if locked:
        table["robot"]["locked"] = locked
    table["limits"] = dict.fromkeys(ASKED, TO_FILL)
    table["move"] = [{"start": start, "goal": goal}]
    table["collision"] = _collision(scene, held, robot, folder, srdf)
    _scaled(table, request, given, str(request_file))
    put_all(table, given)
    to_fill = tuple(f"limits.{name}" for name in ASKED if table.get("limits", {}).get(name) == TO_FILL)
    text = _text(table, [str(scene_file), str(request_file)], to_fill)
    filled = tomllib.loads(text)
    for place in to_fill:
        filled["limits"][place.partition(".")[2]] = "none"
    task_of(filled, "the imported task", text)  # what was set may not fit
    remarks = []
    if scene.between_links:
        remarks.append(
            "the scene's allowed_collision_matrix is not looked at: "
            + ("the SRDF says which links may touch each other" if srdf else "an SRDF may say which links may touch")
        )
    if request.tolerant:
        remarks.append("the goal's tolerances are not used: the goal is met exactly")
    return Imported(text, len(scene.bodies), len(held), tuple(locked), to_fill, tuple(remarks))


def _described(given: Mapping[str, str], scene: Scene, file: str) -> Path:
    name = given.get("robot.description")
    if name is None:
        named = f", robot_model_name {quoted(scene.robot)}" if scene.robot else ""
        raise InputError(
            f"{file}: which robot it is of{named}, only its description says; give --urdf FILE, or --set "
            "robot.description=NAME of one of the package example-robot-data"
        )
    return description_urdf(name.strip("'\""))


def _moving(urdf: Path) -> dict[str, bool]:
    """The joints of a URDF that are not fixed, and whether each mimics another."""
    root = urdf_root(*urdf_text(urdf))
    return {
        str(j.get("name")): j.find("mimic") is not None
        for j in root.iter("joint") if j.get("type") not in (None, "fixed")
    }  # fmt: skip


def _locked(request: Request, moving: Mapping[str, bool], file: str) -> dict[str, float]:
    """Where the joints stay that move, but not in this motion."""
    for name in request.goal:
        if name not in moving:
            raise FileFormatError(
                f"{file}: goal_constraints[0]: the robot has no joint {quoted(name)} that moves"
                f"{nearest(name, moving)}; it has {quoted(sorted(moving), 300)}"
            )
    found = {}
    for name in moving:
        if name not in request.goal:
            if name not in request.start.joints:
                raise FileFormatError(
                    f"{file}: start_state.joint_state: says nothing of the joint {quoted(name)}, which has no goal and "
                    "stays where it is; give its position"
                )
            found[name] = request.start.joints[name]
    return found


def _given_locks(given: Mapping[str, str]) -> dict[str, float]:
    """Joints locked by changes: where, is checked with the task."""
    found = {}
    for place, value in given.items():
        if place.startswith("robot.locked."):
            try:
                found[place.removeprefix("robot.locked.")] = float(value)
            except ValueError as error:
                raise InputError(f"--set {place} is {quoted(value)}; give a number") from error
    return found


def _robot(urdf: Path, locked: Mapping[str, float]) -> Robot:
    return Robot.from_urdf(urdf, file_limits=False, locked=locked)


def _ends(request: Request, robot: Robot, locked: Mapping[str, float], file: str) -> tuple[list[float], list[float]]:
    for name in robot.joints:
        if name not in request.start.joints:
            raise FileFormatError(
                f"{file}: start_state.joint_state: says nothing of the joint {quoted(name)}; give its position"
            )
    start, goal = ([table[name] for name in robot.joints] for table in (request.start.joints, request.goal))
    if start == goal:
        raise FileFormatError(
            f"{file}: goal_constraints[0]: the goal is where the motion starts; there is none to find"
        )
    return start, goal


def _collision(scene: Scene, held: list[Held], robot: Robot, folder: Path, srdf: Path | None) -> dict[str, Any]:
    table: dict[str, Any] = {"links": "urdf"}
    if srdf is not None:
        if not srdf.is_file():
            raise FileFormatError(f"cannot read the SRDF file {srdf}: there is none; leave --srdf out, or give one")
        table["srdf"] = os.path.relpath(srdf.resolve(), folder)
    if held:
        table["link"] = [_held(one, robot) for one in held]
    if scene.bodies:
        table["obstacle"] = [{"name": shape.name, shape.kind: _shape(shape)} for shape in scene.bodies]
    return table


def _held(one: Held, robot: Robot) -> dict[str, Any]:
    """A body of the robot; links that it may touch have to be fixed to the one that holds it."""
    frames = {f.name: f.parentJoint for f in robot.model.frames if f.type == pin.FrameType.BODY}
    for link in (one.link, *one.touches):
        if link not in frames:
            raise InputError(
                f"{one.shape.name!r} is held by, or may touch, {quoted(link)}; the robot has no such link"
                f"{nearest(link, frames)}"
            )
        if frames[link] != frames[one.link]:
            raise InputError(
                f"{one.shape.name!r} may touch {quoted(link)}, which moves against {quoted(one.link)} that holds it; "
                "not supported: leave that link out of touch_links"
            )
    return {"name": one.shape.name, "frame": one.link, one.shape.kind: _shape(one.shape)}


def _shape(shape: Shape) -> dict[str, Any]:
    centre = _clean(shape.pose.translation)
    if shape.kind == "sphere":
        return {"centre": centre, "radius": shape.dimensions[0]}
    if shape.kind == "box":
        table: dict[str, Any] = {"centre": centre, "size": list(shape.dimensions)}
        turned = pin.Quaternion(shape.pose.rotation)
        if np.abs(shape.pose.rotation - np.eye(3)).max() > SHORT:
            table["quat_wxyz"] = _clean(np.array([turned.w, turned.x, turned.y, turned.z]))
        return table
    height, radius = shape.dimensions
    ends = [_clean(shape.pose.act(np.array([0.0, 0.0, sign * 0.5 * height]))) for sign in (-1.0, 1.0)]
    return {"from": ends[0], "to": ends[1], "radius": radius}


def _clean(values: Any) -> list[float]:
    return [0.0 if abs(x) < SHORT else float(x) for x in values]


def _scaled(table: dict[str, Any], request: Request, given: Mapping[str, str], file: str) -> None:
    """Keeps what a request asks for of speed; of acceleration there is no limit to take a share of."""
    share = request.scaling["velocity"]
    if share != 1.0:
        if "limits.velocity" in given:
            raise InputError(
                f"{file}: max_velocity_scaling_factor is {share:g}, and --set gives limits.velocity; make it 0, and "
                "give the limit as it is to hold"
            )
        table["limits"]["velocity"] = f"{100.0 * share:.12g} %"
    share = request.scaling["acceleration"]
    if share != 1.0:
        raise InputError(
            f"{file}: max_acceleration_scaling_factor is {share:g}, of a limit that no URDF holds; make it 0, and give "
            "--set limits.acceleration=NUMBER as it is to hold"
        )


def _text(table: Mapping[str, Any], sources: list[str], to_fill: tuple[str, ...]) -> str:
    lines = [f"# Made from {' and '.join(Path(source).name for source in sources)} by ocp-traj import."]
    lines += [f"{key} = {toml_value(value)}" for key, value in table.items() if not isinstance(value, dict | list)]
    for name, value in table.items():
        if isinstance(value, dict):
            lines += ["", *toml_lines(value, name)]
        elif isinstance(value, list):
            for item in value:
                lines += ["", f"[[{name}]]", *(f"{key} = {toml_value(v)}" for key, v in item.items())]
    note = '  # a number for all joints, or one a joint, or "none"; neither the scene nor the request holds it'
    marks = [f"{place.partition('.')[2]} = {toml_value(TO_FILL)}" for place in to_fill]
    return "\n".join(line + note if line in marks else line for line in lines) + "\n"
