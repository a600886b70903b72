"""Zhu and Wang beside ours: what their times need, their recipe, their swarm, and the errata with what shows them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from ocp_traj.api import solve
from ocp_traj.comparison import Erratum, Reproduction, Run, Sheet, named_objectives
from ocp_traj.curves import polynomial_353
from ocp_traj.nlp import Solution
from ocp_traj.problem import Problem
from ocp_traj.problems import load
from ocp_traj.problems import rotor_353 as paper
from ocp_traj.progress import Progress
from ocp_traj.scalarise import WeightedSum
from ocp_traj.solvers.branch_and_bound import BranchAndBound
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.pso import PSO, SCHEDULES

Array = NDArray[np.float64]

TIME = WeightedSum({"time": 1.0})
HIT = 1e-3  # relative: a run this close to the certified optimum has found it; our choice
SIGNS = {"sign mended": False, "as printed": True}
STARTS = 20  # of IPOPT beside the swarms
SWARM_STEPS = len(SCHEDULES)


def run(seeds: int, progress: Progress) -> Reproduction:
    """Everything the paper reports, beside ours; ``seeds`` runs of each swarm."""
    steps, done = 5 + SWARM_STEPS * seeds, 0

    def told(words: str) -> None:
        nonlocal done
        done += 1
        progress(done, steps, words)

    sheet = Sheet()
    problems = {name: load("rotor-353", as_printed=printed) for name, printed in SIGNS.items()}
    best = {name: solve(problem) for name, problem in problems.items()}
    told("certified optima")
    needs = what_the_times_need(sheet)
    told("published times")
    scan = common_limits()
    told("common limits")
    runs = [_paper_run()]
    for name in SIGNS:
        runs.append(_run("IPOPT with exchange, certified", name, best[name]))
        runs.append(_run("each joint alone, longest phases", name, recipe(sheet, name, best[name])))
    told("the paper's recipe")
    proofs = geometry(sheet)
    told("Table 2")
    extra = {
        "What the published times need": needs,
        "Phases of the recipe with common limits, as multiples of the first": scan,
        "Table 2 by forward kinematics": proofs,
    }
    if seeds:
        extra[f"Swarms on {seeds} seeds, beside IPOPT and branch and bound"] = swarms(
            problems["sign mended"], best["sign mended"], seeds, told
        )
    return Reproduction(
        "rotor-353", problems["sign mended"].reference, tuple(sheet.comparisons), errata(), tuple(runs), extra
    )


def _paper_run() -> Run:
    return Run("paper", "improved PSO", "as printed", None, {"time [s]": paper.TOTAL}, np.nan, None)


def _run(method: str, variant: str, found: Solution) -> Run:
    verdict = found.audit.verdict if found.audit is not None else ""
    named = named_objectives(load("rotor-353"), found.objectives)
    return Run("ours", method, variant, 0, named, found.seconds, found.iterations, verdict)


def what_the_times_need(sheet: Sheet) -> pd.DataFrame:
    """Peak velocity and acceleration of each joint at the published durations, for both signs."""
    rows = []
    for name, printed in SIGNS.items():
        curve = polynomial_353(paper.via_points(paper.ZhuWang(as_printed=printed)), np.array(paper.PHASES))
        peaks = [np.degrees([max(abs(e.lower), abs(e.upper)) for e in curve.extrema(order)]) for order in (1, 2)]
        for j, joint in enumerate(paper.JOINTS):
            rows.append((name, joint, peaks[0][j], peaks[0][j] / paper.VELOCITY[j], peaks[1][j]))
    columns = ["variant", "joint", "peak velocity [deg/s]", "of the maker's", "peak acceleration [deg/s2]"]
    table = pd.DataFrame(rows, columns=columns)
    mended = {row[1]: row[4] for row in rows if row[0] == "sign mended"}
    worst = max(mended, key=lambda joint: mended[joint])
    sheet.add(
        "Times", "sum of the phases", str(paper.TOTAL), sum(paper.PHASES), "s", tolerance=0.0005 * 3.0,
        note=f"{worst} needs {mended[worst]:.0f} deg/s2 with them",
    )  # fmt: skip
    return table


def recipe(sheet: Sheet, name: str, best: Solution) -> Solution:
    """Each joint alone, then the longest of each phase, beside the paper's phases and the synchronised optimum."""
    found = solve(load("rotor-353", as_printed=SIGNS[name], timing="per_joint"))
    assert found.audit is not None
    for k, (printed, ours) in enumerate(zip(paper.PHASES, found.x, strict=True), 1):
        note = f"longest of the six joints' own phases {k}, limits of the default case"
        sheet.add("Phases", f"t{k}, {name}", f"{printed:.3f}", float(ours), "s", note=note)
    longer = found.objectives["time"] / best.objectives["time"] - 1.0
    outcome = "within its limits" if found.audit.proved else f"outside its limits: {found.audit.explain()}"
    note = f"the recipe takes {found.objectives['time']:.4f} s ({longer:+.1%}) and is {outcome}"
    sheet.add("Times", f"total, {name}, synchronised", str(paper.TOTAL), best.objectives["time"], "s", note=note)
    return found


def _alone(points: Array, ratio: float) -> Array:
    """Phases of one joint's shortest motion with |v| <= 1 and |a| <= ratio, by exact peaks and Nelder and Mead."""

    def slowest(z: Array) -> float:
        curve = polynomial_353(points[:, None], np.array([1.0, *np.exp(z)]))
        peaks = [max(abs(e.lower), abs(e.upper)) for order in (1, 2) for e in curve.extrema(order)]
        return float(max(peaks[0], np.sqrt(peaks[1] / ratio)))

    def total(z: Array) -> float:
        return float(slowest(z) * (1.0 + np.exp(z).sum())) if np.abs(z).max() < 6.0 else 1e9

    starts = [np.zeros(2), np.array([1.0, 0.0])]
    options: Any = {"xatol": 1e-4, "fatol": 1e-7, "maxiter": 200}
    ends: list[Any] = [minimize(total, z, method="Nelder-Mead", options=options) for z in starts]
    found = min(ends, key=lambda end: end.fun)
    return np.asarray(slowest(found.x) * np.array([1.0, *np.exp(found.x)]))


def common_limits() -> pd.DataFrame:
    """Whether one velocity and one acceleration for all joints explain the published phases.

    Of the recipe's phases with limits v and a only the scale depends on v: their ratios depend on a / v^2 alone. So one
    scan tells, whatever the limits are.
    """
    published = np.array(paper.PHASES[1:]) / paper.PHASES[0]
    rows = []
    for name, printed in SIGNS.items():
        points = np.degrees(paper.via_points(paper.ZhuWang(as_printed=printed)))
        for ratio in np.geomspace(0.003, 3.0, 11):
            phases = np.max([_alone(points[:, j], float(ratio)) for j in range(6)], axis=0)
            ours = phases[1:] / phases[0]
            rows.append((name, ratio, *ours, float(np.abs(np.log(ours / published)).max())))
    columns = ["variant", "a / v^2 [1/deg]", "t2 / t1", "t3 / t1", "distance of the logarithms"]
    table = pd.DataFrame(rows, columns=columns)
    nearest = table.loc[table.groupby("variant", sort=False)["distance of the logarithms"].idxmin()]
    paper_row = pd.DataFrame([("paper", np.nan, *published, 0.0)], columns=columns)
    return pd.concat([paper_row, nearest], ignore_index=True)


def geometry(sheet: Sheet) -> pd.DataFrame:
    """The moves between Table 2's poses, for both signs: turns, their axes, and what stays level."""
    rows = []
    for name, printed in SIGNS.items():
        poses = paper.forward_kinematics(paper.via_points(paper.ZhuWang(as_printed=printed)))
        for k in range(3):
            turn = Rotation.from_matrix(poses[k + 1, :3, :3] @ poses[k, :3, :3].T).as_rotvec(degrees=True)
            angle = float(np.linalg.norm(turn))
            move = (poses[k + 1, :3, 3] - poses[k, :3, 3]) * 1e3
            upright = abs(turn[2]) / angle
            rows.append((name, f"X{k} to X{k + 1}", angle, upright, move[0], move[1], move[2]))
    columns = ["variant", "move", "turn [deg]", "|axis . z|", "x [mm]", "y [mm]", "z [mm]"]
    table = pd.DataFrame(rows, columns=columns)
    first, last, printed_last = table.iloc[0], table.iloc[2], table.iloc[5]
    note = "Table 2 in degrees, pendant's joint 3, a = 195 mm: the first move keeps its height, to the digits printed"
    sheet.add("Table 2", "height of X1 over X0", "0", float(first["z [mm]"]), "mm", tolerance=0.02, note=note)
    turned = float(printed_last["turn [deg]"])
    note = f"with -63.179 the last move is a translation; with the printed sign it turns {turned:.1f} deg"
    sheet.add("Table 2", "turn from X2 to X3", "0", float(last["turn [deg]"]), "deg", tolerance=0.002, note=note)
    return table


def swarms(problem: Problem, best: Solution, seeds: int, told: Any) -> pd.DataFrame:
    """Every schedule on the same seeds, with IPOPT and branch and bound in the same run."""
    assert best.certificate is not None
    limit = best.objectives["time"] * (1.0 + HIT)
    rows: list[tuple[Any, ...]] = []
    for schedule in SCHEDULES:
        reached, finals, seconds = [], [], []
        for seed in range(seeds):
            solver = PSO(seed, schedule=schedule)
            begun = time.perf_counter()
            evolution, target = solver.run(problem, "time")
            if evolution.interrupted:
                raise KeyboardInterrupt
            seconds.append(time.perf_counter() - begun)
            reached.append(evolution.reached(limit))
            finals.append(float(evolution.history["best"].iloc[-1]))
            told(f"PSO {schedule}, seed {seed}")
        name = {"adaptive": "PSO, pymoo's own"}.get(schedule, f"PSO {schedule.replace('_', ' ')}")
        rows.append(_row(name, [n for n in reached if n is not None], seeds, finals, seconds, best, "individuals"))
    local: list[Solution] = []
    for seed in range(min(STARTS, seeds)):
        local.append(Exchange().solve(problem, TIME, problem.guess(np.random.default_rng(seed))))
    hits = [s.iterations for s in local if s.ok and s.objectives["time"] <= limit]
    finals = [s.objectives["time"] for s in local if s.ok]
    rows.append(_row("IPOPT with exchange", hits, len(local), finals, [s.seconds for s in local], best, "iterations"))
    begun = time.perf_counter()
    certificate, _ = BranchAndBound().certify(problem, TIME, replace(best, certificate=None))
    seconds = [time.perf_counter() - begun]
    rows.append(
        _row("branch and bound, lower bound", [certificate.boxes], 1, [certificate.lower], seconds, best, "boxes")
    )
    columns = [
        "method",
        "runs",
        f"within {HIT:.1%}",
        "median effort to get there",
        "of",
        "median gap",
        "worst gap",
        "median [s]",
    ]
    return pd.DataFrame(rows, columns=columns)


def _row(
    name: str,
    hits: Sequence[int],
    runs: int,
    finals: Sequence[float],
    seconds: Sequence[float],
    best: Solution,
    of: str,
) -> tuple[Any, ...]:
    gaps = np.array(finals) / best.objectives["time"] - 1.0
    effort = float(np.median(hits)) if hits else np.nan
    return name, runs, len(hits), effort, of, float(np.median(gaps)), float(np.max(gaps)), float(np.median(seconds))


def errata() -> tuple[Erratum, ...]:
    """What must read otherwise, and why."""
    printed = paper.forward_kinematics(paper.via_points(paper.ZhuWang(as_printed=True)))
    radians = np.degrees(np.abs(np.array(paper.TABLE_2)).max())
    reach = float(np.hypot(printed[2, 0, 3], printed[2, 1, 3]))
    return (
        Erratum("Table 1, row 4", "a = 1100 mm", "a = 195 mm", "the maker's description has 0.195 m; d4 is repeated"),
        Erratum("Table 2, unit", "rad", "deg", f"as radians, the largest entry would be {radians:.0f} deg"),
        Erratum(
            "Table 2, joint 3, X2", "63.179", "-63.179",
            f"then X2 to X3 is a pure translation; as printed, the flange is {reach:.3f} m from axis 1 at X2",
        ),
        Erratum(
            "(3)", "theta_2 from k_3; m_13 m_31 = .. = ..", "inverse_kinematics of problems/rotor_353.py",
            "k_3 is defined nowhere, and two lines are run into one",
        ),
        Erratum("(5), (6)", "15 entries", "14 entries", "there are 14 coefficients; the vector has one zero too many"),
        Erratum(
            "(10)", "cos^2(t / T_max)", "w_min + (w_max - w_min) cos^2(pi t / (2 T_max))",
            "without w_min the inertia starts at 0.5, not at w_max = 0.9, and never falls towards w_min",
        ),
        Erratum(
            "sect. 4, limits", "none given", "velocity and acceleration of each joint",
            "no common pair of limits gives the published phases: see the scan over a / v^2",
        ),
    )  # fmt: skip
