"""Tables of a solution beside its objectives and its audit: what limits cost, which are in conflict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ocp_traj.cli.console import Rows

if TYPE_CHECKING:
    from ocp_traj.formulation.rows import Conflict
    from ocp_traj.results.limit_gains import LimitGain

MOST_GAINS = 15  # rows of the table of what limits cost: our choice


def objective_table(
    title: str, values: Mapping[str, float], units: Mapping[str, str], errors: Mapping[str, float]
) -> Rows:
    """Objectives, those that are integrals with the error of their rule."""
    rows = [[k, f"{v:.9g}", f"+- {errors[k]:.1e}" if k in errors else "", units[k]] for k, v in values.items()]
    if not errors:
        return title, ["objective", "value", "unit"], [[k, v, unit] for k, v, _, unit in rows]
    return title, ["objective", "value", "quadrature error", "unit"], rows


def gain_values(gains: tuple[LimitGain, ...]) -> list[dict[str, Any]]:
    """What limits cost, as plain values."""
    return [vars(gain) for gain in gains]


def gain_tables(gains: tuple[LimitGain, ...]) -> list[Rows]:
    """What limits cost, the largest of them."""
    shown = gains[:MOST_GAINS]
    if not shown:
        return []
    left = len(gains) - len(shown)
    more = f" ({left} more: --json)" if left else ""
    title = f"What limits cost: gain where one is 1 % wider, to first order{more}"
    rows = [
        [
            g.limit, g.label, f"{g.gain:.3g} {g.unit}".removesuffix(" -") if g.gain else "", f"{g.slope:.3g}",
            f"{g.unit}/({g.limit_unit})", g.rows,
        ]
        for g in shown
    ]  # fmt: skip
    return [(title, ["limit", "joint", "gain per 1 %", "gain per unit", "unit", "rows"], rows)]


def conflict_values(conflicts: tuple[Conflict, ...]) -> list[dict[str, Any]]:
    """Limits in conflict, as plain values."""
    return [
        {
            "limit": c.row.limit, "label": c.row.label, "value": c.value, "bound": c.bound, "excess": c.excess,
            "share": c.share, "unit": c.row.unit,
        }
        for c in conflicts
    ]  # fmt: skip


def conflict_table(title: str, conflicts: tuple[Conflict, ...]) -> Rows:
    """Limits in conflict, and by how much each is off."""
    rows = [
        [
            c.row.limit, c.row.label, c.value, c.bound, c.excess,
            None if c.share is None else f"{100.0 * c.share:.3g}", c.row.unit,
        ]
        for c in conflicts
    ]  # fmt: skip
    return title, ["limit", "joint", "value", "allowed", "excess", "excess [%]", "unit"], rows
