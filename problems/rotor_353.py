"""3-5-3 polynomials for a FANUC M-10iD/8L that welds rotors. Zhu and Wang, improved particle swarm.

Decision variables  the durations t1, t2, t3 [s] of the three segments; the payload [kg] if it is freed    (13)
Curve               cubic, quintic, cubic through the four points of Table 2, at rest at both ends    (4)-(7)
Objectives          time (13); effort, work and jerk, which the paper leaves to later work    sect. 5
Subject to          velocity (14), acceleration (15) for all t; jerk if given; positions and efforts of the maker
Deviations
  Table 2 is in degrees (printed rad), as the teach pendant shows them: its joint 3 is measured from the horizontal. Its
  joint 3 at X2 is -63.179: with that sign, and only with it, the last move is a pure translation, as the first one is a
  turn about the vertical. ``as_printed`` keeps the printed 63.179. Table 1, row 4: a = 195 mm (printed 1100).
  The paper gives no limits. Velocities, positions, inertias and efforts are those of the maker's robot description
  (FANUC Corporation, fanuc_description, m10_8-20d, Apache-2.0); its efforts look like round placeholders. Accelerations
  are our choice: 2 v_max per second. One (t1, t2, t3) for all joints; ``timing="per_joint"`` is the paper's recipe,
  each joint alone and then the longest of each phase, which is neither optimal nor always within the limits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi
import numpy as np
import pinocchio as pin
from numpy.polynomial.legendre import leggauss
from numpy.typing import ArrayLike, NDArray

from ocp_traj.chain import AxisJoint, LinkInertia
from ocp_traj.curves import polynomial_353
from ocp_traj.errors import InputError
from ocp_traj.problem import Decomposition, Objective, Problem, Variable
from ocp_traj.requirements import PathConstraint, PointConstraint, Requirements, State
from ocp_traj.robot import ActuatorMap, Robot

Array = NDArray[np.float64]
Six = tuple[float, ...]

JOINTS = ("J1", "J2", "J3", "J4", "J5", "J6")
TIMINGS = ("synchronised", "per_joint")
VELOCITY = (210.0, 210.0, 220.0, 430.0, 450.0, 720.0)  # [deg/s], maker's description
ACCELERATION = tuple(2.0 * v for v in VELOCITY)  # [deg/s^2]: our choice
EFFORT = (2000.0, 3000.0, 1000.0, 100.0, 100.0, 50.0)  # [N m], maker's description
POSITION = ((-185.0, -90.0, -90.0, -190.0, -179.999, -450.0), (185.0, 145.0, 222.0, 190.0, 179.999, 450.0))  # [deg]
# [W] s of |power| = sqrt(power^2 + s^2), which exceeds it by at most s a joint; with the 24 instants a segment of its
# quadrature, work is within 0.4 % of the integral over 30 random motions (tests/test_rotor_353.py). Our choice.
SMOOTHING = 0.1
PER_JOINT = {"size": 6, "empty": True}  # of a case field: six numbers, or none

# Table 2 [deg], points X_0 .. X_3 by joint; joint 3 of X_2 prints 63.179.
TABLE_2 = (
    (-23.496, -20.128, -7.361, -8.055),
    (73.451, 80.381, 68.721, 61.474),
    (-62.949, -55.208, -63.179, -68.520),
    (77.747, 78.321, -35.605, -29.593),
    (41.879, 35.783, 27.940, 32.293),
    (-2.099, -12.636, 53.129, 46.917),
)
PRINTED_SIGN = 63.179  # [deg], Table 2, joint 3, X_2

# Maker's description: placement [m] and axis of each joint; mass [kg], centre of mass [m], inertia about it
# (xx, xy, xz, yy, yz, zz) [kg m^2] of its link, in the joint's frame.
LINKS = (
    ((0.0, 0.0, 0.45), (0, 0, 1), 25.1, (0.0385, -0.0176, -0.0359),
     (0.285, -0.0106, -0.0157, 0.242, -0.00898, 0.336)),
    ((0.075, 0.0, 0.0), (0, 1, 0), 33.5, (-0.0227, -0.151, 0.402),
     (2.3, -0.0223, 0.0191, 2.33, -0.0412, 0.152)),
    ((0.0, 0.0, 0.84), (0, -1, 0), 54.5, (0.242, 0.0064, 0.116),
     (0.693, -0.0249, -0.368, 2.13, -0.035, 2.1)),
    ((0.0, 0.0, 0.195), (-1, 0, 0), 17.5, (0.678, -0.0311, -0.000832),
     (0.0509, 0.0696, 0.000437, 0.9, -0.000433, 0.915)),
    ((1.1, 0.0, 0.0), (0, -1, 0), 1.16, (0.0214, -0.015, 0.0),
     (0.00173, -0.000392, 0.0, 0.00191, 0.0, 0.00189)),
    ((0.0, 0.0, 0.0), (-1, 0, 0), 0.224, (0.0537, 0.0, 0.0),
     (0.000131, 0.0, 0.0, 0.000102, 0.0, 0.000102)),
)  # fmt: skip
FLANGE = 0.075  # [m] from the wrist along J6


@dataclass(frozen=True)
class ZhuWang:
    """The paper's numbers; a field is what a user may change. Degrees, as in Table 2 and the maker's description."""

    as_printed: bool = False  # joint 3 of X_2 with the printed sign
    velocity: Six = VELOCITY  # v_max [deg/s], (14): maker's description
    acceleration: Six = field(default=ACCELERATION, metadata=PER_JOINT)  # a_max [deg/s^2], (15): our choice; or none
    jerk: Six = field(default=(), metadata=PER_JOINT)  # [deg/s^3], or none
    payload: float = 0.0  # [kg], a point mass at the flange
    effort_limits: bool = True  # whether the maker's efforts are limits
    timing: str = "synchronised"  # of TIMINGS
    min_duration: float = 0.05  # [s], of each segment: our choice
    max_duration: float = 4.0  # [s]: our choice
    free_payload: bool = False  # whether the payload is a decision variable
    max_payload: float = 100.0  # [kg], bound on the freed payload: our choice

    def __post_init__(self) -> None:
        """Checks the fields."""
        for name in ("velocity", "acceleration", "jerk"):
            numbers = getattr(self, name)
            if len(numbers) not in ((6,) if name == "velocity" else (0, 6)) or not all(
                np.isfinite(v) and v > 0.0 for v in numbers
            ):
                none = "" if name == "velocity" else ", or none"
                raise InputError(f"{name} is {numbers}; give six numbers above zero, in degrees{none}")
        if not (np.isfinite(self.payload) and self.payload >= 0.0):
            raise InputError(f"payload is {self.payload} kg; give a finite mass, zero or more")
        if not (np.isfinite(self.max_payload) and self.max_payload > 0.0):
            raise InputError(f"max_payload is {self.max_payload} kg; give a finite mass above zero")
        if self.timing not in TIMINGS:
            raise InputError(f"timing is {self.timing!r}; allowed are {', '.join(TIMINGS)}")
        if self.timing == "per_joint" and self.free_payload:
            raise InputError("timing per_joint has no payload to choose: every joint is timed alone")
        if not 0.0 < self.min_duration < self.max_duration < np.inf:
            raise InputError(
                f"min_duration {self.min_duration} s and max_duration {self.max_duration} s leave no duration; "
                "give 0 < min_duration < max_duration"
            )


def serial_angles(q: Any) -> Any:
    """Angles between the links from the pendant's, whose joint 3 is measured from the horizontal. [rad]."""
    return casadi.vertcat(q[0], q[1], q[1] + q[2], q[3], q[4], q[5])


def robot() -> Robot:
    """FANUC M-10iD/8L with the inertias of the maker's description; its coordinates are the pendant's angles."""
    joints = []
    for place, axis, mass, centre, (xx, xy, xz, yy, yz, zz) in LINKS:
        inertia = LinkInertia(mass, centre, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        joints.append(AxisJoint("revolute", axis, pin.SE3(np.eye(3), np.array(place)), inertia))
    return Robot.from_dh(
        rows=(),
        inertias=(),
        prefix=joints,
        tool=pin.SE3(np.eye(3), np.array([FLANGE, 0.0, 0.0])),
        gravity=(0.0, 0.0, -9.81),
        joints=JOINTS,
        units=("rad",) * 6,
        actuator_map=ActuatorMap("pendant angles", serial_angles),
        name="FANUC M-10iD/8L",
    )


# Table 1 [m], modified Denavit-Hartenberg; row 4 prints a = 1.1.
A1, A2, A3, D4, BASE = 0.075, 0.84, 0.195, 1.1, 0.45
SINGULAR = 1e-9  # of the reach, and of a sine: closer to a singularity, angles are not determined; our choice


def dh_angles(q: ArrayLike) -> Array:
    """Theta of Table 1's Denavit-Hartenberg rows from the pendant's angles ``(N, 6)`` [rad]."""
    j = np.atleast_2d(np.asarray(q, dtype=float))
    turned = np.stack([j[:, 0], j[:, 1] - np.pi / 2, -(j[:, 1] + j[:, 2]), -j[:, 3], -j[:, 4], -j[:, 5]], axis=1)
    return np.asarray(turned)


def pendant_angles(theta: ArrayLike) -> Array:
    """The pendant's angles from theta of Table 1's rows ``(N, 6)`` [rad]; the inverse of ``dh_angles``."""
    t = np.atleast_2d(np.asarray(theta, dtype=float))
    second = t[:, 1] + np.pi / 2
    return np.asarray(np.stack([t[:, 0], second, -t[:, 2] - second, -t[:, 3], -t[:, 4], -t[:, 5]], axis=1))


def _rows(theta: Array, first: int, last: int) -> Array:
    """Product of Table 1's transforms first .. last, by (1): ``(N, 4, 4)``."""
    rows = ((0.0, 0.0, BASE), (A1, -1.0, 0.0), (A2, 0.0, 0.0), (A3, -1.0, D4), (0.0, 1.0, 0.0), (0.0, -1.0, FLANGE))
    product = np.broadcast_to(np.eye(4), (len(theta), 4, 4))
    for i in range(first, last):
        a, sine, d = rows[i]
        cosine = 1.0 - abs(sine)  # the twists are 0 and +-90 deg
        c, s, zero, one = np.cos(theta[:, i]), np.sin(theta[:, i]), np.zeros(len(theta)), np.ones(len(theta))
        step = np.array([
            [c, -s, zero, a * one],
            [s * cosine, c * cosine, -sine * one, -d * sine * one],
            [s * sine, c * sine, cosine * one, d * cosine * one],
            [zero, zero, zero, one],
        ])  # fmt: skip
        product = product @ np.moveaxis(step, 2, 0)
    return np.asarray(product)


def forward_kinematics(q: ArrayLike) -> Array:
    """Pose of the flange ``(N, 4, 4)`` [m] at the pendant's angles ``(N, 6)`` [rad]; (1), (2), Table 1 corrected."""
    return _rows(dh_angles(q), 0, 6)


def inverse_kinematics(pose: ArrayLike) -> tuple[Array, tuple[str, ...]]:
    """All configurations that put the flange at a pose; (3) recovers none, so this is a closed form of our own.

    Args:
        pose: of the flange ``(4, 4)`` [m].

    Returns:
        The pendant's angles ``(branches, 6)`` [rad], each within (-pi, pi] but for the third, and a name a branch:
        shoulder ``front`` or ``back``, elbow ``up`` or ``down``, wrist ``unflipped`` or ``flipped``.

    Raises:
        InputError: the pose is no rigid motion or out of reach; or it is singular, and infinitely many solve it.
    """
    target = np.asarray(pose, dtype=float)
    rotation = target[:3, :3] if target.shape == (4, 4) else np.zeros((3, 3))
    if (
        not np.isfinite(target).all()
        or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6
        or np.linalg.det(rotation) < 0.0
    ):
        raise InputError(
            f"the pose of shape {target.shape} is no rigid motion; give a rotation and a position in (4, 4)"
        )
    p = target[:3, 3] - FLANGE * rotation[:, 2]
    reach, length = float(np.hypot(p[0], p[1])), float(np.hypot(A3, D4))
    if reach < SINGULAR:
        raise InputError("the wrist is on axis 1, where joint 1 may be anything: a shoulder singularity; move the pose")
    z = p[2] - BASE
    found, names, least = [], [], np.inf
    for shoulder, side in (("front", 1.0), ("back", -1.0)):
        first, r = np.arctan2(side * p[1], side * p[0]), side * reach - A1
        distance = float(np.hypot(r, z))
        k = (distance**2 - A2**2 - length**2) / (2.0 * A2)
        least = min(least, max(distance - (A2 + length), abs(A2 - length) - distance))
        if abs(k) > length:
            continue
        for elbow, sign in (("up", 1.0), ("down", -1.0)):
            third = np.arctan2(A3, D4) - np.arctan2(k, sign * np.sqrt(length**2 - k**2))
            c, s = np.cos(third), np.sin(third)
            m, n = A2 + A3 * c - D4 * s, A3 * s + D4 * c
            second = np.arctan2(-z * m - r * n, r * m - z * n)
            arm = _rows(np.array([[first, second, third, 0.0, 0.0, 0.0]]), 0, 3)[0, :3, :3]
            hand = arm.T @ rotation
            sine = float(np.hypot(hand[0, 2], hand[2, 2]))
            if sine < SINGULAR:
                raise InputError(
                    "joints 4 and 6 are in line, only their sum is given: a wrist singularity; move the pose"
                )
            for wrist, turn in (("unflipped", 1.0), ("flipped", -1.0)):
                fourth, sixth = (
                    np.arctan2(turn * hand[2, 2], -turn * hand[0, 2]),
                    np.arctan2(-turn * hand[1, 1], turn * hand[1, 0]),
                )
                found.append([first, second, third, fourth, np.arctan2(turn * sine, hand[1, 2]), sixth])
                names.append(f"{shoulder} {elbow} {wrist}")
    if not found:
        raise InputError(f"the pose is out of reach: the wrist is {least:.6g} m too far from, or too near to, axis 2")
    q = pendant_angles(found)
    wrapped = np.arctan2(np.sin(q), np.cos(q))
    wrapped[:, 2] = np.arctan2(np.sin(q[:, 1] + q[:, 2]), np.cos(q[:, 1] + q[:, 2])) - wrapped[:, 1]
    return wrapped, tuple(names)


def via_points(case: ZhuWang) -> Array:
    """Table 2: the four points ``(4, 6)`` [rad]."""
    points: Array = np.radians(np.array(TABLE_2).T)
    if case.as_printed:
        points[2, 2] = np.radians(PRINTED_SIGN)
    return points


def gauss(points: int) -> tuple[tuple[float, float], ...]:
    """Gauss-Legendre rule on [0, 1]: exact for polynomials up to degree 2 points - 1."""
    nodes, weights = leggauss(points)
    return tuple(((1.0 + float(u)) / 2.0, float(w) / 2.0) for u, w in zip(nodes, weights, strict=True))


def build(case: ZhuWang | None = None) -> Problem:
    """The problem of a case."""
    case = case or ZhuWang()
    points = via_points(case)
    parts: tuple[Problem, ...] = ()
    if case.timing == "per_joint":
        parts = tuple(_problem(case, points, (j,)) for j in range(6))
    return _problem(case, points, tuple(range(6)), parts)


def _problem(case: ZhuWang, points: Array, chosen: tuple[int, ...], parts: tuple[Problem, ...] = ()) -> Problem:
    """The problem of some joints; of all six with the robot's efforts."""
    joints, count, whole = tuple(JOINTS[j] for j in chosen), len(chosen), len(chosen) == 6
    machine = robot()
    durations = Variable(
        "t", np.full(3, case.min_duration), np.full(3, case.max_duration), "s", ("t1", "t2", "t3"), "(13)"
    )
    mass = Variable("payload", np.zeros(1), np.array([case.max_payload]), "kg", ("payload",), "sect. 4")
    free = case.free_payload

    def torque(s: State) -> Any:
        return machine.effort(s.q, s.v, s.a, payload=s.p[0])

    limits = []
    if whole:
        low, high = (np.radians(bound) for bound in POSITION)
        labels = ("J1", "J2", "J2 + J3", "J4", "J5", "J6")
        limits.append(
            PathConstraint("position", lambda s: serial_angles(s.q), low, high, ("rad",) * 6, labels, "maker")
        )
    bounds = (
        ("velocity", case.velocity, "(14)"),
        ("acceleration", case.acceleration, "(15)"),
        ("jerk", case.jerk, "ours"),
    )
    for order, (name, values, eq) in enumerate(bounds, 1):
        if values:
            bound = np.radians([values[j] for j in chosen])
            units = ("rad/s" + ("" if order == 1 else str(order)),) * count
            limits.append(PathConstraint.on_derivative(f"{name}-limit", order, -bound, bound, units, joints, eq))
    if whole and case.effort_limits:
        strongest = np.array(EFFORT)
        limits.append(
            PathConstraint("effort-limit", torque, -strongest, strongest, machine.effort_units, joints, "maker")
        )
    rest = PointConstraint(
        "rest", lambda s: casadi.vertcat(s.v, s.a), ((0, 0.0), (-1, 1.0)), np.zeros(2 * count), np.zeros(2 * count),
        ("rad/s",) * count + ("rad/s2",) * count, tuple(f"v {j}" for j in joints) + tuple(f"a {j}" for j in joints),
        "sect. 3.1", structural=True,
    )  # fmt: skip
    where = points[:, list(chosen)]
    via = PointConstraint(
        "via", lambda s: s.q, ((0, 0.0), (1, 0.0), (2, 0.0), (-1, 1.0)), where, where, ("rad",) * count, joints,
        "Table 2", structural=True,
    )  # fmt: skip

    objectives = [Objective("time", "s", 1.0, eq="(13)", of_variables=lambda x, p: casadi.sum1(x[:3]))]
    if whole:
        strength = casadi.DM(EFFORT)
        objectives += [
            Objective(
                "effort", "s", 1.0, eq="sect. 5", quadrature=gauss(10),
                integrand=lambda s: casadi.sumsqr(torque(s) / strength),
            ),
            Objective(
                "work", "J", 1000.0, eq="sect. 5", quadrature=gauss(24),
                integrand=lambda s: casadi.sum1(casadi.sqrt((torque(s) * s.v) ** 2 + SMOOTHING**2)),
            ),
        ]  # fmt: skip
    objectives.append(
        Objective(
            "jerk", "rad2/s5", 1000.0, eq="sect. 5", quadrature=gauss(3), integrand=lambda s: casadi.sumsqr(s.jerk)
        )
    )
    if free:
        objectives.append(
            Objective("payload_mass", "kg", 10.0, sense="max", eq="sect. 4", of_variables=lambda x, p: x[3])
        )

    def guess(rng: np.random.Generator) -> Array:
        t = np.exp(rng.uniform(np.log(max(0.2, case.min_duration)), np.log(max(2.0, case.min_duration)), 3))
        t = np.clip(t, case.min_duration, case.max_duration)
        return np.append(t, rng.uniform(0.0, min(5.0, case.max_payload))) if free else t

    return Problem(
        id="rotor-353",
        title="FANUC M-10iD/8L, 3-5-3 polynomials" + ("" if whole else f", {joints[0]} alone"),
        reference="Zhu and Wang, improved particle swarm, 3-5-3 polynomials",
        case=case,
        robot=machine if whole else None,
        variables=(durations, mass) if free else (durations,),
        curve=lambda x: polynomial_353(where, x[:3]),
        curve_kind="3-5-3 polynomials, 3 segments",
        parameters=lambda x: x[3:4] if free else casadi.SX(case.payload),
        objectives=tuple(objectives),
        default_objective="time",
        reference_point=_reference(case, where, bounds, chosen),
        requirements=Requirements(joints, ("rad",) * count, tuple(limits), (rest, via), ("payload",), continuity=2),
        guess=guess,
        dilate=lambda x, s: np.concatenate([np.asarray(x)[:3] * s, np.asarray(x)[3:]]),
        scales_in_time=not free,
        decomposition=Decomposition(parts, lambda xs: np.max(xs, axis=0)) if parts else None,
    )


def _reference(case: ZhuWang, points: Array, bounds: Any, chosen: tuple[int, ...]) -> dict[str, float]:
    """The worst values worth having: of twice the time that the ratios 1 : 3 : 1 take; our choice.

    Effort and work are rates of a slow motion, measured at the default case, times that time.
    """
    curve = polynomial_353(points, np.array([1.0, 3.0, 1.0]))
    slowest = 0.0
    for order, (_, values, _) in enumerate(bounds, 1):
        for j, extremum in zip(chosen if values else (), curve.extrema(order), strict=False):
            peak = max(abs(extremum.lower), abs(extremum.upper))
            slowest = max(slowest, float((peak / np.radians(values[j])) ** (1.0 / order)))
    time = min(10.0 * slowest, 3.0 * case.max_duration)
    dilated = polynomial_353(points, time / 10.0 * np.array([1.0, 3.0, 1.0]))
    jerk = sum(
        duration * sum(w * float((dilated.at(k, u, 3) ** 2).sum()) for u, w in gauss(3))
        for k, duration in enumerate(dilated.durations.tolist())
    )
    return {"time": time, "effort": 0.15 * time, "work": 1000.0 * time, "jerk": 30.0 * jerk}


# What the paper reports, sect. 4 [s].
PHASES = (0.311, 0.660, 1.676)
TOTAL = 2.647
