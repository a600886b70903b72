"""Closed-form kinematics of six-axis arms: shoulder and elbow with offsets, three wrist axes through one point.

Modified Denavit-Hartenberg rows (Craig), i = 1 .. 6:

    a_{i-1}      0    a1    a2    a3    0    0
    alpha_{i-1}  0   -90     0   -90   90  -90   [deg]
    d_i         d1     0     0    d4    0   d6

A pose has up to eight configurations, one for each choice of three signs: shoulder s (the wrist in front of the base
axis or behind it), elbow e, wrist w. All functions take many poses at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.robot.chain import DHRow

SIGNS = np.array([(s, e, w) for s in (1, -1) for e in (1, -1) for w in (1, -1)])  # (8, 3): shoulder, elbow, wrist
SINGULARITIES = ("shoulder", "elbow", "wrist")
# Of the measures of ``Branches``: closer to a singularity, a free angle is set; our choice. The elbow's is a root of a
# difference, in which rounding leaves 1e-8.
SINGULAR, ELBOW_SINGULAR = 1e-9, 1e-7
RIGID = 1e-6  # how far a rotation matrix may be from one: our choice


@dataclass(frozen=True, eq=False)
class Branches:
    """The configurations that reach N poses; branch b has the signs ``SIGNS[b]``.

    Attributes:
        angles: theta ``(N, 8, 6)`` [rad], each in (-pi, pi]; NaN where the branch does not exist.
        measures: distance from each of ``SINGULARITIES`` ``(N, 8, 3)``, 0 at it and at most 1: of the wrist from the
            base axis, over the arm's reach; |sin| of the elbow's angle from stretched or folded; |sin theta_5|.
            Errors of the angles grow as its inverse.
        reasons: ``(N, 8)``: empty for a regular branch, else why it does not exist, or which angle is free and was set.
    """

    angles: Array
    measures: Array
    reasons: NDArray[np.object_]

    @property
    def exists(self) -> NDArray[np.bool_]:
        """Which branches exist ``(N, 8)``."""
        return ~np.isnan(self.angles[..., 0])

    def nearest(self, theta: ArrayLike) -> tuple[Array, Array]:
        """The branch nearest to configurations ``(N, 6)``, whole turns apart from it removed.

        Returns:
            its angles ``(N, 6)``, within pi of ``theta``, and the largest difference ``(N,)`` [rad]; NaN for none.
        """
        given = np.asarray(theta, dtype=float).reshape(-1, 1, 6)
        gap = wrapped(self.angles - given)
        size = np.abs(gap).max(axis=-1)
        chosen = np.argmin(np.where(np.isnan(size), np.inf, size), axis=1)
        rows = np.arange(len(chosen))
        return (given + gap)[rows, chosen], size[rows, chosen]

    def require(self) -> Branches:
        """Returns itself, or raises ``InputError`` where a pose has no configuration at all."""
        lost = np.nonzero(~self.exists.any(axis=1))[0]
        if len(lost):
            raise InputError(f"inverse kinematics: pose {lost[0]} is {self.reasons[lost[0], 0]}")
        return self


@dataclass(frozen=True)
class SixAxisArm:
    """Lengths [m] of the arm; see the module's table."""

    d1: float
    a1: float
    a2: float
    a3: float
    d4: float
    d6: float

    def __post_init__(self) -> None:
        """Checks that there is an arm."""
        lengths = (self.d1, self.a1, self.a2, self.a3, self.d4, self.d6)
        if not np.isfinite(lengths).all() or self.a2 <= 0.0 or self.d4 <= 0.0:
            raise InputError(f"an arm has lengths {lengths} m; give finite ones, a2 and d4 above zero")

    @property
    def forearm(self) -> float:
        """From the elbow to the wrist's centre [m]."""
        return float(np.hypot(self.a3, self.d4))

    @property
    def rows(self) -> tuple[DHRow, ...]:
        """The modified Denavit-Hartenberg rows, for ``Robot.from_dh``."""
        a = (0.0, self.a1, self.a2, self.a3, 0.0, 0.0)
        alpha = (0.0, -pi / 2, 0.0, -pi / 2, pi / 2, -pi / 2)
        d = (self.d1, 0.0, 0.0, self.d4, 0.0, self.d6)
        return tuple(DHRow(d=d[i], a=a[i], alpha=alpha[i]) for i in range(6))

    def forward(self, theta: ArrayLike) -> tuple[Array, Array]:
        """Pose of the flange.

        Args:
            theta: ``(N, 6)`` or ``(6,)`` [rad].

        Returns:
            rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m].
        """
        angles = np.asarray(theta, dtype=float).reshape(-1, 6)
        rotation = np.tile(np.eye(3), (len(angles), 1, 1))
        position = np.zeros((len(angles), 3))
        for i, row in enumerate(self.rows):
            lift = np.array([row.a, -np.sin(row.alpha) * row.d, np.cos(row.alpha) * row.d])
            position = position + rotation @ lift
            rotation = rotation @ _row_rotation(angles[:, i], row.alpha)
        return rotation, position

    def inverse(self, rotation: ArrayLike, position: ArrayLike) -> Branches:
        """All configurations that put the flange at poses.

        With p the wrist's centre, r and z its place in the arm's plane, seen from the shoulder, the elbow's angle
        follows from their distance, theta_2 from a linear system, and the wrist's angles from (0R3)^T R.

        Args:
            rotation: ``(N, 3, 3)`` or ``(3, 3)``.
            position: ``(N, 3)`` or ``(3,)`` [m].
        """
        turned, place = _poses(rotation, position)
        s, e, w = (SIGNS[:, k] for k in range(3))
        p = place - self.d6 * turned[:, :, 2]
        rho = np.hypot(p[:, 0], p[:, 1])[:, None] * np.ones(8)
        free_shoulder = rho < SINGULAR * self._reach
        th1 = np.where(free_shoulder, 0.0, np.arctan2(s * p[:, 1:2], s * p[:, 0:1]))
        r, z = s * rho - self.a1, (p[:, 2:3] - self.d1) * np.ones(8)
        reach = self.forearm
        k = (r**2 + z**2 - self.a2**2 - reach**2) / (2.0 * self.a2)
        # (reach - k)(reach + k) from distances, so that a stretched arm loses no digits.
        far = np.hypot(r, z)
        gap = ((self.a2 + reach) ** 2 - far**2) * (far**2 - (self.a2 - reach) ** 2) / (2.0 * self.a2) ** 2
        reachable = gap >= -((ELBOW_SINGULAR * reach) ** 2)
        side = np.sqrt(np.maximum(gap, 0.0))
        th3 = np.arctan2(self.a3, self.d4) - np.arctan2(k, e * side)
        c3, s3 = np.cos(th3), np.sin(th3)
        m, n = self.a2 + self.a3 * c3 - self.d4 * s3, self.a3 * s3 + self.d4 * c3
        th2 = np.arctan2(-z * m - r * n, r * m - z * n)
        wrist = np.swapaxes(_arm_rotation(th1, th2 + th3), -1, -2) @ turned[:, None]
        sine = np.hypot(wrist[..., 0, 2], wrist[..., 2, 2])
        free_wrist = sine < SINGULAR
        th5 = np.arctan2(w * sine, wrist[..., 1, 2])
        th4 = np.where(free_wrist, 0.0, np.arctan2(w * wrist[..., 2, 2], -w * wrist[..., 0, 2]))
        # With theta_4 set, theta_6 is what is left of the turn.
        left = np.arctan2(-wrist[..., 2, 0], -wrist[..., 2, 1])
        th6 = np.where(free_wrist, left, np.arctan2(-w * wrist[..., 1, 1], w * wrist[..., 1, 0]))
        angles = wrapped(np.stack([th1, th2, th3, th4, th5, th6], axis=-1))
        angles[~reachable] = np.nan
        measures = np.stack([rho / self._reach, side / reach, sine], axis=-1)
        measures[~reachable] = np.nan
        singular = np.stack([free_shoulder, side <= ELBOW_SINGULAR * reach, free_wrist], axis=-1)
        return Branches(angles, measures, self._reasons(far, reachable, singular))

    @property
    def _reach(self) -> float:
        return abs(self.a1) + self.a2 + self.forearm

    def _reasons(self, far: Array, reachable: NDArray[np.bool_], singular: NDArray[np.bool_]) -> NDArray[np.object_]:
        words = (
            "shoulder singular: the wrist is on the base axis, theta_1 is free and set to 0",
            "elbow singular: the arm is stretched or folded, both elbow branches are one",
            "wrist singular: only theta_4 and theta_6 together are given, theta_4 is set to 0",
        )
        reasons = np.full(far.shape, "", dtype=object)
        nearest, farthest = abs(self.a2 - self.forearm), self.a2 + self.forearm
        for index in np.argwhere(~reachable | singular.any(axis=-1)):
            i, b = index
            if reachable[i, b]:
                reasons[i, b] = "; ".join(text for text, is_so in zip(words, singular[i, b], strict=True) if is_so)
            else:
                reasons[i, b] = (
                    f"out of reach: the wrist is {far[i, b]:.6g} m from the shoulder's axis; "
                    f"it can be {nearest:.6g} to {farthest:.6g} m away"
                )
        return reasons


def wrapped(angles: ArrayLike) -> Array:
    """Angles less whole turns, in (-pi, pi]."""
    given = np.asarray(angles, dtype=float)
    inside = (given > -pi) & (given <= pi)
    return np.asarray(np.where(inside, given, pi - np.mod(pi - given, 2.0 * pi)))


@dataclass(frozen=True, eq=False)
class JointAngles:
    """How a maker counts the joints of an arm: theta = signs q + offsets.

    Attributes:
        signs: ``(6,)``, 1 or -1.
        offsets: ``(6,)`` [rad].
        ranges: lower and upper ends of the joints' ranges ``(2, 6)`` [rad].
    """

    signs: Array
    offsets: Array
    ranges: Array

    def theta(self, q: ArrayLike) -> Array:
        """Angles of the arm's table from the joints', ``(.., 6)`` [rad]."""
        return np.asarray(self.signs * np.asarray(q, dtype=float) + self.offsets)

    def joints(self, theta: ArrayLike) -> Array:
        """The joints' angles ``(.., 6)`` [rad] from the table's, each within half a turn of the middle of its range."""
        middle = self.ranges.mean(axis=0)
        return np.asarray(middle + wrapped(self.signs * (np.asarray(theta, dtype=float) - self.offsets) - middle))


def _row_rotation(theta: Array, alpha: float) -> Array:
    """Rotation part of (1), ``(N, 3, 3)``."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), round(np.cos(alpha)), round(np.sin(alpha))
    zero = np.zeros_like(c)
    rows = ([c, -s, zero], [s * ca, c * ca, zero - sa], [s * sa, c * sa, zero + ca])
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _arm_rotation(th1: Array, th23: Array) -> Array:
    """0R3: a turn by theta_1 about z, then by theta_2 + theta_3 about the arm's own axis."""
    return _row_rotation(th1, 0.0) @ _row_rotation(th23, -pi / 2)


def _poses(rotation: ArrayLike, position: ArrayLike) -> tuple[Array, Array]:
    turned = np.asarray(rotation, dtype=float).reshape(-1, 3, 3)
    place = np.asarray(position, dtype=float).reshape(-1, 3)
    if len(turned) != len(place):
        raise InputError(f"inverse kinematics: {len(turned)} rotations for {len(place)} positions; give one of each")
    if not (np.isfinite(turned).all() and np.isfinite(place).all()):
        raise InputError("inverse kinematics: a pose holds something that is no number; give finite poses")
    off = np.abs(np.swapaxes(turned, 1, 2) @ turned - np.eye(3)).max(axis=(1, 2))
    bad = (off > RIGID) | (np.linalg.det(turned) < 0.0)
    if bad.any():
        raise InputError(
            f"inverse kinematics: rotation {int(np.argmax(bad))} is no rotation matrix; give orthonormal, right-handed "
            "axes as columns"
        )
    return turned, place
