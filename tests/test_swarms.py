"""Populations that look for one objective, or a front, by themselves: PSO, the genetic algorithm, MOPSO."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import ocp_traj as ot
from ocp_traj import problems
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.evolution.evolution import HANDLING, WORST, PymooProblem
from ocp_traj.evolution.population import Population
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.io.plot_convergence import plot_convergence
from ocp_traj.solvers.ga import GA, fittest
from ocp_traj.solvers.mopso import MOPSO
from ocp_traj.solvers.pso import PSO, SCHEDULES, as_printed, constriction, linear, repaired
from ocp_traj.transcription.nlp import Status
from tests.closed_form import Quintic, quintic_problem

TIME = WeightedSum({"time": 1.0})
SOLVERS: list[Any] = [
    *(PSO(population=12, generations=25, schedule=schedule) for schedule in SCHEDULES),
    PSO(population=12, generations=25, handling="penalty"),
    GA(population=20, generations=15),
    GA(population=20, generations=15, handling="death"),
]


@pytest.fixture(scope="module")
def rotor() -> Problem:
    return problems.load("rotor-353")


# --- schedules ---


def test_inertia_runs_between_the_paper_s_ends_and_only_as_printed_below_them() -> None:
    """w_max = 0.9 and w_min = 0.4 (sect. 4); after 0.6 of the iterations 0.2 to 0.3, at random."""
    shares = np.linspace(0.0, 0.6, 61)
    inertias = {f: np.array([f(t, 0.5)[0] for t in shares]) for f in (as_printed, repaired, linear)}
    assert all((np.diff(inertia) < 0.0).all() for inertia in inertias.values())
    assert [inertia[0] for inertia in inertias.values()] == [0.5, 0.9, 0.9]
    assert inertias[as_printed][-1] == pytest.approx(0.3406, abs=5e-5)  # 0.5 cos^2(0.6)
    assert inertias[repaired][50] == pytest.approx(0.65)  # the middle: cos^2(pi / 4) is a half
    assert linear(0.5, 0.5)[0] == pytest.approx(0.65) and linear(1.0, 0.5)[0] == pytest.approx(0.4)
    for schedule in (as_printed, repaired):
        assert [schedule(0.61, r)[0] for r in (0.0, 0.25, 1.0)] == pytest.approx([0.2, 0.225, 0.3])


def test_a_swarm_learns_from_itself_at_first_and_from_the_others_in_the_end() -> None:
    for schedule in (as_printed, repaired):
        assert schedule(0.0, 0.0)[1:] == (2.0, 0.0)
        assert schedule(0.75, 0.0)[1:] == pytest.approx((1.0, 2.0))
        assert schedule(1.0, 0.0)[1:] == pytest.approx((0.5, 1.5))
    assert linear(0.3, 0.0)[1:] == (2.0, 2.0)


def test_constriction_is_clerc_and_kennedy_s() -> None:
    """chi = 0.7298 for phi = 4.1, of which each learning factor gets half: 1.4962."""
    assert constriction(0.3, 0.0) == constriction(0.9, 1.0) == pytest.approx((0.7298, 1.4962, 1.4962), abs=5e-5)


# --- one objective ---


@pytest.mark.slow
@pytest.mark.parametrize(
    "solver", SOLVERS, ids=lambda s: f"{type(s).__name__} {getattr(s, 'schedule', '')} {s.handling}"
)
def test_what_a_population_finds_is_proved_repeatable_and_no_better_than_the_optimum(
    solver: Any, rotor: Problem
) -> None:
    found, again = solver.solve(rotor, TIME), solver.solve(rotor, TIME)
    assert found.status is Status.FEASIBLE and found.audit is not None and found.audit.proved
    assert np.array_equal(found.x, again.x)
    assert found.objectives["time"] == pytest.approx(found.x.sum())
    assert found.objectives["time"] >= 1.7313605  # certified: see test_rotor_353
    other = replace(solver, seed=1).solve(rotor, TIME)
    assert not np.array_equal(found.x, other.x)
    best = found.history["best"].dropna().to_numpy()
    assert (np.diff(best) <= 0.0).all() and found.history["evaluations"].is_monotonic_increasing


@pytest.mark.slow
def test_a_long_swarm_comes_within_a_thousandth_of_the_certified_optimum(rotor: Problem) -> None:
    found = PSO(schedule="repaired", generations=150).solve(rotor, TIME)
    assert found.objectives["time"] == pytest.approx(1.731362, rel=1e-3)


def test_nothing_feasible_is_said_so() -> None:
    problem = quintic_problem(Quintic(velocity=1e-3))  # T >= 1875 s, at most 10 s allowed
    with pytest.raises(NoSolutionFound, match="quintic: no individual of pso met every limit in 4 generations of 6"):
        PSO(population=6, generations=4).solve(problem, TIME)


def test_an_interrupted_run_keeps_its_best(rotor: Problem) -> None:
    def stop(done: int, total: int, words: str) -> None:
        if done == 6:
            raise KeyboardInterrupt

    found = PSO(population=20, progress=stop).solve(rotor, TIME)
    assert len(found.history) == 6 and found.audit is not None and found.audit.proved


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: PSO(population=1), "population is 1; give a whole number, 2 or more"),
        (lambda: PSO(schedule="fast"), "schedule is 'fast'; allowed are as_printed"),
        (lambda: PSO(handling="death"), "allowed are feasibility, penalty"),
        (lambda: GA(population=3), "4 or more"),
        (lambda: GA(handling="penalty"), "allowed are feasibility, death"),
        (lambda: MOPSO(0, variant="x"), "variant is 'x'; allowed are competitive, crowding"),
        (lambda: MOPSO(0, population=2), "population is 2; give a whole number, 4 or more"),
    ],
)
def test_bad_settings_are_refused(build: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        build()


def test_a_weighted_sum_is_refused(rotor: Problem) -> None:
    with pytest.raises(InputError, match="pso minimises one objective"):
        PSO().solve(rotor, WeightedSum({"time": 1.0, "jerk": 1.0}))


# --- how limits are handled ---


def test_a_tournament_is_won_by_the_feasible_and_among_those_by_the_fitter() -> None:
    known = {"F": np.array([[1.0], [3.0], [2.0], [0.5]]), "CV": np.array([[0.2], [0.0], [0.0], [0.1]])}
    groups = np.array([[0, 1, 2], [0, 1, 1], [0, 3, 0]])
    assert fittest(known, groups).ravel().tolist() == [2, 1, 3]


@pytest.mark.parametrize("handling", HANDLING)
def test_a_feasible_individual_is_as_it_is_and_a_broken_one_is_worse(handling: str, rotor: Problem) -> None:
    target = PymooProblem(rotor, ["time"], 15, handling)
    x = np.array([[1.0, 2.0, 1.0], [0.4, 0.8, 0.3], [0.2, 0.5, 0.2]])
    out: dict[str, Any] = {}
    target._evaluate(x, out)
    excess = Population(rotor, ["time"], 15).evaluate(x).violations.clip(min=0.0).sum(axis=1)
    assert out["excess"] == pytest.approx(excess) and excess[0] == 0.0 < excess[1] < excess[2]
    assert out["F"][0, 0] == 4.0
    if handling == "feasibility":
        assert (out["F"][:, 0] == x.sum(axis=1)).all() and (out["G"].max(axis=1) > 0.0).tolist() == [False, True, True]
    elif handling == "penalty":
        assert out["F"][1:, 0] == pytest.approx(x[1:].sum(axis=1) + 1e3 * excess[1:])
    elif handling == "death":
        assert (out["F"][1:, 0] == WORST).all()
    else:
        assert WORST < out["F"][1, 0] < out["F"][2, 0]


def test_parabolas_between_instants_come_closer_to_the_peaks(rotor: Problem) -> None:
    rng = np.random.default_rng(0)
    xs = np.array([rotor.guess(rng) for _ in range(20)])
    exact = Population(rotor, ["time"], 2001).evaluate(xs).violations
    coarse = np.abs(Population(rotor, ["time"], 15).evaluate(xs).violations - exact)
    fine = np.abs(Population(rotor, ["time"], 15, refine=True).evaluate(xs).violations - exact)
    assert np.median(fine.max(axis=1)) < 0.3 * np.median(coarse.max(axis=1))


# --- fronts ---


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["competitive", "crowding"])
def test_a_swarm_s_front_is_proved_and_repeatable(variant: str, rotor: Problem) -> None:
    options = {"method": "mopso", "population": 24, "generations": 15, "variant": variant}
    front, again = (ot.pareto(rotor, ["time", "jerk"], seed=3, **options) for _ in range(2))
    assert len(front) >= 3 and (front.table["verdict"] == "proved").all()
    assert front.table.equals(again.table)


@pytest.mark.slow
def test_mopso_covers_most_of_what_the_trace_does() -> None:
    """Reference (8 s, 6000), ideal (2.4836 s, 1565.2): the trace has 0.709 of the box, NSGA-II 0.70."""
    front = ot.pareto(problems.load("hybrid-spline"), ["time", "energy"], method="mopso")
    assert front.hypervolume(ideal={"time": 2.4836, "energy": 1565.2}).value > 0.69


# --- API and command line ---


def test_options_that_a_method_does_not_have_are_refused(rotor: Problem) -> None:
    with pytest.raises(InputError, match="pso has no option 'tournament'"):
        ot.solve(rotor, method="pso", tournament=3)
    with pytest.raises(InputError, match="nsga2 has no option 'points'"):
        ot.pareto(rotor, ["time", "jerk"], method="nsga2", points=4)
    with pytest.raises(InputError, match="methods are exchange, pso, ga"):
        ot.solve(rotor, method="simplex")


def options(*given: str) -> list[str]:
    """Options of a method, as the command line takes them."""
    return [word for text in given for word in ("--option", text)]


@pytest.mark.slow
def test_the_command_line_runs_a_swarm_and_draws_its_history(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    picture, table = tmp_path / "h.png", tmp_path / "h.csv"
    for target in (picture, table):
        arguments = ["solve", "rotor-353", "--method", "pso", "--history", str(target)]
        assert run([*arguments, *options("population=12", "generations=20", "schedule=linear")]) == 0
        assert "feasible, not optimal" in capfd.readouterr().err
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert list(pd.read_csv(table).columns) == ["generation", "evaluations", "best", "violation", "objective"]
    assert run(["solve", "rotor-353", "--history", str(picture)]) == 2
    assert "--history is of a population" in capfd.readouterr().err


@pytest.mark.slow
def test_the_papers_recipe_keeps_the_history_of_every_joint(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Each joint is a swarm of its own, and none of their histories is lost."""
    arguments = ["solve", "rotor-353", "--set", "timing=per_joint", "--set", "position_limits=false", "--method", "pso"]
    few = options("population=8", "generations=5")
    table, picture = tmp_path / "h.csv", tmp_path / "h.svg"
    for target in (table, picture):
        assert run([*arguments, *few, "--history", str(target)]) in (0, 1)  # what the longest phases break is audited
        assert f"history: {target}" in capfd.readouterr().err
    found = pd.read_csv(table)
    assert list(found.columns) == ["part", "generation", "evaluations", "best", "violation", "objective"]
    joints = found.groupby("part", sort=False)["generation"].agg(list)
    assert len(joints) == 6 and all(generations == joints.iloc[0] for generations in joints)
    assert all(len(generations) == 5 for generations in joints)
    assert all(name in picture.read_text() for name in joints.index)


def test_several_histories_share_a_picture(tmp_path: Path, rotor: Problem) -> None:
    histories = {name: PSO(0, 8, 5, name).run(rotor, "time")[0].history for name in ("linear", "repaired")}
    assert plot_convergence(histories, tmp_path / "both.svg", lower=1.7313).stat().st_size > 1000
