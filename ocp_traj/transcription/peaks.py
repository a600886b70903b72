"""Instants that follow a stationary point of a limit: where g_u = 0, g_ux dx + g_uu du = 0 says how it moves with x."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.transcription.symbolic import SymbolicCurve
from ocp_traj.transcription.transcription import Instant, limit_values

Array = NDArray[np.float64]

RACING = 1e3  # segments a peak moves when x doubles: it is so flat that an instant that stays holds it as well


def peak_function(problem: Problem, limit: PathConstraint, members: Sequence[Instant]) -> Any:
    """Casadi Function (x, u ``(N,)``) -> scaled values, g_u, g_uu ``(N,)``, g_ux ``(N, n)`` of one row an instant.

    Where instants do not move g_ux is empty.
    """
    x, u = casadi.MX.sym("x", problem.size), casadi.MX.sym("u", len(members))
    values = casadi.vec(limit_values(SymbolicCurve.at(problem, x), limit, members, u) / casadi.DM(limit.scale))
    rows = [(m.rows or (0,))[0] + j * len(limit.labels) for j, m in enumerate(members)]
    value = values[rows]
    gu = casadi.gradient(casadi.sum1(value), u)
    guu = casadi.gradient(casadi.sum1(gu), u)
    gux = casadi.densify(casadi.jacobian(gu, x)) if problem.tuning.instants_move else casadi.MX(len(members), 0)
    return casadi.Function("peaks", [x, u], [value, gu, guu, gux])


def follow(problem: Problem, limit: PathConstraint, members: Sequence[Instant], x: Array) -> list[Instant]:
    """The instants, each on a stationary point, made to move with the variables where that is sensible."""
    if not members:
        return []
    _, _, guu, gux = (np.array(v) for v in peak_function(problem, limit, members)(x, [m.u for m in members]))
    return [moving(member, a[0], b, x) for member, a, b in zip(members, guu, gux, strict=True)]


def moving(instant: Instant, guu: float, gux: Array, x: Array) -> Instant:
    """The instant with slope -g_ux / g_uu; at the end of a segment, and on a peak too flat, one that stays."""
    if not (0.0 < instant.u < 1.0 and abs(guu) > 1e-9):
        return replace(instant, slope=None, anchor=None)
    slope = -gux / guu
    if np.abs(slope * x).max() > RACING:
        return replace(instant, slope=None, anchor=None)
    return replace(instant, slope=slope, anchor=x)


def where(instant: Instant, x: Array) -> float:
    """Local time of an instant at x."""
    return _moved(instant.u, instant.slope, instant.anchor, x)


def along(instant: Instant, x: Array) -> float:
    """Place along the sweep of an instant at x."""
    return _moved(instant.sweep, instant.sweep_slope, instant.anchor, x)


def _moved(start: float, slope: Array | None, anchor: Array | None, x: Array) -> float:
    return start if slope is None or anchor is None else float(np.clip(start + slope @ (x - anchor), 0.0, 1.0))


def frozen(instant: Instant, x: Array) -> Instant:
    """The instant where it now is; that it has an anchor still tells it from the grid's."""
    return replace(instant, u=where(instant, x), slope=None, sweep=along(instant, x), sweep_slope=None)
