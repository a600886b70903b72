"""The command line: ``ocp-traj``, also ``python -m ocp_traj``.

Results go to stdout, as tables or, with ``--json``, as one JSON object; progress and messages go to stderr. Exit codes:
0 done and proved; 1 the result is infeasible, violated or undecided, or cannot be written; 2 wrong input, in one line;
130, 143 and 129 ended by Ctrl-C, SIGTERM and SIGHUP.

One of these signals ends ``solve``, ``pareto``, ``resume`` and ``payload`` within the time of an iteration of IPOPT or
of a generation: what has been found is shown and written, and one line on stderr says what was left undone. Any other
command, and the second signal anywhere, ends at once. No file is ever half written.

To import what solves, draws and proves takes seconds: each command imports what it needs, in its body.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup
from typer.exceptions import TyperException

from ocp_traj.blas import one_blas_thread
from ocp_traj.cli import console
from ocp_traj.errors import InputError, OcpTrajError, cut, quoted
from ocp_traj.files import LONGEST_PATH, check_writable, write_text
from ocp_traj.solvers import methods
from ocp_traj.stopping import stopping
from ocp_traj.version import __version__

if TYPE_CHECKING:
    from ocp_traj.formulation.problem import Problem
    from ocp_traj.formulation.task import Task
    from ocp_traj.proof.verdicts import Audit
    from ocp_traj.results.solution import Solution

DONE, NOT_PROVED, WRONG_INPUT = 0, 1, 2
MOST = methods.MOST
LONGEST_USAGE = 500  # of a message about options [characters]: our choice


class _Commands(TyperGroup):
    """The commands; one that is interrupted says so, which typer would not."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            return console.interrupted("before there was a result")


app = typer.Typer(
    cls=_Commands,
    add_completion=False,
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ProblemName = Annotated[
    str, typer.Argument(metavar="PROBLEM", help="Id of a problem, see `ocp-traj problems`, or a task file (TOML).")
]
Fields = Annotated[
    list[str] | None, typer.Option("--set", metavar="FIELD=VALUE", help="Change a field of the case; may be repeated.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
Options = Annotated[
    list[str] | None,
    typer.Option("--option", metavar="NAME=VALUE", help="Set an option of the method; may be repeated."),
]
WorkerCount = Annotated[
    int, typer.Option(metavar="N", help="Processes that solve; the result does not depend on how many.", min=0)
]
ClusterAddress = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="A Dask scheduler whose workers solve, such as tcp://host:8786.")
]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]


@app.callback()
def start(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> int:
    """Robot trajectories that are optimal and proved to keep every limit at every instant.

    Exit codes: 0 done and proved; 1 infeasible, violated, undecided, or not written; 2 wrong input; 130, 143, 129 ended
    by Ctrl-C, SIGTERM, SIGHUP, with what had been found until then.
    """
    if version:
        print(f"ocp-traj {__version__}")
        raise typer.Exit(DONE)
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(WRONG_INPUT)
    return DONE


@app.command("problems")
def list_problems(json: AsJson = False) -> None:
    """Lists the problems.

    Example: ocp-traj problems
    """
    from ocp_traj import problems
    from ocp_traj.cli import sheets

    console.show(sheets.problem_list([problems.summary(name) for name in problems.names()]), json)


@app.command()
def new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Task file to write (TOML).")],
    force: Annotated[bool, typer.Option(help="Replace an existing file.")] = False,
) -> None:
    """Writes a task file to begin with: a robot, a path and limits, every key explained; it solves as it stands.

    Example: ocp-traj new arm.toml
    """
    from ocp_traj.formulation.task_example import task_example

    if file.suffix.lower() != ".toml":
        raise InputError(f"a task file ends in .toml; {quoted(file.name)} does not")
    if file.exists() and not force:
        raise InputError(f"{file} is there already; give another name, or --force to replace it")
    console.say(f"task: {write_text(file, task_example())}\nnext: ocp-traj solve {file} -o t.json")


@app.command()
@one_blas_thread
def show(problem: ProblemName, set_: Fields = None, json: AsJson = False) -> None:
    """Shows a problem's variables, objectives and limits.

    Example: ocp-traj show hybrid-spline
    """
    from ocp_traj.cli import sheets

    console.show(sheets.problem_sheet(_load(problem, set_)), json)


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
        typer.Option(help="Random starts, the best counts; the problem's own number if not given.", min=1, max=MOST),
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
    from ocp_traj import api
    from ocp_traj.cli import sheets

    if plot is not None or history is not None:
        from ocp_traj.io.plot_style import check_picture

    weights = {name: _number(value, f"--weight {cut(name)}") for name, value in _pairs(weight, "--weight").items()}
    chosen = _load(problem, set_)
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
    options = methods.options_from_text(methods.SOLVE, method, _pairs(option, "--option"))
    if refine:
        if method == "exchange":
            raise InputError("--refine hands a population to exchange, which needs none; give --method pso or ga")
        options["refine"] = True
    with stopping() as stop:
        with console.progress("solving") as progress:
            solution = api.solve(
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
        typer.Option(help="Points to trace, or of hmoga to refine; 40 if not given.", min=2, max=MOST),
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

    chosen = _load(problem, set_)
    task = _task(chosen)
    front_table = None if task is None else task.objective.front
    if objectives is None:
        if front_table is None:
            more = ", or write front = { objectives = [..] } under [objective]" if task is not None else ""
            raise InputError(f"there are no objectives to trade; give --objectives A,B{more}")
        objectives = ",".join(front_table.objectives)
        points = points or front_table.points
    names = tuple(name.strip() for name in objectives.split(",") if name.strip())
    corners = [_point(text, names, what) for text, what in ((reference, "--reference"), (ideal, "--ideal"))]
    unbounded = [name for name in names if name not in chosen.reference_point]
    if corners[0] is None and unbounded and len(names) > 1:
        for name in names:
            chosen.objective(name)
        raise InputError(
            f"{chosen.id} has no reference point for {', '.join(unbounded)}; give --reference {objectives}"
        )
    options = methods.options_from_text(methods.FRONT, method, _pairs(option, "--option"))
    if points is not None:
        options["points"] = points
    if certify:
        require_front_certifiable(chosen, names)
    source = None if task is None else {"file": os.path.abspath(problem), "changes": _pairs(set_, "--set")}
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
    corners = [_point(text, traded, what) for text, what in ((reference, "--reference"), (ideal, "--ideal"))]
    fronts = {name: load_run(run) for name, run in zip(names, runs, strict=True)}
    compared, problem = compare_fronts(fronts, *corners), fronts[names[0]].problem
    if output is not None:
        console.say(f"picture: {plot_fronts(compared, problem, output)}")
    console.show(comparison_sheet(compared, problem.id), json)


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
    starts: Annotated[int, typer.Option(help="Random starts of the joint problem.", min=1, max=MOST)] = 2,
    seed: Seed = 0,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write the trajectory that carries it (JSON).")
    ] = None,
    json: AsJson = False,
) -> int:
    """Finds the largest payload (DLCC): for every time law, along a trajectory, or within a time.

    Example: ocp-traj payload hybrid-spline --max-time 6.19
    """
    from ocp_traj import api
    from ocp_traj.cli import sheets
    from ocp_traj.results.trajectory import Trajectory

    chosen = _load(problem, set_)
    if output is not None:
        check_writable(output)
        if along is None and max_time is None:
            raise InputError(
                "the bound for every time law has no trajectory to write; give --along or --max-time with -o"
            )
    trajectory = None if along is None else Trajectory.load(along)
    with stopping() as stop:
        with console.progress("payload") as progress:
            found = api.payload(
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


@app.command()
@one_blas_thread
def audit(
    trajectory: Annotated[Path, typer.Argument(metavar="TRAJECTORY", help="A trajectory file (JSON).")],
    limits: Annotated[
        Path | None, typer.Option(help="Limits to audit against (TOML); its own problem's if not given.")
    ] = None,
    allowance: Annotated[
        float | None, typer.Option(metavar="SHARE", help="Of each bound, by which it may be exceeded and still be met.")
    ] = None,
    json: AsJson = False,
) -> int:
    """Proves that a trajectory keeps its limits, or says where not.

    Example: ocp-traj audit fast.json
    """
    from ocp_traj.cli import sheets
    from ocp_traj.io.requirements_file import read_requirements
    from ocp_traj.proof.audit import audit as run_audit
    from ocp_traj.proof.verdicts import ALLOWANCE
    from ocp_traj.results.trajectory import Trajectory

    moved = Trajectory.load(trajectory)
    if limits is None:
        if allowance is not None:
            raise InputError("--allowance is for limits of a file; give --limits too, or leave it out")
        checked = moved.audit()
    else:
        allowed = ALLOWANCE if allowance is None else allowance
        checked = run_audit(moved, read_requirements(limits), allowance=allowed)
    if not checked.rows:
        raise InputError(f"{limits or moved.problem} asks nothing of {trajectory}: nothing is proved; give a limit")
    console.show(sheets.audit_sheet(checked, moved.posed if limits is None else None), json)
    return _verdict(checked)


@app.command()
@one_blas_thread
def reproduce(
    problem: ProblemName,
    seeds: Annotated[
        int | None,
        typer.Option(help="Runs of stochastic methods; as many as the claims need if not given.", min=1, max=MOST),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Write tables (CSV, Markdown) and figures to it."),
    ] = None,
    pictures: Annotated[
        str | None, typer.Option(metavar="png[,svg][,pdf]", help="How figures are written; png if not given.")
    ] = None,
    json: AsJson = False,
) -> int:
    """Puts a paper's tables and figures beside ours.

    Example: ocp-traj reproduce hybrid-spline -o runs/guo
    """
    from ocp_traj.cli import sheets
    from ocp_traj.reproductions.draft import ignore
    from ocp_traj.reproductions.folder import ReproductionFolder
    from ocp_traj.reproductions.reproduce import reproduce as run_reproduce
    from ocp_traj.reproductions.reproduce import require_known

    require_known(problem)
    folder = None
    if output is not None:
        kinds = [name.strip().lower() for name in ("png" if pictures is None else pictures).split(",")]
        folder = ReproductionFolder(output, tuple(name for name in kinds if name))
    elif pictures is not None:
        raise InputError("--pictures is of the figures in a folder; give -o FOLDER too")
    try:
        with console.progress("reproducing") as progress:
            keep = ignore if folder is None else folder.keep
            found = run_reproduce(problem, seeds=seeds, progress=progress, keep=keep)
    except BaseException as reason:
        left = folder is not None and folder.leave()
        if left and isinstance(reason, KeyboardInterrupt):
            return console.interrupted(f"before all was done; {output} has what was finished")
        raise
    console.show(sheets.reproduction_sheet(found), json)
    if folder is not None:
        console.say(f"written: {output}")
    return DONE


@app.command()
@one_blas_thread
def export(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="A run folder, a front.csv, or a trajectory.")],
    format: Annotated[
        str | None,
        typer.Option(
            help="csv, parquet, json; of a trajectory ros, urscript, krl, fanuc, bpoly too. Its task's if not given."
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="File to write; beside FILE if not given.")
    ] = None,
    samples: Annotated[int | None, typer.Option(help="Even instants of a table; 200 if not given.")] = None,
    at: Annotated[str | None, typer.Option(metavar="knots", help="Of a table: points at the curve's knots.")] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Points at a rate; at the curve's knots if not given.")
    ] = None,
    interpolation: Annotated[
        str | None, typer.Option(help="Of ros, what the controller is told: quintic, cubic or linear.")
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option(metavar="RAD", help="By which quintics may leave a curve of higher degree.")
    ] = None,
    joints: Annotated[str | None, typer.Option(metavar="A=B[,..]", help="Other names for joints.")] = None,
    limits: Annotated[
        Path | None, typer.Option(help="Limits to prove (TOML); those of the trajectory's problem if not given.")
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option("--option", metavar="NAME=VALUE", help="Another option of the format.")
    ] = None,
    json: AsJson = False,
) -> int:
    """Exports a front or a trajectory, and proves what a controller will make of it, where that is known.

    Example: ocp-traj export fast.json --format ros
    """
    from ocp_traj.cli import sheets
    from ocp_traj.io import export as exports
    from ocp_traj.io.requirements_file import read_requirements

    asked = {} if format is not None else exports.asked_by_task(source)
    if rate is not None or at is not None:  # in place of what the task has
        asked = {name: value for name, value in asked.items() if name not in ("at", "rate")}
    format = format or asked.pop("format")
    options = asked | exports.options_from_text(format, _pairs(option, "--option"))
    renamed = None if joints is None else _pairs([part for part in joints.split(",") if part.strip()], "--joints")
    flags = (samples, at, rate, interpolation, tolerance, renamed)
    options |= {name: value for name, value in zip(exports.FLAGS, flags, strict=True) if value is not None}
    place = source if source.name else Path(os.path.realpath(source))  # `.` has no name of its own, and `/` has none
    if output is None and not place.name:
        raise InputError(f"{source} has no name to call a file by; give one with -o")
    target = output or place.with_name(place.stem + exports.SUFFIXES.get(format, f".export.{format}"))
    wanted = None if limits is None else read_requirements(limits)
    found = exports.export(source, format, target, limits=wanted, **options)
    console.show(sheets.export_sheet(found), json)
    for path in found.paths:
        console.say(f"written: {path}")
    if "verdict" in found.about:
        console.say(found.about["verdict"])
    return DONE if found.proved else NOT_PROVED


@app.command()
@one_blas_thread
def report(
    sources: Annotated[
        list[Path], typer.Argument(metavar="RUN|TRAJECTORY..", help="Run folders and trajectory files, shown together.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="HTML", help="The page to write.")] = Path(
        "report.html"
    ),
    json: AsJson = False,
) -> int:
    """Writes a page to look at a front and its motions: one HTML file that opens offline (extra `report`).

    Example: ocp-traj report runs/first -o front.html
    """
    from ocp_traj.cli.report_sheet import report_sheet
    from ocp_traj.report.page import check_page, write_page
    from ocp_traj.report.sources import read_sources

    check_page(output)
    check_writable(output)
    found = read_sources(sources)
    written = write_page(found, output)
    console.show(report_sheet(found, written), json)
    console.say(f"report: {written}")
    return DONE if all(point.audit.proved for source in found for point in source.points) else NOT_PROVED


@app.command()
@one_blas_thread
def plot(
    sources: Annotated[
        list[Path],
        typer.Argument(metavar="RUN|TRAJECTORY|HISTORY..", help="Run folders, trajectories, or histories (CSV)."),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PICTURE", help="PNG, SVG or PDF, by its ending.")],
) -> None:
    """Draws a front, several fronts, trajectories against their limits, or how populations converged.

    Example: ocp-traj plot runs/first -o front.pdf
    """
    from ocp_traj.cli.pictures import draw
    from ocp_traj.io.plot_style import check_picture

    check_picture(output)
    check_writable(output)
    console.say(f"picture: {draw(sources, output)}")


@app.command()
@one_blas_thread
def plan(
    task: Annotated[str, typer.Argument(metavar="TASK", help="A task file (TOML) with [collision].")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PATH", help="The path to write (CSV).")],
    planner: Annotated[str, typer.Option(help="own, or ompl, of the extra plan.")] = "own",
    set_: Fields = None,
    seed: Seed = 0,
    json: AsJson = False,
) -> int:
    """Plans a path past a task's obstacles, for [solve] start: points in joint space, shortened, and no proof.

    Example: ocp-traj plan task.toml -o path.csv
    """
    from ocp_traj.cli import sheets
    from ocp_traj.files import write_text
    from ocp_traj.formulation.task_starts import planned_path
    from ocp_traj.formulation.ways import OMPL, PLAN

    words = {"own": PLAN, "ompl": OMPL}
    if planner not in words:
        raise InputError(f"--planner is {quoted(planner)}; give {' or '.join(words)}")
    if output.suffix.lower() != ".csv":
        raise InputError(f"-o is {quoted(str(output))}; a path ends in .csv")
    check_writable(output)
    problem = _load(task, set_)
    if _task(problem) is None:
        raise InputError(f"{problem.id} is no task file; a path is planned past the obstacles of one")
    path = planned_path(problem, words[planner], seed)
    lines = [",".join(problem.robot.joints), *(",".join(map(repr, point)) for point in path.tolist())]
    write_text(output, "\n".join(lines) + "\n")
    console.show(sheets.plan_sheet(path, problem.robot.joints, output), json)
    console.say(f"path: {output}")
    return DONE


@app.command("import")
def import_(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="A MoveIt planning scene (YAML).")],
    request: Annotated[Path, typer.Argument(metavar="REQUEST", help="A MoveIt motion plan request (YAML).")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="TASK", help="The task file to write (TOML).")],
    urdf: Annotated[Path | None, typer.Option(help="The robot's URDF.")] = None,
    srdf: Annotated[Path | None, typer.Option(help="Its SRDF: which links may touch each other.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PLACE=VALUE", help="A value of the task, such as limits.acceleration=8."),
    ] = None,
    json: AsJson = False,
) -> int:
    """Makes a task of a MoveIt planning scene and a request.

    Example: ocp-traj import scene.yaml request.yaml --urdf arm.urdf --set limits.jerk=60 -o task.toml
    """
    from ocp_traj.cli import sheets
    from ocp_traj.files import write_text
    from ocp_traj.io.import_scene import import_scene

    if output.suffix.lower() != ".toml":
        raise InputError(f"-o is {quoted(str(output))}; a task file ends in .toml")
    check_writable(output)
    found = import_scene(scene, request, output, urdf=urdf, srdf=srdf, changes=_pairs(set_, "--set"))
    write_text(output, found.text)
    console.show(sheets.import_sheet(found, output), json)
    for words in found.remarks:
        console.say(words)
    console.say(f"task: {output}")
    if found.to_fill:
        console.say(f"to fill in before it can be solved, no file holds them: {', '.join(found.to_fill)}")
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
    return _verdict(solution.audit, solution.ok and solution.moved)


def _load(name: str, assignments: Sequence[str] | None) -> Problem:
    from ocp_traj import problems

    changes = _pairs(assignments, "--set")
    if name.lower().endswith(".toml"):
        if "file" in changes:
            raise InputError("--set file is no place in a task; give one such as robot.payload.mass")
        problem = problems.load("task", file=name, **changes)
        _check_export(problem.case, name)
        return problem
    return problems.load(name, **changes)


def _check_export(task: Task, file: str) -> None:
    """Refuses a wrong ``[export]`` before there is anything to export."""
    if task.export is None:
        return
    from ocp_traj.formulation.task_file import told
    from ocp_traj.io.export import check_table

    try:
        check_table(task.export)
    except InputError as error:
        raise told(error, task.name, file) from error


def _task(problem: Problem) -> Task | None:
    """The task a problem is made from, if it is."""
    from ocp_traj.formulation.task import Task

    return problem.case if isinstance(problem.case, Task) else None


def _pairs(assignments: Sequence[str] | None, option: str) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for text in assignments or ():
        name, equals, value = text.partition("=")
        if not (equals and name.strip() and value.strip()):
            hint = f"; an empty list is written {cut(name.strip())}=none" if equals and name.strip() else ""
            raise InputError(f"{option} {quoted(text)} is not NAME=VALUE{hint}")
        if name.strip() in pairs:
            raise InputError(f"{option} gives {quoted(name.strip())} twice; give it once")
        pairs[name.strip()] = value.strip()
    return pairs


def _number(text: str, what: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{what} is {quoted(text)}; give a number") from error


def _point(text: str | None, names: Sequence[str], option: str) -> dict[str, float] | None:
    if text is None:
        return None
    numbers = [_number(part, option) for part in text.split(",")]
    if not all(isfinite(number) for number in numbers):
        raise InputError(f"{option} is {quoted(text)}; give finite numbers")
    if len(numbers) != len(names):
        raise InputError(f"{option} has {len(numbers)} numbers; give one for each of {', '.join(names)}")
    return dict(zip(names, numbers, strict=True))


def _verdict(checked: Audit, solved: bool = True) -> int:
    console.say(checked.explain())
    return DONE if checked.proved and solved else NOT_PROVED


def run(arguments: Sequence[str] | None = None) -> int:
    """Runs a command line and returns its exit code; errors become one line on stderr."""
    try:
        code = _run(arguments)
        if sys.stdout is not None:
            sys.stdout.flush()  # else Python finds at exit that it cannot, with a traceback
    except OSError as error:
        if error.filename is not None:
            console.say(f"error: {cut(str(error.filename), LONGEST_PATH)}: {error.strerror}")
            return WRONG_INPUT
        sys.stdout = open(os.devnull, "w")  # what could not be written is not tried again at exit
        console.say(f"error: cannot write the result: {error.strerror or error}")
        return NOT_PROVED
    return code


def _run(arguments: Sequence[str] | None) -> int:
    command: Callable[..., Any] = typer.main.get_command(app)
    try:
        result = command(
            args=None if arguments is None else list(arguments), prog_name="ocp-traj", standalone_mode=False
        )
    except OcpTrajError as error:
        code = WRONG_INPUT if isinstance(error, InputError) else NOT_PROVED
        if "--json" in (sys.argv[1:] if arguments is None else arguments):
            console.show(
                console.Sheet({"error": cut(str(error), console.LONGEST_MESSAGE), "exit_code": code}, []), json=True
            )
        console.say(f"error: {error}")
        return code
    except typer.Exit as stop:
        return int(stop.exit_code)
    except MemoryError:
        console.say("error: this machine has not enough memory for that; ask for less")
        return NOT_PROVED
    except TyperException as error:  # of options and arguments
        words = error.format_message()
        if words:
            console.say(f"error: {cut(' '.join(words.split()), LONGEST_USAGE)}; see ocp-traj --help")
        return WRONG_INPUT
    return result if isinstance(result, int) else DONE
