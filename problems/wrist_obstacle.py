"""A spherical wrist passes obstacles on a quartic and a quintic. El Haiek et al. (2019), Procedia Manufacturing 32.

Decision variables  angles and velocities of the via point, th3 at the goal, t1, t2; the clearance where there are
                    obstacles                                                                              sect. 4
Curve               a quartic to the via point, then a quintic, at rest at both ends                      (4)-(15)
Objectives          time T (17), joint travelling distance Fq (18), their sum Ff (16); clearance (our choice)
Subject to          the link clear of every obstacle (20); position (sect. 5), velocity and acceleration for all t
Deviations
  (19) divides by zero, so the obstacle is a limit. (8) lacks a term and b4 is missing: the curve solves the conditions
  that define them. Fq is the total variation of the joints, the limit of (18) for ever more positions.
  In the plane base, obstacle and goal of sect. 5 lie on one line, so the goal always collides: the cases lift start and
  goal off the plane. Without limits on velocity and acceleration time dilation makes T whatever its bound is: those
  limits, the bounds on t1 and t2, the sizes of obstacle and link, and d3 are our choice, as are the effort limits.
  Both ways to hold the wrist at the goal, (th1, th2) and (th1 -+ pi, -th2), are its branches 0 and 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot, isfinite, pi, sqrt
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import quartic_quintic
from ocp_traj.errors import InputError
from ocp_traj.formulation import standard
from ocp_traj.formulation.about import About
from ocp_traj.formulation.case import Checked, choice, number, numbers
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.formulation.rows import Conflict
from ocp_traj.formulation.surroundings import Surroundings
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.problems import wrist
from ocp_traj.problems.wrist import JOINTS, UNITS
from ocp_traj.robot import bodies
from ocp_traj.robot.collision import Obstacle, least_clearance
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

Point = tuple[float, float, float]

UNIT = 0.1  # [m], of the paper's lengths; our choice
BRANCHES = ("best", "0", "1")
# Start and goal of the tip [length units]; those of sect. 5 in the plane are (-1, 1) and (1, 1).
CASES: dict[str, tuple[Point, Point]] = {
    "blocked": ((-1.0, 1.0, -sqrt(2.0)), (1.0, 1.0, sqrt(2.0))),
    "open": ((-1.0, 1.0, sqrt(2.0)), (1.0, 1.0, sqrt(2.0))),
}
REACHED = 0.01  # of d3: how far a start or goal may lie off the tip's sphere, on which it is then put; our choice
ROOM = 1e-3  # [rad], of the clearance above the least one, even where the ends leave less; our choice
RESERVE = 2e-9  # [rad], by which a clearance is reported short of what was found, so that it can be proved; our choice


@dataclass(frozen=True)
class ElHaiek2019(Checked):
    """The numbers of a case; a field is what a user may change. Lengths are in the paper's unit, which has no name."""

    case: str = choice("blocked", tuple(CASES))  # start and goal change either
    start: Point | None = None  # of the tip; the case's own if not given
    goal: Point | None = None
    # x, y, z, radius of each, sect. 5; () or "none" where there are none.
    obstacles: tuple[tuple[float, float, float, float], ...] = ((0.5, 0.5, 0.0, 0.4),)
    link_radius: float = number(0.05, above=0.0)  # of the link, a capsule from the base to the tip
    d3: float = number(2.0, above=0.0)  # length of the link, (1)-(3)
    weights: tuple[float, float] = numbers((1.0, 1.0), least=0.0, some=True)  # beta1 [1/s], beta2 [1/rad] of (16)
    branch: str = choice("best", BRANCHES)  # how the wrist is held at the goal
    # The angle, seen from the base, that stays between link and obstacles.
    min_clearance: float = number(0.0, "rad", "an angle", least=0.0, below=pi)
    max_position: tuple[float, float, float] = numbers((pi, pi, pi), "rad", above=0.0)  # sect. 5
    max_velocity: tuple[float, float, float] = numbers((2.0, 2.0, 3.0), "rad/s", above=0.0)
    max_acceleration: tuple[float, float, float] = numbers((10.0, 10.0, 15.0), "rad/s2", above=0.0)
    min_time: float = number(0.1, "s", above=0.0, under="max_time")  # of t1 and of t2
    max_time: float = number(4.0, "s", above=0.0)
    effort_limits: bool = False  # whether the motors' torques are limited as well
    max_effort: tuple[float, float, float] = numbers((1.0, 2.0, 0.2), "N m", above=0.0)

    def __post_init__(self) -> None:
        """Checks the fields, and that start, goal and obstacles lie where they can."""
        super().__post_init__()
        for name, point in (("start", self.ends[0]), ("goal", self.ends[1])):
            if len(point) != 3 or not all(map(isfinite, point)) or abs(hypot(*point) / self.d3 - 1.0) > REACHED:
                raise InputError(
                    f"{name} is {point}, {hypot(*point):.6g} from the base; the tip moves at d3 = {self.d3:.6g} "
                    "from it: give three numbers, a point at that distance (to 1 %)"
                )
        for sphere in obstacles(self):
            if not self.min_clearance + ROOM < sphere.most_clearance:
                raise InputError(
                    f"min_clearance is {self.min_clearance} rad; from obstacle {sphere.number} no motion has more than "
                    f"{sphere.most_clearance:.6g} rad: give less"
                )

    @property
    def ends(self) -> tuple[Point, Point]:
        """Start and goal of the tip."""
        start, goal = CASES[self.case]
        return self.start or start, self.goal or goal


Case = ElHaiek2019


def obstacles(case: ElHaiek2019) -> list[Obstacle]:
    """The obstacles of a case."""
    return [Obstacle(i, sphere, case.d3, case.link_radius) for i, sphere in enumerate(case.obstacles, 1)]


def robot(case: ElHaiek2019 | None = None) -> Robot:
    """The wrist, with the limits of a case."""
    case = case or ElHaiek2019()
    limits = JointLimits(
        position=(tuple(-b for b in case.max_position), case.max_position),
        velocity=case.max_velocity,
        acceleration=case.max_acceleration,
        effort=case.max_effort,
    )
    return wrist.robot(UNIT * case.d3, limits)


def forward_kinematics(q: ArrayLike, case: ElHaiek2019 | None = None) -> tuple[Array, Array]:
    """Poses of the tip, rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m], of joints ``(N, 3)`` [rad]."""
    return robot(case).poses(q)


def inverse_kinematics(rotation: ArrayLike, position: ArrayLike, case: ElHaiek2019 | None = None) -> Array:
    """Joints ``(N, 2, 3)`` [rad] of poses of the tip, both branches, NaN where the tip does not get there."""
    return robot(case).reaching(wrist.inverse_kinematics(rotation, position), rotation, position)


def surroundings(case: ElHaiek2019) -> Surroundings:
    """Its obstacles and the link, in metres."""
    spheres = [
        bodies.sphere(f"obstacle {i}", 0, UNIT * np.array(place), UNIT * radius)
        for i, (*place, radius) in enumerate(case.obstacles, 1)
    ]
    link = bodies.capsule("link", 3, np.zeros(3), [0.0, 0.0, UNIT * case.d3], UNIT * case.link_radius)
    return Surroundings((*spheres, link))


# Of the default case, of either branch the better, each objective with another within the reference point;
# python benchmarks/ideal_points.py wrist-obstacle
BEST = {
    "time": {"distance": 1.32814, "fitness": 1.32814, "clearance": 1.32814},
    "distance": {"time": 3.14159, "fitness": 3.14159, "clearance": 3.14159},
    "fitness": {"time": 4.46973, "distance": 4.46973, "clearance": 4.46973},
    "clearance": {"time": 0.0955811, "distance": 0.0955811, "fitness": 0.0955811},
}


def via_points(case: ElHaiek2019 | None = None) -> Array:
    """Joints ``(2, 3)`` [rad] at start and goal; theta3 is 0 at the start (our choice), and free at the goal: NaN."""
    case = case or ElHaiek2019()
    start, goal = case.ends
    return np.array([[*wrist.pointing(start), 0.0], [*wrist.pointing(goal, int(case.branch == "1")), np.nan]])


def build(case: ElHaiek2019 | None = None) -> Problem:
    """The problem of a case; with branch ``best`` it is branch 0's, and its alternatives are both branches."""
    case = case or ElHaiek2019()
    if case.branch != "best":
        return _build(case)
    branches = {f"branch {b}": _build(replace(case, branch=b)) for b in BRANCHES[1:]}
    return replace(branches["branch 0"], case=case, alternatives=branches)


def _build(case: ElHaiek2019) -> Problem:
    machine, spheres = robot(case), obstacles(case)
    start, end = via_points(case)
    goal = end[:2]
    position, speed = np.array(case.max_position), np.array(case.max_velocity)
    variables = [
        Variable("via", -position, position, "rad", tuple(f"via {j}" for j in JOINTS), "sect. 5"),
        Variable("via_velocity", -speed, speed, "rad/s", tuple(f"via velocity {j}" for j in JOINTS), "our choice"),
        Variable("theta_g", -position[2:], position[2:], "rad", ("theta3 at the goal",), "sect. 4"),
        Variable("t", np.full(2, case.min_time), np.full(2, case.max_time), "s", ("t1", "t2"), "our choice"),
    ]
    objectives = [
        Objective("time", "s", 1.0, eq="(17)", of_variables=lambda x, p: x[7] + x[8]),
        Objective("distance", "rad", 1.0, eq="(18)", variation=lambda s: s.q),
        Objective("fitness", "-", 1.0, eq="(16)", terms=dict(zip(("time", "distance"), case.weights, strict=True))),
    ]
    worst = {"time": 4.0, "distance": 10.0, "fitness": 14.0}  # worth having; our choice
    if spheres:
        ends = wrist.directions(np.array([start, [*goal, 0.0]]))
        room = max(min(float(o.clearance(ends).min()) for o in spheres), case.min_clearance + ROOM)
        low, high = np.array([case.min_clearance]), np.array([room])  # no trajectory has more than its ends have
        variables.append(Variable("margin", low, high, "rad", ("least clearance",), "our choice", slack_of="clearance"))
        objectives.append(Objective("clearance", "rad", 0.1, "max", "our choice", of_variables=lambda x, p: x[9]))
        worst["clearance"] = case.min_clearance
    lower, upper = np.concatenate([v.lower for v in variables]), np.concatenate([v.upper for v in variables])

    def curve(x: Any) -> PiecewiseBezier:
        last = casadi.vertcat(*goal, x[6]) if isinstance(x, casadi.SX) else np.array([*goal, x[6]])
        return quartic_quintic(start, x[:3], x[3:6], last, x[7:9])

    def guess(rng: np.random.Generator) -> Array:
        x = rng.uniform(lower, upper)
        x[7:9] = np.clip(rng.uniform(0.3, 2.0, 2), case.min_time, case.max_time)
        return np.asarray(x)

    def dilate(x: Array, s: float) -> Array:
        slower = np.array(x, dtype=float)
        slower[3:6] /= s
        slower[7:9] *= s
        return slower

    def tighten_slacks(x: Array) -> Array:
        tight = np.array(x, dtype=float)
        tight[9] = least_clearance(curve(tight), wrist.directions, spheres) - RESERVE
        tight[9] = np.clip(tight[9], case.min_clearance, room)
        return tight

    def describe(conflict: Conflict) -> str:
        if not conflict.row.limit.endswith("obstacles"):
            return ""
        at_goal = conflict.row.segment > 0
        tip, sphere = np.array(case.ends[at_goal]), spheres[int(conflict.row.label.split()[-1]) - 1]
        return sphere.describe(tip * case.d3 / hypot(*tip), f"at the {('start', 'goal')[at_goal]}", case.min_clearance)

    kinds = {"position": "sect. 5", "velocity": "our choice", "acceleration": "our choice"}
    effort = standard.effort_limit(
        lambda s: machine.effort(s.q, s.v, s.a), case.max_effort, machine.effort_units, JOINTS, "our choice"
    )
    limits = (
        *standard.joint_limits(machine.limits, JOINTS, UNITS, kinds),
        *[effort] * case.effort_limits,
        *standard.clear_of(spheres, wrist.direction, lambda s: s.p[0], "(20)"),
    )
    points = (
        standard.rest(JOINTS, UNITS, eq="sect. 3"),
        standard.via_points(start, ((0, 0.0),), JOINTS, UNITS, "sect. 5", id="start"),
        standard.via_points(end, ((-1, 1.0),), JOINTS, UNITS, "sect. 5", id="goal"),
    )
    return Problem(
        id="wrist-obstacle",
        case=case,
        robot=machine,
        variables=tuple(variables),
        curve=curve,
        parameters=(lambda x: x[9]) if spheres else (lambda x: casadi.SX(0, 1)),
        objectives=tuple(objectives),
        default_objective="fitness",
        reference_point=worst,
        best_values=BEST if replace(case, branch="best") == ElHaiek2019() else {},
        requirements=Requirements(JOINTS, UNITS, limits, points, ("clearance",) if spheres else (), continuity=2),
        guess=guess,
        dilate=dilate,
        tighten_slacks=tighten_slacks if spheres else None,
        tuning=Tuning(
            starts=4,  # our choice: there are many local optima
            instants=13,  # our choice: from fewer the first rounds wander from one local optimum to another
            max_exchanges=40,  # our choice: past two obstacles valleys are so flat that 26 rounds were needed
        ),
        about=About(
            "spherical wrist, quartic and quintic, obstacles",
            "El Haiek et al. (2019), Procedia Manufacturing 32, 960-968", "quartic and quintic through one via point",
            homotopy_class=lambda motion: wrist.homotopy_class(motion.curve, spheres, int(case.branch)),
            describe_conflict=describe,
            surroundings=lambda: surroundings(case),
        ),
    )  # fmt: skip


# What the paper reports, sect. 5; the fitness with weights that it does not give.
TIME, FITNESS = 0.2, 8.1  # [s], [-]
