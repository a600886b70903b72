"""A motion: a numeric curve of named joints with the parameters its limits depend on. All that a proof looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import ProblemDefinitionError

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("q", "v", "a", "jerk", "snap")


@dataclass(frozen=True, eq=False)
class Motion:
    """A timed motion of named joints.

    Attributes:
        curve: numeric, joint coordinates in SI over seconds.
        joints: one name a joint.
        parameters: global parameters by label, such as the payload.
    """

    curve: PiecewiseBezier
    joints: tuple[str, ...]
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Checks that joints and curve fit."""
        if len(self.joints) != self.curve.dof:
            raise ProblemDefinitionError(f"a trajectory of {self.curve.dof} joints was given {len(self.joints)} names")

    @property
    def duration(self) -> float:
        """Total time [s]."""
        return float(self.curve.duration)

    def sample(self, count: int = 200, times: ArrayLike | None = None) -> pd.DataFrame:
        """Joint coordinates and derivatives at ``count`` even times, or at ``times`` [s].

        Returns:
            One row an instant, indexed by ``time [s]``; columns (quantity, joint) with quantities q, v, a, jerk, snap.
        """
        import pandas as pd  # costs 0.3 s, which problems need not

        t = np.linspace(0.0, self.duration, count) if times is None else np.atleast_1d(np.asarray(times, dtype=float))
        blocks = {
            name: pd.DataFrame(self.curve(t, order), index=t, columns=list(self.joints))
            for order, name in enumerate(COLUMNS)
        }
        return pd.concat(blocks, axis=1).rename_axis("time [s]")
