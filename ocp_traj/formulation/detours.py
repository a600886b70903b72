"""Starts that go around obstacles: a guess whose legs are bent aside, the first bend found that is clear."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import hermite
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.robot.joint_limits import JointLimits

TRIES, AT_ONCE = 96, 8  # bends of a leg, ever wider, and how many are looked at together: our choice
SAMPLES = 24  # postures along a leg at which a bend is looked at: our choice
WIDEST = 2.0  # [rad or m] standard deviation of a joint's bend at most: our choice
AS_IT_IS = 0.5  # share of the starts that are tried as they are first: our choice
_BUMP = 64.0 * np.poly1d([1.0, 0.0, 0.0, 0.0]) * np.poly1d([-1.0, 1.0]) ** 3  # 64 u^3 (1 - u)^3: 1 in the middle


def around(
    made: Parametrisation, limits: JointLimits, room: Callable[[Array], Array]
) -> Callable[[np.random.Generator], Array]:
    """The guesses of a curve, their legs bent until they are clear.

    Args:
        made: the curve; its segments are cut at knots with states.
        limits: of the joints.
        room: postures ``(N, dof)`` -> by how much the bodies are farther apart than they have to be ``(N,)`` [m].

    Returns:
        Random starting point ``(n,)`` from a generator, the same from the same. Where no bend tried is clear it has the
        one that is deepest in the least.
    """
    lower, upper = (np.concatenate([getattr(v, side) for v in made.variables]) for side in ("lower", "upper"))

    def guess(rng: np.random.Generator) -> Array:
        x = made.guess(rng)
        curve = made.curve(x)
        bends = np.array([_bend(curve, leg, limits, room, rng) for leg in made.legs])
        if not bends.any():
            return x
        bent = made.variables_of(_bent(curve, made, bends))
        slower = _slowness(made.curve(bent), limits)
        if made.dilate is not None and slower > 1.0:
            bent = made.dilate(bent, slower)
        return np.clip(bent, lower, upper)

    return guess


def _bend(
    curve: PiecewiseBezier, leg: range, limits: JointLimits, room: Callable[[Array], Array], rng: np.random.Generator
) -> Array:
    """How far each joint is moved aside in the middle of a leg ``(dof,)``."""
    knots = np.asarray(curve.knots)
    u = (np.arange(SAMPLES) + 0.5) / SAMPLES
    straight = curve(knots[leg.start] + u * (knots[leg.stop] - knots[leg.start]))
    first = 0.0 if rng.uniform() < AS_IT_IS else rng.uniform(0.0, 1.0)
    width = np.linspace(first, WIDEST, TRIES)
    bends = width[:, None] * rng.normal(size=(TRIES, curve.dof))
    pair, best, most = limits.bounds(0), bends[0], -np.inf
    for some in np.split(bends, TRIES // AT_ONCE):
        paths = straight + some[:, None] * _BUMP(u)[:, None]
        least = room(paths.reshape(-1, curve.dof)).reshape(len(some), SAMPLES).min(axis=1)
        if pair is not None:
            out = np.maximum(paths - pair[1], pair[0] - paths).max(axis=(1, 2))
            least = np.where(out > 0.0, np.minimum(least, 0.0) - out, least)
        clear = np.flatnonzero(least > 0.0)
        if len(clear):
            return np.asarray(some[clear[0]])
        if least.max() > most:
            best, most = some[int(np.argmax(least))], float(least.max())
    return np.asarray(best)


def _bent(curve: PiecewiseBezier, made: Parametrisation, bends: Array) -> PiecewiseBezier:
    """The curve with its legs moved aside, in positions, velocities and accelerations at knots."""
    durations, knots = np.asarray(curve.durations, dtype=float), np.asarray(curve.knots)
    rows = made.continuity + 1
    ends = [(k, 0.0) for k in range(curve.segments)] + [(curve.segments - 1, 1.0)]
    states = np.array([[curve.at(k, u, order)[0] for order in range(rows)] for k, u in ends])
    for leg, bend in zip(made.legs, bends, strict=True):
        begin, length = knots[leg.start], knots[leg.stop] - knots[leg.start]
        for k in range(leg.start + 1, leg.stop):
            u = (knots[k] - begin) / length
            for order in range(min(3, rows)):
                states[k, order] += bend * _BUMP.deriv(order)(u) / length**order if order else bend * _BUMP(u)
    return hermite(list(states), durations)


def _slowness(curve: PiecewiseBezier, limits: JointLimits) -> float:
    """By how much slower it has to be for its velocities and accelerations at knots to be within limits."""
    slowest = 1.0
    for order in (1, 2):
        pair = limits.bounds(order)
        if pair is not None:
            peak = np.max(
                [np.abs(curve.at(k, np.array([0.0, 0.5, 1.0]), order)) for k in range(curve.segments)], axis=(0, 1)
            )
            share = peak / np.minimum(-pair[0], pair[1])
            slowest = max(slowest, float(share.max()) ** (1.0 / order))
    return slowest
