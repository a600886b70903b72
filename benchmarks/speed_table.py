"""The table of ``benchmarks/speed.py``: what was measured, and whether it reaches its target."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any

SAME = 1e-4  # relative: objectives that are the same
BUSY = 1.1  # wall clock over processor time of a measurement, above which the machine was not quiet
NSGA2_HYPERVOLUME = 0.709  # to reach with 40 points
SIZES, METHODS, BUDGETS = (50, 100, 200), ("nsga2", "mopso"), ("3 s", "10 s", "30 s")
LIBRARIES = ("casadi", "numpy", "scipy", "pymoo", "pin")

Figures = dict[str, Any]
Found = Mapping[str, Figures]
"""What was measured, by row, environment, number and options: ``"front now 0"``."""


@dataclass(frozen=True)
class Row:
    """One line of the table that compares times.

    Attributes:
        name: of its function in ``speed_rows.py``.
        work: in words, with what is inside the time.
        today, target: seconds of the earlier commit and to reach, on a quiet machine: their ratio is the target.
        unit: of the seconds, as shown.
        long: whether it takes more than 20 s.
    """

    name: str
    work: str
    today: float
    target: float
    unit: str = "s"
    long: bool = False


ROWS = (
    Row("cost", "`hybrid-spline` cost, one start; building of the problem and proof inside", 1.04, 0.4),
    Row("wrist", "`wrist-obstacle`, 20 starts a branch; proofs inside", 50.7, 8.0, long=True),
    Row("weld", "`weld-bezier` default; proof inside", 10.0, 5.0),
    Row("weld_air_time", "`weld-bezier` air time; proof inside", 27.1, 12.0, long=True),
    Row("rotor", "`rotor-353`, certified", 1.9, 1.0),
    Row("ur5_solve", "UR5 through 20 points, least time; proof inside", 2.3, 0.6),
    Row("ur5_front", "UR5 through 20 points, front of 15 of time and effort; proofs inside", 98.0, 10.0, long=True),
    Row("audit", "audit of the nonic arm of 6 joints, rest to rest; the second in a process", 0.097, 0.05, "ms"),
    Row("individual", "an individual of `hybrid-spline`, 100 together, 49 instants, six limits", 100e-6, 60e-6, "us"),
)
SCALE = {"s": 1.0, "ms": 1e3, "us": 1e6}


def of(found: Found, row: str, side: str, *options: str) -> list[Figures]:
    """All that is known of a row in an environment."""
    split = [(key.split(), figures) for key, figures in found.items()]
    return [f for words, f in split if words[:2] == [row, side] and set(options) <= set(words[3:])]


def middle(found: Sequence[Figures], name: str = "seconds") -> float:
    """Median of one figure; NaN where nothing is known."""
    return median(one[name] for one in found) if found else float("nan")


def verdict(met: bool, known: bool) -> str:
    """As the table has it."""
    return ("yes" if met else "**no**") if known else "to be measured"


def ratio_lines(found: Found) -> Iterator[Sequence[str]]:
    """Work | before | now | ratio | target | met, of the rows that compare times."""
    before, now, other = (of(found, *row) for row in (("front", "before"), ("front", "now"), ("nsga2", "before")))
    times, reference = (middle(before), middle(now)), middle(other)
    ours, theirs = middle(now, "hypervolume"), max(middle(other, "as found"), middle(other, "hypervolume"))
    shown = [f"{t:.2f} s, {t / reference:.2f} x NSGA-II" if t == t else "-" for t in times]
    if now and other:
        shown[1] += f" ({reference:.2f} s); hypervolume {ours:.4f}, its {theirs:.4f}; {now[0]['proved']} points proved"
    met = times[1] <= reference and ours >= max(NSGA2_HYPERVOLUME, theirs)
    yield (
        "`hybrid-spline` front of 40 points, proofs inside, against NSGA-II 100 x 200 without proof", *shown,
        _ratio(*times), f"1.0 x NSGA-II, hypervolume {NSGA2_HYPERVOLUME}", verdict(met, bool(now and other)),
    )  # fmt: skip
    for row in ROWS:
        before, now = of(found, row.name, "before"), of(found, row.name, "now")
        times, aim = (middle(before), middle(now)), row.target / row.today
        shown = [f"{t * SCALE[row.unit]:.3g} {row.unit}" if t == t else "-" for t in times]
        if before and now and row.name == "audit":
            scans = [f", scan {SCALE[row.unit] * middle(some, 'scan'):.0f} {row.unit}" for some in (before, now)]
            shown = [text + scan for text, scan in zip(shown, scans, strict=True)]
        target = f"{aim:.2f} ({row.target * SCALE[row.unit]:g} of {row.today * SCALE[row.unit]:g} {row.unit})"
        known = bool(before and now)
        kept = known and as_good(before[0], now[0])
        words = "" if kept or not known else "; a worse result"
        yield row.work, *shown, _ratio(*times), target, verdict(kept and times[1] <= aim * times[0], known) + words


def _ratio(before: float, now: float) -> str:
    return f"{now / before:.2f}" if now / before == now / before else "-"


def as_good(before: Figures, now: Figures) -> bool:
    """Whether as much is proved as before, and neither an objective nor a hypervolume is worse."""
    worse = [
        sign * (now[name] - before[name]) > SAME * abs(before[name])
        for name, sign in (("objective", 1.0), ("hypervolume", -1.0))
        if name in before
    ]
    return not any(worse) and bool(now.get("proved", 0) >= before.get("proved", 0))


def equal_time_lines(found: Found) -> Iterator[Sequence[str]]:
    """Time | before | now | NSGA-II | MOPSO | met: hypervolumes, medians over the seeds with least and largest."""
    for budget in BUDGETS:
        own = [of(found, "trace", side, f"budget={budget.split()[0]}") for side in ("before", "now")]
        best = []
        for method in METHODS:
            runs = [of(found, "population", "before", f"method={method}", f"size={size}") for size in SIZES]
            values = [[max(run[budget]["as found"], run[budget]["hypervolume"]) for run in some] for some in runs]
            best.append(max(zip(values, SIZES, strict=True), key=lambda one: median(one[0]) if one[0] else 0.0))
        ours = [one["hypervolume"] for one in own[1]]
        known = bool(ours) and all(values for values, _ in best)
        met = known and all(median(ours) > median(values) for values, _ in best)
        took = f"; {middle(own[1]):.2f} s with proofs, {middle(own[1], 'proved'):.0f} points" if ours else ""
        yield (
            budget, _span([one["hypervolume"] for one in own[0]]), _span(ours) + took,
            *(f"{_span(values)}; population {size}" if values else "-" for values, size in best), verdict(met, known),
        )  # fmt: skip


def _span(values: Sequence[float]) -> str:
    return f"{median(values):.4f} ({min(values):.4f} to {max(values):.4f})" if values else "-"


def markdown(head: Sequence[str], lines: Iterator[Sequence[str]]) -> str:
    """A table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *lines))


def report(found: Found, command: str, before: str, now: str) -> str:
    """The results in Markdown, for names of both commits."""
    stamps = [datetime.fromtimestamp(one["at"], UTC).strftime("%Y-%m-%d %H:%M") for one in found.values()]
    when = f"Measured {min(stamps)} to {max(stamps)} UTC" if stamps else "**Nothing is measured yet**"
    busiest = max((one["seconds"] / one["cpu"] for one in found.values()), default=0.0)
    if busiest > BUSY:
        when += f", **not on a quiet machine**: up to {busiest:.1f} s of wall clock a second of processor"
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    count = max(len(of(found, row.name, "now")) for row in ROWS)
    return f"""## Speed

`{command}`

{when}. Before: commit {before}; now: {now}. {_processor()}, {os.cpu_count()} cores; Python
{platform.python_version()}, {versions}.

Medians of processes of one core each, at most {count} a row and commit, in turn. Imports are outside the time; so is
the building of the problem where it is not named. The target is a ratio: seconds to reach over those of the commit
before, both of a quiet machine. *Met* asks for no worse an objective or hypervolume (to {SAME:g}) and no fewer proofs.

{markdown(("work", "before", "now", "ratio", "target", "met"), ratio_lines(found))}

Hypervolume of `hybrid-spline`, time and energy, after equal wall time (share of the box from (2.4836 s, 1565.2) to
(8 s, 6000)): median, least and largest of the seeds. Before and now: the traced front, proved, of as many points as
there is time for. NSGA-II and MOPSO are pymoo's, evaluated as on the commit before, at the best of populations
{", ".join(map(str, SIZES))}; their time has no proofs in it, and their hypervolume is the larger of that as found and
that proved. As many processes at a time as there are cores, here alone.

{markdown(("time", "before", "now", "NSGA-II", "MOPSO", "met"), equal_time_lines(found))}"""


def _processor() -> str:
    cpu = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in cpu.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()
