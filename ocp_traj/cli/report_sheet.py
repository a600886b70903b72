"""What a report shows, as a sheet to print."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ocp_traj.cli.console import Sheet

if TYPE_CHECKING:
    from ocp_traj.report.sources import Source


def report_sheet(sources: Sequence[Source], target: Path) -> Sheet:
    """Runs and trajectories on a page, with their verdicts."""
    shown = [
        {
            "name": source.name, "problem": source.problem.id, "points": len(source.points),
            "verdicts": dict(Counter(point.audit.verdict for point in source.points)),
        }
        for source in sources
    ]  # fmt: skip
    size = target.stat().st_size
    rows = [
        [name, problem, points, ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items())]
        for name, problem, points, verdicts in (one.values() for one in shown)
    ]
    title = f"{target.name}: {size / 1e6:.3g} MB"
    data = {"written": str(target), "bytes": size, "shown": shown}
    return Sheet(data, [(title, ["run or trajectory", "problem", "points", "verdicts"], rows)])
