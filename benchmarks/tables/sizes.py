"""What size costs: seconds and memory against via points, joints, objectives, obstacles and workers, with exponents.

Every run has a process of its own, so that its memory is its own. Workers are reckoned by ``benchmarks.workers``, whose
clock other processes cannot disturb; beyond one machine there is a reckoning on paper, from the measured seconds of the
jobs and Dask's measured overhead a task.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import ocp_traj as ot
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.tables.words import done, median, table
from benchmarks.workers import Clocked
from ocp_traj.parallel.workers import Workers
from tests.quintics import GOAL, START, held_at_control_points, quintics, refined, ur5, wander
from tests.random_robots import random_model

TITLE = "Cost against size"
APART = True  # memory is a process's
SEED = 0
OBJECTIVES = ("time", "energy", "jerk", "acceleration", "payload_mass", "cost")
FRONT_POINTS = 8
BALL, CLEARANCE = 0.05, 0.01  # [m]: radius of an obstacle, and what is kept from it; our choice
PIECES = 4  # of the move past obstacles: our choice
JOBS = 8  # points of the front that workers share when quick, else 40
NO_OPS = 200  # tasks that do nothing, by which Dask's overhead is measured
MACHINES = (4, 16, 64, 256)  # workers of the reckoning on paper
FITTED = ("cpu", "MB", "iterations")
TEXT = """Via points: quintics of a UR5, a piece from point to point, limits up to jerk and on torques. Joints: a random
move of a chain. Objectives: {points} points of a front of `hybrid-spline` with a free payload, where iterations are
solves. Obstacles: a UR5's capsules past random balls.

{rows}

Exponents p of a fit size^p, sizes above 0:

{fits}

{workers}

What it means: an exponent of 1 is in proportion, and below it a fixed part still dominates. Via points are sparse in
the programme, each with its neighbours alone; of joints, torques are functions of all of them and are differentiated
twice, so that joints weigh most; obstacles that are far cost rows where they come near and nothing elsewhere. No peer
is measured here."""
PAPER = """Beyond one machine, on paper: a task that does nothing takes Dask {each:.2g} ms, the jobs above take
{jobs:.3g} s together and the process that asks {own:.3g} s, so that {tasks} tasks and n workers take no less than

{paper}"""
Solved = tuple[bool, float, float]  # proved, rows, iterations


def _via_points(count: int) -> Solved:
    """Time-optimal quintics, a piece from point to point, limits up to jerk at control points, and torques."""
    return _of(ot.solve(held_at_control_points(quintics(ur5(), wander(count), 1))))


def _joints(count: int) -> Solved:
    """A random move of a chain of revolute joints, limits up to jerk, and torques that do not bind."""
    rng = np.random.default_rng(count)
    model = random_model(rng, count, kinds=("revolute",), aligned=True)
    limits = ot.JointLimits(
        position=((-3.0,) * count, (3.0,) * count), velocity=(3.0,) * count, acceleration=(8.0,) * count,
        jerk=(60.0,) * count, effort=(1000.0,) * count,
    )  # fmt: skip
    robot = ot.Robot(model, tuple(model.names)[1:], ("rad",) * count, limits)
    return _of(ot.solve(refined(robot, rng.uniform(-1.0, 1.0, (2, count)), 4, 8), certify=False))


def _objectives(count: int) -> Solved:
    """A traced front of ``hybrid-spline`` with a free payload."""
    problem = ot.problems.load("hybrid-spline", free_payload=True)
    front = ot.pareto(problem, list(OBJECTIVES[:count]), points=FRONT_POINTS, seed=SEED)
    return len(front) > 0, 0.0, float(front.info.get("solves", np.nan))


def _obstacles(count: int) -> Solved:
    """A move of a UR5, its links in capsules, past random balls around it."""
    rng = np.random.default_rng(SEED)
    angles, reach, height = rng.uniform(-1.2, 1.2, 50), rng.uniform(0.8, 1.1, 50), rng.uniform(-0.1, 0.9, 50)
    centres = np.stack([reach * np.cos(angles), reach * np.sin(angles), height], axis=1).round(3)
    balls = [{"name": f"ball {k}", "sphere": {"centre": c.tolist(), "radius": BALL}} for k, c in enumerate(centres)]
    held = {"links": "urdf", "self": False, "clearance": CLEARANCE, "obstacle": balls[:count]} if count else None
    task = ot.problems.load(
        "task", name="balls", robot={"description": "ur5", "tool_frame": "tool0"},
        limits={"description": True, "acceleration": 8.0, "jerk": 60.0},
        curve={"kind": "quintic", "pieces": PIECES}, move=[{"via": [START, GOAL]}],
        objective={"minimise": "time"}, **({} if held is None else {"collision": held}),
    )  # fmt: skip
    return _of(ot.solve(task, starts=1, certify=False))


def _of(found: Any) -> Solved:
    proved = found.audit is not None and found.audit.proved
    return proved, float(found.row_count), float(found.iterations)


AXES: dict[str, tuple[Callable[[int], Solved], tuple[int, ...], tuple[int, ...]]] = {  # sizes: quick, and whole
    "via points": (_via_points, (10, 30), (10, 30, 100, 300, 1000)),
    "joints": (_joints, (3, 6), (3, 5, 7, 10, 14)),
    "objectives": (_objectives, (2, 4), (2, 3, 4, 5, 6)),
    "obstacles": (_obstacles, (0, 5), (0, 1, 5, 10, 20, 50)),
}
WORKERS, DASK = "workers", "Dask"


def cells(quick: bool) -> Iterator[Cell]:
    """All sizes five times; when quick a few sizes once."""
    for axis, (_, few, all_sizes) in AXES.items():
        for size in few if quick else all_sizes:
            for repeat in range(1 if quick else 5):
                yield Cell("ours", axis, str(size), repeat)
    points = JOBS if quick else 40
    for count in (0, 1, 2) if quick else (0, 1, 2, 4, 8, 16):
        for repeat in range(1 if quick else 3):
            yield Cell("ours", WORKERS, f"{count} of {points} points", repeat)
    for repeat in range(1 if quick else 5):
        yield Cell("distributed", DASK, "", repeat)


def measure(cell: Cell) -> Figures:
    """One run of one size."""
    if cell.subject == DASK:
        return _dask()
    if cell.subject == WORKERS:
        return _workers(*(int(word) for word in cell.setting.split() if word.isdigit()))
    ot.solve(quintics(ur5(), wander(3), 1), certify=False)  # imports, and what is compiled once
    before, begun = _memory("VmRSS"), time.process_time()
    proved, rows, iterations = AXES[cell.subject][0](int(cell.setting))
    return {
        "cpu": time.process_time() - begun, "MB": _memory("VmHWM") - before, "proved": proved, "rows": rows,
        "iterations": iterations,
    }  # fmt: skip


def _memory(name: str) -> float:
    """``VmRSS``, what this process holds, or ``VmHWM``, the most it has held since it began [MB], as Linux tells.

    The peak that ``resource`` tells is no use here: a child's begins at its parent's.
    """
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return next(float(line.split()[1]) for line in status.splitlines() if line.startswith(f"{name}:")) / 1024.0


def _workers(count: int, points: int) -> Figures:
    """Seconds of a front of ``hybrid-spline`` with so many workers, 0 for none, by the reckoning clock."""
    problem = ot.problems.load("hybrid-spline")
    ot.pareto(problem, ["time", "energy"], points=2)  # warm
    begun = time.process_time()
    clocked = Clocked(count) if count else None
    ot.pareto(problem, ["time", "energy"], points=points, workers=Workers() if clocked is None else clocked)
    if clocked is None:
        return {"cpu": time.process_time() - begun}
    return {"cpu": clocked.now, "jobs": clocked.jobs, "own": clocked.own, "wasted": clocked.wasted}


def _dask() -> Figures:
    """Seconds that a task that does nothing takes through a scheduler and one worker, in threads of this process."""
    from distributed import Client, LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster:
        with Client(cluster) as client:
            client.gather(client.map(_nothing, range(10), pure=False))
            begun, cpu = time.perf_counter(), time.process_time()
            client.gather(client.map(_nothing, range(NO_OPS), pure=False))
            took = time.perf_counter() - begun
            return {"cpu": (time.process_time() - cpu) / NO_OPS, "seconds": took / NO_OPS}  # of all its threads


def _nothing(_: int) -> None:
    """What is sent."""


def exponent(sizes: list[float], values: list[float]) -> float:
    """Slope of a straight line through the logarithms; NaN for fewer than two sizes."""
    kept = [(s, v) for s, v in zip(sizes, values, strict=True) if s > 0.0 and v > 0.0]
    if len({s for s, _ in kept}) < 2:
        return float("nan")
    x, y = np.log(np.array(kept)).T
    return float(np.polyfit(x, y, 1)[0])


def by_size(lines: Lines, axis: str) -> dict[int, dict[str, float]]:
    """Medians by size."""
    found: dict[int, dict[str, float]] = {}
    for size in sorted({int(cell.setting) for cell, _ in lines.items(subject=axis)}):
        some = done(lines, subject=axis, setting=str(size))
        if some:
            found[size] = {"runs": len(some), "proved": sum(one["proved"] for one in some)}
            found[size] |= {name: float(np.median([one[name] for one in some])) for name in FITTED}
    return found


def text(lines: Lines) -> str:
    """The section."""
    rows, fits = [], []
    for axis in AXES:
        by = by_size(lines, axis)
        for size, one in by.items():
            rows.append([axis, str(size), f"{one['runs']}", f"{one['cpu']:.3g}", f"{one['MB']:.0f}",
                         f"{one['iterations']:.0f}", f"{one['proved']} of {one['runs']}"])  # fmt: skip
        sizes = [float(size) for size in by]
        if by:
            powers = (exponent(sizes, [one[name] for one in by.values()]) for name in ("cpu", "MB"))
            fits.append([axis, *("-" if np.isnan(power) else f"{power:.2f}" for power in powers)])
    return TEXT.format(
        points=FRONT_POINTS, rows=table(("of", "size", "runs", "seconds", "MB more", "iterations", "proved"), rows),
        fits=table(("of", "seconds", "memory"), fits), workers=_workers_text(lines),
    )  # fmt: skip


def _workers_text(lines: Lines) -> str:
    """Workers, and the reckoning beyond one machine."""
    settings = dict.fromkeys(cell.setting for cell, _ in lines.items(subject=WORKERS))
    by = {setting: done(lines, subject=WORKERS, setting=setting) for setting in settings}
    by = {setting: some for setting, some in by.items() if some}
    alone = [one["cpu"] for setting, some in by.items() if setting.startswith("0 ") for one in some]
    if not alone:
        return ""
    base, rows = float(np.median(alone)), []
    for setting, some in by.items():
        gains = [base / one["cpu"] for one in some]
        wasted = [one.get("wasted", 0.0) for one in some]
        rows.append([setting, median([one["cpu"] for one in some]), median(gains, ".2f"), median(wasted)])
    found = f"""Workers, a front of `hybrid-spline` (0 of them: no workers at all):

{table(("workers", "seconds", "times as fast", "seconds of jobs nobody asked for"), rows)}"""
    overhead, last = done(lines, subject=DASK), list(by.values())[-1]
    if not overhead or "jobs" not in last[0]:
        return found
    each = float(np.median([one["cpu"] for one in overhead]))
    jobs, own = (float(np.median([one[name] for one in last])) for name in ("jobs", "own"))
    tasks = int(list(by)[-1].split()[2])
    paper = [[str(n), f"{own + each * tasks + jobs / min(n, tasks):.3g}", f"{100 * each * tasks / (own + jobs):.1f} %"]
             for n in MACHINES]  # fmt: skip
    head = ("workers", "seconds", "of the work, Dask's overhead")
    return f"{found}\n\n" + PAPER.format(each=1e3 * each, jobs=jobs, own=own, tasks=tasks, paper=table(head, paper))


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    found = {}
    for axis in AXES:
        by = by_size(lines, axis)
        power = exponent([float(size) for size in by], [one["cpu"] for one in by.values()])
        if np.isfinite(power):
            found[f"sizes.{axis.replace(' ', '-')}"] = (f"{power:.1f}", f"exponent of seconds in the number of {axis}")
    return found


def behind(lines: Lines) -> list[str]:
    """Where cost grows quicker than size."""
    words = []
    for axis in AXES:
        by = by_size(lines, axis)
        power = exponent([float(size) for size in by], [one["cpu"] for one in by.values()])
        if power > 1.2:
            words.append(f"Seconds grow as (number of {axis})^{power:.1f}, quicker than in proportion.")
    return words
