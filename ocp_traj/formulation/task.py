"""A task: a robot, a path, limits and objectives as plain data, ``ocp-traj/task/1``; from a TOML file or built in code.

Every field says in its description what it may be: that is what a complaint about it ends with. A task is *resolved*
when nothing outside it decides what it means: robot in numbers, all of it in SI, points given.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, ValidationError, model_validator

from ocp_traj.errors import InputError
from ocp_traj.formulation.collision_table import CollisionTable
from ocp_traj.formulation.task_complaints import complaint
from ocp_traj.formulation.task_values import (
    FREE,
    LIMIT,
    THREE,
    Bound,
    Different,
    Each,
    EachFrom0,
    Inertia,
    Mass,
    Number,
    Positive,
    Range,
    Row,
    Rows,
    Start,
    Table,
    Three,
    Truth,
    Weights,
    Whole,
)

FORMAT = "ocp-traj/task/1"
KINDS = ("cubic", "quintic", "septic", "nonic", "auto", "retime")
QUANTITIES = ("position", "velocity", "acceleration", "jerk", "snap", "effort")
TOOL_WAYS = ("line", "arc", "poses")  # of a move
WAYS = ("via", "goal", "path", *TOOL_WAYS)


class Placement(Table):
    """A frame: where it is, and how it is turned."""

    xyz: Three = Field([0.0, 0.0, 0.0], description=THREE)
    rpy: Three | None = Field(None, description="roll, pitch, yaw [rad, or units.angle], or quat_wxyz instead")
    quat_wxyz: Row | None = Field(None, description="four numbers w, x, y, z, not all zero, or rpy instead")

    @model_validator(mode="after")
    def _one_rotation(self) -> Placement:
        if self.rpy is not None and self.quat_wxyz is not None:
            raise ValueError("gives rpy and quat_wxyz; give one of them")
        if self.quat_wxyz is not None and not (len(self.quat_wxyz) == 4 and any(self.quat_wxyz)):
            raise ValueError("gives a quat_wxyz that is no rotation; give four numbers w, x, y, z, not all zero")
        return self


class Held(Table):
    """What the tool carries, in the tool frame."""

    mass: Mass = Field(description="a mass [kg], 0 or more")
    com: Three = Field([0.0, 0.0, 0.0], description=f"{THREE} in the tool frame")
    inertia: Inertia | None = Field(
        None, description="ixx, ixy, ixz, iyy, iyz, izz, or three principal ones, about the com [kg m2]"
    )


class Friction(Table):
    """Friction of the joints: coulomb tanh(v / velocity_scale) + viscous v."""

    coulomb: EachFrom0 = Field(0.0, description="a number or a list, one a joint [N m or N], 0 or more")
    viscous: EachFrom0 = Field(0.0, description="a number or a list, one a joint [N m s or N s/m], 0 or more")
    velocity_scale: Each = Field(0.01, description="speed over which Coulomb friction turns round [rad/s or m/s]")


class RobotTable(Table):
    """``[robot]``: which robot, what it holds."""

    description: str | None = Field(None, description="the name of a robot of the package example-robot-data")
    urdf: str | None = Field(None, description="the path of a URDF file, from the task file's folder")
    dh: list[dict[str, Any]] | None = Field(None, description="rows of Denavit and Hartenberg, one a joint")
    numbers: dict[str, Any] | None = Field(None, description="a robot in numbers, as a resolved task has it")
    convention: Literal["standard", "modified"] = Field("standard", description='"standard" or "modified" (of dh)')
    base: Placement | None = Field(None, description="a table with xyz and rpy or quat_wxyz (of dh)")
    tool_frame: str | None = Field(None, description="the name of a link or frame of the description")
    tool: Placement | None = Field(None, description="a table with xyz and rpy or quat_wxyz, in the tool frame")
    locked: dict[str, Number] = Field({}, description="a coordinate [rad or m, or as units say] for each locked joint")
    gravity: Three = Field([0.0, 0.0, -9.81], description="three numbers [m/s2] in the world")
    payload: Held | None = Field(None, description="a table with mass and, if need be, com and inertia")
    friction: Friction | None = Field(None, description="a table with coulomb, viscous and velocity_scale")

    @model_validator(mode="after")
    def _one_robot(self) -> RobotTable:
        given = [name for name in ("description", "urdf", "dh", "numbers") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"has {' and '.join(given) or 'no robot'}; give exactly one of description, urdf, dh")
        wrong = {"dh": ("tool_frame", "locked"), "description": ("base",), "urdf": ("base",)}.get(given[0], ())
        for name in wrong:
            if name in self.model_fields_set:
                raise ValueError(f"has {name}, which a robot by {given[0]} does not take; leave it out")
        return self


class LimitsTable(Table):
    """``[limits]``: what a URDF does not hold has to be given, or waived."""

    description: Truth = Field(True, description="true or false: whether the description's own limits hold")
    position: Range | None = Field(
        None, description="two lists (lower, upper) with one number a joint, a share of the description's such as "
        '"50 %", or "none"'
    )  # fmt: skip
    velocity: Bound | None = Field(None, description=LIMIT)
    acceleration: Bound | None = Field(None, description=FREE)
    jerk: Bound | None = Field(None, description=FREE)
    snap: Bound | None = Field(None, description=FREE)
    effort: Bound | None = Field(None, description=LIMIT)
    tool_speed: Positive | None = Field(None, description="a speed above zero [length/s] of the tool frame's origin")


class CurveTable(Table):
    """``[curve]``: of what the motion is made."""

    kind: Literal["cubic", "quintic", "septic", "nonic", "auto", "retime"] = Field(
        "auto", description=f"one of {', '.join(KINDS)}"
    )
    pieces: Whole | None = Field(
        None, ge=1, le=1024, description="a whole number from 1 to 1024, of pieces between via points"
    )
    finest: Whole = Field(
        16, ge=1, le=1024, description="a whole number from 1 to 1024, to which auto refines the pieces at most"
    )
    gain: Positive = Field(0.01, lt=1.0, description="a number between 0 and 1, the gain below which auto stops")
    rest: Whole = Field(
        2, ge=0, le=4, description="a whole number from 0 to 4, of derivatives that vanish at both ends"
    )


class Derivatives(Table):
    """Derivatives at an end, in place of rest."""

    velocity: Row = Field(description="a list, one a joint")
    acceleration: Row | None = Field(None, description="a list, one a joint")


class Turned(Table):
    """How the tool is turned where a tool path ends; as at its beginning where nothing is said."""

    rpy: Three | None = Field(None, description="roll, pitch, yaw [angle] in the world, or quat_wxyz instead")
    quat_wxyz: Row | None = Field(None, description="four numbers w, x, y, z, not all zero, or rpy instead")

    @model_validator(mode="after")
    def _one_rotation(self) -> Turned:
        if self.rpy is not None and self.quat_wxyz is not None:
            raise ValueError("gives rpy and quat_wxyz; give one of them")
        if self.quat_wxyz is not None and not (len(self.quat_wxyz) == 4 and any(self.quat_wxyz)):
            raise ValueError("gives a quat_wxyz that is no rotation; give four numbers w, x, y, z, not all zero")
        return self


class LineTable(Turned):
    """``line`` of a move: straight from where it begins."""

    by: Three | None = Field(None, description=f"{THREE} in the world, from where the move begins")
    to: Three | None = Field(None, description=f"{THREE} in the world")

    @model_validator(mode="after")
    def _one_end(self) -> LineTable:
        if (self.by is None) == (self.to is None):
            raise ValueError("gives by and to; give one of them" if self.by else "gives no end; give by or to")
        return self


class ArcTable(Turned):
    """``arc`` of a move: through a point to another, or about an axis by an angle."""

    via: Three | None = Field(None, description=f"{THREE} in the world, on the arc")
    to: Three | None = Field(None, description=f"{THREE} in the world, its end")
    centre: Three | None = Field(None, description=f"{THREE} in the world, on the axis")
    axis: Three | None = Field(None, description="three numbers, not all zero: about which it turns, right-handed")
    angle: Number | None = Field(None, description="an angle, not zero and at most one turn either way")
    with_arc: bool = Field(False, description="true or false: whether the tool turns along with the arc")

    @model_validator(mode="after")
    def _one_way(self) -> ArcTable:
        given = {name for name in ("via", "to", "centre", "axis", "angle") if getattr(self, name) is not None}
        if given not in ({"via", "to"}, {"centre", "axis", "angle"}):
            raise ValueError(f"has {', '.join(sorted(given)) or 'no end'}; give via and to, or centre, axis and angle")
        if self.with_arc and (self.rpy is not None or self.quat_wxyz is not None):
            raise ValueError("has with_arc and a rotation at its end; give one of them")
        if self.axis is not None and not any(self.axis):
            raise ValueError("has an axis of zeros; give three numbers, not all zero")
        return self


class PoseTable(Turned):
    """One of ``poses`` of a move."""

    xyz: Three = Field(description=f"{THREE} in the world")


class ToleranceTable(Table):
    """``tolerance`` of a move along a tool path."""

    position: Positive = Field(description="a length above zero: distance of the tool frame's origin from the path")
    tilt: Positive = Field(description="an angle above zero and below a half turn, between the tool and the path's")


class SpeedTable(Table):
    """``speed`` of a move along a tool path, constant but for what it takes to start and stop."""

    value: Positive = Field(description="a speed above zero [length/s] of the tool frame's origin")
    band: Positive = Field(0.02, lt=1.0, description="a share below 1, by which the speed may be off either way")
    run_up: Positive | None = Field(
        None, description="a length of path at each end, in which the speed is free; a tenth of the path's if not given"
    )


class SectionTable(Table):
    """A line or an arc of a resolved tool path, along which the tool turns by a rotation vector, all in SI."""

    by: Three | None = Field(None, description="three numbers [m]: of a line")
    centre: Three | None = Field(None, description="three numbers [m]: of an arc")
    axis: Three | None = Field(None, description="three numbers, not all zero: of an arc")
    angle: Number | None = Field(None, description="a number [rad]: of an arc")
    turn: Three = Field([0.0, 0.0, 0.0], description="three numbers [rad]: a rotation vector in the world")
    corner: Row | None = Field(None, description="seven numbers, as of pose: of a section that rounds a corner")
    blend: Positive | None = Field(None, description="a length above zero [m]: within which it is of the corner")

    @model_validator(mode="after")
    def _one_kind(self) -> SectionTable:
        given = {name for name in ("by", "centre", "axis", "angle") if getattr(self, name) is not None}
        if given not in ({"by"}, {"centre", "axis", "angle"}):
            raise ValueError(f"has {', '.join(sorted(given)) or 'nothing'}; give by, or centre, axis and angle")
        if (self.corner is None) != (self.blend is None):
            raise ValueError("has one of corner and blend; give both or none")
        return self


class ToolPathTable(Table):
    """A resolved tool path: where it begins, and its sections."""

    pose: Row = Field(description="seven numbers x, y, z [m], w, x, y, z: the tool frame where it begins")
    sections: list[SectionTable] = Field(min_length=1, description="one or more tables")
    branch: str = Field("", description="words on how the posture at its beginning was chosen")


class Geometry(Table):
    """A path's own curve through the points of ``via``, over a parameter of its own; what ``retime`` keeps."""

    durations: Row = Field(description="a list of numbers above zero, the steps of the parameter between the points")
    control_points: list[Rows] = Field(description="a list with the control points of each segment, in rad or m")

    @model_validator(mode="after")
    def _segments(self) -> Geometry:
        sizes = {len(row) for rows in self.control_points for row in rows}
        if len(self.control_points) != len(self.durations) or min(self.durations) <= 0.0 or len(sizes) != 1:
            raise ValueError("has not as many segments as durations above zero, all of the same joints; give those")
        return self


class MoveTable(Table):
    """``[[move]]``: where to."""

    via: Rows | None = Field(None, description="a list of points, each a list with one coordinate a joint")
    start: Row | None = Field(None, description="a list with one coordinate a joint")
    goal: Row | None = Field(None, description="a list with one coordinate a joint")
    path: str | None = Field(None, description="a CSV, ROS YAML or trajectory file, from the task file's folder")
    point: Whole | None = Field(
        None, ge=0, description="a whole number from 0 up, which trajectory of the run folder that path is"
    )
    geometry: Geometry | None = Field(None, description="a path's own curve, as a resolved task has it")
    line: LineTable | None = Field(None, description="a table with by or to, and rpy or quat_wxyz")
    arc: ArcTable | None = Field(None, description="a table with via and to, or centre, axis and angle")
    poses: list[PoseTable | Row] | None = Field(
        None,
        min_length=1,
        description="a list of poses, each x, y, z, w, x, y, z or a table with xyz and rpy or quat_wxyz",
    )
    blend: Positive | None = Field(
        None,
        description="a length above zero [length], by which the tool may leave a corner of its path and does not stop",
    )
    tolerance: ToleranceTable | EachFrom0 = Field(
        0.0,
        description="a number or a list, one a joint, 0 or more: how near points count; of a tool path a table with "
        "position and tilt",
    )
    free_turn: Truth = Field(False, description="true or false: whether the tool may turn about its axis z as it likes")
    speed: SpeedTable | Positive | None = Field(
        None, description="a speed above zero [length/s] of the tool, or a table with value, band and run_up"
    )
    stop: Truth = Field(True, description="true or false: whether the robot rests at the end of the move")
    dwell: Mass = Field(0.0, description="seconds to stand still after the move, 0 or more")
    begin: Derivatives | None = Field(None, description="a table with velocity and acceleration, of the first move")
    end: Derivatives | None = Field(None, description="a table with velocity and acceleration, of the last move")
    payload: Held | None = Field(
        None, description="a table with mass and, if need be, com and inertia, in place of the robot's"
    )
    tool_path: ToolPathTable | None = Field(None, description="")

    @model_validator(mode="after")
    def _one_way(self) -> MoveTable:
        ways = [name for name in WAYS if getattr(self, name) is not None]
        if len(ways) != 1:
            raise ValueError(f"has {' and '.join(ways) or 'no way to go'}; give exactly one of {', '.join(WAYS)}")
        tool = ways[0] in TOOL_WAYS or self.tool_path is not None
        if self.start is not None and ways != ["goal"] and not tool:
            raise ValueError("has start without goal; give both, or via")
        if self.point is not None and self.path is None:
            raise ValueError("has point without path; give the run folder as path")
        if self.geometry is not None and self.via is None:
            raise ValueError("has geometry without via; give the points it passes as well")
        if self.dwell and not self.stop:
            raise ValueError("has dwell and stop = false; the robot stands still only where it stops")
        if self.dwell and self.blend is not None and self.poses is None:
            raise ValueError("has dwell and blend; the robot does not stand still at a corner that it rounds")
        if tool and not isinstance(self.tolerance, ToleranceTable):
            raise ValueError("has no tolerance of its tool path; give tolerance = { position = .., tilt = .. }")
        if not tool:
            if isinstance(self.tolerance, ToleranceTable):
                raise ValueError(f"has a tolerance of a tool path and goes by {ways[0]}; give a number, or a list")
            for name in ("free_turn", "speed", "blend"):
                if getattr(self, name):
                    raise ValueError(f"has {name}, which is of a tool path; give one of {', '.join(TOOL_WAYS)}")
        return self


class FrontTable(Table):
    """``front`` of ``[objective]``: what ``ocp-traj pareto`` trades."""

    objectives: Different = Field(
        min_length=2, description='two or more different objectives, such as ["time", "effort"]'
    )
    points: Whole | None = Field(None, ge=2, description="a whole number from 2 up")
    reference: dict[str, Number] = Field({}, description="the worst value worth having, by objective")


class ObjectiveTable(Table):
    """``[objective]``: what is minimised."""

    minimise: Weights = Field(
        "time", description="an objective, or a table of weights above zero, such as { time = 0.5, effort = 0.5 }"
    )
    front: FrontTable | None = Field(None, description="a table with objectives, points and reference")


class SolveTable(Table):
    """``[solve]``: how hard to look."""

    starts: Whole = Field(1, ge=1, le=10_000, description="a whole number from 1 up")
    start: Start = Field(
        "auto", description='"auto", "straight", "plan", "ompl", or the path of a CSV or ROS YAML file of points'
    )


class Units(Table):
    """``units``: what angles and lengths are given in."""

    angle: Literal["rad", "deg"] = Field("rad", description='"rad" or "deg"')
    length: Literal["m", "mm"] = Field("m", description='"m" or "mm"')


class Source(Table):
    """What a resolved task was made from."""

    file: str = Field("", description="the task file's name")
    sha256: str = Field("", description="of its text")


class Task(Table):
    """A task. Its fields are the tables of a task file, by the same names; in SI unless ``units`` say otherwise."""

    format: Literal["ocp-traj/task/1"] = Field("ocp-traj/task/1", description=f'"{FORMAT}"')
    name: str = Field("task", min_length=1, max_length=200, description="a text of 1 to 200 letters")
    units: Units = Field(Units(), description="a table with angle and length")
    robot: RobotTable = Field(description="a table, [robot]")
    limits: LimitsTable = Field(LimitsTable(), description="a table, [limits]")
    curve: CurveTable = Field(CurveTable(), description="a table, [curve]")
    move: list[MoveTable] = Field(min_length=1, description="one or more tables, [[move]]")
    objective: ObjectiveTable = Field(ObjectiveTable(), description="a table, [objective]")
    export: dict[str, Any] | None = Field(None, description="a table, [export]")
    solve: SolveTable = Field(SolveTable(), description="a table, [solve]")
    collision: CollisionTable | None = Field(None, description="a table, [collision]")
    payload: Mass | None = Field(None, description="a mass [kg], 0 or more, in place of that of the robot's payload")
    free_payload: Truth = Field(False, description="true or false: whether the payload's mass is a variable")
    source: Source | None = Field(None, description="what a resolved task was made from")

    def __init__(self, **fields: Any) -> None:
        """A task of plain values, by table.

        Raises:
            InputError: one line of what is wrong first.
        """
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise InputError(complaint(error, Task, fields)) from error

    @property
    def resolved(self) -> bool:
        """Whether nothing outside the task decides what it means."""
        return self.robot.numbers is not None and self.source is not None

    def fields(self) -> dict[str, Any]:
        """Its fields that differ from their defaults, as plain JSON values: enough to make it again."""
        return self.model_dump(mode="python", exclude_defaults=True, by_alias=True)
