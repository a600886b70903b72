"""``[collision]`` of a task: what the robot consists of, what stands in its way, and how near it may come.

A resolved task has all bodies in numbers, fixed to joints by name, and the pairs of the robot's own that have to keep
apart: nothing outside it decides what is clear of what.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, model_validator

from ocp_traj.formulation.task_values import THREE, Mass, Number, Positive, Row, Table, Three

RADIUS = "a radius above zero [length]"
SHAPES = ("sphere", "capsule", "cylinder", "box", "plane")


class SphereTable(Table):
    """A ball."""

    centre: Three = Field(description=THREE)
    radius: Positive = Field(description=RADIUS)


class EndsTable(Table):
    """A capsule, all that is within a radius of a segment; or a cylinder, with flat ends."""

    begin: Three = Field(alias="from", description=THREE + ", where its axis begins")
    end: Three = Field(alias="to", description=THREE + ", where its axis ends")
    radius: Positive = Field(description=RADIUS)


class BoxTable(Table):
    """A box, which may be turned."""

    centre: Three = Field(description=THREE)
    size: Three = Field(description="three whole lengths above zero, along its axes [length]")
    rpy: Three | None = Field(None, description="roll, pitch, yaw [angle], or quat_wxyz instead")
    quat_wxyz: Row | None = Field(None, description="four numbers w, x, y, z, not all zero, or rpy instead")

    @model_validator(mode="after")
    def _fits(self) -> BoxTable:
        if not all(length > 0.0 for length in self.size):
            raise ValueError(f"has the size {self.size}; give three lengths above zero")
        if self.rpy is not None and self.quat_wxyz is not None:
            raise ValueError("gives rpy and quat_wxyz; give one of them")
        if self.quat_wxyz is not None and not (len(self.quat_wxyz) == 4 and any(self.quat_wxyz)):
            raise ValueError("gives a quat_wxyz that is no rotation; give four numbers w, x, y, z, not all zero")
        return self


class PlaneTable(Table):
    """A half-space, such as a floor: the robot keeps normal . x >= offset."""

    normal: Three = Field(description="three numbers, not all zero, towards where the robot is")
    offset: Number = Field(description="a number [length]: kept is normal . x >= offset")

    @model_validator(mode="after")
    def _direction(self) -> PlaneTable:
        if not any(self.normal):
            raise ValueError("has the normal [0, 0, 0]; give a direction, three numbers, not all zero")
        return self


class ShapeTable(Table):
    """One of the shapes."""

    name: str = Field("", max_length=200, description="a name")
    sphere: SphereTable | None = Field(None, description="a table with centre and radius")
    capsule: EndsTable | None = Field(None, description="a table with from, to and radius")
    cylinder: EndsTable | None = Field(None, description="a table with from, to and radius")
    box: BoxTable | None = Field(None, description="a table with centre, size and, if it is turned, rpy or quat_wxyz")

    @property
    def shapes(self) -> list[str]:
        """Which shapes it gives."""
        return [name for name in SHAPES if getattr(self, name, None) is not None]


class ObstacleTable(ShapeTable):
    """``[[collision.obstacle]]``: what stands in the way, fixed in the world."""

    plane: PlaneTable | None = Field(None, description="a table with normal and offset")

    @model_validator(mode="after")
    def _one_shape(self) -> ObstacleTable:
        if len(self.shapes) != 1:
            raise ValueError(f"has {' and '.join(self.shapes) or 'no shape'}; give exactly one of {', '.join(SHAPES)}")
        return self


class LinkTable(ShapeTable):
    """``[[collision.link]]``: a body of the robot, of its tool or of what it holds, in a frame that moves.

    ``from``, ``to`` and ``radius`` beside the frame are a capsule.
    """

    frame: str = Field(min_length=1, description='the name of a link, frame or joint of the robot, or "tool"')
    begin: Three | None = Field(None, alias="from", description=THREE + ", where a capsule's axis begins")
    end: Three | None = Field(None, alias="to", description=THREE + ", where a capsule's axis ends")
    radius: Positive | None = Field(None, description=RADIUS + ", of a capsule")

    @model_validator(mode="after")
    def _one_shape(self) -> LinkTable:
        given = [name for name in ("from", "to", "radius") if getattr(self, ALIASES.get(name, name)) is not None]
        found = [*self.shapes, *(["from, to and radius"] if given else [])]
        if len(found) != 1:
            raise ValueError(
                f"has {' and '.join(found) or 'no shape'}; give from, to and radius, or exactly one of "
                f"{', '.join(SHAPES[:-1])}"
            )
        if given and len(given) < 3:
            missing = [name for name in ("from", "to", "radius") if name not in given]
            raise ValueError(f"has {' and '.join(given)} without {' and '.join(missing)}; a capsule needs all three")
        return self


ALIASES = {"from": "begin", "to": "end"}


class CollisionTable(Table):
    """``[collision]``: bodies, what they keep clear of, and by how much."""

    links: Literal["urdf", "given"] | None = Field(
        None,
        description='"urdf" for the collision geometry of the robot\'s URDF, its meshes in capsules, or "given" for '
        "[[collision.link]] alone",
    )
    link: list[LinkTable] = Field(
        [],
        description="tables, [[collision.link]]: frame, and from, to, radius of a capsule, or one of sphere, capsule, "
        'cylinder, box; the frame "tool" is that of the task',
    )
    obstacle: list[ObstacleTable] = Field(
        [],
        description="tables, [[collision.obstacle]]: name, and one of sphere = { centre, radius }, "
        "capsule = { from, to, radius }, cylinder likewise, box = { centre, size, rpy }, plane = { normal, offset }",
    )
    own: bool = Field(True, alias="self", description="true or false: whether the robot keeps clear of itself")
    clearance: Mass = Field(0.0, description="a distance to all obstacles [length], 0 or more")
    self_clearance: Mass = Field(0.0, description="a distance between the robot's own bodies [length], 0 or more")
    srdf: str | None = Field(None, description="the path of an SRDF file, whose pairs need not keep apart")
    bodies: list[dict[str, Any]] | None = Field(None, description="bodies in numbers, as a resolved task has them")
    pairs: list[list[str]] | None = Field(
        None, description="names of bodies and obstacles, as a resolved task has them"
    )
    own_pairs: list[list[str]] = Field([], description="names of bodies of the robot, as a resolved task has them")
    touching: list[list[str]] = Field([], description="names of links that overlap at most postures, left out")

    @model_validator(mode="after")
    def _something(self) -> CollisionTable:
        if (self.bodies is None) != (self.pairs is None):
            raise ValueError("has bodies without pairs, or pairs without bodies; both are what a resolved task has")
        if self.bodies is not None:
            return self
        if self.links == "given" and not self.link:
            raise ValueError('has links = "given" and no [[collision.link]]; give some, or links = "urdf"')
        if not self.own and not self.obstacle:
            raise ValueError("has no [[collision.obstacle]] and self = false: there is nothing to keep clear of")
        return self
