"""Least time through points, beside direct collocation as its users write it: CasADi's Opti, rockit, crocoddyl.

Two subjects: the air move of ``weld-bezier``, limits up to snap and on torques with friction, and ``ur5-via``, limits
up to jerk and on torques with a payload. The states of the peers are a chain of integrators whose last derivative is
constant an interval, so that collocation of their order is exact and their motion is polynomials: it can be audited.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from math import factorial
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from scipy.interpolate import CubicHermiteSpline

import ocp_traj as ot
from benchmarks.air_move import refined_air_move
from benchmarks.exact_curves import of_states
from benchmarks.judge import ORDERS, Bounds, Made, PinArm, judged, of_curve, requirements
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.tables.words import done, median, ratios, spread, table
from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.problems import kr90
from ocp_traj.problems.weld_bezier import via_points
from ocp_traj.robot.payload import ToolPayload
from tests.independent.robots import Machine, WeldRobot

TITLE = "Least time through points, beside direct collocation"
APART = True  # a tool that breaks the process breaks its own
OURS = "ours"
PEERS = {"CasADi Opti": "casadi_collocation", "rockit": "rockit_ocp", "crocoddyl": "crocoddyl_move"}
NEEDS = {"CasADi Opti": "casadi", "rockit": "rockit", "crocoddyl": "crocoddyl"}
EXAMPLE = Path(__file__).parents[2] / "examples" / "tasks" / "ur5-via.toml"
AIR, VIA = "air move", "ur5-via"
OWN_SETTINGS = {AIR: ("septic pieces", "the paper's curve"), VIA: ("curve.kind=auto", "as the file has it")}


TEXT = """Excess is of the scan, with the limit it is over; a motion ends as far off its last point as its controls have
drifted. Settings are intervals from one point to the next, and where limits are looked at. Lines are of the peer's
script; of ours, of the call or the task file.

{rows}

What it means: with a control that is constant an interval, states have their extremes where collocation looks, or near
it, so that what it finds is often legal; nobody knows before an audit. Peers are ahead where more intervals leave less
time than our pieces do. The paper's curve, one piece from point to point, is slower by a tenth. crocoddyl has no hard
limits on states, none on acceleration and jerk, and no free end time: it is given our times at the points and
penalties, judged as it ends, and its excess is over velocity and torques alone. It is made
for control, not for this."""


@dataclass(frozen=True)
class Ground:
    """What is asked of all tools.

    Attributes:
        points: to pass ``(m, n)``.
        bounds: by quantity; the last derivative is the control.
        torque: casadi function (q, v, a) -> ``(n,)``.
        machine: the same, of code that shares nothing with it.
        limits: for the audit.
        guess: of the time between points [s].
    """

    points: Array
    bounds: Bounds
    torque: Any
    machine: Machine
    limits: Requirements
    guess: float


def posed(subject: str, setting: str = "") -> Problem:
    """Our problem."""
    if subject == AIR:
        paper = ot.problems.load("weld-bezier", case="air-move")
        return refined_air_move(paper) if setting == OWN_SETTINGS[AIR][0] else paper
    more = {"curve.kind": "auto"} if setting == OWN_SETTINGS[VIA][0] else {}
    return ot.problems.load("task", file=str(EXAMPLE), **more)


@cache
def ground(subject: str) -> Ground:
    """Points, bounds and torques of a subject."""
    problem = posed(subject)
    robot = problem.robot
    names = (*(ORDERS if subject == AIR else ORDERS[:-1]), "effort")
    bounds = {name: np.array(robot.limits.bounds(name)) for name in names}
    q, v, a = (casadi.SX.sym(name, robot.size) for name in "qva")
    if subject == AIR:
        points, machine = via_points(problem.case), WeldRobot()
        bounds["effort"] = np.array([-np.array(kr90.EFFORT), kr90.EFFORT])
        torque = casadi.Function("torque", [q, v, a], [kr90.torque(robot, q, v, a)])
        limits = Requirements(robot.joints, robot.units, problem.requirements.path_constraints, continuity=3)
        return Ground(points, bounds, torque, machine, limits, 3.0)
    held = problem.case.robot.payload
    payload = ToolPayload(held.mass, held.com)
    torque = casadi.Function("torque", [q, v, a], [robot.effort(q, v, a, payload=payload)])
    return Ground(
        np.array(problem.case.move[0].via), bounds, torque, PinArm(robot, held.mass, held.com),
        requirements(robot, bounds, payload), 0.8,
    )  # fmt: skip


def peer(tool: str) -> Any:
    """The script of a tool."""
    return import_module(f"benchmarks.peers.{PEERS[tool]}")


def cells(quick: bool) -> Iterator[Cell]:
    """Every setting of every tool five times; when quick the first of each, once."""
    for repeat in range(1 if quick else 5):
        for subject in (AIR, VIA):
            for setting in OWN_SETTINGS[subject][: 1 if quick else None]:
                yield Cell(OURS, subject, setting, repeat)
            for tool in PEERS:
                if tool == "crocoddyl" and subject == AIR:
                    continue  # it knows no friction
                if find_spec(NEEDS[tool]) is None:
                    if not repeat:
                        yield Cell(tool, subject, "", 0)
                    continue
                settings = peer(tool).SETTINGS
                for setting in list(settings)[: 1 if quick else None]:
                    yield Cell(tool, subject, setting, repeat)


def measure(cell: Cell) -> Figures:
    """One solve, building included."""
    on = ground(cell.subject)
    begun, wall = time.process_time(), time.perf_counter()
    if cell.tool == OURS:
        found = ot.solve(posed(cell.subject, cell.setting), objective=_time(cell), certify=False)
        spent = {"cpu": time.process_time() - begun, "seconds": time.perf_counter() - wall}
        if found.trajectory is None:
            return {**spent, "failed": found.explain()}
        return {**spent, "iterations": found.iterations, **_judged(of_curve(found.trajectory.curve), on)}
    if find_spec(NEEDS[cell.tool]) is None:
        return {"failed": f"{NEEDS[cell.tool]} is not installed"}
    if cell.tool == "crocoddyl":
        return _by_crocoddyl(on, cell.setting)
    chain = [tuple(on.bounds[name]) for name in ORDERS if name in on.bounds]
    steps, states, controls, iterations = peer(cell.tool).solve(
        on.points, chain, on.torque, on.bounds["effort"][1], on.guess, cell.setting
    )
    spent = {"cpu": time.process_time() - begun, "seconds": time.perf_counter() - wall}
    made, drift = played(np.asarray(steps), np.asarray(states), np.asarray(controls), on.points)
    return {**spent, "iterations": int(iterations), "drift": drift, **_judged(made, on)}


def _by_crocoddyl(on: Ground, setting: str) -> Figures:
    """Given the times at which ours passes the points; played by cubics through its positions and velocities."""
    ours = ot.solve(posed(VIA, OWN_SETTINGS[VIA][0]), certify=False).trajectory
    assert ours is not None
    times = ours.curve.knots[:: ours.curve.segments // (len(on.points) - 1)]
    assert isinstance(on.machine, PinArm)
    begun, wall = time.process_time(), time.perf_counter()
    states, _, iterations = peer("crocoddyl").move(
        on.machine.model, on.points, times, on.bounds["velocity"][1], on.bounds["effort"][1], setting
    )
    spent = {"cpu": time.process_time() - begun, "seconds": time.perf_counter() - wall}
    grid, n = np.linspace(0.0, times[-1], len(states)), on.points.shape[1]
    spline = CubicHermiteSpline(grid, states[:, :n], states[:, n:])
    known = {name: on.bounds[name] for name in ("position", "velocity", "effort")}  # what it can be asked for
    missed = float(np.abs(spline(times) - on.points).max())
    made = Made(float(times[-1]), lambda t, order: np.asarray(spline(t, nu=order)), PiecewiseBezier.from_ppoly(spline))
    return {**spent, "iterations": iterations, "drift": missed, **judged(made, known, on.machine, on.limits)}


def _time(cell: Cell) -> str:
    return "air_time" if cell.setting == OWN_SETTINGS[AIR][1] else "time"


def _judged(made: Made, on: Ground) -> Figures:
    return judged(made, on.bounds, on.machine, on.limits)


def played(steps: Array, states: Array, controls: Array, points: Array) -> tuple[Made, float]:
    """The motion that the controls give from the first state, and how far it ends off the last point.

    Args:
        steps: durations ``(K,)`` [s].
        states: at their begins ``(K, order, n)``; the first counts.
        controls: ``(K, n)``, the last derivative.
        points: to pass ``(m, n)``.
    """
    times, order = np.append(0.0, np.cumsum(steps)), states.shape[1]
    now, taylor = states[0], []
    for step, control in zip(steps, controls, strict=True):
        full = np.vstack([now, control])
        taylor.append(full)
        now = np.array([
            sum(full[k + i] * step**i / factorial(i) for i in range(order - k + 1)) for k in range(order)
        ])  # fmt: skip
    known = np.array(taylor)

    def sample(t: Array, derivative: int) -> Array:
        if derivative > order:
            return np.zeros((len(t), known.shape[2]))
        part = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(steps) - 1)
        after = (t - times[part])[:, None]
        return np.asarray(sum(
            known[part, derivative + i] * after**i / factorial(i) for i in range(order - derivative + 1)
        ))  # fmt: skip

    return Made(float(times[-1]), sample, of_states(times, known)), float(np.abs(now[0] - points[-1]).max())


def code_lines(tool: str) -> int:
    """Lines of a peer's script."""
    return len((Path(__file__).parents[1] / "peers" / f"{PEERS[tool]}.py").read_text().splitlines())


def text(lines: Lines) -> str:
    """The section."""
    rows = []
    for subject in (AIR, VIA):
        first = {"tool": OURS, "subject": subject, "setting": OWN_SETTINGS[subject][0]}
        for tool in (OURS, *PEERS):
            for setting in dict.fromkeys(cell.setting for cell, _ in lines.items(tool=tool, subject=subject)):
                some = done(lines, tool=tool, subject=subject, setting=setting)
                if not some:
                    continue
                one = {"tool": tool, "subject": subject, "setting": setting}
                worst = max(some, key=lambda figures: figures["excess"])
                rows.append([
                    subject, tool, setting, str(len(some)), median([figures["duration"] for figures in some], ".4f"),
                    "none" if worst["excess"] <= 1e-9 else f"{100.0 * worst['excess']:.2g} %, {worst['limit']}",
                    "yes" if all(figures["proved"] for figures in some) else "no",
                    spread([figures["cpu"] for figures in some]), median(ratios(lines, "cpu", one, first)),
                    f"{max(figures.get('drift', 0.0) for figures in some):.1g}",
                    str(code_lines(tool)) if tool in PEERS else {AIR: "1", VIA: "27"}[subject],
                ])  # fmt: skip
    head = (
        "subject", "tool", "setting", "runs", "duration [s]", "excess", "proved", "seconds", "over ours", "drift [rad]",
        "lines",
    )  # fmt: skip
    return TEXT.format(rows=table(head, rows))


def cited(lines: Lines) -> dict[str, tuple[str, str]]:
    """Figures by key, with what they are."""
    found = {}
    for subject in (AIR, VIA):
        some = done(lines, tool=OURS, subject=subject, setting=OWN_SETTINGS[subject][0])
        if some:
            key = subject.replace(" ", "-")
            found[f"collocation.{key}"] = (
                f"{median([one['duration'] for one in some], '.3f')} s",
                f"least time of `{subject}`, proved",
            )
    return found


def behind(lines: Lines) -> list[str]:
    """Where a peer is quicker to solve, or its motion shorter."""
    words = []
    for subject in (AIR, VIA):
        first = {"tool": OURS, "subject": subject, "setting": OWN_SETTINGS[subject][0]}
        for tool in PEERS:
            for tried in dict.fromkeys(cell.setting for cell, _ in lines.items(tool=tool, subject=subject)):
                one = {"tool": tool, "subject": subject, "setting": tried}
                shorter, quicker = ratios(lines, "duration", one, first), ratios(lines, "cpu", one, first)
                if shorter and np.median(shorter) < 0.999:
                    worst = max(0.0, *(figures["excess"] for figures in done(lines, **one)))
                    words.append(
                        f"`{subject}`: {tool}, {tried}, ends with {median(shorter, '.4f')} times our duration, its "
                        f"excess {100.0 * worst:.2g} %: a control that is free in every interval can do what our "
                        "pieces cannot."
                    )
                if quicker and np.median(quicker) < 1.0:
                    proved = all(figures["proved"] for figures in done(lines, **one))
                    legal = "legal, as the audit finds" if proved else "not legal, as the audit finds"
                    words.append(
                        f"`{subject}`: {tool}, {tried}, takes {median(quicker)} times our seconds for a motion that is "
                        f"{legal}; ours are with several levels of pieces and the proof."
                    )
    return words
