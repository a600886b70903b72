"""Curves of Hermite segments: the states at knots and the durations between them are the decision variables.

A segment depends on its own two states and its duration alone, so that what a long path costs grows linearly with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.knots import Knots
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.stretches import Stretch
from ocp_traj.robot.joint_limits import JointLimits

DEGREES = (5, 7, 9)


def knot_states(
    points: ArrayLike,
    limits: JointLimits,
    *,
    degree: int = 5,
    pieces: int = 1,
    even: bool = True,
    rest: int = 2,
    stops: Sequence[int] = (),
    dwells: Mapping[int, float] | None = None,
    via_tolerance: ArrayLike = 0.0,
    start: ArrayLike | None = None,
    end: ArrayLike | None = None,
    joints: Sequence[str] = (),
    units: Sequence[str] = (),
    stretches: Sequence[Stretch] = (),
) -> Parametrisation:
    """A curve through via points whose states at knots, and durations, are variables.

    Derivatives are variables in units of a time near the pieces' (``Knots.unit``), so that all are of one size, and
    bounded by the limits; what is not limited is not bounded. Durations are bounded by ``SHORTEST`` and ``LONGEST``
    times the guessed ones.

    Args:
        points: via points ``(L + 1, n)``, ends included.
        limits: of the joints.
        degree: 5, 7 or 9: continuous up to the 2nd, 3rd or 4th derivative.
        pieces: segments from one via point to the next.
        even: whether the pieces between two via points have one duration, in place of one each, with which many
            pieces seldom converge from a plain guess.
        rest: derivatives that vanish at ends and stops; those above, up to the order of continuity, are free.
        stops: via points at rest, counted from 0.
        dwells: {via point: seconds} standing still there, a constant segment; inner ones.
        via_tolerance: how far inner via points may be passed by, ``()``, ``(n,)`` or each ``(L + 1, n)``, infinite
            where limits alone bound them; the ends are exact.
        start: derivatives 1, 2, .. ``(k, n)`` there, in place of rest.
        end: likewise.
        joints: one name a joint.
        units: of the joints, "rad" where not given.
        stretches: legs along which the start is given.

    Raises:
        ProblemDefinitionError: names what does not fit.
    """
    where = np.asarray(points, dtype=float)
    if where.ndim != 2 or len(where) < 2 or not where.size or not np.isfinite(where).all():
        raise ProblemDefinitionError(
            f"via points are of shape {where.shape}; give two or more, a finite row of joints each"
        )
    n, most = where.shape[1], degree // 2
    _check("degree", degree, degree in DEGREES, "5, 7 or 9")
    _check("pieces", pieces, pieces >= 1, "1 or more")
    _check("rest", rest, 0 <= rest <= most, f"0 to {most}, for degree {degree}")
    tolerance = np.broadcast_to(np.asarray(via_tolerance, dtype=float), where.shape).copy()
    _check("via_tolerance", via_tolerance, bool((tolerance >= 0.0).all()), "numbers from 0 up")
    tolerance[[0, -1]] = 0.0
    inner = range(1, len(where) - 1)
    for word, indices in (("stop", tuple(stops)), ("dwell", tuple(dwells or {}))):
        for i in indices:
            _check(f"{word} at via point", i, i in inner, f"inner ones, 1 to {len(where) - 2}")
    for i, seconds in (dwells or {}).items():
        _check(f"dwell at via point {i}", seconds, 0.0 < seconds < np.inf, "seconds above zero")
    given: dict[int, Array] = {}
    for side, derivatives in ((0, start), (-1, end)):
        rows = np.zeros((rest, n)) if derivatives is None else np.asarray(derivatives, dtype=float)
        fits = rows.ndim == 2 and rows.shape[1] == n and len(rows) <= most and bool(np.isfinite(rows).all())
        _check("derivatives at an end", rows.shape, fits, f"shape (k, {n}) with k up to {most}")
        given[side] = rows
    names, kinds = tuple(joints) or tuple(f"joint {j + 1}" for j in range(n)), tuple(units) or ("rad",) * n
    for word, values in (("names", names), ("units", kinds), ("limits", range(limits.size or n))):
        _check(f"{word} of joints", len(values), len(values) == n, f"{n}, one a joint")
    knots = Knots(
        where,
        limits,
        most + 1,
        pieces,
        even,
        rest,
        frozenset(stops),
        dict(dwells or {}),
        tolerance,
        given,
        names,
        kinds,
        tuple(stretches),
    )
    still = all(not rows.any() for rows in given.values())
    return Parametrisation(
        variables=knots.variables,
        curve=knots.curve,
        guess=knots.guess,
        variables_of=knots.variables_of,
        dilate=knots.dilate if still else None,
        knots=tuple((i if i < len(knots.durations_at) else -1, float(i == len(knots.durations_at))) for i in knots.via),
        legs=knots.legs,
        continuity=most,
        hull_rows=tuple(range(5)) if pieces > 1 else (),
        scales_in_time=False,
        duration=knots.duration,
        guess_along=knots.guess,
    )


def _check(word: str, given: Any, fits: bool, allowed: str) -> None:
    if not fits:
        raise ProblemDefinitionError(f"{word}: {given}; give {allowed}")
