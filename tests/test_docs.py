"""What the documentation and the README show is what happens, and where they point to there is something."""

import re
import shutil
from pathlib import Path

import pytest
import typer

from ocp_traj.cli.commands import app
from ocp_traj.formulation import registry
from tests.doc_pages import PAGES, ROOT, blocks, complaint, run_page

RUN = [page for page in PAGES if any(not (b.reason or b.source) and b.kind != "text" for b in blocks(page))]
LINK = re.compile(r"(?<!`)!?\[[^\]]*\]\(([^)\s]+)\)")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_block_is_run_or_says_why_not(page: Path) -> None:
    assert page.read_text(encoding="utf-8").count("\n```") == 2 * len(blocks(page))
    assert not [f"{words}\n{b.text}" for b in blocks(page) if (words := complaint(b))]


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=name_of)
def test_a_page_is_what_happens(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    shutil.copy(ROOT / "examples" / "foreign" / "arm.urdf", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(registry, "_registered", {})  # what a page registers is its own
    run_page(page, capsys)


def anchors(page: Path) -> set[str]:
    """Of a page's headings, as GitHub and MkDocs make them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title).strip().lower().replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_link_is_dead(page: Path) -> None:
    dead = []
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"https?://", link):
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file) if file else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            dead.append(link)
    assert not dead


def test_every_page_is_in_the_navigation_and_the_other_way_round() -> None:
    listed = set(re.findall(r"[\w/-]+\.md$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE))
    assert listed == {str(page.relative_to(ROOT / "docs")) for page in PAGES[1:]}


def test_the_page_of_commands_has_all_of_them_with_options_that_they_have() -> None:
    known = typer.main.get_command(app).commands
    lines = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8").splitlines()
    rows = {line.split()[2].strip("`"): line for line in lines if line.startswith("| `ocp-traj ")}
    assert set(rows) == set(known)
    for name, line in rows.items():
        options = {option for parameter in known[name].params for option in parameter.opts}
        assert set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", line)) <= options, name


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_files_and_targets_that_a_page_names_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    named = re.findall(r"`(?:python )?((?:ocp_traj|problems|solvers|benchmarks|tests|examples)/[\w/.-]*)[ `]", text)
    modules = re.findall(r"python -m (benchmarks\.[\w.]+)", text)
    targets = re.findall(r"`make ([\w-]+)", text)
    rules = re.findall(r"^([\w -]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    known = {name for rule in rules for name in rule.split()}
    assert not [name for name in named if not (ROOT / name).exists()]
    assert not [name for name in modules if not (ROOT / (name.replace(".", "/") + ".py")).is_file()]
    assert not [name for name in targets if name not in known]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_in_the_text_have_the_options_they_name(page: Path) -> None:
    known = typer.main.get_command(app).commands
    for command, rest in re.findall(r"`ocp-traj (\w+)([^`]*)`", page.read_text(encoding="utf-8")):
        options = {name for parameter in known[command].params for name in (*parameter.opts, *parameter.secondary_opts)}
        assert set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", rest)) <= options, f"ocp-traj {command}{rest}"
