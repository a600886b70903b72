"""A robot: ``pinocchio.Model``, limits, tool and actuators; from a URDF, from Denavit-Hartenberg rows, or from a model.

The trajectory's coordinates q are the *actuators'*.  With s(q) the serial joint coordinates of the model and
J = ds/dq, the model moves with s, J v and J a + dJ/dt v, and virtual work gives the actuators' effort J^T tau.
Units are SI; a prismatic actuator has [m] and [N], a revolute one [rad] and [N m].
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import casadi as ca
import numpy as np
import numpy.typing as npt
import pinocchio as pin
from casadi import SX

from ocp_traj.arrays import Array
from ocp_traj.errors import RobotDefinitionError, nearest
from ocp_traj.robot.chain import AxisJoint, Chain, DHRow, LinkInertia, screw
from ocp_traj.robot.descriptions import description_urdf
from ocp_traj.robot.dynamics import (
    Friction,
    Payload,
    Wrench,
    checked_friction,
    column,
    forward_kinematics,
    inverse_dynamics,
    joint_friction,
    joint_index,
    joint_is_revolute,
)
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.payload import ToolPayload
from ocp_traj.robot.urdf import urdf_limits, urdf_model, urdf_text

EFFORT_UNITS = {"m": "N", "rad": "N m"}
REACHED = 1e-6  # [m], and of a rotation's entries: how far a pose may be missed; our choice


@dataclass(frozen=True, eq=False)
class ActuatorMap:
    """Serial joint coordinates of the model as a smooth function of the actuators' coordinates: ``(n,) -> (nv,)``."""

    name: str
    position: Callable[[SX], SX]


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot as its trajectory sees it.

    Args:
        model: tree of revolute and prismatic joints, its gravity included.
        joints: labels of the actuators.
        units: "m" or "rad" per actuator.
        limits: of the actuators.
        tool: the tool frame in the frame of the joint that carries it.
        actuator_map: ``None`` where the actuators drive the joints themselves.
        tool_joint: index or name of the joint that carries the tool; ``None`` for the last.
        friction: of the actuators, in numbers; ``None`` for none.
    """

    model: pin.Model
    joints: tuple[str, ...]
    units: tuple[str, ...]
    limits: JointLimits = field(default_factory=JointLimits)
    tool: pin.SE3 = field(default_factory=pin.SE3.Identity)
    actuator_map: ActuatorMap | None = None
    tool_joint: int | str | None = None
    friction: Friction | None = None

    def __post_init__(self) -> None:
        """Check that the parts fit."""
        n, nv = len(self.joints), self.model.nv
        _units(self.model)  # raises UnsupportedJoint
        if n == 0 or len(set(self.joints)) != n:
            raise RobotDefinitionError(f"actuator labels are {list(self.joints)}, expected one or more, all different")
        if len(self.units) != n or not set(self.units) <= set(EFFORT_UNITS):
            raise RobotDefinitionError(f"units are {list(self.units)}, expected {n} of {list(EFFORT_UNITS)}")
        if self.limits.size not in (None, n):
            raise RobotDefinitionError(
                f"limits are of {self.limits.size} joints, the robot has {n}: {list(self.joints)}"
            )
        if self.friction is not None:
            object.__setattr__(self, "friction", checked_friction(self.friction, n))
        shape = (n, 1) if self.actuator_map is None else self.actuator_map.position(SX.sym("q", n)).shape
        joint_index(self.model, self.tool_joint)
        if shape != (nv, 1):
            what = "joints" if self.actuator_map is None else f"actuator map {self.actuator_map.name!r}"
            raise RobotDefinitionError(f"{what} gives shape {shape}, the model expects ({nv}, 1)")

    @property
    def size(self) -> int:
        """Number of actuators."""
        return len(self.joints)

    @property
    def effort_units(self) -> tuple[str, ...]:
        """Unit of each effort: "N" or "N m"."""
        return tuple(EFFORT_UNITS[unit] for unit in self.units)

    def effort(
        self,
        q: SX,
        v: SX,
        a: SX,
        *,
        payload: ToolPayload | SX | float = 0.0,
        tool_force: Any = None,
        friction: Friction | None = None,
    ) -> SX:
        """Actuator efforts J^T tau(s, J v, J a + dJ/dt v) + friction(v), by virtual work; Guo et al. (2016), Eq. (110).

        Args:
            q: ``(n,)``, [m or rad].
            v: ``(n,)``, [m/s or rad/s].
            a: ``(n,)``, [m/s^2 or rad/s^2].
            payload: a body in the tool frame, or a point mass at its origin [kg].
            tool_force: ``(3,)``, exerted on the outside at the tool frame's origin, in the tool frame [N].
            friction: of the actuators, in place of the robot's own; see `joint_friction`.

        Returns:
            ``(n,)``, [N or N m].
        """
        s, rate, rate2, jacobian = self._serial(q, v, a)
        if isinstance(payload, ToolPayload):
            held = payload.at(self.tool, self.tool_joint)
        else:
            held = Payload(payload, self.tool.translation, joint=self.tool_joint)
        wrench = None
        if tool_force is not None:
            force = ca.mtimes(SX(self.tool.rotation), SX(tool_force))
            wrench = Wrench(force, SX.zeros(3), self.tool.translation, self.tool_joint)
        tau = inverse_dynamics(self.model, s, rate, rate2, payload=held, tool_wrench=wrench)
        effort = ca.mtimes(jacobian.T, tau)
        rubbing = friction or self.friction
        return effort if rubbing is None else effort + joint_friction(v, *rubbing)

    def tool_pose(self, q: SX) -> tuple[SX, SX]:
        """Rotation ``(3, 3)`` and position ``(3,)`` [m] of the tool frame in the world at q ``(n,)``."""
        zero = SX.zeros(self.size)
        return forward_kinematics(self.model, self._serial(q, zero, zero)[0], self.tool_joint, self.tool)

    def joint_pose(self, q: SX, joint: int) -> tuple[SX, SX]:
        """Rotation ``(3, 3)`` and position ``(3,)`` [m] of a joint's own frame in the world; joint 0 is the world."""
        if joint == 0:
            return SX(np.eye(3)), SX(np.zeros(3))
        zero = SX.zeros(self.size)
        return forward_kinematics(self.model, self._serial(q, zero, zero)[0], joint)

    def poses(self, q: npt.ArrayLike) -> tuple[Array, Array]:
        """Rotations ``(N, 3, 3)`` and positions ``(N, 3)`` [m] of the tool frame at coordinates ``(N, n)``."""
        angles, symbol = np.asarray(q, dtype=float).reshape(-1, self.size), SX.sym("q", self.size)
        function = ca.Function("pose", [symbol], [ca.densify(part) for part in self.tool_pose(symbol)])
        rotation, position = (np.array(part) for part in function.map(len(angles))(angles.T))
        return rotation.reshape(3, -1, 3).swapaxes(0, 1), position.T

    def reaching(self, q: Array, rotation: npt.ArrayLike, position: npt.ArrayLike) -> Array:
        """Coordinates ``(N, B, n)``, NaN where one does not put the tool frame at its pose, to ``REACHED``."""
        turned, place = self.poses(q)
        wanted = np.reshape(rotation, (-1, 1, 3, 3)), np.reshape(position, (-1, 1, 3))
        off = np.abs(turned.reshape(*q.shape[:2], 3, 3) - wanted[0]).max(axis=(2, 3))
        far = np.abs(place.reshape(*q.shape[:2], 3) - wanted[1]).max(axis=2)
        return np.where((np.maximum(off, far) <= REACHED)[..., None], q, np.nan)

    def _serial(self, q: SX, v: SX, a: SX) -> tuple[SX, SX, SX, SX]:
        """(s, J v, J a + dJ/dt v, J)."""
        q, v, a = (column(x, self.size, name) for x, name in ((q, "q"), (v, "v"), (a, "a")))
        if self.actuator_map is None:
            return q, v, a, SX.eye(self.size)
        x, dx, ddx = (SX.sym(name, self.size) for name in ("x", "dx", "ddx"))
        s = self.actuator_map.position(x)
        jacobian = ca.jacobian(s, x)
        rate = ca.mtimes(jacobian, dx)
        rate2 = ca.mtimes(jacobian, ddx) + ca.jtimes(rate, x, dx)
        s, rate, rate2, jacobian = ca.Function("serial", [x, dx, ddx], [s, rate, rate2, jacobian]).call([q, v, a])
        return s, rate, rate2, jacobian

    @classmethod
    def from_urdf(
        cls,
        source: str | Path,
        *,
        limits: JointLimits | None = None,
        file_limits: bool = True,
        tool_frame: str | None = None,
        locked: Mapping[str, float] | None = None,
        gravity: npt.ArrayLike = (0.0, 0.0, -9.81),
    ) -> Self:
        """Robot of a URDF: its joints, inertias and limits (position, velocity, effort); friction is left out.

        A continuous joint is a revolute one without limits on its position; a mimic joint has to be locked.

        Args:
            source: path of a file, or the XML itself (it begins with "<").
            limits: override the file's, field by field; needed where it says nothing (0, or between 0 and 0).
            file_limits: whether the file's limits count at all.
            tool_frame: name of a link or frame of the file; ``None`` for the last joint's frame.
            locked: joints to fix, at a coordinate [m or rad] (a gripper's fingers, say).
            gravity: in the world [m/s^2].
        """
        text, origin = urdf_text(source)
        model = urdf_model(text, origin, locked or {})
        if model.nv == 0:
            raise RobotDefinitionError(f"nothing moves in {origin}: all of its joints are fixed or locked")
        _set_gravity(model, gravity)
        tool, tool_joint = pin.SE3.Identity(), None
        if tool_frame is not None:
            moving = (frame for frame in model.frames if frame.parentJoint > 0)
            # A link and a joint may have one name: the link's comes last, and counts.
            frames = {frame.name: frame for frame in sorted(moving, key=lambda f: f.type == pin.FrameType.BODY)}
            if tool_frame not in frames:
                like = nearest(tool_frame, frames)
                raise RobotDefinitionError(
                    f"{tool_frame!r} is no frame that moves in {origin}{like}; those are {', '.join(sorted(frames))}"
                )
            tool, tool_joint = frames[tool_frame].placement, int(frames[tool_frame].parentJoint)
        units, given = _units(model), limits or JointLimits()
        bounds = urdf_limits(model, origin, given) if file_limits else given
        return cls(model, tuple(model.names)[1:], units, bounds, tool, None, tool_joint)

    @classmethod
    def from_description(
        cls,
        name: str,
        *,
        limits: JointLimits | None = None,
        file_limits: bool = True,
        tool_frame: str | None = None,
        locked: Mapping[str, float] | None = None,
        gravity: npt.ArrayLike = (0.0, 0.0, -9.81),
    ) -> Self:
        """Robot of the package ``example-robot-data`` by name, such as "ur5" or "panda"; see `from_urdf`."""
        return cls.from_urdf(
            description_urdf(name), limits=limits, file_limits=file_limits, tool_frame=tool_frame, locked=locked,
            gravity=gravity,
        )  # fmt: skip

    @classmethod
    def from_dh(
        cls,
        rows: Sequence[DHRow],
        inertias: Sequence[LinkInertia | None],
        *,
        convention: str = "standard",
        prefix: Sequence[AxisJoint] = (),
        base: pin.SE3 | None = None,
        tool: pin.SE3 | None = None,
        gravity: npt.ArrayLike = (0.0, 0.0, -9.81),
        joints: Sequence[str] | None = None,
        units: Sequence[str] | None = None,
        limits: JointLimits | None = None,
        actuator_map: ActuatorMap | None = None,
        name: str = "robot",
    ) -> Self:
        """Robot of a chain: a fixed base transform, joints given by axes, then Denavit-Hartenberg rows.

        "standard" (distal): link i's frame is Rz(theta) Tz(d) Tx(a) Rx(alpha) from link i - 1's; the joint acts about
        z_{i-1}, before the offsets.  "modified" (Craig): Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta) Tz(d), row i holding
        alpha_{i-1} and a_{i-1}; the joint acts about z_i.

        Args:
            rows: a fixed row moves what follows it; fixed rows at the end belong to the tool frame.
            inertias: one per row, in that row's link frame; ``None`` is massless.
            convention: "standard" or "modified".
            prefix: joints before the rows.
            base: of the first joint in the world.
            tool: tool frame in the last row's frame.
            gravity: in the world [m/s^2].
            joints: labels of the actuators; ``None`` for joint1, joint2, ...
            units: of the actuators; needed with an actuator map.
            limits: of the actuators.
            actuator_map: from actuators to these joints.
            name: of the model.
        """
        if convention not in ("standard", "modified"):
            raise RobotDefinitionError(f"{convention!r} is not a convention; allowed are 'standard' and 'modified'")
        if len(inertias) != len(rows):
            raise RobotDefinitionError(
                f"{len(inertias)} inertias for {len(rows)} rows; give one per row, None if massless"
            )
        chain = Chain(name, base or pin.SE3.Identity())
        for joint in prefix:
            chain.constant(joint.placement)
            chain.joint(joint.kind, joint.axis)
            chain.body(joint.inertia)
        for row, inertia in zip(rows, inertias, strict=True):
            about_z, about_x = screw(2, row.theta, row.d), screw(0, row.alpha, row.a)
            if convention == "modified":
                chain.constant(about_x * about_z)
            if row.kind != "fixed":
                chain.joint(row.kind, (0.0, 0.0, 1.0))
            if convention == "standard":
                chain.constant(about_z * about_x)
            chain.body(inertia)
        model = chain.model
        _set_gravity(model, gravity)
        if units is None:
            if actuator_map is not None:
                raise RobotDefinitionError("units of the actuators are needed with an actuator map")
            units = _units(model)
        labels = tuple(joints) if joints is not None else tuple(f"joint{i + 1}" for i in range(len(units)))
        frame = chain.pending if tool is None else chain.pending * tool
        return cls(model, labels, tuple(units), limits or JointLimits(), frame, actuator_map)


def _set_gravity(model: pin.Model, gravity: npt.ArrayLike) -> None:
    vector = np.array(gravity, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise RobotDefinitionError(f"gravity is {gravity!r}, expected three finite numbers [m/s^2]")
    model.gravity.linear = vector


def _units(model: pin.Model) -> tuple[str, ...]:
    return tuple("rad" if joint_is_revolute(model, i) else "m" for i in range(1, model.njoints))
