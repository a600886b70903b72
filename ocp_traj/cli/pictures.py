"""What ``ocp-traj plot`` draws of its arguments: trajectories, one front, several, or how populations converged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ocp_traj.errors import InputError, cut
from ocp_traj.io.plot import plot_front, plot_trajectories
from ocp_traj.io.plot_convergence import plot_convergence, read_histories
from ocp_traj.io.plot_fronts import plot_fronts
from ocp_traj.io.run_reader import load_run, read_manifest
from ocp_traj.report.paper_points import paper_points
from ocp_traj.results.front_comparison import compare_fronts, require_alike
from ocp_traj.results.trajectory import Trajectory

RUN, HISTORY, TRAJECTORY = "run folders", "histories (CSV)", "trajectories"


def draw(sources: Sequence[Path], output: Path) -> Path:
    """Draws what the sources are, which must all be of one kind.

    Raises:
        InputError: where they are of several kinds, one is given twice, or they do not belong in one picture.
    """
    for index, path in enumerate(sources):
        if path.resolve() in [other.resolve() for other in sources[:index]]:
            raise InputError(f"{cut(str(path))} is given twice; give each once")
        if not path.exists():
            raise InputError(f"there is no {cut(str(path))}; give a run folder, a trajectory or a history (CSV)")
    kinds = {path: kind_of(path) for path in sources}
    if len(set(kinds.values())) > 1:
        told = ", ".join(f"{cut(str(path))} is of {kind}" for path, kind in kinds.items())
        raise InputError(f"a picture is of {RUN}, of {TRAJECTORY} or of {HISTORY}, not of several kinds: {told}")
    return {RUN: _fronts, HISTORY: _histories, TRAJECTORY: _trajectories}[kinds[sources[0]]](sources, output)


def kind_of(path: Path) -> str:
    """Of what kind a source is: a folder is a run; a CSV with generations and their best value is a history."""
    if path.is_dir():
        return RUN
    if path.suffix.lower() == ".csv" and path.is_file():
        with path.open("rb") as file:
            first = file.readline(1000).decode("utf-8", "replace").strip().split(",")
        if {"evaluations", "best"} & set(first):
            return HISTORY
    return TRAJECTORY


def _fronts(runs: Sequence[Path], output: Path) -> Path:
    if len(runs) > 1:
        require_alike({str(run): read_manifest(run) for run in runs})
        fronts = {str(run): load_run(run) for run in runs}
        return plot_fronts(compare_fronts(fronts, None, None), fronts[str(runs[0])].problem, output)
    front = load_run(runs[0])
    known = paper_points(front.problem.id, front.objectives)
    printed = {label.removeprefix("paper, "): values for label, values in known.items()}
    return plot_front(replace(front, info={"paper": printed, **front.info}), output)


def _histories(files: Sequence[Path], output: Path) -> Path:
    return plot_convergence(read_histories(files), output)


def _trajectories(files: Sequence[Path], output: Path) -> Path:
    motions = [Trajectory.load(path) for path in files]
    first = motions[0]
    for path, moved in zip(files, motions, strict=True):
        if not moved.problem:
            raise InputError(
                f"{cut(str(path))} names no problem, so that its limits are not known; a picture is of trajectories "
                "that ocp-traj wrote"
            )
        if (moved.problem, moved.case, moved.joints) != (first.problem, first.case, first.joints):
            raise InputError(
                f"{cut(str(path))} is of another problem or case than {cut(str(files[0]))}; in one picture all have "
                "the same limits"
            )
    names = [_name(path, files) for path in files] if len(files) > 1 else [""]
    return plot_trajectories(dict(zip(names, motions, strict=True)), first.posed.requirements, output)


def _name(path: Path, among: Sequence[Path]) -> str:
    """A file's name without its ending, or its whole path where another one has the same."""
    return path.stem if [other.stem for other in among].count(path.stem) == 1 else str(path)
