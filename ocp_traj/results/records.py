"""Records of finished work, plain JSON values: what a journal holds, and what a front can be made of.

Every record has a ``kind`` and ``points``, each with its variables ``x (n,)`` and, but in a population, its objectives
and the verdict of its audit. Numbers come back to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from numpy.typing import ArrayLike

from ocp_traj.files import plain
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.proof.verdicts import PROVED, Audit
from ocp_traj.results.front import Front
from ocp_traj.results.solution import Solution
from ocp_traj.results.solution_records import of_solution
from ocp_traj.transcription.nlp import Status

SOLVE, START, OPENING, POINTS = "solve", "start", "opening", "points"
POPULATION, FRONT = "population", "front"
KEY = "key"  # of a record: the key of the job that it answers

Record = Mapping[str, Any]
Found = Callable[[Record], None]
"""Called with a record of each finished piece of work, before the next is begun."""


def ignore(record: Record) -> None:
    """Keeps nothing."""


def of_solve(scalarisation: Scalarisation, solution: Solution, as_found: Solution | None = None) -> Record:
    """One solve, failed ones too: what was asked and all that came of it, so that it need not be done again.

    Where others have proved the solution later, ``as_found`` is it without a proof, as its solver has found it.
    """
    point = {
        "x": solution.x,
        "objectives": solution.objectives,
        "verdict": solution.audit.verdict if solution.audit is not None else None,
    }
    record = _record(
        SOLVE,
        [point],
        scalarisation={"kind": type(scalarisation).__name__, **vars(scalarisation)},
        status=solution.status.name,
        detail=solution.detail,
        f=solution.f,
        iterations=solution.iterations,
        rounds=solution.rounds,
        seconds=solution.seconds,
        **({KEY: solution.key} if solution.key else {}),
    )
    return {**record, "solution": of_solution(as_found or solution)}


def of_start(scalarisation: Scalarisation, solution: Solution, first: Any = None) -> Record:
    """A solve on the way to one that counts, such as a random start, with what its first NLP has ended with."""
    return {**of_solve(scalarisation, solution), "kind": START, "points": [], "first": first}


def of_opening(first: Any) -> Record:
    """A random start that was not followed beyond its first NLP."""
    return {"kind": OPENING, "points": [], "first": first}


def of_points(points: Iterable[tuple[ArrayLike, Mapping[str, float], Audit]]) -> Record:
    """Points that no solve has found, such as dilations of others: variables ``(n,)``, objectives, and audit."""
    found = [{"x": x, "objectives": objectives, "verdict": audit.verdict} for x, objectives, audit in points]
    return _record(POINTS, found)


def of_population(xs: Iterable[ArrayLike]) -> Record:
    """The best of a population so far ``(n,)`` each, not yet audited: it takes the place of earlier ones."""
    return _record(POPULATION, [{"x": x} for x in xs])


def of_front(front: Front) -> Record:
    """A front, as its run ended."""
    chosen = front.info.get("alternative")
    points = [
        {"x": p.x, "objectives": p.objectives, "verdict": p.verdict}
        | ({"alternative": p.alternative} if p.alternative and chosen is None else {})
        for p in front.points
    ]
    return _record(FRONT, points, **({} if chosen is None else {"alternative": chosen}))


def usable(record: Record) -> bool:
    """Whether a front can be made of its points: not of those of a solve that failed."""
    return bool(record["points"]) and (record["kind"] != SOLVE or Status[record["status"]].ok)


def is_proved(record: Record) -> bool:
    """Whether a point of it is."""
    return any(point.get("verdict") == PROVED for point in record["points"])


def _record(kind: str, points: list[dict[str, Any]], **more: Any) -> Record:
    found: Record = plain({"kind": kind, "points": points, **more})
    return found
