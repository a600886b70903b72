"""Symbolic inverse dynamics and forward kinematics over the data of a ``pinocchio.Model``.

Recursive Newton-Euler in CasADi SX (Luh, Walker and Paul, 1980; Featherstone (2008), Sect. 5.3).  Two choices keep the
graph small.  Every joint frame is re-aligned by a constant rotation so that its axis is z.  Each link is described by
mass m, first moment h = int r dm = m c and second moment J = int r r^T dm = tr(I_o)/2 1 - I_o about its frame's origin,
so that with S = [dw]x + [w]x [w]x (dw = dw/dt) the inertial force and moment are

    F = m a + S h,        N = h x a + int r x (S r) dm,

linear in (m, h, J): a symbolic payload adds its own (m, h, J).  Scalars are SX or floats in plain lists, so that
constants fold and structural zeros vanish.  Units are SI; tau is [N m] for a revolute, [N] for a prismatic joint.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import pinocchio as pin
from casadi import SX

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, RobotDefinitionError, UnsupportedJoint, nearest, quoted

Vector = list[Any]  # three scalars, SX or float
Matrix = list[Vector]  # three rows

REVOLUTE = ("JointModelRX", "JointModelRY", "JointModelRZ", "JointModelRevoluteUnaligned")
PRISMATIC = ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned")
ROUND_OFF = 1e-14  # [-], relative; smaller entries of rotations, positions and inertias become 0: our choice, 50 ulp


@dataclass(frozen=True, eq=False)
class Payload:
    """A rigid body held by the robot; every entry may be a float or SX.

    Args:
        mass: [kg].
        centre: ``(3,)``, centre of mass in the joint's frame [m].
        inertia: ``(3, 3)``, about its centre, in the axes of the joint's frame [kg m^2]; ``None`` for a point mass.
        joint: index or name of the joint whose link holds it; ``None`` for the last.
    """

    mass: Any
    centre: Any
    inertia: Any = None
    joint: int | str | None = None


class Wrench(NamedTuple):
    """What the robot's link exerts on the outside, in its joint's frame: force [N] at a point [m], and moment [N m]."""

    force: Any
    moment: Any
    point: Any
    joint: int | str | None = None


class Friction(NamedTuple):
    """Arguments of `joint_friction` other than the velocity."""

    coulomb: Any
    viscous: Any
    velocity_scale: Any


def checked_friction(friction: Friction, size: int) -> Friction:
    """The same in numbers ``(size,)`` each, refused where they are none, or negative, or the velocity scale is zero."""
    checked = []
    for name, value in friction._asdict().items():
        try:
            numbers = np.array(value, dtype=float)
        except (TypeError, ValueError):
            numbers = np.array(np.nan)
        sound = (0.0 < numbers if name == "velocity_scale" else 0.0 <= numbers) & np.isfinite(numbers)
        if numbers.shape not in ((), (size,)) or not sound.all():
            least = "> 0" if name == "velocity_scale" else ">= 0"
            raise RobotDefinitionError(
                f"friction's {name} is {quoted(value)}, expected a finite number {least}, or {size} of them"
            )
        checked.append(np.broadcast_to(numbers, (size,)).copy())
    return Friction(*checked)


@dataclass(frozen=True, eq=False)
class _Joint:
    """A joint whose axis is the z axis of its re-aligned frame."""

    parent: int
    column: int  # of q, v, a, tau
    revolute: bool
    axes: Array  # (3, 3), the re-aligned frame's axes in pinocchio's joint frame
    rotation: Matrix  # this frame's axes at q = 0 in the parent's re-aligned frame
    position: Vector  # [m], this frame's origin at q = 0 in the parent's re-aligned frame


def joint_is_revolute(model: pin.Model, index: int) -> bool:
    """True for a revolute joint, False for a prismatic one; any other type raises `UnsupportedJoint`."""
    kind = model.joints[index].shortname()
    if kind not in REVOLUTE + PRISMATIC:
        given, *allowed = (name.removeprefix("JointModel") for name in (kind, *REVOLUTE, *PRISMATIC))
        raise UnsupportedJoint(
            f"joint {model.names[index]!r} of {model.name!r} is a {given}; allowed are {', '.join(allowed)}. "
            "Give a continuous joint limits (URDF type 'revolute'), split a joint of several degrees of freedom into "
            "revolute and prismatic ones, and lock a mimic or unused joint (pinocchio.buildReducedModel)"
        )
    return kind in REVOLUTE


def joint_index(model: pin.Model, joint: int | str | None) -> int:
    """Index of a joint given by index or name; ``None`` is the last joint."""
    index = model.njoints - 1 if joint is None else joint
    if isinstance(index, str):
        index = model.getJointId(index) if model.existJointName(index) else -1
    if not 1 <= index < model.njoints:
        names = list(model.names)[1:]
        raise RobotDefinitionError(
            f"{joint!r} is not a joint of {model.name!r}{nearest(str(joint), names)}; joints are {names}"
        )
    return int(index)


def column(x: Any, size: int, name: str) -> SX:
    """A vector as an SX column, its size checked."""
    vector = SX(x)
    if vector.shape != (size, 1):
        raise InputError(f"{name} has shape {vector.shape}, expected ({size}, 1)")
    return vector


def inverse_dynamics(
    model: pin.Model,
    q: SX,
    v: SX,
    a: SX,
    *,
    payload: Payload | None = None,
    tool_wrench: Wrench | tuple[Any, Any, Any] | None = None,
    gravity: Any = None,
) -> SX:
    """Joint forces and torques that give the motion: tau = M(q) a + c(q, v) + g(q) + armature a, as ``pinocchio.rnea``.

    Friction, damping and rotor fields of the model are not used, as in pinocchio; see `joint_friction`.

    Args:
        model: trees of revolute and prismatic joints.
        q: ``(nv,)``, [rad or m].
        v: ``(nv,)``, [rad/s or m/s].
        a: ``(nv,)``, [rad/s^2 or m/s^2].
        payload: a body added to a link.
        tool_wrench: exerted by the last (or the named) joint's link on the outside, in that joint's frame.
        gravity: ``(3,)``, in the world [m/s^2]; ``None`` for the model's.

    Returns:
        ``(nv,)``, [N m or N].
    """
    joints = aligned_joints(model)
    q, v, a = (column(x, model.nv, name) for x, name in ((q, "q"), (v, "v"), (a, "a")))
    force, moment = {}, {}  # on each link, about and in its frame
    turns = [(ca.cos(q[joint.column]), ca.sin(q[joint.column])) for joint in joints[1:]]
    still: Vector = [0.0, 0.0, 0.0]
    lift = [-g for g in _vector(model.gravity.linear if gravity is None else gravity, 3, "gravity")]
    states: list[Any] = [(still, still, lift, [still, still, still])]  # of the universe: w, dw, a, S
    for i, joint in enumerate(joints[1:], start=1):
        k = joint.column
        states.append(_outward(joint, q[k], v[k], a[k], turns[i - 1], states[joint.parent]))
        _, _, acceleration, s = states[i]
        mass, h, second = _mass_moments(model, i, joint.axes, payload)
        force[i] = _add([mass * x for x in acceleration], _times(s, h))
        moment[i] = _add(_cross(h, acceleration), _spin_moment(second, s))
    if tool_wrench is not None:
        wrench = Wrench(*tool_wrench)
        i = joint_index(model, wrench.joint)
        f, n, point = (_realigned(joints[i].axes, _vector(x, 3, "tool_wrench")) for x in wrench[:3])
        force[i], moment[i] = _add(force[i], f), _add(moment[i], n, _cross(point, f))

    tau: Vector = [0.0] * model.nv
    for i in range(model.njoints - 1, 0, -1):
        joint, f, n = joints[i], force[i], moment[i]
        k = joint.column
        tau[k] = (n[2] if joint.revolute else f[2]) + float(model.armature[k]) * a[k]
        if joint.parent > 0:
            if joint.revolute:
                f, n = _turn_z(turns[i - 1], f), _turn_z(turns[i - 1], n)
            else:
                n = _add(n, _cross([0.0, 0.0, q[k]], f))
            f, n = _times(joint.rotation, f), _times(joint.rotation, n)
            force[joint.parent] = _add(force[joint.parent], f)
            moment[joint.parent] = _add(moment[joint.parent], n, _cross(joint.position, f))
    return _stack(tau)


def joint_friction(v: SX, coulomb: Any, viscous: Any, velocity_scale: Any) -> SX:
    """Smooth friction to add to tau: coulomb tanh(v / velocity_scale) + viscous v.

    Args:
        v: ``(n,)``, [rad/s or m/s].
        coulomb: ``(n,)`` or scalar, [N m or N].
        viscous: ``(n,)`` or scalar, [N m s/rad or N s/m].
        velocity_scale: ``(n,)`` or scalar > 0, [rad/s or m/s]; the Coulomb part is 76 % of its full value there.

    Returns:
        ``(n,)``, [N m or N].
    """
    speed = SX(v)
    for name, x in (("coulomb", coulomb), ("viscous", viscous), ("velocity_scale", velocity_scale)):
        if SX(x).shape not in ((1, 1), speed.shape):
            raise InputError(f"{name} has shape {SX(x).shape}, expected a scalar or {speed.shape}")
    scale = SX(velocity_scale)
    if scale.is_constant() and not np.all(np.asarray(ca.DM(scale)) > 0.0):
        raise InputError(f"velocity_scale is {velocity_scale}, expected > 0")
    return SX(coulomb) * ca.tanh(speed / scale) + SX(viscous) * speed


def forward_kinematics(
    model: pin.Model, q: SX, joint: int | str | None = None, placement: pin.SE3 | None = None
) -> tuple[SX, SX]:
    """Rotation and position in the world of a frame fixed to a joint's link.

    Args:
        model: trees of revolute and prismatic joints.
        q: ``(nv,)``, [rad or m].
        joint: index or name; ``None`` for the last.
        placement: of the frame in pinocchio's joint frame; ``None`` for that frame itself.

    Returns:
        rotation ``(3, 3)``, whose columns are the frame's axes; position ``(3,)`` of its origin [m].
    """
    joints = aligned_joints(model)
    q = column(q, model.nv, "q")
    i = joint_index(model, joint)
    frame = pin.SE3.Identity() if placement is None else placement
    to_aligned = joints[i].axes.T
    position = _tidy(to_aligned @ frame.translation)
    columns = [_tidy(axis) for axis in (to_aligned @ frame.rotation).T]
    while i > 0:
        link = joints[i]
        if link.revolute:
            turn = ca.cos(q[link.column]), ca.sin(q[link.column])
            columns = [_turn_z(turn, axis) for axis in columns]
            position = _turn_z(turn, position)
        else:
            position = _add(position, [0.0, 0.0, q[link.column]])
        columns = [_times(link.rotation, axis) for axis in columns]
        position = _add(_times(link.rotation, position), link.position)
        i = link.parent
    return _stack([x for axis in columns for x in axis]).reshape((3, 3)), _stack(position)


def aligned_joints(model: pin.Model) -> list[_Joint]:
    """The model's joints, each with its axis along z; the first entry is the universe."""
    joints = [_Joint(0, -1, True, np.eye(3), [], [])]
    data = model.createData()
    for i in range(1, model.njoints):
        revolute = joint_is_revolute(model, i)
        subspace = np.asarray(data.joints[i].S, dtype=float).reshape(6)  # linear part first
        axis = subspace[3:] if revolute else subspace[:3]
        if not abs(np.linalg.norm(axis) - 1.0) < 1e-9:  # [-], NaN included: our choice
            raise RobotDefinitionError(f"joint {model.names[i]!r} has the axis {axis.tolist()}, expected a unit vector")
        parent = int(model.parents[i])
        to_parent = joints[parent].axes.T
        axes = _axes_with_z_along(axis)
        placement = model.jointPlacements[i]
        rotation = [_tidy(row) for row in to_parent @ placement.rotation @ axes]
        position = _tidy(to_parent @ placement.translation)
        joints.append(_Joint(parent, int(model.joints[i].idx_v), revolute, axes, rotation, position))
    return joints


def _axes_with_z_along(axis: Array) -> Array:
    """Rotation matrix whose third column is the axis; a cyclic permutation where the axis is x, y or z."""
    x = np.eye(3)[(int(np.argmax(np.abs(axis))) + 1) % 3]
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(axis, x), axis))


def _outward(
    joint: _Joint, q: Any, v: Any, a: Any, turn: tuple[Any, Any], parent_state: Any
) -> tuple[Vector, Vector, Vector, Matrix]:
    """(w, dw, a, S) of a link in its frame: angular velocity, its rate, acceleration of the origin less gravity."""
    w, dw, origin, s = parent_state
    back = [list(row) for row in zip(*joint.rotation, strict=True)]
    w, dw, origin = (_times(back, x) for x in (w, dw, _add(origin, _times(s, joint.position))))
    if joint.revolute:
        w, dw, origin = (_turn_z_back(turn, x) for x in (w, dw, origin))
        w, dw = [w[0], w[1], w[2] + v], [dw[0] + w[1] * v, dw[1] - w[0] * v, dw[2] + a]
    squares = [x * x for x in w]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    s = [
        [-(squares[1] + squares[2]), xy - dw[2], xz + dw[1]],
        [xy + dw[2], -(squares[0] + squares[2]), yz - dw[0]],
        [xz - dw[1], yz + dw[0], -(squares[0] + squares[1])],
    ]
    if not joint.revolute:
        twice = 2.0 * v
        origin = _add(origin, [row[2] * q for row in s], [w[1] * twice, -(w[0] * twice), a])
    return w, dw, origin, s


def _mass_moments(model: pin.Model, index: int, axes: Array, payload: Payload | None) -> tuple[Any, Vector, Matrix]:
    """(m, h, J) of a link about its re-aligned frame's origin, payload included: [kg], [kg m], [kg m^2]."""
    inertia = model.inertias[index]
    centre = axes.T @ inertia.lever
    mass: Any = float(inertia.mass)
    second = axes.T @ _second_moment(inertia.inertia) @ axes + mass * np.outer(centre, centre)
    h = _tidy(mass * centre)
    entries = _tidy(second.ravel())
    rows: Matrix = [entries[0:3], entries[3:6], entries[6:9]]
    if payload is None or joint_index(model, payload.joint) != index:
        return mass, h, rows
    added = payload.mass
    c = _realigned(axes, _vector(payload.centre, 3, "payload.centre"))
    if payload.inertia is not None:
        own = SX(payload.inertia)
        if own.shape != (3, 3):
            raise InputError(f"payload.inertia has shape {own.shape}, expected (3, 3)")
        own = SX(axes.T) @ _second_moment(own) @ SX(axes)
        rows = [[rows[i][j] + own[i, j] for j in range(3)] for i in range(3)]
    rows = [[rows[i][j] + added * c[i] * c[j] for j in range(3)] for i in range(3)]
    return mass + added, _add(h, [added * x for x in c]), rows


def _second_moment(inertia: Any) -> Any:
    """J = tr(I)/2 1 - I, the same point and axes [kg m^2]."""
    return np.eye(3) * ((inertia[0, 0] + inertia[1, 1] + inertia[2, 2]) / 2.0) - inertia


def _spin_moment(second: Matrix, s: Matrix) -> Vector:
    """Int r x (S r) dm [N m]: component x is sum_k J_yk S_zk - J_zk S_yk, J symmetric, and so on cyclically."""
    moment = []
    for x, y, z in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        j, k = second[y], second[z]
        moment.append(j[x] * s[z][x] - k[x] * s[y][x] + j[y] * s[z][y] - k[z] * s[y][z] + j[z] * (s[z][z] - s[y][y]))
    return moment


def _vector(x: Any, size: int, name: str) -> Vector:
    checked = column(x, size, name)
    return [checked[i] for i in range(size)]


def _stack(entries: Vector) -> SX:
    """A dense column."""
    return SX(ca.densify(ca.vertcat(*(SX(x) for x in entries))))


def _tidy(x: Array) -> Vector:
    """Floats; round-off about 0 (relative to the largest entry) and about -1 and 1 is removed, so that they fold."""
    x = np.where(np.abs(x) < ROUND_OFF * np.max(np.abs(x)), 0.0, x)
    return [float(e) for e in np.where(np.abs(np.abs(x) - 1.0) < ROUND_OFF, np.sign(x), x)]


def _realigned(axes: Array, x: Sequence[Any]) -> Vector:
    """A vector of pinocchio's joint frame in the re-aligned one."""
    return _times([_tidy(row) for row in axes.T], x)


def _turn_z(turn: tuple[Any, Any], x: Vector) -> Vector:
    c, s = turn
    return [c * x[0] - s * x[1], s * x[0] + c * x[1], x[2]]


def _turn_z_back(turn: tuple[Any, Any], x: Vector) -> Vector:
    c, s = turn
    return [c * x[0] + s * x[1], c * x[1] - s * x[0], x[2]]


def _times(matrix: Sequence[Vector], x: Sequence[Any]) -> Vector:
    return [row[0] * x[0] + row[1] * x[1] + row[2] * x[2] for row in matrix]


def _cross(x: Sequence[Any], y: Sequence[Any]) -> Vector:
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]


def _add(*vectors: Sequence[Any]) -> Vector:
    return [sum(entries[1:], start=entries[0]) for entries in zip(*vectors, strict=True)]
