"""A KUKA KR90 welds a tubular joint on nonic Bezier segments. Ogbemhe, Mpofu and Tlale (2019), IEEE Access.

Decision variables  velocity, acceleration, jerk and snap of the joints at every tag, and their positions, each times a
                    power of the time between tags; the durations of the air moves
Curve               Bezier segments of degree 9, C4 at the tags, at rest at home    (5)-(18)
Objectives          effort (1), movement (19), air time, jerk and snap; effort without gravity (our choice)
Subject to          position (20), velocity .. snap (21)-(25, Table 3) on both sides for all t, torque; the torch's tip
                    and tilt along the seam
Deviations
  (16) and (18) are misprinted, (20) lacks a sign; (21)-(25) are one-sided, and (1) and (19) sum torques with their
  signs, which has no least value: squares here. Table 2 and Tables 5-11 contradict the limits and are not used. The
  paper has no dynamic data, seam, torch nor weld speed: the robot is a stand-in (see ``ocp_traj.problems.kr90``), the
  rest our choice. Torques are limited by its efforts; ``as_printed`` takes the paper's 35 000 N m for every joint.
  The paper stops at nothing but leaves the time between tags open: a weld runs at its speed, and air moves take what
  the limits ask for. ``rest_at_tags`` is the literal reading for air moves: rest at every tag.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import cos, radians
from typing import Any

import casadi
import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from ocp_traj.bernstein import PiecewiseBezier
from ocp_traj.curves import nonic
from ocp_traj.errors import InputError
from ocp_traj.problem import Objective, Problem, Variable
from ocp_traj.problems import kr90
from ocp_traj.requirements import ORDERS, PathConstraint, PointConstraint, Requirements, State
from ocp_traj.robot import Robot
from ocp_traj.seam import Pieces, Placement, PolylineSeam, Seam, TubeSeam, at_piece, pieces
from ocp_traj.tracking import Fit, fit_path

Array = NDArray[np.float64]
Six = tuple[float, float, float, float, float, float]

CASES = ("seam", "air-move")
JOINTS = kr90.JOINTS
PRINTED_EFFORT = 35_000.0  # [N m], every joint: the paper's
AIR_MOVE = (  # rest, via, rest [deg]: our choice
    (0.0, -90.0, 100.0, 0.0, 60.0, 0.0),
    (15.0, -80.0, 110.0, 20.0, 65.0, 15.0),
    (30.0, -65.0, 105.0, 45.0, 50.0, 40.0),
)
NODES = {"effort": 6, "movement": 9, "jerk": 7, "snap": 6}  # Gauss-Legendre nodes; exact but for effort


@dataclass(frozen=True)
class Ogbemhe2019:
    """The numbers of a case; a field is what a user may change."""

    case: str = "seam"  # of CASES: approach, weld and retract, or a move through a via point
    psi: float = 60.0  # [deg] between brace and chord
    chord_radius: float = 0.150  # [m]
    brace_radius: float = 0.090  # [m]
    phi: tuple[float, float] = (-90.0, 90.0)  # [deg] about the brace, from where to where is welded
    mirrored: bool = False  # the other brace of a K joint
    origin: tuple[float, float, float] = (2.05, 0.0, 1.0)  # [m], where the tubes' axes cross
    yaw: float = 180.0  # [deg] of the chord
    seam_file: str = ""  # a CSV file of points and normals in place of the tubes; see ocp_traj.seam
    riser: float = 0.6  # [m], height the robot stands on
    tags: int = 9  # along the seam
    weld_speed: float = 0.008  # [m/s]
    tcp_box: float = 0.04e-3  # [m], the tip's error along each axis
    tcp_tolerance: float = 0.5e-3  # [m], its distance from the seam
    max_tilt: float = 5.0  # [deg] of the torch
    payload: float = 0.0  # [kg] at the flange, beside the torch
    home: Six = (0.0, -90.0, 100.0, 0.0, -60.0, 180.0)  # [deg]
    as_printed: bool = False  # the paper's torque limit
    rest_at_tags: bool = False  # of the air move
    weights: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1e-3)  # of air time, effort, movement, snap in the sum
    min_air_time: float = 0.5  # [s], of each air move
    max_air_time: float = 30.0  # [s]


def _gauss(points: int) -> tuple[tuple[float, float], ...]:
    nodes, weights = leggauss(points)
    return tuple(((1.0 + float(u)) / 2.0, float(w) / 2.0) for u, w in zip(nodes, weights, strict=True))


def _places(count: int) -> tuple[float, ...]:
    """Chebyshev's nodes on [0, 1], between which a polynomial held there cannot swing far."""
    return tuple(float(u) for u in (1.0 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2.0)


def _extremes(count: int) -> tuple[float, ...]:
    """Chebyshev's extremes on [0, 1], ends included."""
    return tuple(float(u) for u in (1.0 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2.0)


def seam(case: Ogbemhe2019) -> Seam:
    """What is welded."""
    place = Placement(case.origin, radians(case.yaw))
    if case.seam_file:
        return PolylineSeam.read(case.seam_file, place)
    low, high = (radians(p) for p in case.phi)
    return TubeSeam(case.chord_radius, case.brace_radius, radians(case.psi), (low, high), place, case.mirrored)


def least_time(start: Array, end: Array, case: Ogbemhe2019) -> float:
    """Least duration [s] of a nonic between two states ``(5, 6)``, to 2 %, at which the limits up to snap hold."""
    limits = [np.radians(v) for v in (kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP)]
    for duration in np.geomspace(case.min_air_time, case.max_air_time, 200):
        curve = nonic([start, end], np.array([duration]))
        if all(
            max(-extreme.lower, extreme.upper) <= bound
            for order, bounds in enumerate(limits, 1)
            for extreme, bound in zip(curve.extrema(order), bounds, strict=True)
        ):
            return float(duration)
    return case.max_air_time


@lru_cache(maxsize=16)
def start(case: Ogbemhe2019) -> tuple[Pieces, Fit, tuple[float, float]]:
    """The seam in pieces, the arm fitted to it, and air durations that the limits allow."""
    machine, path = kr90.robot(riser=case.riser), seam(case)
    cut = pieces(path, case.tags)
    home = np.radians(case.home)
    weld = path.length / case.weld_speed / (case.tags - 1)
    found = []
    for posture in _postures(home):
        fit = fit_path(machine, cut, posture)
        if fit.place_error.max() > 1e-4:
            continue
        tags = fit.states / weld ** np.arange(5)[:, None]
        rest = np.zeros((5, 6))
        rest[0] = home
        air = least_time(rest, tags[0], case), least_time(tags[-1], rest, case)
        found.append((sum(air), fit, air))
    if not found:
        raise InputError("the seam is out of reach")
    _, fit, air = min(found, key=lambda f: f[0])
    return cut, fit, air


def _postures(home: Array) -> list[Array]:
    low, high = np.radians(kr90.POSITION)
    flips = []
    for sign in (1.0, -1.0):
        for other in (1.0, -1.0):
            flip = home.copy()
            flip[3] += sign * np.pi
            flip[4] *= -1.0
            flip[5] += other * np.pi
            flips.append(flip)
    return [home, *(f for f in flips if (f > low).all() and (f < high).all())]


def build(case: Ogbemhe2019 | None = None) -> Problem:
    """The problem of a case."""
    case = case or Ogbemhe2019()
    return _seam_problem(case) if case.case == "seam" else _air_move(case)


def _objectives(case: Ogbemhe2019, machine: Robot, floating: Robot, air: Any) -> list[Objective]:
    strength = casadi.DM(kr90.EFFORT)

    def squares(robot: Robot) -> Any:
        return lambda s: casadi.sumsqr(kr90.torque(robot, s.q, s.v, s.a) / strength)

    return [
        Objective("air_time", "s", 1.0, eq="sect. III", of_variables=air),
        Objective("effort", "s", 1.0, eq="(1)", integrand=squares(machine), quadrature=_gauss(NODES["effort"])),
        Objective("dynamic_effort", "s", 1.0, eq="our choice", integrand=squares(floating), quadrature=_gauss(NODES["effort"])),
        Objective("movement", "rad2/s", 1.0, eq="(19)", integrand=lambda s: casadi.sumsqr(s.v), quadrature=_gauss(NODES["movement"])),
        Objective("jerk", "rad2/s5", 1.0, eq="our choice", integrand=lambda s: casadi.sumsqr(s.jerk), quadrature=_gauss(NODES["jerk"])),
        Objective("snap", "rad2/s7", 1.0, eq="our choice", integrand=lambda s: casadi.sumsqr(s.snap), quadrature=_gauss(NODES["snap"])),
        Objective("total", "-", 1.0, eq="our choice", terms=dict(zip(("air_time", "effort", "movement", "snap"), case.weights, strict=True))),
    ]


def _derivative_limits(case: Ogbemhe2019) -> list[PathConstraint]:
    names = ("position", "velocity", "acceleration", "jerk", "snap")
    limits = []
    for order, (name, bound) in enumerate(zip(names, (kr90.POSITION, kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP), strict=True)):
        low, high = np.radians(bound) if order == 0 else (-np.radians(bound), np.radians(bound))
        units = ("rad" + ("" if order == 0 else "/s" if order == 1 else f"/s{order}"),) * 6
        limits.append(PathConstraint.on_derivative(f"{name}-limit", order, low, high, units, JOINTS, "(20)" if order == 0 else "Table 3"))
    return limits


def _seam_problem(case: Ogbemhe2019) -> Problem:
    cut, fit, air = start(case)
    machine = kr90.robot(case.payload, riser=case.riser)
    floating = kr90.robot(case.payload, riser=case.riser, gravity=0.0)
    tags, weld = case.tags, float(cut.tags[-1]) / case.weld_speed / (case.tags - 1)
    home = np.zeros((5, 6))
    home[0] = np.radians(case.home)
    width = 30 * tags
    low_q, high_q = np.radians(kr90.POSITION)
    bounds = [np.radians(b) * weld**k for k, b in enumerate((kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP), 1)]
    variables = []
    for tag in range(tags):
        for order, name in enumerate(("q", "v", "a", "jerk", "snap")):
            lower, upper = (low_q, high_q) if order == 0 else (-bounds[order - 1], bounds[order - 1])
            variables.append(
                Variable(f"{name}{tag + 1}", lower, upper, "rad", tuple(f"tag {tag + 1} {name} {j}" for j in JOINTS), "Table 3")
            )
    variables.append(Variable("T", np.full(2, case.min_air_time), np.full(2, case.max_air_time), "s", ("approach", "retract"), "our choice"))
    powers = np.array([weld**-k for k in range(5)])

    def curve(x: Any) -> PiecewiseBezier:
        symbolic = isinstance(x, casadi.SX)
        states: list[Any] = [casadi.SX(home) if symbolic else home]
        for tag in range(tags):
            block = x[30 * tag : 30 * tag + 30]
            if symbolic:
                rows = casadi.reshape(block, 6, 5).T
                states.append(casadi.mtimes(casadi.SX(casadi.diag(casadi.DM(powers))), rows))
            else:
                states.append(np.asarray(block).reshape(5, 6) * powers[:, None])
        states.append(states[0])
        times = [x[width], *([weld] * (tags - 1)), x[width + 1]]
        return nonic(states, casadi.vertcat(*times) if symbolic else np.array(times, dtype=float))

    welded = tuple(range(1, tags))
    table = np.zeros((tags + 1, cut.constants.shape[1]))
    table[1:tags] = cut.constants

    def error(s: State) -> Any:
        place, _ = at_piece(s.c, s.u)
        return machine.tool_pose(s.q)[1] - place

    def tilt(s: State) -> Any:
        _, axis = at_piece(s.c, s.u)
        return 1.0 - casadi.dot(machine.tool_pose(s.q)[0][:, 2], axis)

    effort = np.full(6, PRINTED_EFFORT) if case.as_printed else np.array(kr90.EFFORT)
    box = case.tcp_box - cut.position_error
    limits = [
        *_derivative_limits(case),
        PathConstraint("torque", lambda s: kr90.torque(machine, s.q, s.v, s.a), -effort, effort, ("N m",) * 6, JOINTS, "sect. III"),
        PathConstraint("tcp", error, np.full(3, -box), np.full(3, box), ("m",) * 3, ("x", "y", "z"), "our choice", constants=table, segments=welded),
        PathConstraint("tcp-distance", lambda s: casadi.sumsqr(1e3 * error(s)), np.array([-np.inf]), np.array([(1e3 * (case.tcp_tolerance - cut.position_error)) ** 2]), ("mm2",), ("tip",), "our choice", constants=table, segments=welded),
        PathConstraint("tilt", tilt, np.array([-np.inf]), np.array([1.0 - cos(radians(case.max_tilt)) - cut.axis_error]), ("-",), ("torch",), "our choice", constants=table, segments=welded),
    ]
    rest = PointConstraint("rest", lambda s: casadi.vertcat(s.q, s.v, s.a, s.jerk, s.snap), ((0, 0.0), (-1, 1.0)), home.ravel(), home.ravel(), ("rad",) * 6 + ("rad/s",) * 6 + ("rad/s2",) * 6 + ("rad/s3",) * 6 + ("rad/s4",) * 6, tuple(f"{o} {j}" for o in ORDERS for j in JOINTS), "sect. III", structural=True)

    def guess(rng: np.random.Generator) -> Array:
        x = np.concatenate([fit.states.ravel(), np.array(air) * rng.uniform(1.0, 1.1, 2)])
        lower, upper = (np.concatenate([getattr(v, side) for v in variables]) for side in ("lower", "upper"))
        return np.clip(x, lower, upper)

    return Problem(
        id="weld-bezier",
        title="KUKA KR90 welds a tubular joint, nonic Bezier segments",
        reference="Ogbemhe, Mpofu and Tlale (2019), IEEE Access",
        case=case,
        robot=machine,
        variables=tuple(variables),
        curve=curve,
        curve_kind=f"nonic Bezier, {tags + 1} segments",
        objectives=tuple(_objectives(case, machine, floating, lambda x, p: x[width] + x[width + 1])),
        default_objective="total",
        reference_point={"air_time": 12.0, "movement": 10.0, "effort": 8.0},
        requirements=Requirements(JOINTS, ("rad",) * 6, tuple(limits), (rest,), continuity=4),
        instants={"tcp": _places(10), "tilt": _places(4), "snap-limit": _extremes(7)},
        guess=guess,
        instants_move=False,
        local_derivatives=True,
        regularisation={"movement": 1e-3, "snap": 1e-5},
        solver_options={"tol": 1e-4, "mu_target": 1e-4},
    )


def _air_move(case: Ogbemhe2019) -> Problem:
    raise NotImplementedError
