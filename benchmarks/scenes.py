"""Problems of MotionBenchMaker in clutter: solved and proved from own starts and from OMPL's, durations beside it.

A folder has to hold, for each of ``ur5`` and ``panda``, ``ROBOT_spherized.urdf``, ``ROBOT.srdf`` and folders with
``sceneNNNN.yaml`` and ``requestNNNN.yaml``; see docs/formats.md. Each finished part of a problem is a line of a file:
a run that was stopped goes on where it was. A proved motion is looked at in 100 000 places by code of its own
(``sphere_robot``). Seconds are of the processor, building and proof included: starts are stopped after ``--seconds``,
what they have by then is proved, and what is proved within ``WITHIN`` counts as in time. With ``--page`` all that came
of it becomes a section of RESULTS.md.

    python -m benchmarks.scenes FOLDER [--every 10] [--seconds 17] [--output scenes.jsonl] [--page]
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import ruckig
import toppra
from numpy.typing import NDArray
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

import ocp_traj as ot
from benchmarks.scenes_table import contradicted, section_of
from benchmarks.sections import put
from benchmarks.sphere_robot import Cell, SphereRobot
from ocp_traj import problems
from ocp_traj.errors import InputError
from ocp_traj.files import write_text
from ocp_traj.io.import_scene import import_scene
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt

Array = NDArray[np.float64]

SAMPLES = 100_000  # of a proved motion
OMPL_SECONDS = 8.0  # of RRT-Connect
WITHIN = 20.0  # seconds of the processor: a problem that takes longer is not solved in time
FINE = 0.02  # [rad] between postures that OMPL's edges are checked at
GRID = 400  # of TOPP-RA
SOLVER = Exchange(Ipopt(max_iter=200))  # a start that needs more seldom leads anywhere: the next one counts
PIECES = 8  # of a move: finer ones gain some 1 % of the time, and take as long again
LIMITS: dict[str, dict[str, Any]] = {
    "ur5": {"velocity": 3.15, "acceleration": 8.0, "jerk": 60.0},
    "panda": {
        "acceleration": [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0],
        "jerk": [750.0, 375.0, 500.0, 625.0, 750.0, 1000.0, 1000.0],
    },
}


def found_in(folder: Path) -> list[tuple[str, str, int]]:
    """Robot, scene and number of all problems of a folder: the first of each kind of scene, the second of each, .."""
    kinds = [sorted(kind.glob("scene*.yaml")) for robot in LIMITS for kind in sorted((folder / robot).glob("*/"))]
    return [
        (scene.parent.parent.name, scene.parent.name, int(scene.stem.removeprefix("scene")))
        for some in zip_longest(*kinds)
        for scene in some
        if scene is not None
    ]


@contextmanager
def budget(seconds: float) -> Iterator[None]:
    """Ends what is inside, as Ctrl-C does, after so many seconds of the processor."""
    before = signal.signal(signal.SIGPROF, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    signal.setitimer(signal.ITIMER_PROF, max(seconds, 0.01))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def solved(task: Path, start: str, seconds: float, tries: int) -> tuple[Solution | None, float, str]:
    """The first proved solution from seeds 0, 1, .. within a budget, the seconds it took, and why not, if not."""
    begun, reason = time.process_time(), ""
    for seed in range(tries):
        left = seconds - (time.process_time() - begun)
        if left <= 0.0:
            break
        try:
            with budget(left):
                problem = problems.load("task", file=str(task), **{"solve.start": start, "curve.finest": PIECES})
                found = ot.solve(problem, starts=1, seed=seed, certify=False, solver=SOLVER)
        except KeyboardInterrupt:
            reason = f"{reason}; seed {seed} was stopped".lstrip("; ")
            break
        except InputError as error:
            return None, time.process_time() - begun, str(error)
        if found.audit is not None and found.audit.proved:
            return found, time.process_time() - begun, ""
        reason = f"{reason}; {found.status.value}: {found.detail[:160]}".lstrip("; ")
    return None, time.process_time() - begun, reason


def ompl_path(cell: Cell, start: Array, goal: Array, seed: int) -> tuple[Array | None, float]:
    """RRT-Connect of OMPL and its simplification, a Python function for what is clear: the path, and seconds."""
    from ompl import base, geometric, util

    util.setLogLevel(util.LOG_NONE)  # it would complain of a seed that comes after the first
    util.RNG.setSeed(seed)
    robot, n, begun = cell.robot, len(start), time.process_time()
    space = base.RealVectorStateSpace(n)
    bounds = base.RealVectorBounds(n)
    for i in range(n):
        bounds.setLow(i, float(robot.low[i]))
        bounds.setHigh(i, float(robot.high[i]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(
        lambda state: bool(cell.clearance(np.array([[state[i] for i in range(n)]]))[0] >= 0.0)
    )
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(FINE / space.getMaximumExtent())
    ends = []
    for point in (start, goal):
        state = space.allocState()
        for i in range(n):
            state[i] = float(point[i])
        ends.append(state)
    setup.setStartAndGoalStates(*ends)
    setup.setPlanner(geometric.RRTConnect(information))
    setup.solve(base.PlannerTerminationCondition(lambda: time.process_time() - begun > OMPL_SECONDS))
    if not setup.haveExactSolutionPath():
        return None, time.process_time() - begun
    setup.simplifySolution()
    states = setup.getSolutionPath().getStates()
    path = np.array([[state[i] for i in range(n)] for state in states])
    path[0], path[-1] = start, goal
    return path[np.concatenate([[True], np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-9])], time.process_time() - begun


def retimed(path: Array, speed: Array, acceleration: Array) -> float:
    """The duration that TOPP-RA gives a spline through a path's points, with limits on velocity and acceleration."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    spline = toppra.SplineInterpolator(lengths, path)
    limits = [
        JointVelocityConstraint(np.stack([-speed, speed], 1)),
        JointAccelerationConstraint(np.stack([-acceleration, acceleration], 1)),
    ]
    grid = np.linspace(0.0, lengths[-1], GRID + 1)
    found = TOPPRA(limits, spline, gridpoints=grid, parametrizer="ParametrizeConstAccel").compute_trajectory()
    return float("nan") if found is None else float(found.duration)


def unobstructed(start: Array, goal: Array, *limits: Array) -> float:
    """The least duration from rest to rest with nothing in the way (Ruckig): what no motion of a scene is below."""
    asked = ruckig.InputParameter(len(start))
    asked.current_position, asked.target_position = start.tolist(), goal.tolist()
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = (limit.tolist() for limit in limits)
    found = ruckig.Trajectory(len(start))
    if ruckig.Ruckig(len(start)).calculate(asked, found) not in (ruckig.Result.Working, ruckig.Result.Finished):
        return float("nan")
    return float(found.duration)


class Setting:
    """One problem as a task file in a folder of its own, and its cell by code of the benchmark."""

    def __init__(self, folder: Path, robot: str, scene: str, number: int, temporary: Path) -> None:
        """Imports it.

        Raises:
            InputError: the package refuses it.
        """
        place = folder / robot
        files = [place / scene / f"{word}{number:04}.yaml" for word in ("scene", "request")]
        urdf, srdf, self.task = place / f"{robot}_spherized.urdf", place / f"{robot}.srdf", temporary / "task.toml"
        changes = {f"limits.{name}": json.dumps(value) for name, value in LIMITS[robot].items()}
        made = import_scene(*files, self.task, urdf=urdf, srdf=srdf, changes={**changes, "limits.effort": "none"})
        write_text(self.task, made.text)
        problem = problems.load("task", file=str(self.task))
        self.joints, (self.start, self.goal) = problem.robot.joints, np.array(problem.case.move[0].via)
        bounds = [np.broadcast_to(problem.robot.limits.bounds(order)[1], self.start.shape) for order in (1, 2, 3)]
        self.speed, self.acceleration, self.jerk = bounds
        self.cell = Cell(SphereRobot(urdf, srdf, self.joints), files[0])

    def solved(self, word: str, start: str, seconds: float, tries: int) -> dict[str, Any]:
        """What came of a kind of start."""
        found, took, reason = solved(self.task, start, seconds, tries)
        row: dict[str, Any] = {word: found is not None, f"{word} s": took, f"{word} reason": reason}
        if found is not None and found.trajectory is not None:
            curve = found.trajectory.curve
            row[f"{word} time"] = float(curve.duration)
            times = np.linspace(0.0, curve.duration, SAMPLES)
            row[f"{word} least"] = float(self.cell.clearance(curve(times)).min())
        return row

    def own(self, seconds: float, tries: int) -> dict[str, Any]:
        """From own starts."""
        valid = bool((self.cell.clearance(np.array([self.start, self.goal])) >= 0.0).all())
        return {"valid": valid, **self.solved("own", "plan", seconds, tries)}

    def ompl(self, seconds: float, tries: int) -> dict[str, Any]:
        """OMPL's path, its duration by TOPP-RA, and from it as a start."""
        path, took = ompl_path(self.cell, self.start, self.goal, 1)
        row: dict[str, Any] = {"ompl": path is not None, "ompl s": took}
        if path is None:
            return row
        row["toppra"] = retimed(path, self.speed, self.acceleration)
        row["unobstructed"] = unobstructed(self.start, self.goal, self.speed, self.acceleration, self.jerk)
        lines = [",".join(self.joints), *(",".join(map(repr, point)) for point in path.tolist())]
        write_text(self.task.parent / "path.csv", "\n".join(lines) + "\n")
        return row | self.solved("from ompl", "path.csv", seconds, 1)


def measured(part: str, folder: Path, place: tuple[str, str, int], seconds: float, tries: int) -> dict[str, Any]:
    """One part of one problem."""
    with tempfile.TemporaryDirectory() as temporary:
        try:
            return dict(getattr(Setting(folder, *place, Path(temporary)), part)(seconds, tries))
        except InputError as error:
            return {"refused": str(error).removeprefix(f"{Path(temporary) / 'task.toml'}: ")}


def main() -> None:
    """Runs what is not in the output yet, and prints all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--every", type=int, default=1, help="of how many problems one is taken")
    parser.add_argument("--offset", type=int, default=0, help="the first that is taken")
    parser.add_argument(
        "--seconds", type=float, default=17.0, help="after which a start is stopped; its last proof comes on top"
    )
    parser.add_argument("--tries", type=int, default=8, help="seeds of own starts")
    parser.add_argument("--parts", default="own,ompl", help="of each problem, in this order")
    parser.add_argument("--most", type=int, default=10**9, help="problems, of which those that are done count")
    parser.add_argument("--page", action="store_true", help="put what came of it on the page of results")
    parser.add_argument("--output", type=Path, default=Path("scenes.jsonl"))
    asked = parser.parse_args()
    toppra.setup_logging("ERROR")
    wanted = found_in(asked.folder)
    if not wanted:
        raise SystemExit(f"{asked.folder} holds no ur5/*/scene*.yaml and no panda/*/scene*.yaml; left out")
    done: dict[tuple[str, str, int], dict[str, Any]] = {}
    parts: set[tuple[Any, ...]] = set()
    for line in asked.output.read_text().splitlines() if asked.output.exists() else []:
        row = json.loads(line)
        place = row["robot"], row["scene"], row["number"]
        parts.add((row.pop("part"), *place))
        done.setdefault(place, {}).update(row)
    for place in wanted[asked.offset :: asked.every][: asked.most]:
        for part in asked.parts.split(","):
            if (part, *place) in parts:
                continue
            row = dict(zip(("robot", "scene", "number"), place, strict=True))
            row |= measured(part, asked.folder, place, asked.seconds, asked.tries)
            done.setdefault(place, {}).update(row)
            with asked.output.open("a") as file:
                file.write(json.dumps({"part": part, **row}) + "\n")
            print({k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()}, flush=True)
    rows = list(done.values())
    if rows:
        command = f"python -m benchmarks.scenes FOLDER --seconds {asked.seconds:g} --every {asked.every}"
        text = section_of(rows, command, WITHIN, SAMPLES, len(wanted))
        print(text)
        if asked.page:
            put("scenes", text)
    raise SystemExit(contradicted(rows)[1] > 0)


if __name__ == "__main__":
    main()
