"""Levels: a curve of many pieces is solved from the optimum of one with fewer, which is found from a plain guess."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.problem import Levels, Problem

GAIN = 0.01  # relative, of the objective, below which more pieces are not worth their time: our choice
SLOWER = 1.0005  # so that a prolonged optimum is inside its limits, where it rests on them: our choice
HULL_ROWS = tuple(range(5))  # orders whose limits the coarsest level holds at control points


def usual_levels(degree: int, *, stops_only: bool) -> tuple[int, int]:
    """Coarsest and finest number of pieces a leg with which refinement gains what there is to be had in little time.

    Measured on random moves of a UR5, and on its paths and those of a Panda through six points.

    Args:
        degree: of the segments.
        stops_only: whether every via point is a stop, as of a lone move, whose start is close to the shortest motion.
    """
    if not stops_only:
        return 1, 8
    return (8, 16) if degree == 5 else (4, 8)


def levels_of(
    parametrise: Callable[[int], Parametrisation],
    pose: Callable[[int, Parametrisation], Problem],
    pieces: int,
    *,
    finest: int | None = None,
    gain: float = GAIN,
    coarsest: int = 1,
    factor: int = 2,
) -> Problem:
    """The problem with so many pieces a leg, solved by levels: each has some whole number of times the coarser's.

    Args:
        parametrise: number of pieces -> curve; the coarser's pieces cut evenly are the finer's.
        pose: number of pieces and curve -> problem, its ``levels`` left out; its variables may go on after the
            curve's, the same at all levels.
        pieces: of the problem; with ``finest`` of the coarsest one. One piece alone is solved with its limits held at
            control points, which is found from any guess, before those are let go.
        finest: refinement goes on by halves from ``pieces`` up to at most so many; None for a problem that stays.
        gain: of ``Levels``.
        coarsest: number of pieces below which no level is, where there is no ``finest``.
        factor: each level has at most so many times the coarser's pieces, or the least number that goes, where there is
            no ``finest``.
    """
    sizes = [pieces]
    while finest is None and sizes[0] > 1:
        fewer = sizes[0] // next(n for n in (*range(factor, 1, -1), *range(2, sizes[0] + 1)) if sizes[0] % n == 0)
        if fewer < coarsest:
            break
        sizes.insert(0, fewer)
    while finest is not None and 2 * sizes[-1] <= finest:
        sizes.append(2 * sizes[-1])
    # A start for others has to be found from any guess: its limits are held at control points, whatever that costs.
    if sizes == [1] and not parametrise(1).hull_rows:
        sizes = [1, 1]
    given = len(sizes) - 1 if finest is None else 0

    @cache
    def curve(i: int) -> Parametrisation:
        made = parametrise(sizes[i])
        return replace(made, hull_rows=made.hull_rows or HULL_ROWS) if i == 0 and len(sizes) > 1 else made

    @cache
    def problem(i: int) -> Problem:
        own = curve(i)

        def prolong(x: Array) -> Array:
            before = curve(i - 1)
            size = sum(len(v.labels) for v in before.variables)
            parts = sizes[i] // sizes[i - 1]
            if own.refine is not None:
                finer = own.refine(x[:size], parts)
            else:
                finer = own.variables_of(cut(before.curve(x[:size]), parts, before.legs))
            slower = finer if own.dilate is None else own.dilate(finer, SLOWER)
            return np.concatenate([slower, x[size:]])

        posed = pose(sizes[i], own)
        lower, upper = posed.lower, posed.upper
        levels = Levels(
            (lambda: problem(i - 1)) if i else None,
            lambda x: np.clip(prolong(x), lower, upper),
            (lambda: problem(i + 1)) if finest is not None and i + 1 < len(sizes) else None,
            gain,
        )
        return replace(posed, levels=levels)

    return problem(given)


def cut(curve: PiecewiseBezier, parts: int, legs: tuple[range, ...]) -> PiecewiseBezier:
    """The same curve, the segments of its legs cut evenly, by de Casteljau; others stay."""
    inside = {k for leg in legs for k in leg}
    durations, points = [], []
    for k in range(curve.segments):
        number = parts if k in inside else 1
        for i in range(number):
            durations.append(curve.durations[k] / number)
            points.append(curve.restrict(k, i / number, (i + 1) / number))
    return PiecewiseBezier(np.array(durations), tuple(points))
