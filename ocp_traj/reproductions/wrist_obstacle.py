"""El Haiek et al. reproduced as far as the text goes: why it is no problem, what is solved instead, GA beside IPOPT."""

from __future__ import annotations

import time
from collections.abc import Callable
from math import pi, sqrt
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj import problems
from ocp_traj.api.solving import solve
from ocp_traj.arrays import Array
from ocp_traj.errors import NoSolutionFound
from ocp_traj.evolution.outcome import solution_of
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.problems import wrist_obstacle as paper
from ocp_traj.progress import Progress
from ocp_traj.reproductions.comparison import Reproduction, Run, Sheet, named_objectives
from ocp_traj.reproductions.courses import FOLLOWED, Courses, objectives_of
from ocp_traj.reproductions.draft import Draft, Keep, ignore
from ocp_traj.reproductions.wrist_obstacle_errata import equation_errata, later_start, misses
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ga import GA
from ocp_traj.transcription.symbolic import evaluate_objectives

TIME, FITNESS = f"{paper.TIME:.1f}", f"{paper.FITNESS:.1f}"  # as printed
KNOWN = {"blocked": 4.4698, "open": 2.7664}  # fitness of the cases solved instead, found before by other code
PLANE = {"start": (-1.0, 1.0, 0.0), "goal": (1.0, 1.0, 0.0), "d3": sqrt(2.0)}  # sect. 5; d3 reaches both
RADII = (0.01, 0.1, 0.4)  # of an obstacle, and no thickness of the link to speak of: our choice
THIN = 1e-6
BOUNDS = (0.05, 0.1, 0.2)  # [s], of t1 and of t2: our choice
WIDE = {"max_velocity": (100.0,) * 3, "max_acceleration": (1e4,) * 3}  # no limits to speak of
SCALES = (0.15059, 0.5, 1.0, 2.0)  # of time; the first makes 0.2 s of our optimum
# (constraint handling, time scaling): what it is called. The paper's is the second.
VARIANTS = {
    ("feasibility", False): "the feasible first",
    ("death", False): "death penalty, as (19)",
    ("death", True): "death penalty, time scaled",
}
STARTS = 4  # of each branch: the problem's own number
HIT = 1e-3  # relative: a run this close to the best has found it; our choice
SETTLED = 0.01  # of its last value: a run this close to it has settled; our choice


def run(seeds: int, progress: Progress, keep: Keep = ignore) -> Reproduction:
    """All of the paper's numbers beside ours; see ``ocp_traj.reproductions.reproduce.reproduce``."""
    from ocp_traj.reproductions import wrist_obstacle_figures as figures  # Matplotlib is slow to import

    reference = problems.load("wrist-obstacle").about.reference
    draft = Draft("wrist-obstacle", reference, 4 + seeds * len(VARIANTS), progress, keep, figures.FIGURES)
    sheet, runs, extra = draft.sheet, draft.runs, draft.extra
    draft.begin("the plane")
    extra["The paper's points in the plane"] = plane(sheet)
    draft.begin("the cases solved instead")
    best = known(sheet, runs)
    assert best.trajectory is not None
    curve = best.trajectory.curve
    draft.begin("time without limits")
    extra["Time without limits falls to its bound"] = bounds(sheet)
    extra["One path, as slow as one likes"] = dilations(best)
    draft.begin("equations")
    turned = equations(sheet, best)
    problem = problems.load("wrist-obstacle", branch="0")
    courses = Courses({}, None)
    if seeds:
        title = f"Genetic algorithm of the paper on {seeds} seed{'' if seeds == 1 else 's'}, beside IPOPT"
        extra[title], courses = genetic(problem, best, seeds, runs, draft.begin)
        figures.courses(draft, courses, best.objectives, FITNESS, TIME)
    figures.motions(draft, problem, best.trajectory, courses.best)
    return draft.finish(equation_errata(curve, turned))


# --- why the text is not a problem ---


def plane(sheet: Sheet) -> pd.DataFrame:
    """The obstacle, the goal and the base of sect. 5 on one line: no radius lets the link reach the goal."""
    centre, goal = np.array([0.5, 0.5, 0.0]), np.array(PLANE["goal"])
    aside = float(np.linalg.norm(np.cross(centre, goal)) / np.linalg.norm(goal))
    note = "in the plane base, obstacle and goal are on one line; beyond it the text has no heights"
    item = "obstacle's distance from the link at the goal"
    sheet.expect("Sect. 5", item, 0.0, aside, "-", tolerance=1e-12, note=note)
    rows = []
    for radius in RADII:
        case = {**PLANE, "obstacles": ((*centre.tolist(), radius),), "link_radius": THIN}
        found = solve(problems.load("wrist-obstacle", branch="0", **case), starts=1)
        tip = float(np.linalg.norm(goal)) - float(np.linalg.norm(centre))  # the tip stays at d3 from the base
        rows.append((radius, found.status.value, "; ".join(map(str, found.conflicts)), tip - radius))
    return pd.DataFrame(rows, columns=["radius", "link", "why", "least distance of the tip alone"])


def bounds(sheet: Sheet) -> pd.DataFrame:
    """The shortest time without limits on velocity and acceleration, for several bounds of t1 and t2."""
    rows = []
    for least in BOUNDS:
        problem = problems.load("wrist-obstacle", branch="0", min_time=least, **WIDE)
        found = solve(problem, starts=STARTS).require()
        assert found.trajectory is not None and found.audit is not None
        v, a = peaks(found)
        values = found.objectives
        rows.append((least, values["time"], values["distance"], values["fitness"], v, a, found.audit.verdict))
        if f"{2.0 * least:.1f}" == TIME:
            note = "the bound twice: a bound of 0.1 s each explains the paper's time, limits on the motion would not"
            sheet.add("Sect. 5", f"time, t1 and t2 >= {least:g} s, no limits", TIME, values["time"], "s", note=note)
    columns = "bound of t1, t2 [s]|time [s]|distance [rad]|fitness [-]|peak v [rad/s]|peak a [rad/s2]|verdict"
    return pd.DataFrame(rows, columns=columns.split("|"))


def dilations(best: Solution) -> pd.DataFrame:
    """Our optimum slower and faster: the same distance, any time."""
    problem = problems.load("wrist-obstacle", branch="0")
    assert problem.dilate is not None
    rows = []
    for s in SCALES:
        moved = trajectory_of(problem, problem.dilate(best.x, s))
        values = evaluate_objectives(problem, problem.dilate(best.x, s))
        v, a = (max(max(-e.lower, e.upper) for e in moved.curve.extrema(order)) for order in (1, 2))
        rows.append((s, values["time"], values["distance"], v, a))
    return pd.DataFrame(rows, columns=["scale", "time [s]", "distance [rad]", "peak v [rad/s]", "peak a [rad/s2]"])


def peaks(solution: Solution) -> tuple[float, float]:
    """Largest |v| [rad/s] and |a| [rad/s^2] of any joint."""
    assert solution.trajectory is not None
    v, a = (max(float(max(-e.lower, e.upper)) for e in solution.trajectory.curve.extrema(order)) for order in (1, 2))
    return v, a


# --- what is solved instead ---


def known(sheet: Sheet, runs: list[Run]) -> Solution:
    """The optima of both cases, on both branches, beside values found before; returns that of the blocked one."""
    solved: dict[str, Solution] = {}
    for case, value in KNOWN.items():
        problem = problems.load("wrist-obstacle", case=case)
        found = solved[case] = solve(problem, starts=STARTS).require()
        assert found.audit is not None
        note = (
            f"not the paper's: start and goal lifted off the plane, limits and sizes our choice; {found.audit.verdict}"
        )
        sheet.expect("Cases solved instead", f"fitness, {case}", value, found.f, "-", note=note, tolerance=3e-4)
        for branch, one in found.alternatives.items():
            assert one.audit is not None
            named = named_objectives(problem, one.objectives)
            method = f"exchange, IPOPT, {STARTS} starts"
            words = f"{case}, {branch}"
            runs.append(Run("ours", method, words, 0, named, one.seconds, one.iterations, one.audit.verdict))
    best = solved["blocked"]
    distance = best.objectives["distance"]
    sheet.expect("Cases solved instead", "distance, blocked", pi, distance, "rad", tolerance=5e-7, note="half a turn")
    note = "weights and limits are not given: no number of ours can be held against it"
    sheet.add("Sect. 5", "fitness, blocked, both weights 1", FITNESS, best.f, "-", note=note)
    sheet.add("Sect. 5", "time, blocked, our limits", TIME, best.objectives["time"], "s", note=note)
    paper = {"time [s]": float(TIME), "fitness [-]": float(FITNESS)}
    method = "GA, 200 individuals, 80 generations, weights and limits not given"
    runs.append(Run("paper", method, "in the plane", None, paper, None, None))
    return best


def equations(sheet: Sheet, best: Solution) -> float:
    """What the coefficients miss, as printed and as they must read; returns how far theta3 turns [rad]."""
    assert best.trajectory is not None
    curve = best.trajectory.curve
    for printed, words in ((True, "as printed"), (False, "as it must read")):
        via, goal = misses(later_start(curve), printed=printed)[0], misses(curve, printed=printed)[1]
        for item, value in ((f"via point missed with (8) {words}", via), (f"goal missed, b4 {words}", goal)):
            sheet.expect("Equations", item, 0.0, value, "rad", tolerance=1e-9)
    turned = float(sum(np.abs(np.diff(points[:, 2])).sum() for points in curve.control_points))
    note = "of the control points, which bounds it"
    sheet.expect("Equations", "theta3 turned at the optimum", 0.0, turned, "rad", tolerance=1e-6, note=note)
    return turned


# --- the genetic algorithm ---


def genetic(
    problem: Problem, best: Solution, seeds: int, runs: list[Run], told: Callable[[str], None]
) -> tuple[pd.DataFrame, Courses]:
    """The paper's algorithm with both ways to treat limits, and IPOPT from as many starts, on branch 0.

    Returns:
        a row each, and how the genetic algorithm went.
    """
    rows: list[tuple[Any, ...]] = []
    values: dict[str, list[Array]] = {}
    proved: list[Solution] = []
    for (handling, scaling), words in VARIANTS.items():
        found: list[Solution] = []
        settled: list[int] = []
        for seed in range(seeds):
            told(f"GA, {words}, seed {seed}")
            solver = GA(seed, handling=handling, scaling=scaling)
            evolution, target = solver.run(problem, "fitness")
            if evolution.interrupted:
                raise KeyboardInterrupt
            values.setdefault(words, []).append(objectives_of(problem, evolution.champions, FOLLOWED))
            size = solver.population, solver.generations
            try:
                solution = solution_of(evolution, target, problem, "fitness", "ga", *size)
            except NoSolutionFound:  # counted below: fewer proved runs than seeds
                continue
            assert solution.audit is not None and solution.history is not None
            evaluations = int(solution.history["evaluations"].iloc[-1])
            named = named_objectives(problem, solution.objectives)
            verdict = solution.audit.verdict
            method = f"GA, {words}"
            runs.append(Run("ours", method, "blocked, branch 0", seed, named, solution.seconds, evaluations, verdict))
            found.append(solution)
            proved += [solution] if solution.audit.proved else []
            history = solution.history["best"].to_numpy()
            settled.append(int(np.argmax(history <= (1.0 + SETTLED) * history[-1])) + 1)
        counts = [int(s.history["evaluations"].iloc[-1]) for s in found if s.history is not None]
        rows.append(_row(f"GA, {words}", seeds, found, counts, "individuals", best, settled))
    local = []
    for seed in range(seeds):
        begun = time.perf_counter()
        x0 = problem.guess(np.random.default_rng([0, seed]))
        solution = Exchange().solve(problem, WeightedSum({"fitness": 1.0}), x0)
        if solution.ok:
            local.append(solution)
            assert solution.seconds <= time.perf_counter() - begun
    rows.append(
        _row("IPOPT with exchange, one start", seeds, local, [s.iterations for s in local], "iterations", best, [])
    )
    columns = f"method|runs|proved|within {HIT:.1%}|best fitness|median fitness|median gap|worst gap"
    more = "settled after [generations]|median effort|of|median [s]"
    motion = min(proved, key=lambda one: one.f).trajectory if proved else None
    return pd.DataFrame(rows, columns=[*columns.split("|"), *more.split("|")]), Courses(values, motion)


def _row(
    name: str, seeds: int, found: list[Solution], effort: list[int], of: str, best: Solution, settled: list[int]
) -> tuple[Any, ...]:
    proved = [s for s in found if s.audit is not None and s.audit.proved]
    values = np.array([s.f for s in proved]) if proved else np.full(1, np.nan)
    gaps = values / best.f - 1.0
    generations = float(np.median(settled)) if settled else np.nan
    seconds = float(np.median([s.seconds for s in found])) if found else np.nan
    median = float(np.median(effort)) if effort else np.nan
    return (
        name, seeds, len(proved), int((gaps <= HIT).sum()), float(values.min()), float(np.median(values)),
        float(np.median(gaps)), float(gaps.max()), generations, median, of, seconds,
    )  # fmt: skip
