"""What a page holds, as plain JSON values: what was asked, fronts, motions, limits, margins, robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ocp_traj.files import plain
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, PointConstraint, Requirements
from ocp_traj.formulation.standard import units_of
from ocp_traj.report.kinematics import robot_data
from ocp_traj.report.packing import packed
from ocp_traj.report.paper_points import paper_points
from ocp_traj.report.sampled import clearance_samples, limit_samples
from ocp_traj.report.sources import Point, Source
from ocp_traj.version import __version__

FORMAT = "ocp-traj/report/1"
NUMBERS = ("bound", "attained", "instant", "proved_bound", "margin", "allowance")  # of a row of an audit
VERDICTS = ("proved", "checked", "undecided", "violated")


def page_data(sources: Sequence[Source]) -> dict[str, Any]:
    """All that a page shows. Arrays are packed: control points exactly, sampled values in four bytes each."""
    titles = list(dict.fromkeys(source.problem.about.title or source.problem.id for source in sources))
    return {
        "format": FORMAT,
        "title": "; ".join(titles),
        "version": __version__,
        "verdicts": VERDICTS,
        "sets": [_set(source) for source in sources],
    }


def _set(source: Source) -> dict[str, Any]:
    problem, front = source.problem, source.front
    traded = [] if front is None else list(front.objectives)
    plain_ids = [o.id for o in problem.objectives if o.terms is None or o.id in traded]
    rows, points = _rows(source.points), source.points
    motions = [point.trajectory for point in points]
    requirements = problem.requirements
    samples: dict[str, list[Any]] = {
        limit.id: [packed(values, "f4") for values in limit_samples(motions, requirements, limit)]
        for limit in requirements.path_constraints
        if limit.order is None
    }
    for clearance in requirements.clearance_constraints:
        found = clearance_samples(motions, clearance)
        samples[clearance.id] = [
            {"least": packed(least, "f4"), "row": packed(row, "f4")} for least, row in found
        ]  # fmt: skip
    return {
        "name": source.name,
        "problem": problem.id,
        "title": problem.about.title or problem.id,
        "reference": problem.about.reference,
        "curve": problem.about.curve_kind,
        "notes": list(problem.about.notes),
        "command": source.command,
        "request": dict(source.request),
        "versions": dict(source.versions),
        "isRun": front is not None,
        "objectives": [
            {"id": o.id, "unit": o.unit, "sense": o.sense, "traded": o.id in traded}
            for o in problem.objectives
            if o.id in plain_ids
        ],
        "traded": traded,
        "knee": None if front is None else front.knee(),
        "ends": [] if front is None else sorted({int(i) for i in np.argmin(front.normalised(), axis=0)}),
        "paper": {} if front is None else _paper(problem, front.info, traded),
        "joints": list(requirements.joints),
        "units": [list(units_of(requirements.joint_units, order)) for order in range(len(ORDERS))],
        "limits": _limits(requirements),
        "places": _places(requirements),
        "variables": {
            "labels": list(problem.labels), "units": list(problem.units),
            "blocks": [v.id for v in problem.variables for _ in v.labels],
            "lower": packed(problem.lower), "upper": packed(problem.upper),
        },
        "rows": [list(key) for key in rows],
        "robot": robot_data(problem),
        "points": [
            _point(point, plain_ids, rows, {name: values[index] for name, values in samples.items()})
            for index, point in enumerate(points)
        ],
    }  # fmt: skip


def _paper(problem: Problem, info: Mapping[str, Any], traded: Sequence[str]) -> dict[str, dict[str, float]]:
    """The paper's points that have all the traded objectives."""
    told = {
        label: {name: float(values[name]) for name in traded}
        for label, values in info.get("paper", {}).items()
        if isinstance(values, Mapping) and all(name in values for name in traded)
    }
    return {**paper_points(problem.id, traded), **told}


def _limits(requirements: Requirements) -> list[dict[str, Any]]:
    """Every limit that holds at every instant, in the order of the audit."""
    found = [
        {
            "id": limit.id, "eq": limit.eq, "order": limit.order, "labels": list(limit.labels),
            "units": list(limit.units), "lower": plain(limit.lower), "upper": plain(limit.upper),
            "scale": plain(limit.scale), "kind": "values",
        }
        for limit in requirements.path_constraints
    ]  # fmt: skip
    for clearance in requirements.clearance_constraints:
        found.append({
            "id": clearance.id, "eq": clearance.eq, "order": None, "labels": list(clearance.labels),
            "units": list(clearance.units), "parameter": clearance.parameter, "kind": "clearance",
            "lower": [clearance.clearance] * len(clearance.labels), "upper": [None] * len(clearance.labels),
            "scale": plain(clearance.scale),
        })  # fmt: skip
    return found


def _places(requirements: Requirements) -> list[dict[str, Any]]:
    """Where on the curve the joints are given: via points and ends."""
    return [
        {"id": point.id, "eq": point.eq, "at": [list(at) for at in point.at]}
        for point in requirements.point_constraints
        if _is_place(requirements, point)
    ]


def _is_place(requirements: Requirements, point: PointConstraint) -> bool:
    return requirements.order(point) == 0


def _rows(points: Sequence[Point]) -> dict[tuple[str, str, str], int]:
    """Limit, label and unit of every row of the audits, numbered as they come."""
    keys = dict.fromkeys((row.limit, row.label, row.unit) for point in points for row in point.audit.rows)
    return {key: number for number, key in enumerate(keys)}


def _point(
    point: Point, objectives: Sequence[str], rows: Mapping[tuple[str, str, str], int], samples: Mapping[str, Any]
) -> dict[str, Any]:
    curve, audit = point.trajectory.curve, point.audit
    return {
        "name": point.name,
        "verdict": audit.verdict,
        "words": audit.explain(),
        "margin": plain(float(audit.margin)),
        "objectives": [plain(float(point.objectives[name])) if point.objectives else None for name in objectives],
        "parameters": dict(point.trajectory.parameters),
        "x": None if point.x is None else packed(point.x),
        "durations": packed(curve.durations),
        "degrees": list(curve.degrees),
        "control": packed(np.concatenate(curve.control_points)),
        "samples": dict(samples),
        "row": [rows[row.limit, row.label, row.unit] for row in audit.rows],
        "verdicts": "".join(str(VERDICTS.index(row.verdict)) for row in audit.rows),
        "numbers": packed([[getattr(row, name) for name in NUMBERS] for row in audit.rows]),
    }
