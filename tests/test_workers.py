"""Workers change nothing but the time: a job is its content, its answer is found again, a dead worker is replaced."""

import json
import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.errors import InputError
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, WeightedSum
from ocp_traj.parallel.choice import workers_for
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.processes import Processes, WorkerDied
from ocp_traj.parallel.recipe import Recipe
from ocp_traj.parallel.workers import Pending, Workers
from ocp_traj.results.records import OPENING, Record
from ocp_traj.results.records import SOLVE as SOLVES
from ocp_traj.results.solution_records import of_solution
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_tracer import FrontTracer
from ocp_traj.solvers.hmoga import HMOGA
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.memetic import Memetic
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.waves import SOLVE, second
from tests.closed_form import quintic_problem, stairs_problem

PAIR = ("time", "energy")
TASK = Path(__file__).parents[1] / "examples" / "tasks" / "ur5-via.toml"
ID = "tests.test_workers:arm"  # of an own problem that workers can build


def arm() -> Problem:
    return replace(quintic_problem(), id=ID)


def quintic() -> Problem:
    return ot.problems.load(ID)


def job(problem: Problem, **changes: Any) -> Job:
    given = {"solver": Exchange(), "scalarisation": WeightedSum({"time": 1.0}), "x0": np.array([3.0])}
    return Job(SOLVE, problem, given | changes)


class Ahead(Workers):
    """This process, which does jobs as soon as they are submitted, and in reverse where several are asked for."""

    count = 3

    def _begin(self, job: Job) -> Pending:
        pending = super()._begin(job)
        pending.result()
        return pending


# --- keys ---


def test_a_key_is_of_all_that_an_answer_depends_on() -> None:
    problem = quintic()
    keys = {
        job(problem).key,
        job(problem, x0=np.array([np.nextafter(3.0, 4.0)])).key,
        job(problem, scalarisation=WeightedSum({"time": 2.0})).key,
        job(problem, scalarisation=EpsilonConstraint("time", {"effort": 90.0})).key,
        job(problem, solver=Exchange(prove=False)).key,
        job(problem, solver=Exchange(Ipopt(tol=1e-9))).key,
        Job("another:function", problem, job(problem).arguments).key,
        job(ot.problems.load("hybrid-spline")).key,
        job(ot.problems.load("hybrid-spline", payload=1.0)).key,
    }
    assert len(keys) == 9 and "" not in keys
    assert job(quintic()).key == job(problem).key
    assert job(problem, solver=Exchange(progress=lambda *words: None)).key == ""  # nobody can name that


def test_an_answer_does_not_make_keys_depend_on_the_seconds_it_took() -> None:
    problem = quintic()
    (answer,) = Workers().run([job(problem)])
    solution = answer["solution"]
    later = {**solution, "seconds": solution["seconds"] + 1.0}
    one, two, other = (job(problem, warm={"solution": s}).key for s in (solution, later, {**solution, "f": 0.0}))
    assert one == two != other


def test_a_problem_that_was_changed_in_python_is_told_from_the_one_that_its_id_makes() -> None:
    problem = quintic()
    assert Recipe.of(problem).build().labels == problem.labels
    slower = replace(problem, reference_point={"time": 5.0, "effort": 100.0})
    assert job(slower).key != job(problem).key
    with pytest.raises(InputError, match="built again of its case is not the problem that was given"):
        Recipe.of(slower).build()


@pytest.mark.slow
def test_a_recipe_knows_the_level() -> None:
    problem = ot.problems.load("task", file=str(TASK), **{"curve.kind": "auto"})
    assert problem.levels is not None and problem.levels.finer is not None
    finer = problem.levels.finer()
    assert finer.size > problem.size
    for level in (problem, finer):
        assert Recipe.of(level).build().size == level.size


def test_an_own_problem_is_refused_by_workers_in_one_line() -> None:
    with pytest.raises(InputError, match="a problem of this process alone.*module:function"):
        ot.pareto(quintic_problem(), ["time", "effort"], workers=2)
    with pytest.raises(InputError, match="workers is -1"):
        workers_for(quintic(), -1)
    with pytest.raises(InputError, match="not both"):
        workers_for(quintic(), 2, "tcp://127.0.0.1:1")
    with pytest.raises(InputError, match="nsga2 does all of its work in one process"):
        ot.pareto(quintic(), ["time", "effort"], method="nsga2", workers=2)


# --- the same whoever works ---


@pytest.mark.parametrize("objectives", [["time", "effort"], ["time", "effort", "speed"]])
def test_what_is_begun_ahead_changes_no_bit_of_a_front(objectives: list[str]) -> None:
    told: list[list[Record]] = [[], []]
    fronts = []
    for workers, records in zip((Workers(), Ahead()), told, strict=True):
        tracer = FrontTracer(points=9, workers=workers, found=records.append)
        fronts.append(tracer.pareto(quintic(), objectives))
    assert np.array_equal(fronts[0].xs, fronts[1].xs) and fronts[0].info == fronts[1].info
    assert [r["points"] for r in told[0]] == [r["points"] for r in told[1]]
    assert [r.get("key") for r in told[0]] == [r.get("key") for r in told[1]]


def test_the_ends_of_a_front_are_begun_together() -> None:
    submitted: list[str] = []

    class Told(Ahead):
        def _begin(self, job: Job) -> Pending:
            submitted.append(str(job.arguments["scalarisation"].names))
            return super()._begin(job)

    told: list[int] = []
    FrontTracer(points=2, workers=Told(), found=lambda _: told.append(len(submitted))).pareto(
        quintic(), ["time", "effort"]
    )
    assert told[0] >= 2 and len(set(submitted[: told[0]])) == 2


@pytest.mark.slow
def test_what_is_begun_ahead_changes_no_bit_of_a_front_of_three_objectives() -> None:
    names = ["time", "first", "second"]
    one, ahead = (FrontTracer(points=8, workers=w).pareto(stairs_problem(), names) for w in (Workers(), Ahead()))
    assert np.array_equal(one.xs, ahead.xs) and one.info == ahead.info


WAVES = {
    "memetic": Memetic(0, population=12, generations=6, every=3, chosen=5, points=6),
    "hmoga": HMOGA(0, population=12, generations=4, points=9),
}


@pytest.mark.parametrize("method", WAVES)
def test_local_solves_of_a_population_that_are_begun_ahead_or_answered_change_nothing(method: str) -> None:
    told: list[Record] = []
    whole = replace(WAVES[method], found=told.append).pareto(quintic(), ["time", "effort"])
    kept = json.loads(json.dumps([record for record in told if record.get("key")]))
    known = Workers({record["key"]: record for record in kept})
    for workers in (Ahead(), known):
        again = replace(WAVES[method], workers=workers).pareto(quintic(), ["time", "effort"])
        assert np.array_equal(again.xs, whole.xs)
        assert all(again.info[name] == whole.info[name] for name in ("solves", "iterations"))
    assert known.answered >= whole.info["solves"] > 4
    assert sum(record["kind"] == SOLVES for record in kept) >= whole.info["solves"]


@pytest.mark.slow
@pytest.mark.parametrize("method", WAVES)
def test_two_processes_find_the_same_points_around_a_population(method: str) -> None:
    here = WAVES[method].pareto(quintic(), ["time", "effort"])
    with Processes(2) as workers:
        there = replace(WAVES[method], workers=workers).pareto(quintic(), ["time", "effort"])
    assert np.array_equal(there.xs, here.xs)


def test_a_second_solve_is_followed_where_it_may_be_better() -> None:
    """Beside the optimum it ends with its first NLP; beside a worse point it is followed."""
    problem, scalar = quintic(), WeightedSum({"time": 1.0})
    best = Exchange().solve(problem, scalar, np.array([3.0]))
    worse = replace(best, f=1.01 * best.f, x=1.01 * best.x)
    given_up, followed = (
        second(problem, Exchange(), scalar, np.array([4.0]), {"solution": of_solution(known)})
        for known in (best, worse)
    )
    assert given_up["kind"] == OPENING and given_up["first"]["iterations"] > 0
    assert followed["kind"] == SOLVES
    assert float(followed["f"]) == pytest.approx(best.f, rel=1e-8)


def wavy() -> Problem:
    """The quintic with an objective of many valleys, the deepest near 4 s."""
    problem = quintic()
    wavy = Objective("wavy", "-", of_variables=lambda x, p: casadi.sin(8.0 * x[0]) + 0.05 * (x[0] - 4.0) ** 2 + 2.0)
    return replace(problem, objectives=(*problem.objectives, wavy))


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"all_optima": True}])
def test_starts_begun_ahead_are_shared_and_given_up_as_one_after_the_other(options: dict[str, Any]) -> None:
    one, ahead = (
        Multistart(starts=8, seed=1, workers=workers, **options).solve(wavy(), WeightedSum({"wavy": 1.0}))
        for workers in (Workers(), Ahead())
    )
    assert one.x.tolist() == ahead.x.tolist()
    assert (one.starts, one.given_up) == (ahead.starts, ahead.given_up)
    assert one.given_up > 0 if not options else len(one.optima) > 1
    assert [(o.solution.f, o.starts, o.sampled) for o in one.optima] == [
        (o.solution.f, o.starts, o.sampled) for o in ahead.optima
    ]


def test_runs_of_a_population_that_are_begun_ahead_change_nothing() -> None:
    options: dict[str, Any] = {"objective": "time", "method": "pso", "starts": 3, "generations": 4, "population": 10}
    one, ahead = (ot.solve(quintic(), workers=workers, **options) for workers in (Workers(), Ahead()))
    assert one.x.tolist() == ahead.x.tolist() and one.detail == ahead.detail
    assert one.history is not None and one.history.equals(ahead.history)


@pytest.mark.slow
@pytest.mark.parametrize("objectives", [["time", "effort"], ["time", "effort", "speed"]])
def test_finished_work_is_answered_and_the_front_is_the_same(objectives: list[str]) -> None:
    """Half of the records are lost, as where a run was killed."""
    told: list[Record] = []
    whole = FrontTracer(points=9, found=told.append).pareto(quintic(), objectives)
    kept = json.loads(json.dumps(told))
    for part in (kept[: len(kept) // 2], kept):
        known = Workers({record["key"]: record for record in part if record.get("key")})
        again = FrontTracer(points=9, workers=known).pareto(quintic(), objectives)
        assert np.array_equal(again.xs, whole.xs)
        assert known.answered == len(known.known)
        assert {name: again.info[name] for name in ("solves", "iterations", "failed")} == {
            name: whole.info[name] for name in ("solves", "iterations", "failed")
        }


# --- processes ---


def pid(problem: Problem) -> Answer:
    return {"pid": os.getpid()}


def dies(problem: Problem, times: int, folder: str) -> Answer:
    """Kills its process so many times, and then answers."""
    number = len(list(Path(folder).iterdir()))
    if number < times:
        (Path(folder) / str(number)).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"times": number}


def dying(times: int, folder: Path) -> Job:
    folder.mkdir()
    return Job("tests.test_workers:dies", quintic(), {"times": times, "folder": str(folder)})


@pytest.mark.slow
def test_processes_find_the_same_bytes_and_a_killed_one_costs_nothing_else() -> None:
    here = FrontTracer(points=9).pareto(quintic(), ["time", "effort"])
    with Processes(2) as workers:
        (answer,) = workers.run([Job("tests.test_workers:pid", quintic(), {})])
        assert answer["pid"] != os.getpid()

        def kill(done: int, total: int, words: str) -> None:
            if done == 4:
                os.kill(answer["pid"], signal.SIGKILL)

        tracer = FrontTracer(points=9, workers=workers, progress=kill)
        assert np.array_equal(tracer.pareto(quintic(), ["time", "effort"]).xs, here.xs)
        assert workers.deaths == 1


@pytest.mark.slow
def test_a_job_that_kills_every_worker_is_named_and_others_are_answered(tmp_path: Path) -> None:
    with Processes(1) as workers:
        worst, beside = (workers.submit(dying(times, tmp_path / str(times))) for times in (9, 0))
        with pytest.raises(WorkerDied, match="3 times at one job, the last time alone: dies of tests.test_workers:arm"):
            worst.result()
        assert beside.result()["times"] == 0
