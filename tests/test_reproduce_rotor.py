"""Zhu and Wang beside ours: the claims of the reproduction, as facts."""

import json

import numpy as np
import pytest

from ocp_traj.comparison import AGREES, DIFFERS, Sheet
from ocp_traj.problems import rotor_353 as paper
from ocp_traj.reproduce import Reproduction, reproduce
from ocp_traj.reproductions import rotor_353


def test_the_published_times_need_1670_deg_s2_and_with_the_printed_sign_425_deg_s() -> None:
    table = rotor_353.what_the_times_need(Sheet()).set_index(["variant", "joint"])
    assert round(table.loc[("sign mended", "J6"), "peak acceleration [deg/s2]"]) == 1670
    assert round(table.loc[("as printed", "J3"), "peak velocity [deg/s]"]) == 425
    assert (table.loc["sign mended", "of the maker's"] < 1.0).all()
    assert table.loc[("as printed", "J3"), "of the maker's"] > 1.9


def test_table_2_is_a_turn_about_the_vertical_and_a_translation_with_the_sign_mended_only() -> None:
    sheet = Sheet()
    table = rotor_353.geometry(sheet).set_index(["variant", "move"])
    assert [c.verdict for c in sheet.comparisons] == [AGREES, AGREES]
    assert table.loc[("sign mended", "X0 to X1"), "|axis . z|"] == pytest.approx(1.0, abs=1e-8)
    assert abs(table.loc[("sign mended", "X0 to X1"), "z [mm]"]) < 0.0075
    assert table.loc[("sign mended", "X2 to X3"), "turn [deg]"] < 1e-3
    assert table.loc[("as printed", "X2 to X3"), "turn [deg]"] > 90.0


def test_one_joint_alone_meets_its_limits_and_scales_with_them() -> None:
    points = np.degrees(paper.via_points(paper.ZhuWang()))[:, 3]
    phases = rotor_353._alone(points, 0.02)
    curve = rotor_353.polynomial_353(points[:, None], phases)
    peaks = [max(abs(e.lower), abs(e.upper)) for order in (1, 2) for e in curve.extrema(order)]
    assert peaks[0] <= 1.0 + 1e-9 and peaks[1] <= 0.02 * (1.0 + 1e-9)
    assert max(peaks[0], peaks[1] / 0.02) == pytest.approx(1.0, rel=1e-9)


@pytest.fixture(scope="module")
def found() -> Reproduction:
    return reproduce("rotor-353", seeds=1)


@pytest.mark.slow
def test_no_common_limits_give_the_published_phases(found: Reproduction) -> None:
    table = next(t for title, t in found.extra.items() if title.startswith("Phases"))
    assert list(table["variant"]) == ["paper", "sign mended", "as printed"]
    assert (table["distance of the logarithms"].iloc[1:] > 0.3).all()


@pytest.mark.slow
def test_the_recipe_is_slower_or_not_feasible_and_no_phase_is_the_paper_s(found: Reproduction) -> None:
    recipes = {run.variant: run for run in found.runs if run.method.startswith("each joint")}
    best = {run.variant: run for run in found.runs if run.method.startswith("IPOPT")}
    assert recipes["sign mended"].objectives["time [s]"] > 1.1 * best["sign mended"].objectives["time [s]"]
    assert recipes["as printed"].verdict == "violated"
    assert {c.verdict for c in found.comparisons if c.table == "Phases"} == {DIFFERS}


@pytest.mark.slow
def test_swarms_stand_beside_ipopt_and_branch_and_bound(found: Reproduction) -> None:
    title, table = next((title, t) for title, t in found.extra.items() if title.startswith("Swarms"))
    table = table.set_index("method")
    assert "1 seeds" in title and len(table) == 7
    assert table.loc["PSO as printed", "within 0.1%"] == 0 and table.loc["PSO repaired", "within 0.1%"] == 1
    assert table.loc["IPOPT with exchange", "worst gap"] < 1e-8
    assert -1e-6 < table.loc["branch and bound, lower bound", "median gap"] <= 0.0
    assert len(found.errata) == 7
    json.dumps(found.to_dict(), default=float)
