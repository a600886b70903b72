"""Commands that show problems and make task files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ocp_traj.blas import one_blas_thread
from ocp_traj.cli import console
from ocp_traj.cli.app import DONE, app
from ocp_traj.cli.arguments import AsJson, Fields, ProblemName, Seed, load_problem, pairs, task_of
from ocp_traj.errors import InputError, quoted
from ocp_traj.files import check_writable, write_text


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

    console.show(sheets.problem_sheet(load_problem(problem, set_)), json)


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
    from ocp_traj.formulation.task_starts import planned_path
    from ocp_traj.formulation.ways import OMPL, PLAN

    words = {"own": PLAN, "ompl": OMPL}
    if planner not in words:
        raise InputError(f"--planner is {quoted(planner)}; give {' or '.join(words)}")
    if output.suffix.lower() != ".csv":
        raise InputError(f"-o is {quoted(str(output))}; a path ends in .csv")
    check_writable(output)
    problem = load_problem(task, set_)
    if task_of(problem) is None:
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
    from ocp_traj.io.import_scene import import_scene

    if output.suffix.lower() != ".toml":
        raise InputError(f"-o is {quoted(str(output))}; a task file ends in .toml")
    check_writable(output)
    found = import_scene(scene, request, output, urdf=urdf, srdf=srdf, changes=pairs(set_, "--set"))
    write_text(output, found.text)
    console.show(sheets.import_sheet(found, output), json)
    for words in found.remarks:
        console.say(words)
    console.say(f"task: {output}")
    if found.to_fill:
        console.say(f"to fill in before it can be solved, no file holds them: {', '.join(found.to_fill)}")
    return DONE
