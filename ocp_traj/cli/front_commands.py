"""Commands that trace, go on with and compare fronts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from ocp_traj.blas import one_blas_thread
from ocp_traj.cli import console
from ocp_traj.cli.app import DONE, app
from ocp_traj.cli.arguments import (
    AsJson,
    ClusterAddress,
    Fields,
    Options,
    ProblemName,
    Seed,
    WorkerCount,
    load_problem,
    pairs,
    point,
    task_of,
)
from ocp_traj.errors import InputError
from ocp_traj.files import check_writable
from ocp_traj.solvers import methods
from ocp_traj.stopping import stopping


@app.command()
@one_blas_thread
def pareto(
    problem: ProblemName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN", help="Folder to write the run to.")],
    objectives: Annotated[
        str | None, typer.Option(metavar="A,B[,..]", help="Objectives to trade; those of a task's front if not given.")
    ] = None,
    method: Annotated[str, typer.Option(help=f"One of: {', '.join(methods.FRONT)}.")] = "trace",
    option: Options = None,
    points: Annotated[
        int | None,
        typer.Option(help="Points to trace, or of hmoga to refine; 40 if not given.", min=2, max=methods.MOST),
    ] = None,
    set_: Fields = None,
    seed: Seed = 0,
    budget: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Stop after this time with what is there.")
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(metavar="A,B[,..]", help="Reference point of the hypervolume; the problem's own if not given."),
    ] = None,
    ideal: Annotated[
        str | None,
        typer.Option(metavar="A,B[,..]", help="Ideal point of the hypervolume; the problem's own if not given."),
    ] = None,
    keep_unproved: Annotated[bool, typer.Option(help="Keep points that are not proved.")] = False,
    workers: WorkerCount = 0,
    cluster: ClusterAddress = None,
    certify: Annotated[
        bool, typer.Option("--certify", help="Bound what the front leaves out, in a minute at most, where it can be.")
    ] = False,
    force: Annotated[bool, typer.Option(help="Replace an existing run.")] = False,
    json: AsJson = False,
) -> int:
    """Traces a Pareto front, every point proved.

    Example: ocp-traj pareto hybrid-spline --objectives time,energy -o runs/a
    """
    from ocp_traj.cli import fronts
    from ocp_traj.io.store import Run, request
    from ocp_traj.parallel.choice import workers_for
    from ocp_traj.solvers.front_certifier import require_front_certifiable

    chosen = load_problem(problem, set_)
    task = task_of(chosen)
    front_table = None if task is None else task.objective.front
    if objectives is None:
        if front_table is None:
            more = ", or write front = { objectives = [..] } under [objective]" if task is not None else ""
            raise InputError(f"there are no objectives to trade; give --objectives A,B{more}")
        objectives = ",".join(front_table.objectives)
        points = points or front_table.points
    names = tuple(name.strip() for name in objectives.split(",") if name.strip())
    corners = [point(text, names, what) for text, what in ((reference, "--reference"), (ideal, "--ideal"))]
    unbounded = [name for name in names if name not in chosen.reference_point]
    if corners[0] is None and unbounded and len(names) > 1:
        for name in names:
            chosen.objective(name)
        raise InputError(
            f"{chosen.id} has no reference point for {', '.join(unbounded)}; give --reference {objectives}"
        )
    options = methods.options_from_text(methods.FRONT, method, pairs(option, "--option"))
    if points is not None:
        options["points"] = points
    if certify:
        require_front_certifiable(chosen, names)
    source = None if task is None else {"file": os.path.abspath(problem), "changes": pairs(set_, "--set")}
    asked = request(
        chosen, names, method, seed=seed, budget=budget, keep_unproved=keep_unproved, certify=certify,
        options=options, corners=corners, task=source,
    )  # fmt: skip
    with workers_for(chosen, workers, cluster) as hands, stopping() as stop:
        with Run(output, asked, force=force) as kept:
            return fronts.trace(chosen, asked, kept, hands, stop, json)


@app.command()
@one_blas_thread
def resume(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="The folder of a run that was stopped.")],
    workers: WorkerCount = 0,
    cluster: ClusterAddress = None,
    json: AsJson = False,
) -> int:
    """Goes on with a front that was stopped, to the front of a run that was not.

    Example: ocp-traj resume runs/a
    """
    from ocp_traj.cli import fronts
    from ocp_traj.io.resume import is_finished, resume_run
    from ocp_traj.parallel.choice import workers_for

    if is_finished(run):
        console.say(f"{run} has ended by itself; there is nothing left to do")
        return DONE
    found = resume_run(run)
    with found.run as kept:
        fronts.say_of(found)
        with workers_for(found.problem, workers, cluster, found.known) as hands, stopping() as stop:
            return fronts.trace(found.problem, found.asked, kept, hands, stop, json, found.budget)


@app.command()
@one_blas_thread
def compare(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN RUN ..", help="Run folders of one problem and case.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Draw all fronts here (PNG, PDF or SVG).")
    ] = None,
    reference: Annotated[
        str | None, typer.Option(metavar="A,B[,..]", help="Reference point of all; the problem's own if not given.")
    ] = None,
    ideal: Annotated[
        str | None, typer.Option(metavar="A,B[,..]", help="Ideal point of all; the problem's own if not given.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Compares the fronts of runs, with one reference and one ideal for all.

    Example: ocp-traj compare runs/a runs/b -o both.png
    """
    from ocp_traj.cli.comparison_sheet import comparison_sheet
    from ocp_traj.io.run_reader import load_run, read_manifest
    from ocp_traj.results.front_comparison import compare_fronts, require_alike

    if output is not None:
        from ocp_traj.io.plot_fronts import plot_fronts
        from ocp_traj.io.plot_style import check_picture

        check_picture(output)
        check_writable(output)
    names = [str(run) for run in runs]
    if len(set(names)) < len(names):
        raise InputError(f"{', '.join(names)} name one run twice; give each once")
    asked = dict(zip(names, map(read_manifest, runs), strict=True))
    require_alike(asked)
    traded = tuple(asked[names[0]]["objectives"])
    corners = [point(text, traded, what) for text, what in ((reference, "--reference"), (ideal, "--ideal"))]
    fronts = {name: load_run(run) for name, run in zip(names, runs, strict=True)}
    compared, problem = compare_fronts(fronts, *corners), fronts[names[0]].problem
    if output is not None:
        console.say(f"picture: {plot_fronts(compared, problem, output)}")
    console.show(comparison_sheet(compared, problem.id), json)
