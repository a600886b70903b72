"""What is said of a problem and its trajectories to people; nothing is computed from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ocp_traj.curves.motion import Motion
    from ocp_traj.formulation.rows import Conflict
    from ocp_traj.formulation.surroundings import Surroundings


@dataclass(frozen=True, eq=False)
class About:
    """Texts of a problem, and what puts a motion or a conflict of it into words.

    Attributes:
        title: a few words, for lists.
        reference: the publication.
        curve_kind: family and number of the segments.
        notes: what this case fills in where the paper says nothing; shown with the problem and with every result.
        figures: motion -> (name, value, unit) of each quantity that is no objective and yet worth reporting.
        homotopy_class: motion -> name of the class it is in, such as the side on which it passes an obstacle.
        describe_conflict: what a limit broken at a fixed end state means.
        surroundings: what stands around the robot and is on its links, beside the bodies of its limits; for pictures.
    """

    title: str = ""
    reference: str = ""
    curve_kind: str = ""
    notes: tuple[str, ...] = ()
    figures: Callable[[Motion], Sequence[tuple[str, float, str]]] | None = None
    homotopy_class: Callable[[Motion], str] | None = None
    describe_conflict: Callable[[Conflict], str] | None = None
    surroundings: Callable[[], Surroundings] | None = None
