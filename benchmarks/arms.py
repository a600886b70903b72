"""Every arm of ``example-robot-data``: whether it loads, and a random move of each, solved and proved.

Run with ``python -m benchmarks.arms [NAME ..]`` (``make bench-arms``). An arm has a fixed base and two to seven joints
that move once grippers are locked. The move is from one random posture through another to a third, along the C2 cubic
spline of least time, with the file's limits on position, velocity and effort and our own on acceleration and jerk.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi
import numpy as np
from rich.console import Console
from rich.table import Table

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.robot.inertias import missing_inertias

ACCELERATION, JERK = 8.0, 60.0  # [rad/s2 or m/s2], [rad/s3 or m/s3]: our choice
STEP, SPACE, HOLDING = 1.0, 0.9, 0.6  # [rad] from home, of the range, of the effort's limit at rest: our choice
POSTURES = 200  # tried for one that the motors hold: our choice


@dataclass(frozen=True)
class Arm:
    """An arm of the package: name, tool frame, and what is locked [m or rad]."""

    name: str
    tool_frame: str
    locked: Mapping[str, float] = field(default_factory=dict)

    def robot(self) -> ot.Robot:
        """The robot with its own limits and ours; raises ``InputError`` where it cannot be."""
        bare = ot.Robot.from_description(self.name, locked=self.locked, file_limits=False)
        limits = ot.JointLimits(acceleration=[ACCELERATION] * bare.size, jerk=[JERK] * bare.size)
        return ot.Robot.from_description(self.name, locked=self.locked, tool_frame=self.tool_frame, limits=limits)


FINGERS = {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}
ARMS = (
    Arm("asr_twodof", "EE"),
    Arm("borinot", "flying_arm_2__ee"),
    Arm("double_pendulum", "link2"),
    Arm("double_pendulum_continuous", "link2"),
    Arm("double_pendulum_simple", "link3"),
    Arm("finger_edu", "finger_tip_link"),
    Arm("hextilt", "flying_arm_5__gripper"),
    Arm("kinova", "j2s6s200_end_effector"),
    Arm("panda", "panda_hand_tcp", FINGERS),
    Arm("panda_collision", "panda_hand_tcp", FINGERS),
    Arm("so100", "gripper", {"gripper": 0.0}),
    Arm("so101", "gripper_frame_link", {"gripper": 0.0}),
    Arm("talos_arm", "gripper_left_base_link", {"gripper_left_joint": 0.0}),
    *(Arm(name, "tool0") for name in ("ur3", "ur3_gripper", "ur3_limited", "ur5", "ur5_gripper", "ur5_limited")),
    *(Arm(name, "tool0") for name in ("ur10", "ur10_limited")),
    Arm("xarm", "link_eef"),
    Arm("z1", "gripperStator", {"jointGripper": 0.0}),
)
NO_ARMS = {"bolt": "two legs, on a base that is not fixed"}  # the others of two to seven joints


def random_postures(robot: ot.Robot, seed: int, count: int = 3) -> Array:
    """Postures ``(count, n)`` around the middle of the joints' ranges that the motors hold.

    Raises ``InputError`` where none is found.
    """
    lower, upper = (np.clip(side, -np.pi, np.pi) for side in robot.limits.position)
    home, room = (lower + upper) / 2.0, np.minimum(SPACE * (upper - lower) / 2.0, STEP)
    rng, q = np.random.default_rng(seed), casadi.SX.sym("q", robot.size)
    weight = casadi.Function("weight", [q], [robot.effort(q, casadi.SX.zeros(robot.size), casadi.SX.zeros(robot.size))])
    held = []
    for _ in range(POSTURES):
        posture = home + room * rng.uniform(-1.0, 1.0, robot.size)
        if (np.abs(np.asarray(weight(posture))[:, 0]) <= HOLDING * robot.limits.effort[1]).all():
            held.append(posture)
        if len(held) == count:
            return np.array(held)
    raise InputError(f"of {POSTURES} random postures its motors hold {len(held)}, {count} are needed")


def problem(robot: ot.Robot, postures: Array) -> ot.Problem:
    """Shortest time through postures ``(count, n)``: the durations of a cubic spline."""
    axes, count = (robot.joints, robot.units), len(postures)
    limits = list(ot.standard.joint_limits(robot.limits, *axes))
    if not missing_inertias(robot.model):
        efforts = robot.limits.bounds("effort")
        limits.append(
            ot.standard.effort_limit(lambda s: robot.effort(s.q, s.v, s.a), efforts, robot.effort_units, robot.joints)
        )
    at = [(0, 0.0), *((k, 0.0) for k in range(2, count)), (-1, 1.0)]
    points = (ot.standard.rest(*axes), ot.standard.via_points(postures, at, *axes))
    slowest = float((np.abs(np.diff(postures, axis=0)) / robot.limits.velocity[1]).max())
    h = ot.Variable("h", np.full(count + 1, 0.02), np.full(count + 1, 10.0 + 2.0 * slowest), "s",
                    tuple(f"h{i}" for i in range(1, count + 2)))  # fmt: skip
    return ot.Problem(
        "arm", (h,), lambda x: ot.curves.cubic_spline_free_ends(postures, x),
        (ot.Objective("time", "s", of_variables=lambda x, p: casadi.sum1(x)),),
        ot.Requirements(*axes, tuple(limits), points), lambda rng: rng.uniform(0.5, 1.0, count + 1) * (1.0 + slowest),
        None, robot, dilate=lambda x, s: s * x, scales_in_time=True, reference_point={"time": 60.0},
    )  # fmt: skip


def row(arm: Arm, seed: int) -> tuple[str, str, str, str, str]:
    """Name, number of joints, duration [s], CPU time [s] and outcome of an arm's random move."""
    try:
        robot = arm.robot()
    except InputError as error:
        return arm.name, "", "", "", f"refused: {str(error).rsplit('/', 1)[-1]}"
    without = missing_inertias(robot.model)
    begun = time.process_time()
    try:
        found = ot.solve(problem(robot, random_postures(robot, seed)), certify=False, seed=seed)
    except (InputError, NoSolutionFound) as error:
        return arm.name, str(robot.size), "", "", f"refused: {error}"
    spent = f"{time.process_time() - begun:.2f}"
    words = found.audit.explain() if found.audit is not None else found.explain()
    note = f" (efforts left out: no inertia moves with {', '.join(without)})" if without else ""
    return arm.name, str(robot.size), f"{found.objectives.get('time', np.nan):.4f}", spent, words + note


def main(names: Sequence[str]) -> None:
    """Prints the table of all arms, or of those that are named."""
    table = Table("arm", "joints", "time [s]", "CPU [s]", "outcome", title="A random move of every arm")
    for seed, arm in enumerate(ARMS):
        if not names or arm.name in names:
            table.add_row(*row(arm, seed))
    Console(width=200).print(table)


if __name__ == "__main__":
    main(sys.argv[1:])
