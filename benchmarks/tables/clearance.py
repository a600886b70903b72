"""What a proof of clearances costs beside ``coal`` at so many instants, of the same bodies, pairs and motion.

A UR5 goes over a ball, past a crate and above a floor; its collision meshes are in capsules, or in capsules and
cylinders. The proof holds for all instants and all points of the bodies; ``coal`` looks at the bodies at its instants.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache

import numpy as np

from benchmarks.lines import Cell, Figures, Lines
from benchmarks.peers import coal_scan
from benchmarks.tables.words import done, median, ratios, table
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.proof.audit import audit
from ocp_traj.robot.bodies import box, half_space, sphere
from ocp_traj.robot.body_pairs import obstacle_pairs, self_pairs
from ocp_traj.robot.descriptions import description_urdf
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf_bodies import urdf_bodies

TITLE = "Clearances, beside coal at many instants"
OURS = "proof"
SETTINGS = {"10 000 instants": 10_000, "1000 instants": 1000, "100 instants": 100}
BEST = next(iter(SETTINGS))
TEXT = """A UR5 goes over a ball, past a crate and above a floor in 1.4 s.

{rows}

What samples miss: the least distance there is lies between that proved and that attained; what is missed is reckoned
from the least that anything has found.

{missed}

What it means: the proof is of all instants, costs less than distances at so many, and its bound is as close as it has
to be. Coal is ahead where an answer at one posture is wanted, and it knows meshes, of which the proof sees capsules,
cylinders and boxes around them. That some pair touches is cheaper to know than how far all are apart; it is no
proof."""
BODIES = {"capsules": False, "capsules and cylinders": True}
CLEARANCE = 0.01  # [m] of what is around
VIA = np.array([
    [-0.9, -1.2, 1.5, -1.8, -1.5, 0.0],
    [0.0, -1.9, 1.3, -1.0, -1.5, 0.0],
    [0.9, -1.0, 1.3, -1.8, -1.5, 0.0],
])  # fmt: skip


def motion(robot: Robot) -> Motion:
    """From rest to rest over the ball, in quintic pieces of 0.7 s."""
    return Motion(
        PiecewiseBezier(np.full(2, 0.7), tuple(np.repeat(VIA[k : k + 2], 3, axis=0) for k in (0, 1))), robot.joints
    )


def constraints(robot: Robot, cylinders: bool) -> tuple[ClearanceConstraint, ...]:
    """Of links with what is around them, and with links that are no neighbours."""
    links = urdf_bodies(robot.model, description_urdf("ur5"), cylinders=cylinders)
    c, s = np.cos(0.3), np.sin(0.3)
    around = (
        sphere("ball", 0, [0.57, 0.02, 0.35], 0.1),
        box("crate", 0, [0.45, -0.55, 0.05], [0.2, 0.2, 0.1], [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
        half_space("floor", [0.0, 0.0, 1.0], -0.1),
    )
    bodies = (*links, *around)
    outer = obstacle_pairs(bodies, range(len(links), len(bodies)))
    inner = self_pairs(robot, bodies, range(len(links))).pairs
    return (
        ClearanceConstraint("clearance", robot, bodies, outer, CLEARANCE),
        ClearanceConstraint("self-clearance", robot, bodies, inner, 0.0),
    )


@cache
def posed(subject: str) -> tuple[Robot, Motion, tuple[ClearanceConstraint, ...], Requirements]:
    """Robot, motion, clearances, and all that is required."""
    robot = Robot.from_description("ur5")
    limits = constraints(robot, BODIES[subject])
    return robot, motion(robot), limits, Requirements(robot.joints, robot.units, (), clearance_constraints=limits)


def cells(quick: bool) -> Iterator[Cell]:
    """Five times each, the fewer instants once; when quick twice."""
    for subject in BODIES:
        for repeat in range(2 if quick else 5):
            yield Cell(OURS, subject, "", repeat)
            yield Cell("coal, distances", subject, BEST, repeat)
            yield Cell("coal, collisions", subject, BEST, repeat)
        yield from (Cell("coal, distances", subject, setting, 0) for setting in SETTINGS if setting != BEST)


def measure(cell: Cell) -> Figures:
    """One proof, or one scan; building is not in it. Distances are the least of each constraint's pairs [m]."""
    robot, moved, limits, wanted = posed(cell.subject)
    if cell.tool == OURS:
        audit(moved, wanted)  # builds the tape
        begun = time.process_time()
        found = audit(moved, wanted)
        spent = time.process_time() - begun
        rows = [[row for row in found.rows if row.limit == limit.id] for limit in limits]
        return {
            "cpu": spent, "pairs": sum(len(limit.pairs) for limit in limits), "verdict": found.verdict,
            "proved": found.proved, "least": [min(row.proved_bound for row in some) for some in rows],
            "attained": [min(row.attained for row in some) for some in rows],
        }  # fmt: skip
    bodies = coal_scan.geometry(
        ((body.name, body.joint, *body.coal()) for body in limits[0].bodies),
        (pair for limit in limits for pair in limit.pairs),
    )
    postures = moved.curve(np.linspace(0.0, moved.duration, SETTINGS[cell.setting]))
    scan = coal_scan.least if cell.tool == "coal, distances" else coal_scan.collides
    scan(robot.model, bodies, postures[:2])  # warm
    begun = time.process_time()
    seen = scan(robot.model, bodies, postures)
    spent, first = time.process_time() - begun, len(limits[0].pairs)
    if cell.tool == "coal, collisions":
        return {"cpu": spent, "touching": int(seen)}
    return {"cpu": spent, "least": [float(seen[:first].min()), float(seen[first:].min())]}


def text(lines: Lines) -> str:
    """The section."""
    rows, missed = [], []
    for subject in BODIES:
        ours = done(lines, tool=OURS, subject=subject)
        if not ours:
            continue
        for name in ("coal, distances", "coal, collisions"):
            theirs = done(lines, tool=name, subject=subject, setting=BEST)
            over = _over(lines, subject, name)
            rows.append([
                f"{subject}, {ours[0]['pairs']} pairs", ours[0]["verdict"], f"{name}, {BEST}", str(len(ours)),
                median([one["cpu"] for one in ours]), median([one["cpu"] for one in theirs]), median(over),
            ])  # fmt: skip
        scans = done(lines, tool="coal, distances", subject=subject)
        for setting in SETTINGS:
            for one in done(lines, tool="coal, distances", subject=subject, setting=setting)[:1]:
                for k, name in enumerate(("to what is around", "of links")):
                    found = (ours[0]["least"][k], ours[0]["attained"][k], one["least"][k])
                    shown = [f"{1e3 * distance:.4f}" for distance in found]
                    known = min(found[1], *(scan["least"][k] for scan in scans))
                    missed.append([subject, name, setting, *shown, f"{1e6 * (found[2] - known):.2g}"])
    head = ("bodies", "verdict", "beside", "runs", "proof [s]", "coal [s]", "proof over coal")
    other = (
        "bodies",
        "distance",
        "instants",
        "proved [mm]",
        "attained [mm]",
        "seen by coal [mm]",
        "missed, no less than [um]",
    )
    return TEXT.format(rows=table(head, rows), missed=table(other, missed))


def _over(lines: Lines, subject: str, tool: str) -> list[float]:
    return ratios(lines, "cpu", {"tool": OURS, "subject": subject},
                  {"tool": tool, "subject": subject, "setting": BEST})  # fmt: skip


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    over = [ratio for subject in BODIES for ratio in _over(lines, subject, "coal, distances")]
    what = f"seconds of the proof over those of coal's distances at {BEST}, median"
    return {"clearance.ratio": (median(over, ".2f"), what)} if over else {}


def behind(lines: Lines) -> list[str]:
    """Where a scan is quicker."""
    words = []
    for subject in BODIES:
        for name in ("coal, distances", "coal, collisions"):
            over = _over(lines, subject, name)
            if over and np.median(over) > 1.0:
                words.append(f"{name} at {BEST}, {subject}: the proof takes {median(over)} times as long.")
    return words
