"""A solution as plain JSON values and back, to the last bit: what a worker sends, and what a journal answers with.

JSON has no infinity and no NaN: those are texts here, ``"inf"``, ``"-inf"`` and ``"nan"``, which ``float`` reads. A row
that several lists share is written once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from math import isfinite
from typing import Any

import numpy as np
import pandas as pd

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.rows import Conflict, Row
from ocp_traj.proof.verdicts import Audit, AuditRow
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.transcription.instants import Instant
from ocp_traj.transcription.nlp import Status

Plain = dict[str, Any]

_ROW = [field.name for field in fields(Row)]
_AUDIT_ROW = [field.name for field in fields(AuditRow)]
_VECTORS = ("slope", "anchor", "sweep_slope")  # of an instant
_FLOATS = ("f", "violation", "seconds")
_AS_IS = frozenset({str, int, bool, type(None)})  # asked of each item before it is a call of its own: most are one
_PLAIN = ("name", "iterations", "row_count", "detail", "starts", "rounds", "moved", "given_up", "interrupted")


def exact(value: Any) -> Any:
    """A value as JSON holds it and ``float`` reads it back, numbers that are not finite as texts."""
    kind = type(value)
    if kind is float:
        return value if isfinite(value) else repr(value)
    if kind is np.ndarray:
        return value.tolist() if np.isfinite(value).all() else exact(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): item if _is_plain(item) else exact(item) for key, item in value.items()}
    if kind is list or kind is tuple:
        return [item if _is_plain(item) else exact(item) for item in value]
    if isinstance(value, np.generic):
        return exact(value.item())
    return value


def _is_plain(item: Any) -> bool:
    """Whether ``exact`` has nothing to do: what most items are, and cheaper to ask than a call of its own."""
    kind = type(item)
    return kind in _AS_IS or (kind is float and isfinite(item))


def of_solution(solution: Solution) -> Plain:
    """All that a local solver's solution says, but its trajectory, which its variables stand for.

    What later work adds to a solution, such as its gains, is not in it.
    """
    rows: dict[Row, int] = {}
    for row in (*solution.rows, *solution.multipliers, *solution.slacks):
        rows.setdefault(row, len(rows))
    conflicts = [[_values(c.row, _ROW), c.value, c.bound, c.excess, c.words] for c in solution.conflicts]
    found = {
        **{name: getattr(solution, name) for name in (*_FLOATS, *_PLAIN)},
        "status": solution.status.name,
        "x": solution.x,
        "objectives": solution.objectives,
        "table": [_values(row, _ROW) for row in rows],
        "row_multipliers": solution.row_multipliers,
        "bound_multipliers": solution.bound_multipliers,
        "multipliers": _column(solution.multipliers, rows),
        "slacks": _column(solution.slacks, rows),
        "conflicts": conflicts,
        "instants": [_instant(instant) for instant in solution.instants],
        "audit": None if solution.audit is None else _audit(solution.audit),
        "instead_of": None if solution.instead_of is None else of_solution(solution.instead_of),
        "history": None if solution.history is None else _table(solution.history),
    }
    return {**exact(found), "rows": [rows[row] for row in solution.rows]}


def solution_of(found: Mapping[str, Any], problem: Problem, trajectory: bool = True) -> Solution:
    """The solution that ``of_solution`` has told of, of the same problem; its trajectory only if wanted."""
    table = [Row(*values) for values in found["table"]]
    x = _vector(found["x"])
    assert x is not None
    audit = None if found["audit"] is None else _audit_of(found["audit"])
    instead = found["instead_of"]
    scalars: Plain = {name: float(found[name]) for name in _FLOATS} | {name: found[name] for name in _PLAIN}
    return Solution(
        **scalars,
        status=Status[found["status"]],
        x=x,
        objectives={name: float(value) for name, value in found["objectives"].items()},
        rows=tuple(table[i] for i in found["rows"]),
        row_multipliers=_vector(found["row_multipliers"]),
        bound_multipliers=_vector(found["bound_multipliers"]),
        multipliers=_mapping(found["multipliers"], table),
        slacks=_mapping(found["slacks"], table),
        conflicts=tuple(_conflict(*values) for values in found["conflicts"]),
        instants=tuple(instant_of(entry) for entry in found["instants"]),
        trajectory=trajectory_of(problem, x) if trajectory and audit is not None else None,
        audit=audit,
        instead_of=None if instead is None else solution_of(instead, problem, trajectory=False),
        history=None if found.get("history") is None else _table_of(found["history"]),
    )


def instant_of(entry: Mapping[str, Any]) -> Instant:
    """An instant from its plain values."""
    more: Plain = {name: _vector(entry[name]) for name in _VECTORS if name in entry}
    if "rows" in entry:
        more["rows"] = tuple(entry["rows"])
    if "columns" in entry:
        more["columns"] = np.array(entry["columns"], dtype=np.intp)
    return Instant(**{**entry, **more})


def _instant(instant: Instant) -> Plain:
    return {name: value for name, value in vars(instant).items() if value is not None}


def _conflict(row: Sequence[Any], value: Any, bound: Any, excess: Any, words: str) -> Conflict:
    return Conflict(Row(*row), float(value), float(bound), float(excess), words)


def _values(value: Any, names: Sequence[str]) -> list[Any]:
    return [getattr(value, name) for name in names]


def _column(values: Mapping[Row, float], rows: Iterable[Row]) -> list[float | None]:
    """A value a row; none at all for no values."""
    return [values.get(row) for row in rows] if values else []


def _mapping(column: Sequence[Any], table: Sequence[Row]) -> dict[Row, float]:
    return {row: float(value) for row, value in zip(table, column, strict=bool(column)) if value is not None}


def _vector(values: Sequence[Any] | None) -> Array | None:
    return None if values is None else np.array([float(value) for value in values])


def _table(table: pd.DataFrame) -> Plain:
    columns = {str(name): table[name].tolist() for name in table}
    return {"index": table.index.tolist(), "name": table.index.name, "columns": columns}


def _table_of(found: Mapping[str, Any]) -> pd.DataFrame:
    columns = {
        name: [float(value) if isinstance(value, str) else value for value in values]
        for name, values in found["columns"].items()
    }
    return pd.DataFrame(columns, index=pd.Index(found["index"], name=found["name"]))


def _audit(audit: Audit) -> Plain:
    rows = [_values(row, _AUDIT_ROW) for row in audit.rows]
    return {"allowance": audit.allowance, "parameters": audit.parameters, "rows": rows}


def _audit_of(found: Mapping[str, Any]) -> Audit:
    numbers = ("bound", "attained", "instant", "proved_bound", "margin", "allowance")
    rows = []
    for values in found["rows"]:
        entry = dict(zip(_AUDIT_ROW, values, strict=True))
        sweep = entry["sweep"]
        entry |= {name: float(entry[name]) for name in numbers}
        rows.append(AuditRow(**{**entry, "sweep": None if sweep is None else float(sweep)}))
    parameters = {name: float(value) for name, value in found["parameters"].items()}
    return Audit(tuple(rows), float(found["allowance"]), parameters)
