"""Tags: inner points of a nonic curve whose derivatives, and positions where they are free, are decision variables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.families import at_rest
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.problem import Variable
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.robot.joint_limits import QUANTITIES, JointLimits


@dataclass(frozen=True, eq=False)
class Tags:
    """States (q, v, a, jerk, snap) at tags from variables, the k-th derivative times ``unit`` to the power k.

    So all variables are of the size of angles, whatever the time between tags.

    Attributes:
        positions: of each tag by its name ``(dof,)``, None where it is free.
        limits: of position to snap, which bound the variables.
        joints: one name a joint.
        unit: about the time between tags [s].
        rest: whether all derivatives vanish at the tags, which then have a position each.
    """

    positions: Mapping[str, Array | None]
    limits: JointLimits
    joints: Sequence[str]
    unit: float
    rest: bool = False

    def __post_init__(self) -> None:
        """Checks that tags at rest are somewhere, and that there are bounds."""
        free = [tag for tag, q in self.positions.items() if q is None]
        if self.rest and free:
            raise ProblemDefinitionError(f"tags {', '.join(free)} rest at no position; give one")
        missing = {ORDERS[k]: None for _, k in self.blocks if self.limits.bounds(k) is None}
        if missing:
            raise ProblemDefinitionError(f"tags need limits of {', '.join(missing)}, which bound their variables")

    @property
    def blocks(self) -> list[tuple[str, int]]:
        """Tag and order of each block of variables."""
        return [(t, k) for t, q in self.positions.items() for k in range(q is not None, 5) if not self.rest]

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.blocks) * len(self.joints)

    def variables(self, unit: str, eq: str = "") -> tuple[Variable, ...]:
        """A block a tag and order, in the joints' unit."""
        found = []
        for tag, k in self.blocks:
            labels = tuple(f"{tag} {ORDERS[k]} {joint}" for joint in self.joints)
            low, high = np.array(self.limits.bounds(k)) * self.unit**k
            limits = tuple((f"{QUANTITIES[k]}-limit", joint) for joint in self.joints)
            found.append(Variable(f"{ORDERS[k]} at {tag}", low, high, unit, labels, eq, bounded_by=limits))
        return tuple(found)

    def states(self, x: Any) -> list[Any]:
        """State ``(5, dof)`` at each tag, symbolic, of the variables ``(n,)`` in their order and whatever follows."""
        rows: dict[str, list[Any]] = {tag: [] if q is None else [casadi.SX(q).T] for tag, q in self.positions.items()}
        n = len(self.joints)
        for i, (tag, k) in enumerate(self.blocks):
            rows[tag].append(x[n * i : n * (i + 1)].T * self.unit**-k)
        still = [casadi.SX(at_rest(q)) for q in self.positions.values() if q is not None]
        return still if self.rest else [casadi.vertcat(*r) for r in rows.values()]

    def dilate(self, x: Array, s: float) -> Array:
        """The variables ``(n,)``, and the durations that follow, of the same path s times slower."""
        powers = np.repeat([float(s) ** k for _, k in self.blocks], len(self.joints))
        return np.concatenate([x[: self.size] / powers, s * x[self.size :]])
