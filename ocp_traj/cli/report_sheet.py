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
    shown, rows = [], []
    for source in sources:
        verdicts = Counter(point.audit.verdict for point in source.points)
        facts = source.name, source.problem.id, len(source.points)
        shown.append(dict(zip(("name", "problem", "points"), facts, strict=True)) | {"verdicts": dict(verdicts)})
        rows.append([*facts, ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())])
    size = target.stat().st_size
    title = f"{target.name}: {size / 1e6:.3g} MB"
    data = {"written": str(target), "bytes": size, "shown": shown}
    return Sheet(data, [(title, ["run or trajectory", "problem", "points", "verdicts"], rows)])
