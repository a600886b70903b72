"""A task file to begin with: it solves as it stands, and has every table and key of the format with what it may be.

What a key may be is its field's own description, so that a key that is new stands in it too; here are what it means,
and values to copy.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from textwrap import wrap
from types import UnionType
from typing import Any, Union, get_args, get_origin

from pydantic import BaseModel

from ocp_traj.formulation.task import FORMAT, Task
from ocp_traj.robot.dh import KEYS

WIDTH = 116  # of a line
HEAD = """A task of ocp-traj. As it stands it solves, in some seconds:
    ocp-traj show FILE              what is understood of it
    ocp-traj solve FILE -o t.json   a trajectory, proved to keep every limit at every instant
    ocp-traj export t.json          for the controller, as [export] has it
    ocp-traj pareto FILE -o RUN     a front of the objectives of `front`
Lines that begin with "#" are left out; those with "# key = value" may be used by taking the "#" away. Every key there
is stands in here. Without units it is in rad, m, s, kg, N and N m."""

# What is written down, not left out, and with what value.
GIVEN = {
    "format": f'"{FORMAT}"',
    "name": '"my-arm"',
    "robot.dh": """[
  { name = "pan", d = 0.0892, alpha = 1.5707963, mass = 3.7, com = [0.0, -0.03, 0.0], inertia = [9e-3, 9e-3, 9e-3] },
  { name = "lift", a = -0.425, mass = 8.4, com = [0.212, 0.0, 0.113], inertia = [0.015, 0.134, 0.134] },
  { name = "elbow", a = -0.392, mass = 2.3, com = [0.15, 0.0, 0.027], inertia = [0.004, 0.031, 0.031] },
  { name = "wrist_1", d = 0.109, alpha = 1.5707963, mass = 1.2, com = [0.0, 0.0, 0.02], inertia = [2e-3, 2e-3, 2e-3] },
  { name = "wrist_2", d = 0.095, alpha = -1.5707963, mass = 1.2, com = [0.0, 0.0, 0.02], inertia = [2e-3, 2e-3, 2e-3] },
  { name = "wrist_3", d = 0.0823, mass = 0.2, com = [0.0, 0.0, -0.001], inertia = [1e-4, 1e-4, 1e-4] },
]""",
    "robot.payload": "{ mass = 2.0, com = [0.0, 0.0, 0.05] }",
    "limits.position": "[[-3.1, -3.1, -2.8, -3.1, -3.1, -6.2], [3.1, 3.1, 2.8, 3.1, 3.1, 6.2]]",
    "limits.velocity": "3.0",
    "limits.acceleration": "[6.0, 6.0, 8.0, 12.0, 12.0, 12.0]",
    "limits.jerk": "60.0",
    "limits.effort": "[150.0, 150.0, 150.0, 28.0, 28.0, 28.0]",
    "curve.kind": '"auto"',
    "curve.finest": "4",
    "move.via": """[
  [0.0, -1.2, 1.4, -1.7, -1.5, 0.0],
  [0.6, -0.9, 1.1, -1.6, -1.5, 0.3],
  [1.2, -1.3, 1.5, -1.8, -1.5, 0.0],
]""",
    "objective.minimise": '"time"',
    "objective.front": '{ objectives = ["time", "energy"], points = 10 }',
    "export.format": "",
}
# Values to copy of those that are left out, and of what their own fields have no default for.
TO_COPY = {
    "units": '{ angle = "deg", length = "mm" }',
    "payload": "1.5",
    "collision": '{ clearance = 0.01, link = [{ frame = "tool", sphere = { centre = [0.0, 0.0, 0.1], radius = 0.05 } }]'
    ', obstacle = [{ name = "floor", plane = { normal = [0.0, 0.0, 1.0], offset = -0.4 } }] }',
    "robot.description": '"ur5"',
    "robot.urdf": '"arm.urdf"',
    "robot.base": "{ xyz = [0.0, 0.0, 0.6], rpy = [0.0, 0.0, 1.5708] }",
    "robot.tool_frame": '"tool0"',
    "robot.tool": "{ xyz = [0.0, 0.0, 0.12], quat_wxyz = [1.0, 0.0, 0.0, 0.0] }",
    "robot.locked": "{ finger_joint = 0.02 }",
    "robot.friction": "{ coulomb = 1.5, viscous = [9.0, 9.0, 5.0, 1.0, 1.0, 1.0], velocity_scale = 0.01 }",
    "limits.snap": "1500.0",
    "limits.tool_speed": "0.25",
    "curve.pieces": "2",
    "move.start": "[0.0, -1.2, 1.4, -1.7, -1.5, 0.0]",
    "move.goal": "[1.2, -1.3, 1.5, -1.8, -1.5, 0.0]",
    "move.path": '"points.csv"',
    "move.point": "0",
    "move.line": "{ by = [0.0, 0.3, 0.05] }",
    "move.arc": "{ via = [0.4, 0.3, 0.5], to = [0.3, 0.4, 0.5] }",
    "move.poses": "[[0.4, 0.2, 0.5, 0.0, 1.0, 0.0, 0.0], { xyz = [0.4, 0.3, 0.5], rpy = [3.1416, 0.0, 0.0] }]",
    "move.blend": "0.02",
    "move.speed": "0.1",
    "move.tolerance": "0.01",
    "move.begin": "{ velocity = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], acceleration = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }",
    "move.end": "{ velocity = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0] }",
    "move.payload": "{ mass = 2.0 }",
}
# What keys mean, and in what unit, where their descriptions do not say so.
MEANING = {
    "format": "What this file is.",
    "name": "Of the task, in messages and files.",
    "units": "What joints, points, their limits, dh, tool and com are given in; [rad] and [m] without it.",
    "payload": "In place of the mass of robot.payload.",
    "free_payload": "For `ocp-traj payload`.",
    "collision": "What the robot keeps clear of, whole bodies at every instant; see examples/tasks/ur5-obstacles.toml.",
    "robot": "Which robot: one of description, urdf, dh. These rows are an arm much like a UR5; write your own.",
    "robot.description": 'Of the extra: pip install "ocp-traj[robots]".',
    "robot.dh": f"Of the keys {', '.join(KEYS)}: theta and alpha [rad], d and a [m], kind revolute, prismatic or "
    "fixed, mass [kg], com [m] and inertia about it [kg m2] in the row's frame, armature [kg m2] felt at the joint.",
    "robot.convention": "Whose rows these are: Denavit and Hartenberg's own, or Craig's.",
    "robot.base": "Where the robot stands in the world.",
    "robot.tool_frame": "Where the tool sits; the last link without it.",
    "robot.tool": "The tool centre point in that frame.",
    "robot.locked": "Joints of a description that do not move, such as a gripper's.",
    "robot.payload": "What the tool carries.",
    "robot.friction": "Of the joints: coulomb tanh(v / velocity_scale) + viscous v.",
    "limits": "What no motion may exceed. A description holds position, velocity, effort; the others are needed here.",
    "limits.position": "[rad or m].",
    "limits.velocity": "[rad/s or m/s].",
    "limits.acceleration": "[rad/s2 or m/s2].",
    "limits.jerk": "[rad/s3 or m/s3].",
    "limits.snap": "[rad/s4 or m/s4]; none without it.",
    "limits.effort": "[N m or N], of the motors.",
    "limits.tool_speed": "[m/s], along any direction; none without it.",
    "curve": "Of what the motion is made.",
    "curve.kind": "auto takes as many pieces as pay; cubic is one spline; retime keeps the geometry of a path.",
    "curve.pieces": "Not for auto and cubic.",
    "curve.finest": "For auto: fewer are quicker to solve, more are faster motions.",
    "curve.gain": "For auto.",
    "curve.rest": "2: velocity and acceleration.",
    "move": "One table a move; one way to go in each: via, goal (with start in the first move), path, line, arc, "
    "poses. Tables that follow begin where the one before ends.",
    "move.via": "[rad or m].",
    "move.line": "A straight tool path, with tolerance = { position = 1e-3, tilt = 0.035 }; the first begins at start.",
    "move.arc": "A tool path, round. The tool keeps its rotation, unless one is given at the end, or with_arc.",
    "move.poses": "A tool path, straight from pose to pose; without start the first move begins at the first.",
    "move.free_turn": "Of tool paths.",
    "move.blend": "Of tool paths: of corners between poses, and to the next move along one.",
    "move.speed": "Of tool paths [m/s]: constant, but at either end; limits.tool_speed is a bound.",
    "move.tolerance": "[rad or m].",
    "move.dwell": "[s].",
    "move.begin": "[rad/s, rad/s2], in place of rest.",
    "move.end": "[rad/s, rad/s2], in place of rest.",
    "move.payload": "Such as a part that is gripped.",
    "objective": "What is minimised: time, work, energy, effort, movement, acceleration, jerk, tool_path_length, "
    "tool_speed_uniformity; with obstacles clearance, which is made large.",
    "objective.front": "What `ocp-traj pareto` trades; points 40, reference the task's own without them.",
    "solve": "How hard to look.",
    "solve.starts": "Random starts, the best of which counts.",
    "export": "What `ocp-traj export t.json` writes: a format, and options that are of it.",
}
# Keys of [export], each with a value to copy and of what format it is.
EXPORT = {
    "format": ('"ros"', 'One of "csv", "parquet", "json", "ros", "urscript", "krl", "fanuc", "bpoly".'),
    "at": ('"knots"', "Points at the curve's knots, as without it."),
    "rate": ("125.0", "Points a second [Hz], in place of those at the knots."),
    "samples": ("200", "Of csv, parquet and json: so many even instants, in place of knots or a rate."),
    "tolerance": ("1e-4", "By which quintics may leave a curve of higher degree [rad or m]."),
    "joints": ('{ pan = "joint_a1" }', "Other names for joints, by their own."),
    "interpolation": ('"quintic"', 'Of ros: "quintic", "cubic" or "linear", as the controller is told.'),
    "effort": ("false", "Of ros: true or false, whether points have efforts."),
    "frame": ('"base"', "Of ros: frame_id of the header; of fanuc: number of the user frame, 0 to 9."),
    "lookahead": ("0.03", "Of urscript: of servoj [s], 0.03 to 0.2."),
    "gain": ("2000.0", "Of urscript: of servoj, 100 to 2000."),
    "most_points": ("200", "Of krl and fanuc: points in a file, 2 or more; further ones go into further files."),
    "coupling": ("1", "Of fanuc: of joint 2 into joint 3 as shown, 1, -1 or 0; from the axes without it."),
    "tool": ("1", "Of fanuc: number of the tool, 1 to 10."),
}
# By the program, into trajectories: of no use in a file.
WRITTEN = (
    "source", "robot.numbers", "move.geometry", "collision.bodies", "collision.pairs", "collision.own_pairs",
    "collision.touching",
)  # fmt: skip


def task_example() -> str:
    """The text of a task file."""
    tables = {name: table for name, field in Task.model_fields.items() if (table := _table_in(field.annotation))}
    lines = [f"# {line}".rstrip() for line in HEAD.splitlines()]
    inline = [name for name in Task.model_fields if f"{name}." not in " ".join((*GIVEN, *TO_COPY, *MEANING))]
    for name in Task.model_fields:
        if name in inline and name not in WRITTEN and Task.model_fields[name].description:
            lines += _key(Task, name, "")
    for name in Task.model_fields:
        if name not in inline and Task.model_fields[name].description:
            lines += ["", "", *_comment(MEANING.get(name, "")), f"[[{name}]]" if name == "move" else f"[{name}]"]
            lines += _export() if name == "export" else list(_keys(tables[name], f"{name}."))
    lines += ["", f"# Beside these, {', '.join(WRITTEN)} stand in trajectories, where the program writes them."]
    return "\n".join(lines) + "\n"


def _keys(table: type[BaseModel], prefix: str) -> Iterator[str]:
    for name, field in table.model_fields.items():
        if field.description and prefix + name not in WRITTEN:
            yield from _key(table, name, prefix)


def _key(table: type[BaseModel], name: str, prefix: str) -> list[str]:
    """The lines of a key: what it is, what it may be, and its value."""
    field, place = table.model_fields[name], prefix + name
    allowed = str(field.description)
    words = " ".join(filter(None, (MEANING.get(place), f"{allowed[0].upper()}{allowed[1:]}.")))
    lines = ["", *_comment(f"{name}: {words}")]
    if (inner := _table_in(field.annotation)) is not None:
        for key, own in inner.model_fields.items():
            if f"{place}.{key}" not in WRITTEN:
                told = _comment(f"{own.alias or key}: {own.description}")
                lines += [f"#   {line.removeprefix('# ')}" for line in told]
    value = GIVEN.get(place) or TO_COPY.get(place)
    if value is None and field.default is not None and not isinstance(field.default, BaseModel):
        value = json.dumps(field.default)
    written = f"{name} = {value or '..'}"
    return [*lines, written if place in GIVEN else "\n".join(f"# {line}" for line in written.splitlines())]


def _export() -> list[str]:
    """The lines of the table whose keys are those of a format."""
    lines = []
    for name, (value, words) in EXPORT.items():
        mark = "" if f"export.{name}" in GIVEN else "# "
        lines += ["", *_comment(f"{name}: {words}"), f"{mark}{name} = {value}"]
    return lines


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in wrap(text, WIDTH, break_on_hyphens=False)]


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table that a field's type speaks of, in a list or beside none as well."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if get_origin(annotation) in (list, Union, UnionType):
        return next(filter(None, map(_table_in, get_args(annotation))), None)
    return None
