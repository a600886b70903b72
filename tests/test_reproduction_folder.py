"""The folder of a reproduction: what is finished is written as it is found, whole, and readable to its digits."""

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.figure import Figure

from ocp_traj.cli import commands
from ocp_traj.cli.sheets import reproduction_sheet
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.reproductions import reproduce as module
from ocp_traj.reproductions.comparison import Erratum, Reproduction, Sheet
from ocp_traj.reproductions.draft import Draft, Keep
from ocp_traj.reproductions.folder import ReproductionFolder, stem
from ocp_traj.reproductions.gallery import Listed
from ocp_traj.reproductions.readable import cell, markdown, readable, significant
from tests.reproduction_folder import not_rendered

LISTED = (Listed("Figure 1", "robot", why_not="a drawing"), Listed("Figure 2", "curve", "ours"))
ERRATUM = Erratum("(1)", "a", "b", "c")


def run(seeds: int, progress: object, keep: Keep, stop: bool = False) -> Reproduction:
    """Two steps, the second of which Ctrl-C may end."""
    draft = Draft("hybrid-spline", "a paper", 2, lambda *told: None, keep, LISTED)
    draft.begin("first")
    draft.sheet.add("Table 1", "time", "1032.78", 1032.784321, "s")
    draft.figure("Figure 2", Figure)
    draft.begin("second")
    if stop:
        raise KeyboardInterrupt
    draft.extra["Longer | table"] = pd.DataFrame({"value": [1.0 / 3.0], "certified": [True]})
    return draft.finish([ERRATUM])


def files(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_what_is_finished_is_written_as_it_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    not_rendered(monkeypatch)
    folder = ReproductionFolder(tmp_path / "new")
    seen: list[set[str]] = []

    def keep(found: Reproduction) -> None:
        folder.keep(found)
        seen.append(files(folder.root))
        assert ("Not finished" in (folder.root / "README.md").read_text()) == (not found.finished)

    keep(run(0, None, keep))
    first = {"README.md", "figures/figure-02.png", "tables/table-1.csv", "tables/table-1.md"}
    assert seen[0] == first
    rest = {f"tables/{name}.{kind}" for name in ("longer-table", "errata") for kind in ("csv", "md")}
    assert seen[1] == first | rest | {"reproduction.json"}
    page = (folder.root / "README.md").read_text()
    assert "| [Figure 2](figures/figure-02.png) | curve | made     | ours" in page and "not made | a drawing" in page


def test_a_run_that_is_stopped_leaves_what_it_had(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    not_rendered(monkeypatch)
    registry = {"hybrid-spline": (lambda *given: run(*given, stop=True), 1)}
    monkeypatch.setattr(module, "REGISTRY", registry)
    assert commands.run(["reproduce", "hybrid-spline", "-o", str(tmp_path / "new")]) == 130
    assert "interrupted before all was done" in capsys.readouterr().err
    assert files(tmp_path / "new") == {"README.md", "figures/figure-02.png", "tables/table-1.csv", "tables/table-1.md"}
    assert "Not finished" in (tmp_path / "new" / "README.md").read_text()


def test_the_command_prints_the_digits_of_the_paper_and_the_verdicts_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    not_rendered(monkeypatch)
    monkeypatch.setattr(module, "REGISTRY", {"hybrid-spline": (run, 1)})
    assert commands.run(["reproduce", "hybrid-spline", "-o", str(tmp_path / "new"), "--pictures", "png,svg"]) == 0
    out, err = capsys.readouterr()
    assert "1032.78" in out and "1032.8 " not in out and f"written: {tmp_path / 'new'}" in err
    assert out.rindex("Verdicts") > out.rindex("Figures") > out.rindex("Errata")
    assert {"figures/figure-02.png", "figures/figure-02.svg"} <= files(tmp_path / "new")


def test_folders_and_pictures_that_cannot_be_are_refused_before_work(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    (tmp_path / "empty").mkdir()
    ReproductionFolder(tmp_path / "empty")
    for place, words in (("full", "holds something already; give a new folder"), ("full/mine.txt", "is a file")):
        with pytest.raises(InputError, match=words):
            ReproductionFolder(tmp_path / place)
    with pytest.raises(FileFormatError, match="cannot write"):
        ReproductionFolder(tmp_path / "none" / "new")
    with pytest.raises(InputError, match="pictures are written as png, svg, pdf; got jpg"):
        ReproductionFolder(tmp_path / "new", ("png", "jpg"))
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["nothing", "-o", "new"],
        ["hybrid-spline", "-o", "new", "--pictures", "gif"],
        ["hybrid-spline", "--pictures", "svg"],
    ],
)
def test_wrong_arguments_leave_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert commands.run(["reproduce", *arguments]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1 and not list(tmp_path.iterdir())


def test_ours_has_as_many_digits_as_what_it_is_held_against() -> None:
    sheet = Sheet()
    sheet.add("Table 5", "J22", "2085578.353", 2085578.3528, "kg mm2")
    sheet.add("Table 5", "m x", "0", 0.123456789, "kg mm")
    sheet.expect("Table 5", "sum", 0.25, 1.0 / 3.0, "-", tolerance=1e-9)
    table = readable(Reproduction("p", "r", tuple(sheet.comparisons), ()).tables["Table 5"])
    assert table["ours"].tolist() == ["2085578.353", "0.123457", "0.333333"]
    assert table["paper"].tolist() == ["2085578.353", "0", ""]
    assert [significant(text) for text in ("2085578.353", "0.0840", "1e5", "words")] == [10, 3, 1, 0]
    assert [cell(value) for value in (None, True, 1 / 3, "x", float("nan"))] == ["", "yes", "0.333333", "x", ""]


def test_markdown_is_aligned_and_escapes_bars() -> None:
    text = markdown(pd.DataFrame([("a|b", "1"), ("c", "22")], columns=["name", "n"], dtype=object))
    assert text.splitlines() == ["| name | n   |", "| ---- | --- |", "| a\\|b | 1   |", "| c    | 22  |"]
    assert (
        stem("MOGA beside HMOGA on the air move, 5 seeds: medians")
        == "moga-beside-hmoga-on-the-air-move-5-seeds-medians"
    )


def test_the_sheet_ends_with_the_verdicts_and_names_every_figure() -> None:
    found = replace(run(0, None, lambda found: None), finished=True)
    sheet = reproduction_sheet(found)
    assert [title for title, _, _ in sheet.tables][-2:] == ["Figures", "Verdicts"]
    assert sheet.tables[-2][2][0][:3] == ["Figure 1", "robot", "no"]
    assert [one["made"] for one in sheet.data["figures"]] == [False, True]
