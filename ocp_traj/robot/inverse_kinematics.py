"""Inverse kinematics of any arm: damped least squares on Pinocchio's Jacobian, joint ranges kept, from many starts.

The error is log6 of the tool frame's pose to the wanted one, in the tool frame; where the tool may turn about its axis
z, the place and the shortest rotation that aligns the axes. The damping goes with the square of the error (Levenberg's,
as Sugihara 2011, IEEE Trans. Robotics 27(5), has it), so that it vanishes where a pose is reached and steps stay short
where none is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.robot.dynamics import joint_index
from ocp_traj.robot.robot import Robot

STEPS = 100  # of one search: our choice, as all that follow
CLOSE = 1e-11  # [m, rad] error at which a pose is reached; rounding of a chain leaves some 1e-15
DAMPING, FLOOR = 1e-2, 1e-14  # of the squared error, and the least
LONGEST_STEP = 0.5  # [rad or m]
STALLED, PATIENCE = 0.999, 12  # a search ends where so many steps reduced the error by less than that factor
SEEDS = 64  # random postures from which branches are looked for
SAME = 1e-4  # [rad or m] two postures nearer than that are one


class Reached(NamedTuple):
    """Where a search for a pose ended.

    Attributes:
        q: posture ``(n,)``.
        error: that is left [m, rad]: of place and rotation, whichever is larger.
    """

    q: Array
    error: float

    @property
    def found(self) -> bool:
        """Whether the pose is reached."""
        return self.error <= CLOSE


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """Postures of an arm that put its tool frame somewhere.

    Attributes:
        robot: whose actuators drive the joints themselves.
        free_turn: whether the tool may turn about its axis z.
    """

    robot: Robot
    free_turn: bool = False

    def __post_init__(self) -> None:
        """Checks that the joints are the actuators."""
        if self.robot.actuator_map is not None:
            raise InputError("tool paths are for robots whose actuators drive the joints themselves; give via points")

    @cached_property
    def _joint(self) -> int:
        return int(joint_index(self.robot.model, self.robot.tool_joint))

    @cached_property
    def _data(self) -> pin.Data:
        return self.robot.model.createData()

    @cached_property
    def _into_tool(self) -> Array:
        return np.asarray(self.robot.tool.toActionMatrixInverse())

    @cached_property
    def ranges(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates ``(n,)``, infinite where there is no limit."""
        pair = self.robot.limits.bounds(0)
        free = np.full(self.robot.size, np.inf)
        return (-free, free) if pair is None else (np.array(pair[0]), np.array(pair[1]))

    def pose(self, q: Array) -> pin.SE3:
        """The tool frame in the world."""
        pin.forwardKinematics(self.robot.model, self._data, q)
        return self._data.oMi[self._joint] * self.robot.tool

    def jacobian(self, q: Array) -> Array:
        """Of the tool frame, in that frame: rows of translation [m], then of rotation [rad] ``(6 or 5, n)``."""
        full = self._into_tool @ pin.computeJointJacobian(self.robot.model, self._data, q, self._joint)
        return np.asarray(full[:5] if self.free_turn else full)

    def least_singular_value(self, q: Array) -> float:
        """Of the Jacobian, metres and radians alike: 0 where the tool cannot move some way."""
        return float(np.linalg.svd(self.jacobian(q), compute_uv=False)[-1])

    def error(self, q: Array, target: pin.SE3) -> Array:
        """What the tool frame is short of a pose, in the tool frame ``(6 or 5,)`` [m, rad]."""
        gap = self.pose(q).actInv(target)
        if not self.free_turn:
            return np.asarray(pin.log6(gap).vector)
        x, y, z = gap.rotation[:, 2]
        across = float(np.hypot(x, y))
        turn = np.arctan2(across, z) / across if across > 0.0 else 1.0
        if across == 0.0 and z < 0.0:  # the opposite way: any axis is as short
            return np.append(gap.translation, [np.pi, 0.0])
        return np.append(gap.translation, [-turn * y, turn * x])

    def reach(self, target: pin.SE3, start: Array, *, ranged: bool = True) -> Reached:
        """The posture of a pose to which a search from ``start (n,)`` leads.

        Args:
            target: of the tool frame.
            start: posture; beyond the joint ranges it is put at their ends.
            ranged: whether joint ranges are kept.
        """
        low, high = self.ranges if ranged else (np.full(len(start), -np.inf), np.full(len(start), np.inf))
        q = np.clip(np.asarray(start, dtype=float), low, high)
        e = self.error(q, target)
        best, waited = Reached(q, _size(e)), 0
        for _ in range(STEPS):
            if best.found:
                break
            step = self._step(q, e, low, high)
            q = np.clip(q + step * min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), 1e-300)), low, high)
            e = self.error(q, target)
            size = _size(e)
            waited = 0 if size < STALLED * best.error else waited + 1
            if size < best.error:
                best = Reached(q, size)
            if waited > PATIENCE:
                break
        return best

    def _step(self, q: Array, e: Array, low: Array, high: Array) -> Array:
        """A damped step; joints at an end of their range that it would push further stand still."""
        jacobian, damping = self.jacobian(q), DAMPING * float(e @ e) + FLOOR
        moves = np.ones(len(q), dtype=bool)
        for _ in range(len(q)):
            own = jacobian[:, moves]
            part = own.T @ np.linalg.solve(own @ own.T + damping * np.eye(len(e)), e)
            step = np.zeros(len(q))
            step[moves] = part
            pushed = moves & (((q >= high) & (step > 0.0)) | ((q <= low) & (step < 0.0)))
            if not pushed.any():
                return step
            moves = moves & ~pushed
            if not moves.any():
                break
        return np.zeros(len(q))

    def branches(self, target: pin.SE3, rng: np.random.Generator, near: Array | None = None) -> list[Array]:
        """Postures ``(n,)`` that reach a pose, all different, those that random starts within the ranges lead to.

        Whole turns of revolute joints are taken off until a joint is as near to ``near`` as its range allows.

        Args:
            target: of the tool frame.
            rng: of the starts.
            near: posture ``(n,)``, zero where not given; the first start.
        """
        low, high = (np.clip(side, -np.pi, np.pi) for side in self.ranges)
        middle = np.zeros(self.robot.size) if near is None else np.asarray(near, dtype=float)
        starts = [middle, *rng.uniform(low, high, (SEEDS, self.robot.size))]
        found: list[Array] = []
        for start in starts:
            reached = self.reach(target, start)
            if not reached.found:
                continue
            q = self._unwound(reached.q, middle)
            if not any(self._gap(q, other) < SAME for other in found):
                found.append(q)
        return found

    def _gap(self, q: Array, other: Array) -> float:
        """The largest difference of two postures, whole turns of revolute joints apart."""
        gap, turn = np.abs(q - other), 2.0 * np.pi
        turns = np.array([unit == "rad" for unit in self.robot.units])
        return float(np.where(turns, np.abs(gap - turn * np.round(gap / turn)), gap).max())

    def _unwound(self, q: Array, middle: Array) -> Array:
        """The posture whole turns apart that is nearest to another, within the ranges."""
        low, high = self.ranges
        turns = np.array([unit == "rad" for unit in self.robot.units]) * np.round((middle - q) / (2.0 * np.pi))
        nearer = q + 2.0 * np.pi * turns
        return np.where((nearer >= low) & (nearer <= high), nearer, q)


def _size(error: Array) -> float:
    """Of an error: its place's or its rotation's, whichever is larger."""
    return float(max(np.linalg.norm(error[:3]), np.linalg.norm(error[3:])))
