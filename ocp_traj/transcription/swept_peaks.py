"""Peaks of swept limits over local time and sweep together, and how they move with the variables.

At a peak inside the square g_u = g_s = 0, so (du, ds) = -H^-1 g_(us)x dx with H the Hessian over (u, s); on an edge of
the square the other coordinate alone is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import SWEEP, PathConstraint
from ocp_traj.proof.values import swept_on
from ocp_traj.transcription.peaks import RACING
from ocp_traj.transcription.symbolic import SymbolicCurve
from ocp_traj.transcription.transcription import Instant, limit_values

Array = NDArray[np.float64]

SCAN = 48  # local times a segment when looking for peaks, as for other limits: our choice
NEWTON = 8  # steps: our choice


def swept_peaks(
    problem: Problem, limit: PathConstraint, segment: int, candidate: Motion, back_off: float
) -> list[Instant]:
    """Local maxima of the violation over times and sweeps: above zero, or close enough to hide one that is."""
    u = np.linspace(0.0, 1.0, SCAN)
    low, high = limit.lower / limit.scale + back_off, limit.upper / limit.scale - back_off
    values = swept_on(candidate, problem.requirements, limit, segment, u, SWEEP) / limit.scale[:, None, None]
    excess = np.maximum(values - high[:, None, None], low[:, None, None] - values)
    padded = np.pad(excess, ((0, 0), (1, 1), (1, 1)), constant_values=-np.inf)
    shifts = [padded[:, 1 + i : 1 + i + SCAN, 1 + j : 1 + j + len(SWEEP)] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    around = np.stack([shifted for k, shifted in enumerate(shifts) if k != 4])
    falls = np.where(np.isfinite(around), excess - around, 0.0)
    peak = (excess >= around.max(axis=0)) & (excess > -np.abs(falls).max(axis=0))
    return [
        Instant(limit.id, segment, float(u[i]), (int(row),), sweep=float(SWEEP[j]))
        for row, i, j in zip(*np.nonzero(peak), strict=True)
    ]


def _derivatives(problem: Problem, limit: PathConstraint, members: Sequence[Instant]) -> Any:
    """Casadi Function (x, u, s) -> scaled values, g_u, g_s, g_uu, g_us, g_ss ``(N,)``, g_ux, g_sx ``(N, n)``."""
    n = len(members)
    x, u, s = casadi.MX.sym("x", problem.size), casadi.MX.sym("u", n), casadi.MX.sym("s", n)
    values = limit_values(SymbolicCurve.at(problem, x), limit, members, u, s) / casadi.DM(limit.scale)
    rows = [(m.rows or (0,))[0] + j * len(limit.labels) for j, m in enumerate(members)]
    value = casadi.vec(values)[rows]
    gu, gs = (casadi.gradient(casadi.sum1(value), place) for place in (u, s))
    second = [casadi.gradient(casadi.sum1(g), place) for g, place in ((gu, u), (gu, s), (gs, s))]
    cross = [casadi.densify(casadi.jacobian(g, x)) for g in (gu, gs)]
    return casadi.Function("swept_peaks", [x, u, s], [value, gu, gs, *second, *cross])


def sharpened_sweep(
    problem: Problem, limit: PathConstraint, members: Sequence[Instant], x: Array, back_off: float
) -> list[Instant]:
    """Moves instants onto their peaks by Newton's method over (u, s); keeps those where the limit is broken."""
    derivatives = _derivatives(problem, limit, members)
    rows = np.array([m.rows[0] for m in members if m.rows])
    low, high = (limit.lower / limit.scale + back_off)[rows], (limit.upper / limit.scale - back_off)[rows]
    first = np.array([[m.u, m.sweep] for m in members])
    cell = np.array([1.0 / (SCAN - 1), SWEEP[1]])
    place = first.copy()
    begun = np.array(derivatives(x, *first.T)[0]).ravel()
    for _ in range(NEWTON):
        _, gu, gs, guu, gus, gss, _, _ = (np.array(part) for part in derivatives(x, *place.T))
        for i in range(len(members)):
            gradient, hessian = (
                np.array([gu[i, 0], gs[i, 0]]),
                np.array([[guu[i, 0], gus[i, 0]], [gus[i, 0], gss[i, 0]]]),
            )
            free = _free(place[i], gradient, _side(begun[i], low[i], high[i]))
            step = np.zeros(2)
            if free.any():
                step[free] = -np.linalg.lstsq(hessian[np.ix_(free, free)], gradient[free], rcond=1e-12)[0]
            place[i] = np.clip(place[i] + step, np.maximum(first[i] - cell, 0.0), np.minimum(first[i] + cell, 1.0))
    value, gu, gs, guu, gus, gss, gux, gsx = (np.array(part) for part in derivatives(x, *place.T))
    value = value.ravel()
    excess, at_first = np.maximum(value - high, low - value), np.maximum(begun - high, low - begun)
    kept: list[Instant] = []
    for i in np.nonzero(np.maximum(excess, at_first) > 0.0)[0].tolist():
        if excess[i] < at_first[i]:  # Newton's method led downhill: hold the limit where the scan found it
            kept.append(members[i])
            continue
        gradient, hessian = np.array([gu[i, 0], gs[i, 0]]), np.array([[guu[i, 0], gus[i, 0]], [gus[i, 0], gss[i, 0]]])
        free = _free(place[i], gradient, _side(value[i], low[i], high[i]))
        instant = replace(members[i], u=float(place[i, 0]), sweep=float(place[i, 1]))
        kept.append(_moving(instant, hessian, np.stack([gux[i], gsx[i]]), free, x))
    return kept


def _side(value: float, low: float, high: float) -> float:
    """1 where the upper bound is the one at stake, else -1."""
    return 1.0 if value - high >= low - value else -1.0


def _free(place: Array, gradient: Array, side: float) -> NDArray[np.bool_]:
    """Which of (u, s) are not held at an end of [0, 1] by a limit that still rises towards it."""
    rising = side * gradient
    held = ((place <= 0.0) & (rising < 0.0)) | ((place >= 1.0) & (rising > 0.0))
    return np.asarray(~held)


def _moving(instant: Instant, hessian: Array, cross: Array, free: NDArray[np.bool_], x: Array) -> Instant:
    """The instant with the slopes of its free coordinates; one that would race stays."""
    slopes: list[Array | None] = [None, None]
    inside = np.nonzero(free)[0]
    if len(inside):
        part = hessian[np.ix_(inside, inside)]
        if np.linalg.matrix_rank(part, tol=1e-9) == len(inside):
            moved = -np.linalg.solve(part, cross[inside])
            if np.abs(moved * x).max() <= RACING:
                for place, slope in zip(inside.tolist(), moved, strict=True):
                    slopes[place] = slope
    return replace(instant, slope=slopes[0], sweep_slope=slopes[1], anchor=x)
