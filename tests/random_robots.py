"""Seeded random robots, shared by the tests."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.robot.dynamics import joint_is_revolute
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

ALIGNED = {
    "revolute": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
    "prismatic": (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
}
UNALIGNED = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}


def random_placement(rng: np.random.Generator) -> pin.SE3:
    """A uniformly random rotation, and a translation of some 0.3 m."""
    quaternion = rng.normal(size=4)
    return pin.SE3(pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix(), 0.3 * rng.normal(size=3))


def random_inertia(rng: np.random.Generator) -> pin.Inertia:
    """The inertia of a cloud of 20 points, 0.5 to 5 kg."""
    mass = rng.uniform(0.5, 5.0)
    points = 0.1 * rng.normal(size=(20, 3))
    second = mass * np.cov(points.T)
    return pin.Inertia(mass, 0.2 * rng.normal(size=3), np.trace(second) * np.eye(3) - second)


def random_model(
    rng: np.random.Generator,
    joints: int,
    *,
    kinds: Sequence[str] = ("revolute", "prismatic"),
    aligned: bool | None = None,
    branching: bool = False,
) -> pin.Model:
    """A model with random placements, inertias, armature and gravity.

    Args:
        rng: its state decides everything.
        joints: their number.
        kinds: drawn from for each joint.
        aligned: axes along x, y or z (True), any axes (False), or a mix of both (None).
        branching: hang each joint on one of the last three (or the world), not always on the last.
    """
    model = pin.Model()
    model.name = "random"
    for i in range(joints):
        kind = kinds[int(rng.integers(len(kinds)))]
        along = bool(rng.integers(2)) if aligned is None else aligned
        axis = rng.normal(size=3)
        joint = ALIGNED[kind][rng.integers(3)]() if along else UNALIGNED[kind](axis / np.linalg.norm(axis))
        parent = int(rng.integers(max(0, i - 2), i + 1)) if branching else i
        index = model.addJoint(parent, joint, random_placement(rng), f"joint{i + 1}")
        model.appendBodyToJoint(index, random_inertia(rng), pin.SE3.Identity())
    model.armature = rng.uniform(0.0, 0.5, size=joints)
    model.gravity.linear = rng.normal(scale=6.0, size=3)
    return model


def random_states(rng: np.random.Generator, size: int, count: int) -> tuple[Array, Array, Array]:
    """Coordinates q within +-3, v and a within some +-3 and +-6, each ``(size, count)``."""
    q = rng.uniform(-3.0, 3.0, size=(size, count))
    return q, rng.normal(size=(size, count)), 2.0 * rng.normal(size=(size, count))


def random_robot(rng: np.random.Generator, joints: int) -> Robot:
    """A chain of random joints with limits on everything and a random tool."""
    model = random_model(rng, joints)
    middle = rng.uniform(-1.0, 1.0, size=joints)
    symmetric = {
        name: rng.uniform(low, 3.0 * low, size=joints)
        for name, low in (("velocity", 1.0), ("acceleration", 5.0), ("jerk", 50.0), ("snap", 1e3), ("effort", 100.0))
    }
    return Robot(
        model=model,
        joints=tuple(model.names)[1:],
        units=tuple("rad" if joint_is_revolute(model, i) else "m" for i in range(1, model.njoints)),
        limits=JointLimits(position=(middle - 2.0, middle + 2.0), **symmetric),
        tool=random_placement(rng),
    )
