"""What the comparison with Ogbemhe et al. says: tables decoded, errata with numbers, genetic algorithms in one box."""

import json
from math import comb
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.testing import assert_allclose
from pytest import approx
from scipy.interpolate import BPoly

from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.reproductions import weld_bezier as module
from ocp_traj.reproductions.comparison import Sheet
from ocp_traj.reproductions.reproduce import reproduce
from ocp_traj.reproductions.weld_bezier_errata import (
    MENDED_18,
    PRINTED_8,
    ROWS_18,
    coefficients_of_8,
    end_residual,
    equation_errata,
    skewness,
    sum_of_6,
    zyz,
)
from ocp_traj.reproductions.weld_bezier_tables import (
    CELLS,
    LIMITS,
    ORDERS,
    decoded,
    durations,
    end_points,
    outside,
    peaks,
    shortest,
    table_2,
)
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.solvers.hmoga import HMOGA
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.paper_column import foreign
from tests.reproduction_folder import check_folder

# --- tables ---


def test_every_number_of_table_2_is_its_decoded_one_to_five_digits() -> None:
    sheet = Sheet()
    table_2(sheet)
    verdicts = [c.verdict for c in sheet.comparisons]
    assert len(verdicts) == 60
    assert verdicts.count("agrees") == 58
    wrong = [c for c in sheet.comparisons if c.verdict == "erratum"]
    assert [c.item for c in wrong] == ["joint 4 P0", "joint 4 P5"]
    assert all(c.ours == approx(-2082.2, abs=0.05) for c in wrong)
    assert not foreign("weld-bezier", sheet.comparisons)


@pytest.mark.parametrize("seed", range(4))
def test_end_points_end_as_told_and_the_decoded_ones_do_not(seed: int) -> None:
    """Derivatives of scipy's polynomial of the ten points, of which the first five are none of the end's business."""
    rng = np.random.default_rng(seed)
    end, derivatives = rng.uniform(100.0, 700.0), rng.uniform(50.0, 300.0, 4)

    def state(last: np.ndarray) -> np.ndarray:
        curve = BPoly(np.concatenate([rng.normal(size=5), last[::-1]])[:, None], [0.0, 1.0])
        return np.array([curve.derivative(k)(1.0) if k else curve(1.0) for k in range(5)])

    assert_allclose(state(end_points(end, derivatives)), [end, *derivatives], rtol=1e-8)
    assert abs(state(decoded(end, derivatives))[1] - derivatives[0]) > 0.5 * end


def test_peaks_of_the_move_from_rest_to_rest_are_those_of_its_polynomial() -> None:
    assert_allclose(peaks(), [2.4609375, 9.3720, 78.750, 622.533], rtol=1e-5)


@pytest.mark.parametrize("joint", range(6))
def test_a_move_in_its_shortest_time_meets_its_limit_and_no_shorter_one_does(joint: int) -> None:
    for angle in (1.0, 10.0, 60.0):
        duration, limit = shortest(angle, joint)
        shares = [
            p * angle / duration**k / LIMITS[o][joint] for k, (p, o) in enumerate(zip(peaks(), ORDERS, strict=True), 1)
        ]
        assert max(shares) == approx(1.0, rel=1e-12)
        assert ORDERS[int(np.argmax(shares))] == limit == "snap"


def test_the_papers_time_is_enough_for_a_quarter_to_a_half_of_a_degree() -> None:
    """Of A1 0.281 deg, which is the README's figure."""
    sheet = Sheet()
    table = durations(sheet)
    assert not foreign("weld-bezier", sheet.comparisons)
    reached = table.iloc[:, -1]
    assert reached.tolist() == approx([0.2810, 0.2810, 0.2669, 0.2529, 0.2950, 0.4214], abs=5e-5)
    first = table[table["joint"] == "A1"].iloc[0]
    assert [round(float(first.iloc[i]), 1) for i in (1, 2, 3)] == [1.6, 2.8, 4.4]


def test_objectives_and_limits_name_where_the_text_has_them() -> None:
    """(19) is a vector of torques; the aim of little movement, and the shorter cycle, are in words only."""
    problem = problems.load("weld-bezier", case="air-move")
    at = {o.id: o.eq for o in problem.objectives}
    assert (at["effort"], at["movement"], at["air_time"]) == ("(1)", "sect. III-A", "sect. I")
    limits = {limit.id: limit.eq for limit in problem.requirements.path_constraints}
    assert (limits["position-limit"], limits["snap-limit"], limits["effort-limit"]) == ("(20)", "Table 3", "(25)")


def test_more_than_half_of_the_cells_are_beyond_the_limits() -> None:
    table = outside()
    assert table["of"].sum() == 60 and table["outside"].sum() == 32
    by_hand = sum(
        any(abs(value) > LIMITS[quantity][joint] for value in (mean[joint], most[joint]))
        for (_, quantity, _), (mean, most) in CELLS.items()
        for joint in range(6)
    )
    assert by_hand == 32


# --- errata ---


@pytest.mark.parametrize("t", [0.1, 0.5, 0.9])
def test_the_basis_sums_to_one_only_as_mended(t: float) -> None:
    assert sum_of_6(t, printed=False) == approx(1.0, abs=1e-12)
    assert abs(sum_of_6(t, printed=True) - 1.0) > 1e-3


def test_the_labels_of_8_are_right_only_as_mended() -> None:
    """B_0 = (1 - t)^9 and B_1 = 9 t (1 - t)^8, expanded."""
    left = Polynomial([1.0, -1.0])
    expected = [left**9, comb(9, 1) * Polynomial([0.0, 1.0]) * left**8]
    for label, polynomial in enumerate(expected):
        assert_allclose(coefficients_of_8(label, printed=False), polynomial.coef[::-1], atol=1e-9)
        assert np.abs(coefficients_of_8(label, printed=True) - polynomial.coef[::-1]).max() > 1.0
    assert [label for label, _ in PRINTED_8] == [0, 1, 1, 4]


@pytest.mark.parametrize("seed", range(4))
def test_the_end_conditions_hold_only_as_mended(seed: int) -> None:
    rng = np.random.default_rng(seed)
    state, duration = rng.normal(size=(5, 1)), rng.uniform(2.0, 6.0)
    assert end_residual(MENDED_18, state, duration, first=9) < 1e-9
    assert end_residual(ROWS_18, state, duration, first=5) > 1e-2
    assert end_residual(MENDED_18, state, duration, first=9, scaled=False) > 1e-2
    angles = rng.uniform(0.2, 1.2, 3)
    assert skewness(zyz(angles, printed=False)) < 1e-12
    assert skewness(zyz(angles, printed=True)) > 1e-2


def test_every_erratum_says_why() -> None:
    errata = equation_errata((-1.0, -4.0))
    assert len(errata) >= 18
    assert all(e.where and e.reason and e.printed != e.should_read for e in errata)


def test_table_7_does_not_fit_500_generations_of_200() -> None:
    (found,) = [e for e in equation_errata((-1.0, -4.0)) if e.where.startswith("Table 7, iterations")]
    assert found.printed == "10741 and 6000; 78401 and 1448471"
    assert 78401 < 500 * 200 < 1448471 and 10741 > 6000 > 500
    assert "21 times" in found.reason and "7.3 evaluations each" in found.reason and "14.5 times" in found.reason


def test_evolution_alone_starts_from_random_points_and_is_table_4s() -> None:
    problem = problems.load("hybrid-spline")  # where random points are feasible
    recipe = HMOGA(3, population=24, generations=5)
    once, again = (module.evolution_alone(recipe, problem, ("time", "energy")) for _ in range(2))
    assert once.info["evaluations"] == 24 * 5 and len(once.xs) <= 0.35 * 24
    assert [x.tolist() for x in once.xs] == [x.tolist() for x in again.xs]
    best = min(evaluate_objectives(problem, x)["time"] for x in once.xs)
    assert best > 1.02 * 2.4836  # [s]: nothing of IPOPT's, whose least time this is


# --- one trajectory ---


def test_jumps_at_tags_are_those_put_there() -> None:
    rng = np.random.default_rng(0)
    one = rng.normal(size=(10, 6))
    other = one[::-1].copy()  # meets the first in position; the mirror image turns odd derivatives round
    curve = PiecewiseBezier(np.array([1.0, 1.0]), (one, other))
    found = module.jumps(Trajectory(curve, tuple("abcdef")))
    assert found[0] < 1e-12 and found[2] < 1e-12 and found[4] < 1e-12
    assert found[1] > 0.01 and found[3] > 0.01


# --- all of it ---


@pytest.mark.slow
def test_the_reproduction_has_every_table_and_is_plain_json(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("POPULATION", 40), ("GENERATIONS", 30), ("POINTS", 4)):
        monkeypatch.setattr(module, name, value)
    torques, signed = list[tuple[float, float]](), module.signed_torques
    monkeypatch.setattr(module, "signed_torques", lambda *of: torques.append(signed(*of)) or torques[-1])
    found = reproduce("weld-bezier", seeds=1)
    assert json.loads(json.dumps(found.to_dict()))["format"] == "ocp-traj/reproduction/2"
    (cells,) = [c for c in found.comparisons if c.table == "Tables 5-11"]
    assert cells.ours == 32.0 and cells.verdict == "differs" and cells.paper is None
    ours = [run for run in found.runs if run.source == "ours"]
    assert all(run.verdict == "proved" for run in ours if "random points" not in run.method)
    (table,) = [t for title, t in found.extra.items() if title.startswith("MOGA beside HMOGA")]
    values = dict(zip(table["method"], table["hypervolume"], strict=True))
    ends, alone, plain = "MOGA from IPOPT's ends", "MOGA from random points", "NSGA-II from random points"
    assert list(values) == ["trace", ends, "HMOGA", alone, plain]
    assert values["HMOGA"] >= values[ends] > max(values[alone], values[plain])
    assert not foreign("weld-bezier", found.comparisons, found.runs)
    worth = found.extra["In place of R-square"].set_index("figure")
    assert float(worth.loc["jump of snap at the tags, of its largest value"].map(float).max()) < 1e-9
    ((first, twice),) = torques
    assert twice < first
    left_out = {f"Figure {n}" for n in (1, 2, 3, 4, 5, 6, 7, 13)}
    made = {f"Figure {n}": 6 for n in range(8, 22) if n != 13}
    check_folder(found, tmp_path, monkeypatch, made, left_out)
