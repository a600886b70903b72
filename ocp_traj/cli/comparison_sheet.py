"""Compared fronts as a sheet to print."""

from __future__ import annotations

from math import isfinite
from typing import Any

from ocp_traj.cli.console import Sheet
from ocp_traj.results.front_comparison import FrontComparison


def comparison_sheet(compared: FrontComparison, problem: str) -> Sheet:
    """Fronts side by side, and the share of each that every other one dominates."""
    names = list(compared.points)
    rows = zip(names, compared.table.to_dict("records"), strict=True)
    runs: list[dict[str, Any]] = [
        {"run": name, **{str(column): _plain(value) for column, value in row.items()}} for name, row in rows
    ]
    shares = {a: {b: _plain(float(compared.coverage[b][a])) for b in names if b != a} for a in names}
    data = {
        "problem": problem, "objectives": list(compared.objectives),
        "reference": dict(compared.reference), "reference_from": compared.reference_from,
        "ideal": dict(compared.ideal), "ideal_from": compared.ideal_from,
        "runs": [{("igd_plus" if k == "IGD+" else k): v for k, v in run.items()} for run in runs],
        "coverage": shares,
    }  # fmt: skip
    corners = "; ".join(
        f"{what} {', '.join(f'{name} {value:.6g}' for name, value in point.items())} ({source})"
        for what, point, source in (
            ("reference", compared.reference, compared.reference_from),
            ("ideal", compared.ideal, compared.ideal_from),
        )
    )
    return Sheet(
        data,
        [
            (f"{problem}: {len(runs)} fronts; {corners}", list(runs[0]), [list(run.values()) for run in runs]),
            (
                "share of the column's points that the row's dominate",
                ["run", *names],
                [[a, *(shares[a].get(b) for b in names)] for a in names],
            ),
        ],
    )


def _plain(value: Any) -> Any:
    """A value as JSON has it: nothing where there is no number."""
    if isinstance(value, float):
        return None if not isfinite(value) else int(value) if value.is_integer() and abs(value) > 1.0 else value
    return value
