"""A paper's numbers beside ours: each with the precision the paper prints, and a verdict.

A printed number stands for every number that rounds to it. Ours agrees where it is one of these, widened by what the
rounding of the paper's own inputs can do to it; where it is not, but a reading that the paper itself supports is, the
printed one is an erratum; all else differs. Where the paper prints no number, what follows from its words, or what
other code found, stands in a column of its own: the paper's holds what the paper prints, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from decimal import Decimal
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.reproductions.gallery import PaperFigure

FORMAT = "ocp-traj/reproduction/2"
AGREES, ERRATUM, DIFFERS = "agrees", "erratum", "differs"
VERDICTS = (AGREES, ERRATUM, DIFFERS)
LAST_BITS = 1e-9  # of the tolerance: a number half-way between two prints rounds to either


@dataclass(frozen=True)
class Comparison:
    """One number of ours beside the paper's, or beside what must come out where the paper prints none.

    Attributes:
        table, item: where the paper has it, or what it is about.
        paper: as printed [unit]; None where the paper prints no such number.
        expected: in that case what must come out [unit], else None.
        ours: our number [unit].
        unit: of all.
        tolerance: half a unit of the last printed digit, and what the rounding of the paper's inputs adds [unit].
        verdict: of ``VERDICTS``.
        note: what explains it.
        printed: the paper's number with all its digits; empty where it prints none.
    """

    table: str
    item: str
    paper: float | None
    expected: float | None
    ours: float
    unit: str
    tolerance: float
    verdict: str
    note: str = ""
    printed: str = ""


@dataclass(frozen=True)
class Erratum:
    """Something in the paper that must read otherwise, and why."""

    where: str
    printed: str
    should_read: str
    reason: str


@dataclass(frozen=True)
class Run:
    """One solution: of a solver of ours, or what the paper reports of its own.

    Attributes:
        source: ``ours`` or ``paper``; of the paper's all numbers are as printed.
        method: solver and what it minimised.
        variant: of the problem.
        seed: of its randomness.
        objectives: values by ``id [unit]``.
        seconds: spent.
        evaluations: individuals of a genetic algorithm, iterations of IPOPT.
        verdict: of the audit.
    """

    source: str
    method: str
    variant: str
    seed: int | None
    objectives: Mapping[str, float]
    seconds: float | None
    evaluations: int | None
    verdict: str = ""


@dataclass(frozen=True)
class Reproduction:
    """A paper's results beside ours; ``extra`` holds tables of another kind, by title; ``figures`` are all it has.

    One that is handed on while it is made is not ``finished``.
    """

    problem: str
    reference: str
    comparisons: tuple[Comparison, ...]
    errata: tuple[Erratum, ...]
    runs: tuple[Run, ...] = field(default_factory=tuple)
    extra: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    figures: tuple[PaperFigure, ...] = ()
    finished: bool = True

    @property
    def summary(self) -> pd.DataFrame:
        """Verdicts counted, one line a table."""
        frame = pd.DataFrame([(c.table, c.verdict) for c in self.comparisons], columns=["table", "verdict"])
        counts = frame.groupby(["table", "verdict"], sort=False).size().unstack(fill_value=0)
        return counts.reindex(columns=list(VERDICTS), fill_value=0).rename_axis(columns=None).reset_index()

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The comparisons of each table, the extra tables, then ``Runs`` and ``Errata``."""
        tables: dict[str, pd.DataFrame] = {}
        for name in dict.fromkeys(c.table for c in self.comparisons):
            tables[name] = _table([c for c in self.comparisons if c.table == name])
        tables |= self.extra
        tables["Runs"] = pd.DataFrame([_flat(run) for run in self.runs])
        tables["Errata"] = pd.DataFrame([asdict(erratum) for erratum in self.errata])
        return tables

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON values."""
        counts = {row["table"]: {v: int(row[v]) for v in VERDICTS} for row in self.summary.to_dict("records")}
        extra = {title: table.to_dict("records") for title, table in self.extra.items()}
        figures = [figure.to_dict() for figure in self.figures]
        whole = asdict(replace(self, extra={}, figures=()))
        return {"format": FORMAT, **whole, "extra": extra, "figures": figures, "summary": counts}


def _table(comparisons: Sequence[Comparison]) -> pd.DataFrame:
    """One table's comparisons; the paper's numbers with all their digits, whatever their size, and no empty column."""
    rows = pd.DataFrame([asdict(c) for c in comparisons]).drop(columns=["table", "printed"])
    expected = [None if c.expected is None else f"{c.expected:.12g}" for c in comparisons]
    for column, texts in (("paper", [c.printed or None for c in comparisons]), ("expected", expected)):
        if all(text is None for text in texts):
            rows = rows.drop(columns=column)
        else:
            rows[column] = pd.Series(texts, dtype=object)
    return rows


def _flat(run: Run) -> dict[str, Any]:
    row = {"source": run.source, "method": run.method, "variant": run.variant, "seed": run.seed, **run.objectives}
    return {**row, "seconds [s]": run.seconds, "evaluations": run.evaluations, "verdict": run.verdict}


def half_unit(printed: str) -> float:
    """Half a unit of the last digit: 0.005 for "1.30"."""
    exponent = Decimal(printed).as_tuple().exponent
    assert isinstance(exponent, int), printed
    return float(Decimal(5).scaleb(exponent - 1))


def rounding_effect(function: Callable[[Array], ArrayLike], x: ArrayLike, half: float) -> Array:
    """How far f can be off, to first order, where each entry of x is rounded: sum_i |df/dx_i| half.

    Args:
        function: f, of any shape.
        x: as printed ``(n,)``.
        half: half a unit of the last digit of x.
    """
    point = np.asarray(x, dtype=float)
    steps = half * np.eye(len(point))
    ends = [(np.asarray(function(point + step)), np.asarray(function(point - step))) for step in steps]
    return np.asarray(sum(np.abs(after - before) / 2.0 for after, before in ends))


def compare(
    table: str,
    item: str,
    printed: str,
    ours: float,
    unit: str = "",
    *,
    slack: float = 0.0,
    tolerance: float | None = None,
    should_read: str | None = None,
    note: str = "",
) -> Comparison:
    """Compares a printed number, digit by digit as it stands in the paper, with ours.

    Args:
        table: as in ``Comparison``.
        item: as in ``Comparison``.
        printed: in the paper.
        ours: our number [unit].
        unit: of both.
        slack: on top of half a unit of the last digit, such as a ``rounding_effect``.
        tolerance: in place of both.
        should_read: what is taken for meant, if the printed number is no reading of ours but this is.
        note: what explains it.
    """

    def is_ours(text: str, allowed: float) -> bool:
        return bool(abs(ours - float(text)) <= allowed * (1.0 + LAST_BITS))

    allowed = half_unit(printed) + slack if tolerance is None else tolerance
    verdict = AGREES if is_ours(printed, allowed) else DIFFERS
    if verdict == DIFFERS and should_read is not None and is_ours(should_read, half_unit(should_read) + slack):
        verdict = ERRATUM
    return Comparison(table, item, float(printed), None, float(ours), unit, float(allowed), verdict, note, printed)


@dataclass(frozen=True)
class Sheet:
    """Comparisons as they are made, and the misprints they confirm.

    Attributes:
        misprints: (table, item): what it should read, and why.
        comparisons, errata: so far.
    """

    misprints: Mapping[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    comparisons: list[Comparison] = field(default_factory=list)
    errata: list[Erratum] = field(default_factory=list)

    def add(
        self, table: str, item: str, printed: str, ours: float, unit: str = "",
        *, misprint: tuple[str, str] | None = None, note: str = "", **options: Any,
    ) -> None:  # fmt: skip
        """Compares, see ``compare``; a misprint is one only where ours agrees with what it should read."""
        known = misprint or self.misprints.get((table, item))
        found = compare(table, item, printed, ours, unit, should_read=known[0] if known else None, **options)
        if found.verdict == ERRATUM and known:
            self.errata.append(Erratum(f"{table}, {item}", printed, *known))
            note = f"should read {known[0]}: {known[1]}"
        self.comparisons.append(replace(found, note=note))

    def expect(
        self, table: str, item: str, expected: float, ours: float, unit: str = "", *, tolerance: float, note: str = ""
    ) -> None:
        """Holds our number against one that the paper does not print: of its words, of an identity, of other code."""
        verdict = AGREES if abs(ours - expected) <= tolerance else DIFFERS
        self.comparisons.append(
            Comparison(table, item, None, float(expected), float(ours), unit, float(tolerance), verdict, note)
        )


def named_objectives(problem: Problem, values: Mapping[str, float]) -> dict[str, float]:
    """Objective values by ``id [unit]``, those the mapping has."""
    return {f"{o.id} [{o.unit}]": float(values[o.id]) for o in problem.objectives if o.id in values}
