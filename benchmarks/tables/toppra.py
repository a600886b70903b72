"""Random paths of arms with six and seven joints, their geometry kept, beside TOPP-RA.

Both go through the same spline over chord length from rest to rest. With bounded jerk, which TOPP-RA has not, the paths
are solved and proved as well, and last longer.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi
import numpy as np
import toppra

import ocp_traj as ot
from benchmarks.arms import FINGERS, random_postures
from benchmarks.exact_curves import of_toppra
from benchmarks.judge import Made, PinArm, judged, of_curve, requirements
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.peers.toppra_retime import BEST, SETTINGS, retime
from benchmarks.tables.words import done, median, percent, ratios, spread, table
from ocp_traj.arrays import Array
from ocp_traj.paths.joint_path import JointPath
from tests.quintics import wander
from tests.retimed import retimed

TITLE = "Paths whose geometry is kept, beside TOPP-RA"
POINTS = 6
NEARER = 0.6  # our choice
PIECES, PIECES_WITH_JERK = 16, 8  # from one point to the next: our choice
FEWER = {"8 pieces": 8, "4 pieces": 4}  # tried beside it
TEXT = """Random paths through {points} points, the same cubic spline over chord length for both, from rest to rest,
limits on velocity, acceleration and, where a mass is named, torques with that payload. Excess is of the scan.

{rows}

TOPP-RA's settings, tried on `ur5`, of which the first is used above, and ours of fewer pieces than {pieces} a leg:

{settings}

What it means: our durations are TOPP-RA's optimum to its grid, and keep every limit at every instant, where its own
motion is a little beyond them between grid points; with its spline parametrizer it is beyond them by far. TOPP-RA is
ahead in seconds: it solves two small linear programmes a grid point in one sweep each way. It knows no jerk."""


@dataclass(frozen=True)
class Ground:
    """An arm and its limits.

    Attributes:
        arm: of ``example-robot-data``.
        acceleration: [rad/s2], our choice, as all of these.
        payload: whose torques are limited [kg]; None where torques are not.
        jerk: [rad/s3], if any.
    """

    arm: str
    acceleration: float
    payload: float | None = None
    jerk: float | None = None


GROUNDS = {
    "ur5": Ground("ur5", 8.0),
    "ur5 with torques": Ground("ur5", 20.0, 5.0),
    "ur5 with jerk": Ground("ur5", 8.0, None, 60.0),
    "panda": Ground("panda", 8.0),
    "panda with torques": Ground("panda", 15.0, 2.0),
    "panda with jerk": Ground("panda", 8.0, None, 60.0),
}


@cache
def robot(ground: Ground) -> ot.Robot:
    """The arm with these limits."""
    size = 6 if ground.arm == "ur5" else 7
    more = {} if ground.jerk is None else {"jerk": (ground.jerk,) * size}
    limits = ot.JointLimits(acceleration=(ground.acceleration,) * size, **more)  # type: ignore[arg-type]
    frame, locked = ("tool0", None) if size == 6 else ("panda_hand_tcp", FINGERS)
    return ot.Robot.from_description(ground.arm, limits=limits, tool_frame=frame, locked=locked)


def path(ground: Ground, seed: int) -> JointPath:
    """A random path through ``POINTS`` points."""
    arm = robot(ground)
    points = wander(POINTS, seed) if arm.size == 6 else random_postures(arm, seed, POINTS)
    if arm.size == 7:  # nearer to their middle: the spline swings out between them
        points = points.mean(axis=0) + NEARER * (points - points.mean(axis=0))
    return JointPath.through(points, arm.joints)


def torques(arm: ot.Robot, payload: float) -> Any:
    """(q, v, a) -> torques ``(n,)``, as TOPP-RA asks for them, by our compiled recursion."""
    q, v, a = (casadi.SX.sym(name, arm.size) for name in "qva")
    compiled = casadi.Function("torque", [q, v, a], [arm.effort(q, v, a, payload=payload)])
    return lambda q, v, a: np.asarray(compiled(q, v, a))[:, 0]


def cells(quick: bool) -> Iterator[Cell]:
    """Fifty paths of each, the other settings on the first five; when quick one, with torques and jerk of one arm."""
    for name, ground in GROUNDS.items():
        if quick and ground.arm != "ur5" and ground != Ground(ground.arm, ground.acceleration):
            continue
        for seed in range(1 if quick else 50):
            yield Cell("ours", name, "", seed)
            if ground.jerk is None:
                yield Cell("TOPP-RA", name, BEST, seed)
    for seed in range(1 if quick else 5):
        yield from (Cell("TOPP-RA", "ur5", setting, seed) for setting in SETTINGS if setting != BEST)
        yield from (Cell("ours", "ur5", setting, seed) for setting in FEWER)


def measure(cell: Cell) -> Figures:
    """One path by one tool, building included."""
    toppra.setup_logging("ERROR")
    ground = GROUNDS[cell.subject]
    arm, along = robot(ground), path(ground, cell.repeat)
    bounds: dict[str, Array] = {
        name: np.array(arm.limits.bounds(name))
        for name in ("velocity", "acceleration", "jerk", "effort")
        if arm.limits.bounds(name) is not None and (name != "effort" or ground.payload is not None)
    }
    pieces = FEWER.get(cell.setting, PIECES if ground.jerk is None else PIECES_WITH_JERK)
    if cell.tool == "ours":
        ot.solve(retimed(arm, along, 1), certify=False)  # warm
        begun, wall = time.process_time(), time.perf_counter()
        found = ot.solve(
            retimed(arm, along, pieces, rest=1 if ground.jerk is None else 2, payload=ground.payload), certify=False
        )
        spent = {"cpu": time.process_time() - begun, "seconds": time.perf_counter() - wall}
        if found.trajectory is None:
            return {**spent, "failed": found.explain()}
        spent |= {"rows": found.row_count, "iterations": found.iterations}
        made = of_curve(found.trajectory.curve)
    else:
        torque = None if ground.payload is None else torques(arm, ground.payload)
        retime(along.curve.knots, along.points, bounds["velocity"].T, bounds["acceleration"].T, None, None)  # warm
        begun, wall = time.process_time(), time.perf_counter()
        timed, spline, _ = retime(
            along.curve.knots, along.points, bounds["velocity"].T, bounds["acceleration"].T,
            torque, bounds["effort"].T if torque is not None else None, cell.setting,
        )  # fmt: skip
        spent = {"cpu": time.process_time() - begun, "seconds": time.perf_counter() - wall}
        if timed is None:
            return {**spent, "failed": "no trajectory"}
        made = Made(float(timed.duration), timed, of_toppra(timed, spline))
    machine = None if ground.payload is None else PinArm(arm, ground.payload)
    return {**spent, **judged(made, bounds, machine, requirements(arm, bounds, ground.payload or 0.0))}


def text(lines: Lines) -> str:
    """The section."""
    rows = []
    for name, ground in GROUNDS.items():
        ours = done(lines, tool="ours", subject=name, setting="")
        theirs = done(lines, tool="TOPP-RA", subject=name, setting=BEST)
        rows.append([
            f"{name}, {ground.acceleration:g} rad/s2" + (f", {ground.payload:g} kg" if ground.payload else "")
            + (f", {ground.jerk:g} rad/s3" if ground.jerk else ""),
            f"{sum(one['proved'] for one in ours)} of {len(lines.of(tool='ours', subject=name, setting=''))}",
            f"{sum(one['proved'] for one in theirs)} of {len(theirs)}" if ground.jerk is None else "has no jerk limit",
            spread(_over(lines, "duration", name), ".4f"),
            percent([one["excess"] for one in ours]), percent([one["excess"] for one in theirs]),
            median([one["cpu"] for one in ours]), median([one["cpu"] for one in theirs]),
            spread(_over(lines, "cpu", name)),
        ])  # fmt: skip
    settings = []
    for setting in SETTINGS:
        some = done(lines, tool="TOPP-RA", subject="ur5", setting=setting)
        over = ratios(lines, "duration", {"tool": "TOPP-RA", "subject": "ur5", "setting": setting},
                      {"tool": "TOPP-RA", "subject": "ur5", "setting": BEST})  # fmt: skip
        settings.append([setting, str(len(some)), spread(over, ".5f"), percent([one["excess"] for one in some]),
                         median([one["cpu"] for one in some])])  # fmt: skip
    for setting in FEWER:
        some = done(lines, tool="ours", subject="ur5", setting=setting)
        over = _over(lines, "duration", "ur5", setting)
        settings.append([f"ours, {setting}", str(len(some)), spread(over, ".5f"),
                         percent([one["excess"] for one in some]), median([one["cpu"] for one in some])])  # fmt: skip
    head = (
        "arm, limits", "ours proved", "TOPP-RA proved", "duration, ours over TOPP-RA", "excess, ours",
        "excess, TOPP-RA", "ours [s]", "TOPP-RA [s]", "seconds, ours over TOPP-RA",
    )  # fmt: skip
    tried = table(("setting", "paths", "duration over the first", "excess", "seconds"), settings)
    return TEXT.format(points=POINTS, pieces=PIECES, rows=table(head, rows), settings=tried)


def _over(lines: Lines, name: str, subject: str, setting: str = "") -> list[float]:
    return ratios(lines, name, {"tool": "ours", "subject": subject, "setting": setting},
                  {"tool": "TOPP-RA", "subject": subject, "setting": BEST})  # fmt: skip


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    plain = ("ur5", "panda")
    over = [ratio for name in plain for ratio in _over(lines, "duration", name)]
    ours = [one for name in GROUNDS for one in done(lines, tool="ours", subject=name, setting="")]
    theirs = [one["excess"] for name in GROUNDS for one in done(lines, tool="TOPP-RA", subject=name, setting=BEST)]
    if not over:
        return {}
    return {
        "toppra.duration": (median(over, ".3f"), "duration over TOPP-RA's, median, velocity and acceleration bounded"),
        "toppra.proved": (
            f"{sum(one['proved'] for one in ours)} of {len(lines.of(tool='ours', setting=''))}",
            "paths proved, all limits",
        ),
        "toppra.excess": (f"{100 * max(theirs):.2g} %", "TOPP-RA's largest excess over a limit, all paths"),
    }


def behind(lines: Lines) -> list[str]:
    """Seconds."""
    over = [ratio for name in GROUNDS for ratio in _over(lines, "cpu", name)]
    if not over:
        return []
    known = [one for one in done(lines, tool="ours", setting="") if "rows" in one]
    size, steps = (median([one[name] for one in known], ".0f") for name in ("rows", "iterations"))
    return [
        f"TOPP-RA times a path {spread(over)} times as fast. It finds one speed along the path in two sweeps; ours is "
        f"a smooth law of time in pieces whose limits hold everywhere, a programme of {size} rows and {steps} "
        "iterations (medians), half or more of whose time is IPOPT's own. To begin at such a sweep would not help: of "
        "`ur5-retime` IPOPT takes 24 iterations from the level before, and from the optimum itself 23 with a narrow "
        "barrier, 51 with the usual one."
    ]
