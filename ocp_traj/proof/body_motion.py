"""How fast bodies move over an arc of time, at most, seen from a joint further down the robot.

With e_k the axis of joint k, moving a point x of a body beyond it, the velocity of x is the sum of v_k e_k x (x - o_k),
its acceleration that of a_k e_k x (x - o_k) and v_j v_k e_j x (e_k x (x - o_k)) over pairs of which j is not beyond k,
twice where they differ. With rho_k a bound of the distance of x from the axis of k the norms are at most::

    sum_k rho_k V_k,        sum_k rho_k (A_k + V_k (V_k + 2 sum_{j before k} V_j)),

V and A being bounds of |v| and |a| by hulls of control points. Along a prismatic axis rho_k is 1 and V_j of a prismatic
joint turns nothing. rho_k is the largest of the body's distances at both ends of the arc and how far it gets from there
in half the arc's time, moved by the joints beyond k. Sums of products of numbers that are not negative round by
less than ``MORE`` of their size.

A cylinder of radius R is the same turned about its own axis d. Its points are c + z d + R u with u not turning about d:
u' = (d x d') x u, so that |u'| <= |d'| and |u''| <= |d''| + |d'|^2, and the derivatives of d are bounded as those of a
point, by sigma_k = |e_k x d| in place of rho_k.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.proof.separation import BodyTable, Frames
from ocp_traj.robot.cores import CYLINDERS
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
        arc: of each of M bodies, an index ``(M,)``.
        body: an index ``(M,)``.
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
    ends = []  # a point's distance from an axis is convex: of those of a segment one of its ends is the farthest
    for frames in (arcs.start, arcs.end):
        cores, off = table.cores(frames, arc, body)
        run = cores.axes[:, :, 2] * cores.half[:, 2:]
        ends += [(frames, cores.centre + run, off), (frames, cores.centre - run, off)]
    half_time = 0.5 * arcs.width[arc]
    speed, acceleration = np.zeros((2, len(arc)))
    chain = [joint]
    while joints.parent[chain[-1]] >= 0:
        chain.append(joints.parent[chain[-1]])
    chain = chain[:-1]  # without the world
    round_ = table.group[body] == CYLINDERS
    rim, tilting = np.where(round_, table.half[body, 0], 0.0), np.zeros(len(arc))
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
            lever = np.maximum.reduce([_distance(joints, frames, k, arc, x, off) for frames, x, off in ends])
            lever = lever + speed * half_time + np.where(round_, 0.0, table.reach[body])
            if round_.any():
                tilt = np.maximum(*(_tilt(joints, frames, k, arc, body, table) for frames in (arcs.start, arcs.end)))
                tilt = np.minimum(tilt + tilting * half_time, 1.0)
                lever = lever + rim * tilt
                tilting = np.where(counts, tilting + v * tilt, tilting)
            lever = lever * MORE
        else:
            lever = np.ones(len(arc))
        own = v if joints.revolute[k] else 0.0
        speed = np.where(counts, speed + lever * v, speed)
        acceleration = np.where(counts, acceleration + lever * (a + v * (own + 2.0 * before[k])), acceleration)
    return speed * MORE, (acceleration + rim * tilting**2) * MORE


def _tilt(joints: Joints, frames: Frames, k: int, arc: Index, body: Index, table: BodyTable) -> Array:
    """Sine of the angle of bodies' third axes to the axis of a joint, at most."""
    axis = frames.rotation[arc, k] @ joints.axis[k]
    joint = table.joint[body]
    own = np.einsum("nij,nj->ni", frames.rotation[arc, joint], table.axes[body, :, 2])
    off = 4.0 * (frames.turn[arc, k] + frames.turn[arc, joint]) + 1e-14
    return np.asarray(np.linalg.norm(_cross(axis, own), axis=1) + off)


def _distance(joints: Joints, frames: Frames, k: int, arc: Index, centre: Array, off: Array) -> Array:
    """Of points ``(M, 3)`` from the axis of a joint, at most."""
    axis = frames.rotation[arc, k] @ joints.axis[k]
    arm = centre - frames.position[arc, k]
    size = np.linalg.norm(_cross(axis, arm), axis=1)
    reach = np.abs(arm).sum(axis=1)
    return np.asarray(size * MORE + off + 2.0 * frames.shift[arc, k] + (8.0 * frames.turn[arc, k] + 1e-14) * reach)


def _cross(x: Array, y: Array) -> Array:
    """Products of vectors ``(M, 3)``; NumPy's own takes several times as long."""
    return np.stack([x[:, i] * y[:, j] - x[:, j] * y[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
