"""The task file that ``ocp-traj new`` writes: it solves as it stands, and has every table and key of the format."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.task import Task
from ocp_traj.formulation.task_example import EXPORT, WRITTEN, task_example
from ocp_traj.formulation.task_file import task_of
from ocp_traj.io.export import FORMATS, format_class
from ocp_traj.robot.dh import KEYS

TEXT = task_example()
TOOL_PATHS = ("line", "arc", "poses", "speed", "free_turn", "blend")  # keys of moves that go along one
HEADER = re.compile(r"^\[\[?(\w+)\]\]?$")
LEFT_OUT = re.compile(r"^# (\w+) = (.*)$")


def _places(table: type[BaseModel], prefix: str = "") -> Iterator[str]:
    """Every place of the schema, by dotted name, but what later versions build and what the program writes."""
    for name, field in table.model_fields.items():
        place = f"{prefix}{field.alias or name}"
        if field.description and place not in WRITTEN:
            yield place
            for inner in re.findall(r"<class '[\w.]*\.(\w+)'>|(\w+)\b", str(field.annotation)):
                found = _tables().get(inner[0] or inner[1])
                if found is not None:
                    yield from _places(found, f"{place}.")
                    break


def _tables() -> dict[str, type[BaseModel]]:
    from ocp_traj.formulation import task

    return {name: one for name, one in vars(task).items() if isinstance(one, type) and issubclass(one, BaseModel)}


def _sections() -> dict[str, list[str]]:
    """The lines of each table, those before the first as ""."""
    found: dict[str, list[str]] = {"": []}
    name = ""
    for line in TEXT.splitlines():
        if match := HEADER.match(line):
            name = match[1]
            found[name] = []
        found[name].append(line)
    return found


@pytest.mark.parametrize("place", list(_places(Task)))
def test_every_key_of_every_table_stands_in_it(place: str) -> None:
    sections = _sections()
    table, _, rest = place.partition(".")
    if table in sections and not rest:
        return
    lines = sections[table] if table in sections else sections[""]
    *_, key = place.split(".")
    nested = place.count(".") - (table in sections) > 0
    pattern = rf"^#   {key}: ." if nested else rf"^(# )?{key} = ."
    assert any(re.match(pattern, line) for line in lines), f"{place} is not explained in ocp_traj new"


def test_the_schema_is_walked_to_its_end() -> None:
    places = set(_places(Task))
    assert {
        "units.angle",
        "robot.payload.mass",
        "move.begin.velocity",
        "objective.front.points",
        "robot.tool.rpy",
    } <= places
    assert set(Task.model_fields) - {"source"} <= {place.partition(".")[0] for place in places} | {"collision"}


def test_keys_of_rows_and_of_exports_stand_in_it() -> None:
    assert all(re.search(rf"\b{key}\b", TEXT) for key in KEYS)
    options = {field.name for format in FORMATS for field in fields(format_class(format))}
    assert set(EXPORT) == options | {"format"}
    assert all(f'"{format}"' in EXPORT["format"][1] for format in FORMATS)


def _left_out() -> list[tuple[str, str, str]]:
    return [
        (table, match[1], match[2])
        for table, lines in _sections().items()
        for line in lines
        if (match := LEFT_OUT.match(line))
        and (match[1], match[2]) != ("key", 'value` may be used by taking the "#" away. Every key there')
    ]


@pytest.mark.parametrize(("table", "key", "value"), _left_out())
def test_what_is_left_out_may_be_taken_in(table: str, key: str, value: str) -> None:
    data: dict[str, Any] = tomllib.loads(TEXT)
    here = data if not table else data[table][0] if table == "move" else data[table]
    here[key] = tomllib.loads(f"value = {value}")["value"]
    # What excludes something that is given is put in its place.
    for other in {"description": ["dh", "base"], "urdf": ["dh"], "tool_frame": ["dh"], "locked": ["dh"]}.get(key, []):
        if table == "robot":
            here.pop(other, None)
            if key in ("tool_frame", "locked"):
                here["description"] = "ur5"
    if table == "move" and key in ("goal", "path", "point", *TOOL_PATHS):
        points = here.pop("via")
        if key in TOOL_PATHS:
            here |= {"start": points[0], "tolerance": {"position": 1e-3, "tilt": 0.035}}
            here.setdefault("line" if key in ("speed", "free_turn", "blend") else key, {"by": [0.0, 0.0, 0.1]})
    if key == "point":
        here["path"] = "a-run"
    if table == "move" and key == "start":
        here["goal"] = here.pop("via")[-1]
    assert task_of(data).fields()


@pytest.mark.slow
def test_the_command_writes_it_and_it_solves_proved_and_exports(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "arm.toml"]) == 0
    assert Path("arm.toml").read_text() == TEXT
    assert run(["solve", "arm.toml", "-o", "t.json"]) == 0
    moved = ot.Trajectory.load("t.json")
    assert moved.audit().proved and moved.duration < 1.2  # [s]; 1.233 s with one piece a leg
    assert run(["export", "t.json"]) == 0 and Path("t.ros.yaml").exists()
    capsys.readouterr()
    Path("arm.toml").write_text("mine")
    assert run(["new", "arm.toml"]) == 2 and Path("arm.toml").read_text() == "mine"
    assert "arm.toml is there already; give another name, or --force" in capsys.readouterr().err
    assert run(["new", "arm.toml", "--force"]) == 0 and Path("arm.toml").read_text() == TEXT
    assert run(["new", "arm.txt"]) == 2 and not Path("arm.txt").exists()
    assert run(["new", "nowhere/arm.toml"]) == 2


def test_its_front_has_what_its_own_table_asks_for() -> None:
    task = task_of(tomllib.loads(TEXT))
    assert task.objective.front is not None
    with pytest.raises(InputError, match="no objective"):
        ot.problems.load("task", task=task, **{"objective.minimise": "tiem"})
    known = [objective.id for objective in ot.problems.load("task", task=task).objectives]
    assert set(task.objective.front.objectives) <= set(known)
