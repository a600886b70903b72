"""The four papers' robots, built joint by joint from their tables with pinocchio alone."""

from math import pi, sqrt
from typing import Protocol

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from ocp_traj.problems import kr90

Array = npt.NDArray[np.float64]


class Machine(Protocol):
    """A robot as these tests need it."""

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """Efforts of the actuators ``(n,)`` at one instant."""


def efforts(machine: Machine, q: Array, v: Array, a: Array) -> Array:
    """Efforts at many instants, ``(N, n)`` from ``(N, n)`` each."""
    return np.array([machine.effort(*state) for state in zip(q, v, a, strict=True)])


def place(x: float, y: float, z: float) -> pin.SE3:
    """A translation."""
    return pin.SE3(np.eye(3), np.array([x, y, z], dtype=float))


def turn(axis: str, angle: float) -> pin.SE3:
    """A rotation about an axis of the frame."""
    return pin.SE3(pin.utils.rotate(axis, angle), np.zeros(3))


def point_mass(mass: float) -> pin.Inertia:
    """A payload."""
    return pin.Inertia(float(mass), np.zeros(3), np.zeros((3, 3)))


# --- the hybrid robot of Guo et al. (2016) ---

G = 9.80665  # [m/s^2], below (42)
L1, L2, L3, L4, L5, L01 = 0.420, 0.050, 0.450, 0.180, 0.180, 0.400  # [m], Table 1
LP = 0.225 - (0.180 + sqrt(2.0) * 0.080)  # [m], (8)
# Table 4: mass [kg]; Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass [kg mm^2]; centre of mass [mm].
LINKS = (
    (83.025, (5095170.782, 3291706.841, 2367692.766, -61.008, 1019.065, -15.858), (0.0, 0.0, -44.182)),
    (21.333, (1475990.573, 2366543.574, 911968.216, -3970.014, -748196.633, -8327.223), (-304.563, -1.306, -278.925)),
    (8.022, (142265.977, 45016.139, 109393.601, -0.114, 0.002, 46002.096), (0.0, -63.686, -468.138)),
    (9.120, (119573.680, 36160.108, 94076.578, 27.342, -0.849, -18452.465), (0.0, -52.909, -261.241)),
)


class HybridRobot:
    """The serial model built joint by joint from Tables 1, 3 and 4, and the actuator map (90), (92) written out.

    Args:
        payload: point mass at the tool [kg].
        literal: the payload pulls along the tool's own z axis instead, as the paper's numbers have it (eq. 73).
    """

    def __init__(self, payload: float = 10.0, *, literal: bool = False) -> None:
        link = [
            pin.SE3.Identity(),
            place(L3, 0.0, L01),
            turn("z", -pi / 2) * place(0.0, 0.0, L2 + L4 + sqrt(2.0) * L5) * turn("x", pi / 4),
            turn("z", pi) * turn("x", pi / 4),
        ]  # frames of Table 3 in their joints' frames
        self.tool = link[3] * place(0.0, 0.0, LP)
        model = pin.Model()
        model.gravity.linear = np.array([0.0, 0.0, G])  # Z0 points down
        joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "d1")
        for i, (kind, frame) in enumerate(
            zip((pin.JointModelRZ, pin.JointModelPZ, pin.JointModelRZ, pin.JointModelRZ), link, strict=True)
        ):
            joint = model.addJoint(joint, kind(), pin.SE3.Identity() if i < 2 else link[i - 1], f"joint{i}")
            mass, (xx, yy, zz, xy, xz, yz), centre = LINKS[i]
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) * 1e-6
            model.appendBodyToJoint(joint, pin.Inertia(mass, np.array(centre) * 1e-3, inertia), frame)
        self.pull = pin.Force.Zero()
        if literal:
            force = payload * G * self.tool.rotation[:, 2]
            self.pull = pin.Force(force, np.cross(self.tool.translation, force))
        else:
            model.appendBodyToJoint(joint, point_mass(payload), self.tool)
        self.model, self.data = model, model.createData()

    @staticmethod
    def serial(q: Array) -> Array:
        """Serial coordinates d1, alpha, X_S3, phi4, phi5."""
        return np.array([(q[0] + q[1]) / 2, np.arctan((q[1] - q[0]) / L1), q[2], q[3], q[4]])

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """Actuator efforts J^T tau, (110)."""
        w, dw, ddw = ((x[1] - x[0]) / L1 for x in (q, v, a))
        slope = 1.0 / (1.0 + w**2)
        rate = np.array([(v[0] + v[1]) / 2, slope * dw, *v[2:]])
        rate2 = np.array([(a[0] + a[1]) / 2, slope * ddw - 2.0 * w * (slope * dw) ** 2, *a[2:]])
        forces = [pin.Force.Zero() for _ in range(5)] + [self.pull]
        tau = pin.rnea(self.model, self.data, self.serial(q), rate, rate2, forces)
        jacobian = np.eye(5)
        jacobian[:2, :2] = [[0.5, 0.5], [-slope / L1, slope / L1]]
        return np.asarray(jacobian.T @ tau)

    def tool_pose(self, q: Array) -> tuple[Array, Array]:
        """Rotation and position [m] of the tool frame."""
        pin.forwardKinematics(self.model, self.data, self.serial(q))
        pose = self.data.oMi[5] * self.tool
        return pose.rotation, pose.translation


# --- the arm of Zhu and Wang: the maker's description ---

# Placement [m], axis, mass [kg], centre [m], xx xy xz yy yz zz [kg m2].
MAKER = (
    ((0, 0, 0.45), (0, 0, 1), 25.1, (0.0385, -0.0176, -0.0359), (0.285, -0.0106, -0.0157, 0.242, -0.00898, 0.336)),
    ((0.075, 0, 0), (0, 1, 0), 33.5, (-0.0227, -0.151, 0.402), (2.3, -0.0223, 0.0191, 2.33, -0.0412, 0.152)),
    ((0, 0, 0.84), (0, -1, 0), 54.5, (0.242, 0.0064, 0.116), (0.693, -0.0249, -0.368, 2.13, -0.035, 2.1)),
    ((0, 0, 0.195), (-1, 0, 0), 17.5, (0.678, -0.0311, -0.000832), (0.0509, 0.0696, 0.000437, 0.9, -0.000433, 0.915)),
    ((1.1, 0, 0), (0, -1, 0), 1.16, (0.0214, -0.015, 0), (0.00173, -0.000392, 0, 0.00191, 0, 0.00189)),
    ((0, 0, 0), (-1, 0, 0), 0.224, (0.0537, 0, 0), (0.000131, 0, 0, 0.000102, 0, 0.000102)),
)


class RotorRobot:
    """Gravity -9.81 m/s^2 along z; the pendant's joint 3 is from the horizontal, so actuator 2 feels joint 3 too."""

    couple = np.eye(6) + np.eye(6)[[2]].T @ np.eye(6)[[1]]  # serial joint 3 is J2 + J3

    def __init__(self, payload: float = 0.0) -> None:
        model, joint = pin.Model(), 0
        for where, axis, mass, centre, (xx, xy, xz, yy, yz, zz) in MAKER:
            kind = pin.JointModelRevoluteUnaligned(np.array(axis, dtype=float))
            joint = model.addJoint(joint, kind, place(*where), f"J{model.njoints}")
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            body = pin.Inertia(mass, np.array(centre, dtype=float), inertia)
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        model.appendBodyToJoint(joint, point_mass(payload), place(0.075, 0.0, 0.0))
        self.model, self.data = model, model.createData()

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """Virtual work: the transposed coupling of the serial torques."""
        return np.asarray(self.couple.T @ pin.rnea(self.model, self.data, *(self.couple @ x for x in (q, v, a))))


# --- the wrist of El Haiek et al. (2019): our choice ---


class WristRobot:
    """Cylinders of 1.2 and 0.8 kg, a rod of 0.25 kg and 0.30 kg at its tip; 0.1 m a length unit of ``d3``."""

    def __init__(self, d3: float = 2.0) -> None:
        length = 0.1 * d3
        rod = place(0.0, 0.0, length / 2.0).act(pin.Inertia.FromCylinder(0.25, 0.02, length))
        third = rod + pin.Inertia(0.30, np.array([0.0, 0.0, length]), np.zeros((3, 3)))
        bodies = (pin.Inertia.FromCylinder(1.2, 0.05, 0.1), pin.Inertia.FromCylinder(0.8, 0.04, 0.08), third)
        model, joint = pin.Model(), 0
        for kind, body in zip((pin.JointModelRZ, pin.JointModelRY, pin.JointModelRZ), bodies, strict=True):
            joint = model.addJoint(joint, kind(), pin.SE3.Identity(), f"joint{joint}")
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        model.gravity.linear = np.array([0.0, 0.0, -9.81])
        self.model, self.data = model, model.createData()

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """Joint torques."""
        return np.array(pin.rnea(self.model, self.data, q, v, a))


# --- the stand-in for the KR90: the tables of its module ---


class WeldRobot:
    """The arm on its riser, torch and payload at the flange, with friction.

    Args:
        payload: point mass at the flange [kg].
        riser: [m].
        bare: without torch and payload.
    """

    def __init__(self, payload: float = 0.0, riser: float = 0.0, *, bare: bool = False) -> None:
        model = pin.Model()
        for i, ((angles, where), (mass, centre, moments, axes)) in enumerate(
            zip(kr90.PLACEMENTS, kr90.LINKS, strict=True)
        ):
            at = pin.SE3(pin.rpy.rpyToMatrix(*angles), np.array(where))
            model.addJoint(i, pin.JointModelRZ(), place(0.0, 0.0, riser) * at if i == 0 else at, f"A{i + 1}")
            principal = pin.rpy.rpyToMatrix(*axes)
            body = pin.Inertia(mass, np.array(centre), principal @ np.diag(moments) @ principal.T)
            model.appendBodyToJoint(i + 1, body, pin.SE3.Identity())
        flange = pin.SE3(pin.rpy.rpyToMatrix(*kr90.FLANGE[0]), np.array(kr90.FLANGE[1]))
        if not bare:
            mass, centre, moments = kr90.TORCH
            model.appendBodyToJoint(6, pin.Inertia(mass, np.array(centre), np.diag(moments)), flange)
            model.appendBodyToJoint(6, point_mass(payload), flange)
        (where, tilt), self.flange = kr90.TIP, flange
        self.tool = flange * place(*where) * turn("y", np.radians(tilt))
        self.model, self.data = model, model.createData()

    def effort(self, q: Array, v: Array, a: Array) -> Array:
        """Torques, with Coulomb friction, smoothed, and viscous friction."""
        strongest, fastest = np.array(kr90.EFFORT), np.radians(kr90.VELOCITY)
        friction = kr90.COULOMB * np.tanh(v / (kr90.CREEP * fastest)) + kr90.VISCOUS * v / fastest
        return np.asarray(pin.rnea(self.model, self.data, q, v, a) + strongest * friction)

    def tip(self, q: Array) -> pin.SE3:
        """The torch's tip in the world."""
        pin.forwardKinematics(self.model, self.data, q)
        return self.data.oMi[6] * self.tool

    def tips(self, q: Array) -> tuple[Array, Array]:
        """Places ``(N, 3)`` [m] and axes ``(N, 3)`` of the torch at postures ``(N, 6)``."""
        poses = [self.tip(posture) for posture in q]
        return np.array([pose.translation for pose in poses]), np.array([pose.rotation[:, 2] for pose in poses])
