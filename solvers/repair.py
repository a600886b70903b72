"""Repair by time scaling: a near miss, slowed down along its own path, is proved or left as it was.

A rest-to-rest trajectory dilated by s keeps its path; its m-th derivatives fall as s^-m. Position limits and gravity do
not scale, so this mends small excesses of velocity, acceleration, jerk and of the dynamic part of efforts only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ocp_traj.problem import Problem
from ocp_traj.trajectory import audit_points
from ocp_traj.verdicts import Audit

Array = NDArray[np.float64]

# Of the excess e, as the factor's distance from 1: a limit on the m-th derivative needs (1 + e)^(1/m) - 1 < e / m.
MULTIPLES = (0.2500003, 0.3333337, 0.5000005, 1.000001, 1.001, 1.1, 2.0, 10.0, 100.0)
LARGEST = 1.1  # factor: our choice; more than a tenth slower is another trajectory, not a mended one


def slow_down(
    problem: Problem, xs: Sequence[Array], audits: Sequence[Audit] | None = None
) -> tuple[list[Array], list[Audit]]:
    """Dilates the unproved of several decision vectors until they are proved, at most by a factor of ``LARGEST``.

    The factors tried follow from the largest relative excess that the audit found; all vectors are audited together.

    Args:
        problem: it must say how x dilates, or nothing is changed.
        xs: decision vectors ``(n,)``.
        audits: of these vectors, where they are known.

    Returns:
        The vectors, mended where that was possible, and their audits.
    """
    xs = [np.asarray(x, dtype=float) for x in xs]
    checked = list(audits or (found for _, found in audit_points(problem, xs)))
    if problem.dilate is None:
        return xs, checked
    excess = {i: max(largest_excess(problem, found), 1e-9) for i, found in enumerate(checked) if not found.proved}
    original = list(xs)
    for multiple in MULTIPLES:
        trial = {i: np.asarray(problem.dilate(original[i], 1.0 + multiple * e)) for i, e in excess.items()}
        trial = {i: x for i, x in trial.items() if multiple * excess[i] <= LARGEST - 1.0 and (x <= problem.upper).all()}
        audited = audit_points(problem, list(trial.values()))
        for i, (_, found) in zip(trial, audited, strict=True):
            if found.proved:
                xs[i], checked[i] = trial[i], found
                del excess[i]
    return xs, checked


def largest_excess(problem: Problem, checked: Audit) -> float:
    """Largest relative amount by which a path limit is broken, at the instants the audit found."""
    scale = {
        (limit.id, label): float(size)
        for limit in problem.requirements.path_constraints
        for label, size in zip(limit.labels, limit.scale, strict=True)
    }
    rows = [row for row in checked.failures if (row.limit, row.label) in scale]
    return max((abs(row.attained - row.bound) / scale[row.limit, row.label] for row in rows), default=0.0)
