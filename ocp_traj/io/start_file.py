"""The trajectories that a file or a run folder holds, to begin from."""

from __future__ import annotations

from pathlib import Path

from ocp_traj.io.run_reader import load_run
from ocp_traj.results.trajectory import Trajectory


def earlier_results(place: str | Path) -> list[Trajectory]:
    """The trajectories of a run's front, or the one of a file, in any format that ``Trajectory.load`` reads."""
    if Path(place).is_dir():
        return [point.trajectory for point in load_run(place).points]
    return [Trajectory.load(place)]
