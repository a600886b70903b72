"""Fronts of one problem side by side: every figure with one reference and one ideal for all."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import moocore
import numpy as np
import pandas as pd

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, cut
from ocp_traj.files import plain
from ocp_traj.proof.verdicts import PROVED
from ocp_traj.results.front import Front, Point
from ocp_traj.results.trajectory import case_fields

OF_PROBLEM, OF_UNION, GIVEN = "the problem's", "of all fronts together", "given"  # where a corner comes from
BEYOND = 0.1  # of the union's range: how far beyond its worst values a reference lies that is made of it; our choice
LABELS = ("name", "source", "export")  # of a task: what is called or written otherwise is the same problem
EFFORT = ("iterations", "evaluations", "solves")  # what methods count in ``front.info``


@dataclass(frozen=True, eq=False)
class FrontComparison:
    """What fronts are worth beside each other. Proved points count, and nothing else.

    Attributes:
        objectives: traded by all, in the order of the first.
        reference, ideal: corners that hypervolume and IGD+ are measured between, for all fronts the same.
        reference_from, ideal_from: where they come from.
        points: proved, in the objectives' units and their own sense ``(n, objectives)``, by name of the front.
        table: a row a front: ``hypervolume``, a share of the box between the corners; ``IGD+``, the mean distance from
            the non-dominated points of all fronts to this one, in shares of the box, counted where it is worse;
            ``points``; ``seconds``; what its method counted.
        coverage: the share of the column's points that a point of the row's front dominates: as good in every
            objective and better in one.
    """

    objectives: tuple[str, ...]
    reference: Mapping[str, float]
    reference_from: str
    ideal: Mapping[str, float]
    ideal_from: str
    points: Mapping[str, Array]
    table: pd.DataFrame
    coverage: pd.DataFrame


def compare_fronts(
    fronts: Mapping[str, Front], reference: Point | None = None, ideal: Point | None = None
) -> FrontComparison:
    """Compares fronts of one problem, case and choice of objectives.

    Args:
        fronts: two or more, by the names they are to have.
        reference: worst values worth having; by default the problem's, else a little beyond the worst of all points.
        ideal: best values; by default the problem's, else the best of all points.

    Raises:
        InputError: the fronts differ in what they are fronts of, in which field is said; or have no proved point.
    """
    require_alike(
        {
            name: {"problem": f.problem.id, "case": case_fields(f.problem), "objectives": f.objectives}
            for name, f in fronts.items()
        }
    )
    first = next(iter(fronts.values()))
    objectives, problem = first.objectives, first.problem
    signs = np.array([1.0 if o.sense == "min" else -1.0 for o in first.traded])
    costs = {name: _costs(front, objectives) * signs for name, front in fronts.items()}
    union = np.concatenate(list(costs.values()))
    if not len(union):
        raise InputError(f"{problem.id}: none of {', '.join(fronts)} has a proved point to compare")
    known = problem.ideal_point(objectives)
    best, best_from = _corner(ideal, known, objectives, union.min(axis=0) * signs)
    low, high = union.min(axis=0), union.max(axis=0)
    far = high + BEYOND * np.where(high > low, high - low, np.maximum(np.abs(high), 1.0))
    worst, worst_from = _corner(reference, problem.reference_point, objectives, far * signs)
    size = (worst - best) * signs
    if not (size > 0.0).all():
        name = objectives[int(np.argmin(size > 0.0))]
        raise InputError(f"the ideal is not better than the reference in {name!r}; move one of them")
    scaled = {name: (values - best * signs) / size for name, values in costs.items()}
    together = np.concatenate(list(scaled.values()))
    target = together[moocore.is_nondominated(together)]
    table = pd.DataFrame(
        [_row(front, scaled[name], target) for name, front in fronts.items()], index=pd.Index(list(fronts), name="run")
    )
    shares = [[_covered(a, b) if a is not b else np.nan for b in scaled.values()] for a in scaled.values()]
    coverage = pd.DataFrame(shares, index=list(fronts), columns=list(fronts))
    return FrontComparison(
        objectives,
        dict(zip(objectives, worst.tolist(), strict=True)),
        worst_from,
        dict(zip(objectives, best.tolist(), strict=True)),
        best_from,
        {name: values * signs for name, values in costs.items()},
        table.dropna(axis=1, how="all"),
        coverage,
    )


def require_alike(asked: Mapping[str, Mapping[str, Any]]) -> None:
    """Raises ``InputError`` unless runs are of one problem, case and choice of objectives, with the difference.

    Args:
        asked: by name, the ``problem``, ``case`` and ``objectives`` of each run, as ``run.json`` has them.
    """
    if len(asked) < 2:
        raise InputError(f"one front is not compared with anything ({', '.join(asked) or 'none'}); give two or more")
    (first, one), *others = ((name, _places(what)) for name, what in asked.items())
    for name, other in others:
        different = [
            f"{place} is {_told(one, place)} in {first} and {_told(other, place)} in {name}"
            for place in sorted({*one, *other})
            if one.get(place) != other.get(place)
        ]
        if different:
            raise InputError(f"these are fronts of different problems: {cut('; '.join(different), 600)}")


def _places(asked: Mapping[str, Any]) -> dict[str, Any]:
    """What a front is of, by dotted place."""
    case = {name: value for name, value in plain(dict(asked["case"])).items() if name not in LABELS}
    return {"problem": asked["problem"], "objectives": sorted(asked["objectives"]), **dict(_flat("case", case))}


def _flat(place: str, value: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(f"{place}.{key}", inner)
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        for index, inner in enumerate(value):
            yield from _flat(f"{place}[{index}]", inner)
    else:
        yield place, value


def _told(asked: Mapping[str, Any], place: str) -> str:
    return repr(asked[place]) if place in asked else "the default"


def _costs(front: Front, objectives: Sequence[str]) -> Array:
    """Objectives of the proved points, in their own sense ``(n, objectives)``."""
    rows = [[p.objectives[name] for name in objectives] for p in front.points if p.verdict == PROVED]
    return np.array(rows, dtype=float).reshape(len(rows), len(objectives))


def _corner(given: Point | None, known: Point, objectives: Sequence[str], otherwise: Array) -> tuple[Array, str]:
    """A corner for all fronts, in the objectives' own sense, and where it comes from."""
    for point, source in ((given, GIVEN), (known, OF_PROBLEM)):
        if isinstance(point, Mapping):
            if all(name in point for name in objectives):
                return np.array([point[name] for name in objectives], dtype=float), source
            if source == GIVEN:
                raise InputError(f"a corner was given for {', '.join(point)}; give one for each of {objectives}")
        elif point is not None:
            values = np.asarray(point, dtype=float)
            if values.shape != (len(objectives),) or not np.isfinite(values).all():
                raise InputError(f"a corner is {values.tolist()}; give one finite number for each of {objectives}")
            return values, source
    return otherwise, OF_UNION


def _row(front: Front, scaled: Array, target: Array) -> dict[str, Any]:
    """The figures of one front, of its points in shares of the box."""
    inside = np.maximum(scaled[(scaled < 1.0).all(axis=1)], 0.0)  # better than the ideal counts as the ideal
    return {
        "method": front.method,
        "seed": front.seed,
        "points": len(scaled),
        "hypervolume": float(moocore.hypervolume(inside, ref=np.ones(scaled.shape[1]))) if len(inside) else 0.0,
        "IGD+": float(moocore.igd_plus(scaled, ref=target)) if len(scaled) else np.inf,
        "seconds": front.seconds,
        **{name: front.info.get(name) for name in EFFORT},
    }


def _covered(one: Array, other: Array) -> float:
    """The share of one front's points that another one's dominate."""
    if not len(other):
        return np.nan
    no_worse = (one[:, None] <= other[None]).all(axis=2)
    better = (one[:, None] < other[None]).any(axis=2)
    return float((no_worse & better).any(axis=0).mean()) if len(one) else 0.0
