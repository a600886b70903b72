"""What commands found, as sheets to print: a function a kind of result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ocp_traj.cli.body_sheets import body_tables, collision_words, nearest_bodies
from ocp_traj.cli.console import Rows, Sheet
from ocp_traj.cli.solution_tables import (
    conflict_table,
    conflict_values,
    gain_tables,
    gain_values,
    objective_table,
)
from ocp_traj.display import count

if TYPE_CHECKING:  # a list of problems needs none of them
    from ocp_traj.arrays import Array
    from ocp_traj.formulation.problem import Problem
    from ocp_traj.formulation.summary import Summary
    from ocp_traj.io.export.exported import Exported
    from ocp_traj.io.import_scene import Imported
    from ocp_traj.proof.verdicts import Audit, AuditRow
    from ocp_traj.reproductions.reproduce import Reproduction
    from ocp_traj.results.front import Front, Hypervolume
    from ocp_traj.results.solution import Solution
    from ocp_traj.solvers.payload import LargestPayload

MOST_VARIABLES, SMALL_BLOCK = 60, 4  # with more than the one, only blocks up to the other are printed: our choice


def problem_list(problems: Sequence[Summary]) -> Sheet:
    """All problems, a line each."""
    data = [asdict(problem) for problem in problems]
    rows = [[", ".join(v) if isinstance(v, tuple) else v for v in entry.values()] for entry in data]
    return Sheet({"problems": data}, [("Problems", list(data[0]) if data else [], rows)])


def _notes(problem: Problem) -> list[Rows]:
    """What the case fills in where the paper says nothing."""
    notes = [[note] for note in problem.about.notes]
    title = "Not in the paper" if problem.about.reference else "Understood"
    return [(title, ["this case has"], notes)] if notes else []


def _case(problem: Problem) -> dict[str, Any]:
    """The fields of a problem's case."""
    from ocp_traj.formulation.task import Task

    if isinstance(problem.case, Task):
        robot = problem.case.robot.numbers or {}
        told: dict[str, Any] = {"robot": {"numbers": f"{robot.get('name')}, {len(robot.get('joints', ()))} joints"}}
        if problem.case.collision is not None:
            told["collision"] = collision_words(problem.case.collision)
        return problem.case.fields() | told
    return {f.name: getattr(problem.case, f.name) for f in fields(problem.case)} if is_dataclass(problem.case) else {}


def problem_sheet(problem: Problem) -> Sheet:
    """A problem's case, variables, objectives and limits."""
    case = _case(problem)
    parts = problem.summary()
    data = {
        "problem": problem.id,
        "title": problem.about.title,
        "paper": problem.about.reference,
        "case": case,
        **parts,
        "continuity": problem.requirements.continuity,
        "default_objective": problem.default_objective,
        "notes": list(problem.about.notes),
    }
    words = ". ".join(filter(None, (problem.about.title, problem.about.reference)))
    headline = ": ".join(filter(None, (problem.id, words)))
    tables: list[Rows] = [(headline, ["case field", "value"], list(case.items()))]
    titles = "Variables", "Objectives", "Limits, at every instant", "Point constraints"
    for title, rows in zip(titles, parts.values(), strict=True):
        if rows:
            tables.append((title, list(rows[0]), [list(row.values()) for row in rows]))
    bodies, about_bodies = body_tables(problem)
    return Sheet(data | bodies, tables + about_bodies + _notes(problem))


def _variable_table(problem: Problem, solution: Solution) -> Rows:
    """The decision variables; of very many those of the small blocks only."""
    rows, left = [], 0
    many = problem.size > MOST_VARIABLES
    places = iter(zip(problem.labels, solution.x, problem.units, strict=True))
    for block in problem.variables:
        entries = [list(next(places)) for _ in block.labels]
        if many and len(entries) > SMALL_BLOCK:
            left += len(entries)
        else:
            rows += entries
    title = f"Variables (and {left} more: --json, -o)" if left else "Variables"
    return title, ["name", "value", "unit"], rows


def audit_values(checked: Audit) -> dict[str, Any]:
    """An audit as plain values."""
    return {
        "verdict": checked.verdict,
        "margin": checked.margin,
        "allowance": checked.allowance,
        "parameters": dict(checked.parameters),
        "rows": [vars(r) for r in checked.rows],
    }


def _audit_tables(checked: Audit) -> list[Rows]:
    from ocp_traj.proof.verdicts import CHECKED

    columns = ["limit", "joint", "unit", "bound", "allowance", "attained", "t [s]", "margin", "verdict"]
    proofs = [row for row in checked.rows if row.boxes]
    checks = [row for row in checked.rows if not row.boxes]
    tables: list[Rows] = [
        (
            f"Audit: {checked.verdict}",
            columns,
            [
                [r.limit, r.label, r.unit, r.bound, r.allowance, r.attained, r.instant, r.margin, r.verdict]
                for r in proofs
            ],
        )
    ]
    if checks:
        failed = [row for row in checks if row.verdict != CHECKED]
        title = (
            f"Points, times, variables and continuity: {len(checks) - len(failed)} of {len(checks)} within tolerance"
        )
        worst: Sequence[AuditRow] = failed or sorted(checks, key=lambda row: row.margin)[:1]
        names = ["row", "joint", "unit", "allowed", "found", "t [s]", "verdict"]
        rows = [[r.limit, r.label, r.unit, r.bound, r.attained, r.instant, r.verdict] for r in worst]
        tables.append((title, names, rows))
    return tables


def audit_sheet(checked: Audit, problem: Problem | None = None) -> Sheet:
    """The rows of an audit, and what its problem has that they do not say, such as pairs that are not looked at."""
    notes = () if problem is None else problem.about.notes
    return Sheet(
        audit_values(checked) | {"notes": list(notes)},
        _audit_tables(checked) + ([] if problem is None else _notes(problem)),
    )


def solution_sheet(problem: Problem, solution: Solution) -> Sheet:
    """What a solve found."""
    units = {o.id: o.unit for o in problem.objectives}
    solved = solution.audit is not None
    variables = {name: block.tolist() for name, block in problem.unpack(solution.x).items()} if solved else {}
    found = solution.trajectory
    figures = problem.about.figures(found) if problem.about.figures is not None and found is not None else ()
    data = {
        "problem": problem.id,
        "status": solution.status.value,
        "objectives": dict(solution.objectives),
        "quadrature_errors": solution.quadrature_errors,
        "units": units,
        "variables": variables,
        "seconds": solution.seconds,
        "iterations": solution.iterations,
        "rounds": solution.rounds,
        "rows": solution.row_count,
        "starts": solution.starts,
        "given_up": solution.given_up,
        "moved": solution.moved,
        "conflicts": conflict_values(solution.conflicts),
        "certificate": None
        if solution.certificate is None
        else {**vars(solution.certificate), "gap": solution.certificate.gap},
        "audit": audit_values(solution.audit) if solution.audit is not None else {"verdict": None, "rows": []},
        "detail": solution.detail,
        "interrupted": solution.interrupted,
        "notes": list(problem.about.notes),
        "figures": [{"name": n, "value": v, "unit": u} for n, v, u in figures],
        "gains": gain_values(solution.gains),
    }
    if solution.alternatives:
        data["alternatives"] = [
            {**_outcome(problem, other), "name": name, "chosen": other.x is solution.x}
            for name, other in solution.alternatives.items()
        ]
    if solution.optima:
        data["optima"] = [
            {
                **_outcome(problem, o.solution),
                "homotopy_class": o.homotopy_class, "starts": o.starts, "sampled": o.sampled,
            }
            for o in solution.optima
        ]  # fmt: skip
    effort = f"{solution.seconds:.2f} s, {count(solution.rounds, 'round')}, {count(solution.iterations, 'iteration')}"
    certified = ", certified" if solution.certificate is not None and solution.certificate.certified else ""
    title = f"{problem.id}: {solution.status.value}{certified} in {effort}"
    tables: list[Rows] = []
    if solution.audit is not None:
        tables.append(objective_table(title, solution.objectives, units, solution.quadrature_errors))
        tables.append(_variable_table(problem, solution))
        tables += [*gain_tables(solution.gains), *_audit_tables(solution.audit)]
        data["nearest_bodies"], nearest = nearest_bodies(problem, solution.audit)
        tables += nearest
    elif solution.conflicts:
        tables.append(conflict_table(title, solution.conflicts))
    if figures:
        tables.append(("Figures", ["figure", "value", "unit"], [[n, f"{v:.5g}", u] for n, v, u in figures]))
    names = [f"{o.id} [{o.unit}]" for o in problem.objectives]
    if solution.alternatives:
        lines = [
            [name, *_outcome_cells(problem, other), other.x is solution.x]
            for name, other in solution.alternatives.items()
        ]
        tables.append(("Alternatives", ["alternative", *names, "verdict", "chosen"], lines))
    if solution.optima:
        lines = [
            [i, *_outcome_cells(problem, o.solution), o.starts, o.sampled, o.homotopy_class]
            for i, o in enumerate(solution.optima, 1)
        ]
        sampled = sum(o.sampled for o in solution.optima)
        title = (
            f"{len(lines)} local optima, best first; {sampled} of the problem sampled at its first instants led to them"
        )
        tables.append((title, ["optimum", *names, "verdict", "starts", "sampled", "homotopy class"], lines))
    return Sheet(data, tables + _notes(problem))


def _outcome(problem: Problem, solution: Solution) -> dict[str, Any]:
    """One of several solutions as plain values."""
    solved = solution.audit is not None
    return {
        "status": solution.status.value,
        "f": solution.f,
        "objectives": dict(solution.objectives),
        "verdict": _verdict(solution),
        "variables": {k: block.tolist() for k, block in problem.unpack(solution.x).items()} if solved else {},
        "case": dict(solution.trajectory.case) if solution.trajectory is not None else {},
    }


def _outcome_cells(problem: Problem, solution: Solution) -> list[Any]:
    values = [solution.objectives.get(o.id) for o in problem.objectives]
    return [*(None if v is None else f"{v:.7g}" for v in values), _verdict(solution) or solution.status.value]


def _verdict(solution: Solution) -> str | None:
    return solution.audit.verdict if solution.audit is not None else None


def front_sheet(front: Front, volume: Hypervolume, folder: Path) -> Sheet:
    """A front, as saved."""
    table = front.table
    hidden = {f"{label} [{unit}]" for label, unit in zip(front.problem.labels, front.problem.units, strict=True)}
    columns = [name for name in table.columns if name not in hidden]
    rows = [[index, *row] for index, row in zip(table.index, table[columns].to_numpy(dtype=object), strict=True)]
    knee = front.knee()
    data = {
        "problem": front.problem.id,
        "method": front.method,
        "objectives": list(front.objectives),
        "points": len(front),
        "seconds": front.seconds,
        "seed": front.seed,
        "hypervolume": volume.to_dict(),
        "spread": front.spread(),
        "knee": knee,
        "info": dict(front.info),
        "notes": list(front.problem.about.notes),
        "run": str(folder),
        "picture": str(folder / "front.png"),
    }
    if front.certificate is not None:
        data["certificate"] = front.certificate.to_dict()
    own = " (from its own ideal: not comparable)" if volume.own_ideal else ""
    title = (
        f"{front.problem.id}: {len(front)} proved points by {front.method} in {front.seconds:.1f} s; "
        f"hypervolume {volume.value:.4f}{own}, spread {front.spread():.3f}, knee at point {knee}"
    )
    return Sheet(data, [(title, ["point", *columns], rows), *_notes(front.problem)])


def front_remarks(front: Front) -> Iterator[str]:
    """What a reader of a front should not overlook."""
    if front.certificate is not None:
        yield front.certificate.explain()
    if front.info.get("moved") is False:
        yield f"{front.method} found nothing better than its first generation, which is what this front is made of"
    if front.info.get("conflict") is False:
        yield f"{' and '.join(front.objectives)} do not conflict here: one trajectory is best in both"
    for name, size in front.info.get("unresolved", {}).items():
        unit = front.problem.objective(name).unit
        yield f"there are no more points: neighbours are within {size:g} {unit} in {name}, and it is told no finer"
    refined, known = front.info.get("points to refine", 0), front.info.get("genetic front", 0)
    if refined < known:
        yield f"{refined} points of the genetic front's {known} were to be refined; --points refines more"
    shares = {name: one["points of the front"] for name, one in front.info.get("alternatives", {}).items()}
    if shares:
        words = ", ".join(f"{count(n, 'point')} of {name}" for name, n in shares.items())
        yield f"the front is of all alternatives: {words}"


def payload_sheet(found: LargestPayload) -> Sheet:
    """The largest payload and what stops it."""
    data = {
        "payload": found.payload,
        "unit": "kg",
        "binding": found.binding,
        "instant": found.instant,
        "kind": found.kind,
        "argument": found.argument,
        "verdict": found.audit.verdict if found.audit is not None else None,
    }
    names = ["payload [kg]", "binding limit", "instant [s]", "holds for", "because"]
    row = [f"{found.payload:.6f}", found.binding, found.instant, found.kind, found.argument]
    title = "Largest payload" + (" found" if found.kind == "within a time" else "")
    return Sheet(data, [(title, names, [row])])


def export_sheet(found: Exported) -> Sheet:
    """What was exported, and what is proved of it."""
    data = {
        "written": str(found.path),
        "format": found.format,
        "files": [str(path) for path in found.paths],
        "verdict": found.verdict,
        "about": dict(found.about),
    }
    rows = [[name, f"{value:.9g}" if isinstance(value, float) else value] for name, value in found.about.items()]
    title = f"{found.format}: {found.verdict} as it will be played"
    return Sheet(data, [(title, ["of the motion", "value"], rows)] if rows else [])


def plan_sheet(path: Array, joints: Sequence[str], target: Path) -> Sheet:
    """A planned path."""
    data = {"written": str(target), "joints": list(joints), "points": path.tolist()}
    rows: list[list[float]] = path.round(4).tolist()
    return Sheet(data, [(f"{target.name}: {len(path)} points", list(joints), rows)])


def import_sheet(found: Imported, target: Path) -> Sheet:
    """What a task was made of."""
    data = {"written": str(target), **asdict(found)}
    del data["text"]
    rows: list[list[Any]] = [
        ["bodies in the world", found.bodies],
        ["bodies held", found.held],
        ["joints locked", ", ".join(found.locked) or "none"],
    ]
    return Sheet(data, [(target.name, ["imported", ""], rows)])


def reproduction_sheet(found: Reproduction) -> Sheet:
    """A paper's tables beside ours, the figures, and the verdicts at the end."""
    from ocp_traj.reproductions.readable import cell, readable

    tables: list[Rows] = []
    for title, table in [*found.tables.items(), ("Verdicts", found.summary)]:
        text = readable(table)
        tables.append((title, list(text.columns), text.to_numpy(dtype=object).tolist()))
    figures = [[one.listed.number, one.listed.shows, cell(one.made), one.words] for one in found.figures]
    tables.insert(-1, ("Figures", ["figure", "shows", "made", "of, or why not"], figures))
    return Sheet(found.to_dict(), tables)
