"""Guo et al. (2016) reproduced: its tables, the true optimum, NSGA-II with its parameters, and its largest payload."""

from __future__ import annotations

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.problems import hybrid_spline as paper
from ocp_traj.progress import Progress
from ocp_traj.proof.audit import audit
from ocp_traj.reproductions import hybrid_spline_tables as tables
from ocp_traj.reproductions.comparison import Reproduction, Run, Sheet, named_objectives, rounding_effect
from ocp_traj.reproductions.courses import objectives_of
from ocp_traj.reproductions.draft import Draft, Keep, ignore
from ocp_traj.reproductions.hybrid_spline_errata import MISPRINTS, equation_errata
from ocp_traj.reproductions.hybrid_spline_tables import (
    FMINCON,
    LITERAL,
    NSGA_II,
    PHYSICAL,
    PRINTED,
    digits,
    objectives,
    pseudo_inertias,
    spline_knots,
    tracking,
    via_points,
)
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.solvers.nsga2 import NSGA2
from ocp_traj.solvers.payload import along, static_bound
from ocp_traj.transcription.end_states import fixed_values
from ocp_traj.transcription.symbolic import evaluate_objectives, objective_function

STARTS = 3  # random starts of IPOPT: our choice
STEP = 0.05  # [kg] with which a search for the payload would end at the paper's: our guess
ALONE, TOGETHER = "of the cost", "of the four objectives"  # the second, then its least cost, is sect. 4, steps 6 and 7
DESCENT = ("cost", "time", "energy", "jerk", "acceleration")  # followed over generations
# What NSGA-II minimises, in which convention.
GENETIC = (
    (("cost",), ALONE, PHYSICAL),
    (("cost",), ALONE, LITERAL),
    (("time", "energy", "jerk", "acceleration"), TOGETHER, LITERAL),
)


def run(seeds: int, progress: Progress, keep: Keep = ignore) -> Reproduction:
    """All of the paper's numbers beside ours; see ``ocp_traj.reproductions.reproduce.reproduce``."""
    from ocp_traj.reproductions import hybrid_spline_figures as figures  # Matplotlib is slow to import

    cases = {convention: problems.load("hybrid-spline", convention=convention) for convention in paper.CONVENTIONS}
    physical = cases[PHYSICAL]
    total = 1 + 2 * len(paper.CONVENTIONS) + seeds * len(GENETIC)
    draft = Draft(
        "hybrid-spline", physical.about.reference, total, progress, keep, figures.FIGURES, MISPRINTS
    )  # fmt: skip
    sheet, runs = draft.sheet, draft.runs
    runs += reported()
    draft.begin("tables")
    pseudo_inertias(sheet)
    via_points(sheet)
    spline_knots(sheet)
    tracking(sheet)
    for problem in (cases[LITERAL], physical):
        objectives(sheet, problem)
    least: dict[str, float] = {}
    for convention, problem in cases.items():
        draft.begin(f"optimum, {convention}")
        best = optimum(sheet, runs, problem)
        least[convention] = best.objectives["cost"]
        if convention == PHYSICAL:
            assert best.trajectory is not None
            figures.motions(draft, problem, best.trajectory, trajectory_of(problem, paper.TABLE_7))
    descents: dict[str, list[Array]] = {}
    for chosen, words, convention in GENETIC:
        found = []
        for seed in range(seeds):
            draft.begin(f"NSGA-II {words}, {convention}, seed {seed}")
            one, champions = genetic(cases[convention], chosen, words, seed)
            found.append(one)
            if words == ALONE:
                descents.setdefault(convention, []).append(objectives_of(cases[convention], champions, DESCENT))
        if found:
            genetic_costs(sheet, found, words, convention)
        runs += found
    if descents:
        figures.descents(draft, descents, least)
    for convention, problem in cases.items():
        draft.begin(f"payload, {convention}")
        payloads(sheet, problem)
    return draft.finish(equation_errata(physical, cases[LITERAL]))


def reported() -> list[Run]:
    """The paper's own two solutions, Table 9 and sect. 6."""
    problem = problems.load("hybrid-spline")
    return [
        Run("paper", method, "", None, named_objectives(problem, values), tables.SECONDS[method], None)
        for method, values in paper.TABLE_9.items()
    ]


def optimum(sheet: Sheet, runs: list[Run], problem: Problem) -> Solution:
    """The true minimum of the cost beside the paper's two, and the slope that Table 7 leaves unused."""
    convention, index = problem.case.convention, [o.id for o in problem.objectives].index("cost")
    solutions = Multistart(starts=STARTS).solve_all(problem, WeightedSum({"cost": 1.0}))
    if len(solutions) < STARTS:
        raise KeyboardInterrupt
    best = best_of(solutions).require()
    costs = [solution.f for solution in solutions]
    assert best.audit is not None
    note = f"IPOPT, {best.audit.verdict}; {STARTS} random starts end within {max(costs) - min(costs):.0e} of each other"
    sheet.add("Optimum", f"cost of NSGA-II, {convention}", digits(NSGA_II, "cost"), best.f, "-", note=note)
    note = f"mean of 100 random starts of SQP, and of {STARTS} of IPOPT"
    mean = float(np.mean(costs))
    sheet.add("Optimum", f"mean cost of fmincon, {convention}", digits(FMINCON, "cost"), mean, "-", note=note)

    x = casadi.MX.sym("x", problem.size)
    slope = casadi.gradient(objective_function(problem)(x)[index], x)
    gradient = casadi.Function("gradient", [x], [slope])

    def slopes(h: ArrayLike) -> Array:
        return np.array(gradient(np.asarray(h))).ravel()

    at, slack = slopes(paper.TABLE_7), rounding_effect(slopes, paper.TABLE_7, PRINTED)
    k = int(np.argmax(np.abs(at)))
    margin = audit(trajectory_of(problem, paper.TABLE_7), problem.requirements).margin
    note = f"a minimum inside all limits has slope 0; at Table 7 the nearest limit is {margin:.1%} of its size away"
    label, value = f"dFc/dh{k + 1} at Table 7, {convention}", float(at[k])
    sheet.expect("Optimum", label, 0.0, value, "1/s", tolerance=float(slack[k]), note=note)
    seconds, iterations = sum(s.seconds for s in solutions), sum(s.iterations for s in solutions)
    named, method = named_objectives(problem, best.objectives), f"IPOPT, {STARTS} starts"
    runs.append(Run("ours", method, convention, 0, named, seconds, iterations, best.audit.verdict))
    return best


def genetic(problem: Problem, chosen: tuple[str, ...], words: str, seed: int) -> tuple[Run, Array]:
    """NSGA-II with the paper's parameters, and the least cost of its last generation (the paper's, of all).

    Returns:
        the run, and its best individual so far of the first objective, generation by generation ``(G, n)``.
    """
    found = NSGA2(seed=seed).pareto(problem, chosen)
    if found.interrupted:
        raise KeyboardInterrupt
    values = [evaluate_objectives(problem, x) for x in found.xs]
    least = min(range(len(values)), key=lambda i: values[i]["cost"])
    verdict = audit(trajectory_of(problem, found.xs[least]), problem.requirements).verdict
    method, named = f"NSGA-II {words}", named_objectives(problem, values[least])
    evaluations = int(found.info["evaluations"])
    assert found.champions is not None
    one = Run("ours", method, problem.case.convention, seed, named, found.seconds, evaluations, verdict)
    return one, found.champions


def genetic_costs(sheet: Sheet, runs: list[Run], words: str, convention: str) -> None:
    """The paper's least cost beside the mean of our seeds."""
    costs = np.array([run.objectives["cost [-]"] for run in runs])
    spread = float(np.abs(costs - costs.mean()).max())
    seeds = f"mean of {len(costs)} seeds" if len(costs) > 1 else "one seed"
    note = f"{seeds}, {costs.min():.4f} to {costs.max():.4f}; the tolerance is their spread"
    item = f"least cost, NSGA-II {words}, {convention}"
    sheet.add("NSGA-II", item, digits(NSGA_II, "cost"), float(costs.mean()), "-", slack=spread, note=note)


def payloads(sheet: Sheet, problem: Problem) -> None:
    """The largest payload along Table 7 and for every time law, and what the paper's would need."""
    convention, printed = problem.case.convention, f"{paper.LARGEST_PAYLOAD:.2f}"
    carried, bound = along(problem, trajectory_of(problem, paper.TABLE_7)), static_bound(problem)
    reached = f"{carried.binding} reaches its limit at t = {carried.instant:.2f} s"
    if convention == LITERAL:
        first = np.ceil(bound.payload / STEP) * STEP
        reached += f"; a search in steps of {STEP} kg that reports the first mass too many ends at {first:.2f} kg"
    sheet.add("Payload", f"along Table 7, {convention}", printed, carried.payload, "kg", note=reached)
    sheet.add("Payload", f"every time law, {convention}", printed, bound.payload, "kg", note=bound.argument)
    rows = [f for f in fixed_values(problem) if f"{f.limit.id} {f.limit.labels[f.row]}" == bound.binding]
    force = max(abs(float(row.value(float(printed)))) for row in rows)
    note = f"the limit of Table 2, and what {printed} kg need at rest"
    item = f"|{bound.binding.split()[1]}| with {printed} kg, {convention}"
    sheet.add("Payload", item, f"{abs(bound.bound):g}", force, bound.unit, tolerance=0.0, note=note)
