"""What each limit costs: how much better the objective would be if the limit were one per cent wider.

At a local optimum the multiplier of a row is the slope of the optimum in the row's bound. A limit stands in the NLP as
rows at instants, as rows of control points and as bounds on variables, all of which move with it: what they gain adds
up. That is of first order, and of the motions near the one that was found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.rows import VARIABLE, Row
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.transcription.nlp import NLPResult, Status

SHARE = 0.01  # by which a limit is widened
LEAST = 1e-6  # of the largest slope times size: below is what a solver's tolerance leaves of limits that cost nothing
WHOLE = "all"  # label of a limit whose rows are all widened


@dataclass(frozen=True)
class LimitGain:
    """What one limit costs.

    Attributes:
        limit: its id; ``rows.VARIABLE`` for a bound on a variable that is of no limit.
        label: of its row, such as a joint; ``WHOLE`` for all of them together.
        gain: by how much the objective gets better where the bounds move outwards by 1 % of their size each, of a range
            given to a point by 1 % of half its width [unit]; 0 of a bound of zero, which has no size.
        slope: by how much it gets better per unit of the limit [unit per limit_unit].
        unit: of the objective; "-" for a sum of several.
        limit_unit: of the limit.
        rows: how many rows and bounds of variables it rests on.
    """

    limit: str
    label: str
    gain: float
    slope: float
    unit: str
    limit_unit: str
    rows: int


@dataclass(frozen=True)
class _Part:
    """One active row or bound: whose, its slope [objective per unit of the limit], and the size it moves by.

    ``scale`` is a size of the limit where that is zero.
    """

    limit: str
    label: str
    unit: str
    slope: float
    size: float
    scale: float = 1.0

    @property
    def weight(self) -> float:
        """What tells a slope from none."""
        return self.slope * (self.size or self.scale)


def limit_gains(problem: Problem, scalarisation: Scalarisation, result: NLPResult) -> tuple[LimitGain, ...]:
    """What each limit costs, and each of its rows, largest first.

    Args:
        problem: whose limits.
        scalarisation: what was minimised.
        result: a local optimum with its multipliers, over the problem's variables and whatever follows them.

    Returns:
        Nothing where the multipliers are not to be had: of populations, and of a point that a solver did not end in.
    """
    bounds = result.bound_multipliers
    optimal = result.status in (Status.SOLVED, Status.ACCEPTABLE)
    if not optimal or not result.multipliers or bounds is None or result.row_multipliers is None:
        return ()
    per_f, unit = _measure(problem, scalarisation)
    parts = [*_of_rows(problem, result), *_of_variables(problem, scalarisation, bounds)]
    groups: dict[tuple[str, str], list[_Part]] = {}
    for part in parts:
        groups.setdefault((part.limit, part.label), []).append(part)
    for limit in {part.limit for part in parts} - {VARIABLE}:
        own = [part for part in parts if part.limit == limit]
        if len({part.label for part in own}) > 1:
            groups[limit, WHOLE] = own
    weights = {key: sum(part.weight for part in own) for key, own in groups.items()}
    most = max(weights.values(), default=0.0)
    slopes = {key: float(sum(part.slope for part in own)) for key, own in groups.items()}
    found = [
        LimitGain(
            *key, _gain(own) * per_f, slopes[key] * per_f, unit, " or ".join(dict.fromkeys(part.unit for part in own)),
            sum(part.slope > LEAST * slopes[key] for part in own),
        )
        for key, own in groups.items()
        if weights[key] > LEAST * most
    ]  # fmt: skip
    return tuple(sorted(found, key=lambda g: (-g.gain, -g.slope, g.limit, g.label)))


def _gain(parts: list[_Part]) -> float:
    return float(sum(SHARE * part.slope * part.size for part in parts))


def _measure(problem: Problem, scalarisation: Scalarisation) -> tuple[float, str]:
    """Units of the objective per unit of what is minimised, and the objective's unit; a sum is its own measure."""
    names = scalarisation.names
    name = getattr(scalarisation, "minimise", names[0] if len(names) == 1 else None)
    if name is None:
        return 1.0, "-"
    zero, one = ({other: float(other == name) * size for other in names} for size in (0.0, 1.0))
    slope = abs(float(scalarisation.apply(problem, one).f - scalarisation.apply(problem, zero).f))
    return 1.0 / slope, problem.objective(name).unit


def _of_rows(problem: Problem, result: NLPResult) -> Iterator[_Part]:
    requirements = problem.requirements
    paths = {
        (limit.id, label): (limit.lower[i], limit.upper[i])
        for limit in requirements.path_constraints
        for i, label in enumerate(limit.labels)
    }
    ids = {objective.id for objective in problem.objectives}
    multipliers = np.zeros(0) if result.row_multipliers is None else result.row_multipliers
    for row, multiplier in zip(result.rows, multipliers.tolist(), strict=True):
        if row.defines or multiplier == 0.0:
            continue
        pair = paths.get((row.limit, row.label)) or _range(problem, row)
        if pair is not None:
            size = abs(pair[1] if multiplier > 0.0 else pair[0])
        elif row.limit in ids:  # a bound on an objective, which its slope is of; its own value is not kept
            size = 0.0
        else:
            continue
        yield _Part(
            row.limit, row.label, row.unit, abs(multiplier) / row.scale, size if np.isfinite(size) else 0.0, row.scale
        )


def _range(problem: Problem, row: Row) -> tuple[float, float] | None:
    """Half the width of the range that a point constraint leaves a row; None for an equality, which has none."""
    for point in problem.requirements.point_constraints:
        if point.id == row.limit:
            i = point.labels.index(row.label)
            segments = problem.at_symbols[1].segments
            places = [(k % segments, u) for k, u in point.at]
            at = places.index((row.segment, row.instant))
            half = 0.5 * float(point.upper[at, i] - point.lower[at, i])
            return (half, half) if half > 0.0 else None
    return None


def _of_variables(problem: Problem, scalarisation: Scalarisation, multipliers: Array) -> Iterator[_Part]:
    """Bounds on variables that are active; those of a limit are in its unit, whatever the variable's is."""
    limits = {limit.id: limit for limit in problem.requirements.path_constraints}
    ranges = {point.id for point in problem.requirements.point_constraints}
    fixed = problem.inactive(scalarisation.names)
    origins = [o for v in problem.variables for o in v.bounded_by or ((VARIABLE, label) for label in v.labels)]
    for multiplier, low, high, own, unit, name, (limit, label) in zip(
        multipliers[: problem.size], problem.lower, problem.upper, fixed, problem.units, problem.labels, origins,
        strict=True,
    ):  # fmt: skip
        if multiplier == 0.0 or own or not low < high:
            continue
        size, slope = abs(high if multiplier > 0.0 else low), float(abs(multiplier))
        if limit in limits:
            entry = limits[limit].labels.index(label)
            unit = limits[limit].units[entry]
            size = float(abs((limits[limit].upper if multiplier > 0.0 else limits[limit].lower)[entry]))
            slope *= abs(high if multiplier > 0.0 else low) / size if size > 0.0 else 1.0
        elif limit in ranges:
            size = 0.5 * (high - low)
        elif limit != VARIABLE:
            limit, label = VARIABLE, name
        yield _Part(limit, label, unit, slope, size if np.isfinite(size) else 0.0)
