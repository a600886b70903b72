"""Every arm of ``example-robot-data``: whether it loads, and a random move of each, solved and proved.

Run with ``python -m benchmarks.arms [NAME ..]`` (``make bench-arms``). An arm has a fixed base and two to seven joints
that move once grippers are locked. Each is a task built in code: from one random posture to another in least time, with
the file's limits on position, velocity and effort and our own on acceleration and jerk, and a curve of kind ``auto``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

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

    @property
    def table(self) -> dict[str, Any]:
        """``[robot]`` of its task."""
        return {"description": self.name, "tool_frame": self.tool_frame, "locked": dict(self.locked)}

    def robot(self) -> ot.Robot:
        """The robot with its own limits; raises ``InputError`` where it cannot be."""
        return ot.Robot.from_description(self.name, locked=self.locked, tool_frame=self.tool_frame)


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


def random_postures(robot: ot.Robot, seed: int, count: int = 2) -> Array:
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


def move(table: Mapping[str, Any], postures: Array, finest: int = 16, **limits: Any) -> ot.Problem:
    """Shortest time from one posture to another ``(2, n)``, of at most ``finest`` pieces.

    Args:
        table: ``[robot]`` of the task.
        postures: start and goal.
        finest: of the task's curve.
        limits: beside ours, or in place of them.
    """
    return ot.problems.load(
        "task", name="arm", robot=dict(table), move=[{"start": postures[0], "goal": postures[1]}],
        limits={"acceleration": ACCELERATION, "jerk": JERK, **limits}, curve={"finest": finest},
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
        task = move(arm.table, random_postures(robot, seed), **({"effort": "none"} if without else {}))
        found = ot.solve(task, seed=seed)
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
