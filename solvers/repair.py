"""Repair by time scaling: a near miss, slowed down along its own path, is proved or left as it was.

A rest-to-rest trajectory dilated by s keeps its path; its m-th derivatives fall as s^-m. Position limits and gravity do
not scale, so this mends small excesses of velocity, acceleration, jerk and of the dynamic part of efforts only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ocp_traj.audit import audit_all
from ocp_traj.problem import Problem
from ocp_traj.transcription import trajectory
from ocp_traj.verdicts import Audit

Array = NDArray[np.float64]

LARGEST = 1.1  # factor: our choice; more than a tenth slower is another trajectory, not a mended one


def slow_down(
    problem: Problem, xs: Sequence[Array], audits: Sequence[Audit] | None = None
) -> tuple[list[Array], list[Audit]]:
    """Dilates the unproved of several decision vectors until they are proved, at most by a factor of ``LARGEST``.

    The first step is the largest relative excess that the audit's bounds leave open, and doubles from there; all
    vectors are audited together.

    Args:
        problem: it must say how x dilates, or nothing is changed.
        xs: decision vectors ``(n,)``.
        audits: of these vectors, where they are known.

    Returns:
        The vectors, mended where that was possible, and their audits.
    """
    xs = [np.asarray(x, dtype=float) for x in xs]
    checked = list(audits or audit_all([trajectory(problem, x) for x in xs], problem.requirements))
    if problem.dilate is None:
        return xs, checked
    step = {i: _excess(found) for i, found in enumerate(checked) if not found.proved}
    factor = dict.fromkeys(step, 1.0)
    original = list(xs)
    while step:
        trial: dict[int, Array] = {}
        for i in list(step):
            factor[i] += step[i]
            step[i] *= 2.0
            x = np.asarray(problem.dilate(original[i], factor[i]))
            if factor[i] > LARGEST or (x > problem.upper).any():
                del step[i]
            else:
                trial[i] = x
        audited = audit_all([trajectory(problem, x) for x in trial.values()], problem.requirements)
        for i, found in zip(trial, audited, strict=True):
            if found.proved:
                xs[i], checked[i] = trial[i], found
                del step[i]
    return xs, checked


def _excess(found: Audit) -> float:
    worst = max((-row.margin for row in found.failures if np.isfinite(row.margin)), default=0.0)
    return min(max(worst, 1e-9), 1.0)
