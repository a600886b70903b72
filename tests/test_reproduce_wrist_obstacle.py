"""What the comparison with El Haiek et al. says: why the text is no problem, its errata, GA beside IPOPT."""

import json
from math import pi
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from ocp_traj import problems
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.reproductions.comparison import Comparison, Reproduction, Sheet
from ocp_traj.reproductions.reproduce import reproduce
from ocp_traj.reproductions.wrist_obstacle import dilations, equations, plane
from ocp_traj.reproductions.wrist_obstacle_errata import equation_errata, later_start, misses
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange
from tests.paper_column import foreign
from tests.reproduction_folder import check_folder


@pytest.fixture(scope="module")
def found() -> Reproduction:
    """All of the paper, with one seed."""
    return reproduce("wrist-obstacle", seeds=1)


def entry(found: Sheet | Reproduction, start: str) -> Comparison:
    (one,) = [c for c in found.comparisons if c.item.startswith(start)]
    return one


def random_curve(seed: int) -> PiecewiseBezier:
    problem = problems.load("wrist-obstacle", branch="0")
    return trajectory_of(problem, problem.guess(np.random.default_rng(seed))).curve


def test_in_the_plane_the_link_collides_at_the_goal_whatever_the_radius() -> None:
    sheet = Sheet()
    table = plane(sheet)
    assert len(table) == 3 and (table["link"] == "infeasible").all()
    assert table["why"].str.contains("touches the link at the goal").all()
    assert (table["least distance of the tip alone"] > 0.3).all()  # a test of the tip alone sees nothing
    assert entry(sheet, "obstacle's distance").verdict == "agrees"
    assert not foreign("wrist-obstacle", sheet.comparisons)


def test_the_printed_coefficients_miss_and_the_corrected_ones_do_not() -> None:
    for seed in range(5):
        curve = random_curve(seed)
        size = np.abs(np.concatenate(curve.control_points)).max()
        assert max(misses(curve, printed=False)) < 1e-9 * size
        assert max(misses(later_start(curve), printed=False)) < 1e-9 * size
        assert misses(later_start(curve), printed=True)[0] > 1e-3 and misses(curve, printed=True)[1] > 1e-3


def test_a_later_start_is_the_same_curve() -> None:
    curve = random_curve(7)
    part = later_start(curve, 0.3)
    u = np.linspace(0.0, 1.0, 11)
    for order in range(3):
        np.testing.assert_allclose(part.at(0, u, order), curve.at(0, 0.3 + 0.7 * u, order), rtol=1e-9, atol=1e-9)


def test_one_path_has_any_time_and_the_errata_have_their_numbers() -> None:
    problem = problems.load("wrist-obstacle", branch="0")
    best = Exchange().solve(problem, WeightedSum({"fitness": 1.0}), problem.guess(np.random.default_rng([0, 0])))
    table = dilations(best).set_index("scale")
    assert table["distance [rad]"].to_numpy() == approx(np.full(4, pi), abs=1e-6)
    assert table["time [s]"].to_numpy() == approx(1.3281469 * table.index.to_numpy(), rel=1e-6)
    assert table["time [s]"].iloc[0] == approx(0.2, abs=1e-4)
    assert table.loc[0.5, "peak v [rad/s]"] == approx(4.0, rel=1e-6)
    assert table.loc[0.5, "peak a [rad/s2]"] == approx(40.0, rel=1e-6)
    sheet = Sheet()
    turned = equations(sheet, best)
    verdicts = {c.item: c.verdict for c in sheet.comparisons}
    assert verdicts.pop("via point missed with (8) as printed") == "differs"
    assert verdicts.pop("goal missed, b4 as printed") == "differs"
    assert set(verdicts.values()) == {"agrees"} and len(verdicts) == 3
    assert not foreign("wrist-obstacle", sheet.comparisons)
    assert best.trajectory is not None
    errata = {erratum.where: erratum for erratum in equation_errata(best.trajectory.curve, turned)}
    assert {"(8)", "below (14)", "(19)", "(1)-(3), sect. 4", "sect. 4", "sect. 5, points", "sect. 5"} == set(errata)
    # Raised by sqrt(2), the goal (1, 1) lies 45 deg above the obstacle's direction, whose centre is sqrt(1/2) away.
    assert (
        "inferred" in errata["sect. 5, points"].reason
        and "centre is 0.5 off the link" in errata["sect. 5, points"].reason
    )
    assert "by 0.061 rad" in errata["(8)"].reason and "by 22.4 rad" in errata["below (14)"].reason


@pytest.mark.slow
def test_the_papers_column_holds_what_it_prints(found: Reproduction) -> None:
    assert not foreign("wrist-obstacle", found.comparisons, found.runs)


@pytest.mark.slow
def test_known_values_are_met_and_the_papers_are_not(found: Reproduction) -> None:
    for case, value in (("blocked", 4.46973957), ("open", 2.76640438)):
        (one,) = [c for c in found.comparisons if c.item == f"fitness, {case}"]
        assert one.ours == approx(value, abs=1e-6)


@pytest.mark.slow
def test_without_limits_time_is_its_bound(found: Reproduction) -> None:
    table = found.extra["Time without limits falls to its bound"]
    assert table["time [s]"].to_numpy() == approx(2.0 * table["bound of t1, t2 [s]"].to_numpy(), rel=1e-6)
    assert (table["verdict"] == "proved").all()
    assert entry(found, "time, t1 and t2 >= 0.1 s").verdict == "agrees"
    assert entry(found, "time, blocked").verdict == "differs"


@pytest.mark.slow
def test_the_genetic_algorithm_stands_beside_ipopt(found: Reproduction) -> None:
    (title,) = [title for title in found.extra if title.startswith("Genetic algorithm")]
    table = found.extra[title].set_index("method")
    assert "on 1 seed," in title and len(table) == 4
    ipopt = table.loc["IPOPT with exchange, one start"]
    assert ipopt["median gap"] == approx(0.0, abs=1e-7) and ipopt["within 0.1%"] == 1
    genetic = table.drop(index="IPOPT with exchange, one start")
    assert (genetic["proved"] == 1).all() and (genetic["median gap"] > 0.005).all()
    assert (genetic["median gap"] < 0.2).all() and (genetic["median effort"] == 16000).all()


@pytest.mark.slow
def test_everything_is_plain_json(found: Reproduction) -> None:
    plain = json.loads(json.dumps(found.to_dict(), default=float))
    assert plain["summary"]["Cases solved instead"] == {"agrees": 3, "erratum": 0, "differs": 0}
    assert "Runs" in found.tables and "Errata" in found.tables


@pytest.mark.slow
def test_the_folder_has_every_figure(found: Reproduction, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = {"Figure 3": 2, "Figure 4": 1, **{f"Figure {n}": 3 for n in (5, 6, 7)}, "Figure 8": 1, "Figure 9": 1}
    check_folder(found, tmp_path, monkeypatch, made, {"Figure 1", "Figure 2"})
