"""Where a trajectory breaks its limits: the instants that constraint exchange adds, each on a peak."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.proof.values import limit_on
from ocp_traj.proof.verdicts import Audit
from ocp_traj.transcription.peaks import moving, peak_function
from ocp_traj.transcription.swept_peaks import sharpened_sweep, swept_peaks
from ocp_traj.transcription.transcription import BACK_OFF, Instant

Array = NDArray[np.float64]

SCAN = 48  # samples a segment when looking for peaks: our choice, far denser than the degrees in use have peaks
FINE = 33  # samples about a sample that stands out, from one neighbour to the other: our choice


def worst_instants(
    problem: Problem, x: Array, candidate: Motion, checked: Audit, back_off: float = BACK_OFF
) -> list[Instant]:
    """The peaks at which a trajectory of x ``(n,)`` breaks its limits, each as an instant that moves with x."""
    failing = {row.limit for row in checked.failures}
    found: list[Instant] = []
    for limit in problem.requirements.path_constraints:
        if limit.id in failing:
            found += _sharpened(problem, limit, _peaks(problem, limit, candidate, back_off), x, back_off)
    return found


def _scaled_bounds(limit: PathConstraint, back_off: float) -> tuple[Array, Array]:
    return limit.lower / limit.scale + back_off, limit.upper / limit.scale - back_off


def _peaks(problem: Problem, limit: PathConstraint, candidate: Motion, back_off: float) -> list[Instant]:
    """Local maxima of the violation of one limit, from a scan: above zero, or close enough to hide one that is."""
    low, high = _scaled_bounds(limit, back_off)
    u = np.linspace(0.0, 1.0, SCAN)
    members: list[Instant] = []
    for k in filter(limit.holds_on, range(candidate.curve.segments)):
        if limit.sweep:
            members += swept_peaks(problem, limit, k, candidate, back_off)
            continue
        values = limit_on(candidate, problem.requirements, limit, k, u) / limit.scale[:, None]
        for side, bound in ((1.0, high), (-1.0, -low)):
            rows, places = np.nonzero(_stands_out(side * values - bound[:, None]))
            if not len(rows):
                continue
            # Narrow peaks lie between samples, where Newton's method would go astray: look closer first.
            close = np.clip(u[places][:, None] + np.linspace(-1.0, 1.0, FINE) / (SCAN - 1), 0.0, 1.0)
            closer = limit_on(candidate, problem.requirements, limit, k, close.ravel()) / limit.scale[:, None]
            own = closer.reshape(-1, *close.shape)[rows, np.arange(len(rows))]  # (peaks, FINE)
            highest = close[np.arange(len(rows)), np.argmax(side * own, axis=1)]
            members += [Instant(limit.id, k, float(v), (int(row),)) for row, v in zip(rows, highest, strict=True)]
    return members


def _stands_out(excess: Array) -> NDArray[np.bool_]:
    """Which samples ``(rows, SCAN)`` are local maxima of an excess that is above zero, or may be between samples."""
    left = np.pad(excess[:, :-1], ((0, 0), (1, 0)), constant_values=-np.inf)
    right = np.pad(excess[:, 1:], ((0, 0), (0, 1)), constant_values=-np.inf)
    with np.errstate(invalid="ignore"):  # of a side without a bound
        falls = np.stack([excess - left, excess - right])
    fall = np.where(np.isfinite(falls), falls, 0.0).max(axis=0)
    return np.asarray((excess >= left) & (excess > right) & (excess > -fall))


def _sharpened(
    problem: Problem, limit: PathConstraint, members: list[Instant], x: Array, back_off: float
) -> list[Instant]:
    """Moves instants onto their peaks by Newton's method on g_u = 0; keeps those where the limit is broken."""
    if not members:
        return []
    if limit.sweep:
        return sharpened_sweep(problem, limit, members, x, back_off)
    derivatives = peak_function(problem, limit, members)
    rows = np.array([m.rows[0] for m in members if m.rows])
    low, high = (bound[rows] for bound in _scaled_bounds(limit, back_off))
    first = np.array([m.u for m in members])
    u, cell = first, 2.0 / (SCAN - 1) / (FINE - 1)
    begun = np.array(derivatives(x, u)[0]).ravel()
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(4):
            value, gu, guu, gux = (np.array(part) for part in derivatives(x, u))
            step = np.nan_to_num(-gu.ravel() / guu.ravel(), nan=0.0, posinf=0.0, neginf=0.0)
            u = np.clip(u + step, np.maximum(first - cell, 0.0), np.minimum(first + cell, 1.0))
        value, gu, guu, gux = (np.array(part) for part in derivatives(x, u))
    value = value.ravel()
    excess, at_first = np.maximum(value - high, low - value), np.maximum(begun - high, low - begun)
    kept = []
    for i in np.nonzero(np.maximum(excess, at_first) > 0.0)[0]:
        if excess[i] < at_first[i]:
            # Newton's method led downhill: the peak is a corner at the end of a segment, where it stays.
            kept.append(members[i])
        elif not problem.tuning.instants_move:
            kept.append(replace(members[i], u=float(u[i])))
        else:  # g_u = 0 ties u to x
            kept.append(moving(replace(members[i], u=float(u[i])), guu[i, 0], gux[i], x))
    return kept
