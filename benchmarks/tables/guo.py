"""Guo's multi-start SQP as it was, by SciPy's SLSQP and trust-constr beside IPOPT, on one NLP and from the same points.

Guo et al. (2016), sect. 6, run MATLAB's fmincon (SQP) from 100 random points and give the mean cost. All see the same
rows at the same few instants with exact gradients; IPOPT has exact second derivatives too. A start has converged where
its solver says so and the rows hold; what it ends in is proved or not as it is, since limits are looked at on instants
alone. The last line is IPOPT with exchange, as the package has it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache

import numpy as np
from scipy.sparse import csr_matrix

from benchmarks.judge import judged_point
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.peers.scipy_minimize import BEST, SETTINGS, solve
from benchmarks.tables.words import done, median, percent, table
from ocp_traj import problems
from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import few_instants
from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.transcription import transcribe

TITLE = "The paper's random starts, beside SciPy"
COST = WeightedSum({"cost": 1.0})
CASE = "paper-literal"  # the paper's reading of energy and payload, whose mean is to be compared
PAPER = (3.220, 3.093)  # mean of 100 SQP runs, NSGA-II: Guo et al., sect. 6
CLOSE = 1e-3  # relative: an end this close to the best of all is that optimum; our choice
FEASIBLE = 1e-6  # of a row's scale: excess that is overlooked; our choice
IPOPT, OURS = "IPOPT, the same rows", "ours: IPOPT with exchange"

TEXT = """The paper gives {mean:.3f} as the mean of 100 runs of fmincon, and {nsga:.3f} as NSGA-II's best. Here, the
same problem in its own reading (`convention={case}`) from random points, the same for all; below the solvers at their
best are the other settings that were tried.

{rows}

What it means: a mean of {mean:.3f} is no matter of the starts, nor of the solver: every start that converges ends
within a thousandth of one optimum below it. What looks at a few instants may break limits between them, whoever solves
it; exchange does not. SciPy's SLSQP is ahead in seconds a start, needs no second derivatives and no other package."""


@cache
def posed() -> tuple[Problem, NLP]:
    """The problem, and the NLP that all see."""
    problem = problems.load("hybrid-spline", convention=CASE)
    return problem, transcribe(problem, COST, few_instants(problem), back_off=0.0)


def cells(quick: bool) -> Iterator[Cell]:
    """100 starts, the settings of SciPy that are not its best on ten; when quick 3, of trust-constr 1."""
    for seed in range(3 if quick else 100):
        for method in BEST:
            if seed == 0 or not quick or method == "SLSQP":
                yield Cell(method, CASE, BEST[method], seed)
        yield Cell(IPOPT, CASE, "", seed)
        yield Cell(OURS, CASE, "", seed)
    for setting, (method, _) in SETTINGS.items():
        if setting not in BEST.values() and not (quick and method == "trust-constr"):
            for seed in range(2 if quick else 10):
                yield Cell(method, CASE, setting, seed)


def excess(nlp: NLP, x: Array) -> float:
    """Largest excess of a row or a bound, rows in their scale."""
    g = nlp.program.values(x)[1]
    return float(
        max((nlp.lower_g - g).max(), (g - nlp.upper_g).max(), (nlp.lower_x - x).max(), (x - nlp.upper_x).max())
    )


def by_scipy(nlp: NLP, x0: Array, setting: str) -> tuple[Array, bool, int]:
    """End, whether SciPy says that it converged, iterations."""
    program = nlp.program
    row, column = (np.array(index) for index in program.jacobian_sparsity.get_triplet())

    def jacobian(x: Array) -> csr_matrix:
        return csr_matrix((program.jacobian(x), (row, column)), shape=(program.rows, program.size))

    return solve(
        lambda x: program.values(x)[0], program.gradient, lambda x: program.values(x)[1], jacobian,
        (nlp.lower_x, nlp.upper_x), (nlp.lower_g, nlp.upper_g), x0, setting,
    )  # fmt: skip


def measure(cell: Cell) -> Figures:
    """One start by one solver; seconds are without proofs, but for exchange, whose rounds end with one."""
    problem, nlp = posed()
    x0 = problem.guess(np.random.default_rng([0, cell.repeat]))
    begun = time.process_time()
    if cell.tool == OURS:
        solution = Exchange().solve(problem, COST, x0)
        x, iterations = solution.x, solution.iterations
        converged = solution.ok and solution.audit is not None and solution.audit.proved
        cost = solution.f
    else:
        if cell.tool == IPOPT:
            found = Ipopt().solve(nlp, x0)
            x, converged, iterations = found.x, found.ok, found.iterations
        else:
            x, converged, iterations = by_scipy(nlp, x0, cell.setting)
        cost = float(nlp.program.values(x)[0])
        converged = converged and np.isfinite(cost) and excess(nlp, x) <= FEASIBLE
    spent = time.process_time() - begun
    return {
        "cpu": spent, "cost": float(cost), "converged": bool(converged), "iterations": int(iterations),
        **judged_point(problem, x),
    }  # fmt: skip


def text(lines: Lines) -> str:
    """The section."""
    ours = [one["cost"] for one in done(lines, tool=OURS) if one["converged"]]
    best = min(ours, default=np.nan)
    named = [(method, BEST[method]) for method in BEST] + [(IPOPT, ""), (OURS, "")]
    others = [(method, setting) for setting, (method, _) in SETTINGS.items() if setting not in BEST.values()]
    rows = [_row(lines, tool, setting, best) for tool, setting in (*named, *others)]
    head = (
        "solver", "starts", "converged", "mean cost", "best", "worst", f"within {CLOSE:.1%}", "iterations", "seconds",
        "proved as found", "excess by the scan",
    )  # fmt: skip
    return TEXT.format(mean=PAPER[0], nsga=PAPER[1], case=CASE, rows=table(head, rows))


def _row(lines: Lines, tool: str, setting: str, best: float) -> list[str]:
    some = done(lines, tool=tool, setting=setting)
    kept = [one["cost"] for one in some if one["converged"]]
    return [
        setting or tool, str(len(some)), str(len(kept)), f"{np.mean(kept):.4f}" if kept else "-",
        f"{min(kept):.4f}" if kept else "-", f"{max(kept):.4f}" if kept else "-",
        str(sum(cost <= (1.0 + CLOSE) * best for cost in kept)), median([one["iterations"] for one in some], ".0f"),
        median([one["cpu"] for one in some]), str(sum(one["proved"] for one in some)),
        percent([one["excess"] for one in some]),
    ]  # fmt: skip


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    ours, theirs = done(lines, tool=OURS), done(lines, tool="SLSQP", setting=BEST["SLSQP"])
    kept = [one["cost"] for one in ours if one["converged"]]
    if not kept or not theirs:
        return {}
    return {
        "guo.cost": (f"{min(kept):.4f}", "least cost of `hybrid-spline` in the paper's reading"),
        "guo.slsqp-iterations": (median([one["iterations"] for one in theirs], ".0f"), "SLSQP's iterations, median"),
        "guo.ours-iterations": (median([one["iterations"] for one in ours], ".0f"), "ours, exchange, median"),
    }


def behind(lines: Lines) -> list[str]:
    """Where SciPy is quicker a start."""
    ours = done(lines, tool=OURS)
    words = []
    for method, setting in BEST.items():
        some = done(lines, tool=method, setting=setting)
        if some and ours and np.median([o["cpu"] for o in some]) < np.median([o["cpu"] for o in ours]):
            words.append(
                f"{setting} takes {median([o['cpu'] for o in some])} s a start where exchange takes "
                f"{median([o['cpu'] for o in ours])} s; exchange solves several programmes and proves the last."
            )
    return words
