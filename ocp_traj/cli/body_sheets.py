"""Tables about bodies: which there are, which pairs keep apart, and where they come nearest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ocp_traj.cli.console import Rows

if TYPE_CHECKING:
    from ocp_traj.formulation.collision_table import CollisionTable
    from ocp_traj.formulation.problem import Problem
    from ocp_traj.proof.verdicts import Audit


def collision_words(table: CollisionTable) -> dict[str, Any]:
    """``[collision]`` of a resolved task in a few numbers."""
    return {
        "clearance": table.clearance, "self_clearance": table.self_clearance, "bodies": len(table.bodies or ()),
        "pairs with obstacles": len(table.pairs or ()), "own pairs": len(table.own_pairs),
    }  # fmt: skip


def body_tables(problem: Problem) -> tuple[dict[str, Any], list[Rows]]:
    """Bodies of a problem and the pairs that keep apart, as plain values and as tables; none where there are none."""
    limits = problem.requirements.clearance_constraints
    if not limits:
        return {}, []
    bodies = list({body.name: body for limit in limits for body in limit.bodies}.values())
    names = ["the world", *list(limits[0].robot.model.names)[1:]]
    table = getattr(problem.case, "collision", None)
    left_out = [] if table is None else [" - ".join(pair) for pair in table.touching]
    data = {
        "bodies": [body.to_data(limits[0].robot.model) for body in bodies],
        "clearances": [{"id": limit.id, "clearance": limit.clearance, "pairs": list(limit.labels)} for limit in limits],
        "left_out": left_out,
    }
    rows = [
        [body.name, body.link, body.kind, names[body.joint], body.radius if body.radius > 0.0 else None]
        for body in bodies
    ]
    kept = [[limit.id, limit.clearance, label] for limit in limits for label in limit.labels]
    tables: list[Rows] = [
        ("Bodies", ["name", "of", "kind", "moves with", "radius [m]"], rows),
        ("Kept apart, at every instant", ["limit", "distance [m]", "between"], kept),
    ]
    if left_out:
        tables.append(("Left out: their bodies overlap at most postures", ["between"], [[pair] for pair in left_out]))
    return data, tables


def nearest_bodies(problem: Problem, checked: Audit) -> tuple[list[dict[str, Any]], list[Rows]]:
    """Of each limit on distances which bodies come nearest, and where: as plain values and as a table."""
    found = []
    for limit in problem.requirements.clearance_constraints:
        rows = [row for row in checked.rows if row.limit == limit.id]
        row = min(rows, key=lambda row: row.attained)
        least = min(row.proved_bound for row in rows)
        found.append({
            "limit": limit.id, "between": row.label, "distance": row.attained, "instant": row.instant,
            "all_at_least": least, "verdict": row.verdict,
        })  # fmt: skip
    if not found:
        return [], []
    columns = ["limit", "between", "distance [m]", "t [s]", "all at least [m]", "verdict"]
    cells = [[r["limit"], r["between"], r["distance"], r["instant"], r["all_at_least"], r["verdict"]] for r in found]
    return found, [("Nearest bodies", columns, cells)]
