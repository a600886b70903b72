"""Signed distances of segments and half-spaces from solid cylinders, many pairs at once; see ``separation``."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.robot.separation import PARALLEL, TOUCHING, Nearest, by_normal, dot, unit

HALVINGS = 50  # of [0, 1], to the last digits


def segment_cylinder(a: Array, centre: Array, rotation: Array, half: Array) -> Nearest:
    """Of segments from solid cylinders; of those that run through one, d is no more than how deep they are.

    Args:
        a: ends ``(N, 2, 3)`` [m].
        centre: ``(N, 3)`` [m].
        rotation: ``(N, 3, 3)``, its third column the axis.
        half: radius, radius and half the height ``(N, 3)`` [m].
    """
    local = np.einsum("nji,nkj->nki", rotation, a - centre[:, None])
    begin, step = local[:, 0], local[:, 1] - local[:, 0]
    radius, height = half[:, 0], half[:, 2]

    def beyond(t: Array) -> Array:
        point = begin + t[:, None] * step
        off = np.hypot(point[:, 0], point[:, 1])
        share = np.where(off > radius, 1.0 - radius / np.where(off > 0.0, off, 1.0), 0.0)
        rise = point[:, 2] - np.clip(point[:, 2], -height, height)
        return np.column_stack([point[:, :2] * share[:, None], rise])

    # The squared distance is convex: its slope along the segment only rises.
    low, high = np.zeros(len(a)), np.ones(len(a))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        rising = dot(beyond(middle), step) >= 0.0
        low, high = np.where(rising, low, middle), np.where(rising, middle, high)
    ends = np.stack([dot(beyond(np.full(len(a), end)), step) for end in (0.0, 1.0)])
    t = np.where(ends[0] >= 0.0, 0.0, np.where(ends[1] <= 0.0, 1.0, 0.5 * (low + high)))
    apart, point = beyond(t), begin + t[:, None] * step
    distance = np.linalg.norm(apart, axis=1)
    inner = (t > 0.0) & (t < 1.0)
    side = (np.abs(point[:, 2]) < height) & (np.abs(apart[:, 2]) == 0.0)
    axis = np.array([0.0, 0.0, 1.0])
    along = unit(step) * inner[:, None]
    skew = 1.0 - along[:, 2] ** 2 > PARALLEL
    edge_a = along * (side & skew)[:, None]
    edge_b = side[:, None] * axis
    point_b = np.where(side[:, None], point * axis, point - apart)
    grown = np.where(side, radius, 0.0)
    found = Nearest(distance, point, point_b, edge_a, edge_b, unit(apart), 1.0 - side, grown)
    inside = np.flatnonzero(distance <= TOUCHING)
    if len(inside):
        found.put(inside, _through_cylinder(begin[inside], step[inside], radius[inside], height[inside]))
    return found.turned(rotation, centre)


def _through_cylinder(begin: Array, step: Array, radius: Array, height: Array) -> Nearest:
    """Of segments that run through a cylinder about the origin: the least way out, over its ends or straight aside."""
    ends, rows = np.stack([begin, begin + step], axis=1), np.arange(len(begin))
    caps = np.stack([ends[:, :, 2].min(axis=1) - height, -ends[:, :, 2].max(axis=1) - height], axis=1)
    flat = step[:, :2]
    size = (flat**2).sum(axis=1)
    t = np.clip(-(begin[:, :2] * flat).sum(axis=1) / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
    near = begin + t[:, None] * step
    off = np.hypot(near[:, 0], near[:, 1])
    sideways = np.where((off > TOUCHING)[:, None], near[:, :2], np.column_stack([-flat[:, 1], flat[:, 0]]))
    sideways = np.where((np.abs(sideways).max(axis=1) > 0.0)[:, None], sideways, np.array([1.0, 0.0]))
    radial = np.column_stack([unit(sideways), np.zeros(len(begin))])
    aside, cap = off - radius, np.argmax(caps, axis=1)
    by_cap = caps[rows, cap] >= aside
    normal = np.where(by_cap[:, None], np.where(cap == 0, 1.0, -1.0)[:, None] * np.array([0.0, 0.0, 1.0]), radial)
    which = np.argmin(np.where((cap == 0)[:, None], ends[:, :, 2], -ends[:, :, 2]), axis=1)
    point = np.where(by_cap[:, None], ends[rows, which], near)
    return by_normal(np.where(by_cap, caps[rows, cap], aside), point, normal)


def cylinder_plane(centre: Array, rotation: Array, half: Array, normal: Array, offset: Array) -> Nearest:
    """Of solid cylinders from half-spaces normal . x <= offset; see ``segment_cylinder`` for cylinders."""
    down = -np.einsum("nji,nj->ni", rotation, normal)
    out = unit(np.column_stack([down[:, :2], np.zeros(len(down))])) * half[:, :1]
    end = np.where(down[:, 2] >= 0.0, half[:, 2], -half[:, 2])
    lowest = out + end[:, None] * np.array([0.0, 0.0, 1.0])
    point = centre + np.einsum("nij,nj->ni", rotation, lowest)
    return by_normal(dot(point, normal) - offset, point, normal)
