"""What every folder of a reproduction must hold, for the tests of each paper."""

import json
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

from ocp_traj.io import plot_style
from ocp_traj.reproductions.comparison import Reproduction
from ocp_traj.reproductions.folder import ReproductionFolder


def not_rendered(monkeypatch: pytest.MonkeyPatch) -> dict[str, Figure]:
    """Figures by the name of their files, which are made empty: to render them takes longer than all else."""
    drawn: dict[str, Figure] = {}

    def save(figure: Figure, path: str | Path) -> Path:
        drawn[Path(path).name] = figure
        Path(path).touch()
        return Path(path)

    monkeypatch.setattr(plot_style, "save_figure", save)
    return drawn


def check_folder(
    found: Reproduction, place: Path, monkeypatch: pytest.MonkeyPatch, made: dict[str, int], left_out: set[str]
) -> None:
    """The folder of a reproduction that is finished.

    Args:
        found: all of it.
        place: for the folder.
        monkeypatch: keeps pictures from being rendered.
        made: figures that must be made, with the number of axes in each.
        left_out: figures that must be named with a reason.
    """
    drawn = not_rendered(monkeypatch)
    ReproductionFolder(place / "run").keep(found)
    axes = {one.listed.number: len(drawn[f"{one.listed.stem}.png"].axes) for one in found.figures if one.made}
    assert axes == made
    for one in found.figures:
        if one.made:
            assert (place / "run" / "figures" / f"{one.listed.stem}.png").is_file()
    page = (place / "run" / "README.md").read_text()
    assert {one.listed.number for one in found.figures if not one.made} == left_out
    assert all(one.words and one.words in page for one in found.figures) and "Not finished" not in page
    assert all(f"[{title}](tables/" in page for title in found.tables)
    written = sorted((place / "run" / "tables").glob("*.csv"))
    assert len(written) == len(found.tables) == len(list((place / "run" / "tables").glob("*.md")))
    assert sum(len(pd.read_csv(path)) for path in written) == sum(len(table) for table in found.tables.values())
    values = json.loads((place / "run" / "reproduction.json").read_text())
    assert [one["figure"] for one in values["figures"]] == [one.listed.number for one in found.figures]
