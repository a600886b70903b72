"""Tool paths on a UR5 and a Panda: lines, arcs and poses, two tolerances, free turn or none, speed bounded or constant.

Every case whose name has all the parts in it is solved: duration, what an independent dense scan with Pinocchio finds
of distance, tilt and speed, and the verdict. Each is a line of a file: a run that was stopped goes on where it was.

    python -m benchmarks.tool_paths [PART ..] [--output FILE] [--page]
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import ocp_traj as ot
from benchmarks.sections import put
from benchmarks.tables.words import table

SCAN = 20_000  # instants
TILT = 0.035  # [rad]
STARTS = {"ur5": [0.0, -1.3, 1.4, -1.6, -1.5, 0.0], "panda": [0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8]}
ROBOTS: dict[str, dict[str, Any]] = {
    "ur5": {"description": "ur5", "tool_frame": "tool0"},
    "panda": {
        "description": "panda",
        "tool_frame": "panda_hand",
        "locked": {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0},
    },
}


def cases() -> dict[str, dict[str, Any]]:
    """Tasks by name: robot path tolerance turn speed."""
    found = {}
    parts = STARTS, ("line", "arc", "poses"), (1e-3, 2e-4), ("fixed", "free"), ("bounded", "constant")
    for robot, path, tolerance, turn, speed in itertools.product(*parts):
        name = f"{robot} {path} {1e3 * tolerance:g} mm {turn} {speed}"
        found[name] = task(robot, path, tolerance, turn == "free", speed == "constant")
    return found


def task(robot: str, path: str, tolerance: float, free_turn: bool, constant: bool) -> dict[str, Any]:
    """One task, as a file would have it."""
    given = dict(ROBOTS[robot])
    model = ot.Robot.from_description(given.pop("description"), **given)
    turned, (place, *_) = model.poses([STARTS[robot]])
    quaternion = pin.Quaternion(turned[0]).coeffs()
    straight = [float(quaternion[3]), *quaternion[:3].tolist()]
    ways: dict[str, Any] = {
        "line": {"line": {"by": [0.0, 0.3, 0.05]}},
        "arc": {"arc": {"via": (place + [0.05, 0.1, -0.02]).tolist(), "to": (place + [0.0, 0.2, -0.05]).tolist()}},
        "poses": {
            "poses": [
                [*(place + [0.0, 0.15, 0.0]), *straight],
                {"xyz": (place + [-0.1, 0.2, 0.0]).tolist(), "quat_wxyz": straight},
                [*(place + [-0.1, 0.2, -0.1]), *straight],
            ]
        },
    }
    move = {"start": STARTS[robot], **ways[path], "tolerance": {"position": tolerance, "tilt": TILT}}
    if free_turn:
        move["free_turn"] = True
    moves = [move]
    if constant:  # a corner cannot be taken at constant speed: each part is a move of its own
        lines = [{"line": {"to": p["xyz"] if isinstance(p, dict) else p[:3]}} for p in move.get("poses", ())]
        more = {k: v for k, v in move.items() if k not in ("poses", "start")} | {"speed": 0.1}
        moves = [more | line for line in lines] or [move | {"speed": 0.1}]
        moves[0]["start"] = STARTS[robot]
    return {
        "name": f"{robot}-{path}", "robot": ROBOTS[robot],
        "limits": {"acceleration": 8.0, "jerk": 60.0, "tool_speed": 0.25},
        "curve": {"kind": "auto", "finest": 2 if constant else 4}, "move": moves,
    }  # fmt: skip


def scan(problem: ot.Problem, trajectory: ot.Trajectory) -> tuple[float, float, float]:
    """Largest distance [m], tilt [rad] and speed [m/s] at ``SCAN`` instants, by Pinocchio, not by the limits' code."""
    from ocp_traj.formulation.route import route_of

    route = route_of(problem.case, problem.robot.size)
    model, data = problem.robot.model, problem.robot.model.createData()
    path = [move.path for _, move in route.tool_moves]
    wanted = [one.at(s) for one in path for s in np.linspace(0.0, one.length, 4001)]
    places = np.array([frame.translation for frame in wanted])
    free = route.tool_moves[0][1].free_turn
    joint = model.njoints - 1 if problem.robot.tool_joint is None else problem.robot.tool_joint
    spacing = max(one.length for one in path) / 4000.0
    off = tilt = speed = 0.0
    times = np.linspace(0.0, trajectory.duration, SCAN)
    for q, v in zip(trajectory.curve(times), trajectory.curve(times, 1), strict=True):
        pin.forwardKinematics(model, data, q, v)
        tool = data.oMi[joint] * problem.robot.tool
        gap = np.linalg.norm(places - tool.translation, axis=1)
        nearest = int(np.argmin(gap))
        off = max(off, float(np.sqrt(max(gap[nearest] ** 2 - (spacing / 2.0) ** 2, 0.0))))
        goal = wanted[nearest].rotation
        cosine = goal[:, 2] @ tool.rotation[:, 2] if free else (np.trace(goal.T @ tool.rotation) - 1.0) / 2.0
        tilt = max(tilt, float(np.arccos(np.clip(cosine, -1.0, 1.0))))
        speed = max(speed, float(np.linalg.norm(problem.robot.tool.actInv(data.v[joint]).linear)))
    return off, tilt, speed


def measured(fields: dict[str, Any]) -> dict[str, Any]:
    """One case: what came of it, or why nothing did."""
    begun = time.process_time()
    try:
        problem = ot.problems.load("task", **fields)
        solution = ot.solve(problem)
    except ot.OcpTrajError as error:
        return {"verdict": str(error)}
    spent = time.process_time() - begun
    if solution.audit is None or solution.trajectory is None:
        return {"cpu": spent, "verdict": f"{solution.status.value}: {solution.detail}"}
    off, tilt, speed = scan(problem, solution.trajectory)
    return {
        "duration": solution.trajectory.duration, "off": 1e3 * off, "tilt": tilt, "speed": speed, "cpu": spent,
        "verdict": solution.audit.verdict,
    }  # fmt: skip


def section_of(found: dict[str, dict[str, Any]]) -> str:
    """The section of RESULTS.md."""
    proved = sum(row["verdict"] == "proved" for row in found.values())
    columns = {"duration": ".4f", "off": ".4f", "tilt": ".5f", "speed": ".4f", "cpu": ".1f"}
    rows = [
        [name, *(format(row[key], how) if key in row else "-" for key, how in columns.items()), row["verdict"]]
        for name, row in found.items()
    ]
    head = ("case", "duration [s]", "off the path [mm]", "tilt [rad]", "tool speed [m/s]", "seconds", "verdict")
    return (
        f"## Tool paths\n\n`python -m benchmarks.tool_paths --page`: {len(found)} cases, {proved} proved. Limits on "
        f"velocity, acceleration 8 rad/s2, jerk 60 rad/s3, tool speed 0.25 m/s, tilt {TILT} rad; *constant* is 0.1 m/s "
        "within 2 % but for a tenth of the path at either end, where it may be faster. What the tool does is from "
        f"{SCAN} instants, by Pinocchio; seconds are of the processor, building and proof inside.\n\n"
        f"{table(head, rows)}"
    )


def main() -> None:
    """Runs what is not in the output yet, and prints it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", help="of the names of the cases that are run; all if not given")
    parser.add_argument("--output", type=Path, default=Path("runs/tool_paths.jsonl"), help="a line a case")
    parser.add_argument("--page", action="store_true", help="put what came of it on the page of results")
    asked = parser.parse_args()
    asked.output.parent.mkdir(parents=True, exist_ok=True)
    lines = asked.output.read_text().splitlines() if asked.output.exists() else []
    found: dict[str, dict[str, Any]] = {row.pop("case"): row for row in map(json.loads, lines)}
    for name, fields in cases().items():
        if name in found or not all(part in name for part in asked.parts):
            continue
        found[name] = measured(fields)
        with asked.output.open("a") as file:
            file.write(json.dumps({"case": name, **found[name]}) + "\n")
        print(name, {k: round(v, 5) if isinstance(v, float) else v for k, v in found[name].items()}, flush=True)
    if asked.page:
        put("tool paths", section_of({name: found[name] for name in cases() if name in found}))


if __name__ == "__main__":
    main()
