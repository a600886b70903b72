"""Certified fronts: no trajectory below the lower staircase, a gap that grows with what is missing, refusals."""

import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import casadi
import numpy as np
import pandas as pd
import pytest

import ocp_traj as ot
from ocp_traj import problems
from ocp_traj.cli.commands import run as run_command
from ocp_traj.errors import InputError
from ocp_traj.files import read_json
from ocp_traj.formulation.objective import Objective, SumOfSquares
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.plot import plot_front
from ocp_traj.io.store import save_run
from ocp_traj.results.front import Front
from ocp_traj.results.front_certificate import FrontCertificate
from ocp_traj.solvers.front_certifier import FrontCertifier
from ocp_traj.solvers.front_search import FrontRows, power_above, power_below
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.test_branch_and_bound import exact_time, small_problem

REFERENCE = {"time": 40.0, "acceleration": 12.0}


def strangers_problem(seed: int) -> Problem:
    """Durations and limits on derivatives of a problem of one's own; time against squared acceleration, as T^-3."""
    problem = small_problem(seed)
    square = Objective("acceleration", "rad2/s3", integrand=SumOfSquares(lambda s: s.a))
    squared = Objective("squared time", "s2", of_variables=lambda x, p: casadi.sum1(x) ** 2)
    power = Objective("power", "rad2/s3", integrand=lambda s: casadi.sumsqr(s.a) + casadi.sumsqr(s.q))
    return replace(
        problem,
        objectives=(*problem.objectives, square, squared, power),
        reference_point=REFERENCE,
    )


@lru_cache
def shapes(seed: int) -> tuple[Problem, np.ndarray]:
    """Random ratios, each as quick as its limits allow, and slowed down: vectors ``(N, 3)``."""
    problem, rng = strangers_problem(seed), np.random.default_rng(seed)
    found = []
    for ratios in np.exp(rng.normal(scale=0.6, size=(150, 3))):
        quickest = ratios / ratios.sum() * exact_time(problem, ratios) * (1.0 + 1e-9)
        found += [quickest, 1.3 * quickest, 2.5 * quickest]
    inside = [x for x in found if (x <= problem.upper).all() and (x >= problem.lower).all()]
    return problem, np.array(inside)


@lru_cache
def certified(seed: int) -> Front:
    problem, xs = shapes(seed)
    front = Front.of(problem, ["time", "acceleration"], xs, method="", seed=0, seconds=0.0)
    return FrontCertifier(tolerance=0.05, max_boxes=12_000).certify(front)


def bound_at(certificate: FrontCertificate, first: float) -> float:
    """The lower staircase at a value of the first objective."""
    index = int(np.searchsorted(certificate.bound[:, 0], first, side="right")) - 1
    return np.inf if index < 0 else float(certificate.bound[index, 1])


@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 1))])
def test_no_random_trajectory_lies_below_the_lower_staircase(seed: int) -> None:
    problem, xs = shapes(seed)
    certificate = certified(seed).certificate
    assert certificate is not None and len(xs) > 200
    nearest = np.inf
    for x in xs:
        values = evaluate_objectives(problem, x)
        if values["time"] < 40.0 and values["acceleration"] < 12.0:
            bound = bound_at(certificate, values["time"])
            assert values["acceleration"] >= bound * (1.0 - 1e-12)
            nearest = min(nearest, values["acceleration"] / bound)
    assert nearest < 1.2  # nor is the bound far away


def test_the_gap_is_the_hypervolume_between_the_staircases() -> None:
    front = certified(2)
    certificate = front.certificate
    assert certificate is not None and 0.0 < certificate.gap < 0.2
    table, corner = certificate.table, list(REFERENCE.values())
    volumes = {}
    for kind in ("attained", "bound"):
        stairs = table[table.staircase == kind].iloc[:, 1:].to_numpy(dtype=float)
        assert (np.diff(stairs[:, 0]) > 0.0).all() and (np.diff(stairs[:, 1]) < 0.0).all()
        ends = np.append(stairs[1:, 0], corner[0])
        volumes[kind] = float((ends - stairs[:, 0]) @ (corner[1] - stairs[:, 1]))
    assert volumes["attained"] == pytest.approx(front.hypervolume(REFERENCE).volume, rel=1e-9)
    assert volumes["attained"] == pytest.approx(certificate.volume, rel=1e-9)
    assert volumes["bound"] == pytest.approx(certificate.most, rel=1e-9)
    assert certificate.gap == pytest.approx(1.0 - volumes["attained"] / volumes["bound"], rel=1e-6)


@pytest.mark.slow
def test_a_front_that_is_worse_shows_what_it_lacks() -> None:
    """Its gap is larger by the share of the hypervolume that it has less."""
    front = certified(2)
    assert front.certificate is not None
    worse = Front.of(
        front.problem, front.objectives, [1.1 * p.x for p in front.points[::3]], method="", seed=0, seconds=0.0
    )
    again = FrontCertifier(tolerance=0.05, max_boxes=12_000).certify(worse).certificate
    assert again is not None and not again.certified and "not certified to 5 %" in again.explain()
    lost = 1.0 - worse.hypervolume().volume / front.hypervolume().volume
    assert lost > 0.02
    expected = 1.0 - (1.0 - front.certificate.gap) * (1.0 - lost)
    assert again.gap == pytest.approx(expected, abs=0.01)


@pytest.mark.slow
def test_objectives_may_come_the_other_way_round_and_grow_otherwise_than_time() -> None:
    problem, xs = shapes(2)
    both = []
    for names, reference in (
        (["acceleration", "time"], REFERENCE),
        (["squared time", "acceleration"], {"squared time": 1600.0, "acceleration": 12.0}),
    ):
        front = Front.of(problem, names, xs, method="", seed=0, seconds=0.0)
        certificate = FrontCertifier(max_boxes=2000).certify(front, reference).certificate
        assert certificate is not None and certificate.objectives[1] == "acceleration"
        both.append(certificate)
        assert all(corner[1] >= bound_at(certificate, corner[0]) for corner in certificate.attained)
    plain = certified(2).certificate
    assert plain is not None and both[0].gap < plain.gap + 0.15 and both[1].gap < 0.3


@pytest.mark.slow
def test_curves_of_boxes_are_below_every_motion_in_them() -> None:
    problem = strangers_problem(1)
    rows = FrontRows(problem, ("time", "acceleration"))
    rng = np.random.default_rng(1)
    middle, width = np.exp(rng.normal(size=(20, 2))), np.exp(rng.uniform(-7.0, 0.5, (20, 1)))
    low, high = middle / (1.0 + width), middle * (1.0 + width)
    curves, reached = rows.over(low, high)
    assert (reached.start >= curves.start).all() and (curves.level > 0.0).all()
    for i in range(20):
        for z in rng.uniform(low[i], high[i], (10, 2)):
            ratios = np.append(1.0, z)
            time = exact_time(problem, ratios)
            for slower in (1.0, 1.7):
                x = ratios / ratios.sum() * time * slower
                if (x < problem.lower).any() or (x > problem.upper).any():
                    continue
                value = evaluate_objectives(problem, x)["acceleration"]
                t = float(x.sum())
                assert t >= curves.start[i] * (1.0 - 1e-12)
                assert value >= max(curves.level[i] * t**-3, curves.floor[i]) * (1.0 - 1e-12)


def test_bounds_of_powers() -> None:
    from fractions import Fraction

    base = np.exp(np.random.default_rng(0).uniform(-20.0, 20.0, 200))
    for exponent in (Fraction(-5), Fraction(-5, 3), Fraction(1, 7), Fraction(0)):
        low, high = power_below(base, exponent), power_above(base, exponent)
        exact = np.exp(np.longdouble(exponent.numerator) / exponent.denominator * np.log(base.astype(np.longdouble)))
        assert (low <= exact).all() and (exact <= high).all() and (high / low < 1.0 + 1e-12).all()


@pytest.mark.parametrize(
    ("name", "objectives", "words"),
    [
        ("hybrid-spline", ["time", "jerk"], "not durations of segments alone"),
        ("rotor-353", ["time", "effort"], "effort is no power of time"),
        ("rotor-353", ["time", "effort", "jerk"], "give two objectives"),
        ("wrist-obstacle", ["time", "clearance"], "leaves a choice open"),
    ],
)
def test_what_cannot_be_certified_is_refused_before_any_work(name: str, objectives: list[str], words: str) -> None:
    with pytest.raises(InputError, match=words):
        ot.pareto(problems.load(name), objectives, certify=True)


def test_objectives_that_both_grow_and_those_of_no_degree_are_refused() -> None:
    problem = strangers_problem(0)
    with pytest.raises(InputError, match=r"they go as time as T\^1, squared time as T\^2"):
        ot.pareto(problem, ["time", "squared time"], certify=True)
    with pytest.raises(InputError, match="power is no power of time"):
        ot.pareto(problem, ["time", "power"], certify=True)
    # A curve that moves with a duration is none of ratios, whatever the problem says of itself.
    moved = replace(problem, id="moved", curve=lambda x: problem.curve(x + 0.1))
    with pytest.raises(InputError, match="not durations of segments alone"):
        ot.pareto(moved, ["time", "acceleration"], certify=True)
    with pytest.raises(InputError, match="between 0 and 1"):
        FrontCertifier(tolerance=2.0)


@pytest.mark.slow
def test_a_run_folder_holds_both_staircases_and_the_picture_shades_between(tmp_path: Path) -> None:
    front = certified(2)
    certificate = front.certificate
    assert certificate is not None
    folder = save_run(front, tmp_path / "run")
    table = pd.read_csv(folder / "bounds.csv")
    pd.testing.assert_frame_equal(table, certificate.table, check_exact=True)
    told = read_json(folder / "run.json", "run")["certificate"]
    assert told["gap"] == certificate.gap and told["left_out"] == []
    svg = plot_front(front, tmp_path / "front.svg").read_text()
    assert "no trajectory is below" in svg and "not decided" in svg
    assert "no trajectory is below" not in plot_front(replace(front, certificate=None), tmp_path / "b.svg").read_text()
    save_run(replace(front, certificate=None), folder, force=True)
    assert not (folder / "bounds.csv").exists() and "certificate" not in read_json(folder / "run.json", "run")


@pytest.mark.slow
def test_a_front_of_30_points_is_certified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = "pareto rotor-353 --objectives time,jerk --points 30 --certify -o"
    assert run_command([*arguments.split(), str(tmp_path / "run")]) == 0
    words = capsys.readouterr().err
    found = re.search(r"front certified: .* is at most ([\d.]+) %", words)
    assert found is not None and float(found[1]) < 0.3
    assert read_json(tmp_path / "run" / "run.json", "run")["certify"] is True


@pytest.mark.slow
def test_the_command_refuses_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = "pareto rotor-353 --objectives time,effort --certify -o"
    assert run_command([*arguments.split(), str(tmp_path / "run")]) == 2
    assert "cannot be certified" in capsys.readouterr().err and not (tmp_path / "run").exists()
