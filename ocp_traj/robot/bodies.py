"""Convex bodies fixed to joints of a robot, or to the world: what may touch what, as plain data.

A body is a core grown by a ball of ``radius``. Cores are a point (sphere), a segment (capsule), a box, a cylinder, and
a half-space; the first three are boxes of which some half lengths are zero, so that their vertices give them exactly:
1, 2 and 8. A cylinder has none: its support function is exact.

They are made and used so::

    ball = sphere("ball", 0, [0.5, 0.0, 0.3], 0.1)          # joint 0 is the world
    arm = capsule("arm", 3, [0, 0, 0], [0.4, 0, 0], 0.05)   # in the frame of joint 3 of the robot's model
    arm.vertices                                            # (2, 3) in that frame; the body: their hull, grown
    arm.support(n)                                          # the largest n . x, n in the joint's frame
    shape, placement = arm.coal()                           # for coal.distance; placement in the joint's frame

Two bodies are a distance ``c`` apart where a unit normal n has ``n . (x_a - x_b) - r_a - r_b >= c`` for all vertices of
both; of a half-space the rows are ``n . (x - centre) - r >= c`` with its own normal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import hypot
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, RobotDefinitionError, quoted
from ocp_traj.robot.dynamics import joint_index

SPHERE, CAPSULE, BOX, CYLINDER, HALF_SPACE = KINDS = ("sphere", "capsule", "box", "cylinder", "half-space")
ROTATED = 1e-9  # how far a rotation's columns may be from orthonormal


@dataclass(frozen=True, eq=False)
class Body:
    """A convex body in the frame of a joint; see ``sphere``, ``capsule``, ``box``, ``cylinder``, ``half_space``.

    Attributes:
        name: unique among the bodies of a robot and its cell.
        kind: one of ``KINDS``.
        joint: index in the robot's model; 0 is the world.
        centre: of the core ``(3,)`` [m]; of a half-space a point on its face.
        axes: ``(3, 3)``, columns are the core's axes; a capsule's and a cylinder's runs along the third, a half-space
            lies below its face, which the third is the outward normal of.
        half: half lengths of the core along its axes ``(3,)`` [m]: ``(0, 0, 0)`` of a sphere, ``(0, 0, h)`` of a
            capsule, ``(R, R, h)`` of a cylinder, infinite of a half-space.
        radius: of the ball the core is grown by [m].
        link: whose part it is, as verdicts call it; its own name where it is alone.
    """

    name: str
    kind: str
    joint: int
    centre: Array
    axes: Array
    half: Array
    radius: float
    link: str = ""

    def __post_init__(self) -> None:
        """Checks numbers and shapes."""
        words = f"body {quoted(self.name)}"
        if self.kind not in KINDS:
            raise InputError(f"{words} is a {quoted(self.kind)}; allowed are {', '.join(KINDS)}")
        for name, shape in (("centre", (3,)), ("axes", (3, 3)), ("half", (3,))):
            object.__setattr__(self, name, _numbers(getattr(self, name), shape, f"{words}: {name}", name == "half"))
        if not np.abs(self.axes.T @ self.axes - np.eye(3)).max() <= ROTATED or np.linalg.det(self.axes) < 0.0:
            raise InputError(f"{words}: its axes are {self.axes.tolist()}; give a rotation")
        if self.kind == HALF_SPACE and self.joint != 0:
            raise InputError(f"{words} is a half-space on joint {self.joint}; one stands still in the world, joint 0")
        if not 0.0 <= self.radius < np.inf:
            raise InputError(f"{words} has the radius {self.radius} m; give a finite number, zero or more")
        if not (self.half >= 0.0).all() or (np.isinf(self.half).any() and self.kind != HALF_SPACE):
            raise InputError(f"{words} has half lengths {self.half.tolist()} m; give finite numbers, zero or more")
        object.__setattr__(self, "link", self.link or self.name)

    @property
    def vertices(self) -> Array:
        """Of the core ``(1, 2, 4 or 8, 3)``, in the joint's frame [m]; of a cylinder or half-space ``InputError``."""
        if self.kind in (CYLINDER, HALF_SPACE):
            raise InputError(f"body {quoted(self.name)} is a {self.kind}, which has no vertices")
        sides = [(0.0,) if h == 0.0 else (-h, h) for h in self.half.tolist()]
        return np.asarray(self.centre + np.array(list(product(*sides))) @ self.axes.T)

    @property
    def normal(self) -> Array:
        """Of a half-space's face, outward ``(3,)``; of others the third axis."""
        return np.asarray(self.axes[:, 2])

    def support(self, direction: ArrayLike) -> float:
        """The largest ``direction . x`` over the body, direction in the joint's frame; infinite where unbounded."""
        d = np.asarray(direction, dtype=float)
        along, size = self.axes.T @ d, float(np.linalg.norm(d))
        start = float(d @ self.centre) + self.radius * size
        if self.kind == HALF_SPACE:
            return start if along[2] > 0.0 and hypot(along[0], along[1]) <= ROTATED * size else np.inf
        if self.kind == CYLINDER:
            return start + float(self.half[0]) * hypot(along[0], along[1]) + float(self.half[2] * abs(along[2]))
        return start + float(np.abs(along) @ self.half)

    def coal(self) -> tuple[Any, pin.SE3]:
        """Shape for ``coal`` and where it is in the joint's frame; grown boxes and cylinders by a swept sphere."""
        placement = pin.SE3(self.axes, self.centre)
        if self.kind == SPHERE:
            return coal.Sphere(self.radius), placement
        if self.kind == CAPSULE:
            return coal.Capsule(self.radius, 2.0 * self.half[2]), placement
        if self.kind == HALF_SPACE:
            return coal.Halfspace(self.normal, float(self.normal @ self.centre) + self.radius), pin.SE3.Identity()
        shape = coal.Box(*(2.0 * self.half)) if self.kind == BOX else coal.Cylinder(self.half[0], 2.0 * self.half[2])
        shape.setSweptSphereRadius(self.radius)
        return shape, placement

    def to_data(self, model: pin.Model) -> dict[str, Any]:
        """As JSON has it, its joint by name; ``from_data`` makes it again, bit by bit."""
        half = [] if self.kind == HALF_SPACE else self.half.tolist()
        return {
            "name": self.name, "kind": self.kind, "joint": str(model.names[self.joint]), "link": self.link,
            "centre": self.centre.tolist(), "axes": self.axes.tolist(), "half": half, "radius": self.radius,
        }  # fmt: skip

    @classmethod
    def from_data(cls, model: pin.Model, data: Mapping[str, Any]) -> Body:
        """The body of ``to_data``; wrong or missing fields raise ``InputError``."""
        fields = {"name", "kind", "joint", "link", "centre", "axes", "half", "radius"}
        if set(data) != fields:
            raise InputError(f"a body has the fields {sorted(data)}; it takes {sorted(fields)}")
        if not isinstance(data["radius"], float | int) or isinstance(data["radius"], bool):
            raise InputError(f"body {quoted(data['name'])} has the radius {quoted(data['radius'])}; give a number [m]")
        joint, half = str(data["joint"]), data["half"]
        index = 0 if joint == model.names[0] else joint_index(model, joint)
        if data["kind"] == HALF_SPACE:
            half = np.full(3, np.inf)
        return cls(
            str(data["name"]), str(data["kind"]), index, data["centre"], data["axes"], half,
            float(data["radius"]), str(data["link"]),
        )  # fmt: skip


def sphere(name: str, joint: int, centre: ArrayLike, radius: float, link: str = "") -> Body:
    """A ball."""
    _above_zero(name, "radius", radius)
    return Body(name, SPHERE, joint, np.asarray(centre), np.eye(3), np.zeros(3), float(radius), link)


def capsule(name: str, joint: int, start: ArrayLike, end: ArrayLike, radius: float, link: str = "") -> Body:
    """All that is within ``radius`` of a segment; one without length is a sphere."""
    _above_zero(name, "radius", radius)
    ends = [_numbers(point, (3,), f"body {quoted(name)}: an end") for point in (start, end)]
    return _along(name, CAPSULE, joint, ends, 0.0, float(radius), link)


def cylinder(name: str, joint: int, start: ArrayLike, end: ArrayLike, radius: float, link: str = "") -> Body:
    """A cylinder with flat ends at the centres of which its axis begins and ends."""
    _above_zero(name, "radius", radius)
    ends = [_numbers(point, (3,), f"body {quoted(name)}: an end") for point in (start, end)]
    if not np.linalg.norm(ends[1] - ends[0]) > 0.0:
        raise InputError(f"cylinder {quoted(name)} begins and ends at {ends[0].tolist()}; give two different points")
    return _along(name, CYLINDER, joint, ends, float(radius), 0.0, link)


def box(
    name: str, joint: int, centre: ArrayLike, size: ArrayLike, axes: ArrayLike | None = None, link: str = ""
) -> Body:
    """A box of whole lengths ``size (3,)`` along its axes, the columns of ``axes (3, 3)``."""
    lengths = _numbers(size, (3,), f"body {quoted(name)}: size")
    if not (lengths > 0.0).all():
        raise InputError(f"box {quoted(name)} has the size {lengths.tolist()} m; give three numbers above zero")
    turned = np.eye(3) if axes is None else np.asarray(axes)
    return Body(name, BOX, joint, np.asarray(centre), turned, 0.5 * lengths, 0.0, link)


def half_space(name: str, normal: ArrayLike, offset: float, link: str = "") -> Body:
    """All x of the world with normal . x <= offset, a floor or a wall: what is kept clear of it is beyond."""
    direction = _numbers(normal, (3,), f"body {quoted(name)}: normal")
    size = float(np.linalg.norm(direction))
    if not size > 0.0 or not np.isfinite([size, offset]).all():
        raise InputError(
            f"half-space {quoted(name)} has the normal {direction.tolist()} and the offset {offset}; "
            "give a direction and a finite offset [m]"
        )
    axes = axes_along(direction / size)
    return Body(name, HALF_SPACE, 0, (float(offset) / size) * axes[:, 2], axes, np.full(3, np.inf), 0.0, link)


def axes_along(direction: Array) -> Array:
    """A rotation whose third column is a unit vector."""
    first = np.eye(3)[int(np.argmin(np.abs(direction)))]
    first = first - (first @ direction) * direction
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(direction, first), direction])


def _along(name: str, kind: str, joint: int, ends: Sequence[Array], core: float, radius: float, link: str) -> Body:
    span = ends[1] - ends[0]
    length = float(np.linalg.norm(span))
    axes = axes_along(span / length) if length > 0.0 else np.eye(3)
    half = np.array([core, core, 0.5 * length])
    kind = SPHERE if kind == CAPSULE and length == 0.0 else kind
    return Body(name, kind, joint, 0.5 * (ends[0] + ends[1]), axes, half, radius, link)


def _above_zero(name: str, what: str, value: float) -> None:
    if not 0.0 < value < np.inf:
        raise InputError(f"body {quoted(name)} has the {what} {value}; give a finite number above zero [m]")


def _numbers(values: ArrayLike, shape: tuple[int, ...], what: str, infinite: bool = False) -> Array:
    try:
        numbers = np.array(values, dtype=float)
    except (TypeError, ValueError):
        numbers = np.array(np.nan)
    if numbers.shape != shape or np.isnan(numbers).any() or (np.isinf(numbers).any() and not infinite):
        raise InputError(f"{what} is {quoted(values)}; give {' x '.join(map(str, shape))} finite numbers")
    return numbers


def unique_names(bodies: Sequence[Body]) -> None:
    """Raises ``RobotDefinitionError`` where two bodies share a name."""
    names = [body.name for body in bodies]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise RobotDefinitionError(f"bodies {doubled} are there twice; give each a name of its own")
