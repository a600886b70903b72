"""3-5-3 polynomials for a FANUC M-10iD/8L that welds rotors. Zhu and Wang, improved particle swarm.

Decision variables  the durations t1, t2, t3 [s] of the three segments; the payload [kg] if it is freed    (13)
Curve               cubic, quintic, cubic through the four points of Table 2, at rest at both ends    (4)-(7)
Objectives          time (13); effort, work and jerk, which the paper leaves to later work    sect. 5
Subject to          velocity (14), acceleration (15) for all t; jerk if given; positions and efforts of the maker
Deviations
  Table 2 is in degrees (printed rad), as the teach pendant shows them: its joint 3 is measured from the horizontal. Its
  joint 3 at X2 is -63.179: with that sign the last move is a pure translation, as the first is a turn about the
  vertical; ``as_printed`` keeps the printed 63.179. Table 1, row 4: a = 195 mm (printed 1100).
  The paper gives no limits. Velocities, positions, inertias and efforts are those of the maker's robot description (see
  ``ocp_traj.problems.m10id``), whose efforts look like round placeholders. Accelerations are our choice: 2 v_max per
  second. One (t1, t2, t3) for all joints; ``timing="per_joint"`` is the paper's recipe, each joint alone and then the
  longest of each phase, which is neither optimal nor always within the limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import polynomial_353
from ocp_traj.errors import InputError
from ocp_traj.formulation import standard
from ocp_traj.formulation.about import About
from ocp_traj.formulation.case import Checked, choice, number, numbers
from ocp_traj.formulation.objective import Objective, SumOfSquares, gauss
from ocp_traj.formulation.problem import Decomposition, Problem, Variable
from ocp_traj.formulation.requirements import Expression, PathConstraint, Requirements, State
from ocp_traj.problems import m10id
from ocp_traj.problems.m10id import EFFORT, JOINTS, POSITION, VELOCITY, serial_angles
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

Six = tuple[float, ...]

ALL, RAD = range(6), ("rad",) * 6
LINK_ANGLES = ("J1", "J2", "J2 + J3", "J4", "J5", "J6")
TIMINGS = ("synchronised", "per_joint")
ACCELERATION = tuple(2.0 * v for v in VELOCITY)  # [deg/s^2]: our choice
# [W] of |power|: sqrt(power^2 + s^2) exceeds it by at most s, and work comes out at most 6 s T too large. Our choice.
SMOOTHING = 0.1
# Gauss-Legendre nodes a segment, our choice. Measured on 22 motions of 1.4 to 4.3 s against finer rules: effort within
# 1.4e-7 of its value, work within 0.3 %, smoothing included; squared jerk is of degree 4, so that 3 nodes are exact.
NODES = {"effort": 16, "work": 24, "jerk": 3}

# Table 2; joint 3 of X_2 prints 63.179.
TABLE_2 = pd.DataFrame(index=JOINTS, columns=["X_0 [deg]", "X_1 [deg]", "X_2 [deg]", "X_3 [deg]"], data=(
    (-23.496, -20.128, -7.361, -8.055),
    (73.451, 80.381, 68.721, 61.474),
    (-62.949, -55.208, -63.179, -68.520),
    (77.747, 78.321, -35.605, -29.593),
    (41.879, 35.783, 27.940, 32.293),
    (-2.099, -12.636, 53.129, 46.917),
))  # fmt: skip
PRINTED_SIGN = 63.179  # [deg], Table 2, joint 3, X_2


@dataclass(frozen=True)
class ZhuWang(Checked):
    """The paper's numbers; a field is what a user may change. Degrees, as in Table 2 and the maker's description."""

    as_printed: bool = False  # joint 3 of X_2 with the printed sign; a3 of Table 1 as printed
    velocity: Six = numbers(VELOCITY, "deg/s", above=0.0)  # v_max, (14): maker's description
    acceleration: Six = numbers(ACCELERATION, "deg/s2", empty=True, above=0.0)  # a_max, (15): our choice; or none
    jerk: Six = numbers((), "deg/s3", size=6, empty=True, above=0.0)
    payload: float = number(0.0, "kg", "a finite mass", least=0.0)  # a point mass at the flange
    position_limits: bool = True  # whether the maker's ranges of the joints are limits; the paper has none
    effort_limits: bool = True  # whether the maker's efforts are limits; the paper has none
    timing: str = choice("synchronised", TIMINGS)
    min_duration: float = number(0.05, "s", above=0.0, under="max_duration")  # of each segment: our choice
    max_duration: float = number(4.0, "s", above=0.0)  # our choice
    free_payload: bool = False  # whether the payload is a decision variable
    max_payload: float = number(150.0, "kg", "a finite mass", above=0.0)  # if freed: our choice

    def __post_init__(self) -> None:
        """Checks the fields."""
        super().__post_init__()
        if self.timing == "per_joint" and self.free_payload:
            raise InputError("timing per_joint has no payload to choose: every joint is timed alone")


Case = ZhuWang


def robot(case: ZhuWang | None = None) -> Robot:
    """The arm, the same of every case."""
    return m10id.robot()


def forward_kinematics(q: ArrayLike, case: ZhuWang | None = None) -> tuple[Array, Array]:
    """Flange poses, rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m], of pendant angles ``(N, 6)`` [rad]."""
    return m10id.forward_kinematics(q, bool(case and case.as_printed))


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike, case: ZhuWang | None = None) -> Array:
    """Pendant angles ``(N, 8, 6)`` [rad] of flange poses, all branches, NaN where one does not exist."""
    return m10id.inverse_kinematics(rotation, position, bool(case and case.as_printed))


def via_points(case: ZhuWang | None = None) -> Array:
    """Table 2: the four points ``(4, 6)`` [rad]."""
    points = np.radians(TABLE_2.to_numpy().T)
    if case and case.as_printed:
        points[2, 2] = np.radians(PRINTED_SIGN)
    return np.asarray(points)


def notes(case: ZhuWang) -> tuple[str, ...]:
    """What the paper leaves out and this case has."""

    def numbers(values: Six, unit: str) -> str:
        return f"{', '.join(f'{v:g}' for v in values)} {unit}" if values else "none"

    source = {
        "velocity": "the maker's description" if case.velocity == VELOCITY else "given",
        "acceleration": "our choice, 2 v_max per second" if case.acceleration == ACCELERATION else "given",
    }
    said = [
        f"v_max {numbers(case.velocity, 'deg/s')}: {source['velocity']}",
        f"a_max {numbers(case.acceleration, 'deg/s2')}: {source['acceleration']}",
    ]
    if case.jerk:
        said.append(f"jerk limit {numbers(case.jerk, 'deg/s3')}: given")
    if case.effort_limits:
        said.append(f"efforts {numbers(EFFORT, 'N m')}: the maker's description, round numbers that look provisional")
    if case.timing == "per_joint":
        said.append(
            "timing per_joint, the paper's: every joint alone, then the longest of each phase; not an optimum, and not "
            "always within the limits"
        )
    return tuple(said)


def worst_worth_having(case: ZhuWang, points: Array, machine: Robot) -> dict[str, float]:
    """Reference point of fronts: our choice, from the fastest motion in three equal durations within (14), (15).

    Twice its time and effort, four times its work, ten times its squared jerk.
    """
    unit, slowest = polynomial_353(points, np.ones(3)), case.min_duration
    for order, limits in enumerate((case.velocity, case.acceleration, case.jerk), 1):
        if limits:
            peaks = np.array([max(-e.lower, e.upper) for e in unit.extrema(order)])
            slowest = max(slowest, float((peaks / np.radians(limits)).max() ** (1.0 / order)))
    curve = PiecewiseBezier(np.full(3, slowest), unit.control_points)
    nodes, weights = np.array(gauss(NODES["effort"])).T
    q, v, a, jerk = (np.concatenate([curve.at(k, nodes, order) for k in range(3)]).T for order in range(4))
    symbols = [casadi.SX.sym(name, 6) for name in "qva"]
    effort = casadi.Function("effort", symbols, [machine.effort(*symbols, payload=case.payload)])
    tau, share = np.array(effort(q, v, a)), slowest * np.tile(weights, 3)
    return {
        "time": 6.0 * slowest,
        "effort": 2.0 * float(share @ ((tau / np.array(EFFORT)[:, None]) ** 2).sum(axis=0)),
        "work": 4.0 * float(share @ np.abs(tau * v).sum(axis=0)),
        "jerk": 10.0 * float(share @ (jerk**2).sum(axis=0)),
    }


# Of the default case, each with another within the reference point; python benchmarks/ideal_points.py rotor-353
BEST = {
    "time": {"effort": 1.73136, "work": 1.73136, "jerk": 1.73136},
    "effort": {"time": 0.216743, "work": 0.216743, "jerk": 0.216743},
    "work": {"time": 448.58, "effort": 447.823, "jerk": 436.529},
    "jerk": {"time": 50.7629, "effort": 81.6909, "work": 5.72568},
}


def build(case: ZhuWang | None = None) -> Problem:
    """The problem of a case."""
    case = case or ZhuWang()
    machine, points, strength, (low, high) = robot(), via_points(case), casadi.DM(EFFORT), np.radians(POSITION)

    def torque(s: State) -> Any:
        return machine.effort(s.q, s.v, s.a, payload=s.p[0])

    def strain(s: State) -> Any:
        return torque(s) / strength

    def power(s: State) -> Any:
        return casadi.sum1(casadi.sqrt((torque(s) * s.v) ** 2 + SMOOTHING**2))

    def integral(id: str, unit: str, scale: float, integrand: Expression) -> Objective:
        return Objective(id, unit, scale, eq="sect. 5", integrand=integrand, quadrature=gauss(NODES[id]))

    time = Objective("time", "s", 1.0, eq="(13)", of_variables=lambda x, p: casadi.sum1(x[:3]))
    jerk = integral("jerk", "rad2/s5", 1000.0, SumOfSquares(lambda s: s.jerk))
    positions = PathConstraint("position-limit", lambda s: serial_angles(s.q), low, high, RAD, LINK_ANGLES, "maker")
    efforts = standard.effort_limit(torque, EFFORT, machine.effort_units, JOINTS, "maker")
    alone = ALL if case.timing == "per_joint" else ()
    parts = tuple(_problem(case, points, [j], _limits(case, [j]), (time, jerk)) for j in alone)
    problem = _problem(
        case, points, ALL,
        (*[positions] * case.position_limits, *_limits(case, ALL), *[efforts] * case.effort_limits),
        (time, integral("effort", "s", 1.0, SumOfSquares(strain)), integral("work", "J", 1000.0, power), jerk),
        robot=machine,
        reference_point=worst_worth_having(case, points, machine),
        best_values=BEST if case == ZhuWang() else {},
        decomposition=Decomposition(parts, lambda xs: np.max(xs, axis=0)) if parts else None,
    )  # fmt: skip
    return standard.free_payload(problem, case.max_payload, 5.0, "ours") if case.free_payload else problem


def _limits(case: ZhuWang, chosen: Sequence[int]) -> tuple[PathConstraint, ...]:
    """Velocity, acceleration and jerk of some joints, those that are given."""
    kinds = {"velocity": "(14)", "acceleration": "(15)", "jerk": "ours"}
    given = {name: np.radians(getattr(case, name))[list(chosen)] for name in kinds if getattr(case, name)}
    return standard.joint_limits(JointLimits(**given), [JOINTS[j] for j in chosen], RAD[: len(chosen)], kinds)


def _problem(
    case: ZhuWang, points: Array, chosen: Sequence[int], limits: Sequence[PathConstraint],
    objectives: tuple[Objective, ...], **more: Any,
) -> Problem:  # fmt: skip
    """The problem of some joints, in three durations for all of them."""
    joints, units, where = tuple(JOINTS[j] for j in chosen), RAD[: len(chosen)], points[:, list(chosen)]
    least, most = np.full(3, case.min_duration), np.full(3, case.max_duration)
    passed = standard.via_points(where, ((0, 0.0), (1, 0.0), (2, 0.0), (-1, 1.0)), joints, units, "Table 2")

    def guess(rng: np.random.Generator) -> Array:
        low, high = (np.log(max(t, case.min_duration)) for t in (0.2, 2.0))
        return np.clip(np.exp(rng.uniform(low, high, 3)), least, most)

    return Problem(
        id="rotor-353",
        case=case,
        variables=(Variable("t", least, most, "s", ("t1", "t2", "t3"), "(13)"),),
        curve=lambda x: polynomial_353(where, x[:3]),
        parameters=lambda x: casadi.SX(case.payload),
        objectives=objectives,
        requirements=Requirements(
            joints, units, tuple(limits), (standard.rest(joints, units, eq="sect. 3.1"), passed), ("payload",), 2
        ),
        guess=guess,
        dilate=lambda x, s: np.asarray(x) * s,
        scales_in_time=True,
        about=About(
            "FANUC M-10iD/8L, 3-5-3 polynomials" + ("" if len(chosen) == 6 else f", {joints[0]} alone"),
            "Zhu and Wang, improved particle swarm, 3-5-3 polynomials",
            "3-5-3 polynomials, 3 segments",
            notes(case),
        ),
        **more,
    )


# What the paper reports, sect. 4.
PHASES = pd.Series((0.311, 0.660, 1.676), ("t1 [s]", "t2 [s]", "t3 [s]"))
TOTAL = 2.647  # [s]
SHORTENED = 56.0  # [%]
GUESS = 2.0  # [s], of each phase to begin with
