"""scipy's ``BPoly``: the curve itself, as ``scipy.interpolate.BPoly(c, x)`` takes it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from ocp_traj.errors import InputError
from ocp_traj.files import plain, write_text
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.io.export.exported import Exported
from ocp_traj.paths.trajectory_file import BPOLY_FORMAT
from ocp_traj.proof.audit import audit
from ocp_traj.proof.verdicts import UNDECIDED
from ocp_traj.results.playback import NO_LIMITS
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.version import __version__


@dataclass(frozen=True, kw_only=True)
class Bpoly:
    """Bernstein coefficients, all segments at the highest degree; the audit is of the curve that is read back."""

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes ``c`` ``(degree + 1, segments, joints)`` and ``x`` [s] ``(segments + 1,)``."""
        if target.suffix.lower() != ".json":
            raise InputError(f"a bpoly is written as .json; {target.name!r} ends otherwise")
        curve = trajectory.curve.to_bpoly()
        data = {
            **{name: value for name, value in trajectory.to_dict().items() if name != "control_points"},
            "format": BPOLY_FORMAT,
            "degrees": list(trajectory.curve.degrees),
            "x": curve.x.tolist(),
            "c": curve.c.tolist(),
        }
        again = Trajectory.from_dict(data, str(target))
        found = None if requirements is None else audit(again, requirements)
        facts = {
            "written by": f"ocp-traj {__version__}",
            "duration [s]": trajectory.duration,
            "verdict": NO_LIMITS if found is None else found.explain(),
        }
        path = write_text(target, json.dumps(plain({**data, "about": facts}), indent=1) + "\n")
        return Exported(path, "bpoly", (path,), facts, UNDECIDED if found is None else found.verdict)
