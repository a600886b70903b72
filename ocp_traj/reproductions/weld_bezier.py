"""Ogbemhe et al. reproduced as far as the text goes: its tables decoded, and MOGA beside HMOGA on a case of ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import casadi
import numpy as np
import pandas as pd
from pymoo.algorithms.moo.nsga2 import NSGA2 as PymooNSGA2
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM

from ocp_traj import problems
from ocp_traj.api.solving import solve
from ocp_traj.arrays import Array
from ocp_traj.errors import NoSolutionFound
from ocp_traj.evolution.elitism import ControlledElitism
from ocp_traj.evolution.evolution import PymooProblem, evolve
from ocp_traj.evolution.generations import crowding_distances, spread
from ocp_traj.evolution.outcome import front_of
from ocp_traj.formulation.problem import Problem
from ocp_traj.problems import kr90
from ocp_traj.progress import Progress
from ocp_traj.reproductions.comparison import Reproduction, Run, named_objectives
from ocp_traj.reproductions.courses import Generations
from ocp_traj.reproductions.draft import Draft, Keep, ignore
from ocp_traj.reproductions.weld_bezier_errata import equation_errata
from ocp_traj.reproductions.weld_bezier_tables import GENERATIONS, POPULATION, TABLE_7, durations, outside, table_2
from ocp_traj.results.front import Front
from ocp_traj.results.pareto_set import ParetoSet
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import slow_down
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.solvers.front_tracer import FrontTracer
from ocp_traj.solvers.hmoga import HMOGA
from ocp_traj.solvers.nsga2 import NSGA2

TRADED = ("air_time", "dynamic_effort")
POINTS = 15  # of the traced front, and refined at most: our choice
RANDOM, FROM_ENDS = "from random points", "MOGA from IPOPT's ends"


def run(seeds: int, progress: Progress, keep: Keep = ignore) -> Reproduction:
    """All of the paper's numbers beside ours; see ``ocp_traj.reproductions.reproduce.reproduce``."""
    from ocp_traj.reproductions import weld_bezier_figures as figures  # Matplotlib is slow to import

    seam = problems.load("weld-bezier")
    total = 4 + (1 + 3 * seeds if seeds else 0)
    draft = Draft("weld-bezier", seam.about.reference, total, progress, keep, figures.FIGURES)
    sheet, runs, extra = draft.sheet, draft.runs, draft.extra
    draft.begin("tables")
    extra["Table 2 without its slips, ends at their limits after one second"] = table_2(sheet)
    extra["Least durations that Table 3 allows, from rest to rest"] = durations(sheet)
    cells = extra["Cells of Tables 5 to 11 beyond the limits"] = outside()
    note = "the text has all of them within; Table 8 repeats Table 9 and is not counted"
    item, beyond = f"cells beyond the limits, of {cells['of'].sum()}", float(cells["outside"].sum())
    sheet.expect("Tables 5-11", item, 0.0, beyond, tolerance=0.0, note=note)
    draft.begin("the seam")
    solved = {"seam": (seam, solve(seam).require())}
    for words, rest in (("air move", False), ("air move, rest at the via point", True)):
        draft.begin(words)
        problem = problems.load("weld-bezier", case="air-move", rest_at_tags=rest)
        solved[words] = (problem, solve(problem, objective="air_time").require())
    for words, (problem, found) in solved.items():
        assert found.audit is not None
        named = named_objectives(problem, found.objectives)
        method = "exchange, IPOPT, sum of objectives" if words == "seam" else "exchange, IPOPT, least time"
        runs.append(Run("ours", method, words, 0, named, found.seconds, found.iterations, found.audit.verdict))
    extra["In place of R-square"] = quality(solved)
    for method, line in TABLE_7.items():
        values = {
            "trajectory time [s]": line.trajectory_time, "spread [-]": line.spread,
            "average distance [-]": line.distance,
        }  # fmt: skip
        runs.append(Run("paper", method, "motion not given", None, values, line.seconds, line.evaluations))
    if seeds:
        title = f"MOGA beside HMOGA on the air move, {seeds} seed{'' if seeds == 1 else 's'}: medians"
        move, least = solved["air move"]
        extra[title], found_fronts = fronts(move, seeds, runs, draft)
        drawn(draft, move, least, found_fronts)
    return draft.finish(equation_errata(signed_torques(*solved["air move"])))


def drawn(draft: Draft, move: Problem, least: Solution, found: Sequence[_Found]) -> None:
    """The figures of MOGA and HMOGA, of the first seed: from random points, or where nothing is feasible, the ends."""
    from ocp_traj.reproductions import weld_bezier_figures as figures  # Matplotlib is slow to import

    by_method = {one.method: one for one in reversed(found)}  # of each the first
    assert least.trajectory is not None
    for method, names in (("MOGA", (f"MOGA {RANDOM}", FROM_ENDS)), ("HMOGA", ("HMOGA",))):
        for name in names:
            front = by_method[name].front
            if front is None:
                continue
            fastest = front.trajectory(int(np.argmin(front.values[:, 0])))
            words = f"the fastest point of {name}, since {names[0]} nothing is feasible; else as above"
            figures.motions(draft, move, method, fastest, "" if name == names[0] else words, least.trajectory)
            break
    generations = by_method[FROM_ENDS].generations
    if generations is not None:
        figures.generations(draft, TRADED, generations)


# --- what one trajectory is worth ---


def quality(solved: dict[str, tuple[Problem, Solution]]) -> pd.DataFrame:
    """Share of each limit that is used, the tip's error, and jumps at the tags: of each trajectory a column."""
    columns: dict[str, dict[str, str]] = {}
    for words, (problem, found) in solved.items():
        assert found.audit is not None and found.trajectory is not None
        rows: dict[str, str] = {}
        for limit in problem.requirements.path_constraints:
            worst = min((row for row in found.audit.rows if row.limit == limit.id), key=lambda row: row.margin)
            rows[f"{limit.id}, share used"] = f"{1.0 - worst.margin:.4f} ({worst.label})"
        for name, value, unit in problem.about.figures(found.trajectory) if problem.about.figures is not None else ():
            rows[f"{name} [{unit}]"] = f"{value:.4g}"
        for order, jump in zip(("q", "v", "a", "jerk", "snap"), jumps(found.trajectory), strict=True):
            rows[f"jump of {order} at the tags, of its largest value"] = f"{jump:.1g}"
        columns[words] = rows
    return pd.DataFrame(columns).fillna("-").rename_axis("figure").reset_index()


def jumps(motion: Trajectory) -> Array:
    """Largest jump at an inner knot of each derivative, in units of its largest value anywhere ``(5,)``."""
    curve, found = motion.curve, []
    for order in range(5):
        largest = max(max(-e.lower, e.upper) for e in curve.extrema(order))
        steps = [np.abs(curve.at(k, 1.0, order) - curve.at(k + 1, 0.0, order)).max() for k in range(curve.segments - 1)]
        found.append(float(max(steps)) / largest)
    return np.array(found)


def signed_torques(problem: Problem, found: Solution) -> tuple[float, float]:
    """Least sum of the joints' torques [N m] along a motion, and along its path twice as fast."""
    assert problem.dilate is not None
    q, v, a = (casadi.SX.sym(name, 6) for name in "qva")
    total = casadi.Function("total", [q, v, a], [casadi.sum1(kr90.torque(problem.robot, q, v, a))])
    u = np.linspace(0.0, 1.0, 400)
    least = []
    for s in (1.0, 0.5):
        curve = trajectory_of(problem, problem.dilate(found.x, s)).curve
        states = [np.concatenate([curve.at(k, u, order) for k in range(curve.segments)]).T for order in range(3)]
        least.append(float(np.array(total.map(states[0].shape[1])(*states)).min()))
    return least[0], least[1]


# --- fronts ---


@dataclass(frozen=True, eq=False)
class _Found:
    """A front, or None where nothing was feasible, what it took, and of a genetic algorithm how it went."""

    method: str
    seed: int | None
    front: Front | None
    evaluations: int
    iterations: int
    seconds: float
    generations: Generations | None = None


def fronts(problem: Problem, seeds: int, runs: list[Run], draft: Draft) -> tuple[pd.DataFrame, list[_Found]]:
    """Both genetic algorithms from random points, MOGA from IPOPT's ends, HMOGA and the traced front, in one box."""
    found: list[_Found] = []
    draft.begin("traced front")
    traced = FrontTracer(POINTS, progress=draft.within("traced front")).pareto(problem, TRADED)
    found.append(_proved(problem, traced, "trace", traced.xs, 0, traced.info["iterations"], traced.seconds))
    for seed in range(seeds):
        draft.begin(f"HMOGA, seed {seed}")
        told = draft.within(f"HMOGA, seed {seed}")
        recipe = HMOGA(seed, points=POINTS, population=POPULATION, generations=GENERATIONS, progress=told)
        hybrid = recipe.pareto(problem, TRADED)
        info = hybrid.info
        ends = info["ends"]
        before = ends["points"] + info["genetic front"]
        counts = info["evaluations"], ends["iterations"], ends["seconds"] + info["evolution seconds"]
        ended = _proved(problem, hybrid, FROM_ENDS, hybrid.xs[:before], *counts)
        found.append(replace(ended, generations=_generations(recipe, info["history"], ended.front)))
        spent = info["evaluations"], ends["iterations"] + info["iterations"], hybrid.seconds
        found.append(_proved(problem, hybrid, "HMOGA", hybrid.xs, *spent))
        for name, method in (
            (f"MOGA {RANDOM}", partial(evolution_alone, recipe)),
            (f"NSGA-II {RANDOM}", NSGA2(seed, population=POPULATION, generations=GENERATIONS).pareto),
        ):
            draft.begin(f"{name}, seed {seed}")
            try:
                plain = method(problem, TRADED)
            except NoSolutionFound:  # its hypervolume is none
                found.append(_Found(name, seed, None, POPULATION * GENERATIONS, 0, np.nan))
                continue
            found.append(_proved(problem, plain, name, plain.xs, plain.info["evaluations"], 0, plain.seconds))
    filled = [one.front for one in found if one.front is not None]
    ideal = {name: min(front.ideal[name] for front in filled) for name in TRADED}
    rows = []
    for one in found:
        values = _figures(one.front, ideal)
        best = {} if one.front is None else named_objectives(problem, one.front.ideal)
        named = {**best, "hypervolume [-]": values[1], "spread [-]": values[2], "average distance [-]": values[3]}
        verdict = "proved" if one.front is not None else "nothing feasible"
        runs.append(Run("ours", one.method, "air move", one.seed, named, one.seconds, one.evaluations, verdict))
        rows.append((one.method, *values, one.evaluations, one.iterations, one.seconds))
    names = ["points", "hypervolume", "spread", "average distance", "evaluations", "IPOPT iterations", "seconds"]
    table = pd.DataFrame(rows, columns=["method", *names])
    medians = table.groupby("method", sort=False)[names].median()
    medians.insert(0, "runs", table.groupby("method", sort=False).size())
    medians.insert(3, "least hypervolume", table.groupby("method", sort=False)["hypervolume"].min())
    return medians.reset_index(), found


def _generations(recipe: HMOGA, history: Mapping[str, Any], front: Front | None) -> Generations | None:
    """How the hybrid's genetic algorithm went, and the front it ended in."""
    if front is None:
        return None
    distances = crowding_distances(front.values)
    limits = recipe.generations, recipe.stall, recipe.function_tolerance
    return Generations(pd.DataFrame(history), *limits, front.values, distances)


def evolution_alone(recipe: HMOGA, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
    """The hybrid's genetic algorithm with nothing of IPOPT's: its first generation is random, nothing is refined."""
    rng = np.random.default_rng(recipe.seed)
    target = PymooProblem(problem, objectives, recipe.per_segment, tolerance=recipe.constraint_tolerance)
    algorithm = PymooNSGA2(
        pop_size=recipe.population,
        sampling=np.array([problem.guess(rng) for _ in range(recipe.population)]),
        crossover=SBX(prob=recipe.crossover, eta=recipe.crossover_index),
        mutation=PM(prob=1.0, prob_var=recipe.mutation, eta=recipe.mutation_index),
        survival=ControlledElitism(recipe.pareto_fraction),
    )
    algorithm.tournament_type = "comp_by_rank_and_crowding"
    run = evolve(algorithm, target, recipe.generations, recipe.seed, recipe.max_seconds, recipe.progress)
    return front_of(run, target, problem, "moga", recipe.seed, recipe.population, recipe.generations)


def _proved(
    problem: Problem, run: ParetoSet, method: str, xs: Sequence[Array], evaluations: int, iterations: int,
    seconds: float,
) -> _Found:  # fmt: skip
    mended, _ = slow_down(problem, xs)
    front = Front.of(problem, TRADED, mended, method=method, seed=run.seed, seconds=seconds)
    return _Found(
        method, None if method == "trace" else run.seed, front if len(front) else None, evaluations, iterations, seconds
    )


def _figures(front: Front | None, ideal: dict[str, float]) -> tuple[Any, ...]:
    """Points, hypervolume, and the paper's spread and average distance."""
    if front is None:
        return 0, 0.0, np.nan, np.nan
    distances = crowding_distances(front.values)
    finite = distances[np.isfinite(distances)]
    average = float(finite.mean()) if len(finite) else np.nan
    return len(front), front.hypervolume(ideal=ideal).value, spread(distances, np.zeros(2)), average
