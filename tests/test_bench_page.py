"""The page of benchmarks: lines that survive a stop, sections that keep their neighbours, figures cited as they are."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from benchmarks import bench
from benchmarks.bench import TABLES
from benchmarks.exact_curves import of_states, of_timed_path
from benchmarks.judge import INSTANTS, Made, of_curve, scan
from benchmarks.lines import Cell, Figures, Lines
from benchmarks.sections import RESULTS, cited_figures, disagreements, put
from benchmarks.tables.sizes import exponent

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
CELL = Cell("tool", "subject", "setting", 3)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_what_is_cited_stands_on_the_page(document: Path) -> None:
    page = cited_figures(RESULTS.read_text(encoding="utf-8"))
    assert disagreements(document.read_text(encoding="utf-8"), page) == []


def test_another_figure_or_key_than_the_page_has_is_found() -> None:
    rows = "| key | figure | what |\n| `a.b` | 1.002 | x |\n| `c` | 3 of 4 | y |"
    page = cited_figures(f"| `d` | 5 | z |\n<!-- cited -->\n{rows}\n<!-- /cited -->")
    assert page == {"a.b": "1.002", "c": "3 of 4"}
    assert disagreements("takes 1.002 <!-- results: a.b --> and\n(3 of 4 <!-- results: c -->)", page) == []
    for wrong in ("11.002 <!-- results: a.b -->", "1.00 <!-- results: a.b -->", "1.002 <!-- results: b -->"):
        assert len(disagreements(wrong, page)) == 1


def test_a_section_is_replaced_and_the_others_stay(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    put("one", "first", page)
    put("two", "second", page)
    put("one", "again", page)
    assert page.read_text() == (
        "# Results of the benchmarks\n\n<!-- one -->\nagain\n<!-- /one -->\n\n<!-- two -->\nsecond\n<!-- /two -->\n"
    )
    page.write_text("<!-- one -->\nall else would be lost")
    with pytest.raises(ValueError, match="pair up"):
        put("one", "x", page)


def test_a_line_that_was_cut_short_is_measured_again_and_the_last_one_counts(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "lines.jsonl"
    Lines(path).add(CELL, {"cpu": 1.0})
    other = Cell("tool", "subject", "setting", 4)
    Lines(path).add(other, {"cpu": 5.0})
    path.write_bytes(path.read_bytes()[:-20])
    again = Lines(path)
    assert set(again.found) == {CELL}
    again.add(other, {"cpu": 6.0})
    again.add(CELL, {"cpu": 2.0})
    known = Lines(path)
    assert [known.found[cell]["cpu"] for cell in (CELL, other)] == [2.0, 6.0]
    assert [one["cpu"] for one in known.of(repeat=4)] == [6.0]


class OneTable:
    """A table of one figure."""

    TITLE = "One table"

    def text(self, lines: Lines) -> str:
        return f"it takes {lines.found[CELL]['cpu']} s"

    def cited(self, lines: Lines) -> dict[str, tuple[str, str]]:
        return {"guo.new": (f"{lines.found[CELL]['cpu']}", "seconds")}

    def behind(self, lines: Lines) -> list[str]:
        return ["slower"]


class TwoCells(OneTable):
    """A table whose second cell fails the first time."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def cells(self, quick: bool) -> list[Cell]:
        return [Cell("tool", "subject", "", repeat) for repeat in range(2 if quick else 3)]

    def measure(self, cell: Cell) -> Figures:
        self.asked.append(cell.repeat)
        if cell.repeat == 1 and self.asked.count(1) == 1:
            raise ArithmeticError("the tool gave up")
        return {"cpu": float(cell.repeat)}


def test_a_run_goes_on_where_it_was_and_tries_what_failed_once_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = TwoCells()
    monkeypatch.setattr(bench, "load", lambda name: table)
    bench.measure("guo", True, tmp_path, fresh=False)
    failed = Lines(tmp_path / "guo.jsonl").of(repeat=1)
    assert [one["failed"] for one in failed] == ["ArithmeticError: the tool gave up"]
    bench.measure("guo", False, tmp_path, fresh=False)
    assert table.asked == [0, 1, 1, 2]
    assert [one["cpu"] for one in Lines(tmp_path / "guo.jsonl").of()] == [0.0, 1.0, 2.0]
    bench.measure("guo", True, tmp_path, fresh=True)
    assert table.asked == [0, 1, 1, 2, 0, 1]


def test_a_page_of_one_table_keeps_what_is_said_of_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page, folders = tmp_path / "page.md", (tmp_path / "whole", tmp_path / "quick")
    put("ruckig", "the other table", page)
    put("behind", "* ruckig: stays\n* guo: goes", page)
    put("cited", "| `ruckig.x` | 3 | stays |\n| `guo.old` | 4 | goes |", page)
    monkeypatch.setattr(bench, "load", lambda name: {"guo": OneTable()}[name])
    Lines(folders[1] / "guo.jsonl").add(CELL, {"cpu": 1.5})
    bench.page(folders, page)
    text = page.read_text()
    assert "it takes 1.5 s" in text and "the other table" in text
    assert [line for line in text.splitlines() if line.startswith("* ")] == ["* ruckig: stays", "* guo: slower"]
    assert cited_figures(text) == {"guo.new": "1.5", "ruckig.x": "3"}
    Lines(folders[0] / "guo.jsonl").add(CELL, {"cpu": 2.5})
    bench.page(folders, page)
    assert cited_figures(page.read_text())["guo.new"] == "2.5"


def test_peers_are_scripts_of_at_most_sixty_lines() -> None:
    scripts = sorted((ROOT / "benchmarks" / "peers").glob("*.py"))
    assert len(scripts) >= 8
    assert {path.name: n for path in scripts if (n := len(path.read_text().splitlines())) > 60} == {}
    assert [path.name for path in scripts if "ocp_traj" in path.read_text()] == []


@pytest.mark.parametrize("name", TABLES)
def test_a_table_with_nothing_measured_says_nothing_wrong(name: str, tmp_path: Path) -> None:
    if name in ("toppra", "ruckig"):
        pytest.importorskip(name)
    table, lines = importlib.import_module(f"benchmarks.tables.{name}"), Lines(tmp_path / "none.jsonl")
    assert "nan" not in table.text(lines) and table.cited(lines) == {} and table.behind(lines) == []
    quick, whole = list(table.cells(True)), list(table.cells(False))
    assert len(quick) == len(set(quick)) and len(set(whole)) == len(whole) > len(quick) > 0


def test_taylor_polynomials_and_timed_paths_are_the_motions_they_are_of() -> None:
    rng = np.random.default_rng(0)
    spline = CubicSpline([0.0, 0.7, 1.1, 2.0], rng.normal(size=(4, 2)))
    states = np.stack([spline(spline.x[:-1], nu) for nu in range(4)], axis=1)
    t = np.linspace(0.0, 2.0, 201)
    assert np.abs(of_states(spline.x, states)(t) - spline(t)).max() < 1e-13
    places = np.union1d(spline.x, np.linspace(0.0, 2.0, 23))
    speeds = np.sqrt(rng.uniform(0.5, 2.0, len(places)))
    times = np.append(0.0, np.cumsum(2.0 * np.diff(places) / (speeds[1:] + speeds[:-1])))
    curve = of_timed_path(spline, times, places, speeds)
    k = rng.integers(len(places) - 1, size=50)
    after = rng.uniform(0.0, 1.0, 50) * np.diff(times)[k]
    rate = np.diff(speeds)[k] / np.diff(times)[k]
    s = places[k] + speeds[k] * after + 0.5 * rate * after**2
    assert np.abs(curve(times[k] + after) - spline(s)).max() < 1e-12
    assert np.abs(curve(times[k] + after, 1) - spline(s, 1) * (speeds[k] + rate * after)[:, None]).max() < 1e-9


def test_the_scan_sees_the_largest_excess_of_all_limits() -> None:
    """q = A sin^2(pi t / 2) over two seconds by a sampler of its own: v up to A pi / 2, a up to A pi^2 / 2."""
    size, rate = np.array([1.0, 0.5]), np.pi

    def sample(t: np.ndarray, order: int) -> np.ndarray:
        wave = (0.5 * (1.0 - np.cos(rate * t)), 0.5 * rate * np.sin(rate * t), 0.5 * rate**2 * np.cos(rate * t))[order]
        return wave[:, None] * size

    curve = of_states(np.array([0.0, 2.0]), np.zeros((1, 2, 2)))  # is not looked at
    v, a = np.array([1.5, 1.0]), np.array([4.0, 4.0])
    excess, limit = scan(Made(2.0, sample, curve), {"velocity": (-v, v), "acceleration": (-a, a)}, None)
    assert limit == "acceleration" and excess == pytest.approx(rate**2 / 8.0 - 1.0, rel=1.0 / INSTANTS)
    still = of_curve(curve)
    assert scan(still, {"velocity": (-v, v)}, None)[0] == -1.0


def test_an_exponent_is_the_slope_of_logarithms() -> None:
    assert exponent([0.0, 1.0, 2.0, 4.0], [9.0, 3.0, 3.0 * 2**1.5, 3.0 * 4**1.5]) == pytest.approx(1.5)
    assert np.isnan(exponent([2.0, 2.0], [1.0, 3.0]))
