"""Commands that solve a problem: for a trajectory, and for the largest payload."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ocp_traj.blas import one_blas_thread
from ocp_traj.cli import console
from ocp_traj.cli.app import DONE, NOT_PROVED, app
from ocp_traj.cli.arguments import (
    AsJson,
    ClusterAddress,
    Fields,
    Options,
    ProblemName,
    Seed,
    WorkerCount,
    load_problem,
    number,
    pairs,
)
from ocp_traj.cli.verdict import verdict
from ocp_traj.errors import InputError, cut
from ocp_traj.files import check_writable
from ocp_traj.solvers import methods
from ocp_traj.stopping import stopping

if TYPE_CHECKING:
    from ocp_traj.formulation.problem import Problem
    from ocp_traj.results.solution import Solution


@app.command()
@one_blas_thread
def solve(
    problem: ProblemName,
    objective: Annotated[str | None, typer.Option(metavar="NAME", help="Minimise this objective.")] = None,
    weight: Annotated[
        list[str] | None, typer.Option(metavar="NAME=W", help="Minimise sum W f / scale; may be repeated.")
    ] = None,
    set_: Fields = None,
    method: Annotated[str, typer.Option(help=f"One of: {', '.join(methods.SOLVE)}.")] = "exchange",
    option: Options = None,
    starts: Annotated[
        int | None,
        typer.Option(
            help="Random starts, the best counts; the problem's own number if not given.", min=1, max=methods.MOST
        ),
    ] = None,
    start: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN|FILE", help="Begin at an earlier result, not at random: a trajectory, or a run's best point."
        ),
    ] = None,
    refine: Annotated[bool, typer.Option(help="Hand the best of a population (pso, ga) to IPOPT.")] = False,
    all_optima: Annotated[bool, typer.Option(help="List every distinct local optimum that a start ends in.")] = False,
    certify: Annotated[
        bool | None,
        typer.Option(
            "--certify/--no-certify", help="Prove global optimality by branch and bound; done where it applies."
        ),
    ] = None,
    seed: Seed = 0,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Write the trajectory here (JSON).")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the trajectory here (PNG, PDF or SVG).")] = None,
    history: Annotated[
        Path | None, typer.Option(help="Draw (PNG, PDF or SVG) or write (CSV) how a population converged.")
    ] = None,
    workers: WorkerCount = 0,
    cluster: ClusterAddress = None,
    json: AsJson = False,
) -> int:
    """Solves a problem and proves the result.

    Example: ocp-traj solve hybrid-spline --objective time -o fast.json
    """
    from ocp_traj.api import solving
    from ocp_traj.cli import sheets

    if plot is not None or history is not None:
        from ocp_traj.io.plot_style import check_picture

    weights = {name: number(value, f"--weight {cut(name)}") for name, value in pairs(weight, "--weight").items()}
    chosen = load_problem(problem, set_)
    targets = [path for path in (output, plot, history) if path is not None]
    if len(set(targets)) < len(targets):
        raise InputError(f"{', '.join(map(str, targets))} name one file twice; give each its own")
    if plot is not None:
        check_picture(plot)
    if history is not None:
        if method == "exchange":
            raise InputError("--history is of a population; give --method pso or ga")
        if history.suffix.lower() != ".csv":
            check_picture(history)
    for path in targets:
        check_writable(path)
    options = methods.options_from_text(methods.SOLVE, method, pairs(option, "--option"))
    if refine:
        if method == "exchange":
            raise InputError("--refine hands a population to exchange, which needs none; give --method pso or ga")
        options["refine"] = True
    with stopping() as stop:
        with console.progress("solving") as progress:
            solution = solving.solve(
                chosen, objective=objective, weights=weights, method=method, starts=starts, seed=seed, start=start,
                all_optima=all_optima, certify=certify, progress=progress, workers=workers, cluster=cluster, **options,
            )  # fmt: skip
        if chosen.levels is not None and solution.trajectory is not None:
            chosen = solution.trajectory.origin or chosen  # of the level that was reached
        try:  # what was found is shown whatever becomes of the files, and written whatever becomes of stdout
            _write(solution, chosen, output, plot, history, objective or next(iter(weights), None))
        finally:
            console.show(sheets.solution_sheet(chosen, solution), json)
        code = _outcome(solution)
        return console.interrupted(solution.interrupted) if stop.interrupted else code


@app.command()
@one_blas_thread
def payload(
    problem: ProblemName,
    along: Annotated[
        Path | None, typer.Option(metavar="TRAJECTORY", help="Along this trajectory (JSON), timing kept.")
    ] = None,
    max_time: Annotated[
        float | None, typer.Option(metavar="S", help="Of all trajectories within this time [s].")
    ] = None,
    set_: Fields = None,
    starts: Annotated[int, typer.Option(help="Random starts of the joint problem.", min=1, max=methods.MOST)] = 2,
    seed: Seed = 0,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the trajectory that carries it (JSON).")
    ] = None,
    json: AsJson = False,
) -> int:
    """Finds the largest payload (DLCC): for every time law, along a trajectory, or within a time.

    Example: ocp-traj payload hybrid-spline --max-time 6.19
    """
    from ocp_traj.api import payloads
    from ocp_traj.cli import sheets
    from ocp_traj.results.trajectory import Trajectory

    chosen = load_problem(problem, set_)
    if output is not None:
        check_writable(output)
        if along is None and max_time is None:
            raise InputError(
                "the bound for every time law has no trajectory to write; give --along or --max-time with -o"
            )
    trajectory = None if along is None else Trajectory.load(along)
    with stopping() as stop:
        with console.progress("payload") as progress:
            found = payloads.payload(
                chosen, trajectory=trajectory, max_time=max_time, starts=starts, seed=seed, progress=progress
            )
        try:
            if output is not None and found.trajectory is not None:
                console.say(f"trajectory: {found.trajectory.save(output)}")
        finally:
            console.show(sheets.payload_sheet(found), json)
        if stop.interrupted:
            return console.interrupted("" if found.solution is None else found.solution.interrupted)
        return DONE


def _write(
    solution: Solution, problem: Problem, output: Path | None, plot: Path | None, history: Path | None,
    objective: str | None,
) -> None:  # fmt: skip
    """Writes what was asked for of a solution, as far as there is one."""
    if solution.trajectory is None or solution.audit is None:
        return
    if output is not None:
        console.say(f"trajectory: {solution.trajectory.save(output)}")
    if plot is None and history is None:
        return
    from ocp_traj.io.plot import plot_trajectory  # Matplotlib is slow to import
    from ocp_traj.io.plot_convergence import save_history

    if plot is not None:
        console.say(f"picture: {plot_trajectory(solution.trajectory, problem.requirements, plot)}")
    if history is not None and solution.history is not None:
        followed = problem.objective(objective or problem.default_objective)  # a population has one objective
        quantity = f"{'minus ' if followed.sense == 'max' else ''}{followed.id} [{followed.unit}]"
        console.say(f"history: {save_history(solution.history, history, quantity)}")
    elif history is not None:
        console.say(f"history: {history} is not written; no population of this run has one")


def _outcome(solution: Solution) -> int:
    """Says how a solution is to be taken; the exit code of that."""
    from ocp_traj.transcription.nlp import Status

    if solution.trajectory is None or solution.audit is None:
        console.say(solution.explain())
        return NOT_PROVED
    if solution.certificate is not None:
        console.say(solution.certificate.explain())
    if solution.status is Status.FEASIBLE:
        console.say(f"feasible, not optimal: {solution.detail}")
    elif not solution.ok:
        console.say(f"{solution.status.value}: {solution.detail}")
    elif (steps := solution.detail.partition("; by levels: ")[2]) and steps.count(",") > 0:
        console.say(f"by levels: {steps}")
    return verdict(solution.audit, solution.ok and solution.moved)
