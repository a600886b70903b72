"""What the table of speeds says of what was measured."""

import pytest

from benchmarks.speed import plan
from benchmarks.speed_table import BUDGETS, METHODS, ROWS, SIZES, Figures, equal_time_lines, ratio_lines, report

COST = next(row for row in ROWS if row.name == "cost")


def _measured(before: float, now: float, **now_has: float) -> dict[str, Figures]:
    known = {"cpu": 1.0, "at": 0.0, "objective": 2.0, "proved": 1}
    return {"cost before 0": {**known, "seconds": before}, "cost now 0": {**known, "seconds": now, **now_has}}


def _line(found: dict[str, Figures]) -> list[str]:
    return list(next(line for line in ratio_lines(found) if line[0] == COST.work))


@pytest.mark.parametrize(
    ("now", "better", "met"),
    [
        (COST.target, {}, "yes"),
        (1.001 * COST.target, {}, "**no**"),
        (0.1, {"objective": 2.0003}, "**no**; a worse result"),
        (0.1, {"proved": 0}, "**no**; a worse result"),
        (0.1, {"objective": 1.0}, "yes"),
    ],
)
def test_a_target_is_a_ratio_and_bought_with_no_worse_a_result(now: float, better: dict[str, float], met: str) -> None:
    machine = 3.0  # times slower than the one of the targets
    assert _line(_measured(machine * COST.today, machine * now, **better))[-1] == met


def test_times_are_medians() -> None:
    found = {**_measured(2.0, 1.0), **{f"cost now {k}": {"seconds": s, "proved": 1} for k, s in ((1, 9.0), (2, 1.5))}}
    assert _line(found)[1:4] == ["2 s", "1.5 s", "0.75"]


def test_what_is_not_measured_is_said_to_be() -> None:
    assert _line({})[-1] == "to be measured"
    text = report({}, "command", "before", "now")
    assert "Nothing is measured yet" in text and "nan" not in text
    assert "not on a quiet machine**: up to 2.0 s" in report(_measured(2.0, 1.0), "command", "before", "now")


def _hypervolumes(own: float, others: dict[tuple[str, int], float]) -> dict[str, Figures]:
    seen = {key: {"as found": value, "hypervolume": 0.0} for key, value in others.items()}
    found: dict[str, Figures] = {}
    for budget in BUDGETS:
        found[f"trace now 0 budget={budget.split()[0]} seed=0"] = {"hypervolume": own, "seconds": 1.0, "proved": 9}
    for (method, size), value in seen.items():
        found[f"population before 0 method={method} size={size} seed=0"] = dict.fromkeys(BUDGETS, value)
    return found


def test_a_front_is_ahead_of_the_best_population_of_both_methods() -> None:
    others = {(method, size): 0.5 for method in METHODS for size in SIZES}
    assert [line[-1] for line in equal_time_lines(_hypervolumes(0.6, others))] == ["yes"] * 3
    others["mopso", 200] = 0.7
    lines = list(equal_time_lines(_hypervolumes(0.6, others)))
    assert [line[-1] for line in lines] == ["**no**"] * 3 and "population 200" in lines[0][4]


def test_rows_of_both_commits_take_turns_and_long_ones_are_fewer() -> None:
    keys = [one.key for some in plan(["cost", "wrist"], 2, 1, 1) for one in some]
    assert keys == ["cost before 0", "cost now 0", "cost before 1", "cost now 1", "wrist before 0", "wrist now 0"]
