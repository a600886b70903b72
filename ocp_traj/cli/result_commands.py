"""Commands on what was found: proofs, files, pages, pictures, and what the papers report."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from ocp_traj.blas import one_blas_thread
from ocp_traj.cli import console
from ocp_traj.cli.app import DONE, NOT_PROVED, app
from ocp_traj.cli.arguments import AsJson, ProblemName, pairs
from ocp_traj.cli.verdict import verdict
from ocp_traj.errors import InputError
from ocp_traj.files import check_writable
from ocp_traj.solvers import methods


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
    return verdict(checked)


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
    options = asked | exports.options_from_text(format, pairs(option, "--option"))
    renamed = None if joints is None else pairs([part for part in joints.split(",") if part.strip()], "--joints")
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
def reproduce(
    problem: ProblemName,
    seeds: Annotated[
        int | None,
        typer.Option(
            help="Runs of stochastic methods; as many as the claims need if not given.", min=1, max=methods.MOST
        ),
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
