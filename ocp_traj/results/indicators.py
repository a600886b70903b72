"""What is said of a front as a whole: how evenly its points lie, and where its knee is."""

from __future__ import annotations

import moocore
import numpy as np

from ocp_traj.arrays import Array

FLAT = 1e-9  # of the objectives' ranges: a front that bulges less has no knee; our choice
SINGULAR = 1e9  # condition beyond which the extreme points do not span a plane; our choice


def hypervolume_so_far(values: Array, reference: Array, ideal: Array) -> float | None:
    """Share of the box from the ideal to the reference point that values dominate; None where there is no such box.

    Args:
        values: ``(N, objectives)``, less is better.
        reference: worst values worth having ``(objectives,)``.
        ideal: best values ``(objectives,)``.
    """
    size = reference - ideal
    if not (len(values) and np.isfinite(size).all() and (size > 0.0).all()):
        return None
    return float(moocore.hypervolume(np.maximum((values - ideal) / size, 0.0), ref=np.ones(len(size))))


def spread(points: Array) -> float:
    """How unevenly points lie, 0 for equal gaps; NaN for fewer than three.

    sum_i |d_i - mean d| / (N mean d) over the N distances d_i: between neighbours for two objectives (Delta of Deb et
    al. 2002, IEEE TEC 6(2)), from each point to its nearest for more (Zhou et al. 2006, CEC). The true front's ends are
    not known; with the own ones their terms vanish.

    Args:
        points: ``(N, objectives)``, objectives divided by their ranges (our choice).
    """
    if len(points) < 3:
        return np.nan
    if points.shape[1] == 2:
        gaps = np.linalg.norm(np.diff(points[np.lexsort(points.T[::-1])], axis=0), axis=1)
    else:
        between = np.linalg.norm(points[:, None] - points[None], axis=2)
        gaps = (between + np.diag(np.full(len(points), np.inf))).min(axis=1)
    return float(np.abs(gaps - gaps.mean()).mean() / gaps.mean()) if gaps.any() else np.nan


def knee(points: Array) -> int:
    """Index of the point that bulges farthest towards the ideal from the hyperplane through the extreme points.

    Das (1999), Structural Optimization 18. Where there is no such plane or no point lies on the ideal's side of it (two
    points, a straight or a concave front): the point closest to the ideal.

    Args:
        points: ``(N, objectives)``, 0 at the ideal, 1 at the nadir.
    """
    # The best point in each objective; of several, the one that is best in the others.
    order = [np.lexsort((points.sum(axis=1), points[:, k]))[0] for k in range(points.shape[1])]
    extremes = points[order]
    if np.linalg.cond(extremes) < SINGULAR:
        normal = np.linalg.solve(extremes, np.ones(len(extremes)))  # the plane is normal . z = 1, the ideal z = 0
        distance = (1.0 - points @ normal) / np.linalg.norm(normal)
        if (normal > 0.0).all() and distance.max() > FLAT:
            return int(np.argmax(distance))
    return int(np.argmin(np.linalg.norm(points, axis=1)))
