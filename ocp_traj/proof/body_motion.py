"""How fast bodies move over an arc of time, at most, seen from a joint further down the robot.

With e_k the axis of joint k, moving a point x of a body beyond it, the velocity of x is the sum of v_k e_k x (x - o_k),
its acceleration that of a_k e_k x (x - o_k) and v_j v_k e_j x (e_k x (x - o_k)) over pairs of which j is not beyond k,
twice where they differ. With rho_k a bound of the distance of x from the axis of k the norms are at most::

    sum_k rho_k V_k,        sum_k rho_k (A_k + V_k (V_k + 2 sum_{j before k} V_j)),

V and A being bounds of |v| and |a| by hulls of control points. Along a prismatic axis rho_k is 1 and V_j of a prismatic
joint turns nothing. rho_k is the largest of the body's distances at both ends of the arc and of how far it gets from
there in half the arc's time, moved by the joints beyond k. Sums of products of numbers that are not negative round by
less than ``MORE`` of their size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.proof.separation import BodyTable, Frames
from ocp_traj.robot.dynamics import joint_is_revolute
from ocp_traj.robot.robot import Robot

MORE = 1.0 + 1e-12


@dataclass(frozen=True, eq=False)
class Joints:
    """The joints that carry bodies, and those below them, as frames have them; the world is the first.

    Attributes:
        indices: in the model, ascending.
        parent: column of the one below ``(joints,)``; -1 of the world.
        column: of a joint's coordinate ``(joints,)``.
        revolute: of each.
        axis: in the joint's frame ``(joints, 3)``.
        depth: how many are below ``(joints,)``.
    """

    indices: tuple[int, ...]
    parent: tuple[int, ...]
    column: tuple[int, ...]
    revolute: tuple[bool, ...]
    axis: Array
    depth: Index

    @classmethod
    def of(cls, robot: Robot, carrying: Sequence[int]) -> Joints:
        """Of a robot and the joints that carry its bodies."""
        model, wanted = robot.model, {0}
        for index in carrying:
            while index > 0:
                wanted.add(index)
                index = int(model.parents[index])
        indices = tuple(sorted(wanted))
        data = model.createData()
        axis, revolute, parent, depth = np.zeros((len(indices), 3)), [False], [-1], [0]
        for place, index in enumerate(indices[1:], start=1):
            turns = joint_is_revolute(model, index)
            subspace = np.asarray(data.joints[index].S, dtype=float).reshape(6)
            axis[place] = subspace[3:] if turns else subspace[:3]
            revolute.append(turns)
            parent.append(indices.index(int(model.parents[index])))
            depth.append(depth[parent[-1]] + 1)
        columns = (-1, *(int(model.joints[index].idx_v) for index in indices[1:]))
        return cls(indices, tuple(parent), columns, tuple(revolute), axis, np.array(depth))

    def common(self, first: int, second: int) -> int:
        """Column of the highest joint at or below both."""
        while first != second:
            if self.depth[first] < self.depth[second]:
                second = self.parent[second]
            else:
                first = self.parent[first]
        return first


@dataclass(frozen=True, eq=False)
class ArcMotion:
    """What is known of N arcs of time: frames at their ends, and bounds of the speeds over them.

    Attributes:
        start, end: frames there.
        width: upper bounds of the durations [s] ``(N,)``.
        speed, acceleration: of the model's joints, upper bounds of the sizes ``(nv, N)``.
    """

    start: Frames
    end: Frames
    width: Array
    speed: Array
    acceleration: Array


def motion_bounds(
    joints: Joints, table: BodyTable, arcs: ArcMotion, arc: Index, body: Index, base: Index
) -> tuple[Array, Array]:
    """Bounds of speed and acceleration of all core points of bodies, seen from joints below them.

    Args:
        joints: of the frames.
        table: of the bodies.
        arcs: of time.
        arc, body: indices ``(M,)``.
        base: columns of the joints from which it is seen ``(M,)``; each at or below the body's.

    Returns:
        [m/s] and [m/s^2], ``(M,)`` each.
    """
    speed, acceleration = np.zeros((2, len(arc)))
    for joint in np.unique(table.joint[body]):
        which = np.flatnonzero(table.joint[body] == joint)
        found = _bounds_on(joints, table, arcs, int(joint), arc[which], body[which], joints.depth[base[which]])
        speed[which], acceleration[which] = found
    return speed, acceleration


def _bounds_on(
    joints: Joints, table: BodyTable, arcs: ArcMotion, joint: int, arc: Index, body: Index, depth: Index
) -> tuple[Array, Array]:
    """The same for bodies on one joint, seen from the one at a depth below it."""
    ends = [(frames, *table.cores(frames, arc, body)) for frames in (arcs.start, arcs.end)]
    half_time = 0.5 * arcs.width[arc]
    speed, acceleration = np.zeros((2, len(arc)))
    chain = [joint]
    while joints.parent[chain[-1]] >= 0:
        chain.append(joints.parent[chain[-1]])
    chain = chain[:-1]  # without the world
    turning, before = np.zeros(len(arc)), {}  # sum of the speeds of revolute joints between the base and each
    for k in reversed(chain):
        before[k] = turning
        turning = turning + np.where(
            (joints.depth[k] > depth) & joints.revolute[k], arcs.speed[joints.column[k], arc], 0.0
        )
    for k in chain:
        counts = joints.depth[k] > depth
        v, a = arcs.speed[joints.column[k], arc], arcs.acceleration[joints.column[k], arc]
        if joints.revolute[k]:
            lever = np.maximum(*(_distance(joints, frames, k, arc, cores.centre, off) for frames, cores, off in ends))
            lever = (lever + table.reach[body] + speed * half_time) * MORE
        else:
            lever = np.ones(len(arc))
        own = v if joints.revolute[k] else 0.0
        speed = np.where(counts, speed + lever * v, speed)
        acceleration = np.where(counts, acceleration + lever * (a + v * (own + 2.0 * before[k])), acceleration)
    return speed * MORE, acceleration * MORE


def _distance(joints: Joints, frames: Frames, k: int, arc: Index, centre: Array, off: Array) -> Array:
    """Of points ``(M, 3)`` from the axis of a joint, at most."""
    axis = frames.rotation[arc, k] @ joints.axis[k]
    arm = centre - frames.position[arc, k]
    turned = np.cross(axis, arm)
    size = np.sqrt(np.einsum("ni,ni->n", turned, turned))
    reach = np.abs(arm).sum(axis=1)
    return np.asarray(size * MORE + off + 2.0 * frames.shift[arc, k] + (8.0 * frames.turn[arc, k] + 1e-14) * reach)
