"""Whether any limits explain the times of Zhu and Wang: its recipe over all pairs of a velocity and an acceleration.

Of one joint the largest |v| and |a| depend on the ratios of its durations, and scale with time: v ~ 1/T, a ~ 1/T^2. On
a grid of ratios they are computed once; then every pair of limits costs a minimum over the grid. v_max times 1/c and
a_max times 1/c^2 scale all times by c: the pairs are one family, a_max / v_max^2, times a scale.
"""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import basis, difference_matrix
from ocp_traj.problems import rotor_353 as paper

RATIOS = np.geomspace(0.02, 20.0, 160)  # t1 / t2 and t3 / t2: our choice, 4.4 % apart
SAMPLES = 65  # of the quintic: our choice
FAMILY = np.geomspace(1e-3, 1e3, 121)  # a_max over v_max^2 [1/deg] in units of the joint's own path: our choice


def single_joint_peaks(x: Array) -> tuple[Array, Array, Array]:
    """Durations ``(N, 3)`` with t2 = 1 s, and the largest |v| and |a| ``(N,)`` of one joint through X ``(4,)``."""
    t1, t3 = (part.ravel() for part in np.meshgrid(RATIOS, RATIOS, indexing="ij"))
    first, last = x[1] - x[0], x[3] - x[2]
    v1, a1, v2, a2 = 0.6 * first / t1, 0.3 * first / t1**2, 0.6 * last / t3, -0.3 * last / t3**2
    one = np.ones_like(t1)
    quintic = np.stack(
        [x[1] * one, x[1] + v1, x[1] + 2.0 * v1 + a1, x[2] - 2.0 * v2 + a2, x[2] - v2, x[2] * one]
    )  # as in ``polynomial_353``; its ends are those of the cubics, whose own peaks lie there
    u = np.linspace(0.0, 1.0, SAMPLES)
    peaks = [np.abs(basis(5 - m, u) @ difference_matrix(5, m) @ quintic).max(axis=0) for m in (1, 2)]
    return np.stack([t1, one, t3], axis=1), peaks[0], peaks[1]


def closest_phases(sign: bool, speeds: Array, target: Array) -> tuple[Array, float, float]:
    """The longest of each phase over the joints, each alone, for the limits that bring it closest to ``target``.

    Args:
        sign: whether joint 3 of X_2 has the printed sign.
        speeds: v_max of the joints up to a common factor ``(6,)``; a_max is v_max times another.
        target: t1, t2, t3 [s].

    Returns:
        the phases [s], by how much the worst of them is off, relative, and a_max / v_max [1/s].
    """
    points = np.degrees(paper.via_points(paper.ZhuWang(as_printed=sign)))
    joints = [single_joint_peaks(points[:, j]) for j in range(6)]
    best: tuple[Array, float, float] = (np.full(3, np.nan), np.inf, np.nan)
    size = np.abs(np.diff(points, axis=0)).max()
    for factor in FAMILY:
        alone = []
        for (t, v, a), speed in zip(joints, speeds, strict=True):
            scale = np.maximum(v / speed, np.sqrt(a / (speed * factor * speeds.max() / size)))
            i = int(np.argmin(scale * t.sum(axis=1)))
            alone.append(scale[i] * t[i])
        longest = np.max(alone, axis=0)
        # The scale that makes the worst ratio to the target least.
        ratio = np.log(longest / target)
        centre = (ratio.max() + ratio.min()) / 2.0
        off = float(np.expm1(ratio.max() - centre))
        if off < best[1]:
            best = (longest * np.exp(-centre), off, float(factor * speeds.max() / size * np.exp(centre)))
    return best
