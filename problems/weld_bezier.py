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
from functools import lru_cache
from itertools import pairwise
from math import radians
from typing import Any

import casadi
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.families import at_rest, nonic
from ocp_traj.errors import InputError
from ocp_traj.formulation import standard
from ocp_traj.formulation.about import About
from ocp_traj.formulation.case import Checked, choice, number, numbers
from ocp_traj.formulation.objective import Objective, SumOfSquares, gauss
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import DurationConstraint, PathConstraint, PointConstraint, Requirements
from ocp_traj.formulation.summary import Summary
from ocp_traj.formulation.surroundings import SAMPLES, Surroundings
from ocp_traj.formulation.tags import Tags
from ocp_traj.formulation.tuning import Tuning, chebyshev
from ocp_traj.paths.polyline_seam import PolylineSeam
from ocp_traj.paths.seam import Placement, Seam, TubeSeam
from ocp_traj.paths.tracking import figures
from ocp_traj.problems import kr90
from ocp_traj.problems.kr90 import JOINTS
from ocp_traj.problems.kr90 import TABLE_3 as TABLE_3
from ocp_traj.problems.weld_start import Start, find_start, least_time
from ocp_traj.robot.robot import Robot

UNITS = ("rad",) * 6
REFERENCE = "Ogbemhe, Mpofu and Tlale (2019), IEEE Access"
SUMMARY = Summary(  # of the seam, whose start takes seconds to find
    "weld-bezier", "KUKA KR90 stand-in, nonic Bezier segments, a tubular seam",
    "KR90 R3100 extra HA (stand-in), 6 joints", "nonic Bezier, approach, 8 pieces of the seam, retract", 272,
    ("air_time", "effort", "dynamic_effort", "movement", "jerk", "snap", "total"), REFERENCE,
)  # fmt: skip
PRINTED_EFFORT = 35_000.0  # [N m], every joint: the paper's
# Rest, via, rest: our choice.
AIR_MOVE = pd.DataFrame(columns=[f"{joint} [deg]" for joint in JOINTS], data=(
    (0.0, -90.0, 100.0, 0.0, 60.0, 0.0),
    (15.0, -80.0, 110.0, 20.0, 65.0, 15.0),
    (30.0, -65.0, 105.0, 45.0, 50.0, 40.0),
))  # fmt: skip


@dataclass(frozen=True)
class Ogbemhe2019(Checked):
    """The numbers of a case; a field is what a user may change. Seam, torch and speeds are our choice."""

    case: str = choice("seam", ("seam", "air-move"))  # approach, weld and retract, or a move through a via point
    psi: float = number(60.0, "deg", "an angle", above=0.0, most=90.0)  # between brace and chord
    chord_radius: float = number(0.150, "m", above=0.0)
    brace_radius: float = number(0.090, "m", above=0.0)
    phi: tuple[float, float] = numbers((-90.0, 90.0), "deg")  # about the brace, from where to where is welded
    mirrored: bool = False  # the other brace of a K joint
    origin: tuple[float, float, float] = numbers((2.05, 0.0, 1.0), "m")  # where the tubes' axes cross
    yaw: float = number(180.0, "deg")  # of the chord
    seam_file: str = ""  # a CSV file of points and normals in place of the tubes; see ocp_traj.paths.polyline_seam
    riser: float = number(0.6, "m")  # height the robot stands on
    tags: int = number(9, what="a whole number", least=2, most=40)  # along the seam; 40 are 1200 variables
    weld_speed: float = number(0.008, "m/s", above=0.0)
    tcp_box: float = number(0.04e-3, "m", above=0.0)  # the tip's error along each axis
    tcp_tolerance: float = number(0.5e-3, "m", above=0.0)  # its distance from the seam
    max_tilt: float = number(5.0, "deg", "an angle", above=0.0, below=90.0)  # of the torch
    payload: float = number(0.0, "kg", "a finite mass", least=0.0)  # at the flange, beside the torch
    home: tuple[float, ...] = numbers((0.0, -90.0, 100.0, 0.0, -60.0, 180.0), "deg", ranges=kr90.RANGES)
    as_printed: bool = False  # the paper's torque limit
    rest_at_tags: bool = False  # of the air move
    # Of air time, effort, movement, snap in the sum.
    weights: tuple[float, float, float, float] = numbers((1.0, 1.0, 1.0, 1e-3), least=0.0, some=True)
    min_air_time: float = number(0.5, "s", above=0.0, under="max_air_time")  # of each air move
    max_air_time: float = number(30.0, "s", above=0.0)

    def __post_init__(self) -> None:
        """Checks the fields; what makes no seam of tubes is found where it is made."""
        super().__post_init__()
        if self.rest_at_tags and self.case == "seam":
            raise InputError("rest_at_tags is for case air-move: a weld that keeps its speed does not rest at its tags")


Case = Ogbemhe2019


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


def robot(case: Ogbemhe2019 | None = None) -> Robot:
    """The stand-in on its riser, with the payload of a case."""
    case = case or Ogbemhe2019()
    return kr90.robot(case.payload, riser=case.riser)


def forward_kinematics(q: ArrayLike, case: Ogbemhe2019 | None = None) -> tuple[Array, Array]:
    """Poses of the torch's tip, rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m], of joints ``(N, 6)`` [rad]."""
    return robot(case).poses(q)


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike, case: Ogbemhe2019 | None = None) -> Array:
    """Joints ``(N, 8, 6)`` [rad] of poses of the torch's tip, all branches, NaN where one does not exist."""
    return kr90.inverse_kinematics(rotation, position, (case or Ogbemhe2019()).riser)


def via_points(case: Ogbemhe2019 | None = None) -> Array:
    """Joints [rad] that no variable moves: home before and after a seam ``(2, 6)``, the air move's three ``(3, 6)``."""
    case = case or Ogbemhe2019()
    return np.radians([case.home] * 2 if case.case == "seam" else AIR_MOVE.to_numpy())


# Of both default cases, each objective with another within the reference point;
# python benchmarks/ideal_points.py weld-bezier [case=air-move]. Air times on a seam end within 1 %: the best.
BEST = {
    "seam": {
        "air_time": {"effort": 6.97691, "movement": 6.97691},
        "effort": {"air_time": 3.63686, "movement": 3.63689},
        "movement": {"air_time": 2.28997, "effort": 0.774962},
    },
    "air-move": {
        "air_time": {"dynamic_effort": 4.23322, "effort": 4.23322, "movement": 4.23322},
        "dynamic_effort": {"air_time": 0.0163711, "effort": 0.0162944, "movement": 0.0108871},
        "effort": {"air_time": 0.386736, "dynamic_effort": 0.386736, "movement": 0.386736},
        "movement": {"air_time": 0.261411, "dynamic_effort": 0.0400463, "effort": 0.107494},
    },
}


def build(case: Ogbemhe2019 | None = None) -> Problem:
    """The problem of a case."""
    case = case or Ogbemhe2019()
    return _weld(case) if case.case == "seam" else _air_move(case)


def _objectives(case: Ogbemhe2019, machine: Robot) -> tuple[Objective, ...]:
    """Integrals are exact but for effort; the last two variables are the durations of the air moves."""
    strength = casadi.DM(kr90.EFFORT)
    floating = kr90.robot(case.payload, riser=case.riser, gravity=0.0)

    def strain(robot: Robot) -> SumOfSquares:
        return SumOfSquares(lambda s: kr90.torque(robot, s.q, s.v, s.a) / strength)

    parts = dict(zip(("air_time", "effort", "movement", "snap"), case.weights, strict=True))
    return (
        Objective("air_time", "s", 1.0, eq="sect. I", of_variables=lambda x, p: x[-2] + x[-1]),
        Objective("effort", "s", 1.0, "min", "(1)", strain(machine), gauss(6)),
        Objective("dynamic_effort", "s", 1.0, "min", "our choice", strain(floating), gauss(6)),
        Objective("movement", "rad2/s", 1.0, "min", "sect. III-A", SumOfSquares(lambda s: s.v), gauss(9)),
        Objective("jerk", "rad2/s5", 1.0, "min", "sect. VII", SumOfSquares(lambda s: s.jerk), gauss(7)),
        Objective("snap", "rad2/s7", 1.0, "min", "sect. VII", SumOfSquares(lambda s: s.snap), gauss(6)),
        Objective("total", "-", 1.0, eq="our choice", terms=parts),
    )


def _rest(id: str, q: Array, at: tuple[int, float]) -> PointConstraint:
    return standard.posture(id, q, (at,), JOINTS, UNITS, "sect. IV-B")


def _problem(
    case: Ogbemhe2019, machine: Robot, tags: Tags, labels: tuple[str, str],
    guess: Callable[[np.random.Generator], Array], passed: Sequence[PointConstraint] = (),
    followed: Sequence[PathConstraint] = (), paced: Sequence[DurationConstraint] = (), **more: Any,
) -> Problem:  # fmt: skip
    """What both cases share: rest, an air move, tags with durations that are held, an air move, rest."""
    first, last = via_points(case)[[0, -1]]
    least, most = np.full(2, case.min_air_time), np.full(2, case.max_air_time)
    variables = (*tags.variables("rad", "sect. III-C"), Variable("T", least, most, "s", labels, "our choice"))
    lower, upper = (np.concatenate([getattr(v, end) for v in variables]) for end in ("lower", "upper"))
    held = [t for constraint in paced for t in constraint.lower]
    kinds = {"position": "(20)", **dict.fromkeys(("velocity", "acceleration", "jerk", "snap"), "Table 3")}
    efforts = np.full(6, PRINTED_EFFORT) if case.as_printed else kr90.EFFORT
    effort = standard.effort_limit(
        lambda s: kr90.torque(machine, s.q, s.v, s.a), efforts, machine.effort_units, JOINTS, "(25)"
    )
    limits = (*standard.joint_limits(machine.limits, JOINTS, UNITS, kinds), effort, *followed)
    points = (_rest("start", first, (0, 0.0)), *passed, _rest("end", last, (-1, 1.0)))
    ends = [casadi.SX(at_rest(q)) for q in (first, last)]
    return Problem(
        id="weld-bezier",
        case=case,
        robot=machine,
        variables=variables,
        curve=lambda x: nonic([ends[0], *tags.states(x), ends[1]], casadi.vertcat(x[-2], *held, x[-1])),
        objectives=_objectives(case, machine),
        default_objective="total",
        best_values=BEST[case.case] if case == Ogbemhe2019(case=case.case) else {},
        requirements=Requirements(JOINTS, UNITS, limits, points, continuity=4, duration_constraints=tuple(paced)),
        guess=lambda rng: np.clip(guess(rng), lower, upper),
        **more,
    )


def _about(case: Ogbemhe2019, words: str, curve_kind: str, **more: Any) -> About:
    """With what the paper leaves out and this case has."""
    notes = ["the robot is a stand-in for the KR90: KR150 R3100-2 inertias and efforts on the KR90's dimensions"]
    if case.as_printed:
        notes.append(f"torque limit {PRINTED_EFFORT:g} N m on every joint, as printed: it never binds")
    return About(f"KUKA KR90 stand-in, nonic Bezier segments, {words}", REFERENCE, curve_kind, tuple(notes), **more)


def _weld(case: Ogbemhe2019) -> Problem:
    begun, machine, path, count = start(case), robot(case), seam(case), case.tags
    cut, pieces = begun.cut, range(1, count)
    pace = np.full(count - 1, float(cut.tags[-1]) / case.weld_speed / (count - 1))
    tags = Tags(dict.fromkeys(f"tag {k}" for k in range(1, count + 1)), machine.limits, JOINTS, pace[0])
    return _problem(
        case, machine, tags, ("approach", "retract"),
        lambda rng: np.concatenate([begun.fit.states.ravel(), begun.air]),  # random ones wind the wrist up
        followed=standard.follow(
            machine, cut, pieces, count + 1, case.tcp_box, case.tcp_tolerance, radians(case.max_tilt), "our choice"
        ),
        paced=(DurationConstraint("weld-time", tuple(pieces), pace, pace, "our choice"),),
        reference_point={"air_time": 12.0, "effort": 12.0, "movement": 25.0},
        tuning=Tuning(
            instants={"tcp": chebyshev(10), "tilt": chebyshev(4), "snap-limit": chebyshev(7, ends=True)},
            instants_move=False,
            # Traces that keep the torch's spin and the tags' derivatives definite where nothing else does; our choice.
            regularisation={"movement": 1e-3, "snap": 1e-4},
            # The torch's spin leaves valleys that bend: short steps down them, made longer soon, and a barrier that is
            # low from the start; the optimum of "total" lies in the middle of a valley.
            solver_options={"ipopt": {
                "tol": 1e-4, "mu_target": 3e-5, "mu_init": 1e-3, "perturb_dec_fact": 0.1,
            }},
            warm_start_objective="total",
        ),
        about=_about(
            case, "a seam" if case.seam_file else "a tubular seam",
            f"nonic Bezier, approach, {count - 1} pieces of the seam, retract",
            figures=lambda motion: figures(machine, path, cut.tags, motion.curve, 1),
            surroundings=lambda: Surroundings(paths={"seam": path.at(np.linspace(0.0, path.length, SAMPLES)).position}),
        ),
    )  # fmt: skip


def _air_move(case: Ogbemhe2019) -> Problem:
    machine, points = robot(case), via_points(case)
    least = np.array([least_time(at_rest(a), at_rest(b), case) for a, b in pairwise(points)])
    tags = Tags({"via": points[1]}, machine.limits, JOINTS, float(least.mean()), case.rest_at_tags)
    passed = standard.via_points(points[1], ((1, 0.0),), JOINTS, UNITS, "our choice")
    via = _rest("via", points[1], (1, 0.0)) if case.rest_at_tags else passed
    return _problem(
        case, machine, tags, ("T1", "T2"),
        lambda rng: np.concatenate([0.05 * rng.normal(size=tags.size), least * rng.uniform(1.0, 1.5, 2)]), (via,),
        reference_point={"air_time": 9.0, "dynamic_effort": 0.05, "effort": 2.0, "movement": 2.0},
        dilate=tags.dilate,
        tuning=Tuning(starts=3),  # our choice: Coulomb friction makes many local optima of dynamic effort
        about=_about(case, "an air move through a via point", "nonic Bezier, 2 segments"),
    )  # fmt: skip
