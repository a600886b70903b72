"""The comparisons with the papers: the verdicts themselves, and what they say of Guo et al. (2016)."""

import json
from pathlib import Path

import casadi
import numpy as np
import pytest
from pytest import approx

from ocp_traj import problems
from ocp_traj.errors import InputError, UnknownName
from ocp_traj.formulation.problem import Problem
from ocp_traj.problems import hybrid_robot
from ocp_traj.problems import hybrid_spline as paper
from ocp_traj.reproductions import hybrid_spline_tables as tables
from ocp_traj.reproductions.comparison import Comparison, Run, Sheet, compare, half_unit, rounding_effect
from ocp_traj.reproductions.hybrid_spline import optimum, payloads, reported
from ocp_traj.reproductions.hybrid_spline_errata import (
    MISPRINTS,
    energies,
    equation_errata,
    tangent_angles,
    yaw_error,
)
from ocp_traj.reproductions.hybrid_spline_tables import (
    TURNS,
    lines,
    objectives,
    pseudo_inertias,
    spline_knots,
    tool_positions,
    tracking,
    turned,
    via_points,
)
from ocp_traj.reproductions.reproduce import Reproduction, names, reproduce
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.paper_column import foreign
from tests.reproduction_folder import check_folder

LITERAL = "paper-literal"


@pytest.fixture(scope="module")
def literal() -> Problem:
    return problems.load("hybrid-spline", convention=LITERAL)


@pytest.fixture(scope="module")
def sheet(hybrid: Problem, literal: Problem) -> Sheet:
    """All of Guo et al. that needs no solver."""
    sheet = Sheet(MISPRINTS)
    for table in (pseudo_inertias, via_points, spline_knots, tracking):
        table(sheet)
    for problem in (literal, hybrid):
        objectives(sheet, problem)
    return sheet


def entry(sheet: Sheet, table: str, item: str) -> Comparison:
    (found,) = [c for c in sheet.comparisons if (c.table, c.item) == (table, item)]
    return found


def verdicts(sheet: Sheet, table: str, verdict: str) -> set[str]:
    return {c.item for c in sheet.comparisons if c.table == table and c.verdict == verdict}


# --- Verdicts ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("printed", "half"), [("1.30", 0.005), ("-0.1997", 5e-5), ("600", 0.5), ("0", 0.5)])
def test_half_unit_is_that_of_the_last_printed_digit(printed: str, half: float) -> None:
    assert half_unit(printed) == approx(half, rel=1e-12)


@pytest.mark.parametrize(
    ("ours", "slack", "should_read", "verdict"),
    [
        (2.345, 0.0, None, "agrees"),  # half-way: either print is right
        (2.3449, 0.0, None, "agrees"),
        (2.3451, 0.0, None, "differs"),
        (2.3451, 0.001, None, "agrees"),
        (2.43, 0.0, "2.43", "erratum"),
        (2.45, 0.0, "2.43", "differs"),  # a misprint that ours does not confirm is none
        (2.34, 0.0, "2.43", "agrees"),
        (float("nan"), 0.0, "2.43", "differs"),
    ],
)
def test_verdict(ours: float, slack: float, should_read: str | None, verdict: str) -> None:
    assert compare("T", "x", "2.34", ours, slack=slack, should_read=should_read).verdict == verdict


def test_only_confirmed_misprints_become_errata() -> None:
    sheet = Sheet({("T", "a"): ("2.43", "swapped"), ("T", "b"): ("2.43", "swapped"), ("T", "c"): ("2.43", "swapped")})
    for item, ours in (("a", 2.431), ("b", 2.341), ("c", 2.9)):
        sheet.add("T", item, "2.34", ours, "mm")
    assert [(e.where, e.printed, e.should_read) for e in sheet.errata] == [("T, a", "2.34", "2.43")]
    assert [c.note for c in sheet.comparisons] == ["should read 2.43: swapped", "", ""]


def test_rounding_effect_bounds_a_linear_function_exactly() -> None:
    matrix = np.array([[1.0, -2.0, 0.0], [0.5, 0.5, 4.0]])
    assert rounding_effect(lambda x: matrix @ x, np.ones(3), 0.05) == approx(np.array([0.15, 0.25]), rel=1e-9)


def test_a_number_the_paper_does_not_print_is_expected_and_not_the_papers() -> None:
    sheet = Sheet()
    sheet.add("T", "printed", "3921.602", 3921.6, "J")
    sheet.expect("T", "met", 0.0, 1e-12, "m", tolerance=1e-9)
    sheet.expect("T", "missed", 0.0, float("nan"), "m", tolerance=1e-9)
    assert [c.verdict for c in sheet.comparisons] == ["differs", "agrees", "differs"]
    table = Reproduction("p", "r", tuple(sheet.comparisons), ()).tables["T"]
    assert table["paper"].tolist() == ["3921.602", None, None]  # not to five digits, as ours
    assert table["expected"].tolist() == [None, "0", "0"]
    assert "expected" not in Reproduction("p", "r", tuple(sheet.comparisons[:1]), ()).tables["T"]


# --- Guo et al. (2016) ------------------------------------------------------------------------------------------------


def test_inverse_kinematics_gives_every_via_point_of_table_6(sheet: Sheet) -> None:
    assert verdicts(sheet, "Table 6", "erratum") == {"row 3 X_S3", "row 6 X_S3", "row 12 z"}
    extra = {f"row {number} {joint}" for number in (2, 12) for joint in hybrid_robot.JOINTS}
    assert verdicts(sheet, "Table 6", "differs") == extra  # they follow from the intervals


def test_spline_gives_the_knots_of_table_8(sheet: Sheet) -> None:
    corrected = {"row 2 X_S1", "row 3 X_S3", "row 5 t", "row 6 X_S3", "row 12 X_S2", "row 12 phi_5"}
    assert verdicts(sheet, "Table 8", "erratum") == corrected
    unexplained = {"row 2 X_S2", "row 12 X_S1", "row 12 X_S3", "row 7 y"}
    assert verdicts(sheet, "Table 8", "differs") == unexplained
    assert (
        max(abs(entry(sheet, "Table 8", item).ours - entry(sheet, "Table 8", item).paper) for item in unexplained)
        < 0.06
    )


def test_tool_positions_of_table_8_are_of_joints_rounded_to_four_decimals(sheet: Sheet) -> None:
    positions = [c for c in sheet.comparisons if c.table == "Table 8" and c.item[-1] in "xyz"]
    gaps = np.array([abs(c.ours - c.paper) for c in positions])
    assert len(gaps) == 39 and gaps.max() < 0.00054 and (gaps <= 0.0005).sum() == 38  # [mm], printed to 0.001
    printed = np.array([[float(text) for text in row[6:]] for row in lines(tables.TABLE_8_PRINTED).values()])
    exact = tool_positions(paper.via_points(paper.Guo2016()))
    assert np.abs(np.delete(printed, [1, 11], axis=0) - exact).max() > 0.06  # [mm]: not rounded, they do not agree


def test_the_papers_column_holds_what_it_prints(sheet: Sheet) -> None:
    assert not foreign("hybrid-spline", sheet.comparisons, reported())


def test_tracking_error_is_the_distance_to_the_curve(sheet: Sheet) -> None:
    assert len(verdicts(sheet, "Figure 15", "agrees")) == 3


def test_pseudo_inertia_of_table_5_no_3_is_copied_from_no_2(sheet: Sheet) -> None:
    assert verdicts(sheet, "Table 5", "erratum") == {"no. 3 J22", "no. 3 J33", "no. 3 m z"}
    assert verdicts(sheet, "Table 5", "differs") == {"no. 5 m x"}


def test_table_9_follows_from_table_7_in_the_paper_literal_convention(sheet: Sheet) -> None:
    agree = {f"{name}, {LITERAL}" for name in ("time", "jerk", "acceleration")}
    assert verdicts(sheet, "Table 9", "agrees") == agree | {
        f"{name}, {LITERAL}, Table 5's inertias" for name in ("energy", "cost")
    }
    assert entry(sheet, "Table 9", f"energy, {LITERAL}").ours == approx(3914.6, abs=0.05)  # [N2 m2/s]
    assert entry(sheet, "Table 9", "cost, physical").ours == approx(2.7060, abs=5e-5)


def test_turns_of_table_3_are_the_models() -> None:
    model = hybrid_robot.robot().model
    for inertia, turns, (mass, about_centre, _) in zip(
        list(model.inertias)[2:], TURNS, hybrid_robot.TABLE_4, strict=True
    ):
        rotation = turned(*turns)
        assert inertia.mass == mass
        assert inertia.inertia == approx(rotation @ np.array(about_centre) @ rotation.T * 1e-6, rel=1e-9, abs=1e-12)


def test_printed_tables_hold_the_corrected_ones() -> None:
    """Table 6 as printed is Table 6 as used, but for rows 2, 12 and one digit; Table 8 repeats it."""
    six = {k: row[:5] for k, row in lines(tables.TABLE_6_PRINTED).items() if k not in (2, 12)}
    eight = {k: row[1:6] for k, row in lines(tables.TABLE_8_PRINTED).items() if k not in (2, 12)}
    assert six == eight
    gaps = np.array([[float(text) for text in row] for row in six.values()]) - np.array(paper.TABLE_6)
    assert np.argwhere(np.abs(gaps) > 1e-9).tolist() == [[4, 2]] and gaps[4, 2] == approx(-3.0)


def test_equation_errata_show_their_numbers(hybrid: Problem, literal: Problem) -> None:
    errata = {erratum.where: erratum for erratum in equation_errata(hybrid, literal)}
    assert {"(30), A1 and B1", "(60)", "(67)", "before (145)", "Table 2, JC of joints 1-3"} <= set(errata)
    assert yaw_error() > 0.1  # [rad]
    payload = errata["(73), 5f5 of a payload"].reason
    assert "inferred" in payload and "12.5108" in payload and "12.6328" in payload
    assert "94 to 112 deg off the tangent; n is 5 to 22 deg" in errata["sect. 6, orientation of the tool"].reason
    assert "0.870 as printed, 1.066 so, 1.068 reported" in errata["(154), z3"].reason


def test_payload_and_sum_of_energies_are_the_nearest_readings(hybrid: Problem, literal: Problem) -> None:
    """Of weight upright or along the tool, and |U||v| summed after squaring or before, one is near 3921.602."""
    tried = np.array([energies(hybrid), energies(literal)])
    assert tried == approx(np.array([[2629.785, 3015.499], [2562.021, 3914.556]]), abs=5e-4)
    assert evaluate_objectives(hybrid, paper.TABLE_7)["energy"] == approx(tried[0, 0], rel=1e-12)
    assert evaluate_objectives(literal, paper.TABLE_7)["energy"] == approx(tried[1, 1], rel=1e-12)


def test_tool_cannot_point_along_the_tangent() -> None:
    """The paper's o and n by the model's forward kinematics at Table 6's joints, against the chord of neighbours."""
    q, symbols = paper.via_points(paper.Guo2016()), casadi.SX.sym("q", 5)
    rotation, position = hybrid_robot.robot().tool_pose(symbols)
    pose = casadi.Function("pose", [symbols], [rotation[:, 0], rotation[:, 1], position])
    n, o, p = (np.array(part).T for part in pose.map(len(q))(q.T))
    chord = (p[2:] - p[:-2]) / np.linalg.norm(p[2:] - p[:-2], axis=1)[:, None]  # a parabola: along its tangent
    for axis, angles in zip((o, n), tangent_angles(), strict=True):
        seen = np.degrees(np.arccos((axis[1:-1] * chord).sum(axis=1)))
        assert seen == approx(angles[1:-1], abs=1e-6)
    assert (o[:, 2] > 0.0).all() and (np.diff(p[:, 2]) < 0.0).all()


@pytest.mark.slow
def test_table_7_is_no_minimum(literal: Problem) -> None:
    sheet = Sheet()
    runs: list[Run] = []
    optimum(sheet, runs, literal)
    (run,) = runs
    assert run.verdict == "proved" and run.objectives["cost [-]"] == approx(2.957317, abs=5e-7)
    (slope,) = [c for c in sheet.comparisons if c.item.startswith("dFc/dh")]
    assert slope.verdict == "differs" and abs(slope.ours) > 10.0 * slope.tolerance
    assert slope.paper is None and slope.expected == 0.0
    assert not foreign("hybrid-spline", sheet.comparisons)


# --- Asking for it ----------------------------------------------------------------------------------------------------


def test_unknown_problems_are_refused() -> None:
    assert names() == ("hybrid-spline", "rotor-353", "wrist-obstacle", "weld-bezier")
    with pytest.raises(
        UnknownName, match="no problem 'hybrid'; problems whose paper can be reproduced are hybrid-spline"
    ):
        reproduce("hybrid")


@pytest.mark.parametrize("seeds", [-1, 1.5])
def test_wrong_number_of_seeds_is_refused(seeds: int) -> None:
    with pytest.raises(InputError, match="give a whole number, zero or more"):
        reproduce("hybrid-spline", seeds=seeds)


def test_tables_summary_and_json_hold_every_comparison(sheet: Sheet) -> None:
    result = Reproduction("hybrid-spline", "a reference", tuple(sheet.comparisons), tuple(sheet.errata))
    assert list(result.tables) == ["Table 5", "Table 6", "Table 8", "Figure 15", "Table 9", "Runs", "Errata"]
    assert sum(len(result.tables[name]) for name in result.summary["table"]) == len(sheet.comparisons)
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert plain["summary"]["Table 6"] == {"agrees": 91, "erratum": 3, "differs": 10}
    assert plain["comparisons"][0].keys() == vars(sheet.comparisons[0]).keys()


@pytest.mark.slow
def test_payload_of_the_paper_breaks_the_limit_of_f3_at_rest(hybrid: Problem, literal: Problem) -> None:
    sheet = Sheet()
    for problem in (hybrid, literal):
        payloads(sheet, problem)
    values = {c.item: c.ours for c in sheet.comparisons}
    assert values["every time law, physical"] == approx(12.5108, abs=5e-5)  # [kg]
    assert values["along Table 7, physical"] == approx(11.882, abs=5e-4)
    assert values[f"along Table 7, {LITERAL}"] == approx(12.633, abs=5e-4)
    assert values["|F3| with 12.65 kg, physical"] == approx(501.36, abs=5e-3)  # [N]
    assert values[f"|F3| with 12.65 kg, {LITERAL}"] > 500.0
    assert {c.verdict for c in sheet.comparisons} == {"differs"}
    assert not foreign("hybrid-spline", sheet.comparisons)


@pytest.mark.slow
def test_whole_paper_with_one_seed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[int, int, str]] = []
    result = reproduce("hybrid-spline", seeds=1, progress=lambda *words: told.append(words))
    assert [done for done, _, _ in told] == list(range(len(told))) and told[-1][0] == told[-1][1]
    best = {run.variant: run.objectives["cost [-]"] for run in result.runs if run.method.startswith("IPOPT")}
    assert best == {"physical": approx(2.550568, abs=5e-7), LITERAL: approx(2.957317, abs=5e-7)}
    genetic = [run for run in result.runs if run.method.startswith("NSGA-II of")]
    assert len(genetic) == 3 and all(run.evaluations == 20_000 and run.verdict == "proved" for run in genetic)
    for run in genetic:
        gap = run.objectives["cost [-]"] / best[run.variant] - 1.0
        assert 0.0 < gap < (0.002 if run.method == "NSGA-II of the cost" else 0.1)
    assert json.loads(json.dumps(result.to_dict(), allow_nan=False))["format"] == "ocp-traj/reproduction/2"
    assert {erratum.where for erratum in result.errata} >= {"Table 6, row 6 X_S3", "(30), A1 and B1"}
    assert not foreign("hybrid-spline", result.comparisons, result.runs)
    made = {"Figure 6": 1, "Figure 7": 1, "Figure 8": 4, **{f"Figure {n}": 2 for n in range(9, 15)}, "Figure 15": 1}
    check_folder(result, tmp_path, monkeypatch, made, {f"Figure {n}" for n in range(1, 6)})
