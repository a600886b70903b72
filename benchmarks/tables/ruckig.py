"""Random moves of a UR5, rest to rest, beside Ruckig.

Ruckig's duration is the optimum for bounded velocity, acceleration and jerk (Berscheid and Kroeger, 2021), which is
all it knows of; with bounded snap and torques on top the moves are solved and proved as well, and last longer.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache

import numpy as np
from ruckig import Trajectory

import ocp_traj as ot
from benchmarks.exact_curves import of_states
from benchmarks.judge import Bounds, Made, PinArm, judged, of_curve, requirements
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.peers.ruckig_move import BEST, SETTINGS, at, breaks
from benchmarks.peers.ruckig_move import move as by_ruckig
from benchmarks.tables.words import done, median, percent, ratios, spread, table
from ocp_traj.formulation.levels import usual_levels
from tests.quintics import PAYLOAD, move, refined, ur5

TITLE = "Moves from rest to rest, beside Ruckig"
SNAP = 1500.0  # [rad/s4], our choice
THIRD = ("velocity", "acceleration", "jerk")
LIMITS = {  # quantities that are bounded, degree of our pieces
    "up to jerk": (THIRD, 5),
    "and torques": ((*THIRD, "effort"), 5),
    "and torques and snap": ((*THIRD, "effort", "snap"), 7),
}
CAN = (  # what each can bound, as its manual says; the first line was tried
    ("position on the way", "no: it takes `max_position` and goes beyond it", "yes, proved"),
    ("velocity, acceleration, jerk", "yes, and at its optimum", "yes, proved"),
    ("snap", "no", "yes, proved"),
    ("torques, payload", "no", "yes, proved"),
    ("tool, clearances", "no", "yes, proved"),
    ("points on the way", "by its cloud service", "yes"),
    ("begin and end in motion", "yes", "at rest up to a chosen derivative"),
    ("objective", "time", "time, effort and others, fronts of them"),
    ("within a control cycle", "yes", "no"),
)


@cache
def arm(limits: str) -> tuple[ot.Robot, Bounds]:
    """The UR5, and its bounds."""
    names, _ = LIMITS[limits]
    robot = ur5(snap=(SNAP,) * 6) if "snap" in names else ur5()
    return robot, {name: np.array(robot.limits.bounds(name)) for name in names}


def cells(quick: bool) -> Iterator[Cell]:
    """200 moves, up to jerk, with torques, and with snap; when quick 8, 5 and 5."""
    for limits in LIMITS:
        for seed in range((8 if limits == "up to jerk" else 5) if quick else 200):
            yield Cell("ours", limits, "", seed)
            yield Cell("Ruckig", limits, BEST, seed)
    for setting in SETTINGS:
        for seed in range(0 if setting == BEST else 5 if quick else 20):
            yield Cell("Ruckig", "up to jerk", setting, seed)


def measure(cell: Cell) -> Figures:
    """One move by one tool, building included."""
    (robot, bounds), points, degree = arm(cell.subject), move(cell.repeat), LIMITS[cell.subject][1]
    torque, rest = "effort" in bounds, 3 if "snap" in bounds else 2  # derivatives that vanish at both ends
    if cell.tool == "ours":
        coarsest, finest = usual_levels(degree, stops_only=True)
        ot.solve(refined(robot, points, coarsest, coarsest, torque=torque, degree=degree, rest=rest))  # warm
        begun = time.process_time()
        found = ot.solve(refined(robot, points, coarsest, finest, torque=torque, degree=degree, rest=rest))
        spent = time.process_time() - begun
        if found.trajectory is None:
            return {"cpu": spent, "failed": found.explain()}
        made = of_curve(found.trajectory.curve)
    else:
        most = [np.array(robot.limits.bounds(name))[1] for name in THIRD]
        by_ruckig(*points, *most, cell.setting)  # warm
        begun = time.process_time()
        moved = by_ruckig(*points, *most, cell.setting)
        spent = time.process_time() - begun
        made = of_ruckig(moved)
    machine = PinArm(robot, PAYLOAD) if torque else None
    return {"cpu": spent, **judged(made, bounds, machine, requirements(robot, bounds, PAYLOAD))}


def of_ruckig(moved: Trajectory) -> Made:
    """Its cubics between the instants at which a jerk changes."""
    times = breaks(moved)
    q, v, a = (at(moved, times, order) for order in range(3))
    jerk = np.diff(a, axis=0) / np.diff(times)[:, None]
    states = np.stack([q[:-1], v[:-1], a[:-1], jerk], axis=1)

    def sample(t: np.ndarray, order: int) -> np.ndarray:
        return np.zeros((len(t), q.shape[1])) if order > 3 else at(moved, t, order)

    return Made(float(moved.duration), sample, of_states(times, states))


def _over(lines: Lines, name: str, subject: str) -> list[float]:
    return ratios(lines, name, {"tool": "ours", "subject": subject},
                  {"tool": "Ruckig", "subject": subject, "setting": BEST})  # fmt: skip


def text(lines: Lines) -> str:
    """The section."""
    rows, settings = [], []
    for limits in LIMITS:
        ours = done(lines, tool="ours", subject=limits)
        theirs = done(lines, tool="Ruckig", subject=limits, setting=BEST)
        rows.append([
            limits, f"{sum(one['proved'] for one in ours)} of {len(lines.of(tool='ours', subject=limits))}",
            f"{sum(one['excess'] <= 1e-9 and not one['jumps'] for one in theirs)} of {len(theirs)}",
            spread(_over(lines, "duration", limits), ".4f"), percent([one["excess"] for one in ours]),
            percent([one["excess"] for one in theirs]), median([one["cpu"] for one in ours]),
            median([1e6 * one["cpu"] for one in theirs]),
        ])  # fmt: skip
    for setting in SETTINGS:
        over = ratios(lines, "duration", {"tool": "Ruckig", "subject": "up to jerk", "setting": setting},
                      {"tool": "Ruckig", "subject": "up to jerk", "setting": BEST})  # fmt: skip
        settings.append([setting, str(len(over)), spread(over, ".5f")])
    return f"""Random moves of a UR5, each joint within a radian of home. Ruckig is given the limits up to jerk, all it
takes; its trajectories are then judged by all limits of the row.

{
        table(
            (
                "limits",
                "ours proved",
                "Ruckig within them by the scan",
                "duration, ours over Ruckig",
                "excess, ours",
                "excess, Ruckig",
                "ours [s]",
                "Ruckig [us]",
            ),
            rows,
        )
    }

Settings of Ruckig's synchronisation, tried on the first row; the first is used above:

{table(("setting", "moves", "duration over the first"), settings)}

{table(("what can be limited or wanted", "Ruckig", "ours"), CAN)}

What it means: Ruckig's durations are the optimum where limits end with jerk; ours come within the ratio above with
pieces of polynomials, and keep torques and snap besides, of which Ruckig knows nothing. Ruckig is ahead in seconds by
four orders or more: it has the optimum in closed form, made for a control cycle. Where limits end with jerk and there
is nothing on the way, use Ruckig."""


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    over = _over(lines, "duration", "up to jerk")
    if not over:
        return {}
    ours = done(lines, tool="ours")
    return {
        "ruckig.duration": (median(over, ".3f"), "duration over Ruckig's optimum, median, limits up to jerk"),
        "ruckig.proved": (
            f"{sum(one['proved'] for one in ours)} of {len(lines.of(tool='ours'))}",
            "moves proved, all limits",
        ),
    }


def behind(lines: Lines) -> list[str]:
    """Seconds, and what is left of the duration."""
    over, spent = _over(lines, "duration", "up to jerk"), _over(lines, "cpu", "up to jerk")
    return [] if not over else [
        f"Ruckig is {median(spent, '.2g')} times as fast on a move from rest to rest, and its duration is the optimum: "
        f"ours is {spread(over, '.4f')} times that. Finer pieces come closer; a closed form for limits up to jerk is "
        "Ruckig's own, and a task that needs no more should use it."
    ]  # fmt: skip
