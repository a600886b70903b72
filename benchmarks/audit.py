"""Time and tightness of the audit, next to scans of the same limits in the same run.

    python benchmarks/audit.py

The audit proves every limit at every instant. A scan looks at 1e5 instants and proves nothing: with the float tape (all
limits), and with ``pinocchio.rnea`` (torque alone), whose loop over 1e4 instants is timed and multiplied by ten.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import casadi
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import at_rest, nonic
from ocp_traj.formulation import standard
from ocp_traj.formulation.requirements import PathConstraint, Requirements, State
from ocp_traj.proof.audit import audit_all
from ocp_traj.proof.values import limit_on
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.results.trajectory import trajectory_of as of_vector
from ocp_traj.robot.joint_limits import JointLimits
from ocp_traj.robot.robot import Robot

Array = NDArray[np.float64]

POINTS = 100_000
REPEATS = 7
WIDTHS = (6, 8, 6, 8, 8, 8, 10, 8)  # of the table's columns
JOINTS, UNITS = ("A1", "A2", "A3", "A4", "A5", "A6"), ("rad",) * 6

# A stand-in for the KUKA KR90 R3100: its dimensions, and the inertial figures of the KR150 R3100-2 as published in
# kroshu/kuka_robot_descriptions (Apache-2.0). Roll, pitch, yaw [rad] and origin [m] of each joint in the one before.
_H = np.pi / 2.0
_PLACEMENTS = (
    ((np.pi, 0, 0), (0, 0, 0.3056)), ((_H, 0, 0), (0.350, 0.072, -0.3694)), ((0, 0, 0), (1.350, 0, -0.103)),
    ((_H, 0, -_H), (1.008, 0.041, 0.175)), ((0, _H, _H), (0, 0.096, -0.392)), ((_H, 0, -_H), (0.1665, 0, -0.096)),
)  # fmt: skip
# Mass [kg], centre of mass [m], principal moments [kg m^2], roll, pitch, yaw of the principal axes [rad].
_LINKS = (
    (363.07, (0.0288, 0.0119, -0.2340), (13.209, 31.495, 33.884), (1.8662, 0.1026, -0.2163)),
    (250.56, (0.5779, -0.0014, -0.1256), (6.112, 82.751, 83.259), (0.5376, 0.0907, 0.0072)),
    (199.93, (0.2623, 0.041, 0.1377), (3.488, 31.684, 32.631), (2.1421, -0.0660, -0.0638)),
    (42.41, (0, 0.0192, -0.1979), (0.1613, 1.3645, 1.3916), (1.5711, -1.4368, -1.5712)),
    (16.99, (0.0622, 0.0003, -0.0658), (0.2001, 0.1206, 0.2210), (1.5705, -0.8763, -0.0023)),
    (6.60, (0, 0, -0.0065), (0.01146, 0.01146, 0.01454), (0, 0, 0)),
)  # fmt: skip
_FLANGE = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), np.array([0.0, 0.0, -0.0485]))
_TORCH = pin.Inertia(12.0, np.array([0.03, 0.0, 0.18]), np.diag([0.25, 0.25, 0.03]))
_TORCH_TIP = pin.SE3(pin.rpy.rpyToMatrix(0.0, np.radians(40.0), 0.0), np.array([0.06, 0.0, 0.38]))

# Ogbemhe et al. (2019), Table 3 [deg], and the efforts of the KR150 R3100-2 [N m].
LIMITS = JointLimits(
    position=tuple(np.radians([(-185, -140, -120, -350, -125, -350), (185, -5, 155, 350, 125, 350)])),
    velocity=np.radians([105, 101, 107, 292, 258, 284]),
    acceleration=np.radians([52, 50, 80, 136, 178, 206]),
    jerk=np.radians([75, 75, 82, 100, 190, 200]),
    snap=np.radians([100, 100, 95, 90, 105, 150]),
    effort=(7290.0, 8910.0, 7539.0, 2431.0, 1461.0, 893.0),
)
HOME, VIA, GOAL = np.radians([(0, -90, 100, 0, 60, 0), (15, -80, 110, 20, 65, 15), (30, -65, 105, 45, 50, 40)])


def six_joint_arm() -> Robot:
    """A KR90-like welding arm with its torch."""
    model = pin.Model()
    for i, ((rpy, xyz), (mass, centre, moments, axes)) in enumerate(zip(_PLACEMENTS, _LINKS, strict=True)):
        placement = pin.SE3(pin.rpy.rpyToMatrix(*map(float, rpy)), np.array(xyz, dtype=float))
        joint = model.addJoint(i, pin.JointModelRZ(), placement, JOINTS[i])
        turn = pin.rpy.rpyToMatrix(*map(float, axes))
        inertia = pin.Inertia(mass, np.array(centre, dtype=float), turn @ np.diag(moments) @ turn.T)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.appendBodyToJoint(6, _TORCH, _FLANGE)
    return Robot(model, JOINTS, UNITS, LIMITS, _FLANGE * _TORCH_TIP)


def tag_to_tag(rest: bool, seconds: float = 5.0) -> PiecewiseBezier:
    """Nonic segments from home to the goal: one at rest at both ends, or two that pass a via point in motion."""
    start, via, goal = (at_rest(q) for q in (HOME, VIA, GOAL))
    if rest:
        return nonic([start, goal], [seconds])
    via[1] = (GOAL - HOME) / seconds
    via[2] = np.radians([3.0, -4.0, 2.0, 5.0, -6.0, 4.0])
    return nonic([start, via, goal], [0.5 * seconds] * 2)


def _bounds(name: str) -> tuple[Array, Array]:
    bounds = LIMITS.bounds(name)
    assert bounds is not None
    return bounds


def torque(robot: Robot, friction: bool = False) -> PathConstraint:
    """The arm's torque limit; friction as assumed for it: 3 % of the effort, smoothed, and 5 % at full speed."""
    lower, effort = _bounds("effort")
    speed = _bounds("velocity")[1]

    def expression(s: State) -> Any:
        tau = robot.effort(s.q, s.v, s.a)
        if not friction:
            return tau
        return tau + 0.03 * effort * casadi.tanh(s.v / (0.02 * speed)) + 0.05 * effort / speed * s.v

    return standard.effort_limit(expression, (lower, effort), robot.effort_units, JOINTS)


def arm_requirements(friction: bool = False) -> Requirements:
    """All limits of the arm."""
    derivatives = standard.joint_limits(LIMITS, JOINTS, UNITS)
    return Requirements(JOINTS, UNITS, (*derivatives, torque(six_joint_arm(), friction)), continuity=4)


class Subject(NamedTuple):
    """What is audited and scanned."""

    name: str
    trajectories: list[Trajectory]
    requirements: Requirements
    robot: Robot


def subjects() -> list[Subject]:
    """The trajectories of the table."""
    hybrid = problems.load("hybrid-spline")
    rng = np.random.default_rng(0)
    splines = [of_vector(hybrid, hybrid.guess(rng)).dilate(1.5) for _ in range(40)]
    arm = six_joint_arm()
    one, two = Trajectory(tag_to_tag(True), JOINTS), Trajectory(tag_to_tag(False, 7.0), JOINTS)
    return [
        Subject("hybrid-spline", splines[:1], hybrid.requirements, hybrid.robot),
        Subject("hybrid-spline, 40 together", splines, hybrid.requirements, hybrid.robot),
        Subject("arm, rest to rest", [one], arm_requirements(), arm),
        Subject("arm, through a via point", [two], arm_requirements(), arm),
        Subject("arm with friction, via point", [two], arm_requirements(friction=True), arm),
    ]


def milliseconds(call: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Median time of a call, after one that compiles and warms up."""
    call()
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - begun))
    return statistics.median(times)


def scan(trajectory: Trajectory, requirements: Requirements) -> None:
    """All limits at ``POINTS`` instants, in floats."""
    u = np.linspace(0.0, 1.0, POINTS // trajectory.curve.segments)
    for limit in requirements.path_constraints:
        for segment in range(trajectory.curve.segments):
            limit_on(trajectory, requirements, limit, segment, u)


def rnea(trajectory: Trajectory, robot: Robot) -> None:
    """Torques at a tenth of ``POINTS`` instants, one by one."""
    t = np.linspace(0.0, trajectory.duration, POINTS // 10)
    q, v, a = (trajectory.curve(t, order) for order in range(3))
    data = robot.model.createData()
    for i in range(len(t)):
        pin.rnea(robot.model, data, q[i], v[i], a[i])


def main() -> None:
    """Prints the table."""
    print("Per trajectory; audit, scan and rnea in ms. scan: 1e5 instants, all limits, float tape. rnea: torque only,")
    print("1e4 instants times ten. gap: largest distance of proved bound and attained value, of the limit's range.\n")
    columns = ("joints", "segments", "boxes", "audit", "scan", "rnea", "scan/audit", "gap")
    print(
        f"{'trajectory':30} "
        + " ".join(f"{name:>{width}}" for name, width in zip(columns, WIDTHS, strict=True))
        + "  verdict"
    )
    for name, trajectories, requirements, robot in subjects():
        count = len(trajectories)
        audits = audit_all(trajectories, requirements)
        proof = milliseconds(partial(audit_all, trajectories, requirements)) / count
        looking = milliseconds(partial(scan, trajectories[0], requirements), 3)
        loop = 10.0 * milliseconds(partial(rnea, trajectories[0], robot), 3)
        scale = {
            (c.id, label): s for c in requirements.path_constraints for label, s in zip(c.labels, c.scale, strict=True)
        }
        rows = [r for a in audits for r in a.rows if r.boxes]
        boxes = sum({(id(a), r.limit): r.boxes for a in audits for r in a.rows}.values()) / count
        gap = max(abs(r.proved_bound - r.attained) / scale[r.limit, r.label] for r in rows)
        verdicts = sorted({a.verdict for a in audits})
        cells = (
            f"{robot.size}", f"{trajectories[0].curve.segments}", f"{boxes:.0f}", f"{proof:.1f}", f"{looking:.1f}",
            f"{loop:.1f}", f"{looking / proof:.1f}", f"{gap:.1e}",
        )  # fmt: skip
        line = " ".join(f"{cell:>{width}}" for cell, width in zip(cells, WIDTHS, strict=True))
        print(f"{name:30} {line}  {', '.join(verdicts)}")


if __name__ == "__main__":
    main()
