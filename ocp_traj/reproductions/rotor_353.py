"""Zhu and Wang reproduced: tables, what the published times need, recipe and swarms beside the certified optimum."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from ocp_traj import problems
from ocp_traj.api.solving import solve
from ocp_traj.arrays import Array
from ocp_traj.curves.families import polynomial_353
from ocp_traj.curves.motion import Motion
from ocp_traj.problems import m10id
from ocp_traj.problems import rotor_353 as paper
from ocp_traj.progress import Progress
from ocp_traj.reproductions import rotor_353_convergence
from ocp_traj.reproductions.comparison import Reproduction, Run, Sheet, rounding_effect
from ocp_traj.reproductions.draft import Draft, Keep, ignore
from ocp_traj.reproductions.rotor_353_errata import (
    MISPRINTS,
    TABLE_1_PRINTED,
    TABLE_2_PRINTED,
    equation_errata,
    turn,
)
from ocp_traj.reproductions.rotor_353_limits import closest_phases
from ocp_traj.reproductions.rotor_353_swarms import swarms
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.pso import SCHEDULES

STARTS = 3  # random starts of IPOPT: our choice
TOTAL = f"{paper.TOTAL:.3f}"  # as printed
PRINTED = 0.0005  # [deg], half a unit of Table 2's last digit
SIGNS = {False: "corrected sign", True: "printed sign"}
TIMINGS = {"synchronised": "all joints together", "per_joint": "every joint alone"}
FREE = {"position_limits": False, "effort_limits": False}  # (14) and (15) are the paper's limits


def run(seeds: int, progress: Progress, keep: Keep = ignore) -> Reproduction:
    """All of the paper's numbers beside ours; see ``ocp_traj.reproductions.reproduce.reproduce``."""
    from ocp_traj.reproductions import rotor_353_figures as figures  # Matplotlib is slow to import

    plain = problems.load("rotor-353")
    steps = 2 + len(SIGNS) * (1 + len(paper.TIMINGS))
    total = steps + seeds * len(SCHEDULES) + rotor_353_convergence.runs(seeds)
    draft = Draft("rotor-353", plain.about.reference, total, progress, keep, figures.FIGURES, MISPRINTS)
    sheet, runs = draft.sheet, draft.runs
    draft.begin("tables")
    draft.extra["What the published times need"] = demand_table()
    tables(sheet)
    draft.begin("poses")
    poses(sheet)
    for sign, words in SIGNS.items():
        draft.begin(f"published times, {words}")
        published(sheet, runs, sign)
    found: dict[tuple[bool, str], Solution] = {}
    for sign, words in SIGNS.items():
        for timing in paper.TIMINGS:
            draft.begin(f"{TIMINGS[timing]}, {words}")
            found[sign, timing] = optimum(sheet, runs, sign, timing)
    ours = found[False, "synchronised"].trajectory
    assert ours is not None
    figures.motions(draft, ours, Motion(polynomial_353(paper.via_points(paper.ZhuWang()), phases()), m10id.JOINTS))
    if seeds:
        title = f"Swarms on {seeds} seed{'' if seeds == 1 else 's'}, beside IPOPT and branch and bound"
        draft.extra[title], together = swarms(plain, seeds, draft.begin)
        figures.swarms_together(draft, together.best, together.least)
        table, followed = rotor_353_convergence.convergence(seeds, draft.begin)
        draft.extra["Swarms as the paper ran them, every joint alone"] = table
        figures.swarms_alone(draft, followed)
    return draft.finish(equation_errata(excess(found[True, "per_joint"])))


# --- tables ---


def printed_table_2() -> list[list[str]]:
    """Table 2 as printed, a line a joint."""
    return [line.split() for line in TABLE_2_PRINTED.strip().splitlines()]


def sign_of_joint_3() -> float:
    """Joint 3 at X_2 [deg] with which the move from X_2 to X_3 turns the flange least."""
    points = paper.via_points(paper.ZhuWang())

    def angle(joint: float) -> float:
        moved = points[2:].copy()
        moved[0, 2] = np.radians(joint)
        return turn(*paper.forward_kinematics(moved)[0])[0]

    grid = np.arange(-180.0, 180.0, 1.0)
    best = grid[int(np.argmin([angle(joint) for joint in grid]))]
    return float(minimize_scalar(angle, bounds=(best - 1.0, best + 1.0), method="bounded").x)


def tables(sheet: Sheet) -> None:
    """Table 1 beside the maker's description of the same arm; Table 2's odd number beside what the poses ask for."""
    reached = np.cumsum([place for place, *_ in m10id.LINKS], axis=0) * 1000.0  # [mm], joints at zero
    lengths = [
        (0.0, reached[0, 2]),
        (reached[1, 0], 0.0),
        (reached[2, 2] - reached[1, 2], 0.0),
        (reached[3, 2] - reached[2, 2], reached[4, 0] - reached[3, 0]),
        (0.0, 0.0),
        (0.0, 1000.0 * m10id.FLANGE),
    ]
    for i, (printed, ours) in enumerate(zip(TABLE_1_PRINTED, lengths, strict=True), 1):
        for name, text, value in zip((f"row {i} a", f"row {i} d"), printed, ours, strict=True):
            sheet.add("Table 1", name, text, float(value), "mm", note="maker's description of the arm")
    (item,) = (key[1] for key in MISPRINTS if key[0] == "Table 2")
    sheet.add("Table 2", item, printed_table_2()[2][2], sign_of_joint_3(), "deg", slack=5.0 * PRINTED)


def poses(sheet: Sheet) -> None:
    """The two moves that show what the tables mean: a turn about the vertical, and a pure translation."""
    printed = np.array(printed_table_2(), dtype=float)
    corrected = np.degrees(paper.via_points(paper.ZhuWang())).T

    def moves(degrees: ArrayLike, case: paper.ZhuWang) -> Array:
        rotation, position = paper.forward_kinematics(np.radians(np.reshape(degrees, (6, 4))).T, case)
        _, axis = turn(rotation[0], rotation[1])
        tilt = np.degrees(np.arctan2(np.hypot(axis[0], axis[1]), abs(axis[2])))
        rise = 1000.0 * abs(position[1, 2] - position[0, 2])
        return np.array([rise, tilt, turn(rotation[2], rotation[3])[0]])

    names = ("X0 to X1, change of height", "X0 to X1, axis of the turn from the vertical", "X2 to X3, turn")
    for angles, case, words in (
        (corrected, paper.ZhuWang(), "corrected"),
        (printed, paper.ZhuWang(as_printed=True), "as printed"),
    ):
        ours = moves(angles, case)
        # An angle is never below zero: to first order the rounding of Table 2 moves it about where it vanishes.
        slack = rounding_effect(partial(_signed_moves, case=case), angles.ravel(), PRINTED)
        for name, value, unit, digits in zip(names, ours, ("mm", "deg", "deg"), slack, strict=True):
            note = "a turn about the vertical and a pure translation are inferred; the tolerance is Table 2's rounding"
            item = f"{name}, Tables 1 and 2 {words}"
            sheet.expect("Poses", item, 0.0, float(value), unit, tolerance=float(digits), note=note)


def _signed_moves(degrees: ArrayLike, case: paper.ZhuWang) -> Array:
    """Height [mm], tilt [deg] and turn [deg] of ``poses`` as vectors, smooth where they vanish; summed by size."""
    rotation, position = paper.forward_kinematics(np.radians(np.reshape(degrees, (6, 4))).T, case)
    angle, axis = turn(rotation[0], rotation[1])
    last, along = turn(rotation[2], rotation[3])
    tilt = np.degrees(axis[:2].sum())
    return np.array([1000.0 * (position[1, 2] - position[0, 2]), tilt, last * along.sum()])


# --- times ---


def phases() -> Array:
    """The published t1, t2, t3 [s]."""
    return np.asarray(paper.PHASES)


def demands(sign: bool) -> Array:
    """Largest |v| [deg/s] and |a| [deg/s^2] of the published times ``(2, 6)``."""
    curve = polynomial_353(paper.via_points(paper.ZhuWang(as_printed=sign)), phases())
    peaks = [[max(-e.lower, e.upper) for e in curve.extrema(order)] for order in (1, 2)]
    return np.asarray(np.degrees(np.array(peaks)))


def demand_table() -> pd.DataFrame:
    """What the published times need of each joint, for both signs."""
    rows = [
        (words, joint, v, v / v_max, a)
        for sign, words in SIGNS.items()
        for joint, v_max, v, a in zip(m10id.JOINTS, m10id.VELOCITY, *demands(sign), strict=True)
    ]
    columns = ["variant", "joint", "peak velocity [deg/s]", "of the maker's", "peak acceleration [deg/s2]"]
    return pd.DataFrame(rows, columns=columns)


def published(sheet: Sheet, runs: list[Run], sign: bool) -> None:
    """The published times: their sum, what they need, and why no limits make them optimal."""
    words, t = SIGNS[sign], phases()
    if not sign:
        named = {"time [s]": paper.TOTAL, **_named(t)}
        runs.append(Run("paper", "PSO, every joint alone", "", None, named, None, None))
        sheet.add("Sect. 4", "t1 + t2 + t3", TOTAL, float(t.sum()), "s", slack=3 * 0.0005)
        shorter = 100.0 * (1.0 - t.sum() / (3.0 * paper.GUESS))
        note = f"against the first guess, {paper.GUESS:g} s a phase; not against another method"
        sheet.add("Sect. 4", "shortened by", f"{paper.SHORTENED:g}", float(shorter), "%", note=note)
    v, a = demands(sign)
    limits = {"velocity": tuple(v), "acceleration": tuple(a)}
    tight = solve(problems.load("rotor-353", as_printed=sign, **limits, **FREE), starts=STARTS).require()
    note = (
        "limits of each joint equal to what the published motion needs; wider ones leave less time still, so that no "
        "limits make the published times optimal for all joints together"
    )
    sheet.add("Sect. 4", f"least time within what the published times need, {words}", TOTAL, tight.f, "s", note=note)
    for family, speeds in (
        ("one limit for all joints", np.ones(6)),
        ("shares of the maker's", np.array(m10id.VELOCITY)),
    ):
        closest, off, ratio = closest_phases(sign, speeds, t)
        for name, text, value in zip(("t1", "t2", "t3"), paper.PHASES, closest, strict=True):
            note = f"a_max {ratio:.3g} v_max per second: of all pairs the closest, a phase {off:.0%} off"
            item = f"{name}, every joint alone, {family}, {words}"
            sheet.add("Sect. 4", item, f"{text:.3f}", float(value), "s", note=note)


def _named(t: Array) -> dict[str, float]:
    return {f"t{k} [s]": float(x) for k, x in enumerate(t, 1)}


def optimum(sheet: Sheet, runs: list[Run], sign: bool, timing: str) -> Solution:
    """Our times with the paper's limits, (14) and (15), and our a_max, all joints together or by the paper's recipe."""
    problem = problems.load("rotor-353", as_printed=sign, timing=timing, **FREE)
    found = solve(problem, starts=STARTS)
    assert found.audit is not None and found.trajectory is not None
    words, together = SIGNS[sign], timing == "synchronised"
    note = f"{'exchange, IPOPT' if together else 'longest of each phase'}, {found.audit.verdict}; a_max is our choice"
    if found.certificate is not None and found.certificate.certified:
        # Rounded down: the bound itself holds to its last digit, a rounded one need not.
        note += f"; certified: nothing below {np.floor(1e6 * found.certificate.lower) / 1e6:.6f} s"
    if not found.audit.proved:
        note += f"; {found.audit.explain()}"
    sheet.add("Sect. 4", f"time, {TIMINGS[timing]}, {words}", TOTAL, float(found.x.sum()), "s", note=note)
    extrema = [found.trajectory.curve.extrema(order) for order in (1, 2)]
    v, a = (np.degrees([max(-e.lower, e.upper) for e in of]) for of in extrema)
    shares = {"v / v_max [-]": (v / m10id.VELOCITY).max(), "a / a_max [-]": (a / paper.ACCELERATION).max()}
    named = {"time [s]": float(found.x.sum()), **_named(found.x), **{k: float(x) for k, x in shares.items()}}
    method = f"exchange, IPOPT, {STARTS} starts, {TIMINGS[timing]}"
    runs.append(Run("ours", method, words, 0, named, found.seconds, found.iterations, found.audit.verdict))
    return found


def excess(recipe: Solution) -> float:
    """By how much the recipe breaks an acceleration limit, relative, at worst."""
    assert recipe.audit is not None
    rows = [row for row in recipe.audit.rows if row.limit == "acceleration-limit"]
    return max(abs(row.attained / row.bound) for row in rows) - 1.0
