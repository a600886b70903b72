"""A KUKA KR90 welds a tubular joint on nonic Bezier segments. Ogbemhe, Mpofu and Tlale (2019), IEEE Access.

Decision variables  velocity, acceleration, jerk and snap of the joints at every tag, and their positions, each times a
                    power of the time between tags; the durations of the air moves
Curve               Bezier segments of degree 9, C4 at the tags, at rest at home    (6)-(18)
Objectives          effort (1), movement (sect. III-A), air time (sect. I), jerk and snap (sect. VII), integrals of
                    squares our choice; effort without gravity (our choice)
Subject to          position (20), velocity .. snap (21)-(24, Table 3) and torque (25) on both sides for all t; the
                    torch's tip and tilt along the seam (our choice)
Deviations
  (16) and (18) are misprinted, (20) has a sign too many; (21)-(25) are one-sided, and (1) and (19) have torques with
  their signs, which have no least value: squares here. Table 2 and Tables 5-11 contradict the limits and are not used.
  The paper has no dynamic data, seam, torch nor weld speed: the robot is a stand-in (see ``ocp_traj.problems.kr90``),
  the rest our choice. Torques are limited by its efforts; ``as_printed`` takes the paper's 35 000 N m for every joint.
  The paper stops at nothing but leaves the time between tags open: a weld runs at its speed, and air moves take what
  the limits ask for. ``rest_at_tags`` is the literal reading for air moves: rest at every tag.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise
from math import cos, radians
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import nonic
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import InputError
from ocp_traj.formulation import standard
from ocp_traj.formulation.case import check, choice, number, numbers
from ocp_traj.formulation.objective import Objective, gauss
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import (
    ORDERS,
    DurationConstraint,
    PathConstraint,
    PointConstraint,
    Requirements,
    State,
)
from ocp_traj.formulation.summary import Summary
from ocp_traj.paths.pieces import Pieces, at_piece
from ocp_traj.paths.polyline_seam import PolylineSeam
from ocp_traj.paths.seam import Placement, Seam, TubeSeam
from ocp_traj.paths.tracking import pose_function
from ocp_traj.problems import kr90
from ocp_traj.problems.weld_start import Start, at_rest, find_start, least_time
from ocp_traj.robot.robot import Robot

Array = NDArray[np.float64]
Six = tuple[float, float, float, float, float, float]

SUMMARY = Summary(  # of the seam, whose start takes seconds to find
    "weld-bezier", "KUKA KR90 stand-in, nonic Bezier segments, a tubular seam",
    "KR90 R3100 extra HA (stand-in), 6 joints", "nonic Bezier, approach, 8 pieces of the seam, retract", 272,
    ("air_time", "effort", "dynamic_effort", "movement", "jerk", "snap", "total"),
    "Ogbemhe, Mpofu and Tlale (2019), IEEE Access",
)  # fmt: skip
CASES = ("seam", "air-move")
JOINTS = kr90.JOINTS
PRINTED_EFFORT = 35_000.0  # [N m], every joint: the paper's
AIR_MOVE = (  # rest, via, rest [deg]: our choice
    (0.0, -90.0, 100.0, 0.0, 60.0, 0.0),
    (15.0, -80.0, 110.0, 20.0, 65.0, 15.0),
    (30.0, -65.0, 105.0, 45.0, 50.0, 40.0),
)
UNITS = tuple((unit,) * 6 for unit in ("rad", "rad/s", "rad/s2", "rad/s3", "rad/s4"))
# Traces of these keep the torch's spin and the tags' derivatives definite where nothing else does; our choice.
TRACES = {"movement": 1e-3, "snap": 1e-4}
SCAN = 100  # instants a piece at which figures are taken; our choice
MOST_TAGS = 40  # our choice: 1200 variables
NODES = {"effort": 6, "movement": 9, "jerk": 7, "snap": 6}  # Gauss-Legendre nodes a segment; exact but for effort


# Of both default cases, each objective with another within the reference point;
# python benchmarks/ideal_points.py weld-bezier [case=air-move]. Air times on a seam end within 1 %: the best.
BEST = {
    "air_time": {"effort": 6.97691, "movement": 6.97691},
    "effort": {"air_time": 3.63686, "movement": 3.63689},
    "movement": {"air_time": 2.28997, "effort": 0.774962},
}
BEST_AIR_MOVE = {
    "air_time": {"dynamic_effort": 4.23322, "effort": 4.23322, "movement": 4.23322},
    "dynamic_effort": {"air_time": 0.0163711, "effort": 0.0162944, "movement": 0.0108871},
    "effort": {"air_time": 0.386736, "dynamic_effort": 0.386736, "movement": 0.386736},
    "movement": {"air_time": 0.261411, "dynamic_effort": 0.0400463, "effort": 0.107494},
}


@dataclass(frozen=True)
class Ogbemhe2019:
    """The numbers of a case; a field is what a user may change. Seam, torch and speeds are our choice."""

    case: str = choice("seam", CASES)  # approach, weld and retract, or a move through a via point
    psi: float = 60.0  # [deg] between brace and chord
    chord_radius: float = 0.150  # [m]
    brace_radius: float = 0.090  # [m]
    phi: tuple[float, float] = (-90.0, 90.0)  # [deg] about the brace, from where to where is welded
    mirrored: bool = False  # the other brace of a K joint
    origin: tuple[float, float, float] = (2.05, 0.0, 1.0)  # [m], where the tubes' axes cross
    yaw: float = 180.0  # [deg] of the chord
    seam_file: str = ""  # a CSV file of points and normals in place of the tubes; see ocp_traj.paths.polyline_seam
    riser: float = 0.6  # [m], height the robot stands on
    tags: int = number(9, what="a whole number", least=2, most=MOST_TAGS)  # along the seam
    weld_speed: float = number(0.008, "m/s", above=0.0)
    tcp_box: float = number(0.04e-3, "m", above=0.0)  # the tip's error along each axis
    tcp_tolerance: float = number(0.5e-3, "m", above=0.0)  # its distance from the seam
    max_tilt: float = number(5.0, "deg", "an angle", above=0.0, below=90.0)  # of the torch
    payload: float = number(0.0, "kg", "a finite mass", least=0.0)  # at the flange, beside the torch
    home: Six = (0.0, -90.0, 100.0, 0.0, -60.0, 180.0)  # [deg]
    as_printed: bool = False  # the paper's torque limit
    rest_at_tags: bool = False  # of the air move
    # Of air time, effort, movement, snap in the sum.
    weights: tuple[float, float, float, float] = numbers((1.0, 1.0, 1.0, 1e-3), least=0.0, some=True)
    min_air_time: float = number(0.5, "s", above=0.0)  # of each air move
    max_air_time: float = number(30.0, "s", above=0.0)

    def __post_init__(self) -> None:
        """Checks the fields; those of a seam are checked where it is made."""
        check(self)
        if self.rest_at_tags and self.case == "seam":
            raise InputError("rest_at_tags is for case air-move: a weld that keeps its speed does not rest at its tags")
        if not self.min_air_time < self.max_air_time:
            raise InputError(
                f"min_air_time {self.min_air_time} s and max_air_time {self.max_air_time} s leave no duration; "
                "widen them"
            )
        low, high = kr90.POSITION
        for joint, lower, angle, upper in zip(JOINTS, low, self.home, high, strict=True):
            if not lower < angle < upper:
                raise InputError(f"home has {joint} at {angle} deg; its range is {lower:g} to {upper:g} deg")


Case = Ogbemhe2019


def _nodes(count: int) -> tuple[float, ...]:
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


@lru_cache(maxsize=16)
def start(case: Ogbemhe2019) -> Start:
    """From where the seam of a case is optimised."""
    return find_start(kr90.robot(riser=case.riser), seam(case), case)


def build(case: Ogbemhe2019 | None = None) -> Problem:
    """The problem of a case."""
    case = case or Ogbemhe2019()
    machine = kr90.robot(case.payload, riser=case.riser)
    limits = _joint_limits(case, machine)
    return _seam_problem(case, machine, limits) if case.case == "seam" else _air_move(case, machine, limits)


def _objectives(case: Ogbemhe2019, machine: Robot, air: Callable[[Any], Any]) -> tuple[Objective, ...]:
    strength = casadi.DM(kr90.EFFORT)
    floating = kr90.robot(case.payload, riser=case.riser, gravity=0.0)

    def integral(name: str, unit: str, eq: str, integrand: Callable[[State], Any], rule: str = "") -> Objective:
        return Objective(name, unit, 1.0, eq=eq, integrand=integrand, quadrature=gauss(NODES[rule or name]))

    def strain(robot: Robot) -> Callable[[State], Any]:
        return lambda s: casadi.sumsqr(kr90.torque(robot, s.q, s.v, s.a) / strength)

    parts = dict(zip(("air_time", "effort", "movement", "snap"), case.weights, strict=True))
    return (
        Objective("air_time", "s", 1.0, eq="sect. I", of_variables=lambda x, p: air(x)),
        integral("effort", "s", "(1)", strain(machine)),
        integral("dynamic_effort", "s", "our choice", strain(floating), "effort"),
        integral("movement", "rad2/s", "sect. III-A", lambda s: casadi.sumsqr(s.v)),
        integral("jerk", "rad2/s5", "sect. VII", lambda s: casadi.sumsqr(s.jerk)),
        integral("snap", "rad2/s7", "sect. VII", lambda s: casadi.sumsqr(s.snap)),
        Objective("total", "-", 1.0, eq="our choice", terms=parts),
    )


def _joint_limits(case: Ogbemhe2019, machine: Robot) -> list[PathConstraint]:
    kinds = {"position": "(20)", **dict.fromkeys(("velocity", "acceleration", "jerk", "snap"), "Table 3")}
    effort = np.full(6, PRINTED_EFFORT) if case.as_printed else np.array(kr90.EFFORT)

    def torque(s: State) -> Any:
        return kr90.torque(machine, s.q, s.v, s.a)

    return [
        *standard.joint_limits(machine.limits, JOINTS, UNITS[0], kinds),
        standard.effort_limit(torque, (-effort, effort), machine.effort_units, JOINTS, "(25)"),
    ]


def _rest_constraint(id: str, at: tuple[int, float], q: Array) -> PointConstraint:
    """At rest in all derivatives up to snap, at a posture."""
    return standard.posture(id, q, (at,), JOINTS, UNITS[0], "sect. IV-B")


def _tag_variables(tag: str, weld: float, position: bool) -> list[Variable]:
    """Derivatives of the joints at a tag times powers of the time between tags, within Table 3; positions if free."""
    low, high = np.radians(kr90.POSITION)
    bounds = [(low, high)] if position else []
    for order, table in enumerate((kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP), 1):
        most = np.radians(table) * weld**order
        bounds.append((-most, most))
    names = ORDERS if position else ORDERS[1:]
    return [
        Variable(f"{name} at {tag}", *pair, "rad", tuple(f"{tag} {name} {j}" for j in JOINTS), "sect. III-C")
        for name, pair in zip(names, bounds, strict=True)
    ]


def _scaled_states(block: Any, weld: float, orders: Sequence[int]) -> Any:
    """Derivatives ``(orders, 6)`` of a tag from its variables."""
    powers = np.array([weld**-k for k in orders])
    if isinstance(block, casadi.SX):
        rows = casadi.reshape(block, 6, len(orders)).T
        return casadi.mtimes(casadi.SX(casadi.diag(casadi.DM(powers))), rows)
    return np.asarray(block, dtype=float).reshape(len(orders), 6) * powers[:, None]


def _problem(
    case: Ogbemhe2019, machine: Robot, variables: Sequence[Variable], curve: Callable[[Any], PiecewiseBezier],
    limits: Sequence[PathConstraint], points: Sequence[PointConstraint], guess: Callable[[np.random.Generator], Array],
    words: str, durations: tuple[DurationConstraint, ...] = (), **more: Any,
) -> Problem:  # fmt: skip
    """What both cases share; the last two variables are the air moves' durations."""
    count = sum(len(v.labels) for v in variables)
    lower = np.concatenate([v.lower for v in variables])
    upper = np.concatenate([v.upper for v in variables])
    return Problem(
        id="weld-bezier",
        title=f"KUKA KR90 stand-in, nonic Bezier segments, {words}",
        reference="Ogbemhe, Mpofu and Tlale (2019), IEEE Access",
        case=case,
        robot=machine,
        variables=tuple(variables),
        curve=curve,
        objectives=_objectives(case, machine, lambda x: x[count - 2] + x[count - 1]),
        default_objective="total",
        requirements=Requirements(
            JOINTS, ("rad",) * 6, tuple(limits), tuple(points), continuity=4, duration_constraints=durations
        ),
        guess=lambda rng: np.clip(guess(rng), lower, upper),
        local_derivatives=True,
        notes=notes(case),
        **more,
    )


def notes(case: Ogbemhe2019) -> tuple[str, ...]:
    """What the paper leaves out and this case has."""
    said = ["the robot is a stand-in for the KR90: KR150 R3100-2 inertias and efforts on the KR90's dimensions"]
    if case.as_printed:
        said.append(f"torque limit {PRINTED_EFFORT:g} N m on every joint, as printed: it never binds")
    return tuple(said)


def _durations(case: Ogbemhe2019, labels: tuple[str, str]) -> Variable:
    return Variable("T", np.full(2, case.min_air_time), np.full(2, case.max_air_time), "s", labels, "our choice")


def _seam_problem(case: Ogbemhe2019, machine: Robot, limits: Sequence[PathConstraint]) -> Problem:
    begun = start(case)
    cut, tags, home = begun.cut, case.tags, np.radians(case.home)
    weld = float(cut.tags[-1]) / case.weld_speed / (tags - 1)
    pace = np.full(tags - 1, weld)
    variables = [v for tag in range(1, tags + 1) for v in _tag_variables(f"tag {tag}", weld, position=True)]
    variables.append(_durations(case, ("approach", "retract")))

    def curve(x: Any) -> PiecewiseBezier:
        symbolic = isinstance(x, casadi.SX)
        rest: Any = casadi.SX(at_rest(home)) if symbolic else at_rest(home)
        inner = [_scaled_states(x[30 * tag : 30 * tag + 30], weld, range(5)) for tag in range(tags)]
        times = [x[30 * tags], *([weld] * (tags - 1)), x[30 * tags + 1]]
        return nonic([rest, *inner, rest], casadi.vertcat(*times) if symbolic else np.array(times, dtype=float))

    def guess(rng: np.random.Generator) -> Array:
        return np.concatenate([begun.fit.states.ravel(), begun.air])  # random ones wind the wrist up

    table = np.zeros((tags + 1, cut.constants.shape[1]))
    table[1:tags] = cut.constants
    along: dict[str, Any] = {"eq": "our choice", "constants": table, "segments": tuple(range(1, tags))}

    def error(s: State) -> Any:
        return machine.tool_pose(s.q)[1] - at_piece(s.c, s.u)[0]

    def tilt(s: State) -> Any:
        return 1.0 - casadi.dot(machine.tool_pose(s.q)[0][:, 2], at_piece(s.c, s.u)[1])

    # What the polynomials miss of the seam comes off the bounds.
    box, radius = case.tcp_box - cut.position_error, 1e3 * (case.tcp_tolerance - cut.position_error)
    most = 1.0 - cos(radians(case.max_tilt)) - cut.axis_error
    tracked = (
        PathConstraint("tcp", error, np.full(3, -box), np.full(3, box), ("m",) * 3, ("x", "y", "z"), **along),
        PathConstraint(
            "tcp-distance", lambda s: casadi.sumsqr(1e3 * error(s)), np.array([-np.inf]), np.array([radius**2]),
            ("mm2",), ("squared",), **along,
        ),
        PathConstraint("tilt", tilt, np.array([-np.inf]), np.array([most]), ("-",), ("1 - cos",), **along),
    )  # fmt: skip
    return _problem(
        case, machine, variables, curve, (*limits, *tracked),
        (_rest_constraint("start", (0, 0.0), home), _rest_constraint("end", (-1, 1.0), home)),
        guess, "a tubular seam" if not case.seam_file else "a seam",
        durations=(DurationConstraint("weld-time", tuple(range(1, tags)), pace, pace, "our choice"),),
        curve_kind=f"nonic Bezier, approach, {tags - 1} pieces of the seam, retract",
        reference_point={"air_time": 12.0, "effort": 12.0, "movement": 25.0},
        best_values=BEST if case == Ogbemhe2019() else {},
        instants={"tcp": _nodes(10), "tilt": _nodes(4), "snap-limit": _extremes(7)},
        instants_move=False,
        regularisation=TRACES,
        figures=partial(_figures, machine, seam(case), cut),
        # The torch's spin leaves valleys that bend: short steps down them, made longer soon, and a barrier that is low
        # from the start; the stepping stone lies in the middle of a valley.
        solver_options={"ipopt": {
            "tol": 1e-4, "mu_target": 1e-4, "mu_init": 1e-3, "perturb_dec_fact": 0.1, "constr_viol_tol": 1e-9,
        }},
        stepping_stone="total",
    )  # fmt: skip


def _figures(machine: Robot, path: Seam, cut: Pieces, motion: Motion) -> list[tuple[str, float, str]]:
    """How closely a trajectory keeps to the seam itself, at ``SCAN`` instants a piece."""
    u = np.linspace(0.0, 1.0, SCAN)
    q = np.concatenate([motion.curve.at(k, u) for k in range(1, len(cut.tags))])
    place, axis, *_ = (np.array(o).T for o in pose_function(machine).map(len(q))(q.T))
    wanted = path.at(np.concatenate([a + (b - a) * u for a, b in pairwise(cut.tags)]))
    off = np.linalg.norm(place - wanted.position, axis=1)
    tilt = np.arccos(np.clip((axis * wanted.axis).sum(axis=1), -1.0, 1.0))
    return [
        ("tip off the seam, rms", 1e3 * float(np.sqrt((off**2).mean())), "mm"),
        ("tip off the seam, largest", 1e3 * float(off.max()), "mm"),
        ("tilt of the torch, largest", float(np.degrees(tilt.max())), "deg"),
        ("time of the weld", float(motion.curve.durations[1:-1].sum()), "s"),
    ]


def _air_move(case: Ogbemhe2019, machine: Robot, limits: Sequence[PathConstraint]) -> Problem:
    points = np.radians(np.array(AIR_MOVE))
    rest = at_rest(points[1])
    least = [least_time(at_rest(a), at_rest(b), case) for a, b in pairwise(points)]
    unit = float(np.mean(least))  # [s], by powers of which the via point's derivatives are scaled
    variables = [] if case.rest_at_tags else _tag_variables("via", unit, position=False)
    variables.append(_durations(case, ("T1", "T2")))
    inner = 0 if case.rest_at_tags else 24

    def curve(x: Any) -> PiecewiseBezier:
        symbolic = isinstance(x, casadi.SX)
        if case.rest_at_tags:
            via: Any = casadi.SX(rest) if symbolic else rest
        else:
            moving = _scaled_states(x[:24], unit, range(1, 5))
            via = casadi.vertcat(casadi.SX(points[1]).T, moving) if symbolic else np.vstack([points[1], moving])
        ends = [casadi.SX(at_rest(q)) if symbolic else at_rest(q) for q in points[[0, 2]]]
        times = x[inner : inner + 2]
        return nonic([ends[0], via, ends[1]], times if symbolic else np.asarray(times, dtype=float))

    def guess(rng: np.random.Generator) -> Array:
        return np.concatenate([0.05 * rng.normal(size=inner), np.array(least) * rng.uniform(1.0, 1.5, 2)])

    def dilate(x: Array, s: float) -> Array:
        slower = np.array(x, dtype=float)
        slower[:inner] /= np.repeat([s, s**2, s**3, s**4], 6)[:inner]
        slower[inner:] *= s
        return slower

    via_point = standard.via_points(points[1], ((1, 0.0),), JOINTS, UNITS[0], "our choice")
    if case.rest_at_tags:
        via_point = _rest_constraint("via", (1, 0.0), points[1])
    return _problem(
        case, machine, variables, curve, limits,
        (_rest_constraint("start", (0, 0.0), points[0]), via_point, _rest_constraint("end", (-1, 1.0), points[2])),
        guess, "an air move through a via point",
        curve_kind="nonic Bezier, 2 segments",
        starts=3,  # our choice: Coulomb friction makes many local optima of dynamic effort
        reference_point={"air_time": 9.0, "dynamic_effort": 0.05, "effort": 2.0, "movement": 2.0},
        best_values=BEST_AIR_MOVE if case == Ogbemhe2019(case="air-move") else {},
        dilate=dilate,
    )  # fmt: skip
