"""A serial chain from its geometry: joints given by axes or by Denavit-Hartenberg rows become a ``pinocchio.Model``."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from ocp_traj.errors import RobotDefinitionError, UnsupportedJoint, quoted
from ocp_traj.robot.inertias import inertia_matrix


@dataclass(frozen=True, eq=False)
class LinkInertia:
    """Mass [kg], centre of mass ``(3,)`` [m] and inertia about it [kg m^2], in the link frame's axes.

    The inertia is given as `inertia_matrix` takes it, and stored as ``(3, 3)``.
    """

    mass: float
    centre: Any = (0.0, 0.0, 0.0)
    inertia: Any = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        """Check and store as arrays."""
        try:
            centre = np.array(self.centre, dtype=float)
        except (TypeError, ValueError):
            centre = np.array(np.nan)
        if not 0.0 <= self.mass < np.inf:
            raise RobotDefinitionError(f"a link's mass is {self.mass} kg, expected finite and >= 0")
        if centre.shape != (3,) or not np.isfinite(centre).all():
            raise RobotDefinitionError(f"a link has centre {quoted(self.centre)}, expected three finite numbers [m]")
        object.__setattr__(self, "centre", centre)
        object.__setattr__(self, "inertia", inertia_matrix(self.inertia))


@dataclass(frozen=True)
class DHRow:
    """Denavit-Hartenberg constants; the joint's coordinate adds to theta (revolute) or d (prismatic).  [rad], [m]."""

    theta: float = 0.0
    d: float = 0.0
    a: float = 0.0
    alpha: float = 0.0
    kind: str = "revolute"  # or "prismatic", "fixed"


@dataclass(frozen=True, eq=False)
class AxisJoint:
    """A joint given by its placement in the previous joint's frame and its axis in its own; see `Robot.from_dh`."""

    kind: str  # "revolute" or "prismatic"
    axis: Any = (0.0, 0.0, 1.0)
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    inertia: LinkInertia | None = None  # in the joint's moving frame; None is massless


class Chain:
    """A model under construction; `pending` is the current frame in the last joint's moving frame."""

    def __init__(self, name: str, base: pin.SE3) -> None:
        self.model, self.last, self.pending = pin.Model(), 0, base
        self.model.name = name

    def constant(self, transform: pin.SE3) -> None:
        """Moves the current frame."""
        self.pending = self.pending * transform

    def joint(self, kind: str, axis: Any) -> None:
        """Adds a joint about or along an axis of the current frame, which then moves with it."""
        direction = np.array(axis, dtype=float)
        types = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
        if kind not in types:
            raise UnsupportedJoint(
                f"joint {self.model.njoints} is {kind!r}; allowed are 'revolute', 'prismatic' and, for a row, 'fixed'"
            )
        if direction.shape != (3,) or not 0.0 < np.linalg.norm(direction) < np.inf:
            raise RobotDefinitionError(
                f"axis of joint {self.model.njoints} is {axis}, expected three numbers, not all 0"
            )
        model = types[kind](direction / np.linalg.norm(direction))
        self.last = self.model.addJoint(self.last, model, self.pending, f"joint{self.model.njoints}")
        self.model.addJointFrame(self.last)  # pinocchio's own functions expect a frame for every joint
        self.pending = pin.SE3.Identity()

    def body(self, inertia: LinkInertia | None) -> None:
        """Hangs a link on the last joint, in the current frame; one fixed to the world does not matter."""
        if inertia is not None and self.last > 0:
            body = pin.Inertia(float(inertia.mass), inertia.centre, inertia.inertia)
            self.model.appendBodyToJoint(self.last, body, self.pending)


def screw(axis: int, angle: float, length: float) -> pin.SE3:
    """Rotation about x (0) or z (2) by an angle [rad] and translation along it by a length [m]."""
    if not np.isfinite([angle, length]).all():
        raise RobotDefinitionError(f"a DH row has an angle {angle} rad and a length {length} m, expected finite ones")
    return pin.SE3(pin.utils.rotate("xyz"[axis], float(angle)), float(length) * np.eye(3)[axis])
