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
    Each,
    Later,
    Mass,
    Number,
    Positive,
    Row,
    Rows,
    Start,
    Table,
    Three,
    Whole,
)

FORMAT = "ocp-traj/task/1"
KINDS = ("cubic", "quintic", "septic", "nonic", "auto", "retime")
QUANTITIES = ("position", "velocity", "acceleration", "jerk", "snap", "effort")


class Placement(Table):
    """A frame: where it is, and how it is turned."""

    xyz: Three = Field([0.0, 0.0, 0.0], description=THREE)
    rpy: Three | None = Field(None, description="roll, pitch, yaw [angle], or quat_wxyz instead")
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
    inertia: Row | None = Field(
        None, description="ixx, ixy, ixz, iyy, iyz, izz, or three principal ones, about the com [kg m2]"
    )


class Friction(Table):
    """Friction of the joints: coulomb tanh(v / velocity_scale) + viscous v."""

    coulomb: Each = Field(0.0, description="a number or a list, one a joint [N m or N], 0 or more")
    viscous: Each = Field(0.0, description="a number or a list, one a joint [N m s or N s/m], 0 or more")
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
    locked: dict[str, Number] = Field({}, description="a coordinate [angle or length] for each joint that is locked")
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

    description: bool = Field(True, description="true or false: whether the description's own limits hold")
    position: Bound | None = Field(None, description=LIMIT + "; two lists, since positions are not symmetric")
    velocity: Bound | None = Field(None, description=LIMIT)
    acceleration: Bound | None = Field(None, description=FREE)
    jerk: Bound | None = Field(None, description=FREE)
    snap: Bound | None = Field(None, description=FREE)
    effort: Bound | None = Field(None, description=LIMIT)
    tool_speed: Later | None = Field(None, description="")


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


class MoveTable(Table):
    """``[[move]]``: where to."""

    via: Rows | None = Field(None, description="a list of points, each a list with one coordinate a joint")
    start: Row | None = Field(None, description="a list with one coordinate a joint")
    goal: Row | None = Field(None, description="a list with one coordinate a joint")
    path: str | None = Field(None, description="a CSV, ROS YAML or trajectory file, from the task file's folder")
    line: Later | None = Field(None, description="")
    arc: Later | None = Field(None, description="")
    poses: Later | None = Field(None, description="")
    blend: Later | None = Field(None, description="")
    tolerance: Each = Field(0.0, description="a number or a list, one a joint, 0 or more: how near via points count")
    stop: bool = Field(True, description="true or false: whether the robot rests at the end of the move")
    dwell: Mass = Field(0.0, description="seconds to stand still after the move, 0 or more")
    begin: Derivatives | None = Field(None, description="a table with velocity and acceleration, of the first move")
    end: Derivatives | None = Field(None, description="a table with velocity and acceleration, of the last move")
    payload: Held | None = Field(None, description="what is carried on this move, in place of the robot's")

    @model_validator(mode="after")
    def _one_way(self) -> MoveTable:
        ways = [name for name in ("via", "goal", "path") if getattr(self, name) is not None]
        if len(ways) != 1:
            raise ValueError(f"has {' and '.join(ways) or 'no way to go'}; give exactly one of via, goal, path")
        if self.start is not None and ways != ["goal"]:
            raise ValueError("has start without goal; give both, or via")
        if self.dwell and not self.stop:
            raise ValueError("has dwell and stop = false; the robot stands still only where it stops")
        return self


class FrontTable(Table):
    """``front`` of ``[objective]``: what ``ocp-traj pareto`` trades."""

    objectives: list[str] = Field(min_length=2, description="two or more objectives")
    points: Whole | None = Field(None, ge=2, description="a whole number from 2 up")
    reference: dict[str, Number] = Field({}, description="the worst value worth having, by objective")


class ObjectiveTable(Table):
    """``[objective]``: what is minimised."""

    minimise: str | dict[str, Positive] = Field(
        "time", description="an objective, or a table of weights, such as { time = 0.5, effort = 0.5 }"
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
    name: str = Field("task", min_length=1, max_length=200, description="a name")
    units: Units = Field(Units(), description="a table with angle and length")
    robot: RobotTable = Field(description="a table, [robot]")
    limits: LimitsTable = Field(LimitsTable(), description="a table, [limits]")
    curve: CurveTable = Field(CurveTable(), description="a table, [curve]")
    move: list[MoveTable] = Field(min_length=1, description="one or more tables, [[move]]")
    objective: ObjectiveTable = Field(ObjectiveTable(), description="a table, [objective]")
    export: dict[str, Any] | None = Field(None, description="a table, [export]")
    solve: SolveTable = Field(SolveTable(), description="a table, [solve]")
    collision: CollisionTable | None = Field(None, description="a table, [collision]")
    payload: Mass | None = Field(None, description="a mass [kg] in place of that of the robot's payload")
    free_payload: bool = Field(False, description="true or false: whether the payload's mass is a variable")
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
