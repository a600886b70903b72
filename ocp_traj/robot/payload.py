"""A payload in the tool frame, its mass free or given."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from casadi import SX

from ocp_traj.arrays import Array
from ocp_traj.errors import RobotDefinitionError, quoted
from ocp_traj.robot.dynamics import Payload
from ocp_traj.robot.inertias import inertia_matrix


@dataclass(frozen=True, eq=False)
class ToolPayload:
    """A rigid body held at the tool, in the tool frame.

    Args:
        mass: [kg], a number or SX.
        com: ``(3,)``, centre of mass [m], numbers or SX.
        inertia: about the centre of mass, in the tool frame's axes, as `inertia_matrix` takes it, or SX ``(3, 3)``
            [kg m^2]; it stays the same where the mass is symbolic. Stored as ``(3, 3)``; ``None`` for a point mass.
    """

    mass: Any
    com: Any = (0.0, 0.0, 0.0)
    inertia: Any = None

    def __post_init__(self) -> None:
        """Checks what is no symbol."""
        if not isinstance(self.mass, SX):
            object.__setattr__(self, "mass", _mass(self.mass))
        if not isinstance(self.com, SX):
            object.__setattr__(self, "com", _com(self.com))
        if self.inertia is not None and not isinstance(self.inertia, SX):
            object.__setattr__(self, "inertia", inertia_matrix(self.inertia))

    def at(self, tool: pin.SE3, joint: int | str | None) -> Payload:
        """The same body in the frame of the joint that carries the tool."""
        rotation, inertia = tool.rotation, self.inertia
        if isinstance(inertia, SX):
            inertia = SX(rotation) @ inertia @ SX(rotation.T)
        elif inertia is not None:
            inertia = rotation @ inertia @ rotation.T
        symbolic = isinstance(self.com, SX)
        centre = SX(rotation) @ self.com + SX(tool.translation) if symbolic else tool.act(self.com)
        return Payload(self.mass, centre, inertia, joint)


def _mass(value: Any) -> float:
    try:
        mass = float(value)
    except (TypeError, ValueError):
        mass = np.nan
    if not 0.0 <= mass < np.inf:
        raise RobotDefinitionError(f"a payload's mass is {quoted(value)}, expected a finite number >= 0 [kg]")
    return mass


def _com(value: Any) -> Array:
    try:
        com = np.array(value, dtype=float)
    except (TypeError, ValueError):
        com = np.array(np.nan)
    if com.shape != (3,) or not np.isfinite(com).all():
        raise RobotDefinitionError(f"a payload's com is {quoted(value)}, expected three finite numbers [m]")
    return com
