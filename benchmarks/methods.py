"""Every method on every problem: fronts of so many seconds, and solves, each cell in a process of its own.

    python -m benchmarks.methods RESULTS [--seconds 20,60] [--cells PROBLEM/METHOD,..] [--solves] [--seed 0] [--table]
                                 [--cpu] [--page]

A cell that has ended is a line of JSON in the file RESULTS at once; a run that is stopped goes on where it was, and
``--table`` prints what there is. PROBLEM or METHOD may be ``*``. Hypervolumes are shares of the one box that is stated
for each problem, from its ideal to its reference point, of points that are proved; ``dropped`` are those that are not
proved or are dominated. A method that gives no front has to say why: its words are then the cell. With ``--cpu``
seconds are of the cell's own process, whatever else the machine does.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ocp_traj as ot
from benchmarks.sections import put
from ocp_traj.errors import OcpTrajError
from ocp_traj.formulation.problem import Problem

EXAMPLE = Path(__file__).parent.parent / "examples" / "tasks" / "ur5-via.toml"
PAGE = """## Every method on every problem

`make bench-methods`, `python -m benchmarks.methods LINES --cpu --page`: hypervolumes are shares of the boxes below, of
points that are proved; *dropped* are those that are not proved, or are dominated. A method that gives no front says
why. Seconds are of the processor; a front is proved after them."""
UNBOUNDED = 100_000  # points and generations: the time ends it
LEEWAY = 600.0  # [s] beyond its time, after which a cell is ended: our choice
SEAM = "weld-bezier seam"


@dataclass(frozen=True)
class Row:
    """A problem, what is traded on it, and the box of its hypervolumes.

    Attributes:
        id: of the problem.
        objectives: traded.
        ideal, reference: of the box, in the objectives' units.
        best: least value of the first objective that is known.
        case: fields of its case.
    """

    id: str
    objectives: tuple[str, ...]
    ideal: tuple[float, ...]
    reference: tuple[float, ...]
    best: float
    case: Mapping[str, str] = field(default_factory=dict)

    def load(self) -> Problem:
        """Builds it."""
        return ot.problems.load(self.id, **self.case)

    @property
    def box(self) -> dict[str, dict[str, float]]:
        """``ideal`` and ``reference`` as ``Front.hypervolume`` takes them."""
        corners = {"ideal": self.ideal, "reference": self.reference}
        return {name: dict(zip(self.objectives, corner, strict=True)) for name, corner in corners.items()}


# Ideals: the problems' ideal points, of ur5-via the least of each objective alone.
ROWS = {
    "hybrid-spline": Row("hybrid-spline", ("time", "energy"), (2.63615, 1565.21), (8.0, 6000.0), 2.4836242),
    "rotor-353": Row("rotor-353", ("time", "effort"), (1.73136, 0.216743), (5.5624563, 0.5618671), 1.7313622),
    "wrist-obstacle": Row("wrist-obstacle", ("time", "clearance"), (1.32814, 0.0955811), (4.0, 0.0), 1.3281365),
    "weld-bezier air move": Row(
        "weld-bezier", ("air_time", "dynamic_effort"), (4.23322, 0.0163711), (9.0, 0.05), 4.2332295,
        {"case": "air-move"},
    ),
    SEAM: Row("weld-bezier", ("air_time", "movement"), (6.97691, 2.28997), (12.0, 25.0), 6.9689165),
    "ur5-via": Row(
        "task", ("time", "effort"), (2.86825, 0.43085), (13.691358, 3.1935421), 2.86825, {"file": str(EXAMPLE)}
    ),
}  # fmt: skip
FRONTS: dict[str, dict[str, Any]] = {
    "trace": {"points": UNBOUNDED},
    "nsga2": {"generations": UNBOUNDED},
    "mopso": {"generations": UNBOUNDED},
    "hmoga": {"generations": UNBOUNDED, "points": UNBOUNDED},
    "memetic": {"generations": UNBOUNDED},
}
SOLVES: dict[str, dict[str, Any]] = {
    "exchange": {},
    "pso": {"method": "pso"},
    "ga": {"method": "ga"},
    "pso --refine": {"method": "pso", "refine": True},
    "ga --refine": {"method": "ga", "refine": True},
}


@dataclass(frozen=True)
class Cell:
    """A method on a problem.

    Attributes:
        kind: ``front`` or ``solve``.
        problem, method: a row, and one of ``FRONTS`` or ``SOLVES``.
        seconds: it is given; a solve takes what it takes.
        seed: of everything random.
        cpu: whether its seconds are of its process.
    """

    kind: str
    problem: str
    method: str
    seconds: float
    seed: int
    cpu: bool = False

    def measure(self) -> dict[str, Any]:
        """Runs it, in this process; of a refusal its reason."""
        if self.cpu:
            time.perf_counter = time.process_time  # all clocks of the package; it runs on one thread
        row = ROWS[self.problem]
        problem = row.load()
        begun, cpu = time.perf_counter(), time.process_time()
        try:
            found = self._front(row, problem) if self.kind == "front" else self._solve(row, problem)
        except OcpTrajError as error:
            found = {"refused": str(error)}
        return {**vars(self), **found, "took": time.perf_counter() - begun, "spent": time.process_time() - cpu}

    def _front(self, row: Row, problem: Problem) -> dict[str, Any]:
        front = ot.pareto(
            problem, row.objectives, method=self.method, seed=self.seed, budget=self.seconds, **FRONTS[self.method]
        )
        keys = (
            "generations",
            "evaluations",
            "moved",
            "solves",
            "solves that gained",
            "ended after",
            "refined individuals",
            "shares of time",
        )
        return {
            "hypervolume": front.hypervolume(**row.box).value,
            "points": len(front),
            "dropped": front.info["dropped"],
            "front's ideal": front.ideal,
            "values": front.values.tolist(),
            "info": {key: front.info[key] for key in keys if key in front.info},
        }

    def _solve(self, row: Row, problem: Problem) -> dict[str, Any]:
        found = ot.solve(problem, objective=row.objectives[0], seed=self.seed, certify=False, **SOLVES[self.method])
        proved = found.audit is not None and found.audit.proved
        value = found.objectives.get(row.objectives[0])
        return {"value": value, "proved": proved, "status": found.status.value, "detail": found.detail}


def cells(kinds: tuple[str, ...], chosen: str, seconds: list[float], seed: int, cpu: bool) -> Iterator[Cell]:
    """The cells that ``--cells`` and ``--seconds`` name."""
    wanted = [pair.partition("/")[::2] for pair in chosen.split(",")]
    for kind in kinds:
        for budget in seconds:
            for problem in ROWS:
                for method in FRONTS if kind == "front" else SOLVES:
                    if any(p in ("*", problem) and m in ("*", method) for p, m in wanted):
                        yield Cell(kind, problem, method, budget, seed, cpu)


def run(cell: Cell) -> dict[str, Any]:
    """A cell in a process of its own."""
    words = [sys.executable, "-m", "benchmarks.methods", "-", "--one", json.dumps(vars(cell))]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=20.0 * cell.seconds + LEEWAY)
    except subprocess.TimeoutExpired:
        return {**vars(cell), "broken": "it did not end"}
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no word"])[-1]
        return {**vars(cell), "broken": f"exit code {done.returncode}: {last}"}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def finished(path: Path) -> dict[Cell, dict[str, Any]]:
    """What the file has, by cell; the last line of one counts."""
    names = Cell.__dataclass_fields__
    lines = path.read_text().splitlines() if path.exists() else []
    found = [json.loads(line) for line in lines if line.endswith("}")]
    return {Cell(**{name: one[name] for name in names}): one for one in found}


def table(results: Mapping[Cell, dict[str, Any]]) -> str:
    """Markdown, with the boxes of the hypervolumes."""
    lines = []
    for kind, methods in (("front", FRONTS), ("solve", SOLVES)):
        for seconds in sorted({cell.seconds for cell in results if cell.kind == kind}):
            some = {cell: one for cell, one in results.items() if (cell.kind, cell.seconds) == (kind, seconds)}
            lines += [
                "",
                f"{kind}, {seconds:g} s",
                "",
                f"| | {' | '.join(methods)} |",
                "|---" * (len(methods) + 1) + "|",
            ]
            for name in ROWS:
                by = {cell.method: _words(one, name) for cell, one in some.items() if cell.problem == name}
                if by:
                    lines.append(f"| {name} | {' | '.join(by.get(method, '') for method in methods)} |")
    lines += ["", "| box | objectives | ideal | reference |", "|---|---|---|---|"]
    for name, row in ROWS.items():
        corners = (", ".join(f"{v:g}" for v in corner) for corner in (row.ideal, row.reference))
        lines.append(f"| {name} | {', '.join(row.objectives)} | {' | '.join(corners)} |")
    return "\n".join(lines).strip()


def _words(one: Mapping[str, Any], name: str) -> str:
    """A cell of the table."""
    for key in ("refused", "broken"):
        if key in one:
            return f"{key}: {one[key]}".replace("|", "/")
    if one["kind"] == "solve":
        value = one["value"]
        above = "" if value is None else f"{value:.6g} ({value / ROWS[name].best - 1.0:+.1e})"
        return f"{above}{'' if one['proved'] else ' not proved'}, {one['took']:.0f} s"
    dropped = ", ".join(f"{n} {why}" for why, n in one["dropped"].items() if n)
    moved = "" if one["info"].get("moved", True) else ", did not move"
    return f"{one['hypervolume']:.4f}, {one['points']} points{moved}" + (f" (dropped {dropped})" if dropped else "")


def main() -> None:
    """Reads the arguments, runs what is not there yet, prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--seconds", default="20,60")
    parser.add_argument("--cells", default="*/*")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--solves", action="store_true", help="solves in place of fronts")
    parser.add_argument("--cpu", action="store_true", help="seconds of the cell's process")
    parser.add_argument("--table", action="store_true", help="run nothing")
    parser.add_argument("--page", action="store_true", help="put the table on the page of results")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(Cell(**json.loads(given.one)).measure()))
        return
    if not given.table:
        kinds = ("solve",) if given.solves else ("front",)
        known = finished(given.results)
        given.results.parent.mkdir(parents=True, exist_ok=True)
        budgets = [float(s) for s in given.seconds.split(",")]
        for cell in cells(kinds, given.cells, budgets, given.seed, given.cpu):
            if cell not in known:
                found = run(cell)
                with given.results.open("a") as file:
                    file.write(json.dumps(found) + "\n")
                    file.flush()
                    os.fsync(file.fileno())
                print(cell.problem, cell.method, f"{cell.seconds:g} s:", _words(found, cell.problem), flush=True)
    found = table(finished(given.results))
    print(found)
    if given.page:
        put("methods", f"{PAGE}\n\n{found}")


if __name__ == "__main__":
    main()
